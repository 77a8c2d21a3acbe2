//! The names of a file: constants, functions and models.

use std::cell::Cell;
use std::rc::Rc;

use rustc_hash::FxHashMap;

use super::import::{Import, import};
use super::order::{chain, edges, free_names, free_names_under, others, topological};
use super::parts::Files;
use super::reserved::{VALUES, did_you_mean, function_names, is_builtin, is_function};
use super::scope::{Callable, Meaning, Scope};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Exprs};
use crate::model::errors::foreign;
use crate::model::expressions::Lowering;
use crate::model::{ModelError, TargetKind};
use crate::source::Span;
use crate::syntax::{Const, Experiment, File, Function, Ident, Item};

/// Work a model may cost, in entries made and expressions visited.
const BUDGET: usize = 4_000_000;

/// What the file declares, by name.
#[derive(Default)]
pub(crate) struct FileNames<'f> {
    names: FxHashMap<&'f str, (&'static str, Span)>,
    pub imports: Vec<Import<'f>>,
    consts: Vec<&'f Const>,
    functions: Vec<&'f Function>,
    /// True where an item could not be read.
    forgiving: bool,
}

impl<'f> FileNames<'f> {
    /// The files it imports.
    pub fn files(&self) -> impl Iterator<Item = &'f File> + '_ {
        self.imports.iter().filter_map(|import| import.file)
    }

    /// The kind and place of a declaration.
    pub fn get(&self, name: &str) -> Option<(&'static str, Span)> {
        self.names.get(name).copied()
    }
}

/// The work that one model may cost, with all its parts.
pub(crate) fn budget() -> Rc<Cell<Option<usize>>> {
    Rc::new(Cell::new(Some(BUDGET)))
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

/// Declarations of a file; each name once.
pub(crate) fn file_names<'f>(file: &'f File, diags: &mut Diagnostics) -> FileNames<'f> {
    let mut names = FileNames::default();
    for item in &file.items {
        match item {
            Item::Use(item) => import(&mut names, item, diags),
            Item::Const(item) if declare(&mut names, &item.name, "constant", diags) => {
                names.consts.push(item)
            }
            Item::Fn(item) if declare(&mut names, &item.name, "function", diags) => {
                names.functions.push(item)
            }
            Item::Bad(_) => names.forgiving = true,
            Item::Model(item) => {
                declare(&mut names, &item.name, "model", diags);
            }
            _ => {}
        }
    }
    names
}

fn declare<'f>(
    names: &mut FileNames<'f>,
    name: &'f Ident,
    kind: &'static str,
    diags: &mut Diagnostics,
) -> bool {
    declare_name(names, &name.name, name.span, kind, diags)
}

pub(crate) fn declare_name<'f>(
    names: &mut FileNames<'f>,
    name: &'f str,
    span: Span,
    kind: &'static str,
    diags: &mut Diagnostics,
) -> bool {
    let text = name.to_owned();
    if is_builtin(&text) {
        diags.push(ModelError::BuiltIn { name: text, span });
        return false;
    }
    if let Some(&(_, first)) = names.names.get(name) {
        diags.push(ModelError::Redeclared {
            name: text,
            first,
            second: span,
        });
        return false;
    }
    names.names.insert(name, (kind, span));
    true
}

/// The scope that all models of a file share: its constants computed, its functions checked.
pub(crate) fn file_scope<'e>(
    exprs: &'e Exprs,
    time: Expr<'e>,
    file: &FileNames<'_>,
    imported: &FxHashMap<Span, Rc<Scope<'e>>>,
    budget: &Rc<Cell<Option<usize>>>,
    diags: &mut Diagnostics,
) -> Scope<'e> {
    let mut names: FxHashMap<String, Meaning<'e>> = FxHashMap::default();
    for (&name, &(kind, _)) in &file.names {
        match kind {
            "model" => {
                names.insert(name.to_owned(), Meaning::Word("model"));
            }
            "constant" => {
                names.insert(name.to_owned(), Meaning::Unusable);
            }
            _ => {}
        }
    }
    let mut functions = functions(file, &mut names, diags);
    for import in &file.imports {
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
    let own = file.names.iter().filter(|(_, (kind, _))| *kind != "`use`");
    let declares = own.map(|(&name, _)| name.to_owned()).collect();
    let mut scope = Scope {
        exprs,
        time,
        prefix: String::new(),
        names: names.clone(),
        of_file: Rc::new(names),
        functions: Rc::new(functions),
        declares: Rc::new(declares),
        forgiving: file.forgiving,
        budget: Rc::clone(budget),
    };
    constants(&mut scope, file, diags);
    scope
}

