//! Relays with memory, and comparisons that they decide.
//!
//! A relay is a switch of its own: no other has its surface, whatever it watches. What is compared with
//! nothing but relays and switches of time is decided by their sides:
//!
//! step(ψ(α)) -> Σ_corners step(ψ(corner)) Π_i (α_i or 1 - α_i)

use super::surface::Form;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::model::{NamedSwitch, SwitchKind, Thresholds};
use crate::source::Span;
use crate::system::lower::instance::Instance;
use crate::system::lower::translation::Translation;
use crate::system::switches::entries::Entry;
use crate::system::switches::{Refused, Switches};
use crate::system::{NamedReading, Relay, System, SystemError};

/// More relays and switches of time than this in one comparison are not enumerated.
const MOST_ENUMERATED: usize = 8;

impl<'e> Switches<'e> {
    /// Makes a relay that watches nothing yet; returns its number and the variable that is read.
    fn relay(&mut self, name: &str, span: Span, reading: NamedReading) -> (usize, Expr<'e>) {
        let relay = self.add(self.exprs().constant(0.0), span);
        relay.relay = Some(Relay::default());
        relay.name = Some(name.to_owned());
        relay.spans.push(span);
        relay.named.push(reading);
        let k = self.list.len() - 1;
        (k, self.entries.variable(k, Entry::Linear))
    }

    /// Whether the side of a switch is decided before those of the others.
    pub fn is_leading(&self, k: usize) -> bool {
        self.list[k].is_timed || self.list[k].relay.is_some()
    }

    /// The α of a ψ that depends on nothing but relays and switches of time.
    pub fn deciding(&self, psi: Expr<'e>) -> Option<Vec<Var>> {
        let mut alphas = variables_of(&[psi]);
        alphas.retain(|&var| self.params.fixed(var).is_none());
        let leads = |var: &Var| {
            self.entries
                .of_alpha(*var)
                .is_some_and(|k| self.is_leading(k))
        };
        let all = !alphas.is_empty() && alphas.iter().all(leads);
        (all && alphas.len() <= MOST_ENUMERATED).then_some(alphas)
    }

