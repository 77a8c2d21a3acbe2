//! Surfaces that came closer than a run is accurate, so that it cannot be told whether they are crossed.

use nsd_solver::events::{Approach, Visit};
use nsd_solver::hybrid::Outcome;

use crate::report::Warning;
use crate::system::System;

/// What estimates of errors may fall short by.
const SAFETY: f64 = 2.0;

/// What a run cannot tell about the surfaces that it touches.
#[derive(Default)]
pub struct Touches {
    /// What visits to the other sides, which end soon, would change in a state, relative to its
    /// largest magnitude.
    pub error: f64,
    /// The touch that matters most.
    worst: Option<Touch>,
}

/// One surface that was touched.
pub struct Touch {
    pub switch: usize,
    pub time: f64,
    /// Uncertainty of ψ.
    pub known_to: f64,
    /// Largest change of a state, relative to its magnitude.
    pub matters: f64,
    /// By how much more accurate runs could tell; none where rounding hides it.
    pub share_to_tell: Option<f64>,
}

impl Touches {
    /// Judges what came close in a run by what a more accurate run `misses` in each ψ, and by what
    /// rounding may do to a state; changes are relative to the `scale` of states.
    pub fn find(
        outcome: &Outcome,
        misses: &[f64],
        rounding: impl Fn(usize) -> f64,
        scale: &[f64],
    ) -> Touches {
        let mut moved = vec![0.0; scale.len()];
        let mut worst: Option<Touch> = None;
        for (approach, miss) in outcome.approaches.iter().zip(misses) {
            let terms = approach.gradient.iter();
            let floor: f64 = terms.map(|&(j, g)| g.abs() * rounding(j)).sum();
            let floor = SAFETY * (approach.rounding + floor);
            let known_to = floor + SAFETY * miss;
            let Some((lasts, ends)) = visit(approach, known_to, outcome.time) else {
                continue;
            };
            let mut matters = 0.0_f64;
            for (i, jump) in approach.jump.iter().enumerate() {
                let change = if jump.is_nan() {
                    f64::INFINITY
                } else {
                    jump.abs() * lasts
                };
                // A state that has not moved would be as large as its change.
                let scale = scale[i].max(change);
                if scale > 8.0 * rounding(i) {
                    let share = if change.is_finite() {
                        change / scale
                    } else {
                        change
                    };
                    matters = matters.max(share);
                    moved[i] += if ends { share } else { 0.0 };
                }
            }
            let distance = approach.distance.abs();
            if worst.as_ref().is_none_or(|worst| matters > worst.matters) {
                worst = Some(Touch {
                    switch: approach.switch,
                    time: approach.time,
                    known_to,
                    matters,
                    share_to_tell: (distance > 2.0 * floor).then_some(0.1 * distance / known_to),
                });
            }
        }
        Touches {
            error: moved.into_iter().fold(0.0, f64::max),
            worst,
        }
    }

    /// Takes note of a touch; a visit that ends soon is an error of as much.
    pub fn add(&mut self, touch: Touch, ends: bool) {
        self.error += if ends { touch.matters } else { 0.0 };
        if self
            .worst
            .as_ref()
            .is_none_or(|worst| touch.matters > worst.matters)
        {
            self.worst = Some(touch);
        }
    }

    fn worst(&self, tolerance: f64) -> Option<&Touch> {
        let matters = |touch: &&Touch| touch.matters > tolerance.max(1e-13);
        self.worst.as_ref().filter(matters)
    }

    /// The share of the tolerance with which it could be told what matters.
    pub fn share_to_tell(&self, tolerance: f64) -> Option<f64> {
        self.worst(tolerance)?.share_to_tell
    }

    /// What to say where it matters.
    pub fn warning(&self, system: &System, tolerance: f64) -> Option<Warning> {
        let touch = self.worst(tolerance)?;
        let switch = &system.switches[touch.switch];
        Some(Warning {
            code: "W0710".into(),
            message: format!(
                "at t = {}, `{}` touches its surface as far as can be told, to {:.0e}; whether it is crossed matters",
                touch.time, switch.name, touch.known_to
            ),
            span: switch.spans.first().copied(),
        })
    }
}

/// How long the other side may have been visited instead, or how fast a contact struck, where ψ is known to
/// `known_to`, and whether that ends soon; nothing where it is certain what happens.
fn visit(approach: &Approach, known_to: f64, end: f64) -> Option<(f64, bool)> {
    let left = end - approach.time;
    let depth = known_to - approach.distance;
    if approach.crosses {
        // The time of a visit is uncertain as the run is; only that it was none is news.
        if -approach.distance >= known_to {
            return None;
        }
        return match approach.visit(depth) {
            Visit::Lasts(_) => None,
            Visit::Stays => Some((left, false)),
            Visit::Strikes(speed) => Some((speed, false)),
        };
    }
    (depth > 0.0).then(|| match approach.visit(depth) {
        Visit::Lasts(time) => (time.min(left), true),
        Visit::Stays => (left, false),
        Visit::Strikes(speed) => (speed, false),
    })
}
