//! One mode: its compiled functions, its Taylor expansion, and its algebra.
//!
//! While surfaces K slide, α_K solves φ_K(t, x, α_K) = 0. The order-k coefficient
//! of φ_K is linear in the order-k coefficient of α_K with the matrix
//! A = ∂φ_K/∂α_K of the expansion point, so one factorization serves all orders:
//! evaluate with α_K,k = 0, solve A α_K,k = -φ_K,k, evaluate again.

use super::control::Probed;
use super::series;
use super::state::State;
use super::{ModeFunctions, Side};
use crate::linalg::{DenseLu, Singular};
use crate::tape::{Jet, Scratch};

pub(crate) struct Mode {
    pub sides: Box<[Side]>,
    /// K: the sliding switches.
    pub sliding: Vec<usize>,
    pub n: usize,
    pub order: usize,
    functions: ModeFunctions,
    jet: Jet,
    field_scratch: Scratch,
    sliding_scratch: Scratch,
    pub inputs: Vec<f64>,
    pub field: Vec<f64>,
    linear: Vec<f64>,
    lu: DenseLu,
    /// Sign of det ∂φ_K/∂α_K at the expansion point.
    orientation: f64,
    /// Σ_l |∂φ_j/∂α_l| at the expansion point.
    pub gains: Vec<f64>,
    /// Size of the terms of f, φ_K and ψ at the expansion point, which may cancel.
    pub terms: Vec<f64>,
    pub probed: Probed,
    rhs: Vec<f64>,
    gram: Vec<f64>,
}

/// Newton iterations for α before the equations count as unsolvable.
const MAX_NEWTON: usize = 30;

impl Mode {
    pub(crate) fn new(sides: &[Side], functions: ModeFunctions, n: usize, order: usize) -> Self {
        let sliding: Vec<usize> = (0..sides.len())
            .filter(|&i| sides[i] == Side::Slide)
            .collect();
        let k = sliding.len();
        let mut jet = Jet::new(&functions.field, order);
        jet.bound_degree(0, 1);
        Mode {
            sides: sides.into(),
            jet,
            field_scratch: functions.field.scratch(),
            sliding_scratch: functions.sliding.scratch(),
            inputs: vec![0.0; 1 + n + k],
            field: vec![0.0; n + k + sides.len()],
            linear: vec![0.0; k * k + k * n + k],
            lu: DenseLu::new(k),
            orientation: 1.0,
            gains: vec![0.0; k],
            terms: vec![0.0; n + k + sides.len()],
            probed: Probed::new(n, sides.len()),
            rhs: vec![0.0; k],
            gram: vec![0.0; k * k],
            n,
            order,
            sliding,
            functions,
        }
    }

    /// Evaluates where `inputs` say.
    pub(crate) fn eval_inputs(&mut self) {
        self.functions
            .field
            .eval(&self.inputs, &mut self.field, &mut self.field_scratch);
    }

    /// Evaluates f, φ_K and ψ; α_K is taken from `alpha` of all switches.
    pub(crate) fn eval(&mut self, t: f64, x: &[f64], alpha: &[f64]) {
        self.inputs[0] = t;
        self.inputs[1..=self.n].copy_from_slice(x);
        for (j, &i) in self.sliding.iter().enumerate() {
            self.inputs[1 + self.n + j] = alpha[i];
        }
        self.eval_inputs();
    }

    /// Evaluates ∂φ_K/∂α_K, ∂ψ_K/∂x and ∂ψ_K/∂t where `eval` was last called.
    pub(crate) fn linearize(&mut self) {
        self.functions
            .sliding
            .eval(&self.inputs, &mut self.linear, &mut self.sliding_scratch);
    }

    pub(crate) fn f(&self) -> &[f64] {
        &self.field[..self.n]
    }

    pub(crate) fn phi(&self) -> &[f64] {
        &self.field[self.n..self.n + self.sliding.len()]
    }

    pub(crate) fn psi(&self) -> &[f64] {
        &self.field[self.n + self.sliding.len()..]
    }

    /// ∂φ_row/∂α_col, both counted within K.
    pub(crate) fn coupling(&self, row: usize, col: usize) -> f64 {
        self.linear[row * self.sliding.len() + col]
    }

    /// ∂ψ_row/∂x, row counted within K.
    pub(crate) fn gradient(&self, row: usize) -> &[f64] {
        let k = self.sliding.len();
        &self.linear[k * k + row * self.n..k * k + (row + 1) * self.n]
    }

    /// ∂ψ_row/∂t, row counted within K.
    pub(crate) fn time_gradient(&self, row: usize) -> f64 {
        let k = self.sliding.len();
        self.linear[k * k + k * self.n + row]
    }

    /// Solves φ_K(α_K) = 0 by Newton's method from the given α; leaves A factored.
    pub(crate) fn solve_alpha(
        &mut self,
        t: f64,
        x: &[f64],
        alpha: &mut [f64],
    ) -> Result<(), Singular> {
        let k = self.sliding.len();
        self.eval(t, x, alpha);
        for _ in 0..MAX_NEWTON {
            if k == 0 {
                return Ok(());
            }
            self.linearize();
            self.lu.factor(&self.linear[..k * k])?;
            self.rhs.copy_from_slice(&self.field[self.n..self.n + k]);
            self.lu.solve(&mut self.rhs);
            let mut change = 0.0_f64;
            for (&i, delta) in self.sliding.iter().zip(&self.rhs) {
                alpha[i] -= delta;
                change = change.max(delta.abs() / (1.0 + alpha[i].abs()));
            }
            self.eval(t, x, alpha);
            if change <= 1e-13 {
                return Ok(());
            }
        }
        Err(Singular { column: 0 })
    }

