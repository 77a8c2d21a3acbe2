use super::{NONE, Weights, matching};
use proptest::prelude::*;

/// The largest product of one entry of every row, no two of a column, by trying all; zero if there is none.
fn largest_product(dense: &[Vec<f64>], row: usize, used: &mut Vec<bool>) -> f64 {
    if row == dense.len() {
        return 1.0;
    }
    let mut largest = 0.0_f64;
    for column in 0..used.len() {
        if !used[column] && dense[row][column] > 0.0 {
            used[column] = true;
            largest = largest.max(dense[row][column] * largest_product(dense, row + 1, used));
            used[column] = false;
        }
    }
    largest
}

fn sparse(dense: &[Vec<f64>]) -> (Vec<u32>, Vec<u32>, Vec<f64>) {
    let (mut starts, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
    for row in dense {
        for (column, &weight) in row.iter().enumerate().filter(|entry| *entry.1 > 0.0) {
            columns.push(column as u32);
            weights.push(weight);
        }
        starts.push(columns.len() as u32);
    }
    (starts, columns, weights)
}

proptest! {
    #[test]
    fn the_product_is_the_largest(
        n_rows in 1..6_usize,
        n_columns in 1..7_usize,
        entries in prop::collection::vec(prop_oneof![Just(0.0), 1e-3..1.0_f64, Just(1.0)], 42),
    ) {
        let dense: Vec<Vec<f64>> = (0..n_rows).map(|i| entries[i * 7..][..n_columns].to_vec()).collect();
        let (starts, columns, weights) = sparse(&dense);
        let found = matching(&Weights { starts: &starts, columns: &columns, weights: &weights, n_columns });
        let mut used = vec![false; n_columns];
        let mut product = 1.0;
        for (row, &column) in found.iter().enumerate().filter(|pair| *pair.1 != NONE) {
            prop_assert!(!std::mem::replace(&mut used[column as usize], true));
            prop_assert!(dense[row][column as usize] > 0.0);
            product *= dense[row][column as usize];
        }
        let largest = largest_product(&dense, 0, &mut vec![false; n_columns]);
        // Where not every row can have a column, some have none.
        prop_assert_eq!(found.contains(&NONE), largest == 0.0);
        if largest > 0.0 {
            prop_assert!((product / largest - 1.0).abs() < 1e-12, "{} instead of {}", product, largest);
        }
    }
}

#[test]
fn paths_may_be_long() {
    // Row i takes columns i and i + 1, the last row only column 0: all others have to move on.
    let n = 200_u32;
    let mut columns: Vec<u32> = (0..n).flat_map(|i| [i, i + 1]).collect();
    columns.push(0);
    let starts: Vec<u32> = (0..=n).map(|i| 2 * i).chain([2 * n + 1]).collect();
    let weights = vec![1.0; columns.len()];
    let found = matching(&Weights {
        starts: &starts,
        columns: &columns,
        weights: &weights,
        n_columns: n as usize + 1,
    });
    let expected: Vec<u32> = (1..=n).chain([0]).collect();
    assert_eq!(found, expected);
}
