//! `nsdc sweep`

use std::sync::OnceLock;
use std::time::Duration;

use crate::cli::args::SweepArgs;
use crate::cli::files;
use crate::cli::files::Sink;
use crate::cli::progress::Bar;
use crate::cli::project;
use crate::cli::project::Project;
use crate::cli::{Exit, Streams, io};
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::limit::{Cancel, Limit};
use crate::project::clock::Clock;
use crate::project::ensemble::Source;
use crate::project::launch::launch;
use crate::project::rerun::Rerun;
use crate::report::expect::{self, Findings, Verdict};
use crate::report::{Status, Trajectory, Warning};
use crate::simulate::Request;
#[cfg(feature = "parquet")]
use crate::source::files::{FileError, WRITE};
use crate::study::sweep;
use crate::study::sweep::{Axis, Grid, Like, Row, SweepError, Table};
use crate::syntax::{Bind, Expect, Experiment, ExperimentSetting, ExprKind, Path, SettingKind};
use crate::system::experiment::{Sampling, Settings};
use crate::{Compiled, check_names, compile, threads};

/// An experiment with the quantities that are swept.
struct Swept<'s> {
    project: &'s Project,
    experiment: &'s Experiment,
    overrides: &'s [Bind],
    /// A binding for each axis, whose value is replaced.
    axes: Vec<Bind>,
    /// The entries of all states.
    states: Vec<String>,
    /// Of each run.
    time_limit: Option<Duration>,
    /// Ends them all.
    cancel: Cancel,
}

/// Runs an experiment at all points of a grid.
pub fn run(args: &SweepArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let grid = match grid(args) {
        Ok(grid) => grid,
        Err(error) => {
            let mut diags = Diagnostics::new();
            diags.push(error);
            project::print(&diags, &Default::default(), streams)?;
            return Ok(Exit::Usage);
        }
    };
    if let Some(message) = misuse(args, &grid) {
        writeln!(streams.err, "error: {message}")?;
        return Ok(Exit::Usage);
    }
    if !files::foresee(args.targets().all(), streams)? {
        return Ok(Exit::Wrong);
    }
    let Some((mut project, overrides)) = project::open(&args.file, &args.set, streams)? else {
        return Ok(Exit::Wrong);
    };
    let experiment = project::selected_one(&project, args.experiment.as_deref(), "sweep", streams)?;
    let Some(experiment) = &experiment else {
        return Ok(Exit::Wrong);
    };
    let Some(axes) = project.bindings("--over", &examples(&grid)) else {
        project::print(&project.diags, &project.sources, streams)?;
        return Ok(Exit::Wrong);
    };
    let mut swept = Swept {
        project: &project,
        experiment,
        overrides: &overrides,
        axes,
        states: Vec::new(),
        time_limit: args.time_limit,
        cancel: on_interrupt(),
    };
    let mut diags = Diagnostics::new();
    let first = swept.at(&grid.point(0));
    let Some((states, units)) = check_names(&project.file, experiment, &first, &mut diags) else {
        project::print(&diags, &project.sources, streams)?;
        return Ok(Exit::Wrong);
    };
    swept.states = states;
    if let Some(diags) = swept.mistakes(&grid.point(0)) {
        project::print(&diags, &project.sources, streams)?;
        return Ok(Exit::Wrong);
    }
    let (rows, columns) = swept.rows(&grid, args, streams.progress);
    // What is wrong with all points is told once, with its place.
    let mut begun = rows.iter().flatten().peekable();
    if begun.peek().is_some()
        && begun.all(|row| row.status.is_none())
        && let Err(diags) = swept.trajectory(&grid.point(0))
    {
        project::print(&diags, &project.sources, streams)?;
        return Ok(Exit::Wrong);
    }
    let table = Table {
        grid: &grid,
        columns: &columns,
        rows: &rows,
        has_expectations: swept.expects(),
        units: &units,
    };
    let is_solved = |row: &Option<Row>| {
        let status = row.as_ref().and_then(|row| row.status);
        status == Some(Status::Solved)
    };
    let all_solved = rows.iter().all(is_solved);
    Ok(match (write(args, &table, streams)?, all_solved) {
        (false, _) => Exit::Wrong,
        (true, false) => Exit::Failed,
        (true, true) => Exit::Success,
    })
}

/// What is wrong with a combination of arguments.
fn misuse(args: &SweepArgs, grid: &Grid) -> Option<String> {
    let drawn = args.plot.is_some() && grid.drawn().len() > 2;
    if let Some(path) = &args.parquet {
        if cfg!(not(feature = "parquet")) {
            let help = "build it with `--features parquet`, or write `--csv`";
            return Some(format!("this nsdc writes no Parquet\n  help: {help}"));
        }
        if files::is_standard(path) {
            return Some("a Parquet file is not for standard output".to_owned());
        }
    }
    drawn
        .then(|| {
            let help = "leave out `--plot`, or some of `--over`";
            format!("a figure has one axis or two\n  help: {help}")
        })
        .or_else(|| args.targets().misuse())
}

