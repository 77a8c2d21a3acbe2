//! Units: whether the dimensions of a model and of an experiment fit.
//!
//! A walk over the syntax tree of a model that is right otherwise. A value has the dimension its
//! declaration gives, or that of its expression; what is declared without a unit has an unknown one,
//! and fits everywhere. A number is a pure number in a product, and has the unit of what it stands
//! beside in a sum, a comparison and the like: `x - 2`, but `k*x` with a unit of `k`.
//!
//! Functions are followed at each call, and parts at each statement, so that a function or an input
//! without a unit takes that of what it is given. Everything is looked at once per loop: a vector has
//! one unit for all entries, and what is stacked from different units has an unknown one.

mod dimension;
mod error;
mod functions;
mod infer;
mod names;
mod statements;
#[cfg(test)]
mod tests;

use rustc_hash::{FxHashMap, FxHashSet};

pub use error::UnitError;

use self::dimension::{Dimension, Ratio};
use crate::diagnostics::Diagnostics;
use crate::model::names::import;
use crate::model::names::import::imports;
use crate::source::Span;
use crate::syntax::{
    Bind, Binder, Decl, Experiment, File, Function, Ident, Item, Model, Named, Part, Path, Segment,
    Stmt,
};

/// Expressions inside each other, through functions, names and parts: what the stack bears.
/// Further down, dimensions are unknown.
const MAX_DEPTH: usize = 300;
/// Expressions that are looked at; beyond, dimensions are unknown. Models that reach it are refused
/// for their size, unless they repeat a call in vain.
const BUDGET: usize = 4_000_000;

/// Reports units of a model, and of its parts, that do not fit.
pub(super) fn check_model(file: &File, item: &Model, diags: &mut Diagnostics) {
    if has_units(file, item) {
        let mut checker = Checker::new(file, item, diags);
        checker.body(&item.body);
    }
}

/// Reports units in an experiment that do not fit those of its model; `None` after an error.
pub(crate) fn check_experiment(
    file: &File,
    home: &File,
    item: &Model,
    experiment: &Experiment,
    overrides: &[Bind],
    diags: &mut Diagnostics,
) -> Option<()> {
    let mut found = Diagnostics::default();
    if has_units(home, item) {
        let mut checker = Checker::new(home, item, &mut found);
        checker.place.file = file;
        checker.experiment(experiment, overrides);
    }
    let is_fine = !found.has_errors();
    diags.append(found);
    is_fine.then_some(())
}

/// True where a model, or one of its parts, declares a unit.
fn has_units(file: &File, item: &Model) -> bool {
    let (mut open, mut seen) = (vec![(file, item)], FxHashSet::default());
    while let Some((file, item)) = open.pop() {
        if declares_units(item) {
            return true;
        }
        let parts = item.body.iter().filter_map(|stmt| match stmt {
            Stmt::Part(part) => import::find_silently(file, &part.model),
            _ => None,
        });
        open.extend(parts.filter(|(_, item)| seen.insert(item.span)));
    }
    false
}

fn declares_units(item: &Model) -> bool {
    item.body.iter().any(|stmt| match stmt {
        Stmt::Decl(decl) => decl.unit.is_some(),
        Stmt::Named(named) => named.unit.is_some(),
        _ => false,
    })
}

/// What is known about the unit of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dim {
    /// Nothing: it fits everywhere.
    Unknown,
    /// It is made of numbers alone: pure in products, of any unit beside others.
    Number,
    /// Its dimension.
    Known(Dimension),
}

impl Dim {
    const PURE: Dim = Dim::Known(Dimension::NUMBER);

    fn of(dimension: Option<Dimension>) -> Dim {
        dimension.map_or(Dim::Unknown, Dim::Known)
    }

    /// The dimension, where it is known and not that of a pure number.
    fn unit(self) -> Option<Dimension> {
        match self {
            Dim::Known(dimension) if dimension != Dimension::NUMBER => Some(dimension),
            _ => None,
        }
    }

    fn multiply(self, other: Dim) -> Dim {
        match (self, other) {
            (Dim::Unknown, _) | (_, Dim::Unknown) => Dim::Unknown,
            (Dim::Number, other) | (other, Dim::Number) => other,
            (Dim::Known(a), Dim::Known(b)) => Dim::of(a.multiply(b)),
        }
    }

    fn divide(self, other: Dim) -> Dim {
        self.multiply(other.power(Ratio::whole(-1)))
    }

    fn power(self, exponent: Ratio) -> Dim {
        match self {
            Dim::Known(dimension) => Dim::of(dimension.power(exponent)),
            other => other,
        }
    }
}

