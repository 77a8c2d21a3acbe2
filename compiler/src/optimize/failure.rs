//! How the solver ended -> diagnostic at the lines of the model that it failed at.

use miette::LabeledSpan;
use nsd_solver::mpcc::{Class, Solution, Status};
use nsd_solver::problem::Nlp;

use super::Problem;
use crate::discretize::DiscretizeError;
use crate::mpcc::Source;
use crate::report::Failure;
use crate::source::Span;
use crate::system::experiment::Settings;

/// Objectives below this, at points that satisfy all constraints up to so much of their size, have no minimum.
const UNBOUNDED: f64 = -1e9;
const ROUNDING: f64 = 1e-6;
/// Lines that are named at most.
const MOST_LINES: usize = 4;
/// Violations below this share of the largest one are left out.
const SHARE: f64 = 1e-2;

/// Why there is no solution; `None` where there is one.
pub(super) fn of(problem: &mut Problem, solution: &Solution) -> Option<Failure> {
    let span = problem.settings.span;
    let failed = |what: &str| {
        Some(Failure::NotOptimal {
            what: what.to_owned(),
            is_feasible: solution.is_feasible(),
            span,
        })
    };
    // Feasible but for rounding, and beyond all bounds.
    let size = solution.w.iter().fold(1.0, |m: f64, w| m.max(w.abs()));
    let is_feasible = solution.residuals.violation <= ROUNDING * size;
    let is_beyond = is_feasible && solution.objective < UNBOUNDED;
    match solution.status {
        Status::Solved => None,
        Status::Feasible | Status::IterationLimit | Status::NumericalFailure if is_beyond => {
            Some(Failure::Unbounded {
                span: problem.task.cost_span,
            })
        }
        Status::Feasible => failed(&not_shown(solution)),
        Status::LocallyInfeasible => {
            let violation = solution
                .residuals
                .violation
                .max(solution.residuals.complementarity);
            Some(Failure::Infeasible {
                violation: format!("{violation:.1e}"),
                lines: lines(problem, &solution.w),
            })
        }
        Status::Unbounded => Some(Failure::Unbounded {
            span: problem.task.cost_span,
        }),
        Status::IterationLimit => failed("the limit of iterations was reached"),
        Status::TimeLimit => Some(Failure::TimeLimit { time: 0.0, span }),
        Status::Evaluation => {
            failed("a function of the model, or a derivative, is not finite at the guess")
        }
        Status::NumericalFailure => failed("the solver found no further step"),
    }
}

/// What keeps a feasible point from being known to be an optimum.
fn not_shown(solution: &Solution) -> String {
    match solution.class {
        _ if !solution.is_differentiable => {
            "a feasible point was reached where a derivative is not finite".to_owned()
        }
        Class::None => {
            "a feasible point was reached that was not shown to be stationary".to_owned()
        }
        class => format!(
            "a feasible point was reached that is {class:?}-stationary, which does not exclude descent to first order"
        ),
    }
}

/// Why a stationary point of the program is none of the control problem.
pub(super) fn descends(rate: f64, settings: &Settings) -> Failure {
    Failure::NotOptimal {
        what: format!(
            "simulations with other free quantities have smaller objectives, by {rate:.1e} per half of their range, \
             and the program has no such point near this one"
        ),
        is_feasible: true,
        span: settings.span,
    }
}

/// The statements whose rows are violated most.
fn lines(problem: &mut Problem, w: &[f64]) -> Vec<LabeledSpan> {
    let mut values = vec![0.0; problem.program.n_rows()];
    problem.program.rows(w, &mut values);
    let bounds = problem.program.row_bounds();
    let mut found: Vec<(Span, f64, usize)> = Vec::new();
    for (row, &value) in values.iter().enumerate() {
        let violation = (bounds.lower[row] - value).max(value - bounds.upper[row]);
        let Some(origin) = problem
            .mpcc
            .origin(&problem.program, row)
            .filter(|_| violation > 0.0)
        else {
            continue;
        };
        let span = match origin.source {
            Source::Dcs(origin) => origin.span,
            Source::Task(span) => span,
            Source::Grid => continue,
        };
        match found.iter_mut().find(|(known, ..)| *known == span) {
            Some((_, most, count)) => {
                *most = most.max(violation);
                *count += 1;
            }
            None => found.push((span, violation, 1)),
        }
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    let most = found.first().map_or(0.0, |(_, violation, _)| *violation);
    let lines = found
        .into_iter()
        .filter(|(_, violation, _)| *violation >= SHARE * most);
    let label = |(span, violation, _): (Span, f64, usize)| {
        LabeledSpan::new_with_span(Some(format!("not met: off by {violation:.1e}")), span)
    };
    lines.take(MOST_LINES).map(label).collect()
}

/// What cannot be discretized.
pub(super) fn refused(error: &DiscretizeError, settings: &Settings) -> Failure {
    Failure::NotOptimal {
        what: error.to_string(),
        is_feasible: false,
        span: settings.span,
    }
}
