//! Runs of a fit: numbers of free parameters and initial values -> weighted differences from the data, with derivatives.
//!
//! Where a derivative is lost (W0735), what is known before is kept, and the rest is that of central differences of two runs.

use nalgebra::{DMatrix, DVector};
use nsd_solver::optimization::least_squares::{Linearized, Residuals};
use nsd_solver::optimization::mpcc::deviate;

use crate::Compiled;
use crate::diagnostics::{Diagnostics, counted};
use crate::limit::Limit;
use crate::project::prepared::{Opened, Target};
use crate::project::sensed::Sensor;
use crate::project::watch::{Progress, Watch};
use crate::report::{Samples, Sensitivity, Series, Trajectory, Warning};
use crate::simulate::{Plan, Request};
use crate::system::System;
use crate::system::experiment::{Column, Fit, Sampling, Settings, Starts};

/// Derivatives are known up to this many times the tolerance of runs, and differences up to as many times its power 2/3.
const RANK: f64 = 100.0;

/// The runs of one fit.
pub(super) struct Runs<'f, 'e> {
    fit: &'f Fit<'e>,
    system: System<'e>,
    /// Those of the experiment, with rows at the instants of the data alone.
    settings: Settings<'e>,
    plan: Plan<'e>,
    sensor: Sensor,
    request: Request,
    /// Their number.
    count: usize,
    /// What there is to say of the last run.
    last: Seen,
    /// The same where the search is.
    taken: Seen,
    /// The numbers of events on the way of a search, each time it was another one.
    events: Vec<usize>,
}

/// The way of a search.
pub(super) struct Way {
    pub events: Vec<usize>,
    lost: Vec<Option<String>>,
}

/// What there is to say of a run.
#[derive(Clone, Default)]
struct Seen {
    events: usize,
    /// For each direction, why its derivative is a difference of runs.
    lost: Vec<Option<String>>,
}

impl<'f, 'e> Runs<'f, 'e> {
    /// Compiles the experiment for runs.
    ///
    /// # Errors
    ///
    /// Where a run is not differentiated by something that is free.
    pub fn new(
        compiled: &Compiled<'e>,
        fit: &'f Fit<'e>,
        limit: &Limit,
    ) -> Result<Self, Diagnostics> {
        let sensor = Sensor::new(compiled, Opened::of)?.expect("a fit has something that is free");
        let sensor = sensor.with_given_initial();
        let (system, settings) = (&compiled.system, &compiled.settings);
        let plan = Plan::of_method(system, settings, &sensor.opened.places);
        let points = fit.columns.iter().flat_map(|column| &column.points);
        let mut instants: Vec<f64> = points.map(|[t, _]| *t).collect();
        instants.sort_by(f64::total_cmp);
        instants.dedup();
        let mut settings = settings.clone();
        // Behind the last measurement nothing is compared.
        if let Some(&last) = instants.last().filter(|&&last| last > 0.0) {
            settings.horizon = last;
        }
        settings.recording.sampling = Sampling::At(instants);
        Ok(Runs {
            fit,
            system: system.clone(),
            settings,
            plan,
            sensor,
            request: Request {
                dense: false,
                estimate: false,
                multipliers: false,
                limit: limit.clone(),
            },
            count: 0,
            last: Seen::default(),
            taken: Seen::default(),
            events: Vec::new(),
        })
    }

    /// How many there were.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The way of a search that has ended: the number of events, each time it was another one, and for each direction why its
    /// derivative at the end is a difference of runs.
    pub fn take_way(&mut self) -> Way {
        Way {
            events: std::mem::take(&mut self.events),
            lost: std::mem::take(&mut self.taken.lost),
        }
    }

    /// What free quantities may be.
    pub fn bounds(&self) -> Vec<[f64; 2]> {
        let free = self.fit.free.iter();
        free.map(|freed| [freed.lower, freed.upper]).collect()
    }

    /// What they are in the experiment, within their bounds.
    pub fn guess(&self) -> Vec<f64> {
        let values = self.sensor.values();
        let initial = self.sensor.opened.initial(&values);
        let targets = self.sensor.targets.iter().zip(&self.fit.free);
        let guess = targets.map(|(target, freed)| {
            let value = match *target {
                Target::Parameter(at) => values[at],
                Target::Initial(state) => initial[state],
            };
            value.max(freed.lower).min(freed.upper)
        });
        guess.collect()
    }

    /// The size of free quantities at a point: their magnitudes there, or in the experiment if these are larger; the widths of
    /// their bounds, or one, where they are zero in the experiment.
    fn sizes_at(&self, point: &[f64]) -> Vec<f64> {
        let all = point.iter().zip(self.guess()).zip(self.bounds());
        let sizes = all.map(|((p, guess), [low, high])| {
            let width = high - low;
            let usual = match guess.abs() {
                size if size > 0.0 => size,
                _ if width > 0.0 && width.is_finite() => width,
                _ => 1.0,
            };
            p.abs().max(usual)
        });
        sizes.collect()
    }

