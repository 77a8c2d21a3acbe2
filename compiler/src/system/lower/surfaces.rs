//! Switching functions that the source names: comparisons, and `switch` statements.

use rustc_hash::{FxHashMap, FxHashSet};

use super::instance::Instance;
use super::translation::Translation;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::model::{Sliding, Surface, SwitchKind};
use crate::source::Span;
use crate::system::switches::entries::Entry;
use crate::system::switches::surface::Form;
use crate::system::switches::{Switches, relay};
use crate::system::{NamedReading, SystemError};

/// ψ in the user's words, and where it stands.
pub(crate) type Texts<'e> = FxHashMap<Expr<'e>, (String, Span)>;

/// Makes the switches of the source, each after those in its ψ: relays first, named switches between the surfaces
/// without them and those with them.
pub(crate) fn declare<'e>(
    translation: &mut Translation<'_, 'e>,
    diags: &mut Diagnostics,
) -> Texts<'e> {
    let instance = translation.instance;
    let mut texts = FxHashMap::default();
    let relays = relay::declare(translation);
    let (direct, through) = split(instance, &translation.given);
    declare_all(&direct, translation, &mut texts, diags);
    relay::finish(translation, &relays, diags);
    read_named(translation);
    declare_all(&through, translation, &mut texts, diags);
    texts
}

/// The surfaces of the source: those that can be written at once, and those whose switching function holds a named
/// switch, which comes first.
fn split<'m, 'e>(
    instance: &Instance<'m, 'e>,
    given: &Substitution<'e>,
) -> (Vec<&'m Surface<'e>>, Vec<&'m Surface<'e>>) {
    let named: FxHashSet<Var> = (instance.model.switches.iter())
        .filter(|switch| !matches!(switch.kind, SwitchKind::Relay(_)))
        .flat_map(|switch| &switch.vars)
        .filter_map(|var| var.as_variable())
        .collect();
    let is_direct = |surface: &&Surface<'e>| {
        let psi = surface.psi.substitute(given);
        variables_of(&[psi]).iter().all(|var| !named.contains(var))
    };
    let surfaces = instance.model.surfaces.iter();
    let kept = surfaces.filter(|s| !s.is_alias && instance.needs.holds_all(s.psi));
    kept.partition(is_direct)
}

/// Makes switches in the order, orientation and words of the source.
fn declare_all<'e>(
    surfaces: &[&Surface<'e>],
    translation: &mut Translation<'_, 'e>,
    texts: &mut Texts<'e>,
    diags: &mut Diagnostics,
) {
    for surface in surfaces {
        let (name, span) = (&surface.name, surface.span);
        let psi = translation.in_alphas(surface.psi, span);
        if psi.cancels() {
            let name = name.clone();
            diags.push(SystemError::ZeroSwitch { name, span });
            continue;
        }
        texts.entry(psi).or_insert_with(|| (name.clone(), span));
        translation.switches.declare(psi, name, span);
    }
}

/// Gives every named switch its value.
fn read_named(translation: &mut Translation<'_, '_>) {
    let instance = translation.instance;
    for (s, switch) in instance.model.switches.iter().enumerate() {
        let entry = match instance.sliding(s) {
            Some(Sliding::Linear) => Entry::Linear,
            Some(Sliding::Nonlinear) => Entry::Nonlinear,
            None => Entry::Term,
        };
        if matches!(switch.kind, SwitchKind::Relay(_)) {
            continue;
        }
        for (k, (&psi, var)) in switch.psi.iter().zip(&switch.vars).enumerate() {
            if !instance.needs.holds(var.as_variable()) {
                continue;
            }
            let psi = translation.replace(psi, switch.span);
            let above = translation.switches.enter(psi, psi, entry);
            let is_sign = matches!(switch.kind, SwitchKind::Sign);
            if let Some(var) = var.as_variable() {
                let value = if is_sign { 2.0 * above - 1.0 } else { above };
                translation.named.insert(var, value);
            }
            let name = switch.shape.entry_name(&switch.name, k);
            let reading = |flipped| NamedReading {
                name: switch.name.clone(),
                index: (switch.psi.len() > 1).then_some(k),
                flipped,
                is_sign,
            };
            (translation.switches).name(psi, &name, switch.span, reading);
        }
    }
}

/// α of the switches that expectations name.
pub(crate) fn named<'e>(translation: &mut Translation<'_, 'e>) -> Vec<Expr<'e>> {
    let instance = translation.instance;
    let alpha = |&surface: &Expr<'e>| {
        let psi = translation.replace(surface, Span::default());
        let var = surface.as_variable();
        if var.is_some_and(|var| translation.named.get(var).is_some()) {
            return Some(translation.switches.entries.merged(psi));
        }
        let (k, _) = translation.switches.find(psi)?;
        let alpha = translation.switches.list[k].alpha;
        Some(instance.model.exprs.expr(alpha))
    };
    instance.needs.surfaces.iter().filter_map(alpha).collect()
}

/// Texts of switching functions as the model compares the two sides of them, `x - bound`, by the names of switches that have
/// no statement of their own, where these are not shorter. A text of two switches is that of the first.
pub(crate) fn aliases<'e>(translation: &mut Translation<'_, 'e>) -> FxHashMap<String, String> {
    let instance = translation.instance;
    let surfaces = instance.model.surfaces.iter();
    let kept = surfaces.filter(|s| s.is_alias && instance.needs.holds_all(s.psi));
    let mut found: FxHashMap<String, String> = FxHashMap::default();
    let mut seen: FxHashSet<&str> = FxHashSet::default();
    for surface in kept {
        let psi = translation.replace(surface.psi, surface.span);
        if let Some((k, false)) = translation.switches.find(psi) {
            let switch = &translation.switches.list[k];
            let is_declared = !switch.named.is_empty() || switch.relay.is_some();
            let name = translation.switches.name_of(k);
            let is_short = surface.name.chars().count() <= name.chars().count();
            if !is_declared && is_short && !found.contains_key(&name) && seen.insert(&surface.name)
            {
                found.insert(name, surface.name.clone());
            }
        }
    }
    found
}

/// Says what is wrong with switching functions that are none.
pub(crate) fn report_refused<'e>(
    switches: &Switches<'e>,
    texts: &Texts<'e>,
    diags: &mut Diagnostics,
) {
    for refused in &switches.refused {
        let text = texts.get(&refused.psi).cloned();
        let (name, span) = text.unwrap_or_else(|| (refused.psi.to_string(), refused.span));
        let none = |name, why: &str, help| SystemError::NoSurface {
            name,
            span,
            why: why.to_owned(),
            help,
        };
        diags.push(match refused.form {
            Form::Constant(value) | Form::Parameter(value) => {
                SystemError::ConstantSwitch { name, span, value }
            }
            Form::Definite(sign) if sign > 0.0 => none(name, "is never negative", None),
            Form::Definite(_) => none(name, "is never positive", None),
            Form::OddPower(base) => {
                let help = Some(format!("write `{base}`, which has the same sign"));
                none(name, "crosses zero with slope zero", help)
            }
            Form::Free => SystemError::FreeSwitch { name, span },
            Form::ZeroAtCorner => SystemError::ZeroAtCorner { name, span },
            Form::Regular => continue,
        });
    }
}
