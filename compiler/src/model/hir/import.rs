//! Names that come from other files: what a `use` brings in, and which model a path means.

use super::reserved::did_you_mean;
use crate::diagnostics::Diagnostics;
use crate::model::errors::ModelError;
use crate::source::Span;
use crate::source::imports::ImportError;
use crate::syntax::{
    Const, File, Function, Ident, Item, Link, Model, Path, Segment, Use, UseSource,
};

/// What a file declares or imports.
#[derive(Clone, Copy)]
pub(crate) enum Global<'f> {
    Const(&'f Const),
    /// A function, and the file it stands in.
    Function(&'f File, &'f Function),
    Model(&'f Model),
    Import(Import<'f>),
}

/// The model that a path means, with the file it stands in.
pub fn find<'f>(
    file: &'f File,
    path: &Path,
    diags: &mut Diagnostics,
) -> Option<(&'f File, &'f Model)> {
    let found = find_silently(file, path);
    if found.is_none() && !is_broken(file, path) {
        let text = |name: &str, field: &Ident| format!("{name}.{}", field.name);
        let name = match &path.rest[..] {
            [Segment::Field(field)] => text(&path.head.name, field),
            _ => path.head.name.clone(),
        };
        let own = models(file).map(|model| model.name.name.clone());
        let known = own.chain(uses(file).flat_map(|item| {
            imports(item).into_iter().flat_map(|import| match import {
                Import {
                    local,
                    name: Some(_),
                    ..
                } => vec![local.to_owned()],
                Import {
                    local,
                    file: Some(file),
                    ..
                } => models(file).map(|model| text(local, &model.name)).collect(),
                _ => vec![],
            })
        }));
        let known: Vec<String> = known.collect();
        let help = did_you_mean(&name, known.iter().map(String::as_str));
        diags.push(ModelError::UnknownModel {
            name,
            span: path.span,
            help,
        });
    }
    found
}

/// [`find`] without a word where there is none.
pub(crate) fn find_silently<'f>(file: &'f File, path: &Path) -> Option<(&'f File, &'f Model)> {
    let head = &path.head.name;
    let model = |file: &'f File, name: &str| {
        let mut models = models(file);
        models
            .find(|model| model.name.name == name)
            .map(|model| (file, model))
    };
    let import = || {
        uses(file)
            .flat_map(imports)
            .find(|import| import.local == *head)
    };
    match &path.rest[..] {
        [] => model(file, head).or_else(|| {
            let import = import()?;
            model(import.file?, &import.name?.name)
        }),
        [Segment::Field(field)] => {
            let import = import().filter(|import| import.name.is_none())?;
            model(import.file?, &field.name)
        }
        _ => None,
    }
}

/// True for a name from a file that is not there, or that is not in it: both have been reported.
fn is_broken(file: &File, path: &Path) -> bool {
    let mut imports = uses(file).flat_map(imports);
    let found = imports.find(|import| import.local == path.head.name);
    found.is_some_and(|import| match (import.file, import.name) {
        (None, _) => true,
        (Some(file), Some(name)) => !declares(file, &name.name),
        (Some(_), None) => false,
    })
}

fn models(file: &File) -> impl Iterator<Item = &Model> {
    let globals = file.items.iter().filter_map(|item| global(file, item));
    globals.filter_map(|(_, global)| match global {
        Global::Model(model) => Some(model),
        _ => None,
    })
}

pub(super) fn uses(file: &File) -> impl Iterator<Item = &Use> {
    file.items.iter().filter_map(|item| match item {
        Item::Use(item) => Some(item),
        _ => None,
    })
}

/// True where a file itself declares a constant, function or model of that name.
fn declares(file: &File, name: &str) -> bool {
    own(file, name).is_some()
}

fn declared(file: &File) -> impl Iterator<Item = &str> {
    let globals = file.items.iter().filter_map(|item| global(file, item));
    globals.map(|(name, _)| &*name.name)
}

