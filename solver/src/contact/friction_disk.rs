//! Slip velocities with two entries: w = 0 is no surface, but a point of a plane.
//!
//! While a contact sticks both ψ slide, and u = 2α - 1 stays in the unit disc. While it slips rates have u = w/|w|,
//! which is smooth but at w = 0, where its derivatives have no bound: a step comes closer to that by a factor, and
//! ends there once |w| is rounding. So what turns all the faster the slower it becomes stops without a loss of digits.
//! Neither ψ = 0 alone is an event. What is watched is w·d with the direction d = w/|w| at the start of a step.
//!
//! From rest w starts as `depart` says; where that is not known, in the direction that the forces of contacts give it,
//! with a length that is rounding: w/|w| has a value then.

use super::rows::Rows;
use crate::event::state::State;
use crate::events::roots::{Root, RootFinder};
use crate::expansion::dense::Dense;
use crate::expansion::mode::Mode;
use crate::expansion::scales::{Bands, Scales};
use crate::expansion::series;
use crate::hybrid::point::Point;
use crate::hybrid::{HybridSystem, Side};
use crate::integrate::step::Step;
use crate::selector::select::BAND;
use crate::selector::selection::Departure;

/// Of the way to w = 0, what a step leaves.
const LEFT: f64 = 1.0 / 64.0;

/// Of the last step to w = 0, the part in which w has a direction.
pub(crate) const DIRECTED: f64 = 1.0 - LEFT;

/// A speed of so many bands is none: how it turns on the way to zero does not matter any more.
pub(crate) const STOPS: f64 = 100.0;

/// Speed from rest, as a share of the band below which it is none.
const DEPARTS: f64 = 0.1;

/// Errors of so many tolerances in a speed turn its direction.
const TURNS: f64 = 100.0;

/// Of a speed that errors may turn, what a step does not know.
const KNOWN: f64 = 1e-4;

/// Of the distance in time to the instant of rest, what a step away from it is long.
const AWAY: f64 = 0.5;

/// An entry of a direction that is so small is rounding.
pub(crate) const STRAIGHT: f64 = 4.0 * f64::EPSILON;

/// Distance of |u|² from 1 at which it is there.
pub(crate) const RIM: f64 = 1e-9;

/// What is watched of a slip velocity with two entries, by the first of them.
#[derive(Clone, Default)]
struct Disc {
    /// The other switch.
    other: usize,
    /// d.
    direction: [f64; 2],
    /// The series of w·d.
    series: Vec<f64>,
    /// The states whose rates have u in them.
    states: Vec<usize>,
    /// Whether it slipped when sizes of terms were measured last.
    slipped: bool,
}

/// The discs of a system, by switch.
pub(crate) struct Discs {
    of: Vec<Option<Disc>>,
    /// Switches of second entries.
    is_second: Vec<bool>,
}

impl Discs {
    pub(crate) fn new(system: &HybridSystem) -> Self {
        let disc = |i: usize| {
            let other = system.across(i).filter(|other| *other > i)?;
            let rubs = |switch: &usize| [i, other].contains(switch);
            let blocks = system.blocks.iter();
            let blocks = blocks.filter(|block| block.switches.iter().any(rubs));
            Some(Disc {
                other,
                states: blocks.flat_map(|block| block.states.clone()).collect(),
                ..Disc::default()
            })
        };
        let of: Vec<Option<Disc>> = (0..system.n_switches()).map(disc).collect();
        let mut is_second = vec![false; of.len()];
        of.iter()
            .flatten()
            .for_each(|disc| is_second[disc.other] = true);
        Discs { of, is_second }
    }
}

impl Mode {
    /// The switch of the other entry, of the first one of two.
    pub(crate) fn other(&self, switch: usize) -> Option<usize> {
        self.discs.of[switch].as_ref().map(|disc| disc.other)
    }

    /// Whether a switch is that of an entry of two.
    pub(crate) fn is_in_disc(&self, switch: usize) -> bool {
        self.discs.of[switch].is_some() || self.is_second(switch)
    }

    /// Whether a switch is that of the second entry, which the first one stands for.
    pub(crate) fn is_second(&self, switch: usize) -> bool {
        self.discs.is_second[switch]
    }

