//! `expect x at end ~ [1, 0] within 1e-9;`

use super::error::ExpectError;
use super::miss::{Miss, expected, misses, slack};
use super::values::{Run, Symbols, Words, at};
use super::{Findings, Subject, Verdict};
use crate::diagnostics::Diagnostics;
use crate::expr::Expr;
use crate::model::{Shape, Tensor};
use crate::report::Trajectory;
use crate::report::forms::text::significant;
use crate::source::Span;
use crate::syntax::{self, ExpectOp, ExpectRelation, ExpectWhen};
use crate::system::Valuation;
use crate::system::experiment::MethodKind;

/// A relation in the terms of the system.
pub struct Sides<'e> {
    left: Tensor<'e>,
    right: Tensor<'e>,
    left_when: When<Expr<'e>>,
    right_when: When<Expr<'e>>,
    within: Option<Expr<'e>>,
    /// Whether a side is about the order of convergence.
    pub has_order: bool,
}

/// When a side is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
enum When<T> {
    /// Once; it does not change over time.
    Run,
    /// At an instant.
    At(T),
    /// At all reported instants.
    Always,
}

/// A relation as it was resolved for a run, which serves others, and other values of parameters.
#[derive(Default)]
pub struct Known<'e> {
    symbols: Symbols<'e>,
    sides: Option<Sides<'e>>,
}

/// What a relation is in one run.
struct Numbers {
    left_when: When<f64>,
    right_when: When<f64>,
    within: f64,
}

/// Resolves both sides, their instants and the tolerance.
pub fn resolve<'e>(
    subject: &Subject<'_, 'e>,
    relation: &ExpectRelation,
    span: Span,
    run: &Run<'_, 'e>,
    diags: &mut Diagnostics,
) -> Option<Sides<'e>> {
    let words = Words::new(subject, run);
    let mut at = |expr: &syntax::Expr| entry(subject, run, expr, diags).map(When::At);
    let left_when = match &relation.when {
        ExpectWhen::Run => Some(When::Run),
        ExpectWhen::At(instant) => at(instant),
        ExpectWhen::Always => Some(When::Always),
    };
    // Without an instant of its own, the right side is taken together with the left one.
    let right_when = match &relation.right_at {
        Some(instant) => at(instant),
        None => left_when,
    };
    let left = side(subject, &words, &relation.left, left_when, diags);
    let right = side(subject, &words, &relation.right, right_when, diags);
    let within = within(subject, relation, span, run, diags);

    let (left, right) = (left?, right?);
    let conforms =
        left.shape == right.shape || left.shape == Shape::Scalar || right.shape == Shape::Scalar;
    if !conforms && !words.has_list.get() {
        diags.push(ExpectError::Shapes {
            left_shape: left.shape.to_string(),
            right_shape: right.shape.to_string(),
            left: relation.left.span,
            right: relation.right.span,
        });
        return None;
    }
    Some(Sides {
        left,
        right,
        left_when: left_when?,
        right_when: right_when?,
        within: within?,
        has_order: words.has_order.get(),
    })
}

/// Finds the mistakes in a relation that need no run to be seen; whether it is about the order of convergence.
pub fn check(
    subject: &Subject<'_, '_>,
    relation: &ExpectRelation,
    span: Span,
    diags: &mut Diagnostics,
) -> Option<bool> {
    let sides = resolve(subject, relation, span, &Run::Unknown, diags)?;
    let params = subject.system.parameters();
    numbers(subject, relation, &sides, &params, diags)?;
    Some(sides.has_order)
}

/// The instants and the tolerance of a relation, where parameters and words have these values.
fn numbers(
    subject: &Subject<'_, '_>,
    relation: &ExpectRelation,
    sides: &Sides<'_>,
    known: &Valuation,
    diags: &mut Diagnostics,
) -> Option<Numbers> {
    let mut at = |when: When<Expr<'_>>, expr: &syntax::Expr| match when {
        When::Run => Some(When::Run),
        When::At(entry) => {
            let instant = known.value(entry);
            within_run(subject, instant, expr, diags).then_some(When::At(instant))
        }
        When::Always => Some(When::Always),
    };
    // No expression is looked at where there is none.
    let own = match &relation.when {
        ExpectWhen::At(expr) => expr,
        _ => &relation.left,
    };
    let left_when = at(sides.left_when, own);
    let right_when = match &relation.right_at {
        Some(expr) => at(sides.right_when, expr),
        None => left_when,
    };
    let within = match sides.within {
        None => 0.0,
        Some(entry) => known.value(entry),
    };
    if !(within.is_finite() && within >= 0.0) {
        if let Some(expr) = &relation.within {
            diags.push(ExpectError::NotATolerance { span: expr.span });
        }
        return None;
    }
    Some(Numbers {
        left_when: left_when?,
        right_when: right_when?,
        within,
    })
}

