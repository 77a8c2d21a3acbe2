//! The end of an element where functions that the mode keeps have their values.
//!
//! ψ' = μ φ along a mode that slides on φ = 0 leaves ψ as it is: the gap of a contact that has closed for good, whose
//! rate is φ. Finite elements keep φ = 0 and let ψ drift by their error, off its surface. The end is shifted by the
//! least change, next to the sizes s of the states, that takes both back,
//!
//! x₁ + S² Jᵀ ν,   ψ(x₁ + S² Jᵀ ν) = ψ(x₀),   J = ∂ψ/∂x,   S = diag(s),
//!
//! which is as large as the drift (Hairer, Lubich & Wanner 2006, IV.4).

use crate::fesd::system::evaluator::Evaluator;
use crate::fesd::system::full::Functions;
use crate::linalg::DenseLu;

/// Steps of Newton's method with the first Jacobian: what is left is quadratic in what there was.
const ITERATIONS: usize = 3;

/// Memory for the end of an element.
pub(crate) struct Keeper {
    at: Evaluator,
    /// s.
    sizes: Vec<f64>,
    /// ψ(x₀).
    values: Vec<f64>,
    /// S² Jᵀ, column by column.
    directions: Vec<f64>,
    /// J S² Jᵀ.
    matrix: Vec<f64>,
    lu: DenseLu,
    rhs: Vec<f64>,
}

impl Keeper {
    /// Memory for states of the length n.
    pub fn new(n: usize, kept: &Functions) -> Self {
        let n_kept = kept.tape.n_outputs();
        let tapes = [&kept.tape, &kept.slopes.tape];
        Keeper {
            at: Evaluator::new(kept.tape.n_inputs(), tapes),
            sizes: vec![0.0; n],
            values: vec![0.0; n_kept],
            directions: vec![0.0; n_kept * n],
            matrix: vec![0.0; n_kept * n_kept],
            lu: DenseLu::new(n_kept),
            rhs: vec![0.0; n_kept],
        }
    }

    /// Takes the values at the start of an element, and the sizes of the states.
    pub fn start(&mut self, kept: &Functions, t: f64, x: &[f64], sizes: &[f64], numbers: &[f64]) {
        self.sizes.copy_from_slice(sizes);
        self.at.set(t, x.iter().copied());
        self.at.set_numbers(numbers);
        let now = self.at.eval(&kept.tape);
        for (value, now) in self.values.iter_mut().zip(now) {
            *value = now;
        }
    }

    /// Shifts x at `t` to where the values are those of the start; leaves it where no direction leads there.
    pub fn shift(&mut self, kept: &Functions, t: f64, x: &mut [f64]) {
        let n = x.len();
        self.at.set(t, x.iter().copied());
        if !self.factor(kept, n) {
            return;
        }
        for _ in 0..ITERATIONS {
            let now = self.at.eval(&kept.tape);
            for ((rhs, value), now) in self.rhs.iter_mut().zip(&self.values).zip(now) {
                *rhs = value - now;
            }
            self.lu.solve(&mut self.rhs);
            for (nu, direction) in self.rhs.iter().zip(self.directions.chunks_exact(n)) {
                for (x, by_nu) in self.at.inputs[1..=n].iter_mut().zip(direction) {
                    *x += nu * by_nu;
                }
            }
        }
        if self.at.inputs[1..=n].iter().all(|x| x.is_finite()) {
            x.copy_from_slice(&self.at.inputs[1..=n]);
        }
    }

    /// Factors J S² Jᵀ where the inputs are.
    fn factor(&mut self, kept: &Functions, n: usize) -> bool {
        let slopes = &kept.slopes;
        self.directions.fill(0.0);
        for (&(row, input), slope) in slopes.entries.iter().zip(self.at.eval(&slopes.tape)) {
            let size = self.sizes[input - 1];
            self.directions[row * n + input - 1] = size * size * slope;
        }
        self.matrix.fill(0.0);
        for (&(row, input), slope) in slopes.entries.iter().zip(self.at.results(&slopes.tape)) {
            let columns = self.directions.chunks_exact(n);
            let products = self.matrix[row * self.rhs.len()..].iter_mut().zip(columns);
            for (entry, direction) in products {
                *entry += slope * direction[input - 1];
            }
        }
        self.lu.factor(&self.matrix).is_ok()
    }
}
