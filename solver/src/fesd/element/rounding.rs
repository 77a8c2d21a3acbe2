//! Rates that are rounding: terms that cancel within an expression, which no derivative shows.
//!
//! Where |f_i - x_i'| between the nodes is no larger than the running error δ_i of f_i, no shorter element makes it
//! smaller: δ_i/ε is the size of the terms of f_i.

use super::solved::Solved;
use crate::expansion::dense::ElementSeries;
use crate::expansion::series;
use crate::fesd::element::Element;
use crate::fesd::element::scheme::Scheme;
use crate::fesd::system::hidden::Hidden;
use crate::tape::{Ball, Rounded};

/// Chains of states that pass on each other's rounding, at most this long.
const PASSES: usize = 4;

/// The function and its linearization have their roundings, and so has the sum of V.
const SHARED: f64 = 4.0;

/// Terms are larger than was known of them by more than this: the sizes that derivatives show fall short by less.
const LARGER: f64 = 8.0;

/// Roundings of the terms of its rate, up to which a state is nothing but rounding.
const HELD: f64 = 8.0;

/// Running errors of rates.
pub(crate) struct Rounding {
    registers: Vec<Rounded>,
    /// The states whose rates have been found to be rounding; none at first.
    found: Vec<bool>,
    /// δ_i of all rates at the points looked at, infinite where the difference is larger.
    errors: Vec<f64>,
    /// How far rounding moves states that are nothing else.
    moved: Vec<f64>,
    /// Whether any element has been looked at.
    pub(crate) has_looked: bool,
}

impl Rounding {
    pub fn new(n: usize) -> Self {
        Rounding {
            registers: Vec::new(),
            found: vec![false; n],
            errors: vec![0.0; n],
            moved: vec![0.0; n],
            has_looked: false,
        }
    }
}

impl Element {
    /// Raises the sizes of terms where running errors that `see` takes note of are larger.
    fn raise(&mut self, scale: &[f64], mut see: impl FnMut(&Self, &mut Rounding)) -> bool {
        let mut rounding = std::mem::replace(&mut self.rounding, Rounding::new(0));
        let mut is_new = false;
        for _ in 0..PASSES {
            self.move_noise(scale, &mut rounding);
            rounding.errors.fill(0.0);
            see(self, &mut rounding);
            let found = rounding.found.iter_mut().zip(&rounding.errors);
            let mut goes_on = false;
            for ((found, error), activity) in found.zip(&mut self.activity) {
                let terms = *error / f64::EPSILON;
                if terms.is_finite() && terms > LARGER * *activity {
                    goes_on |= !*found;
                    (*activity, *found, is_new) = (terms, true, true);
                }
            }
            if !goes_on {
                break;
            }
        }
        self.rounding = rounding;
        is_new
    }

    /// How far rounding moves the states whose rates are rounding. A state with digits of its own is as well known as
    /// these, however fast it is pulled back.
    fn move_noise(&self, scale: &[f64], rounding: &mut Rounding) {
        let states = rounding.moved.iter_mut().zip(&rounding.found).enumerate();
        for (i, (moved, found)) in states {
            let noise = f64::EPSILON * self.activity[i];
            let is_noise = scale[i] <= HELD * noise * (self.t.abs() + self.h);
            *moved = if *found && is_noise {
                self.h * noise
            } else {
                0.0
            };
        }
    }

    /// Starts the sizes of the terms of rates with those of the rates that have been found to be rounding.
    pub(crate) fn measure_rounding(&mut self, scheme: &Scheme) {
        self.activity.fill(0.0);
        if !self.rounding.found.contains(&true) {
            return;
        }
        let mut rounding = std::mem::replace(&mut self.rounding, Rounding::new(0));
        rounding.errors.fill(0.0);
        let x = |i: usize| self.x[i * scheme.groups].as_array()[0];
        let t = self.t + scheme.tableau.nodes[0] * self.h;
        // Whatever the rate is.
        let any = std::iter::repeat_n(f64::NAN, self.n);
        self.see(t, (0..self.n).map(x), self.w(0), any, &mut rounding);
        let rates = rounding.errors.iter().zip(&rounding.found);
        for (activity, (error, _)) in
            (self.activity.iter_mut().zip(rates)).filter(|(_, (_, found))| **found)
        {
            *activity = error / f64::EPSILON;
        }
        self.rounding = rounding;
    }

    /// Takes note of running errors at a point, where the rates are to be `v`.
    fn see(
        &self,
        t: f64,
        x: impl Iterator<Item = f64>,
        w: &[f64],
        v: impl Iterator<Item = f64>,
        rounding: &mut Rounding,
    ) {
        let tape = &self.reduced.equations;
        let registers = &mut rounding.registers;
        let exactly = |value: f64| Rounded::from(Ball::new(value, 0.0));
        registers.clear();
        registers.push(exactly(t));
        let states = x.zip(&rounding.moved);
        registers.extend(states.map(|(x, moved)| Rounded::from(Ball::new(x, *moved))));
        registers.extend(w.iter().chain(&self.numbers).map(|value| exactly(*value)));
        let wanted = tape.n_registers().max(registers.len());
        registers.resize(wanted, exactly(0.0));
        tape.run(registers);
        let rates = tape.results(registers).take(self.n).zip(v);
        for (error, (rate, v)) in rounding.errors.iter_mut().zip(rates) {
            let rate = rate.ball();
            let differs = (rate.middle - v).abs();
            *error = match differs > SHARED * rate.radius {
                true => f64::INFINITY,
                false => error.max(rate.radius),
            };
        }
    }

    /// Whether the polynomials of an element that has been solved miss some rates by their rounding, and the terms of
    /// these are larger than was known of them.
    pub fn misses_by_rounding(
        &mut self,
        scheme: &Scheme,
        hidden: &mut Hidden,
        solved: &Solved,
        rows: &ElementSeries,
        scale: &[f64],
    ) -> bool {
        self.raise(scale, |element, rounding| {
            for sigma in scheme.probes() {
                let (t, tau) = (solved.t + sigma * solved.h, sigma * solved.h);
                let x = || (0..element.n).map(|i| series::value(rows.row(i), tau));
                let v = (0..element.n).map(|i| series::slope(rows.row(i), tau));
                hidden.set(t, x(), element.w(scheme.s / 2));
                if hidden.solve(&element.reduced).is_err() {
                    rounding.errors.fill(f64::INFINITY);
                    return;
                }
                element.see(t, x(), hidden.w(), v, rounding);
            }
        })
    }
}
