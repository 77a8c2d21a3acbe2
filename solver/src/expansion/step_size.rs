//! The length of a step.
//!
//! |c_k| = magnitude / ρᵏ gives the radius ρ of a series, taken as the least over its last three terms (two in Jorba &
//! Zou 2005, section 3.2); then (h/ρ)^(p+1) = tolerance.

use super::mode::Mode;
use super::scales::{Bands, SMALLEST, Scales};
use super::series;

/// Lengths tried before a step is as long as its series allow, and how close to that it ends.
const MAX_GROWTHS: usize = 200;
const CLOSE: f64 = 1.05;

/// The largest of the last three terms of some series, relative to the scale of each.
struct LastTerms {
    order: usize,
    worst: [f64; 3],
}

impl LastTerms {
    fn see(&mut self, c: &[f64], scale: f64) {
        for (worst, c) in self.worst.iter_mut().zip(&c[self.order - 2..=self.order]) {
            if *c != 0.0 {
                // Even where it overflows, it allows some step.
                *worst = worst.max((c.abs() / scale).min(f64::MAX));
            }
        }
    }

    /// Logarithm of the least radius of convergence that they show.
    fn radius(&self) -> f64 {
        let orders = self.order - 2..=self.order;
        let radii = self.worst.iter().zip(orders);
        let radii = radii.map(|(worst, k)| -worst.ln() / k as f64);
        radii.fold(f64::INFINITY, f64::min)
    }
}

/// The largest step whose first neglected terms stay below `tolerance` times the magnitude of each series.
pub(crate) struct StepSize<'a> {
    pub mode: &'a Mode,
    pub tolerance: f64,
}

impl StepSize<'_> {
    /// That of every state and α, up to `longest`.
    pub(crate) fn of_states(&self, scales: &Scales, longest: f64) -> f64 {
        let (mode, tolerance) = (self.mode, self.tolerance);
        self.grow(mode.memory.known, longest, |h, last| {
            for i in 0..mode.n {
                let c = mode.x_series(i);
                last.see(c, scales.of_error(i, c, h, tolerance));
            }
            for &i in &mode.sliding {
                let rounding = 8.0 * f64::EPSILON * scales.terms_of_rate(mode, i)
                    / mode.equations.gain(i).max(SMALLEST);
                let c = mode.alpha_series(i);
                let scale = series::magnitude(c, h, 0).max(1.0);
                last.see(c, scale.max(rounding / tolerance));
            }
        })
    }

    /// Whether the series of all states, cut behind an order, still allow a step h.
    pub(crate) fn covers(&self, scales: &Scales, order: usize, h: f64) -> bool {
        let mut last = LastTerms {
            order,
            worst: [0.0; 3],
        };
        for i in 0..self.mode.n {
            let c = self.mode.x_series(i);
            last.see(c, scales.of_error(i, c, h, self.tolerance));
        }
        last.radius() + self.tolerance.ln() / (order + 1) as f64 >= h.ln()
    }

    /// That of every ψ that is monitored.
    pub(crate) fn of_psi(&self, bands: &Bands, longest: f64) -> f64 {
        let (mode, tolerance) = (self.mode, self.tolerance);
        self.grow(mode.memory.order, longest, |h, last| {
            for &i in &mode.monitored.switches {
                if !mode.planes.is_affine(i, &mode.surfaces) {
                    let rounding = 8.0 * f64::EPSILON * bands.terms[i];
                    let c = mode.psi_series(i);
                    let scale = series::magnitude(c, h, 0).max(rounding / tolerance);
                    last.see(c, scale.max(SMALLEST));
                }
            }
        })
    }

    /// That of a slip velocity with two entries, in relation to |w|, once both have been expanded.
    pub(crate) fn of_slip(&self, of: [usize; 2], longest: f64) -> f64 {
        let (memory, surfaces) = (&self.mode.memory, &self.mode.surfaces);
        let series = of.map(|i| memory.series(surfaces.row(i)));
        let speed = series[0][0].hypot(series[1][0]).max(SMALLEST);
        self.grow(self.mode.memory.order, longest, |_, last| {
            series.into_iter().for_each(|c| last.see(c, speed));
        })
    }

    /// Lengthens a step from nothing as far as the last terms that `see` shows for it allow: a longer
    /// step has larger magnitudes, which their size is relative to. Every length on the way is allowed. The series are of
    /// this order.
    fn grow(&self, order: usize, longest: f64, see: impl Fn(f64, &mut LastTerms)) -> f64 {
        let margin = self.tolerance.ln() / (order + 1) as f64;
        let mut h = 0.0;
        for _ in 0..MAX_GROWTHS {
            let mut last = LastTerms {
                order,
                worst: [0.0; 3],
            };
            see(h, &mut last);
            let next = longest.min((last.radius() + margin).exp());
            let settled = next <= CLOSE * h;
            h = next;
            if settled || h == longest {
                break;
            }
        }
        h
    }
}