    /// Whether |ψ| where the point is is below its band, of two entries both.
    pub(crate) fn is_near(&mut self, switch: usize, bands: &Bands) -> bool {
        let is_near = |mode: &mut Mode, i: usize| mode.psi(i).abs() <= bands.width[i];
        let other = self.other(switch);
        is_near(self, switch) && other.is_none_or(|other| is_near(self, other))
    }

    /// Whether ψ, or one of two, cannot vanish within a step.
    pub(crate) fn keeps_off(&mut self, switch: usize, h: f64) -> bool {
        let all = [Some(switch), self.other(switch)];
        all.into_iter().flatten().any(|i| {
            let (values, reach) = (&self.memory.values, &self.monitored.reach);
            self.surfaces.stays_away(i, values, reach, h)
        })
    }

    /// ψ where the point is, or w·d.
    pub(crate) fn monitored_psi(&mut self, switch: usize) -> f64 {
        match self.discs.of[switch]
            .as_ref()
            .map(|disc| (disc.other, disc.direction))
        {
            Some((other, [d, e])) => d * self.psi(switch) + e * self.psi(other),
            None => self.psi(switch),
        }
    }

    /// Watches w along the direction that it has where the point is.
    pub(crate) fn aim(&mut self, switch: usize) {
        let Some(mut disc) = self.discs.of[switch].take() else {
            return;
        };
        disc.direction = direction([switch, disc.other].map(|i| self.psi(i)));
        self.discs.of[switch] = Some(disc);
    }

    /// Whether what is watched is affine in time and states.
    pub(crate) fn is_monitored_affine(&self, switch: usize) -> bool {
        let all = [Some(switch), self.other(switch)];
        all.into_iter()
            .flatten()
            .all(|i| self.surfaces.is_affine(i))
    }

    /// Joins the series of both entries to that of w·d.
    pub(crate) fn expand_along(&mut self, switch: usize) {
        let Some(mut disc) = self.discs.of[switch].take() else {
            return;
        };
        let [first, second] = [switch, disc.other].map(|i| {
            let start = self.surfaces.row(i);
            &self.memory.rows[start..=start + self.order]
        });
        disc.direction = direction([first[0], second[0]]);
        let [d, e] = disc.direction;
        let terms = first.iter().zip(second);
        disc.series.clear();
        disc.series.extend(terms.map(|(a, b)| d * a + e * b));
        self.discs.of[switch] = Some(disc);
    }

    /// The series of w·d, of the first entry of two.
    pub(crate) fn series_along(&self, switch: usize) -> Option<&[f64]> {
        self.discs.of[switch].as_ref().map(|disc| &disc.series[..])
    }

    /// Whether some contact slips with two entries.
    pub(crate) fn slips_in_a_plane(&self) -> bool {
        (0..self.discs.of.len()).any(|i| self.slips_by(i))
    }

    /// Whether a contact slips with two entries, of which this is the first one.
    fn slips_by(&self, switch: usize) -> bool {
        let is_off = self.sides[switch] != Side::Slide && !self.is_idle(switch, &self.sides);
        self.discs.of[switch].is_some() && is_off
    }

    /// What rounding does to w is so many times as large in w/|w| where the point is, of all that slips in a plane: close
    /// to w = 0 forces are not known better.
    pub(crate) fn roundings_of_direction(&mut self, bands: &Bands) -> f64 {
        let mut most = 0.0_f64;
        for i in 0..self.discs.of.len() {
            if let Some(other) = self.other(i).filter(|_| self.slips_by(i)) {
                let terms = bands.terms[i].max(bands.terms[other]);
                most = most.max(terms / self.psi(i).hypot(self.psi(other)));
            }
        }
        most
    }

    /// The same, once the terms of all such w have been measured.
    pub(crate) fn measure_directions(&mut self, bands: &mut Bands) -> f64 {
        for i in 0..self.discs.of.len() {
            if let Some(other) = self.other(i).filter(|_| self.slips_by(i)) {
                self.measure_terms_of_psi(i, bands);
                self.measure_terms_of_psi(other, bands);
            }
        }
        self.roundings_of_direction(bands)
    }

    /// Whether the system has slip velocities with two entries.
    pub(crate) fn has_discs(&self) -> bool {
        self.discs.of.iter().any(Option::is_some)
    }

