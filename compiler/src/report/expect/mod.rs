//! Expectations: what an experiment asserts of its own run.
//!
//! [`check`] finds the mistakes that can be found without a run; [`evaluate`]
//! compares with one. Both read names as the model does, with the words that
//! only a run gives a meaning to: `switches`, `events(..)`, `end`.

mod error;
mod miss;
mod mode;
mod relation;
mod values;

pub use error::ExpectError;

use self::relation::Known;
use super::{Status, Trajectory};
use crate::diagnostics::Diagnostics;
use crate::model::Model;
use crate::model::hir::reserved::one_of;
use crate::report::numbers::difference;
use crate::source::{SourceMap, Span};
use crate::syntax::{Expect, Expr, ExprKind};
use crate::system::System;

/// What expectations are about.
pub struct Subject<'s, 'e> {
    /// The model.
    pub model: &'s Model<'e>,
    /// Its system under the experiment.
    pub system: &'s System<'e>,
    /// End of the run.
    pub horizon: f64,
    /// Whether the method takes a number of steps, so that it has an order.
    pub has_steps: bool,
    /// Where the texts are.
    pub sources: &'s SourceMap,
}

/// An expectation after a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// As written, without `expect`.
    pub text: String,
    /// The statement.
    pub span: Span,
    /// Whether it holds.
    pub verdict: Verdict,
}

/// Whether an expectation holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// It does.
    Passed,
    /// It does not.
    Failed {
        /// What should be.
        expected: String,
        /// What is.
        got: String,
    },
    /// Golden files are not what they should be.
    Differs(Vec<Difference>),
    /// It cannot be said yet.
    Unsupported {
        /// Code of the diagnostic that says so.
        code: String,
    },
}

/// A golden file that is not what it should be.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Its name.
    pub name: String,
    /// Whether it is missing.
    pub is_missing: bool,
    /// What is gone and what is new.
    pub lines: Vec<String>,
}

/// A golden file and what should be in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Comparison {
    /// Its name.
    pub name: String,
    /// What is in it, where it is there.
    pub golden: Option<String>,
    /// What this run would write.
    pub now: String,
}

impl Comparison {
    /// How the file differs, if it does.
    pub fn difference(&self) -> Option<Difference> {
        let golden = self.golden.as_deref();
        let lines = difference::lines(golden.unwrap_or(""), &self.now);
        let differs = golden.is_none() || !lines.is_empty();
        differs.then(|| Difference {
            name: self.name.clone(),
            is_missing: golden.is_none(),
            lines,
        })
    }
}

/// What a run gave besides its trajectory.
#[derive(Default)]
pub struct Findings {
    /// Codes of all warnings.
    pub warnings: Vec<String>,
    /// The printed forms with their golden files, where they are asked for.
    pub lowering: Vec<Comparison>,
    /// The numbers with theirs, where they are asked for.
    pub numbers: Vec<Comparison>,
    /// The order of convergence, where one was measured, or why there is none.
    pub order: Option<Result<Convergence, String>>,
}

/// How fast the error of a method falls.
#[derive(Clone, Debug)]
pub struct Convergence {
    /// p of error ≈ C h^p.
    pub order: f64,
    /// What it was found from.
    pub account: String,
}

/// Whether an expectation is about the order of convergence, which takes runs of its own.
pub fn asks_for_order(subject: &Subject<'_, '_>, expects: &[(Expect, Span)]) -> bool {
    let asks = |(expect, span): &(Expect, Span)| {
        let Expect::Relation(relation) = expect else {
            return false;
        };
        relation::check(subject, relation, *span, &mut Diagnostics::new()) == Some(true)
    };
    expects.iter().any(asks)
}

