//! Lists the pages of `explain/` and the files of the standard library, so that the compiler carries
//! them with it.

use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Path::new(&env::var("CARGO_MANIFEST_DIR")?).join("explain");
    writeln!(io::stdout(), "cargo::rerun-if-changed={}", folder.display())?;

    let pages = table(&folder, "md")?;
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out.join("pages.rs"), pages)?;

    let library = Path::new(&env::var("CARGO_MANIFEST_DIR")?).join("../stdlib");
    writeln!(
        io::stdout(),
        "cargo::rerun-if-changed={}",
        library.display()
    )?;
    fs::write(out.join("stdlib.rs"), table(&library, "nsd")?)?;
    Ok(())
}

/// The names of the files of a folder, each with its text, as an array of pairs.
fn table(folder: &Path, extension: &str) -> Result<String, Box<dyn std::error::Error>> {
    let mut paths: Vec<PathBuf> = match fs::read_dir(folder) {
        Ok(entries) => entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .collect(),
        Err(_) => Vec::new(),
    };
    paths.retain(|path| path.extension().is_some_and(|found| found == extension));
    paths.sort();

    let mut table = String::from("&[\n");
    for path in paths {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        writeln!(
            table,
            "    ({name:?}, include_str!({:?})),",
            path.display().to_string()
        )?;
    }
    table.push_str("]\n");
    Ok(table)
}
