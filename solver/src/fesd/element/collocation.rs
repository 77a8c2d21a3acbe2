//! The equations of an element and their derivatives, evaluated in lanes over the nodes.

use wide::f64x4;

use super::scheme::{Scheme, WIDTH};
use crate::fesd::element::Element;
use crate::fesd::system::Reduced;
use crate::fesd::system::hidden::Unsolved;
use crate::linalg::DenseLu;
use crate::tape::Tape;

impl Element {
    /// X_m = x₀ + h Σ_j a_mj V_j
    pub(crate) fn place(&mut self, scheme: &Scheme) {
        let (per_node, groups) = (self.per_node(), scheme.groups);
        for i in 0..self.n {
            for g in 0..groups {
                let mut sum = f64x4::splat(0.0);
                for j in 0..scheme.s {
                    sum += scheme.columns[j * groups + g] * self.unknowns[j * per_node + i];
                }
                self.x[i * groups + g] = f64x4::splat(self.x0[i]) + sum * self.h;
            }
        }
    }

    /// Puts t, X and w of a group of nodes into registers.
    pub(crate) fn load(&self, scheme: &Scheme, g: usize, registers: &mut [f64x4]) {
        let (n, per_node) = (self.n, self.per_node());
        registers[0] = f64x4::splat(self.t) + scheme.nodes[g] * self.h;
        for i in 0..n {
            registers[1 + i] = self.x[i * scheme.groups + g];
        }
        for k in n..per_node {
            let at = |lane: usize| {
                let node = (g * WIDTH + lane).min(scheme.s - 1);
                self.unknowns[node * per_node + k]
            };
            registers[1 + k] = f64x4::from(std::array::from_fn(at));
        }
        for (register, number) in registers[1 + per_node..].iter_mut().zip(&self.numbers) {
            *register = f64x4::splat(*number);
        }
    }

    /// Evaluates a tape at a group of nodes.
    fn run(&mut self, scheme: &Scheme, g: usize, tape: impl Fn(&Reduced) -> &Tape) {
        let mut registers = std::mem::take(&mut self.registers);
        self.load(scheme, g, &mut registers);
        tape(&self.reduced).run(&mut registers);
        self.registers = registers;
    }

    /// The negative residual: f - V and -r of every node, into `rhs`.
    pub(crate) fn residual(&mut self, scheme: &Scheme) {
        self.place(scheme);
        let (n, per_node) = (self.n, self.per_node());
        for g in 0..scheme.groups {
            self.run(scheme, g, |reduced| &reduced.equations);
            let tape = &self.reduced.equations;
            let first = g * WIDTH;
            let last = (first + WIDTH).min(scheme.s);
            for (i, value) in tape.results(&self.registers).enumerate() {
                let values = value.to_array();
                for node in first..last {
                    let at = node * per_node + i;
                    self.rhs[at] = match i < n {
                        true => values[node - first] - self.unknowns[at],
                        false => -values[node - first],
                    };
                }
            }
        }
        self.work.evaluations += scheme.s;
    }

    /// ∂(f, r)/∂(t, x, w) at all nodes.
    fn differentiate(&mut self, scheme: &Scheme) {
        self.place(scheme);
        for g in 0..scheme.groups {
            self.run(scheme, g, |reduced| &reduced.slopes.tape);
            let tape = &self.reduced.slopes.tape;
            for (e, value) in tape.results(&self.registers).enumerate() {
                self.slopes[e * scheme.groups + g] = value;
            }
        }
        self.measure(scheme);
    }

    /// The sizes of the terms of rates. A state at rest is what rounding leaves of the terms of its rate over an
    /// element, so that it counts as them in the rates of others: v = 0 by forces that balance, and x' = v.
    fn measure(&mut self, scheme: &Scheme) {
        self.measure_rounding(scheme);
        for rests in [false, true] {
            if rests {
                self.resting.copy_from_slice(&self.activity);
            }
            for (e, &(row, input)) in self.reduced.slopes.entries.iter().enumerate() {
                let state = input.wrapping_sub(1);
                let value = match (input, rests) {
                    _ if row >= self.n => continue,
                    (_, true) if state >= self.n => continue,
                    (_, true) => self.h * self.resting[state],
                    (0, false) => self.t,
                    (_, false) if state < self.n => self.x0[state].abs().max(self.sizes[state]),
                    (_, false) => 1.0,
                };
                self.activity[row] += (self.slope(scheme, e, 0) * value).abs();
            }
        }
    }

    fn slope(&self, scheme: &Scheme, entry: usize, node: usize) -> f64 {
        self.slopes[entry * scheme.groups + node / WIDTH].as_array()[node % WIDTH]
    }

    /// Factors the Jacobian of V - f and r at the present unknowns, for elements of length h.
    pub(crate) fn factor(&mut self, scheme: &Scheme, h: f64) -> Result<(), Unsolved> {
        self.differentiate(scheme);
        let (n, s, per_node) = (self.n, scheme.s, self.per_node());
        let size = s * per_node;
        self.matrix.fill(0.0);
        let places = self.places.as_deref();
        let place = |at: usize| places.map_or(at, |places| places[at]);
        for m in 0..s {
            for i in 0..n {
                self.matrix[place(m * per_node + i) * (size + 1)] = 1.0;
            }
            for (e, &(row, input)) in self.reduced.slopes.entries.iter().enumerate() {
                if input == 0 {
                    continue;
                }
                let slope = self.slope(scheme, e, m);
                let sign = if row < n { -1.0 } else { 1.0 };
                let start = place(m * per_node + row) * size;
                if input <= n {
                    for j in 0..s {
                        let a = scheme.tableau.a[m * s + j];
                        let column = place(j * per_node + input - 1);
                        self.matrix[start + column] += sign * h * a * slope;
                    }
                } else {
                    self.matrix[start + place(m * per_node + input - 1)] += sign * slope;
                }
            }
        }
        let lu = self.lu.get_or_insert_with(|| DenseLu::new(size));
        self.factored = 0.0;
        self.work.factorizations += 1;
        lu.factor(&self.matrix).map_err(|_| Unsolved::Singular)?;
        self.factored = h;
        Ok(())
    }

    /// Minus the derivative of V - f and r by h, into `by_length`.
    pub(crate) fn slope_by_length(&mut self, scheme: &Scheme) {
        let (n, s, per_node) = (self.n, scheme.s, self.per_node());
        self.by_length.fill(0.0);
        for m in 0..s {
            for (e, &(row, input)) in self.reduced.slopes.entries.iter().enumerate() {
                let moved = match input {
                    0 => scheme.tableau.nodes[m],
                    _ if input <= n => {
                        let terms = (0..s).map(|j| {
                            scheme.tableau.a[m * s + j] * self.unknowns[j * per_node + input - 1]
                        });
                        terms.sum()
                    }
                    _ => continue,
                };
                let sign = if row < n { 1.0 } else { -1.0 };
                self.by_length[m * per_node + row] += sign * self.slope(scheme, e, m) * moved;
            }
        }
    }
}
