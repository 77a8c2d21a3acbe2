//! Symbolic derivatives: forward for columns of a Jacobian, reverse for a gradient.
//!
//! Both walk over the same graph: the nodes that depend on a wanted variable, and for each of them the partial
//! derivatives by its children. Shared parts are differentiated once.
//! A kink has the derivative of its sides: `abs' = sign`, `sign' = step' = 0`.

use rustc_hash::FxHashMap;

use super::nodes::Id;
use super::{BinaryFunction, Expr, Exprs, Node, Var};

/// The entries of a Jacobian that are not structurally zero.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseJacobian<'e> {
    /// The number of functions.
    pub rows: usize,
    /// The number of variables.
    pub cols: usize,
    /// Row, column and value, row by row.
    pub entries: Vec<(usize, usize, Expr<'e>)>,
}

/// `∂f_i / ∂x_j`, by one forward sweep per variable over what depends on it.
pub fn jacobian<'e>(functions: &[Expr<'e>], vars: &[Var]) -> SparseJacobian<'e> {
    let graph = Graph::new(functions, vars);
    let mut rows_at: FxHashMap<usize, Vec<usize>> = FxHashMap::default();
    for (i, function) in functions.iter().enumerate() {
        if let Some(&place) = graph.place.get(&function.id) {
            rows_at.entry(place).or_default().push(i);
        }
    }
    let mut entries = Vec::new();
    for (j, &var) in vars.iter().enumerate() {
        for (place, entry) in graph.column(var) {
            if let Some(rows) = rows_at.get(&place).filter(|_| !entry.is_zero()) {
                entries.extend(rows.iter().map(|&i| (i, j, entry)));
            }
        }
    }
    entries.sort_unstable_by_key(|&(i, j, _)| (i, j));
    SparseJacobian {
        rows: functions.len(),
        cols: vars.len(),
        entries,
    }
}

/// `∂f / ∂x_j` for all variables, by one reverse sweep.
pub fn gradient<'e>(function: Expr<'e>, vars: &[Var]) -> Vec<Expr<'e>> {
    let graph = Graph::new(&[function], vars);
    graph.gradient(function, vars)
}

/// `∂²f / ∂x_i ∂x_j` for `i >= j`: the Jacobian of the gradient, below and on the diagonal.
pub fn hessian<'e>(function: Expr<'e>, vars: &[Var]) -> SparseJacobian<'e> {
    let mut hessian = jacobian(&gradient(function, vars), vars);
    hessian.entries.retain(|&(i, j, _)| i >= j);
    hessian
}

/// The nodes below some functions that depend on some variables, children before parents.
struct Graph<'e> {
    nodes: Vec<Expr<'e>>,
    /// The position in `nodes`.
    place: FxHashMap<Id, usize>,
    /// The positions of the children, with the derivatives by them.
    partials: Vec<Vec<(usize, Expr<'e>)>>,
    parents: Vec<Vec<usize>>,
}

impl<'e> Graph<'e> {
    fn new(functions: &[Expr<'e>], vars: &[Var]) -> Self {
        let mut graph = Self {
            nodes: Vec::new(),
            place: FxHashMap::default(),
            partials: Vec::new(),
            parents: Vec::new(),
        };
        let Some(first) = functions.first().filter(|_| !vars.is_empty()) else {
            return graph;
        };
        let mut wanted = vars.to_vec();
        wanted.sort_unstable();
        let order = first.exprs.nodes().below(functions.iter().map(|f| f.id));
        for id in order {
            let node = first.with(id);
            let partials = partials(node, |child| graph.place.contains_key(&child.id));
            let is_wanted = |var| wanted.binary_search(&var).is_ok();
            if !partials.is_empty() || node.as_variable().is_some_and(is_wanted) {
                graph.push(node, partials);
            }
        }
        graph
    }

    fn push(&mut self, node: Expr<'e>, partials: Vec<(Expr<'e>, Expr<'e>)>) {
        let here = self.nodes.len();
        let partials = partials
            .into_iter()
            .map(|(child, partial)| (self.place[&child.id], partial));
        let partials: Vec<_> = partials.collect();
        for &(child, _) in &partials {
            self.parents[child].push(here);
        }
        self.nodes.push(node);
        self.place.insert(node.id, here);
        self.partials.push(partials);
        self.parents.push(Vec::new());
    }

    /// The derivatives by one variable, of the nodes that depend on it.
    fn column(&self, var: Var) -> FxHashMap<usize, Expr<'e>> {
        let mut derivatives = FxHashMap::default();
        let Some(first) = self.nodes.first() else {
            return derivatives;
        };
        let exprs = first.exprs;
        let Some(&seed) = self.place.get(&exprs.expr(var).id) else {
            return derivatives;
        };
        for place in self.above(seed) {
            let terms = self.partials[place].iter();
            let terms =
                terms.filter_map(|(child, partial)| Some(*partial * *derivatives.get(child)?));
            let derivative = if place == seed {
                exprs.constant(1.0)
            } else {
                exprs.sum(terms)
            };
            derivatives.insert(place, derivative);
        }
        derivatives
    }

