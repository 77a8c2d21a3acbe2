//! Where files come from: folders of a disk, or a list of names with what is in them.

use std::collections::{BTreeMap, HashMap};
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use std::{fmt, fs};

use miette::Diagnostic;

use crate::diagnostics::Fixable;
use crate::source::imports::{Loaded, Loader, NotLoaded};
use crate::source::table;
use crate::syntax;

/// Extension of model files.
pub const EXTENSION: &str = "nsd";

/// What was not possible, of a file of results.
pub const WRITE: &str = "write";

/// A file that could not be read or written.
#[derive(Clone, Debug, thiserror::Error)]
#[error("cannot {action} `{name}`: {reason}")]
pub struct FileError {
    /// What was tried: `read`, `write`.
    pub action: &'static str,
    /// Its path.
    pub name: String,
    /// Why that failed.
    pub reason: String,
}

impl Diagnostic for FileError {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        (self.action == WRITE).then(|| Box::new("E0814") as Box<dyn fmt::Display>)
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let help = "name a file in a folder that is there and may be written to";
        (self.action == WRITE).then(|| Box::new(help) as Box<dyn fmt::Display>)
    }
}

impl Fixable for FileError {}

impl FileError {
    /// What the system says about a path.
    pub fn new(action: &'static str, path: &Path, error: &io::Error) -> Self {
        let reason = match error.kind() {
            io::ErrorKind::NotFound => "there is no such file or folder".into(),
            io::ErrorKind::PermissionDenied => "permission denied".into(),
            io::ErrorKind::IsADirectory => "it is a folder".into(),
            _ => error.to_string(),
        };
        FileError {
            action,
            name: path.display().to_string(),
            reason,
        }
    }
}

/// Where files come from: a model, what it uses, its data and guesses.
///
/// A path in a file is joined to the folder of that file before it comes here.
pub trait Files: Send + Sync {
    /// The bytes of a file; at most one more than `limit` of them.
    ///
    /// # Errors
    ///
    /// Where there is none that can be read.
    fn read(&self, path: &Path, limit: usize) -> Result<Vec<u8>, FileError>;

    /// The same for the same file, however its path is written.
    fn key(&self, path: &Path) -> String {
        plain(path).display().to_string()
    }

    /// The name of a file in diagnostics.
    fn name(&self, path: &Path) -> String {
        path.display().to_string()
    }
}

impl Files for Arc<dyn Files> {
    fn read(&self, path: &Path, limit: usize) -> Result<Vec<u8>, FileError> {
        self.as_ref().read(path, limit)
    }

    fn key(&self, path: &Path) -> String {
        self.as_ref().key(path)
    }

    fn name(&self, path: &Path) -> String {
        self.as_ref().name(path)
    }
}

/// The files of this machine.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disk;

impl Files for Disk {
    fn read(&self, path: &Path, limit: usize) -> Result<Vec<u8>, FileError> {
        let read = || {
            let mut bytes = Vec::new();
            open(path)?.take(limit as u64 + 1).read_to_end(&mut bytes)?;
            Ok(bytes)
        };
        read().map_err(|error| FileError::new("read", path, &error))
    }

    fn key(&self, path: &Path) -> String {
        // What is not there yet will be in its folder.
        let beside = || {
            let folder = fs::canonicalize(path.parent()?).ok()?;
            Some(folder.join(path.file_name()?))
        };
        let whole = fs::canonicalize(path).ok().or_else(beside);
        let whole = whole.unwrap_or_else(|| path.to_owned());
        whole.display().to_string()
    }
}

/// Opens a regular file: others, as FIFOs and devices, may have no end, or no beginning.
pub(crate) fn open(path: &Path) -> io::Result<fs::File> {
    let kind = fs::metadata(path)?;
    if kind.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    match kind.is_file() {
        true => fs::File::open(path),
        false => Err(io::Error::other("it is no regular file")),
    }
}

/// Files by their names, such as `models/ball.nsd`, with what is in them; there are no others.
#[derive(Clone, Debug, Default)]
pub struct Memory(BTreeMap<PathBuf, Vec<u8>>);

impl<N: AsRef<Path>, B: Into<Vec<u8>>> FromIterator<(N, B)> for Memory {
    fn from_iter<I: IntoIterator<Item = (N, B)>>(files: I) -> Self {
        let known = |(name, bytes): (N, B)| (plain(name.as_ref()), bytes.into());
        Memory(files.into_iter().map(known).collect())
    }
}

