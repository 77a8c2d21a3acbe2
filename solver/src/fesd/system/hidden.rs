//! w in a single point: where a residual contains no w, its derivative along f determines it.

use crate::fesd::system::Reduced;
use crate::fesd::system::evaluator::Evaluator;
use crate::linalg::DenseLu;
use crate::linalg::newton::{Newton, subtract};

/// Why equations were not solved.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Unsolved {
    /// The Jacobian is singular.
    Singular,
    /// Newton's method does not converge.
    Diverged,
}

const NEWTON: Newton = Newton {
    most: 30,
    converged: 1e-14,
    rounding: 1e-10,
};

/// Memory to solve for w in a point.
pub(crate) struct Hidden {
    /// t, x, w, and the numbers that change at breakpoints.
    at: Evaluator,
    values: Vec<f64>,
    matrix: Vec<f64>,
    lu: DenseLu,
    n: usize,
    n_w: usize,
}

impl Hidden {
    pub fn new(n: usize, n_numbers: usize, reduced: &Reduced) -> Self {
        let n_w = reduced.unknowns.len();
        let tapes = [
            &reduced.hidden.tape,
            &reduced.hidden.slopes.tape,
            &reduced.members.tape,
            &reduced.members.slopes.tape,
            &reduced.algebraics,
            &reduced.alphas,
            &reduced.equations.tape,
        ];
        Hidden {
            at: Evaluator::new(1 + n + n_w + n_numbers, tapes),
            values: vec![0.0; reduced.hidden.slopes.entries.len().max(n_w)],
            matrix: vec![0.0; n_w * n_w],
            lu: DenseLu::new(n_w),
            n,
            n_w,
        }
    }

    /// Moves to a point, with a guess of w.
    pub fn set(&mut self, t: f64, x: impl Iterator<Item = f64>, w: &[f64]) {
        self.at.set(t, x.take(self.n));
        self.at.inputs[1 + self.n..][..w.len()].copy_from_slice(w);
    }

    /// Takes the numbers that hold from here on.
    pub fn set_numbers(&mut self, numbers: &[f64]) {
        self.at.set_numbers(numbers);
    }

    /// w of the point.
    pub fn w(&self) -> &[f64] {
        &self.at.inputs[1 + self.n..][..self.n_w]
    }

    /// Evaluates a tape where the point is.
    pub fn eval<'h>(&'h mut self, tape: &'h crate::tape::Tape) -> impl Iterator<Item = f64> + 'h {
        self.at.eval(tape)
    }

    /// Solves for w where the point is; leaves ∂hidden/∂w factored.
    pub fn solve(&mut self, reduced: &Reduced) -> Result<(), Unsolved> {
        let n_w = reduced.unknowns.len();
        if n_w == 0 {
            return Ok(());
        }
        let converges = NEWTON.iterate(|| {
            self.factor(reduced)?;
            let found = self.at.eval(&reduced.hidden.tape);
            for (value, found) in self.values.iter_mut().zip(found) {
                *value = found;
            }
            self.lu.solve(&mut self.values[..n_w]);
            let w = &mut self.at.inputs[1 + self.n..][..n_w];
            Ok(subtract(w, &self.values[..n_w]))
        })?;
        converges.then_some(()).ok_or(Unsolved::Diverged)
    }

    /// dw/dt where the point is, while x moves at these rates.
    pub fn rate_of_w(
        &mut self,
        reduced: &Reduced,
        rates: &[f64],
        by_time: &mut Vec<f64>,
    ) -> Result<(), Unsolved> {
        self.factor(reduced)?;
        let n = self.n;
        by_time.clear();
        by_time.resize(self.n_w, 0.0);
        let slopes = &reduced.hidden.slopes;
        for (&(row, input), slope) in slopes.entries.iter().zip(self.eval(&slopes.tape)) {
            match input {
                0 => by_time[row] -= slope,
                _ if input <= n => by_time[row] -= slope * rates[input - 1],
                _ => {}
            }
        }
        self.lu.solve(by_time);
        Ok(())
    }

    /// det ∂hidden/∂w where the point is: where it vanishes, solutions for w meet and end.
    pub fn determinant(&mut self, reduced: &Reduced) -> f64 {
        match self.factor(reduced) {
            Ok(()) => self.lu.determinant(),
            Err(_) => 0.0,
        }
    }

    fn factor(&mut self, reduced: &Reduced) -> Result<(), Unsolved> {
        let n_w = reduced.unknowns.len();
        let results = self.at.eval(&reduced.hidden.slopes.tape);
        self.matrix.fill(0.0);
        for (&(row, input), slope) in reduced.hidden.slopes.entries.iter().zip(results) {
            if input > self.n {
                self.matrix[row * n_w + input - 1 - self.n] = slope;
            }
        }
        self.lu.factor(&self.matrix).map_err(|_| Unsolved::Singular)
    }

    /// A watched member where the point is, with w solved for; its derivatives by x are those along
    /// the surface hidden = 0, and go to `by_x`. Returns the value and ∂/∂t.
    pub fn member(
        &mut self,
        reduced: &Reduced,
        member: usize,
        by_x: &mut [f64],
    ) -> Result<(f64, f64), Unsolved> {
        let n_w = reduced.unknowns.len();
        let value = self
            .eval(&reduced.members.tape)
            .nth(member)
            .unwrap_or(f64::NAN);
        by_x.fill(0.0);
        let (mut rate, mut by_w) = (0.0, vec![0.0; n_w]);
        let n = self.n;
        let slopes = &reduced.members.slopes;
        for (&(row, input), slope) in slopes.entries.iter().zip(self.at.eval(&slopes.tape)) {
            match input {
                _ if row != member => {}
                0 => rate = slope,
                _ if input <= n => by_x[input - 1] = slope,
                _ => by_w[input - 1 - n] = slope,
            }
        }
        if by_w.iter().any(|slope| *slope != 0.0) {
            // dw = -H_w⁻¹ (H_x dx + H_t dt), so the row -by_w H_w⁻¹ multiplies H_x and H_t.
            self.factor(reduced)?;
            let mut row = by_w;
            self.lu.solve_transposed(&mut row);
            let slopes = &reduced.hidden.slopes;
            for (&(k, input), slope) in slopes.entries.iter().zip(self.at.eval(&slopes.tape)) {
                match input {
                    0 => rate -= row[k] * slope,
                    _ if input <= n => by_x[input - 1] -= row[k] * slope,
                    _ => {}
                }
            }
        }
        Ok((value, rate))
    }
}
