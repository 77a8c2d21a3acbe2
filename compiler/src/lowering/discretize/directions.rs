//! Slip velocities with two entries do not turn round within an element.
//!
//! While a contact slips, u = w/|w| follows w smoothly. Where w passes through rest u turns round at once, and γ = |w|
//! is zero at that instant alone: pairs of γ and β = 1 - |u|² do not change, as those of one slip velocity do. So
//! neighbouring nodes, and the left end of an element with its first node, have
//!
//! u_(m-1)·u_m + K (β_(m-1) + β_m + gap_(m-1) + gap_m) >= 0
//!
//! In an element in which the contact slips all β are zero, and so are all gaps where it pushes: directions at
//! neighbouring nodes are at most a right angle apart. Elsewhere, with a large K, the rows say nothing: where the contact
//! sticks one β is positive, and where it is open no force depends on u.
//!
//! A slip velocity that turns round has γ⁺ = 0 where two elements meet, and slips in both. Their lengths are free then,
//! see [`crate::lowering::mpcc::Conditions`], and the pair of γ⁺ and β⁺ = 1 - |u⁺|² says which it is.

use super::formals::Formals;
use super::formals::block::Builder;
use super::impulses::origin;
use crate::expr::Expr;
use crate::lowering::dcs::{Dcs, Disc, Impact, SlipLaw};
use crate::lowering::mpcc;
use crate::lowering::mpcc::{Kind, Mpcc, Span};

/// K, chosen by trial.
const RELEASE: f64 = 100.0;

/// A contact with friction in two directions.
struct Slipping<'p, 'e> {
    impact: &'p Impact<'e>,
    disc: Disc,
    /// Where its α⁺ and β⁺ are among the variables of a boundary.
    place: usize,
}

/// The contacts that slip in a plane.
fn slipping<'p, 'e>(dcs: &'p Dcs<'e>) -> Vec<Slipping<'p, 'e>> {
    let mut place = dcs.impacts.len();
    let mut found = Vec::new();
    for impact in &dcs.impacts {
        let Some(friction) = &impact.friction else {
            continue;
        };
        if let SlipLaw::Disc { disc, .. } = friction.law {
            found.push(Slipping {
                impact,
                disc,
                place,
            });
        }
        place += friction.variables().count();
    }
    found
}

/// The rows.
pub(crate) fn state<'e>(formals: &Formals<'_, 'e>, mpcc: &mut Mpcc<'e>) {
    let Formals { dcs, layout, .. } = *formals;
    let slipping = slipping(dcs);
    if slipping.is_empty() {
        return;
    }
    let exprs = mpcc.exprs;
    let nodes = Span::new("m", 1, layout.end);
    let ranges = [layout.each_step(), layout.each_element(), nodes];
    let mut block = Builder::new("direction", ranges);
    let mut rows = Vec::new();
    for contact in &slipping {
        // u, β and the gap at node m - 1, and at node m.
        let mut sides = Vec::new();
        for back in [1, 0] {
            let inside = contact.disc.inside();
            let variables = ["first", "second", "stick"].map(|name| exprs.variable(name));
            for (at, (&var, i)) in variables.iter().zip(inside).enumerate() {
                block = block.variable(var, |[k, j, m]| match m - back {
                    0 => layout.impulses(k, j).unwrap_or(0) + contact.place + at,
                    m => (layout.z(k, j, m, i)).expect("discs are there at nodes and ends"),
                });
            }
            let gap = exprs.variable("gap");
            block = block.variable(gap, |[k, j, m]| {
                let gap = layout.z(k, j, m - back, contact.impact.gap);
                gap.expect("what is continuous is there at ends")
            });
            let [first, second, stick] = variables;
            let u = [first, second].map(|alpha| 2.0 * alpha - 1.0);
            sides.push((u, stick + gap));
        }
        let [(before, released), (here, also)] = [sides[0], sides[1]];
        let turn: Expr<'e> = before[0] * here[0] + before[1] * here[1];
        rows.push(turn + RELEASE * (released + also));
    }
    let origins = slipping.iter().map(|contact| origin(dcs, contact.impact));
    let text = format!(
        "0 <= dot(u[k,j,m-1], u[k,j,m]) + {RELEASE}*(stick[k,j,m-1] + stick[k,j,m] + gap[k,j,m-1] + gap[k,j,m])"
    );
    let block = block.bounds(vec![(0.0, f64::INFINITY); rows.len()]);
    block.state(mpcc, Kind::Inequality, rows, origins.collect(), text);
}

/// Which pairs of the program say that a slip velocity is at rest.
pub(crate) fn rests(dcs: &Dcs, mpcc: &Mpcc) -> Option<mpcc::Rests> {
    let slipping = slipping(dcs);
    (!slipping.is_empty()).then(|| mpcc::Rests {
        first_pair: mpcc.first_pair("impulse_disc"),
        slips: slipping.iter().map(|contact| contact.disc.slip).collect(),
    })
}
