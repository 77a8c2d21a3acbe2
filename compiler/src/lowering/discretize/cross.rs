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

use super::Problem;
use super::block::{Builder, variable};
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::lowering::dcs::Origin;
use crate::lowering::mpcc::{Block, Kind, Mpcc, Source, Span};
use crate::system::experiment::Cross;

/// 0 <= `jump` ⟂ `continuous` >= 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Members<'e> {
    pub jump: Expr<'e>,
    pub continuous: Expr<'e>,
    origin: Origin,
}

/// Pairs with the same nodes.
pub(crate) struct Group<'e> {
    /// What a and b are called where they are printed.
    pub names: (&'static str, &'static str),
    pub block: &'static str,
    /// The last m.
    pub last: usize,
    /// Whether b is taken at all nodes and ends, or at the node of a alone.
    pub is_crossed: bool,
    pub members: Vec<Members<'e>>,
}

/// One vector of formal arguments with its node.
pub(crate) type Copied<'e> = (usize, Vec<Expr<'e>>);

impl fmt::Display for Members<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} perp {}", self.jump, self.continuous)
    }
}

impl<'e> Problem<'_, 'e> {
    /// All pairs: those whose a is there at the nodes, those whose a is there at a right end that is no node too, and
    /// those that are not stated across nodes.
    pub(crate) fn groups(&self) -> Vec<Group<'e>> {
        let layout = &self.layout;
        let group = |names, block, last, is_crossed| Group {
            names,
            block,
            last,
            is_crossed,
            members: Vec::new(),
        };
        let mut groups = [
            group(("a", "b"), "complementarity", layout.nodes, true),
            group(("a_end", "b_end"), "complementarity_end", layout.end, true),
            group(
                ("a_node", "b_node"),
                "complementarity_node",
                layout.nodes,
                false,
            ),
        ];
        for (pair, &origin) in self.dcs.pairs.iter().zip(&self.dcs.origins.pairs) {
            let [left, right] = [pair.left, pair.right].map(|member| self.algebraic(member));
            let is_continuous = |i: usize| self.dcs.algebraics[i].continuous;
            let detected = self.detection.is_some();
            let (jump, continuous, group) = match (is_continuous(left), is_continuous(right)) {
                (false, true) if detected => (pair.left, pair.right, self.group(left)),
                (true, false) if detected => (pair.right, pair.left, self.group(right)),
                (true, true) if detected => (pair.left, pair.right, self.group(left)),
                _ => (pair.left, pair.right, 2),
            };
            groups[group].members.push(Members {
                jump,
                continuous,
                origin,
            });
        }
        groups
            .into_iter()
            .filter(|group| !group.members.is_empty())
            .collect()
    }

    fn group(&self, jump: usize) -> usize {
        usize::from(self.layout.at_end.contains(&jump))
    }

    /// The number of the variable that a member contains.
    pub(crate) fn algebraic(&self, member: Expr<'e>) -> usize {
        let contains =
            |z: &crate::lowering::dcs::Algebraic| z.var == member || z.var == 1.0 - member;
        let place = self.dcs.algebraics.iter().position(contains);
        place.expect("members of pairs are algebraic variables, or 1 minus one")
    }

    /// The number of the variable that a member contains, and the derivative by it.
    pub(crate) fn jump(&self, member: Expr<'e>) -> (usize, f64) {
        let i = self.algebraic(member);
        let is_variable = self.dcs.algebraics[i].var == member;
        (i, if is_variable { 1.0 } else { -1.0 })
    }

    /// The pairs.
    pub(crate) fn complementarity(&self, mpcc: &mut Mpcc<'e>) {
        for group in self.groups() {
            let cross = self.detection.map(|detection| detection.cross);
            match cross.filter(|_| group.is_crossed) {
                None => self.nodewise(&group, mpcc),
                Some(Cross::All) => {
                    self.all(&group, mpcc);
                    self.bounded(&group, mpcc);
                }
                Some(Cross::SumTheta) => {
                    self.sum_theta(&group, mpcc);
                    self.bounded(&group, mpcc);
                }
                Some(Cross::SumLambda) => self.sum_lambda(&group, mpcc),
                Some(Cross::SumBoth) => self.sum_both(&group, mpcc),
            }
        }
    }

    fn nodewise(&self, group: &Group<'e>, mpcc: &mut Mpcc<'e>) {
        let ranges = [self.steps(), self.elements(), Span::new("m", 1, group.last)];
        let (a, b) = (group.jumps(), group.continuous());
        let both = [a.clone(), b.clone()].concat();
        let block = Builder::new(group.block, ranges);
        let block = self.bind(block, &both, &both, |[k, j, m]| (k, j, m));
        let text = [at(group.names.0, "m"), at(group.names.1, "m")];
        mpcc.blocks.push(group.finish(block, a, b, text));
    }

    fn all(&self, group: &Group<'e>, mpcc: &mut Mpcc<'e>) {
        let [m, l] = self.spans(group);
        let (a, b) = (group.jumps(), group.continuous());
        let block = Builder::new(group.block, [self.steps(), self.elements(), m, l]);
        let block = self.bind(block, &a, &a, |[k, j, m, _]| (k, j, m));
        let block = self.bind(block, &b, &b, |[k, j, _, l]| (k, j, l));
        let text = [at(group.names.0, "m"), at(group.names.1, "l")];
        mpcc.blocks.push(group.finish(block, a, b, text));
    }

    fn sum_theta(&self, group: &Group<'e>, mpcc: &mut Mpcc<'e>) {
        let [m, l] = self.spans(group);
        let (a, b) = (group.jumps(), group.continuous());
        let jumps = self.copied(&a, m);
        let mut block = Builder::new(group.block, [self.steps(), self.elements(), l]);
        for (m, copy) in &jumps {
            block = self.bind(block, &a, copy, |[k, j, _]| (k, j, *m));
        }
        let block = self.bind(block, &b, &b, |[k, j, l]| (k, j, l));
        let text = [summed(group.names.0, m), at(group.names.1, "l")];
        mpcc.blocks
            .push(group.finish(block, self.sum(&jumps), b, text));
    }

    fn sum_lambda(&self, group: &Group<'e>, mpcc: &mut Mpcc<'e>) {
        let [m, l] = self.spans(group);
        let (a, b) = (group.jumps(), group.continuous());
        let continuous = self.copied(&b, l);
        let mut block = Builder::new(group.block, [self.steps(), self.elements(), m]);
        for (l, copy) in &continuous {
            block = self.bind(block, &b, copy, |[k, j, _]| (k, j, *l));
        }
        let block = self.bind(block, &a, &a, |[k, j, m]| (k, j, m));
        let (block, b, more) = self.with_bounds(block, &a, self.sum(&continuous));
        let text = [at(group.names.0, "m"), summed(group.names.1, l) + more];
        mpcc.blocks.push(group.finish(block, a, b, text));
    }

    fn sum_both(&self, group: &Group<'e>, mpcc: &mut Mpcc<'e>) {
        let [m, l] = self.spans(group);
        let (a, b) = (group.jumps(), group.continuous());
        let (jumps, continuous) = (self.copied(&a, m), self.copied(&b, l));
        let mut block = Builder::new(group.block, [self.steps(), self.elements()]);
        for (m, copy) in &jumps {
            block = self.bind(block, &a, copy, |[k, j]| (k, j, *m));
        }
        for (l, copy) in &continuous {
            block = self.bind(block, &b, copy, |[k, j]| (k, j, *l));
        }
        let (block, b, more) = self.with_bounds(block, &a, self.sum(&continuous));
        let text = [summed(group.names.0, m), summed(group.names.1, l) + more];
        let a = self.sum(&jumps);
        mpcc.blocks.push(group.finish(block, a, b, text));
    }

    /// Σ b with the bounds of S, which are complementary to the same a.
    fn with_bounds<const N: usize>(
        &self,
        block: Builder<N>,
        a: &[Expr<'e>],
        b: Vec<Expr<'e>>,
    ) -> (Builder<N>, Vec<Expr<'e>>, &'static str) {
        let (block, bounds) = self.bounds_of(block, a);
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
        let (block, bounds) = self.bounds_of(
            Builder::new("sliding", [self.steps(), self.elements()]),
            &group.jumps(),
        );
        let members = group.members.iter().zip(bounds);
        let members = members.filter_map(|(&member, r)| Some((member, r?)));
        let (members, r): (Vec<Members>, Vec<Expr>) = members.unzip();
        if members.is_empty() {
            return;
        }
        let group = Group { members, ..*group };
        let [m, _] = self.spans(&group);
        let a = group.jumps();
        let jumps = self.copied(&a, m);
        let block = jumps.iter().fold(block, |block, (m, copy)| {
            self.bind(block, &a, copy, |[k, j]| (k, j, *m))
        });
        let text = [summed(group.names.0, m), "r[k,j]".to_owned()];
        mpcc.blocks
            .push(group.finish(block, self.sum(&jumps), r, text));
    }

    /// Where a and b are taken.
    pub(crate) fn spans(&self, group: &Group) -> [Span; 2] {
        [
            Span::new("m", 1, group.last),
            Span::new("l", 0, self.layout.end),
        ]
    }

    /// Members in variables of their own for each node.
    pub(crate) fn copied(&self, members: &[Expr<'e>], nodes: Span) -> Vec<Copied<'e>> {
        let copy = |node| {
            let fresh = |&member: &Expr<'e>| {
                let z = self.dcs.algebraics[self.algebraic(member)].var;
                let mut renamed = Substitution::new();
                renamed.insert(variable(z), self.dcs.exprs.variable(&z.to_string()));
                member.substitute(&renamed)
            };
            (node, members.iter().map(fresh).collect())
        };
        (nodes.first..=nodes.last).map(copy).collect()
    }

    /// Sums of members over the nodes.
    pub(crate) fn sum(&self, copies: &[Copied<'e>]) -> Vec<Expr<'e>> {
        let n = copies.first().map_or(0, |(_, members)| members.len());
        let sum = |i| {
            self.dcs
                .exprs
                .sum(copies.iter().map(|(_, members)| members[i]))
        };
        (0..n).map(sum).collect()
    }

    /// Binds the variables of members, or of their copies, at a node.
    pub(crate) fn bind<const N: usize>(
        &self,
        block: Builder<N>,
        members: &[Expr<'e>],
        copies: &[Expr<'e>],
        node: impl Fn([usize; N]) -> (usize, usize, usize),
    ) -> Builder<N> {
        let mut bound: Vec<Var> = Vec::new();
        members
            .iter()
            .zip(copies)
            .fold(block, |block, (&member, &copy)| {
                let i = self.algebraic(member);
                let formal = variables_of(&[copy])[0];
                // One variable may be in several members, as α is.
                if bound.contains(&formal) {
                    return block;
                }
                bound.push(formal);
                block.variable(self.dcs.exprs.expr(formal), |place| {
                    let (k, j, m) = node(place);
                    let index = self.layout.z(k, j, m, i);
                    index.expect("members are taken where they are declared")
                })
            })
    }
}

/// `a(z[k,j,m])`
fn at(name: &str, index: &str) -> String {
    format!("{name}(z[k,j,{index}])")
}

/// `sum(a(z[k,j,m]), m in 1..4)`
fn summed(name: &str, nodes: Span) -> String {
    let (index, first, last) = (nodes.name, nodes.first, nodes.last);
    format!("sum({}, {index} in {first}..{last})", at(name, index))
}

impl<'e> Group<'e> {
    /// a.
    pub fn jumps(&self) -> Vec<Expr<'e>> {
        self.members.iter().map(|pair| pair.jump).collect()
    }

    /// b.
    pub fn continuous(&self) -> Vec<Expr<'e>> {
        self.members.iter().map(|pair| pair.continuous).collect()
    }

    /// Rows about a that hold for some choices only.
    pub(crate) fn conditional<const N: usize>(
        &self,
        block: Builder<N>,
        values: Vec<Expr<'e>>,
        text: String,
    ) -> Block<'e> {
        let sources = self.members.iter().map(|pair| Source::Dcs(pair.origin));
        block.finish(Kind::Conditional, values, sources.collect(), text)
    }

    /// The rows 0 <= a ⟂ b >= 0.
    fn finish<const N: usize>(
        &self,
        block: Builder<N>,
        a: Vec<Expr<'e>>,
        b: Vec<Expr<'e>>,
        text: [String; 2],
    ) -> Block<'e> {
        let sources = self.members.iter().map(|pair| Source::Dcs(pair.origin));
        let outputs = a.into_iter().chain(b).collect();
        let text = format!("0 <= {} perp {} >= 0", text[0], text[1]);
        block.finish(Kind::Pair, outputs, sources.collect(), text)
    }
}
