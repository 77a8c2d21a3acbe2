use super::PairedLdl;
use crate::linalg::ldl::SparseLdl;
use crate::linalg::ldl::tests::{check, kkt};
use crate::linalg::symmetric::{FactorFailure, Inertia, KktSolver};
use crate::optimization::problem::Pattern;
use proptest::prelude::*;

proptest! {
    #[test]
    fn agrees_with_eigenvalues(
        entries in prop::collection::vec((0..24_usize, 0..24_usize, -1.0..1.0_f64), 0..80),
        x in prop::collection::vec(-1.0..1.0_f64, 17),
        n_pairs in 0..8_u32,
    ) {
        // Diagonally dominant rows: well conditioned with any pairs.
        let (pattern, values) = kkt(10, 7, &entries, 20.0, 20.0);
        let pairs: Vec<[u32; 2]> = (0..n_pairs).map(|i| [(3 * i) % 10, 10 + (i + 2) % 7]).take(7).collect();
        check(&mut PairedLdl::new(&pattern, &pairs), &pattern, &values, &x, 1e-12);
    }

    #[test]
    fn saddle_points_need_no_diagonal(
        entries in prop::collection::vec((0..17_usize, 0..10_usize, -0.1..0.1_f64), 0..80),
        x in prop::collection::vec(-1.0..1.0_f64, 17),
        diagonal in prop::collection::vec(1.0..2.0_f64, 7),
    ) {
        // J has a large entry in every row, the diagonal of the rows is zero, and H is as it comes.
        let large = (0..7).map(|i| (10 + i, i, diagonal[i]));
        let entries: Vec<_> = entries.into_iter().filter(|entry| entry.0 < 10).chain(large).collect();
        let (pattern, values) = kkt(10, 7, &entries, 0.5, 0.0);
        let pairs: Vec<[u32; 2]> = (0..7).map(|i| [i, 10 + i]).collect();
        check(&mut PairedLdl::new(&pattern, &pairs), &pattern, &values, &x, 1e-10);
    }
}

/// A row x - y = 0 is eliminated first where x and y have many neighbours, and divides by its own small diagonal: what y
/// has of its own is lost.
#[test]
fn pairs_keep_what_single_pivots_lose() {
    let hessian = (0..5_u32).flat_map(|i| (0..=i).map(move |j| (i, j)));
    let pattern = Pattern::new(6, hessian.chain([(5, 0), (5, 1), (5, 5)]).collect());
    let entries = (0..6).flat_map(|i| pattern.row(i).iter().map(move |&j| (i as u32, j)));
    let value = |entry| match entry {
        (5, 5) => -1e-10,
        (5, 0) => 1.0,
        (5, _) => -1.0,
        (i, j) if i == j => 1e-8,
        _ => 0.0,
    };
    let values: Vec<f64> = entries.map(value).collect();
    let lost = SparseLdl::new(&pattern).factor(&values);
    assert!(matches!(lost, Err(FactorFailure::ZeroPivot(_))));
    // Without pairs both do the same.
    assert_eq!(PairedLdl::new(&pattern, &[]).factor(&values), lost);
    let exact = Inertia {
        positive: 5,
        negative: 1,
    };
    let found = PairedLdl::new(&pattern, &[[0, 5]]).factor(&values);
    assert_eq!(found, Ok(exact));
}

#[test]
fn cancelled_pivots_are_reported() {
    let pattern = Pattern::new(2, vec![(0, 0), (1, 0), (1, 1)]);
    let mut solver = PairedLdl::new(&pattern, &[[0, 1]]);
    for values in [[1.0, 1.0, 1.0], [0.0, 0.0, 1.0], [0.1, 0.3, 0.9]] {
        let failure = solver.factor(&values).expect_err("the matrix is singular");
        assert!(matches!(failure, FactorFailure::ZeroPivot(_)));
    }
    let failure = solver.factor(&[f64::NAN, 0.0, 1.0]);
    assert_eq!(failure, Err(FactorFailure::NotFinite));
    let inertia = solver.factor(&[0.0, 2.0, 0.0]);
    assert_eq!(
        inertia,
        Ok(Inertia {
            positive: 1,
            negative: 1
        })
    );
}
