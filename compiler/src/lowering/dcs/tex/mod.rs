//! A DCS as LaTeX: one `align*` environment of amsmath.

mod jumps;
mod names;

use std::collections::HashMap;

use crate::expr::{BinaryFunction, Expr, Node, rewrite};

use super::{Dcs, DcsError, auto};
use crate::system::System;
use crate::system::experiment::Lowering;
use names::{name, name_parts, number};

/// A formula with a longer text gets a symbol, and the symbol an equation of its own.
const LONGEST: usize = 4000;

/// The equations of a system, ready to be included where amsmath is loaded. Contacts are stated by forces and impulses,
/// and other jumps by their laws, whatever method runs them.
pub fn tex(system: &System, lowerings: &[Lowering]) -> Result<String, DcsError> {
    let dcs = auto::lower_with_jumps(system, lowerings)?;
    let mut writer = Writer::default();
    let mut jumps = jumps::impulses(&dcs, &mut writer);
    jumps.extend(jumps::laws(system, &dcs, &mut writer));
    Ok(equations(&dcs, writer, jumps))
}

/// The equations of a DCS, and lines about jumps.
fn equations<'e>(dcs: &Dcs<'e>, mut writer: Writer<'e>, jumps: Vec<String>) -> String {
    let mut lines = Vec::new();
    for (state, &rate) in dcs.states.iter().zip(&dcs.rows.rates) {
        lines.push(format!(
            "{} &= {}",
            derivative(state.var),
            writer.formula(rate)
        ));
    }
    for &row in &dcs.rows.equations {
        lines.push(format!("0 &= {}", writer.formula(row)));
    }
    for pair in &dcs.rows.pairs {
        let (left, right) = (writer.formula(pair.left), writer.formula(pair.right));
        lines.push(format!("0 &\\le {left} \\perp {right} \\ge 0"));
    }
    let has_jumps = !jumps.is_empty();
    lines.extend(jumps);
    lines.extend(writer.definitions);

    // A comment ends with its line.
    let comment = dcs.lowering.reason.as_ref().map(|reason| {
        let reason = reason.replace(['\n', '\r'], " ");
        format!("% {}: {reason}\n", dcs.lowering.formulation)
    });
    let legend = match has_jumps {
        true => "% where states jump, - is before and + behind\n",
        false => "",
    };
    let lines = lines.join(" \\\\\n");
    format!(
        "{}{legend}\\begin{{align*}}\n{lines}\n\\end{{align*}}\n",
        comment.unwrap_or_default()
    )
}

/// How tightly a formula holds together.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Sum,
    Product,
    Power,
    Atom,
}

/// A formula; a fraction binds like an atom except under a power.
#[derive(Clone)]
struct Piece {
    text: String,
    binding: Binding,
}

impl Piece {
    fn within(&self, outer: Binding) -> String {
        if self.binding < outer {
            format!("\\left({}\\right)", self.text)
        } else {
            self.text.clone()
        }
    }
}

/// Formulas that share what is too long to repeat.
#[derive(Default)]
struct Writer<'e> {
    pieces: HashMap<Expr<'e>, Piece>,
    /// `w_{1} &= ..`, in order.
    definitions: Vec<String>,
}

impl<'e> Writer<'e> {
    /// An expression in math mode.
    fn formula(&mut self, expr: Expr<'e>) -> String {
        // Bottom-up, so that deep expressions do not recurse.
        rewrite(expr, &mut |e| {
            if !self.pieces.contains_key(&e) {
                let piece = piece(e, &self.pieces);
                let piece = if e == expr || piece.text.len() <= LONGEST {
                    piece
                } else {
                    self.define(piece)
                };
                self.pieces.insert(e, piece);
            }
            e
        });
        self.pieces[&expr].text.clone()
    }

    /// The same as a part of a formula that binds so tightly.
    fn within(&mut self, expr: Expr<'e>, outer: Binding) -> String {
        self.formula(expr);
        self.pieces[&expr].within(outer)
    }

    fn define(&mut self, piece: Piece) -> Piece {
        let symbol = format!("w_{{{}}}", self.definitions.len() + 1);
        self.definitions.push(format!("{symbol} &= {}", piece.text));
        Piece {
            text: symbol,
            binding: Binding::Atom,
        }
    }
}

fn piece(expr: Expr, pieces: &HashMap<Expr, Piece>) -> Piece {
    match expr.printed_node() {
        Node::Constant(value) => Piece {
            text: number(value),
            binding: if value < 0.0 {
                Binding::Sum
            } else {
                Binding::Atom
            },
        },
        Node::Variable(var) => Piece {
            text: name(&expr.exprs().name(var)),
            binding: Binding::Atom,
        },
        Node::Sum { constant, terms } => sum(constant, &terms, pieces),
        Node::Product(factors) => product(1.0, &factors, pieces),
        Node::Unary(function, a) => {
            let (before, behind) = function.definition().tex;
            Piece {
                text: format!("{before}{}{behind}", pieces[&a].text),
                binding: Binding::Atom,
            }
        }
        Node::Binary(BinaryFunction::Pow, a, b) => Piece {
            text: format!(
                "{}^{{{}}}",
                pieces[&a].within(Binding::Atom),
                pieces[&b].text
            ),
            binding: Binding::Power,
        },
        Node::Binary(function, a, b) => {
            call(operator(function.name()), &[&pieces[&a], &pieces[&b]])
        }
    }
}

