//! Jumps across a surface that other switches turn on and off.
//!
//! f|α=1 - f|α=0 may hold the α of other switches, as on the boundary of two cells that ends where a third one begins.
//! Points sampled on ψ = 0 may all miss the part where the others let it jump, so their sides are gone through instead:
//! those that occur together on both sides of the surface, and so on a part of the surface itself.

use super::arrangement::{Arrangement, Side, Sides};
use super::coverage::{Frame, closure};
use super::sample::Sampler;
use crate::expr::{Expr, Var};
use crate::system::switches::affine::{at, jump};
use crate::system::switches::continuity::is_zero_on;
use crate::system::switches::interaction::positions;

/// With more switches in a jump, or more combinations of sides, the dynamics are taken to jump.
const MOST_SWITCHES: usize = 8;

/// Whether one of the functions jumps across the surface of switch `k` for some sides of the other switches in its
/// jump.
pub(crate) fn jumps_somewhere<'e>(
    f: &[Expr<'e>],
    k: usize,
    frame: &Frame<'e>,
    sampler: &Sampler<'e>,
) -> bool {
    let (alpha, psi) = frame.switches[k];
    let alphas: Vec<Var> = frame.switches.iter().map(|&(alpha, _)| alpha).collect();
    f.iter().any(|&f| {
        let jump = jump(f, alpha);
        let others = positions(jump, &alphas);
        if others.is_empty() {
            return false;
        }
        let inner = |k: usize| positions(frame.switches[k].1, &alphas);
        let mut members = closure([others.as_slice(), &inner(k)].concat(), inner);
        members.retain(|&j| j != k);
        if members.len() > MOST_SWITCHES {
            return true;
        }
        let surfaces: Vec<(Var, Expr<'e>)> = (members.iter().chain([&k]))
            .map(|&j| frame.switches[j])
            .collect();
        let arrangement = Arrangement::new(&surfaces, &frame.params, frame.origin.iter().copied());
        on_the_surface(&arrangement).iter().any(|sides| {
            let corner = surfaces.iter().zip(&sides.signs);
            let on_corner = corner.fold(jump, |e, (&(alpha, _), side)| match side {
                Some(above) => at(e, alpha, f64::from(*above)),
                None => e,
            });
            !is_zero_on(on_corner, psi, sampler)
        })
    })
}

/// The sides of all surfaces but the last one that have points on both sides of that.
fn on_the_surface(arrangement: &Arrangement<'_>) -> Vec<Sides> {
    let last = arrangement.n_surfaces() - 1;
    let part = |sides: &Sides, k: usize, above: bool| match arrangement.side(sides, k, above) {
        Side::Cell(part) => (!part.is_thin()).then_some(part),
        Side::Empty => None,
        Side::Unknown(part) => Some(part),
    };
    let mut found = vec![arrangement.all()];
    for k in 0..last {
        let sides = found.iter().flat_map(|sides| {
            let parts = [false, true].map(|above| part(sides, k, above));
            parts.into_iter().flatten()
        });
        found = sides.collect();
    }
    found.retain(|sides| {
        [false, true]
            .iter()
            .all(|&above| part(sides, last, above).is_some())
    });
    found
}
