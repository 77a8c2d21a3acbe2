//! The Taylor expansion of a mode, order by order.

use super::layout::Memory;
use super::mode::Mode;
use crate::integrate::singular::MODERATE;
use crate::linalg::Singular;
use crate::tape;

/// Series that overflow at this order or before are not cut: their last terms say nothing of what is cut off (chosen by
/// trial).
const LEAST_KNOWN: usize = 5;

impl Mode {
    /// Expands x and α around (t, x).
    pub(crate) fn expand(&mut self, t: f64, x: &[f64], alpha: &mut [f64]) -> Result<(), Singular> {
        self.start(t, x, alpha)?;
        self.start_series(t, x, alpha);
        for k in 1..self.order {
            self.advance_field(k);
            self.raise_states(k);
            self.solve_order(k);
        }
        if !self.sliding.is_empty() {
            self.advance_field(self.order);
            self.raise_states(self.order);
            self.solve_order(self.order);
        }
        self.memory.known = self.order;
        let overflows = || (0..self.n).any(|i| !self.x_series(i)[self.order].is_finite());
        if self.slips_in_a_plane() {
            self.cut_overflow();
        } else if overflows()
            && let Some(known) = self.known_order()
        {
            self.cut_overflow();
            self.memory.known = known;
        }
        Ok(())
    }

    /// The terms of order 0, and those of x of order 1.
    pub(crate) fn start_series(&mut self, t: f64, x: &[f64], alpha: &[f64]) {
        let lists = self.field.list();
        let Memory {
            rows,
            weights,
            stride,
            ..
        } = &mut self.memory;
        (rows[0], rows[1]) = (t, 1.0);
        for (i, &x) in x.iter().enumerate() {
            rows[(1 + i) * *stride] = x;
        }
        for &i in &self.sliding {
            rows[(1 + self.n + i) * *stride] = alpha[i];
        }
        tape::fill_all(&lists.timed, rows, weights, self.order + 1, *stride);
        tape::start_all(&lists.steps, rows, *stride);
        self.raise_states(0);
    }

    /// f of order k.
    pub(crate) fn advance_field(&mut self, k: usize) {
        let Memory {
            rows,
            weights,
            stride,
            ..
        } = &mut self.memory;
        for &i in &self.sliding {
            rows[(1 + self.n + i) * *stride + k] = 0.0;
        }
        tape::advance_all(&self.field.listed().steps, rows, weights, k, *stride);
    }

    /// (k + 1) x_{k+1} = f_k
    pub(crate) fn raise_states(&mut self, k: usize) {
        let Memory { rows, stride, .. } = &mut self.memory;
        let over = 1.0 / (k + 1) as f64;
        let mut next = *stride + k + 1;
        for rate in &self.field.rows {
            rows[next] = rows[rate + k] * over;
            next += *stride;
        }
    }

    /// A α_K,k = -(k + 1) ψ_K,k+1, where α_K,k is 0 so far.
    fn solve_order(&mut self, k: usize) {
        if self.sliding.is_empty() {
            return;
        }
        self.equate(k);
        self.equations.solve();
        self.take_alpha(k);
    }

    /// The right-hand sides of order k.
    pub(crate) fn equate(&mut self, k: usize) {
        for (at, &i) in self.equations.switches.iter().enumerate() {
            if self.equations.tie(at).is_some() || self.equations.is_held(at) {
                self.equations.rhs[at] = 0.0;
                continue;
            }
            // What is kept of lower orders must be that of the states as they are by now.
            match k {
                1 if !self.surfaces.is_affine(i) => {
                    self.surfaces.advance(i, &mut self.memory, 0);
                    self.surfaces.advance(i, &mut self.memory, 1);
                }
                _ => self.surfaces.now(i).correct(&mut self.memory, k),
            }
            self.surfaces.advance(i, &mut self.memory, k + 1);
            let psi = self.memory.rows[self.surfaces.row(i) + k + 1];
            self.equations.rhs[at] = -((k + 1) as f64) * psi;
        }
    }

    /// Takes what the equations were solved for as α_K,k, and evaluates again what contains it.
    pub(crate) fn take_alpha(&mut self, k: usize) {
        let Memory {
            rows,
            weights,
            stride,
            ..
        } = &mut self.memory;
        for (&i, alpha) in self.equations.switches.iter().zip(&self.equations.rhs) {
            rows[(1 + self.n + i) * *stride + k] = *alpha;
        }
        tape::advance_all(&self.field.listed().by_alpha, rows, weights, k, *stride);
        for &i in &self.field.listed().sliding_states {
            rows[(1 + i) * *stride + k + 1] = rows[self.field.rows[i] + k] / (k + 1) as f64;
        }
    }

    /// Cuts all series before their first term that is no number: close to w = 0 terms grow with their order until they
    /// overflow. What is cut off too early shows in the defect of a step.
    pub(crate) fn cut_overflow(&mut self) {
        // Values that are no numbers end the run.
        let Some(end) = self.first_overflow().filter(|k| *k > 0) else {
            return;
        };
        for start in self.starts() {
            self.memory.rows[start + end..=start + self.order].fill(0.0);
        }
    }

    /// The first order of a term that is no number, of x, f and α.
    fn first_overflow(&self) -> Option<usize> {
        let starts = self.starts();
        let rows = &self.memory.rows;
        (0..=self.order).find(|k| !starts.iter().all(|start| rows[start + k].is_finite()))
    }

    /// The order up to which all series are numbers, where terms inside of functions have grown until they overflowed:
    /// those of a step at a root are moderate, and its series end at once.
    fn known_order(&self) -> Option<usize> {
        let has_grown = |c: &f64| c.is_finite() && c.abs() > MODERATE;
        let grows = !self.system.has_roots() && self.memory.rows.iter().any(has_grown);
        let end = self.first_overflow().filter(|end| *end > LEAST_KNOWN);
        end.filter(|_| grows).map(|end| end - 1)
    }

    /// Where the series of x, f and α start.
    fn starts(&self) -> Vec<usize> {
        let states = (0..self.n).flat_map(|i| [self.memory.state(i), self.field.rows[i]]);
        let alphas = self.sliding.iter().map(|&i| self.memory.alpha(i));
        states.chain(alphas).collect()
    }
}