fn grid(args: &SweepArgs) -> Result<Grid, SweepError> {
    let axes: Result<Vec<Axis>, _> = args.over.iter().map(|text| Axis::parse(text)).collect();
    Grid::new(axes?, args.zip)
}

/// `name=value` of each axis, with its first value.
fn examples(grid: &Grid) -> Vec<String> {
    let axes = grid.axes().iter();
    axes.map(|axis| format!("{}={:?}", axis.name, axis.values[0]))
        .collect()
}

/// Canceled once the user has interrupted the program: no run is begun or goes on. The second time ends the program.
fn on_interrupt() -> Cancel {
    let cancel = Cancel::default();
    let told = cancel.clone();
    // Where something else listens, that keeps the signal.
    let _ = ctrlc::set_handler(move || {
        if told.is_canceled() {
            std::process::exit(130);
        }
        told.cancel();
    });
    cancel
}

fn write(args: &SweepArgs, table: &Table, streams: &mut Streams<'_>) -> io::Result<bool> {
    let mut sinks = Vec::new();
    sinks.extend(args.csv.as_ref().map(|path| Sink::with(path, table.csv())));
    sinks.extend(
        args.json
            .as_ref()
            .map(|path| Sink::objects(path, &table.json(), false)),
    );
    let plot = args.plot.as_ref();
    sinks.extend(plot.map(|path| Sink::with(path, table.figure())));
    #[cfg(feature = "parquet")]
    if let Some(path) = &args.parquet {
        match table.parquet() {
            Ok(bytes) => sinks.push(Sink::with(path, bytes)),
            Err(error) => {
                let error = io::Error::other(error);
                FileError::new(WRITE, path, &error).tell(streams)?;
                return Ok(false);
            }
        }
    }
    if !args.targets().to_standard() {
        streams.out.write_all(table.text().as_bytes())?;
    }
    let mut written = true;
    for sink in sinks {
        written &= sink.finish(streams)?;
    }
    Ok(written)
}

