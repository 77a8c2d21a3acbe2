//! The controls that were found, simulated from event to event.

use nsd_solver::optimization::mpcc::Solution;

use super::reduced::Reduced;
use super::solved;
use crate::limit::Limit;
use crate::optimize::problem::{size_of_objective, size_of_state};
use crate::optimize::{Problem, failure};
use crate::project::clock::Instant;
use crate::report::{Check, Confirmation, Failure, Status, Trajectory, Warning};
use crate::system::experiment::{Sampling, Settings};

/// How accurate the simulation is, compared with what the result is to be.
const FINER: f64 = 1e-2;
const FINEST: f64 = 1e-12;
/// The rows of a program hold to an accuracy relative to the sizes of states: smaller ones are zero to it.
const FEASIBLE: f64 = 1e-6;
/// The code of what a simulation says against a result.
const DISAGREES: &str = "W0709";

/// What a simulation says, and the largest magnitude of a state in it.
fn compare(
    problem: &Problem,
    solution: &Solution,
    limit: &Limit,
) -> Result<(Check, f64), Option<Failure>> {
    let w = &solution.w;
    let refines = problem.task.discretization.refines;
    let run = solved::run(problem, w, limit, |settings| {
        let numerics = &mut settings.numerics;
        numerics.tolerance = match refines {
            // What grows along the run is to be the error of the grid.
            true => FINEST,
            false => (FINER * numerics.tolerance).max(FINEST),
        };
        settings.recording.sampling = Sampling::Method;
    });
    if run.status != Status::Solved {
        return Err(run.failure);
    }
    let last = run.samples.time.len() - 1;
    let x = run.samples.states[0].at(last);
    let (_, n) = solved::end(problem, x);
    let all = (0..run.samples.time.len()).flat_map(|k| &run.samples.states[0].at(k)[..n]);
    let size = all.fold(0.0, |m: f64, x| m.max(x.abs()));
    let check = Check {
        terminal_error: solved::terminal_error(problem, w, x),
        objective_error: cost(problem, x, w) + penalty(problem, w, limit) - solution.objective,
    };
    Ok((check, size))
}

/// By how much a simulation differs at the end, in states and relative to them where they are small, or in the objective;
/// not finite where it does not get there.
pub(crate) fn disagreement(problem: &Problem, solution: &Solution, limit: &Limit) -> f64 {
    let compared = compare(problem, solution, limit);
    let relative = |(check, size): (Check, f64)| relative(problem, &check, size.min(1.0), solution);
    compared.map_or(f64::INFINITY, relative)
}

fn relative(problem: &Problem, check: &Check, size: f64, solution: &Solution) -> f64 {
    let size_of_objective = size_of_objective(problem, solution.objective);
    let objective = check.objective_error.abs() / size_of_objective;
    let states = 0..problem.system.n_model_states();
    let least = states.fold(0.0, |m: f64, i| m.max(size_of_state(problem, i)));
    let least = if least > 0.0 { least } else { 1.0 };
    (check.terminal_error / size.max(FEASIBLE * least)).max(objective)
}

/// Simulates in the time that is left, and says by how much the end and the objective differ.
pub(crate) fn simulate(
    problem: &Problem,
    solution: &Solution,
    limit: &Limit,
    trajectory: &mut Trajectory,
) {
    let started = Instant::now();
    let compared = compare(problem, solution, limit);
    if let Some(optimum) = &mut trajectory.optimum {
        optimum.seconds.check = started.elapsed().as_secs_f64();
    }
    let (check, size) = match compared {
        Ok(compared) => compared,
        Err(failure) => {
            let warning = unfinished(&problem.settings, failure.as_ref());
            return trajectory.warnings.push(warning);
        }
    };
    let relative = relative(problem, &check, size, solution);
    if relative > problem.settings.numerics.tolerance {
        let advice = match problem.task.discretization.refines {
            true => "no finer grid that was tried is closer",
            false => "more `elements` or nodes are more accurate, and `grid auto;` looks for them",
        };
        let message = format!(
            "a simulation with these controls ends {:.1e} away, with an objective that differs by {:.1e}; {advice}",
            check.terminal_error,
            check.objective_error.abs()
        );
        let warning = disagrees(&problem.settings, message);
        trajectory.warnings.push(warning);
    }
    trajectory.quality.error_estimate = Some(relative);
    if let Some(optimum) = &mut trajectory.optimum {
        optimum.check = Some(check);
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

/// What violations of soft constraints cost; not finite where that is not known.
fn penalty(problem: &Problem, w: &[f64], limit: &Limit) -> f64 {
    if problem
        .mpcc
        .stated
        .iter()
        .all(|stated| stated.slack.is_none())
    {
        return 0.0;
    }
    let values = Reduced::new(problem, w, limit).and_then(|mut reduced| reduced.at(w));
    values.map_or(f64::INFINITY, |values| values.penalty)
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
    // So have data and controls that step where the horizon ends, in intervals of any length.
    let ends = at.ends();
    let inside = 0.5 * (ends[layout.steps - 1] + ends[layout.steps]);
    let known = solved.valuation_around([at.horizon(), inside], x, &alphas);
    known.value(task.cost.value)
}
