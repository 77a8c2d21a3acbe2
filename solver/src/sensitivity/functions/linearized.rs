//! f and φ_K with their derivatives at a point of a mode.

use super::{Functions, Moved, Slots};
use crate::linalg::DenseLu;
use crate::tape::Lane;

/// f with its derivatives at a point of a mode, those of α_K in it.
pub(in crate::sensitivity) struct Linearized {
    pub f: Vec<f64>,
    /// (state, slot, ∂f/∂slot), state by state.
    pub(super) entries: Vec<(usize, usize, f64)>,
    /// K, and its equations.
    pub sliding: Vec<usize>,
    pub(super) equations: Option<Equations>,
}

impl Linearized {
    /// The derivatives of f and of α_K with a point that moves in a direction.
    pub fn along(&self, functions: &Functions, moved: Moved, direction: usize) -> [Vec<f64>; 2] {
        let term = |slot, slope| functions.term(slot, slope, moved, direction);
        let mut alpha = Vec::new();
        if let Some(equations) = &self.equations {
            alpha = equations.sums(|slot, slope| -term(slot, slope));
            equations.lu.solve(&mut alpha);
        }
        let f = self.rates(functions.slots, term, |at, slope| slope * alpha[at]);
        [f, alpha]
    }

    /// The derivatives of f in lanes of directions, by the terms of slopes.
    pub fn along_lanes<L: Lane>(&self, slots: Slots, term: impl Fn(usize, f64) -> L) -> Vec<L> {
        let mut alpha = Vec::new();
        if let Some(equations) = &self.equations {
            alpha = equations.sums(|slot, slope| -term(slot, slope));
            equations.lu.solve_lanes(&mut alpha);
        }
        self.rates(slots, term, |at, slope| L::splat(slope) * alpha[at])
    }

    /// How large the terms of these are.
    pub fn terms_lanes<L: Lane>(&self, slots: Slots, term: impl Fn(usize, f64) -> L) -> Vec<L> {
        let size = |slot, slope| term(slot, slope).map(f64::abs);
        let mut alpha = Vec::new();
        if let Some(equations) = &self.equations {
            alpha = equations.sums(size);
            equations.lu.solve_lanes(&mut alpha);
        }
        self.rates(slots, size, |at, slope| {
            (L::splat(slope) * alpha[at]).map(f64::abs)
        })
    }

    /// How large the terms of the derivatives of f are.
    pub fn terms(&self, functions: &Functions, moved: Moved, direction: usize) -> Vec<f64> {
        let size = |slot, slope: f64| (slope * functions.by(slot, moved, direction)[1]).abs();
        let mut alpha = Vec::new();
        if let Some(equations) = &self.equations {
            alpha = equations.sums(size);
            equations.lu.solve(&mut alpha);
        }
        self.rates(functions.slots, size, |at, slope| (slope * alpha[at]).abs())
    }

    /// Sums over the slopes of each rate, of those by slots and by the α of what slides.
    pub fn rates<L: Lane>(
        &self,
        slots: Slots,
        term: impl Fn(usize, f64) -> L,
        of_alpha: impl Fn(usize, f64) -> L,
    ) -> Vec<L> {
        let nothing = L::splat(0.0);
        let mut sums = vec![nothing; self.f.len()];
        for &(state, slot, slope) in &self.entries {
            let term = match slots.switch(slot) {
                None => term(slot, slope),
                Some(switch) => {
                    let at = self.sliding.binary_search(&switch);
                    at.map_or(nothing, |at| of_alpha(at, slope))
                }
            };
            sums[state] = sums[state] + term;
        }
        sums
    }

    /// The derivatives of f and of φ_K with (x, α_K) in a direction.
    pub fn open(&self, functions: &Functions, y: &[f64], direction: usize, out: &mut [f64]) {
        let (tangent, alpha) = y.split_at(self.f.len());
        let term = |slot, slope| functions.term(slot, slope, Moved::still(tangent), direction);
        let (rates, residuals) = out.split_at_mut(tangent.len());
        rates.copy_from_slice(&self.rates(functions.slots, term, |at, slope| slope * alpha[at]));
        let Some(equations) = &self.equations else {
            return;
        };
        let of_alpha = |slot: usize| {
            let switch = functions.slots.switch(slot)?;
            Some(alpha[self.sliding.binary_search(&switch).ok()?])
        };
        let sums = equations.sums(|slot, slope| match of_alpha(slot) {
            Some(alpha) => slope * alpha,
            None => term(slot, slope),
        });
        residuals.copy_from_slice(&sums);
    }

    /// ∂(f, φ_K)/∂(x, α_K), row major.
    pub fn matrix(&self, slots: Slots, out: &mut [f64]) {
        let n = self.f.len();
        let width = n + self.sliding.len();
        out.fill(0.0);
        let column = |slot: usize| match slots.switch(slot) {
            Some(switch) => Some(n + self.sliding.binary_search(&switch).ok()?),
            None => slot.checked_sub(1).filter(|state| *state < n),
        };
        let rows = self.equations.iter().flat_map(|equations| &equations.rows);
        let rows = rows.enumerate();
        let phi = rows.flat_map(|(at, row)| row.iter().map(move |&(s, slope)| (n + at, s, slope)));
        for (row, slot, slope) in self.entries.iter().copied().chain(phi) {
            if let Some(column) = column(slot) {
                out[row * width + column] += slope;
            }
        }
    }

    /// The derivatives of α of a switch that slides, by slots.
    pub fn alpha(&self, switch: usize) -> Vec<(usize, f64)> {
        let (Some(equations), Ok(at)) = (&self.equations, self.sliding.binary_search(&switch))
        else {
            return Vec::new();
        };
        let mut weights = vec![0.0; self.sliding.len()];
        weights[at] = -1.0;
        equations.lu.solve_transposed(&mut weights);
        let rows = equations.rows.iter().zip(weights);
        rows.flat_map(|(row, weight)| row.iter().map(move |&(slot, slope)| (slot, weight * slope)))
            .collect()
    }
}

/// φ_K with its derivatives by slots, and A factored.
pub(super) struct Equations {
    pub lu: DenseLu,
    pub values: Vec<f64>,
    pub rows: Vec<Vec<(usize, f64)>>,
}

impl Equations {
    /// Sums over the slopes of each φ.
    fn sums<L: Lane>(&self, term: impl Fn(usize, f64) -> L) -> Vec<L> {
        let sum = |row: &Vec<(usize, f64)>| {
            let terms = row.iter().map(|&(slot, slope)| term(slot, slope));
            terms.fold(L::splat(0.0), |sum, term| sum + term)
        };
        self.rows.iter().map(sum).collect()
    }
}
