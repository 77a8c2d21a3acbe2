//! Reading and writing files, with errors that name them.

use std::fs::{self, Permissions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use super::{Streams, project};
use crate::diagnostics::Diagnostics;
use crate::source::SourceMap;
pub use crate::source::files::FileError;
use crate::source::files::{Disk, EXTENSION, Files, WRITE, open};

/// Folders below a folder before a walk gives up; a cycle of links would never end.
const MAX_DEPTH: usize = 64;

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
}

/// Whether a path stands for standard input or output.
pub fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// The file of one experiment of several: `figure.svg` becomes `figure-crossing.svg`.
pub fn of_experiment(path: &Path, experiment: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = format!("{stem}-{experiment}");
    match path.extension() {
        Some(extension) => path.with_file_name(format!("{name}.{}", extension.to_string_lossy())),
        None => path.with_file_name(name),
    }
}

/// The name of a file in diagnostics.
pub fn display_name(path: &Path) -> String {
    match is_standard(path) {
        true => "<standard input>".into(),
        false => path.display().to_string(),
    }
}

/// The files of this machine, and standard input for `-`.
pub struct Terminal;

impl Files for Terminal {
    fn read(&self, path: &Path, limit: usize) -> Result<Vec<u8>, FileError> {
        if !is_standard(path) {
            return Disk.read(path, limit);
        }
        let mut bytes = Vec::new();
        let read = (io::stdin().lock())
            .take(limit as u64 + 1)
            .read_to_end(&mut bytes);
        match read {
            Ok(_) => Ok(bytes),
            Err(error) => Err(FileError::new("read", path, &error)),
        }
    }

    fn key(&self, path: &Path) -> String {
        Disk.key(path)
    }

    fn name(&self, path: &Path) -> String {
        display_name(path)
    }
}

/// The bytes of a file, or of standard input for `-`; at most one more than `limit` of them.
pub fn read(path: &Path, limit: usize) -> Result<Vec<u8>, FileError> {
    Terminal.read(path, limit)
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

/// Whether files of results can be written, as far as that is known before hours of work; else it is told.
pub fn foresee<'p>(
    paths: impl IntoIterator<Item = &'p Path>,
    streams: &mut Streams<'_>,
) -> io::Result<bool> {
    match paths.into_iter().find_map(obstacle) {
        Some(error) => error.tell(streams).map(|()| false),
        None => Ok(true),
    }
}

fn obstacle(path: &Path) -> Option<FileError> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let kind = match (is_standard(path), path.is_dir(), folder) {
        (false, true, _) => io::ErrorKind::IsADirectory,
        (false, false, Some(folder)) if !folder.is_dir() => io::ErrorKind::NotFound,
        _ => return None,
    };
    Some(FileError::new(WRITE, path, &kind.into()))
}

/// Replaces a file as a whole: it has its old text or the new one, whatever happens meanwhile.
pub fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), FileError> {
    replace(path, bytes.as_ref()).map_err(|error| FileError::new(WRITE, path, &error))
}

fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    // A link stays one; what is no regular file, or protected, is not replaced by another file.
    let target = match fs::canonicalize(path) {
        Ok(target) => target,
        Err(_) if path.is_symlink() => return fs::write(path, bytes),
        Err(_) => path.to_owned(),
    };
    let known = fs::metadata(&target).ok();
    let may_go = |known: &fs::Metadata| known.is_file() && !known.permissions().readonly();
    let folder = target
        .parent()
        .filter(|_| known.as_ref().is_none_or(may_go));
    let Some(folder) = folder else {
        return fs::write(path, bytes);
    };
    let permissions = known.as_ref().map(fs::Metadata::permissions);
    match replace_within(folder, &target, bytes, permissions) {
        // Where the folder takes no other file, the file itself may still be written.
        Err(error) if known.is_some() && error.kind() == io::ErrorKind::PermissionDenied => {
            fs::write(path, bytes)
        }
        other => other,
    }
}