    /// The value of step(ψ) where ψ depends on nothing but switches that are decided before the others.
    pub fn decided_before(&mut self, psi: Expr<'e>, entry: Entry) -> Option<Expr<'e>> {
        let alphas = self.deciding(psi)?;
        let exprs = self.exprs();
        let mut above = exprs.constant(0.0);
        for corner in 0..1_usize << alphas.len() {
            let on = |i: usize| corner >> i & 1 == 1;
            let value = psi.eval(&|var| match alphas.iter().position(|&alpha| alpha == var) {
                Some(i) => f64::from(on(i)),
                None => self.params.fixed(var).unwrap_or(f64::NAN),
            });
            if value == 0.0 && entry != Entry::Kink {
                let (form, span) = (Form::ZeroAtCorner, self.entries.here);
                self.refused.push(Refused { psi, form, span });
                return Some(exprs.constant(1.0));
            }
            if value > 0.0 {
                let weight = alphas.iter().enumerate().map(|(i, &alpha)| {
                    let alpha = exprs.expr(alpha);
                    if on(i) { alpha } else { 1.0 - alpha }
                });
                above = above + exprs.product(weight);
            }
        }
        Some(self.entries.merged(above))
    }
}

/// A relay that reads nothing yet: the entry of a `switch` statement, and its number among the collected switches.
pub(crate) struct Declared {
    statement: usize,
    entry: usize,
    switch: usize,
}

/// Makes all relays that are needed, so that whatever reads them can be written.
pub(crate) fn declare(translation: &mut Translation<'_, '_>) -> Vec<Declared> {
    let instance = translation.instance;
    let mut relays = Vec::new();
    for (statement, switch) in instance.model.switches.iter().enumerate() {
        if !matches!(switch.kind, SwitchKind::Relay(_)) {
            continue;
        }
        for (entry, var) in switch.vars.iter().enumerate() {
            if !instance.needs.holds(var.as_variable()) {
                continue;
            }
            let name = switch.shape.entry_name(&switch.name, entry);
            let reading = NamedReading {
                name: switch.name.clone(),
                index: (switch.psi.len() > 1).then_some(entry),
                flipped: false,
                is_sign: false,
            };
            let (k, value) = translation.switches.relay(&name, switch.span, reading);
            if let Some(var) = var.as_variable() {
                translation.named.insert(var, value);
            }
            relays.push(Declared {
                statement,
                entry,
                switch: k,
            });
        }
    }
    relays
}

/// Says what the relays watch and how they start, which are numbers; each may read those before it.
pub(crate) fn finish(
    translation: &mut Translation<'_, '_>,
    relays: &[Declared],
    diags: &mut Diagnostics,
) {
    let instance = translation.instance;
    for relay in relays {
        let switch = &instance.model.switches[relay.statement];
        let SwitchKind::Relay(thresholds) = &switch.kind else {
            continue;
        };
        let start = thresholds.start.as_deref().unwrap_or_default();
        let numbers = [&thresholds.on[..], &thresholds.off, start].concat();
        let values = instance.values();
        if let Some(free) = values.free.first_in(&numbers) {
            let what = format!("the relay `{}`", switch.name);
            diags.push(values.depends_on_free(instance.model, what, free, switch.span));
            continue;
        }
        let y = translation.in_alphas(switch.psi[relay.entry], switch.span);
        let sampler = translation.sampler();
        let at_start = sampler.eval(y, &sampler.start());
        match remembered(instance, (switch, thresholds), relay.entry, at_start) {
            Ok(remembered) => {
                let collected = &mut translation.switches.list[relay.switch];
                let alpha = instance.model.exprs.expr(collected.alpha);
                let Relay { on, off, .. } = remembered;
                collected.psi = if on < off {
                    on + (off - on) * alpha - y
                } else {
                    y - on - (off - on) * alpha
                };
                collected.relay = Some(remembered);
            }
            Err(error) => diags.push(error),
        }
    }
}

/// The relay of an entry, for y at the start.
fn remembered<'e>(
    instance: &Instance<'_, 'e>,
    (switch, thresholds): (&NamedSwitch<'e>, &Thresholds<'e>),
    entry: usize,
    y: f64,
) -> Result<Relay, SystemError> {
    let span = switch.span;
    let name = switch.shape.entry_name(&switch.name, entry);
    let number = |entries: &[Expr<'e>]| instance.number(entries[entry]);
    let (on, off) = (number(&thresholds.on), number(&thresholds.off));
    if !(on.is_finite() && off.is_finite()) || on == off {
        return Err(SystemError::Thresholds {
            name,
            on,
            off,
            span,
        });
    }
    let given = thresholds.start.as_deref().map(number);
    if let Some(start) = given.filter(|start| *start != 0.0 && *start != 1.0) {
        return Err(SystemError::RelayStart { name, start, span });
    }
    let given = given.map(|start| start == 1.0);
    let relay = Relay {
        on,
        off,
        given,
        ..Relay::default()
    };
    match relay.start_at(y) {
        Some(start) => Ok(Relay { start, ..relay }),
        None => Err(SystemError::NoStart { name, y, span }),
    }
}

impl System<'_> {
    /// Whether each relay starts on the side that was compiled, from the initial values that the system has now; not where y
    /// depends on other switches.
    pub(crate) fn starts_relays_as_compiled(&self) -> bool {
        let mut relays = { self.switches.iter() }
            .filter_map(|switch| Some((switch, switch.relay.as_ref()?)))
            .peekable();
        if relays.peek().is_none() {
            return true;
        }
        let start = self.start();
        relays.all(|(switch, relay)| {
            // ψ = on - y or y - on at α = 0.
            let psi = start.value_at_zero(switch.psi, switch.alpha.as_variable());
            let y = relay.on - psi * (relay.off - relay.on).signum();
            !y.is_nan() && relay.start_at(y) == Some(relay.start)
        })
    }
}

/// A function at all values of the relays in it, with another one at the same values.
pub(crate) fn at_all_sides<'e>(
    functions: &[Expr<'e>],
    psi: Expr<'e>,
    relays: &[Var],
) -> Option<Vec<(Vec<Expr<'e>>, Expr<'e>)>> {
    let below = variables_of(&[functions, &[psi]].concat());
    let inside: Vec<Var> = relays
        .iter()
        .copied()
        .filter(|var| below.binary_search(var).is_ok())
        .collect();
    if inside.len() > MOST_ENUMERATED {
        return None;
    }
    let corners = (0..1_usize << inside.len()).map(|corner| {
        let side =
            |(i, &var): (usize, &Var)| (var, psi.exprs().constant(f64::from(corner >> i & 1 == 1)));
        let sides: Substitution<'e> = inside.iter().enumerate().map(side).collect();
        let at = |e: &Expr<'e>| e.substitute(&sides);
        (functions.iter().map(at).collect(), at(&psi))
    });
    Some(corners.collect())
}
