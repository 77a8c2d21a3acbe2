//! The text of an expression: the user's names, few parentheses, one order.
//!
//! Terms come by their first variable and falling degree, the number last, unless it is the only positive start:
//! `x[1]^2 + x[2]^2 - 1`, `2 - sign(x)`. What is too large to read, or nested too deeply, is cut: the parts get
//! names, and the names are explained behind `where`.

use std::fmt::{self, Display, Formatter, Write};

use rustc_hash::FxHashMap;

use super::layout::{Binding, Fraction, Term, binding, fraction, in_order, parts_to_name};
use super::nodes::{Data, Id, Nodes};
use super::{BinaryFunction, Expr};

struct Printer<'a> {
    nodes: &'a Nodes,
    /// The number of the name of a part.
    names: FxHashMap<Id, usize>,
}

impl Display for Expr<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let nodes = self.exprs.nodes();
        let parts = parts_to_name(&nodes, self.id);
        let names = parts.iter().enumerate().map(|(i, &part)| (part, i + 1));
        let printer = Printer {
            nodes: &nodes,
            names: names.collect(),
        };
        printer.print(f, self.id, Binding::Sum)?;
        for (i, &part) in parts.iter().enumerate() {
            let separator = if i == 0 { " where " } else { ", " };
            write!(f, "{separator}#{} = ", i + 1)?;
            printer.body(f, part, Binding::Sum)?;
        }
        Ok(())
    }
}

impl Printer<'_> {
    fn print(&self, f: &mut impl Write, id: Id, outer: Binding) -> fmt::Result {
        match self.names.get(&id) {
            Some(number) => write!(f, "#{number}"),
            None => self.body(f, id, outer),
        }
    }

    fn body(&self, f: &mut impl Write, id: Id, outer: Binding) -> fmt::Result {
        let parentheses = binding(self.nodes, id) < outer;
        if parentheses {
            f.write_char('(')?;
        }
        match self.nodes.data(id) {
            Data::Constant(value) => write_number(f, value)?,
            Data::Variable(var) => f.write_str(self.nodes.name(var))?,
            Data::Sum {
                constant,
                start,
                len,
            } => {
                self.sum(f, constant, self.nodes.terms(start, len))?;
            }
            Data::Product { start, len } => {
                self.product(f, 1.0, self.nodes.factors(start, len))?;
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

    fn sum(&self, f: &mut impl Write, constant: f64, terms: &[(Id, f64)]) -> fmt::Result {
        for (i, piece) in in_order(self.nodes, constant, terms)
            .into_iter()
            .enumerate()
        {
            let Term {
                negative,
                coefficient,
                term,
            } = piece;
            f.write_str(sign(negative, i == 0))?;
            match term {
                Some(term) => self.term(f, coefficient, term)?,
                None => write_number(f, coefficient)?,
            }
        }
        Ok(())
    }

    /// A positive number times an expression.
    fn term(&self, f: &mut impl Write, coefficient: f64, term: Id) -> fmt::Result {
        match self.nodes.data(term) {
            Data::Product { start, len } if !self.names.contains_key(&term) => {
                self.product(f, coefficient, self.nodes.factors(start, len))
            }
            _ if coefficient == 1.0 => self.print(f, term, Binding::Product),
            _ => self.product(f, coefficient, &[(term, 1)]),
        }
    }

    fn product(&self, f: &mut impl Write, coefficient: f64, factors: &[(Id, i32)]) -> fmt::Result {
        let Fraction {
            numerator,
            above,
            denominator,
            below,
        } = fraction(self.nodes, coefficient, factors);
        self.factors(f, numerator, &above)?;
        match below.len() + usize::from(denominator != 1.0) {
            0 => Ok(()),
            1 => {
                f.write_char('/')?;
                self.factors(f, denominator, &below)
            }
            _ => {
                f.write_str("/(")?;
                self.factors(f, denominator, &below)?;
                f.write_char(')')
            }
        }
    }

    fn factors(&self, f: &mut impl Write, number: f64, powers: &[(Id, u32)]) -> fmt::Result {
        let has_number = number != 1.0 || powers.is_empty();
        if has_number {
            write_number(f, number)?;
        }
        for (i, &(base, power)) in powers.iter().enumerate() {
            if has_number || i > 0 {
                f.write_char('*')?;
            }
            if power == 1 {
                self.print(f, base, Binding::Power)?;
            } else {
                self.print(f, base, Binding::Atom)?;
                write!(f, "^{power}")?;
            }
        }
        Ok(())
    }
}

/// What stands in front of a term.
fn sign(negative: bool, first: bool) -> &'static str {
    match (negative, first) {
        (false, true) => "",
        (true, true) => "-",
        (false, false) => " + ",
        (true, false) => " - ",
    }
}

/// The shortest text that reads back as the same number.
fn write_number(f: &mut impl Write, value: f64) -> fmt::Result {
    let magnitude = value.abs();
    if magnitude != 0.0 && magnitude.is_finite() && !(1e-4..1e16).contains(&magnitude) {
        write!(f, "{value:e}")
    } else {
        write!(f, "{value}")
    }
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
        assert_snapshot!((1.0 / 3.0 + 1e-9) * x, @"0.33333333433333334*x");
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
