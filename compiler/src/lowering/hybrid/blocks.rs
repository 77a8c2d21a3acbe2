//! Which rates are compiled together.
//!
//! Rates with costly expressions in common form a block, which computes them once. To have an α in
//! common is no reason: then every change of one side would concern all that is connected.

use nsd_solver::hybrid::Block;
use petgraph::unionfind::UnionFind;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::expr::{Expr, Node, Var, children};

/// Operations below this number are rather repeated than shared between blocks.
const CHEAP: u32 = 6;

/// What a function costs in operations.
const FUNCTION: u32 = 4;

/// Systems with no more states than this, and no more switches, are one block.
const SMALL: usize = 4;

/// Cuts rates into blocks, in order of their first states. `switches` are those in every rate.
pub(crate) fn cut(rates: &[Expr], switches: &[Vec<usize>], alphas: &[Var]) -> Vec<Block> {
    let mut cutter = Cutter {
        alphas: alphas.iter().copied().collect(),
        costs: FxHashMap::default(),
        owners: FxHashMap::default(),
        joined: UnionFind::new(rates.len()),
    };
    let small = rates.len() <= SMALL && alphas.len() <= SMALL;
    for (state, &rate) in rates.iter().enumerate() {
        if small {
            cutter.joined.union(state, 0);
        }
        cutter.visit(rate, state);
    }
    let mut blocks: Vec<Block> = Vec::new();
    let mut place = FxHashMap::default();
    for (state, inside) in switches.iter().enumerate() {
        let at = *place
            .entry(cutter.joined.find_mut(state))
            .or_insert_with(|| {
                blocks.push(Block::default());
                blocks.len() - 1
            });
        blocks[at].states.push(state);
        blocks[at].switches.extend(inside);
    }
    for block in &mut blocks {
        block.switches.sort_unstable();
        block.switches.dedup();
    }
    blocks
}

struct Cutter<'e> {
    alphas: FxHashSet<Var>,
    /// Operations of an expression, none where it becomes a number once the sides are known.
    costs: FxHashMap<Expr<'e>, u32>,
    /// The first rate that an expression occurs in.
    owners: FxHashMap<Expr<'e>, usize>,
    /// The blocks as sets of rates.
    joined: UnionFind<usize>,
}

impl<'e> Cutter<'e> {
    /// Joins the block of a rate with those that have costly expressions in common with it.
    fn visit(&mut self, rate: Expr<'e>, state: usize) {
        let mut stack = vec![rate];
        while let Some(e) = stack.pop() {
            if let Some(&owner) = self.owners.get(&e) {
                if self.cost(e) >= CHEAP {
                    self.joined.union(state, owner);
                }
                continue;
            }
            self.owners.insert(e, state);
            stack.extend(children(e));
        }
    }

    /// Operations of an expression as a tree, no more than [`CHEAP`] of them.
    fn cost(&mut self, root: Expr<'e>) -> u32 {
        let mut stack = vec![root];
        while let Some(&e) = stack.last() {
            let below = children(e);
            let open = below.iter().filter(|child| !self.costs.contains_key(child));
            let open: Vec<_> = open.copied().collect();
            if !open.is_empty() && !self.costs.contains_key(&e) {
                stack.extend(open);
                continue;
            }
            stack.pop();
            let inner: u32 = below.iter().map(|child| self.costs[child]).sum();
            let cost = match e.node() {
                Node::Variable(var) => u32::from(!self.alphas.contains(&var)),
                Node::Unary(..) | Node::Binary(..) if inner > 0 => inner + FUNCTION,
                _ => inner,
            };
            self.costs.insert(e, cost.min(CHEAP));
        }
        self.costs[&root]
    }
}
