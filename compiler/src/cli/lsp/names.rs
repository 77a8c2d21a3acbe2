//! Where names are declared and used, over all files, and other names for them.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use lsp_types::{
    DocumentHighlight, DocumentHighlightKind, DocumentHighlightParams, GotoDefinitionParams,
    GotoDefinitionResponse, Location, PrepareRenameResponse, ReferenceParams, RenameParams,
    TextDocumentPositionParams, TextEdit, WorkspaceEdit,
};

use super::text::{Lines, uri_of};
use super::world::{Analysis, World, is_name, standard};
use super::{Answer, Refused};
use crate::cli::files;
use crate::cli::texts::Texts;
use crate::model::index::{Definition, Kind, Role};
use crate::project::golden;
use crate::source::Span;
use crate::syntax::{Expect, SettingKind};

/// A place in a file, whoever reads it: the name of the file, and bytes in it.
type Site = (PathBuf, Range<usize>);

fn site(analysis: &Analysis, span: Span) -> Option<Site> {
    let start = analysis.project.sources.file(span)?.start;
    let (name, file) = analysis.files().find(|(_, file)| file.start == start)?;
    Some((name.to_owned(), file.bytes(span)))
}

/// Where what stands at a position is declared.
pub fn definition(
    world: &mut World,
    params: &GotoDefinitionParams,
) -> Answer<Option<GotoDefinitionResponse>> {
    let at = &params.text_document_position_params;
    let uri = &at.text_document.uri;
    let Some([now, good]) = world.states(uri) else {
        return Ok(None);
    };
    let found = match now.named(at.position) {
        Some((_, definition)) => now.location(leads_to(definition)),
        // While a line is broken, what was there before it was.
        None => good
            .named_then(&now, at.position)
            .and_then(|(_, definition)| location_now(&good, &now, leads_to(definition))),
    };
    Ok(found.map(GotoDefinitionResponse::Scalar))
}

/// Where a definition is shown.
fn leads_to(definition: &Definition) -> Span {
    let leads_on = matches!(definition.kind, Kind::Alias | Kind::File | Kind::Module);
    let of = definition.of.filter(|_| leads_on);
    of.unwrap_or(definition.place)
}

/// A place of an earlier text in the one that it has become.
fn location_now(good: &Analysis, now: &Analysis, place: Span) -> Option<Location> {
    let location = good.location(place)?;
    if !good.is_here(place) {
        return Some(location);
    }
    let text = &good.source().text;
    let bytes = good.source().bytes(place);
    let [start, end] = [bytes.start, bytes.end].map(|at| now.then(text, at));
    let range = now.lines().range(start..end);
    Some(Location { range, ..location })
}

/// Where what stands at a position is named in its own file.
pub fn highlights(
    world: &mut World,
    params: &DocumentHighlightParams,
) -> Answer<Option<Vec<DocumentHighlight>>> {
    let at = &params.text_document_position_params;
    let Some(analysis) = world.analysis(&at.text_document.uri) else {
        return Ok(None);
    };
    let Some((_, definition)) = analysis.named(at.position) else {
        return Ok(None);
    };
    let places = analysis.index.places(definition.place);
    let places = places.filter(|place| analysis.is_here(place.span));
    let shown = places.map(|place| DocumentHighlight {
        range: analysis.range(place.span),
        kind: Some(match place.role {
            Role::Reads => DocumentHighlightKind::READ,
            Role::Sets | Role::Declares => DocumentHighlightKind::WRITE,
        }),
    });
    Ok(Some(shown.collect()))
}

/// Where what stands at a position is named, in all files.
pub fn references(world: &mut World, params: &ReferenceParams) -> Answer<Option<Vec<Location>>> {
    let at = &params.text_document_position;
    let Some(named) = Named::at(world, at)? else {
        return Ok(None);
    };
    let with_own = params.context.include_declaration;
    let sites = named
        .sites
        .iter()
        .filter(|(_, role)| with_own || *role != Role::Declares);
    let mut locations: Vec<Location> = sites
        .filter_map(|(place, _)| named.location(place))
        .collect();
    locations.dedup();
    Ok(Some(locations))
}

/// Something that has a name, in all files that name it.
struct Named {
    definition: Definition,
    /// Those who name it.
    users: Vec<Rc<Analysis>>,
    /// Whether others may name it, too, in files that were not looked at.
    is_cut: bool,
    /// Where.
    sites: BTreeSet<(OrderedSite, Role)>,
}

type OrderedSite = (PathBuf, usize, usize);

