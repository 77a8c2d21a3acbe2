//! Data as the simulator sees it: polynomials in time whose coefficients change from piece to piece.
//!
//! r = c_0 + s (c_1 + s (c_2 + s c_3)), s = t - q: the coefficients and q, where the piece begins, are numbers
//! that change at breakpoints.

use std::cell::RefCell;
use std::sync::Arc;

use crate::expr::{Expr, Substitution, Var};
use crate::system::System;
use crate::table::Table;

/// All data of a system, and where its coefficients stand among those of all.
#[derive(Clone)]
pub(super) struct Pieces {
    tables: RefCell<Vec<Arc<Table>>>,
    n_coefficients: usize,
}

impl Pieces {
    /// The data, with its coefficients as variables in order, and what takes the place of each.
    pub fn new<'e>(system: &System<'e>) -> (Self, Vec<Var>, Substitution<'e>) {
        let (mut coefficients, mut polynomials) = (Vec::new(), Substitution::new());
        let mut coefficient = |name: &str| -> Expr<'e> {
            let c = system.exprs.variable(name);
            coefficients.extend(c.as_variable());
            c
        };
        for data in &system.data {
            let begin = coefficient("begin");
            let c: Vec<Expr<'e>> = (0..data.table.n_coefficients())
                .map(|_| coefficient("c"))
                .collect();
            let s = system.time - begin;
            let value = c.iter().rev().copied().reduce(|sum, c| c + s * sum);
            if let (Some(var), Some(value)) = (data.var.as_variable(), value) {
                polynomials.insert(var, value);
            }
        }
        let tables = system.data.iter().map(|data| data.table.clone());
        let pieces = Pieces {
            tables: RefCell::new(tables.collect()),
            n_coefficients: coefficients.len(),
        };
        (pieces, coefficients, polynomials)
    }

    /// The number of coefficients, places where pieces begin among them.
    pub fn n_coefficients(&self) -> usize {
        self.n_coefficients
    }

    /// Gives the data from number `first` on other values, of the same fits.
    pub fn replace(&self, first: usize, tables: &[Arc<Table>]) {
        let mut known = self.tables.borrow_mut();
        known[first..first + tables.len()].clone_from_slice(tables);
    }

    /// Writes the coefficients that hold from `t` on; the next breakpoint.
    pub fn write(&self, t: f64, coefficients: &mut [f64]) -> f64 {
        let mut places = coefficients.iter_mut();
        let tables = self.tables.borrow();
        let ends = tables.iter().map(|table| {
            let piece = table.piece(t);
            let numbers = [piece.start]
                .into_iter()
                .chain(piece.coefficients.iter().copied());
            for (number, place) in numbers.zip(places.by_ref()) {
                *place = number;
            }
            piece.end
        });
        ends.fold(f64::INFINITY, f64::min)
    }
}