    /// Forgets how large the terms of what slips in a plane were: next to rest, what rounding does to a direction is large
    /// for as long as it is next to rest.
    pub(crate) fn forget_directions(&mut self, scales: &mut Scales) {
        for i in 0..self.discs.of.len() {
            let slips = self.slips_by(i);
            if let Some(disc) = &mut self.discs.of[i]
                && (std::mem::replace(&mut disc.slipped, slips) || slips)
            {
                disc.states.iter().for_each(|&j| scales.activity[j] = 0.0);
            }
        }
    }

    /// Changes what each w is made of by a share of itself, in the way that turns w/|w| most.
    pub(crate) fn perturb_directions(&mut self) {
        let by = self.terms.share;
        for i in 0..self.discs.of.len() {
            let Some(other) = self.other(i).filter(|_| self.slips_by(i)) else {
                continue;
            };
            let [d, e] = direction([i, other].map(|k| self.psi(k)));
            for (k, across) in [(i, -e), (other, d)] {
                self.surfaces.linearize(k, &self.memory.values);
                let time = std::iter::once((0, self.surfaces.time_gradient(k)));
                let states = self.surfaces.gradient(k).iter();
                for (at, g) in time.chain(states.map(|&(j, g)| (1 + j, g))) {
                    let input = self.memory.values[at];
                    self.terms.perturbed[at] = input + by * input.abs() * (across * g).signum();
                }
            }
        }
    }

    /// Cuts all series before their first term that is no number: close to w = 0 terms grow with their order until they
    /// overflow. What is cut off too early shows in the defect of a step.
    pub(crate) fn cut_overflow(&mut self) {
        let starts = (0..self.n)
            .flat_map(|i| [self.memory.state(i), self.field.rows[i]])
            .chain(self.sliding.iter().map(|&i| self.memory.alpha(i)));
        let starts: Vec<usize> = starts.collect();
        let rows = &mut self.memory.rows;
        let is_finite = |k: &usize| starts.iter().all(|start| rows[start + k].is_finite());
        // Values that are no numbers end the run.
        let Some(end) = (0..=self.order).find(|k| !is_finite(k)).filter(|k| *k > 0) else {
            return;
        };
        for start in starts {
            rows[start + end..=start + self.order].fill(0.0);
        }
    }

    /// How far two entries with these α are inside their disc, or how fast they slip in their direction, relative to a
    /// rate.
    pub(crate) fn margin_in_disc(
        &self,
        switch: usize,
        side: Side,
        alpha: &[f64],
        rate: f64,
    ) -> f64 {
        let other = self.other(switch).unwrap_or(switch);
        let [d, e] = [switch, other].map(|i| 2.0 * alpha[i] - 1.0);
        match side {
            Side::Slide => 1.0 - d.hypot(e),
            _ if rate > 0.0 => (d * self.phi(switch) + e * self.phi(other)) / rate,
            _ => 0.0,
        }
    }

    /// The end of what slips in two directions and is all but at rest, where it still turns: no step gets there.
    pub(crate) fn comes_to_rest(&mut self, state: &mut State) -> Option<Step> {
        let slowing = |mode: &mut Mode, state: &mut State, i: usize| {
            if state.bands.armed[i] || !mode.slips_by(i) {
                return false;
            }
            mode.expand_psi(i, &mut state.bands);
            let slows = |w: &[f64]| w[0] <= STOPS * state.bands.width[i] && w[1] < 0.0;
            mode.series_along(i).is_some_and(slows)
        };
        let switch = (0..self.sides.len()).find(|&i| slowing(self, state, i))?;
        Some(Step::at_once(switch))
    }

    /// A step of h, or a shorter one away from rest. The series of w/|w| converges for |w|/|w'|, and beyond that what is
    /// small next to the states may turn w.
    pub(crate) fn leaves_rest(&self, tolerance: f64, bands: &Bands, h: f64) -> f64 {
        self.monitored.switches.iter().fold(h, |h, &i| {
            let lost = bands.width[i] * STOPS.max(TURNS * tolerance / BAND);
            match self.series_along(i) {
                Some([speed, rate, ..]) if *rate > 0.0 && *speed <= lost => {
                    h.min(AWAY * speed / rate)
                }
                _ => h,
            }
        })
    }

