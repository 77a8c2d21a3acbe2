//! `expect x at end ~ [1, 0] within 1e-9;`

use super::error::ExpectError;
use super::values::{Run, Words, at};
use super::{Findings, Subject, Verdict};
use crate::diagnostics::Diagnostics;
use crate::expr::Expr;
use crate::model::{Shape, Tensor};
use crate::report::Trajectory;
use crate::report::forms::text::significant;
use crate::source::Span;
use crate::syntax::{self, ExpectOp, ExpectRelation, ExpectWhen};
use crate::system::experiment::MethodKind;

/// A relation in the terms of the system.
pub struct Sides<'e> {
    left: Tensor<'e>,
    right: Tensor<'e>,
    left_when: When,
    right_when: When,
    within: f64,
    /// Whether a side is about the order of convergence.
    pub has_order: bool,
}

/// When a side is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
enum When {
    /// Once; it does not change over time.
    Run,
    /// At an instant.
    At(f64),
    /// At all reported instants.
    Always,
}

/// Resolves both sides, their instants and the tolerance.
pub fn resolve<'e>(
    subject: &Subject<'_, 'e>,
    relation: &ExpectRelation,
    span: Span,
    run: &Run<'_>,
    diags: &mut Diagnostics,
) -> Option<Sides<'e>> {
    let words = Words::new(subject, run);
    let left_when = match &relation.when {
        ExpectWhen::Run => Some(When::Run),
        ExpectWhen::At(at) => instant(subject, at, diags).map(When::At),
        ExpectWhen::Always => Some(When::Always),
    };
    // Without an instant of its own, the right side is taken together with the left one.
    let right_when = match &relation.right_at {
        Some(at) => instant(subject, at, diags).map(When::At),
        None => left_when,
    };
    let left = side(subject, &words, &relation.left, left_when, diags);
    let right = side(subject, &words, &relation.right, right_when, diags);
    let within = within(subject, relation, span, diags);

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
    let sides = resolve(subject, relation, span, &Run::Unknown, &mut diags);
    let Some(Sides { left, right, .. }) = sides.filter(|sides| {
        let params = subject.system.parameters();
        relation.relation == ExpectOp::Close
            && sides.left_when == When::At(subject.horizon)
            && !words.has_list.get()
            && params.unknown(&sides.right.data).is_none()
    }) else {
        return Vec::new();
    };
    let params = subject.system.parameters();
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
    when: Option<When>,
    diags: &mut Diagnostics,
) -> Option<Tensor<'e>> {
    let value = words
        .value(expr, diags)?
        .map(|entry| subject.system.read(entry));
    if when == Some(When::Run)
        && let Some(var) = subject.system.parameters().unknown(&value.data)
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

fn within(
    subject: &Subject<'_, '_>,
    relation: &ExpectRelation,
    span: Span,
    diags: &mut Diagnostics,
) -> Option<f64> {
    match (relation.relation, &relation.within) {
        (ExpectOp::Close, None) => {
            diags.push(ExpectError::NoTolerance { span });
            None
        }
        (ExpectOp::Close, Some(expr)) => {
            let within = number(subject, expr, diags)?;
            if !(within.is_finite() && within >= 0.0) {
                diags.push(ExpectError::NotATolerance { span: expr.span });
                return None;
            }
            Some(within)
        }
        (_, Some(within)) => {
            diags.push(ExpectError::UnusedTolerance { span: within.span });
            None
        }
        (_, None) => Some(0.0),
    }
}

/// The instant that follows `at`.
pub fn instant(
    subject: &Subject<'_, '_>,
    at: &syntax::Expr,
    diags: &mut Diagnostics,
) -> Option<f64> {
    let instant = number(subject, at, diags)?;
    if !(0.0..=subject.horizon).contains(&instant) {
        diags.push(ExpectError::OutsideRun {
            instant: significant(instant, 12),
            horizon: significant(subject.horizon, 12),
            span: at.span,
        });
        return None;
    }
    Some(instant)
}

