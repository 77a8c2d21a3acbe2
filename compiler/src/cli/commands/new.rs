//! `nsdc new`

use std::fs;
use std::path::Path;

use crate::cli::{Exit, Streams, files, io};

/// What a new folder holds: names and texts.
const FILES: [(&str, &str); 6] = [
    ("slider.nsd", include_str!("../../../template/slider.nsd")),
    (
        "slider.golden/swings.system",
        include_str!("../../../template/slider.golden/swings.system"),
    ),
    (
        "slider.golden/swings.stewart.dcs",
        include_str!("../../../template/slider.golden/swings.stewart.dcs"),
    ),
    (
        "slider.golden/swings.numbers",
        include_str!("../../../template/slider.golden/swings.numbers"),
    ),
    ("README.md", include_str!("../../../template/README.md")),
    (".gitignore", include_str!("../../../template/gitignore")),
];

/// Makes a folder with a small model, its expectations and a README.
pub fn run(path: &Path, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let shown = path.display();
    let name = path.file_name().map(|name| name.to_string_lossy());
    let Some(name) = name.filter(|name| !name.starts_with('-')) else {
        writeln!(streams.err, "error: `{shown}` does not name a new folder")?;
        return Ok(Exit::Wrong);
    };
    if path.symlink_metadata().is_ok() {
        writeln!(
            streams.err,
            "error: `{shown}` is there already\n  help: choose another name; nothing is overwritten"
        )?;
        return Ok(Exit::Wrong);
    }
    if let Err(error) = fs::create_dir_all(path) {
        writeln!(streams.err, "error: cannot make `{shown}`: {error}")?;
        return Ok(Exit::Wrong);
    }
    for (file, text) in FILES {
        let text = text.replace("{name}", &name);
        if let Err(error) = files::write_in_folder(&path.join(file), &text) {
            error.tell(streams)?;
            return Ok(Exit::Wrong);
        }
    }
    writeln!(
        streams.out,
        "made `{shown}` with a model, its tests and a README\n\n  cd {shown}\n  nsdc test .\n  nsdc run slider.nsd"
    )?;
    Ok(Exit::Success)
}
