//! Hash-consing: equal nodes are one.

use std::hash::{Hash, Hasher};

use rustc_hash::{FxHashMap, FxHasher};

use super::nodes::{Data, Id, Nodes};
use super::{BinaryFunction, Function};

#[derive(Debug, Default)]
pub(super) struct Arena {
    pub nodes: Nodes,
    /// The latest node of every hash, and for every node the previous one with its hash.
    latest: FxHashMap<u64, Id>,
    previous: Vec<Id>,
    /// Functions of one argument that occur, as bits.
    functions: u32,
}

const NONE: Id = Id::MAX;

impl Arena {
    pub fn applies(&self, function: Function) -> bool {
        self.functions >> function as u32 & 1 == 1
    }

    /// A variable that equals no other one, whatever its name.
    pub fn fresh_variable(&mut self, name: &str) -> Id {
        self.previous.push(NONE);
        self.nodes.push_variable(name)
    }

    /// `-0` becomes `0`, so that equal numbers are one node.
    pub fn constant(&mut self, value: f64) -> Id {
        let value = value + 0.0;
        let hash = hash_of(|h| (0u8, value.to_bits()).hash(h));
        let same = |data: Data, _: &Nodes| matches!(data, Data::Constant(v) if v.to_bits() == value.to_bits());
        self.intern(hash, same, |nodes| nodes.push(Data::Constant(value)))
    }

    pub fn unary(&mut self, function: Function, a: Id) -> Id {
        let hash = hash_of(|h| (1u8, function, a).hash(h));
        let same =
            |data: Data, _: &Nodes| matches!(data, Data::Unary(f, x) if f == function && x == a);
        self.functions |= 1 << function as u32;
        self.intern(hash, same, |nodes| nodes.push(Data::Unary(function, a)))
    }

    pub fn binary(&mut self, function: BinaryFunction, a: Id, b: Id) -> Id {
        let hash = hash_of(|h| (2u8, function, a, b).hash(h));
        let same = |data: Data, _: &Nodes| matches!(data, Data::Binary(f, x, y) if f == function && x == a && y == b);
        self.intern(hash, same, |nodes| nodes.push(Data::Binary(function, a, b)))
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
        let same = |data: Data, nodes: &Nodes| {
            matches!(data, Data::Sum { constant: c, start, len }
                if c.to_bits() == constant.to_bits() && nodes.terms(start, len) == terms)
        };
        self.intern(hash, same, |nodes| nodes.push_sum(constant, terms))
    }

    /// Interns a product whose factors are already in canonical form; see `simplify`.
    pub fn canonical_product(&mut self, factors: &[(Id, i32)]) -> Id {
        let hash = hash_of(|h| (4u8, factors).hash(h));
        let same = |data: Data, nodes: &Nodes| matches!(data, Data::Product { start, len } if nodes.factors(start, len) == factors);
        self.intern(hash, same, |nodes| nodes.push_product(factors))
    }

    fn intern(
        &mut self,
        hash: u64,
        same: impl Fn(Data, &Nodes) -> bool,
        make: impl FnOnce(&mut Nodes) -> Id,
    ) -> Id {
        let latest = self.latest.get(&hash).copied().unwrap_or(NONE);
        let mut candidate = latest;
        while candidate != NONE {
            if same(self.nodes.data(candidate), &self.nodes) {
                return candidate;
            }
            candidate = self.previous[candidate as usize];
        }
        let id = make(&mut self.nodes);
        self.previous.push(latest);
        self.latest.insert(hash, id);
        id
    }
}

fn hash_of(feed: impl FnOnce(&mut FxHasher)) -> u64 {
    let mut hasher = FxHasher::default();
    feed(&mut hasher);
    hasher.finish()
}
