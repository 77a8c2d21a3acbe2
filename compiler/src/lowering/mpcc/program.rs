//! An [`Mpcc`] as the solvers see it.
//!
//! Members of pairs that are variables in [0, ∞) stay variables; others are rows, and where the same member stands in
//! several pairs it is one row.
//! Once it is known which member of every pair is zero, terms that only steer leave the objective, and those
//! conditional rows hold that [`Conditions`] say.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use nsd_solver::hybrid::check::{Fault, must};
use nsd_solver::optimization::kernels::ProgramBuilder;
use nsd_solver::optimization::problem::{Member, Nlp, Other, Pair, Side, Structure};
use nsd_solver::optimization::{kernels, problem};
use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::conditions::Conditions;
use super::{Block, Bounds, Kind, Mpcc, Origin};
use crate::expr::{CompileError, Expr, Node};

/// A compiled [`Mpcc`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(remote = "Self")]
pub struct Program {
    kernels: kernels::Program,
    /// Terms of the objective that only steer.
    steering: Vec<usize>,
    /// What these terms count.
    steers: f64,
    conditions: Conditions,
    /// The first row of every block that has rows of its own.
    first_rows: Vec<usize>,
    /// Variables of sums that are members, pair by pair and member by member.
    terms: Vec<[Range<u32>; 2]>,
    term_variables: Vec<u32>,
    /// Block and first row of the rows of the program.
    rows: Vec<(usize, Range<usize>)>,
    #[serde(skip)]
    others: Option<Arc<dyn Others>>,
}

/// Points of other branches that mean the same: see [`nsd_solver::optimization::problem::Mpcc::others`].
pub trait Others: fmt::Debug + Send + Sync {
    /// Those of a point.
    fn at(&self, w: &[f64], zeros: &[Member], near: &Linearized) -> Vec<Other>;
}

/// A program near a point.
#[derive(Clone, Debug)]
pub struct Linearized {
    /// The derivatives of the Lagrangian, without rows that are sides of pairs.
    pub slopes: Vec<f64>,
    /// Entries (column, row, value) of the Jacobian of the equations that hold in all branches, column by column.
    equations: Vec<(u32, u32, f64)>,
}

impl Linearized {
    /// By how much the equations change at most with these variables.
    pub fn change(&self, direction: &FxHashMap<usize, f64>) -> f64 {
        let mut rows: FxHashMap<u32, f64> = FxHashMap::default();
        for (&column, d) in direction {
            let column = column as u32;
            let first = self.equations.partition_point(|entry| entry.0 < column);
            let entries = self.equations[first..].iter();
            for &(_, row, value) in entries.take_while(|entry| entry.0 == column) {
                *rows.entry(row).or_default() += value * d;
            }
        }
        rows.values()
            .fold(0.0, |m: f64, change| m.max(change.abs()))
    }
}

impl<'e> Mpcc<'e> {
    /// Compiles all kernels with their derivatives.
    pub fn program(&self) -> Result<Program, CompileError> {
        let bounds = self.bounds();
        let side = |side: fn(&Bounds) -> f64| bounds.iter().map(side).collect::<Vec<f64>>();
        let (lower, upper) = (side(|b| b.lower), side(|b| b.upper));
        let mut builder = kernels::Program::builder(&lower, &upper, &side(|b| b.guess));
        builder.parameters(&self.parameters());
        let mut steering = Vec::new();
        let mut rows = Vec::new();
        let mut pairs = Pairs {
            lower: &lower,
            terms: Vec::new(),
            term_variables: Vec::new(),
        };
        let mut first_rows = vec![usize::MAX; self.blocks.len()];
        for (number, block) in self.blocks.iter().enumerate() {
            let n = block.n_rows();
            let whole = || self.kernel(block, &block.kernel.outputs);
            let infinite = || (vec![f64::NEG_INFINITY; n], vec![f64::INFINITY; n]);
            let (lower, upper) = match block.kind {
                Kind::Objective => {
                    builder.objective(whole()?);
                    continue;
                }
                Kind::Steering => {
                    steering.push(builder.objective(whole()?));
                    continue;
                }
                Kind::Pair => {
                    pairs.add(self, block, &mut builder)?;
                    continue;
                }
                Kind::Equation => (vec![0.0; n], vec![0.0; n]),
                Kind::Conditional => infinite(),
                Kind::Inequality => {
                    let places = block.n_places();
                    let repeated = |bound: fn(&(f64, f64)) -> f64| {
                        let bounds = block.bounds.iter().map(bound);
                        bounds.flat_map(|bound| vec![bound; places]).collect()
                    };
                    (repeated(|b| b.0), repeated(|b| b.1))
                }
            };
            let found = builder.rows(whole()?, &lower, &upper);
            first_rows[number] = found.start;
            rows.push((number, found));
        }
        Ok(Program {
            kernels: builder.finish(),
            steering,
            steers: 1.0,
            conditions: self.conditions.clone(),
            first_rows,
            terms: pairs.terms,
            term_variables: pairs.term_variables,
            rows,
            others: None,
        })
    }

