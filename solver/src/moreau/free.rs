//! A step of the motion without contacts, by the midpoint rule.
//!
//! y = x + h f(t + h/2, (x + y)/2) (Hairer, Nørsett & Wanner 1993, section II.7), the method of θ = ½: it keeps the
//! energy of constant and of linear forces. Newton's method solves for states that depend on each other together,
//! and for others apart.

use super::scene::Free;
use crate::linalg::BlockLu;

/// Iterations with one matrix, and matrices, before a step counts as unsolvable.
const ITERATIONS: usize = 8;
const MATRICES: usize = 6;
/// A change below this share of a state is rounding.
const ROUNDING: f64 = 1e-13;

/// Memory for free steps.
pub(super) struct FreeStep {
    /// Where each state is among the rows of the matrix.
    place: Vec<usize>,
    /// (row, column, slope) of the entries of each block.
    blocks: Vec<Vec<(usize, usize, usize)>>,
    sizes: Vec<usize>,
    lu: BlockLu,
    /// ∂f/∂x where it was evaluated last, by slope.
    pub jacobian: Vec<f64>,
    /// f in the middle of the step.
    pub rates: Vec<f64>,
    /// The middle of the step.
    pub middle: Vec<f64>,
    change: Vec<f64>,
}

impl FreeStep {
    pub fn new(free: &impl Free) -> Self {
        let n = free.n_states();
        let slopes = free.slopes();
        let mut parents: Vec<usize> = (0..n).collect();
        for &(i, j) in slopes {
            let (a, b) = (root(&mut parents, i), root(&mut parents, j));
            parents[a.max(b)] = a.min(b);
        }
        let roots: Vec<usize> = (0..n).map(|i| root(&mut parents, i)).collect();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by_key(|&i| (roots[i], i));
        let (mut place, mut block, mut starts) = (vec![0; n], vec![0; n], Vec::new());
        for (at, &i) in order.iter().enumerate() {
            if at == 0 || roots[order[at - 1]] != roots[i] {
                starts.push(at);
            }
            (place[i], block[i]) = (at, starts.len() - 1);
        }
        let mut blocks = vec![Vec::new(); starts.len()];
        for (slope, &(i, j)) in slopes.iter().enumerate() {
            let first = starts[block[i]];
            blocks[block[i]].push((place[i] - first, place[j] - first, slope));
        }
        starts.push(n);
        let mut lu = BlockLu::default();
        lu.shape(&starts);
        FreeStep {
            place,
            blocks,
            sizes: starts.windows(2).map(|pair| pair[1] - pair[0]).collect(),
            lu,
            jacobian: vec![0.0; slopes.len()],
            rates: vec![0.0; n],
            middle: vec![0.0; n],
            change: vec![0.0; n],
        }
    }

    /// Writes y; false where Newton's method does not find it.
    pub fn solve(
        &mut self,
        free: &mut impl Free,
        (t, h): (f64, f64),
        x: &[f64],
        y: &mut [f64],
    ) -> bool {
        let middle = t + 0.5 * h;
        free.rates(middle, x, &mut self.rates);
        for (y, (x, f)) in y.iter_mut().zip(x.iter().zip(&self.rates)) {
            *y = x + h * f;
        }
        for _ in 0..MATRICES {
            self.between(x, y);
            free.jacobian(middle, &self.middle, &mut self.jacobian);
            if !self.factor(h) {
                return false;
            }
            for _ in 0..ITERATIONS {
                self.between(x, y);
                free.rates(middle, &self.middle, &mut self.rates);
                for (i, &at) in self.place.iter().enumerate() {
                    self.change[at] = x[i] + h * self.rates[i] - y[i];
                }
                self.lu.solve(&mut self.change);
                let mut done = true;
                for (i, &at) in self.place.iter().enumerate() {
                    let change = self.change[at];
                    y[i] += change;
                    let size = x[i].abs() + y[i].abs() + (h * self.rates[i]).abs();
                    done &= change.abs() <= ROUNDING * size;
                }
                if !y.iter().all(|y| y.is_finite()) {
                    return false;
                }
                if done {
                    return true;
                }
            }
        }
        false
    }

    fn between(&mut self, x: &[f64], y: &[f64]) {
        for (middle, (x, y)) in self.middle.iter_mut().zip(x.iter().zip(y)) {
            *middle = 0.5 * (x + y);
        }
    }

    /// I - h/2 ∂f/∂x
    fn factor(&mut self, h: f64) -> bool {
        for (b, (entries, &n)) in self.blocks.iter().zip(&self.sizes).enumerate() {
            let matrix = self.lu.matrix(b);
            (0..n).for_each(|k| matrix[k * n + k] = 1.0);
            for &(row, column, slope) in entries {
                matrix[row * n + column] -= 0.5 * h * self.jacobian[slope];
            }
        }
        self.lu.factor().is_ok()
    }
}

fn root(parents: &mut [usize], mut i: usize) -> usize {
    while parents[i] != i {
        parents[i] = parents[parents[i]];
        i = parents[i];
    }
    i
}
