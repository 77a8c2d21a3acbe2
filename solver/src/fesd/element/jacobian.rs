//! The Jacobian of V - f and r by all unknowns of an element, and its factors.

use wide::f64x4;

use super::banded;
use super::scheme::{Scheme, WIDTH};
use super::stages::Stages;
use crate::fesd::system::Reduced;
use crate::fesd::system::hidden::Unsolved;
use crate::linalg::DenseLu;

/// A Jacobian with its factors.
pub(crate) struct Jacobian {
    /// ∂(f, r)/∂(t, x, w) at the nodes, in lanes: entry e at `e * groups`.
    slopes: Vec<f64x4>,
    matrix: Vec<f64>,
    lu: Option<DenseLu>,
    /// The places of unknowns and equations in the matrix; none where they stand in their order.
    places: Option<Vec<usize>>,
    permuted: Vec<f64>,
    /// The h that is factored, zero where nothing is.
    pub factored: f64,
    /// Contraction of the last iterations with these factors.
    pub contraction: f64,
}

impl Jacobian {
    /// Memory for elements of an active set.
    pub fn new(scheme: &Scheme, stages: &Stages, reduced: &Reduced) -> Self {
        let size = stages.unknowns.len();
        let entries = reduced.equations.slopes.entries.iter();
        let entries = entries.filter(|(_, input)| *input > 0);
        let entries = entries.map(|&(row, input)| (row, input - 1));
        let places = banded::places(scheme.s, stages.per_node, entries);
        Jacobian {
            slopes: vec![f64x4::splat(0.0); reduced.equations.slopes.entries.len() * scheme.groups],
            matrix: vec![0.0; size * size],
            lu: None,
            permuted: vec![0.0; if places.is_some() { size } else { 0 }],
            places,
            factored: 0.0,
            contraction: 1.0,
        }
    }

    /// ∂(f, r)/∂(t, x, w) at all nodes.
    pub fn differentiate(&mut self, scheme: &Scheme, reduced: &Reduced, stages: &mut Stages) {
        let tape = &reduced.equations.slopes.tape;
        stages.place(scheme);
        for g in 0..scheme.groups {
            stages.run(scheme, g, tape);
            for (e, value) in tape.results(&stages.registers).enumerate() {
                self.slopes[e * scheme.groups + g] = value;
            }
        }
    }

    /// An entry of ∂(f, r)/∂(t, x, w) at a node.
    pub fn slope(&self, scheme: &Scheme, entry: usize, node: usize) -> f64 {
        self.slopes[entry * scheme.groups + node / WIDTH].as_array()[node % WIDTH]
    }

    /// Factors the Jacobian of V - f and r for elements of length h. With X_m = x₀ + h Σ_j a_mj V_j its blocks are
    ///
    /// ∂(V_m - f_m)/∂V_j = δ_mj I - h a_mj ∂f_m/∂x,   ∂(V_m - f_m)/∂w_m = -∂f_m/∂w,
    /// ∂r_m/∂V_j = h a_mj ∂r_m/∂x,   ∂r_m/∂w_m.
    ///
    /// ∂(f, r)/∂(t, x, w) are those of the last [`Jacobian::differentiate`].
    pub fn factor(
        &mut self,
        scheme: &Scheme,
        reduced: &Reduced,
        stages: &Stages,
        h: f64,
    ) -> Result<(), Unsolved> {
        let (n, s, per_node) = (stages.n, scheme.s, stages.per_node);
        let size = s * per_node;
        self.matrix.fill(0.0);
        let places = self.places.as_deref();
        let place = |at: usize| places.map_or(at, |places| places[at]);
        for m in 0..s {
            for i in 0..n {
                self.matrix[place(m * per_node + i) * (size + 1)] = 1.0;
            }
            for (e, &(row, input)) in reduced.equations.slopes.entries.iter().enumerate() {
                let slope = self.slope(scheme, e, m);
                let sign = if row < n { -1.0 } else { 1.0 };
                let row_start = place(m * per_node + row) * size;
                match input {
                    // t_m is known.
                    0 => {}
                    // X_m depends on V of all nodes.
                    _ if input <= n => {
                        for j in 0..s {
                            let a = scheme.tableau.a[m * s + j];
                            let column = place(j * per_node + input - 1);
                            self.matrix[row_start + column] += sign * h * a * slope;
                        }
                    }
                    // w_m.
                    _ => {
                        let column = place(m * per_node + input - 1);
                        self.matrix[row_start + column] += sign * slope;
                    }
                }
            }
        }
        let lu = self.lu.get_or_insert_with(|| DenseLu::new(size));
        self.factored = 0.0;
        lu.factor(&self.matrix).map_err(|_| Unsolved::Singular)?;
        self.factored = h;
        Ok(())
    }

    /// Minus the derivative of V - f and r by h.
    pub fn by_length(
        &self,
        scheme: &Scheme,
        reduced: &Reduced,
        stages: &Stages,
        by_length: &mut [f64],
    ) {
        let (n, s, per_node) = (stages.n, scheme.s, stages.per_node);
        by_length.fill(0.0);
        for m in 0..s {
            for (e, &(row, input)) in reduced.equations.slopes.entries.iter().enumerate() {
                let moved = match input {
                    0 => scheme.tableau.nodes[m],
                    _ if input <= n => {
                        let a = &scheme.tableau.a[m * s..][..s];
                        let terms = a.iter().enumerate();
                        let terms =
                            terms.map(|(j, a)| a * stages.unknowns[j * per_node + input - 1]);
                        terms.sum()
                    }
                    _ => continue,
                };
                let sign = if row < n { 1.0 } else { -1.0 };
                by_length[m * per_node + row] += sign * self.slope(scheme, e, m) * moved;
            }
        }
    }

    /// Overwrites a right-hand side with the solution of the factored equations.
    pub fn solve(&mut self, rhs: &mut [f64]) -> Result<(), Unsolved> {
        let lu = self.lu.as_ref().ok_or(Unsolved::Singular)?;
        match &self.places {
            None => lu.solve(rhs),
            Some(places) => {
                for (value, &place) in rhs.iter().zip(places) {
                    self.permuted[place] = *value;
                }
                lu.solve(&mut self.permuted);
                for (value, &place) in rhs.iter_mut().zip(places) {
                    *value = self.permuted[place];
                }
            }
        }
        Ok(())
    }
}