    /// The nodes that depend on one, itself included, in order.
    fn above(&self, seed: usize) -> Vec<usize> {
        let mut above = rustc_hash::FxHashSet::default();
        let mut stack = vec![seed];
        while let Some(place) = stack.pop() {
            if above.insert(place) {
                stack.extend(&self.parents[place]);
            }
        }
        let mut above: Vec<usize> = above.into_iter().collect();
        above.sort_unstable();
        above
    }

    fn gradient(&self, function: Expr<'e>, vars: &[Var]) -> Vec<Expr<'e>> {
        let exprs = function.exprs;
        // What reaches a node from its parents.
        let mut contributions: Vec<Vec<Expr<'e>>> = vec![Vec::new(); self.nodes.len()];
        let mut adjoints: FxHashMap<Id, Expr<'e>> = FxHashMap::default();
        if let Some(&root) = self.place.get(&function.id) {
            contributions[root].push(exprs.constant(1.0));
        }
        for place in (0..self.nodes.len()).rev() {
            let adjoint = exprs.sum(std::mem::take(&mut contributions[place]));
            adjoints.insert(self.nodes[place].id, adjoint);
            for &(child, partial) in &self.partials[place] {
                contributions[child].push(adjoint * partial);
            }
        }
        let adjoint = |&var: &Var| adjoints.get(&exprs.expr(var).id).copied();
        vars.iter()
            .map(|var| adjoint(var).unwrap_or(exprs.constant(0.0)))
            .collect()
    }
}

impl<'e> Expr<'e> {
    /// `∂self / ∂var`.
    pub fn diff(self, var: Var) -> Expr<'e> {
        let derivative = jacobian(&[self], &[var]).entries.pop();
        derivative.map_or(self.exprs.constant(0.0), |(_, _, derivative)| derivative)
    }
}

/// The wanted children with the derivatives by them.
fn partials<'e>(value: Expr<'e>, wanted: impl Fn(Expr<'e>) -> bool) -> Vec<(Expr<'e>, Expr<'e>)> {
    let mut partials = match value.node() {
        Node::Constant(_) | Node::Variable(_) => Vec::new(),
        Node::Sum { terms, .. } => terms
            .into_iter()
            .map(|(c, term)| (term, value.exprs.constant(c)))
            .collect(),
        Node::Product(factors) => (factors.iter().enumerate())
            .filter(|(_, (factor, _))| wanted(*factor))
            .map(|(i, &(factor, _))| (factor, product_partial(value.exprs, &factors, i)))
            .collect(),
        Node::Unary(function, a) => vec![(a, (function.definition().slope)(value, a))],
        Node::Binary(function, a, b) => {
            let (by_a, by_b) = binary_partials(value, function, a, b);
            vec![(a, by_a), (b, by_b)]
        }
    };
    partials.retain(|(child, _)| wanted(*child));
    partials
}