/// The expectations that are about any run: golden files are about the method and the form, or about the run with the
/// numbers that are written, and an order of convergence takes runs of its own.
pub fn of_any_run(subject: &Subject<'_, '_>, expects: &[(Expect, Span)]) -> Vec<(Expect, Span)> {
    let mut open = expects.to_vec();
    let is_golden =
        |expect: &Expect| matches!(expect, Expect::LoweringGolden | Expect::NumbersGolden);
    open.retain(|(expect, _)| !is_golden(expect));
    open.retain(|expect| !asks_for_order(subject, std::slice::from_ref(expect)));
    open
}

/// Finds the mistakes in expectations that need no run to be seen.
pub fn check(subject: &Subject<'_, '_>, expects: &[(Expect, Span)], diags: &mut Diagnostics) {
    for (expect, span) in expects {
        match expect {
            Expect::LoweringGolden | Expect::NumbersGolden => {}
            Expect::Warning(code) => {
                if let Some(error) = ExpectError::unknown_code("warning", code) {
                    diags.push(error);
                }
            }
            Expect::Status(status) => {
                if !Status::ALL
                    .iter()
                    .any(|known| known.as_str() == status.name)
                {
                    let known = Status::ALL.iter().map(|known| known.as_str());
                    diags.push(ExpectError::UnknownStatus {
                        help: one_of(&status.name, "a run ends as", known),
                        name: status.name.clone(),
                        span: status.span,
                    });
                }
            }
            Expect::Mode { at, mode } => {
                relation::instant(subject, at, diags);
                mode::check(subject, mode, diags);
            }
            Expect::Relation(relation) => {
                relation::check(subject, relation, *span, diags);
            }
        }
    }
}

/// Expectations as they were resolved for a run, which serve others of the same compilation.
#[derive(Default)]
pub struct Resolved<'e> {
    relations: Vec<Known<'e>>,
}

impl<'e> Resolved<'e> {
    /// How many expectations do not hold in a run.
    pub fn missed(
        &mut self,
        subject: &Subject<'_, 'e>,
        expects: &[(Expect, Span)],
        trajectory: &Trajectory,
        findings: &Findings,
    ) -> usize {
        let subject = &up_to_stop(subject, trajectory);
        self.relations.resize_with(expects.len(), Known::default);
        let misses = |((expect, span), known): (&(Expect, Span), &mut Known<'e>)| match expect {
            Expect::Relation(relation) => {
                !known.holds(subject, (relation, *span), trajectory, findings)
            }
            _ => verdict(subject, expect, *span, trajectory, findings) != Verdict::Passed,
        };
        let missed = expects.iter().zip(&mut self.relations).map(misses);
        let missed = missed.filter(|missed| *missed).count();
        missed + usize::from(fails(expects, trajectory))
    }
}

/// With the horizon where a run has been stopped.
fn up_to_stop<'s, 'e>(subject: &Subject<'s, 'e>, trajectory: &Trajectory) -> Subject<'s, 'e> {
    let stop = trajectory.history.stop();
    Subject {
        horizon: stop.map_or(subject.horizon, |stop| stop.time),
        ..*subject
    }
}

/// Whether a run has failed, and that is not what it is expected to do.
fn fails(expects: &[(Expect, Span)], trajectory: &Trajectory) -> bool {
    let mut expects = expects.iter();
    let asks_for_status = expects.any(|(expect, _)| matches!(expect, Expect::Status(_)));
    trajectory.status != Status::Solved && !asks_for_status
}

/// Compares all expectations with a run.
pub fn evaluate(
    subject: &Subject<'_, '_>,
    expects: &[(Expect, Span)],
    trajectory: &Trajectory,
    findings: &Findings,
) -> Vec<Check> {
    let subject = &up_to_stop(subject, trajectory);
    let one = |(expect, span): &(Expect, Span)| Check {
        text: text(subject.sources, *span),
        span: *span,
        verdict: verdict(subject, expect, *span, trajectory, findings),
    };
    let mut checks: Vec<Check> = expects.iter().map(one).collect();
    if fails(expects, trajectory) {
        checks.insert(
            0,
            Check {
                text: "the run ends well".into(),
                span: Span::default(),
                verdict: Verdict::Failed {
                    expected: Status::Solved.as_str().into(),
                    got: status_text(trajectory),
                },
            },
        );
    }
    checks
}

