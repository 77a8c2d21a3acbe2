//! Multipliers of least norm.
//!
//! Where multipliers are not unique, those of an interior-point method may be far from the origin, and have wrong signs
//! there. y is least with r_i = 0 for all variables strictly between their bounds: (J Jᵀ + δ) (y⁺ - y) = -J r for these
//! columns of J, from y = 0 on, where δ is taken back in every step.

use crate::linalg::ldl::SparseLdl;
use crate::linalg::symmetric::KktSolver;
use crate::problem::Pattern;

use super::local::Local;

/// δ, relative to the largest entry of J.
const PROXIMITY: f64 = 1e-8;
const STEPS: usize = 3;

/// y of the rows `takes_row`, zero for the others; `None` where there is no factorization.
pub fn least_multipliers(
    local: &Local,
    is_inside: impl Fn(usize) -> bool,
    takes_row: impl Fn(usize) -> bool,
) -> Option<Vec<f64>> {
    let numbers = |count: usize, takes: &dyn Fn(usize) -> bool| {
        let mut next = 0..;
        let number = |i| takes(i).then(|| next.next()).flatten();
        (0..count).map(number).collect::<Vec<Option<u32>>>()
    };
    let columns = numbers(local.w.len(), &is_inside);
    let rows = numbers(local.rows.len(), &takes_row);
    let n = columns.iter().flatten().count();
    let m = rows.iter().flatten().count();
    // ( -1  Jᵀ ) ( r  )   ( -r )
    // (  J  δ  ) ( Δy ) = (  0 )
    let entries = local.jacobian.iter().filter_map(|&(row, j, value)| {
        let (row, column) = (rows[row]?, columns[j]?);
        Some((n as u32 + row, column, value))
    });
    let entries: Vec<(u32, u32, f64)> = entries.collect();
    let diagonal = (0..(n + m) as u32).map(|i| (i, i));
    let off_diagonal = entries.iter().map(|&(row, column, _)| (row, column));
    let pattern = Pattern::new(n + m, diagonal.chain(off_diagonal).collect());
    let mut values = vec![0.0; pattern.n_entries()];
    let mut largest = 1.0_f64;
    for &(row, column, value) in &entries {
        values[pattern.place(row as usize, column)?] += value;
        largest = largest.max(value.abs());
    }
    for i in 0..n + m {
        let place = pattern.place(i, i as u32)?;
        values[place] = if i < n { -1.0 } else { PROXIMITY * largest };
    }
    let mut ldl = SparseLdl::new(&pattern);
    ldl.factor(&values).ok()?;
    let mut y = vec![0.0; local.rows.len()];
    let mut rhs = vec![0.0; n + m];
    for _ in 0..STEPS {
        rhs.fill(0.0);
        for (&column, r) in columns.iter().zip(local.reduced_gradient(&y)) {
            if let Some(column) = column {
                rhs[column as usize] = -r;
            }
        }
        ldl.solve(&mut rhs);
        for (y, &row) in y.iter_mut().zip(&rows) {
            if let Some(row) = row {
                *y += rhs[n + row as usize];
            }
        }
    }
    Some(y)
}

#[cfg(test)]
mod tests {
    use super::least_multipliers;
    use crate::mpcc::local::Local;

    #[test]
    fn rows_that_repeat_each_other_share_a_multiplier() {
        // f = 3 x + u, the rows x and x once more and 2 x + u, which is not active; u is at a bound.
        let local = Local {
            w: vec![0.0; 2],
            gradient: vec![3.0, 1.0],
            rows: vec![0.0; 3],
            jacobian: vec![(0, 0, 1.0), (1, 0, 1.0), (2, 0, 2.0), (2, 1, 1.0)],
            scale: 3.0,
        };
        let y = least_multipliers(&local, |i| i == 0, |row| row < 2).expect("there are some");
        for (y, exact) in y.iter().zip([-1.5, -1.5, 0.0]) {
            assert!((y - exact).abs() < 1e-12, "{y} instead of {exact}");
        }
    }
}
