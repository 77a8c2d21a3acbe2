//! Storage of expressions.
//!
//! A node is a `u32`; equal nodes have the same number, and children have smaller numbers than their parents.
//! So ascending numbers are a topological order, and no algorithm here needs recursion.

use std::cell::RefCell;

use super::{BinaryFunction, Function, Var};

/// The number of a node.
pub(super) type Id = u32;

/// A node with its children as numbers; the lists of sums and products are ranges of one flat vector each.
#[derive(Clone, Copy, Debug)]
pub(super) enum Data {
    Constant(f64),
    Variable(Var),
    /// `constant + Σ coefficient * term`.
    Sum {
        constant: f64,
        start: u32,
        len: u32,
    },
    /// `Π factor ^ power`.
    Product {
        start: u32,
        len: u32,
    },
    Unary(Function, Id),
    Binary(BinaryFunction, Id, Id),
}

/// What the printer sorts by, kept per node because finding it is not local.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Rank {
    /// The earliest variable below, `u32::MAX` without one.
    pub first_variable: u32,
    /// The total degree as a polynomial; functions have degree 0.
    pub degree: i32,
}

/// All nodes, and the names of variables.
#[derive(Debug, Default)]
pub(super) struct Nodes {
    data: Vec<Data>,
    ranks: Vec<Rank>,
    terms: Vec<(Id, f64)>,
    factors: Vec<(Id, i32)>,
    names: Vec<String>,
    variables: Vec<Id>,
    /// Memory of walks.
    walk: RefCell<Walk>,
}

/// Memory of walks below expressions, most of which are short ones.
#[derive(Debug, Default)]
pub(super) struct Walk {
    /// For every node the last walk that has seen it.
    seen: Vec<u32>,
    number: u32,
    pub stack: Vec<Id>,
}

impl Walk {
    /// Begins a walk over an arena with so many nodes.
    pub fn begin(&mut self, n: usize) {
        if self.number == u32::MAX {
            self.seen.fill(0);
            self.number = 0;
        }
        self.number += 1;
        self.seen.resize(n, 0);
        self.stack.clear();
    }

    /// Whether a node is seen for the first time.
    pub fn is_new(&mut self, id: Id) -> bool {
        std::mem::replace(&mut self.seen[id as usize], self.number) != self.number
    }
}

impl Nodes {
    pub fn len(&self) -> usize {
        self.data.len()
    }

    pub fn data(&self, id: Id) -> Data {
        self.data[id as usize]
    }

    pub fn as_variable(&self, id: Id) -> Option<Var> {
        match self.data(id) {
            Data::Variable(var) => Some(var),
            _ => None,
        }
    }

    /// The value of a number, which may be the sum of some that keep their digits.
    pub fn number(&self, id: Id) -> Option<f64> {
        match self.data(id) {
            Data::Constant(value) => Some(value),
            _ => Some(self.numbers_of(id)?.sum()),
        }
    }

