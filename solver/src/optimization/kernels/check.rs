//! What every [`Program`] satisfies: places are among variables, rows, entries and parameters.

use super::Program;
use crate::hybrid::check::{Fault, must};
use crate::optimization::problem::{HeldStructure, Intervals, Side};

impl Program {
    /// How many parameters its functions need at least.
    pub fn n_parameters(&self) -> usize {
        let terms = self.terms.iter().map(|term| &term.block);
        let blocks = self.blocks.iter().chain(terms);
        blocks.map(|block| block.n_parameters()).max().unwrap_or(0)
    }

    /// The number of terms of the objective.
    pub fn n_terms(&self) -> usize {
        self.terms.len()
    }

    /// Checks that it is one.
    ///
    /// # Errors
    ///
    /// What refers to something that is not there, or does not fit.
    pub fn check(&self) -> Result<(), Fault> {
        let HeldStructure {
            variables,
            rows,
            start,
            jacobian,
            hessian,
        } = &self.structure;
        let (n, m) = (start.len(), rows.lower.len());
        let are_bounds =
            |bounds: &Intervals, n: usize| bounds.lower.len() == n && bounds.upper.len() == n;
        must(
            are_bounds(variables, n) && are_bounds(rows, m),
            "every variable and every row has its bounds",
        )?;
        must(
            jacobian.is_of(m, n) && hessian.is_of(n, n),
            "patterns have rows of ascending columns",
        )?;
        let [slopes, curvatures] = [jacobian, hessian].map(|pattern| pattern.n_entries());
        must(
            self.constant_slopes.len() == slopes && self.constant_gradient.len() == n,
            "every entry has its constant part",
        )?;
        let mut sides = self.pairs.iter().flat_map(|pair| [pair.a, pair.b]);
        let is_side = |side: Side| match side {
            Side::Variable(i) => variables
                .lower
                .get(i as usize)
                .is_some_and(|l| l.is_finite()),
            Side::Row(i) => {
                let bounds = rows.lower.get(i as usize).zip(rows.upper.get(i as usize));
                bounds.is_some_and(|(l, u)| l.is_finite() && *u == f64::INFINITY)
            }
        };
        must(
            sides.all(is_side),
            "sides of pairs have lower bounds, and rows no upper one",
        )?;
        let mut blocks = self.blocks.iter();
        let of_rows =
            blocks.all(|block| block.has_rows_among(m) && block.fits(n, [slopes, curvatures]));
        let mut terms = self.terms.iter();
        let of_terms = terms.all(|term| {
            let mut variables = term.constant.iter().map(|&(variable, _)| variable as usize);
            term.block.fits(n, [n, curvatures]) && variables.all(|variable| variable < n)
        });
        must(
            of_rows && of_terms,
            "functions have their inputs, and places for their values",
        )
    }
}

crate::checked_when_read!(Program);
