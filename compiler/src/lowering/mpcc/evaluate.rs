//! Values and first derivatives of all rows, terms of the objective and members of pairs among them.

use nsd_solver::optimization::kernels;
use nsd_solver::optimization::problem::{Nlp, Pattern};

use super::{Block, Mpcc};
use crate::expr::{CompileError, Expr, Var, compile, variables_of};

/// Evaluates the rows of an [`Mpcc`]; memory is kept from one point to the next.
#[derive(Clone, Debug)]
pub struct Evaluator {
    rows: kernels::Program,
}

impl Evaluator {
    /// Compiles all kernels.
    pub fn new(mpcc: &Mpcc) -> Result<Self, CompileError> {
        Evaluator::of(mpcc, &mpcc.blocks)
    }

    /// Compiles those of some blocks.
    pub(super) fn of(mpcc: &Mpcc, blocks: &[Block]) -> Result<Self, CompileError> {
        let n = mpcc.n_variables();
        let free = (vec![f64::NEG_INFINITY; n], vec![f64::INFINITY; n]);
        let mut rows = kernels::Program::builder(&free.0, &free.1, &vec![0.0; n]);
        rows.parameters(&mpcc.parameters());
        for block in blocks {
            let zeros = vec![0.0; block.n_rows()];
            rows.rows(mpcc.kernel(block, &block.kernel.outputs)?, &zeros, &zeros);
        }
        let rows = rows.finish();
        Ok(Evaluator { rows })
    }

    /// The pattern of the Jacobian.
    pub fn pattern(&self) -> &Pattern {
        self.rows.jacobian_pattern()
    }

    /// The values of all rows at w.
    pub fn values(&mut self, w: &[f64], rows: &mut [f64]) {
        self.rows.rows(w, rows);
    }

    /// The entries of the Jacobian at w, in the order of [`Evaluator::pattern`].
    pub fn jacobian(&mut self, w: &[f64], entries: &mut [f64]) {
        self.rows.jacobian(w, entries);
    }
}

impl Mpcc<'_> {
    /// The values of the parameters.
    pub(crate) fn parameters(&self) -> Vec<f64> {
        self.params.iter().map(|param| param.value).collect()
    }

    /// The sum of all rows of some blocks.
    pub fn sum(&self, blocks: &[Block], w: &[f64]) -> Result<f64, CompileError> {
        let mut values = vec![0.0; blocks.iter().map(Block::n_rows).sum()];
        Evaluator::of(self, blocks)?.values(w, &mut values);
        Ok(values.iter().sum())
    }

    /// Some outputs of a block at all its places, compiled.
    pub(crate) fn kernel(
        &self,
        block: &Block,
        outputs: &[Expr],
    ) -> Result<kernels::Block, CompileError> {
        let kernel = &block.kernel;
        let occurring = variables_of(outputs);
        let params = (self.params.iter().zip(0..))
            .filter_map(|(param, place)| Some((param.var.as_variable()?, place)))
            .filter(|(var, _)| occurring.binary_search(var).is_ok());
        let (params, parameters): (Vec<Var>, Vec<u32>) = params.unzip();
        let n = block.n_places();
        let (variables, arguments) = among(&occurring, &kernel.variables, &block.arguments, n);
        let (numbers, values) = among(&occurring, &kernel.numbers, &block.numbers, n);
        let formals: Vec<Var> = [variables, numbers, params].concat();
        Ok(kernels::Block {
            values: compile(&formals, outputs)?,
            n_places: n,
            variables: arguments,
            numbers: values,
            parameters,
        })
    }
}

/// The formal arguments that occur, and the actual ones of each at n places.
fn among<T: Copy>(
    occurring: &[Var],
    formals: &[Var],
    actual: &[T],
    n: usize,
) -> (Vec<Var>, Vec<T>) {
    let places = actual.chunks(n.max(1));
    let occurring =
        (formals.iter().zip(places)).filter(|(formal, _)| occurring.binary_search(formal).is_ok());
    let (formals, actual): (Vec<Var>, Vec<&[T]>) = occurring.unzip();
    (formals, actual.concat())
}
