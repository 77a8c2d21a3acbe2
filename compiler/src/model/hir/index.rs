//! The names of a text: what is declared where, and where it is named.
//!
//! A fold over a file and the files that it imports, by the rules of the pass that finds references. A definition is known by the
//! place where its name stands first; what an editor shows of names is a view of this list.

use rustc_hash::{FxHashMap, FxHashSet};

use super::references::Resolver;
use super::settings::Settings;
use super::surfaces::Surfaces;
use super::{Declared, Definition as Item, File, Hir, import};
use crate::diagnostics::Diagnostics;
use crate::source::Span;
use crate::syntax::{self, DeclKind, Ident, Link, NamedKind, Path};

/// What a name is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// A file that is used under its own name.
    File,
    /// A file that is used under another name.
    Module,
    /// Another name for what a file declares.
    Alias,
    /// `const`
    Constant,
    /// `fn`
    Function,
    /// `model`
    Model,
    /// `simulate`, `optimize`
    Experiment,
    /// `param`
    Param,
    /// `state`
    State,
    /// `discrete`
    Discrete,
    /// `control`
    Control,
    /// `input`
    Input,
    /// `algebraic`, and what a program or a variational inequality determines
    Algebraic,
    /// `let`
    Let,
    /// `output`
    Output,
    /// `signal`
    Signal,
    /// `switch`
    Switch,
    /// `part`
    Part,
    /// `region`
    Region,
    /// `jump`
    Jump,
    /// `contact`
    Contact,
    /// An index of a loop or a sum.
    Index,
    /// An argument of a function.
    Argument,
}

impl Kind {
    /// What it is called.
    pub fn word(self) -> &'static str {
        match self {
            Kind::File | Kind::Module => "file",
            Kind::Alias => "name of another file",
            Kind::Constant => "constant",
            Kind::Function => "function",
            Kind::Model => "model",
            Kind::Experiment => "experiment",
            Kind::Param => "parameter",
            Kind::State => "state",
            Kind::Discrete => "discrete state",
            Kind::Control => "control",
            Kind::Input => "input",
            Kind::Algebraic => "algebraic state",
            Kind::Let => "let",
            Kind::Output => "output",
            Kind::Signal => "signal",
            Kind::Switch => "switch",
            Kind::Part => "part",
            Kind::Region => "region",
            Kind::Jump => "jump",
            Kind::Contact => "contact",
            Kind::Index => "index",
            Kind::Argument => "argument",
        }
    }
}

/// What stands where a name is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Role {
    /// It is declared.
    Declares,
    /// It is given a value.
    Sets,
    /// Its value, or what it is, is used.
    Reads,
}

/// A name that is declared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Definition {
    /// The name.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// Where the name stands in its declaration; no other definition stands there.
    pub place: Span,
    /// The declaration.
    pub whole: Span,
    /// Where it is known by its name alone: a file, a model, a block.
    pub scope: Span,
    /// What it is made of: the model of a part or an experiment, what another name stands for, the start of a file.
    pub of: Option<Span>,
}

/// A name that stands somewhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Occurrence {
    /// Where.
    pub span: Span,
    /// [`Definition::place`] of what it names.
    pub declared: Span,
    /// What it does there.
    pub role: Role,
}

/// The names of a file and of what it imports.
#[derive(Clone, Debug, Default)]
pub struct Index {
    /// By position; each place once.
    definitions: Vec<Definition>,
    /// By position.
    occurrences: Vec<Occurrence>,
    /// Where units stand, by position.
    units: Vec<Span>,
    /// Where those names are declared that are switching functions by themselves.
    surfaces: FxHashSet<Span>,
}

impl Index {
    /// The names of a file that is linked, whether it is right or not.
    pub fn new(file: &syntax::File) -> Self {
        let (mut files, mut diags, mut hir) = (vec![], Diagnostics::new(), Hir::default());
        reach(file, &mut files, &mut FxHashSet::default());
        for file in &files {
            hir.file(file, &mut diags);
            for item in &file.items {
                if let syntax::Item::Model(model) = item {
                    hir.model(file, model, &mut diags);
                }
            }
        }
        let mut recorder = Recorder {
            hir: &hir,
            definitions: FxHashMap::default(),
            occurrences: vec![],
            units: vec![],
            surfaces: Surfaces::default(),
        };
        for file in files {
            recorder = recorder.file(file);
        }
        let mut definitions: Vec<_> = recorder.definitions.into_values().collect();
        definitions.sort_by_key(|definition| definition.place);
        let mut occurrences = recorder.occurrences;
        occurrences.sort_by_key(|found| (found.span, found.declared));
        occurrences.dedup();
        let mut units = recorder.units;
        units.sort();
        Index {
            definitions,
            occurrences,
            units,
            surfaces: recorder.surfaces.all(),
        }
    }

