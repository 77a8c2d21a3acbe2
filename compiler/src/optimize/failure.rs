//! How the solver ended -> diagnostic at the lines of the model that it failed at.

use miette::LabeledSpan;
use nsd_solver::optimization::mpcc::{Class, Solution, Status};
use nsd_solver::optimization::problem::Nlp;

use super::Problem;
use crate::lowering::discretize::DiscretizeError;
use crate::lowering::mpcc::Source;
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
            lines: vec![whole(span)],
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
                span: problem.task.cost.span,
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
            span: problem.task.cost.span,
        }),
        Status::IterationLimit => failed("the limit of iterations was reached"),
        Status::Over(over) => Some(Failure::over(over, 0.0, span)),
        Status::Evaluation => Some(Failure::NotOptimal {
            what: "a function of the model, or a derivative, is not finite at the guess".to_owned(),
            is_feasible: false,
            lines: not_finite(problem, &solution.w),
        }),
        Status::NumericalFailure => failed("the solver found no further step"),
    }
}

/// The experiment as a whole.
fn whole(span: Span) -> LabeledSpan {
    LabeledSpan::new_with_span(Some("this optimization".to_owned()), span)
}

/// The statements of rows and of the cost that are not finite, or whose slopes are not; the experiment, where there is
/// none.
fn not_finite(problem: &mut Problem, w: &[f64]) -> Vec<LabeledSpan> {
    let program = &mut problem.program;
    let pattern = program.jacobian_pattern().clone();
    let mut values = vec![0.0; program.n_rows()];
    let mut slopes = vec![0.0; pattern.columns.len()];
    let mut gradient = vec![0.0; program.n_variables()];
    program.rows(w, &mut values);
    program.jacobian(w, &mut slopes);
    program.gradient(w, &mut gradient);
    let cost = program.objective(w);
    let mut found: Vec<(Span, &str)> = Vec::new();
    let mut blame = |span: Span, is_value: bool| {
        let what = match is_value {
            true => "is not finite at the guess",
            false => "has a slope that is not finite at the guess",
        };
        if found.iter().all(|(known, _)| *known != span) {
            found.push((span, what));
        }
    };
    let is_steep = |slopes: &[f64]| slopes.iter().any(|slope| !slope.is_finite());
    if !cost.is_finite() || is_steep(&gradient) {
        blame(problem.task.cost.span, !cost.is_finite());
    }
    for (row, value) in values.iter().enumerate() {
        let entries = pattern.starts[row]..pattern.starts[row + 1];
        if value.is_finite() && !is_steep(&slopes[entries]) {
            continue;
        }
        if let Some(span) = line(problem, row) {
            blame(span, !value.is_finite());
        }
    }
    if found.is_empty() {
        return vec![whole(problem.settings.span)];
    }
    let label = |(span, what): (Span, &str)| LabeledSpan::new_with_span(Some(what.into()), span);
    found.into_iter().take(MOST_LINES).map(label).collect()
}

/// The statement that a row is made of; none where it is one of the grid.
fn line(problem: &Problem, row: usize) -> Option<Span> {
    match problem.mpcc.origin(&problem.program, row)?.source {
        Source::Dcs(origin) => Some(origin.span),
        Source::Task(span) => Some(span),
        Source::Grid => None,
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
        _ if solution.b_stationary == Some(true) => {
            "a feasible point was reached that is stationary and no minimum: the objective curves down there along the \
             constraints, and no lower point was found"
                .to_owned()
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
        lines: vec![whole(settings.span)],
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
        let Some(span) = line(problem, row).filter(|_| violation > 0.0) else {
            continue;
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
    let line = match error {
        DiscretizeError::NoValue { span, .. } => {
            LabeledSpan::new_with_span(Some("reads it where it has no value".to_owned()), *span)
        }
        _ => whole(settings.span),
    };
    Failure::NotOptimal {
        what: error.to_string(),
        is_feasible: false,
        lines: vec![line],
    }
}