/// What `left ~ right` says of the end of a run: entries of the left side with their numbers; nothing
/// where they are not known before the run.
pub fn at_end<'e>(
    subject: &Subject<'_, 'e>,
    relation: &ExpectRelation,
    span: Span,
) -> Vec<(Expr<'e>, f64)> {
    let mut diags = Diagnostics::new();
    let words = Words::new(subject, &Run::Unknown);
    words.value(&relation.right, &mut diags);
    let params = subject.system.parameters();
    let sides = resolve(subject, relation, span, &Run::Unknown, &mut diags);
    let Some(Sides { left, right, .. }) = sides.filter(|sides| {
        let numbers = numbers(subject, relation, sides, &params, &mut diags);
        relation.relation == ExpectOp::Close
            && numbers.is_some_and(|numbers| numbers.left_when == When::At(subject.horizon))
            && !words.has_list.get()
            && params.unknown(&sides.right.data).is_none()
    }) else {
        return Vec::new();
    };
    let numbers = right.data.iter().map(|&entry| params.value(entry));
    match right.shape {
        Shape::Scalar => left.data.into_iter().zip(numbers.cycle()).collect(),
        _ => left.data.into_iter().zip(numbers).collect(),
    }
}

fn side<'e>(
    subject: &Subject<'_, 'e>,
    words: &Words<'_, '_, 'e>,
    expr: &syntax::Expr,
    when: Option<When<Expr<'e>>>,
    diags: &mut Diagnostics,
) -> Option<Tensor<'e>> {
    let value = words
        .value(expr, diags)?
        .map(|entry| subject.system.read(entry));
    if when == Some(When::Run)
        && let Some(var) = words.unknown(&subject.system.parameters(), &value.data)
    {
        let name = subject.model.exprs.name(var);
        diags.push(ExpectError::NoInstant {
            name,
            span: expr.span,
        });
        return None;
    }
    Some(value)
}

/// The tolerance, none for a relation that is exact.
fn within<'e>(
    subject: &Subject<'_, 'e>,
    relation: &ExpectRelation,
    span: Span,
    run: &Run<'_, 'e>,
    diags: &mut Diagnostics,
) -> Option<Option<Expr<'e>>> {
    match (relation.relation, &relation.within) {
        (ExpectOp::Close, None) => {
            diags.push(ExpectError::NoTolerance { span });
            None
        }
        (ExpectOp::Close, Some(expr)) => entry(subject, run, expr, diags).map(Some),
        (_, Some(within)) => {
            diags.push(ExpectError::UnusedTolerance { span: within.span });
            None
        }
        (_, None) => Some(None),
    }
}

/// The instant that follows `at`.
pub fn instant(
    subject: &Subject<'_, '_>,
    at: &syntax::Expr,
    diags: &mut Diagnostics,
) -> Option<f64> {
    let entry = entry(subject, &Run::Unknown, at, diags)?;
    let instant = subject.system.parameters().value(entry);
    within_run(subject, instant, at, diags).then_some(instant)
}

fn within_run(
    subject: &Subject<'_, '_>,
    instant: f64,
    at: &syntax::Expr,
    diags: &mut Diagnostics,
) -> bool {
    let is_inside = (0.0..=subject.horizon).contains(&instant);
    if !is_inside {
        diags.push(ExpectError::OutsideRun {
            instant: significant(instant, 12),
            horizon: significant(subject.horizon, 12),
            span: at.span,
        });
    }
    is_inside
}

/// A number that is known before the run, in parameters and words.
fn entry<'e>(
    subject: &Subject<'_, 'e>,
    run: &Run<'_, 'e>,
    expr: &syntax::Expr,
    diags: &mut Diagnostics,
) -> Option<Expr<'e>> {
    let words = Words::new(subject, run);
    let value = words.value(expr, diags)?;
    let params = subject.system.parameters();
    match value.as_scalar().map(|entry| subject.system.read(entry)) {
        Some(entry) if !words.has_list.get() && words.unknown(&params, &[entry]).is_none() => {
            Some(entry)
        }
        _ => {
            diags.push(ExpectError::NotAnInstant { span: expr.span });
            None
        }
    }
}