    /// All definitions, by position.
    pub fn definitions(&self) -> &[Definition] {
        &self.definitions
    }

    /// All places of names, by position.
    pub fn occurrences(&self) -> &[Occurrence] {
        &self.occurrences
    }

    /// All places of units, by position.
    pub fn units(&self) -> &[Span] {
        &self.units
    }

    /// Whether a name is a switching function by itself, whose zero set is a surface; one that does not change is none.
    pub fn is_surface(&self, known: &Definition) -> bool {
        let changes = !matches!(known.kind, Kind::Param | Kind::Constant | Kind::Index);
        changes && self.surfaces.contains(&known.place)
    }

    /// The definition whose name stands at a place.
    pub fn definition(&self, place: Span) -> Option<&Definition> {
        let found = self
            .definitions
            .binary_search_by_key(&place, |known| known.place);
        found.ok().map(|at| &self.definitions[at])
    }

    /// The name that stands at or ends at a position.
    pub fn at(&self, position: u32) -> Option<&Occurrence> {
        let after = self
            .occurrences
            .partition_point(|known| known.span.start <= position);
        let before = self.occurrences[..after].iter().rev().take(2);
        let mut around = before.filter(|known| position <= known.span.end);
        around.next()
    }

    /// Where something is named, by position.
    pub fn places(&self, declared: Span) -> impl Iterator<Item = &Occurrence> {
        self.occurrences
            .iter()
            .filter(move |known| known.declared == declared)
    }

    /// What is declared in a model, or in a file itself, with the places of the names that it has there alone.
    pub fn members(&self, scope: Span) -> impl Iterator<Item = &Definition> {
        let start = self
            .definitions
            .partition_point(|known| known.place < Span { end: 0, ..scope });
        let inside = self.definitions[start..].iter();
        let inside = inside.take_while(move |known| known.place.end <= scope.end);
        inside.filter(move |known| known.scope == scope)
    }

    /// What is known by its name alone at a position, the innermost first; the model of an experiment is open to it.
    pub fn in_scope(&self, position: u32) -> Vec<&Definition> {
        let holds = |span: Span| span.start <= position && position <= span.end;
        let mut found: Vec<&Definition> = vec![];
        found.extend(self.definitions.iter().filter(|known| holds(known.scope)));
        found.sort_by_key(|known| known.scope.end - known.scope.start);
        let experiment = self.experiment_at(position);
        if let Some(model) = experiment.and_then(|known| self.definition(known.of?)) {
            found.splice(0..0, self.members(model.whole));
        }
        let mut seen = FxHashSet::default();
        found.retain(|known| seen.insert(known.name.as_str()));
        found
    }

    /// The experiment around a position.
    pub fn experiment_at(&self, position: u32) -> Option<&Definition> {
        let mut all = self
            .definitions
            .iter()
            .filter(|known| known.kind == Kind::Experiment);
        all.find(|known| known.whole.start <= position && position <= known.whole.end)
    }

    /// The model that something is declared in.
    pub fn model_of(&self, declared: &Definition) -> Option<&Definition> {
        let mut models = self
            .definitions
            .iter()
            .filter(|known| known.kind == Kind::Model);
        models.find(|known| known.whole == declared.scope)
    }

    /// What a definition stands for, where it is another name for it.
    pub fn meant<'i>(&'i self, definition: &'i Definition) -> &'i Definition {
        match definition.kind {
            Kind::Alias => definition
                .of
                .and_then(|of| self.definition(of))
                .unwrap_or(definition),
            _ => definition,
        }
    }
}

