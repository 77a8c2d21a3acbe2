//! By how much a relation holds in numbers, or is missed.

use crate::report::forms::text::significant;
use crate::syntax::{ExpectOp, ExpectRelation};

/// What rounding does to both sides, as a share of them.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// By how much a relation holds in the entry in which it does so least, negative where it is missed by more than rounding.
pub fn slack(within: f64, relation: ExpectOp, left: &[f64], right: &[f64]) -> f64 {
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
                ExpectOp::Close | ExpectOp::Equal => within - above.abs(),
                ExpectOp::Less | ExpectOp::LessEqual => -above,
                ExpectOp::Greater | ExpectOp::GreaterEqual => above,
            }
    });
    slacks.fold(f64::INFINITY, f64::min)
}

/// A relation that does not hold.
pub struct Miss {
    /// Not a number where the relation is about one instant.
    pub time: f64,
    /// The entry that misses most.
    pub entry: usize,
    pub by: f64,
    pub left: Vec<f64>,
    pub right: Vec<f64>,
}

impl Miss {
    /// What is there instead.
    pub fn describe(&self) -> String {
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

/// The entry that misses the relation most, and by how much.
///
/// A scalar is compared with every entry of the other side. Lists of different length miss, and
/// an empty list misses every scalar: what did not happen shall not pass for what should.
pub fn misses(
    within: f64,
    relation: ExpectOp,
    [left, right]: [&[f64]; 2],
    are_scalar: [bool; 2],
) -> Option<(usize, f64)> {
    let n = match (left.len(), right.len()) {
        (a, b) if a == b => a,
        (_, b @ 1..) if are_scalar[0] => b,
        (a @ 1.., _) if are_scalar[1] => a,
        (a, b) => return Some((a.min(b), f64::INFINITY)),
    };
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
pub fn expected(relation: &ExpectRelation, right: &[f64], within: f64) -> String {
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
