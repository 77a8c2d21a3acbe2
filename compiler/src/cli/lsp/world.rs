//! The files that a client works on: texts as it has them, whether they are written or not, and all others as they are on
//! disk; what is known of each, found once for each state of the world.

use std::cell::OnceCell;
use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::{Arc, Mutex};
use std::time::SystemTime;

use lsp_types::{Location, Position, Range, TextDocumentContentChangeEvent, Uri};

use super::text::{Lines, path_of, uri_of};
use crate::diagnostics::Diagnostics;
use crate::model::index::{Definition, Index, Occurrence};
use crate::project::Project;
use crate::source::files::{Disk, EXTENSION, FileError, Files};
use crate::source::{SourceFile, Span};
use crate::syntax::{self, Token, TokenKind};

/// More files are not looked through for names.
const MOST_FILES: usize = 2000;
/// Nor in more folders.
const MOST_FOLDERS: usize = 20_000;

/// Texts that are not on disk as they are, by what makes a file the same; all others are on disk.
#[derive(Clone, Debug, Default)]
pub struct Texts {
    texts: BTreeMap<String, Arc<str>>,
    /// Which files were asked for, as they were before they were read.
    asked: Arc<Mutex<Seen>>,
}

/// Files by their keys: when each was changed, and how long it is, where it is there.
pub type Seen = BTreeMap<String, Option<(SystemTime, u64)>>;

/// What files are like on disk now.
pub fn look<'k>(keys: impl IntoIterator<Item = &'k String>) -> Seen {
    let seen = |key: &String| {
        let known = fs::metadata(key).ok();
        let known = known.and_then(|known| Some((known.modified().ok()?, known.len())));
        (key.clone(), known)
    };
    keys.into_iter().map(seen).collect()
}

impl Files for Texts {
    fn read(&self, path: &Path, limit: usize) -> Result<Vec<u8>, FileError> {
        let key = self.key(path);
        let text = self.texts.get(&key);
        if let Ok(mut asked) = self.asked.lock()
            && !asked.contains_key(&key)
        {
            asked.append(&mut look([&key]));
        }
        match text {
            Some(text) => Ok(text.bytes().take(limit.saturating_add(1)).collect()),
            None => Disk.read(path, limit),
        }
    }

    fn key(&self, path: &Path) -> String {
        Disk.key(path)
    }
}

impl Texts {
    /// All files that were asked for, whether they are there or not, as they were before they were read.
    pub fn asked(&self) -> Seen {
        let asked = self.asked.lock();
        asked.map_or_else(|_| Seen::new(), |asked| asked.clone())
    }

    /// These with others in their place.
    pub fn with(&self, others: impl IntoIterator<Item = (String, String)>) -> Texts {
        let mut texts = self.texts.clone();
        let others = others.into_iter();
        texts.extend(others.map(|(key, text)| (key, text.into())));
        let asked = Arc::default();
        Texts { texts, asked }
    }
}

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
            texts,
        })
    }

    /// Whether it depends on what is in a file, or on whether there is one.
    fn depends_on(&self, key: &str) -> bool {
        let asked = self.texts.asked.lock();
        asked.is_ok_and(|asked| asked.contains_key(key))
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
        let start = self.source().start;
        let local = |at: u32| (at as usize).saturating_sub(start);
        self.lines().range(local(span.start)..local(span.end))
    }

    /// Where something is, in whatever file.
    pub fn location(&self, span: Span) -> Option<Location> {
        let file = self.project.sources.file(span)?;
        let local = |at: u32| (at as usize).saturating_sub(file.start);
        let range = Lines::new(&file.text).range(local(span.start)..local(span.end));
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
    let module = name.strip_prefix("std/")?.strip_suffix(".nsd")?;
    let mut all = crate::source::imports::STANDARD.iter();
    all.find(|(known, _)| *known == module)
        .map(|(_, text)| *text)
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

    /// A client has opened a text.
    pub fn open(&mut self, uri: Uri, version: i32, text: String) {
        let key = World::key(&uri);
        self.texts.texts.insert(key.clone(), text.into());
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
        let (Some(document), Some(known)) =
            (self.open.get_mut(&key), self.texts.texts.get_mut(&key))
        else {
            return;
        };
        document.version = version;
        let mut text = known.to_string();
        for change in changes {
            match change.range {
                Some(range) => {
                    let bytes = Lines::new(&text).bytes(range);
                    text.replace_range(bytes, &change.text);
                }
                None => text = change.text,
            }
        }
        *known = text.into();
        self.touch(&key);
    }

    /// A client has closed a text: what is on disk counts.
    pub fn close(&mut self, uri: &Uri) {
        let key = World::key(uri);
        self.texts.texts.remove(&key);
        self.open.remove(&key);
        self.good.remove(&key);
        self.touch(&key);
    }

    /// A file has changed: what depends on it is not known any more.
    pub fn touch(&mut self, key: &str) {
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

    /// What was known of an open file when it could be read last.
    pub fn last_good(&mut self, uri: &Uri) -> Option<Rc<Analysis>> {
        let now = self.analysis(uri)?;
        Some(match now.project.diags.has_errors() {
            true => self.good.get(&World::key(uri)).cloned().unwrap_or(now),
            false => now,
        })
    }

    /// Forgets what was read of files that have changed on disk since, whether a client has said so or not.
    pub fn look_again(&mut self) {
        let all = self.known.values().flatten();
        let mut seen: Vec<_> = all.flat_map(|known| known.texts.asked()).collect();
        seen.sort();
        seen.dedup();
        seen.retain(|(key, _)| !self.texts.texts.contains_key(key));
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
