//! `nsdc sweep`

use crate::cli::args::SweepArgs;
use crate::cli::files;
use crate::cli::files::Sink;
use crate::cli::progress::{Bar, Meter};
use crate::cli::project;
use crate::cli::{Exit, Streams, interrupted, io};
use crate::diagnostics::Diagnostics;
use crate::project::sweep::{Rows, Sweep, examples};
use crate::report::Status;
#[cfg(feature = "parquet")]
use crate::source::files::{FileError, WRITE};
use crate::study::sweep::{Axis, Grid, Row, SweepError, Table};
use crate::threads;

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
    let Some(experiment) = experiment else {
        return Ok(Exit::Wrong);
    };
    let name = experiment.name.name.clone();
    let Some(axes) = project.bindings("--over", &examples(&grid)) else {
        project::print(&project.diags, &project.sources, streams)?;
        return Ok(Exit::Wrong);
    };
    let sweep = match Sweep::new(&project, experiment, (overrides, axes), grid) {
        Ok(sweep) => sweep.within(args.time_limit).canceled_by(&interrupted()),
        Err(diags) => {
            project::print(&diags, &project.sources, streams)?;
            return Ok(Exit::Wrong);
        }
    };
    let found = rows(&sweep, args, &streams.meter, &name);
    // What is wrong with all points is told once, with its place.
    if let Some(messages) = sweep.refused(&found) {
        let text = messages.render(streams.colour, streams.width);
        streams.err.write_all(text.as_bytes())?;
        return Ok(Exit::Wrong);
    }
    let table = sweep.table(&found);
    let is_solved = |row: &Option<Row>| {
        let status = row.as_ref().and_then(|row| row.status);
        status == Some(Status::Solved)
    };
    let all_solved = found.rows.iter().all(is_solved);
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

/// All rows, with a bar that shows how many there are.
fn rows(sweep: &Sweep<'_>, args: &SweepArgs, meter: &Meter, name: &str) -> Rows {
    let (mut bar, count) = (Bar::new(name, meter.clone()), sweep.grid().len());
    let jobs = args.jobs.map_or_else(threads::count, usize::from);
    sweep.rows(0..count, jobs, &mut |done| {
        let share = done as f64 / count as f64;
        bar.show(share, || format!("{done} of {count} runs"));
    })
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
