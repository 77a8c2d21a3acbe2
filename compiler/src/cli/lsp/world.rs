//! The files that a client works on: texts as it has them, whether they are written or not, and all others as they are on
//! disk; what is known of each, found once for each state of the world.

use std::cell::OnceCell;
use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use lsp_types::{Location, Position, Range, TextDocumentContentChangeEvent, Uri};

use super::text::{Lines, path_of, uri_of};
use crate::cli::texts::{Texts, look};
use crate::diagnostics::{Diagnostics, position};
use crate::model::index::{Definition, Index, Occurrence};
use crate::project::Project;
use crate::source::files::{Disk, EXTENSION, Files};
use crate::source::imports::standard_text;
use crate::source::{SourceFile, Span};
use crate::syntax::{self, Token, TokenKind};

/// More files are not looked through for names.
const MOST_FILES: usize = 2000;
/// Nor in more folders.
const MOST_FOLDERS: usize = 20_000;

/// A text that a client has open.
#[derive(Clone, Debug)]
pub struct Document {
    /// What the client calls it.
    pub uri: Uri,
    /// The number of its last change.
    pub version: i32,
}

/// What is known of a file, as long as nothing changes.
pub struct Analysis {
    /// The file with what it uses.
    pub project: Project,
    /// Its names.
    pub index: Index,
    /// What is wrong with the whole of it, once somebody has asked.
    checked: OnceCell<Diagnostics>,
    /// How the lines of the file itself start.
    starts: OnceCell<Vec<usize>>,
    /// Of each file that was read, what it is called whoever reads it.
    names: OnceCell<Vec<PathBuf>>,
    texts: Texts,
}

impl Analysis {
    /// A file of these texts; nothing where there is none.
    pub fn of(path: &Path, texts: Texts) -> Option<Self> {
        let texts = texts.with([]);
        let project = Project::from_files(path, texts.clone()).ok()?;
        Some(Analysis {
            index: project.index(),
            project,
            checked: OnceCell::new(),
            starts: OnceCell::new(),
            names: OnceCell::new(),
            texts,
        })
    }

    /// Whether it depends on what is in a file, or on whether there is one.
    fn depends_on(&self, key: &str) -> bool {
        self.texts.has_asked(key)
    }

    /// What is wrong.
    pub fn checked(&self) -> &Diagnostics {
        self.checked.get_or_init(|| self.project.checked())
    }

    /// The text of the file itself.
    pub fn source(&self) -> &SourceFile {
        // It is the first that was read.
        &self.project.sources.files()[0]
    }

    /// The models of the file itself.
    pub fn models(&self) -> impl Iterator<Item = &syntax::Model> {
        self.project.items().filter_map(|item| match item {
            syntax::Item::Model(model) => Some(model),
            _ => None,
        })
    }

    /// The files that were read, each with its name in the standard library, or what makes it the same on disk.
    pub fn files(&self) -> impl Iterator<Item = (&Path, &SourceFile)> {
        let name = |file: &Arc<SourceFile>| {
            PathBuf::from(match standard(&file.name) {
                Some(_) => file.name.clone(),
                None => {
                    let key = Disk.key(Path::new(&file.name));
                    super::pages::standard(&key).unwrap_or(key)
                }
            })
        };
        let files = self.project.sources.files();
        let names = self.names.get_or_init(|| files.iter().map(name).collect());
        let names = names.iter().map(PathBuf::as_path);
        names.zip(files.iter().map(|file| &**file))
    }

