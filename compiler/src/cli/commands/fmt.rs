//! `nsdc fmt`

use std::path::{Path, PathBuf};

use crate::cli::files::is_standard;
use crate::cli::{Exit, Streams, files, io, project};
use crate::diagnostics::Diagnostics;
use crate::source::SourceMap;
use crate::syntax;

/// Lays files out in the standard way, or says which are not.
pub fn run(paths: &[PathBuf], check: bool, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let paths = match files::find(paths) {
        Ok(paths) => paths,
        Err(error) => {
            error.tell(streams)?;
            return Ok(Exit::Wrong);
        }
    };
    let mut exit = Exit::Success;
    for path in &paths {
        exit = exit.max(one(path, check, streams)?);
    }
    Ok(exit)
}

fn one(path: &Path, check: bool, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let bytes = match files::read(path, syntax::MAX_BYTES) {
        Ok(bytes) => bytes,
        Err(error) => {
            error.tell(streams)?;
            return Ok(Exit::Wrong);
        }
    };
    let mut sources = SourceMap::new();
    let mut diags = Diagnostics::new();
    let source = sources.add_bytes(files::display_name(path), bytes);
    // A file that does not parse is left as it is.
    let Some(formatted) = syntax::format(&source, &mut diags) else {
        project::print(&diags, &sources, streams)?;
        return Ok(Exit::Wrong);
    };
    let is_same = formatted == source.text;
    if check {
        if !is_same {
            writeln!(streams.out, "{}", files::display_name(path))?;
            return Ok(Exit::Wrong);
        }
    } else if is_standard(path) {
        streams.out.write_all(formatted.as_bytes())?;
    } else if !is_same && let Err(error) = files::write(path, &formatted) {
        error.tell(streams)?;
        return Ok(Exit::Wrong);
    }
    Ok(Exit::Success)
}
