//! What a point is worth, measured by the rows, bounds and pairs alone.

use super::{Named, Problem};
use crate::optimization::problem::{Mpcc, Nlp, Side};

/// By how much a point misses the conditions of a problem.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Quality {
    /// The largest violation of a row or of a bound.
    #[serde(rename = "constraint_violation")]
    pub violation: f64,
    /// Where it is, unless there is none, or in a row that is none of the file.
    #[serde(skip)]
    pub worst: Option<Named>,
    /// The largest |min(G, H)| of a pair.
    pub complementarity_min: f64,
    /// The largest |G H| of a pair.
    pub complementarity_product: f64,
}

impl Problem {
    /// Measures a point of the program; what is not a number is infinitely bad.
    pub fn quality(&mut self, w: &[f64]) -> Quality {
        let mut values = vec![0.0; self.program.n_rows()];
        self.program.rows(w, &mut values);
        let program = &self.program;
        let (variables, rows) = (program.variable_bounds(), program.row_bounds());
        let outside = |value: f64, lower: f64, upper: f64| match value.is_nan() {
            true => f64::INFINITY,
            false => (lower - value).max(value - upper).max(0.0),
        };
        let mut quality = Quality::default();
        let mut see = |violation: f64, name: Option<Named>| {
            if violation > quality.violation {
                (quality.violation, quality.worst) = (violation, name);
            }
        };
        for (i, &value) in w.iter().enumerate() {
            let name = (i < self.sizes.variables).then_some(Named::Variable(i));
            see(outside(value, variables.lower[i], variables.upper[i]), name);
        }
        let mut of_file = vec![None; values.len()];
        for (row, at) in self.rows.iter().enumerate() {
            of_file[at.row as usize] = Some(Named::Row(row));
        }
        for (i, &value) in values.iter().enumerate() {
            see(outside(value, rows.lower[i], rows.upper[i]), of_file[i]);
        }
        let distance = |side: Side| match side {
            Side::Variable(i) => w[i as usize] - variables.lower[i as usize],
            Side::Row(i) => values[i as usize] - rows.lower[i as usize],
        };
        for pair in program.pairs() {
            let (g, h) = (distance(pair.a), distance(pair.b));
            let number = |value: f64| {
                if value.is_nan() {
                    f64::INFINITY
                } else {
                    value.abs()
                }
            };
            let least = if g.is_nan() { g } else { g.min(h) };
            quality.complementarity_min = quality.complementarity_min.max(number(least));
            quality.complementarity_product = quality.complementarity_product.max(number(g * h));
        }
        quality
    }
}
