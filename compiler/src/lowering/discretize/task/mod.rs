//! Optimal control: controls, free parameters, free initial values and a free horizon.
//!
//! Steps are control intervals of length T/N. In step k, controls are u_k, or the straight line from u_(k-1) to u_k.
//! In numerical time intervals have free lengths, and a clock that is k T/N at their ends: s_k = Σ_j h_kj N/T is the
//! speed of time of Nurkanović, Sartor, Albrecht & Diehl 2021, who scale rates by it instead.

mod choices;
mod conditions;
mod points;
pub(crate) mod quadrature;
mod soft;
mod starts;

pub(crate) use choices::chosen;

use nsd_solver::integrate::tableau::Tableau;

use super::DiscretizeError;
use super::cross::Pairs;
use crate::lowering::mpcc::Mpcc;
use conditions::Conditional;
use points::Points;
use quadrature::{Integral, Quadrature};

/// Everything that simulations do not have.
pub(crate) fn state<'e>(
    pairs: &Pairs<'_, 'e>,
    tableau: &Tableau,
    integrals: &[Integral<'e>],
    mpcc: &mut Mpcc<'e>,
) -> Result<(), DiscretizeError> {
    let formals = pairs.formals;
    let Some(task) = &formals.dcs.task else {
        return Ok(());
    };
    if pairs.are_detected() {
        starts::state(formals, mpcc);
    }
    choices::state(formals.layout, task, mpcc);
    let quadrature = Quadrature {
        formals,
        weights: &tableau.weights,
        integrals,
    };
    quadrature.state(mpcc);
    let points = Points {
        formals,
        task,
        weights: &tableau.weights,
    };
    points.cost(mpcc)?;
    points.terms(&quadrature, mpcc)?;
    points.constraints(mpcc)?;
    if pairs.are_detected() {
        Conditional { pairs, tableau }.state(mpcc);
    }
    Ok(())
}
