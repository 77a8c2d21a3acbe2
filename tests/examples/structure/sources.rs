//! Files of code without what only tests read.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};
use syn::spanned::Spanned;

/// Folders of the crates that a user runs.
const CRATES: [&str; 4] = [
    "grammar/src",
    "solver/src",
    "compiler/expr/src",
    "compiler/src",
];

/// A file that is parsed.
pub struct Source {
    /// Its crate, and its path in it.
    pub of: &'static str,
    pub path: String,
    /// Its module, from the crate on.
    pub module: Vec<String>,
    pub items: Vec<syn::Item>,
    /// Lines with code, from 1.
    pub lines: BTreeSet<usize>,
}

impl Source {
    /// Lines with code in this piece of it.
    pub fn lines_of(&self, piece: &impl Spanned) -> usize {
        let span = piece.span();
        self.lines
            .range(span.start().line..=span.end().line)
            .count()
    }

    /// The path from the root of the project.
    pub fn name(&self) -> String {
        format!("{}/{}", self.of, self.path)
    }
}

/// All files of code.
pub fn of(root: &Path) -> Vec<Source> {
    let mut sources = Vec::new();
    for of in CRATES {
        let mut paths = Vec::new();
        collect(&root.join(of), &mut paths);
        paths.sort();
        for path in paths {
            let text = fs::read_to_string(&path).expect("a source file is text");
            let path = path
                .strip_prefix(root.join(of))
                .expect("it is in the crate");
            let path = path.to_string_lossy().into_owned();
            sources.push(parse(of, path, &text));
        }
    }
    sources
}

/// Numbers of entries of all folders; a module of tests is none.
pub fn folders(root: &Path) -> Vec<(String, usize)> {
    let mut found = Vec::new();
    let mut open: Vec<PathBuf> = CRATES.iter().map(|of| root.join(of)).collect();
    while let Some(folder) = open.pop() {
        let inside = entries(&folder);
        let name = folder.strip_prefix(root).expect("it is in the project");
        found.push((name.to_string_lossy().into_owned(), inside.len()));
        open.extend(inside.into_iter().filter(|path| path.is_dir()));
    }
    found.sort();
    found
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder of the project");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    paths.filter(|path| !is_of_tests(path)).collect()
}

fn collect(folder: &Path, paths: &mut Vec<PathBuf>) {
    for path in entries(folder) {
        if path.is_dir() {
            collect(&path, paths);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            paths.push(path);
        }
    }
}

fn is_of_tests(path: &Path) -> bool {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    stem == "tests" || stem.ends_with("_tests") || stem == "fixtures" || stem == "snapshots"
}

fn parse(of: &'static str, path: String, text: &str) -> Source {
    let file = syn::parse_file(text).expect("it compiles");
    let tokens: TokenStream = text.parse().expect("it compiles");
    let text: Vec<&str> = text.lines().collect();
    let mut lines = BTreeSet::new();
    code(tokens, &text, &mut lines);
    let (tests, items): (Vec<_>, Vec<_>) = file.items.into_iter().partition(is_test);
    for item in tests {
        let span = item.span();
        lines.retain(|line| !(span.start().line..=span.end().line).contains(line));
    }
    let module = path.trim_end_matches(".rs").split('/');
    let module = module.filter(|name| !["mod", "lib", "main"].contains(name));
    Source {
        of,
        module: module.map(str::to_owned).collect(),
        path,
        items,
        lines,
    }
}

/// Lines on which a token starts or ends that is no comment.
fn code(tokens: TokenStream, text: &[&str], lines: &mut BTreeSet<usize>) {
    for token in tokens {
        let start = token.span().start();
        let line: String = text[start.line - 1].chars().skip(start.column).collect();
        if line.starts_with("//") || line.starts_with("/*") {
            continue;
        }
        lines.extend([start.line, token.span().end().line]);
        if let TokenTree::Group(group) = token {
            code(group.stream(), text, lines);
        }
    }
}

/// Whether an item is compiled for tests alone.
fn is_test(item: &syn::Item) -> bool {
    let attributes = match item {
        syn::Item::Mod(item) => &item.attrs,
        syn::Item::Fn(item) => &item.attrs,
        syn::Item::Impl(item) => &item.attrs,
        syn::Item::Use(item) => &item.attrs,
        _ => return false,
    };
    attributes.iter().any(|attribute| {
        let meta = &attribute.meta;
        let is_cfg = meta.path().is_ident("cfg");
        is_cfg
            && meta
                .require_list()
                .is_ok_and(|list| list.tokens.to_string() == "test")
    })
}
