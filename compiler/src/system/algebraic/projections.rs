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
use crate::system::lower::Lowering;

impl<'e> Lowering<'_, 'e> {
    /// Adds the forces of all constraints to the rates.
    pub(crate) fn projections(&mut self, rates: &mut [Expr<'e>], diags: &mut Diagnostics) {
        let model = self.model;
        for projection in &model.statements.projections {
            for row in &projection.constraints {
                if let Err(error) = self.constrain(projection, row, rates) {
                    diags.push(*error);
                }
            }
        }
    }

    fn constrain(
        &mut self,
        projection: &Projection<'e>,
        row: &Constraint<'e>,
        rates: &mut [Expr<'e>],
    ) -> Result<(), Box<SystemError>> {
        if !self.needs.holds_all(row.c) {
            return Ok(());
        }
        let name = row.c.to_string();
        let wrong = |what: &str, span| {
            let (name, what) = (name.clone(), what.to_owned());
            Box::new(SystemError::NoConstraint { name, what, span })
        };
        let c = self.in_alphas(row.c, row.span);
        let gradient: Vec<Expr<'e>> = (projection.entries.iter())
            .map(|&entry| self.slope(c, entry))
            .collect();
        let push = self.pushes(projection, &gradient);
        let switching = [c]
            .iter()
            .chain(&push)
            .any(|&e| !self.switches.alphas_of(e).is_empty());
        if switching {
            let what = "it, or `metric`, has a switching term";
            return Err(wrong(what, row.span));
        }
        // ∇cᵀ E ∇c
        let terms = gradient.iter().zip(&push).map(|(&g, &p)| g * p);
        let gain = self.model.exprs.sum(terms);
        if self.vanishes(gain) {
            let what = "the projected state does not move it";
            return Err(wrong(what, row.span));
        }
        if !self.at_samples(gain, |gain| gain >= 0.0) {
            let what = "`metric` is not positive semidefinite";
            return Err(wrong(what, projection.span));
        }
        let Ok(switch) = self.switches.unilateral(c, &name, row.span) else {
            let what = match self.switches.find(c) {
                Some(_) => "it is compared elsewhere too, or is a constraint twice",
                None => "its surface is none, as that of a power",
            };
            return Err(wrong(what, row.span));
        };
        let force = 1.0 - self.model.exprs.expr(self.switches.list[switch].alpha);
        let kept: Vec<usize> = self.kept_states().map(|(entry, _)| entry).collect();
        for (&entry, push) in projection.entries.iter().zip(push) {
            if let Ok(place) = kept.binary_search(&entry) {
                rates[place] = rates[place] + push * force;
            }
        }
        Ok(())
    }

    /// E ∇c
    fn pushes(&mut self, projection: &Projection<'e>, gradient: &[Expr<'e>]) -> Vec<Expr<'e>> {
        let Some(metric) = &projection.metric else {
            return gradient.to_vec();
        };
        let rows = metric.chunks_exact(gradient.len());
        let rows = rows.map(|row| {
            let terms: Vec<Expr<'e>> = (row.iter().zip(gradient))
                .map(|(&e, &g)| self.in_alphas(e, projection.span) * g)
                .collect();
            self.model.exprs.sum(terms)
        });
        rows.collect()
    }
}
