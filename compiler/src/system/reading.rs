//! How switches enter the expressions of the user.

use super::SystemError;
use super::affine::{at, is_affine, is_polynomial, multi_affine};
use super::continuity::vanishes_at_samples;
use super::sample::Sampler;
use super::switches::Switches;
use crate::expr::{Expr, Var, variables_of};
use crate::model::{Model, Sliding, SwitchKind};
use crate::source::Span;

/// Reports every switch that an expression is not affine in and that has no reading.
///
/// What differs from the multi-affine form only off the surface's values, as `sign(x)*abs(x)`
/// does, needs none.
pub(super) fn check_reading<'e>(
    switches: &Switches<'e>,
    value: Expr<'e>,
    entry: Span,
    sampler: impl Fn() -> Sampler<'e>,
    model: &Model<'e>,
    sliding: impl Fn(usize) -> Option<Sliding>,
) -> Vec<SystemError> {
    let mut errors = Vec::new();
    let below = variables_of(&[value]);
    let strict = switches.strict(value);
    for k in switches.occurring(value) {
        let switch = &switches.list[k];
        let name = || switches.name_of(k);
        let reads = |value: Expr<'e>, var: Var| {
            is_hidden_term_zero(value, var, switch.psi, switches, &sampler())
        };
        if !is_affine(strict, switch.alpha) && !reads(strict, switch.alpha) {
            let named = switch.named.first().and_then(|reading| {
                let statement = model
                    .switches
                    .iter()
                    .position(|known| known.name == reading.name)?;
                Some((reading, statement))
            });
            let span = switch
                .spans
                .iter()
                .copied()
                .find(|span| entry.start <= span.start && span.end <= entry.end);
            let span = span.or(switch.spans.first().copied()).unwrap_or(entry);
            errors.push(match named {
                Some((_, statement)) if sliding(statement) == Some(Sliding::Nonlinear) => {
                    SystemError::NonlinearSliding {
                        span: model.switches[statement].span,
                    }
                }
                Some((reading, statement)) => {
                    let kind = match model.switches[statement].kind {
                        SwitchKind::Sign => "sign",
                        _ => "step",
                    };
                    let write =
                        |word| format!("switch {} = {kind}(..) sliding {word};", reading.name);
                    SystemError::NonlinearSwitch {
                        name: reading.name.clone(),
                        linear: write("linear"),
                        nonlinear: write("nonlinear"),
                        switch: model.switches[statement].span,
                        entry,
                    }
                }
                None => {
                    let write = |word| format!("switch s = sign({}) sliding {word};", name());
                    SystemError::NonlinearSwitch {
                        name: format!("sign({})", name()),
                        linear: write("linear"),
                        nonlinear: write("nonlinear"),
                        switch: span,
                        entry,
                    }
                }
            });
        }
        if let Some(condition) = switches
            .condition(k)
            .filter(|var| below.binary_search(var).is_ok())
            && !is_polynomial(value, condition)
            && !reads(value, condition)
        {
            let span = switch.spans.first().copied().unwrap_or(switch.origin);
            errors.push(SystemError::NonlinearCondition {
                name: name(),
                condition: span,
                entry,
            });
        }
    }
    errors
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
        let hidden = switches.merged(at(hidden, var, inside));
        hidden.is_zero() || vanishes_at_samples(hidden, psi, &sampler.only(&[hidden, psi]))
    })
}
