//! The page of benchmarks: runs nsdc and other solvers, and writes `tests/BENCHMARKS.md` with tables and figures.
//!
//! ```sh
//! cargo run --release -p nsd-tests --example page                  # all parts
//! cargo run --release -p nsd-tests --example page -- orders sizes  # these parts, the others stay as they are
//! ```
//!
//! | part | what it runs |
//! | --- | --- |
//! | `orders` | every method of nsdc on every system of the three sources: errors against time |
//! | `peers` | the benches that set other solvers beside; these are left out where they are not installed |
//! | `optimal` | optimal control beside nosnoc: objective and time |
//! | `mpcc` | folders of `.nl` files that `NSDC_MPCC_FOLDERS` names, separated by `:` |
//! | `sizes` | cost against control intervals and against discs |
//!
//! The variables of the peers are those of the benches. Times mean something on an idle machine only.

mod format;
mod mpcc;
mod orders;
mod runs;

use std::fs;
use std::path::{Path, PathBuf};

/// A part of the page: its name, its title, and what writes it.
type Part = (&'static str, &'static str, fn(&Path) -> String);

const PARTS: [Part; 5] = [
    ("orders", "Errors against time", orders::write),
    ("peers", "Other solvers, for an error", runs::peers),
    (
        "optimal",
        "Optimal control: quality and time",
        runs::optimal,
    ),
    (
        "mpcc",
        "Programs with complementarity constraints",
        mpcc::write,
    ),
    ("sizes", "Cost against size", runs::sizes),
];

fn main() {
    let asked: Vec<String> = std::env::args().skip(1).collect();
    let unknown = asked
        .iter()
        .find(|name| PARTS.iter().all(|part| part.0 != **name));
    assert!(unknown.is_none(), "there is no part {unknown:?}");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (page, figures) = (folder.join("BENCHMARKS.md"), folder.join("benchmarks"));
    fs::create_dir_all(&figures).expect("the folder of the tests is writable");
    let before = fs::read_to_string(&page).unwrap_or_default();
    let mut text = String::from(
        "# Benchmarks\n\n\
         Made by `cargo run --release -p nsd-tests --example page`; [README.md](README.md#benchmarks) says how to set up other solvers.\n\
         Take ratios within a table, and no times from one table to another: parts may be of different days.\n",
    );
    for (name, title, write) in PARTS {
        let is_asked = asked.is_empty() || asked.iter().any(|asked| asked == name);
        let body = match (is_asked, kept(&before, name)) {
            (false, Some(kept)) => kept.to_owned(),
            (false, None) => "Not run yet.\n".to_owned(),
            (true, _) => {
                print(&format!("\n== {name}"));
                format!("{}\n{}", machine(), write(&figures))
            }
        };
        text.push_str(&format!(
            "\n## {title}\n\n{}{body}{}",
            opening(name),
            closing(name)
        ));
        // What is done is kept when a later part fails.
        fs::write(&page, &text).expect("the folder of the tests is writable");
    }
}

fn opening(name: &str) -> String {
    format!("<!-- {name} -->\n\n")
}

fn closing(name: &str) -> String {
    format!("\n<!-- end of {name} -->\n")
}

/// What the page has between the marks of a part.
fn kept<'t>(page: &'t str, name: &str) -> Option<&'t str> {
    let rest = page.split_once(&opening(name))?.1;
    Some(rest.split_once(&closing(name))?.0)
}

fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let profile = if cfg!(debug_assertions) {
        ", without optimization of the compiler"
    } else {
        ""
    };
    format!("{cores} cores, {}{profile}.\n", std::env::consts::ARCH)
}

/// A file of the repository.
fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// Writes a figure, and gives the line that shows it; a link has no blanks.
fn figure(figures: &Path, name: &str, alt: &str, svg: &str) -> String {
    let name = name.replace(' ', "-");
    fs::write(figures.join(format!("{name}.svg")), svg)
        .expect("the folder of the figures is writable");
    format!("![{alt}](benchmarks/{name}.svg)\n")
}

#[allow(clippy::print_stdout, reason = "a benchmark says how far it is")]
fn print(text: &str) {
    println!("{text}");
}
