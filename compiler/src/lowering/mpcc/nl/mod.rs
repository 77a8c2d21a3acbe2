//! AMPL text format (.nl) of an [`Mpcc`], with complementarity.
//!
//! A row is a nonlinear expression plus linear terms. The format wants variables and rows that are nonlinear first.
//! A pair a ⟂ b becomes one row with the body a that complements a variable b in [0, ∞). Where neither member is such a
//! variable, or another pair has it already, b becomes a slack: 0 = b - s, s >= 0, 0 <= a ⟂ s.
//! What occurs several times in the nonlinear parts is a defined variable, so that the text is as small as the graph.
//!
//! Gay 2005, *Writing .nl files*; Gay 1997, *Hooking your solver to AMPL*, for complementarity.

mod expressions;
mod text;

use rustc_hash::{FxHashMap, FxHashSet};

use super::{Bounds, Mpcc, Value};
use crate::expr::{Expr, Node, Substitution, Var, variables_of};

/// A program in AMPL's format, with the way back.
#[derive(Clone, Debug)]
pub struct Ampl {
    /// The file.
    pub text: String,
    /// The variable that each column is: its index in w, and from the number of variables on a slack.
    pub columns: Vec<usize>,
    /// The row that each row of the file is: its index in [`super::Flat::rows`] without terms of the objective and
    /// without conditional rows, and from their number on the definition of a slack.
    pub rows: Vec<usize>,
    /// Names of the columns, each once.
    pub column_names: Vec<String>,
    /// Names of the rows, each once, and that of the objective.
    pub row_names: Vec<String>,
}

/// A row before it is written.
struct Row<'e> {
    name: String,
    body: Linear<'e>,
    /// What is asked of it.
    kind: RowKind,
}

/// What is asked of a row.
#[derive(Clone, Copy)]
enum RowKind {
    /// lower <= body <= upper; equal for an equation.
    Between(f64, f64),
    /// It complements this variable.
    Complements(usize),
}

/// constant + Σ coefficient * variable + Σ coefficient * nonlinear term.
#[derive(Clone, Debug, Default)]
struct Linear<'e> {
    constant: f64,
    linear: FxHashMap<usize, f64>,
    nonlinear: Vec<(f64, Expr<'e>)>,
}

/// All that is written, variables by their numbers in `bounds`.
struct Program<'e> {
    name: String,
    numbers: FxHashMap<Var, usize>,
    names: Vec<String>,
    bounds: Vec<Bounds>,
    objective: Linear<'e>,
    rows: Vec<Row<'e>>,
}

impl<'e> Mpcc<'e> {
    /// The program in AMPL's format.
    pub fn nl(&self) -> Ampl {
        Program::new(self).write()
    }
}

impl<'e> Program<'e> {
    fn new(mpcc: &Mpcc<'e>) -> Self {
        let flat = mpcc.flat();
        let params = mpcc.params.iter();
        let values: Substitution = params
            .filter_map(|p| Some((p.var.as_variable()?, mpcc.exprs.constant(p.value))))
            .collect();
        let number = |(i, var): (usize, &Expr)| Some((var.as_variable()?, i));
        let mut program = Program {
            name: mpcc.name.clone(),
            numbers: flat
                .variables
                .iter()
                .enumerate()
                .filter_map(number)
                .collect(),
            names: mpcc.names(),
            bounds: mpcc.bounds(),
            objective: Linear::default(),
            rows: Vec::new(),
        };
        let mut slacks = Vec::new();
        let mut known = FxHashMap::default();
        let mut taken = FxHashSet::default();
        let mut terms = Vec::new();
        for row in &flat.rows {
            // Rows of one place that differ in their component only have the same name.
            let count: &mut usize = known.entry(&row.name).or_default();
            *count += 1;
            let name = match *count {
                1 => row.name.clone(),
                n => format!("{}.{n}", row.name),
            };
            match row.value {
                Value::Objective(term) => terms.push(values.apply(&[term])[0]),
                Value::Equation(body) => {
                    let body = program.linear(values.apply(&[body])[0]);
                    let kind = RowKind::Between(0.0, 0.0);
                    program.rows.push(Row { name, body, kind });
                }
                Value::Inequality(lower, body, upper) => {
                    let body = program.linear(values.apply(&[body])[0]);
                    let kind = RowKind::Between(lower, upper);
                    program.rows.push(Row { name, body, kind });
                }
                // The format has no choices.
                Value::Conditional(_) => {}
                Value::Pair(a, b) => {
                    let [a, b] = [a, b].map(|member| values.apply(&[member])[0]);
                    let free = |member: Expr| {
                        let number = program.number(member)?;
                        let bounds = program.bounds[number];
                        let is_half_line = bounds.lower == 0.0 && bounds.upper == f64::INFINITY;
                        (is_half_line && !taken.contains(&number)).then_some(number)
                    };
                    let (body, variable) = match (free(b), free(a)) {
                        (Some(b), _) => (a, b),
                        (None, Some(a)) => (b, a),
                        (None, None) => {
                            let slack = mpcc.exprs.variable("slack");
                            let side = format!("side_{name}");
                            slacks.push((side.clone(), b - slack));
                            (a, program.declare(slack, side))
                        }
                    };
                    taken.insert(variable);
                    let body = program.linear(body);
                    let kind = RowKind::Complements(variable);
                    program.rows.push(Row { name, body, kind });
                }
            }
        }
        program.objective = program.linear(mpcc.exprs.sum(terms));
        for (name, definition) in slacks {
            let body = program.linear(definition);
            let kind = RowKind::Between(0.0, 0.0);
            program.rows.push(Row { name, body, kind });
        }
        program
    }

    /// A new variable in [0, ∞).
    fn declare(&mut self, slack: Expr<'e>, name: String) -> usize {
        let number = self.bounds.len();
        self.numbers
            .extend(slack.as_variable().map(|var| (var, number)));
        self.names.push(name);
        self.bounds.push(Bounds::between(0.0, f64::INFINITY, 0.0));
        number
    }

    /// The number of what is a variable.
    fn number(&self, expr: Expr) -> Option<usize> {
        self.numbers.get(&expr.as_variable()?).copied()
    }

    /// Takes an expression apart.
    fn linear(&self, expr: Expr<'e>) -> Linear<'e> {
        let mut parts = Linear::default();
        let mut stack = vec![(1.0, expr)];
        while let Some((scale, expr)) = stack.pop() {
            match expr.node() {
                Node::Constant(value) => parts.constant += scale * value,
                Node::Sum { constant, terms } => {
                    parts.constant += scale * constant;
                    stack.extend(terms.iter().rev().map(|&(c, term)| (scale * c, term)));
                }
                _ => match self.number(expr) {
                    Some(number) => *parts.linear.entry(number).or_default() += scale,
                    None => parts.nonlinear.push((scale, expr)),
                },
            }
        }
        parts
    }

    /// The numbers of the variables that are in nonlinear terms of these.
    fn nonlinear_in<'r>(&self, parts: impl Iterator<Item = &'r Linear<'e>>) -> FxHashSet<usize>
    where
        'e: 'r,
    {
        let terms = parts.flat_map(|part| part.nonlinear.iter().map(|&(_, term)| term));
        let terms: Vec<Expr> = terms.collect();
        let vars = variables_of(&terms).into_iter();
        vars.map(|var| self.numbers[&var]).collect()
    }
}
