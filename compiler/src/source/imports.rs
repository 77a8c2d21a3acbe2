//! `use`: finds, reads and links the files that a file imports.
//!
//! Reading is the business of a [`Loader`]; the standard library is embedded and needs none. Files
//! are read once each, then linked in an order where each comes after what it imports, so that a
//! circle of imports is a circle in a graph and not one in the program.

use std::collections::HashMap;
use std::sync::Arc;

use miette::Diagnostic;
use petgraph::algo::tarjan_scc;
use petgraph::graph::{DiGraph, NodeIndex};
use thiserror::Error;

use crate::diagnostics::{Applicability, Diagnostics, Fix, Fixable, Help};
use crate::model::hir::reserved::one_of;
use crate::source::table::Source;
use crate::source::{SourceMap, Span, table};
use crate::syntax::{self, File, Ident, Item, Link, Use, UseSource};

/// The standard library: names of modules and their texts.
pub const STANDARD: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/stdlib.rs"));

/// The text of a module of the standard library.
pub fn standard_text(module: &str) -> Option<&'static str> {
    let mut all = STANDARD.iter();
    all.find(|(name, _)| *name == module).map(|(_, text)| *text)
}

/// Files that import files that import files.
const MAX_DEPTH: usize = 64;

/// Reads imported files.
pub trait Loader {
    /// The file that `path` means in the file known as `from`: the text between `use` and what follows.
    fn load(&mut self, from: &str, path: &str) -> Result<Loaded, NotLoaded>;
    /// The bytes of the file of data that `path` names in the file known as `from`.
    fn data(&mut self, from: &str, path: &str) -> Result<Vec<u8>, NotLoaded>;
}

/// A file that has been read.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The same for the same file, however it was reached.
    pub key: String,
    /// Its name in diagnostics.
    pub name: String,
    /// What is in it.
    pub bytes: Vec<u8>,
}

/// Why there is no such file.
#[derive(Clone, Debug)]
pub struct NotLoaded {
    /// Where it was looked for.
    pub tried: String,
    /// Why that failed.
    pub reason: String,
}

/// A loader that finds nothing: the standard library is there without one.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoFiles;

impl Loader for NoFiles {
    fn load(&mut self, _: &str, path: &str) -> Result<Loaded, NotLoaded> {
        Err(NotLoaded {
            tried: format!("{path}.nsd"),
            reason: "files are not read here".to_owned(),
        })
    }

    fn data(&mut self, _: &str, path: &str) -> Result<Vec<u8>, NotLoaded> {
        Err(NotLoaded {
            tried: path.to_owned(),
            reason: "files are not read here".to_owned(),
        })
    }
}

/// A mistake in a `use` (E01).
#[derive(Clone, Debug, Diagnostic, Error)]
#[allow(
    missing_docs,
    reason = "fields are the words of the message; labels say the rest"
)]
pub enum ImportError {
    /// A file that cannot be read.
    #[error("cannot import `{path}`")]
    #[diagnostic(code(E0119))]
    Missing {
        path: String,
        why: String,
        #[label("{why}")]
        span: Span,
        #[help]
        help: Option<Help>,
    },

    /// Files that import each other.
    #[error("`{name}` imports itself: {chain}")]
    #[diagnostic(code(E0120), help("move what both need into a file of its own"))]
    Circle {
        name: String,
        chain: String,
        #[label("the circle begins here")]
        first: Option<Span>,
        #[label(primary, "leads back to `{name}`")]
        span: Span,
    },

    /// Imports of imports of imports.
    #[error("imports are nested more than {limit} deep")]
    #[diagnostic(code(E0120), help("import what is needed directly"))]
    Deep {
        limit: usize,
        #[label("too deep")]
        span: Span,
    },
}

impl Fixable for ImportError {
    fn fix(&self) -> Option<Fix> {
        match self {
            ImportError::Missing { help, span, .. } => help.as_ref()?.fix(*span),
            _ => None,
        }
    }
}

/// A file with what it imports, by the positions of its items.
struct Read {
    name: String,
    key: String,
    file: File,
    imports: Vec<(usize, usize)>,
}

