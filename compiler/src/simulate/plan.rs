//! The method of an experiment, with what is compiled of its system before it runs.

use super::{Events, Progress, Request, adaptive, fesd, frozen, moreau};
use crate::report::Trajectory;
use crate::system::System;
use crate::system::experiment::{Method, Settings};

/// A system that is ready to be run, again and again with other seeds.
pub enum Plan {
    /// From event to event.
    Events(Box<Events>),
    /// By methods that compile as they run.
    Other,
}

impl Plan {
    /// Compiles a system for the method of an experiment.
    pub fn new(system: &System, settings: &Settings) -> Self {
        assert!(
            system.impulsive.is_empty() || settings.steps_through_contacts(),
            "contacts without forces are for steps of time"
        );
        match settings.method {
            Method::Fesd(_) | Method::Timestepping(_) | Method::Adaptive => Plan::Other,
            _ if settings.freezes() => Plan::Other,
            _ => Plan::Events(Box::new(Events::new(system, settings, &[]))),
        }
    }

    /// Integrates the system over the horizon of the experiment, and calls `watch` every few steps.
    pub fn run(
        &mut self,
        system: &System,
        settings: &Settings,
        request: &Request,
        watch: &mut dyn FnMut(Progress),
    ) -> Trajectory {
        if let Plan::Events(events) = self {
            return events.run(system, settings, request, watch);
        }
        if settings.freezes() {
            return frozen::run(system, settings, request, watch);
        }
        match &settings.method {
            // Without contacts there are no impulses to take.
            Method::Fesd(options) if settings.takes_impulses() && !system.contacts.is_empty() => {
                fesd::impulses::run(system, settings, options, request, watch)
            }
            Method::Fesd(options) => fesd::run(system, settings, options, request, watch),
            Method::Timestepping(options) if !system.impulsive.is_empty() => {
                moreau::run(system, settings, options, request, watch)
            }
            Method::Timestepping(options) => {
                fesd::stepping::run(system, settings, options, request, watch)
            }
            _ => adaptive::run(system, settings, request, watch),
        }
    }
}
