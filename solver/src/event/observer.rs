//! What is seen of a run while it happens: steps with their dense output, and events.

use std::ops::ControlFlow;

use crate::expansion::{Polynomials, series};
use crate::hybrid::Side;
use crate::selector::Decision;

/// A change of mode, or a jump of the state.
#[derive(Clone, Debug)]
pub struct Event<'a> {
    /// When.
    pub time: f64,
    /// Where; after a jump.
    pub x: &'a [f64],
    /// Where before; the same without a jump.
    pub before: &'a [f64],
    /// The laws that have jumped, in order.
    pub jumps: &'a [usize],
    /// What decided about nonlinear switches.
    pub decisions: &'a [Decision],
    /// Mode before.
    pub from: &'a [Side],
    /// Mode after.
    pub to: &'a [Side],
    /// Infinitely many events accumulate here: the time is the limit of a series.
    pub accumulates: bool,
    /// What has brought it about.
    pub cause: Cause<'a>,
}

/// What brings about an event, and so decides when it takes place.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cause<'a> {
    /// The switches whose surface was reached, or whose sliding ended.
    pub met: &'a [usize],
    /// Of the laws that have jumped, by their places, switches on whose surface they have found the state.
    pub on: &'a [(usize, usize)],
    /// Whether the instant is that of a breakpoint of data, a kick, or the start, whatever the state is.
    pub is_scheduled: bool,
    /// Whether events accumulate soon, and the run goes on to their limit in the mode behind it.
    pub is_in_limit: bool,
}

/// One accepted step with its dense output.
pub struct Segment<'a> {
    /// Start.
    pub start: f64,
    /// Length.
    pub length: f64,
    /// End: start + length but for rounding, and the time of an event that takes place there.
    pub until: f64,
    /// The mode.
    pub sides: &'a [Side],
    /// State at the end, with the drift off sliding surfaces projected away.
    pub end: &'a [f64],
    pub(crate) dense: &'a dyn Polynomials,
}

impl<'a> Segment<'a> {
    /// A step of a run that is made of another one.
    pub fn new(
        start: f64,
        length: f64,
        until: f64,
        sides: &'a [Side],
        end: &'a [f64],
        dense: &'a dyn Polynomials,
    ) -> Self {
        Segment {
            start,
            length,
            until,
            sides,
            end,
            dense,
        }
    }

    /// Its polynomials.
    pub fn polynomials(&self) -> &'a dyn Polynomials {
        self.dense
    }

    /// The state `tau` after the start.
    pub fn state(&self, tau: f64, x: &mut [f64]) {
        for (i, x) in x.iter_mut().enumerate() {
            *x = series::value(self.dense.x(i), tau);
        }
    }

    /// Degree of the series.
    pub fn order(&self) -> usize {
        self.dense.degree()
    }

    /// Coefficients of the series of a state around the start, constant term first.
    pub fn state_series(&self, state: usize) -> &[f64] {
        self.dense.x(state)
    }

    /// Coefficients of the series of α of a sliding switch; none where α is constant.
    pub fn alpha_series(&self, switch: usize) -> Option<&[f64]> {
        (self.sides[switch] == Side::Slide).then(|| self.dense.alpha(switch))
    }

    /// Appends the series of all states and α around the start, of `order() + 1` coefficients each; not a number where α
    /// is not known.
    pub fn write(&self, coefficients: &mut Vec<f64>) {
        let n_coefficients = self.order() + 1;
        coefficients.reserve((self.end.len() + self.sides.len()) * n_coefficients);
        for i in 0..self.end.len() {
            coefficients.extend_from_slice(self.state_series(i));
        }
        for (i, side) in self.sides.iter().enumerate() {
            match self.alpha_series(i) {
                None if self.unobserved().contains(&i) => {
                    coefficients.resize(coefficients.len() + n_coefficients, f64::NAN);
                }
                Some(series) => coefficients.extend_from_slice(series),
                None => {
                    coefficients.push(0.5 + 0.5 * side.sign());
                    coefficients.resize(coefficients.len() + n_coefficients - 1, 0.0);
                }
            }
        }
    }

    /// Switches that nothing but outputs looks at, whose α is not known: their ψ has no series here, only values.
    pub fn unobserved(&self) -> &[usize] {
        self.dense.unobserved()
    }

    /// α of every switch `tau` after the start; not a number where it is not known.
    pub fn alpha(&self, tau: f64, alpha: &mut [f64]) {
        for (i, alpha) in alpha.iter_mut().enumerate() {
            *alpha = match self.sides[i] {
                Side::Minus => 0.0,
                Side::Slide => series::value(self.dense.alpha(i), tau),
                Side::Plus => 1.0,
            };
        }
        for &i in self.unobserved() {
            alpha[i] = f64::NAN;
        }
    }
}

/// Sees a run while it happens.
pub trait Observer {
    /// A step was accepted. Breaking ends the run.
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()>;
    /// The mode changed.
    fn event(&mut self, event: &Event);
    /// May move the state that a run starts from, or goes on from behind an event, by a few of the `roundings` of each
    /// state: a second run so shows what the system makes of them. What does not move has none.
    fn displace(&mut self, _x: &mut [f64], _roundings: &[f64]) {}
    /// Whether [`Observer::displace`] does so.
    fn displaces(&self) -> bool {
        false
    }
}

impl<O: Observer + ?Sized> Observer for &mut O {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        (**self).segment(segment)
    }

    fn event(&mut self, event: &Event) {
        (**self).event(event);
    }

    fn displace(&mut self, x: &mut [f64], roundings: &[f64]) {
        (**self).displace(x, roundings);
    }

    fn displaces(&self) -> bool {
        (**self).displaces()
    }
}

/// Sees nothing.
impl Observer for () {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {}
}
