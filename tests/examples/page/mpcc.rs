//! Collections of programs with complementarity constraints.

use std::fs;
use std::path::Path;

use nsdc::cli::{self, Meter, Streams};
use nsdc::limit::Cancel;

use super::{figure, print};

/// Folders of `.nl` files, which are not part of this repository.
const FOLDERS: &str = "NSDC_MPCC_FOLDERS";

/// The performance profile and the count of each folder.
pub fn write(figures: &Path) -> String {
    let Ok(folders) = std::env::var(FOLDERS) else {
        print(&format!("skipped: {FOLDERS} names no folders of .nl files"));
        return format!("Skipped: `{FOLDERS}` named no folders of `.nl` files.\n");
    };
    let mut text = String::from(
        "`nsdc solve FOLDER`; what counts as solved is under [the command line](../grammar/README.md#the-command-line).\n",
    );
    for folder in folders.split(':').map(Path::new) {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        print(&name);
        let plot = figures.join("profile.svg");
        let (mut out, mut err) = (Vec::new(), Vec::new());
        let mut streams = Streams {
            out: &mut out,
            err: &mut err,
            colour: false,
            meter: Meter::None,
            cancel: Cancel::default(),
            width: 100,
            files: cli::terminal(),
        };
        let args = [
            "nsdc".into(),
            "solve".into(),
            folder.into(),
            "--plot".into(),
            plot.clone().into(),
        ];
        cli::run(args, &mut streams);
        let told = String::from_utf8_lossy(&out).into_owned();
        let summary = told.trim_end().rsplit("\n\n").next().unwrap_or_default();
        let svg = fs::read_to_string(&plot).unwrap_or_default();
        let _ = fs::remove_file(&plot);
        let shown = figure(figures, &format!("mpcc-{name}"), &name, &svg);
        text.push_str(&format!(
            "\n### {name}\n\n{shown}\n```text\n{summary}\n```\n"
        ));
    }
    text
}
