//! `nsdc completions`

use std::io;

use clap::CommandFactory;
use clap_complete::{Shell, generate};

use crate::cli::args::Args;
use crate::cli::{Exit, Streams};

/// Prints the script of a shell.
pub fn run(shell: Shell, streams: &mut Streams<'_>) -> io::Result<Exit> {
    // Written at once: what generates the script panics where writing fails.
    let mut script = Vec::new();
    generate(shell, &mut Args::command(), "nsdc", &mut script);
    streams.out.write_all(&script)?;
    Ok(Exit::Success)
}
