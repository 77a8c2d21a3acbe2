//! Symbolic derivatives.
//!
//! A kink has the derivative of its sides: `abs' = sign`, `sign' = step' = 0`.

use rustc_hash::FxHashMap;

use super::arena::Id;
use super::{BinaryFunction, Expr, Function, Node, Var};

impl<'e> Expr<'e> {
    /// `∂self / ∂var`.
    pub fn diff(self, var: Var) -> Expr<'e> {
        let (order, variable) = {
            let arena = self.exprs.arena.borrow();
            (arena.below([self.id]), arena.variable(var))
        };
        // Nodes that do not depend on the variable are absent.
        let mut derivatives: FxHashMap<Id, Expr<'e>> = FxHashMap::default();
        for id in order {
            if id == variable {
                derivatives.insert(id, self.exprs.constant(1.0));
                continue;
            }
            let partials = self
                .with(id)
                .partials(&|child| derivatives.contains_key(&child.id));
            let terms: Vec<_> = (partials.into_iter())
                .map(|(child, partial)| partial * derivatives[&child.id])
                .collect();
            if !terms.is_empty() {
                derivatives.insert(id, self.exprs.sum(terms));
            }
        }
        derivatives
            .get(&self.id)
            .copied()
            .unwrap_or(self.exprs.constant(0.0))
    }

    /// The wanted children with the derivatives by them.
    fn partials(self, wanted: &impl Fn(Expr<'e>) -> bool) -> Vec<(Expr<'e>, Expr<'e>)> {
        let mut partials = match self.node() {
            Node::Constant(_) | Node::Variable(_) => Vec::new(),
            Node::Sum { terms, .. } => terms
                .into_iter()
                .map(|(c, term)| (term, self.exprs.constant(c)))
                .collect(),
            Node::Product(factors) => (factors.iter().enumerate())
                .filter(|(_, (factor, _))| wanted(*factor))
                .map(|(i, &(factor, _))| (factor, self.product_partial(&factors, i)))
                .collect(),
            Node::Unary(function, a) => vec![(a, self.unary_partial(function, a))],
            Node::Binary(function, a, b) => {
                let (by_a, by_b) = self.binary_partials(function, a, b);
                vec![(a, by_a), (b, by_b)]
            }
        };
        partials.retain(|(child, _)| wanted(*child));
        partials
    }

    /// `p f^(p-1)` times the other factors.
    fn product_partial(self, factors: &[(Expr<'e>, i32)], which: usize) -> Expr<'e> {
        let power = |(i, &(factor, p)): (usize, &(Expr<'e>, i32))| {
            (factor.id, if i == which { p.saturating_sub(1) } else { p })
        };
        self.exprs.build(|arena| {
            arena.product(
                f64::from(factors[which].1),
                factors.iter().enumerate().map(power),
            )
        })
    }

    fn unary_partial(self, function: Function, a: Expr<'e>) -> Expr<'e> {
        match function {
            Function::Sqrt => 0.5 / self,
            Function::Exp => self,
            Function::Log => 1.0 / a,
            Function::Sin => a.cos(),
            Function::Cos => -a.sin(),
            Function::Tan => 1.0 + self * self,
            Function::Asin => 1.0 / (1.0 - a * a).sqrt(),
            Function::Acos => -1.0 / (1.0 - a * a).sqrt(),
            Function::Atan => 1.0 / (1.0 + a * a),
            Function::Sinh => a.cosh(),
            Function::Cosh => a.sinh(),
            Function::Tanh => 1.0 - self * self,
            Function::Step | Function::Sign => self.exprs.constant(0.0),
            Function::Abs => a.sign(),
        }
    }

    fn binary_partials(
        self,
        function: BinaryFunction,
        a: Expr<'e>,
        b: Expr<'e>,
    ) -> (Expr<'e>, Expr<'e>) {
        match function {
            BinaryFunction::Pow => (b * a.powf(b - 1.0), self * a.log()),
            BinaryFunction::Atan2 => {
                let square = a * a + b * b;
                (b / square, -a / square)
            }
            BinaryFunction::Min => ((b - a).step(), (a - b).step()),
            BinaryFunction::Max => ((a - b).step(), (b - a).step()),
        }
    }
}
