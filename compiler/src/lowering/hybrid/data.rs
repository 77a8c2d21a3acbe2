//! Data as polynomials in time whose coefficients are inputs of functions.
//!
//! r = c_0 + s (c_1 + s (c_2 + s c_3)), s = t - q: the coefficients and q, where the piece begins, are numbers
//! that change at breakpoints.

use crate::expr::{Expr, Substitution, Var};
use crate::system::System;

/// All data of a system.
pub(crate) struct Polynomials<'e> {
    /// For each in turn, where the piece begins and its coefficients.
    pub coefficients: Vec<Var>,
    /// What takes the place of each.
    pub instead: Substitution<'e>,
}

impl<'e> Polynomials<'e> {
    /// The data of a system, with new variables.
    pub fn of(system: &System<'e>) -> Self {
        let (mut coefficients, mut instead) = (Vec::new(), Substitution::new());
        let mut coefficient = |name: &str| -> Expr<'e> {
            let c = system.exprs.variable(name);
            coefficients.extend(c.as_variable());
            c
        };
        for data in &system.exogenous.data {
            let begin = coefficient("begin");
            let c: Vec<Expr<'e>> = (0..data.table.n_coefficients())
                .map(|_| coefficient("c"))
                .collect();
            let s = system.time - begin;
            let value = c.iter().rev().copied().reduce(|sum, c| c + s * sum);
            if let (Some(var), Some(value)) = (data.var.as_variable(), value) {
                instead.insert(var, value);
            }
        }
        Polynomials {
            coefficients,
            instead,
        }
    }
}