/// A relation beside a run.
enum Found<'k, 'e> {
    Holds,
    Misses(&'k Sides<'e>, f64, Miss),
    /// Why there are no values.
    Without(String),
    Unresolved(Diagnostics),
}

impl<'e> Known<'e> {
    /// Whether a relation holds in a run.
    pub fn holds(
        &mut self,
        subject: &Subject<'_, 'e>,
        relation: (&ExpectRelation, Span),
        trajectory: &Trajectory,
        findings: &Findings,
    ) -> bool {
        let found = self.compare(subject, relation, trajectory, findings);
        matches!(found, Found::Holds)
    }

    /// Compares both sides in a run.
    pub fn evaluate(
        &mut self,
        subject: &Subject<'_, 'e>,
        (relation, span): (&ExpectRelation, Span),
        trajectory: &Trajectory,
        findings: &Findings,
    ) -> Verdict {
        match self.compare(subject, (relation, span), trajectory, findings) {
            Found::Holds => Verdict::Passed,
            Found::Misses(sides, within, miss) => Verdict::Failed {
                expected: expected(relation, &miss.right, within),
                got: match &findings.order {
                    Some(Ok(found)) if sides.has_order => found.account.clone(),
                    _ => miss.describe(),
                },
            },
            Found::Without(got) => Verdict::Failed {
                expected: subject.sources.text(relation.right.span).to_owned(),
                got,
            },
            Found::Unresolved(diags) => verdict_of(&diags),
        }
    }

    /// Both sides with the numbers of the words, resolved anew where words have another number of them.
    fn sides(
        &mut self,
        subject: &Subject<'_, 'e>,
        (relation, span): (&ExpectRelation, Span),
        (trajectory, order): (&Trajectory, f64),
        diags: &mut Diagnostics,
    ) -> Option<(&Sides<'e>, Vec<(Expr<'e>, f64)>)> {
        let numbers = |symbols: &Symbols<'e>| symbols.numbers(subject, trajectory, order);
        if self.sides.is_none() || numbers(&self.symbols).is_none() {
            self.symbols.clear();
            let symbols = &self.symbols;
            let run = Run::Known {
                trajectory,
                order,
                symbols,
            };
            self.sides = resolve(subject, relation, span, &run, diags);
        }
        Some((self.sides.as_ref()?, numbers(&self.symbols)?))
    }

    fn compare(
        &mut self,
        subject: &Subject<'_, 'e>,
        (relation, span): (&ExpectRelation, Span),
        trajectory: &Trajectory,
        findings: &Findings,
    ) -> Found<'_, 'e> {
        let mut diags = Diagnostics::new();
        let order = match &findings.order {
            Some(Ok(found)) => found.order,
            _ => f64::NAN,
        };
        let run = (trajectory, order);
        let Some((sides, words)) = self.sides(subject, (relation, span), run, &mut diags) else {
            return Found::Unresolved(diags);
        };
        let mut known = subject.system.parameters();
        known.extend(words.iter().copied());
        let numbers = numbers(subject, relation, sides, &known, &mut diags);
        let Some(numbers) = numbers else {
            return Found::Unresolved(diags);
        };
        if sides.has_order
            && let Some(Err(reason)) = &findings.order
        {
            return Found::Without(reason.clone());
        }
        let both = |time: f64| {
            both(
                subject,
                trajectory,
                (sides, &numbers),
                (&known, &words),
                time,
            )
        };
        let instants = match (numbers.left_when, numbers.right_when) {
            (When::Always, _) | (_, When::Always) => looks(trajectory, &|time| {
                let [left, right] = both(time).ok()?;
                Some(slack(numbers.within, relation.relation, &left, &right))
            }),
            _ => vec![f64::NAN],
        };
        let are_scalar = [&sides.left, &sides.right].map(|side| side.shape == Shape::Scalar);
        let mut worst: Option<Miss> = None;
        for time in instants {
            let [left, right] = match both(time) {
                Ok(both) => both,
                Err(got) => return Found::Without(got),
            };
            let miss = misses(
                numbers.within,
                relation.relation,
                [&left, &right],
                are_scalar,
            );
            let is_worse = |old: &Miss| miss.as_ref().is_some_and(|(_, by)| *by > old.by);
            if let Some((entry, by)) = miss
                && worst.as_ref().is_none_or(is_worse)
            {
                worst = Some(Miss {
                    time,
                    entry,
                    by,
                    left,
                    right,
                });
            }
        }
        match worst {
            None => Found::Holds,
            Some(miss) => Found::Misses(sides, numbers.within, miss),
        }
    }
}

