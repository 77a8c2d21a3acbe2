use super::SparseLdl;
use crate::linalg::bunch_kaufman::BunchKaufman;
use crate::linalg::symmetric::{FactorFailure, Inertia, KktSolver};
use crate::optimization::problem::Pattern;
use proptest::prelude::*;

/// A random matrix [H + w J'; J -d]: entries of the lower triangle, row by row.
pub fn kkt(
    n: usize,
    m: usize,
    entries: &[(usize, usize, f64)],
    w: f64,
    d: f64,
) -> (Pattern, Vec<f64>) {
    let size = n + m;
    let mut dense = vec![0.0; size * size];
    let mut places: Vec<(u32, u32)> = (0..size as u32).map(|i| (i, i)).collect();
    for &(i, j, value) in entries {
        let (i, j) = (i % size, j % n);
        let (i, j) = (i.max(j), i.min(j));
        dense[i * size + j] = value;
        places.push((i as u32, j as u32));
    }
    for i in 0..size {
        dense[i * size + i] += if i < n { w } else { -d };
    }
    let pattern = Pattern::new(size, places);
    let values = (0..size).flat_map(|i| pattern.row(i).iter().map(move |&j| i * size + j as usize));
    let values = values.map(|place| dense[place]).collect();
    (pattern, values)
}

fn multiply(pattern: &Pattern, values: &[f64], x: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; x.len()];
    for i in 0..x.len() {
        let range = pattern.starts[i]..pattern.starts[i + 1];
        for (&j, &a) in pattern.row(i).iter().zip(&values[range]) {
            let j = j as usize;
            product[i] += a * x[j];
            if j != i {
                product[j] += a * x[i];
            }
        }
    }
    product
}

/// By the eigenvalues of the dense matrix.
fn inertia(pattern: &Pattern, values: &[f64]) -> Inertia {
    let n = pattern.n_rows();
    let mut dense = nalgebra::DMatrix::zeros(n, n);
    for i in 0..n {
        let range = pattern.starts[i]..pattern.starts[i + 1];
        for (&j, &a) in pattern.row(i).iter().zip(&values[range]) {
            dense[(i, j as usize)] = a;
            dense[(j as usize, i)] = a;
        }
    }
    let eigenvalues = dense.symmetric_eigenvalues();
    Inertia {
        positive: eigenvalues.iter().filter(|&&value| value > 0.0).count(),
        negative: eigenvalues.iter().filter(|&&value| value < 0.0).count(),
    }
}

pub fn check(
    solver: &mut dyn KktSolver,
    pattern: &Pattern,
    values: &[f64],
    x: &[f64],
    tolerance: f64,
) {
    let found = solver.factor(values).expect("the matrix is not singular");
    assert_eq!(found, inertia(pattern, values));
    let mut solution = multiply(pattern, values, x);
    solver.solve(&mut solution);
    for (found, exact) in solution.iter().zip(x) {
        assert!(
            (found - exact).abs() < tolerance,
            "{found} instead of {exact}"
        );
    }
}

proptest! {
    #[test]
    fn agrees_with_eigenvalues(
        entries in prop::collection::vec((0..24_usize, 0..24_usize, -1.0..1.0_f64), 0..80),
        x in prop::collection::vec(-1.0..1.0_f64, 17),
    ) {
        // Diagonally dominant rows: well conditioned, whatever their signs.
        let (pattern, values) = kkt(10, 7, &entries, 20.0, 20.0);
        check(&mut SparseLdl::new(&pattern, &[]), &pattern, &values, &x, 1e-12);
        check(&mut BunchKaufman::new(&pattern), &pattern, &values, &x, 1e-12);
    }

    #[test]
    fn an_indefinite_hessian_changes_the_inertia(
        entries in prop::collection::vec((0..24_usize, 0..24_usize, -1.0..1.0_f64), 30..80),
        x in prop::collection::vec(-1.0..1.0_f64, 17),
    ) {
        let (pattern, values) = kkt(10, 7, &entries, 0.3, 1e-2);
        let mut dense = BunchKaufman::new(&pattern);
        check(&mut dense, &pattern, &values, &x, 1e-8);
        let mut sparse = SparseLdl::new(&pattern, &[]);
        if let Ok(found) = sparse.factor(&values) {
            prop_assert_eq!(found, inertia(&pattern, &values));
        }
    }

    #[test]
    fn pairs_agree_with_eigenvalues(
        entries in prop::collection::vec((0..24_usize, 0..24_usize, -1.0..1.0_f64), 0..80),
        x in prop::collection::vec(-1.0..1.0_f64, 17),
        n_pairs in 0..8_u32,
    ) {
        // Diagonally dominant rows: well conditioned with any pairs.
        let (pattern, values) = kkt(10, 7, &entries, 20.0, 20.0);
        let pairs: Vec<[u32; 2]> = (0..n_pairs).map(|i| [(3 * i) % 10, 10 + (i + 2) % 7]).take(7).collect();
        check(&mut SparseLdl::new(&pattern, &pairs), &pattern, &values, &x, 1e-12);
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
        check(&mut SparseLdl::new(&pattern, &pairs), &pattern, &values, &x, 1e-10);
    }
}