    /// The rows of a block in a [`Program`]; none of members of pairs and of terms of the objective.
    pub fn rows_of(&self, program: &Program, block: usize) -> Range<usize> {
        let found = program.rows.iter().find(|(number, _)| *number == block);
        found.map_or(0..0, |(_, rows)| rows.clone())
    }

    /// Where a row of a [`Program`] comes from; nothing for members of pairs.
    pub fn origin(&self, program: &Program, row: usize) -> Option<Origin> {
        let (block, rows) = program.rows.iter().find(|(_, rows)| rows.contains(&row))?;
        Some(self.blocks[*block].origin(row - rows.start))
    }
}

/// Collects pairs.
struct Pairs<'l> {
    lower: &'l [f64],
    terms: Vec<[Range<u32>; 2]>,
    term_variables: Vec<u32>,
}

/// A member at all places of a block.
struct Sides {
    sides: Vec<Side>,
    /// Its terms, where it is a sum of variables in [0, ∞), as formal arguments.
    terms: Vec<usize>,
}

impl Pairs<'_> {
    fn add<'e>(
        &mut self,
        mpcc: &Mpcc<'e>,
        block: &Block<'e>,
        builder: &mut ProgramBuilder,
    ) -> Result<(), CompileError> {
        let n = block.n_places();
        let outputs = &block.kernel.outputs;
        let members = outputs.iter().map(|&e| self.sides(mpcc, block, e, builder));
        let members: Vec<Sides> = members.collect::<Result<_, _>>()?;
        let (first, second) = members.split_at(outputs.len() / 2);
        for (a, b) in first.iter().zip(second) {
            for place in 0..n {
                builder.pair(Pair {
                    a: a.sides[place],
                    b: b.sides[place],
                });
                let terms = [a, b].map(|member| {
                    let start = self.term_variables.len() as u32;
                    let terms = member.terms.iter();
                    self.term_variables
                        .extend(terms.map(|&formal| block.arguments[formal * n + place]));
                    start..self.term_variables.len() as u32
                });
                self.terms.push(terms);
            }
        }
        Ok(())
    }

    fn sides<'e>(
        &self,
        mpcc: &Mpcc<'e>,
        block: &Block<'e>,
        member: Expr<'e>,
        builder: &mut ProgramBuilder,
    ) -> Result<Sides, CompileError> {
        let n = block.n_places();
        if let Some(formal) = self.variable(block, member) {
            let variables = &block.arguments[formal * n..(formal + 1) * n];
            return Ok(Sides {
                sides: variables
                    .iter()
                    .map(|&variable| Side::Variable(variable))
                    .collect(),
                terms: Vec::new(),
            });
        }
        let terms = match member.node() {
            Node::Sum {
                constant: 0.0,
                terms,
            } => {
                let formal = |&(c, term): &(f64, Expr<'e>)| {
                    let formal = self.variable(block, term)?;
                    (c > 0.0).then_some(formal)
                };
                terms.iter().map(formal).collect::<Option<Vec<usize>>>()
            }
            _ => None,
        };
        // One row for all places with the same arguments.
        let whole = mpcc.kernel(block, &[member])?;
        let key = |place: usize| -> Vec<u64> {
            let variables = whole.variables.iter().skip(place).step_by(n);
            let numbers = whole.numbers.iter().skip(place).step_by(n);
            (variables.map(|&variable| u64::from(variable)))
                .chain(numbers.map(|number| number.to_bits()))
                .collect()
        };
        let mut known: FxHashMap<Vec<u64>, usize> = FxHashMap::default();
        let mut places: Vec<usize> = Vec::new();
        let mut numbers = Vec::with_capacity(n);
        for place in 0..n {
            let number = *known.entry(key(place)).or_insert_with(|| {
                places.push(place);
                places.len() - 1
            });
            numbers.push(number);
        }
        let at_places = |values: &[u32]| -> Vec<u32> {
            let formals = values.chunks(n.max(1));
            formals
                .flat_map(|formal| places.iter().map(|&place| formal[place]))
                .collect()
        };
        let numbers_at = whole.numbers.chunks(n.max(1));
        let numbers_at: Vec<f64> = numbers_at
            .flat_map(|formal| places.iter().map(|&place| formal[place]))
            .collect();
        let row = kernels::Block {
            n_places: places.len(),
            variables: at_places(&whole.variables),
            numbers: numbers_at,
            ..whole
        };
        let count = places.len();
        let rows = builder.rows(row, &vec![0.0; count], &vec![f64::INFINITY; count]);
        let sides = numbers
            .iter()
            .map(|number| Side::Row((rows.start + number) as u32));
        Ok(Sides {
            sides: sides.collect(),
            terms: terms.unwrap_or_default(),
        })
    }

    /// The argument that a member is, where it is a variable in [0, ∞) at all places.
    fn variable(&self, block: &Block, member: Expr) -> Option<usize> {
        let var = member.as_variable()?;
        let formal = block
            .kernel
            .variables
            .iter()
            .position(|formal| *formal == var)?;
        let n = block.n_places();
        let mut variables = block.arguments[formal * n..(formal + 1) * n].iter();
        variables
            .all(|&variable| self.lower[variable as usize] == 0.0)
            .then_some(formal)
    }
}

