//! Derivatives from both sides of a number by which a run has none.
//!
//! A run whose data are p + h has derivatives g(h), exact through its events; that from above at p is their limit for h → 0.
//! Where g is smooth for h > 0, 2 g(h) - g(2 h) is g(0) + O(h²), and the same of doubled steps agrees with that; where it
//! does not, as a root of h at a surface that is touched, there is no derivative on that side, or none is found.

use crate::Compiled;
use crate::project::prepared::{Target, check_parameters};
use crate::project::sensed::Sensor;
use crate::report::{Sensitivity, Series, Status, Trajectory};
use crate::simulate::{Plan, Request};
use crate::system::experiment::Sampling;

/// Steps as shares of the size of a number; what a run takes for one point has derivatives on neither side of it.
const STEPS: [f64; 3] = [1e-6, 1e-5, 1e-4];

/// How much two extrapolations differ at most, as a share of a derivative and of the largest of its series.
const AGREES: [f64; 2] = [1e-6, 1e-9];

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

/// Derivatives of one run, one after another: those of rows, and of the instants of events.
struct Derivatives {
    rows: Vec<f64>,
    events: Vec<f64>,
}

impl Beside<'_, '_> {
    /// Adds what is known from below and from above to a run that is solved, for each number by which it loses its
    /// derivatives.
    pub fn add(mut self, request: &Request, run: &mut Trajectory) {
        let is_asked = self.compiled.settings.recording.one_sided;
        if !is_asked || run.status != Status::Solved {
            return;
        }
        let all = run.samples.sensitivities.clone();
        for (d, by) in all.iter().enumerate().filter(|(_, by)| by.until.is_some()) {
            for (sign, side) in [(-1.0, "below"), (1.0, "above")] {
                let to = format!("{} from {side}", by.to);
                let of_side = self.limit(d, sign, request, run);
                let of_side = written(by, to, of_side, &run.samples.time);
                run.samples.sensitivities.push(of_side);
            }
        }
        let (system, opened) = (&mut self.compiled.system, &self.sensor.opened);
        opened.set(system, self.open, self.x0);
    }

    /// The limit from one side; none where runs beside are not differentiated either.
    fn limit(
        &mut self,
        d: usize,
        sign: f64,
        request: &Request,
        run: &Trajectory,
    ) -> Option<Derivatives> {
        let size = self.size(d, run);
        STEPS.iter().find_map(|step| {
            let mut at = |k: f64| self.derivatives(d, sign * k * step * size, request, run);
            let found = [at(1.0)?, at(2.0)?, at(4.0)?];
            let rows = found.each_ref().map(|by| &by.rows[..]);
            let events = found.each_ref().map(|by| &by.events[..]);
            Some(Derivatives {
                rows: extrapolated(rows),
                events: extrapolated(events),
            })
        })
    }

    /// What a step is a share of: the number itself, or for an initial value of zero the largest value of its state.
    fn size(&self, d: usize, run: &Trajectory) -> f64 {
        let own = match self.sensor.targets[d] {
            Target::Parameter(place) => self.open[place].abs(),
            Target::Initial(state) => {
                let name = &self.compiled.system.states[state].name;
                let mut columns = run.samples.states.iter().flat_map(Series::columns);
                let values = columns.find(|(entry, _)| entry == name);
                let values = values.into_iter().flat_map(|(_, values)| values);
                let x0 = self.x0[state].abs();
                if x0 > 0.0 {
                    x0
                } else {
                    values.fold(0.0, |a: f64, x| a.max(x.abs()))
                }
            }
        };
        if own > 0.0 { own } else { 1.0 }
    }

    /// The derivatives of a run with another number, in the rows of the run; none where they are not known to the end.
    fn derivatives(
        &mut self,
        d: usize,
        step: f64,
        request: &Request,
        run: &Trajectory,
    ) -> Option<Derivatives> {
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
        let mut instants = run.samples.time.clone();
        instants.dedup();
        settings.recording.sampling = Sampling::At(instants);
        settings.recording.weights = None;
        let sensing = self.sensor.asked(&settings, &open);
        let asked = (request, sensing.as_ref());
        let beside = (self.plan).run_sensed(&self.compiled.system, &settings, asked, &mut |_| {});
        let by = beside.samples.sensitivities.get(d)?;
        if beside.status != Status::Solved || by.until.is_some() {
            return None;
        }
        let places = places(&run.samples.time, &beside.samples.time)?;
        let series = by.states.iter().chain(&by.outputs);
        let rows = series.flat_map(|series| places.iter().flat_map(|&k| series.at(k)));
        Some(Derivatives {
            rows: rows.copied().collect(),
            events: by.events.iter().map(|moves| moves.derivative).collect(),
        })
    }
}

/// The rows of some instants among others: the first and the last of those at one instant.
fn places(instants: &[f64], others: &[f64]) -> Option<Vec<usize>> {
    let place = |(k, t): (usize, &f64)| {
        let first = others.partition_point(|other| other < t);
        let behind = others.partition_point(|other| other <= t);
        let is_first = instants.get(k + 1) == Some(t);
        (first < behind).then(|| if is_first { first } else { behind - 1 })
    };
    instants.iter().enumerate().map(place).collect()
}

/// The limits at 0 of what is known at h, 2 h and 4 h: not a number where it has none.
fn extrapolated([near, far, farther]: [&[f64]; 3]) -> Vec<f64> {
    if near.len() != far.len() || far.len() != farther.len() {
        return Vec::new();
    }
    let largest = near.iter().fold(0.0, |a: f64, g| a.max(g.abs()));
    let limit = |k: usize| {
        let (limit, other) = (2.0 * near[k] - far[k], 2.0 * far[k] - farther[k]);
        let agrees = (limit - other).abs() <= AGREES[0] * limit.abs() + AGREES[1] * largest;
        if agrees { limit } else { f64::NAN }
    };
    (0..near.len()).map(limit).collect()
}

/// Derivatives in the shapes of those of the run.
fn written(
    by: &Sensitivity,
    to: String,
    found: Option<Derivatives>,
    instants: &[f64],
) -> Sensitivity {
    let mut side = Sensitivity { to, ..by.clone() };
    let (mut rows, events) = match found {
        Some(found) => (found.rows.into_iter(), found.events),
        None => (Vec::new().into_iter(), Vec::new()),
    };
    for series in side.states.iter_mut().chain(&mut side.outputs) {
        series.values.fill_with(|| rows.next().unwrap_or(f64::NAN));
    }
    let is_known = events.len() == side.events.len();
    for (k, moves) in side.events.iter_mut().enumerate() {
        moves.derivative = if is_known { events[k] } else { f64::NAN };
    }
    let all = || side.states.iter().chain(&side.outputs);
    let is_lost = |series: &Series, k: usize| series.at(k).iter().any(|g| g.is_nan());
    let lost = |k: &usize| all().any(|series| is_lost(series, *k));
    let first = (0..instants.len()).find(lost);
    side.until = first.map(|k| instants[k]);
    side
}