    /// The lines of the file itself, of which positions are asked.
    pub fn lines(&self) -> Lines<'_> {
        let text = &self.source().text;
        let starts = self.starts.get_or_init(|| super::text::starts(text));
        Lines::known(text, starts)
    }

    /// Where a position of the file itself is in the address space.
    pub fn at(&self, position: Position) -> u32 {
        self.source().span().start + super::text::number(self.lines().byte(position))
    }

    /// Where a byte of another state of the text was in this one: before and behind what differs nothing has changed.
    pub fn then(&self, text: &str, byte: usize) -> usize {
        let was = self.source().text.as_bytes();
        let is = text.as_bytes();
        let before = was.iter().zip(is).take_while(|(a, b)| a == b).count();
        let behind = was[before..].iter().rev().zip(is[before..].iter().rev());
        let behind = behind.take_while(|(a, b)| a == b).count();
        match byte {
            byte if byte <= before => byte,
            byte if byte >= is.len() - behind => was.len() - (is.len() - byte),
            _ => before,
        }
    }

    /// Whether a place is in the file itself.
    pub fn is_here(&self, span: Span) -> bool {
        let file = self.source().span();
        file.start <= span.start && span.end <= file.end
    }

    /// The positions of a place in the file itself.
    pub fn range(&self, span: Span) -> Range {
        self.lines().range(self.source().bytes(span))
    }

    /// Whether something in a range could not be read.
    pub fn is_broken(&self, range: Span) -> bool {
        let mut errors = self.project.diags.errors();
        errors.any(|error| {
            let place = position(error.as_ref()).map(super::text::number);
            place.is_some_and(|place| range.start <= place && place <= range.end)
        })
    }

    /// Where something is, in whatever file.
    pub fn location(&self, span: Span) -> Option<Location> {
        let file = self.project.sources.file(span)?;
        let range = Lines::new(&file.text).range(file.bytes(span));
        let path = match standard(&file.name) {
            Some(text) => super::pages::write_standard(Path::new(&file.name), text)?,
            None => PathBuf::from(&file.name),
        };
        let uri = uri_of(&path)?;
        Some(Location { uri, range })
    }

    /// The word at a position of the file itself.
    pub fn word(&self, position: Position) -> Option<Token<'_>> {
        let byte = self.lines().byte(position);
        let mut words = syntax::tokens(&self.source().text).filter(|token| !token.is_blank());
        words.find(|token| {
            token.start <= byte && byte <= token.end() && token.kind == TokenKind::Word
        })
    }

    /// The same name in this text, where it is one, as at a position of the text that has become of it.
    pub fn named_then(
        &self,
        now: &Analysis,
        position: Position,
    ) -> Option<(Position, &Definition)> {
        let byte = self.then(&now.source().text, now.lines().byte(position));
        let then = self.lines().position(byte);
        let (found, definition) = self.named(then)?;
        let is_same = self.project.sources.text(found.span) == now.word(position)?.text;
        is_same.then_some((then, definition))
    }

    /// The name at a position of the file itself, with its definition.
    pub fn named(&self, position: Position) -> Option<(&Occurrence, &Definition)> {
        let found = self.index.at(self.at(position))?;
        Some((found, self.index.definition(found.declared)?))
    }
}

/// The text of a file of the standard library, by its name.
pub fn standard(name: &str) -> Option<&'static str> {
    standard_text(name.strip_prefix("std/")?.strip_suffix(".nsd")?)
}

/// The files.
#[derive(Default)]
pub struct World {
    /// Folders that the client works in.
    pub roots: Vec<PathBuf>,
    open: BTreeMap<String, Document>,
    texts: Texts,
    known: HashMap<String, Option<Rc<Analysis>>>,
    /// Of each open file, what was known when it could be read last.
    good: HashMap<String, Rc<Analysis>>,
    /// The same when nothing was wrong with it last.
    sound: HashMap<String, Rc<Analysis>>,
    has_changed: bool,
}

impl World {
    /// What makes a file the same, however it is called.
    pub fn key(uri: &Uri) -> String {
        Disk.key(&path_of(uri))
    }

    /// The texts as they are.
    pub fn texts(&self) -> &Texts {
        &self.texts
    }

    /// Whether a file has changed since this was asked last.
    pub fn has_changed(&mut self) -> bool {
        std::mem::take(&mut self.has_changed)
    }

    /// A client has opened a text.
    pub fn open(&mut self, uri: Uri, version: i32, text: String) {
        let key = World::key(&uri);
        self.texts.set(key.clone(), text);
        self.touch(&key);
        self.open.insert(key, Document { uri, version });
    }

    /// A client has changed a text.
    pub fn change(
        &mut self,
        uri: &Uri,
        version: i32,
        changes: Vec<TextDocumentContentChangeEvent>,
    ) {
        let key = World::key(uri);
        let (Some(document), Some(known)) = (self.open.get_mut(&key), self.texts.get(&key)) else {
            return;
        };
        document.version = version;
        let mut text = known.to_owned();
        for change in changes {
            match change.range {
                Some(range) => {
                    let bytes = Lines::new(&text).bytes(range);
                    text.replace_range(bytes, &change.text);
                }
                None => text = change.text,
            }
        }
        self.texts.set(key.clone(), text);
        self.touch(&key);
    }

    /// A client has closed a text: what is on disk counts.
    pub fn close(&mut self, uri: &Uri) {
        let key = World::key(uri);
        self.texts.forget(&key);
        self.open.remove(&key);
        self.good.remove(&key);
        self.sound.remove(&key);
        self.touch(&key);
    }

    /// A file has changed: what depends on it is not known any more.
    pub fn touch(&mut self, key: &str) {
        self.has_changed = true;
        let stays = |known: &Rc<Analysis>| !known.depends_on(key);
        self.known
            .retain(|_, known| known.as_ref().is_some_and(stays));
    }

