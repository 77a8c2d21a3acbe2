//! One run of a fit: that of the experiment, or of data with a run of their own.
//!
//! Where a derivative is lost (W0735), what is known before is kept, and the rest is that of central differences of two runs.

use nalgebra::{DMatrix, DVector};

use crate::Compiled;
use crate::diagnostics::Diagnostics;
use crate::limit::Limit;
use crate::project::prepared::{Opened, Target};
use crate::project::sensed::Sensor;
use crate::project::watch::{Progress, Watch};
use crate::report::{Samples, Sensitivity, Series, Trajectory};
use crate::simulate::{Plan, Request};
use crate::system::System;
use crate::system::experiment::{Column, Fit, Sampling, Settings};

/// A run with its data.
pub(super) struct Single<'e> {
    /// What is given to it alone.
    pub with: Option<String>,
    pub columns: Vec<Column<'e>>,
    system: System<'e>,
    /// Those of the experiment, with rows at the instants of the data alone.
    settings: Settings<'e>,
    plan: Plan<'e>,
    sensor: Sensor,
    /// The numbers that are free in it, by their places among all that are.
    places: Vec<usize>,
    request: Request,
    /// How many there were.
    pub count: usize,
}

/// Where a search is.
pub(super) struct Here<'p> {
    /// What is free.
    pub point: &'p [f64],
    /// Its sizes there.
    pub sizes: Vec<f64>,
    pub bounds: Vec<[f64; 2]>,
}

/// What a run says at a point.
pub(super) struct Found {
    /// r
    pub residuals: Vec<f64>,
    /// Its rows of J.
    pub slopes: DMatrix<f64>,
    /// The length of by how much, with their weights, columns change.
    pub changes: f64,
    pub events: usize,
}

impl<'e> Single<'e> {
    /// Compiles a run; `fit` is that of the experiment.
    ///
    /// # Errors
    ///
    /// Where it is not differentiated by something that is free in it.
    pub fn new(compiled: &Compiled<'e>, fit: &Fit<'e>, limit: &Limit) -> Result<Self, Diagnostics> {
        let mut sensor = Sensor::new(compiled, Opened::of)?;
        let targets = sensor.targets.clone();
        sensor.give_initial(targets.iter());
        let (system, mut settings) = (&compiled.system, compiled.settings.clone());
        let plan = Plan::of_method(system, &settings, &sensor.opened.places);
        let own = settings.recording.fit.take().expect("it is a run of a fit");
        let sensed = settings.recording.sensed.iter();
        let places = sensed.map(|sensed| {
            let mut all = fit.sensed.iter();
            let place = all.position(|one| one.name == sensed.name);
            place.expect("what is free in a run is free in the fit")
        });
        let places = places.collect();
        let points = own.columns.iter().flat_map(|column| &column.points);
        let mut instants: Vec<f64> = points.map(|[t, _]| *t).collect();
        instants.sort_by(f64::total_cmp);
        instants.dedup();
        // Behind the last measurement nothing is compared.
        if let Some(&last) = instants.last().filter(|&&last| last > 0.0) {
            settings.horizon = last;
        }
        settings.recording.sampling = Sampling::At(instants);
        Ok(Single {
            with: own.with,
            columns: own.columns,
            system: system.clone(),
            settings,
            plan,
            sensor,
            places,
            request: Request {
                dense: false,
                estimate: false,
                multipliers: false,
                limit: limit.clone(),
            },
            count: 0,
        })
    }

    /// What a number is where the search begins, if it is free in this run.
    pub fn guess(&self, place: usize) -> Option<f64> {
        let k = self.places.iter().position(|&known| known == place)?;
        let values = self.sensor.values();
        Some(match self.sensor.targets[k] {
            Target::Parameter(at) => values[at],
            Target::Initial(state) => self.sensor.opened.initial(&values)[state],
        })
    }

    /// The open parameters and x(0) with these numbers.
    fn numbers(&self, point: &[f64]) -> [Vec<f64>; 2] {
        let (opened, mut values) = (&self.sensor.opened, self.sensor.values());
        let targets = || self.sensor.targets.iter().zip(&self.places);
        for (target, &place) in targets() {
            if let Target::Parameter(at) = *target {
                values[at] = point[place];
            }
        }
        let mut initial = opened.initial(&values);
        for (target, &place) in targets() {
            if let Target::Initial(state) = *target {
                initial[state] = point[place];
            }
        }
        [values, initial]
    }

    /// The run with all that the experiment says; the system of `compiled` is that of it.
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

