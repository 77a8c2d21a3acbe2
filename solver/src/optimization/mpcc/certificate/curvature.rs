//! From a point that is stationary and no minimum to second order to a lower one of the same branch.

use crate::optimization::mpcc::branch::polish::{Goal, Guess, Polished, polish};
use crate::optimization::mpcc::lift::Lifted;
use crate::optimization::mpcc::work::{MAX_SWITCHES, Work};

/// How far the start of a descent is from the point, relative to its largest variable or 1, where that is larger.
const STEPS: [f64; 4] = [0.3, 0.03, 3e-3, 3e-4];
/// What an objective is lower by where that is not rounding, relative to the objective or 1.
const GAIN: f64 = 1e-10;

impl Work<'_> {
    /// Follows directions of negative curvature to both sides, as long as that leads down.
    pub fn fall(&mut self, lifted: &mut Lifted<'_>, mut best: Polished) -> Polished {
        while let Some(direction) = &best.falling
            && self.stats.switches < MAX_SWITCHES
            && let Some(lower) = self.lower(lifted, &best, direction)
        {
            self.stats.switches += 1;
            best = lower;
        }
        best
    }

    /// The better one of the solutions to both sides of a point.
    fn lower(
        &mut self,
        lifted: &mut Lifted<'_>,
        best: &Polished,
        direction: &[f64],
    ) -> Option<Polished> {
        let size = best.point.w.iter().fold(1.0_f64, |m, w| m.max(w.abs()));
        let below = excess(best) - GAIN * best.objective.abs().max(1.0);
        for step in STEPS {
            let sides = [-step * size, step * size].map(|step| {
                if self.is_over() {
                    return None;
                }
                let moved = best.point.w.iter().zip(direction);
                let guess = Guess {
                    w: moved.map(|(w, d)| w + step * d).collect(),
                    y: best.point.y.clone(),
                };
                polish(lifted, &guess, &best.zeros, Goal::Below(below), self).ok()
            });
            let lower = sides.into_iter().flatten();
            let lower = lower.filter(|side| side.is_optimal && excess(side) < below);
            if let Some(lower) = lower.min_by(|a, b| excess(a).total_cmp(&excess(b))) {
                return Some(lower);
            }
        }
        None
    }
}

/// The objective, and what the rows would cost that are violated.
fn excess(point: &Polished) -> f64 {
    let weights = point.point.y.iter().map(|y| y.abs()).sum::<f64>();
    point.objective + weights * point.residuals.violation
}
