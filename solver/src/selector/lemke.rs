//! More surfaces than can be enumerated: one choice by Lemke's method, others by search.

use nalgebra::DMatrix;

use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::expansion::scales::TIE;
use crate::hybrid::Side;
use crate::optimization::lcp;

/// α and rates this close to their bounds after Lemke's method are tried on both sides.
const NEAR: f64 = 1e-7;

/// Partial choices looked at by the search for further solutions.
const MAX_NODES: usize = 4000;

/// φ = b + Aα on the surfaces of a group.
pub(crate) struct Problem<'m> {
    pub mode: &'m mut Mode,
    pub state: &'m State,
    pub group: &'m [usize],
}

impl Problem<'_> {
    /// -A, with every row divided by its size.
    fn matrix(&self) -> (Vec<f64>, Vec<f64>) {
        let n = self.group.len();
        let mut matrix = vec![0.0; n * n];
        let mut sizes = vec![1.0; n];
        for row in 0..n {
            for col in 0..n {
                matrix[row * n + col] = -self.mode.coupling(self.group[row], self.group[col]);
            }
            let row_of = &mut matrix[row * n..(row + 1) * n];
            let size = row_of.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            sizes[row] = size.max(self.mode.phi(self.group[row]).abs());
            if sizes[row] == 0.0 {
                sizes[row] = 1.0;
            }
            row_of.iter_mut().for_each(|v| *v /= sizes[row]);
        }
        (matrix, sizes)
    }

    /// True when -A is proved to be a P-matrix here, so that there is exactly one solution, or one of forces alone that is
    /// positive semidefinite: those that solve it have the same rates.
    pub(crate) fn is_unique(&mut self) -> bool {
        self.mode.vary(&self.state.point.alpha);
        self.mode.linearize(self.group);
        let n = self.group.len();
        let (matrix, sizes) = self.matrix();
        lcp::is_p_matrix(&matrix, n) == Some(true)
            || (0..n).all(|row| self.is_force(row)) && is_semidefinite(&matrix, &sizes)
    }

    /// Whether what keeps a surface is a force λ = 1 - α, which has no bound.
    fn is_force(&self, row: usize) -> bool {
        self.mode.system.is_unilateral(self.group[row])
    }

    /// One solution by Lemke's method, relinearized until the sides repeat: the sides of every
    /// switch, several where a rate vanishes at a bound of α.
    ///
    /// w = Mz + q with z = (α, p), w = (n, 1 - α), M = (-A I; -I 0), q = (-b, e); of forces, which have no bound, z = λ and
    /// w = φ.
    pub(crate) fn pivot(&mut self, options: &[Vec<Side>]) -> Option<Vec<Vec<Side>>> {
        let n = self.group.len();
        let is_force: Vec<bool> = (0..n).map(|row| self.is_force(row)).collect();
        let mut alpha = self.state.point.alpha.clone();
        let mut last = Vec::new();
        for _ in 0..20 {
            self.mode.vary(&alpha);
            self.mode.linearize(self.group);
            let (matrix, sizes) = self.matrix();
            let size = 2 * n;
            let mut m = vec![0.0; size * size];
            let (mut q, mut cover) = (vec![1.0; size], vec![1.0; size]);
            // φ where all α are zero, and where there is neither a force nor another α.
            let mut rates = vec![0.0; n];
            for row in 0..n {
                let sign = if is_force[row] { -1.0 } else { 1.0 };
                let mut b = self.mode.phi(self.group[row]) / sizes[row];
                let mut pushed = 0.0;
                for (col, &is_force) in is_force.iter().enumerate() {
                    let entry = matrix[row * n + col];
                    b += entry * alpha[self.group[col]];
                    pushed += if is_force { entry } else { 0.0 };
                    m[row * size + col] = if is_force {
                        -sign * entry
                    } else {
                        sign * entry
                    };
                    cover[row] += entry.abs();
                }
                if !is_force[row] {
                    m[row * size + n + row] = 1.0;
                    m[(n + row) * size + row] = -1.0;
                }
                q[row] = -sign * (b - pushed);
                rates[row] = b;
            }
            let z = lcp::lemke(&m, &q, &cover).ok()?;
            for (row, (&i, &z)) in self.group.iter().zip(&z).enumerate() {
                alpha[i] = if is_force[row] { 1.0 - z } else { z };
            }
            let sides = |row: usize| {
                let terms = (0..n).map(|col| matrix[row * n + col] * alpha[self.group[col]]);
                let rate = rates[row] - terms.sum::<f64>();
                match is_force[row] {
                    true => {
                        let gain = matrix[row * n + row] * z[row];
                        let terms = (0..n).map(|col| (m[row * size + col] * z[col]).abs());
                        pushed(
                            [gain, rate],
                            q[row].abs() + terms.sum::<f64>(),
                            &options[row],
                        )
                    }
                    false => nearest(z[row], rate, &options[row]),
                }
            };
            let sides: Vec<Vec<Side>> = (0..n).map(sides).collect();
            if sides == last {
                break;
            }
            last = sides;
        }
        Some(last)
    }

    /// All choices of sides that interval bounds of φ do not exclude, by branch and bound, and whether these are all of
    /// them: no more than `MAX_NODES` partial choices are looked at.
    ///
    /// φ = b + Aα with α_j = 0 or 1 of decided switches and α_j ∈ [0, 1] of undecided and sliding ones gives
    /// low ≤ φ ≤ high. Minus needs low ≤ 0, plus high ≥ 0, and sliding both.
    pub(crate) fn search(&mut self, options: &[Vec<Side>]) -> (Vec<Vec<Side>>, bool) {
        let n = self.group.len();
        self.mode.vary(&self.state.point.alpha);
        self.mode.linearize(self.group);
        let (matrix, sizes) = self.matrix();
        let (mut low, mut high) = (vec![0.0; n], vec![0.0; n]);
        for row in 0..n {
            let mut b = self.mode.phi(self.group[row]) / sizes[row];
            for (entry, &i) in matrix[row * n..(row + 1) * n].iter().zip(self.group) {
                b += entry * self.state.point.alpha[i];
                low[row] -= entry.max(0.0);
                high[row] -= entry.min(0.0);
            }
            low[row] += b;
            high[row] += b;
        }
        // A force has no bound, and neither has what it does.
        for at in (0..n).filter(|&at| self.is_force(at)) {
            for row in 0..n {
                if matrix[row * n + at] != 0.0 {
                    (low[row], high[row]) = (f64::NEG_INFINITY, f64::INFINITY);
                }
            }
        }
        let is_possible = |sides: &[Side], low: &[f64], high: &[f64]| {
            sides.iter().enumerate().all(|(row, side)| match side {
                Side::Minus => low[row] <= NEAR,
                Side::Slide => low[row] <= NEAR && high[row] >= -NEAR,
                Side::Plus => high[row] >= -NEAR,
            })
        };
        let mut found = Vec::new();
        let mut open = vec![(Vec::new(), low, high)];
        for _ in 0..MAX_NODES {
            let Some((sides, low, high)) = open.pop() else {
                break;
            };
            if !is_possible(&sides, &low, &high) {
                continue;
            }
            let at = sides.len();
            if at == n {
                found.push(sides);
                continue;
            }
            for &side in &options[at] {
                let (mut low, mut high) = (low.clone(), high.clone());
                if side != Side::Slide {
                    let alpha = if side == Side::Plus { 1.0 } else { 0.0 };
                    for row in 0..n {
                        let slope = -matrix[row * n + at];
                        low[row] += slope * alpha - slope.min(0.0);
                        high[row] += slope * alpha - slope.max(0.0);
                    }
                }
                open.push(([sides.as_slice(), &[side]].concat(), low, high));
            }
        }
        (found, open.is_empty())
    }
}

