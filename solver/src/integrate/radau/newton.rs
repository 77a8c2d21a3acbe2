//! Simplified Newton iterations for the equations of a step, block by block.
//!
//! (A⁻¹ ⊗ M/h - I ⊗ J) Δz = R with R_i = F(y₀ + z_i) - M Σ_j (A⁻¹)_ij z_j / h becomes, for
//! w = (T⁻¹ ⊗ I) z,
//!
//! (γ M/h - J) Δw₁ = (T⁻¹ R)₁,   ((a + ib) M/h - J) (Δw₂ + iΔw₃) = (T⁻¹ R)₂ + i (T⁻¹ R)₃, ..
//!
//! (Hairer & Wanner 1996, section IV.8). R is computed with A⁻¹ itself, so that the rounding errors
//! of T only cost speed.

use std::sync::Arc;

use super::blocks::Blocks;
use super::tableau::Tableau;
use super::{Counts, Implicit, Shape, Start};

/// The iterations do not converge, or the matrix is singular.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Diverged;

/// What the iterations work on.
pub(crate) struct Newton {
    tableau: Arc<Tableau>,
    pub(super) shape: Shape,
    /// z of every node.
    displacements: Vec<f64>,
    /// R, and T⁻¹ R, which becomes Δw.
    residuals: Vec<f64>,
    transformed: Vec<f64>,
    y: Vec<f64>,
    /// -A⁻¹/h.
    weights: Vec<f64>,
    blocks: Blocks,
    /// What an iteration leaves of the error, as seen last.
    contraction: f64,
    /// Iterations of the last step.
    iterations: usize,
    /// What rounding of f and φ does to y in a step.
    pub noise: Vec<f64>,
}

/// How far to iterate.
pub(crate) struct Accuracy<'a> {
    pub tolerance: f64,
    /// Written: the magnitudes of y within the step, which the tolerance is relative to.
    pub sizes: &'a mut [f64],
}

/// Error of the iterations as a fraction of the tolerance (Hairer & Wanner 1996, section IV.8).
const FRACTION: f64 = 1e-2;

/// Fraction of the tolerance at which iterations that no longer converge have met rounding.
const ROUNDING: f64 = 0.1;

/// Contraction that may be expected of any first iteration that goes on to converge.
const PROMPT: f64 = 0.2;

/// Power that makes a contraction seen before a careful guess (Hairer & Wanner 1996, section IV.8).
const TRUST: f64 = 0.8;

/// Iterations with a contraction above this want a new Jacobian at the next step.
const SLOW: f64 = 1e-2;

/// Magnitudes below this are zero.
const SMALLEST: f64 = 1e-250;

impl Newton {
    pub(crate) fn new(tableau: &Arc<Tableau>, shape: Shape) -> Self {
        let (s, n) = (tableau.s, shape.unknowns());
        Newton {
            shape,
            displacements: vec![0.0; s * n],
            residuals: vec![0.0; s * n],
            transformed: vec![0.0; s * n],
            y: vec![0.0; n],
            weights: vec![0.0; s * s],
            blocks: Blocks::new(tableau, shape),
            contraction: 1.0,
            iterations: 0,
            noise: vec![0.0; n],
            tableau: tableau.clone(),
        }
    }

    /// Forgets the Jacobian, as where the solution has gone another way since.
    pub(crate) fn forget(&mut self) {
        self.blocks.forget();
        self.contraction = 1.0;
    }

    /// z of a node.
    pub(crate) fn displacement(&self, node: usize) -> &[f64] {
        let n = self.shape.unknowns();
        &self.displacements[node * n..(node + 1) * n]
    }

    pub(crate) fn displacement_mut(&mut self, node: usize) -> &mut [f64] {
        let n = self.shape.unknowns();
        &mut self.displacements[node * n..(node + 1) * n]
    }

    /// Iterations that the last step took, and how many it might have taken.
    pub(crate) fn effort(&self) -> (usize, usize) {
        (self.iterations, self.most_iterations())
    }

    /// More nodes need more iterations (Hairer & Wanner 1999).
    fn most_iterations(&self) -> usize {
        7 + (self.tableau.s - 3) * 5 / 2
    }

