//! Jumps of states as LaTeX: impulses of contacts, and other laws.
//!
//! A formula with a superscript - or + has the values of the states before or behind the jump.

use crate::expr::{Expr, Substitution};
use crate::lowering::dcs::{Dcs, Friction, SlipLaw, Tangent};
use crate::model::{Periodic, When};
use crate::system::System;

use super::names::name_parts;
use super::{Binding, Writer};

/// The lines of all impulses.
pub(crate) fn impulses<'e>(dcs: &Dcs<'e>, writer: &mut Writer<'e>) -> Vec<String> {
    let mut lines = Vec::new();
    for (state, by) in dcs.jumps() {
        let [before, after] = ["-", "+"].map(|sign| state_at(dcs.states[state].var, sign));
        lines.push(format!("{after} - {before} &= {}", writer.formula(by)));
    }
    for impact in &dcs.impacts {
        let [impulse, gap] =
            [impact.impulse, dcs.algebraics[impact.gap].var].map(|e| writer.formula(e));
        lines.push(format!("0 &\\le {impulse} \\perp {gap} \\ge 0"));
        let mut law = at(writer, impact.speed, "+");
        if !impact.restitution.is_zero() {
            let factor = writer.within(impact.restitution, Binding::Power);
            law = format!("{law} + {factor} \\, {}", at(writer, impact.speed, "-"));
        }
        lines.push(format!(
            "0 &\\le {impulse} \\perp {law} \\ge 0 \\quad \\text{{where }} {gap} = 0"
        ));
        if let Some(friction) = &impact.friction {
            lines.extend(slips(dcs, friction, writer));
        }
    }
    lines
}

/// The lines of how α⁺ follows from the slip velocity behind an impulse.
fn slips<'e>(dcs: &Dcs<'e>, friction: &Friction<'e>, writer: &mut Writer<'e>) -> Vec<String> {
    match friction.law {
        SlipLaw::Interval(multipliers) => {
            let side = friction.tangents[0].side;
            let [above, below] = multipliers.map(|place| dcs.algebraics[place].var);
            let [above, below] = [above, below].map(|e| at(writer, e, "+"));
            let [side, other] = [side, 1.0 - side].map(|e| writer.formula(e));
            vec![
                format!("0 &\\le {below} \\perp {side} \\ge 0"),
                format!("0 &\\le {above} \\perp {other} \\ge 0"),
            ]
        }
        SlipLaw::Disc { disc, stick } => {
            let slip = at(writer, dcs.algebraics[disc.slip].var, "+");
            let row = |tangent: &Tangent<'e>| {
                let velocity = at(writer, tangent.velocity, "+");
                let inside = writer.within(2.0 * tangent.side - 1.0, Binding::Power);
                format!("0 &= {velocity} - {slip} \\, {inside}")
            };
            let mut lines: Vec<String> = friction.tangents.iter().map(row).collect();
            let edge = writer.formula(friction.edge() - stick);
            let stick = writer.formula(stick);
            lines.push(format!("0 &= {edge}"));
            lines.push(format!("0 &\\le {slip} \\perp {stick} \\ge 0"));
            lines
        }
    }
}

/// The lines of the laws of a system, with α as the complementarity system has them.
pub(crate) fn laws<'e>(system: &System<'e>, dcs: &Dcs<'e>, writer: &mut Writer<'e>) -> Vec<String> {
    let alphas = &dcs.switches.alphas;
    let compared = system.jumps.comparisons.iter();
    let compared = compared.map(|comparison| (comparison.var, alphas[comparison.switch]));
    let alphas: Substitution = (system.switches.iter().zip(alphas))
        .filter_map(|(switch, &alpha)| Some((switch.alpha.as_variable()?, alpha)))
        .chain(compared)
        .collect();
    let mut lines = Vec::new();
    for law in &system.jumps.laws {
        let when = match law.strikes {
            Some(switch) => format!(
                "\\text{{where }} {} = 0 \\text{{ is struck}}",
                writer.formula(system.switches[switch].psi)
            ),
            None => match law.when {
                When::Guard(guard) => format!(
                    "\\text{{when }} {} = 1",
                    writer.formula(guard.substitute(&alphas))
                ),
                When::Every(Periodic { period, offset }) => {
                    let first = writer.formula(offset);
                    let period = writer.within(period, Binding::Power);
                    format!("t = {first} + k\\,{period}, \\quad k = 0, 1, \\dots")
                }
            },
        };
        if law.stops {
            lines.push(format!("&\\text{{ends }} {when}"));
        }
        for &(state, value) in &law.resets {
            let after = state_at(system.states[state].var, "+");
            let value = at(writer, value.substitute(&alphas), "-");
            lines.push(format!("{after} &= {value} \\quad {when}"));
        }
    }
    lines
}

/// `v_{1}^{+}`
fn state_at(state: Expr, sign: &str) -> String {
    let name = state.as_variable().map(|var| state.exprs().name(var));
    let (symbol, subscript) = name_parts(&name.unwrap_or_default());
    format!("{symbol}{subscript}^{{{sign}}}")
}

/// A formula before or behind a jump; a number is the same.
fn at<'e>(writer: &mut Writer<'e>, e: Expr<'e>, sign: &str) -> String {
    match e.as_constant() {
        Some(_) => writer.formula(e),
        None => format!("{}^{{{sign}}}", writer.within(e, Binding::Atom)),
    }
}