/// The name that an item of a file declares.
pub(super) fn global<'f>(file: &'f File, item: &'f Item) -> Option<(&'f Ident, Global<'f>)> {
    match item {
        Item::Const(item) => Some((&item.name, Global::Const(item))),
        Item::Fn(item) => Some((&item.name, Global::Function(file, item))),
        Item::Model(item) => Some((&item.name, Global::Model(item))),
        _ => None,
    }
}

/// A name that a `use` brings in.
#[derive(Clone, Copy)]
pub(crate) struct Import<'f> {
    pub local: &'f str,
    /// Where the local name stands; the path of a file without another name.
    pub place: Span,
    /// The name in the other file; none for the file as a whole.
    pub name: Option<&'f Ident>,
    /// The other file, where it could be read.
    pub file: Option<&'f File>,
}

/// Names that a `use` brings in.
pub(crate) fn imports(item: &Use) -> Vec<Import<'_>> {
    let file = match &item.link {
        Link::File(file) => Some(&**file),
        Link::Open | Link::Failed => None,
    };
    if !item.names.is_empty() {
        let named = item.names.iter();
        let named = named.map(|(name, alias)| Import {
            local: &alias.as_ref().unwrap_or(name).name,
            place: alias.as_ref().unwrap_or(name).span,
            name: Some(name),
            file,
        });
        return named.collect();
    }
    let whole = match (&item.alias, &item.source) {
        (Some(alias), _) => Some((alias.name.as_str(), alias.span)),
        (None, UseSource::Dotted(path)) => path.last().map(|last| (&*last.name, last.span)),
        (None, UseSource::Relative(path)) => {
            let last = path.name.rsplit('/').next();
            last.map(|last| (last, path.span))
        }
    };
    let whole = whole.map(|(local, place)| Import {
        local,
        place,
        name: None,
        file,
    });
    whole.into_iter().collect()
}

impl<'f> Import<'f> {
    /// What it is in the other file.
    pub fn target(&self) -> Option<Global<'f>> {
        own(self.file?, &self.name?.name)
    }

    /// Where the local name is declared: in the other file, unless it is another name here.
    pub fn declared_at(&self) -> Span {
        let name = self.name.filter(|name| name.span == self.place);
        self.named_at(name).unwrap_or(self.place)
    }

    /// Where a name of the other file is declared.
    pub fn named_at(&self, name: Option<&Ident>) -> Option<Span> {
        own_named(self.file?, &name?.name).map(|(name, _)| name.span)
    }
}

/// What a file declares itself under a name.
pub(crate) fn own<'f>(file: &'f File, name: &str) -> Option<Global<'f>> {
    own_named(file, name).map(|(_, global)| global)
}

/// The same, with the name where it is declared.
pub(super) fn own_named<'f>(file: &'f File, name: &str) -> Option<(&'f Ident, Global<'f>)> {
    let mut globals = file.items.iter().filter_map(|item| global(file, item));
    globals.find(|(known, _)| known.name == name)
}

/// What a `use` declares, with where each name stands; says which of them are not there.
pub(super) fn named<'f>(item: &'f Use, diags: &mut Diagnostics) -> Vec<(Import<'f>, Span)> {
    if item.link == Link::Open {
        diags.push(ImportError::Missing {
            path: "..".to_owned(),
            why: "files are not read here".to_owned(),
            span: item.span,
            help: None,
        });
    }
    let mut found = Vec::new();
    for import in imports(item) {
        let span = match (import.name, &item.alias) {
            (Some(name), _) => name.span,
            (None, Some(alias)) => alias.span,
            (None, None) => item.span,
        };
        if let (Some(file), Some(name)) = (import.file, import.name)
            && !declares(file, &name.name)
            && !file.items.iter().any(|item| matches!(item, Item::Bad(_)))
        {
            diags.push(ModelError::NotInFile {
                name: name.name.clone(),
                span,
                help: did_you_mean(&name.name, declared(file)),
            });
        }
        found.push((import, span));
    }
    found
}
