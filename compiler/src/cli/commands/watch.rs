//! `nsdc watch`

use std::collections::BTreeMap;
use std::thread;
use std::time::Duration;

use crate::cli::args::WatchArgs;
use crate::cli::files::{Form, Sink, is_standard};
use crate::cli::progress::Bar;
use crate::cli::texts::{Texts, look};
use crate::cli::watch::Watching;
use crate::cli::{Exit, Streams, files, interrupted, io};
use crate::limit::{Cancel, Limit};
use crate::project::Project;
use crate::project::run::{Options, Run};
use crate::report::numbers::{self, difference};

/// Between two looks at the files.
const PAUSE: Duration = Duration::from_millis(150);

/// How far numbers may be from what they were, by the rules of goldens, whatever tolerance an experiment asks for.
const TOLERANCE: f64 = 1e-8;

/// Checks, runs and draws a file whenever it, or what it uses, is written, until the user interrupts it.
pub fn run(args: &WatchArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    if is_standard(&args.file) {
        writeln!(
            streams.err,
            "error: standard input is not written again\n  help: name a file"
        )?;
        return Ok(Exit::Usage);
    }
    if let Some(message) = files::misnamed([(args.plot.as_deref(), Form::Svg)]) {
        writeln!(streams.err, "error: {message}")?;
        return Ok(Exit::Usage);
    }
    let cancel = interrupted();
    let mut known = BTreeMap::new();
    while !cancel.is_canceled() {
        let world = Texts::default();
        once(args, &world, &cancel, &mut known, streams)?;
        streams.out.flush()?;
        // What is written while it is read, or runs, is seen afterwards.
        let seen = world.asked();
        while !cancel.is_canceled() && seen == look(seen.keys()) {
            thread::sleep(PAUSE);
        }
    }
    Ok(Exit::Success)
}

/// One round.
fn once(
    args: &WatchArgs,
    files: &Texts,
    cancel: &Cancel,
    known: &mut BTreeMap<String, String>,
    streams: &mut Streams<'_>,
) -> io::Result<()> {
    let project = match Project::from_files(&args.file, files.clone()) {
        Ok(project) => project,
        Err(error) => {
            return error.tell(streams);
        }
    };
    let found = project.check();
    streams
        .err
        .write_all(found.render(streams.colour, streams.width).as_bytes())?;
    if found.has_errors() {
        return Ok(());
    }
    let selected = match project.select(args.experiment.as_deref()) {
        Ok(selected) => selected,
        Err(error) => {
            writeln!(streams.err, "error: {error}\n  help: {}", error.help)?;
            return Ok(());
        }
    };
    for experiment in &selected {
        let name = &experiment.name.name;
        let options = Options {
            limit: Limit::default().canceled_by(cancel),
            figure: args.plot.is_some(),
            ..Options::default()
        };
        let mut watching = Watching::new(Bar::new(name, streams.meter.clone()));
        let run = project.run(name, &options, &mut watching);
        drop(watching);
        if cancel.is_canceled() {
            break;
        }
        let run = match run {
            Ok(run) => run,
            Err(messages) => {
                streams
                    .err
                    .write_all(messages.render(streams.colour, streams.width).as_bytes())?;
                continue;
            }
        };
        streams.err.write_all(
            run.messages()
                .render(streams.colour, streams.width)
                .as_bytes(),
        )?;
        let numbers = tell(&run, name, known.get(name), streams)?;
        known.insert(name.clone(), numbers);
        if let (Some(path), Some(figure)) = (&args.plot, run.figure) {
            let path = match selected.len() {
                1 => path.clone(),
                _ => files::of_experiment(path, name),
            };
            Sink::with(&path, figure).finish(streams)?;
        }
    }
    Ok(())
}

/// Reports a run, or where it is not the first one what has changed; its numbers.
fn tell(
    run: &Run,
    name: &str,
    before: Option<&String>,
    streams: &mut Streams<'_>,
) -> io::Result<String> {
    let numbers = numbers::renewed(before.map(String::as_str), &run.trajectory, TOLERANCE);
    let Some(before) = before else {
        writeln!(streams.out, "{}", run.text().trim_end())?;
        return Ok(numbers);
    };
    let lines = difference::lines(before, &numbers);
    let what = match lines.is_empty() {
        true => "the same numbers",
        false => "other numbers",
    };
    writeln!(streams.out, "{name}: {what}")?;
    for line in lines {
        writeln!(streams.out, "  {line}")?;
    }
    Ok(numbers)
}
