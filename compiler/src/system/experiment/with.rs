//! `with { omega = 6; x = [0, 1]; u = sin(time); s.sliding = linear; }`

use rustc_hash::{FxHashMap, FxHashSet};

use super::error::ExperimentError;
use super::reader::unknown_choice;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var};
use crate::model::{GivenError, Model, Quantity, Target, TargetKind};
use crate::source::Span;
use crate::syntax::{self, Bind, ExprKind, Ident, Path, SettingKind, Sliding};

/// What `with` gives to the model.
#[derive(Debug, Default)]
pub(crate) struct Given<'e> {
    /// Values by variable, with the line that gives each.
    pub values: FxHashMap<Var, (Expr<'e>, Span)>,
    /// Readings of named switches.
    pub sliding: FxHashMap<usize, Sliding>,
    /// Whether controls that are not given are decided by the experiment.
    pub decides: bool,
    /// Parameters that are optimized or stay open, with where each is freed.
    pub free: FxHashMap<Var, Span>,
    /// Those that stay open.
    pub open: FxHashSet<Var>,
    /// What the data of a run of its own give, which is not free there.
    pub own: FxHashSet<Var>,
    /// The experiment.
    pub span: Span,
}

/// Everything that `with` and `overrides` give; `None` after an error.
pub(crate) fn given<'e>(
    model: &Model<'e>,
    experiment: &syntax::Experiment,
    overrides: &[Bind],
    diags: &mut Diagnostics,
) -> Option<Given<'e>> {
    let mut given = Given {
        decides: matches!(
            experiment.kind,
            syntax::ExperimentKind::Optimize | syntax::ExperimentKind::Mpc
        ),
        free: freed(model, experiment),
        own: own(model, experiment),
        span: experiment.span,
        ..Given::default()
    };
    given.free.retain(|var, _| !given.own.contains(var));
    if experiment.kind == syntax::ExperimentKind::Fit {
        given.open = given.free.keys().copied().collect();
    }
    let mut complete = stay_open(model, experiment, &mut given, diags);
    let binds = experiment
        .settings
        .iter()
        .filter_map(|setting| match &setting.kind {
            SettingKind::With(binds) => Some(binds),
            _ => None,
        });
    for bind in binds.flatten() {
        complete &= give(model, bind, false, &mut given, diags).is_some();
    }
    for bind in overrides {
        complete &= give(model, bind, true, &mut given, diags).is_some();
    }
    let mut of_data = Given::default();
    for bind in experiment.own() {
        complete &= give(model, bind, false, &mut of_data, diags).is_some();
    }
    given.values.extend(of_data.values);
    given.sliding.extend(of_data.sliding);
    complete.then_some(given)
}

/// What data with a run of their own give; what is wrong with it is reported where it is given.
fn own(model: &Model<'_>, experiment: &syntax::Experiment) -> FxHashSet<Var> {
    let targets = experiment.own().iter().filter_map(|bind| {
        let target = model.scope.target(&bind.target, &mut Diagnostics::new())?;
        let quantity = model.quantities.get(target.kind)?;
        Some(entries(quantity, &target).collect::<Vec<_>>())
    });
    targets.flatten().collect()
}

/// Lets parameters stay open; false where something else should, or what is optimized.
fn stay_open(
    model: &Model<'_>,
    experiment: &syntax::Experiment,
    given: &mut Given<'_>,
    diags: &mut Diagnostics,
) -> bool {
    let mut complete = true;
    for path in &experiment.open {
        let Some(target) = model.scope.target(path, diags) else {
            complete = false;
            continue;
        };
        let TargetKind::Param(k) = target.kind else {
            // What is no number to differentiate by is told where that is read.
            if experiment.senses(path.span) {
                continue;
            }
            diags.push(ExperimentError::NotFree {
                name: path_text(model, path, &target),
                kind: target.kind.word(),
                expected: "param",
                span: path.span,
            });
            complete = false;
            continue;
        };
        for var in entries(&model.quantities.params[k], &target) {
            match given.free.insert(var, path.span) {
                Some(first) if !given.open.contains(&var) => {
                    diags.push(ExperimentError::Twice {
                        what: format!("`{}`", model.exprs.name(var)),
                        first,
                        second: path.span,
                    });
                    complete = false;
                }
                _ => _ = given.open.insert(var),
            }
        }
    }
    complete
}

/// The variables of what is named of a quantity.
fn entries(quantity: &Quantity<'_>, target: &Target) -> impl Iterator<Item = Var> {
    let entries = target.entries.iter();
    entries.filter_map(|&entry| quantity.vars.get(entry)?.as_variable())
}

