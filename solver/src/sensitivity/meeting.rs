//! What is zero at a point of a mode, and has to stay so to first order as the point moves: surfaces on which it lies, bounds of
//! α, and the equations that keep algebraic states.

use super::adjoint::Costate;
use super::functions::{Functions, Linearized, Moved, Point};
use super::run::STAYS;
use super::why::Why;
use crate::hybrid::{Effect, Input, Role, Side};
use crate::linalg::DenseLu;

/// How well a run knows where it is.
pub(super) struct Known<'a> {
    /// The share of its terms up to which ψ is zero.
    pub share: f64,
    /// How large states have been.
    pub sizes: &'a [f64],
    /// How far the instant may be off, and the rates by which that moves states.
    pub instant: f64,
    pub f: &'a [f64],
}

impl Known<'_> {
    /// How far a function may be off.
    fn width(&self, slopes: &[(usize, f64)], t: f64) -> f64 {
        let n = self.sizes.len();
        let (mut terms, mut rate) = (0.0, 0.0);
        for &(slot, slope) in slopes {
            match slot {
                0 => {
                    terms += (slope * t).abs();
                    rate += slope;
                }
                slot if slot <= n => {
                    terms += slope.abs() * self.sizes[slot - 1];
                    rate += slope * self.f[slot - 1];
                }
                _ => {}
            }
        }
        self.share * terms + (rate * self.instant).abs()
    }
}

/// A point in a mode.
#[derive(Clone, Copy)]
pub(super) struct Meeting<'a> {
    pub point: Point<'a>,
    pub sides: &'a [Side],
    /// Of each switch, whether nothing but outputs looks at it.
    pub observers: &'a [bool],
}

/// The equations that keep algebraic states.
pub(super) struct Algebraic {
    rows: Vec<Vec<(usize, f64)>>,
    lu: DenseLu,
}

impl Algebraic {
    /// Gives z the tangent that they want: h_z Z = -(h_y Y + h_t dt/dp + h_p).
    pub fn keep(&self, functions: &Functions, tangent: &mut [f64], time: f64, direction: usize) {
        let algebraics = &functions.system.algebraics;
        algebraics.iter().for_each(|&z| tangent[z] = 0.0);
        let moved = Moved {
            time,
            ..Moved::still(tangent)
        };
        let rows = self.rows.iter();
        let rhs = rows.map(|row| -functions.along(row, moved, direction)[0]);
        let mut rhs: Vec<f64> = rhs.collect();
        self.lu.solve(&mut rhs);
        for (&z, value) in algebraics.iter().zip(rhs) {
            tangent[z] = value;
        }
    }

    /// How large the terms of that are, |h_z⁻¹| of those of the rows, for terms of the others of such sizes.
    pub fn sizes(&self, functions: &Functions, moved: Moved, direction: usize) -> Vec<f64> {
        let rows = self.rows.iter();
        let terms = rows.map(|row| functions.along(row, moved, direction)[1]);
        let terms: Vec<f64> = terms.collect();
        let of_state = |i: usize| {
            let mut weights = vec![0.0; terms.len()];
            weights[i] = 1.0;
            self.lu.solve_transposed(&mut weights);
            let weighted = weights.iter().zip(&terms).map(|(w, term)| w.abs() * term);
            weighted.sum()
        };
        (0..terms.len()).map(of_state).collect()
    }

    /// The transpose of what keeps them.
    pub fn transpose(&self, functions: &Functions, costate: &mut Costate) {
        for (row, weight) in self.rows.iter().zip(self.weights(functions, costate)) {
            costate.add(functions.slots, row, weight);
        }
        self.forget(functions, costate);
    }

    /// Adds how large the terms of the transpose of a row are to how large those of the row are.
    pub fn spread(&self, functions: &Functions, row: &Costate, size: &mut Costate) {
        for (row, weight) in self.rows.iter().zip(self.weights(functions, row)) {
            size.add(functions.slots, &magnitudes(row), weight.abs());
        }
        self.forget(functions, size);
    }

    /// What weights of z are of the equations.
    fn weights(&self, functions: &Functions, costate: &Costate) -> Vec<f64> {
        let weights = functions.system.algebraics.iter();
        let mut weights: Vec<f64> = weights.map(|&z| -costate.x[z]).collect();
        self.lu.solve_transposed(&mut weights);
        weights
    }

    fn forget(&self, functions: &Functions, costate: &mut Costate) {
        let algebraics = &functions.system.algebraics;
        algebraics.iter().for_each(|&z| costate.x[z] = 0.0);
    }
}

