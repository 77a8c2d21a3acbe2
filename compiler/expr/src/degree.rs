//! Degrees as polynomials, read off the form of an expression.
//!
//! deg Σ c_i e_i = max deg e_i and deg Π f_i^p_i = Σ p_i deg f_i. Terms of the highest degree may cancel, so what is
//! found is a bound. Every node is looked at once: the work grows with the number of nodes, whatever the degree.

use super::nodes::{Data, Id, Nodes};
use super::{Expr, Var};

impl Nodes {
    /// The degree of a node of which the children have the degrees `of`.
    fn degree(&self, id: Id, var: Var, of: impl Fn(Id) -> Option<u32>) -> Option<u32> {
        let is_free = |child: Id| of(child) == Some(0);
        match self.data(id) {
            Data::Constant(_) => Some(0),
            Data::Variable(other) => Some(u32::from(other == var)),
            Data::Sum { start, len, .. } => {
                let terms = self.terms(start, len).iter();
                terms
                    .map(|&(term, _)| of(term))
                    .try_fold(0, |most, degree| Some(most.max(degree?)))
            }
            Data::Product { start, len } => {
                let mut factors = self.factors(start, len).iter();
                factors.try_fold(0_u32, |sum, &(factor, power)| match of(factor)? {
                    0 => Some(sum),
                    degree => {
                        let power = u32::try_from(power).ok()?;
                        Some(sum.saturating_add(degree.saturating_mul(power)))
                    }
                })
            }
            Data::Unary(_, a) => is_free(a).then_some(0),
            Data::Binary(_, a, b) => (is_free(a) && is_free(b)).then_some(0),
        }
    }
}

impl Expr<'_> {
    /// A bound on the degree in a variable, as the form shows it; none where it is no polynomial in the variable.
    pub fn degree(self, var: Var) -> Option<u32> {
        let nodes = self.exprs.nodes();
        let order = nodes.below([self.id]);
        let mut degrees: Vec<Option<u32>> = Vec::with_capacity(order.len());
        for &id in &order {
            let of = |child: Id| degrees[order.partition_point(|&other| other < child)];
            let degree = nodes.degree(id, var, of);
            degrees.push(degree);
        }
        degrees.last().copied().flatten()
    }
}

#[cfg(test)]
mod tests {
    use crate::Exprs;

    #[test]
    fn degrees_are_read_off_the_form() {
        let e = Exprs::new();
        let (x, y) = (e.variable("x"), e.variable("y"));
        let var = x.as_variable().expect("a variable");
        assert_eq!((y.sin() + 2.0).degree(var), Some(0));
        assert_eq!((y.sin() * x - 3.0 * x).degree(var), Some(1));
        assert_eq!(((x + y).powi(3) * x + y).degree(var), Some(4));
        assert_eq!((y / (x + 1.0)).degree(var), None);
        assert_eq!((x.exp() + x).degree(var), None);
        assert_eq!(x.powf(y).degree(var), None);
    }

    #[test]
    fn high_degrees_cost_no_more_than_low_ones() {
        let e = Exprs::new();
        let x = e.variable("x");
        let var = x.as_variable().expect("a variable");
        let chain = (0..1000).fold(x, |p, _| p * (1.0 - p));
        assert_eq!(chain.degree(var), Some(u32::MAX));
    }
}
