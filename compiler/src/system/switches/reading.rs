//! How switches enter the expressions of the user.

use super::affine::{at, is_affine, is_polynomial, multi_affine};
use super::continuity::vanishes_at_samples;
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::model::{Model, SwitchKind};
use crate::source::Span;
use crate::system::SystemError;
use crate::system::regions::sample::Sampler;
use crate::system::switches::Switches;

/// Reports every switch that an expression is not affine in and that has no reading.
///
/// What differs from the multi-affine form only off the surface's values, as `sign(x)*abs(x)`
/// does, needs none.
pub(crate) fn check_reading<'e>(
    switches: &Switches<'e>,
    value: Expr<'e>,
    entry: Span,
    sampler: impl Fn() -> Sampler<'e>,
    model: &Model<'e>,
) -> Vec<SystemError> {
    let mut errors = Vec::new();
    let below = variables_of(&[value]);
    let strict = switches.entries.strict(value);
    for k in switches.entries.occurring(value) {
        let switch = &switches.list[k];
        let reads = |value: Expr<'e>, var: Var| {
            is_hidden_term_zero(value, var, switch.psi, switches, &sampler())
        };
        // What is read as it is written needs no agreement.
        let is_open = !switches.entries.is_nonlinear(k) && !is_affine(strict, switch.alpha);
        if is_open && !reads(strict, switch.alpha) {
            errors.push(nonlinear_switch(switches, k, strict, entry, model));
        }
        if let Some(condition) = switches
            .entries
            .condition(k)
            .filter(|var| below.binary_search(var).is_ok())
            && !is_polynomial(value, condition)
            && !reads(value, condition)
        {
            let span = switch.spans.first().copied().unwrap_or(switch.origin);
            errors.push(SystemError::NonlinearCondition {
                name: switches.name_of(k),
                condition: span,
                entry: beside(span, entry),
            });
        }
    }
    errors
}

/// A label around another one is hard to read.
fn beside(span: Span, entry: Span) -> Option<Span> {
    (!is_inside(span, entry)).then_some(entry)
}

fn is_inside(span: Span, entry: Span) -> bool {
    entry.start <= span.start && span.end <= entry.end
}

/// Asks for a reading of a switch: by its statement, or else by one that could be written.
fn nonlinear_switch<'e>(
    switches: &Switches<'e>,
    k: usize,
    value: Expr<'e>,
    entry: Span,
    model: &Model<'e>,
) -> SystemError {
    let switch = &switches.list[k];
    let named = switch.named.first().and_then(|reading| {
        let mut statements = model.switches.iter();
        Some((reading, statements.find(|s| s.name == reading.name)?))
    });
    let (name, statement, above, span) = match named {
        Some((reading, declared)) => {
            let s = model.exprs.variable(&reading.name);
            let above = match declared.kind {
                SwitchKind::Sign => 0.5 * (s + 1.0),
                SwitchKind::Step | SwitchKind::Relay(_) => s,
            };
            let above = if reading.flipped { 1.0 - above } else { above };
            let name = reading.name.clone();
            (name, declared.statement(), above, declared.span)
        }
        None => {
            let name = format!("sign({})", switches.name_of(k));
            let s = free_name(model);
            let statement = format!("switch {s} = {name}");
            let above = 0.5 * (model.exprs.variable(&s) + 1.0);
            let spans = &switch.spans;
            let span = spans.iter().find(|&&span| is_inside(span, entry));
            let span = span.or(spans.first()).copied().unwrap_or(entry);
            (name, statement, above, span)
        }
    };
    // A `switch` statement gives the reading of its switching function wherever that stands.
    let end = model.span.end.saturating_sub(1);
    let place = Span { start: end, end };
    let declared = named.map(|(_, declared)| declared.span);
    let unnamed = (place, statement.clone());
    let (linear, nonlinear) = readings(switches, value, (switch.alpha, above), &statement);
    SystemError::NonlinearSwitch {
        name,
        linear,
        nonlinear,
        switch: span,
        entry: beside(span, entry),
        named: declared.ok_or(unnamed),
    }
}

/// A name for a switch that means nothing else in the model.
fn free_name(model: &Model<'_>) -> String {
    let is_free = |name: &String| model.scope.names().all(|known| known != name);
    let more = (1..).map(|k| format!("s{k}"));
    let mut names = std::iter::once("s".to_owned()).chain(more);
    names.find(is_free).unwrap_or_default()
}

/// Both readings of a switch, with what an expression is on the surface under each; `above` is α in the user's words.
fn readings<'e>(
    switches: &Switches<'e>,
    value: Expr<'e>,
    (alpha, above): (Var, Expr<'e>),
    statement: &str,
) -> (String, String) {
    const LONGEST: usize = 80;
    let written = |e: Expr<'e>| {
        let text = switches.written(e.substitute(&Substitution::from_iter([(alpha, above)])));
        (text.chars().count() <= LONGEST).then(|| format!("which is `{text}` there"))
    };
    let between = written(multi_affine(value, &[alpha]));
    let between =
        between.unwrap_or_else(|| "with values between those of the two sides".to_owned());
    let hidden = written(value).unwrap_or_else(|| "the expression as it stands".to_owned());
    (
        format!("`{statement} sliding linear;` for Filippov's, {between}"),
        format!("`{statement} sliding nonlinear;` for hidden dynamics, {hidden}"),
    )
}

/// Whether f and its interpolant in `var` agree on the surface, for values of `var` between 0 and 1.
fn is_hidden_term_zero<'e>(
    value: Expr<'e>,
    var: Var,
    psi: Expr<'e>,
    switches: &Switches<'e>,
    sampler: &Sampler<'e>,
) -> bool {
    let hidden = value - multi_affine(value, &[var]);
    [0.3, 0.6].into_iter().all(|inside| {
        let hidden = switches.entries.merged(at(hidden, var, inside));
        hidden.is_zero() || vanishes_at_samples(hidden, psi, &sampler.only(&[hidden, psi]))
    })
}