/// Writes a file beside another one of the same folder, and puts it in its place.
fn replace_within(
    folder: &Path,
    target: &Path,
    bytes: &[u8],
    permissions: Option<Permissions>,
) -> io::Result<()> {
    // A file in this folder is told as one without a folder.
    let folder = match folder.as_os_str().is_empty() {
        true => Path::new("."),
        false => folder,
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".nsdc-");
    #[cfg(unix)]
    {
        // As any file that is made, but for what the user's mask takes away.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(Permissions::from_mode(0o666));
    }
    let mut beside = builder.tempfile_in(folder)?;
    beside.write_all(bytes)?;
    if let Some(permissions) = permissions {
        beside.as_file().set_permissions(permissions)?;
    }
    beside.persist(target)?;
    Ok(())
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

/// What a file holds, as its name says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    Json,
    Csv,
    Svg,
    Figure,
    Parquet,
    Xml,
    Model,
}

/// The form of a file by its extension.
pub fn form_of(path: &Path) -> Option<Form> {
    let extension = path.extension()?.to_ascii_lowercase();
    match extension.to_str()? {
        "json" | "jsonl" => Some(Form::Json),
        "csv" => Some(Form::Csv),
        "svg" => Some(Form::Svg),
        "png" | "pdf" => Some(Form::Figure),
        "parquet" => Some(Form::Parquet),
        "xml" => Some(Form::Xml),
        EXTENSION => Some(Form::Model),
        _ => None,
    }
}

impl Form {
    fn word(self) -> &'static str {
        match self {
            Form::Json => "JSON",
            Form::Csv => "CSV",
            Form::Svg | Form::Figure => "a figure",
            Form::Parquet => "Parquet",
            Form::Xml => "XML",
            Form::Model => "a model",
        }
    }
}

/// What is wrong with the first of some files that shall hold another form than its name says.
pub fn misnamed<'p>(targets: impl IntoIterator<Item = (Option<&'p Path>, Form)>) -> Option<String> {
    targets.into_iter().find_map(|(path, form)| {
        let path = path?;
        let named = form_of(path).filter(|named| *named != form)?;
        let (path, named, form) = (path.display(), named.word(), form.word());
        Some(format!(
            "`{path}` is named as {named}, and what is written there is {form}"
        ))
    })
}

/// Where results go: standard output or a file that is written as a whole at the end.
pub struct Sink {
    path: PathBuf,
    bytes: Vec<u8>,
}

impl Sink {
    /// A sink for JSON objects, each on a line: these where the path is `-` or ends in `.jsonl`, elsewhere one document,
    /// the only object of what has one or an array of them.
    pub fn objects(path: &Path, lines: &str, has_one: bool) -> Self {
        let is_lines = path
            .extension()
            .is_some_and(|extension| extension.eq_ignore_ascii_case("jsonl"));
        let is_object = has_one && !lines.is_empty();
        if is_object || is_lines || is_standard(path) {
            return Sink::with(path, lines);
        }
        let objects: Vec<&str> = lines.lines().collect();
        let text = match objects[..] {
            [] => "[]\n".to_owned(),
            _ => format!("[\n{}\n]\n", objects.join(",\n")),
        };
        Sink::with(path, text)
    }

    /// A sink for a path, `-` for standard output, with all it takes.
    pub fn with(path: &Path, bytes: impl Into<Vec<u8>>) -> Self {
        Sink {
            path: path.to_owned(),
            bytes: bytes.into(),
        }
    }

    /// Writes everything; problems with the file are told on the error stream.
    pub fn finish(self, streams: &mut Streams<'_>) -> io::Result<bool> {
        if is_standard(&self.path) {
            streams.out.write_all(&self.bytes)?;
            return Ok(true);
        }
        match write(&self.path, &self.bytes) {
            Ok(()) => Ok(true),
            Err(error) => {
                error.tell(streams)?;
                Ok(false)
            }
        }
    }
}
