//! How the solver ended -> diagnostic at the lines of the model that it failed at.

use miette::LabeledSpan;
use nsd_solver::optimization::mpcc::{Class, Solution, Status};
use nsd_solver::optimization::problem::{Mpcc, Nlp, Side};

use super::Problem;
use crate::diagnostics::counted;
use crate::lowering::discretize::DiscretizeError;
use crate::lowering::mpcc::{self, Kind, Origin, Source};
use crate::report::{self, Failure, Stationarity};
use crate::source::Span;
use crate::system::experiment::Settings;

/// Objectives below this, at points that satisfy all constraints up to so much of their size, have no minimum.
const UNBOUNDED: f64 = -1e9;
const ROUNDING: f64 = 1e-6;
/// Lines that are named at most.
const MOST_LINES: usize = 4;
/// Multipliers of pairs below this, relative to the larger one or 1, have the wrong sign.
const WRONG: f64 = 1e-6;
/// Violations below this share of the largest one are left out.
const SHARE: f64 = 1e-2;

/// What is said of a stationary point that is no minimum.
const CURVES_DOWN: &str = "a feasible point was reached that is stationary and no minimum: the objective curves down there \
                           along the constraints, and no lower point was found";

/// Why there is no solution; `None` where there is one.
pub(super) fn of(problem: &mut Problem, solution: &Solution) -> Option<Failure> {
    let span = problem.settings.span;
    let failed = |what: &str, end: report::Status| {
        Some(Failure::NotOptimal {
            what: what.to_owned(),
            end,
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
        Status::Feasible => match not_shown(solution) {
            Some(what) => failed(what, report::Status::Feasible),
            None => Some(weak(problem, solution)),
        },
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
        Status::IterationLimit if is_at_limit(problem, solution) => failed(
            "`max_iterations` was reached",
            report::Status::IterationLimit,
        ),
        Status::IterationLimit => failed(
            "no program that was solved on the way came to its end",
            report::Status::NumericalFailure,
        ),
        Status::Over(over) => Some(Failure::over(over, 0.0, span)),
        Status::Evaluation => Some(Failure::NotOptimal {
            what: "a function of the model, or a derivative, is not finite at the guess".to_owned(),
            end: report::Status::NumericalFailure,
            lines: not_finite(problem, &solution.w),
        }),
        Status::NumericalFailure => failed(
            "the solver found no further step",
            report::Status::NumericalFailure,
        ),
    }
}

/// Whether it took all iterations that the experiment allows, and not those that programs have by themselves.
fn is_at_limit(problem: &Problem, solution: &Solution) -> bool {
    let most = problem.task.options.max_iterations;
    most.is_some_and(|most| solution.stats.iterations >= most)
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
    span_of(&problem.mpcc.origin(&problem.program, row)?)
}

/// Where the pair of this number among all pairs comes from.
fn origin_of_pair(mpcc: &mpcc::Mpcc<'_>, pair: usize) -> Option<Origin> {
    let mut before = 0;
    let mut blocks = (mpcc.blocks.iter()).filter(|block| block.kind == Kind::Pair);
    blocks.find_map(|block| {
        let own = pair - before;
        before += block.n_rows() / 2;
        (pair < before).then(|| block.origin(own))
    })
}

fn span_of(origin: &Origin) -> Option<Span> {
    match origin.source {
        Source::Dcs(origin) => Some(origin.span),
        Source::Task(span) => Some(span),
        Source::Grid => None,
    }
}

/// What keeps a feasible point from being known to be an optimum; `None` where it is its class.
fn not_shown(solution: &Solution) -> Option<&'static str> {
    match solution.class {
        _ if !solution.is_differentiable => {
            Some("a feasible point was reached where a derivative is not finite")
        }
        Class::None => Some("a feasible point was reached that was not shown to be stationary"),
        // Points of these classes are solutions where nothing is seen to curve down.
        Class::M if solution.b_stationary.is_none() => Some(CURVES_DOWN),
        _ if solution.b_stationary == Some(true) => Some(CURVES_DOWN),
        _ => None,
    }
}

/// That the class of a point is too weak, with the statements whose complementarity has multipliers of the wrong sign.
fn weak(problem: &Problem, solution: &Solution) -> Failure {
    let is_wrong = |pair: &usize| {
        let [a, b] = solution.multipliers.pairs[*pair];
        a.min(b) < -WRONG * a.abs().max(b.abs()).max(1.0)
    };
    let wrong: Vec<usize> = (solution.biactive.iter().copied())
        .filter(is_wrong)
        .collect();
    let statement = |&pair: &usize| span_of(&origin_of_pair(&problem.mpcc, pair)?);
    let mut spans: Vec<Span> = Vec::new();
    for span in wrong.iter().filter_map(statement) {
        if !spans.contains(&span) {
            spans.push(span);
        }
    }
    let label = |span| LabeledSpan::new_with_span(Some("undecided here".to_owned()), span);
    let descent = match solution.b_stationary {
        None => "the search for a direction of descent met its limit",
        _ => {
            "the objective falls to first order, and no lower point was found along that direction"
        }
    };
    Failure::Weak {
        class: Stationarity::of(solution.class, solution.b_stationary).as_str(),
        missing: format!(
            "S or B is missing: {} with both members zero, {} of them with a multiplier of the wrong sign; {descent}",
            counted(solution.biactive.len(), "pair"),
            wrong.len()
        ),
        lines: match spans.is_empty() {
            true => vec![whole(problem.settings.span)],
            false => spans.into_iter().take(MOST_LINES).map(label).collect(),
        },
    }
}

/// Why a stationary point of the program is none of the control problem.
pub(super) fn descends(rate: f64, settings: &Settings) -> Failure {
    Failure::NotOptimal {
        what: format!(
            "simulations with other free quantities have smaller objectives, by {rate:.1e} per half of their range, \
             and the program has no such point near this one"
        ),
        end: report::Status::Feasible,
        lines: vec![whole(settings.span)],
    }
}

/// The statements whose rows are violated most.
fn lines(problem: &mut Problem, w: &[f64]) -> Vec<LabeledSpan> {
    let mut values = vec![0.0; problem.program.n_rows()];
    problem.program.rows(w, &mut values);
    let bounds = problem.program.row_bounds();
    let mut found: Vec<(Span, f64, usize)> = Vec::new();
    let missed = values.iter().enumerate().map(|(row, &value)| {
        let violation = (bounds.lower[row] - value).max(value - bounds.upper[row]);
        (line(problem, row), violation)
    });
    // Of a pair the smaller member is zero.
    let pairs = problem.program.pairs().iter().enumerate();
    let pairs = pairs.map(|(number, pair)| {
        let [a, b] = [pair.a, pair.b].map(|side| match side {
            Side::Row(row) => values[row as usize],
            Side::Variable(variable) => w[variable as usize],
        });
        let origin = origin_of_pair(&problem.mpcc, number);
        let span = origin.and_then(|origin| span_of(&origin));
        (span, a.min(b).abs())
    });
    let missed = missed
        .chain(pairs)
        .filter(|(_, violation)| *violation > 0.0);
    for (span, violation) in missed {
        let Some(span) = span else { continue };
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
        end: report::Status::NumericalFailure,
        lines: vec![line],
    }
}

#[cfg(test)]
mod tests {
    use miette::Diagnostic;
    use nsd_solver::optimization::mpcc::{Class, Options, Solution, Status, solve};

    use crate::optimize::{Given, Problem};
    use crate::testing::with_last;

    /// A solution that is said to be of a class, with one undecided pair whose multipliers are these.
    fn ending(
        found: &Solution,
        class: Class,
        b_stationary: Option<bool>,
        pair: [f64; 2],
    ) -> Solution {
        let mut ending = Solution {
            status: Status::Feasible,
            class,
            b_stationary,
            biactive: vec![0],
            ..found.clone()
        };
        ending.multipliers.pairs[0] = pair;
        ending
    }

    #[test]
    fn weak_classes_have_a_code_of_their_own() {
        let text = "model m { state x = 1; control u in [-1, 1] = 0; x' = u - 0.5*sign(x); }
                    optimize o of m { horizon 1; intervals 2; minimize final((x - 1)^2); }";
        with_last(text, |compiled| {
            let task = (compiled.settings.optimize.as_ref()).expect("it is an optimization");
            let problem = Problem::new(&compiled.system, &compiled.settings, task, Given::Numbers);
            let mut problem = problem.expect("it has a program");
            let found = solve(&mut problem.program, &Options::default());
            let mut failure = |class, b_stationary, pair| {
                let ending = ending(&found, class, b_stationary, pair);
                let failure = super::of(&mut problem, &ending).expect("it is no solution");
                assert_eq!(failure.status(), crate::report::Status::Feasible);
                let code = failure.code().expect("failures have codes").to_string();
                (code, failure.to_string())
            };
            for (class, name) in [(Class::A, "A"), (Class::W, "W"), (Class::C, "C")] {
                let (code, message) = failure(class, Some(false), [-1.0, 1.0]);
                assert_eq!(code, "E0735");
                assert!(message.contains(&format!("{name}-stationary")), "{message}");
                assert!(
                    message.contains("1 pair with both members zero, 1 of them with a"),
                    "{message}"
                );
                assert!(message.contains("falls to first order"), "{message}");
            }
            let (code, message) = failure(Class::C, None, [1.0, 1.0]);
            assert_eq!(code, "E0735");
            assert!(message.contains("met its limit"), "{message}");
            assert!(
                message.contains(" 0 of them with a multiplier"),
                "{message}"
            );
            assert_eq!(failure(Class::None, None, [0.0; 2]).0, "E0717");
            // Without curvature these would be solutions.
            for (class, b_stationary) in [(Class::M, None), (Class::C, Some(true))] {
                let (code, message) = failure(class, b_stationary, [-1.0, 0.0]);
                assert_eq!(code, "E0717");
                assert!(message.contains("curves down"), "{message}");
            }
        });
    }
}
