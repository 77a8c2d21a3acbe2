//! The sizes of the terms of rates: times ε, their rounding errors.
//!
//! Rates may be rounding themselves: terms that cancel within an expression, which no derivative shows.
//! Where |f_i - x_i'| between the nodes is no larger than the running error δ_i of f_i, no shorter element makes it
//! smaller: δ_i/ε is the size of the terms of f_i.

use super::jacobian::Jacobian;
use super::solved::Solved;
use super::stages::Stages;
use crate::expansion::dense::ElementSeries;
use crate::expansion::series;
use crate::fesd::element::scheme::Scheme;
use crate::fesd::system::Reduced;
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

/// Sizes of the terms of rates.
pub(crate) struct Terms {
    /// That of each rate where it was last differentiated.
    pub activity: Vec<f64>,
    /// The same by the states alone that do not rest, while it is measured.
    resting: Vec<f64>,
    /// What states are at least in the terms of rates: the sizes of those that equations determine.
    pub sizes: Vec<f64>,
    registers: Vec<Rounded>,
    /// The states whose rates have been found to be rounding; none at first.
    found: Vec<bool>,
    /// δ_i of all rates at the points looked at, infinite where the difference is larger.
    errors: Vec<f64>,
    /// How far rounding moves states that are nothing else.
    moved: Vec<f64>,
    /// Whether running errors of any element have been looked at.
    pub has_looked: bool,
}

impl Terms {
    /// Memory for states of the length n.
    pub fn new(n: usize) -> Self {
        Terms {
            activity: vec![0.0; n],
            resting: vec![0.0; n],
            sizes: vec![0.0; n],
            registers: Vec::new(),
            found: vec![false; n],
            errors: vec![0.0; n],
            moved: vec![0.0; n],
            has_looked: false,
        }
    }

    /// Measures them by derivatives. A state at rest is what rounding leaves of the terms of its rate over an
    /// element, so that it counts as them in the rates of others: v = 0 by forces that balance, and x' = v.
    pub fn measure(
        &mut self,
        scheme: &Scheme,
        reduced: &Reduced,
        stages: &Stages,
        jacobian: &Jacobian,
    ) {
        self.measure_rounding(scheme, reduced, stages);
        for rests in [false, true] {
            if rests {
                self.resting.copy_from_slice(&self.activity);
            }
            for (e, &(row, input)) in reduced.equations.slopes.entries.iter().enumerate() {
                let state = input.wrapping_sub(1);
                let value = match (input, rests) {
                    _ if row >= stages.n => continue,
                    (_, true) if state >= stages.n => continue,
                    (_, true) => stages.h * self.resting[state],
                    (0, false) => stages.t,
                    (_, false) if state < stages.n => stages.x0[state].abs().max(self.sizes[state]),
                    (_, false) => 1.0,
                };
                self.activity[row] += (jacobian.slope(scheme, e, 0) * value).abs();
            }
        }
    }

    /// Starts them with those of the rates that have been found to be rounding.
    fn measure_rounding(&mut self, scheme: &Scheme, reduced: &Reduced, stages: &Stages) {
        self.activity.fill(0.0);
        if !self.found.contains(&true) {
            return;
        }
        self.errors.fill(0.0);
        let x = (0..stages.n).map(|i| stages.x[i * scheme.groups].as_array()[0]);
        let t = stages.t + scheme.tableau.nodes[0] * stages.h;
        let others = stages.w(0).iter().chain(&stages.numbers);
        // Whatever the rate is.
        let any = std::iter::repeat_n(f64::NAN, stages.n);
        self.see(reduced, t, x, others, any);
        let rates = self.errors.iter().zip(&self.found);
        for (activity, (error, found)) in self.activity.iter_mut().zip(rates) {
            if *found {
                *activity = error / f64::EPSILON;
            }
        }
    }

    /// Takes note of running errors at a point, where the rates are to be `v`; `others` are w and the numbers.
    fn see<'v>(
        &mut self,
        reduced: &Reduced,
        t: f64,
        x: impl Iterator<Item = f64>,
        others: impl Iterator<Item = &'v f64>,
        v: impl Iterator<Item = f64>,
    ) {
        let (tape, registers) = (&reduced.equations.tape, &mut self.registers);
        let exactly = |value: f64| Rounded::from(Ball::new(value, 0.0));
        registers.clear();
        registers.push(exactly(t));
        let states = x.zip(&self.moved);
        registers.extend(states.map(|(x, moved)| Rounded::from(Ball::new(x, *moved))));
        registers.extend(others.map(|value| exactly(*value)));
        let wanted = tape.n_registers().max(registers.len());
        registers.resize(wanted, exactly(0.0));
        tape.run(registers);
        let rates = tape.results(registers).zip(v);
        for (error, (rate, v)) in self.errors.iter_mut().zip(rates) {
            let rate = rate.ball();
            let differs = (rate.middle - v).abs();
            *error = match differs > SHARED * rate.radius {
                true => f64::INFINITY,
                false => error.max(rate.radius),
            };
        }
    }

    /// How far rounding moves the states whose rates are rounding. A state with digits of its own is as well known as
    /// these, however fast it is pulled back.
    fn move_noise(&mut self, stages: &Stages, scale: &[f64]) {
        let states = self.moved.iter_mut().zip(&self.found).enumerate();
        for (i, (moved, found)) in states {
            let noise = f64::EPSILON * self.activity[i];
            let is_noise = scale[i] <= HELD * noise * (stages.t.abs() + stages.h);
            *moved = if *found && is_noise {
                stages.h * noise
            } else {
                0.0
            };
        }
    }

    /// Raises them where the polynomials of an element that has been solved miss rates by running errors that are
    /// larger; whether there are any.
    pub fn raise(
        &mut self,
        scheme: &Scheme,
        reduced: &Reduced,
        stages: &Stages,
        hidden: &mut Hidden,
        (solved, rows): (&Solved, &ElementSeries),
        scale: &[f64],
    ) -> bool {
        let mut is_new = false;
        for _ in 0..PASSES {
            self.move_noise(stages, scale);
            self.errors.fill(0.0);
            for sigma in scheme.points.probes() {
                let (t, tau) = (solved.t + sigma * solved.h, sigma * solved.h);
                let x = || (0..stages.n).map(|i| series::value(rows.row(i), tau));
                let v = (0..stages.n).map(|i| series::slope(rows.row(i), tau));
                hidden.set(t, x(), stages.w(scheme.s / 2));
                if hidden.solve(reduced).is_err() {
                    self.errors.fill(f64::INFINITY);
                    break;
                }
                let others = hidden.w().iter().chain(&stages.numbers);
                self.see(reduced, t, x(), others, v);
            }
            let found = self.found.iter_mut().zip(&self.errors);
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
        is_new
    }
}
