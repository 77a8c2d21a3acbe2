//! From the contents of a file to a program of kernels.

use rustc_hash::FxHashMap;

use super::expression::{Id, Node, Operator};
use super::header::Discrete;
use super::lift::{Lifted, lift};
use super::segments::{Contents, Function, Linear, RowBound, Sense};
use super::shape::{Shape, Word, Writer, compile};
use super::{Error, Fault, FileRow, Problem, Sizes};
use crate::optimization::kernels::{Block, Program, ProgramBuilder};
use crate::optimization::problem::{Pair, Side};
use crate::tape::{Tape, Term};

/// How many operations all functions of a file may have together.
const MAX_OPERATIONS: usize = 5_000_000;

/// How many second derivatives the functions of many variables may have together.
const MAX_CURVATURE: usize = 10_000_000;
/// Functions of fewer variables are not counted: their second derivatives are a multiple of the file.
const MANY_VARIABLES: usize = 100;

/// Functions of one shape.
#[derive(Clone, Debug, Default)]
struct Group {
    code: Vec<Word>,
    /// Variables and numbers, place by place.
    variables: Vec<u32>,
    numbers: Vec<f64>,
    /// Bounds and the caller's number of each place; nothing for terms of the objective.
    bounds: Vec<(f64, f64)>,
    members: Vec<usize>,
}

/// Groups in the order of their first members.
#[derive(Clone, Debug, Default)]
struct Groups {
    groups: Vec<Group>,
    of_code: FxHashMap<Vec<Word>, usize>,
}

/// A row before it belongs to a group.
struct Row {
    factor: f64,
    nonlinear: Option<Id>,
    linear: Linear,
    bounds: (f64, f64),
}

impl Row {
    fn new(nonlinear: Option<Id>, linear: Linear, bounds: (f64, f64)) -> Self {
        Row {
            factor: 1.0,
            nonlinear,
            linear,
            bounds,
        }
    }
}

/// The rows of a file, then those of kinks and complementarities.
struct Rows {
    rows: Vec<Row>,
    pairs: Vec<(Side, Side)>,
    /// Lower bounds and initial values of the variables behind those of the file; none is bounded above.
    added: Vec<(f64, f64)>,
}

/// Builds the program of a file.
pub(crate) fn build(mut contents: Contents) -> Result<Problem, Error> {
    let lifted = lift(&mut contents);
    let mut rows = Rows::of(&mut contents, lifted);
    let n_kinks = rows.pairs.len();
    let n_complements = rows.bound(&contents)?;
    let n_binaries = rows.complement_binaries(&contents)?;
    let Rows { rows, pairs, added } = rows;

    let mut program = variables(&contents, &added);
    let n_all = contents.variable_bounds.len() + added.len();
    let mut functions = Functions {
        writer: Writer::new(&contents.nodes, &contents.defined, n_all),
        left: MAX_OPERATIONS,
        curvature: 0,
        contents: &contents,
    };
    let places = functions.rows(&rows, &mut program)?;
    let sense = functions.objective(&mut program)?;
    for (a, b) in &pairs {
        let [a, b] = [a, b].map(|&side| match side {
            Side::Row(row) => Side::Row(places[row as usize]),
            variable => variable,
        });
        program.pair(Pair { a, b });
    }
    let file_rows = places.iter().zip(&rows).map(|(&place, row)| FileRow {
        row: place,
        negated: row.factor < 0.0,
    });
    Ok(Problem {
        program: program.finish(),
        sizes: Sizes {
            variables: contents.header.n_variables,
            rows: contents.header.n_rows,
            complementarities: n_complements,
            kinks: n_kinks,
            binaries: n_binaries,
        },
        rows: file_rows.take(contents.header.n_rows).collect(),
        sense,
        header: contents.header,
    })
}

impl Rows {
    /// The rows of a file, which have no bounds yet, and behind them the equations of its kinks, such as
    /// a - (p - n) = 0 for |a| = p + n, with the pairs 0 <= p ⟂ n >= 0.
    fn of(contents: &mut Contents, lifted: Lifted) -> Self {
        let unbounded = (f64::NEG_INFINITY, f64::INFINITY);
        let own = contents.rows.iter_mut().map(|function| {
            let linear = merged(std::mem::take(&mut function.linear));
            Row::new(function.nonlinear, linear, unbounded)
        });
        let equations = lifted.equations.into_iter();
        let equations = equations.map(|equation| Row::new(Some(equation), Vec::new(), (0.0, 0.0)));
        let pairs = lifted.pairs.into_iter();
        Rows {
            rows: own.chain(equations).collect(),
            pairs: pairs
                .map(|(p, n)| (Side::Variable(p), Side::Variable(n)))
                .collect(),
            added: lifted.variables,
        }
    }