    /// The texts that are open.
    pub fn documents(&self) -> impl Iterator<Item = &Document> {
        self.open.values()
    }

    /// What a client calls a file that it has open.
    pub fn called(&self, key: &str) -> Option<Uri> {
        self.open.get(key).map(|document| document.uri.clone())
    }

    /// What is known of a file; nothing where there is none.
    pub fn analysis(&mut self, uri: &Uri) -> Option<Rc<Analysis>> {
        let key = World::key(uri);
        if let Some(known) = self.known.get(&key) {
            return known.clone();
        }
        let found = Analysis::of(&path_of(uri), self.texts.clone()).map(Rc::new);
        if let Some(found) = found
            .as_ref()
            .filter(|found| !found.project.diags.has_errors())
        {
            self.good.insert(key.clone(), Rc::clone(found));
        }
        self.known.insert(key, found.clone());
        found
    }

    /// A file as it is, and as it was when it could be read last.
    pub fn states(&mut self, uri: &Uri) -> Option<[Rc<Analysis>; 2]> {
        let now = self.analysis(uri)?;
        let good = match now.project.diags.has_errors() {
            true => self.good.get(&World::key(uri)).cloned(),
            false => None,
        };
        Some([Rc::clone(&now), good.unwrap_or(now)])
    }

    /// Keeps a file that has been found to be sound.
    pub fn keep_sound(&mut self, uri: &Uri, known: &Rc<Analysis>) {
        self.sound.insert(World::key(uri), Rc::clone(known));
    }

    /// A file as it was when nothing was wrong with it last.
    pub fn sound(&self, uri: &Uri) -> Option<Rc<Analysis>> {
        self.sound.get(&World::key(uri)).cloned()
    }

    /// Forgets what was read of files that have changed on disk since, whether a client has said so or not.
    pub fn look_again(&mut self) {
        let all = self.known.values().flatten();
        let mut seen: Vec<_> = all.flat_map(|known| known.texts.asked()).collect();
        seen.sort();
        seen.dedup();
        seen.retain(|(key, _)| self.texts.get(key).is_none());
        let now = look(seen.iter().map(|(key, _)| key));
        for (key, _) in seen.iter().filter(|(key, was)| now[key] != *was) {
            self.touch(key);
        }
        self.known.retain(|_, known| known.is_some());
    }

    /// The names of all files of the world, as they are now: those that are open, and those in the folders of the client;
    /// and whether there are others that were not looked at.
    pub fn all(&mut self) -> (Vec<Rc<Analysis>>, bool) {
        self.look_again();
        let mut uris: BTreeMap<String, Uri> = self
            .open
            .iter()
            .map(|(key, known)| (key.clone(), known.uri.clone()))
            .collect();
        let (found, is_cut) = models(&self.roots);
        for path in &found {
            if let Some(uri) = uri_of(path) {
                uris.entry(Disk.key(path)).or_insert(uri);
            }
        }
        let all = uris.values().filter_map(|uri| self.analysis(uri));
        (all.collect(), is_cut)
    }
}

/// The files of models below folders, and whether there are more; folders that are hidden, links or not to be read are
/// left out.
fn models(roots: &[PathBuf]) -> (Vec<PathBuf>, bool) {
    let mut found = vec![];
    let (mut folders, mut n_folders) = (roots.to_vec(), 0);
    while let Some(folder) = folders.pop() {
        n_folders += 1;
        if n_folders > MOST_FOLDERS {
            return (found, true);
        }
        let entries = fs::read_dir(&folder).into_iter().flatten().flatten();
        let mut entries: Vec<_> = entries.map(|entry| entry.path()).collect();
        entries.sort();
        for path in entries {
            let is_hidden = path
                .file_name()
                .is_some_and(|name| name.to_string_lossy().starts_with('.'));
            if path.is_dir() {
                if !is_hidden && !path.is_symlink() {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|known| known == EXTENSION) && path.is_file() {
                if found.len() == MOST_FILES {
                    return (found, true);
                }
                found.push(path);
            }
        }
    }
    (found, false)
}

/// Whether a text is a name that anything may have.
pub fn is_name(text: &str) -> bool {
    let project = Project::from_text("name.nsd", &format!("const {text} = 1;"));
    let mut items = project.items();
    let fits = match (items.next(), items.next()) {
        (Some(syntax::Item::Const(item)), None) => project.sources.text(item.name.span) == text,
        _ => false,
    };
    fits && project.check().is_empty()
}