impl Named {
    fn at(world: &mut World, at: &TextDocumentPositionParams) -> Answer<Option<Self>> {
        let (mut all, is_cut) = world.all();
        let Some(analysis) = world.analysis(&at.text_document.uri) else {
            return Ok(None);
        };
        let Some((_, definition)) = analysis.named(at.position) else {
            return Ok(None);
        };
        let declared = site(&analysis, definition.place);
        let mut named = Named {
            definition: definition.clone(),
            users: vec![],
            is_cut,
            sites: BTreeSet::new(),
        };
        if !all.iter().any(|other| Rc::ptr_eq(other, &analysis)) {
            all.push(analysis);
        }
        for user in all {
            let mut known = user.index.definitions().iter();
            let known = known.find(|known| {
                known.name == named.definition.name && site(&user, known.place) == declared
            });
            let Some(known) = known else {
                continue;
            };
            for place in user.index.places(known.place) {
                if let Some((path, range)) = site(&user, place.span) {
                    named
                        .sites
                        .insert(((path, range.start, range.end), place.role));
                }
            }
            named.users.push(user);
        }
        Ok(Some(named))
    }

    /// Refuses what cannot be renamed as a whole: where it may be named out of sight, or where goldens keep the name.
    fn is_known(&self) -> Answer<()> {
        let old = &self.definition.name;
        if self.is_cut {
            let message = format!(
                "`{old}` may be named elsewhere: there are more files than are looked through; open a folder with fewer"
            );
            return Err(Refused::new(message));
        }
        for user in &self.users {
            let file = &user.source().name;
            if user.project.diags.has_errors() {
                let message =
                    format!("`{file}` has errors that hide names; `{old}` may be one of them");
                return Err(Refused::new(message));
            }
            if let Some(golden) = kept(user, &self.definition) {
                let message = format!(
                    "`{}` holds `{old}`: rename it by hand, and write it anew with `nsdc test --accept {file}`",
                    golden.display()
                );
                return Err(Refused::new(message));
            }
        }
        Ok(())
    }

    /// The text of a file that somebody reads.
    fn text(&self, path: &Path) -> Option<&str> {
        let mut files = self.users.iter().flat_map(|user| user.files());
        let file = files.find(|(name, _)| *name == path);
        file.map(|(_, file)| file.text.as_str())
    }

    fn location(&self, (path, start, end): &OrderedSite) -> Option<Location> {
        let range = Lines::new(self.text(path)?).range(*start..*end);
        let uri = match standard(&path.to_string_lossy()) {
            Some(text) => uri_of(&super::pages::write_standard(path, text)?)?,
            None => uri_of(path)?,
        };
        Some(Location { uri, range })
    }
}

/// A golden file of an experiment that compares with it, in which a name is kept.
fn kept(user: &Analysis, definition: &Definition) -> Option<PathBuf> {
    let file = Path::new(&user.source().name);
    let mut experiments = user.project.experiments().filter(|experiment| {
        experiment.settings.iter().any(|setting| {
            let SettingKind::Expect(expect) = &setting.kind else {
                return false;
            };
            matches!(expect, Expect::LoweringGolden | Expect::NumbersGolden)
        })
    });
    experiments.find_map(|experiment| {
        let name = &experiment.name.name;
        let goldens = files::list_if_present(&golden::folder(file)).unwrap_or_default();
        goldens.into_iter().find(|path| {
            let file = path.file_name().unwrap_or_default().to_string_lossy();
            let ending = file
                .strip_prefix(name.as_str())
                .is_some_and(|rest| rest.starts_with('.'));
            ending
                && ((definition.kind == Kind::Experiment && definition.name == *name)
                    || fs::read_to_string(path).is_ok_and(|text| holds(&text, &definition.name)))
        })
    })
}

/// Whether a text has a word, or one with an index behind it.
fn holds(text: &str, name: &str) -> bool {
    let mut words = text.split(|c: char| !c.is_alphanumeric() && c != '_');
    words.any(|word| {
        let rest = word.strip_prefix(name);
        rest.is_some_and(|rest| rest.chars().all(|c| c.is_ascii_digit()))
    })
}

/// The name at a position, where it may have another one.
pub fn may_rename(
    world: &mut World,
    params: &TextDocumentPositionParams,
) -> Answer<Option<PrepareRenameResponse>> {
    let Some(analysis) = world.analysis(&params.text_document.uri) else {
        return Ok(None);
    };
    let Some((found, definition)) = analysis.named(params.position) else {
        return Ok(None);
    };
    fixed(&analysis, definition)?;
    Ok(Some(PrepareRenameResponse::Range(
        analysis.range(found.span),
    )))
}

