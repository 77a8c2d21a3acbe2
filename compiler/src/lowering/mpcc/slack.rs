//! By how much soft constraints are missed.

use std::ops::Range;

use super::{Evaluator, Mpcc, Variables};

/// The slacks of lower <= v - Σ ±s <= upper: 0 <= s⁻, s⁺, of which one misses it below and one above, or one s of any sign.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slack {
    /// The block of the rows.
    pub row: usize,
    /// The block of what they cost.
    pub penalty: usize,
    /// The sign of each slack of a place in the sum.
    pub signs: Vec<i8>,
    /// The block of the variables, those of a place next to each other.
    pub block: usize,
}

impl Variables {
    fn indices(&self) -> Range<usize> {
        self.start..self.start + self.bounds.len()
    }
}

impl Mpcc<'_> {
    /// Gives slacks the least values with which soft constraints hold at a point, the rest of which stays.
    pub fn slacken(&self, w: &mut [f64]) {
        let all = self
            .stated
            .iter()
            .filter_map(|stated| stated.slack.as_ref());
        for slack in all {
            let block = &self.blocks[slack.row];
            let least = self.variables[slack.block].bounds[0].lower;
            let (lower, upper) = block.bounds.first().copied().unwrap_or_default();
            let variables = self.variables[slack.block].indices();
            w[variables.clone()].fill(0.0);
            let mut values = vec![0.0; block.n_rows()];
            let rows = Evaluator::of(self, std::slice::from_ref(block));
            rows.expect("kernels are smooth").values(w, &mut values);
            let places = w[variables].chunks_mut(slack.signs.len());
            for (slacks, &value) in places.zip(&values) {
                // How far above, or below as a negative number.
                let missed = value - value.max(lower).min(upper);
                for (s, &sign) in slacks.iter_mut().zip(&slack.signs) {
                    *s = (f64::from(sign) * missed).max(least);
                }
            }
        }
    }
}
