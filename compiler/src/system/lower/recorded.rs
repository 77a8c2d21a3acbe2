//! What is recorded or watched of a run.

use super::instance::Instance;
use super::surfaces;
use super::translation::Translation;
use crate::expr::{Expr, variables_of};
use crate::model::TargetKind;
use crate::source::Span;
use crate::system::values::limits::{Allowed, Limit};
use crate::system::{Output, Recorded, StateGroup};

impl<'e> Recorded<'e> {
    /// What an experiment records, and α of the switches that expectations name.
    pub(super) fn of(translation: &mut Translation<'_, 'e>) -> (Self, Vec<Expr<'e>>) {
        let groups = groups(translation.instance);
        let (outputs, controls) = outputs(translation);
        let named = surfaces::named(translation);
        let recorded = Recorded {
            groups,
            outputs,
            controls,
            limits: limits(translation),
        };
        (recorded, named)
    }

    /// All its expressions that a run records or watches.
    pub(super) fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        let outputs = self.outputs.iter().chain(&self.controls);
        let outputs = outputs.flat_map(|output| output.exprs.iter().copied());
        outputs.chain(self.limits.iter().map(|limit| limit.value))
    }
}

/// The states that are recorded: those of the model, or those that the experiment lists.
fn groups(instance: &Instance<'_, '_>) -> Vec<StateGroup> {
    let group = |name: &str, shape: Vec<usize>, entries: &[Expr<'_>]| {
        let vars = entries.iter().filter_map(|x| x.as_variable());
        StateGroup {
            name: name.to_owned(),
            shape,
            entries: vars.map(|var| instance.places[&var]).collect(),
        }
    };
    match &instance.settings.recording.outputs {
        None => (instance.model.quantities.states.iter())
            .map(|state| group(&state.name, state.shape.sizes(), &state.vars))
            .collect(),
        Some(listed) => (listed.iter())
            .filter(|kept| matches!(kept.kind, TargetKind::State(_)))
            .map(|kept| group(&kept.name, kept.shape.clone(), &kept.entries))
            .collect(),
    }
}

/// Outputs and controls: those of the model, or those that the experiment lists.
fn outputs<'e>(translation: &mut Translation<'_, 'e>) -> (Vec<Output<'e>>, Vec<Output<'e>>) {
    let instance = translation.instance;
    let mut output = |name: &str, shape: Vec<usize>, entries: &[Expr<'e>], span: Span| Output {
        name: name.to_owned(),
        shape,
        exprs: (entries.iter())
            .map(|&e| translation.in_alphas(e, span))
            .collect(),
        span,
    };
    let model = instance.model;
    let (mut outputs, mut controls) = (Vec::new(), Vec::new());
    match &instance.settings.recording.outputs {
        None => {
            for y in &model.definitions.outputs {
                outputs.push(output(
                    &y.name,
                    y.value.shape.sizes(),
                    &y.value.data,
                    y.span,
                ));
            }
            for z in &model.quantities.algebraics {
                outputs.push(output(&z.name, z.shape.sizes(), &z.vars, z.span));
            }
            for u in &model.quantities.controls {
                controls.push(output(&u.name, u.shape.sizes(), &u.vars, u.span));
            }
        }
        Some(listed) => {
            for kept in listed {
                let list = match kept.kind {
                    TargetKind::State(_) => continue,
                    TargetKind::Control(_) => &mut controls,
                    _ => &mut outputs,
                };
                let shape = kept.shape.clone();
                list.push(output(&kept.name, shape, &kept.entries, kept.span));
            }
        }
    }
    (outputs, controls)
}

/// Bounds of the quantities that are kept.
fn limits<'e>(translation: &mut Translation<'_, 'e>) -> Vec<Limit<'e>> {
    let instance = translation.instance;
    let model = instance.model;
    let quantities = (model.quantities.states.iter().map(|s| ("state", s)))
        .chain(
            model
                .quantities
                .algebraics
                .iter()
                .map(|z| ("algebraic state", z)),
        )
        .chain(model.quantities.controls.iter().map(|c| ("control", c)))
        .chain(model.quantities.inputs.iter().map(|i| ("input", i)))
        .chain(model.quantities.connected.iter().map(|c| ("input", c)));
    let rounded: Vec<Expr<'_>> = model.rounded.iter().map(|one| one.argument).collect();
    let rounded = variables_of(&rounded);
    let is_counted = |entry: Expr<'_>| {
        let var = entry.as_variable();
        var.is_some_and(|var| rounded.binary_search(&var).is_ok())
    };
    let mut limits = Vec::new();
    for (kind, quantity) in quantities {
        for (k, &entry) in quantity.vars.iter().enumerate() {
            let Some(allowed) = Allowed::of(quantity, k, &|e| instance.number(e)) else {
                continue;
            };
            if !instance.needs.holds_all(entry) {
                continue;
            }
            limits.push(Limit {
                kind,
                name: quantity.shape.entry_name(&quantity.name, k),
                value: translation.in_alphas(entry, quantity.span),
                is_counted: is_counted(entry),
                allowed,
                span: quantity.span,
            });
        }
    }
    limits
}
