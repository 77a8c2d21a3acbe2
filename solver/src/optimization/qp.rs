//! Convex quadratic programs with a diagonal Hessian, as programs over the cone of what is not negative ([`super::conic`]).
//!
//! minimize ½ Σ d_j x_j² + cᵀx  subject to  a_i·x + b_i >= 0
//!
//! Linear programs have d = 0.

use super::conic::{self, End, Program, Set};

/// The half-space a·x + b >= 0, a by its entries that are not zero.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfSpace {
    /// (j, a_j), ascending in j.
    pub normal: Vec<(usize, f64)>,
    /// b.
    pub offset: f64,
}

/// A solution with the multipliers that prove it.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// x.
    pub x: Vec<f64>,
    /// A multiplier z_i >= 0 per row: d∘x + c = Σ z_i a_i.
    pub multipliers: Vec<f64>,
}

/// What is asked of residuals and of the duality gap, relative to the size of the problem.
const TOLERANCE: f64 = 1e-11;

/// What stalls just above the tolerance is a solution too, within this.
const REDUCED: f64 = 1e3 * TOLERANCE;

/// Solves the program; `None` where the method finds no solution.
///
/// `curvature` is d and `cost` is c, both with an entry per variable.
pub fn solve(curvature: &[f64], cost: &[f64], rows: &[HalfSpace]) -> Option<Solution> {
    let (solution, is_solved) = approach(curvature, cost, rows)?;
    is_solved.then_some(solution)
}

/// The last iterate, and whether it is a solution to the tolerance.
pub fn approach(curvature: &[f64], cost: &[f64], rows: &[HalfSpace]) -> Option<(Solution, bool)> {
    let mut program = Program::default();
    for (j, &d) in curvature.iter().enumerate().filter(|(_, d)| **d != 0.0) {
        program.hessian.push((j, j, d));
    }
    let rows = rows.iter();
    program.add(
        Set::NonNegative,
        rows.map(|row| (row.normal.iter().copied(), row.offset)),
    );
    let found = program.minimize(cost, conic::settings(TOLERANCE, REDUCED), None)?;
    let solution = Solution {
        x: found.x,
        multipliers: found.z.iter().map(|z| z.max(0.0)).collect(),
    };
    Some((solution, found.end == End::Solved))
}

impl HalfSpace {
    /// a·x + b.
    pub fn value(&self, x: &[f64]) -> f64 {
        let products = self.normal.iter().map(|&(j, a)| a * x[j]);
        products.sum::<f64>() + self.offset
    }

    /// The other side: -a·x - b >= 0.
    pub fn opposite(&self) -> Self {
        HalfSpace {
            normal: self.normal.iter().map(|&(j, a)| (j, -a)).collect(),
            offset: -self.offset,
        }
    }

    /// The same with |a| = 1; `None` without a direction.
    pub fn normalized(mut self) -> Option<Self> {
        let squares = self.normal.iter().map(|&(_, a)| a * a);
        let length = squares.sum::<f64>().sqrt();
        if !(length.is_normal() && self.offset.is_finite()) {
            return None;
        }
        self.normal.iter_mut().for_each(|(_, a)| *a /= length);
        self.offset /= length;
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use super::{HalfSpace, solve};

    fn row(normal: &[f64], offset: f64) -> HalfSpace {
        HalfSpace {
            normal: normal.iter().copied().enumerate().collect(),
            offset,
        }
    }

    #[test]
    fn the_nearest_point_of_a_triangle() {
        // x + y >= 2, x <= 3, y <= 3 from the origin: (1, 1), with multiplier 1.
        let rows = [
            row(&[1.0, 1.0], -2.0),
            row(&[-1.0, 0.0], 3.0),
            row(&[0.0, -1.0], 3.0),
        ];
        let found = solve(&[1.0, 1.0], &[0.0, 0.0], &rows).expect("the triangle is not empty");
        let expected = ([1.0, 1.0], [1.0, 0.0, 0.0]);
        for (a, b) in found.x.iter().zip(expected.0) {
            assert!((a - b).abs() < 1e-9, "{found:?}");
        }
        for (a, b) in found.multipliers.iter().zip(expected.1) {
            assert!((a - b).abs() < 1e-9, "{found:?}");
        }
    }

    #[test]
    fn what_has_no_point_has_no_solution() {
        let rows = [row(&[1.0], -1.0), row(&[-1.0], 0.0)];
        assert_eq!(solve(&[0.0], &[1.0], &rows), None);
        // Unbounded.
        assert_eq!(solve(&[0.0], &[-1.0], &rows[..1]), None);
    }
}
