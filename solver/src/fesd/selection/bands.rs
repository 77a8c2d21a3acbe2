//! What counts as zero: values of members below what rounding leaves of their terms.

use crate::fesd::modes::Modes;
use crate::fesd::run::Run;
use crate::fesd::system::{ComplementaritySystem, Member, NEGLIGIBLE, Pair, Zero};
use crate::fesd::watch::BAND;

/// Values of the continuous member of each pair below which it is zero: what rounding leaves of
/// its terms, or of itself where these are zero.
pub(crate) struct Bands<'s> {
    pub system: &'s ComplementaritySystem,
    pub of: Vec<f64>,
    /// How long steps are about.
    pub length: f64,
}

impl<'s> Bands<'s> {
    /// Those where a run is.
    pub fn at(modes: &Modes<'s>, run: &Run, length: f64) -> Self {
        let (system, place) = (modes.system, &run.place);
        let (n, full) = (place.x.len(), &system.full);
        let slopes = slopes(system, &place.point(&modes.numbers).with(&place.z));
        let n_rows = full.equations.n_outputs() - n;
        // Sums of terms, and the largest one that is balanced.
        let mut sizes = vec![[0.0_f64; 2]; n_rows];
        for (&(row, input), slope) in full.slopes.entries.iter().zip(&slopes) {
            let Some(row) = row.checked_sub(n) else {
                continue;
            };
            match input {
                0 => sizes[row][0] += slope.abs() * place.t.abs(),
                _ if input <= n => sizes[row][0] += slope.abs() * run.scale[input - 1],
                // λ = g_i - μ is as rounded as μ, although x may be in no term of g_i.
                _ if system.is_continuous(input - 1 - n) => {
                    let term = (slope * place.z[input - 1 - n]).abs();
                    sizes[row][1] = sizes[row][1].max(term);
                }
                _ => {}
            }
        }
        let mut of_variable = vec![0.0_f64; place.z.len()];
        for (&(row, input), slope) in full.slopes.entries.iter().zip(&slopes) {
            if row >= n && input > n && *slope != 0.0 {
                let size = &mut of_variable[input - 1 - n];
                let [sum, balanced] = sizes[row - n];
                *size = size.max(sum).max(balanced);
            }
        }
        let band = |pair: &Pair| {
            let members = [pair.left, pair.right].into_iter();
            let continuous = members.filter(|m| system.is_continuous(m.variable));
            let size = |m: Member| of_variable[m.variable].max(m.value(&place.z).abs());
            BAND * continuous.map(size).fold(0.0, f64::max)
        };
        let mut of: Vec<f64> = system.pairs.iter().map(band).collect();
        run.slips.raise(system, &mut of);
        Bands { system, of, length }
    }

    /// The largest size of a member.
    pub fn largest_size(&self) -> f64 {
        let sizes = self.of.iter().map(|band| band / BAND);
        sizes.fold(0.0, f64::max)
    }

    /// What the member of a pair that is not zero is compared with: what jumps, like θ and α, is up to 1, and a slip
    /// velocity what it is where it stops.
    pub fn size(&self, zeros: &[Zero], pair: usize) -> f64 {
        let (_, member) = self.system.pairs[pair].split(zeros[pair]);
        match self.system.is_continuous(member.variable) {
            true if self.is_of_disc(pair) => 0.5 * self.of[pair] / BAND,
            true => self.of[pair] / BAND,
            false => 1.0,
        }
    }

    fn is_of_disc(&self, pair: usize) -> bool {
        let mut discs = self.system.discs.iter();
        discs.any(|disc| disc.pair == pair)
    }
}

/// Raises the sizes of algebraic states by what they balance: y = 0 is known to the rounding of the other terms of
/// its rows, the least of (Σ |∂g/∂x_j x_j| + |g - ∇g·(x, z)|) / |∂g/∂y| without its own, next to which it may be
/// [`NEGLIGIBLE`].
pub(crate) fn measure_balance(modes: &Modes, run: &mut Run) {
    let (system, place, scale) = (modes.system, &run.place, &mut run.scale);
    let (n, full, algebraic) = (place.x.len(), &system.full, &system.algebraic_states);
    if algebraic.is_empty() {
        return;
    }
    let inputs = place.point(&modes.numbers).with(&place.z);
    let slopes = slopes(system, &inputs);
    let mut left = vec![0.0; full.equations.n_outputs()];
    full.equations
        .eval(&inputs, &mut left, &mut full.equations.scratch());
    let mut terms = vec![0.0; left.len()];
    for (&(row, input), slope) in full.slopes.entries.iter().zip(&slopes) {
        if input > 0 {
            left[row] -= slope * inputs[input];
        }
        if (1..=n).contains(&input) {
            terms[row] += slope.abs() * scale[input - 1];
        }
    }
    for &y in algebraic {
        let of_rows = full.slopes.entries.iter().zip(&slopes);
        let of_rows = of_rows.filter(|((row, input), _)| *row >= n && *input == 1 + y);
        let balanced = of_rows.filter_map(|(&(row, _), slope)| {
            let all = terms[row] + left[row].abs();
            let others = all - slope.abs() * scale[y];
            (others > BAND * all).then_some(others / slope.abs())
        });
        let least = balanced.fold(f64::INFINITY, f64::min);
        if least.is_finite() {
            scale[y] = scale[y].max(NEGLIGIBLE * least);
        }
    }
}

/// ∂(f, g) at these inputs, entry by entry.
pub(crate) fn slopes(system: &ComplementaritySystem, inputs: &[f64]) -> Vec<f64> {
    let full = &system.full.slopes;
    let mut slopes = vec![0.0; full.entries.len()];
    full.tape
        .eval(inputs, &mut slopes, &mut full.tape.scratch());
    slopes
}
