//! Values of expressions, also of those that are not smooth.

use std::cell::RefCell;
use std::ops::{Add, Mul};

use super::nodes::{Data, Id};
use super::{BinaryFunction, Expr, Function, Interval, Var};

/// What an expression is evaluated in.
trait Number: Copy + Add<Output = Self> + Mul<Output = Self> {
    fn of(number: f64) -> Self;
    fn powi(self, power: i32) -> Self;
    fn unary(self, function: Function) -> Self;
    fn binary(self, function: BinaryFunction, other: Self) -> Self;
}

impl Number for f64 {
    fn of(number: f64) -> Self {
        number
    }

    fn powi(self, power: i32) -> Self {
        f64::powi(self, power)
    }

    fn unary(self, function: Function) -> Self {
        function.value(self)
    }

    fn binary(self, function: BinaryFunction, other: Self) -> Self {
        function.value(self, other)
    }
}

impl Number for Interval {
    fn of(number: f64) -> Self {
        Interval::rounded(number)
    }

    fn powi(self, power: i32) -> Self {
        Interval::powi(self, power)
    }

    fn unary(self, function: Function) -> Self {
        Interval::unary(self, function)
    }

    fn binary(self, function: BinaryFunction, other: Self) -> Self {
        Interval::binary(self, function, other)
    }
}

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
        let arena = expr.exprs.nodes();
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
        let mut values = self.values.borrow_mut();
        self.run(value, &mut values);
        values.last().copied().unwrap_or(f64::NAN)
    }

    /// An enclosure of the values where variables are within intervals: every number where a part of the expression
    /// has no bound, as next to a pole.
    pub fn enclose(&self, within: &impl Fn(Var) -> Interval) -> Interval {
        let mut values = Vec::with_capacity(self.nodes.len());
        self.run(within, &mut values);
        match values.iter().all(|value| value.magnitude().is_finite()) {
            true => values.last().copied().unwrap_or(Interval::ALL),
            false => Interval::ALL,
        }
    }

    fn run<N: Number>(&self, value: &impl Fn(Var) -> N, values: &mut Vec<N>) {
        let arena = self.expr.exprs.nodes();
        values.clear();
        let mut children = self.children.iter();
        for &id in &self.nodes {
            let mut next = || values[*children.next().expect("every child has a place")];
            let result = match arena.data(id) {
                Data::Constant(number) => N::of(number),
                Data::Variable(var) => value(var),
                Data::Sum {
                    constant,
                    start,
                    len,
                } => (arena.terms(start, len).iter())
                    .fold(N::of(constant), |total, &(_, c)| total + N::of(c) * next()),
                Data::Product { start, len } => (arena.factors(start, len).iter())
                    .fold(N::of(1.0), |total, &(_, power)| total * next().powi(power)),
                Data::Unary(function, _) => next().unary(function),
                Data::Binary(function, ..) => {
                    let (a, b) = (next(), next());
                    a.binary(function, b)
                }
            };
            values.push(result);
        }
    }

    /// A bound on how far rounding takes the value from that of exact arithmetic: each operation passes on the errors of
    /// its operands and adds one rounding of its result (Higham 2002, section 3.3). Numbers have been rounded, too.
    pub fn running_error(&self, value: &impl Fn(Var) -> f64) -> f64 {
        self.eval(value);
        let arena = self.expr.exprs.nodes();
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
    use crate::{Exprs, Interval};

    #[test]
    fn enclosures_hold_values_and_have_no_bound_at_poles() {
        let e = Exprs::new();
        let x = e.variable("x");
        let function = x.sin() * x + x.powi(3) / (1.0 + x.powi(2)) - x.max(e.constant(1.5)).floor();
        let evaluator = Evaluator::new(function);
        for k in 0..50 {
            let low = -3.0 + 0.12 * f64::from(k);
            let within = evaluator.enclose(&|_| Interval::new(low, low + 0.25));
            for share in 0..=10 {
                let value = evaluator.eval(&|_| low + 0.025 * f64::from(share));
                assert!(within.contains(value), "{low} {share}: {value} {within:?}");
            }
            assert!(within.width() < 3.0, "{low}: {within:?}");
        }
        for pole in [x.tan(), (1.0 / (x - 1.5)).atan(), (x - 1.5).log()] {
            let within = Evaluator::new(pole).enclose(&|_| Interval::new(1.4, 1.6));
            assert_eq!(within, Interval::ALL, "{pole}");
        }
    }

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
