//! What rounding does to the states by moving events.
//!
//! ψ is known to its rounding ε only, and its root τ to the δ for which one term of ψ(τ + δ) is as
//! large as that, |ψ⁽ᵏ⁾(τ)| δᵏ/k! = ε: ε/|ψ'| at a crossing, and much longer where the surface is
//! met at a small angle. For that time one field acts for the other, and every run may be wrong
//! there by the same |f⁺ - f⁻| δ, however accurate its steps are.

use crate::expansion::mode::Mode;
use crate::expansion::scales::{Bands, Scales, refill};
use crate::expansion::series;
use crate::hybrid::Side;

/// How long an event is uncertain, and what that does to the states.
#[derive(Default)]
pub(crate) struct Window {
    /// How long the last event is uncertain; 0 once that is accounted for.
    pub length: f64,
    /// f before that event.
    before: Vec<f64>,
    /// Squares of what uncertain events may have moved the states by.
    pub moved: Vec<f64>,
}

impl Window {
    /// That of a run of n states, without an event so far.
    pub(crate) fn begin(&mut self, n: usize) {
        self.length = 0.0;
        refill(&mut self.before, n, 0.0);
        refill(&mut self.moved, n, 0.0);
    }

    /// Takes note of the fields before an event at `tau`, and of how long it is uncertain.
    pub(crate) fn open(
        &mut self,
        mode: &Mode,
        scales: &Scales,
        bands: &Bands,
        tau: f64,
        triggers: &[usize],
    ) {
        let crossings = triggers.iter().filter(|i| mode.sides[**i] != Side::Slide);
        let windows = crossings.map(|&i| {
            let c = mode.psi_series(i);
            // A few roundings of every term, and of the states as large as they have been.
            let sizes = c.iter().rev().fold(0.0, |sum, c| sum * tau + c.abs());
            let past = mode.surfaces.weigh(i, |j| scales.largest[j]);
            let rounding = ROUNDINGS * f64::EPSILON * bands.terms[i].max(sizes).max(past);
            uncertain(c, tau, rounding)
        });
        let window = windows.fold(0.0, f64::max);
        self.length = if window.is_finite() { window } else { 0.0 };
        if self.length > 0.0 {
            for i in 0..mode.n {
                self.before[i] = series::value(
                    &mode.memory.series(mode.field.rows[i])[..mode.memory.order],
                    tau,
                );
            }
        }
    }

    /// Adds what the fields after the event, expanded by now, have to do with those before.
    pub(crate) fn close(&mut self, mode: &Mode) {
        if self.length > 0.0 {
            for i in 0..mode.n {
                let moved = self.length * (mode.x_series(i)[1] - self.before[i]);
                self.moved[i] += moved * moved;
            }
        }
    }
}

/// The δ for which a derivative of Σ c_j τʲ at `tau` makes as much of a difference as rounding does.
pub(crate) fn uncertain(c: &[f64], tau: f64, rounding: f64) -> f64 {
    let around: [f64; 1 + DERIVATIVES] = series::around(c, tau);
    let terms = around.into_iter().enumerate().skip(1);
    series::soonest(rounding, terms).map_or(f64::INFINITY, |(_, length)| length)
}

/// Derivatives of ψ that are looked at.
const DERIVATIVES: usize = 4;

/// Roundings of a term that a value has seen.
pub(crate) const ROUNDINGS: f64 = 8.0;
