//! The term of a right-hand side that is not finite where a run ends, or has the steepest slope there.
//!
//! A run ends just before a root, a logarithm or a quotient loses its value, so that all rates may still be finite.
//! Then a term has lost it a little later on the tangent, or |∂f_i/∂x_j| is largest in the rate that is to blame, and most
//! of it comes from one term of f_i.

use miette::LabeledSpan;

use nsd_solver::hybrid::Outcome;

use crate::expr::{Expr, Var, children, variables_of};
use crate::source::Span;
use crate::system::switches::roots::{Root, Vanishing};
use crate::system::{System, Valuation};

/// A term with at least this share of the slope of what it stands in is to blame for it.
const SHARE: f64 = 1e-3;
/// The base of a root below this is at its end.
const AT_END: f64 = 1e-6;
/// A rate turns over where it changes by more than this share of itself.
const TURNING: f64 = 0.1;
/// A longer term is not written out.
const LONGEST: usize = 60;
/// Slopes below this are nothing special.
const STEEP: f64 = 1e6;
/// Where on the tangent it is looked, as shares of what is ahead.
const AHEAD: [f64; 6] = [0.0, 0.125, 0.25, 0.5, 1.0, 1.25];

/// The line of the rate with the term, as a label; none where all rates are harmless.
pub(crate) fn label<'e>(system: &System<'e>, outcome: &Outcome, ahead: f64) -> Option<LabeledSpan> {
    not_finite(system, outcome, ahead).or_else(|| steepest(system, outcome))
}

/// The same of a rate or a switching function that is not finite where the run has ended, or in some time from there.
pub(crate) fn not_finite<'e>(
    system: &System<'e>,
    outcome: &Outcome,
    ahead: f64,
) -> Option<LabeledSpan> {
    let found = AHEAD.iter().find_map(|share| {
        let values = on_tangent(system, outcome, share * ahead);
        let value = |e: Expr<'e>| values.value(e);
        let is_known = |e: Expr<'e>| values.unknown(&[e]).is_none();
        let (function, span) =
            functions(system).find(|(e, _)| is_known(*e) && !value(*e).is_finite())?;
        let size = |e: Expr<'e>| {
            if value(e).is_finite() {
                0.0
            } else {
                f64::INFINITY
            }
        };
        let term = innermost(function, &size);
        let is = match value(term) {
            number if number.is_nan() => "no number".to_owned(),
            number => number.to_string(),
        };
        let text = format!("`{term}` is {is}{}", below_zero(system, term, &value));
        Some((text, span))
    });
    let (text, span) = found?;
    Some(LabeledSpan::new_with_span(Some(text), span))
}

/// Rates and switching functions, with their lines.
fn functions<'s, 'e>(system: &'s System<'e>) -> impl Iterator<Item = (Expr<'e>, Span)> + 's {
    let rates = system.states.iter().map(|state| (state.rate, state.span));
    let switches = system.switches.iter();
    let surfaces = switches.filter_map(|switch| Some((switch.psi, *switch.spans.first()?)));
    rates.chain(surfaces)
}

fn steepest<'e>(system: &System<'e>, outcome: &Outcome) -> Option<LabeledSpan> {
    let values = values(system, outcome);
    let value = |e: Expr<'e>| values.value(e);
    let mut steepest: Option<(f64, Expr, Span, Var)> = None;
    for (function, span) in functions(system) {
        for var in variables_of(&[function]) {
            let slope = slope(value(function.diff(var)));
            if slope > STEEP && steepest.is_none_or(|(most, ..)| slope > most) {
                steepest = Some((slope, function, span, var));
            }
        }
    }
    let (size, function, span, var) = steepest?;
    let term = innermost(function, &|e| slope(value(e.diff(var))));
    let name = system.exprs.name(var);
    let text = match size.is_finite() {
        true => format!("the slope of `{term}` along `{name}` is {size:.0e}"),
        false => format!("`{term}` has no slope along `{name}`"),
    };
    let text = text + &below_zero(system, term, &value);
    Some(LabeledSpan::new_with_span(Some(text), span))
}

