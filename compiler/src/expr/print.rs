//! The text of an expression: the user's names, few parentheses, one order.
//!
//! Terms come by their first variable and falling degree, the number last, unless it is the only positive start:
//! `x[1]^2 + x[2]^2 - 1`, `2 - sign(x)`. What is too large to read, or nested too deeply, is cut: the parts get
//! names, and the names are explained behind `where`.

use std::fmt::{self, Display, Formatter, Write};

use rustc_hash::{FxHashMap, FxHashSet};

use super::arena::{Arena, Data, Id};
use super::{BinaryFunction, Expr, Node};

/// An expression with fewer operations than this, shared ones counted again, is printed in one piece.
const ONE_PIECE: u64 = 2000;
/// In pieces, a shared part or a part of a deep chain gets a name from this size on.
const NAMED: u64 = 40;
/// No piece is nested more deeply.
const DEPTH: u32 = 60;

/// How tightly the printed text holds together.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Sum,
    Product,
    Power,
    Atom,
}

struct Printer<'a> {
    arena: &'a Arena,
    /// The number of the name of a part.
    names: FxHashMap<Id, usize>,
}

impl Display for Expr<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let arena = self.exprs.arena.borrow();
        let parts = parts_to_name(&arena, self.id);
        let mut printer = Printer {
            arena: &arena,
            names: FxHashMap::default(),
        };
        let names = parts.iter().enumerate().map(|(i, &part)| (part, i + 1));
        printer.names = names.collect();
        printer.print(f, self.id, Binding::Sum)?;
        for (i, &part) in parts.iter().enumerate() {
            let separator = if i == 0 { " where " } else { ", " };
            write!(f, "{separator}#{} = ", i + 1)?;
            printer.body(f, part, Binding::Sum)?;
        }
        Ok(())
    }
}

impl<'e> Expr<'e> {
    /// One level of structure, with terms and factors in the order of the printed text.
    pub fn printed_node(self) -> Node<'e> {
        let mut node = self.node();
        let arena = self.exprs.arena.borrow();
        match &mut node {
            Node::Sum { terms, .. } => terms.sort_by_key(|(_, term)| term_key(&arena, term.id)),
            Node::Product(factors) => {
                factors.sort_by_key(|(factor, _)| factor_key(&arena, factor.id));
            }
            _ => {}
        }
        node
    }
}

/// The coefficient of the first printed term of a sum.
pub(super) fn leading_coefficient(arena: &Arena, id: Id) -> f64 {
    match arena.data(id) {
        Data::Sum { start, len, .. } => {
            let terms = arena.terms(start, len);
            let first = terms.iter().min_by_key(|&&(term, _)| term_key(arena, term));
            first.map_or(1.0, |&(_, coefficient)| coefficient)
        }
        _ => 1.0,
    }
}

/// First variable, then falling degree, then what was written first.
fn term_key(arena: &Arena, term: Id) -> (u32, i32, Id) {
    let rank = arena.rank(term);
    (rank.first_variable, rank.degree.saturating_neg(), term)
}

/// Parameters and states before functions and sums of the same variable.
fn factor_key(arena: &Arena, factor: Id) -> (u32, u8, Id) {
    let kind = match arena.data(factor) {
        Data::Constant(_) | Data::Variable(_) => 0,
        Data::Unary(..) | Data::Binary(..) => 1,
        Data::Sum { .. } | Data::Product { .. } => 2,
    };
    (arena.rank(factor).first_variable, kind, factor)
}

