//! A file that has been read and parsed, and its experiments.

use std::path::{Path, PathBuf};

use super::files::{self, FileError, Imports};
use super::{Streams, io};
use crate::clock::Clock;
use crate::diagnostics::{self, Diagnostics, is_error};
use crate::imports;
use crate::source::SourceMap;
use crate::syntax::{self, Bind, Experiment, ExperimentSetting, File, Item, SettingKind};

/// A file that has been read and parsed.
pub struct Project {
    /// Where it came from.
    pub path: PathBuf,
    /// All texts.
    pub sources: SourceMap,
    /// Its syntax.
    pub file: File,
    /// What is wrong with the file as a whole.
    pub diags: Diagnostics,
    /// Time spent so far.
    pub clock: Clock,
}

impl Project {
    /// Reads and parses a file.
    pub fn load(path: &Path) -> Result<Project, FileError> {
        let mut clock = Clock::default();
        let bytes = clock.time("read", || files::read(path, syntax::MAX_BYTES))?;
        Ok(Project::parsed(path, bytes, clock))
    }

    /// A file as if it held these bytes.
    pub fn of(path: &Path, bytes: Vec<u8>) -> Project {
        Project::parsed(path, bytes, Clock::default())
    }

    fn parsed(path: &Path, bytes: Vec<u8>, mut clock: Clock) -> Project {
        let mut sources = SourceMap::new();
        let mut diags = Diagnostics::new();
        let source = sources.add_bytes(files::display_name(path), bytes);
        let mut file = clock.time("parse", || syntax::parse(&source, &mut diags));
        let mut imports = Imports::default();
        let key = imports.key(path);
        clock.time("parse", || {
            imports::link(&mut file, &key, &mut imports, &mut sources, &mut diags);
        });
        Project {
            path: path.to_owned(),
            sources,
            file,
            diags,
            clock,
        }
    }

    /// All diagnostics of the file: of its syntax, its models and its experiments.
    pub fn check(&mut self) -> Diagnostics {
        let mut diags = std::mem::take(&mut self.diags);
        crate::check(&self.file, &self.sources, &mut diags);
        diags
    }

    /// All experiments, in order.
    pub fn experiments(&self) -> impl Iterator<Item = &Experiment> {
        self.file.items.iter().filter_map(|item| match item {
            Item::Experiment(experiment) => Some(experiment),
            _ => None,
        })
    }

    /// Reads and parses a file and the values that `--set` gives; nothing after an error, which has
    /// been printed.
    pub fn open(
        path: &Path,
        sets: &[String],
        streams: &mut Streams<'_>,
    ) -> io::Result<Option<(Project, Vec<Bind>)>> {
        let mut project = match Project::load(path) {
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
        &self,
        name: Option<&str>,
        command: &str,
        streams: &mut Streams<'_>,
    ) -> io::Result<Option<Experiment>> {
        let mut experiments = self.selected(name, streams)?.unwrap_or_default();
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
        &self,
        name: Option<&str>,
        streams: &mut Streams<'_>,
    ) -> io::Result<Option<Vec<Experiment>>> {
        match self.select(name) {
            Ok(experiments) => Ok(Some(experiments)),
            Err(message) => {
                writeln!(streams.err, "error: {message}")?;
                Ok(None)
            }
        }
    }

    /// The experiment of that name, or all of them; what is wrong where there are none.
    fn select(&self, name: Option<&str>) -> Result<Vec<Experiment>, String> {
        let all: Vec<&Experiment> = self.experiments().collect();
        let shown = files::display_name(&self.path);
        let Some(name) = name else {
            return match all.is_empty() {
                true => Err(format!(
                    "`{shown}` has no experiment\n  help: add `simulate NAME of MODEL {{ horizon 1; }}`"
                )),
                false => Ok(all.into_iter().cloned().collect()),
            };
        };
        if let Some(found) = all.iter().find(|experiment| experiment.name.name == name) {
            return Ok(vec![(*found).clone()]);
        }
        let names: Vec<&str> = all
            .iter()
            .map(|experiment| experiment.name.name.as_str())
            .collect();
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
        Err(format!(
            "there is no experiment `{name}` in `{shown}`\n  help: {help}"
        ))
    }

    /// An experiment of a model without settings of its own.
    pub fn default_experiment(&mut self, model: &str) -> Option<Experiment> {
        let text = format!("simulate {model} of {model} {{ horizon 1; }}");
        let source = self.sources.add("<default experiment>", text);
        let file = syntax::parse(&source, &mut self.diags);
        file.items.into_iter().find_map(|item| match item {
            Item::Experiment(experiment) => Some(experiment),
            _ => None,
        })
    }

    /// Values given on the command line as `name=value`.
    pub fn bindings(&mut self, option: &str, sets: &[String]) -> Option<Vec<Bind>> {
        let mut overrides = Vec::new();
        for set in sets {
            let settings = self.parse_settings(option, ["with { ", set, "; }"])?;
            for setting in settings {
                match setting.kind {
                    SettingKind::With(binds) => overrides.extend(binds),
                    _ => return None,
                }
            }
        }
        Some(overrides)
    }

    /// Replaces the settings of an experiment that `words`, such as `method event`, gives anew.
    pub fn replace_setting(
        &mut self,
        experiment: &mut Experiment,
        option: &str,
        words: &str,
    ) -> Option<()> {
        let new = self.parse_settings(option, ["", words, ";"])?;
        let same = |old: &ExperimentSetting| {
            let kind = std::mem::discriminant(&old.kind);
            new.iter()
                .any(|new| std::mem::discriminant(&new.kind) == kind)
        };
        experiment.settings.retain(|old| !same(old));
        experiment.settings.extend(new);
        Some(())
    }

    /// An experiment with these settings, without any other lowering.
    pub fn on_road(
        &mut self,
        experiment: &Experiment,
        option: &str,
        words: &str,
    ) -> Option<Experiment> {
        let mut other = experiment.clone();
        let lowers = |kind: &SettingKind| matches!(kind, SettingKind::Lower(_));
        other.settings.retain(|setting| !lowers(&setting.kind));
        self.replace_setting(&mut other, option, words)?;
        Some(other)
    }

    /// The settings of an experiment that is made up around words of the command line; diagnostics show nothing else.
    fn parse_settings(
        &mut self,
        option: &str,
        [before, words, after]: [&str; 3],
    ) -> Option<Vec<ExperimentSetting>> {
        let before = format!("simulate x of x {{ {before}");
        let words = format!("{words}\n");
        let after = format!("{after} }}\n");
        let source = self.sources.add_within(option, [&before, &words, &after]);
        let mut diags = Diagnostics::new();
        let file = syntax::parse(&source, &mut diags);
        let has_errors = diags.has_errors();
        self.diags.append(diags);
        let experiments = file.items.into_iter().filter_map(|item| match item {
            Item::Experiment(experiment) => Some(experiment.settings),
            _ => None,
        });
        (!has_errors).then(|| experiments.flatten().collect())
    }
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

/// Codes of the errors.
pub fn error_codes(diags: &Diagnostics) -> Vec<String> {
    codes(diags, true)
}

/// Codes of the warnings.
pub fn warning_codes(diags: &Diagnostics) -> Vec<String> {
    codes(diags, false)
}

fn codes(diags: &Diagnostics, of_errors: bool) -> Vec<String> {
    let wanted = diags
        .iter()
        .filter(|diagnostic| is_error(diagnostic.as_ref()) == of_errors);
    wanted
        .filter_map(|diagnostic| diagnostic.code())
        .map(|code| code.to_string())
        .collect()
}
