//! Slip velocities with two entries: w = 0 is no surface, but a point of a plane.
//!
//! While a contact sticks both ψ slide, and u = 2α - 1 stays in the unit disc. While it slips rates have u = w/|w|,
//! which is smooth but at w = 0, where its derivatives have no bound: a step comes closer to that by a factor, and
//! ends there once |w| is rounding. So what turns all the faster the slower it becomes stops without a loss of digits.
//!
//! From rest w starts as `slip_onset` says; where that is not known, in the direction that the forces of contacts give it,
//! with a length that is rounding: w/|w| has a value then.

use super::rows::Rows;
use crate::event::state::State;
use crate::events::roots::{Root, RootFinder};
use crate::expansion::dense::Dense;
use crate::expansion::mode::Mode;
use crate::expansion::monitor::Monitor;
use crate::expansion::scales::{BAND, Bands, Scales};
use crate::expansion::series;
use crate::expansion::step_size::StepSize;
use crate::hybrid::Side;
use crate::hybrid::point::Point;
use crate::integrate::step::Step;
use crate::selector::selection::Onset;

/// Of the way to w = 0, what a step leaves.
const LEFT: f64 = 1.0 / 64.0;

/// Of the last step to w = 0, the part in which w has a direction.
pub(crate) const DIRECTED: f64 = 1.0 - LEFT;

/// A speed of so many bands is none: how it turns on the way to zero does not matter any more.
pub(crate) const STOPS: f64 = 100.0;

/// Speed from rest, as a share of the band below which it is none.
const DEPARTS: f64 = 0.1;

/// |w| is slow below this many tolerances of the motion of its states: their errors may turn w/|w|.
const TURNS: f64 = 100.0;

/// Tolerance of a slow w relative to |w|, and so of the angle of w/|w|.
const DIRECTION_TOLERANCE: f64 = 1e-4;

/// Of the distance in time to the instant of rest, what a step away from it is long.
const AWAY: f64 = 0.5;

/// An entry of a direction that is so small is rounding.
pub(crate) const STRAIGHT: f64 = 4.0 * f64::EPSILON;

/// Distance of |u|² from 1 at which it is there.
pub(crate) const RIM: f64 = 1e-9;

/// A slip velocity with two entries, along the step of a mode in which both α are those of u = 2α - 1.
#[derive(Clone, Copy)]
pub(crate) struct Disc<'d> {
    dense: Dense<'d>,
    switches: [usize; 2],
}

impl<'d> Disc<'d> {
    /// That of the first entry of two.
    pub(crate) fn of(dense: Dense<'d>, switch: usize) -> Option<Self> {
        let other = dense.mode().system.second(switch)?;
        Some(Disc {
            dense,
            switches: [switch, other],
        })
    }

    /// The series of 1 - |u|² of a contact that sticks.
    pub(crate) fn margin(&self, series: &mut Vec<f64>) {
        let all = self.switches.map(|i| self.dense.alpha(i));
        series.clear();
        for m in 0..=self.dense.order() {
            let mut sum = if m == 0 { 1.0 } else { 0.0 };
            for alpha in all {
                let u = |k: usize| 2.0 * alpha[k] - if k == 0 { 1.0 } else { 0.0 };
                sum -= (0..=m).map(|k| u(k) * u(m - k)).sum::<f64>();
            }
            series.push(sum);
        }
    }

    /// Whether what is at the rim of its disc goes back inside, or stays, by its series.
    pub(crate) fn goes_on(&self, h: f64) -> bool {
        let mut terms = Vec::new();
        self.margin(&mut terms);
        terms[0] > RIM || series::leading(&terms, h, RIM).is_none_or(|k| terms[k] > 0.0)
    }

    /// 1 - |u|² at a point, and its derivative by time.
    pub(crate) fn margin_at(&self, tau: f64, alpha: &[f64]) -> (f64, f64) {
        let switches = self.switches.iter();
        switches.fold((1.0, 0.0), |(value, slope), &i| {
            let u = 2.0 * alpha[i] - 1.0;
            let rate = series::slope(self.dense.alpha(i), tau);
            (value - u * u, slope - 4.0 * u * rate)
        })
    }

    /// Whether u of two entries that stick is at the rim after some time.
    pub(crate) fn is_at_rim(&self, tau: f64) -> bool {
        let alphas = self.switches.map(|i| self.dense.alpha(i));
        let u = alphas.map(|alpha| 2.0 * series::value(alpha, tau) - 1.0);
        (1.0 - u[0] * u[0] - u[1] * u[1]).abs() <= RIM
    }

    /// The first instant at which u leaves the disc.
    pub(crate) fn leaves(
        &self,
        roots: &mut RootFinder,
        series: &mut Vec<f64>,
        h: f64,
    ) -> Option<Root> {
        self.margin(series);
        let band = (series[0].abs() <= RIM).then_some(RIM);
        roots.first_from(series[0], series, h, 1.0, band, 0.0)
    }

    /// How far u with these α is inside its disc, or how fast w grows in its direction, relative to a rate.
    pub(crate) fn inside(&self, side: Side, alpha: &[f64], rate: f64) -> f64 {
        let mode = self.dense.mode();
        let [[d, e], [first, second]] = [
            self.switches.map(|i| 2.0 * alpha[i] - 1.0),
            self.switches.map(|i| mode.phi(i)),
        ];
        match side {
            Side::Slide => 1.0 - d.hypot(e),
            _ if rate > 0.0 => (d * first + e * second) / rate,
            _ => 0.0,
        }
    }
}

