//! Storage and hash-consing.
//!
//! A node is a `u32`; equal nodes have the same number, and children have smaller numbers than their parents.
//! So ascending numbers are a topological order, and no algorithm here needs recursion.

use std::cell::RefCell;
use std::hash::{Hash, Hasher};

use rustc_hash::{FxHashMap, FxHasher};

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

#[derive(Debug, Default)]
pub(super) struct Arena {
    nodes: Vec<Data>,
    ranks: Vec<Rank>,
    terms: Vec<(Id, f64)>,
    factors: Vec<(Id, i32)>,
    /// The latest node of every hash, and for every node the previous one with its hash.
    latest: FxHashMap<u64, Id>,
    previous: Vec<Id>,
    /// Functions of one argument that occur, as bits.
    functions: u32,
    names: Vec<String>,
    variables: Vec<Id>,
    /// Memory of walks.
    pub(super) walk: RefCell<Walk>,
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

const NONE: Id = Id::MAX;

impl Arena {
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    pub fn data(&self, id: Id) -> Data {
        self.nodes[id as usize]
    }

    pub fn applies(&self, function: Function) -> bool {
        self.functions >> function as u32 & 1 == 1
    }

    pub fn as_variable(&self, id: Id) -> Option<Var> {
        match self.data(id) {
            Data::Variable(var) => Some(var),
            _ => None,
        }
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

    /// A variable that equals no other one, whatever its name.
    pub fn fresh_variable(&mut self, name: &str) -> Id {
        let var = Var(u32_len(self.variables.len()));
        self.names.push(name.to_owned());
        let id = self.push(Data::Variable(var), NONE);
        self.variables.push(id);
        id
    }

    /// `-0` becomes `0`, so that equal numbers are one node.
    pub fn constant(&mut self, value: f64) -> Id {
        let value = value + 0.0;
        let hash = hash_of(|h| (0u8, value.to_bits()).hash(h));
        let same = |data: Data, _: &Self| matches!(data, Data::Constant(v) if v.to_bits() == value.to_bits());
        self.intern(hash, same, |_| Data::Constant(value))
    }

    pub fn unary(&mut self, function: Function, a: Id) -> Id {
        let hash = hash_of(|h| (1u8, function, a).hash(h));
        let same =
            |data: Data, _: &Self| matches!(data, Data::Unary(f, x) if f == function && x == a);
        self.functions |= 1 << function as u32;
        self.intern(hash, same, |_| Data::Unary(function, a))
    }

    pub fn binary(&mut self, function: BinaryFunction, a: Id, b: Id) -> Id {
        let hash = hash_of(|h| (2u8, function, a, b).hash(h));
        let same = |data: Data, _: &Self| matches!(data, Data::Binary(f, x, y) if f == function && x == a && y == b);
        self.intern(hash, same, |_| Data::Binary(function, a, b))
    }

    /// Interns a sum whose terms are already in canonical form; see `simplify`.
    pub fn canonical_sum(&mut self, constant: f64, terms: &[(Id, f64)]) -> Id {
        let constant = constant + 0.0;
        let hash = hash_of(|h| {
            (3u8, constant.to_bits()).hash(h);
            for (id, coefficient) in terms {
                (*id, coefficient.to_bits()).hash(h);
            }
        });
        let same = |data: Data, arena: &Self| {
            matches!(data, Data::Sum { constant: c, start, len }
                if c.to_bits() == constant.to_bits() && arena.terms(start, len) == terms)
        };
        self.intern(hash, same, |arena| {
            let start = u32_len(arena.terms.len());
            arena.terms.extend_from_slice(terms);
            Data::Sum {
                constant,
                start,
                len: u32_len(terms.len()),
            }
        })
    }

    /// Interns a product whose factors are already in canonical form; see `simplify`.
    pub fn canonical_product(&mut self, factors: &[(Id, i32)]) -> Id {
        let hash = hash_of(|h| (4u8, factors).hash(h));
        let same = |data: Data, arena: &Self| matches!(data, Data::Product { start, len } if arena.factors(start, len) == factors);
        self.intern(hash, same, |arena| {
            let start = u32_len(arena.factors.len());
            arena.factors.extend_from_slice(factors);
            Data::Product {
                start,
                len: u32_len(factors.len()),
            }
        })
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

    fn intern(
        &mut self,
        hash: u64,
        same: impl Fn(Data, &Self) -> bool,
        make: impl FnOnce(&mut Self) -> Data,
    ) -> Id {
        let latest = self.latest.get(&hash).copied().unwrap_or(NONE);
        let mut candidate = latest;
        while candidate != NONE {
            if same(self.data(candidate), self) {
                return candidate;
            }
            candidate = self.previous[candidate as usize];
        }
        let data = make(self);
        let id = self.push(data, latest);
        self.latest.insert(hash, id);
        id
    }

    fn push(&mut self, data: Data, previous: Id) -> Id {
        let id = u32_len(self.nodes.len());
        let rank = self.rank_of(data);
        self.nodes.push(data);
        self.ranks.push(rank);
        self.previous.push(previous);
        id
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

fn hash_of(feed: impl FnOnce(&mut FxHasher)) -> u64 {
    let mut hasher = FxHasher::default();
    feed(&mut hasher);
    hasher.finish()
}

/// Lengths are kept in 32 bits; four thousand million nodes do not fit in memory anyway.
fn u32_len(len: usize) -> u32 {
    u32::try_from(len).expect("an expression arena holds fewer than 2^32 entries")
}
