//! Kinks inside of a gap, and whether it is smooth there.
//!
//! In α a gap c(q, t, α) is once differentiable across ψₖ = 0 where neither c nor its rate ∂c/∂q q' + ∂c/∂t jumps with
//! αₖ, whatever the velocities are: then the surface c = 0 has a tangent everywhere, and its curvature alone jumps.
//! So it is of the distance |max(q - p, 0)| - r from a corner p. Points with c < 0 are inside of a body, and say nothing.

use crate::expr::{Expr, Function, Node, Var, rewrite};
use crate::system::lower::translation::Translation;
use crate::system::regions::sample::Point;
use crate::system::switches::affine::{at, jump};

/// Points that are tried for each switch.
const N_POINTS: usize = 64;

/// How close to a surface a jump is compared with what changes, relative to sizes of states.
const NEAR: f64 = 1e-6;

/// A gap with (2αₖ - 1) ψₖ in place of √(ψₖ²), which has no derivative at zero: the length of a vector with one entry.
pub(crate) fn in_signs<'e>(gap: Expr<'e>, translation: &Translation<'_, 'e>) -> Expr<'e> {
    let switches = &translation.switches;
    let alphas = switches.entries.alphas_of(gap);
    let switches_of_gap = || {
        alphas
            .iter()
            .filter_map(|&alpha| switches.entries.of_alpha(alpha))
    };
    let mut magnitude = |e: Expr<'e>| {
        let Node::Unary(Function::Sqrt, base) = e.node() else {
            return e;
        };
        let (scale, form) = base.split_scale();
        let length = switches_of_gap().find_map(|k| {
            let switch = &switches.list[k];
            let (square, own) = switch.psi.powi(2).split_scale();
            let sign = 2.0 * gap.exprs().expr(switch.alpha) - 1.0;
            (own == form).then(|| (scale / square).sqrt() * sign * switch.psi)
        });
        length.unwrap_or(e)
    };
    switches.entries.merged(rewrite(gap, &mut magnitude))
}

/// Whether a gap that holds switches has a surface, and is negative behind it.
pub(crate) fn has_inside<'e>(gap: Expr<'e>, translation: &Translation<'_, 'e>) -> bool {
    if translation.switches.entries.alphas_of(gap).is_empty() {
        return true;
    }
    let sampler = translation.sampler().only(&[gap]);
    let starts: Vec<Point> = sampler.points(N_POINTS).collect();
    let mut on_surface = starts
        .iter()
        .filter_map(|start| sampler.to_surface(gap, start));
    on_surface.any(|point| {
        let near = sampler.near(gap, &point, NEAR);
        near.iter().any(|near| sampler.eval(gap, near) < 0.0)
    })
}

/// An α across the surface of which a gap, or its rate, is not continuous.
pub(crate) struct Corner {
    pub alpha: Var,
    /// Whether it was looked at in a point with a positive gap.
    pub is_seen: bool,
}

/// The first corner of a gap; none where it and its rate are continuous across the surfaces of all α.
pub(crate) fn corner<'e>(
    (gap, speed): (Expr<'e>, Expr<'e>),
    translation: &Translation<'_, 'e>,
) -> Option<Corner> {
    let switches = &translation.switches;
    let alphas = switches.entries.alphas_of(gap).into_iter();
    let mut alphas = alphas.chain(switches.entries.alphas_of(speed));
    alphas.find_map(|alpha| {
        let switch = switches.entries.of_alpha(alpha);
        let switch = switch.map(|k| &switches.list[k]);
        let switch = switch.filter(|switch| switch.relay.is_none());
        let is_smooth = switch.map_or(Some(false), |switch| {
            is_smooth([gap, speed], (alpha, switch.psi), translation)
        });
        let is_seen = is_smooth.is_some();
        (is_smooth != Some(true)).then_some(Corner { alpha, is_seen })
    })
}

/// Whether functions, the first of which is a gap, are continuous on ψ = 0 where the gap is positive; `None` without
/// such points.
fn is_smooth<'e>(
    functions: [Expr<'e>; 2],
    (alpha, psi): (Var, Expr<'e>),
    translation: &Translation<'_, 'e>,
) -> Option<bool> {
    let [gap, speed] = functions;
    let sampler = translation.sampler().only(&[gap, speed, psi]);
    let others = translation.switches.entries.alphas_of(gap + speed);
    let others: Vec<Var> = others.into_iter().filter(|&other| other != alpha).collect();
    let mut found = None;
    for start in sampler.points(N_POINTS) {
        let Some(point) = sampler.to_surface(psi, &start) else {
            continue;
        };
        // Of other sides no term is left that has no value here.
        let here = |f: Expr<'e>| {
            others
                .iter()
                .fold(f, |f, &other| at(f, other, point.get(other)))
        };
        let [gap, speed] = functions.map(here);
        if sampler.eval(gap, &point) <= 0.0 {
            continue;
        }
        let near = sampler.near(psi, &point, NEAR);
        let is_rounding = [gap, speed].map(|f| {
            let jump = jump(f, alpha);
            let value = sampler.eval(jump, &point);
            let others = near
                .iter()
                .map(|near| (sampler.eval(jump, near) - value).abs());
            value.abs() <= others.fold(sampler.rounding(jump, &point), f64::max)
        });
        if is_rounding.contains(&false) {
            return Some(false);
        }
        found = Some(true);
    }
    found
}