impl Files for Memory {
    fn read(&self, path: &Path, limit: usize) -> Result<Vec<u8>, FileError> {
        let bytes = self.0.get(&plain(path)).ok_or_else(|| {
            let missing = io::ErrorKind::NotFound.into();
            FileError::new("read", path, &missing)
        })?;
        Ok(bytes
            .iter()
            .copied()
            .take(limit.saturating_add(1))
            .collect())
    }
}

/// A path without `.`, and without `..` behind a name.
fn plain(path: &Path) -> PathBuf {
    let mut found = PathBuf::new();
    for step in path.components() {
        push(&mut found, step);
    }
    found
}

/// Goes a step on a path.
fn push(path: &mut PathBuf, step: Component<'_>) {
    let is_name = matches!(path.components().next_back(), Some(Component::Normal(_)));
    match step {
        Component::CurDir => {}
        Component::ParentDir if is_name => {
            path.pop();
        }
        step => path.push(step),
    }
}

/// Reads imported files, relative to the file that imports them.
pub struct Imports<'f> {
    files: &'f dyn Files,
    /// Where each file was found, by what makes it the same file.
    paths: HashMap<String, PathBuf>,
}

impl<'f> Imports<'f> {
    /// Nothing is known yet.
    pub fn new(files: &'f dyn Files) -> Self {
        let paths = HashMap::new();
        Imports { files, paths }
    }

    /// What a path is known by, however it was written.
    pub fn key(&mut self, path: &Path) -> String {
        let key = self.files.key(path);
        self.paths
            .entry(key.clone())
            .or_insert_with(|| path.to_owned());
        key
    }

    fn folder(&self, of: &str) -> PathBuf {
        let folder = self.paths.get(of).and_then(|path| path.parent());
        folder.map(Path::to_owned).unwrap_or_default()
    }
}

impl Loader for Imports<'_> {
    fn data(&mut self, from: &str, path: &str) -> Result<Vec<u8>, NotLoaded> {
        let found = self.folder(from).join(path);
        let failed = |tried: String, reason: String| NotLoaded { tried, reason };
        let bytes = self.files.read(&found, table::MAX_BYTES);
        let bytes = bytes.map_err(|error| failed(error.name, error.reason))?;
        match bytes.len() > table::MAX_BYTES {
            true => {
                let reason = format!("it is larger than {} MiB", table::MAX_BYTES >> 20);
                Err(failed(found.display().to_string(), reason))
            }
            false => Ok(bytes),
        }
    }

    fn load(&mut self, from: &str, path: &str) -> Result<Loaded, NotLoaded> {
        let mut found = self.folder(from);
        let steps = Path::new(path).components();
        for step in steps.filter(|step| *step != Component::RootDir) {
            push(&mut found, step);
        }
        found.as_mut_os_string().push(format!(".{EXTENSION}"));
        let bytes = self.files.read(&found, syntax::MAX_BYTES);
        let bytes = bytes.map_err(|error| NotLoaded {
            tried: error.name,
            reason: error.reason,
        })?;
        Ok(Loaded {
            key: self.key(&found),
            name: self.files.name(&found),
            bytes,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file is the same file from wherever it is named.
    #[test]
    fn files_in_memory_have_folders() {
        let files: Memory = [("a/../models/./ball.nsd", "x")].into_iter().collect();
        let read = |path: &str| files.read(Path::new(path), 10).ok();
        assert_eq!(read("models/ball.nsd").as_deref(), Some(&b"x"[..]));
        assert_eq!(read("./models/b/../ball.nsd").as_deref(), Some(&b"x"[..]));
        assert_eq!(read("../models/ball.nsd"), None);
        let key = |path: &str| files.key(Path::new(path));
        assert_eq!(key("models/c/../ball.nsd"), key("./models/ball.nsd"));
    }

    #[test]
    fn no_more_is_read_than_what_shows_that_it_is_too_long() {
        let files: Memory = [("a", vec![0; 100])].into_iter().collect();
        let length = |limit| files.read(Path::new("a"), limit).map(|bytes| bytes.len());
        assert_eq!(length(10).ok(), Some(11));
        assert_eq!(length(100).ok(), Some(100));
    }
}
