//! Complementarity across the nodes of an element.
//!
//! 0 <= a_i(z_m) ⟂ b_i(z_l) >= 0   for all nodes m, all nodes and ends l, and all pairs i
//!
//! a jumps and b is continuous along solutions. If b_i is positive anywhere in an element, ends included, a_i vanishes
//! in all of it, so no switch is inside. All terms are non-negative, so sums over m, over l or over both say the same
//! with fewer rows (Nurkanović et al. 2024).
//! Where both are continuous, as members of algebraic complementarity are, either of them may be a: both are zero at a
//! switch, and a that closes is zero at the end of its element by a row of its own, see `mpcc::Conditions`.
//! Where something is optimized, what bounds the stability of nonlinear sliding modes is one more b, see `branch`.
//! A pair of which neither is continuous is stated at each node alone.

use std::fmt;

use super::branch;
use super::formals::block::{Builder, variable};
use super::formals::{Formals, sources};
use super::layout::Layout;
use crate::expr::{Expr, Substitution};
use crate::lowering::dcs::{Dcs, Origin};
use crate::lowering::mpcc::{Kind, Mpcc, Source, Span};
use crate::system::experiment::Cross;

/// All pairs, and how they are stated.
pub(crate) struct Pairs<'p, 'e> {
    pub formals: &'p Formals<'p, 'e>,
    /// How pairs across nodes are added up; `None` where switches are not detected.
    cross: Option<Cross>,
    pub groups: Vec<Group<'e>>,
}

/// Pairs with the same nodes: 0 <= a_i ⟂ b_i >= 0.
pub(crate) struct Group<'e> {
    pub block: &'static str,
    /// Whether b is taken at all nodes and ends, or at the node of a alone.
    pub is_crossed: bool,
    /// a, which jumps.
    pub jumps: Side<'e>,
    /// b, which is continuous.
    pub continuous: Side<'e>,
    origins: Vec<Origin>,
}

/// The members a or b.
#[derive(Clone)]
pub(crate) struct Side<'e> {
    /// What they are called where they are printed.
    pub name: &'static str,
    /// Where they are taken.
    pub nodes: Span,
    pub members: Vec<Member<'e>>,
}

/// A member of a pair: z or 1 - z.
#[derive(Clone, Copy)]
pub(crate) struct Member<'e> {
    pub value: Expr<'e>,
    /// The place of z among the algebraic variables.
    pub z: usize,
    /// The derivative by z.
    pub slope: f64,
}

impl fmt::Display for Group<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}(z), {}(z)", self.jumps.name, self.continuous.name)
    }
}

impl<'e> Member<'e> {
    fn new(dcs: &Dcs<'e>, value: Expr<'e>) -> Self {
        let mut z = dcs.algebraics.iter().map(|z| z.var);
        let z = z.position(|z| z == value || 1.0 - z == value);
        let z = z.expect("members of pairs are algebraic variables, or 1 minus one");
        let slope = match dcs.algebraics[z].var == value {
            true => 1.0,
            false => -1.0,
        };
        Member { value, z, slope }
    }
}

impl<'p, 'e> Pairs<'p, 'e> {
    /// Those whose a is there at the nodes, those whose a is there at a right end that is no node too, and those that are
    /// not stated across nodes.
    pub fn new(formals: &'p Formals<'p, 'e>, cross: Option<Cross>) -> Self {
        let Formals { dcs, layout, .. } = *formals;
        let mut groups = [
            Group::new(layout, ["a", "b"], "complementarity", layout.nodes),
            Group::new(
                layout,
                ["a_end", "b_end"],
                "complementarity_end",
                layout.end,
            ),
            Group::new(
                layout,
                ["a_node", "b_node"],
                "complementarity_node",
                layout.nodes,
            ),
        ];
        groups[2].is_crossed = false;
        for (pair, &origin) in dcs.rows.pairs.iter().zip(&dcs.rows.origins.pairs) {
            let [left, right] = [pair.left, pair.right].map(|value| Member::new(dcs, value));
            let is_continuous = |member: Member| dcs.algebraics[member.z].continuous;
            let at_end = |jump: Member| usize::from(layout.algebraics.at_end.contains(&jump.z));
            let (jump, continuous, group) = match (is_continuous(left), is_continuous(right)) {
                _ if cross.is_none() => (left, right, 2),
                (_, true) => (left, right, at_end(left)),
                (true, false) => (right, left, at_end(right)),
                (false, false) => (left, right, 2),
            };
            groups[group].jumps.members.push(jump);
            groups[group].continuous.members.push(continuous);
            groups[group].origins.push(origin);
        }
        let is_there = |group: &Group| !group.origins.is_empty();
        Pairs {
            formals,
            cross,
            groups: groups.into_iter().filter(is_there).collect(),
        }
    }

