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

use super::Problem;
use super::block::Builder;
use crate::expr::Expr;
use crate::lowering::dcs::{Disc, Impact, SlipLaw};
use crate::lowering::mpcc;
use crate::lowering::mpcc::{Kind, Mpcc, Source, Span};

/// K, chosen by trial.
const RELEASE: f64 = 100.0;

/// A contact with friction in two directions.
struct Slipping<'p, 'e> {
    impact: &'p Impact<'e>,
    disc: Disc,
    /// Where its α⁺ and β⁺ are among the variables of a boundary.
    place: usize,
}

impl<'e> Problem<'_, 'e> {
    /// The contacts that slip in a plane.
    fn slipping(&self) -> Vec<Slipping<'_, 'e>> {
        let impacts = &self.dcs.impacts;
        let mut place = impacts.len();
        let mut found = Vec::new();
        for impact in impacts {
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
    pub(crate) fn directions(&self, mpcc: &mut Mpcc<'e>) {
        let (slipping, layout) = (self.slipping(), &self.layout);
        if slipping.is_empty() {
            return;
        }
        let exprs = mpcc.exprs;
        let ranges = [self.steps(), self.elements(), Span::new("m", 1, layout.end)];
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
        let origins: Vec<Source> = (slipping.iter())
            .map(|contact| self.origin(contact.impact))
            .collect();
        let text = format!(
            "0 <= dot(u[k,j,m-1], u[k,j,m]) + {RELEASE}*(stick[k,j,m-1] + stick[k,j,m] + gap[k,j,m-1] + gap[k,j,m])"
        );
        let block = block.bounds(vec![(0.0, f64::INFINITY); rows.len()]);
        mpcc.blocks
            .push(block.finish(Kind::Inequality, rows, origins, text));
    }

    /// Which pairs of the program say that a slip velocity is at rest.
    pub(crate) fn rests(&self, mpcc: &Mpcc<'e>) -> Option<mpcc::Rests> {
        let slipping = self.slipping();
        (!slipping.is_empty()).then(|| mpcc::Rests {
            first_pair: mpcc.first_pair("impulse_disc"),
            slips: slipping.iter().map(|contact| contact.disc.slip).collect(),
        })
    }

    /// Whether this continuous member is γ of a disc.
    pub(crate) fn is_slip(&self, continuous: Expr<'e>) -> bool {
        let i = self.algebraic(continuous);
        self.dcs.discs.iter().any(|disc| disc.slip == i)
    }
}
