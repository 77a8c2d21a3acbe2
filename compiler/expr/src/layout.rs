//! What every printed form of an expression shares: order, fractions, precedence, and the cut of large ones.

use rustc_hash::{FxHashMap, FxHashSet};

use super::nodes::{Data, Id, Nodes};
use super::{BinaryFunction, Expr, Node};

/// An expression with fewer operations than this, shared ones counted again, is printed in one piece.
const ONE_PIECE: u64 = 2000;
/// In pieces, a shared part gets a name from this size on.
const NAMED: u64 = 40;
/// No piece is nested more deeply.
const DEPTH: u32 = 60;

/// How tightly the printed text holds together.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Binding {
    Sum,
    Product,
    Power,
    Atom,
}

/// A term of a sum: its sign, its size, and what is multiplied; the number has none.
pub(super) struct Term {
    pub negative: bool,
    pub coefficient: f64,
    pub term: Option<Id>,
}

/// A product as a quotient.
pub(super) struct Fraction {
    pub numerator: f64,
    pub above: Vec<(Id, u32)>,
    pub denominator: f64,
    pub below: Vec<(Id, u32)>,
}

/// The terms of a sum as they are printed; the number comes first if that saves a leading minus, else last.
pub(super) fn in_order(nodes: &Nodes, constant: f64, terms: &[(Id, f64)]) -> Vec<Term> {
    let mut terms = terms.to_vec();
    terms.sort_by_key(|&(term, _)| term_key(nodes, term));
    let piece = |c: f64, term| Term {
        negative: c < 0.0,
        coefficient: c.abs(),
        term,
    };
    let number_first = constant > 0.0 && terms.first().is_some_and(|term| term.1 < 0.0);
    let mut pieces: Vec<Term> = terms
        .into_iter()
        .map(|(term, c)| piece(c, Some(term)))
        .collect();
    if constant != 0.0 {
        let place = if number_first { 0 } else { pieces.len() };
        pieces.insert(place, piece(constant, None));
    }
    pieces
}

/// A positive number times powers as a quotient.
pub(super) fn fraction(nodes: &Nodes, coefficient: f64, factors: &[(Id, i32)]) -> Fraction {
    let mut factors = factors.to_vec();
    factors.sort_by_key(|&(factor, _)| factor_key(nodes, factor));
    let (above, below): (Vec<_>, Vec<_>) = factors.into_iter().partition(|&(_, power)| power > 0);
    let (numerator, denominator) = as_fraction(coefficient);
    let size = |(factor, power): (Id, i32)| (factor, power.unsigned_abs());
    Fraction {
        numerator,
        above: above.into_iter().map(size).collect(),
        denominator,
        below: below.into_iter().map(size).collect(),
    }
}

impl<'e> Expr<'e> {
    /// One level of structure, with terms and factors in the order of the printed text.
    pub fn printed_node(self) -> Node<'e> {
        let mut node = self.node();
        let nodes = self.exprs.nodes();
        match &mut node {
            Node::Sum { terms, .. } => terms.sort_by_key(|(_, term)| term_key(&nodes, term.id)),
            Node::Product(factors) => {
                factors.sort_by_key(|(factor, _)| factor_key(&nodes, factor.id));
            }
            _ => {}
        }
        node
    }
}

/// How tightly the printed form of a node holds together.
pub(super) fn binding(nodes: &Nodes, id: Id) -> Binding {
    match nodes.data(id) {
        Data::Constant(value) if value < 0.0 => Binding::Sum,
        Data::Constant(_) | Data::Variable(_) | Data::Unary(..) => Binding::Atom,
        Data::Sum {
            constant: 0.0,
            start,
            len: 1,
        } if nodes.terms(start, 1)[0].1 > 0.0 => Binding::Product,
        Data::Sum { .. } => Binding::Sum,
        Data::Product { start, len: 1 } if nodes.factors(start, 1)[0].1 > 0 => Binding::Power,
        Data::Product { .. } => Binding::Product,
        Data::Binary(BinaryFunction::Pow, ..) => Binding::Power,
        Data::Binary(..) => Binding::Atom,
    }
}

/// The coefficient of the first printed term of a sum.
pub(super) fn leading_coefficient(nodes: &Nodes, id: Id) -> f64 {
    match nodes.data(id) {
        Data::Sum { start, len, .. } => {
            let terms = nodes.terms(start, len);
            let first = terms.iter().min_by_key(|&&(term, _)| term_key(nodes, term));
            first.map_or(1.0, |&(_, coefficient)| coefficient)
        }
        _ => 1.0,
    }
}

/// First variable, then falling degree, then what was written first.
fn term_key(nodes: &Nodes, term: Id) -> (u32, i32, Id) {
    let rank = nodes.rank(term);
    (rank.first_variable, rank.degree.saturating_neg(), term)
}

/// Parameters and states before functions and sums of the same variable.
fn factor_key(nodes: &Nodes, factor: Id) -> (u32, u8, Id) {
    let kind = match nodes.data(factor) {
        Data::Constant(_) | Data::Variable(_) => 0,
        Data::Unary(..) | Data::Binary(..) => 1,
        Data::Sum { .. } | Data::Product { .. } => 2,
    };
    (nodes.rank(factor).first_variable, kind, factor)
}

/// The parts that do not fit in one piece, later ones first.
pub(super) fn parts_to_name(nodes: &Nodes, root: Id) -> Vec<Id> {
    let order = nodes.below([root]);
    let mut size: FxHashMap<Id, (u64, u32)> = FxHashMap::default();
    let mut uses: FxHashMap<Id, u32> = FxHashMap::default();
    let measure = |id: Id, named: &FxHashSet<Id>, size: &mut FxHashMap<Id, (u64, u32)>| {
        let (mut total, mut depth) = (1u64, 1u32);
        nodes.for_each_child(id, |child| {
            let (child_size, child_depth) = if named.contains(&child) {
                (1, 1)
            } else {
                size[&child]
            };
            total = total.saturating_add(child_size);
            depth = depth.max(child_depth.saturating_add(1));
        });
        size.insert(id, (total, depth));
        (total, depth)
    };
    let mut named = FxHashSet::default();
    let mut whole = (1, 1);
    for &id in &order {
        whole = measure(id, &named, &mut size);
        nodes.for_each_child(id, |child| *uses.entry(child).or_default() += 1);
    }
    if whole.0 <= ONE_PIECE && whole.1 <= DEPTH {
        return Vec::new();
    }
    for &id in order.iter().filter(|&&id| id != root) {
        let (total, depth) = measure(id, &named, &mut size);
        let shared = uses[&id] > 1;
        if depth >= DEPTH || (shared && total >= NAMED) {
            named.insert(id);
        }
    }
    let mut parts: Vec<Id> = named.into_iter().collect();
    parts.sort_unstable_by_key(|&id| std::cmp::Reverse(id));
    parts
}

/// A positive coefficient as a quotient of small integers, if its decimals are long and that is the same number.
fn as_fraction(value: f64) -> (f64, f64) {
    let whole = (value, 1.0);
    if !(1e-4..1e4).contains(&value) || value.to_string().len() < 12 {
        return whole;
    }
    let quotient = |q: u16| ((value * f64::from(q)).round(), f64::from(q));
    (2..1000)
        .map(quotient)
        .find(|(p, q)| p / q == value)
        .unwrap_or(whole)
}
