//! Nonlinear expressions in prefix notation, one operator or operand per line.

use std::fmt::Write;

use rustc_hash::FxHashMap;

use crate::expr::{BinaryFunction, Expr, Node, Var, children, rewrite_all};

/// Writes expressions; what occurs several times is a defined variable.
pub(crate) struct Writer<'e> {
    /// The columns of the variables.
    columns: FxHashMap<Var, usize>,
    /// The numbers of defined variables, in order of definition.
    defined: FxHashMap<Expr<'e>, usize>,
    /// What they are.
    definitions: Vec<Expr<'e>>,
}

/// What is still to be written, the next one last.
enum Piece<'e> {
    Line(String),
    Expr(Expr<'e>),
    /// The body of what is defined.
    Body(Expr<'e>),
}

impl<'e> Writer<'e> {
    /// For these terms, which are all that will be written.
    pub fn new(columns: FxHashMap<Var, usize>, terms: &[Expr<'e>]) -> Self {
        let mut uses: FxHashMap<Expr<'e>, usize> = FxHashMap::default();
        for &term in terms {
            *uses.entry(term).or_default() += 1;
        }
        let mut order = Vec::new();
        rewrite_all(terms, &mut |e| {
            for child in children(e) {
                *uses.entry(child).or_default() += 1;
            }
            order.push(e);
            e
        });
        let is_leaf = |e: &Expr| e.as_variable().is_some() || e.as_constant().is_some();
        order.retain(|e| uses[e] > 1 && !is_leaf(e));
        let first = columns.len();
        let numbered = order.iter().enumerate().map(|(i, &e)| (e, first + i));
        Writer {
            defined: numbered.collect(),
            columns,
            definitions: order,
        }
    }

    /// The number of defined variables.
    pub fn n_defined(&self) -> usize {
        self.definitions.len()
    }

    /// The segments of all defined variables: each contains earlier ones only.
    pub fn definitions(&self, out: &mut String) {
        for (i, &definition) in self.definitions.iter().enumerate() {
            line(out, &format!("V{} 0 0", self.columns.len() + i));
            self.write(vec![Piece::Body(definition)], out);
        }
    }

    /// constant + Σ coefficient * term.
    pub fn sum(&self, constant: f64, terms: &[(f64, Expr<'e>)], out: &mut String) {
        let mut pieces = Vec::new();
        push_sum(constant, terms, &mut pieces);
        pieces.reverse();
        self.write(pieces, out);
    }

    fn write(&self, mut stack: Vec<Piece<'e>>, out: &mut String) {
        let mut pieces = Vec::new();
        while let Some(piece) = stack.pop() {
            match piece {
                Piece::Line(text) => line(out, &text),
                Piece::Expr(e) => match self.defined.get(&e) {
                    Some(number) => line(out, &format!("v{number}")),
                    None => self.body(e, &mut pieces),
                },
                Piece::Body(e) => self.body(e, &mut pieces),
            }
            stack.extend(pieces.drain(..).rev());
        }
    }

    /// One level of an expression.
    fn body(&self, e: Expr<'e>, pieces: &mut Vec<Piece<'e>>) {
        match e.node() {
            Node::Constant(value) => pieces.push(Piece::Line(format!("n{}", number(value)))),
            Node::Variable(var) => pieces.push(Piece::Line(format!("v{}", self.columns[&var]))),
            Node::Sum { constant, terms } => push_sum(constant, &terms, pieces),
            Node::Product(factors) => {
                let side = |above: bool| -> Vec<(Expr<'e>, u32)> {
                    let powers = factors.iter().filter(|(_, power)| (*power > 0) == above);
                    powers
                        .map(|&(base, power)| (base, power.unsigned_abs()))
                        .collect()
                };
                let (above, below) = (side(true), side(false));
                if !below.is_empty() {
                    pieces.push(operator(3));
                }
                push_product(&above, pieces);
                if !below.is_empty() {
                    push_product(&below, pieces);
                }
            }
            Node::Unary(function, a) => {
                let code = function.definition().opcode;
                let code = code.expect("the kernels of an Mpcc are smooth");
                pieces.extend([operator(code), Piece::Expr(a)]);
            }
            Node::Binary(function, a, b) => {
                pieces.extend([operator(binary(function)), Piece::Expr(a), Piece::Expr(b)]);
            }
        }
    }
}

fn push_sum<'e>(constant: f64, terms: &[(f64, Expr<'e>)], pieces: &mut Vec<Piece<'e>>) {
    let has_constant = constant != 0.0 || terms.is_empty();
    match terms.len() + usize::from(has_constant) {
        1 => {}
        2 => pieces.push(operator(0)),
        n => pieces.extend([operator(54), Piece::Line(n.to_string())]),
    }
    for &(coefficient, term) in terms {
        if coefficient == -1.0 {
            pieces.push(operator(16));
        } else if coefficient != 1.0 {
            let coefficient = Piece::Line(format!("n{}", number(coefficient)));
            pieces.extend([operator(2), coefficient]);
        }
        pieces.push(Piece::Expr(term));
    }
    if has_constant {
        pieces.push(Piece::Line(format!("n{}", number(constant))));
    }
}

fn push_product<'e>(powers: &[(Expr<'e>, u32)], pieces: &mut Vec<Piece<'e>>) {
    if powers.is_empty() {
        pieces.push(Piece::Line("n1".to_owned()));
    }
    for (i, &(base, power)) in powers.iter().enumerate() {
        if i + 1 < powers.len() {
            pieces.push(operator(2));
        }
        if power == 1 {
            pieces.push(Piece::Expr(base));
        } else {
            let power = Piece::Line(format!("n{power}"));
            pieces.extend([operator(5), Piece::Expr(base), power]);
        }
    }
}

fn operator<'e>(code: u32) -> Piece<'e> {
    Piece::Line(format!("o{code}"))
}

/// The shortest text that reads back as the same number.
pub(crate) fn number(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 || (1e-5..1e15).contains(&magnitude) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

pub(crate) fn line(out: &mut String, text: &str) {
    writeln!(out, "{text}").expect("text can be appended to a string");
}

/// The code of a function (Gay 2005).
fn binary(function: BinaryFunction) -> u32 {
    match function {
        BinaryFunction::Pow => 5,
        BinaryFunction::Atan2 => 48,
        BinaryFunction::Min | BinaryFunction::Max => {
            unreachable!("the kernels of an Mpcc are smooth")
        }
    }
}