    /// Expands x, α and ψ around (t, x) up to `order`.
    pub(crate) fn expand(
        &mut self,
        t: f64,
        x: &[f64],
        alpha: &mut [f64],
        order: usize,
    ) -> Result<(), Singular> {
        debug_assert!(order <= self.order, "the jet has room for the order");
        let (n, k_sliding) = (self.n, self.sliding.len());
        self.solve_alpha(t, x, alpha)?;
        self.orientation = self.lu.determinant_sign();
        for row in 0..k_sliding {
            self.gains[row] = (0..k_sliding)
                .map(|col| self.coupling(row, col).abs())
                .sum();
        }
        let jet = &mut self.jet;
        jet.set_input(0, 0, t);
        for (i, &x) in x.iter().enumerate() {
            jet.set_input(1 + i, 0, x);
        }
        for (j, &i) in self.sliding.iter().enumerate() {
            jet.set_input(1 + n + j, 0, alpha[i]);
        }
        jet.advance(0);
        for k in 1..=order {
            // (k + 1) x_{k+1} = f_k
            for i in 0..n {
                let rate = jet.output(i, k - 1);
                jet.set_input(1 + i, k, rate / k as f64);
            }
            if k == 1 {
                jet.set_input(0, 1, 1.0);
            }
            if k_sliding > 0 {
                for j in 0..k_sliding {
                    jet.set_input(1 + n + j, k, 0.0);
                }
                jet.advance(k);
                for j in 0..k_sliding {
                    self.rhs[j] = -jet.output(n + j, k);
                }
                self.lu.solve(&mut self.rhs);
                for j in 0..k_sliding {
                    jet.set_input(1 + n + j, k, self.rhs[j]);
                }
            }
            jet.advance(k);
        }
        Ok(())
    }

    pub(crate) fn functions(&self) -> &ModeFunctions {
        &self.functions
    }

    /// True when det ∂φ_K/∂α_K has another sign where `eval` was last called than at the expansion
    /// point: in between, α_K was not determined.
    pub(crate) fn turned_over(&mut self) -> bool {
        let k = self.sliding.len();
        if k == 0 {
            return false;
        }
        self.linearize();
        let regular = self.lu.factor(&self.linear[..k * k]).is_ok();
        !regular || self.lu.determinant_sign() != self.orientation
    }

    pub(crate) fn order(&self) -> usize {
        self.order
    }

    /// Series of state i.
    pub(crate) fn x_series(&self, i: usize) -> &[f64] {
        self.jet.input_row(1 + i)
    }

    /// Series of α of the j-th sliding switch.
    pub(crate) fn alpha_series(&self, j: usize) -> &[f64] {
        self.jet.input_row(1 + self.n + j)
    }

    /// Series of ψ of switch i.
    pub(crate) fn psi_series(&self, i: usize) -> &[f64] {
        self.jet.output_row(self.n + self.sliding.len() + i)
    }

    pub(crate) fn state(&self, tau: f64, x: &mut [f64]) {
        for (i, x) in x.iter_mut().enumerate() {
            *x = series::value(self.x_series(i), tau);
        }
    }

    pub(crate) fn alpha(&self, tau: f64, alpha: &mut [f64]) {
        for (alpha, side) in alpha.iter_mut().zip(&self.sides) {
            *alpha = if *side == Side::Plus { 1.0 } else { 0.0 };
        }
        for (j, &i) in self.sliding.iter().enumerate() {
            alpha[i] = series::value(self.alpha_series(j), tau);
        }
    }

    /// Projects x onto the sliding surfaces, in the norm of the states' sizes, and returns the
    /// largest |ψ| found, relative to the size of its terms.
    pub(crate) fn project(&mut self, state: &mut State) -> f64 {
        let k = self.sliding.len();
        let mut drift = 0.0_f64;
        if k == 0 {
            return drift;
        }
        for round in 0..3 {
            self.eval(state.t, &state.x, &state.alpha);
            self.linearize();
            let mut worst = 0.0_f64;
            for (j, &i) in self.sliding.iter().enumerate() {
                let terms = self.gradient(j).iter().enumerate();
                let size: f64 = terms.map(|(i, g)| g.abs() * state.size(i)).sum();
                self.rhs[j] = self.field[self.n + k + i];
                if size > 0.0 {
                    worst = worst.max(self.rhs[j].abs() / size);
                }
                for l in 0..k {
                    let pairs = self.gradient(j).iter().zip(self.gradient(l)).enumerate();
                    self.gram[j * k + l] =
                        pairs.map(|(i, (a, b))| a * b * state.size(i).powi(2)).sum();
                }
            }
            if round == 0 {
                drift = worst;
            }
            if worst <= f64::EPSILON || self.lu.factor(&self.gram).is_err() {
                break;
            }
            self.lu.solve(&mut self.rhs);
            for i in 0..self.n {
                let correction: f64 = (0..k).map(|j| self.gradient(j)[i] * self.rhs[j]).sum();
                state.x[i] -= correction * state.size(i).powi(2);
            }
        }
        drift
    }
}