    /// Takes the bounds of the rows of a file, and complementarities, which it counts.
    fn bound(&mut self, contents: &Contents) -> Result<usize, Error> {
        let mut n_complements = 0;
        for (row, bound) in contents.row_bounds.iter().enumerate() {
            match *bound {
                RowBound::Between(lower, upper) => self.rows[row].bounds = (lower, upper),
                RowBound::Complements {
                    variable,
                    lower,
                    upper,
                } => {
                    let (l, u) = contents.variable_bounds[variable as usize];
                    for (asked, value, bound) in [(lower, l, "lower"), (upper, u, "upper")] {
                        if asked && !value.is_finite() {
                            return Err(contents.wrong(Fault::Unbounded {
                                row,
                                variable,
                                bound,
                            }));
                        }
                    }
                    n_complements += usize::from(lower) + usize::from(upper);
                    self.complement(contents, row, variable, (lower, upper));
                }
            }
        }
        Ok(n_complements)
    }

    /// Lets a row complement a variable at its lower bound, its upper bound, both or none.
    fn complement(
        &mut self,
        contents: &Contents,
        row: usize,
        variable: u32,
        (lower, upper): (bool, bool),
    ) {
        let body = Side::Row(row as u32);
        let own = &mut self.rows[row];
        own.bounds = (0.0, if lower == upper { 0.0 } else { f64::INFINITY });
        match (lower, upper) {
            (false, false) => {}
            (true, false) => self.pairs.push((body, Side::Variable(variable))),
            (false, true) => {
                own.factor = -1.0;
                let distance = self.below(contents, variable);
                self.pairs.push((body, distance));
            }
            // body = p - n with p ⟂ x - l and n ⟂ u - x.
            (true, true) => {
                let first = (contents.header.n_variables + self.added.len()) as u32;
                self.added.extend([(0.0, 0.0); 2]);
                own.linear.extend([(first, -1.0), (first + 1, 1.0)]);
                let distance = self.below(contents, variable);
                let pairs = [(first, Side::Variable(variable)), (first + 1, distance)];
                let pairs = pairs.map(|(part, side)| (Side::Variable(part), side));
                self.pairs.extend(pairs);
            }
        }
    }

    /// Adds the row u - x >= 0, as -x >= -u.
    fn below(&mut self, contents: &Contents, variable: u32) -> Side {
        let (_, upper) = contents.variable_bounds[variable as usize];
        let bounds = (-upper, f64::INFINITY);
        self.rows
            .push(Row::new(None, vec![(variable, -1.0)], bounds));
        Side::Row((self.rows.len() - 1) as u32)
    }

    /// 0 <= x ⟂ 1 - x >= 0 for binary variables, which it counts.
    fn complement_binaries(&mut self, contents: &Contents) -> Result<usize, Error> {
        let Discrete {
            binary,
            integer,
            place,
        } = &contents.header.discrete;
        let (mut count, mut others) = (0, 0);
        let all = integer.iter().chain([binary]).cloned();
        for variable in all.flatten() {
            match contents.variable_bounds[variable] {
                (0.0, 1.0) => {
                    let distance = self.below(contents, variable as u32);
                    self.pairs.push((Side::Variable(variable as u32), distance));
                    count += 1;
                }
                (l, u) if l == u && (l == 0.0 || l == 1.0) => count += 1,
                _ if binary.contains(&variable) => {
                    return Err(contents.wrong(Fault::Binary(variable)));
                }
                (l, u) if l == u && l.fract() == 0.0 => {}
                _ => others += 1,
            }
        }
        match others {
            0 => Ok(count),
            _ => Err(Error {
                place: *place,
                fault: Fault::Integer(others),
            }),
        }
    }
}

/// A program of the variables of a file and added ones.
fn variables(contents: &Contents, added: &[(f64, f64)]) -> ProgramBuilder {
    let bounds = contents.variable_bounds.iter().copied();
    let more = added.iter().map(|&(lower, _)| (lower, f64::INFINITY));
    let (lower, upper): (Vec<f64>, Vec<f64>) = bounds.chain(more).unzip();
    let start = contents.start.iter().copied();
    let start: Vec<f64> = start.chain(added.iter().map(|v| v.1)).collect();
    Program::builder(&lower, &upper, &start)
}