/// Reads what `file` imports, directly or not, and links it, and the data that their signals name; `key`
/// is what a loader calls the file.
pub fn link(
    file: &mut File,
    key: &str,
    loader: &mut dyn Loader,
    sources: &mut SourceMap,
    diags: &mut Diagnostics,
) {
    if !file.items.iter().any(|item| matches!(item, Item::Use(_))) {
        read_data(file, key, loader);
        return;
    }
    let main = std::mem::replace(
        file,
        File {
            items: vec![],
            data: table::Sources::new(),
            span: file.span,
        },
    );
    let name = sources
        .file(main.span)
        .map(|source| source.name.clone())
        .unwrap_or_default();
    let mut read = vec![Read {
        name,
        key: key.to_owned(),
        file: main,
        imports: vec![],
    }];
    let mut known: HashMap<String, usize> = HashMap::from([(key.to_owned(), 0)]);
    // The list grows while it is walked.
    let mut next = 0;
    while next < read.len() {
        for position in 0..read[next].file.items.len() {
            let Item::Use(item) = &read[next].file.items[position] else {
                continue;
            };
            let loaded = load(item, &read[next].key, loader, diags);
            let target = loaded.map(|loaded| {
                *known.entry(loaded.key.clone()).or_insert_with(|| {
                    let source = sources.add_bytes(loaded.name.clone(), loaded.bytes);
                    read.push(Read {
                        name: loaded.name,
                        key: loaded.key,
                        file: syntax::parse(&source, diags),
                        imports: vec![],
                    });
                    read.len() - 1
                })
            });
            match target {
                Some(target) => read[next].imports.push((position, target)),
                None => set_link(&mut read[next].file, position, Link::Failed),
            }
        }
        let one = &mut read[next];
        read_data(&mut one.file, &one.key, loader);
        next += 1;
    }
    *file = join(read, diags);
}

/// Puts files into those that import them, innermost first.
fn join(mut read: Vec<Read>, diags: &mut Diagnostics) -> File {
    let mut graph = DiGraph::<usize, ()>::new();
    let nodes: Vec<NodeIndex> = (0..read.len()).map(|index| graph.add_node(index)).collect();
    for (index, one) in read.iter().enumerate() {
        for &(_, target) in &one.imports {
            graph.add_edge(nodes[index], nodes[target], ());
        }
    }
    let mut linked: Vec<Option<Arc<File>>> = vec![None; read.len()];
    let mut depths = vec![0; read.len()];
    // Components come with what they reach before them.
    for component in tarjan_scc(&graph) {
        let mut members: Vec<usize> = component.iter().map(|node| graph[*node]).collect();
        members.sort_unstable();
        let first = members[0];
        let in_circle = members.len() > 1 || graph.contains_edge(nodes[first], nodes[first]);
        if in_circle {
            diags.push(circle(&read, &members));
        }
        for index in members.iter().copied() {
            for (position, target) in read[index].imports.clone() {
                let link = match &linked[target] {
                    Some(file) if !members.contains(&target) => {
                        depths[index] = depths[index].max(depths[target] + 1);
                        Link::File(Arc::clone(file))
                    }
                    _ => Link::Failed,
                };
                let link = if depths[index] > MAX_DEPTH {
                    if let Item::Use(item) = &read[index].file.items[position] {
                        let (limit, span) = (MAX_DEPTH, item.span);
                        diags.push(ImportError::Deep { limit, span });
                    }
                    depths[index] = 0;
                    Link::Failed
                } else {
                    link
                };
                set_link(&mut read[index].file, position, link);
            }
            let empty = File {
                items: vec![],
                data: table::Sources::new(),
                span: read[index].file.span,
            };
            let file = std::mem::replace(&mut read[index].file, empty);
            linked[index] = Some(Arc::new(file));
        }
    }
    let main = linked.swap_remove(0);
    // The others may hold it only in a circle, and there nothing is linked.
    main.map_or_else(
        || File {
            items: vec![],
            data: table::Sources::new(),
            span: read[0].file.span,
        },
        Arc::unwrap_or_clone,
    )
}