/// The functions that can be inlined; the others become unusable names.
fn functions<'e>(
    file: &FileNames<'_>,
    unusable: &mut FxHashMap<String, Meaning<'e>>,
    diags: &mut Diagnostics,
) -> FxHashMap<String, Callable<'e>> {
    let names: Vec<&str> = file
        .functions
        .iter()
        .map(|function| function.name.name.as_str())
        .collect();
    let needs = file.functions.iter().map(|function| called(function));
    let needs = edges(&names, needs);
    let (_, cycles) = topological(&needs);
    let mut bad = vec![false; names.len()];
    for cycle in cycles {
        cycle.iter().for_each(|&node| bad[node] = true);
        let name = names[cycle[0]].to_owned();
        let span = file.functions[cycle[0]].name.span;
        diags.push(ModelError::Recursion {
            name,
            chain: chain(&cycle, &names),
            span,
        });
    }
    for (index, function) in file.functions.iter().enumerate() {
        bad[index] |= !check_function(file, function, diags);
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
    for (index, function) in file.functions.iter().enumerate() {
        match bad[index] {
            true => unusable
                .insert(names[index].to_owned(), Meaning::Unusable)
                .map_or((), drop),
            false => usable
                .insert(
                    names[index].to_owned(),
                    Callable {
                        function: Rc::new((*function).clone()),
                        home: None,
                    },
                )
                .map_or((), drop),
        }
    }
    usable
}

fn called(function: &Function) -> Vec<String> {
    let params: Vec<String> = function
        .params
        .iter()
        .map(|param| param.name.clone())
        .collect();
    free_names_under(&params, std::iter::once(&function.body))
}

/// Parameters have names of their own, and the body reads them, constants and functions only.
fn check_function(file: &FileNames<'_>, function: &Function, diags: &mut Diagnostics) -> bool {
    let mut fine = true;
    for (position, param) in function.params.iter().enumerate() {
        let name = param.name.clone();
        if is_builtin(&name) {
            diags.push(ModelError::BuiltIn {
                name,
                span: param.span,
            });
            fine = false;
        } else if let Some(first) = function.params[..position]
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
    for name in called(function) {
        let known = file.forgiving
            || file.names.contains_key(name.as_str())
            || VALUES.contains(&name.as_str())
            || is_function(&name);
        if !known {
            let params = function.params.iter().map(|param| param.name.as_str());
            let all = file
                .names
                .keys()
                .copied()
                .chain(VALUES)
                .chain(function_names())
                .chain(params);
            let known = foreign::function(&name).or_else(|| foreign::value(&name));
            let close = known.or_else(|| did_you_mean(&name, all));
            let help = close.or_else(|| {
                Some("a function sees its arguments, constants and functions only".into())
            });
            let span = super::order::name_span(&function.body, &name).unwrap_or(function.body.span);
            diags.push(ModelError::UnknownName { name, span, help });
            fine = false;
        }
    }
    fine
}

fn constants<'e>(scope: &mut Scope<'e>, file: &FileNames<'_>, diags: &mut Diagnostics) {
    let names: Vec<&str> = file
        .consts
        .iter()
        .map(|item| item.name.name.as_str())
        .collect();
    let needs = edges(
        &names,
        file.consts.iter().map(|item| free_names(&item.value)),
    );
    let (order, cycles) = topological(&needs);
    let mut in_cycle = vec![false; names.len()];
    for cycle in cycles {
        cycle.iter().for_each(|&node| in_cycle[node] = true);
        let what = format!("`{}`", names[cycle[0]]);
        let span = file.consts[cycle[0]].name.span;
        diags.push(ModelError::Cycle {
            what,
            chain: chain(&cycle, &names),
            span,
            others: others(&cycle, &names, |node| file.consts[node].name.span),
        });
    }
    for node in order.into_iter().filter(|&node| !in_cycle[node]) {
        let item = file.consts[node];
        let mut found = Diagnostics::default();
        let value = {
            let mut lowering = Lowering::new(scope, None, &mut found);
            lowering.expr(&item.value).and_then(|value| {
                let what = format!("`{}`", item.name.name);
                lowering.as_constants(&value.tensor, &what, item.value.span)?;
                Ok(value)
            })
        };
        diags.append(found);
        let meaning = value.map_or(Meaning::Unusable, |value| {
            Meaning::Value(value, TargetKind::Const)
        });
        Rc::make_mut(&mut scope.of_file).insert(item.name.name.clone(), meaning.clone());
        scope.names.insert(item.name.name.clone(), meaning);
    }
}
