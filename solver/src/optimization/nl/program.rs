//! From the contents of a file to a program of kernels.

use rustc_hash::FxHashMap;

use super::expression::{Id, Node, Operator};
use super::lift::lift;
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

/// Builds the program of a file.
pub(crate) fn build(mut contents: Contents) -> Result<Problem, Error> {
    let n = contents.header.n_variables;
    let n_rows = contents.header.n_rows;
    let mut lifted = lift(&mut contents);
    let mut rows: Vec<Row> = Vec::with_capacity(n_rows);
    for function in &mut contents.rows {
        rows.push(Row {
            factor: 1.0,
            nonlinear: function.nonlinear,
            linear: merged(std::mem::take(&mut function.linear)),
            bounds: (f64::NEG_INFINITY, f64::INFINITY),
        });
    }
    let mut pairs = Vec::new();
    let n_kinks = lifted.pairs.len();
    pairs.extend((lifted.pairs.iter()).map(|&(p, n)| (Side::Variable(p), Side::Variable(n))));
    rows.extend(lifted.equations.iter().map(|&equation| Row {
        factor: 1.0,
        nonlinear: Some(equation),
        linear: Vec::new(),
        bounds: (0.0, 0.0),
    }));

    let infinity = f64::INFINITY;
    let fail = |fault| {
        let place = contents.end;
        Err(Error { place, fault })
    };
    let bounds = &contents.variable_bounds;
    // The row u - x >= 0, as -x >= -u.
    let below = |rows: &mut Vec<Row>, variable: u32| {
        rows.push(Row {
            factor: 1.0,
            nonlinear: None,
            linear: vec![(variable, -1.0)],
            bounds: (-bounds[variable as usize].1, infinity),
        });
        Side::Row((rows.len() - 1) as u32)
    };
    let mut n_complements = 0;
    for (row, bound) in contents.row_bounds.iter().enumerate() {
        let (variable, lower, upper) = match *bound {
            RowBound::Between(lower, upper) => {
                rows[row].bounds = (lower, upper);
                continue;
            }
            RowBound::Complements {
                variable,
                lower,
                upper,
            } => (variable, lower, upper),
        };
        let (l, u) = bounds[variable as usize];
        for (asked, value, bound) in [(lower, l, "lower"), (upper, u, "upper")] {
            if asked && !value.is_finite() {
                return fail(Fault::Unbounded {
                    row,
                    variable,
                    bound,
                });
            }
        }
        n_complements += usize::from(lower) + usize::from(upper);
        let body = Side::Row(row as u32);
        match (lower, upper) {
            (false, false) => rows[row].bounds = (0.0, 0.0),
            (true, false) => {
                rows[row].bounds = (0.0, infinity);
                pairs.push((body, Side::Variable(variable)));
            }
            (false, true) => {
                rows[row].factor = -1.0;
                rows[row].bounds = (0.0, infinity);
                let distance = below(&mut rows, variable);
                pairs.push((body, distance));
            }
            // body = p - n with p ⟂ x - l and n ⟂ u - x.
            (true, true) => {
                let first = (n + lifted.variables.len()) as u32;
                lifted.variables.extend([(0.0, 0.0); 2]);
                rows[row].linear.extend([(first, -1.0), (first + 1, 1.0)]);
                rows[row].bounds = (0.0, 0.0);
                let distance = below(&mut rows, variable);
                pairs.push((Side::Variable(first), Side::Variable(variable)));
                pairs.push((Side::Variable(first + 1), distance));
            }
        }
    }
    // 0 <= x ⟂ 1 - x >= 0: a binary variable.
    let first_binary = n - contents.header.n_binary;
    for (variable, &bounds) in bounds.iter().enumerate().skip(first_binary) {
        match bounds {
            (l, u) if l == u && (l == 0.0 || l == 1.0) => {}
            (0.0, 1.0) => {
                let distance = below(&mut rows, variable as u32);
                pairs.push((Side::Variable(variable as u32), distance));
            }
            _ => return fail(Fault::Binary(variable)),
        }
    }

    let added = &lifted.variables;
    let lower: Vec<f64> = (bounds.iter().map(|b| b.0))
        .chain(added.iter().map(|v| v.0))
        .collect();
    let upper: Vec<f64> = (bounds.iter().map(|b| b.1))
        .chain(added.iter().map(|_| infinity))
        .collect();
    let start = contents.start.iter().copied();
    let start: Vec<f64> = start.chain(added.iter().map(|v| v.1)).collect();
    let mut program = Program::builder(&lower, &upper, &start);

    let mut functions = Functions {
        writer: Writer::new(&contents.nodes, &contents.defined, lower.len()),
        left: MAX_OPERATIONS,
        curvature: 0,
        contents: &contents,
    };
    let mut groups = Groups::default();
    for (number, row) in rows.iter().enumerate() {
        let user = || format!("row {number}");
        let shape = functions.shape(row.factor, row.nonlinear, &row.linear, user)?;
        if shape.variables.len() > MANY_VARIABLES
            && let Some(nonlinear) = row.nonlinear
        {
            let mut terms = Terms::default();
            terms.collect_expression(&contents, 1.0, nonlinear);
            for (factor, term) in terms.nonlinear {
                let shape = functions.shape(factor, Some(term), &[], user)?;
                functions.count(&shape, user)?;
            }
        }
        groups.add(shape, row.bounds, number);
    }
    let mut file_rows = vec![0; rows.len()];
    for group in groups.groups {
        let members = group.members.clone();
        let places = group.place(&mut program);
        for (&member, place) in members.iter().zip(places) {
            file_rows[member] = place as u32;
        }
    }
    let sense = functions.objective(&mut program)?;
    for (a, b) in &pairs {
        let [a, b] = [a, b].map(|&side| match side {
            Side::Row(row) => Side::Row(file_rows[row as usize]),
            variable => variable,
        });
        program.pair(Pair { a, b });
    }
    let file_rows = (0..n_rows).map(|row| FileRow {
        row: file_rows[row],
        negated: rows[row].factor < 0.0,
    });
    let file_rows = file_rows.collect();
    Ok(Problem {
        program: program.finish(),
        sizes: Sizes {
            variables: n,
            rows: n_rows,
            complementarities: n_complements,
            kinks: n_kinks,
            binaries: contents.header.n_binary,
        },
        rows: file_rows,
        sense,
        header: contents.header,
    })
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
            None => Err(Error {
                place: self.contents.end,
                fault: Fault::Large {
                    user: user(),
                    what: "operations",
                    limit: MAX_OPERATIONS,
                },
            }),
        }
    }

    /// Counts the second derivatives of a term: at most those by all pairs of its variables.
    fn count(&mut self, shape: &Shape, user: impl Fn() -> String) -> Result<(), Error> {
        let n = shape.variables.len();
        if n > MANY_VARIABLES {
            self.curvature += n * (n + 1) / 2;
        }
        if self.curvature > MAX_CURVATURE {
            return Err(Error {
                place: self.contents.end,
                fault: Fault::Large {
                    user: user(),
                    what: "second derivatives",
                    limit: MAX_CURVATURE,
                },
            });
        }
        Ok(())
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
