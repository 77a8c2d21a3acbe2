//! Order of convergence: how the error at the end of a run falls with the step size, and what it
//! costs, for every method that can run the experiment.
//!
//! The error is ‖x(T) - x*‖₂. The reference x* is what the experiment expects at its end, where that
//! gives all states, or else a run that is more accurate than all others. Orders are slopes of
//! straight lines through log-errors, over those that are above the accuracy of the reference and
//! small enough to be about convergence (`fit.rs`).

mod fit;
mod grid;
mod reference;
mod table;

use std::time::Duration;

pub use fit::Fit;
pub use grid::Road;
pub use reference::Reference;
pub use table::{csv, text};

use crate::Compiled;
use crate::limit::Limit;
use crate::model::Units;
use crate::project::clock::Instant;
use crate::report::expect::Convergence;
#[cfg(feature = "plots")]
use crate::report::plot::{Curve as Line, LogLog};
use crate::simulate::{Bench, End};
use crate::source::SourceMap;
use crate::system::experiment::Settings;
use grid::Sweep;

/// Errors above this share of the size of the state say nothing about convergence.
const COARSE: f64 = 0.1;
/// Runs below the floor before a sweep ends.
const MOST_BELOW: usize = 2;
/// Failed runs in a row before a sweep ends, after one that reached the end and before: the first grids
/// may be far too coarse.
const MOST_FAILED: [usize; 2] = [6, 24];
/// What is left for a refinement that doubles the work of the last one, at least.
const GROWTH: f64 = 2.0;

/// Errors of all methods.
#[derive(Clone, Debug)]
pub struct Study {
    /// Name of the experiment.
    pub experiment: String,
    /// Name of the model.
    pub model: String,
    /// Units of time, and of all states where they have one.
    pub units: [Option<String>; 2],
    /// What errors are measured against.
    pub reference: Reference,
    /// One per method.
    pub curves: Vec<Curve>,
    /// Methods that do not run this experiment, and why.
    pub left_out: Vec<(String, String)>,
    /// Wall time of everything in seconds.
    pub seconds: f64,
}

/// Runs of one method.
#[derive(Clone, Debug)]
pub struct Curve {
    /// `fesd radau_iia(3)`
    pub name: String,
    /// What is refined from run to run.
    pub knob: Knob,
    /// Family of methods in the figures, and place in it.
    pub place: (usize, usize),
    /// From coarse to fine.
    pub points: Vec<Point>,
    /// The slope of log-error over log-knob; none where too few errors say something.
    pub fit: Option<Fit>,
}

/// What is refined from run to run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Knob {
    /// The length h of elements.
    Step,
    /// The tolerance.
    Tolerance,
    /// The width of smoothed switches.
    Epsilon,
}

impl Knob {
    /// The word of the CSV form.
    pub fn word(self) -> &'static str {
        match self {
            Knob::Step => "step",
            Knob::Tolerance => "tolerance",
            Knob::Epsilon => "epsilon",
        }
    }

    /// As in `h^5`.
    pub fn symbol(self) -> &'static str {
        match self {
            Knob::Step => "h",
            Knob::Tolerance => "tol",
            Knob::Epsilon => "eps",
        }
    }
}

/// One run.
#[derive(Clone, Debug)]
pub struct Point {
    /// The step size, tolerance or width that was asked for.
    pub knob: f64,
    /// Steps that were taken.
    pub steps: usize,
    /// Their mean length.
    pub step: f64,
    /// ‖x(T) - x*‖₂, or why the run failed.
    pub error: Result<f64, String>,
    /// Median time of the solve in seconds.
    pub seconds: f64,
}

/// How far a study is.
#[derive(Clone, Debug)]
pub struct Progress<'a> {
    /// The method that runs.
    pub name: &'a str,
    /// Its last step size or tolerance.
    pub knob: f64,
    /// Share of the methods that are done.
    pub done: f64,
}

/// An experiment on a road that takes jumps, or why it does not go it.
pub type Lowered<'c, 'e> = (Road, Result<&'c Compiled<'e>, String>);

