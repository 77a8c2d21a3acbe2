//! Which files import which: a name counts for the file that defines it, not for one that hands it on.

use std::collections::{BTreeMap, BTreeSet};

use petgraph::algo::tarjan_scc;
use petgraph::graph::DiGraph;
use syn::visit::{self, Visit};

use super::sources::Source;

/// What a path stands for, in the crate of a file.
pub struct Names<'a> {
    sources: &'a [Source],
    /// Files by crate and module.
    files: BTreeMap<(&'a str, &'a [String]), usize>,
    /// What a file calls by another path, from the crate on.
    imported: Vec<BTreeMap<String, Vec<String>>>,
}

impl<'a> Names<'a> {
    /// Names of all files.
    pub fn of(sources: &'a [Source]) -> Self {
        let key = |source: &'a Source| (source.of, &source.module[..]);
        let numbered = sources.iter().enumerate();
        Names {
            sources,
            files: numbered.map(|(file, source)| (key(source), file)).collect(),
            imported: sources.iter().map(imported).collect(),
        }
    }

    /// The file that defines what a path in this one names, if the crate does.
    pub fn find(&self, source: &Source, path: &[String]) -> Option<usize> {
        self.follow(source, &absolute(source, path), 8)
    }

    fn follow(&self, source: &Source, path: &[String], left: usize) -> Option<usize> {
        let of = source.of;
        let known = (0..=path.len()).rev();
        let (file, rest) = known
            .filter_map(|n| Some((*self.files.get(&(of, &path[..n]))?, &path[n..])))
            .next()?;
        let handed_on = rest.first().and_then(|name| self.imported[file].get(name));
        match handed_on {
            Some(other) if left > 0 => {
                let other: Vec<String> = other.iter().chain(&rest[1..]).cloned().collect();
                self.follow(&self.sources[file], &other, left - 1)
            }
            _ => Some(file),
        }
    }
}

/// Files that import each other in a circle, each with its path.
pub fn circles(sources: &[Source]) -> Vec<Vec<String>> {
    let names = Names::of(sources);
    let mut graph = DiGraph::<usize, ()>::new();
    let nodes: Vec<_> = (0..sources.len())
        .map(|file| graph.add_node(file))
        .collect();
    for (from, source) in sources.iter().enumerate() {
        let mut paths = Paths::default();
        source.items.iter().for_each(|item| paths.visit_item(item));
        let to: BTreeSet<usize> = paths
            .found
            .iter()
            .filter_map(|path| names.find(source, path))
            .collect();
        for to in to.into_iter().filter(|&to| to != from) {
            graph.add_edge(nodes[from], nodes[to], ());
        }
    }
    let mut circles: Vec<Vec<String>> = tarjan_scc(&graph)
        .into_iter()
        .map(|circle| {
            circle
                .iter()
                .map(|&node| sources[graph[node]].name())
                .collect()
        })
        .collect();
    circles.iter_mut().for_each(|circle| circle.sort());
    circles.sort();
    circles
}

/// A path from the crate on.
fn absolute(source: &Source, path: &[String]) -> Vec<String> {
    let mut module = source.module.clone();
    let mut rest = path;
    match path.first().map(String::as_str) {
        Some("crate") => (module, rest) = (Vec::new(), &path[1..]),
        Some("self") => rest = &path[1..],
        _ => {}
    }
    while rest.first().is_some_and(|name| name == "super") {
        module.pop();
        rest = &rest[1..];
    }
    module.extend_from_slice(rest);
    module
}

/// Names that `use` gives to paths of the crate.
fn imported(source: &Source) -> BTreeMap<String, Vec<String>> {
    let mut names = BTreeMap::new();
    for item in &source.items {
        if let syn::Item::Use(item) = item {
            for (name, path) in leaves(&item.tree) {
                let first = path.first().map_or("", String::as_str);
                let is_child = source
                    .items
                    .iter()
                    .any(|item| matches!(item, syn::Item::Mod(child) if child.ident == first));
                if is_child || ["crate", "self", "super"].contains(&first) {
                    names.insert(name, absolute(source, &path));
                }
            }
        }
    }
    names
}

/// The names that a `use` brings, and what they stand for.
fn leaves(tree: &syn::UseTree) -> Vec<(String, Vec<String>)> {
    match tree {
        syn::UseTree::Path(tree) => {
            let head = tree.ident.to_string();
            let mut inside = leaves(&tree.tree);
            for (name, path) in &mut inside {
                match path.first().is_some_and(|first| first == "self") {
                    true if name == "self" => *name = head.clone(),
                    _ => {}
                }
                path.retain(|part| part != "self");
                path.insert(0, head.clone());
            }
            inside
        }
        syn::UseTree::Group(tree) => tree.items.iter().flat_map(leaves).collect(),
        syn::UseTree::Name(tree) => {
            let name = tree.ident.to_string();
            vec![(name.clone(), vec![name])]
        }
        syn::UseTree::Rename(tree) => {
            vec![(tree.rename.to_string(), vec![tree.ident.to_string()])]
        }
        syn::UseTree::Glob(_) => Vec::new(),
    }
}

/// Paths of the crate that a file uses; what it only hands on is not among them.
#[derive(Default)]
struct Paths {
    found: Vec<Vec<String>>,
}

impl<'ast> Visit<'ast> for Paths {
    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        if matches!(item.vis, syn::Visibility::Inherited) {
            self.found
                .extend(leaves(&item.tree).into_iter().map(|leaf| leaf.1));
        }
    }

    /// `pub(super)` imports nothing.
    fn visit_visibility(&mut self, _: &'ast syn::Visibility) {}

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let parts = path.segments.iter().map(|part| part.ident.to_string());
        let parts: Vec<String> = parts.collect();
        if ["crate", "super"].contains(&parts[0].as_str()) {
            self.found.push(parts);
        }
        visit::visit_path(self, path);
    }
}