/// The line of the rate that changes most in some time from where the run has ended, as states go on there, with the
/// innermost term that does it; none where no rate changes by a share of what it is.
pub(crate) fn turning<'e>(
    system: &System<'e>,
    outcome: &Outcome,
    ahead: f64,
) -> Option<LabeledSpan> {
    let [here, there] = [0.0, ahead].map(|tau| on_tangent(system, outcome, tau));
    let change = |e: Expr<'e>| (there.value(e) - here.value(e)).abs();
    let rates = system.states.iter().map(|state| (state.rate, state.span));
    let (rate, span) = rates.max_by(|a, b| change(a.0).total_cmp(&change(b.0)))?;
    let most = change(rate);
    if most.is_nan() || most <= TURNING * here.value(rate).abs() {
        return None;
    }
    let term = innermost(rate, &|e| f64::from(u8::from(change(e) >= 0.5 * most)));
    let [from, to] = [&here, &there].map(|values| values.value(term));
    let name = match term.to_string() {
        long if long.len() > LONGEST => "this rate".to_owned(),
        term => format!("`{term}`"),
    };
    let text = format!("{name} goes from {from:.1e} to {to:.1e} within {ahead:.0e}");
    Some(LabeledSpan::new_with_span(Some(text), span))
}

/// All variables some time after the run has ended, where states go on as they do there.
fn on_tangent(system: &System, outcome: &Outcome, tau: f64) -> Valuation {
    let mut values = values(system, outcome);
    if tau == 0.0 {
        return values;
    }
    let rates = system.states.iter();
    let rates: Vec<f64> = rates.map(|state| values.value(state.rate)).collect();
    let time = (system.time, 1.0);
    let states = system.states.iter().map(|state| state.var).zip(rates);
    for (e, rate) in states.chain([time]).filter(|(_, rate)| rate.is_finite()) {
        values.set(e, values.value(e) + tau * rate);
    }
    // Plain switches go along.
    for switch in system
        .switches
        .iter()
        .filter(|switch| switch.relay.is_none())
    {
        let alpha = values.value(switch.alpha);
        if alpha == 0.0 || alpha == 1.0 {
            let psi = values.value(switch.psi);
            values.set(switch.alpha, if psi > 0.0 { 1.0 } else { 0.0 });
        }
    }
    values
}

/// How a root goes on whose base has come to zero, or below, where no switch looks after it.
fn below_zero<'e>(system: &System<'e>, term: Expr<'e>, value: &dyn Fn(Expr<'e>) -> f64) -> String {
    let switching: Vec<Expr> = system.switches.iter().map(|switch| switch.psi).collect();
    let is_plain = Vanishing::of(system, &switching).root(term).is_none();
    let ended = Root::of(term).filter(|root| is_plain && value(root.base) < AT_END);
    ended.map_or_else(String::new, |root| {
        format!("; `max({}, 0)` in it goes on at zero", root.base)
    })
}

/// What a slope weighs: without bound where it is no number.
fn slope(value: f64) -> f64 {
    if value.is_nan() {
        f64::INFINITY
    } else {
        value.abs()
    }
}

/// The smallest part of an expression that still has most of its size.
fn innermost<'e>(e: Expr<'e>, size: &dyn Fn(Expr<'e>) -> f64) -> Expr<'e> {
    let mut at = e;
    loop {
        let wanted = SHARE * size(at);
        match children(at).into_iter().find(|&part| size(part) >= wanted) {
            Some(part) => at = part,
            None => return at,
        }
    }
}

/// All variables where the run has ended.
pub(crate) fn values(system: &System, outcome: &Outcome) -> Valuation {
    system.valuation(outcome.time, &outcome.x, &outcome.alpha)
}
