//! Ast -> Model.
//!
//! Names are collected first, so that their order does not matter; then declarations are computed in an
//! order where each comes after what it needs, then defaults, then dynamics. The parts of a model are
//! declared with it and walked after it; at last their inputs get what they are connected to.

use rustc_hash::{FxHashMap, FxHashSet};

use super::{Model, ModelError, display, units};
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::model::expressions::Lowering;
use crate::model::names::parts::{Files, Instance};
use crate::model::names::scope::Scope;
use crate::model::names::{bind, connect};
use crate::model::statements::declare::Declaring;
use crate::model::statements::{algebraic, dynamics, partition};
use crate::source::Span;
use crate::syntax::{Bind, Experiment, File, Item};

/// The meaning of the model called `name`.
///
/// Of the `with` of an experiment, what it gives to structural constants is used here.
/// Nothing is returned unless all of the model is right and supported.
pub fn resolve<'e>(
    exprs: &'e Exprs,
    file: &File,
    name: &str,
    with: &[Bind],
    diags: &mut Diagnostics,
) -> Option<Model<'e>> {
    let mut found = Diagnostics::default();
    let model = resolve_in(exprs, file, name, with, &mut found);
    let failed = found.has_errors();
    found.remove_repeated();
    found.remove_known(diags);
    diags.append(found);
    model.filter(|model| !failed && !model.scope.forgiving)
}

fn resolve_in<'e>(
    exprs: &'e Exprs,
    file: &File,
    name: &str,
    with: &[Bind],
    diags: &mut Diagnostics,
) -> Option<Model<'e>> {
    let item = file.items.iter().find_map(|item| match item {
        Item::Model(model) if model.name.name == name => Some(model),
        _ => None,
    });
    let Some(item) = item else {
        diags.push(ModelError::UnknownModel {
            name: name.to_owned(),
            span: file.span,
            help: None,
        });
        return None;
    };
    let time = exprs.variable("time");
    let mut files = Files::new(exprs, time);
    let scope = files.scope(file, diags);
    let mut declaring = Declaring::new(file, item, scope, files, diags);
    let whole = declaring.instance(file, item, String::new(), vec![], with);
    let Declaring {
        mut draft, files, ..
    } = declaring;
    let bound = bind::defaults(&mut draft, &whole, diags);
    let mut model = draft.model;
    model.scope = (*whole.scope).clone();

    let touched = walk(&mut model, &whole, diags);
    let is_connected = connect::connect(&mut model, bound, diags);
    let mut seen = FxHashSet::default();
    (model.surfaces)
        .retain(|surface| surface.psi.is_zero() || seen.insert((surface.psi, surface.is_alias)));
    if is_connected && !is_forgiving(&whole) {
        partition::partition(&mut model, &touched, diags);
        algebraic::count(&model, diags);
    }
    model.scope.forgiving |= is_forgiving(&whole);
    if !diags.has_errors() && !model.scope.forgiving {
        units::check_model(files.hir, file, item, diags);
    }
    debug_assert!(
        diags.has_errors() || display::verify(&model).is_ok(),
        "{:?}",
        display::verify(&model)
    );
    Some(model)
}

/// Lowers the statements of an instance and of the parts in it; returns the states with wrong ones.
fn walk<'e>(
    model: &mut Model<'e>,
    whole: &Instance<'_, 'e>,
    diags: &mut Diagnostics,
) -> FxHashSet<String> {
    let mut walk = dynamics::Walk::new(model);
    let mut open = vec![whole];
    while let Some(instance) = open.pop() {
        let mut lowering = Lowering::new(&instance.scope, None, diags);
        walk.block(&mut lowering, &instance.names.item.body);
        model.surfaces.append(&mut lowering.surfaces);
        model.rounded.append(&mut lowering.rounded);
        let inner = instance.parts.iter().map(|inner| &inner.instance);
        open.extend(inner.rev());
    }
    model.statements = walk.found;
    walk.touched
}

/// Reports what is wrong with the names of a file, whatever its models need.
pub fn check_file(file: &File, diags: &mut Diagnostics) {
    let exprs = Exprs::new();
    let time = exprs.variable("time");
    Files::new(&exprs, time).scope(file, diags);
    let mut experiments: FxHashMap<&str, Span> = FxHashMap::default();
    for item in &file.items {
        if let Item::Experiment(Experiment { name, .. }) = item
            && let Some(first) = experiments.insert(&name.name, name.span)
        {
            diags.push(ModelError::Redeclared {
                name: name.name.clone(),
                first,
                second: name.span,
            });
        }
    }
}

/// True where a statement somewhere in the model could not be read.
fn is_forgiving(whole: &Instance<'_, '_>) -> bool {
    let inner = whole.parts.iter();
    whole.scope.forgiving || inner.map(|inner| &inner.instance).any(is_forgiving)
}

impl Model<'_> {
    /// Lets experiments in another file see the names of that file, besides those of the model.
    pub fn see_from(&mut self, file: &File, diags: &mut Diagnostics) {
        let of_file = Files::new(self.exprs, self.time).scope(file, diags);
        self.scope = Scope {
            names: std::mem::take(&mut self.scope.names),
            forgiving: self.scope.forgiving || of_file.forgiving,
            ..of_file
        };
    }
}
