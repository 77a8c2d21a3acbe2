//! Projections: forces that keep a state in a set.
//!
//! x' = f + E ∇c λ,   0 ≤ c(t, x) ⟂ λ ≥ 0,
//!
//! becomes with λ = 1 - α and a unilateral switch per constraint, α = 1 where c > 0 and any number up to 1 on c = 0,
//!
//! x' = f + (1 - α) E ∇c.
//!
//! On c = 0 the rate decides: it slides with (∇cᵀE∇c) λ = -(∇cᵀf + ∂c/∂t) where that is positive, and leaves where it
//! is not. For E > 0 this is the projection of f onto the tangent cone of {c ≥ 0} in the norm of E⁻¹ (Brogliato,
//! Daniilidis, Lemaréchal & Acary 2006); for a time-dependent c, onto that of the moving set.

use crate::diagnostics::Diagnostics;
use crate::expr::Expr;
use crate::model::{Constraint, Projection};
use crate::system::SystemError;
use crate::system::lower::translation::Translation;

/// Adds the forces of all constraints to the rates.
pub(crate) fn push<'e>(
    translation: &mut Translation<'_, 'e>,
    rates: &mut [Expr<'e>],
    diags: &mut Diagnostics,
) {
    let instance = translation.instance;
    for projection in &instance.model.statements.projections {
        for row in &projection.constraints {
            if let Err(error) = constrain(translation, (projection, row), rates) {
                diags.push(*error);
            }
        }
    }
}

fn constrain<'e>(
    translation: &mut Translation<'_, 'e>,
    (projection, row): (&Projection<'e>, &Constraint<'e>),
    rates: &mut [Expr<'e>],
) -> Result<(), Box<SystemError>> {
    let instance = translation.instance;
    if !instance.needs.holds_all(row.c) {
        return Ok(());
    }
    let name = row.c.to_string();
    let wrong = |what: &str, span| {
        let (name, what) = (name.clone(), what.to_owned());
        Box::new(SystemError::NoConstraint { name, what, span })
    };
    let exprs = instance.model.exprs;
    let c = translation.in_alphas(row.c, row.span);
    let entries = projection.entries.iter();
    let vars = entries.filter_map(|&entry| instance.vars[entry].as_variable());
    let gradient: Vec<Expr<'e>> = vars.map(|var| c.diff(var)).collect();
    let push = pushes(translation, projection, &gradient);
    let is_smooth = |&e: &Expr<'e>| translation.switches.entries.alphas_of(e).is_empty();
    if !is_smooth(&c) || !push.iter().all(is_smooth) {
        let what = "it, or `metric`, has a switching term";
        return Err(wrong(what, row.span));
    }
    // ∇cᵀ E ∇c
    let terms = gradient.iter().zip(&push).map(|(&g, &p)| g * p);
    let terms: Vec<Expr> = terms.collect();
    if instance.params.cancel(&terms) {
        let what = "the projected state does not move it";
        return Err(wrong(what, row.span));
    }
    if !instance
        .params
        .at_samples(exprs.sum(terms), |gain| gain >= 0.0)
    {
        let what = "`metric` is not positive semidefinite";
        return Err(wrong(what, projection.span));
    }
    let switches = &mut translation.switches;
    let Ok(switch) = switches.unilateral(c, &name, row.span) else {
        let what = match switches.find(c) {
            Some(_) => "it is compared elsewhere too, or is a constraint twice",
            None => "its surface is none, as that of a power",
        };
        return Err(wrong(what, row.span));
    };
    let force = 1.0 - exprs.expr(switches.list[switch].alpha);
    for (&entry, push) in projection.entries.iter().zip(push) {
        if let Some(place) = instance.place(entry) {
            rates[place] = rates[place] + push * force;
        }
    }
    Ok(())
}

/// E ∇c
fn pushes<'e>(
    translation: &mut Translation<'_, 'e>,
    projection: &Projection<'e>,
    gradient: &[Expr<'e>],
) -> Vec<Expr<'e>> {
    let Some(metric) = &projection.metric else {
        return gradient.to_vec();
    };
    let rows = metric.chunks_exact(gradient.len());
    let rows = rows.map(|row| {
        let terms: Vec<Expr<'e>> = (row.iter().zip(gradient))
            .map(|(&e, &g)| translation.in_alphas(e, projection.span) * g)
            .collect();
        row[0].exprs().sum(terms)
    });
    rows.collect()
}