/// `p f^(p-1)` times the other factors.
fn product_partial<'e>(exprs: &'e Exprs, factors: &[(Expr<'e>, i32)], which: usize) -> Expr<'e> {
    let power = |(i, &(factor, p)): (usize, &(Expr<'e>, i32))| {
        (factor.id, if i == which { p.saturating_sub(1) } else { p })
    };
    exprs.build(|arena| {
        arena.product(
            f64::from(factors[which].1),
            factors.iter().enumerate().map(power),
        )
    })
}

/// The derivatives of `value`, which is `function(a, b)`, by a and b.
fn binary_partials<'e>(
    value: Expr<'e>,
    function: BinaryFunction,
    a: Expr<'e>,
    b: Expr<'e>,
) -> (Expr<'e>, Expr<'e>) {
    match function {
        BinaryFunction::Pow => (b * a.powf(b - 1.0), value * a.log()),
        BinaryFunction::Atan2 => {
            let square = a * a + b * b;
            (b / square, -a / square)
        }
        BinaryFunction::Min => ((b - a).step(), (a - b).step()),
        BinaryFunction::Max => ((a - b).step(), (b - a).step()),
    }
}

#[cfg(test)]
mod tests {
    use insta::assert_snapshot;

    use super::*;
    use crate::variables_of;

    fn show(jacobian: &SparseJacobian) -> String {
        let line = |(i, j, entry): &(usize, usize, Expr)| format!("{i} {j}: {entry}\n");
        jacobian.entries.iter().map(line).collect()
    }

    #[test]
    fn derivatives_read_like_those_of_a_book() {
        let e = Exprs::new();
        let x = e.variables("x", 2);
        let var = x[0].as_variable().unwrap();
        assert_snapshot!((x[0].powi(3) * x[1].sin() / x[0].sqrt()).diff(var), @"-0.5*x[1]^3*sin(x[2])/sqrt(x[1])^3 + 3*x[1]^2*sin(x[2])/sqrt(x[1])");
        assert_snapshot!((x[1] / (1.0 + x[0] * x[0])).diff(var), @"-2*x[1]*x[2]/(x[1]^2 + 1)^2");
        assert_snapshot!((x[0].tanh() + x[1].atan2(x[0]) + x[0].powf(x[1])).diff(var), @"x[1]^(x[2] - 1)*x[2] - tanh(x[1])^2 - x[2]/(x[1]^2 + x[2]^2) + 1");
        assert_snapshot!((x[0].abs() + x[0].max(x[1]) * x[1]).diff(var), @"step(x[1] - x[2])*x[2] + sign(x[1])");
    }

    #[test]
    fn a_jacobian_has_no_structural_zeros() {
        let e = Exprs::new();
        let x = e.variables("x", 3);
        let vars = variables_of(&x);
        let functions = [x[1], x[0] * x[2] - x[1], e.constant(1.0), x[2].cos()];
        assert_snapshot!(show(&jacobian(&functions, &vars)), @r"
0 1: 1
1 0: x[3]
1 1: -1
1 2: x[1]
3 2: -sin(x[3])
");
    }

    #[test]
    fn the_gradient_is_the_row_of_the_jacobian() {
        let e = Exprs::new();
        let x = e.variables("x", 3);
        let vars = variables_of(&x);
        let f = (x[0] * x[1]).sin() * x[0] + x[1] * x[2].exp();
        let row = jacobian(&[f], &vars).entries;
        let value = |entry: Expr| entry.eval(&|var| 0.3 + var.index() as f64);
        for ((_, _, forward), reverse) in row.into_iter().zip(gradient(f, &vars)) {
            assert!((value(forward) - value(reverse)).abs() < 1e-14);
        }
    }

    #[test]
    fn a_hessian_is_its_lower_triangle() {
        let e = Exprs::new();
        let x = e.variables("x", 3);
        let vars = variables_of(&x);
        assert_snapshot!(show(&hessian(x[0] * x[1] * x[1] + x[2].powi(3) - x[0], &vars)), @r"
1 0: 2*x[2]
1 1: 2*x[1]
2 2: 6*x[3]
");
    }
}