/// A file, and all that it imports, each once.
fn reach<'f>(
    file: &'f syntax::File,
    found: &mut Vec<&'f syntax::File>,
    seen: &mut FxHashSet<Span>,
) {
    if !seen.insert(file.span) {
        return;
    }
    found.push(file);
    for item in import::uses(file) {
        if let Link::File(file) = &item.link {
            reach(file, found, seen);
        }
    }
}

/// What has members: a file, or the model of a part with the file it stands in.
#[derive(Clone, Copy)]
pub(super) enum Holder<'f> {
    File(&'f syntax::File),
    Model(&'f syntax::File, &'f syntax::Model),
}

impl<'f> Holder<'f> {
    /// The model that a path of a file means.
    pub fn of_path(file: &'f syntax::File, path: &Path) -> Option<Self> {
        let (file, model) = import::find_silently(file, path)?;
        Some(Holder::Model(file, model))
    }
}

/// Takes names down.
pub(super) struct Recorder<'r, 'f> {
    hir: &'r Hir<'f>,
    definitions: FxHashMap<Span, Definition>,
    occurrences: Vec<Occurrence>,
    pub units: Vec<Span>,
    pub surfaces: Surfaces,
}

impl<'r, 'f> Recorder<'r, 'f> {
    /// A name stands at a place.
    pub fn occurs(&mut self, span: Span, declared: Span, role: Role) {
        self.occurrences.push(Occurrence {
            span,
            declared,
            role,
        });
    }

    /// A name is declared, and known in a part of the text.
    pub fn declares(&mut self, name: &Ident, kind: Kind, whole: Span, scope: Span) {
        self.defines(Definition {
            name: name.name.clone(),
            kind,
            place: name.span,
            whole,
            scope,
            of: None,
        });
    }

    fn defines(&mut self, definition: Definition) {
        self.occurs(definition.place, definition.place, Role::Declares);
        self.definitions.insert(definition.place, definition);
    }

    /// Whether what stands at a place names a switch.
    pub fn is_of_switch(&self, place: Span) -> bool {
        let found = self.occurrences.iter().rev();
        let mut found = found.filter(|known| known.span == place);
        let declared = found.next().map(|known| known.declared);
        let mut all = self.hir.models.values().flat_map(|model| &model.declared);
        all.any(|known| matches!(known.item, Item::Switch(_)) && Some(known.name.span) == declared)
    }

    /// Where a member is declared, and what has members itself.
    pub fn member(&self, holder: Holder<'f>, name: &str) -> Option<(Span, Option<Holder<'f>>)> {
        match holder {
            Holder::File(file) => {
                let (name, _) = import::own_named(file, name)?;
                Some((name.span, None))
            }
            Holder::Model(file, model) => {
                let model = self.hir.models.get(&model.span)?;
                let declared = &model.declared[*model.index.get(name)?];
                let inner = match declared.item {
                    Item::Part(part) => Holder::of_path(file, &part.model),
                    _ => None,
                };
                Some((declared.name.span, inner))
            }
        }
    }

    /// The names of a file.
    fn file(mut self, file: &'f syntax::File) -> Self {
        let Some(names) = self.hir.files.get(&file.span) else {
            return self;
        };
        for item in &file.items {
            self.item(file, item);
        }
        let mut resolver = Resolver::of_file(names);
        resolver.recorder = Some(self);
        for item in &file.items {
            match item {
                syntax::Item::Const(item) => resolver.expr(&item.value),
                syntax::Item::Fn(function) => resolver.function(function),
                _ => {}
            }
        }
        let mut recorder = resolver.recorder.take();
        for item in &file.items {
            recorder = match item {
                syntax::Item::Model(model) => recorder.map(|recorder| recorder.model(model)),
                syntax::Item::Experiment(item) => {
                    recorder.map(|recorder| recorder.experiment(names, item))
                }
                _ => recorder,
            };
        }
        recorder.expect("it goes from one to the next")
    }

