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

    /// A bound on how far rounding takes the value from that of exact arithmetic: each operation passes on the errors of
    /// its operands and adds one rounding of its result (Higham 2002, section 3.3). Numbers have been rounded, too.
    pub fn running_error(&self, value: &impl Fn(Var) -> f64) -> f64 {
        self.eval(value);
        let arena = self.expr.exprs.arena.borrow();
        let values = self.values.borrow();
        let mut errors: Vec<f64> = Vec::with_capacity(values.len());
        let mut children = self.children.iter();
        for (&id, &result) in self.nodes.iter().zip(values.iter()) {
            let mut next = || {
                let place = children.next().map_or(0, |&place| place);
                [values[place], errors[place]]
            };
            let passed = match arena.data(id) {
                Data::Constant(_) | Data::Variable(_) => 0.0,
                Data::Sum {
                    constant,
                    start,
                    len,
                } => (arena.terms(start, len).iter()).fold(
                    f64::EPSILON * constant.abs(),
                    |total, &(_, c)| {
                        let [value, error] = next();
                        total + c.abs() * (error + f64::EPSILON * value.abs())
                    },
                ),
                Data::Product { start, len } => {
                    let largest =
                        (arena.factors(start, len).iter()).fold(1.0, |total, &(_, power)| {
                            let [value, error] = next();
                            let error = if power > 0 { error } else { -error };
                            total * (value.abs() + error).max(0.0).powi(power)
                        });
                    largest - result.abs()
                }
                Data::Unary(function, _) => {
                    let [value, error] = next();
                    let at = |sign: f64| function.value(value + sign * error);
                    [-1.0, 1.0]
                        .map(|sign| (at(sign) - result).abs())
                        .iter()
                        .sum()
                }
                Data::Binary(function, ..) => {
                    let ([a, a_error], [b, b_error]) = (next(), next());
                    let by_a = [-a_error, a_error].map(|error| function.value(a + error, b));
                    let by_b = [-b_error, b_error].map(|error| function.value(a, b + error));
                    (by_a.iter().chain(&by_b))
                        .map(|moved| (moved - result).abs())
                        .sum()
                }
            };
            errors.push(passed + f64::EPSILON * result.abs());
        }
        errors.last().copied().unwrap_or(f64::NAN)
    }
}

impl Expr<'_> {
    /// The value. At 0, `sign` is 0 and `step` is 1/2.
    pub fn eval(self, value: &impl Fn(Var) -> f64) -> f64 {
        Evaluator::new(self).eval(value)
    }
}

#[cfg(test)]
mod tests {
    use super::Evaluator;
    use crate::Exprs;

    #[test]
    fn what_cancels_is_no_larger_than_its_running_error() {
        let e = Exprs::new();
        let (x, y) = (e.variable("x"), e.variable("y"));
        let identities = [
            x.sin().powi(2) + x.cos().powi(2) - 1.0,
            ((x + y).powi(3) - (x.powi(3) + 3.0 * x.powi(2) * y + 3.0 * x * y.powi(2) + y.powi(3)))
                / (1.0 + y.powi(2)),
            x.exp().log() - x,
            (x * y).abs() - x.abs() * y.abs(),
            y.max(x) + y.min(x) - x - y,
        ];
        let mut largest: f64 = 0.0;
        for k in 0..400 {
            let at = |var| match var == x.as_variable().unwrap() {
                true => 0.1 + 0.017 * f64::from(k),
                false => 3.0 - 0.023 * f64::from(k),
            };
            for identity in identities {
                let evaluator = Evaluator::new(identity);
                let (value, error) = (evaluator.eval(&at), evaluator.running_error(&at));
                assert!(value.abs() <= error, "{identity}: {value:e}, {error:e}");
                assert!(error <= 1e-11, "{identity}: {error:e}");
                largest = largest.max(value.abs());
            }
        }
        assert!(largest > 0.0);
    }
}
