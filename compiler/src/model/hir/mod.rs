//! What the names of a text refer to, found once for each file and each model, whatever values its
//! constants have and however often it is a part.
//!
//! A reference stands in the table of its file or model under the place of the name. The order of
//! declarations, the checks of functions, and units read these tables; the value of a name is looked
//! up in `names/lookup.rs`, by the same rules.

mod collect;
pub(crate) mod import;
pub mod index;
pub(crate) mod order;
mod references;
pub mod reserved;
mod settings;
mod surfaces;
#[cfg(test)]
mod tests;
mod words;

use std::rc::Rc;

use rustc_hash::{FxHashMap, FxHashSet};

pub(crate) use self::import::Global;
use self::import::Import;
use self::references::Resolver;
use self::settings::Settings;
use crate::diagnostics::Diagnostics;
use crate::model::errors::ModelError;
use crate::source::Span;
use crate::syntax::{
    self, Bind, Binder, Const, Decl, Experiment, Expr, ExprKind, Ident, Item, Named, NamedKind,
    Part, Program, Stmt, Switch,
};

/// What a name refers to; one that is declared nowhere has none.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Reference<'f> {
    /// An index of a loop, a sum or an array of parts around.
    Index,
    /// The argument of the function around, by position.
    Argument(usize),
    /// A `let` of a block around.
    Let(&'f Named),
    /// A declaration of the model around, by position in [`Model::declared`].
    Own(usize),
    /// A declaration of the file around, by position in [`File::globals`].
    Global(usize),
    /// A value or a function of the language.
    BuiltIn,
}

impl Reference<'_> {
    /// Equal for references to the same thing.
    fn identity(&self) -> (std::mem::Discriminant<Self>, usize) {
        let which = match *self {
            Reference::Index | Reference::BuiltIn => 0,
            Reference::Argument(at) | Reference::Own(at) | Reference::Global(at) => at,
            Reference::Let(named) => std::ptr::from_ref(named).addr(),
        };
        (std::mem::discriminant(self), which)
    }
}

/// References by the place of the name.
pub(crate) type References<'f> = FxHashMap<Span, Reference<'f>>;

/// What a model declares.
#[derive(Clone, Copy)]
pub(crate) enum Definition<'f> {
    Const(&'f Const),
    Decl(&'f Decl),
    Named(&'f Named),
    Switch(&'f Switch),
    Part(&'f Part),
    Program(&'f Program),
    /// A name that is not a value, and its statement.
    Word(&'static str, Span),
    /// Something that is wrong.
    Unsupported,
}

/// A declaration of a model that has a meaning of its own.
pub(crate) struct Declared<'f> {
    pub name: &'f Ident,
    pub item: Definition<'f>,
    /// Loops around it, outermost first.
    pub frames: Vec<Frame<'f>>,
}

/// A loop around a declaration, with the `let`s that stand in it.
#[derive(Clone)]
pub(crate) struct Frame<'f> {
    pub binders: &'f [Binder],
    pub lets: Vec<Rc<Named>>,
    pub span: Span,
}

/// A name that holds in a whole file.
pub(crate) struct Globally<'f> {
    pub name: &'f str,
    pub span: Span,
    pub global: Global<'f>,
}

/// The names of a file, each once, in order of appearance.
pub(crate) struct File<'f> {
    pub file: &'f syntax::File,
    pub globals: Vec<Globally<'f>>,
    index: FxHashMap<&'f str, usize>,
    /// References of its constants and functions.
    pub references: Rc<References<'f>>,
    /// True where an item could not be read.
    pub forgiving: bool,
}

/// The names of a model.
pub(crate) struct Model<'f> {
    pub file: Rc<File<'f>>,
    pub item: &'f syntax::Model,
    /// In order of appearance; what takes a name twice is [`Definition::Unsupported`].
    pub declared: Vec<Declared<'f>>,
    index: FxHashMap<&'f str, usize>,
    pub references: Rc<References<'f>>,
}

/// Files and models, each looked at once.
#[derive(Default)]
pub(crate) struct Hir<'f> {
    files: FxHashMap<Span, Rc<File<'f>>>,
    models: FxHashMap<Span, Rc<Model<'f>>>,
}

