//! Values and first derivatives of all rows.
//!
//! Each kernel is compiled once, with its derivatives by its arguments, and evaluated at eight places at a time. The
//! pattern of the Jacobian is found once; a variable that is two arguments of a row has one entry, their sum.

use std::ops::Range;

use nsd_solver::tape::{LaneScratch, Tape};

use super::{Block, Mpcc};
use crate::expr::{CompileError, Expr, Var, compile, jacobian, variables_of};

/// Evaluates the rows of an [`Mpcc`]; memory is kept from one point to the next.
#[derive(Clone, Debug)]
pub struct Evaluator {
    blocks: Vec<Compiled>,
    pattern: Pattern,
}

/// The entries of the Jacobian that are not structurally zero, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    /// Where the entries of a row start; one more than there are rows.
    pub starts: Vec<usize>,
    /// The variables of the entries, ascending within a row.
    pub columns: Vec<u32>,
}

/// The functions of one block.
#[derive(Clone, Debug)]
struct Compiled {
    n_places: usize,
    rows: Range<usize>,
    /// Indices of the variables that are the first inputs.
    gather: Vec<u32>,
    /// Inputs of both tapes; those behind the variables never change.
    inputs: Vec<f64>,
    values: (Tape, LaneScratch),
    slopes: (Tape, LaneScratch),
    /// The outputs of `slopes`, and the entry of the Jacobian that each is added to.
    terms: Vec<f64>,
    scatter: Vec<u32>,
}

impl Evaluator {
    /// Compiles all kernels.
    pub fn new(mpcc: &Mpcc) -> Result<Self, CompileError> {
        let mut blocks = Vec::with_capacity(mpcc.blocks.len());
        let mut entries = Vec::with_capacity(mpcc.blocks.len());
        for (block, rows) in mpcc.rows() {
            let (compiled, found) = Compiled::new(mpcc, block, rows)?;
            blocks.push(compiled);
            entries.push(found);
        }
        let pattern = Pattern::new(mpcc.n_rows(), &entries);
        for (block, entries) in blocks.iter_mut().zip(entries) {
            let places = entries.into_iter();
            block.scatter = places.map(|entry| pattern.place(entry)).collect();
        }
        Ok(Evaluator { blocks, pattern })
    }

    /// The pattern of the Jacobian.
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// The values of all rows at w.
    pub fn values(&mut self, w: &[f64], rows: &mut [f64]) {
        for block in &mut self.blocks {
            block.gather(w);
            let (tape, scratch) = &mut block.values;
            let rows = &mut rows[block.rows.clone()];
            tape.eval_many(&block.inputs, rows, block.n_places, scratch);
        }
    }

    /// The entries of the Jacobian at w, in the order of [`Evaluator::pattern`].
    pub fn jacobian(&mut self, w: &[f64], entries: &mut [f64]) {
        entries.fill(0.0);
        for block in &mut self.blocks {
            block.gather(w);
            let (tape, scratch) = &mut block.slopes;
            tape.eval_many(&block.inputs, &mut block.terms, block.n_places, scratch);
            for (&term, &entry) in block.terms.iter().zip(&block.scatter) {
                entries[entry as usize] += term;
            }
        }
    }
}

/// Row and column of a derivative by an argument.
type Entry = (usize, u32);

impl Compiled {
    /// The functions of a block, and for each output of the slopes at each place its row and column.
    fn new(
        mpcc: &Mpcc,
        block: &Block,
        rows: Range<usize>,
    ) -> Result<(Self, Vec<Entry>), CompileError> {
        let (kernel, n) = (&block.kernel, block.n_places());
        let occurring = variables_of(&kernel.outputs);
        let params: Vec<(Var, f64)> = (mpcc.params.iter())
            .filter_map(|param| Some((param.var.as_variable()?, param.value)))
            .filter(|(var, _)| occurring.binary_search(var).is_ok())
            .collect();
        let formals = kernel.variables.iter().chain(&kernel.numbers);
        let formals: Vec<Var> = formals
            .copied()
            .chain(params.iter().map(|param| param.0))
            .collect();
        let constants = params.iter().flat_map(|&(_, value)| vec![value; n]);
        let inputs: Vec<f64> = (vec![0.0; block.arguments.len()].into_iter())
            .chain(block.numbers.iter().copied())
            .chain(constants)
            .collect();

        let slopes = jacobian(&kernel.outputs, &kernel.variables).entries;
        let entries = slopes.iter().flat_map(|&(output, argument, _)| {
            let row = rows.start + output * n;
            (0..n).map(move |place| (row + place, block.arguments[argument * n + place]))
        });
        let entries: Vec<Entry> = entries.collect();
        let slopes: Vec<Expr> = slopes.iter().map(|&(.., slope)| slope).collect();
        let tape = |outputs: &[Expr]| -> Result<(Tape, LaneScratch), CompileError> {
            let tape = compile(&formals, outputs)?;
            let scratch = tape.lane_scratch();
            Ok((tape, scratch))
        };
        let (values, slopes) = (tape(&kernel.outputs)?, tape(&slopes)?);
        let compiled = Compiled {
            n_places: n,
            rows,
            gather: block.arguments.clone(),
            inputs,
            values,
            slopes,
            terms: vec![0.0; entries.len()],
            scatter: Vec::new(),
        };
        Ok((compiled, entries))
    }

    fn gather(&mut self, w: &[f64]) {
        for (input, &index) in self.inputs.iter_mut().zip(&self.gather) {
            *input = w[index as usize];
        }
    }
}

impl Pattern {
    fn new(n_rows: usize, entries: &[Vec<Entry>]) -> Self {
        let mut sorted: Vec<Entry> = entries.iter().flatten().copied().collect();
        sorted.sort_unstable();
        sorted.dedup();
        let mut starts = vec![0; n_rows + 1];
        for &(row, _) in &sorted {
            starts[row + 1] += 1;
        }
        for row in 0..n_rows {
            starts[row + 1] += starts[row];
        }
        Pattern {
            starts,
            columns: sorted.iter().map(|&(_, column)| column).collect(),
        }
    }

    /// The columns of a row.
    pub fn row(&self, row: usize) -> &[u32] {
        &self.columns[self.starts[row]..self.starts[row + 1]]
    }

    /// The number of an entry that is there.
    fn place(&self, (row, column): Entry) -> u32 {
        let place = self.starts[row] + self.row(row).partition_point(|&c| c < column);
        u32::try_from(place).expect("a Jacobian has fewer than 2^32 entries")
    }
}