    /// Where a search begins: the first one where the experiment says, others around it.
    pub fn start(&self, number: u64, starts: Option<&Starts>) -> Vec<f64> {
        let guess = self.guess();
        let Some(starts) = starts.filter(|_| number > 0) else {
            return guess;
        };
        let sizes = self.sizes_at(&guess);
        let moved = guess.iter().zip(sizes).enumerate().map(|(k, (p, size))| {
            p + starts.deviation * size * deviate(starts.seed, number, k as u64)
        });
        moved.collect()
    }

    /// The open parameters and x(0) with these numbers.
    fn numbers(&self, point: &[f64]) -> [Vec<f64>; 2] {
        let (opened, mut values) = (&self.sensor.opened, self.sensor.values());
        let targets = || self.sensor.targets.iter().zip(point);
        for (target, &p) in targets() {
            if let Target::Parameter(at) = *target {
                values[at] = p;
            }
        }
        let mut initial = opened.initial(&values);
        for (target, &p) in targets() {
            if let Target::Initial(state) = *target {
                initial[state] = p;
            }
        }
        [values, initial]
    }

    /// The run of what was found, with all that the experiment says; the system of `compiled` is that of it.
    pub fn told(
        &mut self,
        compiled: &mut Compiled<'e>,
        point: &[f64],
        request: &Request,
        watch: &mut dyn Watch,
    ) -> Trajectory {
        let [values, initial] = self.numbers(point);
        self.sensor
            .opened
            .set(&mut compiled.system, &values, &initial);
        let (system, settings) = (&compiled.system, &compiled.settings);
        let told = &mut |progress| watch.progress(&Progress::Simulation(progress));
        self.plan.run(system, settings, request, told)
    }

    /// A run; none where it does not come to its end, or where the experiment has to be compiled for these numbers.
    fn run(&mut self, point: &[f64], differentiates: bool) -> Option<Trajectory> {
        if !point.iter().all(|p| p.is_finite()) {
            return None;
        }
        let [values, initial] = self.numbers(point);
        let opened = &self.sensor.opened;
        if !opened.set(&mut self.system, &values, &initial) {
            return None;
        }
        let sensing = differentiates.then(|| self.sensor.at(&values));
        let asked = (&self.request, sensing.as_ref());
        let (system, settings) = (&self.system, &self.settings);
        let run = (self.plan).run_sensed(system, settings, asked, &mut |_| {});
        self.count += 1;
        run.failure.is_none().then_some(run)
    }

    /// w (q - y) of all measurements.
    pub fn residuals(&self, run: &Trajectory) -> Option<Vec<f64>> {
        self.compared(
            &run.samples.time,
            |column| quantity(&run.samples, column),
            true,
        )
    }

    /// What columns say at the instants of their measurements, with their weights.
    fn compared<'s>(
        &self,
        time: &[f64],
        of: impl Fn(&Column<'e>) -> Option<(&'s Series, usize)>,
        less_data: bool,
    ) -> Option<Vec<f64>> {
        let mut all = Vec::new();
        for column in &self.fit.columns {
            let (series, entry) = of(column)?;
            for &[t, y] in &column.points {
                // Where something jumps, it is what comes behind.
                let row = time.partition_point(|&other| other <= t).checked_sub(1)?;
                if time[row] < t {
                    return None;
                }
                let y = if less_data { y } else { 0.0 };
                all.push(column.weight * (series.at(row)[entry] - y));
            }
        }
        Some(all)
    }

    /// The length of by how much, with their weights, columns change in a run.
    fn compared_size(&self, run: &Trajectory) -> Option<f64> {
        let of = |column: &Column<'e>| quantity(&run.samples, column);
        let mut values = self.compared(&run.samples.time, of, false)?;
        let mut left = &mut values[..];
        for column in &self.fit.columns {
            let (of_column, rest) = left.split_at_mut(column.points.len());
            let low = of_column.iter().copied().fold(f64::INFINITY, f64::min);
            let high = of_column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            of_column.fill(high - low);
            left = rest;
        }
        Some(DVector::from_vec(values).norm())
    }

    /// A column of J, with what is not known of it by differences.
    fn slope(
        &mut self,
        point: &[f64],
        k: usize,
        run: &Trajectory,
        here: &[f64],
    ) -> Option<Vec<f64>> {
        let by = &run.samples.sensitivities[k];
        let slope = self.compared(&run.samples.time, |column| derivative(by, column), false)?;
        if slope.iter().all(|slope| slope.is_finite()) {
            return Some(slope);
        }
        let why = run.warnings.iter().find(|warning| warning.code == "W0735");
        let why = why.map_or_else(
            || "an output has no derivative".to_owned(),
            |w| w.message.clone(),
        );
        self.last.lost[k] = Some(why);
        // Errors of the runs over h, and h² of the differences, are alike.
        let h = self.sizes_at(point)[k] * self.settings.numerics.tolerance.cbrt();
        let [low, high] = self.bounds()[k];
        if low == high {
            return Some(vec![0.0; here.len()]);
        }
        let mut ends = Vec::new();
        for end in [(point[k] - h).max(low), (point[k] + h).min(high)] {
            let mut other = point.to_vec();
            other[k] = end;
            let run = self.run(&other, false);
            let found = run.and_then(|run| self.residuals(&run));
            ends.extend(found.map(|found| (end, found)));
        }
        if ends.len() < 2 {
            ends.push((point[k], here.to_vec()));
        }
        let [(a, low), (b, high)] = &ends[..] else {
            return None;
        };
        let differences = low
            .iter()
            .zip(high)
            .map(|(low, high)| (high - low) / (b - a));
        let filled = slope
            .iter()
            .zip(differences)
            .map(|(&known, difference)| match known {
                known if known.is_finite() => known,
                _ => difference,
            });
        let filled: Vec<f64> = filled.collect();
        filled
            .iter()
            .all(|slope| slope.is_finite())
            .then_some(filled)
    }
}

