use super::BunchKaufman;
use crate::linalg::symmetric::{FactorFailure, Inertia, KktSolver};
use crate::optimization::problem::Pattern;

#[test]
fn zeros_on_the_diagonal_need_blocks() {
    // (0 1 2; 1 0 3; 2 3 0) has one positive eigenvalue; its determinant is 12.
    let pattern = Pattern::new(3, vec![(1, 0), (2, 0), (2, 1)]);
    let mut solver = BunchKaufman::new(&pattern);
    let inertia = solver.factor(&[1.0, 2.0, 3.0]);
    let (positive, negative) = (1, 2);
    assert_eq!(inertia, Ok(Inertia { positive, negative }));
    let mut rhs = [1.0 * -2.0 + 2.0 * 0.5, 1.0 + 3.0 * 0.5, 2.0 - 6.0];
    solver.solve(&mut rhs);
    for (found, exact) in rhs.iter().zip([1.0, -2.0, 0.5]) {
        assert!((found - exact).abs() < 1e-14);
    }
}

#[test]
fn what_is_left_without_a_pivot_is_reported() {
    let pattern = Pattern::new(2, vec![(0, 0), (1, 0), (1, 1)]);
    let mut solver = BunchKaufman::new(&pattern);
    assert_eq!(
        solver.factor(&[1.0, 1.0, 1.0]),
        Err(FactorFailure::ZeroPivot(1))
    );
    let failure = solver.factor(&[f64::INFINITY, 1.0, 1.0]);
    assert_eq!(failure, Err(FactorFailure::NotFinite));
}
