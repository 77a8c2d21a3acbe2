//! What a file may use.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Component, Path};

use lsp_types::{CompletionItem, CompletionItemKind};

use super::super::around::Around;
use super::super::text::{number, path_of};
use super::{Known, item, words};
use crate::source::files::EXTENSION;
use crate::source::imports::{STANDARD, standard_text};
use crate::syntax::{self, Item, Link};

impl Known<'_> {
    /// Files of the standard library, and what is in a file.
    pub(super) fn of_use(&self, around: &Around<'_>) -> Vec<CompletionItem> {
        if around.block() == "use" {
            let head = around.heads.last().map_or(&[][..], Vec::as_slice);
            let path: Vec<&str> = head[1..].iter().map(|token| token.text).collect();
            let is_it = |item: &&syntax::Use| {
                let start = self.good.source().span().start;
                item.span.start - start == number(head[0].start)
            };
            let items = self
                .now
                .project
                .file
                .items
                .iter()
                .chain(&self.good.project.file.items);
            let mut uses = items.filter_map(|item| match item {
                Item::Use(item) => Some(item),
                _ => None,
            });
            if let Some(Link::File(file)) = uses.find(is_it).map(|item| &item.link) {
                return gives(file);
            }
            let text = match path[..] {
                ["std", ".", name, "."] => standard_text(name),
                _ => None,
            };
            return text.map_or(vec![], |text| {
                gives(&crate::project::Project::from_text("std.nsd", text).file)
            });
        }
        let path: String = around.before[1..].iter().map(|token| token.text).collect();
        match (around.before.len(), around.word(1)) {
            (1, _) => words(["std"]),
            _ if path.starts_with('.') => self.files(&path),
            (3, "std") => words(STANDARD.iter().map(|(name, _)| *name)),
            _ => vec![],
        }
    }

    /// Files and folders below a path that is relative to the file itself: on disk, and those that are open.
    fn files(&self, path: &str) -> Vec<CompletionItem> {
        let Some((folder, _)) = path.rsplit_once('/') else {
            return vec![];
        };
        let own = Path::new(&self.now.source().name);
        let folder = own.parent().unwrap_or(own).join(folder);
        let mut found = BTreeMap::new();
        let mut add = |path: &Path, is_folder: bool| {
            let name = match is_folder {
                true => path.file_name(),
                false if path.extension().is_some_and(|known| known == EXTENSION) => {
                    path.file_stem()
                }
                false => None,
            };
            if let Some(name) = name.filter(|_| path != own).and_then(|name| name.to_str())
                && !name.starts_with('.')
            {
                found.insert(name.to_owned(), is_folder);
            }
        };
        for entry in fs::read_dir(&folder)
            .into_iter()
            .flatten()
            .flatten()
            .take(MOST)
        {
            let path = entry.path();
            add(&path, path.is_dir());
        }
        for document in self.world.documents() {
            let path = path_of(&document.uri);
            if path.parent().is_some_and(|known| is_same(known, &folder)) {
                add(&path, false);
            }
        }
        let item = |(name, is_folder): (&String, &bool)| match is_folder {
            true => item(name, CompletionItemKind::FOLDER, None),
            false => item(name, CompletionItemKind::FILE, None),
        };
        found.iter().map(item).collect()
    }
}

/// Entries of a folder that are looked at.
const MOST: usize = 10_000;

/// Whether two paths are one, where `.` and `..` lead.
fn is_same(a: &Path, b: &Path) -> bool {
    let plain = |path: &Path| {
        let mut all = vec![];
        for part in path.components() {
            match part {
                Component::CurDir => {}
                Component::ParentDir => drop(all.pop()),
                part => all.push(part.as_os_str().to_owned()),
            }
        }
        all
    };
    plain(a) == plain(b)
}

fn gives(file: &syntax::File) -> Vec<CompletionItem> {
    let name = |item: &Item| match item {
        Item::Const(known) => Some(item_of(&known.name.name, CompletionItemKind::CONSTANT)),
        Item::Fn(known) => Some(item_of(&known.name.name, CompletionItemKind::FUNCTION)),
        Item::Model(known) => Some(item_of(&known.name.name, CompletionItemKind::CLASS)),
        _ => None,
    };
    file.items.iter().filter_map(name).collect()
}

fn item_of(name: &str, kind: CompletionItemKind) -> CompletionItem {
    item(name, kind, None)
}
