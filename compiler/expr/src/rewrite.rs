//! Walking below expressions: substitution and rewriting, all in order of the node numbers.

use rustc_hash::{FxHashMap, FxHashSet};

use super::arena::Arena;
use super::nodes::{Data, Id};
use super::{Expr, Node, Var};

impl Arena {
    /// The same node over other children.
    fn rebuild(&mut self, id: Id, child: impl Fn(Id) -> Id) -> Id {
        let mut changed = false;
        self.nodes.for_each_child(id, |c| changed |= child(c) != c);
        if !changed {
            return id;
        }
        match self.nodes.data(id) {
            Data::Constant(_) | Data::Variable(_) => id,
            Data::Sum {
                constant,
                start,
                len,
            } => {
                let terms = self.nodes.terms(start, len).iter();
                let terms: Vec<_> = terms.map(|&(term, c)| (child(term), c)).collect();
                self.sum(constant, terms)
            }
            Data::Product { start, len } => {
                let factors = self.nodes.factors(start, len).iter();
                let factors: Vec<_> = factors.map(|&(factor, p)| (child(factor), p)).collect();
                self.product(1.0, factors)
            }
            Data::Unary(function, a) => self.apply(function, child(a)),
            Data::Binary(function, a, b) => self.apply_binary(function, child(a), child(b)),
        }
    }
}

/// Rewrites bottom-up: `f` sees every node below once, over children that are rewritten already.
///
/// What `f` returns is not visited again.
pub fn rewrite<'e>(expr: Expr<'e>, f: &mut impl FnMut(Expr<'e>) -> Expr<'e>) -> Expr<'e> {
    rewrite_all(&[expr], f)[0]
}

/// [`rewrite`] for several expressions: a node that they share is seen once.
pub fn rewrite_all<'e>(
    roots: &[Expr<'e>],
    f: &mut impl FnMut(Expr<'e>) -> Expr<'e>,
) -> Vec<Expr<'e>> {
    transform(roots, &mut |_, rebuilt| f(rebuilt))
}

/// Rewrites bottom-up by a function of a node and of that node over rewritten children.
pub fn transform<'e>(
    roots: &[Expr<'e>],
    f: &mut impl FnMut(Expr<'e>, Expr<'e>) -> Expr<'e>,
) -> Vec<Expr<'e>> {
    let Some(&first) = roots.first() else {
        return Vec::new();
    };
    let order = first.exprs.nodes().below(roots.iter().map(|root| root.id));
    transform_in(&order, roots, f)
}

/// [`transform`] where the nodes below are known.
fn transform_in<'e>(
    order: &[Id],
    roots: &[Expr<'e>],
    f: &mut impl FnMut(Expr<'e>, Expr<'e>) -> Expr<'e>,
) -> Vec<Expr<'e>> {
    let Some(&first) = roots.first() else {
        return Vec::new();
    };
    let place = |id: Id| order.partition_point(|&other| other < id);
    let mut images: Vec<Id> = Vec::with_capacity(order.len());
    for &id in order {
        let rebuilt = first
            .exprs
            .build(|arena| arena.rebuild(id, |child| images[place(child)]));
        images.push(f(first.with(id), rebuilt).id);
    }
    let image = |root: &Expr<'e>| root.with(images[place(root.id)]);
    roots.iter().map(image).collect()
}

