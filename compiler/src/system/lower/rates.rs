//! Rates of the states: x' = f + Σ_R w_R f_R in α.

use super::translation::Translation;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Substitution};
use crate::model::{Model, Rate, Sliding};
use crate::source::Span;
use crate::system::SystemError;
use crate::system::regions::conjunction::literals;
use crate::system::regions::partitions::Regions;
use crate::system::switches::Switches;

/// x' of the states that are kept, in α.
pub(crate) fn lower<'e>(
    translation: &mut Translation<'_, 'e>,
    regions: &Regions<'e>,
    diags: &mut Diagnostics,
) -> Vec<Expr<'e>> {
    let instance = translation.instance;
    let (model, needs) = (instance.model, &instance.needs);
    let mut rates = vec![model.exprs.constant(0.0); needs.entries.len()];
    let mut add = |rate: &Rate<'e>, value: Expr<'e>| {
        rates[rate.entry] = rates[rate.entry] + value;
    };
    for rate in &model.statements.dynamics {
        if !needs.entries[rate.entry] {
            continue;
        }
        let value = translation.replace(rate.value, rate.span);
        translation.check(value, rate.span, diags);
        add(rate, value);
    }
    for (r, region) in model.statements.regions.iter().enumerate() {
        if !needs.regions[r] {
            continue;
        }
        let weight = regions.weights[r];
        let implied = implied(regions.guards[r], &translation.switches);
        for rate in &region.rates {
            if !needs.entries[rate.entry] {
                continue;
            }
            let value = translation
                .replace(rate.value, rate.span)
                .substitute(&implied);
            translation.check(value, rate.span, diags);
            let value = translation.switches.entries.merged(value);
            check_product(&translation.switches, (weight, value), rate.span, diags);
            add(rate, weight * value);
        }
    }
    for hidden in &model.statements.hidden {
        let reading = instance.sliding(hidden.switch);
        let mut asks = reading.is_none();
        for rate in &hidden.rates {
            if !needs.entries[rate.entry] {
                continue;
            }
            if std::mem::take(&mut asks) {
                diags.push(open_reading(model, hidden.switch, rate));
            }
            // What is read linearly has no terms that both sides do not have.
            if reading == Some(Sliding::Nonlinear) {
                let value = translation.replace(rate.value, rate.span);
                translation.check(value, rate.span, diags);
                add(rate, value);
            }
        }
    }
    let kept = instance.entries.iter();
    kept.map(|&entry| translation.switches.entries.merged(rates[entry]))
        .collect()
}

/// Asks whether a hidden term is meant, where its switch does not say so.
fn open_reading<'e>(model: &Model<'e>, switch: usize, rate: &Rate<'e>) -> SystemError {
    let switch = &model.switches[switch];
    SystemError::HiddenReading {
        name: switch.name.clone(),
        statement: switch.statement(),
        term: format!("{}' += {}", model.entry_name(rate.entry), rate.value),
        term_span: rate.span,
        switch: switch.span,
    }
}

/// A region whose guard leaves a nonlinear switch open has no rates that are written for one side of it.
fn check_product<'e>(
    switches: &Switches<'e>,
    (weight, value): (Expr<'e>, Expr<'e>),
    span: Span,
    diags: &mut Diagnostics,
) {
    let among = |e: Expr<'e>| switches.entries.alphas_of(e);
    let common = among(weight).into_iter().find(|alpha| {
        let k = switches.entries.of_alpha(*alpha);
        k.is_some_and(|k| switches.entries.is_nonlinear(k)) && among(value).contains(alpha)
    });
    if let Some(k) = common.and_then(|alpha| switches.entries.of_alpha(alpha)) {
        diags.push(SystemError::NonlinearGuard {
            name: switches.name_of(k),
            span,
        });
    }
}

/// What a guard says about the switches inside it, as values of their variables.
fn implied<'e>(guard: Expr<'e>, switches: &Switches<'e>) -> Substitution<'e> {
    let literals = literals(guard, switches).unwrap_or_default().into_iter();
    let values = literals.flat_map(|(k, on)| {
        let number = guard.exprs().constant(f64::from(on));
        let vars = switches.entries.variables_of(k);
        vars.map(move |var| (var, number))
    });
    values.collect()
}