    /// What an item of a file declares.
    fn item(&mut self, file: &'f syntax::File, item: &'f syntax::Item) {
        let scope = file.span;
        match item {
            syntax::Item::Use(item) => {
                for import in import::imports(item) {
                    self.import(item, &import, scope);
                }
            }
            syntax::Item::Const(item) => {
                self.declares(&item.name, Kind::Constant, item.span, scope);
            }
            syntax::Item::Fn(item) => self.declares(&item.name, Kind::Function, item.span, scope),
            syntax::Item::Model(item) => self.declares(&item.name, Kind::Model, item.span, scope),
            syntax::Item::Experiment(item) => {
                let model = import::find_silently(file, &item.model);
                self.defines(Definition {
                    name: item.name.name.clone(),
                    kind: Kind::Experiment,
                    place: item.name.span,
                    whole: item.span,
                    // Experiments have a namespace of their own.
                    scope: item.name.span,
                    of: model.map(|(_, model)| model.name.span),
                });
            }
            syntax::Item::ExpectDiagnostic(_) | syntax::Item::Bad(_) => {}
        }
    }

    fn import(&mut self, item: &syntax::Use, import: &import::Import<'_>, scope: Span) {
        let target = import.named_at(import.name);
        if let (Some(name), Some(target)) = (import.name, target) {
            self.occurs(name.span, target, Role::Reads);
        }
        let (kind, of) = match import.name {
            Some(name) if name.span == import.place => return,
            Some(_) => (Kind::Alias, target),
            None => {
                let kind = match item.alias {
                    Some(_) => Kind::Module,
                    None => Kind::File,
                };
                let start = import.file.map(|file| Span {
                    end: file.span.start,
                    ..file.span
                });
                (kind, start)
            }
        };
        self.defines(Definition {
            name: import.local.to_owned(),
            kind,
            place: import.place,
            whole: item.span,
            scope,
            of,
        });
    }

    fn model(mut self, item: &'f syntax::Model) -> Self {
        let Some(model) = self.hir.models.get(&item.span) else {
            return self;
        };
        for declared in &model.declared {
            self.declared(declared, item.span, model.file.file);
        }
        let mut resolver = Resolver::of_model(model);
        resolver.recorder = Some(self);
        resolver.body(&item.body);
        resolver.recorder.take().expect("it was given")
    }

    fn declared(&mut self, declared: &Declared<'f>, scope: Span, file: &syntax::File) {
        let (kind, whole) = match declared.item {
            Item::Const(item) => (Kind::Constant, item.span),
            Item::Decl(decl) => (of_decl(decl.kind), decl.span),
            Item::Named(named) => (of_named(named.kind), named.span),
            Item::Switch(switch) => (Kind::Switch, switch.span),
            Item::Part(part) => (Kind::Part, part.span),
            Item::Program(program) => (Kind::Algebraic, program.span),
            Item::Word("region", span) => (Kind::Region, span),
            Item::Word("jump", span) => (Kind::Jump, span),
            Item::Word(_, span) => (Kind::Contact, span),
            // Which of several is meant is unknown.
            Item::Unsupported => return,
        };
        let of = match declared.item {
            Item::Part(part) => import::find_silently(file, &part.model),
            _ => None,
        };
        self.defines(Definition {
            name: declared.name.name.clone(),
            kind,
            place: declared.name.span,
            whole,
            scope,
            of: of.map(|(_, model)| model.name.span),
        });
    }

    /// What an experiment says of names; it has no switches of its own.
    fn experiment(mut self, file: &'r File<'f>, item: &'f syntax::Experiment) -> Self {
        let surfaces = std::mem::take(&mut self.surfaces);
        let model = import::find_silently(file.file, &item.model);
        let model = model.and_then(|(_, model)| self.hir.models.get(&model.span));
        let mut resolver = match model {
            Some(model) => Resolver::of_model(model),
            None => Resolver::of_file(file),
        };
        resolver.file = file;
        resolver.recorder = Some(self);
        resolver.model_path(file, &item.model);
        Settings {
            resolver: &mut resolver,
        }
        .read(item);
        let read = resolver.recorder.take().expect("it was given");
        Recorder { surfaces, ..read }
    }
}

fn of_decl(kind: DeclKind) -> Kind {
    match kind {
        DeclKind::Param => Kind::Param,
        DeclKind::State => Kind::State,
        DeclKind::Discrete => Kind::Discrete,
        DeclKind::Control => Kind::Control,
        DeclKind::Input => Kind::Input,
        DeclKind::Algebraic => Kind::Algebraic,
    }
}

fn of_named(kind: NamedKind) -> Kind {
    match kind {
        NamedKind::Let => Kind::Let,
        NamedKind::Output => Kind::Output,
        NamedKind::Signal => Kind::Signal,
    }
}
