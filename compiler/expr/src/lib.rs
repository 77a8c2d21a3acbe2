//! Hash-consed expressions in canonical form.
//!
//! An [`Exprs`] owns all nodes; an [`Expr`] is a copyable handle with operators, so that a lowering reads like its
//! equations: `g - lambda - mu`. Equal expressions are the same node: comparing two costs one comparison.
//!
//! Invariants:
//! - children have smaller numbers than their parents, so nothing here recurses;
//! - sums and products are in the canonical form of `simplify`, in an order that depends only on the order of creation;
//! - names belong to variables and mean nothing: two variables of one name are two variables;
//! - an expression holds no source position; side tables do.

mod arena;
mod compile;
mod degree;
mod derivative;
mod evaluate;
mod function;
mod identity;
mod interval;
mod layout;
mod nodes;
mod operators;
mod print;
mod rewrite;
mod simplify;
#[cfg(test)]
mod tests;

use std::cell::{Ref, RefCell};
use std::fmt;
use std::hash::{Hash, Hasher};

use arena::Arena;
use nodes::{Data, Id, Nodes};

pub use compile::{CompileError, compile};
pub use derivative::{SparseJacobian, gradient, hessian, jacobian};
pub use evaluate::Evaluator;
pub use function::{BinaryFunction, Definition, Function, Steep, Unit};
pub use interval::Interval;
pub use operators::{dot, sum};
pub use rewrite::{
    Reach, Substitution, children, has_kinks, n_nodes_of, rewrite, rewrite_all, transform,
    variables_of,
};

/// The owner of all nodes.
#[derive(Debug, Default)]
pub struct Exprs {
    arena: RefCell<Arena>,
}

/// A variable of one [`Exprs`]; ordered by creation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Var(u32);

/// An expression: a handle to a node of an [`Exprs`].
#[derive(Clone, Copy)]
pub struct Expr<'e> {
    exprs: &'e Exprs,
    id: Id,
}

/// One level of an expression.
#[derive(Clone, Debug, PartialEq)]
pub enum Node<'e> {
    /// A number.
    Constant(f64),
    /// A variable.
    Variable(Var),
    /// `constant + Σ coefficient * term`; a numeric multiple is a sum with one term and constant 0.
    Sum {
        /// The number added.
        constant: f64,
        /// Coefficients, none of them 0, and distinct terms.
        terms: Vec<(f64, Expr<'e>)>,
    },
    /// `Π factor ^ power` with distinct factors; a lone factor has a power other than 1.
    Product(Vec<(Expr<'e>, i32)>),
    /// A function of one argument.
    Unary(Function, Expr<'e>),
    /// A function of two arguments.
    Binary(BinaryFunction, Expr<'e>, Expr<'e>),
}

impl Node<'_> {
    /// Whether it has a kink or a jump, whatever its arguments are.
    pub fn is_nonsmooth(&self) -> bool {
        match self {
            Node::Unary(function, _) => function.is_nonsmooth(),
            Node::Binary(function, ..) => function.is_nonsmooth(),
            _ => false,
        }
    }
}

impl Var {
    /// The position in the order of creation.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl Exprs {
    /// An empty arena.
    pub fn new() -> Self {
        Self::default()
    }

    /// A number.
    pub fn constant(&self, value: f64) -> Expr<'_> {
        self.build(|arena| arena.constant(value))
    }

    /// A new variable; it differs from earlier ones of the same name.
    pub fn variable(&self, name: &str) -> Expr<'_> {
        self.build(|arena| arena.fresh_variable(name))
    }

    /// New variables `name[1]`, ..., `name[n]`.
    pub fn variables(&self, name: &str, n: usize) -> Vec<Expr<'_>> {
        (1..=n)
            .map(|i| self.variable(&format!("{name}[{i}]")))
            .collect()
    }

    /// The variable as an expression.
    pub fn expr(&self, var: Var) -> Expr<'_> {
        let id = self.nodes().variable(var);
        Expr { exprs: self, id }
    }

    /// The name of a variable.
    pub fn name(&self, var: Var) -> String {
        self.nodes().name(var).to_owned()
    }

    /// Gives a variable another name.
    pub fn rename(&self, var: Var, name: &str) {
        self.arena.borrow_mut().nodes.rename(var, name);
    }

    /// The number of variables so far.
    pub fn n_variables(&self) -> usize {
        self.nodes().n_variables()
    }

    /// Whether any expression so far applies this function.
    pub fn applies(&self, function: Function) -> bool {
        self.arena.borrow().applies(function)
    }

    /// The number of nodes so far: what all expressions together cost.
    pub fn n_nodes(&self) -> usize {
        self.nodes().len()
    }

    fn nodes(&self) -> Ref<'_, Nodes> {
        Ref::map(self.arena.borrow(), |arena| &arena.nodes)
    }

    fn build(&self, make: impl FnOnce(&mut Arena) -> Id) -> Expr<'_> {
        let id = make(&mut self.arena.borrow_mut());
        Expr { exprs: self, id }
    }
}

