//! The method of an experiment, with what is compiled of its system before it runs.

mod adaptive;
mod events;
pub mod fesd;
mod frozen;
pub mod moreau;
mod smoothed;

use std::sync::Arc;

use adaptive::Adaptive;
use events::Events;
pub(crate) use events::solver_settings;
use fesd::ByElements;
use fesd::impulses::WithImpulses;
use fesd::stepping::Stepping;
use frozen::InNumericalTime;
use moreau::Contacts;

use super::driver::{self, Run};
use super::reported::Reported;
use super::{Progress, Request};
use crate::report::Trajectory;
use crate::system::System;
use crate::system::experiment::{Method, Settings};

/// A system that is ready to be run, again and again with other seeds and initial states.
pub struct Plan<'e> {
    run: Box<dyn Run<'e> + 'e>,
    reported: Arc<Reported>,
}

impl<'e> Plan<'e> {
    /// Compiles a system for the method of an experiment.
    pub fn new(system: &System<'e>, settings: &Settings<'e>) -> Self {
        Plan {
            run: of(system, settings),
            reported: Arc::new(Reported::new(system, &[])),
        }
    }

    /// Compiles a system for runs from event to event, with some parameters open, by their numbers.
    pub(crate) fn open(system: &System<'e>, settings: &Settings<'e>, open: &[usize]) -> Self {
        Plan {
            run: Box::new(Events::new(system, settings, open)),
            reported: Arc::new(Reported::new(system, open)),
        }
    }

    /// Integrates the system, which may have other initial states, data and values of open parameters than the one that was
    /// compiled, over the horizon of the experiment, and calls `watch` every few steps.
    pub fn run(
        &mut self,
        system: &System<'e>,
        settings: &Settings<'e>,
        request: &Request,
        watch: &mut dyn FnMut(Progress),
    ) -> Trajectory {
        let of = (system, settings);
        driver::drive(&mut *self.run, of, &self.reported, request, watch)
    }
}

/// The method of an experiment.
pub(super) fn of<'e>(system: &System<'e>, settings: &Settings<'e>) -> Box<dyn Run<'e> + 'e> {
    assert!(
        system.impulsive.is_empty() || settings.steps_through_contacts(),
        "contacts without forces are for steps of time"
    );
    // Without contacts there are no impulses to take.
    let impulses = settings.takes_impulses() && !system.contacts.is_empty();
    match settings.method {
        Method::Adaptive => Box::new(Adaptive::new(system, settings)),
        Method::Timestepping(_) if !system.impulsive.is_empty() => {
            Box::new(Contacts::new(system, settings))
        }
        Method::Timestepping(_) => Box::new(Stepping::new(system, settings)),
        _ if settings.freezes() => Box::new(InNumericalTime::new(system, settings)),
        Method::Fesd(_) if impulses => Box::new(WithImpulses::new(system, settings)),
        Method::Fesd(_) => Box::new(ByElements::new(system, settings)),
        Method::Auto | Method::Event(_) | Method::Smoothing(_) => {
            Box::new(Events::new(system, settings, &[]))
        }
    }
}
