//! A file that has been read and parsed, and its experiments.

pub mod clock;
pub mod describe;
pub mod ensemble;
#[cfg(feature = "plots")]
pub mod figure;
pub mod golden;
pub mod launch;
pub mod prepared;
pub(crate) mod rerun;
mod reruns;
pub mod run;
pub(crate) mod sensed;
pub mod session;
pub mod sweep;
pub mod watch;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::Diagnostic;

use crate::diagnostics::messages::Messages;
use crate::diagnostics::{Diagnostics, Fixable};
use crate::model::index::Index;
use crate::project::clock::Clock;
use crate::source::files::{Disk, FileError, Files, Imports, Memory};
use crate::source::{SourceMap, imports};
use crate::syntax::{self, Bind, Experiment, ExperimentSetting, File, Item, SettingKind};

/// A file that has been read and parsed.
pub struct Project {
    /// Where it came from.
    pub(crate) path: PathBuf,
    /// Where other files come from, such as guesses.
    pub(crate) files: Arc<dyn Files>,
    /// All texts.
    pub(crate) sources: SourceMap,
    /// Its syntax.
    pub(crate) file: File,
    /// What is wrong with the file as a whole.
    pub(crate) diags: Diagnostics,
    /// Time spent so far.
    pub(crate) clock: Clock,
}

/// Why no experiment is meant.
#[derive(Clone, Debug, Diagnostic, thiserror::Error)]
#[error("{message}")]
#[diagnostic(help("{help}"))]
pub struct NotSelected {
    /// What is asked for.
    pub message: String,
    /// What there is.
    pub help: String,
}

impl Fixable for NotSelected {}

impl Project {
    /// Reads and parses a file of a disk, and what it uses.
    ///
    /// ```no_run
    /// let project = nsdc::Project::load("examples/bouncing_ball.nsd")?;
    /// # Ok::<(), nsdc::files::FileError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Where the file itself cannot be read. What is wrong in it comes with [`Project::check`].
    pub fn load(path: impl AsRef<Path>) -> Result<Project, FileError> {
        Project::from_files(path, Disk)
    }

    /// Parses a text, which has this name in diagnostics and uses no other files but those of the standard library.
    ///
    /// ```
    /// let project = nsdc::Project::from_text("rest.nsd", "model rest { state x = 1; x' = 0; }");
    /// assert!(project.check().is_empty());
    /// ```
    pub fn from_text(name: &str, text: &str) -> Project {
        let files: Memory = [(name, text)].into_iter().collect();
        Project::from_files(name, files).expect("the text is there")
    }

    /// Reads and parses a file, and what it uses, wherever files come from.
    ///
    /// ```
    /// use nsdc::Project;
    /// use nsdc::files::Memory;
    ///
    /// let files: Memory = [
    ///     ("main.nsd", "use ./parts/decay.{decay}; simulate s of decay { horizon 1; }"),
    ///     ("parts/decay.nsd", "model decay { state x = 1; x' = -x; }"),
    /// ].into_iter().collect();
    /// let project = Project::from_files("main.nsd", files)?;
    /// assert!(project.check().is_empty());
    /// # Ok::<(), nsdc::files::FileError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Where the file itself cannot be read.
    pub fn from_files(
        path: impl AsRef<Path>,
        files: impl Files + 'static,
    ) -> Result<Project, FileError> {
        let (path, mut clock) = (path.as_ref(), Clock::default());
        let bytes = clock.time("read", || files.read(path, syntax::MAX_BYTES))?;
        Ok(Project::parsed(path, bytes, files, clock))
    }

    /// Parses a file as if it held these bytes, as an editor has it that has not written them yet.
    pub fn of(path: &Path, bytes: Vec<u8>, files: impl Files + 'static) -> Project {
        Project::parsed(path, bytes, files, Clock::default())
    }

    fn parsed(
        path: &Path,
        bytes: Vec<u8>,
        files: impl Files + 'static,
        mut clock: Clock,
    ) -> Project {
        let mut sources = SourceMap::new();
        let mut diags = Diagnostics::new();
        let source = sources.add_bytes(files.name(path), bytes);
        let mut file = clock.time("parse", || syntax::parse(&source, &mut diags));
        let mut imports = Imports::new(&files);
        let key = imports.key(path);
        clock.time("parse", || {
            imports::link(&mut file, &key, &mut imports, &mut sources, &mut diags);
        });
        Project {
            path: path.to_owned(),
            files: Arc::new(files),
            sources,
            file,
            diags,
            clock,
        }
    }

