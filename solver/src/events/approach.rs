//! Surfaces that a run came close to, and what it may have missed behind them.

use crate::expansion::series;
use crate::hybrid::Side;

/// A surface that came close.
#[derive(Clone, Debug)]
pub struct Approach {
    /// Its switch.
    pub switch: usize,
    /// When.
    pub time: f64,
    /// Where.
    pub x: Vec<f64>,
    /// ψ, positive on the side that the run came from.
    pub distance: f64,
    /// What rounding may change in it.
    pub rounding: f64,
    /// (j, ∂ψ/∂x_j).
    pub gradient: Vec<(usize, f64)>,
    /// f on the other side, less f: not a number where there is no solution on the other side.
    pub jump: Vec<f64>,
    /// Whether the run has crossed the surface, where it might have turned back.
    pub crosses: bool,
    /// A relay, which does not return with ψ.
    pub(crate) latches: bool,
    /// A contact, whose jump is that of the velocities by a change of ψ' by one.
    pub(crate) strikes: bool,
    /// Coefficients of ψ from order one on, with the sign of the distance, in the mode of the run and
    /// behind the surface.
    pub(crate) along: [f64; DERIVATIVES],
    pub(crate) behind: [f64; DERIVATIVES],
}

/// How long the other side of a surface is visited.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Visit {
    /// For so long.
    Lasts(f64),
    /// The field there does not lead back soon.
    Stays,
    /// None: a contact is struck, and ψ' changes by no more than this.
    Strikes(f64),
}

/// An approach in a step, before it is known what is behind the surface.
pub(crate) struct Pending {
    pub approach: Approach,
    pub sides: Box<[Side]>,
    pub alpha: Vec<f64>,
    /// It ended the step.
    pub is_event: bool,
}

/// Surfaces that came close in a run.
#[derive(Default)]
pub(crate) struct Approaches {
    /// Switches whose ψ turns back close to zero in a step, and when after its start.
    pub close: Vec<(usize, f64)>,
    /// Those in the last step, and all that came close in the run.
    pub pending: Vec<Pending>,
    pub known: Vec<Approach>,
    /// Scratch memory of guards.
    pub registers: Vec<f64>,
}

/// Derivatives of ψ that are looked at.
pub(crate) const DERIVATIVES: usize = 4;

/// Doublings of the time of a visit after which it does not end.
const DOUBLINGS: usize = 6;

/// Of more approaches the closest are kept.
const MOST: usize = 256;

impl Approach {
    /// How long the other side is visited where the run misses the surface by `depth`, in truth beyond it.
    pub fn visit(&self, depth: f64) -> Visit {
        let terms = (2..=DERIVATIVES).map(|k| (k, self.along[k - 1]));
        let half = series::soonest(depth, terms).map_or(f64::INFINITY, |(_, half)| half);
        if self.strikes {
            // |ψ'| ≤ k d/half for the power k that d is reached with; a rebound may double it.
            return Visit::Strikes(2.0 * DERIVATIVES as f64 * depth / half);
        }
        if self.latches || !half.is_finite() || self.behind[0].is_nan() {
            return Visit::Stays;
        }
        // A field that pushes back acts only for the share of the time that keeps ψ at zero.
        if self.behind[0] * half > depth {
            return Visit::Lasts(4.0 * depth / self.behind[0]);
        }
        let rise = |tau: f64| tau * series::value(&self.behind, tau);
        let times = (0..=DOUBLINGS).map(|k| half * f64::from(1 << k));
        let mut returns = times.filter(|&tau| rise(tau) >= 0.5 * depth);
        returns
            .next()
            .map_or(Visit::Stays, |tau| Visit::Lasts(half + tau))
    }
}

impl Approaches {
    /// Those of a run, of which none is known.
    pub(crate) fn begin(&mut self) {
        self.close.clear();
        self.pending.clear();
        self.known.clear();
    }

    pub(crate) fn keep(&mut self, approach: Approach) {
        if self.known.len() < MOST {
            self.known.push(approach);
            return;
        }
        let distance = |a: &Approach| a.distance.abs();
        let farthest = self.known.iter_mut();
        let farthest = farthest.max_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(farthest) = farthest.filter(|other| distance(other) > distance(&approach)) {
            *farthest = approach;
        }
    }
}