/// Measures the errors of all methods in about as much wall time as `limit`; why there is no
/// reference otherwise. Where states jump, `roads` are compared, too.
pub fn study(
    compiled: &Compiled<'_>,
    roads: &[Lowered<'_, '_>],
    sources: &SourceMap,
    limit: Duration,
    watch: &mut dyn FnMut(Progress),
) -> Result<Study, String> {
    let started = Instant::now();
    let settings = &compiled.settings;
    has_switches_alone(compiled)?;
    let mut bench = Bench::new(&compiled.system, settings);
    let found = reference::find(compiled, &mut bench, sources, limit / 4)?;
    let reference = found.reference;
    let (sweeps, mut left_out) = grid::sweeps(&bench, settings, found.steps);
    let mut sweeps: Vec<(Sweep, Option<&Compiled>)> =
        sweeps.into_iter().map(|sweep| (sweep, None)).collect();
    // What is said of a road says more than what is said of its method.
    left_out.retain(|(name, _)| roads.iter().all(|(road, _)| road.name() != name));
    for (road, lowered) in roads {
        match lowered {
            Ok(lowered) => {
                let new = road.sweeps(&lowered.settings, found.steps);
                sweeps.extend(new.into_iter().map(|sweep| (sweep, Some(*lowered))));
            }
            Err(reason) => left_out.push((road.name().to_owned(), reason.clone())),
        }
    }
    let mut curves = Vec::with_capacity(sweeps.len());
    for (k, (sweep, lowered)) in sweeps.iter().enumerate() {
        let left = limit.saturating_sub(started.elapsed());
        let share = left / (sweeps.len() - k) as u32;
        let done = k as f64 / sweeps.len() as f64;
        let mut watch = |knob| {
            let name = &sweep.name;
            watch(Progress { name, knob, done });
        };
        let mut other = lowered.map(|lowered| Bench::lowered(&lowered.system, &lowered.settings));
        let bench = other.as_mut().unwrap_or(&mut bench);
        curves.push(measure(
            bench, settings, sweep, &reference, share, &mut watch,
        ));
    }
    Ok(Study {
        experiment: settings.name.clone(),
        model: settings.model.clone(),
        units: units(compiled),
        reference,
        curves,
        left_out,
        seconds: started.elapsed().as_secs_f64(),
    })
}

/// The order of the experiment's own method, from runs on grids in about as much wall time as `limit` leaves; why there is
/// none otherwise.
pub fn of_method(
    compiled: &Compiled<'_>,
    sources: &SourceMap,
    limit: &Limit,
    watch: &mut dyn FnMut(Progress),
) -> Result<Convergence, String> {
    let left = || limit.left().unwrap_or(Duration::MAX);
    let settings = &compiled.settings;
    has_switches_alone(compiled)?;
    let mut bench = Bench::new(&compiled.system, settings)
        .untimed()
        .within(limit);
    let takes_jumps = settings.freezes() || settings.takes_impulses();
    if let Some(reason) = bench
        .without_elements()
        .filter(|_| settings.numerics.method.kind().needs_dcs() && !takes_jumps)
    {
        return Err(format!(
            "the order of this lowering is not measured: {reason}"
        ));
    }
    let found = reference::find(compiled, &mut bench, sources, left() / 4)
        .map_err(|failure| format!("there is nothing to measure errors against: {failure}"))?;
    let Some(sweep) = grid::own(settings, found.steps) else {
        return Err("the method has no number of steps".into());
    };
    let name = &sweep.name;
    let mut watch = |knob| {
        let done = 0.5;
        watch(Progress { name, knob, done });
    };
    let reference = &found.reference;
    if takes_jumps {
        bench = Bench::lowered(&compiled.system, settings)
            .untimed()
            .within(limit);
    }
    let curve = measure(&mut bench, settings, &sweep, reference, left(), &mut watch);
    match &curve.fit {
        Some(fit) => Ok(Convergence {
            order: fit.order,
            account: format!(
                "{}, errors against {}",
                table::summary(&curve),
                reference.source
            ),
        }),
        None => Err(format!(
            "{}, errors against {}",
            table::summary(&curve),
            reference.source
        )),
    }
}

