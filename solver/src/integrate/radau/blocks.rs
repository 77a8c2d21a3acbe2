//! The matrices of simplified Newton iterations, one real and a complex one for each pair of eigenvalues of A⁻¹:
//!
//! γ M/h - J,   (a + ib) M/h - J

use nalgebra::Complex;

use super::tableau::Tableau;
use super::{Implicit, Shape, Start};
use crate::linalg::{DenseLu, Singular};

/// Factors serve lengths this close to their own.
const SAME_LENGTH: f64 = 1e-2;

/// Their factors.
pub(super) struct Blocks {
    shape: Shape,
    /// J, and when it was taken.
    jacobian: Vec<f64>,
    taken_at: Option<f64>,
    /// The length h that they are of; 0 when there are none.
    h: f64,
    real: DenseLu,
    complex: Vec<DenseLu<Complex<f64>>>,
    matrix: Vec<f64>,
    complex_matrix: Vec<Complex<f64>>,
    pair: Vec<Complex<f64>>,
}

impl Blocks {
    pub(super) fn new(tableau: &Tableau, shape: Shape) -> Self {
        let n = shape.unknowns();
        Blocks {
            shape,
            jacobian: vec![0.0; n * n],
            taken_at: None,
            h: 0.0,
            real: DenseLu::new(n),
            complex: vec![DenseLu::new(n); tableau.pairs.len()],
            matrix: vec![0.0; n * n],
            complex_matrix: vec![Complex::default(); n * n],
            pair: vec![Complex::default(); n],
        }
    }

    /// Forgets the Jacobian and the factors.
    pub(super) fn forget(&mut self) {
        self.taken_at = None;
        self.h = 0.0;
    }

    pub(super) fn have_jacobian(&self) -> bool {
        self.taken_at.is_some()
    }

    /// Whether J is that of time `t`.
    pub(super) fn is_current(&self, t: f64) -> bool {
        self.taken_at == Some(t)
    }

    /// Takes J where a step starts.
    pub(super) fn linearize(&mut self, problem: &mut impl Implicit, start: &Start) {
        problem.jacobian(start.t, &start.y, &mut self.jacobian);
        self.taken_at = Some(start.t);
        self.h = 0.0;
    }

    /// Whether they serve a step of length h.
    pub(super) fn serve(&self, h: f64) -> bool {
        (h - self.h).abs() <= SAME_LENGTH * self.h
    }

    /// Factors all for a length.
    pub(super) fn factor(&mut self, tableau: &Tableau, h: f64) -> Result<(), Singular> {
        let n = self.shape.unknowns();
        self.h = 0.0;
        for (to, from) in self.matrix.iter_mut().zip(&self.jacobian) {
            *to = -from;
        }
        for i in 0..self.shape.states {
            self.matrix[i * n + i] += tableau.gamma / h;
        }
        self.real.factor(&self.matrix)?;
        for (lu, pair) in self.complex.iter_mut().zip(&tableau.pairs) {
            for (to, from) in self.complex_matrix.iter_mut().zip(&self.jacobian) {
                *to = Complex::new(-from, 0.0);
            }
            for i in 0..self.shape.states {
                self.complex_matrix[i * n + i] += pair / h;
            }
            lu.factor(&self.complex_matrix)?;
        }
        self.h = h;
        Ok(())
    }

    /// Solves with the real one.
    pub(super) fn solve_real(&self, v: &mut [f64]) {
        self.real.solve(v);
    }

    /// Solves with all, block by block.
    pub(super) fn solve(&mut self, v: &mut [f64]) {
        let n = self.shape.unknowns();
        let (first, others) = v.split_at_mut(n);
        self.real.solve(first);
        for (lu, block) in self.complex.iter().zip(others.chunks_mut(2 * n)) {
            let (re, im) = block.split_at_mut(n);
            for (pair, (re, im)) in self.pair.iter_mut().zip(re.iter().zip(im.iter())) {
                *pair = Complex::new(*re, *im);
            }
            lu.solve(&mut self.pair);
            for (pair, (re, im)) in self.pair.iter().zip(re.iter_mut().zip(im)) {
                (*re, *im) = (pair.re, pair.im);
            }
        }
    }
}
