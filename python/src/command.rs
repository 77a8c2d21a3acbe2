//! The command line, and what belongs to no project.

use std::ffi::OsString;
use std::io::{self, Write};

use nsdc::cli::{self, Meter, Streams};
use nsdc::diagnostics;
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;

use crate::errors::detached;
use crate::interrupt::Interrupt;

/// Runs the command line `args`, the name of the program first: the exit code, and what it has written to standard output
/// and error where that is kept.
#[pyfunction]
#[pyo3(signature = (args, keep, colour, progress, width))]
pub fn main(
    py: Python<'_>,
    args: Vec<OsString>,
    keep: bool,
    colour: bool,
    progress: bool,
    width: usize,
) -> PyResult<(u8, Vec<u8>, Vec<u8>)> {
    let interrupt = Interrupt::new();
    let done = detached(py, || {
        let (mut out, mut err) = (Vec::new(), Vec::new());
        let (mut stdout, mut stderr) = (io::BufWriter::new(io::stdout()), io::stderr());
        let (out_to, err_to): (&mut dyn Write, &mut dyn Write) = match keep {
            true => (&mut out, &mut err),
            false => (&mut stdout, &mut stderr),
        };
        let mut streams = Streams {
            out: out_to,
            err: err_to,
            colour,
            meter: Meter::line(progress),
            cancel: interrupt.cancel.clone(),
            width,
            files: cli::terminal(),
        };
        let exit = cli::run(args, &mut streams);
        (exit as u8, out, err)
    })?;
    interrupt.check()?;
    Ok(done)
}

/// The page of a code, `E0101`.
#[pyfunction]
pub fn explain(code: &str) -> PyResult<String> {
    let page = diagnostics::explain::page(code);
    page.map(str::to_owned)
        .ok_or_else(|| PyKeyError::new_err(format!("there is no code `{code}`")))
}

/// A panic, for the test that one is an exception.
#[pyfunction]
#[pyo3(name = "_panic")]
pub fn panic(py: Python<'_>) -> PyResult<()> {
    detached(py, || panic!("on purpose"))
}
