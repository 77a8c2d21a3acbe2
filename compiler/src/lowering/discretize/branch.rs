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

use nsd_solver::integrate::tableau::lagrange;

use super::Problem;
use super::block::{Builder, variable};
use super::dynamics::sources;
use crate::expr::{Expr, Substitution};
use crate::lowering::dcs::{Branch, Dcs, Origin};
use crate::lowering::mpcc;
use crate::lowering::mpcc::{Bounds, Kind, Mpcc, Span, n_places};
use crate::system::task::Shape;

/// S may be above its bound by so much: where S = 0 is asked for, too, that leaves room.
const ROOM: f64 = 1e-8;

/// Elements are no shorter than this share of their mean length.
pub(crate) const SHORTEST: f64 = 1e-3;

/// Declares r: the index of the first one, and how many switches have them.
pub(crate) fn declare(mpcc: &mut Mpcc, dcs: &Dcs, elements: [Span; 2]) -> (usize, usize) {
    if dcs.task.is_none() {
        return (0, 0);
    }
    let names = |branch: &Branch| {
        let alpha = branch.alpha.to_string();
        [format!("S({alpha}=0)"), format!("S({alpha}=1)")]
    };
    let names: Vec<String> = dcs.branches.iter().flat_map(names).collect();
    let bounds = vec![Bounds::between(0.0, f64::INFINITY, 0.0); names.len() * n_places(&elements)];
    let first = mpcc.declare("r", names, &elements, bounds);
    (first, dcs.branches.len())
}

