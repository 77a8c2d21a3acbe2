//! Ast -> Model.
//!
//! Names are collected first, so that their order does not matter; then declarations are computed in an
//! order where each comes after what it needs, then defaults, then dynamics. The parts of a model are
//! declared with it and walked after it; at last their inputs get what they are connected to.

use rustc_hash::FxHashSet;

use super::names::{Declared, Item};
use super::{Model, ModelError, display, units};
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::model::expressions::Lowering;
use crate::model::names::order::{chain, edges, free_names_under, others, topological};
use crate::model::names::parts::{Files, Instance};
use crate::model::names::{connect, import, parts};
use crate::model::statements::declare::Declaring;
use crate::model::statements::{algebraic, dynamics, partition};
use crate::syntax::{self, Bind, Expr, File, Stmt};

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
        syntax::Item::Model(model) if model.name.name == name => Some(model),
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
    let bound = declaring.defaults(&whole);
    let mut model = declaring.model;
    model.scope = (*whole.scope).clone();

    let touched = walk(&mut model, &whole, diags);
    let is_connected = connect::connect(&mut model, bound, diags);
    let mut seen = FxHashSet::default();
    (model.surfaces).retain(|surface| surface.psi.is_zero() || seen.insert(surface.psi));
    if is_connected && !is_forgiving(&whole) {
        partition::partition(&mut model, &touched, diags);
        algebraic::count(&model, diags);
    }
    model.scope.forgiving |= is_forgiving(&whole);
    if !diags.has_errors() && !model.scope.forgiving {
        units::check_model(file, item, diags);
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
        walk.block(&mut lowering, &instance.item.body);
        model.surfaces.append(&mut lowering.surfaces);
        model.rounded.append(&mut lowering.rounded);
        let inner = instance.parts.iter().map(|inner| &inner.instance);
        open.extend(inner.rev());
    }
    model.statements = walk.found;
    walk.touched
}

/// True where a statement somewhere in the model could not be read.
fn is_forgiving(whole: &Instance<'_, '_>) -> bool {
    let inner = whole.parts.iter();
    whole.scope.forgiving || inner.map(|inner| &inner.instance).any(is_forgiving)
}

/// True where a statement could not be read, also in blocks.
pub(super) fn has_bad(body: &[Stmt]) -> bool {
    body.iter().any(|stmt| match stmt {
        Stmt::Bad(_) => true,
        Stmt::For(repeat) => has_bad(&repeat.body),
        Stmt::Region(region) => has_bad(&region.body),
        Stmt::Hidden(hidden) => has_bad(&hidden.body),
        _ => false,
    })
}

/// An order of declarations; those in cycles are left out and reported.
pub(super) fn order(
    declared: &[Declared<'_>],
    file: &File,
    with: &[Bind],
    diags: &mut Diagnostics,
) -> Vec<usize> {
    let names: Vec<&str> = declared
        .iter()
        .map(|declared| declared.name.name.as_str())
        .collect();
    let needs = edges(
        &names,
        declared.iter().map(|declared| needs(declared, file, with)),
    );
    let (order, cycles) = topological(&needs);
    let mut in_cycle = vec![false; declared.len()];
    for cycle in cycles {
        if cycle.iter().any(|&node| in_cycle[node]) {
            continue;
        }
        cycle.iter().for_each(|&node| in_cycle[node] = true);
        let what = format!("`{}`", names[cycle[0]]);
        let span = declared[cycle[0]].name.span;
        diags.push(ModelError::Cycle {
            what,
            chain: chain(&cycle, &names),
            span,
            others: others(&cycle, &names, |node| declared[node].name.span),
        });
    }
    order.into_iter().filter(|&node| !in_cycle[node]).collect()
}

/// Names that must have a value before a declaration has one.
fn needs(declared: &Declared<'_>, file: &File, with: &[Bind]) -> Vec<String> {
    match declared.item {
        Item::Const(item) => free_names_under(&[], std::iter::once(given(item, with))),
        Item::Decl(decl) => free_names_under(&[], decl.shape.iter()),
        // The words of a table are no names.
        Item::Named(named) if syntax::table_of(named).is_some() => vec![],
        Item::Named(named) => free_names_under(&[], std::iter::once(&named.value)),
        Item::Switch(switch) => {
            // Indices hide names in the body; bounds are seen from outside them.
            let binders = || declared.frames.iter().flat_map(|frame| frame.binders);
            let lets = || declared.frames.iter().flat_map(|frame| &frame.lets);
            let mut bound: Vec<String> = binders().map(|binder| binder.name.name.clone()).collect();
            bound.extend(lets().map(|named| named.name.name.clone()));
            let bounds = free_names_under(
                &[],
                binders().flat_map(|binder| [&binder.first, &binder.last]),
            );
            let used = used_lets(&switch.value, &declared.frames);
            let inner = std::iter::once(&switch.value).chain(used.iter().map(|named| &named.value));
            let mut names = free_names_under(&bound, inner);
            names.extend(bounds);
            names
        }
        Item::Part(part) => part_needs(part, file, with),
        Item::Program(program) => free_names_under(&[], program.shape.iter()),
        Item::Word(_) | Item::Unsupported => vec![],
    }
}

/// Only structural constants are needed before a part is there.
fn part_needs(part: &syntax::Part, file: &File, with: &[Bind]) -> Vec<String> {
    let binders = || part.binder.iter();
    let bounds = binders().flat_map(|binder| [&binder.first, &binder.last]);
    let mut names = free_names_under(&[], bounds);
    let index: Vec<String> = binders().map(|binder| binder.name.name.clone()).collect();
    if let Some((file, item)) = import::find_silently(file, &part.model) {
        let consts = part.binds.iter();
        let consts = consts.filter(|bind| parts::names_const(file, item, &bind.target));
        names.extend(free_names_under(&index, consts.map(|bind| &bind.value)));
    }
    let from_outside = with.iter();
    let from_outside = from_outside
        .filter(|bind| bind.target.head.name == part.name.name && !bind.target.rest.is_empty());
    names.extend(free_names_under(&[], from_outside.map(|bind| &bind.value)));
    names
}

/// Local `let`s that an expression reads, directly or through each other.
fn used_lets<'d>(expr: &Expr, frames: &'d [super::names::Frame<'_>]) -> Vec<&'d syntax::Named> {
    let lets: Vec<&syntax::Named> = frames
        .iter()
        .flat_map(|frame| &frame.lets)
        .map(|named| &**named)
        .collect();
    let mut used: Vec<&syntax::Named> = vec![];
    let mut open = free_names_under(&[], std::iter::once(expr));
    while let Some(name) = open.pop() {
        for named in lets.iter().filter(|named| named.name.name == name) {
            if !used.iter().any(|other| std::ptr::eq(*other, *named)) {
                used.push(named);
                open.extend(free_names_under(&[], std::iter::once(&named.value)));
            }
        }
    }
    used
}

/// The value of a constant: its own, or what the experiment gives it.
pub(super) fn given<'a>(item: &'a syntax::Const, with: &'a [Bind]) -> &'a Expr {
    let of_const =
        |bind: &&Bind| bind.target.rest.is_empty() && bind.target.head.name == item.name.name;
    with.iter()
        .rev()
        .find(of_const)
        .map_or(&item.value, |bind| &bind.value)
}
