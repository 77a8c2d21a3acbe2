//! The names of a file: constants, functions and models.

use std::rc::Rc;

use rustc_hash::FxHashMap;

use super::scope::{Callable, Meaning, Scope};
use crate::diagnostics::Diagnostics;
use crate::model::TargetKind;
use crate::model::errors::{ModelError, foreign};
use crate::model::expressions::Lowering;
use crate::model::hir::order::{chain, others, topological};
use crate::model::hir::reserved::{VALUES, did_you_mean, function_names, taken};
use crate::model::hir::{self, Global};
use crate::source::Span;
use crate::syntax::Function;

/// The scope that all models of a file share: its constants computed, its functions checked.
pub(crate) fn file_scope<'e>(
    mut scope: Scope<'e>,
    file: &hir::File<'_>,
    imported: &FxHashMap<Span, Rc<Scope<'e>>>,
    diags: &mut Diagnostics,
) -> Scope<'e> {
    let mut names: FxHashMap<String, Meaning<'e>> = FxHashMap::default();
    for known in &file.globals {
        let meaning = match known.global {
            Global::Model(_) => Meaning::Word("model"),
            Global::Const(_) => Meaning::Unusable,
            Global::Function(..) | Global::Import(_) => continue,
        };
        names.insert(known.name.to_owned(), meaning);
    }
    let mut functions = functions(file, &mut names, diags);
    for import in file.imports() {
        let scope = import.file.and_then(|file| imported.get(&file.span));
        let meaning = match (scope, import.name) {
            (None, _) => Some(Meaning::Unusable),
            (Some(scope), None) => Some(Meaning::Module(Rc::clone(scope))),
            (Some(scope), Some(name)) => match scope.functions.get(&name.name) {
                Some(function) if scope.declares.contains(&name.name) => {
                    let home = Some(Rc::clone(scope));
                    let function = Rc::clone(&function.function);
                    let callable = Callable { function, home };
                    functions.insert(import.local.to_owned(), callable);
                    None
                }
                _ => Some(
                    scope
                        .declared(&name.name)
                        .cloned()
                        .unwrap_or(Meaning::Unusable),
                ),
            },
        };
        if let Some(meaning) = meaning {
            names.insert(import.local.to_owned(), meaning);
        }
    }
    let own = file.globals.iter();
    let own = own.filter(|known| !matches!(known.global, Global::Import(_)));
    scope.of_file = Rc::new(names);
    scope.functions = Rc::new(functions);
    scope.declares = Rc::new(own.map(|known| known.name.to_owned()).collect());
    scope.forgiving = file.forgiving;
    constants(&mut scope, file, diags);
    scope
}

/// The functions that can be inlined; the others become unusable names.
fn functions<'e>(
    file: &hir::File<'_>,
    unusable: &mut FxHashMap<String, Meaning<'e>>,
    diags: &mut Diagnostics,
) -> FxHashMap<String, Callable<'e>> {
    let globals = &file.globals;
    let names: Vec<&str> = globals.iter().map(|known| known.name).collect();
    let function = |index: usize| match globals[index].global {
        Global::Function(_, function) => Some(function),
        _ => None,
    };
    let needs = file.needs(|index| Some(&function(index)?.body));
    let (_, cycles) = topological(&needs);
    let mut bad = vec![false; names.len()];
    for cycle in cycles {
        cycle.iter().for_each(|&node| bad[node] = true);
        let name = names[cycle[0]].to_owned();
        diags.push(ModelError::Recursion {
            name,
            chain: chain(&cycle, &names),
            span: globals[cycle[0]].span,
        });
    }
    for (index, bad) in bad.iter_mut().enumerate() {
        *bad |= function(index).is_some_and(|function| !check_function(file, function, diags));
    }
    // What calls an unusable function cannot be used either; callers come after in no order, so repeat.
    loop {
        let spread: Vec<usize> = (0..names.len())
            .filter(|&node| !bad[node] && needs[node].iter().any(|&need| bad[need]))
            .collect();
        if spread.is_empty() {
            break;
        }
        spread.iter().for_each(|&node| bad[node] = true);
    }
    let mut usable = FxHashMap::default();
    for (index, &name) in names.iter().enumerate() {
        let Some(function) = function(index) else {
            continue;
        };
        if bad[index] {
            unusable.insert(name.to_owned(), Meaning::Unusable);
        } else {
            let (function, home) = (Rc::new(function.clone()), None);
            usable.insert(name.to_owned(), Callable { function, home });
        }
    }
    usable
}

/// Parameters have names of their own, and the body reads them, constants and functions only.
fn check_function(file: &hir::File<'_>, function: &Function, diags: &mut Diagnostics) -> bool {
    let mut fine = true;
    for (position, param) in function.params.iter().enumerate() {
        let name = param.name.clone();
        fine &= !VALUES.contains(&name.as_str());
        if let Some(error) = taken(&name, param.span) {
            diags.push(error);
        }
        if let Some(first) = function.params[..position]
            .iter()
            .find(|other| other.name == name)
        {
            diags.push(ModelError::Redeclared {
                name,
                first: first.span,
                second: param.span,
            });
            fine = false;
        }
    }
    for (name, span) in file.unknown(&function.body) {
        let params = function.params.iter().map(|param| param.name.as_str());
        let all = file.globals.iter().map(|known| known.name);
        let all = all.chain(VALUES).chain(function_names()).chain(params);
        let known = foreign::function(name).or_else(|| foreign::value(name));
        let close = known.or_else(|| did_you_mean(name, all));
        let help = close
            .or_else(|| Some("a function sees its arguments, constants and functions only".into()));
        let name = name.to_owned();
        diags.push(ModelError::UnknownName { name, span, help });
        fine = false;
    }
    fine
}

fn constants<'e>(scope: &mut Scope<'e>, file: &hir::File<'_>, diags: &mut Diagnostics) {
    let globals = &file.globals;
    let names: Vec<&str> = globals.iter().map(|known| known.name).collect();
    let value = |index: usize| match globals[index].global {
        Global::Const(item) => Some(&item.value),
        _ => None,
    };
    let (order, cycles) = topological(&file.needs(value));
    let mut in_cycle = vec![false; names.len()];
    for cycle in cycles {
        cycle.iter().for_each(|&node| in_cycle[node] = true);
        let what = format!("`{}`", names[cycle[0]]);
        diags.push(ModelError::Cycle {
            what,
            chain: chain(&cycle, &names),
            span: globals[cycle[0]].span,
            others: others(&cycle, &names, |node| globals[node].span),
        });
    }
    for node in order.into_iter().filter(|&node| !in_cycle[node]) {
        let Some(expr) = value(node) else {
            continue;
        };
        let mut lowering = Lowering::new(scope, None, diags);
        let value = lowering.expr(expr).and_then(|value| {
            let what = format!("`{}`", names[node]);
            lowering.as_constants(&value.tensor, &what, expr.span)?;
            Ok(value)
        });
        let meaning = value.map_or(Meaning::Unusable, |value| {
            Meaning::Value(value, TargetKind::Const)
        });
        Rc::make_mut(&mut scope.of_file).insert(names[node].to_owned(), meaning);
    }
}