/// Columns that are eliminated in runs, where some of L is full and some is not.
#[test]
fn long_columns_agree_with_eigenvalues() {
    for (modulus, count) in [(7, 4), (11, 8), (13, 40)] {
        let entry = |k: usize| {
            let (i, j) = (k * k % 83 + 3 * k, 5 * k + k * k * k % 71);
            (i, j, ((k % modulus) as f64 - 2.0) / modulus as f64)
        };
        let entries: Vec<_> = (0..70 * count).map(entry).collect();
        let (pattern, values) = kkt(50, 30, &entries, 30.0, 30.0);
        let mut sparse = SparseLdl::new(&pattern, &[]);
        let longest = sparse
            .analysis
            .starts
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .max();
        assert!(longest > Some(16), "{longest:?}");
        let x: Vec<f64> = (0..80).map(|i| (i as f64).sin()).collect();
        check(&mut sparse, &pattern, &values, &x, 1e-12);
        let pairs: Vec<[u32; 2]> = (0..30).map(|i| [i, 50 + i]).collect();
        let mut paired = SparseLdl::new(&pattern, &pairs);
        check(&mut paired, &pattern, &values, &x, 1e-12);
    }
}

#[test]
fn a_chain_has_as_many_entries_as_links() {
    let n = 1000_u32;
    let entries = (0..n).flat_map(|i| [(i, i), (i, i.saturating_sub(1))]);
    let pattern = Pattern::new(n as usize, entries.collect());
    let solver = SparseLdl::new(&pattern, &[]);
    assert_eq!(solver.n_entries(), 999);
}

#[test]
fn cancelled_pivots_are_reported() {
    let pattern = Pattern::new(2, vec![(0, 0), (1, 0), (1, 1)]);
    let mut solver = SparseLdl::new(&pattern, &[]);
    for values in [[1.0, 1.0, 1.0], [0.0, 0.0, 1.0], [0.1, 0.3, 0.9]] {
        let failure = solver.factor(&values).expect_err("the matrix is singular");
        assert!(matches!(failure, FactorFailure::ZeroPivot(_)));
    }
    let failure = solver.factor(&[f64::NAN, 0.0, 1.0]);
    assert_eq!(failure, Err(FactorFailure::NotFinite));
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
    let lost = SparseLdl::new(&pattern, &[]).factor(&values);
    assert!(matches!(lost, Err(FactorFailure::ZeroPivot(_))));
    let exact = Inertia {
        positive: 5,
        negative: 1,
    };
    let found = SparseLdl::new(&pattern, &[[0, 5]]).factor(&values);
    assert_eq!(found, Ok(exact));
}

#[test]
fn cancelled_pivots_of_pairs_are_reported() {
    let pattern = Pattern::new(2, vec![(0, 0), (1, 0), (1, 1)]);
    let mut solver = SparseLdl::new(&pattern, &[[0, 1]]);
    for values in [[1.0, 1.0, 1.0], [0.0, 0.0, 1.0], [0.1, 0.3, 0.9]] {
        let failure = solver.factor(&values).expect_err("the matrix is singular");
        assert!(matches!(failure, FactorFailure::ZeroPivot(_)));
    }
    let failure = solver.factor(&[f64::NAN, 0.0, 1.0]);
    assert_eq!(failure, Err(FactorFailure::NotFinite));
    assert!(solver.factor(&[1.0, f64::NAN, 1.0]).is_err());
    let inertia = solver.factor(&[0.0, 2.0, 0.0]);
    assert_eq!(
        inertia,
        Ok(Inertia {
            positive: 1,
            negative: 1
        })
    );
}
