//! Products of α that are variables of their own, by what they are made of.

use crate::expr::{Var, variables_of};
use crate::lowering::dcs::{Cause, Dcs};

/// z_value = Σ c Π z over monomials of at most two algebraic variables, counted from 0.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Product {
    /// The number of the product.
    pub value: usize,
    /// c, and what it is a factor of.
    terms: Vec<(f64, Vec<usize>)>,
}

impl Product {
    /// Its value for these z.
    pub fn at(&self, z: impl Fn(usize) -> f64) -> f64 {
        let term = |(c, factors): &(f64, Vec<usize>)| {
            factors.iter().fold(*c, |product, &i| product * z(i))
        };
        self.terms.iter().map(term).sum()
    }

    /// Its change where these z change by so much, to first order.
    pub fn change(&self, z: impl Fn(usize) -> f64, change: impl Fn(usize) -> f64) -> f64 {
        let term = |(c, factors): &(f64, Vec<usize>)| match factors[..] {
            [a] => c * change(a),
            [a, b] => c * (change(a) * z(b) + z(a) * change(b)),
            _ => 0.0,
        };
        self.terms.iter().map(term).sum()
    }
}

/// The products of a system, in order: one contains earlier ones only. A product with other variables is left out.
pub(crate) fn products(dcs: &Dcs) -> Vec<Product> {
    let place = |var: Var| (dcs.algebraics.iter()).position(|z| z.var.as_variable() == Some(var));
    let rows = dcs.rows.equations.iter().zip(&dcs.rows.origins.equations);
    let rows = rows.filter(|(_, origin)| matches!(origin.cause, Cause::Product(_)));
    let rows: Vec<_> = rows.map(|(&row, _)| row).collect();
    let first = dcs.algebraics.len() - rows.len();
    let product = |(number, &row): (usize, &crate::expr::Expr)| {
        let value = first + number;
        let vars = variables_of(&[row]).into_iter();
        let vars: Option<Vec<(Var, usize)>> = vars.map(|var| Some((var, place(var)?))).collect();
        let vars: Vec<(Var, usize)> = vars?.into_iter().filter(|v| v.1 != value).collect();
        // 0 = β - product, where β and all but these factors are zero.
        let at = |ones: &[Var]| -row.eval(&|var| f64::from(u8::from(ones.contains(&var))));
        let constant = at(&[]);
        let mut terms = vec![(constant, Vec::new())];
        for (number, &(a, i)) in vars.iter().enumerate() {
            terms.push((at(&[a]) - constant, vec![i]));
            for &(b, j) in &vars[..number] {
                terms.push((at(&[a, b]) - at(&[a]) - at(&[b]) + constant, vec![i, j]));
            }
        }
        terms.retain(|(c, _)| *c != 0.0);
        Some(Product { value, terms })
    };
    rows.iter().enumerate().filter_map(product).collect()
}
