//! `method timestepping`: the complementarity system in steps of one length, without switch detection.

use nsd_solver::fesd::{Stepper, SteppingSettings};
use nsd_solver::simulate::Status;

use super::{estimate, judge_steps, lower};
use crate::clock::Instant;
use crate::report::{Method, MethodOption, Trajectory};
use crate::simulate::overlooked::Looking;
use crate::simulate::schedule::scheduled;
use crate::simulate::watch::{Progress, Watched};
use crate::simulate::{Comparison, Recorder, Request, assemble};
use crate::system::System;
use crate::system::experiment::{Settings, SteppingOptions};

/// Integrates the system step by step over the horizon of the experiment.
pub(in crate::simulate) fn run(
    system: &System,
    settings: &Settings,
    options: &SteppingOptions,
    request: &Request,
    watch: &mut dyn FnMut(Progress),
) -> Trajectory {
    let started = Instant::now();
    let (dcs, complementarity) = lower(&scheduled(system, settings.horizon), settings);
    let x0: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
    let stepper = |steps: usize| {
        let settings = SteppingSettings {
            family: options.scheme().0,
            nodes: options.scheme().1,
            steps,
            limit: request.limit.clone(),
        };
        let stepper = Stepper::new(&complementarity, settings);
        stepper.expect("the number of nodes has been checked")
    };
    let mut first = stepper(options.steps);
    let mut recorder = Recorder::new(system, settings, settings.tolerance, request.dense);
    let mut looking = Looking::new(system, settings, &mut recorder);
    let mut watched = Watched::new(&mut looking, settings.horizon, false, watch);
    let mut outcome = first.run(0.0, settings.horizon, &x0, &mut watched);
    outcome.notes.extend(looking.notes());
    // Across switches the order is one, so that halving the steps removes half of the error.
    let error = (request.estimate && outcome.status == Status::Solved).then(|| {
        let mut comparison = Comparison::new(&recorder, &x0);
        let mut watched = Watched::new(&mut comparison, settings.horizon, true, watch);
        let fine = stepper(2 * options.steps).run(0.0, settings.horizon, &x0, &mut watched);
        Some(2.0 * estimate(system, &comparison, [&outcome, &fine])?.error)
    });
    let mut trajectory = assemble(system, settings, &outcome, recorder);
    let (family, nodes) = options.scheme();
    let text = |word: String| MethodOption::Text(word);
    trajectory.method = Method {
        name: "timestepping".into(),
        options: vec![
            ("scheme".into(), text(format!("{}({nodes})", family.word()))),
            ("lowering".into(), text(dcs.formulation.word().into())),
            ("steps".into(), MethodOption::Number(options.steps as f64)),
        ],
    };
    judge_steps(
        &mut trajectory,
        system,
        settings,
        options.steps,
        error.flatten(),
    );
    trajectory.stats.solve_s = started.elapsed().as_secs_f64();
    trajectory
}
