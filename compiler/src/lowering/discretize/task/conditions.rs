//! Rows that wait for the sides of pairs.
//!
//! Elements between which nothing switches have equal lengths, and where a sliding mode is left inside a step, what
//! jumps has reached its bound: λ alone accepts every boundary within about half a node's distance, because it leaves
//! zero tangentially. Where the switch is read nonlinearly a S takes the place of a, see `branch`.

use nsd_solver::integrate::tableau::{Tableau, lagrange};

use crate::expr::Expr;
use crate::lowering::dcs::Branch;
use crate::lowering::discretize::cross::{Group, Member, Pairs};
use crate::lowering::discretize::formals::block::{Builder, variable};
use crate::lowering::discretize::formals::{Formals, sources};
use crate::lowering::discretize::{branch, directions};
use crate::lowering::mpcc;
use crate::lowering::mpcc::{Block, Conditions, Kind, Mpcc, Source, Span};
use crate::system::task::Shape;

/// What pairs and their values where elements end say of rows.
pub(crate) struct Conditional<'p, 'e> {
    pub pairs: &'p Pairs<'p, 'e>,
    pub tableau: &'p Tableau,
}

impl<'e> Conditional<'_, 'e> {
    /// All rows, and when they hold.
    pub fn state(&self, mpcc: &mut Mpcc<'e>) {
        let Formals { dcs, layout, .. } = *self.pairs.formals;
        if layout.elements < 2 {
            return;
        }
        let gaps = dcs.impacts.iter().map(|impact| impact.gap);
        let mut conditions = Conditions {
            steps: layout.steps,
            elements: layout.elements,
            branches: self.branches(mpcc),
            has_more: self.pairs.groups.iter().any(|group| !group.is_crossed)
                || layout.boundaries.is_some()
                || layout.algebraics.led.is_some()
                || mpcc.blocks.iter().any(|block| block.name == "sliding"),
            impulses: layout.boundaries.as_ref().map(|_| mpcc::Impulses {
                first_pair: mpcc.first_pair("impulse"),
                gaps: gaps.collect(),
            }),
            rests: directions::rests(dcs, mpcc),
            ..Conditions::default()
        };
        for group in self.pairs.crossed() {
            let is_own = |block: &&Block| block.kind == Kind::Pair && block.name == group.block;
            let stated = mpcc.blocks.iter().find(is_own);
            let stated = stated.expect("pairs are stated before what follows from them");
            let places = stated.n_places();
            let [a, b] = [&group.jumps.members, &group.continuous.members];
            conditions.groups.push(mpcc::Group {
                first_pair: mpcc.first_pair(group.block),
                per_element: places / (layout.steps * layout.elements),
                members: a.len(),
                continuous: b.iter().map(|b| b.z).collect(),
                jumps: a.iter().map(|a| (a.z, a.slope)).collect(),
                leave: mpcc.blocks.len(),
            });
            self.leave(group, mpcc);
        }
        let h = mpcc.exprs.variables("h", 2);
        let block = Builder::new("equal", self.inner())
            .variable(h[0], |[k, j]| layout.h(k, j))
            .variable(h[1], |[k, j]| layout.h(k, j + 1));
        let text = "0 = h[k,j+1] - h[k,j], where nothing switches";
        let row = vec![h[1] - h[0]];
        conditions.equal = Some(mpcc.blocks.len());
        mpcc.conditions = conditions;
        block.state(mpcc, Kind::Conditional, row, vec![Source::Grid], text);
    }

    /// Elements but for the last one of a step.
    fn inner(&self) -> [Span; 2] {
        let layout = self.pairs.formals.layout;
        [layout.each_step(), Span::new("j", 1, layout.elements - 1)]
    }

    /// 0 = a or 0 = a S at the end of an element inside a step.
    fn leave(&self, group: &Group<'e>, mpcc: &mut Mpcc<'e>) {
        let (formals, a, exprs) = (self.pairs.formals, &group.jumps, mpcc.exprs);
        // The polynomial through the values at the nodes, unless there is one at the end.
        let (n, last) = (formals.layout.nodes, a.nodes.last);
        let weights = match last > n {
            true => (1..=last).map(|m| f64::from(u8::from(m == last))).collect(),
            false => lagrange(&self.tableau.nodes, &[1.0]),
        };
        let block = Builder::new("leave", self.inner());
        let (block, values) = a.at_each(formals, block, |element| element);
        let value = |i: usize| {
            let terms = weights.iter().zip(&values);
            let terms = terms.filter(|(weight, _)| last > n || **weight != 0.0);
            exprs.sum(terms.map(|(&weight, values)| weight * values[i]))
        };
        let stabilities = branch::stabilities(formals);
        let (block, stabilities) = self.at_ends(block, &stabilities, |element| element);
        let rows = a.members.iter().enumerate();
        let rows = rows.map(|(i, a)| match branch::of(formals, a) {
            Some(branch) => value(i) * stabilities[branch],
            None => value(i),
        });
        let times = if stabilities.is_empty() { "" } else { "*S" };
        let text = format!(
            "0 = {}{times}(z[k,j]) at the end, where it reaches zero there",
            a.name
        );
        block.state(
            mpcc,
            Kind::Conditional,
            rows.collect(),
            group.sources(),
            text,
        );
    }

    /// The rows that wait for sliding modes to end where a step does.
    fn branches(&self, mpcc: &mut Mpcc<'e>) -> mpcc::Branches {
        let crossed = self.pairs.crossed();
        let jumps: Vec<Member> = crossed
            .flat_map(|group| group.jumps.members.clone())
            .collect();
        let of_branch = |branch: usize| {
            let own = jumps.iter().enumerate();
            let own = own.filter(|(_, a)| branch::of(self.pairs.formals, a) == Some(branch));
            own.map(|(at, _)| at).collect()
        };
        let branches = &self.pairs.formals.dcs.switches.branches;
        let members: Vec<Vec<usize>> = (0..branches.len()).map(of_branch).collect();
        let own = branches.iter().zip(&members);
        let own = own.flat_map(|(branch, own)| own.iter().map(move |&at| (branch, at)));
        let own: Vec<_> = own.map(|(branch, at)| (branch, jumps[at].value)).collect();
        mpcc::Branches {
            leave: self.leave_steps(&own, mpcc),
            members: members.concat(),
        }
    }

    /// 0 = a S where a step ends; none where controls jump there, and a mode may end anywhere.
    fn leave_steps(
        &self,
        members: &[(&Branch<'e>, Expr<'e>)],
        mpcc: &mut Mpcc<'e>,
    ) -> Option<usize> {
        let Formals { dcs, layout, .. } = *self.pairs.formals;
        let is_linear = (dcs.task.iter()).any(|task| task.shape == Shape::Linear);
        if dcs.switches.branches.is_empty() || !is_linear || layout.steps < 2 {
            return None;
        }
        let last = layout.elements;
        let block = Builder::new("leave_step", [Span::new("k", 1, layout.steps - 1)]);
        let values = members
            .iter()
            .flat_map(|(branch, a)| [*a, branch.stability]);
        let values: Vec<Expr> = values.collect();
        let (block, values) = self.at_ends(block, &values, |[k]| [k, last]);
        let rows = values.chunks_exact(2).map(|pair| pair[0] * pair[1]);
        let origins = sources(members.iter().map(|(branch, _)| branch.origin));
        let text = format!("0 = a*S(z[k,{last}]) at the end, where it reaches zero there");
        let number = mpcc.blocks.len();
        block.state(mpcc, Kind::Conditional, rows.collect(), origins, text);
        Some(number)
    }

    /// Values where elements end: the polynomials through those at the nodes.
    fn at_ends<const N: usize>(
        &self,
        block: Builder<N>,
        values: &[Expr<'e>],
        element: impl Fn([usize; N]) -> [usize; 2],
    ) -> (Builder<N>, Vec<Expr<'e>>) {
        if values.is_empty() {
            return (block, Vec::new());
        }
        let formals = self.pairs.formals;
        let (exprs, layout) = (formals.dcs.exprs, formals.layout);
        let h = exprs.variable("h");
        let values = formals.timed(values, h);
        let mut block = formals.in_element(block, h, &element);
        let mut terms = vec![Vec::new(); values.len()];
        let weights = lagrange(&self.tableau.nodes, &[1.0]);
        for (m, &weight) in (1..).zip(&weights).filter(|(_, weight)| **weight != 0.0) {
            let mut there = formals.at_point(layout.points[m]);
            for (i, &state) in formals.states.iter().enumerate() {
                let copy = exprs.variable(&state.to_string());
                there.insert(variable(state), copy);
                block = block.variable(copy, |place| {
                    let [k, j] = element(place);
                    layout.x(k, j, m) + i
                });
            }
            for (i, z) in formals.dcs.algebraics.iter().enumerate() {
                let copy = exprs.variable(&z.var.to_string());
                there.insert(variable(z.var), copy);
                block = block.variable(copy, |place| {
                    let [k, j] = element(place);
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
