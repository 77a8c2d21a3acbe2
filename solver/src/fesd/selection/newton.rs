//! One solution of the directional problem, where the pairs that meet are too many to try all sets.
//!
//! 0 ≤ a ⟂ b ≥ 0 is replaced by the smoothed Fischer-Burmeister equation
//! a + b - √(a² + b² + 2σ) = 0, whose solutions satisfy ab = σ, a, b > 0; Newton's method follows
//! them from σ = 1 towards zero (Kanzow 1996).

use super::directional::{Directional, members};
use crate::fesd::system::{ComplementaritySystem, Zero};

/// Where σ ends, and what it is multiplied with; pairs are of size 1 by their scales.
const LAST: f64 = 1e-20;
const SHRINK: f64 = 0.1;

/// Newton iterations for one σ, and halvings of their steps.
const MAX_ITERATIONS: usize = 30;
const MAX_HALVINGS: usize = 20;

impl Directional {
    /// u where the open pairs are complementary and the others have the given members zero.
    pub(crate) fn smooth(
        &mut self,
        system: &ComplementaritySystem,
        zeros: &[Zero],
        open: &[usize],
        mut u: Vec<f64>,
    ) -> Option<Vec<f64>> {
        if self.of_rates.is_empty() {
            self.of_rates = rows_of_rates(system);
        }
        // Rates are measured by the largest one at the start.
        self.linearize(system, &u);
        let size = match self.largest_rate() {
            0.0 => 1.0,
            size => size,
        };
        let mut sigma = 1.0;
        while sigma > LAST {
            for _ in 0..MAX_ITERATIONS {
                let before = self.assemble(system, zeros, open, &u, size, sigma);
                if before <= 1e-12 {
                    break;
                }
                let start = u.clone();
                let mut share = 1.0;
                if self.step(&mut u, share).is_none() {
                    // In the middle of a face of solutions the equations without σ determine none of them.
                    return start.iter().all(|u| u.is_finite()).then_some(start);
                }
                let step: Vec<f64> = u.iter().zip(&start).map(|(u, start)| u - start).collect();
                for _ in 0..MAX_HALVINGS {
                    if self.assemble(system, zeros, open, &u, size, sigma)
                        <= (1.0 - 1e-4 * share) * before
                    {
                        break;
                    }
                    share *= 0.5;
                    for ((u, start), step) in u.iter_mut().zip(&start).zip(&step) {
                        *u = start + share * step;
                    }
                }
            }
            sigma *= SHRINK;
        }
        Some(u)
    }

    /// `matrix` and `rhs` of a Newton step at u, of z that jumps and z' of z that is continuous: the Jacobian of F, and -F.
    /// Its rows are g or g', and for each pair with members a and b a + b - √(a² + b² + 2σ) where it is `open`, and else the
    /// member that is zero. Members that are rates are in units of `size`. Returns ‖F‖.
    fn assemble(
        &mut self,
        system: &ComplementaritySystem,
        zeros: &[Zero],
        open: &[usize],
        u: &[f64],
        size: f64,
        sigma: f64,
    ) -> f64 {
        self.linearize(system, u);
        let n_equations = system.full.directional.n_outputs();
        for (row, &zero) in zeros.iter().enumerate() {
            let pair = &system.pairs[row];
            let (left, right) = members(system, row, u);
            let at = n_equations + row;
            if !open.contains(&row) {
                let (vanishing, _) = pair.split(zero);
                self.rhs[at] = -if zero == Zero::Left { left } else { right };
                *self.matrix.entry(at, vanishing.variable) = vanishing.slope();
                continue;
            }
            // What is continuous is here a rate; what jumps is of size 1.
            let scale = |variable: usize| {
                if system.is_continuous(variable) {
                    size
                } else {
                    1.0
                }
            };
            let scales = [scale(pair.left.variable), scale(pair.right.variable)];
            let (a, b) = (left / scales[0], right / scales[1]);
            let root = (a * a + b * b + 2.0 * sigma).sqrt();
            self.rhs[at] = root - a - b;
            *self.matrix.entry(at, pair.left.variable) +=
                (1.0 - a / root) * pair.left.slope() / scales[0];
            *self.matrix.entry(at, pair.right.variable) +=
                (1.0 - b / root) * pair.right.slope() / scales[1];
        }
        let rows = self
            .residuals(size)
            .chain(self.rhs[n_equations..].iter().copied());
        rows.map(|row| row * row).sum::<f64>().sqrt()
    }
}

/// Which rows of the directional form of g have the rate of something in them.
fn rows_of_rates(system: &ComplementaritySystem) -> Vec<bool> {
    let (full, first) = (&system.full, 1 + system.n_states() + system.n_algebraics());
    let mut of_rates = vec![false; full.directional.n_outputs()];
    for &(row, input) in &full.directional_slopes.entries {
        of_rates[row] |= system.is_continuous(input - first);
    }
    of_rates
}