impl<'f> Hir<'f> {
    /// The names of a file.
    pub fn file(&mut self, file: &'f syntax::File, diags: &mut Diagnostics) -> Rc<File<'f>> {
        let known = self.files.entry(file.span);
        Rc::clone(known.or_insert_with(|| Rc::new(File::new(file, diags))))
    }

    /// The names of a model in a file.
    pub fn model(
        &mut self,
        file: &'f syntax::File,
        item: &'f syntax::Model,
        diags: &mut Diagnostics,
    ) -> Rc<Model<'f>> {
        let file = self.file(file, diags);
        let known = self.models.entry(item.span);
        Rc::clone(known.or_insert_with(|| Rc::new(Model::new(file, item, diags))))
    }
}

impl<'f> File<'f> {
    fn new(file: &'f syntax::File, diags: &mut Diagnostics) -> Self {
        let mut names = File {
            file,
            globals: vec![],
            index: FxHashMap::default(),
            references: Rc::default(),
            forgiving: false,
        };
        for item in &file.items {
            match item {
                Item::Use(item) => {
                    for (import, span) in import::named(item, diags) {
                        names.declare(import.local, span, Global::Import(import), diags);
                    }
                }
                Item::Bad(_) => names.forgiving = true,
                _ => {
                    if let Some((name, global)) = import::global(file, item) {
                        names.declare(&name.name, name.span, global, diags);
                    }
                }
            }
        }
        let mut resolver = Resolver::of_file(&names);
        for known in &names.globals {
            match known.global {
                Global::Const(item) => resolver.expr(&item.value),
                Global::Function(_, function) => resolver.function(function),
                Global::Model(_) | Global::Import(_) => {}
            }
        }
        names.references = Rc::new(resolver.found);
        names
    }

    /// Declares a name that is free.
    fn declare(&mut self, name: &'f str, span: Span, global: Global<'f>, diags: &mut Diagnostics) {
        let text = name.to_owned();
        let is_function = matches!(global, Global::Function(..) | Global::Import(_));
        let built_in = match is_function && reserved::is_kept(name) {
            true => Some(ModelError::BuiltIn {
                name: text.clone(),
                span,
            }),
            false => reserved::taken(name, span),
        };
        let is_refused = matches!(built_in, Some(ModelError::BuiltIn { .. }));
        if let Some(error) = built_in {
            diags.push(error);
        }
        if is_refused {
            return;
        }
        if let Some(known) = self.get(name) {
            diags.push(ModelError::Redeclared {
                name: text,
                first: known.span,
                second: span,
            });
        } else {
            self.index.insert(name, self.globals.len());
            self.globals.push(Globally { name, span, global });
        }
    }

    /// What it imports.
    pub fn imports(&self) -> impl Iterator<Item = Import<'f>> + '_ {
        self.globals.iter().filter_map(|known| match known.global {
            Global::Import(import) => Some(import),
            _ => None,
        })
    }

    /// What each global needs of the others that have a body, too, each once.
    pub fn needs(&self, body: impl Fn(usize) -> Option<&'f Expr>) -> Vec<Vec<usize>> {
        let all = 0..self.globals.len();
        let needs = all.map(|index| {
            let read = body(index).map_or(vec![], |body| read(body, &self.references));
            let needs = read.into_iter().filter_map(|reference| match reference {
                Reference::Global(need) => body(need).map(|_| need),
                _ => None,
            });
            needs.collect()
        });
        needs.collect()
    }

