//! Kinks as complementarity conditions.
//!
//! |a| = p + n             with  a = p - n,              0 <= p ⟂ n >= 0
//! min(a, b) = m           with  a = m + p,  b = m + n,  0 <= p ⟂ n >= 0
//! max(a, b) = m           with  a = m - p,  b = m - n,  0 <= p ⟂ n >= 0
//!
//! The new variables start at the values that they have where the others start.

use super::expression::{Id, Node, Nodes, Operator};
use super::segments::Contents;
use super::shape::apply;
use crate::tape::{Tape, Term};

/// What has been added to a file.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lifted {
    /// Lower bounds and initial values of the variables behind those of the file; none is bounded above.
    pub variables: Vec<(f64, f64)>,
    /// What is zero.
    pub equations: Vec<Id>,
    /// Variables that complement each other.
    pub pairs: Vec<(u32, u32)>,
}

/// Rewrites all kinks of a file.
pub(crate) fn lift(contents: &mut Contents) -> Lifted {
    let mut lifted = Lifted::default();
    let n_nodes = contents.nodes.nodes.len();
    let is_kink = |node: &Node| match node {
        Node::Operation { operator, .. } => operator.is_kink(),
        _ => false,
    };
    if !contents.nodes.nodes.iter().any(is_kink) {
        return lifted;
    }
    let values = values(contents);
    let n_variables = contents.header.n_variables;
    let nodes = &mut contents.nodes;
    for id in 0..n_nodes {
        let Node::Operation { operator, first, n } = nodes.nodes[id] else {
            continue;
        };
        if !operator.is_kink() {
            continue;
        }
        let operands = nodes.operands(first, n).to_vec();
        let mut lifter = Lifter {
            nodes,
            lifted: &mut lifted,
            n_variables,
        };
        let start = |operand: Id| values[operand as usize];
        let result = if operator == Operator::Absolute {
            lifter.absolute(operands[0], start(operands[0]))
        } else {
            let mut best = (operands[0], start(operands[0]));
            for &operand in &operands[1..] {
                best = lifter.extremum(operator, best, (operand, start(operand)));
            }
            best.0
        };
        nodes.nodes[id] = nodes.nodes[result as usize];
    }
    lifted
}

/// The values of all expressions where the variables start.
fn values(contents: &Contents) -> Vec<f64> {
    let nodes = &contents.nodes;
    let mut values: Vec<f64> = Vec::with_capacity(nodes.nodes.len());
    let mut b = Tape::builder(0);
    for node in &nodes.nodes {
        let value = match *node {
            Node::Number(number) => number,
            Node::Variable(variable) => contents.start[variable as usize],
            Node::Defined(number) => {
                let function = &contents.defined[number as usize];
                let nonlinear = function.nonlinear.map_or(0.0, |id| values[id as usize]);
                let terms = function.linear.iter();
                let terms =
                    terms.map(|&(variable, factor)| factor * contents.start[variable as usize]);
                nonlinear + terms.sum::<f64>()
            }
            Node::Operation { operator, first, n } => {
                let operands = nodes.operands(first, n).iter();
                let operands = operands.map(|&id| values[id as usize]);
                match operator {
                    Operator::Absolute => operands.map(f64::abs).sum(),
                    Operator::Minimum => operands.fold(f64::INFINITY, f64::min),
                    Operator::Maximum => operands.fold(f64::NEG_INFINITY, f64::max),
                    _ => {
                        let operands: Vec<Term> = operands.map(Term::Number).collect();
                        match apply(operator, &operands, &mut b) {
                            Term::Number(number) => number,
                            Term::Multiple(..) => unreachable!("numbers have numbers as results"),
                        }
                    }
                }
            }
        };
        values.push(value);
    }
    values
}

struct Lifter<'n> {
    nodes: &'n mut Nodes,
    lifted: &'n mut Lifted,
    n_variables: usize,
}

impl Lifter<'_> {
    /// A new variable, as its number and its node.
    fn variable(&mut self, lower: f64, start: f64) -> (u32, Id) {
        let start = if start.is_finite() { start } else { 0.0 };
        let number = (self.n_variables + self.lifted.variables.len()) as u32;
        self.lifted.variables.push((lower, start));
        (number, self.nodes.push(Node::Variable(number)))
    }

    /// p ⟂ n for a difference p - n that starts at this value.
    fn parts(&mut self, difference: f64) -> (Id, Id) {
        let (p, positive) = self.variable(0.0, difference.max(0.0));
        let (n, negative) = self.variable(0.0, (-difference).max(0.0));
        self.lifted.pairs.push((p, n));
        (positive, negative)
    }

    fn zero(&mut self, left: Id, right: Id) {
        let equation = self.nodes.operation(Operator::Subtract, &[left, right]);
        self.lifted.equations.push(equation);
    }

    fn absolute(&mut self, a: Id, start: f64) -> Id {
        // The node of the kink is overwritten with the result; its operand stays where it is.
        let (p, n) = self.parts(start);
        let difference = self.nodes.operation(Operator::Subtract, &[p, n]);
        self.zero(a, difference);
        self.nodes.operation(Operator::Add, &[p, n])
    }

    fn extremum(&mut self, operator: Operator, a: (Id, f64), b: (Id, f64)) -> (Id, f64) {
        let (sign, start, difference) = match operator {
            Operator::Minimum => (Operator::Add, a.1.min(b.1), a.1 - b.1),
            _ => (Operator::Subtract, a.1.max(b.1), b.1 - a.1),
        };
        let (_, m) = self.variable(f64::NEG_INFINITY, start);
        let (p, n) = self.parts(difference);
        for (operand, part) in [(a.0, p), (b.0, n)] {
            let sum = self.nodes.operation(sign, &[m, part]);
            self.zero(operand, sum);
        }
        (m, start)
    }
}
