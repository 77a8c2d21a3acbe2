//! Values of expressions, also of those that are not smooth.

use std::cell::RefCell;

use super::arena::{Data, Id};
use super::{Expr, Var};

/// An expression to be evaluated at many points: what is below it is listed once.
#[derive(Clone, Debug)]
pub struct Evaluator<'e> {
    expr: Expr<'e>,
    /// The nodes below, children before parents, the expression itself last.
    nodes: Vec<Id>,
    /// The places among the nodes of all children of all nodes, in order.
    children: Vec<usize>,
    /// The values of the nodes.
    values: RefCell<Vec<f64>>,
}

impl<'e> Evaluator<'e> {
    /// Lists what is below an expression.
    pub fn new(expr: Expr<'e>) -> Self {
        let arena = expr.exprs.arena.borrow();
        let nodes = arena.below([expr.id]);
        let mut children = Vec::new();
        for &id in &nodes {
            arena.for_each_child(id, |child| {
                // Nodes are in order of their numbers, and all children are among them.
                children.push(nodes.partition_point(|&node| node < child));
            });
        }
        Evaluator {
            expr,
            values: RefCell::new(Vec::with_capacity(nodes.len())),
            nodes,
            children,
        }
    }

    /// The value. At 0, `sign` is 0 and `step` is 1/2.
    pub fn eval(&self, value: &impl Fn(Var) -> f64) -> f64 {
        let arena = self.expr.exprs.arena.borrow();
        let mut values = self.values.borrow_mut();
        values.clear();
        let mut children = self.children.iter();
        for &id in &self.nodes {
            let mut next = || children.next().map_or(f64::NAN, |&place| values[place]);
            let result = match arena.data(id) {
                Data::Constant(number) => number,
                Data::Variable(var) => value(var),
                Data::Sum {
                    constant,
                    start,
                    len,
                } => (arena.terms(start, len).iter())
                    .fold(constant, |total, &(_, c)| total + c * next()),
                Data::Product { start, len } => (arena.factors(start, len).iter())
                    .fold(1.0, |total, &(_, power)| total * next().powi(power)),
                Data::Unary(function, _) => function.value(next()),
                Data::Binary(function, ..) => {
                    let (a, b) = (next(), next());
                    function.value(a, b)
                }
            };
            values.push(result);
        }
        values.last().copied().unwrap_or(f64::NAN)
    }
}

impl Expr<'_> {
    /// The value. At 0, `sign` is 0 and `step` is 1/2.
    pub fn eval(self, value: &impl Fn(Var) -> f64) -> f64 {
        Evaluator::new(self).eval(value)
    }
}
