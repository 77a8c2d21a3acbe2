//! Rows that leave their variables no choice.
//!
//! An affine row Σ a_j w_j + k whose least value within the bounds of its variables is its upper bound keeps all of
//! them at the bounds where it has this value: a sum of variables that are not negative is zero only if all of them
//! are (forcing constraints; Andersen and Andersen 1995). A branch that holds such a sum at zero has no interior until
//! its terms are held, too.

use crate::optimization::problem::{Bounds, Intervals, Nlp};

/// The affine rows of a problem.
#[derive(Clone, Debug, Default)]
pub struct Forcing {
    rows: Vec<Affine>,
}

#[derive(Clone, Debug)]
struct Affine {
    row: usize,
    /// (j, a_j).
    terms: Vec<(usize, f64)>,
    /// k.
    constant: f64,
}

/// How close the least value has to be to the bound, relative to the largest term or bound.
const TOLERANCE: f64 = 1e-12;

impl Forcing {
    /// Finds the rows whose derivatives are the same at two points.
    pub fn new(nlp: &mut dyn Nlp) -> Self {
        let start: Vec<f64> = nlp.start().to_vec();
        let n_entries = nlp.jacobian_pattern().n_entries();
        let (mut here, mut there) = (vec![0.0; n_entries], vec![0.0; n_entries]);
        nlp.jacobian(&start, &mut here);
        let moved = start.iter().zip(1..).map(|(w, j)| {
            // Other by a different amount for every variable, so that nothing cancels.
            w + 0.1 + 0.05 * f64::from(j).sin()
        });
        let moved: Vec<f64> = moved.collect();
        nlp.jacobian(&moved, &mut there);
        let mut values = vec![0.0; nlp.n_rows()];
        nlp.rows(&start, &mut values);
        let pattern = nlp.jacobian_pattern();
        let rows = (0..pattern.n_rows()).filter_map(|row| {
            let places = pattern.starts[row]..pattern.starts[row + 1];
            if here[places.clone()] != there[places.clone()] || !values[row].is_finite() {
                return None;
            }
            let columns = pattern.row(row).iter().map(|&j| j as usize);
            let terms: Vec<(usize, f64)> = columns
                .zip(here[places].iter().copied())
                .filter(|(_, a)| *a != 0.0)
                .collect();
            let products = terms.iter().map(|&(j, a)| a * start[j]);
            let constant = values[row] - products.sum::<f64>();
            Some(Affine {
                row,
                terms,
                constant,
            })
        });
        Forcing {
            rows: rows.collect(),
        }
    }

    /// Fixes what the rows force, until they force no more.
    pub fn propagate(&self, rows: Bounds<'_>, bounds: &mut Intervals) {
        loop {
            let mut has_changed = false;
            for affine in &self.rows {
                for (sign, bound) in [
                    (1.0, rows.upper[affine.row]),
                    (-1.0, -rows.lower[affine.row]),
                ] {
                    has_changed |= affine.force(sign, bound, bounds);
                }
            }
            if !has_changed {
                return;
            }
        }
    }
}

impl Affine {
    /// Fixes the variables when the least value of `sign` times the row is `bound`; whether any was free.
    fn force(&self, sign: f64, bound: f64, bounds: &mut Intervals) -> bool {
        let (lower, upper) = (&mut bounds.lower, &mut bounds.upper);
        if !bound.is_finite() {
            return false;
        }
        let mut least = sign * self.constant - bound;
        let mut size = self.constant.abs().max(bound.abs()).max(1.0);
        let mut is_open = false;
        for &(j, a) in &self.terms {
            let at = if sign * a > 0.0 { lower[j] } else { upper[j] };
            if !at.is_finite() {
                return false;
            }
            let term = sign * a * at;
            least += term;
            size = size.max(term.abs());
            is_open |= lower[j] < upper[j];
        }
        if !is_open || least.abs() > TOLERANCE * size {
            return false;
        }
        for &(j, a) in &self.terms {
            if sign * a > 0.0 {
                upper[j] = lower[j];
            } else {
                lower[j] = upper[j];
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::Forcing;
    use crate::optimization::problem::{Intervals, Nlp};
    use crate::optimization::quadratic::{Function, Quadratic};

    /// x + y + z = s with x, y, z, s >= 0, and a row x y that is not affine.
    fn sum() -> Quadratic {
        let sum = Function::default()
            .linear(0, 1.0)
            .linear(1, 2.0)
            .linear(2, 0.5);
        let rows = vec![
            (sum.linear(3, -1.0), 0.0, 0.0),
            (Function::default().product(0, 1, 1.0), -1.0, 0.0),
        ];
        let problem = Quadratic::new(4, Function::default(), rows);
        (0..4).fold(problem, |p, j| p.bound(j, 0.0, f64::INFINITY))
    }

    fn upper(held: Option<usize>) -> Vec<f64> {
        let mut problem = sum();
        let forcing = Forcing::new(&mut problem);
        let mut bounds = Intervals {
            lower: vec![0.0; 4],
            upper: vec![f64::INFINITY; 4],
        };
        if let Some(held) = held {
            bounds.upper[held] = 0.0;
        }
        forcing.propagate(problem.row_bounds(), &mut bounds);
        assert_eq!(bounds.lower, [0.0; 4]);
        bounds.upper
    }

    #[test]
    fn a_sum_that_is_zero_has_no_terms() {
        assert_eq!(upper(Some(3)), [0.0; 4]);
        // Neither a sum that is free nor one of its terms says anything.
        assert_eq!(upper(None), [f64::INFINITY; 4]);
        assert_eq!(upper(Some(0))[1..], [f64::INFINITY; 3]);
    }
}