/// The state at the end that the expectations give, in order of the states of the system; none where
/// an entry is missing.
pub fn final_state(subject: &Subject<'_, '_>, expects: &[(Expect, Span)]) -> Option<Vec<f64>> {
    let states = &subject.system.states;
    let mut found: Vec<Option<f64>> = vec![None; states.len()];
    for (expect, span) in expects {
        let Expect::Relation(relation) = expect else {
            continue;
        };
        for (left, number) in relation::at_end(subject, relation, *span) {
            if let Some(state) = states.iter().position(|state| state.var == left) {
                found[state] = Some(number);
            }
        }
    }
    found.into_iter().collect()
}

fn verdict(
    subject: &Subject<'_, '_>,
    expect: &Expect,
    span: Span,
    trajectory: &Trajectory,
    findings: &Findings,
) -> Verdict {
    let failed = |expected: String, got: String| Verdict::Failed { expected, got };
    match expect {
        Expect::LoweringGolden => same(&findings.lowering),
        Expect::NumbersGolden => same(&findings.numbers),
        Expect::Status(status) if status.name == trajectory.status.as_str() => Verdict::Passed,
        Expect::Status(status) => failed(status.name.clone(), status_text(trajectory)),
        Expect::Warning(code) if findings.warnings.contains(&code.name) => Verdict::Passed,
        Expect::Warning(code) => {
            let got = match findings.warnings.is_empty() {
                true => "no warning".into(),
                false => findings.warnings.join(", "),
            };
            failed(code.name.clone(), got)
        }
        Expect::Mode { at, mode } => mode::evaluate(subject, at, mode, trajectory),
        Expect::Relation(relation) => {
            Known::default().evaluate(subject, (relation, span), trajectory, findings)
        }
    }
}

fn status_text(trajectory: &Trajectory) -> String {
    let status = trajectory.status.as_str();
    match &trajectory.failure {
        Some(failure) => format!("{status}: {failure}"),
        None => status.into(),
    }
}

/// Whether golden files are what they should be; where there are none, nothing can be said for the expectation.
fn same(files: &[Comparison]) -> Verdict {
    if files.is_empty() {
        return Verdict::Failed {
            expected: "a golden file".into(),
            got: "nothing to compare".into(),
        };
    }
    let differences: Vec<Difference> = files.iter().filter_map(Comparison::difference).collect();
    match differences.is_empty() {
        true => Verdict::Passed,
        false => Verdict::Differs(differences),
    }
}

/// A statement on one line, without `expect` and semicolon.
fn text(sources: &SourceMap, span: Span) -> String {
    let words: Vec<&str> = sources.text(span).split_whitespace().collect();
    let line = words.join(" ");
    let line = line.strip_prefix("expect ").unwrap_or(&line);
    line.trim_end_matches([';', ' ']).to_owned()
}

/// The name that an expression is, if it is one.
fn as_name(expr: &Expr) -> Option<&str> {
    match &expr.kind {
        ExprKind::Name(name) => Some(name),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::{Comparison, Verdict, same};

    #[test]
    fn golden_files_are_compared_line_by_line() {
        let file = |golden: Option<&str>| Comparison {
            name: "m.golden/run.system".into(),
            golden: golden.map(str::to_owned),
            now: "a\nb\n".into(),
        };
        assert_eq!(same(&[file(Some("a\r\nb"))]), Verdict::Passed);
        assert!(matches!(same(&[]), Verdict::Failed { .. }));
        let both = [file(None), file(Some("a\nb")), file(Some("a\nc"))];
        let Verdict::Differs(differences) = same(&both) else {
            panic!("two of them differ");
        };
        let missing: Vec<bool> = differences.iter().map(|file| file.is_missing).collect();
        assert_eq!(missing, [true, false]);
        assert_eq!(differences[1].lines, ["  a", "- c", "+ b"]);
    }
}