    /// Whether switches are detected.
    pub fn are_detected(&self) -> bool {
        self.cross.is_some()
    }

    /// Those that are stated across nodes.
    pub fn crossed(&self) -> impl Iterator<Item = &Group<'e>> {
        self.groups.iter().filter(|group| group.is_crossed)
    }

    /// All rows.
    pub fn state(&self, mpcc: &mut Mpcc<'e>) {
        for group in &self.groups {
            self.state_group(group, mpcc);
        }
    }

    fn state_group(&self, group: &Group<'e>, mpcc: &mut Mpcc<'e>) {
        let (formals, name) = (self.formals, group.block);
        let [k, j] = [formals.layout.each_step(), formals.layout.each_element()];
        let Group {
            jumps: a,
            continuous: b,
            ..
        } = group;
        let (m, l) = (a.nodes, b.nodes);
        match self.cross.filter(|_| group.is_crossed) {
            None => {
                let (block, jumps) = a.at(formals, Builder::new(name, [k, j, m]), |node| node);
                let (block, continuous) = b.at(formals, block, |node| node);
                let text = [a.at_node("m"), b.at_node("m")];
                group.finish(mpcc, block, [jumps, continuous], text);
            }
            Some(Cross::All) => {
                let block = Builder::new(name, [k, j, m, l]);
                let (block, jumps) = a.at(formals, block, |[k, j, m, _]| [k, j, m]);
                let (block, continuous) = b.at(formals, block, |[k, j, _, l]| [k, j, l]);
                let text = [a.at_node("m"), b.at_node("l")];
                group.finish(mpcc, block, [jumps, continuous], text);
                self.bounded(group, mpcc);
            }
            Some(Cross::SumTheta) => {
                let block = Builder::new(name, [k, j, l]);
                let (block, jumps) = a.sum(formals, block, |[k, j, _]| [k, j]);
                let (block, continuous) = b.at(formals, block, |node| node);
                let text = [a.summed(), b.at_node("l")];
                group.finish(mpcc, block, [jumps, continuous], text);
                self.bounded(group, mpcc);
            }
            Some(Cross::SumLambda) => {
                let block = Builder::new(name, [k, j, m]);
                let (block, continuous) = b.sum(formals, block, |[k, j, _]| [k, j]);
                let (block, jumps) = a.at(formals, block, |node| node);
                let (block, continuous, more) = self.with_bounds(block, a, continuous);
                let text = [a.at_node("m"), b.summed() + more];
                group.finish(mpcc, block, [jumps, continuous], text);
            }
            Some(Cross::SumBoth) => {
                let (block, jumps) = a.sum(formals, Builder::new(name, [k, j]), |place| place);
                let (block, continuous) = b.sum(formals, block, |place| place);
                let (block, continuous, more) = self.with_bounds(block, a, continuous);
                let text = [a.summed(), b.summed() + more];
                group.finish(mpcc, block, [jumps, continuous], text);
            }
        }
    }

    /// Σ b with the bounds of S, which are complementary to the same a.
    fn with_bounds<const N: usize>(
        &self,
        block: Builder<N>,
        a: &Side<'e>,
        b: Vec<Expr<'e>>,
    ) -> (Builder<N>, Vec<Expr<'e>>, &'static str) {
        let (block, bounds) = branch::bounds_of(self.formals, block, &a.members);
        let more = match bounds.iter().any(Option::is_some) {
            true => " + r[k,j]",
            false => "",
        };
        let b = b.into_iter().zip(bounds);
        let b = b.map(|(b, r)| r.map_or(b, |r| b + r));
        (block, b.collect(), more)
    }

    /// Σ a against the bounds of S alone, where b is not added up.
    fn bounded(&self, group: &Group<'e>, mpcc: &mut Mpcc<'e>) {
        let layout = self.formals.layout;
        let block = Builder::new("sliding", [layout.each_step(), layout.each_element()]);
        let (block, bounds) = branch::bounds_of(self.formals, block, &group.jumps.members);
        let all = group.jumps.members.iter().zip(&group.origins).zip(bounds);
        let bounded: Vec<_> = all
            .filter_map(|((&a, &origin), r)| Some((a, origin, r?)))
            .collect();
        if bounded.is_empty() {
            return;
        }
        let a = Side {
            members: bounded.iter().map(|bounded| bounded.0).collect(),
            ..group.jumps
        };
        let origins = sources(bounded.iter().map(|bounded| bounded.1));
        let r = bounded.iter().map(|bounded| bounded.2);
        let (block, mut outputs) = a.sum(self.formals, block, |place| place);
        outputs.extend(r);
        let text = format!("0 <= {} perp r[k,j] >= 0", a.summed());
        block.state(mpcc, Kind::Pair, outputs, origins, text);
    }
}