    /// A step of h, or a shorter one close to rest: what is small next to the states may turn a w as small as that, and
    /// a step that takes it for anything comes no closer to rest.
    pub(crate) fn keeps_directions(&mut self, tolerance: f64, bands: &mut Bands, h: f64) -> f64 {
        let mut shorter = h;
        for i in 0..self.discs.of.len() {
            let Some(other) = self.other(i).filter(|_| self.slips_by(i)) else {
                continue;
            };
            let lost = bands.width[i] * STOPS.max(TURNS * tolerance / BAND);
            if self.psi(i).hypot(self.psi(other)) <= lost {
                self.expand_psi(i, bands);
                shorter = self.step_size_of_slip([i, other], KNOWN, shorter);
            }
        }
        shorter
    }

    /// Where a step towards w = 0 ends before it gets there; nothing where it does, or goes nowhere else.
    pub(crate) fn stops_short(
        &self,
        point: &Point,
        bands: &Bands,
        switch: usize,
        tau: f64,
    ) -> Option<f64> {
        let speed = self.series_along(switch)?[0];
        let length = tau * (1.0 - LEFT);
        let far = speed > STOPS * bands.width[switch] && point.t + (length + point.t_low) > point.t;
        far.then_some(length)
    }
}

/// w/|w|, or any direction where w is zero.
fn direction(w: [f64; 2]) -> [f64; 2] {
    let speed = w[0].hypot(w[1]);
    match speed > 0.0 {
        true => w.map(|w| w / speed),
        false => [1.0, 0.0],
    }
}

/// The series of 1 - |u|² of a contact that sticks.
pub(crate) fn margin(dense: Dense, switch: usize, other: usize, series: &mut Vec<f64>) {
    let all = [switch, other].map(|i| dense.alpha(i));
    series.clear();
    for m in 0..=dense.order() {
        let mut sum = if m == 0 { 1.0 } else { 0.0 };
        for alpha in all {
            let u = |k: usize| 2.0 * alpha[k] - if k == 0 { 1.0 } else { 0.0 };
            sum -= (0..=m).map(|k| u(k) * u(m - k)).sum::<f64>();
        }
        series.push(sum);
    }
}

/// Whether what is at the rim of its disc goes back inside, or stays, by its series.
pub(crate) fn goes_on(mode: &Mode, switch: usize, h: f64) -> bool {
    let mut terms = Vec::new();
    let other = mode.other(switch).unwrap_or(switch);
    margin(Dense::Taylor(mode), switch, other, &mut terms);
    terms[0] > RIM || series::leading(&terms, h, RIM).is_none_or(|k| terms[k] > 0.0)
}

/// 1 - |u|² at a point, and its derivative by time.
pub(crate) fn margin_at(dense: Dense, switch: usize, tau: f64, alpha: &[f64]) -> (f64, f64) {
    let other = dense.mode().other(switch).unwrap_or(switch);
    [switch, other]
        .into_iter()
        .fold((1.0, 0.0), |(value, slope), i| {
            let (u, rate) = (2.0 * alpha[i] - 1.0, series::slope(dense.alpha(i), tau));
            (value - u * u, slope - 4.0 * u * rate)
        })
}

/// Whether u of the first entry of two that stick is at the rim after some time.
pub(crate) fn is_at_rim(dense: Dense, switch: usize, tau: f64) -> bool {
    let Some(other) = dense.mode().other(switch) else {
        return false;
    };
    let u = [switch, other].map(|i| 2.0 * series::value(dense.alpha(i), tau) - 1.0);
    (1.0 - u[0] * u[0] - u[1] * u[1]).abs() <= RIM
}

/// The first instant at which u leaves the disc.
pub(crate) fn leaves(
    roots: &mut RootFinder,
    dense: Dense,
    series: &mut Vec<f64>,
    switch: usize,
    h: f64,
) -> Option<Root> {
    let other = dense.mode().other(switch)?;
    margin(dense, switch, other, series);
    let band = (series[0].abs() <= RIM).then_some(RIM);
    crate::integrate::step::first_root(roots, series[0], series, h, 1.0, band, 0.0)
}

impl Departure {
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
        let &Departure {
            switches,
            direction,
        } = self;
        let mut alpha = point.alpha.clone();
        switches.iter().for_each(|&i| alpha[i] = 0.5);
        mode.eval(point.t, x, &alpha);
        Rows::linearize(mode, &switches);
        let sizes = switches.map(|i| mode.weigh(i, |j| scales.size(j)));
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