impl Way {
    /// Derivatives that are those of differences, and why, and that events have come or gone, where the objective is not smooth.
    pub fn warnings(&self, fit: &Fit<'_>) -> Vec<Warning> {
        let all = self.lost.iter().zip(&fit.sensed);
        let differences = all.filter_map(|(why, sensed)| {
            let why = why.as_ref()?;
            Some(Warning {
                code: "W0744".into(),
                message: format!(
                    "derivatives by `{}` are differences of runs where they are not known: {why}",
                    sensed.name
                ),
                span: Some(sensed.span),
            })
        });
        let mut warnings: Vec<Warning> = differences.collect();
        if let [first, .., last] = self.events[..] {
            let times = counted(self.events.len() - 1, "time");
            warnings.push(Warning {
                code: "W0743".into(),
                message: format!(
                    "the number of events has changed {times} on the way, from {first} to {last}: the sum of squares is not smooth there, and other minima may be near; several `starts` look for them"
                ),
                span: fit.free.first().map(|freed| freed.span),
            });
        }
        warnings
    }
}

impl Residuals for Runs<'_, '_> {
    fn at(&mut self, point: &[f64]) -> Option<Linearized> {
        let run = self.run(point, true)?;
        let residuals = self.residuals(&run)?;
        let (m, n) = (residuals.len(), point.len());
        if !residuals.iter().all(|r| r.is_finite()) || run.samples.sensitivities.len() != n {
            return None;
        }
        self.last = Seen {
            events: run.history.events.len(),
            lost: vec![None; n],
        };
        let mut jacobian = DMatrix::zeros(m, n);
        for k in 0..n {
            let slope = self.slope(point, k, &run, &residuals)?;
            jacobian.set_column(k, &DVector::from_vec(slope));
        }
        let tolerance = self.settings.numerics.tolerance;
        let has_differences = self.last.lost.iter().any(Option::is_some);
        let accuracy = match has_differences {
            true => tolerance.powf(2.0 / 3.0),
            false => tolerance,
        };
        // By how much numbers that are rounded change r.
        let rounding = (jacobian.abs() * DVector::from_vec(self.sizes_at(point))).norm();
        Some(Linearized {
            noise: tolerance * self.compared_size(&run)? + f64::EPSILON * rounding,
            rank: (RANK * accuracy).clamp(f64::EPSILON.sqrt(), 1e-2),
            residuals: DVector::from_vec(residuals),
            jacobian,
        })
    }

    fn taken(&mut self) {
        self.taken = self.last.clone();
        if self.events.last() != Some(&self.taken.events) {
            self.events.push(self.taken.events);
        }
    }

    fn sizes(&self, point: &[f64]) -> Vec<f64> {
        self.sizes_at(point)
    }

    fn is_over(&self) -> bool {
        self.request.limit.is_over()
    }
}

/// The series that has what a column measures, and its place in it.
fn quantity<'s>(samples: &'s Samples, column: &Column<'_>) -> Option<(&'s Series, usize)> {
    entry(samples.series(), column)
}

/// The same of derivatives.
fn derivative<'s>(by: &'s Sensitivity, column: &Column<'_>) -> Option<(&'s Series, usize)> {
    entry(by.states.iter().chain(&by.outputs), column)
}

fn entry<'s>(
    mut all: impl Iterator<Item = &'s Series>,
    column: &Column<'_>,
) -> Option<(&'s Series, usize)> {
    all.find_map(|series| {
        let names = series.entry_names();
        let entry = names.iter().position(|name| *name == column.kept.name)?;
        Some((series, entry))
    })
}