/// What an expression is made of.
pub fn children(e: Expr<'_>) -> Vec<Expr<'_>> {
    match e.node() {
        Node::Constant(_) | Node::Variable(_) => Vec::new(),
        Node::Sum { terms, .. } => terms.into_iter().map(|(_, term)| term).collect(),
        Node::Product(factors) => factors.into_iter().map(|(factor, _)| factor).collect(),
        Node::Unary(_, a) => vec![a],
        Node::Binary(_, a, b) => vec![a, b],
    }
}

/// Whether something inside of an expression has a kink or a step.
pub fn has_kinks(expr: Expr<'_>) -> bool {
    let mut found = false;
    rewrite(expr, &mut |e| {
        found |= match e.node() {
            Node::Unary(function, _) => function.is_nonsmooth(),
            Node::Binary(function, ..) => function.is_nonsmooth(),
            _ => false,
        };
        e
    });
    found
}

/// The variables below the expressions, in order of creation.
pub fn variables_of(roots: &[Expr]) -> Vec<Var> {
    let Some(first) = roots.first() else {
        return Vec::new();
    };
    let nodes = first.exprs.nodes();
    let mut vars = Vec::new();
    let ids = roots.iter().map(|root| root.id);
    nodes.visit_below(ids, |id| vars.extend(nodes.as_variable(id)));
    vars.sort_unstable();
    vars
}

/// How many different nodes an expression consists of.
pub fn n_nodes_of(root: Expr) -> usize {
    root.exprs.nodes().below([root.id]).len()
}

/// What lies below a growing set of expressions; each node is visited once.
#[derive(Debug, Default)]
pub struct Reach {
    seen: FxHashSet<Id>,
}

impl Reach {
    /// The variables below an expression that were not below any earlier one.
    pub fn new_variables(&mut self, root: Expr) -> Vec<Var> {
        let nodes = root.exprs.nodes();
        let mut found = Vec::new();
        let mut stack = vec![root.id];
        while let Some(id) = stack.pop() {
            if self.seen.insert(id) {
                found.extend(nodes.as_variable(id));
                nodes.for_each_child(id, |child| stack.push(child));
            }
        }
        found
    }
}

/// Which expression takes the place of which variable.
#[derive(Clone, Debug, Default)]
pub struct Substitution<'e> {
    values: FxHashMap<Var, Expr<'e>>,
}

impl<'e> Substitution<'e> {
    /// Replaces nothing.
    pub fn new() -> Self {
        Self::default()
    }

    /// Replaces one variable.
    pub fn one(var: Var, value: Expr<'e>) -> Self {
        [(var, value)].into_iter().collect()
    }

    /// Whether a variable is replaced.
    pub fn contains(&self, var: &Var) -> bool {
        self.values.contains_key(var)
    }

    /// Replaces `var` by `value`; all variables are replaced at once.
    pub fn insert(&mut self, var: Var, value: Expr<'e>) {
        self.values.insert(var, value);
    }

    /// The replacement of a variable.
    pub fn get(&self, var: Var) -> Option<Expr<'e>> {
        self.values.get(&var).copied()
    }

    /// [`Expr::substitute`] for several expressions: what they share is rewritten once.
    pub fn apply(&self, roots: &[Expr<'e>]) -> Vec<Expr<'e>> {
        let Some(first) = roots.first().filter(|_| !self.is_empty()) else {
            return roots.to_vec();
        };
        let order = {
            let nodes = first.exprs.nodes();
            let order = nodes.below(roots.iter().map(|root| root.id));
            let mut vars = order.iter().filter_map(|&id| nodes.as_variable(id));
            if !vars.any(|var| self.contains(&var)) {
                return roots.to_vec();
            }
            order
        };
        // Only nodes that were variables before: `-x` may have become one.
        transform_in(&order, roots, &mut |node, rebuilt| {
            let value = node.as_variable().and_then(|var| self.get(var));
            value.unwrap_or(rebuilt)
        })
    }

    /// Replaces variables in the replacements.
    pub fn then(&mut self, next: &Substitution<'e>) {
        for value in self.values.values_mut() {
            *value = value.substitute(next);
        }
    }

    /// What is replaced, with the replacements.
    pub fn pairs(&self) -> impl Iterator<Item = (Var, Expr<'e>)> + '_ {
        self.values.iter().map(|(&var, &value)| (var, value))
    }

    /// Whether nothing is replaced.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }
}

impl<'e> FromIterator<(Var, Expr<'e>)> for Substitution<'e> {
    fn from_iter<I: IntoIterator<Item = (Var, Expr<'e>)>>(pairs: I) -> Self {
        Self {
            values: pairs.into_iter().collect(),
        }
    }
}

impl<'e> Extend<(Var, Expr<'e>)> for Substitution<'e> {
    fn extend<I: IntoIterator<Item = (Var, Expr<'e>)>>(&mut self, pairs: I) {
        self.values.extend(pairs);
    }
}

impl<'e> Expr<'e> {
    /// Replaces variables, all at once, and folds.
    pub fn substitute(self, substitution: &Substitution<'e>) -> Expr<'e> {
        match substitution.is_empty() {
            true => self,
            false => substitution.apply(&[self])[0],
        }
    }

    /// Whether the variable occurs.
    pub fn depends_on(self, var: Var) -> bool {
        let nodes = self.exprs.nodes();
        let (id, mut found) = (nodes.variable(var), false);
        nodes.visit_below([self.id], |node| found |= node == id);
        found
    }
}
