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
use super::{Progress, Request};
use crate::report::Trajectory;
use crate::simulate::record::reported::Reported;
use crate::source::table::Table;
use crate::system::System;
use crate::system::experiment::{Lowering, Method, MethodKind, Settings};

/// A system that is ready to be run, again and again with other seeds and initial states.
pub struct Plan<'e> {
    run: Box<dyn Run<'e> + 'e>,
    reported: Arc<Reported>,
    /// The parameters that stay open, by their numbers.
    open: Vec<usize>,
    made: Made,
}

/// The numbers that a system was compiled with, and for which method.
struct Made {
    x0: Vec<f64>,
    params: Vec<f64>,
    tables: Vec<Arc<Table>>,
    horizon: f64,
    method: MethodKind,
    lowerings: Vec<Lowering>,
}

impl Made {
    fn of(system: &System, settings: &Settings) -> Self {
        Made {
            x0: system.states.iter().map(|state| state.initial).collect(),
            params: system.params.iter().map(|param| param.value).collect(),
            tables: system.data.iter().map(|data| data.table.clone()).collect(),
            horizon: settings.horizon,
            method: settings.method.kind(),
            lowerings: settings.lowerings.clone(),
        }
    }

    /// Whether parameters that do not stay open are the same.
    fn has_params(&self, other: &Self, open: &[usize]) -> bool {
        let mut pairs = self.params.iter().zip(&other.params).enumerate();
        let same = pairs.all(|(at, (a, b))| a == b || open.contains(&at));
        same && self.params.len() == other.params.len()
    }

    /// Whether starts, signals and the method are the same.
    fn is_like(&self, other: &Self) -> bool {
        let mut tables = self.tables.iter().zip(&other.tables);
        self.x0 == other.x0
            && tables.all(|(a, b)| Arc::ptr_eq(a, b))
            && self.horizon == other.horizon
            && self.method == other.method
            && self.lowerings == other.lowerings
    }
}

impl<'e> Plan<'e> {
    /// Compiles a system for the method of an experiment.
    pub fn new(system: &System<'e>, settings: &Settings<'e>) -> Self {
        Plan::by(of(system, settings), system, settings, &[])
    }

    /// Compiles a system for runs from event to event, with some parameters open, by their numbers.
    pub(crate) fn open(system: &System<'e>, settings: &Settings<'e>, open: &[usize]) -> Self {
        let events = Events::new(system, settings, open);
        Plan::by(Box::new(events), system, settings, open)
    }

    fn by(
        run: Box<dyn Run<'e> + 'e>,
        system: &System<'e>,
        settings: &Settings<'e>,
        open: &[usize],
    ) -> Self {
        Plan {
            run,
            reported: Arc::new(Reported::new(system, open)),
            open: open.to_vec(),
            made: Made::of(system, settings),
        }
    }

    /// Integrates the system, which may have other numbers than when it was compiled, over the horizon of the experiment,
    /// and calls `watch` every few steps. What was compiled in and is another number now is compiled again.
    pub fn run(
        &mut self,
        system: &System<'e>,
        settings: &Settings<'e>,
        request: &Request,
        watch: &mut dyn FnMut(Progress),
    ) -> Trajectory {
        let now = Made::of(system, settings);
        let serves = self.made.has_params(&now, &self.open)
            && match self.run.takes_numbers() {
                true => now.horizon <= self.made.horizon,
                false => self.made.is_like(&now),
            };
        if !serves {
            *self = match self.run.takes_numbers() {
                true => Plan::open(system, settings, &self.open),
                false => Plan::new(system, settings),
            };
        }
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
