//! Golden files of an experiment: what is in them, and what is to be written.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::Compiled;
use crate::cli::files::{self, FileError};
use crate::project::golden;
use crate::project::golden::Golden;
use crate::report::expect::{Comparison, Difference, Findings};
use crate::report::{Trajectory, numbers};
use crate::syntax::Expect;

/// A golden file that is to be written anew, or taken away.
pub struct Change {
    path: PathBuf,
    /// The new text; none where nothing asks for the file.
    text: Option<String>,
    difference: Vec<String>,
}

impl Change {
    /// The file.
    pub fn name(&self) -> String {
        files::display_name(&self.path)
    }

    /// What a reader sees before it is done.
    pub fn lines(&self) -> Vec<String> {
        let inner = self.difference.iter().map(|line| format!("  {line}"));
        [self.name()].into_iter().chain(inner).collect()
    }

    /// Does it, and says what was done.
    pub fn write(&self) -> Result<String, FileError> {
        let name = self.name();
        match &self.text {
            Some(text) => {
                files::write_in_folder(&self.path, text)?;
                Ok(format!("wrote {name}"))
            }
            None => {
                files::remove(&self.path)?;
                Ok(format!("removed {name}"))
            }
        }
    }
}

/// What an experiment has been compared with.
#[derive(Default)]
pub struct Compared {
    /// All files, by their paths.
    pub paths: Vec<PathBuf>,
    /// Those that are to be written.
    pub changes: Vec<Change>,
}

/// Whether an experiment asks for golden files.
pub fn is_asked_for(experiment: &Compiled<'_>) -> bool {
    asks(experiment, &Expect::LoweringGolden) || asks(experiment, &Expect::NumbersGolden)
}

fn asks(compiled: &Compiled<'_>, wanted: &Expect) -> bool {
    let mut expects = compiled.settings.expects.iter();
    expects.any(|(expect, _)| expect == wanted)
}

/// The forms of an experiment beside its golden files.
pub fn forms(model: &Path, compiled: &Compiled<'_>) -> Vec<Golden> {
    match asks(compiled, &Expect::LoweringGolden) {
        true => golden::forms(model, compiled),
        false => Vec::new(),
    }
}

/// Reads the golden files, and says what is in them and what should be. Where they are accepted, what should be takes
/// the place of what is in them.
pub fn compare(
    model: &Path,
    compiled: &Compiled<'_>,
    forms: Vec<Golden>,
    trajectory: &Trajectory,
    accept: bool,
    findings: &mut Findings,
) -> Result<Compared, FileError> {
    let mut compared = Compared::default();
    for Golden { path, text } in forms {
        let kept = files::read_if_present(&path)?;
        let comparison = compared.add(path, kept, text, accept);
        findings.lowering.push(comparison);
    }
    if asks(compiled, &Expect::NumbersGolden) {
        let settings = &compiled.settings;
        let path = golden::numbers(model, &settings.name);
        let kept = files::read_if_present(&path)?;
        let now = numbers::renewed(kept.as_deref(), trajectory, settings.numerics.tolerance);
        let comparison = compared.add(path, kept, now, accept);
        findings.numbers.push(comparison);
    }
    Ok(compared)
}

impl Compared {
    fn add(
        &mut self,
        path: PathBuf,
        golden: Option<String>,
        now: String,
        accept: bool,
    ) -> Comparison {
        let mut comparison = Comparison {
            name: files::display_name(&path),
            golden,
            now,
        };
        if let Some(Difference { lines, .. }) = comparison.difference().filter(|_| accept) {
            self.changes.push(Change {
                path: path.clone(),
                text: Some(comparison.now.clone()),
                difference: lines,
            });
            comparison.golden = Some(comparison.now.clone());
        }
        self.paths.push(path);
        comparison
    }
}

/// Golden files of a model that no experiment asks for.
pub fn left_over(model: &Path, known: &[PathBuf]) -> Result<Vec<Change>, FileError> {
    let folder = golden::folder(model);
    let known: BTreeSet<&PathBuf> = known.iter().collect();
    let is_golden = |path: &PathBuf| {
        let extension = path.extension().and_then(|extension| extension.to_str());
        extension.is_some_and(|extension| golden::EXTENSIONS.contains(&extension))
    };
    let files = files::list_if_present(&folder)?;
    let files = files.into_iter().filter(is_golden);
    let files = files.filter(|path| !known.contains(path));
    Ok(files
        .map(|path| Change {
            path,
            text: None,
            difference: vec!["no experiment asks for it".to_owned()],
        })
        .collect())
}
