//! `nsdc check`

use std::path::Path;

use crate::cli::args::CheckArgs;
use crate::cli::files::{FileError, Form, Sink, Terminal, is_standard};
use crate::cli::project::Project;
use crate::cli::{Exit, Streams, files, io, project};
use crate::diagnostics::{self, AnyDiagnostic, Applicability, Diagnostics, Fix, counted, json};
use crate::syntax::Item;

/// A fix may show the next mistake, and a statement tells one at a time; more than this is no repair.
const MOST_ROUNDS: usize = 100;

/// Checks files and prints what is wrong with them.
pub fn run(args: &CheckArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    if let Some(message) = files::misnamed([(args.json.as_deref(), Form::Json)]) {
        writeln!(streams.err, "error: {message}")?;
        return Ok(Exit::Usage);
    }
    if args.fix && args.files.iter().any(|path| is_standard(path)) {
        writeln!(
            streams.err,
            "error: `--fix` changes files, and standard input is none\n  help: name the file"
        )?;
        return Ok(Exit::Usage);
    }
    let mut exit = Exit::Success;
    let mut lines = String::new();
    for path in &args.files {
        let checked = match one(path, args.fix) {
            Ok(checked) => checked,
            Err(error) => {
                error.tell(streams)?;
                exit = Exit::Wrong;
                continue;
            }
        };
        for line in &checked.made {
            writeln!(streams.err, "{line}")?;
        }
        let (diags, sources) = (&checked.diags, &checked.project.sources);
        project::print(diags, sources, streams)?;
        if args.json.is_some() {
            lines.push_str(&json::write(diags, sources, &files::display_name(path)));
        }
        if diags.has_errors() {
            exit = Exit::Wrong;
        } else if !args.json.as_deref().is_some_and(is_standard) {
            let name = files::display_name(path);
            writeln!(streams.out, "{name}: {}", checked.summary())?;
        }
    }
    let json = args.json.as_deref();
    let json = json.map(|path| Sink::objects(path, &lines, false));
    let written = json.map_or(Ok(true), |json| json.finish(streams))?;
    Ok(if written { exit } else { Exit::Wrong })
}

/// A file that has been checked.
struct Checked {
    project: Project,
    diags: Diagnostics,
    /// The fixes that were made before, a line for each.
    made: Vec<String>,
}

impl Checked {
    fn of(project: Project) -> Self {
        let diags = project.checked();
        Checked {
            project,
            diags,
            made: Vec::new(),
        }
    }

    /// What there is in a file without errors.
    fn summary(&self) -> String {
        let items = &self.project.file.items;
        let n_models = items
            .iter()
            .filter(|item| matches!(item, Item::Model(_)))
            .count();
        let n_experiments = self.project.experiments().count();
        let warnings = match self.diags.iter().count() {
            0 => String::new(),
            n => format!(", {}", counted(n, "warning")),
        };
        format!(
            "no errors{warnings} in {} and {}",
            counted(n_models, "model"),
            counted(n_experiments, "experiment")
        )
    }
}

/// Checks a file, where that is asked for after all safe fixes have been made and written.
fn one(path: &Path, fix: bool) -> Result<Checked, FileError> {
    let mut checked = Checked::of(Project::from_files(path, Terminal)?);
    for _ in 0..if fix { MOST_ROUNDS } else { 0 } {
        let Some((text, lines)) = mend(&checked) else {
            break;
        };
        let mut made = std::mem::take(&mut checked.made);
        made.extend(lines);
        checked = Checked::of(Project::of(path, text.into_bytes(), Terminal));
        checked.made = made;
    }
    if let (false, Some(file)) = (
        checked.made.is_empty(),
        checked.project.sources.files().first(),
    ) {
        files::write(path, &file.text)?;
    }
    Ok(checked)
}

/// The file with its safe fixes, and what they do; files that it imports stay as they are, and so does what the
/// file expects to be wrong.
fn mend(checked: &Checked) -> Option<(String, Vec<String>)> {
    let file = checked.project.sources.files().first()?;
    let is_safe = |fix: &Fix| fix.applicability == Applicability::Safe;
    let expected = |code: &str| {
        checked.project.file.items.iter().any(
            |item| matches!(item, Item::ExpectDiagnostic(expected) if expected.code.name == code),
        )
    };
    let is_meant = |diagnostic: &&AnyDiagnostic| {
        diagnostic
            .code()
            .is_some_and(|code| expected(&code.to_string()))
    };
    let found = checked.diags.iter().filter(|found| !is_meant(found));
    let found = found.filter_map(|diagnostic| diagnostic.fix());
    let (text, made) = diagnostics::apply(file, found.filter(is_safe).collect());
    let line = |fix: &Fix| {
        let at = fix.edits.first().map_or(0, |edit| edit.span.start);
        let (line, column) = file.line_column(at);
        let title = fix.title.replace(char::is_control, " ");
        format!("fixed {}:{line}:{column}: {title}", file.name)
    };
    (!made.is_empty()).then(|| (text, made.iter().map(line).collect()))
}