/// The parameters that `free` names; what is wrong with it is reported where it is read.
fn freed(model: &Model<'_>, experiment: &syntax::Experiment) -> FxHashMap<Var, Span> {
    let mut freed = FxHashMap::default();
    let listed = experiment.settings.iter().flat_map(|setting| {
        let list = match &setting.kind {
            SettingKind::Free(list) => &list[..],
            _ => &[],
        };
        list.iter().map(|(path, _)| path)
    });
    for path in listed {
        let Some(target) = model.scope.target(path, &mut Diagnostics::new()) else {
            continue;
        };
        if let TargetKind::Param(k) = target.kind {
            let vars = entries(&model.quantities.params[k], &target);
            freed.extend(vars.map(|var| (var, path.span)));
        }
    }
    freed
}

fn give<'e>(
    model: &Model<'e>,
    bind: &Bind,
    replaces: bool,
    given: &mut Given<'e>,
    diags: &mut Diagnostics,
) -> Option<()> {
    let target = model.scope.target(&bind.target, diags)?;
    let quantity: &Quantity<'e> = match target.kind {
        TargetKind::Sliding(k) => {
            given.sliding.insert(k, sliding(&bind.value, diags)?);
            return Some(());
        }
        // Structural constants were given to the model itself.
        TargetKind::Const => {
            let error = GivenError::constant_entry(&bind.target);
            let is_whole = error.is_none();
            error.into_iter().for_each(|error| diags.push(error));
            return is_whole.then_some(());
        }
        kind => {
            let quantity = model.quantities.get(kind);
            if quantity.is_none() {
                diags.push(ExperimentError::NotGiven {
                    name: path_text(model, &bind.target, &target),
                    kind: kind.word(),
                    span: bind.target.span,
                });
            }
            quantity?
        }
    };
    let name = path_text(model, &bind.target, &target);
    let what = format!("{} `{name}`", target.kind.word());
    let value = model
        .scope
        .expr_as(&bind.value, target.shape, &what, None, diags)?;
    let vars = target
        .entries
        .iter()
        .filter_map(|&k| quantity.vars.get(k)?.as_variable());
    let mut first: Option<Span> = None;
    for (var, entry) in vars.zip(value.data) {
        let before = given.values.insert(var, (entry, bind.span));
        first = first.or(before.map(|(_, span)| span));
    }
    match first {
        Some(first) if !replaces => {
            diags.push(ExperimentError::Twice {
                what,
                first,
                second: bind.span,
            });
            None
        }
        _ => Some(()),
    }
}

fn sliding(value: &syntax::Expr, diags: &mut Diagnostics) -> Option<Sliding> {
    let name = match &value.kind {
        ExprKind::Name(name) => name.clone(),
        _ => "..".to_owned(),
    };
    let reading = Sliding::named(&name);
    if reading.is_none() {
        let span = value.span;
        let words = Sliding::ALL.map(Sliding::word);
        diags.push(unknown_choice("reading", &Ident { name, span }, &words));
    }
    reading
}

/// The name of what a path means: `q`, `x[2]`, `x[1..3]`.
pub(crate) fn path_text(model: &Model<'_>, path: &Path, target: &Target) -> String {
    let quantity = model.quantities.get(target.kind);
    let quantity = quantity.map(|quantity| (quantity.name.clone(), quantity.shape));
    let named = model.definitions.get(target.kind);
    let named = named.map(|named| (named.name.clone(), named.value.shape));
    let whole = quantity.or(named).or_else(|| match target.kind {
        TargetKind::Switch(k) | TargetKind::Sliding(k) => {
            model.switches.get(k).map(|s| (s.name.clone(), s.shape))
        }
        _ => None,
    });
    let Some((name, shape)) = whole else {
        return path.head.name.clone();
    };
    match target.entries[..] {
        _ if target.entries.len() == shape.len() => name,
        [entry] => shape.entry_name(&name, entry),
        [first, .., last] if shape.rank() == 1 => format!("{name}[{}..{}]", first + 1, last + 1),
        [first, .., last] => {
            // Rows and columns from the first entry to the last one.
            let (_, columns) = shape.size();
            let range = |from: usize, to: usize| match from == to {
                true => format!("{}", from + 1),
                false => format!("{}..{}", from + 1, to + 1),
            };
            let rows = range(first / columns, last / columns);
            format!("{name}[{rows},{}]", range(first % columns, last % columns))
        }
        [] => format!("{name}[..]"),
    }
}
