//! Functions of time from data: in a step, each is one polynomial in the time since its start.
//!
//! r(t) = Σ_i c_ki (t - t_k)^i   in step k from t_k = (k - 1) T/N
//!
//! Its pieces begin where steps do, and T is known, unless there is one piece alone.

use super::block::{Builder, variable};
use super::{Grid, Problem};
use crate::expr::{Expr, Var};
use crate::lowering::dcs::Dcs;
use crate::source::table::{Fit, Table};

/// A function of time.
pub(crate) struct Polynomial<'e> {
    /// t_k and c_ki, formal arguments.
    start: Expr<'e>,
    coefficients: Vec<Expr<'e>>,
}

/// Pieces begin so close to the start of a step, as a share of its length.
const TOGETHER: f64 = 1e-9;

/// Formal arguments for all functions.
pub(crate) fn polynomials<'e>(dcs: &Dcs<'e>) -> Vec<Polynomial<'e>> {
    let polynomial = |table: &std::sync::Arc<Table>| Polynomial {
        start: dcs.exprs.variable("start"),
        coefficients: dcs.exprs.variables("c", table.n_coefficients()),
    };
    dcs.tables.iter().map(polynomial).collect()
}

/// Where a piece begins inside a step of a horizon that is known, or anywhere in one that is not.
pub fn inside(table: &Table, horizon: (f64, f64), steps: usize) -> Option<f64> {
    let (shortest, longest) = horizon;
    let step = longest / steps as f64;
    let mut t = 0.0;
    loop {
        t = table.piece(t).end;
        if t >= longest {
            return None;
        }
        let place = t / step;
        if shortest < longest || (place - place.round()).abs() > TOGETHER {
            return Some(t);
        }
    }
}

/// Whether what is continuous in other respects may jump with the data, where steps begin.
pub(crate) fn jumps(dcs: &Dcs, occurring: &[Var]) -> bool {
    let mut data = dcs.data.iter().zip(&dcs.tables);
    data.any(|(&var, table)| table.fit == Fit::Hold && occurring.contains(&variable(var)))
}

impl<'e> Problem<'_, 'e> {
    /// The functions in the time.
    pub(crate) fn functions(&self, time: Expr<'e>) -> Vec<(Var, Expr<'e>)> {
        let data = self.dcs.data.iter().zip(&self.data);
        let functions = data.map(|(&var, polynomial)| {
            let since = time - polynomial.start;
            let terms = (0..).zip(&polynomial.coefficients);
            let terms = terms.map(|(i, &c)| if i == 0 { c } else { c * since.powi(i) });
            (variable(var), self.dcs.exprs.sum(terms))
        });
        functions.collect()
    }

    /// The functions at an instant of the horizon, which is known.
    pub(crate) fn functions_at(&self, instant: f64) -> Vec<(Var, Expr<'e>)> {
        let data = self.dcs.data.iter().zip(&self.dcs.tables);
        let values = data.map(|(&var, table)| {
            let value = table.value(instant);
            (variable(var), self.dcs.exprs.constant(value))
        });
        values.collect()
    }

    /// Binds the polynomials at places of step `step`.
    pub(crate) fn with_data<const N: usize>(
        &self,
        mut block: Builder<N>,
        step: impl Fn([usize; N]) -> usize,
    ) -> Builder<N> {
        let Grid {
            start: from,
            horizon,
            steps,
        } = self.grid;
        let start = |place| from + horizon * (step(place) - 1) as f64 / steps as f64;
        for (polynomial, table) in self.data.iter().zip(&self.dcs.tables) {
            block = block.number(polynomial.start, start);
            for (i, &c) in polynomial.coefficients.iter().enumerate() {
                block = block.number(c, |place| {
                    // The piece of the middle is that of the step.
                    let middle = start(place) + 0.5 * horizon / steps as f64;
                    let around = table.piece(middle).around(start(place));
                    around.get(i).copied().unwrap_or(0.0)
                });
            }
        }
        block
    }
}