impl<'e> Group<'e> {
    fn new(layout: &Layout, names: [&'static str; 2], block: &'static str, last: usize) -> Self {
        let side = |name, nodes| Side {
            name,
            nodes,
            members: Vec::new(),
        };
        Group {
            block,
            is_crossed: true,
            jumps: side(names[0], Span::new("m", 1, last)),
            continuous: side(names[1], Span::new("l", 0, layout.end)),
            origins: Vec::new(),
        }
    }

    /// Where the pairs come from.
    pub fn sources(&self) -> Vec<Source> {
        sources(self.origins.iter().copied())
    }

    /// As they are printed, one per line.
    pub fn lines(&self) -> Vec<String> {
        let pairs = self.jumps.members.iter().zip(&self.continuous.members);
        pairs
            .map(|(a, b)| format!("{} perp {}", a.value, b.value))
            .collect()
    }

    /// The rows 0 <= a ⟂ b >= 0.
    fn finish<const N: usize>(
        &self,
        mpcc: &mut Mpcc<'e>,
        block: Builder<N>,
        sides: [Vec<Expr<'e>>; 2],
        text: [String; 2],
    ) {
        let text = format!("0 <= {} perp {} >= 0", text[0], text[1]);
        block.state(mpcc, Kind::Pair, sides.concat(), self.sources(), text);
    }
}

impl<'e> Side<'e> {
    /// Their values at a node.
    fn at<const N: usize>(
        &self,
        formals: &Formals<'_, 'e>,
        block: Builder<N>,
        node: impl Fn([usize; N]) -> [usize; 3],
    ) -> (Builder<N>, Vec<Expr<'e>>) {
        let z = |member: &Member| formals.dcs.algebraics[member.z].var;
        let block = self.members.iter().fold(block, |block, member| {
            bind(formals, block, z(member), member.z, &node)
        });
        (
            block,
            self.members.iter().map(|member| member.value).collect(),
        )
    }

    /// Their values at each node of an element, in variables of their own.
    pub fn at_each<const N: usize>(
        &self,
        formals: &Formals<'_, 'e>,
        mut block: Builder<N>,
        element: impl Fn([usize; N]) -> [usize; 2],
    ) -> (Builder<N>, Vec<Vec<Expr<'e>>>) {
        let mut all = Vec::with_capacity(self.nodes.len());
        for m in self.nodes.first..=self.nodes.last {
            let mut values = Vec::with_capacity(self.members.len());
            for member in &self.members {
                let z = formals.dcs.algebraics[member.z].var;
                let copy = formals.dcs.exprs.variable(&z.to_string());
                values.push(
                    member
                        .value
                        .substitute(&Substitution::one(variable(z), copy)),
                );
                block = bind(formals, block, copy, member.z, |place| {
                    let [k, j] = element(place);
                    [k, j, m]
                });
            }
            all.push(values);
        }
        (block, all)
    }

    /// Their sums over the nodes of an element.
    pub fn sum<const N: usize>(
        &self,
        formals: &Formals<'_, 'e>,
        block: Builder<N>,
        element: impl Fn([usize; N]) -> [usize; 2],
    ) -> (Builder<N>, Vec<Expr<'e>>) {
        let (block, values) = self.at_each(formals, block, element);
        let sum = |i| formals.dcs.exprs.sum(values.iter().map(|values| values[i]));
        (block, (0..self.members.len()).map(sum).collect())
    }

    /// `a(z[k,j,m])`
    fn at_node(&self, index: &str) -> String {
        format!("{}(z[k,j,{index}])", self.name)
    }

    /// `sum(a(z[k,j,m]), m in 1..4)`
    fn summed(&self) -> String {
        self.summed_in("j")
    }

    /// The same in an element of another name.
    pub fn summed_in(&self, element: &str) -> String {
        let (
            name,
            Span {
                name: index,
                first,
                last,
            },
        ) = (self.name, self.nodes);
        format!("sum({name}(z[k,{element},{index}]), {index} in {first}..{last})")
    }
}

/// Binds a formal argument to z_i at a node.
fn bind<const N: usize>(
    formals: &Formals,
    block: Builder<N>,
    formal: Expr,
    i: usize,
    node: impl Fn([usize; N]) -> [usize; 3],
) -> Builder<N> {
    block.variable(formal, |place| {
        let [k, j, m] = node(place);
        let index = formals.layout.z(k, j, m, i);
        index.expect("members are taken where they are declared")
    })
}
