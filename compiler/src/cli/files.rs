//! Reading and writing files, with errors that name them.

use std::collections::HashMap;
use std::fs;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

use super::{Streams, project};
use crate::diagnostics::{Diagnostics, Fixable};
use crate::imports::{Loaded, Loader, NotLoaded};
use crate::source::SourceMap;
use crate::syntax;
use crate::table;

/// What was not possible, of a file of results.
const WRITE: &str = "write";
/// Extension of model files.
const EXTENSION: &str = "nsd";
/// Folders below a folder before a walk gives up; a cycle of links would never end.
const MAX_DEPTH: usize = 64;

/// A file that could not be read or written.
#[derive(Debug, thiserror::Error)]
#[error("cannot {action} `{name}`: {reason}")]
pub struct FileError {
    action: &'static str,
    name: String,
    reason: String,
}

impl miette::Diagnostic for FileError {
    fn code<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        (self.action == WRITE).then(|| Box::new("E0814") as Box<dyn std::fmt::Display>)
    }

    fn help<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        let help = "name a file in a folder that is there and may be written to";
        (self.action == WRITE).then(|| Box::new(help) as Box<dyn std::fmt::Display>)
    }
}

impl Fixable for FileError {}

impl FileError {
    /// Prints it.
    pub fn tell(self, streams: &mut Streams<'_>) -> io::Result<()> {
        if self.action != WRITE {
            return writeln!(streams.err, "error: {self}");
        }
        let mut diags = Diagnostics::new();
        diags.push(self);
        project::print(&diags, &SourceMap::new(), streams)
    }

