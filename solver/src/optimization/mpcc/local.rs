//! A problem in vertical form at a point: values, first derivatives, and what is active there.

use super::lift::Lifted;
use crate::optimization::problem::{Member, Nlp};

/// Values and first derivatives at a point w.
#[derive(Clone, Debug)]
pub struct Local {
    /// w.
    pub w: Vec<f64>,
    /// ∇f.
    pub gradient: Vec<f64>,
    /// c.
    pub rows: Vec<f64>,
    /// The Jacobian of c as entries (row, column, value).
    pub jacobian: Vec<(usize, usize, f64)>,
    /// What the size of a gradient is measured by: max(1, |∇f|).
    pub scale: f64,
}

/// Where the sides of all pairs are zero.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sets {
    /// Variables that are zero in a pair whose other side is not, or forced by such zeros, or by their bounds: kept
    /// by a multiplier of any sign.
    pub fixed: Vec<bool>,
    /// Pairs both of whose sides are zero and none of them fixed.
    pub biactive: Vec<usize>,
}

impl Local {
    /// Evaluates all at w.
    pub fn new(lifted: &mut Lifted<'_>, w: &[f64]) -> Self {
        let mut gradient = vec![0.0; lifted.n_variables()];
        lifted.gradient(w, &mut gradient);
        let mut rows = vec![0.0; lifted.n_rows()];
        lifted.rows(w, &mut rows);
        let mut values = vec![0.0; lifted.jacobian_pattern().n_entries()];
        lifted.jacobian(w, &mut values);
        let pattern = lifted.jacobian_pattern();
        let entries = (0..pattern.n_rows()).flat_map(|row| {
            let places = pattern.starts[row]..pattern.starts[row + 1];
            let values = &values[places];
            let columns = pattern.row(row).iter().zip(values);
            columns.map(move |(&j, &value)| (row, j as usize, value))
        });
        let jacobian = entries.filter(|entry| entry.2 != 0.0).collect();
        let largest = gradient.iter().fold(1.0, |m: f64, g| m.max(g.abs()));
        Local {
            w: w.to_vec(),
            gradient,
            rows,
            jacobian,
            scale: largest,
        }
    }

    /// Whether all values and derivatives are finite.
    pub fn is_finite(&self) -> bool {
        let entries = self.jacobian.iter().map(|entry| &entry.2);
        let all = self.gradient.iter().chain(&self.rows).chain(entries);
        all.into_iter().all(|value| value.is_finite())
    }

    /// ∇f + Jᵀy.
    pub fn reduced_gradient(&self, y: &[f64]) -> Vec<f64> {
        let mut reduced = self.gradient.clone();
        for &(row, j, value) in &self.jacobian {
            reduced[j] += value * y[row];
        }
        reduced
    }
}

impl Sets {
    /// The sets at w; a side at most `tolerance` is zero.
    pub fn new(lifted: &Lifted<'_>, w: &[f64], tolerance: f64) -> Self {
        let mut held = Vec::new();
        let mut both = Vec::new();
        for pair in 0..lifted.pairs().len() {
            let [a, b] = lifted.distances(pair, w);
            if a.max(b) <= tolerance {
                both.push(pair);
            } else {
                // Where none is zero, the smaller one is meant to be.
                held.push((pair, if a <= b { Member::A } else { Member::B }));
            }
        }
        let bounds = lifted.hold(held.into_iter());
        let bounds = bounds.lower.iter().zip(&bounds.upper);
        let fixed: Vec<bool> = bounds.map(|(l, u)| l == u).collect();
        // A pair that a fixed side satisfies leaves its other side a bound like any other.
        both.retain(|&pair| !lifted.pairs()[pair].iter().any(|&v| fixed[v as usize]));
        Sets {
            fixed,
            biactive: both,
        }
    }
}