    /// What is wrong with the file, its models and its experiments, without a run.
    ///
    /// ```
    /// use nsdc::Project;
    ///
    /// let project = Project::from_text("fall.nsd", "model fall { state v = 0; v' = -g; }");
    /// let found = project.check();
    /// assert!(found.has_errors());
    /// let message = &found.list()[0];
    /// assert_eq!(message.text, "unknown name `g`");
    /// assert_eq!(message.code.as_deref(), Some("E0101"));
    /// let place = &message.labels[0].place;
    /// assert_eq!((place.file.as_str(), place.line, place.column), ("fall.nsd", 1, 33));
    /// ```
    pub fn check(&self) -> Messages {
        Messages::new(self.checked(), self.sources.clone())
    }

    /// The same, as diagnostics.
    pub(crate) fn checked(&self) -> Diagnostics {
        let mut diags = self.diags.clone();
        crate::check(&self.file, &self.sources, &mut diags);
        diags
    }

    /// Where names are declared, and where they stand, of the file and of what it uses, whatever is wrong with them.
    ///
    /// ```
    /// use nsdc::model::index::Kind;
    ///
    /// let project = nsdc::Project::from_text("fall.nsd", "model fall { state v = 0; v' = -9.81; }");
    /// let index = project.index();
    /// let found = index.at(26).expect("`v'` stands there");
    /// let v = index.definition(found.declared).expect("it is declared");
    /// assert_eq!((v.kind, v.name.as_str(), index.places(v.place).count()), (Kind::State, "v", 2));
    /// ```
    pub fn index(&self) -> Index {
        Index::new(&self.file)
    }

    /// What the file consists of, in order.
    pub fn items(&self) -> impl Iterator<Item = &Item> {
        self.file.items.iter()
    }

    /// All experiments, in order.
    ///
    /// ```
    /// let project = nsdc::Project::from_text("rest.nsd", "
    ///     model rest { state x = 1; x' = 0; }
    ///     simulate short of rest { horizon 1; }
    ///     simulate long of rest { horizon 100; }");
    /// let names = project.experiments().map(|experiment| experiment.name.name.as_str());
    /// assert!(names.eq(["short", "long"]));
    /// ```
    pub fn experiments(&self) -> impl Iterator<Item = &Experiment> {
        self.file.items.iter().filter_map(|item| match item {
            Item::Experiment(experiment) => Some(experiment),
            _ => None,
        })
    }

    /// The experiment of that name; what is wrong where there is none.
    pub(crate) fn named(&self, name: &str) -> Result<&Experiment, NotSelected> {
        let mut all = self.experiments();
        if let Some(found) = all.find(|experiment| experiment.name.name == name) {
            return Ok(found);
        }
        let shown = self.files.name(&self.path);
        let names = self.experiments().map(|known| known.name.name.as_str());
        let names: Vec<&str> = names.collect();
        let distance = |known: &&&str| strsim::damerau_levenshtein(known, name);
        let close = names
            .iter()
            .min_by_key(distance)
            .filter(|known| distance(known) <= 1 + name.len() / 3);
        let help = match close {
            Some(known) => format!("did you mean `{known}`?"),
            None if names.is_empty() => "the file has none".into(),
            None => format!(
                "the file has {}",
                names
                    .iter()
                    .map(|name| format!("`{name}`"))
                    .collect::<Vec<_>>()
                    .join(", ")
            ),
        };
        Err(NotSelected {
            message: format!("there is no experiment `{name}` in `{shown}`"),
            help,
        })
    }

    /// Seconds from the text to something that can be run, where `clock` has what came after the file was read.
    pub(crate) fn compile_seconds(&self, clock: &Clock) -> f64 {
        let solving = ["read", "solve", "report"];
        let phases = self.clock.phases().chain(clock.phases());
        let compiling = phases.filter(|(phase, _)| !solving.contains(phase));
        compiling.map(|(_, seconds)| seconds).sum()
    }
}

#[cfg(feature = "cli")]
impl Project {
    /// The experiment of that name, or all of them; what is wrong where there are none.
    pub(crate) fn select(&self, name: Option<&str>) -> Result<Vec<Experiment>, NotSelected> {
        if let Some(name) = name {
            return Ok(vec![self.named(name)?.clone()]);
        }
        let all: Vec<Experiment> = self.experiments().cloned().collect();
        let shown = self.files.name(&self.path);
        match all.is_empty() {
            true => Err(NotSelected {
                message: format!("`{shown}` has no experiment"),
                help: "add `simulate NAME of MODEL { horizon 1; }`".to_owned(),
            }),
            false => Ok(all),
        }
    }