/// Contacts of steps of time are in no other method.
fn has_switches_alone(compiled: &Compiled<'_>) -> Result<(), String> {
    match compiled.system.jumps.impulsive.is_empty() {
        true => Ok(()),
        false => Err("steps of time with contacts are not compared with other methods".into()),
    }
}

/// Refines until the error is that of the reference, or the time is over.
fn measure(
    bench: &mut Bench<'_, '_>,
    settings: &Settings,
    sweep: &Sweep,
    reference: &Reference,
    limit: Duration,
    watch: &mut dyn FnMut(f64),
) -> Curve {
    let started = Instant::now();
    let mut points: Vec<Point> = Vec::new();
    let (mut below, mut failed) = (0, 0);
    for &(knob, variant) in &sweep.runs {
        watch(knob);
        let before = Instant::now();
        let left = limit.saturating_sub(started.elapsed());
        let End {
            x,
            steps,
            failure,
            seconds,
        } = bench.run(variant, left.max(Duration::from_millis(1)));
        let error = match failure {
            Some(failure) => Err(failure),
            None => Ok(reference.error(&x)),
        };
        below = match &error {
            Ok(error) if *error <= reference.floor => below + 1,
            _ => 0,
        };
        failed = if error.is_err() { failed + 1 } else { 0 };
        points.push(Point {
            knob,
            steps,
            step: settings.horizon / steps.max(1) as f64,
            error,
            seconds,
        });
        let next = before.elapsed().mul_f64(GROWTH);
        let most_failed = MOST_FAILED[usize::from(failed == points.len())];
        if below >= MOST_BELOW || failed >= most_failed || started.elapsed() + next > limit {
            break;
        }
    }
    Curve {
        name: sweep.name.clone(),
        knob: sweep.knob,
        place: sweep.place,
        fit: fit::order(&points, reference),
        points,
    }
}

impl Study {
    /// Whether some run of some method reached the end.
    pub fn has_errors(&self) -> bool {
        let mut points = self.curves.iter().flat_map(|curve| &curve.points);
        points.any(|point| point.error.is_ok())
    }
}

#[cfg(feature = "plots")]
fn in_unit(what: &str, unit: Option<&str>) -> String {
    match unit {
        Some(unit) => format!("{what} [{unit}]"),
        None => what.to_owned(),
    }
}

/// The units of time and of all states, where these have one in common.
fn units(compiled: &Compiled<'_>) -> [Option<String>; 2] {
    let units = Units::of(&compiled.model);
    let mut states = compiled
        .system
        .states
        .iter()
        .map(|state| units.unit(&state.name));
    let first = states.next().flatten();
    let common = first.filter(|_| states.all(|unit| unit == first));
    [units.unit("time"), common].map(|unit| unit.map(str::to_owned))
}

#[cfg(feature = "plots")]
impl Study {
    /// Error against step size.
    pub fn error_step(&self) -> String {
        let title = in_unit("mean step size h", self.units[0].as_deref());
        self.figure(&title, |point| point.step)
    }

    /// Error against time.
    pub fn error_time(&self) -> String {
        self.figure("time of the solve in s", |point| point.seconds)
    }

    fn figure(&self, title: &str, x: impl Fn(&Point) -> f64) -> String {
        let line = |curve: &Curve| Line {
            name: curve.name.clone(),
            remark: curve.remark(),
            place: curve.place,
            points: (curve.points.iter())
                .filter_map(|point| Some((x(point), *point.error.as_ref().ok()?)))
                .collect(),
        };
        LogLog {
            x_title: title,
            y_title: &in_unit("error at the end, |x(T) − x*|", self.units[1].as_deref()),
            curves: self.curves.iter().map(line).collect(),
            floor: self.reference.floor,
        }
        .write()
    }
}

impl Curve {
    /// `h^4.98`, or a dash.
    pub fn remark(&self) -> String {
        match &self.fit {
            Some(Fit { order, .. }) => format!("{}^{order:.2}", self.knob.symbol()),
            None => "-".to_owned(),
        }
    }
}
