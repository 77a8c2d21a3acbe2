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
mod instances;
mod names;
mod statements;
#[cfg(test)]
mod tests;

use std::rc::Rc;

use rustc_hash::{FxHashMap, FxHashSet};

pub use error::UnitError;

use self::dimension::{Dimension, Ratio};
use self::instances::Instances;
use self::statements::Checker;
use crate::diagnostics::Diagnostics;
use crate::model::hir::{self, Definition, Hir, References, import};
use crate::source::Span;
use crate::syntax::{Bind, Decl, Experiment, File, Model, Named, Stmt};

/// Expressions inside each other, through functions, names and parts: what the stack bears.
/// Further down, dimensions are unknown.
const MAX_DEPTH: usize = 300;
/// Expressions that are looked at; beyond, dimensions are unknown. Models that reach it are refused
/// for their size, unless they repeat a call in vain.
const BUDGET: usize = 4_000_000;

/// Reports units of a model, and of its parts, that do not fit.
pub(super) fn check_model<'f>(
    hir: Hir<'f>,
    file: &'f File,
    item: &'f Model,
    diags: &mut Diagnostics,
) {
    if has_units(file, item) {
        let dims = Inference::new(Instances::new(hir, file, item), diags);
        Checker { dims }.body(&item.body);
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
        let mut instances = Instances::new(Hir::default(), home, item);
        let file = instances.file(file);
        let names = instances.of(0).of_experiment(&file, experiment, overrides);
        let mut dims = Inference::new(instances, &mut found);
        (dims.place.file, dims.place.names) = (file, Rc::new(names));
        Checker { dims }.experiment(experiment, overrides);
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

/// Where names stand.
#[derive(Clone)]
struct Place<'f> {
    file: Rc<hir::File<'f>>,
    /// What they refer to.
    names: Rc<References<'f>>,
    /// The instance whose names are in sight; none in functions.
    instance: Option<usize>,
    /// Arguments of the function around, with their values where these are plain numbers.
    arguments: Vec<(Dim, Option<Ratio>)>,
    /// Whether `time` has a unit here: it has in a model that declares units.
    has_units: bool,
    /// The call or part that leads to here.
    call: Option<Span>,
}

/// Dimensions of expressions, and of what is declared.
struct Inference<'f, 'd> {
    instances: Instances<'f>,
    /// Dimensions of what instances declare; `None` while one is being looked at.
    known: FxHashMap<(usize, Span), Option<Dim>>,
    place: Place<'f>,
    depth: usize,
    left: usize,
    diags: &'d mut Diagnostics,
}

impl<'f, 'd> Inference<'f, 'd> {
    /// In the model itself.
    fn new(instances: Instances<'f>, diags: &'d mut Diagnostics) -> Self {
        Inference {
            place: instances.place(0, None),
            instances,
            known: FxHashMap::default(),
            depth: 0,
            left: BUDGET,
            diags,
        }
    }

    /// Runs `look` in another place.
    fn within<T>(&mut self, place: Place<'f>, look: impl FnOnce(&mut Self) -> T) -> T {
        let outside = std::mem::replace(&mut self.place, place);
        let result = look(self);
        self.place = outside;
        result
    }

    /// The dimension of what an instance declares.
    fn declared(&mut self, instance: usize, definition: Definition<'f>) -> Dim {
        let span = match definition {
            Definition::Decl(decl) => decl.span,
            Definition::Named(named) => named.span,
            Definition::Switch(_) => return Dim::PURE,
            // A structural constant has no unit of its own.
            _ => return Dim::Unknown,
        };
        // What is asked for while it is looked at depends on itself through parts.
        if let Some(known) = self.known.get(&(instance, span)) {
            return known.unwrap_or(Dim::Unknown);
        }
        self.known.insert((instance, span), None);
        let place = self.instances.place(instance, self.place.call);
        let dim = self.within(place, |dims| match definition {
            Definition::Decl(decl) => dims.quantity(instance, decl),
            Definition::Named(named) => dims.named(named),
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
        let given = self.instances.given(instance, decl);
        let given = given.map(|(value, outer)| {
            let place = self.instances.place(outer, self.place.call);
            self.within(place, |dims| dims.expr(value))
        });
        match given {
            Some(Dim::Known(dimension)) => Dim::Known(dimension),
            _ => Dim::Unknown,
        }
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