/// What a name of a model or file stands for.
#[derive(Clone, Copy)]
enum Thing<'f> {
    Decl(&'f Decl),
    Named(&'f Named),
    Switch,
    Part(&'f Part),
    Const,
    /// A function, and the file it stands in.
    Function(&'f File, &'f Function),
    /// A file that was imported as a whole.
    Module(&'f File),
}

/// Names that hold in a part of the model only.
#[derive(Clone)]
enum Frame<'f> {
    Indices(&'f [Binder]),
    Block(&'f [Stmt]),
    /// Arguments, with their values where these are plain numbers.
    Arguments(&'f Function, Vec<(Dim, Option<Ratio>)>),
}

/// Where names are looked up.
#[derive(Clone, Copy)]
struct Place<'f> {
    file: &'f File,
    /// The instance whose names are in sight; none in functions.
    instance: Option<usize>,
    /// Whether `time` has a unit here: it has in a model that declares units.
    has_units: bool,
}

/// A model or a part of it.
struct Instance<'f> {
    file: &'f File,
    names: FxHashMap<&'f str, Thing<'f>>,
    /// Where it is a part: the statement, and the instance around it.
    part: Option<(&'f Part, usize)>,
    has_units: bool,
}

struct Checker<'f, 'd> {
    instances: Vec<Instance<'f>>,
    /// Instances by the instance around them and the `part` statement.
    parts: FxHashMap<(usize, Span), Option<usize>>,
    /// Dimensions of what instances declare; `None` while one is being looked at.
    known: FxHashMap<(usize, Span), Option<Dim>>,
    /// Names of files.
    of_files: FxHashMap<Span, FxHashMap<&'f str, Thing<'f>>>,
    place: Place<'f>,
    frames: Vec<Frame<'f>>,
    /// The call or part that leads to where we are.
    call: Option<Span>,
    depth: usize,
    left: usize,
    diags: &'d mut Diagnostics,
}

impl<'f, 'd> Checker<'f, 'd> {
    fn new(file: &'f File, item: &'f Model, diags: &'d mut Diagnostics) -> Self {
        let mut checker = Checker {
            instances: vec![],
            parts: FxHashMap::default(),
            known: FxHashMap::default(),
            of_files: FxHashMap::default(),
            place: Place {
                file,
                instance: Some(0),
                has_units: declares_units(item),
            },
            frames: vec![],
            call: None,
            depth: 0,
            left: BUDGET,
            diags,
        };
        checker.instance(file, item, None);
        checker
    }

    fn instance(
        &mut self,
        file: &'f File,
        item: &'f Model,
        part: Option<(&'f Part, usize)>,
    ) -> usize {
        let mut names = FxHashMap::default();
        collect(&item.body, &mut names);
        self.instances.push(Instance {
            file,
            names,
            part,
            has_units: declares_units(item),
        });
        self.instances.len() - 1
    }

    /// The instance that a `part` of an instance makes.
    fn part(&mut self, outer: usize, part: &'f Part) -> Option<usize> {
        if let Some(&known) = self.parts.get(&(outer, part.span)) {
            return known;
        }
        let found = import::find_silently(self.instances[outer].file, &part.model);
        let inner = found.map(|(file, item)| self.instance(file, item, Some((part, outer))));
        self.parts.insert((outer, part.span), inner);
        inner
    }

    /// Runs `look` where the names of an instance are in sight, and nothing else.
    fn within<T>(&mut self, instance: usize, look: impl FnOnce(&mut Self) -> T) -> T {
        let Instance {
            file, has_units, ..
        } = self.instances[instance];
        let place = Place {
            file,
            instance: Some(instance),
            has_units,
        };
        let outside = (
            std::mem::replace(&mut self.place, place),
            std::mem::take(&mut self.frames),
        );
        let result = look(self);
        (self.place, self.frames) = outside;
        result
    }

    /// The meaning of a name that is not local.
    fn thing(&mut self, name: &str) -> Option<Thing<'f>> {
        let of_instance = self.place.instance;
        let own = of_instance.and_then(|own| self.instances[own].names.get(name).copied());
        own.or_else(|| self.of_file(self.place.file, name))
    }

    fn of_file(&mut self, file: &'f File, name: &str) -> Option<Thing<'f>> {
        let names = self.of_files.entry(file.span);
        let names = names.or_insert_with(|| names_of(file));
        names.get(name).copied()
    }

    /// The declaration that a path names, with the instance it stands in.
    fn target(&mut self, path: &Path) -> Option<(usize, Thing<'f>)> {
        let mut instance = self.place.instance?;
        let mut thing = *self.instances[instance].names.get(&*path.head.name)?;
        let fields = path.rest.iter().filter_map(|segment| match segment {
            Segment::Field(field) => Some(field),
            Segment::Index(_) => None,
        });
        for field in fields {
            (instance, thing) = self.field(instance, thing, field)?;
        }
        Some((instance, thing))
    }

    /// `b.q`: what a part declares.
    fn field(
        &mut self,
        instance: usize,
        thing: Thing<'f>,
        field: &Ident,
    ) -> Option<(usize, Thing<'f>)> {
        let Thing::Part(part) = thing else {
            return None;
        };
        let inner = self.part(instance, part)?;
        let thing = self.instances[inner].names.get(&*field.name)?;
        Some((inner, *thing))
    }

    /// The dimension of what an instance declares.
    fn declared(&mut self, instance: usize, thing: Thing<'f>) -> Dim {
        let span = match thing {
            Thing::Decl(decl) => decl.span,
            Thing::Named(named) => named.span,
            Thing::Switch => return Dim::PURE,
            // A structural constant has no unit of its own.
            Thing::Const | Thing::Part(_) | Thing::Function(..) | Thing::Module(_) => {
                return Dim::Unknown;
            }
        };
        // What is asked for while it is looked at depends on itself through parts.
        if let Some(known) = self.known.get(&(instance, span)) {
            return known.unwrap_or(Dim::Unknown);
        }
        self.known.insert((instance, span), None);
        let dim = self.within(instance, |checker| match thing {
            Thing::Decl(decl) => checker.quantity(instance, decl),
            Thing::Named(named) => checker.named(named),
            _ => Dim::Unknown,
        });
        self.known.insert((instance, span), Some(dim));
        dim
    }

    /// The dimension of a quantity: that of its unit, or of what a part is given for it.
    fn quantity(&mut self, instance: usize, decl: &'f Decl) -> Dim {
        if let Some(unit) = &decl.unit {
            return Dim::of(names::read(unit, self.diags));
        }
        let Some((part, outer)) = self.instances[instance].part else {
            return Dim::Unknown;
        };
        let given = part.binds.iter().find(|bind| gives(bind, decl));
        let given = given.map(|bind| {
            self.within(outer, |checker| {
                checker.bound(part, |checker| checker.expr(&bind.value))
            })
        });
        match given {
            Some(Dim::Known(dimension)) => Dim::Known(dimension),
            _ => Dim::Unknown,
        }
    }

    /// Runs `look` with the index of an array of parts in sight.
    fn bound<T>(&mut self, part: &'f Part, look: impl FnOnce(&mut Self) -> T) -> T {
        let binders = part.binder.as_slice();
        self.frames.push(Frame::Indices(binders));
        let result = look(self);
        self.frames.pop();
        result
    }

    /// The dimension of a `let`, `output` or `signal`; one that is declared is compared with it.
    fn named(&mut self, named: &'f Named) -> Dim {
        let value = self.expr(&named.value);
        let Some(unit) = &named.unit else {
            return value;
        };
        let dim = Dim::of(names::read(unit, self.diags));
        let what = format!("`{}`", named.name.name);
        self.fits(what, dim, (value, &named.value), Some(unit.span));
        dim
    }
}

/// True for a line that gives a declaration as a whole.
fn gives(bind: &Bind, decl: &Decl) -> bool {
    bind.target.head.name == decl.name.name && bind.target.rest.is_empty()
}

/// Names that a model declares, also in loops where they are seen outside.
fn collect<'f>(body: &'f [Stmt], names: &mut FxHashMap<&'f str, Thing<'f>>) {
    for stmt in body {
        match stmt {
            Stmt::Const(item) => names.insert(&item.name.name, Thing::Const),
            Stmt::Decl(decl) => names.insert(&decl.name.name, Thing::Decl(decl)),
            Stmt::Named(named) => names.insert(&named.name.name, Thing::Named(named)),
            Stmt::Switch(switch) => names.insert(&switch.name.name, Thing::Switch),
            Stmt::Part(part) => names.insert(&part.name.name, Thing::Part(part)),
            Stmt::For(repeat) => {
                let switches = repeat.body.iter();
                let switches =
                    switches.filter(|stmt| matches!(stmt, Stmt::Switch(_) | Stmt::For(_)));
                switches.for_each(|stmt| collect(std::slice::from_ref(stmt), names));
                None
            }
            _ => None,
        };
    }
}

/// Names that a file declares and imports, as far as they matter here.
fn names_of(file: &File) -> FxHashMap<&str, Thing<'_>> {
    let mut names = FxHashMap::default();
    for item in &file.items {
        match item {
            Item::Use(item) => {
                for import in imports(item) {
                    let thing = match (import.file, import.name) {
                        (Some(file), None) => Some(Thing::Module(file)),
                        (Some(file), Some(name)) => own(file, &name.name),
                        (None, _) => None,
                    };
                    names.extend(thing.map(|thing| (import.local, thing)));
                }
            }
            Item::Const(item) => {
                names.insert(&item.name.name, Thing::Const);
            }
            Item::Fn(item) => {
                names.insert(&item.name.name, Thing::Function(file, item));
            }
            _ => {}
        }
    }
    names
}

/// A constant or function that a file declares itself.
fn own<'f>(file: &'f File, name: &str) -> Option<Thing<'f>> {
    file.items.iter().find_map(|item| match item {
        Item::Const(item) if item.name.name == name => Some(Thing::Const),
        Item::Fn(item) if item.name.name == name => Some(Thing::Function(file, item)),
        _ => None,
    })
}