impl<'e> Expr<'e> {
    /// The owner.
    pub fn exprs(self) -> &'e Exprs {
        self.exprs
    }

    /// One level of structure.
    pub fn node(self) -> Node<'e> {
        let at = |id| self.with(id);
        let nodes = self.exprs.nodes();
        match nodes.data(self.id) {
            Data::Constant(value) => Node::Constant(value),
            Data::Variable(var) => Node::Variable(var),
            Data::Sum {
                constant,
                start,
                len,
            } => {
                let terms = nodes
                    .terms(start, len)
                    .iter()
                    .map(|&(term, c)| (c, at(term)));
                Node::Sum {
                    constant,
                    terms: terms.collect(),
                }
            }
            Data::Product { start, len } => {
                let factors = nodes.factors(start, len).iter();
                Node::Product(
                    factors
                        .map(|&(factor, power)| (at(factor), power))
                        .collect(),
                )
            }
            Data::Unary(function, a) => Node::Unary(function, at(a)),
            Data::Binary(function, a, b) => Node::Binary(function, at(a), at(b)),
        }
    }

    /// The value of a number.
    pub fn as_constant(self) -> Option<f64> {
        self.exprs.nodes().number(self.id)
    }

    /// The variable, if the expression is nothing else.
    pub fn as_variable(self) -> Option<Var> {
        match self.data() {
            Data::Variable(var) => Some(var),
            _ => None,
        }
    }

    /// Whether the expression is a function of others, neither their sum nor their product.
    pub fn is_function(self) -> bool {
        matches!(self.data(), Data::Unary(..) | Data::Binary(..))
    }

    /// Whether the expression is the number 0.
    pub fn is_zero(self) -> bool {
        self.as_constant() == Some(0.0)
    }

    /// `(c, e)` with `self = c * e`, such that equal, opposite and proportional expressions have the same `e`.
    ///
    /// The leading term of `e` has the coefficient 1; in a product this holds for every factor that is a sum.
    /// A coefficient of `e` within rounding of a short decimal number is that number, so that rounding does not
    /// separate what is equal on paper.
    pub fn split_scale(self) -> (f64, Expr<'e>) {
        let one_level = self.split_leading();
        let Node::Product(factors) = one_level.1.node() else {
            return one_level;
        };
        let mut scale = one_level.0;
        let mut normal = Vec::with_capacity(factors.len());
        for (factor, power) in factors {
            let (c, factor) = factor.split_leading();
            scale *= c.powi(power);
            normal.push((factor.id, power));
        }
        if !nsd_solver::tape::is_moderate(scale) {
            return one_level;
        }
        (scale, self.exprs.build(|arena| arena.product(1.0, normal)))
    }

    fn split_leading(self) -> (f64, Expr<'e>) {
        match self.as_constant() {
            Some(0.0) => return (1.0, self),
            Some(value) => return (value, self.exprs.constant(1.0)),
            None => {}
        }
        match self.node() {
            Node::Sum { .. } => {
                let mut arena = self.exprs.arena.borrow_mut();
                let scale = layout::leading_coefficient(&arena.nodes, self.id);
                match arena.divide_to_decimals(self.id, scale) {
                    Some(normal) => (scale, self.with(normal)),
                    None => (1.0, self),
                }
            }
            _ => (1.0, self),
        }
    }

    fn data(self) -> Data {
        self.exprs.nodes().data(self.id)
    }

    fn with(self, id: Id) -> Self {
        Self {
            exprs: self.exprs,
            id,
        }
    }
}

impl PartialEq for Expr<'_> {
    fn eq(&self, other: &Self) -> bool {
        debug_assert!(
            std::ptr::eq(self.exprs, other.exprs),
            "expressions of one comparison share their owner"
        );
        self.id == other.id
    }
}

impl Eq for Expr<'_> {}

impl Hash for Expr<'_> {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.id.hash(state);
    }
}

/// By creation: deterministic, and without mathematical meaning.
impl Ord for Expr<'_> {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.id.cmp(&other.id)
    }
}

impl PartialOrd for Expr<'_> {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl fmt::Debug for Expr<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
