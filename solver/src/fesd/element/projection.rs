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
use crate::linalg::DenseLu;
use crate::tape::Tape;

/// Steps of Newton's method with the first Jacobian: what is left is quadratic in what there was.
const ITERATIONS: usize = 3;

/// Memory for the end of an element.
pub(crate) struct Projection {
    inputs: Vec<f64>,
    registers: Vec<f64>,
    /// F_w, row by row.
    by_w: Vec<f64>,
    /// ∂r/∂x F_w.
    matrix: Vec<f64>,
    lu: DenseLu,
    rhs: Vec<f64>,
}

impl Projection {
    /// Nothing where the end is a node, nothing slides, or an equation contains w.
    pub fn new(scheme: &Scheme, n: usize, reduced: &Reduced) -> Option<Self> {
        let n_w = reduced.unknowns.len();
        let ends_at_node = scheme.nodes_at.last().is_none_or(Option::is_some);
        let contains_w = |&(row, input): &(usize, usize)| row >= n && input > n;
        if n_w == 0 || ends_at_node || reduced.slopes.entries.iter().any(contains_w) {
            return None;
        }
        let tapes = [&reduced.equations, &reduced.slopes.tape];
        let registers = tapes.map(|tape| tape.n_registers().max(tape.n_inputs()));
        Some(Projection {
            inputs: vec![0.0; reduced.equations.n_inputs()],
            registers: vec![0.0; registers.into_iter().max().unwrap_or(0)],
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
        self.inputs[0] = t;
        self.inputs[1..=n].copy_from_slice(x);
        self.inputs[1 + n..][..n_w].copy_from_slice(w);
        self.inputs[1 + n + n_w..].copy_from_slice(numbers);
        if !self.factor(reduced, n, n_w) {
            return;
        }
        for _ in 0..ITERATIONS {
            run(&reduced.equations, &self.inputs, &mut self.registers);
            let r = reduced.equations.results(&self.registers).skip(n);
            for (rhs, r) in self.rhs.iter_mut().zip(r) {
                *rhs = -r;
            }
            self.lu.solve(&mut self.rhs);
            for (x, by_w) in self.inputs[1..=n]
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
        if self.inputs[1..=n].iter().all(|x| x.is_finite()) {
            x.copy_from_slice(&self.inputs[1..=n]);
        }
    }

    /// Factors ∂r/∂x F_w where the inputs are.
    fn factor(&mut self, reduced: &Reduced, n: usize, n_w: usize) -> bool {
        let slopes = &reduced.slopes;
        run(&slopes.tape, &self.inputs, &mut self.registers);
        let entries = || {
            slopes
                .entries
                .iter()
                .zip(slopes.tape.results(&self.registers))
        };
        self.by_w.fill(0.0);
        for (&(row, input), slope) in entries() {
            if row < n && input > n {
                self.by_w[row * n_w + input - 1 - n] = slope;
            }
        }
        self.matrix.fill(0.0);
        for (&(row, input), slope) in entries() {
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

fn run(tape: &Tape, inputs: &[f64], registers: &mut [f64]) {
    registers[..inputs.len()].copy_from_slice(inputs);
    tape.run(registers);
}
