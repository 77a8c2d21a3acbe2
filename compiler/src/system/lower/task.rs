//! What an `optimize` asks -> a task in α.

use super::instance::Instance;
use super::translation::Translation;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, variables_of};
use crate::system::experiment::{Freed, Tied};
use crate::system::task::{At, Free, Holds, Task, TaskRow};
use crate::system::values::limits::Allowed;
use crate::system::{Contact, State};

/// The states that stand for integrals, with their rates in α.
pub(crate) fn integrals<'e>(
    translation: &mut Translation<'_, 'e>,
    diags: &mut Diagnostics,
) -> Vec<State<'e>> {
    let instance = translation.instance;
    let task = instance.settings.optimize.iter();
    let states = task.flat_map(|task| &task.integrals).map(|integral| {
        let rate = translation.replace(integral.value, integral.span);
        translation.check(rate, integral.span, diags);
        State {
            name: integral.var.to_string(),
            var: integral.var,
            initial: 0.0,
            rate: translation.switches.entries.merged(rate),
            span: integral.span,
        }
    });
    states.collect()
}

/// The task in α; states and parameters have their places in the system.
pub(crate) fn lower<'e>(
    translation: &mut Translation<'_, 'e>,
    diags: &mut Diagnostics,
) -> Option<Task<'e>> {
    let instance = translation.instance;
    let (model, values) = (instance.model, instance.values());
    let asked = instance.settings.optimize.as_ref()?;
    let cost = (asked.cost).map(|value| translation.in_alphas(value, asked.cost.span));
    let rows = asked.rows.iter().map(|row| TaskRow {
        name: Some(row.name.clone()),
        value: translation.in_alphas(row.value, row.span),
        lower: row.lower,
        upper: row.upper,
        at: row.at,
        holds: (row.holds).map(|value| translation.in_alphas(value, row.span)),
        starts: None,
        span: row.span,
    });
    let mut rows: Vec<TaskRow<'e>> = rows.collect();
    rows.extend(algebraic_bounds(translation));
    let is_number = |var: &Expr<'e>| {
        let var = var.as_variable();
        var.is_none_or(|var| !values.free.derives(var))
    };
    let params: Vec<Expr<'e>> = (model.quantities.params.iter())
        .flat_map(|param| param.vars.iter().copied().filter(is_number))
        .collect();
    let states: Vec<Expr<'e>> = instance.states().collect();
    let (tied, starts) = tied(translation, diags);
    rows.extend(starts);
    let places = |freed: &[Freed], list: &[Expr<'e>]| -> Vec<Free> {
        let free = freed.iter().filter_map(|freed| {
            let place = list
                .iter()
                .position(|var| var.as_variable() == Some(freed.var))?;
            Some(Free {
                place,
                lower: freed.lower,
                upper: freed.upper,
            })
        });
        free.collect()
    };
    Some(Task {
        controls: instance.decided(),
        shape: asked.discretization.controls,
        lengths: asked.discretization.lengths.clone(),
        horizon: asked.horizon,
        length: None,
        params: places(&asked.params, &params),
        initial: [places(&asked.initial, &states), tied].concat(),
        bounds: state_bounds(instance),
        integrals: asked.integrals.len(),
        clock: None,
        cost,
        rows,
    })
}

/// x(0) = x_0(p) with free p: x(0) is free, and the equation is a row at the start.
fn tied<'e>(
    translation: &mut Translation<'_, 'e>,
    diags: &mut Diagnostics,
) -> (Vec<Free>, Vec<TaskRow<'e>>) {
    let instance = translation.instance;
    let tied = instance
        .settings
        .optimize
        .iter()
        .flat_map(|task| &task.tied);
    let (mut freed, mut rows) = (Vec::new(), Vec::new());
    for &Tied { var, value, span } in tied {
        let Some(&place) = instance.places.get(&var) else {
            continue;
        };
        freed.push(Free {
            place,
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
        });
        let x = value.exprs().expr(var);
        let row = translation.in_alphas(x - value, span);
        // Switches have no values at t = 0 in a program.
        let free = instance.values().free.first_in(&[value]);
        if let Some(free) = free.filter(|_| !translation.switches.entries.alphas_of(row).is_empty())
        {
            let name = instance.model.exprs.name(var);
            let what = format!("the initial value of `{name}`, which has a switching term,");
            diags.push(
                instance
                    .values()
                    .depends_on_free(instance.model, what, free, span),
            );
            continue;
        }
        rows.push(TaskRow {
            name: None,
            value: row,
            lower: 0.0,
            upper: 0.0,
            at: At::Start,
            holds: Holds::Strictly,
            starts: Some(place),
            span,
        });
    }
    (freed, rows)
}

fn state_bounds(instance: &Instance<'_, '_>) -> Vec<Free> {
    let entries = instance.model.quantities.states.iter().flat_map(|state| {
        let entries = state.vars.iter().enumerate();
        entries.map(move |(k, &var)| (state, k, var))
    });
    let bounds = entries.filter_map(|(state, k, var)| {
        let place = *instance.places.get(&var.as_variable()?)?;
        match instance.allowed(state, k, |e| instance.moves(e))? {
            Allowed::Between(lower, upper) => Some(Free {
                place,
                lower,
                upper,
            }),
            Allowed::OneOf(_) => None,
        }
    });
    bounds.collect()
}

/// 0 <= e <= 1 and 0 <= μ of contacts, where free parameters are in them.
pub(crate) fn coefficient_rows<'e>(
    instance: &Instance<'_, 'e>,
    contacts: &[Contact<'e>],
) -> Vec<TaskRow<'e>> {
    let free = &instance.values().free;
    let is_free = |var: &Var| free.vars.contains_key(var) && !free.inputs.contains(var);
    let is_param = |var: &Var| instance.params.numbers.contains_key(var);
    let coefficients = contacts.iter().flat_map(|contact| {
        let friction = contact.friction.as_ref();
        let friction = friction.map(|friction| (friction.coefficient, f64::INFINITY));
        let both = [(contact.restitution.coefficient, 1.0)]
            .into_iter()
            .chain(friction);
        both.map(|(value, upper)| (value, upper, contact.span))
    });
    let rows = coefficients.filter_map(|(value, upper, span)| {
        let vars = variables_of(&[value]);
        vars.iter().any(is_free).then(|| TaskRow {
            name: None,
            value,
            lower: 0.0,
            upper,
            at: match vars.iter().all(is_param) {
                true => At::Start,
                false => At::Nodes,
            },
            holds: Holds::Strictly,
            starts: None,
            span,
        })
    });
    rows.collect()
}

/// Bounds of algebraic states, which hold at the ends of elements.
fn algebraic_bounds<'e>(translation: &mut Translation<'_, 'e>) -> Vec<TaskRow<'e>> {
    let instance = translation.instance;
    let mut rows = Vec::new();
    for z in &instance.model.quantities.algebraics {
        for (k, &var) in z.vars.iter().enumerate() {
            if let Some(Allowed::Between(lower, upper)) =
                instance.allowed(z, k, |e| instance.moves(e))
                && (lower.is_finite() || upper.is_finite())
            {
                rows.push(TaskRow {
                    name: Some(z.shape.entry_name(&z.name, k)),
                    value: translation.in_alphas(var, z.span),
                    lower,
                    upper,
                    at: At::Elements,
                    holds: Holds::Strictly,
                    starts: None,
                    span: z.span,
                });
            }
        }
    }
    rows
}