    /// Names in a function that refer to nothing, each where it stands first.
    pub fn unknown<'x>(&self, body: &'x Expr) -> Vec<(&'x str, Span)> {
        let mut found: Vec<(&str, Span)> = vec![];
        body.visit(&mut |expr| {
            if let ExprKind::Name(name) = &expr.kind
                && !self.forgiving
                && !self.references.contains_key(&expr.span)
                && !found.iter().any(|(known, _)| known == name)
            {
                found.push((name, expr.span));
            }
        });
        found
    }

    /// The declaration of a name.
    pub fn get(&self, name: &str) -> Option<&Globally<'f>> {
        self.index.get(name).map(|&index| &self.globals[index])
    }
}

impl Globally<'_> {
    /// Where what it means is declared, if it has the same name there.
    fn declared_at(&self) -> Span {
        match self.global {
            Global::Import(import) => import.declared_at(),
            _ => self.span,
        }
    }
}

impl Global<'_> {
    /// The word for it.
    pub fn word(&self) -> &'static str {
        match self {
            Global::Const(_) => "constant",
            Global::Function(..) => "function",
            Global::Model(_) => "model",
            Global::Import(_) => "`use`",
        }
    }
}

impl<'f> Model<'f> {
    fn new(file: Rc<File<'f>>, item: &'f syntax::Model, diags: &mut Diagnostics) -> Self {
        let declared = collect::collect(item, &file, diags);
        let names = declared.iter().enumerate();
        let index = names.map(|(k, declared)| (&*declared.name.name, k));
        let mut model = Model {
            index: index.collect(),
            file,
            item,
            declared,
            references: Rc::default(),
        };
        let mut resolver = Resolver::of_model(&model);
        resolver.body(&item.body);
        model.references = Rc::new(resolver.found);
        model
    }

    /// What the model declares under a name.
    pub fn get(&self, name: &str) -> Option<Definition<'f>> {
        let index = self.index.get(name)?;
        Some(self.declared[*index].item)
    }

    /// Declarations of the model that some of its expressions refer to, in order of appearance.
    pub fn read<'x>(&self, exprs: impl IntoIterator<Item = &'x Expr>) -> Vec<usize> {
        let exprs = exprs.into_iter();
        own(exprs.flat_map(|expr| read(expr, &self.references)))
    }

    /// [`Model::read`] of an expression that stands elsewhere, and is read in this model.
    pub fn read_outside(&self, expr: &Expr) -> Vec<usize> {
        let mut resolver = Resolver::of_model(self);
        resolver.expr(expr);
        own(read(expr, &resolver.found))
    }

    /// References of an experiment of this model, which may stand in another file.
    pub fn of_experiment(
        &self,
        file: &File<'f>,
        experiment: &'f Experiment,
        overrides: &'f [Bind],
    ) -> References<'f> {
        let mut resolver = Resolver::of_model(self);
        resolver.file = file;
        resolver.binds(overrides);
        Settings {
            resolver: &mut resolver,
        }
        .read(experiment);
        resolver.found
    }
}

/// The `let`s that stand directly in a block, to be kept.
pub(crate) fn shared_lets(body: &[Stmt]) -> Vec<Rc<Named>> {
    local_lets(body).cloned().map(Rc::new).collect()
}

/// The `let`s that stand directly in a block.
fn local_lets(body: &[Stmt]) -> impl Iterator<Item = &Named> {
    body.iter().filter_map(|stmt| match stmt {
        Stmt::Named(named) if named.kind == NamedKind::Let => Some(named),
        _ => None,
    })
}

fn own<'f>(references: impl IntoIterator<Item = Reference<'f>>) -> Vec<usize> {
    let own = references.into_iter().filter_map(|found| match found {
        Reference::Own(index) => Some(index),
        _ => None,
    });
    own.collect()
}

/// What an expression refers to, each once, in order of first appearance.
pub(crate) fn read<'f>(expr: &Expr, references: &References<'f>) -> Vec<Reference<'f>> {
    let (mut found, mut seen) = (vec![], FxHashSet::default());
    expr.visit(&mut |expr| {
        if let ExprKind::Name(_) = expr.kind
            && let Some(reference) = references.get(&expr.span)
            && seen.insert(reference.identity())
        {
            found.push(*reference);
        }
    });
    found
}