/// Refuses what has its name from elsewhere.
fn fixed(analysis: &Analysis, definition: &Definition) -> Answer<()> {
    let place = site(analysis, definition.place);
    if place.is_some_and(|(file, _)| standard(&file.to_string_lossy()).is_some()) {
        let message = format!("`{}` is of the standard library", definition.name);
        return Err(Refused::new(message));
    }
    match definition.kind {
        Kind::File => Err(Refused::new(format!(
            "`{}` is the name of a file; write `as` and another name behind it",
            definition.name
        ))),
        _ => Ok(()),
    }
}

/// The edits that give what stands at a position another name, and change nothing else.
pub fn rename(world: &mut World, params: &RenameParams) -> Answer<Option<WorkspaceEdit>> {
    let at = &params.text_document_position;
    let new = params.new_name.trim();
    let Some(named) = Named::at(world, at)? else {
        return Err(Refused::new("there is no name here"));
    };
    if let Some(analysis) = world.analysis(&at.text_document.uri)
        && let Some((_, definition)) = analysis.named(at.position)
    {
        fixed(&analysis, definition)?;
    }
    if !is_name(new) {
        return Err(Refused::new(format!("`{new}` cannot be a name")));
    }
    named.is_known()?;
    let mut edits: BTreeMap<&Path, Vec<(usize, usize)>> = BTreeMap::new();
    for ((path, start, end), _) in &named.sites {
        let places = edits.entry(path).or_default();
        if places.last() != Some(&(*start, *end)) {
            places.push((*start, *end));
        }
    }
    let mut texts = Vec::new();
    let mut changes = HashMap::new();
    for (path, places) in edits {
        let Some((text, uri)) = named.text(path).zip(uri_of(path)) else {
            return Err(Refused::new(format!("`{}` cannot be read", path.display())));
        };
        let (mut renamed, mut done) = (String::new(), 0);
        for (start, end) in &places {
            renamed.push_str(&text[done..*start]);
            renamed.push_str(new);
            done = *end;
        }
        renamed.push_str(&text[done..]);
        texts.push((path.display().to_string(), renamed));
        let lines = Lines::new(text);
        let edit = |&(start, end): &(usize, usize)| TextEdit {
            range: lines.range(start..end),
            new_text: new.to_owned(),
        };
        // A client has its own name for what it has open.
        let uri = world.called(&path.display().to_string()).unwrap_or(uri);
        changes.insert(uri, places.iter().map(edit).collect());
    }
    let texts = world.texts().with(texts);
    for user in &named.users {
        same(user, &texts).map_err(|why| {
            let old = &named.definition.name;
            Refused::new(format!("`{old}` cannot be called `{new}`: {why}"))
        })?;
    }
    Ok(Some(WorkspaceEdit {
        changes: Some(changes),
        ..WorkspaceEdit::default()
    }))
}

/// Whether a file means the same with other texts: each name what it did before, and what was wrong is.
fn same(user: &Analysis, texts: &Texts) -> Result<(), String> {
    let path = PathBuf::from(&user.source().name);
    let other = Analysis::of(&path, texts.clone());
    let other = other.ok_or_else(|| "it cannot be read any more".to_owned())?;
    let meanings = |analysis: &Analysis| -> Vec<(Option<usize>, Role)> {
        let all = analysis.index.definitions();
        let found = analysis.index.occurrences().iter().map(|place| {
            let which = all.binary_search_by_key(&place.declared, |known| known.place);
            (which.ok(), place.role)
        });
        found.collect()
    };
    let kinds = |analysis: &Analysis| -> Vec<Kind> {
        let all = analysis.index.definitions().iter();
        all.map(|definition| definition.kind).collect()
    };
    let codes = |analysis: &Analysis| {
        let mut codes = analysis.checked().codes();
        codes.sort();
        codes
    };
    let (before, after) = (codes(user), codes(&other));
    if before != after {
        let new = other.checked().iter().find(|found| {
            let code = found
                .code()
                .map(|code| code.to_string())
                .unwrap_or_default();
            !before.contains(&code)
        });
        return Err(match new {
            Some(found) => found.to_string(),
            None => "it would not be wrong in the same way".to_owned(),
        });
    }
    match meanings(user) == meanings(&other) && kinds(user) == kinds(&other) {
        true => Ok(()),
        false => Err("that is the name of something else".to_owned()),
    }
}
