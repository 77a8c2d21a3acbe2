//! Symmetric systems of equations of which some say what others say, as those of redundant contacts.

/// A row that depends on others but for this, relative to its size, asks for nothing that those do not.
const DEPENDENT: f64 = 1e-9;

/// Solves for the rows that do not depend on others, by exchange of rows and columns alike, and returns which these
/// are; what belongs to the others is zero. `later` are the rows that others come before.
pub(crate) fn eliminate(
    matrix: &mut [f64],
    rhs: &mut [f64],
    later: impl Fn(usize) -> bool,
) -> Vec<bool> {
    let n = rhs.len();
    let sizes: Vec<f64> = (0..n).map(|i| matrix[i * n + i].abs()).collect();
    let mut solved = vec![false; n];
    for turn in [false, true] {
        loop {
            let share = |i: usize| matrix[i * n + i].abs() / sizes[i];
            let left = (0..n).filter(|&i| !solved[i] && later(i) == turn && sizes[i] > 0.0);
            let best = left.max_by(|&a, &b| share(a).total_cmp(&share(b)));
            let Some(pivot) = best.filter(|&best| share(best) > DEPENDENT) else {
                break;
            };
            for row in (0..n).filter(|&row| row != pivot) {
                let factor = matrix[row * n + pivot] / matrix[pivot * n + pivot];
                if factor != 0.0 {
                    for column in 0..n {
                        matrix[row * n + column] -= factor * matrix[pivot * n + column];
                    }
                    rhs[row] -= factor * rhs[pivot];
                }
            }
            solved[pivot] = true;
        }
    }
    for i in 0..n {
        rhs[i] = match solved[i] {
            true => rhs[i] / matrix[i * n + i],
            false => 0.0,
        };
    }
    solved
}

#[cfg(test)]
mod tests {
    use super::eliminate;

    #[test]
    fn dependent_rows_ask_for_nothing() {
        // The second row is the sum of the others, as is its right-hand side.
        let whole = [2.0, 3.0, 1.0, 3.0, 8.0, 5.0, 1.0, 5.0, 4.0];
        let given = [4.0, 13.0, 9.0];
        for last in 0..3 {
            let (mut matrix, mut rhs) = (whole, given);
            let solved = eliminate(&mut matrix, &mut rhs, |row| row == last);
            for (row, expected) in whole.chunks(3).zip(given) {
                let sum: f64 = row.iter().zip(&rhs).map(|(a, x)| a * x).sum();
                assert!((sum - expected).abs() <= 1e-12, "{rhs:?}");
            }
            for row in 0..3 {
                assert_eq!(solved[row], row != last);
                assert!(solved[row] || rhs[row] == 0.0);
            }
        }
    }
}