impl<'e> Problem<'_, 'e> {
    /// Bounds of S.
    pub(crate) fn branches(&self, mpcc: &mut Mpcc<'e>) {
        let (dcs, layout) = (self.dcs, &self.layout);
        if layout.r(1, 1).is_none() {
            return;
        }
        let h = mpcc.exprs.variable("h");
        let stabilities = dcs.branches.iter().map(|branch| branch.stability);
        let stabilities = self.timed(&stabilities.collect::<Vec<_>>(), h);
        let r = mpcc.exprs.variables("r", 2 * stabilities.len());
        let rows = r.chunks_exact(2).zip(stabilities);
        let rows: Vec<Expr> = rows.map(|(r, s)| r[0] + r[1] - s).collect();
        let block = Builder::new("branch", [self.steps(), self.elements(), self.nodes()])
            .vector(&r, |[k, j, _]| {
                layout.r(k, j).expect("every element has its own")
            })
            .bounds(vec![(-ROOM, f64::INFINITY); rows.len()]);
        let block = self.at_nodes(block, h);
        let at = self.arguments("t[k,j] + c[m]*h[k,j]", "x[k,j,m]", "z[k,j,m]");
        let text = format!("S{at} <= sum(r[k,j])");
        let origins: Vec<Origin> = dcs.branches.iter().map(|branch| branch.origin).collect();
        mpcc.blocks
            .push(block.finish(Kind::Inequality, rows, sources(&origins), text));
    }

    /// Binds the r that go with members, in the same order; none for those of other switches.
    pub(crate) fn bounds_of<const N: usize>(
        &self,
        block: Builder<N>,
        members: &[Expr<'e>],
    ) -> (Builder<N>, Vec<Option<Expr<'e>>>) {
        let layout = &self.layout;
        let mut found = Vec::with_capacity(members.len());
        let block = members.iter().fold(block, |block, &member| {
            let branch = self.branch_of(member).filter(|_| layout.r(1, 1).is_some());
            let r = branch.map(|_| self.dcs.exprs.variable("r"));
            found.push(r);
            let (Some(branch), Some(r)) = (branch, r) else {
                return block;
            };
            let side = usize::from(member.as_variable().is_none());
            block.variable(r, |place| {
                let first = layout.r(place[0], place[1]);
                first.expect("every element has its own") + 2 * branch + side
            })
        });
        (block, found)
    }

    /// The rows that wait for sliding modes to end where a step does.
    pub(crate) fn branch_conditions(&self, mpcc: &mut Mpcc<'e>) -> mpcc::Branches {
        let groups = self.groups();
        let crossed = groups.iter().filter(|group| group.is_crossed);
        let jumps: Vec<Expr> = crossed.flat_map(|group| group.jumps()).collect();
        let of_branch = |branch: usize| {
            let is_own = |&at: &usize| self.branch_of(jumps[at]) == Some(branch);
            (0..jumps.len()).filter(is_own).collect()
        };
        let members: Vec<Vec<usize>> = (0..self.dcs.branches.len()).map(of_branch).collect();
        mpcc::Branches {
            leave: self.leaves_between_steps(&members, &jumps, mpcc),
            members: members.concat(),
        }
    }

    /// Rows by which sliding modes end where a step does; none where controls jump there, and a mode may end anywhere.
    fn leaves_between_steps(
        &self,
        members: &[Vec<usize>],
        jumps: &[Expr<'e>],
        mpcc: &mut Mpcc<'e>,
    ) -> Option<usize> {
        let layout = &self.layout;
        let is_linear = (self.dcs.task.iter()).any(|task| task.shape == Shape::Linear);
        if members.is_empty() || !is_linear || layout.steps < 2 {
            return None;
        }
        let block = Builder::new("leave_step", [Span::new("k", 1, layout.steps - 1)]);
        let last = |[k]: [usize; 1]| (k, layout.elements);
        let branches = self.dcs.branches.iter().zip(members);
        let own = branches.flat_map(|(branch, own)| own.iter().map(move |&at| (branch, jumps[at])));
        let own: Vec<(&Branch, Expr)> = own.collect();
        let values = own.iter().flat_map(|(branch, a)| [*a, branch.stability]);
        let values: Vec<Expr> = values.collect();
        let (block, values) = self.at_end_of_elements(block, &values, last);
        let rows = values.chunks_exact(2).map(|pair| pair[0] * pair[1]);
        let origins: Vec<Origin> = own.iter().map(|(branch, _)| branch.origin).collect();
        let text = format!(
            "0 = a*S(z[k,{}]) at the end, where it reaches zero there",
            layout.elements
        );
        let number = mpcc.blocks.len();
        let rows = rows.collect();
        mpcc.blocks
            .push(block.finish(Kind::Conditional, rows, sources(&origins), text));
        Some(number)
    }

    /// The branch whose α a member contains.
    pub(crate) fn branch_of(&self, member: Expr<'e>) -> Option<usize> {
        let mut branches = self.dcs.branches.iter();
        branches.position(|branch| branch.alpha == member || branch.alpha == 1.0 - member)
    }

    /// S of all branches where elements end.
    pub(crate) fn stabilities_at_end<const N: usize>(
        &self,
        block: Builder<N>,
        element: impl Fn([usize; N]) -> (usize, usize),
    ) -> (Builder<N>, Vec<Expr<'e>>) {
        let stabilities = self.dcs.branches.iter().map(|branch| branch.stability);
        self.at_end_of_elements(block, &stabilities.collect::<Vec<_>>(), element)
    }

    /// Values where elements end: the polynomials through those at the nodes.
    fn at_end_of_elements<const N: usize>(
        &self,
        mut block: Builder<N>,
        values: &[Expr<'e>],
        element: impl Fn([usize; N]) -> (usize, usize),
    ) -> (Builder<N>, Vec<Expr<'e>>) {
        let (dcs, layout) = (self.dcs, &self.layout);
        if values.is_empty() {
            return (block, Vec::new());
        }
        let exprs = dcs.exprs;
        let h = exprs.variable("h");
        let values = self.timed(values, h);
        block = block.variable(h, |place| {
            let (k, j) = element(place);
            layout.h(k, j)
        });
        block = self.decided(block, |place| element(place).0);
        if layout.t(1, 1).is_some() {
            block = block.variable(dcs.time, |place| {
                let (k, j) = element(place);
                layout.t(k, j).unwrap_or(0)
            });
        }
        let nodes = &self.tableau.nodes;
        let mut terms = vec![Vec::new(); values.len()];
        let weights = lagrange(nodes, &[1.0]);
        for (m, &weight) in (1..).zip(&weights).filter(|(_, weight)| **weight != 0.0) {
            let instant = exprs.constant(nodes[m - 1]);
            let mut there = Substitution::one(variable(self.node), instant);
            for (i, state) in self.states().into_iter().enumerate() {
                let copy = exprs.variable(&state.to_string());
                there.insert(variable(state), copy);
                block = block.variable(copy, |place| {
                    let (k, j) = element(place);
                    layout.x(k, j, m) + i
                });
            }
            for (i, z) in dcs.algebraics.iter().enumerate() {
                let copy = exprs.variable(&z.var.to_string());
                there.insert(variable(z.var), copy);
                block = block.variable(copy, |place| {
                    let (k, j) = element(place);
                    let index = layout.z(k, j, m, i);
                    index.expect("all algebraic variables are there at the nodes")
                });
            }
            for (terms, value) in terms.iter_mut().zip(there.apply(&values)) {
                terms.push(weight * value);
            }
        }
        let values = terms.into_iter().map(|terms| exprs.sum(terms));
        (block, values.collect())
    }
}
