//! Derivatives from both sides of a number by which a run has none.
//!
//! A run whose data are p + h has derivatives g(h), exact through its events; that from above at p is their limit for h → 0.
//! Where g is smooth for h > 0, 2 g(h) - g(2 h) is g(0) + O(h²), and the same of doubled steps agrees with that; where it
//! does not, as a root of h at a surface that is touched, there is no derivative on that side, or none is found. It is one
//! of the run itself where values follow from it: x(h) - x(0) = h (g(0) + g(h))/2 + O(h³), which they do not where the
//! solution jumps at p, or something else happens between p and p + h.

use std::ops::Range;

use crate::Compiled;
use crate::project::prepared::{Target, check_parameters};
use crate::project::sensed::Sensor;
use crate::report::{Samples, Sensitivity, Series, Status, Trajectory};
use crate::simulate::{Plan, Request};
use crate::system::experiment::Sampling;

/// Steps as shares of a number, or absolute from zero: the first that runs do not take for the same point.
const STEPS: [f64; 6] = [1e-10, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4];

/// How much two extrapolations differ at most, as a share of a derivative and of the largest of its series.
const AGREES: [f64; 2] = [1e-6, 1e-9];

/// How much a value differs at most from what derivatives say, as a share of their part and of the largest of its series.
const FOLLOWS: [f64; 2] = [1e-3, 1e-11];

/// Losses of derivatives that are not farther apart, as a share of their time, are of one event.
const SAME: f64 = 1e-3;

/// An experiment that runs with other data.
pub(crate) struct Beside<'b, 'e> {
    pub compiled: &'b mut Compiled<'e>,
    pub plan: &'b mut Plan<'e>,
    pub sensor: &'b Sensor,
    /// The open parameters of the run.
    pub open: &'b [f64],
    /// The initial values of the run.
    pub x0: &'b [f64],
}

/// What is reported of a run in the rows of another one, with its derivatives: series by series, row by row; not a number
/// where it has no such row.
struct Course {
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl Beside<'_, '_> {
    /// Adds what is known from below and from above to a run that is solved, for each number by which it loses its
    /// derivatives.
    pub fn add(mut self, request: &Request, run: &mut Trajectory) {
        let sensed = &self.compiled.settings.recording.sensed;
        let asked: Vec<bool> = sensed.iter().map(|sensed| sensed.one_sided).collect();
        if run.status != Status::Solved || !asked.contains(&true) {
            return;
        }
        let all = run.samples.sensitivities.clone();
        let lost = all.iter().enumerate().zip(asked);
        for ((d, by), _) in lost.filter(|((_, by), asked)| *asked && by.until.is_some()) {
            for (sign, side) in [(-1.0, "below"), (1.0, "above")] {
                let to = format!("{} from {side}", by.to);
                let limits = self.limits((d, by), sign, request, &run.samples);
                let of_side = written(by, to, limits, &run.samples.time);
                run.samples.sensitivities.push(of_side);
            }
        }
        let (system, opened) = (&mut self.compiled.system, &self.sensor.opened);
        opened.set(system, self.open, self.x0);
    }

    /// The limits from one side; none where all runs beside lose their derivatives where this one does.
    fn limits(
        &mut self,
        (d, by): (usize, &Sensitivity),
        sign: f64,
        request: &Request,
        samples: &Samples,
    ) -> Option<Vec<f64>> {
        let own = match self.sensor.targets[d] {
            Target::Parameter(place) => self.open[place].abs(),
            Target::Initial(state) => self.x0[state].abs(),
        };
        let size = sign * if own > 0.0 { own } else { 1.0 };
        STEPS.iter().find_map(|step| {
            let h = step * size;
            let mut at = |k: f64| self.course((d, by), k * h, request, samples);
            let beside = [at(1.0)?, at(2.0)?, at(4.0)?];
            let mut first = 0;
            let series = samples.series().flat_map(|series| {
                let own = first..first + series.values.len();
                first = own.end;
                limits_of(
                    &series.values,
                    h,
                    beside.each_ref().map(|course| course.part(&own)),
                )
            });
            Some(series.collect())
        })
    }

    /// A run with another number; none where it loses its derivatives where the run does.
    fn course(
        &mut self,
        (d, by): (usize, &Sensitivity),
        step: f64,
        request: &Request,
        samples: &Samples,
    ) -> Option<Course> {
        let opened = &self.sensor.opened;
        let (mut open, mut x0) = (self.open.to_vec(), self.x0.to_vec());
        match self.sensor.targets[d] {
            Target::Parameter(place) => {
                let before = opened.initial(&open);
                open[place] += step;
                let moved = opened.initial(&open);
                for (state, x0) in x0.iter_mut().enumerate() {
                    if !self.sensor.given.contains(&state) {
                        *x0 += moved[state] - before[state];
                    }
                }
            }
            Target::Initial(state) => x0[state] += step,
        }
        check_parameters(&opened.parameters, &open).ok()?;
        if !opened.set(&mut self.compiled.system, &open, &x0) {
            return None;
        }
        let mut settings = self.compiled.settings.clone();
        let mut instants = samples.time.clone();
        instants.dedup();
        settings.recording.sampling = Sampling::At(instants);
        settings.recording.weights = None;
        let sensing = self.sensor.asked(&settings, &open);
        let asked = (request, sensing.as_ref());
        let run = (self.plan).run_sensed(&self.compiled.system, &settings, asked, &mut |_| {});
        let beside = run.samples.sensitivities.get(d)?;
        let own = by.until.unwrap_or(f64::INFINITY);
        let is_lost_there = |until: f64| until <= own + SAME * own.abs();
        if run.status != Status::Solved || beside.until.is_some_and(is_lost_there) {
            return None;
        }
        let places = places(&samples.time, &run.samples.time);
        let (states, outputs) = (beside.states.iter(), beside.outputs.iter());
        Some(Course {
            values: in_rows(run.samples.series(), &places),
            slopes: in_rows(states.chain(outputs), &places),
        })
    }
}

impl Course {
    /// Values and derivatives of a series.
    fn part(&self, own: &Range<usize>) -> [&[f64]; 2] {
        [&self.values[own.clone()], &self.slopes[own.clone()]]
    }
}

/// Entries of series in some rows: not a number in those that are not there.
fn in_rows<'s>(series: impl Iterator<Item = &'s Series>, places: &[Option<usize>]) -> Vec<f64> {
    let mut all = Vec::new();
    for series in series {
        for place in places {
            match place {
                Some(k) => all.extend(series.at(*k)),
                None => all.extend(vec![f64::NAN; series.n_entries()]),
            }
        }
    }
    all
}