impl Swept<'_> {
    /// The overrides of a point.
    fn at(&self, point: &[f64]) -> Vec<Bind> {
        let axes = self.axes.iter().zip(point).map(|(bind, &value)| {
            let mut bind = bind.clone();
            bind.value.kind = ExprKind::Number(value);
            bind
        });
        self.overrides.iter().cloned().chain(axes).collect()
    }

    /// All rows, and the names of end values.
    fn rows(
        &self,
        grid: &Grid,
        args: &SweepArgs,
        is_shown: bool,
    ) -> (Vec<Option<Row>>, Vec<String>) {
        let columns = OnceLock::new();
        let mut bar = Bar::new(&self.experiment.name.name, is_shown);
        let count = grid.len();
        let rows = sweep::over(
            grid,
            args.jobs.map_or_else(threads::count, usize::from),
            &self.cancel,
            |points| self.share(grid, points, &columns),
            &mut |done| {
                let share = done as f64 / count as f64;
                bar.show(share, || format!("{done} of {count} runs"));
            },
        );
        (rows, columns.into_inner().unwrap_or_default())
    }

    /// Runs what one thread gets to. What can be compiled once is, for every side of zero that values are on; other points
    /// are compiled one by one.
    fn share(&self, grid: &Grid, points: sweep::Points<'_>, columns: &OnceLock<Vec<String>>) {
        let exprs = Exprs::new();
        let likes: Vec<Like> = grid.axes().iter().map(Like::of).collect();
        let mut compiled: Vec<(Vec<f64>, Option<Rerun>)> = Vec::new();
        points.each(|point| {
            let first = likes
                .iter()
                .zip(point)
                .map(|(like, value)| like.first(*value));
            let first: Vec<f64> = first.collect();
            let known = compiled.iter().position(|(known, _)| *known == first);
            let known = known.unwrap_or_else(|| {
                let rerun = self.rerun(&exprs, &first);
                compiled.push((first, rerun));
                compiled.len() - 1
            });
            let found = (compiled[known].1.as_mut()).and_then(|rerun| {
                let run = rerun.run(point, &self.request(rerun.compiled()))?;
                let missed = self.missed(rerun.compiled(), &run);
                Some((run, missed))
            });
            let row = match found.map_or_else(|| self.trajectory(point), Ok) {
                Ok((run, missed)) => {
                    columns.get_or_init(|| sweep::columns(&run));
                    Row::of(&run, missed)
                }
                Err(diags) => Row::refused(project::error_codes(&diags).into_iter().next()),
            };
            // What was cut short anywhere is no row.
            (!self.cancel.is_canceled()).then_some(row)
        });
    }

    /// What is asked of a run; its time begins now.
    fn request(&self, compiled: &Compiled<'_>) -> Request {
        Request {
            // Expectations may be about any instant.
            dense: !compiled.settings.expects.is_empty(),
            estimate: true,
            multipliers: false,
            limit: Limit::from(self.time_limit).canceled_by(&self.cancel),
        }
    }

    /// The experiment for all values on the sides of zero of those of a point.
    fn rerun<'e>(&self, exprs: &'e Exprs, point: &[f64]) -> Option<Rerun<'e>> {
        let overrides = self.at(point);
        let source = Source {
            file: &self.project.file,
            experiment: self.experiment,
            overrides: &overrides,
        };
        // All points with this one have the zeros of it.
        let axes = self.axes.iter().zip(point);
        let names = axes.map(|(axis, value)| (*value != 0.0).then(|| axis.target.clone()));
        let names: Vec<Option<Path>> = names.collect();
        let rerun = Rerun::new(exprs, self.project, source, &names, &self.states)?;
        Some(rerun.sampled(|settings| self.sampling(settings)))
    }

    /// When a run is told: at its end, and where there are expectations at all instants of the experiment, since they may
    /// be about these.
    fn sampling(&self, settings: &Settings<'_>) -> Sampling {
        let horizon = settings.horizon;
        match (self.expects(), &settings.recording.sampling) {
            (false, _) => Sampling::At(vec![horizon]),
            (true, Sampling::At(instants)) if instants.last() != Some(&horizon) => {
                Sampling::At([&instants[..], &[horizon]].concat())
            }
            (true, sampling) => sampling.clone(),
        }
    }

    /// How many expectations do not hold in a run, where there are any.
    fn missed(&self, compiled: &Compiled<'_>, run: &Trajectory) -> Option<usize> {
        let subject = compiled.subject(&self.project.sources);
        let expects = expect::of_any_run(&subject, &compiled.settings.expects);
        let findings = Findings {
            warnings: run.warnings.iter().map(|w| w.code.clone()).collect(),
            ..Findings::default()
        };
        let checks = expect::evaluate(&subject, &expects, run, &findings);
        let missed = checks
            .iter()
            .filter(|check| check.verdict != Verdict::Passed);
        (!expects.is_empty()).then(|| missed.count())
    }

    /// Mistakes in expectations, as far as a point shows them.
    fn mistakes(&self, point: &[f64]) -> Option<Diagnostics> {
        let (exprs, mut diags) = (Exprs::new(), Diagnostics::new());
        let (file, clock) = (&self.project.file, &mut Clock::default());
        let overrides = self.at(point);
        let compiled = compile(&exprs, file, self.experiment, &overrides, clock, &mut diags);
        let compiled = compiled.filter(|_| !diags.has_errors())?;
        let mut found = Diagnostics::new();
        let subject = compiled.subject(&self.project.sources);
        expect::check(&subject, &compiled.settings.expects, &mut found);
        found.has_errors().then_some(found)
    }

    /// Whether the experiment has expectations that are about any run.
    fn expects(&self) -> bool {
        let is_open = |setting: &ExperimentSetting| match &setting.kind {
            SettingKind::Expect(expect) => {
                !matches!(expect, Expect::LoweringGolden | Expect::NumbersGolden)
            }
            _ => false,
        };
        self.experiment.settings.iter().any(is_open)
    }

    /// The run of a point, with the warnings of its compilation, and how many expectations it misses.
    fn trajectory(&self, point: &[f64]) -> Result<(Trajectory, Option<usize>), Diagnostics> {
        let (exprs, mut diags) = (Exprs::new(), Diagnostics::new());
        let (file, clock) = (&self.project.file, &mut Clock::default());
        let overrides = self.at(point);
        let compiled = compile(&exprs, file, self.experiment, &overrides, clock, &mut diags);
        let Some(mut compiled) = compiled.filter(|_| !diags.has_errors()) else {
            return Err(diags);
        };
        let settings = &mut compiled.settings;
        if settings.optimize.is_none() {
            settings.recording.sampling = self.sampling(settings);
        }
        let request = self.request(&compiled);
        let mut run = launch(self.project, &mut compiled, &request, &mut ())?;
        run.warnings.splice(0..0, Warning::all(&diags));
        let missed = self.missed(&compiled, &run);
        Ok((run, missed))
    }
}
