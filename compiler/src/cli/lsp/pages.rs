//! Texts that the program holds, as files that an editor can open: the standard library, and the pages of `nsdc explain`.

use std::env;
use std::path::PathBuf;

use crate::cli::files;

/// Writes a text where it is not yet, into a folder of this version of the program; where that is.
pub fn write(folder: &str, name: &str, text: &str) -> Option<PathBuf> {
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
    let path = cache.join("nsdc").join(version).join(folder).join(name);
    let there = std::fs::read_to_string(&path);
    if there.is_ok_and(|there| there == text) {
        return Some(path);
    }
    files::write_in_folder(&path, text).ok()?;
    Some(path)
}
