//! Sizes of the code that a reader meets: lines, methods and fields of a type, lines of a function, entries of a folder,
//! and files that import each other in a circle.
//!
//! ```sh
//! cargo run -p nsd-tests --example structure              # compares with tests/structure.csv
//! cargo run -p nsd-tests --example structure -- --list    # says where what is too large is, too
//! cargo run -p nsd-tests --example structure -- --accept  # writes tests/structure.csv
//! ```
//!
//! Blank lines, comments, documentation and tests do not count. Nothing may become worse than what the file keeps.

#[path = "structure/imports.rs"]
mod imports;
#[path = "structure/items.rs"]
mod items;
#[path = "structure/sources.rs"]
mod sources;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use sources::Source;

/// Entries of a folder, methods and fields of a type, lines of a function, entries of a tuple that is a parameter, and
/// files of a circle, at most.
const ENTRIES: usize = 16;
const METHODS: usize = 25;
const FIELDS: usize = 12;
const LINES: usize = 80;
const TUPLE: usize = 2;
const CIRCLE: usize = 5;

/// How much there is of something of which less is better, and where.
struct Measure {
    name: &'static str,
    count: usize,
    places: Vec<String>,
}

impl Measure {
    fn of(name: &'static str, places: Vec<String>) -> Self {
        Measure {
            name,
            count: places.len(),
            places,
        }
    }
}

fn main() -> ExitCode {
    let has = |flag: &str| std::env::args().any(|arg| arg == flag);
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let sources = sources::of(&root);
    let measures = measure(&root, &sources);
    if has("--list") {
        for measure in &measures {
            for place in &measure.places {
                print(&format!("{}: {place}", measure.name));
            }
        }
    }
    compare(&measures, has("--accept"))
}

fn measure(root: &Path, sources: &[Source]) -> Vec<Measure> {
    let found = items::of(sources);
    let beyond = |sizes: &[(String, usize)], most: usize| {
        let large = sizes.iter().filter(|(_, size)| *size > most);
        large
            .map(|(name, size)| format!("{name} has {size}"))
            .collect::<Vec<_>>()
    };
    let circles = imports::circles(sources);
    let large = circles.iter().filter(|circle| circle.len() > CIRCLE);
    vec![
        Measure {
            name: "lines of code",
            count: sources.iter().map(|source| source.lines.len()).sum(),
            places: Vec::new(),
        },
        Measure::of(
            "folders with more than 16 entries",
            beyond(&sources::folders(root), ENTRIES),
        ),
        Measure::of(
            "types with more than 25 methods",
            beyond(&found.methods, METHODS),
        ),
        Measure::of(
            "types with more than 12 fields",
            beyond(&found.fields, FIELDS),
        ),
        Measure::of(
            "functions with more than 80 lines",
            beyond(&found.functions, LINES),
        ),
        Measure::of(
            "parameters that are tuples of more than two",
            beyond(&found.tuples, TUPLE),
        ),
        Measure {
            name: "files in import circles of more than 5",
            count: large.clone().map(Vec::len).sum(),
            places: large.map(|circle| circle.join(" ")).collect(),
        },
    ]
}

/// The file of kept counts: measure, count.
fn kept() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("structure.csv")
}

fn compare(measures: &[Measure], accept: bool) -> ExitCode {
    let text = fs::read_to_string(kept()).unwrap_or_default();
    let before = |name: &str| {
        let mut rows = text.lines().filter_map(|line| line.split_once(','));
        rows.find(|row| row.0 == name)?.1.parse::<usize>().ok()
    };
    let mut new = String::from("measure,count\n");
    let mut failed = false;
    for Measure { name, count, .. } in measures {
        let _ = writeln!(new, "{name},{count}");
        let most = before(name).unwrap_or(0);
        let is_worse = *count > most;
        failed |= is_worse;
        let remark = if is_worse { "  more" } else { "" };
        print(&format!("{name:<44} {count:>7} {most:>7}{remark}"));
    }
    if accept {
        fs::write(kept(), new).expect("the folder of the tests is writable");
    } else if failed {
        print("`-- --list` says where; what has a reason is kept by `-- --accept`");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

#[allow(clippy::print_stdout, reason = "a program that prints its table")]
fn print(text: &str) {
    println!("{text}");
}
