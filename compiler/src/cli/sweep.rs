//! `nsdc sweep`

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use super::args::SweepArgs;
use super::files::Sink;
use super::launch::launch;
use super::progress::Bar;
use super::project::{self, Project};
use super::watch::Watching;
use super::{Exit, Streams, io};
use crate::clock::Clock;
use crate::compile;
use crate::diagnostics::Diagnostics;
use crate::ensemble;
use crate::expr::Exprs;
use crate::report::{Status, Trajectory};
use crate::simulate::Request;
use crate::sweep::{self, Axis, Grid, Row, SweepError, Table};
use crate::syntax::{Bind, Experiment, ExprKind};
use crate::system::experiment::Sampling;

/// An experiment with the quantities that are swept.
struct Swept<'s> {
    project: &'s Project,
    experiment: &'s Experiment,
    overrides: &'s [Bind],
    /// A binding for each axis, whose value is replaced.
    axes: Vec<Bind>,
    request: Request,
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
    let Some((mut project, overrides)) = Project::open(&args.file, &args.set, streams)? else {
        return Ok(Exit::Wrong);
    };
    let Some(experiments) = project.selected(args.experiment.as_deref(), streams)? else {
        return Ok(Exit::Wrong);
    };
    let [experiment] = &experiments[..] else {
        let names = experiments.iter().map(|e| format!("`{}`", e.name.name));
        let names = names.collect::<Vec<_>>().join(", ");
        writeln!(
            streams.err,
            "error: `nsdc sweep` takes one experiment\n  help: name one of {names}"
        )?;
        return Ok(Exit::Wrong);
    };
    let Some(axes) = project.bindings("--over", &examples(&grid)) else {
        project::print(&project.diags, &project.sources, streams)?;
        return Ok(Exit::Wrong);
    };
    let swept = Swept {
        project: &project,
        experiment,
        overrides: &overrides,
        axes,
        request: Request {
            dense: false,
            estimate: true,
            multipliers: false,
            time_limit: args.time_limit,
        },
    };
    // What is wrong with all points is told once, with its place.
    if let Err(diags) = swept.check(&grid.point(0)) {
        project::print(&diags, &project.sources, streams)?;
        return Ok(Exit::Wrong);
    }
    let columns = OnceLock::new();
    let stop = on_interrupt();
    let mut bar = Bar::new(&experiment.name.name, streams.progress);
    let count = grid.len();
    let rows = sweep::over(
        &grid,
        args.jobs.map_or_else(ensemble::threads, usize::from),
        &stop,
        |point| swept.row(point, &columns),
        &mut |done| {
            bar.show(done as f64 / count as f64, || {
                format!("{done} of {count} runs")
            })
        },
    );
    drop(bar);
    let columns = columns.into_inner().unwrap_or_default();
    let table = Table {
        grid: &grid,
        columns: &columns,
        rows: &rows,
    };
    let written = write(args, &table, streams)?;
    let all_solved = rows.iter().all(|row| {
        row.as_ref()
            .is_some_and(|row| row.status == Some(Status::Solved))
    });
    Ok(match (written, all_solved) {
        (false, _) => Exit::Wrong,
        (true, false) => Exit::Failed,
        (true, true) => Exit::Success,
    })
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

/// Set once the user has interrupted the program: runs that go on come to their end, no other is begun. The second time
/// ends the program.
fn on_interrupt() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let told = stop.clone();
    // Where something else listens, that keeps the signal.
    let _ = ctrlc::set_handler(move || {
        if told.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
    stop
}

fn write(args: &SweepArgs, table: &Table, streams: &mut Streams<'_>) -> io::Result<bool> {
    let mut sinks = Vec::new();
    sinks.extend(args.csv.as_ref().map(|path| Sink::with(path, table.csv())));
    sinks.extend(
        args.json
            .as_ref()
            .map(|path| Sink::with(path, table.json())),
    );
    if let Some(path) = &args.plot {
        match table.figure() {
            Some(figure) => sinks.push(Sink::with(path, figure)),
            None => {
                let why = "a figure has one axis or two";
                writeln!(
                    streams.err,
                    "error: {why}\n  help: leave out `--plot`, or some of `--over`"
                )?;
                return Ok(false);
            }
        }
    }
    if !args.to_standard() {
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

    /// Compiles a point.
    fn check(&self, point: &[f64]) -> Result<(), Diagnostics> {
        let (exprs, mut diags) = (Exprs::new(), Diagnostics::new());
        let (file, clock) = (&self.project.file, &mut Clock::default());
        let overrides = self.at(point);
        let compiled = compile(&exprs, file, self.experiment, &overrides, clock, &mut diags);
        match compiled {
            Some(_) if !diags.has_errors() => Ok(()),
            _ => Err(diags),
        }
    }

    /// Runs a point.
    fn row(&self, point: &[f64], columns: &OnceLock<Vec<String>>) -> Row {
        match self.trajectory(point) {
            Ok(run) => {
                columns.get_or_init(|| sweep::columns(&run));
                Row::of(&run)
            }
            Err(diags) => Row::refused(project::error_codes(&diags).into_iter().next()),
        }
    }

    fn trajectory(&self, point: &[f64]) -> Result<Trajectory, Diagnostics> {
        let (exprs, mut diags) = (Exprs::new(), Diagnostics::new());
        let (file, clock) = (&self.project.file, &mut Clock::default());
        let overrides = self.at(point);
        let compiled = compile(&exprs, file, self.experiment, &overrides, clock, &mut diags);
        let Some(mut compiled) = compiled.filter(|_| !diags.has_errors()) else {
            return Err(diags);
        };
        let settings = &mut compiled.settings;
        if settings.optimize.is_none() {
            settings.sampling = Sampling::At(vec![settings.horizon]);
        }
        let mut watching = Watching::new(Bar::new("", false));
        launch(self.project, &mut compiled, &self.request, &mut watching)
    }
}
