//! `nsdc plot`

use std::path::Path;

use crate::cli::args::PlotArgs;
use crate::cli::files::{self, Sink};
use crate::cli::progress::Bar;
use crate::cli::project::{self, Project};
use crate::cli::watch::Watching;
use crate::cli::{Exit, Streams, io};
use crate::compile;
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::limit::Limit;
use crate::model::Units;
use crate::project::clock::Clock;
use crate::project::{ensemble, figure, launch};
use crate::report::plot::overlay::{self, Source};
use crate::report::{Series, Status};
use crate::simulate::Request;
use crate::syntax::{Bind, Experiment};

/// Bytes of a file of data that are taken.
const MAX_BYTES: usize = 1 << 26;

/// Draws several experiments, and what was measured, in one figure.
pub fn run(args: &PlotArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    if let Some(message) = args.targets().misuse() {
        writeln!(streams.err, "error: {message}")?;
        return Ok(Exit::Usage);
    }
    if !files::foresee(args.targets().all(), streams)? {
        return Ok(Exit::Wrong);
    }
    let Some((project, overrides)) = project::open(&args.file, &args.set, streams)? else {
        return Ok(Exit::Wrong);
    };
    let names = match args.experiments.is_empty() {
        true => vec![None],
        false => (args.experiments.iter().map(|name| Some(name.as_str()))).collect(),
    };
    let mut experiments = Vec::new();
    for name in names {
        let Some(mut found) = project::selected(&project, name, streams)? else {
            return Ok(Exit::Wrong);
        };
        experiments.append(&mut found);
    }
    let limit = Limit::from(args.time_limit);
    // Where quantities are asked for, what a `plot` draws is not all that there is.
    let everything = !args.only.is_empty() || !args.data.is_empty();
    let (mut exit, mut sources) = (Exit::Success, Vec::new());
    for experiment in &experiments {
        let asked = (&project, &overrides[..]);
        let Some((found, status)) = curves(asked, experiment, (&limit, everything), streams)?
        else {
            return Ok(Exit::Wrong);
        };
        if status != Status::Solved {
            exit = Exit::Failed;
        }
        sources.extend(found);
    }
    for path in &args.data {
        match measured(path).and_then(|source| belonging(source, &sources)) {
            Ok(source) => sources.push(source),
            Err(message) => {
                writeln!(streams.err, "error: {}: {message}", path.display())?;
                return Ok(Exit::Wrong);
            }
        }
    }
    if let Some(name) = only(&mut sources, &args.only) {
        writeln!(
            streams.err,
            "error: there is no quantity `{name}` in these runs"
        )?;
        return Ok(Exit::Wrong);
    }
    match Sink::with(&args.output, overlay::write(&sources)).finish(streams)? {
        true => Ok(exit),
        false => Ok(Exit::Wrong),
    }
}

/// Keeps these quantities, all where there are none; a name that nothing has.
fn only<'n>(sources: &mut [Source], names: &'n [String]) -> Option<&'n str> {
    if names.is_empty() {
        return None;
    }
    let runs = || sources.iter().filter(|source| !source.is_measured);
    let columns = || runs().flat_map(|source| &source.columns);
    let is_known = |name: &str| columns().any(|(known, _)| is_of(known, name));
    if let Some(unknown) = names.iter().find(|name| !is_known(name)) {
        return Some(unknown);
    }
    for source in sources {
        let is_asked = |name: &str| names.iter().any(|asked| is_of(name, asked));
        source.columns.retain(|(name, _)| is_asked(name));
    }
    None
}

/// Whether `x[2]` is what is asked for, or an entry of it.
fn is_of(name: &str, asked: &str) -> bool {
    let rest = name.strip_prefix(asked);
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('['))
}

