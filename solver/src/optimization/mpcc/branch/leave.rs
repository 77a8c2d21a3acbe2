//! From a point with a direction of descent to a better one.
//!
//! The direction says which members are zero behind it, and the solution of that branch is what is wanted. An
//! interior-point method does not go downhill from where it starts, though, and may end at a worse solution, or where the
//! branch is infeasible. Where no other way leads to a solution, the branch is solved in boxes around the end of the step
//! then, the largest first, as in the steps of a trust-region method (Leyffer and Munson 2007): small ones hold nothing but
//! what the direction promises.

use super::choose;
use crate::optimization::mpcc::branch::polish::{Goal, Guess, Polished, polish};
use crate::optimization::mpcc::lift::Lifted;
use crate::optimization::mpcc::work::Work;

/// Half of the width of the boxes, relative to max(1, |w_i|).
pub const BOXES: [f64; 3] = [1e-1, 1e-2, 1e-3];
/// What an objective is lower by where that is not rounding, relative to max(1, |f|).
const GAIN: f64 = 1e-10;

/// What is lower than an objective by more is not rounding.
pub fn gain(objective: f64) -> f64 {
    GAIN * objective.abs().max(1.0)
}

impl Work<'_> {
    /// A better point, from a step along a direction of descent, in its branch or in boxes of these widths.
    pub fn leave(
        &mut self,
        lifted: &mut Lifted<'_>,
        best: &Polished,
        step: &[f64],
        boxes: &[f64],
    ) -> Option<Polished> {
        let moved = best.point.w.iter().zip(step).map(|(w, d)| w + d);
        let guess = Guess {
            y: best.point.y.clone(),
            w: moved.collect(),
        };
        let zeros = choose(lifted, &guess.w);
        let below = best.objective - gain(best.objective);
        let boxes = boxes.iter().map(|&reach| Goal::Within(below, reach));
        let mut goals = [Goal::Solution].into_iter().chain(boxes);
        goals.find_map(|goal| {
            if self.is_over() {
                return None;
            }
            let next = polish(lifted, &guess, &zeros, goal, self).ok()?;
            (next.objective < below).then_some(next)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::BOXES;
    use crate::optimization::mpcc::Options;
    use crate::optimization::mpcc::branch::polish::{Goal, Guess, Polished, polish};
    use crate::optimization::mpcc::certificate::Residuals;
    use crate::optimization::mpcc::lift::Lifted;
    use crate::optimization::mpcc::work::Work;
    use crate::optimization::problem::{Member, Side};
    use crate::optimization::quadratic::{Function, Quadratic};

    /// (x - 3)² + (y + 1)² with 0 <= x ⟂ y >= 0.
    fn problem() -> Quadratic {
        let objective = Function::default()
            .product(0, 0, 1.0)
            .linear(0, -6.0)
            .product(1, 1, 1.0)
            .linear(1, 2.0)
            .constant(10.0);
        Quadratic::new(2, objective, Vec::new())
            .bound(0, 0.0, f64::INFINITY)
            .bound(1, 0.0, f64::INFINITY)
            .complement(Side::Variable(0), Side::Variable(1))
    }

    #[test]
    fn a_box_holds_its_part_of_a_branch() {
        let mut problem = problem();
        let mut lifted = Lifted::new(&mut problem);
        let (options, mut silent) = (Options::default(), ());
        let mut work = Work::new(&options, &mut silent);
        let guess = Guess {
            w: vec![2.0, 0.0],
            y: Vec::new(),
        };
        for (reach, x) in [(0.1, 2.2), (1e-3, 2.002), (1.0, 3.0)] {
            let goal = Goal::Within(2.0, reach);
            let found = polish(&mut lifted, &guess, &[Member::B], goal, &mut work);
            let found = found.expect("it is feasible");
            assert!((found.point.w[0] - x).abs() < 1e-8, "{:?}", found.point.w);
            assert_eq!(found.point.w[1], 0.0);
        }
        // One around a point outside the bounds begins where that is nearest to them.
        let guess = Guess {
            w: vec![-0.5, 0.0],
            y: Vec::new(),
        };
        let goal = Goal::Within(10.0, 1e-2);
        let found = polish(&mut lifted, &guess, &[Member::B], goal, &mut work);
        let found = found.expect("it is feasible");
        assert!((found.point.w[0] - 1e-2).abs() < 1e-8, "{found:?}");
    }

    /// At zero, where x > 0 descends.
    #[test]
    fn a_point_is_left_along_descent() {
        let mut problem = problem();
        let mut lifted = Lifted::new(&mut problem);
        let (options, mut silent) = (Options::default(), ());
        let mut work = Work::new(&options, &mut silent);
        let known = Polished {
            point: Guess {
                w: vec![0.0, 0.0],
                y: Vec::new(),
            },
            objective: 10.0,
            zeros: vec![Member::A],
            residuals: Residuals::default(),
            is_optimal: true,
            falling: None,
        };
        let better = work.leave(&mut lifted, &known, &[1e-4, 0.0], &[]);
        let better = better.expect("there is a better point");
        assert!(
            (better.objective - 1.0).abs() < 1e-9,
            "{}",
            better.objective
        );
        // Where the direction does not descend, there is none.
        let best = Polished {
            objective: 1.0,
            point: Guess {
                w: vec![3.0, 0.0],
                y: Vec::new(),
            },
            ..known
        };
        assert!(
            work.leave(&mut lifted, &best, &[1e-4, 0.0], &BOXES)
                .is_none()
        );
    }
}