    /// The numbers of a sum that has nothing else.
    pub fn numbers_of(&self, id: Id) -> Option<impl Iterator<Item = f64> + '_> {
        let Data::Sum {
            constant,
            start,
            len,
        } = self.data(id)
        else {
            return None;
        };
        let number = |&(id, c): &(Id, f64)| match self.data(id) {
            Data::Constant(value) => Some(c * value),
            _ => None,
        };
        let terms = self.terms(start, len).iter();
        if terms.clone().any(|term| number(term).is_none()) {
            return None;
        }
        let numbers = [constant].into_iter().chain(terms.filter_map(number));
        let total: f64 = numbers.clone().sum();
        total.is_finite().then_some(numbers)
    }

    pub fn rank(&self, id: Id) -> Rank {
        self.ranks[id as usize]
    }

    pub fn terms(&self, start: u32, len: u32) -> &[(Id, f64)] {
        &self.terms[start as usize..][..len as usize]
    }

    pub fn factors(&self, start: u32, len: u32) -> &[(Id, i32)] {
        &self.factors[start as usize..][..len as usize]
    }

    pub fn name(&self, var: Var) -> &str {
        &self.names[var.index()]
    }

    pub fn rename(&mut self, var: Var, name: &str) {
        self.names[var.index()] = name.to_owned();
    }

    pub fn n_variables(&self) -> usize {
        self.variables.len()
    }

    pub fn variable(&self, var: Var) -> Id {
        self.variables[var.index()]
    }

    /// Calls `visit` with every child; a child may come twice.
    pub fn for_each_child(&self, id: Id, mut visit: impl FnMut(Id)) {
        match self.data(id) {
            Data::Constant(_) | Data::Variable(_) => {}
            Data::Sum { start, len, .. } => {
                self.terms(start, len).iter().for_each(|&(t, _)| visit(t))
            }
            Data::Product { start, len } => {
                self.factors(start, len).iter().for_each(|&(f, _)| visit(f))
            }
            Data::Unary(_, a) => visit(a),
            Data::Binary(_, a, b) => {
                visit(a);
                visit(b);
            }
        }
    }

    /// The nodes below the roots, roots included, children before parents.
    pub fn below(&self, roots: impl IntoIterator<Item = Id>) -> Vec<Id> {
        let mut nodes = Vec::new();
        self.visit_below(roots, |id| nodes.push(id));
        nodes.sort_unstable();
        nodes
    }

    /// Calls `visit` with every node below the roots, roots included, once.
    pub fn visit_below(&self, roots: impl IntoIterator<Item = Id>, mut visit: impl FnMut(Id)) {
        let walk = &mut *self.walk.borrow_mut();
        walk.begin(self.len());
        for root in roots {
            if walk.is_new(root) {
                walk.stack.push(root);
            }
        }
        while let Some(id) = walk.stack.pop() {
            visit(id);
            self.for_each_child(id, |child| {
                if walk.is_new(child) {
                    walk.stack.push(child);
                }
            });
        }
    }

    /// Whether an expression is a sum of even powers, none of which is taken away.
    pub fn is_sum_of_squares(&self, id: Id) -> bool {
        let is_square = |id: Id| match self.data(id) {
            Data::Product { start, len } => {
                let mut factors = self.factors(start, len).iter();
                factors.all(|&(_, power)| power > 0 && power % 2 == 0)
            }
            _ => false,
        };
        match self.data(id) {
            Data::Sum {
                constant,
                start,
                len,
            } => {
                let mut terms = self.terms(start, len).iter();
                constant >= 0.0 && terms.all(|&(term, c)| c > 0.0 && is_square(term))
            }
            _ => is_square(id),
        }
    }

    /// A new node.
    pub fn push(&mut self, data: Data) -> Id {
        let id = u32_len(self.data.len());
        let rank = self.rank_of(data);
        self.data.push(data);
        self.ranks.push(rank);
        id
    }

    /// A new variable.
    pub fn push_variable(&mut self, name: &str) -> Id {
        let var = Var(u32_len(self.variables.len()));
        self.names.push(name.to_owned());
        let id = self.push(Data::Variable(var));
        self.variables.push(id);
        id
    }

    /// A new sum.
    pub fn push_sum(&mut self, constant: f64, terms: &[(Id, f64)]) -> Id {
        let start = u32_len(self.terms.len());
        self.terms.extend_from_slice(terms);
        self.push(Data::Sum {
            constant,
            start,
            len: u32_len(terms.len()),
        })
    }

    /// A new product.
    pub fn push_product(&mut self, factors: &[(Id, i32)]) -> Id {
        let start = u32_len(self.factors.len());
        self.factors.extend_from_slice(factors);
        self.push(Data::Product {
            start,
            len: u32_len(factors.len()),
        })
    }

    fn rank_of(&self, data: Data) -> Rank {
        let first = |ids: &mut dyn Iterator<Item = Id>| {
            ids.map(|id| self.rank(id).first_variable)
                .min()
                .unwrap_or(u32::MAX)
        };
        let (first_variable, degree) = match data {
            Data::Constant(_) => (u32::MAX, 0),
            Data::Variable(var) => (var.0, 1),
            Data::Sum { start, len, .. } => {
                let terms = self.terms(start, len);
                let degree = terms.iter().map(|&(t, _)| self.rank(t).degree).max();
                (first(&mut terms.iter().map(|t| t.0)), degree.unwrap_or(0))
            }
            Data::Product { start, len } => {
                let factors = self.factors(start, len);
                let degree = factors.iter().fold(0i32, |sum, &(f, power)| {
                    sum.saturating_add(self.rank(f).degree.saturating_mul(power))
                });
                (first(&mut factors.iter().map(|f| f.0)), degree)
            }
            Data::Unary(_, a) => (self.rank(a).first_variable, 0),
            Data::Binary(_, a, b) => (first(&mut [a, b].into_iter()), 0),
        };
        Rank {
            first_variable,
            degree,
        }
    }
}

/// Lengths are kept in 32 bits; four thousand million nodes do not fit in memory anyway.
fn u32_len(len: usize) -> u32 {
    u32::try_from(len).expect("an expression arena holds fewer than 2^32 entries")
}