/// A number that is known before the run.
fn number(subject: &Subject<'_, '_>, expr: &syntax::Expr, diags: &mut Diagnostics) -> Option<f64> {
    let words = Words::new(subject, &Run::Unknown);
    let value = words.value(expr, diags)?;
    let params = subject.system.parameters();
    match value.as_scalar().map(|entry| subject.system.read(entry)) {
        Some(entry) if !words.has_list.get() && params.unknown(&[entry]).is_none() => {
            Some(params.value(entry))
        }
        _ => {
            diags.push(ExpectError::NotAnInstant { span: expr.span });
            None
        }
    }
}

/// Compares both sides in a run.
pub fn evaluate(
    subject: &Subject<'_, '_>,
    relation: &ExpectRelation,
    span: Span,
    trajectory: &Trajectory,
    findings: &Findings,
) -> Verdict {
    let mut diags = Diagnostics::new();
    let order = match &findings.order {
        Some(Ok(found)) => found.order,
        _ => f64::NAN,
    };
    let run = Run::Known { trajectory, order };
    let Some(sides) = resolve(subject, relation, span, &run, &mut diags) else {
        return verdict_of(&diags);
    };
    if sides.has_order
        && let Some(Err(reason)) = &findings.order
    {
        return Verdict::Failed {
            expected: subject.sources.text(relation.right.span).to_owned(),
            got: reason.clone(),
        };
    }
    let both = |time: f64| {
        let left = values(subject, trajectory, &sides.left, sides.left_when, time)?;
        Ok((
            left,
            values(subject, trajectory, &sides.right, sides.right_when, time)?,
        ))
    };
    let instants = match (sides.left_when, sides.right_when) {
        (When::Always, _) | (_, When::Always) => looks(trajectory, &|time| {
            let (left, right) = both(time).ok()?;
            Some(slack(&sides, relation.relation, &left, &right))
        }),
        _ => vec![f64::NAN],
    };
    let mut worst: Option<Miss> = None;
    for time in instants {
        let (left, right) = match both(time) {
            Ok(both) => both,
            Err(got) => {
                let expected = subject.sources.text(relation.right.span).to_owned();
                return Verdict::Failed { expected, got };
            }
        };
        let miss = misses(&sides, relation.relation, &left, &right);
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
        None => Verdict::Passed,
        Some(miss) => Verdict::Failed {
            expected: expected(relation, &miss.right, sides.within),
            got: match &findings.order {
                Some(Ok(found)) if sides.has_order => found.account.clone(),
                _ => miss.describe(),
            },
        },
    }
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

/// What rounding does to both sides, as a share of them.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

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

/// By how much a relation holds in the entry in which it does so least, negative where it is missed by more than rounding.
fn slack(sides: &Sides<'_>, relation: ExpectOp, left: &[f64], right: &[f64]) -> f64 {
    let sizes = [left.len(), right.len()];
    let is_list = sizes.contains(&0) || sizes[0] != sizes[1] && !sizes.contains(&1);
    if is_list {
        return f64::NEG_INFINITY;
    }
    let entry = |side: &[f64], k: usize| side[if side.len() == 1 { 0 } else { k }];
    let slacks = (0..left.len().max(right.len())).map(|k| {
        let [a, b] = [left, right].map(|side| entry(side, k));
        let (above, rounding) = (a - b, ROUNDING * a.abs().max(b.abs()));
        rounding
            + match relation {
                ExpectOp::Close | ExpectOp::Equal => sides.within - above.abs(),
                ExpectOp::Less | ExpectOp::LessEqual => -above,
                ExpectOp::Greater | ExpectOp::GreaterEqual => above,
            }
    });
    slacks.fold(f64::INFINITY, f64::min)
}

/// A relation that does not hold.
struct Miss {
    /// Not a number where the relation is about one instant.
    time: f64,
    /// The entry that misses most.
    entry: usize,
    by: f64,
    left: Vec<f64>,
    right: Vec<f64>,
}

impl Miss {
    fn describe(&self) -> String {
        let mut text = show(&self.left);
        if self.left.len() != self.right.len() && self.by.is_infinite() {
            let (got, wanted) = (self.left.len(), self.right.len());
            text += &format!(", {got} entries instead of {wanted}");
        } else if self.left.len().max(self.right.len()) > 1 {
            text += &format!(
                ", off by {} in entry {}",
                significant(self.by, 3),
                self.entry + 1
            );
        } else if self.by.is_finite() && self.by > 0.0 {
            text += &format!(", off by {}", significant(self.by, 3));
        }
        if self.time.is_finite() {
            text += &format!(" at time = {}", significant(self.time, 12));
        }
        text
    }
}

/// The entries of a side, or why it has none.
fn values(
    subject: &Subject<'_, '_>,
    trajectory: &Trajectory,
    side: &Tensor<'_>,
    when: When,
    time: f64,
) -> Result<Vec<f64>, String> {
    let point = match when {
        When::Run => Some(subject.system.parameters()),
        When::At(instant) => at(subject, trajectory, instant),
        When::Always => at(subject, trajectory, time),
    };
    let reached = || {
        trajectory
            .samples
            .end()
            .time
            .first()
            .copied()
            .unwrap_or(0.0)
    };
    let point = point.ok_or_else(|| format!("the run ended at {}", significant(reached(), 12)))?;
    Ok(side
        .data
        .iter()
        .map(|&entry: &Expr<'_>| point.value(entry))
        .collect())
}

/// The entry that misses the relation most, and by how much.
///
/// A scalar is compared with every entry of the other side. Lists of different length miss, and
/// an empty list misses every scalar: what did not happen shall not pass for what should.
fn misses(
    sides: &Sides<'_>,
    relation: ExpectOp,
    left: &[f64],
    right: &[f64],
) -> Option<(usize, f64)> {
    let is_scalar = |side: &Tensor<'_>| side.shape == Shape::Scalar;
    let n = match (left.len(), right.len()) {
        (a, b) if a == b => a,
        (_, b @ 1..) if is_scalar(&sides.left) => b,
        (a @ 1.., _) if is_scalar(&sides.right) => a,
        (a, b) => return Some((a.min(b), f64::INFINITY)),
    };
    let within = sides.within;
    let entry = |side: &[f64], k: usize| side[if side.len() == 1 { 0 } else { k }];
    let missed = (0..n).filter_map(|k| {
        let (a, b) = (entry(left, k), entry(right, k));
        let holds = match relation {
            ExpectOp::Close => (a - b).abs() <= within,
            ExpectOp::Equal => a == b,
            ExpectOp::Less => a < b,
            ExpectOp::LessEqual => a <= b,
            ExpectOp::Greater => a > b,
            ExpectOp::GreaterEqual => a >= b,
        };
        let by = (a - b).abs();
        (!holds).then_some((k, if by.is_nan() { f64::INFINITY } else { by }))
    });
    missed.max_by(|a, b| a.1.total_cmp(&b.1))
}

/// What the right side asks for.
fn expected(relation: &ExpectRelation, right: &[f64], within: f64) -> String {
    let right = show(right);
    match relation.relation {
        ExpectOp::Close => format!("{right} within {within:e}"),
        ExpectOp::Equal => right,
        ExpectOp::Less => format!("< {right}"),
        ExpectOp::LessEqual => format!("<= {right}"),
        ExpectOp::Greater => format!("> {right}"),
        ExpectOp::GreaterEqual => format!(">= {right}"),
    }
}

fn show(values: &[f64]) -> String {
    const MAX: usize = 6;
    let shown: Vec<String> = values
        .iter()
        .take(MAX)
        .map(|&value| significant(value, 14))
        .collect();
    match values {
        [_] => shown.join(""),
        _ if values.len() > MAX => format!("[{}, ... {} entries]", shown.join(", "), values.len()),
        _ => format!("[{}]", shown.join(", ")),
    }
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
