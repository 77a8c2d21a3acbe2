//! All problems of a folder: a table, and how many are solved.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;

use super::{EXTENSION, name_of, solve};
use crate::cli::args::{Log, SolveArgs};
use crate::cli::files::{Sink, is_standard};
use crate::cli::progress::Bar;
use crate::cli::{Exit, Streams, files, io};
use crate::diagnostics::Diagnostics;
use crate::nl::{self, Known, Record, Settings, Table};
use crate::report::plot::profile;
use crate::source::SourceMap;
use crate::threads;

/// What is known of the problems, beside them.
const KNOWN: &str = "results.csv";

/// Solves all files below a folder and prints the table.
pub fn run(args: &SolveArgs, settings: &Settings, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let paths = match files::find_all(std::slice::from_ref(&args.path), EXTENSION) {
        Ok(paths) => paths,
        Err(error) => {
            error.tell(streams)?;
            return Ok(Exit::Wrong);
        }
    };
    if paths.is_empty() {
        writeln!(
            streams.err,
            "error: there is no .nl file in `{}`",
            args.path.display()
        )?;
        return Ok(Exit::Wrong);
    }
    let known = match known(&paths) {
        Ok(known) => known,
        Err(message) => {
            writeln!(streams.err, "error: {message}")?;
            return Ok(Exit::Wrong);
        }
    };
    let targets = [&args.json, &args.csv, &args.plot].into_iter().flatten();
    let to_standard = targets.clone().any(|target| is_standard(target));
    let prints = args.log > Log::Off && !to_standard;
    let table = solve_all(&paths, &known, args, settings, prints, streams)?;
    if prints {
        write!(streams.out, "\n{}", table.summary())?;
    }
    let mut sinks = Vec::new();
    if let Some(path) = &args.json {
        let reports = table
            .records
            .iter()
            .filter_map(|record| record.result.as_ref().ok());
        let lines: String = reports.map(|report| nl::json(report) + "\n").collect();
        sinks.push(Sink::objects(path, &lines, false));
    }
    if let Some(path) = &args.csv {
        // Cells are names and numbers, which a table always holds.
        sinks.push(Sink::with(path, table.csv().map_err(io::Error::other)?));
    }
    if let Some(path) = &args.plot {
        sinks.push(Sink::with(path, profile::write(&table.times())));
    }
    let is_read = |record: &Record| record.result.is_ok();
    let mut exit = match () {
        () if !table.records.iter().all(is_read) => Exit::Wrong,
        () if table.records.iter().all(Record::is_solved) => Exit::Success,
        () => Exit::Failed,
    };
    for sink in sinks {
        if !sink.finish(streams)? {
            exit = Exit::Wrong;
        }
    }
    Ok(exit)
}

/// What the files `results.csv` beside the problems say, by folder and name.
fn known(paths: &[PathBuf]) -> Result<HashMap<PathBuf, HashMap<String, Known>>, String> {
    let mut known = HashMap::new();
    for folder in paths.iter().filter_map(|path| path.parent()) {
        if known.contains_key(folder) {
            continue;
        }
        let path = folder.join(KNOWN);
        let text = files::read_if_present(&path).map_err(|error| error.to_string())?;
        let entries = text.map_or(Ok(HashMap::new()), |text| nl::read_known(&text));
        let entries =
            entries.map_err(|error| format!("cannot read `{}`: {error}", path.display()))?;
        known.insert(folder.to_owned(), entries);
    }
    Ok(known)
}

/// Solves the files on several threads; rows are printed in the order of the files.
fn solve_all(
    paths: &[PathBuf],
    known: &HashMap<PathBuf, HashMap<String, Known>>,
    args: &SolveArgs,
    settings: &Settings,
    prints: bool,
    streams: &mut Streams<'_>,
) -> io::Result<Table> {
    let n_threads = args.jobs.map_or_else(threads::count, usize::from);
    let n_threads = n_threads.min(paths.len());
    let width = paths
        .iter()
        .map(|path| name_of(path).chars().count())
        .max()
        .unwrap_or(0);
    let mut bar = Bar::new("solve", streams.meter.clone());
    let next = AtomicUsize::new(0);
    let (sender, receiver) = mpsc::channel();
    let mut records: Vec<Option<Record>> = vec![None; paths.len()];
    if prints {
        writeln!(streams.out, "{}", Record::titles(width))?;
    }
    thread::scope(|scope| {
        for _ in 0..n_threads {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(path) = paths.get(index) else {
                        return;
                    };
                    let record = record(path, known, settings);
                    // Nobody listens any more when the output has failed.
                    if sender.send((index, record)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        let (mut n_printed, mut n_done) = (0, 0);
        for (index, record) in &receiver {
            n_done += 1;
            let share = f64::from(n_done) / paths.len() as f64;
            bar.show(share, || {
                format!("{n_done} of {}, {}", paths.len(), record.name)
            });
            records[index] = Some(record);
            while let Some(Some(record)) = records.get(n_printed) {
                n_printed += 1;
                if prints {
                    let printed = writeln!(streams.out, "{}", record.line(width));
                    if let Err(error) = printed.and_then(|()| streams.out.flush()) {
                        // The others end with what they are at.
                        next.store(paths.len(), Ordering::Relaxed);
                        return Err(error);
                    }
                }
            }
        }
        Ok(())
    })?;
    Ok(Table {
        records: records.into_iter().flatten().collect(),
    })
}

/// Solves one file.
fn record(
    path: &Path,
    known: &HashMap<PathBuf, HashMap<String, Known>>,
    settings: &Settings,
) -> Record {
    let name = name_of(path);
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let result = match solve(path, settings, &mut sources, &mut diags, &mut ()) {
        Ok(Some(report)) => Ok(report),
        Ok(None) => {
            let first = diags.iter().next().map(|diagnostic| {
                let code = diagnostic
                    .code()
                    .map_or(String::new(), |code| code.to_string());
                format!("{code} {diagnostic}")
            });
            Err(first.unwrap_or_default())
        }
        Err(error) => Err(error.to_string()),
    };
    let folder = path.parent().and_then(|folder| known.get(folder));
    let known = folder
        .and_then(|entries| entries.get(&name))
        .cloned()
        .unwrap_or_default();
    Record {
        name,
        result,
        known,
    }
}