/// The entries of both sides, or why one has none; `known` are parameters and words.
fn both(
    subject: &Subject<'_, '_>,
    trajectory: &Trajectory,
    (sides, numbers): (&Sides<'_>, &Numbers),
    (known, words): (&Valuation, &[(Expr<'_>, f64)]),
    time: f64,
) -> Result<[Vec<f64>; 2], String> {
    let point = |when: When<f64>| {
        let time = match when {
            When::Run => return Ok(None),
            When::At(instant) => instant,
            When::Always => time,
        };
        let mut point = at(subject, trajectory, time).ok_or_else(|| {
            let reached = trajectory.samples.end().time.first().copied();
            format!(
                "the run ended at {}",
                significant(reached.unwrap_or(0.0), 12)
            )
        })?;
        point.extend(words.iter().copied());
        Ok::<_, String>(Some(point))
    };
    let values = |side: &Tensor<'_>, point: &Option<Valuation>| {
        let point = point.as_ref().unwrap_or(known);
        let entries = side.data.iter();
        entries
            .map(|&entry: &Expr<'_>| point.value(entry))
            .collect()
    };
    let left = point(numbers.left_when)?;
    let of_left = values(&sides.left, &left);
    let of_right = match numbers.right_when == numbers.left_when {
        true => values(&sides.right, &left),
        false => values(&sides.right, &point(numbers.right_when)?),
    };
    Ok([of_left, of_right])
}

/// The instants at which what is to hold always is looked at: those that are reported, and those within steps at which it is
/// missed, of a few in each and of those between them where it is closest to be missed. A scheme of fixed steps promises
/// nothing within them.
fn looks(trajectory: &Trajectory, slack: &impl Fn(f64) -> Option<f64>) -> Vec<f64> {
    let mut looks = trajectory.samples.time.clone();
    let pieces = &trajectory.dense.pieces;
    let parts = (LOOKS / pieces.len().max(1)).min(MOST_PARTS);
    if trajectory.setup.method.name == MethodKind::Timestepping.word() || parts < 2 {
        return looks;
    }
    let mut close: Vec<(f64, [f64; 2])> = Vec::new();
    for piece in pieces.iter() {
        let at = |k: usize| piece.from + (piece.to - piece.from) * (k as f64 / parts as f64);
        let slacks: Vec<Option<f64>> = (0..=parts).map(|k| slack(at(k))).collect();
        for k in 1..parts {
            if let [Some(before), Some(here), Some(behind)] = slacks[k - 1..=k + 1]
                && here <= before.min(behind)
            {
                close.push((here, [at(k - 1), at(k + 1)]));
            }
        }
        let missed = (1..parts).filter(|&k| slacks[k].is_some_and(|slack| slack < 0.0));
        looks.extend(missed.map(at));
    }
    close.sort_by(|a, b| a.0.total_cmp(&b.0));
    close.truncate(SEARCHES);
    let closest = close.into_iter().map(|(_, within)| closest(slack, within));
    looks.extend(closest.filter(|&time| slack(time).is_some_and(|slack| slack < 0.0)));
    looks
}

/// Looks within all steps together, and within each, and places around which the closest one is searched for.
const LOOKS: usize = 2048;
const MOST_PARTS: usize = 256;
const SEARCHES: usize = 8;

/// Where a slack is least between two instants, by golden sections.
fn closest(slack: &impl Fn(f64) -> Option<f64>, [mut from, mut to]: [f64; 2]) -> f64 {
    const SECTIONS: usize = 30;
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let value = |time: f64| slack(time).unwrap_or(f64::INFINITY);
    for _ in 0..SECTIONS {
        let (early, late) = (to - golden * (to - from), from + golden * (to - from));
        match value(early) <= value(late) {
            true => to = late,
            false => from = early,
        }
    }
    0.5 * (from + to)
}

/// The verdict on an expectation that does not resolve in a run.
pub fn verdict_of(diags: &Diagnostics) -> Verdict {
    let codes = diags.codes();
    if let Some(code) = codes.iter().find(|code| code.starts_with("E09")) {
        return Verdict::Unsupported { code: code.clone() };
    }
    let got = match diags.errors().next() {
        Some(error) => error.to_string(),
        None => "nothing".into(),
    };
    Verdict::Failed {
        expected: "a value".into(),
        got,
    }
}
