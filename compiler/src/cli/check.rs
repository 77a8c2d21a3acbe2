//! `nsdc check`

use std::path::PathBuf;

use super::files::Terminal;
use super::project::{self, Project};
use super::{Exit, Streams, io};

/// Checks files and prints what is wrong with them.
pub fn run(files: &[PathBuf], streams: &mut Streams<'_>) -> io::Result<Exit> {
    let mut exit = Exit::Success;
    for path in files {
        match Project::from_files(path, Terminal) {
            Ok(project) => {
                let diags = project.checked();
                project::print(&diags, &project.sources, streams)?;
                if diags.has_errors() {
                    exit = Exit::Wrong;
                }
            }
            Err(error) => {
                writeln!(streams.err, "error: {error}")?;
                exit = Exit::Wrong;
            }
        }
    }
    Ok(exit)
}
