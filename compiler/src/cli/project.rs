//! What commands print about a file that has been read, and its experiments.

use std::path::Path;
use std::sync::Arc;

use super::args::SettingArgs;
use super::{Streams, io};
use crate::diagnostics::{self, Diagnostics};
pub use crate::project::Project;
use crate::source::SourceMap;
use crate::syntax::{Bind, Experiment};

/// Reads and parses a file and the values that `--set` gives; nothing after an error, which has
/// been printed.
pub fn open(
    path: &Path,
    sets: &[String],
    streams: &mut Streams<'_>,
) -> io::Result<Option<(Project, Vec<Bind>)>> {
    let mut project = match Project::from_files(path, Arc::clone(&streams.files)) {
        Ok(project) => project,
        Err(error) => {
            error.tell(streams)?;
            return Ok(None);
        }
    };
    let overrides = project.bindings("--set", sets);
    let overrides = overrides.filter(|_| !project.diags.has_errors());
    if overrides.is_none() {
        print(&project.diags, &project.sources, streams)?;
    }
    Ok(overrides.map(|overrides| (project, overrides)))
}

/// The experiment of that name, or the only one, for a command that takes one; nothing where there is none or several,
/// which has been printed.
pub fn selected_one(
    project: &Project,
    name: Option<&str>,
    command: &str,
    streams: &mut Streams<'_>,
) -> io::Result<Option<Experiment>> {
    let mut experiments = selected(project, name, streams)?.unwrap_or_default();
    if experiments.len() > 1 {
        let names = experiments.iter().map(|e| format!("`{}`", e.name.name));
        let names = names.collect::<Vec<_>>().join(", ");
        writeln!(
            streams.err,
            "error: `nsdc {command}` takes one experiment\n  help: name one of {names}"
        )?;
        return Ok(None);
    }
    Ok(experiments.pop())
}

/// The experiment of that name, or all of them; nothing where there are none, which has been
/// printed.
pub fn selected(
    project: &Project,
    name: Option<&str>,
    streams: &mut Streams<'_>,
) -> io::Result<Option<Vec<Experiment>>> {
    match project.select(name) {
        Ok(experiments) => Ok(Some(experiments)),
        Err(error) => {
            writeln!(streams.err, "error: {error}\n  help: {}", error.help)?;
            Ok(None)
        }
    }
}

/// Gives the experiments the settings of a command line; false after an error, which has been printed.
pub fn replace_settings(
    project: &mut Project,
    experiments: &mut [Experiment],
    settings: &SettingArgs,
    streams: &mut Streams<'_>,
) -> io::Result<bool> {
    for (option, words) in settings.words() {
        for experiment in &mut *experiments {
            let replaced = project.replace_setting(experiment, option, &words);
            if replaced.is_none() {
                print(&project.diags, &project.sources, streams)?;
                return Ok(false);
            }
        }
    }
    Ok(true)
}

/// Prints diagnostics.
pub fn print(
    diags: &Diagnostics,
    sources: &SourceMap,
    streams: &mut Streams<'_>,
) -> io::Result<()> {
    let text = diagnostics::render(diags, sources, streams.colour, streams.width);
    streams.err.write_all(text.as_bytes())
}
