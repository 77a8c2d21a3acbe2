//! What is written in Markdown: links lead somewhere, models are right, the tutorial does what it shows, and every
//! example is in the index.

use std::fs;
use std::path::{Path, PathBuf};

use crate::terminal::{Ran, folder, nsdc};
use nsdc::diagnostics::Diagnostics;
use nsdc::source::SourceMap;
use nsdc::syntax::{self, Item};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Folders of the repository; others beside them, as what peers are installed in, are not its own.
const FOLDERS: [&str; 6] = [
    "compiler", "examples", "grammar", "solver", "stdlib", "tests",
];

/// All Markdown files of the repository.
fn documents() -> Vec<PathBuf> {
    let mut found = files("md");
    found.push(root().join("README.md"));
    found.sort();
    assert!(found.len() > 100, "{} documents", found.len());
    found
}

/// All files of the folders with that extension, without what builds and snapshots leave behind.
fn files(extension: &str) -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = FOLDERS.iter().map(|name| root().join(name)).collect();
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        let entries = fs::read_dir(&folder).expect("folders of the repository are readable");
        for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if path.is_dir() {
                let built = ["target", "snapshots", "corpus"];
                if !name.starts_with('.') && !built.contains(&&*name) {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|kind| kind == extension) {
                found.push(path);
            }
        }
    }
    found
}

/// A fenced block: what stands behind the fence, and its lines.
struct Block {
    info: String,
    text: String,
}

/// The fenced blocks of a document, and its other lines, both in order.
fn parts(text: &str) -> (Vec<Block>, Vec<&str>) {
    let (mut blocks, mut prose) = (Vec::new(), Vec::new());
    let mut open: Option<Block> = None;
    for line in text.lines() {
        match (open.as_mut(), line.trim_start().strip_prefix("```")) {
            (None, Some(info)) => {
                let info = info.trim().to_owned();
                open = Some(Block {
                    info,
                    text: String::new(),
                });
            }
            (None, None) => prose.push(line),
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (Some(block), None) => {
                block.text.push_str(line);
                block.text.push('\n');
            }
        }
    }
    assert!(open.is_none(), "a fence is not closed");
    (blocks, prose)
}

/// A line without what is in backticks, where no link is a link.
fn without_code(line: &str) -> String {
    let pieces = line.split('`').enumerate();
    pieces
        .filter_map(|(k, piece)| (k % 2 == 0).then_some(piece))
        .collect()
}

/// What the links of a line lead to: `[text](target)`.
fn targets(line: &str) -> Vec<String> {
    let line = without_code(line);
    let rest = line.split("](").skip(1);
    rest.filter_map(|rest| Some(rest.split_once(')')?.0.to_owned()))
        .collect()
}

/// The anchor that GitHub gives a heading: lower case, blanks as hyphens, no other signs.
fn anchor(heading: &str) -> String {
    let text = heading.trim_start_matches('#').trim().to_lowercase();
    let kept = text.chars().filter_map(|c| match c {
        ' ' => Some('-'),
        '-' | '_' => Some(c),
        _ => c.is_alphanumeric().then_some(c),
    });
    kept.collect()
}

/// What is wrong with a link in a document, if anything.
fn broken(document: &Path, target: &str) -> Option<String> {
    if ["http://", "https://", "mailto:"]
        .iter()
        .any(|scheme| target.starts_with(scheme))
    {
        return None;
    }
    if target.contains(' ') {
        return Some(format!("{}: a blank in `{target}`", document.display()));
    }
    let (file, heading) = target.split_once('#').unwrap_or((target, ""));
    let beside = document.parent().expect("a document is in a folder");
    let path = match file {
        "" => document.to_path_buf(),
        file => beside.join(file),
    };
    if !path.exists() {
        return Some(format!("{}: no `{target}`", document.display()));
    }
    if heading.is_empty() {
        return None;
    }
    let text = read(&path);
    let mut headings = parts(&text)
        .1
        .into_iter()
        .filter(|line| line.starts_with('#'));
    let is_there = headings.any(|line| anchor(line) == heading);
    (!is_there).then(|| format!("{}: no heading for `{target}`", document.display()))
}

