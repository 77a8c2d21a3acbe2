//! Ast -> Model.
//!
//! Names are collected first, so that their order does not matter; then declarations are computed in an
//! order where each comes after what it needs, then defaults, then dynamics.

use rustc_hash::FxHashSet;

use super::declare::Declaring;
use super::file::{file_names, file_scope};
use super::lower::Lowering;
use super::names::{Declared, Item, collect};
use super::order::{chain, edges, free_names_under, topological};
use super::{Model, ModelError, display, dynamics, partition};
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::syntax::{self, Bind, Expr, ExprKind, File, Stmt};

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
    let names = file_names(file, diags);
    let time = exprs.variable("time");
    let mut scope = file_scope(exprs, time, &names, diags);
    scope.forgiving |= has_bad(&item.body);
    let declared = collect(item, &names, diags);

    let mut declaring = Declaring::new(name, item.span, scope, diags);
    let order = order(&declared, with, declaring.diags);
    // What is not computed, in a cycle, stays like this.
    for declared in &declared {
        declaring.unusable(declared);
    }
    for index in order {
        declaring.declare(&declared[index], with);
    }
    declaring.defaults(&declared);
    let mut model = declaring.model;

    let (mut surfaces, touched) = {
        let mut lowering = Lowering::new(&model.scope, None, diags);
        let mut walk = dynamics::Walk::new(&model);
        walk.block(&mut lowering, &item.body);
        let surfaces = std::mem::take(&mut lowering.surfaces);
        let dynamics::Walk {
            dynamics,
            regions,
            hidden,
            touched,
            ..
        } = walk;
        (model.dynamics, model.regions, model.hidden) = (dynamics, regions, hidden);
        (surfaces, touched)
    };
    model.surfaces.append(&mut surfaces);
    let mut seen = FxHashSet::default();
    model.surfaces.retain(|surface| seen.insert(surface.psi));
    let complete = !item.body.iter().any(sets_elsewhere);
    if !model.scope.forgiving {
        partition::partition(&mut model, &touched, complete, diags);
    }
    debug_assert!(
        diags.has_errors() || display::verify(&model).is_ok(),
        "{:?}",
        display::verify(&model)
    );
    Some(model)
}

/// Statements that set dynamics in ways that are not looked at here.
fn sets_elsewhere(stmt: &Stmt) -> bool {
    matches!(stmt, Stmt::Mechanics(_))
}

/// True where a statement could not be read, also in blocks.
fn has_bad(body: &[Stmt]) -> bool {
    body.iter().any(|stmt| match stmt {
        Stmt::Bad(_) => true,
        Stmt::For(repeat) => has_bad(&repeat.body),
        Stmt::Region(region) => has_bad(&region.body),
        Stmt::Hidden(hidden) => has_bad(&hidden.body),
        _ => false,
    })
}

/// An order of declarations; those in cycles are left out and reported.
fn order(declared: &[Declared<'_>], with: &[Bind], diags: &mut Diagnostics) -> Vec<usize> {
    let names: Vec<&str> = declared
        .iter()
        .map(|declared| declared.name.name.as_str())
        .collect();
    let needs = edges(
        &names,
        declared.iter().map(|declared| needs(declared, with)),
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
        });
    }
    order.into_iter().filter(|&node| !in_cycle[node]).collect()
}

/// Names that must have a value before a declaration has one.
fn needs(declared: &Declared<'_>, with: &[Bind]) -> Vec<String> {
    match declared.item {
        Item::Const(item) => free_names_under(&[], std::iter::once(given(item, with))),
        Item::Decl(decl) => free_names_under(&[], decl.shape.iter()),
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
        Item::Word(_) | Item::Unsupported => vec![],
    }
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

/// The argument of `sign(..)` or `step(..)`.
pub(super) fn switch_argument(value: &Expr) -> Option<(super::SwitchKind, &Expr)> {
    let ExprKind::Call(function, args) = &value.kind else {
        return None;
    };
    let (ExprKind::Name(name), [syntax::Arg::Positional(arg, binders)]) =
        (&function.kind, &args[..])
    else {
        return None;
    };
    let kind = match name.as_str() {
        "sign" => super::SwitchKind::Sign,
        "step" => super::SwitchKind::Step,
        _ => return None,
    };
    binders.is_empty().then_some((kind, arg))
}
