//! What is found of a program in units of its own, in those of the program itself.

use super::certificate::class::Class;
use super::observer::{Observer, Program};
use super::solution::Solution;
use crate::optimization::ipm;
use crate::optimization::problem::{Mpcc, Side};
use crate::optimization::scaling::{Scaled, Sizes};

/// What was found, in the units of the program.
pub(super) fn solution(mut scaled: Scaled<'_>, sizes: &Sizes, found: Solution) -> Solution {
    let [w, y] = scaled.unscaled(&found.w, &found.multipliers.rows);
    let Sizes {
        variables,
        rows,
        objective,
        ..
    } = sizes;
    let in_units = |z: Vec<f64>| -> Vec<f64> {
        let places = z.into_iter().zip(variables);
        places.map(|(z, size)| z * objective / size).collect()
    };
    let side = |side: Side, value: f64| {
        value * objective
            / match side {
                Side::Variable(variable) => variables[variable as usize],
                Side::Row(row) => rows[row as usize],
            }
    };
    let mut multipliers = found.multipliers;
    multipliers.rows = y.iter().map(|y| y * objective).collect();
    multipliers.lower = in_units(multipliers.lower);
    multipliers.upper = in_units(multipliers.upper);
    for (values, pair) in multipliers.pairs.iter_mut().zip(scaled.pairs()) {
        *values = [side(pair.a, values[0]), side(pair.b, values[1])];
    }
    Solution {
        objective: found.objective * objective,
        w,
        multipliers,
        ..found
    }
}

/// Tells an observer of a run in the units of the program.
pub(super) struct InUnits<'o> {
    pub observer: &'o mut dyn Observer,
    /// s.
    pub objective: f64,
}

impl Observer for InUnits<'_> {
    fn program(&mut self, program: &Program) {
        self.observer.program(program);
    }

    fn stationary(&mut self, objective: f64, class: Class) {
        self.observer.stationary(self.objective * objective, class);
    }

    fn iteration(&mut self, program: &Program, progress: &ipm::Progress<'_>) {
        let progress = ipm::Progress {
            objective: self.objective * progress.objective,
            gap: self.objective * progress.gap,
            ..*progress
        };
        self.observer.iteration(program, &progress);
    }
}