/// The curves of an experiment, those of its `plot` alone where not everything is asked for, with the measurements of a fit,
/// and how its run ended; nothing where it does not compile, which has been printed.
fn curves(
    (project, overrides): (&Project, &[Bind]),
    experiment: &Experiment,
    (limit, everything): (&Limit, bool),
    streams: &mut Streams<'_>,
) -> io::Result<Option<(Vec<Source>, Status)>> {
    let (exprs, mut diags, mut clock) = (Exprs::new(), Diagnostics::new(), Clock::default());
    let file = &project.file;
    let compiled = compile(&exprs, file, experiment, overrides, &mut clock, &mut diags);
    project::print(&diags, &project.sources, streams)?;
    let Some(mut compiled) = compiled.filter(|_| !diags.has_errors()) else {
        return Ok(None);
    };
    let request = Request {
        dense: true,
        estimate: false,
        multipliers: false,
        limit: limit.clone(),
    };
    let mut watching = Watching::new(Bar::new(&compiled.settings.name, streams.meter.clone()));
    let source = ensemble::Source {
        file,
        experiment,
        overrides,
    };
    let launched = launch::whole(project, source, &mut compiled, &request, &mut watching);
    drop(watching);
    let trajectory = match launched {
        Ok(trajectory) => trajectory,
        Err(diags) => {
            project::print(&diags, &project.sources, streams)?;
            return Ok(None);
        }
    };
    project::print(&trajectory.diagnostics(), &project.sources, streams)?;
    let fine = match figure::plotted(&compiled, &trajectory) {
        Some(plotted) if !everything => plotted,
        plotted => {
            let mut fine = figure::curves(&compiled, &trajectory);
            let plotted = plotted.into_iter().flat_map(|plotted| plotted.outputs);
            fine.outputs.extend(plotted);
            fine
        }
    };
    let columns = unique(fine.series().flat_map(Series::columns));
    let mut sources = vec![Source {
        name: trajectory.setup.experiment,
        time: fine.time,
        columns,
        units: Units::of(&compiled.model),
        is_measured: false,
    }];
    let data = trajectory.several.fit.into_iter().flat_map(|fit| fit.data);
    sources.extend(data.map(|data| Source {
        name: format!("{} of {}{}", data.column, data.file, data.run()),
        time: data.time,
        columns: vec![(data.quantity, data.measured)],
        units: Units::default(),
        is_measured: true,
    }));
    Ok(Some((sources, trajectory.status)))
}

/// Each quantity once, as a plot may draw it again in a phase portrait.
fn unique(all: impl Iterator<Item = (String, Vec<f64>)>) -> Vec<(String, Vec<f64>)> {
    let mut columns: Vec<(String, Vec<f64>)> = Vec::new();
    for (name, values) in all {
        if !columns.iter().any(|(known, _)| *known == name) {
            columns.push((name, values));
        }
    }
    columns
}

/// What was measured of quantities that runs have; an error where that is nothing.
fn belonging(source: Source, runs: &[Source]) -> Result<Source, String> {
    let known = || {
        runs.iter()
            .flat_map(|run| &run.columns)
            .map(|(name, _)| name)
    };
    let belongs = |(name, _): &(String, Vec<f64>)| known().any(|known| known == name);
    if source.columns.iter().any(belongs) {
        return Ok(source);
    }
    let mut names: Vec<String> = Vec::new();
    for name in known().map(|name| format!("`{name}`")) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    Err(format!(
        "no column has the name of a quantity of these runs: {}",
        names.join(", ")
    ))
}

/// Columns of a file of comma-separated values, of which the first is time; an empty cell was not measured.
fn measured(path: &Path) -> Result<Source, String> {
    let bytes = files::read(path, MAX_BYTES).map_err(|error| error.to_string())?;
    if bytes.len() > MAX_BYTES {
        return Err(format!("it has more than {MAX_BYTES} bytes"));
    }
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(&bytes[..]);
    let names = reader.headers().map_err(|error| error.to_string())?;
    let names: Vec<String> = names.iter().skip(1).map(str::to_owned).collect();
    if names.is_empty() {
        return Err("it has no column besides the first one, which is time".to_owned());
    }
    let mut time = Vec::new();
    let mut values = vec![Vec::new(); names.len()];
    for record in reader.records() {
        let record = record.map_err(|error| error.to_string())?;
        for (k, cell) in record.iter().enumerate() {
            let number = cell.parse().ok().filter(|number: &f64| number.is_finite());
            let number = number.or((k > 0 && cell.is_empty()).then_some(f64::NAN));
            let number = number.ok_or_else(|| {
                let line = record.position().map_or(0, csv::Position::line);
                format!("line {line} has `{cell}`, which is no finite number")
            })?;
            match k.checked_sub(1) {
                None => time.push(number),
                Some(column) => values[column].push(number),
            }
        }
    }
    Ok(Source {
        name: path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        time,
        columns: names.into_iter().zip(values).collect(),
        units: Units::default(),
        is_measured: true,
    })
}
