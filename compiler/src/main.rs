//! The `nsdc` command line.

use std::io::{self, BufWriter, IsTerminal, Write};
use std::process::ExitCode;

use nsdc::cli::{self, Meter, Streams};
use nsdc::limit::Cancel;

fn main() -> ExitCode {
    let mut err = io::stderr();
    let is_terminal = err.is_terminal();
    let colour = is_terminal && std::env::var_os("NO_COLOR").is_none();
    let mut out = BufWriter::new(io::stdout());
    let mut streams = Streams {
        out: &mut out,
        err: &mut err,
        colour,
        meter: Meter::line(is_terminal),
        cancel: Cancel::default(),
        width: width(),
        files: cli::terminal(),
    };
    let exit = cli::run(std::env::args_os(), &mut streams);
    let _ = err.flush();
    ExitCode::from(exit as u8)
}

/// Columns of the terminal, within what reads well.
fn width() -> usize {
    let columns = std::env::var("COLUMNS")
        .ok()
        .and_then(|columns| columns.parse().ok());
    columns.unwrap_or(100).clamp(60, 120)
}