/// Steps of a mode in which slip velocities with two entries are close to rest.
pub(crate) struct NearRest<'m> {
    pub mode: &'m mut Mode,
    pub tolerance: f64,
}

impl NearRest<'_> {
    /// The |w| below which a slip is slow. A band is BAND times the motion of the states of w, unless rounding is more.
    fn slow_speed(&self, bands: &Bands, switch: usize) -> f64 {
        bands.width[switch] * STOPS.max(TURNS * self.tolerance / BAND)
    }

    /// The end of what slips in two directions and is all but at rest, where it still turns: no step gets there. Where a step
    /// has ended at rest, w has no direction.
    pub(crate) fn comes_to_rest(&mut self, state: &mut State) -> Option<Step> {
        let (mode, mut all) = (&mut *self.mode, 0..state.point.sides.len());
        let slowing = |i: &usize| {
            let slips_with = mode.planes.slips_with(*i, &mode.system, &mode.sides);
            let Some(other) = slips_with else {
                return false;
            };
            mode.move_to(&state.point);
            if mode.psi(*i).hypot(mode.psi(other)) <= state.bands.width[*i] {
                return true;
            }
            if state.bands.armed[*i] {
                return false;
            }
            let bands = &mut state.bands;
            Monitor { mode, bands }.expand(*i);
            let slows = |w: &[f64]| w[0] <= STOPS * state.bands.width[*i] && w[1] < 0.0;
            mode.planes.series(*i).is_some_and(slows)
        };
        all.find(slowing).map(Step::at_once)
    }

    /// A step of h, or a shorter one away from rest. The series of w/|w| converges for |w|/|w'|, and beyond that what is
    /// small next to the states may turn w.
    pub(crate) fn leaves_rest(&self, bands: &Bands, h: f64) -> f64 {
        self.mode.monitored.switches.iter().fold(h, |h, &i| {
            let slow = self.slow_speed(bands, i);
            match self.mode.planes.series(i) {
                Some([speed, rate, ..]) if *rate > 0.0 && *speed <= slow => {
                    h.min(AWAY * speed / rate)
                }
                _ => h,
            }
        })
    }

    /// The step h, or a shorter one with a truncation error of each slow w below DIRECTION_TOLERANCE |w|: the error in
    /// the angle of w/|w| is the error of w divided by |w|, which no tolerance relative to the states bounds.
    pub(crate) fn limit_direction_error(&mut self, bands: &mut Bands, h: f64) -> f64 {
        let mut limited = h;
        for first in 0..bands.width.len() {
            let mode = &mut *self.mode;
            let slips_with = mode.planes.slips_with(first, &mode.system, &mode.sides);
            let Some(second) = slips_with else {
                continue;
            };
            let speed = mode.psi(first).hypot(mode.psi(second));
            if speed <= self.slow_speed(bands, first) {
                let mode = &mut *self.mode;
                Monitor { mode, bands }.expand(first);
                let tolerance = DIRECTION_TOLERANCE;
                limited = StepSize { mode, tolerance }.of_slip([first, second], limited);
            }
        }
        limited
    }

    /// Where a step towards w = 0 ends before it gets there; nothing where it does, or goes nowhere else.
    pub(crate) fn stops_short(
        &self,
        point: &Point,
        bands: &Bands,
        switch: usize,
        tau: f64,
    ) -> Option<f64> {
        let speed = self.mode.planes.series(switch)?[0];
        let length = tau * (1.0 - LEFT);
        let far = speed > STOPS * bands.width[switch] && point.t + (length + point.t_low) > point.t;
        far.then_some(length)
    }
}

impl Onset {
    /// Gives a slip velocity that is none a length that is rounding, in the mode in which it sticks: by friction, which
    /// acts on velocities, and not on places where these occur in w.
    pub(crate) fn nudge(
        &self,
        mode: &mut Mode,
        point: &Point,
        scales: &Scales,
        x: &mut [f64],
        t1: f64,
    ) {
        let &Onset {
            switches,
            direction,
        } = self;
        let mut alpha = point.alpha.clone();
        switches.iter().for_each(|&i| alpha[i] = 0.5);
        mode.eval(point.t, x, &alpha);
        Rows::linearize(mode, &switches);
        let sizes = switches.map(|i| mode.surfaces.weigh(i, |j| scales.size(j)));
        // Where nothing has moved yet, what the forces would make of it.
        let last = if scales.longest_step > 0.0 {
            scales.longest_step
        } else {
            t1 - point.t
        };
        let rates = switches.map(|i| mode.phi(i) * last);
        let speed = DEPARTS * BAND * sizes.into_iter().fold(rates[0].hypot(rates[1]), f64::max);
        let w = switches.map(|i| mode.psi(i));
        if w[0].hypot(w[1]) >= speed {
            return;
        }
        let missing = [0, 1].map(|k| speed * direction[k] - w[k]);
        let [first, second] = switches;
        let [[a, b], [c, d]] =
            [first, second].map(|of| [first, second].map(|by| mode.coupling(of, by)));
        let determinant = a * d - b * c;
        let shares = [
            (d * missing[0] - b * missing[1]) / determinant,
            (a * missing[1] - c * missing[0]) / determinant,
        ];
        if !shares.iter().all(|share| share.is_finite()) {
            return;
        }
        Rows::of(mode).take(x, |switch| {
            let at = switches.iter().position(|&i| i == switch);
            at.map(|at| -shares[at])
        });
    }
}
