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

mod declared;
mod dimension;
mod error;
mod functions;
mod infer;
mod instances;
pub(crate) mod literal;
mod names;
mod statements;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::rc::Rc;

use rustc_hash::FxHashSet;

pub use declared::Units;
pub use error::UnitError;

use self::infer::Inference;
use self::instances::{Instances, declares_units};
use self::statements::Checker;
use crate::diagnostics::Diagnostics;
use crate::model::hir::{Definition, Hir, import};
use crate::source::Span;
use crate::syntax::{Bind, Experiment, File, Model, Stmt};

/// The names of units that declarations take.
pub fn names() -> impl Iterator<Item = &'static str> {
    dimension::UNITS.iter().map(|(name, _)| *name)
}

/// Reports units of a model, and of its parts, that do not fit.
pub(crate) fn check_model<'f>(
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

/// Units that follow from those of others, by the places of names that are declared without one.
pub fn inferred(file: &File, item: &Model) -> HashMap<Span, String> {
    let mut silent = Diagnostics::new();
    let mut found = HashMap::new();
    if has_units(file, item) {
        let mut dims = Inference::new(Instances::new(Hir::default(), file, item), &mut silent);
        for stmt in &item.body {
            if let Stmt::Named(named) = stmt
                && named.unit.is_none()
                && let Some(unit) = dims.declared(0, Definition::Named(named)).unit()
            {
                found.insert(named.name.span, unit.to_string());
            }
        }
    }
    found
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
