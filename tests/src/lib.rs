//! Harness shared by the test files of this crate: from text to a trajectory.

pub mod affine;
pub mod bodies;
mod examples;
pub mod faults;
pub mod random;
pub mod set_points;
pub mod stress;

use std::path::{Path, PathBuf};

pub use examples::for_each_example;
use nsdc::cli::{self, Exit, Meter, Streams};
use nsdc::diagnostics::{self, Diagnostics};
use nsdc::expr::Exprs;
use nsdc::limit::Cancel;
use nsdc::lowering::dcs;
use nsdc::optimize;
use nsdc::project::clock::Clock;
use nsdc::project::ensemble::Source;
use nsdc::report::{EventKind, Status, Trajectory};
use nsdc::simulate::{self, Request};
use nsdc::source::SourceMap;
use nsdc::source::imports;
use nsdc::source::imports::{Loaded, Loader, NoFiles, NotLoaded};
use nsdc::study::sweep::{Axis, Grid};
use nsdc::syntax::{self, Item};
use nsdc::system::Role;
use nsdc::system::experiment::{FesdOptions, Method};
use nsdc::{Compiled, Options, Project, compile};

/// Files of data by name, and no others.
#[derive(Clone, Debug, Default)]
pub struct DataFiles<'d>(pub Vec<(&'d str, String)>);

impl Loader for DataFiles<'_> {
    fn load(&mut self, from: &str, path: &str) -> Result<Loaded, NotLoaded> {
        NoFiles.load(from, path)
    }

    fn data(&mut self, from: &str, path: &str) -> Result<Vec<u8>, NotLoaded> {
        let found = self.0.iter().find(|(name, _)| *name == path);
        found.map_or_else(
            || NoFiles.data(from, path),
            |(_, text)| Ok(text.clone().into_bytes()),
        )
    }
}

/// The data in a folder, and no other files.
#[derive(Clone, Debug)]
pub struct DataFolder(pub PathBuf);

impl Loader for DataFolder {
    fn load(&mut self, from: &str, path: &str) -> Result<Loaded, NotLoaded> {
        NoFiles.load(from, path)
    }

    fn data(&mut self, _: &str, path: &str) -> Result<Vec<u8>, NotLoaded> {
        std::fs::read(self.0.join(path)).map_err(|_| NotLoaded {
            tried: path.to_owned(),
            reason: "there is no such file or folder".to_owned(),
        })
    }
}