    fn new(action: &'static str, path: &Path, error: &io::Error) -> Self {
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

/// Whether a path stands for standard input or output.
pub fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// The name of a file in diagnostics.
pub fn display_name(path: &Path) -> String {
    match is_standard(path) {
        true => "<standard input>".into(),
        false => path.display().to_string(),
    }
}

/// The bytes of a file, or of standard input for `-`; at most one more than `limit` of them.
pub fn read(path: &Path, limit: usize) -> Result<Vec<u8>, FileError> {
    let limited = |source: &mut dyn Read| {
        let mut bytes = Vec::new();
        source.take(limit as u64 + 1).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let result = match is_standard(path) {
        true => limited(&mut io::stdin().lock()),
        false => open(path).and_then(|mut file| limited(&mut file)),
    };
    result.map_err(|error| FileError::new("read", path, &error))
}

/// Opens a regular file: others, as FIFOs and devices, may have no end, or no beginning.
fn open(path: &Path) -> io::Result<fs::File> {
    let kind = fs::metadata(path)?;
    if kind.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    match kind.is_file() {
        true => fs::File::open(path),
        false => Err(io::Error::other("it is no regular file")),
    }
}

/// The text of a file that may be missing.
pub fn read_if_present(path: &Path) -> Result<Option<String>, FileError> {
    let text = open(path).and_then(io::read_to_string);
    match text {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(FileError::new("read", path, &error)),
    }
}

/// That a file can hardly be written, for what takes long before it is.
pub fn foresee(path: &Path) -> Result<(), FileError> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let kind = match (is_standard(path), path.is_dir(), folder) {
        (false, true, _) => io::ErrorKind::IsADirectory,
        (false, false, Some(folder)) if !folder.is_dir() => io::ErrorKind::NotFound,
        _ => return Ok(()),
    };
    Err(FileError::new(WRITE, path, &kind.into()))
}

/// Replaces a file as a whole: it has its old text or the new one, whatever happens meanwhile.
pub fn write(path: &Path, text: &str) -> Result<(), FileError> {
    replace(path, text).map_err(|error| FileError::new(WRITE, path, &error))
}

fn replace(path: &Path, text: &str) -> io::Result<()> {
    // A link stays one; what is no regular file, or protected, is not replaced by another file.
    let target = match fs::canonicalize(path) {
        Ok(target) => target,
        Err(_) if path.is_symlink() => return fs::write(path, text),
        Err(_) => path.to_owned(),
    };
    let known = fs::metadata(&target).ok();
    let may_go = |known: &fs::Metadata| known.is_file() && !known.permissions().readonly();
    let name = target
        .file_name()
        .filter(|_| known.as_ref().is_none_or(may_go));
    let Some(name) = name else {
        return fs::write(path, text);
    };
    let name = format!(".{}.{}", name.to_string_lossy(), std::process::id());
    let beside = target.with_file_name(name);
    let written = fs::write(&beside, text).and_then(|()| match &known {
        Some(known) => fs::set_permissions(&beside, known.permissions()),
        None => Ok(()),
    });
    match written.and_then(|()| fs::rename(&beside, &target)) {
        Ok(()) => Ok(()),
        Err(error) => {
            let _ = fs::remove_file(&beside);
            // Where the folder takes no other file, the file itself may still be written.
            match known {
                Some(_) if error.kind() == io::ErrorKind::PermissionDenied => fs::write(path, text),
                _ => Err(error),
            }
        }
    }
}

/// Replaces a file, in a folder that may have to be made; neither of them may be a link that leads elsewhere.
pub fn write_in_folder(path: &Path, text: &str) -> Result<(), FileError> {
    refuse_links(WRITE, path)?;
    let made = path.parent().map_or(Ok(()), fs::create_dir_all);
    made.map_err(|error| FileError::new(WRITE, path, &error))?;
    write(path, text)
}

/// An error where a file or its folder is a symbolic link: what is there belongs to somebody else.
fn refuse_links(action: &'static str, path: &Path) -> Result<(), FileError> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let link = folder
        .into_iter()
        .chain([path])
        .find(|path| path.is_symlink());
    link.map_or(Ok(()), |link| {
        let error = io::Error::other(format!("`{}` is a symbolic link", link.display()));
        Err(FileError::new(action, path, &error))
    })
}

/// Takes a file away; its folder may be no link that leads elsewhere.
pub fn remove(path: &Path) -> Result<(), FileError> {
    refuse_links("remove", path)?;
    fs::remove_file(path).map_err(|error| FileError::new("remove", path, &error))
}

/// What is in a folder that may be missing, in order of names.
pub fn list_if_present(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let error = |error: io::Error| FileError::new("read", folder, &error);
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(missing) if missing.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(other) => return Err(error(other)),
    };
    let paths = entries.map(|entry| entry.map(|entry| entry.path()));
    let mut paths = paths.collect::<io::Result<Vec<PathBuf>>>().map_err(error)?;
    paths.sort();
    Ok(paths)
}

/// Reads imported files, relative to the file that imports them.
#[derive(Debug, Default)]
pub struct Imports {
    /// Where each file was found, by what makes it the same file.
    paths: HashMap<String, PathBuf>,
}

impl Imports {
    /// What a path is known by, however it was written.
    pub fn key(&mut self, path: &Path) -> String {
        let whole = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let key = whole.display().to_string();
        self.paths
            .entry(key.clone())
            .or_insert_with(|| path.to_owned());
        key
    }
}

impl Loader for Imports {
    fn data(&mut self, from: &str, path: &str) -> Result<Vec<u8>, NotLoaded> {
        let folder = self.paths.get(from).and_then(|from| from.parent());
        let found = folder.map_or_else(|| path.into(), |folder| folder.join(path));
        let failed = |tried: String, reason: String| NotLoaded { tried, reason };
        let bytes = read(&found, table::MAX_BYTES);
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
        let folder = self.paths.get(from).and_then(|from| from.parent());
        let mut found = folder.map(Path::to_owned).unwrap_or_default();
        for step in path.split('/') {
            let is_name = matches!(found.components().next_back(), Some(Component::Normal(_)));
            match step {
                "." | "" => {}
                ".." if is_name => {
                    found.pop();
                }
                step => found.push(step),
            }
        }
        found.as_mut_os_string().push(format!(".{EXTENSION}"));
        let bytes = read(&found, syntax::MAX_BYTES).map_err(|error| NotLoaded {
            tried: error.name,
            reason: error.reason,
        })?;
        Ok(Loaded {
            key: self.key(&found),
            name: display_name(&found),
            bytes,
        })
    }
}

/// Files named one by one, and all model files below folders, in order of their names.
pub fn find(paths: &[PathBuf]) -> Result<Vec<PathBuf>, FileError> {
    find_all(paths, EXTENSION)
}

/// The same for files with another extension.
pub fn find_all(paths: &[PathBuf], wanted: &str) -> Result<Vec<PathBuf>, FileError> {
    let mut found = Vec::new();
    for path in paths {
        let is_folder = !is_standard(path) && path.is_dir();
        if !is_folder {
            found.push(path.clone());
            continue;
        }
        let mut folders = vec![(path.clone(), 0)];
        let mut files = Vec::new();
        while let Some((folder, depth)) = folders.pop() {
            let error = |error: io::Error| FileError::new("read", &folder, &error);
            for entry in fs::read_dir(&folder).map_err(error)? {
                let path = entry.map_err(error)?.path();
                if path.is_dir() {
                    if depth < MAX_DEPTH {
                        folders.push((path, depth + 1));
                    }
                } else if path
                    .extension()
                    .is_some_and(|extension| extension == wanted)
                {
                    files.push(path);
                }
            }
        }
        files.sort();
        found.append(&mut files);
    }
    Ok(found)
}

/// Where results go: standard output or a file that is written as a whole at the end.
pub struct Sink {
    path: PathBuf,
    text: String,
}

impl Sink {
    /// A sink for a path, `-` for standard output.
    pub fn new(path: &Path) -> Self {
        Sink {
            path: path.to_owned(),
            text: String::new(),
        }
    }

    /// A sink with its whole text.
    pub fn with(path: &Path, text: String) -> Self {
        Sink {
            path: path.to_owned(),
            text,
        }
    }

    /// Adds text.
    pub fn push(&mut self, text: &str) {
        self.text.push_str(text);
    }

    /// Writes everything; problems with the file are told on the error stream.
    pub fn finish(self, streams: &mut Streams<'_>) -> io::Result<bool> {
        if is_standard(&self.path) {
            streams.out.write_all(self.text.as_bytes())?;
            return Ok(true);
        }
        match write(&self.path, &self.text) {
            Ok(()) => Ok(true),
            Err(error) => {
                error.tell(streams)?;
                Ok(false)
            }
        }
    }
}
