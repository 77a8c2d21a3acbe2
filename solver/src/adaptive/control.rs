//! Order and step size of an extrapolation method.
//!
//! With the error err_j of row j, H_j = H · 0.94 (0.65/err_j)^{1/(2j-1)} would be the best step of
//! that row, and W_j = A_j/H_j its work per unit of time, A_j being the evaluations up to row j. The
//! row k in which convergence is expected is the one with the least work. A step is over when row
//! k - 1, k or k + 1 converges, or when an error is so large that even the later rows will not
//! (Hairer, Nørsett & Wanner 1993, section II.9, order and step size control).

use super::extrapolation::{MOST_ROWS, substeps};

/// What follows from a row.
pub enum Verdict {
    /// The next row is needed.
    GoOn,
    /// The step is accepted.
    Accept,
    /// The step is repeated with another length.
    Reject,
}

/// Chooses orders and steps.
pub struct Control {
    /// Length of the next step.
    pub step: f64,
    /// The row k in which convergence is expected.
    target: usize,
    /// Whether the last step was rejected.
    rejected: bool,
    /// H_j and W_j by row, from row 1 on.
    steps: [f64; MOST_ROWS + 1],
    work: [f64; MOST_ROWS + 1],
}

const SAFETY: f64 = 0.94;
const AIM: f64 = 0.65;
/// The step changes by 0.02^{1/(2j-1)} or its inverse at most, and falls by four times more.
const CHANGE: f64 = 0.02;
const FALL: f64 = 4.0;
/// Work of a row over that of the next, below which the order falls, or rises.
const LOWER: f64 = 0.8;
const HIGHER: f64 = 0.9;
const LEAST_TARGET: usize = 3;

/// Evaluations up to row j, that at the start of the step included.
fn evaluations(row: usize) -> f64 {
    (1..=row).map(substeps).sum::<usize>() as f64 + 1.0
}

/// (n_i/n_1)²
fn growth(row: usize) -> f64 {
    (substeps(row) as f64 / substeps(1) as f64).powi(2)
}

impl Control {
    /// Orders start where the tolerance suggests.
    pub fn new(tolerance: f64, step: f64) -> Self {
        let target = (1.5 - 0.6 * tolerance.log10()) as usize;
        Control {
            step,
            target: target.clamp(LEAST_TARGET, MOST_ROWS - 1),
            rejected: false,
            steps: [0.0; MOST_ROWS + 1],
            work: [f64::INFINITY; MOST_ROWS + 1],
        }
    }

    /// Looks at the error of a row, relative to the tolerance; what is not a number is too large.
    pub fn judge(&mut self, row: usize, length: f64, error: f64) -> Verdict {
        if row == 1 {
            return Verdict::GoOn;
        }
        let exponent = 1.0 / (2 * row - 1) as f64;
        let change = CHANGE.powf(exponent);
        let factor = (error / AIM).powf(exponent) / SAFETY;
        let factor = match factor.is_nan() {
            true => f64::INFINITY,
            false => factor,
        };
        self.steps[row] = length / factor.clamp(change, FALL / change);
        self.work[row] = evaluations(row) / self.steps[row];

        let target = self.target;
        if row + 1 < target {
            return Verdict::GoOn;
        }
        if error <= 1.0 {
            self.accept(row);
            return Verdict::Accept;
        }
        let hopeless = match row {
            row if row < target => growth(target) * growth(target + 1),
            row if row == target => growth(target + 1),
            _ => 1.0,
        };
        if error <= hopeless {
            return Verdict::GoOn;
        }
        self.reject(row);
        Verdict::Reject
    }

    /// Repeats a step, with a quarter of its length.
    pub fn shorten(&mut self, length: f64) {
        self.step = 0.25 * length;
        self.rejected = true;
    }

    /// The next order and step after a step that converged in `row`.
    fn accept(&mut self, row: usize) {
        let work = &self.work;
        let mut best;
        if row <= self.target {
            best = row;
            if row > 2 && work[row - 1] < LOWER * work[row] {
                best = row - 1;
            } else if row == 2 || work[row] < HIGHER * work[row - 1] {
                best = row + 1;
            }
        } else {
            best = row - 1;
            if row > 3 && work[row - 2] < LOWER * work[row - 1] {
                best = row - 2;
            }
            if work[row] < HIGHER * work[best] {
                best = row;
            }
        }
        best = best.clamp(LEAST_TARGET, MOST_ROWS - 1);
        let proposed = match best <= row {
            true => self.steps[best],
            false => self.steps[row] * evaluations(best) / evaluations(row),
        };
        // After a rejection neither grows.
        if self.rejected {
            best = best.min(row.max(LEAST_TARGET));
            self.step = self.step.min(proposed);
        } else {
            self.step = proposed;
        }
        self.target = best;
        self.rejected = false;
    }

    fn reject(&mut self, row: usize) {
        let mut best = self.target.min(row);
        if best > 2 && self.work[best - 1] < LOWER * self.work[best] {
            best -= 1;
        }
        self.step = self.steps[best];
        self.target = best.max(LEAST_TARGET);
        self.rejected = true;
    }
}
