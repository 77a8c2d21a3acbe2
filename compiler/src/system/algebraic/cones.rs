//! Where programs with second-order cones, balls or many rows start: the solution of the program in which everything but the
//! cones is replaced by its linearization at the guesses.
//!
//! Newton's method does not find the surface of a cone from anywhere, nor that of a ball from its centre, and of many rows
//! not all choices of those that hold as equations are tried. Of a quadratic objective with affine rows this is
//! the solution itself, at the start of a run; of other programs it is a guess.

use nsd_solver::optimization::conic;
use nsd_solver::optimization::conic::{Block, Set};
use rustc_hash::FxHashMap;

use super::programs::{Programs, unknowns};
use crate::expr::{Expr, Var};
use crate::model::{Cone, Program, ProgramRow};

/// Up to this many complementarities a run tries all choices.
const MAX_PAIRS: usize = 8;

impl<'e> Programs<'_, '_, 'e> {
    /// Guesses of what programs with cones solve for, and of how their rows hold.
    pub(crate) fn guesses(&self) -> FxHashMap<Var, f64> {
        let mut guesses = FxHashMap::default();
        let programs = &self.instance.model.statements.programs;
        if self.instance.needs.algebraic {
            let pairs = programs.iter().flat_map(|program| &program.rows);
            let many = pairs.filter(|row| !row.is_equation).count() > MAX_PAIRS;
            for program in programs {
                let is_round = |row: &ProgramRow<'e>| row.cone.is_some() || row.radius.is_some();
                let is_guessed = many || program.rows.iter().any(is_round);
                let found = is_guessed.then(|| self.guess_program(program)).flatten();
                guesses.extend(found.into_iter().flatten());
            }
        }
        guesses
    }

    fn guess_program(&self, program: &Program<'e>) -> Option<Vec<(Var, f64)>> {
        let vars = unknowns(program);
        let n = vars.len();
        let start: Vec<f64> = vars
            .iter()
            .map(|var| self.instance.values().numbers[var])
            .collect();
        let value = |e: Expr<'e>| {
            let e = e.substitute(&self.instance.values().signals);
            e.eval(&|var| self.start_value(program, &start, var))
        };
        // e ≈ a·z + b around the guess.
        let affine = |e: Expr<'e>| {
            let slopes: Vec<f64> = vars.iter().map(|&var| value(e.diff(var))).collect();
            let along = slopes.iter().zip(&start).map(|(a, z)| a * z);
            let offset = value(e) - along.sum::<f64>();
            (slopes, offset)
        };
        let map: Vec<(Vec<f64>, f64)> = program.map.iter().map(|&e| affine(e)).collect();
        let entry = |i: usize, j: usize| 0.5 * (map[i].0[j] + map[j].0[i]);
        let hessian: Vec<f64> = (0..n * n).map(|k| entry(k / n, k % n)).collect();
        let cost: Vec<f64> = map.iter().map(|(_, offset)| *offset).collect();
        let blocks = program.rows.iter().map(|row| match &row.cone {
            Some(cone) => Block {
                rows: ([cone.radius].iter().chain(&cone.entries))
                    .map(|&e| affine(e))
                    .collect(),
                set: Set::SecondOrder,
            },
            None => Block {
                rows: vec![affine(row.value)],
                set: match row.is_equation {
                    true => Set::Zero,
                    false => Set::NonNegative,
                },
            },
        });
        let blocks: Vec<Block> = blocks.collect();
        let rows = blocks.iter().flat_map(|block| &block.rows);
        let numbers = rows.flat_map(|(a, b)| a.iter().chain([b]));
        let mut numbers = numbers.chain(&hessian).chain(&cost);
        if !numbers.all(|number| number.is_finite()) {
            return None;
        }
        let found = conic::solve(&hessian, &cost, &blocks)?;
        let mut guesses: Vec<(Var, f64)> = vars.into_iter().zip(found.x.iter().copied()).collect();
        let holds = program.multipliers.iter().zip(&program.rows).zip(&blocks);
        for (((names, row), block), dual) in holds.zip(&found.duals) {
            let values = match row.cone {
                None => dual.clone(),
                Some(_) => {
                    let row = |(a, b): &(Vec<f64>, f64)| {
                        let terms = a.iter().zip(&found.x).map(|(a, x)| a * x);
                        terms.sum::<f64>() + b
                    };
                    let primal: Vec<f64> = block.rows.iter().map(row).collect();
                    Cone::split(&primal, dual)
                }
            };
            let names = names.iter().filter_map(|name| name.as_variable());
            guesses.extend(names.zip(values));
        }
        Some(guesses)
    }
}