/// The source files that a line names in backticks: `selector/select.rs`.
fn sources(line: &str) -> impl Iterator<Item = &str> {
    let codes = line.split('`').skip(1).step_by(2);
    codes.filter(|code| {
        let is_path = |stem: &str| {
            stem.chars()
                .all(|c| c.is_ascii_alphanumeric() || "_/".contains(c))
        };
        code.strip_suffix(".rs").is_some_and(is_path)
    })
}

/// In documents and in comments; files that move take their names with them.
#[test]
fn sources_that_are_named_are_there() {
    let known = files("rs");
    let (mut count, mut wrong) = (0, Vec::new());
    for path in documents().iter().chain(&known) {
        let is_source = path.extension().is_some_and(|kind| kind == "rs");
        for line in read(path).lines() {
            if is_source && !line.trim_start().starts_with("//") {
                continue;
            }
            for name in sources(line) {
                count += 1;
                if !known.iter().any(|file| file.ends_with(name)) {
                    wrong.push(format!("{}: no `{name}`", path.display()));
                }
            }
        }
    }
    assert!(count > 100, "{count} names");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn links_lead_somewhere() {
    let (mut count, mut wrong) = (0, Vec::new());
    for document in documents() {
        let text = read(&document);
        for target in parts(&text).1.into_iter().flat_map(targets) {
            count += 1;
            wrong.extend(broken(&document, &target));
        }
    }
    assert!(count > 50, "{count} links");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn broken_links_are_found() {
    let readme = root().join("README.md");
    let look = |line: &str| -> Vec<bool> {
        let found = targets(line).into_iter();
        found
            .map(|target| broken(&readme, &target).is_some())
            .collect()
    };
    assert_eq!(look("[a](README.md) and [b](NOWHERE.md)"), [false, true]);
    assert_eq!(look("[a](#use), [b](README.md#nowhere)"), [false, true]);
    assert_eq!(look("`[a](NOWHERE.md)` is code"), [false; 0]);
}

/// Whole models in the documents that users read; pages of `nsdc explain` have a test of their own.
#[test]
fn models_in_documents_pass() {
    let mut count = 0;
    for document in documents() {
        if document
            .parent()
            .is_some_and(|folder| folder.ends_with("explain"))
        {
            continue;
        }
        let text = read(&document);
        let models = parts(&text)
            .0
            .into_iter()
            .filter(|block| block.info == "nsd");
        for (k, block) in models.enumerate() {
            count += 1;
            let at = folder("documents");
            fs::write(at.join("model.nsd"), &block.text).expect("the folder is writable");
            for command in ["check", "test"] {
                let Ran { status, out, err } = nsdc(&at, &[command, "model.nsd"]);
                assert_eq!(status, 0, "{} {k}: {out}{err}", document.display());
            }
        }
    }
    assert!(count >= 2, "{count} models");
}

/// Whether two words are the same, or numbers that are close.
fn same_word(shown: &str, word: &str) -> bool {
    let signs = |c: char| "[](),".contains(c);
    let numbers = (
        shown.trim_matches(signs).parse::<f64>(),
        word.trim_matches(signs).parse::<f64>(),
    );
    match numbers {
        (Ok(a), Ok(b)) => (a - b).abs() <= 1e-9 + 1e-9 * b.abs(),
        _ => shown == word,
    }
}

fn same_line(shown: &str, line: &str) -> bool {
    let words = |line: &str| -> Vec<String> {
        let parts = line.split(|c: char| c.is_whitespace() || c == ',');
        parts
            .filter(|part| !part.is_empty())
            .map(str::to_owned)
            .collect()
    };
    let (shown, line) = (words(shown), words(line));
    shown.len() == line.len() && shown.iter().zip(&line).all(|(a, b)| same_word(a, b))
}

/// Whether lines are those that are shown, where `...` stands for any number of them.
fn as_shown(shown: &[&str], lines: &[&str]) -> bool {
    match (shown, lines) {
        ([], []) => true,
        (["...", rest @ ..], _) => (0..=lines.len()).any(|k| as_shown(rest, &lines[k..])),
        ([first, shown @ ..], [line, lines @ ..]) => {
            same_line(first, line) && as_shown(shown, lines)
        }
        _ => false,
    }
}

#[test]
fn other_output_is_found() {
    assert!(as_shown(
        &["a 1.0", "..."],
        &["a  1.0000000000001", "b", "c"]
    ));
    assert!(!as_shown(&["a 1.0", "..."], &["a 1.001"]));
    assert!(!as_shown(&["a", "...", "d"], &["a", "b", "c"]));
    assert!(!as_shown(&["a"], &["a", "b"]));
}

/// Files and commands of the tutorial in their order, each command with the output below it.
#[test]
fn the_tutorial_does_what_it_shows() {
    does_what_it_shows("TUTORIAL.md", 15);
}

#[test]
fn the_second_part_does_what_it_shows() {
    does_what_it_shows("TUTORIAL_2.md", 13);
}

/// Files and commands of a document among the examples, of which there are some at least.
fn does_what_it_shows(name: &str, least: usize) {
    let text = read(&root().join("examples").join(name));
    let at = folder(name);
    let mut commands = 0;
    for block in parts(&text).0 {
        let info: Vec<&str> = block.info.split(' ').collect();
        match info[..] {
            ["nsd", name] => {
                fs::write(at.join(name), &block.text).expect("the folder is writable");
                let Ran { status, err, .. } = nsdc(&at, &["fmt", "--check", name]);
                assert_eq!(status, 0, "{name} is laid out in another way: {err}");
            }
            ["csv", name] => {
                fs::write(at.join(name), &block.text).expect("the folder is writable");
            }
            ["console"] => commands += run_as_shown(&at, &block.text),
            _ => panic!("a block `{}`", block.info),
        }
    }
    assert!(commands >= least, "{commands} commands");
}

/// Runs the commands of a block; a status that is not 0 is shown by `echo $?`.
fn run_as_shown(at: &Path, block: &str) -> usize {
    let mut sessions: Vec<(&str, Vec<&str>)> = Vec::new();
    for line in block.lines() {
        match line.strip_prefix("$ ") {
            Some(command) => sessions.push((command, Vec::new())),
            None => sessions
                .last_mut()
                .expect("a block starts with a command")
                .1
                .push(line),
        }
    }
    let mut ran = 0;
    for (k, (command, shown)) in sessions.iter().enumerate() {
        let args: Vec<&str> = command.split(' ').collect();
        if args[0] != "nsdc" {
            assert_eq!(*command, "echo $?");
            continue;
        }
        let Ran { status, out, err } = nsdc(at, &args[1..]);
        let next = sessions.get(k + 1).filter(|next| next.0 == "echo $?");
        let expected = next.map_or("0", |next| next.1[0]);
        assert_eq!(status.to_string(), expected, "{command}: {out}{err}");
        let output = format!("{out}{err}");
        let lines: Vec<&str> = output.trim_end().lines().collect();
        assert!(as_shown(shown, &lines), "{command} gives\n{output}");
        ran += 1;
    }
    ran
}

/// Every example stands in the index of its folder, with all of its experiments.
#[test]
fn every_example_is_in_the_index() {
    let index = read(&root().join("examples/README.md"));
    let index: Vec<&str> = index.lines().collect();
    let entries = fs::read_dir(root().join("examples")).expect("the examples are there");
    let mut count = 0;
    for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
        if path.extension().is_none_or(|extension| extension != "nsd") {
            continue;
        }
        let name = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let row = index
            .iter()
            .find(|line| line.contains(&format!("]({name})")));
        let row = row.unwrap_or_else(|| panic!("`{name}` is not in the index"));
        let mut sources = SourceMap::new();
        let file = syntax::parse(&sources.add(&name, read(&path)), &mut Diagnostics::new());
        for item in &file.items {
            if let Item::Experiment(experiment) = item {
                let experiment = &experiment.name.name;
                assert!(
                    row.contains(&format!("`{experiment}`")),
                    "{name}: `{experiment}`"
                );
                count += 1;
            }
        }
    }
    assert!(count > 90, "{count} experiments");
}