/// A way around in a circle of files, from the first of them.
fn circle(read: &[Read], members: &[usize]) -> ImportError {
    let mut way = vec![members[0]];
    let mut positions = vec![];
    while let Some(&last) = way.last() {
        let inside = read[last]
            .imports
            .iter()
            .filter(|(_, to)| members.contains(to));
        // Back to the start if possible, else on to what is new, else back to anything.
        let best = inside.min_by_key(|(_, to)| match way.iter().position(|seen| seen == to) {
            Some(0) => 0,
            None => 1,
            Some(_) => 2,
        });
        let Some(&(position, to)) = best else {
            break;
        };
        positions.push(position);
        if let Some(start) = way.iter().position(|&seen| seen == to) {
            way.drain(..start);
            positions.drain(..start);
            break;
        }
        way.push(to);
    }
    let names = way.iter().chain(way.first());
    let names: Vec<&str> = names.map(|&index| read[index].name.as_str()).collect();
    let span = |(&index, &position): (&usize, &usize)| match read[index].file.items.get(position) {
        Some(Item::Use(item)) => item.span,
        _ => read[index].file.span,
    };
    let spans: Vec<Span> = way.iter().zip(&positions).map(span).collect();
    let first = &read[way[0]];
    ImportError::Circle {
        name: first.name.clone(),
        chain: names.join(" -> "),
        first: spans.first().copied().filter(|_| spans.len() > 1),
        span: spans.last().copied().unwrap_or(first.file.span),
    }
}

/// Reads the data that the signals and the experiments of a file name.
fn read_data(file: &mut File, key: &str, loader: &mut dyn Loader) {
    let models = file.items.iter().filter_map(|item| match item {
        Item::Model(model) => Some(&model.body),
        _ => None,
    });
    let mut data = table::Sources::new();
    let experiments = file.items.iter().filter_map(|item| match item {
        Item::Experiment(experiment) => Some(experiment.measured()),
        _ => None,
    });
    let measured = experiments.flatten().map(|data| data.file.as_str());
    for path in models.flatten().filter_map(syntax::data_of).chain(measured) {
        data.entry(path.to_owned()).or_insert_with(|| {
            let source = match loader.data(key, path) {
                Ok(bytes) => Source::read(bytes),
                Err(error) => Source::missing(error.tried, error.reason),
            };
            Arc::new(source)
        });
    }
    file.data = data;
}

fn set_link(file: &mut File, position: usize, link: Link) {
    if let Some(Item::Use(item)) = file.items.get_mut(position) {
        item.link = link;
    }
}

/// What a `use` means, read.
fn load(
    item: &Use,
    from: &str,
    loader: &mut dyn Loader,
    diags: &mut Diagnostics,
) -> Option<Loaded> {
    let result = match &item.source {
        UseSource::Relative(path) => loader.load(from, &path.name).map_err(|error| {
            (
                path.name.clone(),
                format!("{}: {}", error.tried, error.reason),
                path.span,
                None,
            )
        }),
        UseSource::Dotted(path) => standard(path),
    };
    let error = match result {
        Ok(loaded) => return Some(loaded),
        Err(error) => error,
    };
    let (path, why, span, help) = error;
    diags.push(ImportError::Missing {
        path,
        why,
        span,
        help,
    });
    None
}

type Missing = (String, String, Span, Option<Help>);

/// `std.friction`
fn standard(path: &[Ident]) -> Result<Loaded, Missing> {
    let words: Vec<&str> = path.iter().map(|word| word.name.as_str()).collect();
    let text = words.join(".");
    let span = match (path.first(), path.last()) {
        (Some(first), Some(last)) => first.span.to(last.span),
        _ => Span::default(),
    };
    let found = match words[..] {
        ["std", name] => standard_text(name).map(|text| (name, text)),
        _ => None,
    };
    if let Some((name, body)) = found {
        return Ok(Loaded {
            key: format!("std.{name}"),
            name: format!("std/{name}.nsd"),
            bytes: body.as_bytes().to_vec(),
        });
    }
    let modules: Vec<String> = (STANDARD.iter())
        .map(|(name, _)| format!("std.{name}"))
        .collect();
    let (why, help) = match words.first() {
        Some(&"std") => (
            "not in the standard library".to_owned(),
            one_of(&text, "there is", modules.iter().map(String::as_str)),
        ),
        _ => ("neither a path nor `std`".to_owned(), {
            let path = format!("./{}", words.join("/"));
            let text = format!("write `use {path};` for a file beside this one");
            Some(Help::edit(text, path, Applicability::Suggestion))
        }),
    };
    Err((text, why, span, help))
}
