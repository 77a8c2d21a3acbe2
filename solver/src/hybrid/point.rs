//! A point of a run: time, states, and the mode with its α.

use super::{Few, Side};

/// (t, x, α), with the side of every switch.
#[derive(Default)]
pub(crate) struct Point {
    pub t: f64,
    /// What rounding has kept out of `t`.
    pub t_low: f64,
    pub x: Vec<f64>,
    pub sides: Box<[Side]>,
    pub alpha: Vec<f64>,
}

impl Point {
    /// Starts at an instant and a state, with all of n switches on their upper side.
    pub(crate) fn begin(&mut self, t: f64, x: &[f64], n: usize) {
        (self.t, self.t_low) = (t, 0.0);
        self.x.clear();
        self.x.extend_from_slice(x);
        self.alpha.clear();
        self.alpha.resize(n, 1.0);
        if self.sides.len() == n {
            self.sides.fill(Side::Plus);
        } else {
            self.sides = vec![Side::Plus; n].into();
        }
    }

    /// Moves time on. Rounding of a sum of many steps would be a drift of phase: it is kept.
    pub(crate) fn advance(&mut self, length: f64) {
        let start = self.t;
        let step = length + self.t_low;
        self.t = start + step;
        self.t_low = step - (self.t - start);
    }

    /// What is left of time up to `end`.
    pub(crate) fn remaining(&self, end: f64) -> f64 {
        (end - self.t) - self.t_low
    }

    /// The sides, with those of some switches replaced.
    pub(crate) fn sides_with(&self, switches: &[usize], sides: &[Side]) -> Few<Side> {
        let mut all = Few::from_slice(&self.sides);
        for (&i, &side) in switches.iter().zip(sides) {
            all[i] = side;
        }
        all
    }

    /// The sides where some more switches slide.
    pub(crate) fn sides_sliding(&self, switches: &[usize]) -> Few<Side> {
        let mut all = Few::from_slice(&self.sides);
        switches.iter().for_each(|&i| all[i] = Side::Slide);
        all
    }

    /// Puts some switches on other sides.
    pub(crate) fn change_sides(&mut self, switches: &[usize], sides: &[Side]) {
        for (&i, &side) in switches.iter().zip(sides) {
            self.sides[i] = side;
        }
        self.keep_alpha();
    }

    /// Sets the mode, with α where it is constant.
    pub(crate) fn set_sides(&mut self, sides: &[Side]) {
        self.sides.copy_from_slice(sides);
        self.keep_alpha();
    }

    /// Sets α where it is constant.
    fn keep_alpha(&mut self) {
        for (alpha, side) in self.alpha.iter_mut().zip(&self.sides) {
            match side {
                Side::Minus => *alpha = 0.0,
                Side::Plus => *alpha = 1.0,
                Side::Slide => {}
            }
        }
    }
}