/// Whether a matrix with rows over these sizes is symmetric and positive semidefinite, to rounding of its largest entries.
fn is_semidefinite(matrix: &[f64], sizes: &[f64]) -> bool {
    const ROUNDING: f64 = 1e-12;
    let n = sizes.len();
    let whole = DMatrix::from_fn(n, n, |row, col| sizes[row] * matrix[row * n + col]);
    let within = ROUNDING * whole.amax();
    let is_symmetric = (&whole - whole.transpose()).amax() <= within;
    is_symmetric && whole.symmetric_eigenvalues().min() >= -within * n as f64
}

/// The sides that a force and a rate stand for, one of which is zero to rounding of terms that are so large.
fn pushed([gain, rate]: [f64; 2], terms: f64, options: &[Side]) -> Vec<Side> {
    let side = if gain > rate { Side::Slide } else { Side::Plus };
    match gain.max(rate) <= NEAR * terms {
        true => options.to_vec(),
        false => vec![side],
    }
}

/// The sides α and its rate stand for, of those a switch has.
fn nearest(alpha: f64, rate: f64, options: &[Side]) -> Vec<Side> {
    let side = if alpha <= TIE {
        Side::Minus
    } else if alpha >= 1.0 - TIE {
        Side::Plus
    } else {
        Side::Slide
    };
    let slides = options.contains(&Side::Slide);
    if !slides {
        // α of a continuous switch does not matter: its rate decides.
        return match rate {
            rate if rate.abs() <= NEAR => options.to_vec(),
            rate => vec![Side::of(rate)],
        };
    }
    let mut sides = vec![side];
    if rate.abs() <= NEAR {
        let other = if side != Side::Slide {
            Some(Side::Slide)
        } else if alpha <= NEAR {
            Some(Side::Minus)
        } else if alpha >= 1.0 - NEAR {
            Some(Side::Plus)
        } else {
            None
        };
        sides.extend(other);
    }
    sides
}