fn call(operator: String, arguments: &[&Piece]) -> Piece {
    let arguments: Vec<&str> = arguments.iter().map(|piece| piece.text.as_str()).collect();
    Piece {
        text: format!("{operator}\\left({}\\right)", arguments.join(", ")),
        binding: Binding::Atom,
    }
}

fn operator(name: &str) -> String {
    match name {
        "min" | "max" => format!("\\{name}"),
        _ => format!("\\operatorname{{{name}}}"),
    }
}

fn sum(constant: f64, terms: &[(f64, Expr)], pieces: &HashMap<Expr, Piece>) -> Piece {
    let mut text = String::new();
    let mut append = |negative: bool, term: &str| {
        let sign = match (negative, text.is_empty()) {
            (true, true) => "-",
            (true, false) => " - ",
            (false, true) => "",
            (false, false) => " + ",
        };
        text.push_str(sign);
        text.push_str(term);
    };
    let number_first = constant > 0.0 && terms.first().is_some_and(|first| first.0 < 0.0);
    if number_first {
        append(false, &number(constant));
    }
    for &(coefficient, term) in terms {
        let term = scaled(coefficient.abs(), term, pieces);
        append(coefficient < 0.0, &term.within(Binding::Product));
    }
    if constant != 0.0 && !number_first {
        append(constant < 0.0, &number(constant.abs()));
    }
    let lone = matches!(terms, [(coefficient, _)] if constant == 0.0 && *coefficient > 0.0);
    Piece {
        text,
        binding: if lone { Binding::Product } else { Binding::Sum },
    }
}

fn scaled(coefficient: f64, term: Expr, pieces: &HashMap<Expr, Piece>) -> Piece {
    match term.printed_node() {
        _ if coefficient == 1.0 => pieces[&term].clone(),
        Node::Product(factors) => product(coefficient, &factors, pieces),
        _ => product(coefficient, &[(term, 1)], pieces),
    }
}

/// A fraction where there is something below.
fn product(coefficient: f64, factors: &[(Expr, i32)], pieces: &HashMap<Expr, Piece>) -> Piece {
    let side = |above: bool| -> Vec<String> {
        let factors = factors.iter().filter(|(_, power)| (*power > 0) == above);
        let powers = factors.map(|(factor, power)| match power.unsigned_abs() {
            1 => pieces[factor].within(Binding::Power),
            power => format!("{}^{{{power}}}", pieces[factor].within(Binding::Atom)),
        });
        powers.collect()
    };
    let (mut above, below) = (side(true), side(false));
    if coefficient != 1.0 || above.is_empty() {
        above.insert(0, number(coefficient));
    }
    let above = above.join(" \\, ");
    match below.as_slice() {
        [] => Piece {
            text: above,
            binding: Binding::Product,
        },
        _ => Piece {
            text: format!("\\frac{{{above}}}{{{}}}", below.join(" \\, ")),
            binding: Binding::Product,
        },
    }
}

/// The derivative of a state by time.
fn derivative(state: Expr) -> String {
    let name = state.as_variable().map(|var| state.exprs().name(var));
    let (symbol, subscript) = name_parts(&name.unwrap_or_default());
    format!("\\dot{{{symbol}}}{subscript}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_keep_their_parentheses() {
        let exprs = crate::expr::Exprs::new();
        let [x, k, m] = ["x", "k", "m"].map(|name| exprs.variable(name));
        let cases = [
            (k / m * x, "\\frac{x \\, k}{m}"),
            ((x + 1.0) * k, "\\left(x + 1\\right) \\, k"),
            ((x + 1.0).powi(2), "\\left(x + 1\\right)^{2}"),
            (x.powi(2).sqrt(), "\\sqrt{x^{2}}"),
            (-(x * k), "-x \\, k"),
            (1e-20 * x, "10^{-20} \\, x"),
            (
                (2.0 * x).sin() - k.asin(),
                "\\sin\\left(2 \\, x\\right) - \\arcsin\\left(k\\right)",
            ),
            (x.powf(k), "x^{k}"),
            ((x / k).powf(m), "\\left(\\frac{x}{k}\\right)^{m}"),
        ];
        for (expr, expected) in cases {
            assert_eq!(Writer::default().formula(expr), expected);
        }
    }

    #[test]
    fn shared_parts_are_not_repeated_for_ever() {
        let exprs = crate::expr::Exprs::new();
        let x = exprs.variable("x");
        let deep = (0..100).fold(x, |e, _| (e * (e + x)).sin());
        let mut writer = Writer::default();
        let length = writer.formula(deep).len();
        assert!(length < 4 * LONGEST && !writer.definitions.is_empty());
    }
}
