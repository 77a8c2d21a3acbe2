//! The controls that were found, simulated from event to event.

use nsd_solver::optimization::mpcc::Solution;

use super::solved;
use crate::limit::Limit;
use crate::optimize::{Problem, failure};
use crate::project::clock::Instant;
use crate::report::{Check, Confirmation, Failure, Status, Trajectory, Warning};
use crate::system::experiment::{Sampling, Settings};

/// How accurate the simulation is, compared with what the result is to be.
const FINER: f64 = 1e-2;
const FINEST: f64 = 1e-12;
/// The rows of a program hold to an absolute accuracy: smaller states are zero to it.
const FEASIBLE: f64 = 1e-6;
/// The code of what a simulation says against a result.
const DISAGREES: &str = "W0709";

/// Simulates in the time that is left, and says by how much the end and the objective differ.
pub(crate) fn simulate(
    problem: &Problem,
    solution: &Solution,
    limit: &Limit,
    trajectory: &mut Trajectory,
) {
    let w = &solution.w;
    let started = Instant::now();
    let run = solved::run(problem, w, limit, |settings| {
        settings.numerics.tolerance = (FINER * settings.numerics.tolerance).max(FINEST);
        settings.recording.sampling = Sampling::Method;
    });
    if let Some(optimum) = &mut trajectory.optimum {
        optimum.check_s = started.elapsed().as_secs_f64();
    }
    if run.status != Status::Solved {
        let warning = unfinished(&problem.settings, run.failure.as_ref());
        return trajectory.warnings.push(warning);
    }
    let last = run.samples.time.len() - 1;
    let x = run.samples.states[0].at(last);
    let (_, n) = solved::end(problem, x);
    let terminal = solved::terminal_error(problem, w, x);
    let all = (0..run.samples.time.len()).flat_map(|k| &run.samples.states[0].at(k)[..n]);
    let size = all.fold(0.0, |m: f64, x| m.max(x.abs()));
    let objective = cost(problem, x, w) - solution.objective;
    let relative =
        (terminal / size.max(FEASIBLE)).max(objective.abs() / solution.objective.abs().max(1.0));
    if relative > problem.settings.numerics.tolerance {
        let message = format!(
            "a simulation with these controls ends {terminal:.1e} away, with an objective that differs by \
             {:.1e}; more `elements` or nodes are more accurate",
            objective.abs()
        );
        let warning = disagrees(&problem.settings, message);
        trajectory.warnings.push(warning);
    }
    trajectory.quality.error_estimate = Some(relative);
    if let Some(optimum) = &mut trajectory.optimum {
        optimum.check = Some(Check {
            terminal_error: terminal,
            objective_error: objective,
        });
    }
}

/// What simulations with other free quantities mean for a result: one with descent is no optimum.
pub(crate) fn confirmation(problem: &Problem, trajectory: &Trajectory) -> Option<Failure> {
    match trajectory.optimum.as_ref()?.confirmation {
        Confirmation::Descent(rate) => Some(failure::descends(rate, &problem.settings)),
        _ => None,
    }
}

/// That a simulation with the controls does not come to the end.
pub(crate) fn unfinished(settings: &Settings, failure: Option<&Failure>) -> Warning {
    let reason = failure.map_or_else(String::new, |failure| format!(": {failure}"));
    let message = format!("a simulation with these controls does not reach the end{reason}");
    disagrees(settings, message)
}

/// That another minimum is better, to which the program does not lead.
pub(crate) fn elsewhere(settings: &Settings, objective: f64) -> Warning {
    Warning {
        code: "W0724".into(),
        message: format!(
            "a simulation with other controls has the objective {objective:.6}, and the solver does not get there; another \
             `guess`, or several `starts`, may"
        ),
        span: Some(settings.span),
    }
}

fn disagrees(settings: &Settings, message: String) -> Warning {
    Warning {
        code: DISAGREES.into(),
        message,
        span: Some(settings.span),
    }
}

/// The cost for states, integrals among them, at the end.
fn cost(problem: &Problem, x: &[f64], w: &[f64]) -> f64 {
    let Some(task) = &problem.system.task else {
        return f64::NAN;
    };
    let (layout, at) = (&problem.layout, problem.at(w));
    let solved = solved::system(problem, w);
    // Switches in the cost have the values they have in the program.
    let alphas = at.alphas(layout.steps, layout.elements, layout.nodes);
    let known = solved.valuation(at.horizon(), x, &alphas);
    known.value(task.cost.value)
}
