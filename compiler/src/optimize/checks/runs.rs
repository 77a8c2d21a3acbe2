//! Simulations from event to event with other controls and initial values, which keep what they compile.
//!
//! Controls are data, and initial values and parameters that stay open are numbers of a run; free parameters are compiled
//! in, and so are the instants within a horizon that no step passes over.

use std::cell::RefCell;

use super::solved;
use crate::limit::Limit;
use crate::optimize::Problem;
use crate::report::Trajectory;
use crate::simulate::again::Again;
use crate::simulate::{Plan, ReferenceRun, Request};
use crate::system::System;
use crate::system::experiment::Settings;

/// How accurate differences of runs are.
const TOLERANCE: f64 = 1e-11;
/// Runs to a free horizon are compiled for one that is longer by this factor, and serve down to a share of that.
const LONGER: f64 = 1.25;
const LEAST_SHARE: f64 = 0.5;

/// What has been compiled of the system of a problem.
#[derive(Default)]
pub(crate) struct Runs<'e> {
    events: RefCell<Option<Kept<Plan<'e>>>>,
    again: RefCell<Option<Kept<Again>>>,
    /// With controls that are numbers.
    constant: RefCell<Option<Plan<'e>>>,
}

/// Runs with these parameters, to no longer horizon.
struct Kept<T> {
    params: Vec<f64>,
    horizon: f64,
    runs: T,
}

/// What is kept for the parameters of a point and a horizon, or made for them.
fn ready<'k, T>(
    kept: &'k mut Option<Kept<T>>,
    problem: &Problem,
    (w, horizon): (&[f64], f64),
    make: impl FnOnce(f64) -> T,
) -> &'k mut T {
    let params = problem.at(w).params();
    let serves = |kept: &Kept<T>| {
        let share = horizon / kept.horizon;
        kept.params == params && (LEAST_SHARE..=1.0).contains(&share)
    };
    let known = kept.take().filter(serves);
    let ready = known.unwrap_or_else(|| {
        let longest = match problem.layout.horizon() {
            Some(_) => LONGER * horizon,
            None => horizon,
        };
        Kept {
            params,
            horizon: longest,
            runs: make(longest),
        }
    });
    &mut kept.insert(ready).runs
}

impl<'e> Problem<'e> {
    /// A run of the system at a point, which has neither outputs nor controls to report.
    pub(crate) fn simulate(
        &self,
        (system, w): (&System<'e>, &[f64]),
        settings: &Settings<'e>,
        request: &Request,
    ) -> Trajectory {
        let mut kept = self.runs.events.borrow_mut();
        let events = self.events(&mut kept, (system, w), settings);
        events.run(system, settings, request, &mut |_| {})
    }

    /// The same with the modes that it goes through.
    pub(crate) fn reference_run(
        &self,
        (system, w): (&System<'e>, &[f64]),
        settings: &Settings<'e>,
        limit: &Limit,
    ) -> ReferenceRun<'e> {
        let mut kept = self.runs.events.borrow_mut();
        let events = self.events(&mut kept, (system, w), settings);
        events.reference(system, settings, limit)
    }

    /// A run over the horizon of a system whose controls are parameters of its own.
    pub(crate) fn constant_run(&self, system: &System<'e>, limit: &Limit) -> ReferenceRun<'e> {
        let mut kept = self.runs.constant.borrow_mut();
        let plan = kept.get_or_insert_with(|| Plan::open(system, &self.settings, &self.open));
        plan.reference(system, &self.settings, limit)
    }

    /// Makes runs with the parameters and about the horizon of a point ready.
    pub(crate) fn run_again(&self, w: &[f64]) {
        let mut kept = self.runs.again.borrow_mut();
        let again = ready(&mut kept, self, (w, self.at(w).horizon()), |horizon| {
            Again::new(&solved::system(self, w), horizon, TOLERANCE, &self.open)
        });
        again.set_parameters(&self.system.values_of(&self.open));
    }

    /// What is asked of those, with the parameters of another point.
    pub(crate) fn again<R>(&self, w: &[f64], ask: impl FnOnce(&mut Again) -> R) -> R {
        let mut kept = self.runs.again.borrow_mut();
        let params = self.at(w).params();
        match kept.as_mut().filter(|kept| kept.params == params) {
            Some(kept) => ask(&mut kept.runs),
            // Parameters are numbers in what is compiled.
            None => {
                let system = solved::system(self, w);
                let horizon = self.at(w).horizon();
                ask(&mut Again::new(&system, horizon, TOLERANCE, &self.open))
            }
        }
    }

    fn events<'k>(
        &self,
        kept: &'k mut Option<Kept<Plan<'e>>>,
        (system, w): (&System<'e>, &[f64]),
        settings: &Settings<'e>,
    ) -> &'k mut Plan<'e> {
        ready(kept, self, (w, settings.horizon), |horizon| {
            let mut longest = settings.clone();
            longest.horizon = horizon;
            Plan::open(system, &longest, &self.open)
        })
    }
}