    /// The run at the instants of its data, with all that there is to say of it.
    pub fn again(&mut self, point: &[f64], request: &Request) -> Trajectory {
        let [values, initial] = self.numbers(point);
        self.sensor.opened.set(&mut self.system, &values, &initial);
        let request = &Request {
            dense: false,
            ..request.clone()
        };
        let (system, settings) = (&self.system, &self.settings);
        self.plan.run(system, settings, request, &mut |_| {})
    }

    /// What is said of this run, and which one it is.
    pub fn says(&self, what: &str) -> String {
        match &self.with {
            Some(with) => format!("in the run with {with}, {what}"),
            None => what.to_owned(),
        }
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
        let is_sensed = differentiates && !self.places.is_empty();
        let sensing = is_sensed.then(|| self.sensor.at(&values));
        let asked = (&self.request, sensing.as_ref());
        let (system, settings) = (&self.system, &self.settings);
        let run = (self.plan).run_sensed(system, settings, asked, &mut |_| {});
        self.count += 1;
        run.failure.is_none().then_some(run)
    }

    /// Differences and their derivatives; `lost` says by which there are none.
    pub fn at(&mut self, here: &Here<'_>, lost: &mut [Option<String>]) -> Option<Found> {
        let run = self.run(here.point, true)?;
        let residuals = self.residuals(&run)?;
        let is_known = residuals.iter().all(|r| r.is_finite());
        if !is_known || run.samples.sensitivities.len() != self.places.len() {
            return None;
        }
        let mut slopes = DMatrix::zeros(residuals.len(), here.point.len());
        for k in 0..self.places.len() {
            let place = self.places[k];
            let by = &run.samples.sensitivities[k];
            let known = |column: &Column<'e>| derivative(by, column);
            let mut slope = self.compared(&run.samples.time, known, false)?;
            if !slope.iter().all(|slope| slope.is_finite()) {
                lost[place] = Some(self.says(&why_lost(&run)));
                self.fill(&mut slope, here, place, &residuals)?;
            }
            slopes.set_column(place, &DVector::from_vec(slope));
        }
        Some(Found {
            changes: self.compared_size(&run)?,
            events: run.history.events.len(),
            residuals,
            slopes,
        })
    }

    /// w (q - y) of all measurements.
    fn residuals(&self, run: &Trajectory) -> Option<Vec<f64>> {
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
        for column in &self.columns {
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
        for column in &self.columns {
            let (of_column, rest) = left.split_at_mut(column.points.len());
            let low = of_column.iter().copied().fold(f64::INFINITY, f64::min);
            let high = of_column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            of_column.fill(high - low);
            left = rest;
        }
        Some(DVector::from_vec(values).norm())
    }

    /// What is not known of a column of J, by differences.
    fn fill(
        &mut self,
        slope: &mut [f64],
        here: &Here<'_>,
        place: usize,
        residuals: &[f64],
    ) -> Option<()> {
        let (point, [low, high]) = (here.point, here.bounds[place]);
        if low == high {
            slope.fill(0.0);
            return Some(());
        }
        // Errors of the runs over h, and h² of the differences, are alike.
        let h = here.sizes[place] * self.settings.numerics.tolerance.cbrt();
        let mut ends = Vec::new();
        for end in [(point[place] - h).max(low), (point[place] + h).min(high)] {
            let mut other = point.to_vec();
            other[place] = end;
            let run = self.run(&other, false);
            let found = run.and_then(|run| self.residuals(&run));
            ends.extend(found.map(|found| (end, found)));
        }
        if ends.len() < 2 {
            ends.push((point[place], residuals.to_vec()));
        }
        let [(a, low), (b, high)] = &ends[..] else {
            return None;
        };
        for (slope, (low, high)) in slope.iter_mut().zip(low.iter().zip(high)) {
            if !slope.is_finite() {
                *slope = (high - low) / (b - a);
            }
        }
        slope.iter().all(|slope| slope.is_finite()).then_some(())
    }
}

/// Why a run has no derivatives.
fn why_lost(run: &Trajectory) -> String {
    let why = run.warnings.iter().find(|warning| warning.code == "W0735");
    why.map_or_else(
        || "an output has no derivative".to_owned(),
        |w| w.message.clone(),
    )
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
        let is_whole = names.len() == 1 && series.name == column.kept.name;
        let entry = names
            .iter()
            .position(|name| is_whole || *name == column.kept.name)?;
        Some((series, entry))
    })
}
