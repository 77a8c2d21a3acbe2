//! Texts that the program holds, as files that an editor can open: the standard library, and the pages of `nsdc explain`.

use std::env;
use std::path::{Path, PathBuf};

use crate::cli::files;
use crate::source::files::{Disk, Files};

/// The folder of the standard library.
const STANDARD: &str = "std";

/// The folder of this version of the program.
fn home() -> Option<PathBuf> {
    let home = || {
        Some(
            PathBuf::from(env::var_os("HOME").or_else(|| env::var_os("USERPROFILE"))?)
                .join(".cache"),
        )
    };
    let cache = env::var_os("XDG_CACHE_HOME")
        .map(PathBuf::from)
        .or_else(home)?;
    let version = env!("CARGO_PKG_VERSION");
    Some(cache.join("nsdc").join(version))
}

/// Writes a file of the standard library; where that is.
pub fn write_standard(name: &Path, text: &str) -> Option<PathBuf> {
    let name = name.strip_prefix(STANDARD).ok()?;
    write(STANDARD, &name.to_string_lossy(), text)
}

/// The name of a file of the standard library, by the key of what was written of it.
pub fn standard(key: &str) -> Option<String> {
    let folder = Disk.key(&home()?.join(STANDARD));
    let name = Path::new(key).strip_prefix(folder).ok()?;
    Some(format!("{STANDARD}/{}", name.to_string_lossy()))
}

/// Writes a text where it is not yet, into a folder of this version of the program; where that is.
pub fn write(folder: &str, name: &str, text: &str) -> Option<PathBuf> {
    let path = home()?.join(folder).join(name);
    let there = std::fs::read_to_string(&path);
    if there.is_ok_and(|there| there == text) {
        return Some(path);
    }
    files::write_in_folder(&path, text).ok()?;
    Some(path)
}
