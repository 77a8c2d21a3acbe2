//! Functions of time from data: in a step, each is one polynomial in time.
//!
//! r(t) = Σ_i c_ki (t - t_k)^i   in step k, t_k = (k - 1) T/N
//!
//! Its pieces begin where steps do, at t_k, and T is known, unless there is one piece alone: that is the same polynomial
//! around every t_k, wherever steps of other lengths begin.

use super::block::{Builder, variable};
use crate::expr::{Expr, Var};
use crate::lowering::dcs;
use crate::lowering::dcs::Dcs;
use crate::lowering::discretize::Grid;
use crate::source::table::Table;

/// A function of time.
struct Function<'p, 'e> {
    /// r.
    data: &'p dcs::Data<'e>,
    /// t_k and c_ki, formal arguments.
    start: Expr<'e>,
    coefficients: Vec<Expr<'e>>,
}

/// All functions of a system.
pub(crate) struct Data<'p, 'e> {
    functions: Vec<Function<'p, 'e>>,
    grid: Grid,
}

/// Pieces begin so close to the start of a step, as a share of its length.
const TOGETHER: f64 = 1e-9;

/// Where the step begins that an instant begins, of so many in a horizon; none where it is inside of one.
pub fn beginning(t: f64, horizon: f64, steps: usize) -> Option<f64> {
    let place = t / horizon * steps as f64;
    let k = place.round();
    ((place - k).abs() <= TOGETHER).then(|| horizon * k / steps as f64)
}

/// Where pieces end before an instant.
pub fn ends(table: &Table, before: f64) -> impl Iterator<Item = f64> {
    let next = move |t: f64| Some(table.piece(t).end).filter(|&end| end < before);
    std::iter::successors(next(0.0), move |&t| next(t))
}

/// Where a piece begins inside a step of a horizon that is known, or anywhere in one that is not.
pub fn inside(table: &Table, horizon: (f64, f64), steps: usize) -> Option<f64> {
    let (shortest, longest) = horizon;
    let mut ends = ends(table, longest);
    ends.find(|&t| shortest < longest || beginning(t, longest, steps).is_none())
}

impl<'p, 'e> Data<'p, 'e> {
    /// With formal arguments for all functions.
    pub fn of(dcs: &'p Dcs<'e>, grid: Grid) -> Self {
        let function = |data: &'p dcs::Data<'e>| Function {
            data,
            start: dcs.exprs.variable("start"),
            coefficients: dcs.exprs.variables("c", data.table.n_coefficients()),
        };
        Data {
            functions: dcs.data.iter().map(function).collect(),
            grid,
        }
    }

    /// The functions in the time.
    pub fn at(&self, time: Expr<'e>) -> impl Iterator<Item = (Var, Expr<'e>)> {
        self.functions.iter().map(move |function| {
            let around = polynomial(&function.coefficients, time - function.start);
            (variable(function.data.var), around)
        })
    }

    /// The functions at an end of the horizon: the pieces of the step that begins or ends there.
    pub fn at_end_of(&self, step: usize, time: Expr<'e>) -> impl Iterator<Item = (Var, Expr<'e>)> {
        let number = move |value| time.exprs().constant(value);
        let since = time - number(self.grid.start_of(step));
        self.functions.iter().map(move |function| {
            let around = self.piece(function, step).into_iter().map(number);
            let around = polynomial(&around.collect::<Vec<_>>(), since);
            (variable(function.data.var), around)
        })
    }

    /// The polynomial of a step around its start: the piece of its middle.
    fn piece(&self, function: &Function<'p, 'e>, step: usize) -> Vec<f64> {
        let piece = function.data.table.piece(self.grid.middle_of(step));
        piece.around(self.grid.start_of(step))
    }

    /// Binds the polynomials at places of step `step`.
    pub fn bind<const N: usize>(
        &self,
        mut block: Builder<N>,
        step: impl Fn([usize; N]) -> usize,
    ) -> Builder<N> {
        for function in &self.functions {
            block = block.number(function.start, |place| self.grid.start_of(step(place)));
            for (i, &c) in function.coefficients.iter().enumerate() {
                block = block.number(c, |place| {
                    let around = self.piece(function, step(place));
                    around.get(i).copied().unwrap_or(0.0)
                });
            }
        }
        block
    }
}

/// Σ_i c_i sⁱ.
fn polynomial<'e>(c: &[Expr<'e>], s: Expr<'e>) -> Expr<'e> {
    let terms = (0..).zip(c);
    let terms = terms.map(|(i, &c)| if i == 0 { c } else { c * s.powi(i) });
    s.exprs().sum(terms)
}