impl Meeting<'_> {
    /// Whether f alone sees a kink of a switch: then its sides act for no time to first order where it is passed.
    pub fn is_passed(
        &self,
        functions: &Functions,
        i: usize,
        met: &[usize],
        laws: &[usize],
    ) -> bool {
        let system = &functions.system;
        if !system.switches[i].is_continuous || system.role(i) != Role::Step {
            return false;
        }
        let reads = |&law: &usize| match &system.laws[law].effect {
            Effect::Reset(reset) => reset.inputs.contains(&Input::Alpha(i)),
            Effect::Impact(impact) => impact.inputs.contains(&Input::Alpha(i)),
            Effect::Stop => false,
        };
        let is_outer = |k: usize| self.sides[k] == Side::Slide || met.contains(&k);
        let mut outer = (0..self.sides.len()).filter(|&k| is_outer(k));
        !system.laws.iter().any(|law| law.guard.looks_at(i))
            && !laws.iter().any(reads)
            && !outer.any(|k| system.switches[k].inside.contains(&i))
    }

    /// What is zero at the point and has to stay so as it moves: of a switch on whose surface it is, ψ, with those of its
    /// derivatives that are zero where it slides. Those on one side of their surface alone that are `met` are known to be on
    /// it, and `laws` jump.
    pub fn held(
        &self,
        functions: &mut Functions,
        known: &Known,
        [met, laws]: [&[usize]; 2],
    ) -> Vec<Held> {
        let system = functions.system.clone();
        let mut all = Vec::new();
        for i in 0..self.sides.len() {
            let is_other = self.observers[i] || system.is_idle(i, self.sides);
            if is_other || self.is_passed(functions, i, met, laws) {
                continue;
            }
            let slides = self.sides[i] == Side::Slide;
            let orders = if slides {
                functions.n_derivatives(i)
            } else {
                0
            };
            for order in 0..=orders {
                let psi = functions.psi(i, order, self.sides);
                let slopes = psi.slopes(&self.point, &mut functions.registers);
                let value = psi.value(&self.point, &mut functions.registers);
                let is_on = slides || value.abs() <= known.width(&slopes, self.point.t);
                if is_on || met.contains(&i) {
                    all.push(Held {
                        switch: i,
                        slopes,
                        slides,
                    });
                }
            }
        }
        all
    }

    /// What keeps algebraic states.
    pub fn algebraic(&self, functions: &mut Functions) -> Result<Algebraic, Why> {
        let system = functions.system.clone();
        let n = system.algebraics.len();
        let kept = |&i: &usize| self.sides[i] == Side::Slide && system.role(i) != Role::Step;
        let rows = (0..self.sides.len()).filter(kept).map(|i| {
            let psi = functions.psi(i, functions.n_derivatives(i), self.sides);
            psi.slopes(&self.point, &mut functions.registers)
        });
        let rows: Vec<Vec<(usize, f64)>> = rows.collect();
        if rows.len() != n {
            return Err(Why::Singular);
        }
        let place = |slot: usize| system.algebraics.binary_search(&slot.checked_sub(1)?).ok();
        let mut matrix = vec![0.0; n * n];
        for (row, slopes) in rows.iter().enumerate() {
            for &(slot, slope) in slopes {
                if let Some(column) = place(slot) {
                    matrix[row * n + column] += slope;
                }
            }
        }
        let mut lu = DenseLu::new(n);
        lu.factor(&matrix).map_err(|_| Why::Singular)?;
        Ok(Algebraic { rows, lu })
    }

    /// The α that are at a bound and have to stay there as the point moves.
    pub fn bounded(
        &self,
        functions: &Functions,
        (linear, known): (&Linearized, &Known),
        but: Option<usize>,
    ) -> Vec<Held> {
        let system = &functions.system;
        let at_bound = |i: usize| {
            if self.sides[i] != Side::Slide || but == Some(i) || self.observers[i] {
                return None;
            }
            let distances = system.switches[i].limits().iter();
            let distances = distances.map(|limit| (self.point.alpha[i] - limit).abs());
            let distance = distances.fold(f64::INFINITY, f64::min);
            if distance == f64::INFINITY {
                return None;
            }
            let slopes = linear.alpha(i);
            let is_at = distance <= known.width(&slopes, self.point.t) + known.share;
            is_at.then_some(Held {
                switch: i,
                slopes,
                slides: false,
            })
        };
        (0..self.sides.len()).filter_map(at_bound).collect()
    }
}

/// What is zero at a point, and has to stay so to first order as the point moves.
pub(super) struct Held {
    pub switch: usize,
    pub slopes: Vec<(usize, f64)>,
    /// Whether it is zero along the mode.
    pub slides: bool,
}

impl Held {
    /// Whether it does not stay so in a direction.
    pub fn is_left(&self, functions: &Functions, moved: Moved, direction: usize) -> bool {
        let [sum, size] = functions.along(&self.slopes, moved, direction);
        is_off(sum, size)
    }
}

/// Whether a sum is more than what rounding leaves of its terms; what is no number may be.
pub(crate) fn is_off(sum: f64, size: f64) -> bool {
    sum.is_nan() || size.is_nan() || sum.abs() > STAYS * size
}

/// How large slopes are.
pub(super) fn magnitudes(slopes: &[(usize, f64)]) -> Vec<(usize, f64)> {
    let slopes = slopes.iter();
    slopes.map(|&(slot, slope)| (slot, slope.abs())).collect()
}