/// Terms by ascending variables, each once, none zero.
fn merged(mut terms: Linear) -> Linear {
    terms.sort_by_key(|term| term.0);
    terms.dedup_by(|next, last| {
        let same = next.0 == last.0;
        if same {
            last.1 += next.1;
        }
        same
    });
    terms.retain(|term| term.1 != 0.0);
    terms
}

/// Makes shapes, as long as there is room.
struct Functions<'c> {
    writer: Writer<'c>,
    /// Operations that there is room for, and second derivatives so far.
    left: usize,
    curvature: usize,
    contents: &'c Contents,
}

impl Functions<'_> {
    fn shape(
        &mut self,
        factor: f64,
        nonlinear: Option<Id>,
        linear: &[(u32, f64)],
        user: impl Fn() -> String,
    ) -> Result<Shape, Error> {
        match self.writer.write(factor, nonlinear, linear, self.left) {
            Some(shape) => {
                self.left = self.left.saturating_sub(shape.code.len());
                Ok(shape)
            }
            None => Err(self.contents.wrong(Fault::Large {
                user: user(),
                what: "operations",
                limit: MAX_OPERATIONS,
            })),
        }
    }

    /// Counts the second derivatives of a term: at most those by all pairs of its variables.
    fn count(&mut self, shape: &Shape, user: impl Fn() -> String) -> Result<(), Error> {
        let n = shape.variables.len();
        if n > MANY_VARIABLES {
            self.curvature += n * (n + 1) / 2;
        }
        if self.curvature > MAX_CURVATURE {
            return Err(self.contents.wrong(Fault::Large {
                user: user(),
                what: "second derivatives",
                limit: MAX_CURVATURE,
            }));
        }
        Ok(())
    }

    /// Adds rows, shape by shape; where each of them is.
    fn rows(&mut self, rows: &[Row], program: &mut ProgramBuilder) -> Result<Vec<u32>, Error> {
        let mut groups = Groups::default();
        for (number, row) in rows.iter().enumerate() {
            let user = || format!("row {number}");
            let shape = self.shape(row.factor, row.nonlinear, &row.linear, user)?;
            if shape.variables.len() > MANY_VARIABLES
                && let Some(nonlinear) = row.nonlinear
            {
                let mut terms = Terms::default();
                terms.collect_expression(self.contents, 1.0, nonlinear);
                for (factor, term) in terms.nonlinear {
                    let shape = self.shape(factor, Some(term), &[], user)?;
                    self.count(&shape, user)?;
                }
            }
            groups.add(shape, row.bounds, number);
        }
        let mut places = vec![0; rows.len()];
        for group in groups.groups {
            let members = group.members.clone();
            for (&member, place) in members.iter().zip(group.place(program)) {
                places[member] = place as u32;
            }
        }
        Ok(places)
    }

    /// Adds the first objective, term by term; less is better from here on.
    fn objective(&mut self, program: &mut ProgramBuilder) -> Result<Sense, Error> {
        let Some((sense, function)) = self.contents.objectives.first() else {
            return Ok(Sense::Minimize);
        };
        let factor = match sense {
            Sense::Minimize => 1.0,
            Sense::Maximize => -1.0,
        };
        let mut terms = Terms::default();
        terms.collect(self.contents, factor, function);
        let mut groups = Groups::default();
        let user = || "objective 0".to_owned();
        for &(factor, id) in &terms.nonlinear {
            let shape = self.shape(factor, Some(id), &[], user)?;
            self.count(&shape, user)?;
            groups.add(shape, (0.0, 0.0), 0);
        }
        for (variable, factor) in merged(terms.linear) {
            let shape = self.shape(1.0, None, &[(variable, factor)], user)?;
            groups.add(shape, (0.0, 0.0), 0);
        }
        for group in groups.groups {
            let (block, _) = group.block();
            program.objective(block);
        }
        if terms.constant != 0.0 {
            let mut b = Tape::builder(0);
            let constant = b.constant(terms.constant);
            program.objective(Block {
                values: b.finish(&[constant]),
                n_places: 1,
                variables: Vec::new(),
                numbers: Vec::new(),
                parameters: Vec::new(),
            });
        }
        Ok(*sense)
    }
}