/// The parts that do not fit in one piece, later ones first.
fn parts_to_name(arena: &Arena, root: Id) -> Vec<Id> {
    let order = arena.below([root]);
    let mut size: FxHashMap<Id, (u64, u32)> = FxHashMap::default();
    let mut uses: FxHashMap<Id, u32> = FxHashMap::default();
    let measure = |id: Id, named: &FxHashSet<Id>, size: &mut FxHashMap<Id, (u64, u32)>| {
        let (mut total, mut depth) = (1u64, 1u32);
        arena.for_each_child(id, |child| {
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
        arena.for_each_child(id, |child| *uses.entry(child).or_default() += 1);
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

impl Printer<'_> {
    fn print(&self, f: &mut impl Write, id: Id, outer: Binding) -> fmt::Result {
        match self.names.get(&id) {
            Some(number) => write!(f, "#{number}"),
            None => self.body(f, id, outer),
        }
    }

    fn body(&self, f: &mut impl Write, id: Id, outer: Binding) -> fmt::Result {
        let parentheses = self.binding(id) < outer;
        if parentheses {
            f.write_char('(')?;
        }
        match self.arena.data(id) {
            Data::Constant(value) => write_number(f, value)?,
            Data::Variable(var) => f.write_str(self.arena.name(var))?,
            Data::Sum {
                constant,
                start,
                len,
            } => {
                self.sum(f, constant, self.arena.terms(start, len))?;
            }
            Data::Product { start, len } => {
                self.product(f, 1.0, self.arena.factors(start, len))?;
            }
            Data::Unary(function, a) => {
                write!(f, "{}(", function.name())?;
                self.print(f, a, Binding::Sum)?;
                f.write_char(')')?;
            }
            Data::Binary(BinaryFunction::Pow, a, b) => {
                self.print(f, a, Binding::Atom)?;
                f.write_char('^')?;
                self.print(f, b, Binding::Atom)?;
            }
            Data::Binary(function, a, b) => {
                write!(f, "{}(", function.name())?;
                self.print(f, a, Binding::Sum)?;
                f.write_str(", ")?;
                self.print(f, b, Binding::Sum)?;
                f.write_char(')')?;
            }
        }
        if parentheses {
            f.write_char(')')?;
        }
        Ok(())
    }

    fn binding(&self, id: Id) -> Binding {
        match self.arena.data(id) {
            Data::Constant(value) if value.is_sign_negative() => Binding::Sum,
            Data::Constant(_) | Data::Variable(_) | Data::Unary(..) => Binding::Atom,
            Data::Sum {
                constant: 0.0,
                start,
                len: 1,
            } if self.arena.terms(start, 1)[0].1 > 0.0 => Binding::Product,
            Data::Sum { .. } => Binding::Sum,
            Data::Product { start, len: 1 } if self.arena.factors(start, 1)[0].1 > 0 => {
                Binding::Power
            }
            Data::Product { .. } => Binding::Product,
            Data::Binary(BinaryFunction::Pow, ..) => Binding::Power,
            Data::Binary(..) => Binding::Atom,
        }
    }

    fn sum(&self, f: &mut impl Write, constant: f64, terms: &[(Id, f64)]) -> fmt::Result {
        let mut terms = terms.to_vec();
        terms.sort_by_key(|&(term, _)| term_key(self.arena, term));
        let number_first = constant > 0.0 && terms[0].1 < 0.0;
        let mut first = true;
        if number_first {
            write_number(f, constant)?;
            first = false;
        }
        for (term, coefficient) in terms {
            write_sign(f, coefficient < 0.0, first)?;
            first = false;
            self.term(f, coefficient.abs(), term)?;
        }
        if constant != 0.0 && !number_first {
            write_sign(f, constant < 0.0, first)?;
            write_number(f, constant.abs())?;
        }
        Ok(())
    }

    /// A positive number times an expression.
    fn term(&self, f: &mut impl Write, coefficient: f64, term: Id) -> fmt::Result {
        match self.arena.data(term) {
            Data::Product { start, len } if !self.names.contains_key(&term) => {
                self.product(f, coefficient, self.arena.factors(start, len))
            }
            _ if coefficient == 1.0 => self.print(f, term, Binding::Product),
            _ => self.product(f, coefficient, &[(term, 1)]),
        }
    }

    /// A positive number times powers.
    fn product(&self, f: &mut impl Write, coefficient: f64, factors: &[(Id, i32)]) -> fmt::Result {
        let mut factors = factors.to_vec();
        factors.sort_by_key(|&(factor, _)| factor_key(self.arena, factor));
        let (above, below): (Vec<_>, Vec<_>) =
            factors.into_iter().partition(|&(_, power)| power > 0);
        let (numerator, denominator) = as_fraction(coefficient);
        let mut separate = false;
        if numerator != 1.0 || above.is_empty() {
            write_number(f, numerator)?;
            separate = true;
        }
        for (factor, power) in above {
            if separate {
                f.write_char('*')?;
            }
            separate = true;
            self.power(f, factor, power.unsigned_abs())?;
        }
        let n_below = below.len() + usize::from(denominator != 1.0);
        if n_below > 0 {
            f.write_str(if n_below > 1 { "/(" } else { "/" })?;
            separate = denominator != 1.0;
            if separate {
                write_number(f, denominator)?;
            }
            for (factor, power) in below {
                if separate {
                    f.write_char('*')?;
                }
                separate = true;
                self.power(f, factor, power.unsigned_abs())?;
            }
            if n_below > 1 {
                f.write_char(')')?;
            }
        }
        Ok(())
    }

    fn power(&self, f: &mut impl Write, base: Id, power: u32) -> fmt::Result {
        if power == 1 {
            return self.print(f, base, Binding::Power);
        }
        self.print(f, base, Binding::Atom)?;
        write!(f, "^{power}")
    }
}

fn write_sign(f: &mut impl Write, negative: bool, first: bool) -> fmt::Result {
    f.write_str(match (negative, first) {
        (false, true) => "",
        (true, true) => "-",
        (false, false) => " + ",
        (true, false) => " - ",
    })
}

/// The shortest text that reads back as the same number.
pub(super) fn write_number(f: &mut impl Write, value: f64) -> fmt::Result {
    let magnitude = value.abs();
    if magnitude != 0.0 && magnitude.is_finite() && !(1e-4..1e16).contains(&magnitude) {
        write!(f, "{value:e}")
    } else {
        write!(f, "{value}")
    }
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

#[cfg(test)]
mod tests {
    use insta::assert_snapshot;

    use super::super::Exprs;

    #[test]
    fn terms_come_in_the_order_a_reader_expects() {
        let e = Exprs::new();
        let (k, m) = (e.variable("k"), e.variable("m"));
        let x = e.variables("x", 2);
        assert_snapshot!(x[1] * x[1] - 1.0 + x[0].powi(2), @"x[1]^2 + x[2]^2 - 1");
        assert_snapshot!(2.0 - x[0].sign(), @"2 - sign(x[1])");
        assert_snapshot!(-10.0 * x[0] - x[1], @"-10*x[1] - x[2]");
        assert_snapshot!(-x[0] - 1.0, @"-x[1] - 1");
        assert_snapshot!(-(k / m) * x[0] + 9.81, @"9.81 - k*x[1]/m");
        assert_snapshot!((1.0 - x[0] * x[0]) * x[1] - x[0], @"(1 - x[1]^2)*x[2] - x[1]");
    }

    #[test]
    fn parentheses_are_few() {
        let e = Exprs::new();
        let (k, m) = (e.variable("k"), e.variable("m"));
        let x = e.variables("x", 2);
        assert_snapshot!(k * x[0] / (m * (x[1] + 1.0)), @"k*x[1]/(m*(x[2] + 1))");
        assert_snapshot!((x[0] + 1.0).powi(3) * (k + 1.0).powi(-2), @"(x[1] + 1)^3/(k + 1)^2");
        assert_snapshot!((-x[0]).powf(k) / (x[0] / m).sin(), @"(-x[1])^k/sin(x[1]/m)");
        assert_snapshot!(x[0].powf(-x[1]).powf(k).max(-k), @"max((x[1]^(-x[2]))^k, -k)");
    }

    #[test]
    fn numbers_are_short() {
        let e = Exprs::new();
        let x = e.variable("x");
        assert_snapshot!(2.0 * x / 3.0 - 1.0 / x.powi(2), @"2*x/3 - 1/x^2");
        assert_snapshot!(x / 3.0 + x * 1e-9, @"0.33333333433333334*x");
        assert_snapshot!(1e-9 * x - 6.02e23, @"1e-9*x - 6.02e23");
        assert_snapshot!(1.0 / e.constant(0.0) + e.constant(-1.0).sqrt(), @"1/0 + sqrt(-1)");
    }

    #[test]
    fn large_expressions_are_printed_in_parts() {
        let e = Exprs::new();
        let x = e.variable("x");
        let chain = (0..100_000).fold(x, |p, _| (p * 2.0 + 1.0) * x).to_string();
        assert!(chain.contains(" where #1 = "));
        assert!(chain.len() < 5_000_000);

        let doubled = (0..1000).fold(x, |p, _| p.sin() * p.cos()).to_string();
        assert!(doubled.len() < 100_000);
    }
}