    /// An experiment of a model without settings of its own.
    pub(crate) fn default_experiment(&mut self, model: &str) -> Option<Experiment> {
        let text = format!("simulate {model} of {model} {{ horizon 1; }}");
        let source = self.sources.add("<default experiment>", text);
        let file = syntax::parse(&source, &mut self.diags);
        file.items.into_iter().find_map(|item| match item {
            Item::Experiment(experiment) => Some(experiment),
            _ => None,
        })
    }

    /// Values given on the command line as `name=value`.
    pub(crate) fn bindings(&mut self, option: &str, sets: &[String]) -> Option<Vec<Bind>> {
        bindings((&mut self.sources, &mut self.diags), option, sets)
    }

    /// Replaces the setting of an experiment that a user gives anew in the words of an option, such as `method event`.
    pub(crate) fn replace_setting(
        &mut self,
        experiment: &mut Experiment,
        option: &str,
        words: &str,
    ) -> Option<()> {
        let found = (&mut self.sources, &mut self.diags);
        replace_setting(found, experiment, option, words)
    }

    /// An experiment with these settings, without any other lowering.
    pub(crate) fn on_road(
        &mut self,
        experiment: &Experiment,
        option: &str,
        words: &str,
    ) -> Option<Experiment> {
        let mut other = experiment.clone();
        let lowers = |kind: &SettingKind| matches!(kind, SettingKind::Lower(_));
        other.settings.retain(|setting| !lowers(&setting.kind));
        let found = (&mut self.sources, &mut self.diags);
        replace_settings(found, &mut other, option, words)?;
        Some(other)
    }
}

/// What is given for a setting is more than that.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("`{given}` is more than one setting")]
#[diagnostic(help("settings have options of their own, such as `--horizon 10 --tolerance 1e-6`"))]
struct NotSetting {
    given: String,
}

impl Fixable for NotSetting {}

/// What is given for a value is more than that.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("`{given}` is no value of a parameter, initial value or input")]
#[diagnostic(help("write `name=value`"))]
struct NotValue {
    given: String,
}

impl Fixable for NotValue {}

/// Values given as `name=value` under the name of an option.
pub(crate) fn bindings(
    (sources, diags): (&mut SourceMap, &mut Diagnostics),
    option: &str,
    sets: &[String],
) -> Option<Vec<Bind>> {
    let mut overrides = Vec::new();
    for set in sets {
        let settings = settings((sources, diags), option, ["with { ", set, "; }"])?;
        let mut settings = settings.into_iter().map(|setting| setting.kind);
        match (settings.next(), settings.next()) {
            (Some(SettingKind::With(binds)), None) => overrides.extend(binds),
            _ => {
                let given = set.clone();
                diags.push(NotValue { given });
                return None;
            }
        }
    }
    Some(overrides)
}

/// Replaces the setting of an experiment that is given anew in the words of an option, such as `method event`.
pub(crate) fn replace_setting(
    (sources, diags): (&mut SourceMap, &mut Diagnostics),
    experiment: &mut Experiment,
    option: &str,
    words: &str,
) -> Option<()> {
    match replace_settings((sources, diags), experiment, option, words)? {
        1 => Some(()),
        _ => {
            let given = words.to_owned();
            diags.push(NotSetting { given });
            None
        }
    }
}

/// The same of several settings; how many there are.
pub(crate) fn replace_settings(
    found: (&mut SourceMap, &mut Diagnostics),
    experiment: &mut Experiment,
    option: &str,
    words: &str,
) -> Option<usize> {
    let mut new = settings(found, option, ["", words, ";"])?;
    let old = std::mem::take(&mut experiment.settings);
    for old in old {
        match new.iter_mut().find(|new| new.kind.replaces(&old.kind)) {
            Some(new) => new.kind.keep_names(old.kind),
            None => experiment.settings.push(old),
        }
    }
    let n = new.len();
    experiment.settings.append(&mut new);
    Some(n)
}

/// The settings of an experiment that is made up around words of a user; diagnostics show nothing else.
fn settings(
    (sources, diags): (&mut SourceMap, &mut Diagnostics),
    option: &str,
    [before, words, after]: [&str; 3],
) -> Option<Vec<ExperimentSetting>> {
    let before = format!("simulate x of x {{ {before}");
    let words = format!("{words}\n");
    let after = format!("{after} }}\n");
    let source = sources.add_within(option, [&before, &words, &after]);
    let mut own = Diagnostics::new();
    let file = syntax::parse(&source, &mut own);
    let has_errors = own.has_errors();
    diags.append(own);
    let settings = file.items.into_iter().flat_map(|item| match item {
        Item::Experiment(experiment) => experiment.settings,
        _ => Vec::new(),
    });
    (!has_errors).then(|| settings.collect())
}
