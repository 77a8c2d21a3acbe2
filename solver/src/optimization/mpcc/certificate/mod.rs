//! What a point is: its residuals, its stationarity class by multipliers, and B-stationarity.

pub(crate) mod class;
pub(crate) mod curvature;
pub(crate) mod least;
pub(crate) mod lpec;
#[cfg(test)]
mod point_tests;
pub(crate) mod unique;
use std::sync::Arc;

use super::lift::Lifted;
use super::local::{Local, Sets};
use crate::linalg::analyses::Analyses;
use crate::optimization::mpcc::certificate::class::{Class, classify};
use crate::optimization::mpcc::certificate::lpec::{Descent, descend};
use crate::optimization::problem::{Bounds, Nlp};
use crate::optimization::scaling::Sizes;
use crate::runtime::limit::Limit;

/// How far a point is from satisfying the problem.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residuals {
    /// The largest violation of a row or bound, sides of pairs included.
    pub violation: f64,
    /// The largest |min(a, b)|.
    pub complementarity: f64,
    /// The largest |a b|.
    pub product: f64,
}

/// Tolerances of a certificate.
#[derive(Clone, Debug)]
pub struct Tolerances {
    /// A side of a pair is zero when it is at most this.
    pub biactive: f64,
    /// A bound or row is active when it is at most this away, times max(1, |value|).
    pub active: f64,
    /// Reduced gradients up to this, times max(1, |∇f|), are zero; decreases below it, times the radius, are none.
    pub stationarity: f64,
    /// A variable whose way to a bound would decrease f by no more than this, times max(1, |∇f|), is at the bound:
    /// interior-point methods end so far from bounds with small multipliers.
    pub gain: f64,
    /// Δ of the linear program with complementarity constraints.
    pub radius: f64,
    /// How many linear programs may be solved for B-stationarity.
    pub node_limit: usize,
    /// The sizes that these and all other tolerances of a run are relative to, 1 without.
    pub sizes: Option<Arc<Sizes>>,
    /// When searches have to end, undecided if need be.
    pub limit: Limit,
    /// Symbolic factorizations that are known, and those that are made.
    pub analyses: Analyses,
}

impl Default for Tolerances {
    fn default() -> Self {
        Tolerances {
            biactive: 1e-6,
            active: 1e-6,
            stationarity: 1e-6,
            gain: 1e-11,
            radius: 1e-4,
            node_limit: 100,
            sizes: None,
            limit: Limit::default(),
            analyses: Analyses::default(),
        }
    }
}

/// Stationarity of a feasible point.
#[derive(Clone, Debug)]
pub struct Certificate {
    /// The strongest class that was shown.
    pub class: Class,
    /// Whether stronger classes are excluded.
    pub is_exact: bool,
    /// Whether no feasible direction descends: `None` where the search met its limit.
    pub b_stationary: Option<bool>,
    /// Whether all functions and derivatives are finite.
    pub is_differentiable: bool,
    /// Pairs with both sides zero.
    pub biactive: Vec<usize>,
    /// y of the rows of the vertical form.
    pub y: Vec<f64>,
    /// ∇f + Jᵀy of the variables of the vertical form: for a side at zero, its multiplier ν.
    pub reduced: Vec<f64>,
    /// A direction of descent in the vertical form, when the point is not B-stationary.
    pub descent: Option<Vec<f64>>,
}

impl Residuals {
    /// Those of a point of the vertical form.
    pub fn new(lifted: &mut Lifted<'_>, w: &[f64]) -> Self {
        Self::measured(lifted, w, None)
    }

    /// Those of a point of the vertical form of a problem of such sizes, in the units of the problem itself.
    pub fn measured(lifted: &mut Lifted<'_>, w: &[f64], sizes: Option<&Sizes>) -> Self {
        let mut rows = vec![0.0; lifted.n_rows()];
        lifted.rows(w, &mut rows);
        let of_rows = sizes.map_or_else(|| vec![1.0; rows.len()], |sizes| sizes.rows.clone());
        let mut of_variables = match sizes {
            Some(sizes) => sizes.variables.clone(),
            None => vec![1.0; lifted.n_original()],
        };
        of_variables.extend(lifted.slacks().map(|(row, _)| of_rows[row]));
        let outside = |value: f64, lower: f64, upper: f64| {
            let excess = (lower - value).max(value - upper).max(0.0);
            if value.is_finite() {
                excess
            } else {
                f64::INFINITY
            }
        };
        let of = |values: &[f64], bounds: Bounds<'_>, sizes: &[f64]| {
            let bounds = bounds.lower.iter().zip(bounds.upper);
            let each = values.iter().zip(bounds).zip(sizes);
            each.fold(0.0, |m: f64, ((&v, (&l, &u)), size)| {
                m.max(size * outside(v, l, u))
            })
        };
        let of_bounds = of(w, lifted.variable_bounds(), &of_variables);
        let mut residuals = Residuals {
            violation: of_bounds.max(of(&rows, lifted.row_bounds(), &of_rows)),
            ..Residuals::default()
        };
        for (pair, sides) in lifted.pairs().iter().enumerate() {
            let [p, q] = sides.map(|side| of_variables[side as usize]);
            let [a, b] = lifted.distances(pair, w);
            let [a, b] = [p * a, q * b];
            residuals.complementarity = residuals.complementarity.max(a.min(b).abs());
            residuals.product = residuals.product.max((a * b).abs());
        }
        residuals
    }
}

/// The certificate of a feasible point of the vertical form; `y` are multipliers to try first.
pub fn certify(
    lifted: &mut Lifted<'_>,
    w: &[f64],
    y: &[f64],
    tolerances: &Tolerances,
) -> Certificate {
    let local = Local::new(lifted, w);
    let sets = Sets::new(lifted, w, tolerances.biactive);
    if !local.is_finite() || !has_finite_curvature(lifted, w, y) {
        return Certificate {
            class: Class::None,
            is_exact: false,
            b_stationary: None,
            is_differentiable: false,
            reduced: local.reduced_gradient(y),
            y: y.to_vec(),
            biactive: sets.biactive,
            descent: None,
        };
    }
    if !lifted.has_objective() {
        // Of nothing no direction descends, and no multiplier is needed.
        return Certificate {
            class: Class::S,
            is_exact: true,
            b_stationary: Some(true),
            is_differentiable: true,
            reduced: local.gradient,
            y: vec![0.0; y.len()],
            biactive: sets.biactive,
            descent: None,
        };
    }
    let classified = classify(lifted, &local, &sets, y, tolerances);
    let mut certificate = Certificate {
        class: classified.class,
        is_exact: classified.is_exact,
        b_stationary: Some(true),
        is_differentiable: true,
        reduced: local.reduced_gradient(&classified.y),
        y: classified.y,
        biactive: sets.biactive,
        descent: None,
    };
    // S-stationary points are B-stationary; others are asked for a direction of descent.
    if certificate.class != Class::S {
        match descend(lifted, &local, tolerances) {
            Descent::None => {}
            Descent::Undecided => certificate.b_stationary = None,
            Descent::Found(step) => {
                certificate.b_stationary = Some(false);
                certificate.descent = Some(step);
            }
        }
    }
    certificate
}

/// Whether the Hessian of the Lagrangian has finite entries.
fn has_finite_curvature(lifted: &mut Lifted<'_>, w: &[f64], y: &[f64]) -> bool {
    let mut entries = vec![0.0; lifted.hessian_pattern().n_entries()];
    lifted.hessian(w, 1.0, y, &mut entries);
    entries.iter().all(|entry| entry.is_finite())
}