/// Compiles one experiment of a text and hands it to `use_it`.
///
/// # Panics
///
/// With the rendered diagnostics, when the text does not compile.
pub fn with_experiment<T>(
    text: &str,
    experiment: &str,
    use_it: impl FnOnce(&Compiled<'_>) -> T,
) -> T {
    with_data(text, &mut DataFiles::default(), experiment, use_it)
}

/// The same, with the experiment as it stands in the text.
///
/// # Panics
///
/// With the rendered diagnostics, when the text does not compile, and without an experiment of that name.
pub fn with_source<T>(
    text: &str,
    experiment: &str,
    use_it: impl FnOnce(Source<'_>, &Compiled<'_>) -> T,
) -> T {
    let mut diags = Diagnostics::new();
    let source = SourceMap::new().add("test.nsd", text);
    let file = syntax::parse(&source, &mut diags);
    let item = file.items.iter().find_map(|item| match item {
        Item::Experiment(found) if found.name.name == experiment => Some(found),
        _ => None,
    });
    let source = Source {
        file: &file,
        experiment: item.expect("the text has this experiment"),
        overrides: &[],
    };
    with_experiment(text, experiment, |compiled| use_it(source, compiled))
}

/// The same for a text with data beside it.
///
/// # Panics
///
/// With the rendered diagnostics, when the text does not compile.
pub fn with_data<T>(
    text: &str,
    data: &mut DataFiles<'_>,
    experiment: &str,
    use_it: impl FnOnce(&Compiled<'_>) -> T,
) -> T {
    let mut sources = SourceMap::new();
    let mut diags = Diagnostics::new();
    let source = sources.add("test.nsd", text);
    let mut file = syntax::parse(&source, &mut diags);
    imports::link(&mut file, "test.nsd", data, &mut sources, &mut diags);
    let item = file.items.iter().find_map(|item| match item {
        Item::Experiment(found) if found.name.name == experiment => Some(found),
        _ => None,
    });
    let exprs = Exprs::new();
    let compiled =
        item.and_then(|item| compile(&exprs, &file, item, &[], &mut Clock::default(), &mut diags));
    match compiled {
        Some(compiled) if !diags.has_errors() => use_it(&compiled),
        _ => panic!(
            "`{experiment}` does not compile:\n{}",
            diagnostics::render(&diags, &sources, false, 100)
        ),
    }
}

/// Compiles and runs one experiment of a text.
pub fn run(text: &str, experiment: &str) -> Trajectory {
    with_experiment(text, experiment, |compiled| {
        simulate::run(&compiled.system, &compiled.settings, &Request::default())
    })
}

/// The same for one that must solve.
///
/// # Panics
///
/// When it does not, or what it gives is no trajectory.
#[track_caller]
pub fn solved(text: &str, experiment: &str) -> Trajectory {
    let found = run(text, experiment);
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    found.verify().expect("the invariants of `Trajectory`");
    found
}

/// An optimum of a text that is one.
///
/// # Panics
///
/// When it is none, or not a trajectory.
#[track_caller]
pub fn solved_optimum(text: &str, experiment: &str) -> Trajectory {
    let found = optimum(text, experiment);
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    found
}

/// The codes of what is wrong with a text.
pub fn codes(text: &str) -> Vec<String> {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let source = sources.add("test.nsd", text);
    let file = syntax::parse(&source, &mut diags);
    nsdc::check(&file, &sources, &mut diags);
    diags.codes()
}

/// The codes of the rows of a sweep over values of a parameter.
///
/// # Panics
///
/// When the experiment cannot be swept.
pub fn codes_of_rows(
    text: &str,
    experiment: &str,
    (parameter, values): (&str, &[f64]),
) -> Vec<Option<String>> {
    let axis = Axis {
        name: parameter.to_owned(),
        values: values.to_vec(),
    };
    let grid = Grid::new(vec![axis], false).expect("there are few points");
    let project = Project::from_text("test.nsd", text);
    let sweep = project.sweep(experiment, &Options::default(), grid);
    let sweep = sweep.unwrap_or_else(|errors| panic!("{errors}"));
    let rows = sweep.rows(0..values.len(), 1, &mut |_| {}).rows;
    rows.into_iter().flatten().map(|row| row.code).collect()
}

/// That the end of an optimum, and its objective, are those of a run from event to event with the same controls.
///
/// # Panics
///
/// When they differ by more, or the run does not reach its end.
#[track_caller]
pub fn agrees(optimum: &Trajectory, within: f64) {
    let check = optimum.optimum.as_ref().and_then(|optimum| optimum.check);
    let check = check.expect("the run reaches its end");
    for error in [check.terminal_error, check.objective_error] {
        assert!(error.abs() <= within, "{error} is above {within}");
    }
}

/// Compiles one problem of optimal control of a text, and solves it.
pub fn optimum(text: &str, experiment: &str) -> Trajectory {
    optimum_with_data(text, &DataFiles::default(), experiment)
}

/// The same for a text with data beside it.
pub fn optimum_with_data(text: &str, data: &DataFiles<'_>, experiment: &str) -> Trajectory {
    with_data(text, &mut data.clone(), experiment, |compiled| {
        let settings = &compiled.settings;
        let task = settings.optimize.as_ref().expect("an optimization");
        let request = Request::default();
        let run = optimize::run(&compiled.system, settings, task, &[], &request, &mut ());
        let found = run.expect("the problem can be discretized").trajectory;
        found.verify().expect("the invariants of `Trajectory`");
        found
    })
}

/// As [`run`], for a text with data beside it.
pub fn run_with_data(text: &str, data: &DataFiles<'_>, experiment: &str) -> Trajectory {
    with_data(text, &mut data.clone(), experiment, |compiled| {
        simulate::run(&compiled.system, &compiled.settings, &Request::default())
    })
}

/// Every simulation of a text that has no method of its own, by events and, where they take it, by
/// finite elements, both at a tolerance of 1e-11.
pub fn by_both_roads(text: &str) -> Vec<(String, Trajectory, Option<Trajectory>)> {
    let mut sources = SourceMap::new();
    let mut diags = Diagnostics::new();
    let source = sources.add("test.nsd", text);
    let mut file = syntax::parse(&source, &mut diags);
    imports::link(
        &mut file,
        "test.nsd",
        &mut NoFiles,
        &mut sources,
        &mut diags,
    );
    let mut found = Vec::new();
    for item in &file.items {
        let Item::Experiment(experiment) = item else {
            continue;
        };
        let run = |method: Method| {
            let exprs = Exprs::new();
            let mut diags = Diagnostics::new();
            let mut clock = Clock::default();
            let mut compiled = compile(&exprs, &file, experiment, &[], &mut clock, &mut diags)?;
            // Contacts in steps of time are in no other method.
            if !compiled.system.jumps.impulsive.is_empty() {
                return None;
            }
            let numerics = &mut compiled.settings.numerics;
            let own = std::mem::replace(&mut numerics.method, method);
            numerics.tolerance = 1e-11;
            let needs = numerics.method.kind().needs_dcs();
            if needs
                && compiled
                    .system
                    .switches
                    .iter()
                    .any(|k| k.role != Role::Step)
            {
                let horizon = compiled.settings.horizon;
                simulate::settle(&mut compiled.system, horizon).ok()?;
            }
            let lowerings = &compiled.settings.numerics.lowerings;
            let lowers = dcs::check(&compiled.system, lowerings, needs).is_ok();
            let takes = own == Method::Auto
                && lowers
                && (compiled.system.exogenous.data.is_empty() || !needs);
            let takes = takes && compiled.settings.optimize.is_none();
            takes.then(|| simulate::run(&compiled.system, &compiled.settings, &Request::default()))
        };
        if let Some(event) = run(Method::Auto) {
            let name = experiment.name.name.clone();
            found.push((name, event, run(Method::Fesd(FesdOptions::default()))));
        }
    }
    found
}

/// How `nsdc test` of a folder ends, what it prints, and what it says is wrong.
pub fn test_folder(folder: &Path) -> (Exit, String, String) {
    let (mut out, mut err) = (Vec::new(), Vec::new());
    let mut streams = Streams {
        out: &mut out,
        err: &mut err,
        colour: false,
        meter: Meter::None,
        cancel: Cancel::default(),
        width: 100,
        files: cli::terminal(),
    };
    let exit = cli::run(["nsdc".into(), "test".into(), folder.into()], &mut streams);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (exit, text(&out), text(&err))
}

/// Slope of the least squares line through (ln steps, -ln error).
pub fn fitted_order(errors: &[(usize, f64)]) -> f64 {
    let points: Vec<(f64, f64)> = errors
        .iter()
        .map(|&(n, e)| ((n as f64).ln(), -e.ln()))
        .collect();
    let n = points.len() as f64;
    let (mx, my) = points
        .iter()
        .fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let covariance: f64 = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    covariance / points.iter().map(|p| (p.0 - mx) * (p.0 - mx)).sum::<f64>()
}

/// The times of all events of a kind, in order.
pub fn times(trajectory: &Trajectory, kind: EventKind) -> Vec<f64> {
    let events = trajectory.history.events.iter();
    events
        .filter(|event| event.kind == kind)
        .map(|event| event.time)
        .collect()
}

/// The last values of a state or output.
///
/// # Panics
///
/// When the trajectory has no such series or no point.
pub fn end(trajectory: &Trajectory, name: &str) -> Vec<f64> {
    let series = trajectory.samples.states_and_outputs();
    let found = series.into_iter().find(|series| series.name == name);
    let found = found.unwrap_or_else(|| panic!("no `{name}` in the trajectory"));
    found.at(trajectory.samples.time.len() - 1).to_vec()
}

/// Asserts that values are as near to exact ones as this; what is no number is near to none.
///
/// # Panics
///
/// When one of them is not, or there are not as many.
#[track_caller]
pub fn assert_near(found: &[f64], exact: &[f64], within: f64) {
    let is_near = |(found, exact): (&f64, &f64)| (found - exact).abs() <= within;
    assert!(
        found.len() == exact.len() && found.iter().zip(exact).all(is_near),
        "{found:?} is not {exact:?} within {within:e}"
    );
}

/// The larger one of two errors; what is no number is larger than any.
pub fn larger(one: f64, other: f64) -> f64 {
    match one.is_nan() || other.is_nan() {
        true => f64::INFINITY,
        false => one.max(other),
    }
}

/// The largest difference of numbers.
///
/// # Panics
///
/// When there are not as many.
#[track_caller]
pub fn distance(one: &[f64], other: &[f64]) -> f64 {
    assert_eq!(one.len(), other.len(), "{one:?} and {other:?}");
    let differences = one.iter().zip(other).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, larger)
}
