//! The command line: arguments, files and what is printed where.
//!
//! Results go to standard output, everything else to standard error. Nothing
//! but this folder and `main.rs` writes or prints.

#![allow(
    clippy::disallowed_methods,
    reason = "a command has a clock, threads and an end of its own"
)]

mod args;
pub mod commands;
mod files;
mod iterations;
pub mod lsp;
mod progress;
mod project;
mod texts;
mod watch;

pub use self::progress::Meter;

use std::ffi::OsString;
use std::io::{self, Write};
use std::sync::Arc;

use clap::{ColorChoice, Parser};

use self::args::{Args, Command};
use crate::limit::Cancel;
use crate::source::files::Files;

/// How a command ended; the number is the exit status.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Exit {
    /// All well.
    Success = 0,
    /// The model or the input is wrong.
    Wrong = 1,
    /// The numerics failed, or an expectation was missed.
    Failed = 2,
    /// Wrong usage of the command line.
    Usage = 64,
}

/// Where a command prints.
pub struct Streams<'a> {
    /// Results.
    pub out: &'a mut dyn Write,
    /// Diagnostics.
    pub err: &'a mut dyn Write,
    /// Whether diagnostics are coloured.
    pub colour: bool,
    /// Where it is shown how far long runs are.
    pub meter: Meter,
    /// Ends `emit`, `test` and `verify` from elsewhere, as a client of the language server does.
    pub cancel: Cancel,
    /// Columns of the terminal.
    pub width: usize,
    /// Where models come from, and what they use.
    pub files: Arc<dyn Files>,
}

/// Of a thread that runs experiments, in bytes: as much as the main thread has.
const STACK: usize = 8 << 20;

/// The files of this machine, and standard input for `-`.
pub fn terminal() -> Arc<dyn Files> {
    Arc::new(files::Terminal)
}

/// Runs the command line `args`, the name of the program first.
///
/// A reader of the output that stops reading is no mistake of ours.
pub fn run(args: impl IntoIterator<Item = OsString>, streams: &mut Streams<'_>) -> Exit {
    let result =
        match Args::try_parse_from(commands::solve::without_ampl(args.into_iter().collect())) {
            Ok(args) => dispatch(args, streams),
            Err(error) => usage(&error, streams),
        };
    let flushed = streams.out.flush();
    match (result, flushed) {
        (Ok(exit), Ok(())) => exit,
        (Ok(exit), Err(error)) if error.kind() == io::ErrorKind::BrokenPipe => exit,
        (Err(error), _) if error.kind() == io::ErrorKind::BrokenPipe => Exit::Success,
        (Err(error), _) | (_, Err(error)) => {
            let _ = writeln!(streams.err, "error: cannot write the result: {error}");
            Exit::Wrong
        }
    }
}

fn dispatch(args: Args, streams: &mut Streams<'_>) -> io::Result<Exit> {
    streams.colour = match args.color {
        ColorChoice::Auto => streams.colour,
        ColorChoice::Always => true,
        ColorChoice::Never => false,
    };
    match args.command {
        Command::Check(args) => commands::check::run(&args, streams),
        Command::Emit(args) => commands::emit::run(&args, streams),
        Command::Run(args) => commands::run::run(&args, streams),
        Command::Test(args) => commands::test::run(&args, streams),
        Command::Verify(args) => commands::verify::run(&args, streams),
        Command::Modes(args) => commands::modes::run(&args, streams),
        Command::Order(args) => commands::order::run(&args, streams),
        Command::Plot(args) => commands::plot::run(&args, streams),
        Command::Solve(args) => commands::solve::run(&args, streams),
        Command::Sweep(args) => commands::sweep::run(&args, streams),
        Command::Lsp => lsp::run(streams),
        Command::Watch(args) => commands::watch::run(&args, streams),
        Command::Fmt { files, check } => commands::fmt::run(&files, check, streams),
        Command::New { path } => commands::new::run(&path, streams),
        Command::Explain { code } => commands::explain::run(code.as_deref(), streams),
        Command::Completions { shell } => commands::completions::run(shell, streams),
    }
}

/// Canceled once the user has interrupted the program: no run is begun or goes on. The second time ends the program.
fn interrupted() -> Cancel {
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

/// Help is a result; anything else that clap says is a wrong usage.
fn usage(error: &clap::Error, streams: &mut Streams<'_>) -> io::Result<Exit> {
    use clap::error::ErrorKind::{DisplayHelp, DisplayVersion};
    let text = error.render();
    match error.kind() {
        DisplayHelp | DisplayVersion => {
            write!(streams.out, "{text}")?;
            Ok(Exit::Success)
        }
        _ => {
            write!(streams.err, "{text}")?;
            Ok(Exit::Usage)
        }
    }
}
