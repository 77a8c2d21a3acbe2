//! `nsdc test`

mod case;
mod file;
mod goldens;
mod json;
mod junit;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;

use self::case::{Case, Missed, Outcome};
use self::file::{Options, Tested};
use crate::cli::args::TestArgs;
use crate::cli::files::{Form, Sink, is_standard};
use crate::cli::progress::Bar;
use crate::cli::{Exit, STACK, Streams, files, io};
use crate::diagnostics::counted;
use crate::threads;

/// Runs every expectation of files and folders.
pub fn run(args: &TestArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let to_standard = |path: &Option<PathBuf>| path.as_deref().is_some_and(is_standard);
    let n_to_standard = [&args.json, &args.junit]
        .into_iter()
        .filter(|path| to_standard(path))
        .count();
    let misuse = match (n_to_standard, args.accept) {
        (2, _) => Some("only one of `--json`, `--junit` can write to standard output".to_owned()),
        (1, true) => Some("`--accept` shows what it writes: let results go to a file".to_owned()),
        _ => files::misnamed([
            (args.json.as_deref(), Form::Json),
            (args.junit.as_deref(), Form::Xml),
        ]),
    };
    if let Some(misuse) = misuse {
        writeln!(streams.err, "error: {misuse}")?;
        return Ok(Exit::Usage);
    }
    let results = [args.json.as_deref(), args.junit.as_deref()];
    if !files::foresee(results.into_iter().flatten(), streams)? {
        return Ok(Exit::Wrong);
    }
    let paths = match files::find(&args.paths) {
        Ok(paths) => paths,
        Err(error) => {
            error.tell(streams)?;
            return Ok(Exit::Wrong);
        }
    };
    if paths.is_empty() {
        let folders = args.paths.iter().map(|path| path.display().to_string());
        let folders: Vec<String> = folders.collect();
        writeln!(
            streams.err,
            "error: there is no .nsd file below {}",
            folders.join(", ")
        )?;
        return Ok(Exit::Wrong);
    }
    let mut tally = Tally {
        reports: n_to_standard == 0,
        ..Tally::default()
    };
    all(&paths, args, &mut tally, streams)?;
    if let Some(filter) = args.filter.as_ref().filter(|_| tally.cases.is_empty()) {
        writeln!(
            streams.err,
            "error: no test of {} has `{filter}` in its name\n  \
             help: names are those that `nsdc test` prints, `{}: EXPERIMENT`",
            counted(paths.len(), "file"),
            files::display_name(&paths[0])
        )?;
        return Ok(Exit::Usage);
    }
    tally.finish(args, streams)
}

/// Tests files on several threads; what came of them is told in the order of the files.
fn all(
    paths: &[PathBuf],
    args: &TestArgs,
    tally: &mut Tally,
    streams: &mut Streams<'_>,
) -> io::Result<()> {
    let n_threads = args.jobs.map_or_else(threads::count, usize::from);
    let n_threads = n_threads.min(paths.len());
    let cancel = streams.cancel.clone();
    let options = Options {
        accept: args.accept,
        filter: args.filter.as_deref(),
        experiment: args.experiment.as_deref(),
        time_limit: args.time_limit,
        cancel: &cancel,
        // One line at a time.
        meter: streams.meter.only_if(n_threads == 1),
        colour: streams.colour,
        width: streams.width,
        files: Arc::clone(&streams.files),
    };
    let mut bar = Bar::new("tests", streams.meter.only_if(n_threads > 1));
    let next = AtomicUsize::new(0);
    let work = |found: mpsc::Sender<(usize, Tested)>| {
        while let number = next.fetch_add(1, Ordering::Relaxed)
            && let Some(path) = paths.get(number)
        {
            if found.send((number, file::test(path, &options))).is_err() {
                return;
            }
        }
    };
    thread::scope(|scope| {
        let (sender, found) = mpsc::channel();
        for _ in 0..n_threads {
            let sender = sender.clone();
            let thread = thread::Builder::new().stack_size(STACK);
            thread.spawn_scoped(scope, || work(sender))?;
        }
        drop(sender);
        let mut waiting = BTreeMap::new();
        let (mut due, mut done) = (0, 0);
        for (number, tested) in found {
            done += 1;
            bar.show(done as f64 / paths.len() as f64, || {
                format!("{done} of {} files", paths.len())
            });
            waiting.insert(number, tested);
            while let Some(tested) = waiting.remove(&due) {
                if let Err(error) = tally.file(tested, streams) {
                    // Nobody listens any more.
                    next.store(paths.len(), Ordering::Relaxed);
                    return Err(error);
                }
                due += 1;
            }
        }
        Ok(())
    })
}

/// What has come of all tests so far.
#[derive(Default)]
struct Tally {
    cases: Vec<Case>,
    left_out: usize,
    /// Whether results are told on standard output.
    reports: bool,
}

impl Tally {
    /// Tells what came of a file, writes what was accepted, and counts.
    fn file(&mut self, tested: Tested, streams: &mut Streams<'_>) -> io::Result<()> {
        streams.err.write_all(tested.diagnostics.as_bytes())?;
        self.left_out += tested.left_out;
        for mut case in tested.cases {
            self.line(streams, &case.line())?;
            for line in case.outcome.lines() {
                self.line(streams, &format!("          {line}"))?;
            }
            // What changes is seen before it is written.
            for change in std::mem::take(&mut case.changes) {
                for line in change.lines() {
                    self.line(streams, &format!("          {line}"))?;
                }
                match change.write() {
                    Ok(done) => self.line(streams, &format!("          {done}"))?,
                    Err(error) => {
                        self.line(streams, &format!("          error: {error}"))?;
                        case.outcome =
                            Outcome::failed(Missed::plain(error.to_string()), Exit::Wrong);
                    }
                }
            }
            self.cases.push(case);
        }
        // A long run shows where it is.
        streams.out.flush()
    }

    fn line(&self, streams: &mut Streams<'_>, text: &str) -> io::Result<()> {
        match self.reports {
            true => writeln!(streams.out, "{text}"),
            false => Ok(()),
        }
    }

    /// The summary, and the files that are asked for.
    fn finish(&self, args: &TestArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
        let count = |is: fn(&Outcome) -> bool| {
            let cases = self.cases.iter();
            cases.filter(|case| is(&case.outcome)).count()
        };
        let passed = count(|outcome| matches!(outcome, Outcome::Passed(_)));
        let failed = count(|outcome| matches!(outcome, Outcome::Failed { .. }));
        let unsupported = count(|outcome| matches!(outcome, Outcome::Unsupported(_)));
        let left_out = match self.left_out {
            0 => String::new(),
            left_out => format!(", {left_out} left out"),
        };
        self.line(
            streams,
            &format!(
                "\n{passed} passed, {failed} failed, {unsupported} not yet supported{left_out}"
            ),
        )?;
        let exits = self.cases.iter().map(|case| case.outcome.exit());
        let mut exit = exits.max().unwrap_or(Exit::Success);
        let (json, junit) = (args.json.as_deref(), args.junit.as_deref());
        let sinks = [
            json.map(|path| Sink::objects(path, &json::write(&self.cases), false)),
            junit.map(|path| Sink::with(path, junit::write(&self.cases))),
        ];
        for sink in sinks.into_iter().flatten() {
            if !sink.finish(streams)? {
                exit = exit.max(Exit::Wrong);
            }
        }
        Ok(exit)
    }
}