/// A sum taken apart.
#[derive(Clone, Debug, Default)]
struct Terms {
    constant: f64,
    nonlinear: Vec<(f64, Id)>,
    linear: Linear,
}

impl Terms {
    fn collect(&mut self, contents: &Contents, factor: f64, function: &Function) {
        let linear = function.linear.iter();
        (self.linear).extend(linear.map(|&(variable, c)| (variable, factor * c)));
        if let Some(id) = function.nonlinear {
            self.collect_expression(contents, factor, id);
        }
    }

    fn collect_expression(&mut self, contents: &Contents, factor: f64, id: Id) {
        let nodes = &contents.nodes;
        let mut stack = vec![(factor, id)];
        let number = |id: Id| match nodes.nodes[id as usize] {
            Node::Number(number) => Some(number),
            _ => None,
        };
        while let Some((factor, id)) = stack.pop() {
            let Node::Operation { operator, first, n } = nodes.nodes[id as usize] else {
                match nodes.nodes[id as usize] {
                    Node::Number(number) => self.constant += factor * number,
                    Node::Variable(variable) => self.linear.push((variable, factor)),
                    _ => self.nonlinear.push((factor, id)),
                }
                continue;
            };
            let operands = nodes.operands(first, n);
            match operator {
                Operator::Add | Operator::Sum => {
                    stack.extend(operands.iter().rev().map(|&id| (factor, id)));
                }
                Operator::Subtract => stack.extend([(-factor, operands[1]), (factor, operands[0])]),
                Operator::Negate => stack.push((-factor, operands[0])),
                Operator::Multiply => match (number(operands[0]), number(operands[1])) {
                    (Some(number), _) => stack.push((factor * number, operands[1])),
                    (_, Some(number)) => stack.push((factor * number, operands[0])),
                    _ => self.nonlinear.push((factor, id)),
                },
                _ => self.nonlinear.push((factor, id)),
            }
        }
    }
}

impl Groups {
    fn add(&mut self, shape: Shape, bounds: (f64, f64), member: usize) {
        let number = match self.of_code.get(&shape.code) {
            Some(&number) => number,
            None => {
                self.of_code.insert(shape.code.clone(), self.groups.len());
                self.groups.push(Group {
                    code: shape.code,
                    ..Group::default()
                });
                self.groups.len() - 1
            }
        };
        let group = &mut self.groups[number];
        group.variables.extend(shape.variables);
        group.numbers.extend(shape.numbers);
        group.bounds.push(bounds);
        group.members.push(member);
    }
}

impl Group {
    /// Adds the rows and gives their numbers, in the order of the members.
    fn place(self, program: &mut ProgramBuilder) -> std::ops::Range<usize> {
        let (block, bounds) = self.block();
        let (lower, upper): (Vec<f64>, Vec<f64>) = bounds.into_iter().unzip();
        program.rows(block, &lower, &upper)
    }

    /// The kernel at all places; numbers that are the same everywhere are part of it.
    fn block(self) -> (Block, Vec<(f64, f64)>) {
        let n = self.members.len();
        let n_variables = self.variables.len() / n;
        let n_numbers = self.numbers.len() / n;
        let at = |i: usize, place: usize| self.numbers[place * n_numbers + i];
        let varies = |i: usize| (1..n).any(|place| at(i, place) != at(i, 0));
        let varying: Vec<usize> = (0..n_numbers).filter(|&i| varies(i)).collect();

        let mut b = Tape::builder(n_variables + varying.len());
        let inputs: Vec<Term> = (0..n_variables).map(|i| Term::value(b.input(i))).collect();
        let mut numbers: Vec<Term> = (0..n_numbers).map(|i| Term::Number(at(i, 0))).collect();
        for (input, &i) in varying.iter().enumerate() {
            numbers[i] = Term::value(b.input(n_variables + input));
        }
        let output = compile(&self.code, &inputs, &numbers, &mut b).place(&mut b);
        let places = |i: usize| (0..n).map(move |place| place * n_variables + i);
        let block = Block {
            values: b.finish(&[output]),
            n_places: n,
            variables: (0..n_variables)
                .flat_map(places)
                .map(|at| self.variables[at])
                .collect(),
            numbers: (varying.iter())
                .flat_map(|&i| (0..n).map(move |place| (i, place)))
                .map(|(i, place)| at(i, place))
                .collect(),
            parameters: Vec::new(),
        };
        (block, self.bounds)
    }
}