/// The rows of some instants among others: the first and the last of those at one instant.
fn places(instants: &[f64], others: &[f64]) -> Vec<Option<usize>> {
    let place = |(k, t): (usize, &f64)| {
        let first = others.partition_point(|other| other < t);
        let behind = others.partition_point(|other| other <= t);
        let is_first = instants.get(k + 1) == Some(t);
        (first < behind).then(|| if is_first { first } else { behind - 1 })
    };
    instants.iter().enumerate().map(place).collect()
}

/// The limits of the derivatives of a series from what is known of it at h, 2 h and 4 h: not a number where it has none.
fn limits_of(values: &[f64], h: f64, [near, far, farther]: [[&[f64]; 2]; 3]) -> Vec<f64> {
    let largest = |all: &[f64]| all.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
    let (largest_value, largest_slope) = (largest(values), largest(near[1]));
    let limit = |k: usize| {
        let [near, far, farther] = [near, far, farther].map(|course| [course[0][k], course[1][k]]);
        let (limit, other) = (2.0 * near[1] - far[1], 2.0 * far[1] - farther[1]);
        let agrees = (limit - other).abs() <= AGREES[0] * limit.abs() + AGREES[1] * largest_slope;
        let part = 0.5 * h * (limit + near[1]);
        let most = FOLLOWS[0] * h.abs() * limit.abs().max(near[1].abs());
        let follows = |doubt: f64| (near[0] - values[k] - part).abs() <= most + doubt;
        let is_limit = agrees && follows(FOLLOWS[1] * largest_value);
        if is_limit { limit } else { f64::NAN }
    };
    (0..values.len()).map(limit).collect()
}

/// Derivatives in the shapes of those of the run, which stay where they are known.
fn written(
    by: &Sensitivity,
    to: String,
    limits: Option<Vec<f64>>,
    instants: &[f64],
) -> Sensitivity {
    let mut side = Sensitivity { to, ..by.clone() };
    let series = side.states.iter_mut().chain(&mut side.outputs);
    let values = series.flat_map(|series| &mut series.values);
    for (value, limit) in values.zip(limits.into_iter().flatten()) {
        if value.is_nan() {
            *value = limit;
        }
    }
    let all = || side.states.iter().chain(&side.outputs);
    let is_lost = |series: &Series, k: usize| series.at(k).iter().any(|g| g.is_nan());
    let lost = |k: &usize| all().any(|series| is_lost(series, *k));
    let first = (0..instants.len()).find(lost);
    side.until = first.map(|k| instants[k]);
    side
}
