//! The end of an element on the surfaces it slides on.
//!
//! While a switch slides, 0 = r(t, x) holds at the nodes. Where the end is no node, as with Gauss
//! methods, x₁ = x₀ + h Σ b_j V_j is off a curved surface by an error of the order of the polynomial,
//! and w, which is determined by the derivative of r, makes it that of the method: for n nodes n, or
//! n + 1 where n is odd. The end that is moved along the directions in which w acts,
//!
//! x₁ + F_w ν,   0 = r(t₁, x₁ + F_w ν),   F_w = ∂f/∂w,
//!
//! has order 2n again (Ascher & Petzold 1991, projected collocation). To ask for both in one system,
//! r = 0 at the nodes and at the end, is more than its unknowns can satisfy.

use super::scheme::Scheme;
use crate::fesd::system::Reduced;
use crate::fesd::system::evaluator::Evaluator;
use crate::linalg::DenseLu;

/// Steps of Newton's method with the first Jacobian: what is left is quadratic in what there was.
const ITERATIONS: usize = 3;

/// Memory for the end of an element.
pub(crate) struct Projection {
    at: Evaluator,
    /// F_w, row by row.
    by_w: Vec<f64>,
    /// ∂r/∂x F_w.
    matrix: Vec<f64>,
    lu: DenseLu,
    rhs: Vec<f64>,
}

impl Projection {
    /// Whether ends are moved: not where they are nodes, nothing slides, or an equation contains w.
    pub fn applies(scheme: &Scheme, n: usize, reduced: &Reduced) -> bool {
        let ends_at_node = scheme.points.nodes.last().is_none_or(Option::is_some);
        let contains_w = |&(row, input): &(usize, usize)| row >= n && input > n;
        let mut entries = reduced.equations.slopes.entries.iter();
        !reduced.unknowns.is_empty() && !ends_at_node && !entries.any(contains_w)
    }

    /// Nothing where ends are not moved.
    pub fn new(scheme: &Scheme, n: usize, reduced: &Reduced) -> Option<Self> {
        if !Projection::applies(scheme, n, reduced) {
            return None;
        }
        let n_w = reduced.unknowns.len();
        let tapes = [&reduced.equations.tape, &reduced.equations.slopes.tape];
        Some(Projection {
            at: Evaluator::new(reduced.equations.tape.n_inputs(), tapes),
            by_w: vec![0.0; n * n_w],
            matrix: vec![0.0; n_w * n_w],
            lu: DenseLu::new(n_w),
            rhs: vec![0.0; n_w],
        })
    }

    /// Moves x at `t` onto the surfaces, near which w acts; leaves it where the directions do not lead
    /// there.
    pub fn project(
        &mut self,
        reduced: &Reduced,
        t: f64,
        w: &[f64],
        numbers: &[f64],
        x: &mut [f64],
    ) {
        let (n, n_w) = (x.len(), w.len());
        self.at.set(t, x.iter().chain(w).copied());
        self.at.set_numbers(numbers);
        if !self.factor(reduced, n, n_w) {
            return;
        }
        for _ in 0..ITERATIONS {
            let r = self.at.eval(&reduced.equations.tape).skip(n);
            for (rhs, r) in self.rhs.iter_mut().zip(r) {
                *rhs = -r;
            }
            self.lu.solve(&mut self.rhs);
            for (x, by_w) in self.at.inputs[1..=n]
                .iter_mut()
                .zip(self.by_w.chunks_exact(n_w))
            {
                *x += by_w
                    .iter()
                    .zip(&self.rhs)
                    .map(|(a, nu)| a * nu)
                    .sum::<f64>();
            }
        }
        if self.at.inputs[1..=n].iter().all(|x| x.is_finite()) {
            x.copy_from_slice(&self.at.inputs[1..=n]);
        }
    }

    /// Factors ∂r/∂x F_w where the inputs are.
    fn factor(&mut self, reduced: &Reduced, n: usize, n_w: usize) -> bool {
        let slopes = &reduced.equations.slopes;
        self.by_w.fill(0.0);
        for (&(row, input), slope) in slopes.entries.iter().zip(self.at.eval(&slopes.tape)) {
            if row < n && input > n {
                self.by_w[row * n_w + input - 1 - n] = slope;
            }
        }
        self.matrix.fill(0.0);
        for (&(row, input), slope) in slopes.entries.iter().zip(self.at.results(&slopes.tape)) {
            if row >= n && (1..=n).contains(&input) {
                let by_w = &self.by_w[(input - 1) * n_w..][..n_w];
                let products = self.matrix[(row - n) * n_w..].iter_mut().zip(by_w);
                for (entry, by_w) in products {
                    *entry += slope * by_w;
                }
            }
        }
        self.lu.factor(&self.matrix).is_ok()
    }
}