    /// Iterates from the displacements as they are.
    pub(crate) fn solve(
        &mut self,
        problem: &mut impl Implicit,
        start: &Start,
        h: f64,
        accuracy: Accuracy,
        counts: &mut Counts,
    ) -> Result<(), Diverged> {
        self.prepare(problem, start, h, counts)?;
        let solved = self.iterate(problem, start, h, accuracy, counts);
        if solved.is_err() {
            self.contraction = 1.0;
        }
        solved
    }

    /// True when J is that of time `t`.
    pub(crate) fn is_current(&self, t: f64) -> bool {
        self.blocks.is_current(t)
    }

    fn iterate(
        &mut self,
        problem: &mut impl Implicit,
        start: &Start,
        h: f64,
        mut accuracy: Accuracy,
        counts: &mut Counts,
    ) -> Result<(), Diverged> {
        let (s, n) = (self.tableau.s, self.shape.unknowns());
        let most = self.most_iterations();
        let (mut last, mut last_ratio) = (f64::INFINITY, 1.0_f64);
        // What the steps before have seen, trusted less from one to the next (Hairer & Wanner 1996,
        // section IV.8).
        self.contraction = self.contraction.max(f64::EPSILON).powf(TRUST);
        for iteration in 1..=most {
            self.residual(problem, start, h);
            counts.evaluations += s;
            counts.iterations += 1;
            self.iterations = iteration;
            self.solve_blocks();
            transform(
                &self.tableau.transform,
                &self.transformed,
                &mut self.residuals,
                n,
            );
            let steps = self.residuals.iter();
            for (z, step) in self.displacements.iter_mut().zip(steps) {
                *z += step;
            }
            self.measure_sizes(start, &mut accuracy);
            let change = self.change(accuracy.sizes) / accuracy.tolerance;
            if change == 0.0 {
                break;
            }
            if !change.is_finite() {
                return Err(Diverged);
            }
            if iteration > 1 {
                let ratio = change / last;
                self.contraction = if iteration > 2 {
                    (ratio * last_ratio).sqrt()
                } else {
                    ratio
                };
                last_ratio = ratio;
                if ratio >= 0.9 && change <= ROUNDING.max(64.0 * f64::EPSILON / accuracy.tolerance)
                {
                    break;
                }
                let left = (most - iteration) as i32;
                let theta = self.contraction;
                if theta >= 0.99 || theta.powi(left) / (1.0 - theta) * change > FRACTION {
                    return Err(Diverged);
                }
            }
            // Without steps before, a first iteration says nothing of the error it leaves, unless it
            // hardly moved.
            let theta = if iteration > 1 {
                self.contraction
            } else {
                self.contraction.min(PROMPT)
            };
            if theta / (1.0 - theta) * change <= FRACTION {
                break;
            }
            if iteration == most {
                return Err(Diverged);
            }
            last = change;
        }
        Ok(())
    }

    /// Sees to it that J and the factors are there.
    fn prepare(
        &mut self,
        problem: &mut impl Implicit,
        start: &Start,
        h: f64,
        counts: &mut Counts,
    ) -> Result<(), Diverged> {
        let stale = self.contraction > SLOW && !self.blocks.is_current(start.t);
        if !self.blocks.have_jacobian() || stale {
            self.blocks.linearize(problem, start);
        }
        if !self.blocks.serve(h) {
            counts.factorizations += 1;
            let factored = self.blocks.factor(&self.tableau, h);
            factored.map_err(|_| Diverged)?;
        }
        self.measure_noise(start);
        Ok(())
    }

    /// (γ M/h - J)⁻¹ v.
    pub(crate) fn filter(&self, v: &mut [f64]) {
        self.blocks.solve_real(v);
    }

    /// Rounding errors of f and φ are ε times the size of their terms, taken here in proportions that
    /// do not cancel.
    fn measure_noise(&mut self, start: &Start) {
        let mut share = 0.0_f64;
        for (noise, term) in self.noise.iter_mut().zip(&start.terms) {
            share = (share + 0.618_033_988_749_895).fract();
            *noise = self.tableau.gamma * term * (2.0 * share - 1.0).signum() * (0.5 + share);
        }
        self.blocks.solve_real(&mut self.noise);
        for noise in &mut self.noise {
            *noise = noise.abs();
        }
    }