nsd_solver::checked_when_read!(Program);

impl Program {
    /// Checks that all that it refers to is there.
    ///
    /// # Errors
    ///
    /// What is not.
    pub fn check(&self) -> Result<(), Fault> {
        let n_pairs = problem::Mpcc::pairs(&self.kernels).len();
        let n_rows = self.kernels.n_rows();
        let mut steering = self.steering.iter();
        must(
            steering.all(|term| *term < self.kernels.n_terms()),
            "what steers is a term of the objective",
        )?;
        let n_terms = self.term_variables.len();
        let mut terms = self.terms.iter().flatten();
        let are_listed =
            terms.all(|range| range.start <= range.end && range.end as usize <= n_terms);
        let n = self.kernels.n_variables();
        let mut variables = self.term_variables.iter();
        must(
            self.terms.len() == n_pairs && are_listed && variables.all(|v| (*v as usize) < n),
            "every pair has its terms",
        )?;
        must(
            self.conditions.fit(n_pairs, n_rows),
            "conditions are those of pairs",
        )?;
        let mut conditional = self.conditions.blocks();
        let have_rows = conditional.all(|block| {
            let first = self.first_rows.get(block.number);
            let end = first.and_then(|first| first.checked_add(block.rows));
            end.is_some_and(|end| end <= n_rows)
        });
        must(have_rows, "conditional rows are rows")
    }

    /// How many parameters its functions need at least.
    pub fn n_parameters(&self) -> usize {
        self.kernels.n_parameters()
    }

    /// Weights the terms that only steer.
    pub fn set_steering(&mut self, weight: f64) {
        self.steers = weight;
        problem::Mpcc::settle(self, None);
    }

    /// Where a solver starts from.
    pub fn set_start(&mut self, start: &[f64]) {
        self.kernels.set_start(start);
    }

    /// Gives a variable its value; it is no side of a pair by itself.
    pub fn set_value(&mut self, variable: usize, value: f64) {
        self.set_bounds(variable, value, value);
    }

    /// Gives a variable other bounds; where it is a side of a pair, its lower one has to stay.
    pub fn set_bounds(&mut self, variable: usize, lower: f64, upper: f64) {
        self.kernels.set_variable_bounds(variable, lower, upper);
    }

