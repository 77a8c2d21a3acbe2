//! Contacts by finite elements with jumps between them (FESD-J).
//!
//! Each step of the grid is the program of an optimal control problem with nothing to control: elements, impulses where
//! they meet, and complementarity (Nurkanović, Frey, Pozharskiy & Diehl 2024). It is made once for each number of
//! elements, and started from any instant and state. A run from event to event says which branch of it is solved first,
//! and in which elements contacts stay closed, where the rates of their gaps vanish at the nodes, too (`lowering/dcs/drift.rs`);
//! then the relaxed program is solved, and then one with more elements: a step with r switches and impacts needs r + 1.
//! What is found satisfies all equations and signs; gaps are looked at between the nodes, too.

mod compare;
mod program;

use nsd_solver::event::Observer;
use nsd_solver::fesd::jumps;
use nsd_solver::fesd::jumps::{Grid, Reached, Reference, Simulator};
use nsd_solver::hybrid::{Outcome, Status};

use super::{counted, method, options};
use crate::lowering::dcs;
use crate::lowering::dcs::Dcs;
use crate::lowering::mpcc::Program;
use crate::report::{Failure, Method, Trajectory};
use crate::simulate::driver::{Accuracy, Ended, Problem, Run};
use crate::simulate::estimate::{Comparison, Estimate, Estimator};
use crate::simulate::outcome;
use crate::simulate::record::modes::ModeNames;
use crate::system::System;
use crate::system::experiment::{FesdOptions, Settings};

/// Steps where the experiment does not say how many.
const STEPS: usize = 50;
/// Steps at most where the tolerance chooses them.
const MOST_STEPS: usize = 400;

/// A system with impulses, and the branch of its steps by events.
pub(in crate::simulate) struct WithImpulses<'e> {
    dcs: Dcs<'e>,
    runs: Simulator<Program>,
    reference: Option<Reference>,
    /// What the last runs on a grid, and on a finer one, have come to.
    coarse: Option<Reached>,
    fine: Option<Reached>,
}

impl<'e> WithImpulses<'e> {
    /// Lowers a system, with some parameters open, by their numbers.
    pub fn new(system: &System<'e>, settings: &Settings<'e>, open: &[usize]) -> Self {
        let dcs = lowered(system, settings);
        let of = (settings.horizon, options(settings));
        WithImpulses {
            runs: Simulator::new(program::plain(system, &dcs, of, open)),
            dcs,
            reference: None,
            coarse: None,
            fine: None,
        }
    }
}

/// The lowering that an experiment asks for.
fn lowered<'e>(system: &System<'e>, settings: &Settings<'e>) -> Dcs<'e> {
    let dcs = dcs::lower(system, &settings.numerics.lowerings);
    dcs.expect("compilation has checked that the system can be lowered")
}

/// A system with impulses where elements meet as plain data: all programs of its steps, with some parameters open, by their
/// numbers. Runs of it make nothing.
///
/// # Panics
///
/// Where the experiment is not one of `lower impact`.
pub fn prepared(system: &System, settings: &Settings, open: &[usize]) -> jumps::System<Program> {
    let (dcs, options) = (lowered(system, settings), options(settings));
    let mut plain = program::plain(system, &dcs, (settings.horizon, options), open);
    let mut make = |elements| program::program(system, &dcs, options, elements);
    plain.prepare(options.elements, &mut make);
    plain
}

/// The grid of the first run of an experiment.
pub(crate) fn first_grid(settings: &Settings) -> Grid {
    grid(settings, Accuracy::of(settings))
}

/// The grid of an attempt.
fn grid(settings: &Settings, accuracy: Accuracy) -> Grid {
    let (options, more) = (options(settings), usize::from(accuracy.is_finer));
    Grid {
        horizon: settings.horizon,
        steps: steps(options, accuracy.attempt) << more,
        // With as many elements, twice as many steps could cut an interval between two events as before.
        elements: options.elements + more,
    }
}