    /// R.
    fn residual(&mut self, problem: &mut impl Implicit, start: &Start, h: f64) {
        let (n, s) = (self.shape.unknowns(), self.tableau.s);
        let states = self.shape.states;
        let nodes = self.displacements.chunks(n);
        let nodes = nodes
            .zip(self.residuals.chunks_mut(n))
            .zip(&self.tableau.nodes);
        for ((z, residual), c) in nodes {
            for ((y, start), z) in self.y.iter_mut().zip(&start.y).zip(z) {
                *y = start + z;
            }
            problem.eval(start.t + c * h, &self.y, residual);
        }
        let weights = self.weights.iter_mut().zip(&self.tableau.inverse);
        weights.for_each(|(weight, entry)| *weight = -entry / h);
        let rows = self.weights.chunks_exact(s);
        for (row, residual) in rows.zip(self.residuals.chunks_exact_mut(n)) {
            add_product(row, &self.displacements, n, &mut residual[..states]);
        }
    }

    /// Δw.
    fn solve_blocks(&mut self) {
        let n = self.shape.unknowns();
        transform(
            &self.tableau.back,
            &self.residuals,
            &mut self.transformed,
            n,
        );
        self.blocks.solve(&mut self.transformed);
    }

    /// Magnitudes of y: given, or within the step, and no less than what keeps the tolerance above
    /// rounding.
    fn measure_sizes(&self, start: &Start, accuracy: &mut Accuracy) {
        let n = self.shape.unknowns();
        for i in 0..n {
            let within =
                (0..self.tableau.s).map(|j| (start.y[i] + self.displacements[j * n + i]).abs());
            let rounding = 8.0 * f64::EPSILON * self.noise[i] / accuracy.tolerance;
            let size = within.fold(start.scales[i].max(rounding), f64::max);
            accuracy.sizes[i] = size.max(SMALLEST);
        }
    }

    /// Largest change of the last iteration, relative to the sizes.
    fn change(&self, sizes: &[f64]) -> f64 {
        let rows = self.residuals.chunks(self.shape.unknowns());
        let relative = rows.flat_map(|row| row.iter().zip(sizes).map(|(z, size)| z.abs() / size));
        largest(relative)
    }
}

/// The largest of some magnitudes; infinite when one is not a number.
pub(crate) fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most, v| {
        if v.is_nan() {
            f64::INFINITY
        } else {
            most.max(v)
        }
    })
}

/// (matrix ⊗ I) from, for `n` entries per node.
fn transform(matrix: &[f64], from: &[f64], to: &mut [f64], n: usize) {
    to.fill(0.0);
    let s = from.len() / n;
    for (row, to) in matrix.chunks_exact(s).zip(to.chunks_exact_mut(n)) {
        add_product(row, from, n, to);
    }
}

/// Adds Σ_j row_j from_jk to every entry k of `to`, the first of `n` per node.
fn add_product(row: &[f64], from: &[f64], n: usize, to: &mut [f64]) {
    let (fours, rest) = to.as_chunks_mut::<4>();
    let (twos, ones) = rest.as_chunks_mut::<2>();
    let mut from = from;
    for to in fours {
        add_columns(row, from, n, to);
        from = &from[4..];
    }
    for to in twos {
        add_columns(row, from, n, to);
        from = &from[2..];
    }
    for to in ones {
        add_columns(row, from, n, std::array::from_mut(to));
    }
}

/// The same for a few entries next to each other, the first of `from`.
fn add_columns<const W: usize>(row: &[f64], from: &[f64], n: usize, to: &mut [f64; W]) {
    let mut sum = *to;
    for (weight, from) in row.iter().zip(from.chunks(n)) {
        if let Some(from) = from.first_chunk::<W>() {
            for (sum, from) in sum.iter_mut().zip(from) {
                *sum += weight * from;
            }
        }
    }
    *to = sum;
}