    /// Gives the parameters of the [`Mpcc`] that this was made of other values, in their order.
    pub fn set_parameters(&mut self, values: &[f64]) {
        self.kernels.set_parameters(values);
    }

    /// The program near a point with multipliers y.
    fn linearized(&mut self, w: &[f64], y: &[f64]) -> Linearized {
        let pairs = problem::Mpcc::pairs(&self.kernels).iter();
        let sides = pairs.flat_map(|pair| [pair.a, pair.b]);
        let mut is_side = vec![false; y.len()];
        for side in sides {
            if let Side::Row(row) = side {
                is_side[row as usize] = true;
            }
        }
        let bounds = self.kernels.row_bounds();
        let bounds = bounds.lower.iter().zip(bounds.upper);
        let mut is_equation: Vec<bool> = bounds.map(|(lower, upper)| lower == upper).collect();
        for block in self.conditions.blocks() {
            let first = self.first_rows[block.number];
            is_equation[first..first + block.rows].fill(false);
        }
        let mut slopes = vec![0.0; w.len()];
        self.kernels.gradient(w, &mut slopes);
        let mut entries = vec![0.0; self.kernels.jacobian_pattern().n_entries()];
        self.kernels.jacobian(w, &mut entries);
        let pattern = self.kernels.jacobian_pattern();
        let mut equations = Vec::new();
        for (row, &y) in y.iter().enumerate().filter(|(row, _)| !is_side[*row]) {
            let values = &entries[pattern.starts[row]..pattern.starts[row + 1]];
            for (&column, &value) in pattern.row(row).iter().zip(values) {
                slopes[column as usize] += value * y;
                if is_equation[row] {
                    equations.push((column, row as u32, value));
                }
            }
        }
        equations.sort_unstable_by_key(|&(column, row, _)| (column, row));
        Linearized { slopes, equations }
    }

    /// What knows other points that mean the same.
    pub fn set_others(&mut self, others: Arc<dyn Others>) {
        self.others = Some(others);
    }
}

impl Nlp for Program {
    fn structure(&self) -> Structure<'_> {
        self.kernels.structure()
    }

    fn has_objective(&self) -> bool {
        self.kernels.has_objective()
    }

    fn objective(&mut self, w: &[f64]) -> f64 {
        self.kernels.objective(w)
    }

    fn gradient(&mut self, w: &[f64], gradient: &mut [f64]) {
        self.kernels.gradient(w, gradient);
    }

    fn rows(&mut self, w: &[f64], rows: &mut [f64]) {
        self.kernels.rows(w, rows);
    }

    fn jacobian(&mut self, w: &[f64], entries: &mut [f64]) {
        self.kernels.jacobian(w, entries);
    }

    fn hessian(&mut self, w: &[f64], factor: f64, y: &[f64], entries: &mut [f64]) {
        self.kernels.hessian(w, factor, y, entries);
    }
}

impl problem::Mpcc for Program {
    fn pairs(&self) -> &[Pair] {
        self.kernels.pairs()
    }

    fn settle(&mut self, zeros: Option<&[Member]>) -> bool {
        for &term in &self.steering {
            let weight = if zeros.is_none() { self.steers } else { 0.0 };
            self.kernels.weight_term(term, weight);
        }
        let holding = zeros.map(|zeros| self.conditions.holding(zeros));
        for block in self.conditions.blocks() {
            let first = self.first_rows[block.number];
            for row in 0..block.rows {
                let holds =
                    (holding.as_ref()).is_some_and(|holding| holding.contains(block.number, row));
                let bound = if holds { 0.0 } else { f64::INFINITY };
                self.kernels.set_row_bounds(first + row, -bound, bound);
            }
        }
        !self.steering.is_empty() || self.conditions.blocks().next().is_some()
    }

    fn terms(&self, pair: usize, member: Member) -> &[u32] {
        let range = self.terms[pair][member as usize].clone();
        &self.term_variables[range.start as usize..range.end as usize]
    }

    fn others(&mut self, w: &[f64], zeros: &[Member], y: &[f64]) -> Vec<Other> {
        let Some(others) = self.others.clone() else {
            return Vec::new();
        };
        let near = self.linearized(w, y);
        others.at(w, zeros, &near)
    }
}
