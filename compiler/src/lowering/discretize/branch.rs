//! Sliding modes that attract.
//!
//! Where a switch that is read nonlinearly slides, every α at which its rate φ vanishes satisfies the rows of the dynamics.
//! No trajectory follows those that repel, at which S = ∂φ/∂α > 0. With two r for each element and such switch,
//!
//! S(t_kjm, x_kjm, z_kjm) <= r⁻_kj + r⁺_kj,   0 <= r⁻_kj ⟂ α_kjm >= 0,   0 <= r⁺_kj ⟂ 1 - α_kjm >= 0
//!
//! leave S <= 0 at all nodes of an element in which the switch slides, and S free where α is 0 or 1 throughout. Being
//! complementary to the same members as λⁿ and λᵖ, r stands with them in the sums of `cross`. Where several switches
//! slide this bounds each S taken alone, a diagonal entry of ∂φ/∂α: whether their common mode attracts is left to the
//! check by simulation.
//!
//! A mode may end with α inside of (0, 1), at a sliding fold, where S = 0. So where a nonlinear switch leaves its surface
//! not a = 0 is asked for, as of others, but a S = 0; where controls are continuous, at ends of steps, too.

use super::cross::Member;
use super::formals::block::Builder;
use super::formals::{Formals, sources};
use crate::expr::Expr;
use crate::lowering::mpcc::{Kind, Mpcc};

/// S may be above its bound by so much: where S = 0 is asked for, too, that leaves room.
const ROOM: f64 = 1e-8;

/// Bounds of S.
pub(crate) fn state<'e>(formals: &Formals<'_, 'e>, mpcc: &mut Mpcc<'e>) {
    let Formals { dcs, layout, .. } = *formals;
    if layout.r(1, 1).is_none() {
        return;
    }
    let h = mpcc.exprs.variable("h");
    let stabilities = formals.timed(&stabilities(formals), h);
    let r = mpcc.exprs.variables("r", 2 * stabilities.len());
    let rows = r.chunks_exact(2).zip(stabilities);
    let rows: Vec<Expr> = rows.map(|(r, s)| r[0] + r[1] - s).collect();
    let ranges = [
        layout.each_step(),
        layout.each_element(),
        layout.each_node(),
    ];
    let block = Builder::new("branch", ranges)
        .vector(&r, |[k, j, _]| {
            layout.r(k, j).expect("every element has its own")
        })
        .bounds(vec![(-ROOM, f64::INFINITY); rows.len()]);
    let block = formals.at(block, h, |node| node);
    let text = format!("S{} <= sum(r[k,j])", formals.at_node());
    let origins = sources(dcs.switches.branches.iter().map(|branch| branch.origin));
    block.state(mpcc, Kind::Inequality, rows, origins, text);
}

/// Binds the r that go with members a, in the same order; none for those of other switches.
pub(crate) fn bounds_of<'e, const N: usize>(
    formals: &Formals<'_, 'e>,
    mut block: Builder<N>,
    members: &[Member<'e>],
) -> (Builder<N>, Vec<Option<Expr<'e>>>) {
    let Formals { dcs, layout, .. } = *formals;
    let mut found = Vec::with_capacity(members.len());
    for member in members {
        let branch = of(formals, member).filter(|_| layout.r(1, 1).is_some());
        let r = branch.map(|branch| (branch, dcs.exprs.variable("r")));
        found.push(r.map(|(_, r)| r));
        let Some((branch, r)) = r else {
            continue;
        };
        let side = usize::from(member.slope < 0.0);
        block = block.variable(r, |place| {
            let first = layout.r(place[0], place[1]);
            first.expect("every element has its own") + 2 * branch + side
        });
    }
    (block, found)
}

/// S of all branches.
pub(crate) fn stabilities<'e>(formals: &Formals<'_, 'e>) -> Vec<Expr<'e>> {
    let branches = formals.dcs.switches.branches.iter();
    branches.map(|branch| branch.stability).collect()
}

/// The branch whose α a member contains.
pub(crate) fn of(formals: &Formals, member: &Member) -> Option<usize> {
    let alpha = formals.dcs.algebraics[member.z].var;
    let mut branches = formals.dcs.switches.branches.iter();
    branches.position(|branch| branch.alpha == alpha)
}