/// The steps of an attempt.
fn steps(options: &FesdOptions, attempt: usize) -> usize {
    options.steps.unwrap_or(STEPS << (attempt - 1))
}

impl<'e> Run<'e> for WithImpulses<'e> {
    /// The finer run has twice as many steps, each of one element more.
    fn march(
        &mut self,
        problem: &Problem<'_, 'e>,
        accuracy: Accuracy,
        observer: &mut dyn Observer,
    ) -> Ended {
        let Problem {
            system,
            settings,
            limit,
            x0,
            ..
        } = problem;
        if accuracy.attempt == 1 && !accuracy.is_finer {
            self.runs
                .set_parameters(&system.values_of(self.runs.open()));
            self.reference = None;
        }
        let (runs, dcs) = (&mut self.runs, &self.dcs);
        let reference =
            (self.reference).get_or_insert_with(|| runs.follow(settings.horizon, x0, limit));
        let mut make = |elements| program::program(system, dcs, options(settings), elements);
        let grid = grid(settings, accuracy);
        let reached = runs.run(grid, x0, (reference, limit), &mut make, observer);
        let outcome = reached.outcome();
        let failed = Outcome {
            time: reached.at,
            ..outcome.clone()
        };
        let failure = outcome::failure(system, &ModeNames::new(system), &failed, settings);
        let last = match accuracy.is_finer {
            false => &mut self.coarse,
            true => &mut self.fine,
        };
        *last = Some(reached);
        Ended { outcome, failure }
    }

    fn describe(&self, problem: &Problem<'_, 'e>, _: &Ended) -> Method {
        let coarse = self.coarse.as_ref();
        let lowering = format!("impact, {}", self.dcs.lowering.formulation);
        let steps = coarse.map(|run| run.grid.steps);
        let method = method(problem.settings, None, &lowering, steps);
        counted(
            method,
            [("added_elements", coarse.map_or(0, |run| run.added))],
        )
    }

    fn estimator(&self, settings: &Settings<'e>) -> Estimator {
        Estimator::of_elements(settings)
    }

    fn compares(&self, ended: &Ended) -> bool {
        ended.is_solved()
    }

    fn takes_numbers(&self) -> bool {
        true
    }

    fn estimate(
        &mut self,
        _: &Problem<'_, 'e>,
        _: &Comparison,
        [_, finer]: [&Ended; 2],
    ) -> Option<Estimate> {
        let is_over = finer.failure.as_ref().is_some_and(Failure::is_over);
        let runs = self.coarse.as_ref().zip(self.fine.as_ref());
        let (coarse, fine) = runs.filter(|_| !is_over)?;
        Some(compare::estimate(coarse, fine, finer.is_solved()))
    }

    /// Twice as many steps.
    fn refined(
        &mut self,
        settings: &Settings<'e>,
        accuracy: Accuracy,
        ended: &Ended,
        estimate: Option<&Estimate>,
    ) -> Option<Accuracy> {
        let options = options(settings);
        let error = estimate.map_or(0.0, |estimate| estimate.error);
        let is_unsolved = ended.outcome.status == Status::Unsolved;
        let is_open = options.steps.is_none() && steps(options, accuracy.attempt) < MOST_STEPS;
        let is_needed = error > settings.numerics.tolerance || is_unsolved;
        (is_open && is_needed).then(|| accuracy.next(accuracy.tolerance))
    }

    fn tell(&mut self, _: &Problem<'_, 'e>, _: &Ended, trajectory: &mut Trajectory) {
        let relaxed = self.coarse.as_ref().map_or(0, |run| run.work.relaxed);
        trajectory.quality.stats.homotopy_steps = relaxed as u64;
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use nsd_solver::event::{Event, Observer, Segment};
    use nsd_solver::fesd::jumps;

    use super::{Simulator, first_grid, prepared};
    use crate::Compiled;
    use crate::limit::Limit;
    use crate::lowering::mpcc::Program;
    use crate::report::Status;
    use crate::simulate::{Request, run_watched};
    use crate::testing::with_last;

    /// One that bounces without friction, and a block in a plane that turns round.
    const BOUNCES: &str = "model m {
                      state q = 1; state v = 0;
                      q' = v;
                      mechanics q, v { mass = 1; force = -9.81; contact floor { gap = q; restitution = 0.5; } }
                    }
                    simulate s of m { horizon 0.7; lower impact; method fesd { steps = 6; elements = 3; } }";
    const PUSHED: &str = "model m {
                      state q[3] = [0, 0, 0]; state v[3] = [0.6, 0.8, 0];
                      q' = v;
                      mechanics q, v {
                        mass = eye(3); force = [-1.8, -2.4, -10];
                        contact ground { gap = q[3]; slip = [v[1], v[2]]; restitution = 0; friction = 0.2; }
                      }
                    }
                    simulate s of m {
                      horizon 1; lower impact;
                      method fesd { scheme = radau_iia(3); steps = 5; elements = 3; }
                    }";

    /// A ball that falls, slips and comes to rest in six steps, and in the twelve of a finer run.
    const FALLS: &str = "model m {
                      state q[2] = [0, 0.5]; state v[2] = [2, 0];
                      q' = v;
                      mechanics q, v {
                        mass = eye(2); force = [0, -9.81];
                        contact floor { gap = q[2]; slip = v[1]; restitution = 0; friction = 0.6; }
                      }
                    }
                    simulate o of m {
                      horizon 1.2; lower impact;
                      method fesd { scheme = radau_iia(3); steps = 6; elements = 3; }
                    }";

    /// The values of all nodes.
    struct Values(Vec<f64>);

    impl Observer for Values {
        fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
            self.0.push(segment.length);
            self.0.extend_from_slice(segment.end);
            ControlFlow::Continue(())
        }

        fn event(&mut self, event: &Event) {
            self.0.push(event.time);
        }
    }

    /// A run of what is read is that of what was written, bit for bit, and makes no program.
    #[test]
    fn systems_are_written_and_read() {
        for text in [FALLS, BOUNCES, PUSHED] {
            with_last(text, is_written_and_read);
        }
    }

    fn is_written_and_read(compiled: &Compiled<'_>) {
        let (system, settings) = (&compiled.system, &compiled.settings);
        let known = prepared(system, settings, &[]);
        let mut bytes = Vec::new();
        ciborium::into_writer(&known, &mut bytes).expect("it can be written");
        let read: jumps::System<Program> =
            ciborium::from_reader(&bytes[..]).expect("it is a system");
        assert_eq!(read.programs.len(), known.programs.len());
        let x0: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
        let run = |system: jumps::System<Program>| {
            let (mut runs, mut seen) = (Simulator::new(system), Values(Vec::new()));
            let (grid, limit) = (first_grid(settings), Limit::default());
            let reference = runs.follow(grid.horizon, &x0, &limit);
            let near = (&reference, &limit);
            let outcome = runs
                .run(grid, &x0, near, &mut |_| None, &mut seen)
                .outcome();
            assert_eq!(outcome.status, nsd_solver::hybrid::Status::Solved);
            seen.0.into_iter().map(f64::to_bits).collect::<Vec<_>>()
        };
        let found = run(read);
        assert!(!found.is_empty());
        assert_eq!(found, run(known));
    }

    /// The first step of each of the two runs makes the program of all.
    #[test]
    fn no_expression_is_made_behind_the_first_step() {
        with_last(FALLS, |compiled| {
            let (system, mut counts) = (&compiled.system, [Vec::new(), Vec::new()]);
            let request = Request::default();
            let run = run_watched(system, &compiled.settings, &request, &mut |progress| {
                counts[usize::from(progress.estimates)].push(system.exprs.n_nodes());
            });
            assert_eq!(run.status, Status::Solved);
            for (counts, steps) in counts.iter().zip([6, 12]) {
                assert!(counts.len() >= steps);
                assert_eq!(*counts, vec![counts[0]; counts.len()]);
            }
        });
    }
}
