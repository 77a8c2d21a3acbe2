//! The Taylor expansion of a mode, order by order.

use super::layout::Memory;
use super::mode::Mode;
use crate::linalg::Singular;
use crate::tape;

/// Terms of series below this do not overflow by the next one.
pub(crate) const MODERATE: f64 = 1e100;

/// Series that overflow at this order or before are not cut: their last terms say nothing of what is cut off (chosen by
/// trial).
const LEAST_KNOWN: usize = 5;

/// The series of x, f and α of a mode, around a point.
pub(crate) struct Expansion<'m> {
    pub mode: &'m mut Mode,
}

impl Expansion<'_> {
    /// Expands x and α around (t, x).
    pub(crate) fn around(&mut self, t: f64, x: &[f64], alpha: &mut [f64]) -> Result<(), Singular> {
        self.mode.start(t, x, alpha)?;
        self.start_series(t, x, alpha);
        for k in 1..self.mode.memory.order {
            self.advance_field(k);
            self.raise_states(k);
            self.solve_order(k);
        }
        if !self.mode.sliding.is_empty() {
            self.advance_field(self.mode.memory.order);
            self.raise_states(self.mode.memory.order);
            self.solve_order(self.mode.memory.order);
        }
        self.mode.memory.known = self.mode.memory.order;
        let overflows =
            || (0..self.mode.n).any(|i| !self.mode.x_series(i)[self.mode.memory.order].is_finite());
        if self.mode.planes.slip(&self.mode.system, &self.mode.sides) {
            self.cut_overflow();
        } else if overflows()
            && let Some(known) = self.known_order()
        {
            self.cut_overflow();
            self.mode.memory.known = known;
        }
        Ok(())
    }

    /// The terms of order 0, and those of x of order 1.
    pub(crate) fn start_series(&mut self, t: f64, x: &[f64], alpha: &[f64]) {
        let lists = self.mode.field.list();
        let Memory {
            rows,
            weights,
            order,
            stride,
            ..
        } = &mut self.mode.memory;
        (rows[0], rows[1]) = (t, 1.0);
        for (i, &x) in x.iter().enumerate() {
            rows[(1 + i) * *stride] = x;
        }
        for &i in &self.mode.sliding {
            rows[(1 + self.mode.n + i) * *stride] = alpha[i];
        }
        tape::fill_all(&lists.timed, rows, weights, *order + 1, *stride);
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
        } = &mut self.mode.memory;
        for &i in &self.mode.sliding {
            rows[(1 + self.mode.n + i) * *stride + k] = 0.0;
        }
        tape::advance_all(&self.mode.field.listed().steps, rows, weights, k, *stride);
    }

    /// (k + 1) x_{k+1} = f_k
    pub(crate) fn raise_states(&mut self, k: usize) {
        let Memory { rows, stride, .. } = &mut self.mode.memory;
        let over = 1.0 / (k + 1) as f64;
        let mut next = *stride + k + 1;
        for rate in &self.mode.field.rows {
            rows[next] = rows[rate + k] * over;
            next += *stride;
        }
    }

    /// A α_K,k = -(k + 1) ψ_K,k+1, where α_K,k is 0 so far.
    fn solve_order(&mut self, k: usize) {
        if self.mode.sliding.is_empty() {
            return;
        }
        self.equate(k);
        self.mode.equations.solve();
        self.take_alpha(k);
    }

    /// The right-hand sides of order k.
    pub(crate) fn equate(&mut self, k: usize) {
        for at in 0..self.mode.sliding.len() {
            let i = self.mode.equations.switches()[at];
            if self.mode.equations.tie(at).is_some() || self.mode.equations.is_held(at) {
                self.mode.equations.rhs[at] = 0.0;
                continue;
            }
            // What is kept of lower orders must be that of the states as they are by now.
            match k {
                1 if !self.mode.surfaces.is_affine(i) => {
                    self.mode.surfaces.advance(i, &mut self.mode.memory, 0);
                    self.mode.surfaces.advance(i, &mut self.mode.memory, 1);
                }
                _ => self.mode.surfaces.now(i).correct(&mut self.mode.memory, k),
            }
            self.mode.surfaces.advance(i, &mut self.mode.memory, k + 1);
            let psi = self.mode.memory.rows[self.mode.surfaces.row(i) + k + 1];
            self.mode.equations.rhs[at] = -((k + 1) as f64) * psi;
        }
    }

    /// Takes what the equations were solved for as α_K,k, and evaluates again what contains it.
    pub(crate) fn take_alpha(&mut self, k: usize) {
        let Memory {
            rows,
            weights,
            stride,
            ..
        } = &mut self.mode.memory;
        for (i, alpha) in self.mode.equations.solution() {
            rows[(1 + self.mode.n + i) * *stride + k] = alpha;
        }
        tape::advance_all(
            &self.mode.field.listed().by_alpha,
            rows,
            weights,
            k,
            *stride,
        );
        for &i in &self.mode.field.listed().sliding_states {
            rows[(1 + i) * *stride + k + 1] = rows[self.mode.field.rows[i] + k] / (k + 1) as f64;
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
            self.mode.memory.rows[start + end..=start + self.mode.memory.order].fill(0.0);
        }
    }

    /// Leaves the terms of all series below order `end`, and below the first one of a state that is no number; false where
    /// that leaves less than all.
    pub(crate) fn cut_short(&mut self, end: usize) -> bool {
        let orders = 1..=self.mode.memory.order;
        let mut broken =
            orders.filter(|&k| (0..self.mode.n).any(|i| !self.mode.x_series(i)[k].is_finite()));
        let end = end.min(broken.next().unwrap_or(usize::MAX));
        if end > self.mode.memory.order {
            return true;
        }
        let of_states = (0..self.mode.n).map(|i| (self.mode.memory.state(i), end));
        let of_rates = self.mode.field.rows.iter().map(|&row| (row, end - 1));
        let of_alphas = self
            .mode
            .sliding
            .iter()
            .map(|&i| (self.mode.memory.alpha(i), end));
        let starts: Vec<_> = of_states.chain(of_rates).chain(of_alphas).collect();
        for (start, end) in starts {
            self.mode.memory.rows[start + end.max(1)..=start + self.mode.memory.order].fill(0.0);
        }
        false
    }

    /// The first order of a term that is no number, of x, f and α.
    fn first_overflow(&self) -> Option<usize> {
        let starts = self.starts();
        let rows = &self.mode.memory.rows;
        (0..=self.mode.memory.order)
            .find(|k| !starts.iter().all(|start| rows[start + k].is_finite()))
    }

    /// The order up to which all series are numbers, where terms inside of functions have grown until they overflowed:
    /// those of a step at a root are moderate, and its series end at once.
    fn known_order(&self) -> Option<usize> {
        let has_grown = |c: &f64| c.is_finite() && c.abs() > MODERATE;
        let grows = !self.mode.system.has_roots() && self.mode.memory.rows.iter().any(has_grown);
        let end = self.first_overflow().filter(|end| *end > LEAST_KNOWN);
        end.filter(|_| grows).map(|end| end - 1)
    }

    /// Where the series of x, f and α start.
    fn starts(&self) -> Vec<usize> {
        let states =
            (0..self.mode.n).flat_map(|i| [self.mode.memory.state(i), self.mode.field.rows[i]]);
        let alphas = self.mode.sliding.iter().map(|&i| self.mode.memory.alpha(i));
        states.chain(alphas).collect()
    }
}
