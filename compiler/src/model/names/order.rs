//! Dependencies between declarations: an order in which each comes after what it needs.

use miette::LabeledSpan;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::source::Span;
use crate::syntax::{Arg, Binder, Expr, ExprKind, Index};

/// Names an expression reads that it does not bind itself, in order of appearance.
pub(crate) fn free_names(expr: &Expr) -> Vec<String> {
    let mut walk = Walk::default();
    walk.expr(expr);
    walk.names
}

/// [`free_names`] of several expressions with the same names bound around them.
pub(crate) fn free_names_under<'a>(
    bound: &[String],
    exprs: impl Iterator<Item = &'a Expr>,
) -> Vec<String> {
    let mut walk = Walk {
        bound: bound.to_vec(),
        ..Walk::default()
    };
    exprs.for_each(|expr| walk.expr(expr));
    walk.names
}

#[derive(Default)]
struct Walk {
    names: Vec<String>,
    seen: FxHashSet<String>,
    bound: Vec<String>,
    looking_for: Option<String>,
    found: Option<Span>,
}

impl Walk {
    fn expr(&mut self, expr: &Expr) {
        match &expr.kind {
            ExprKind::Number(_) | ExprKind::String(_) => {}
            ExprKind::Name(name) => {
                if !self.bound.contains(name) && self.seen.insert(name.clone()) {
                    self.names.push(name.clone());
                    if self.looking_for.as_ref() == Some(name) {
                        self.found = Some(expr.span);
                    }
                }
            }
            ExprKind::Field(base, _) | ExprKind::Negate(base) | ExprKind::Not(base) => {
                self.expr(base)
            }
            ExprKind::Index(base, indices) => {
                self.expr(base);
                for index in indices {
                    match index {
                        Index::All(_) => {}
                        Index::One(one) => self.expr(one),
                        Index::Range(first, last) => {
                            self.expr(first);
                            self.expr(last);
                        }
                    }
                }
            }
            ExprKind::Call(function, args) => {
                self.expr(function);
                for arg in args {
                    match arg {
                        Arg::Named(_, value) => self.expr(value),
                        Arg::Positional(value, binders) => self.under(binders, value),
                    }
                }
            }
            ExprKind::Matrix(matrix) => matrix
                .rows
                .iter()
                .flatten()
                .for_each(|entry| self.expr(entry)),
            ExprKind::Comprehension(body, binders) => self.under(binders, body),
            ExprKind::Binary(_, a, b) => {
                self.expr(a);
                self.expr(b);
            }
            ExprKind::Chain(first, rest) => {
                self.expr(first);
                rest.iter().for_each(|(_, operand)| self.expr(operand));
            }
            ExprKind::And(members) | ExprKind::Or(members) => {
                members.iter().for_each(|member| self.expr(member))
            }
            ExprKind::Compare(first, rest) => {
                self.expr(first);
                rest.iter().for_each(|(_, member)| self.expr(member));
            }
            ExprKind::If(c, a, b) => {
                self.expr(c);
                self.expr(a);
                self.expr(b);
            }
        }
    }

    fn under(&mut self, binders: &[Binder], body: &Expr) {
        let depth = self.bound.len();
        for binder in binders {
            self.expr(&binder.first);
            self.expr(&binder.last);
            self.bound.push(binder.name.name.clone());
        }
        self.expr(body);
        self.bound.truncate(depth);
    }
}

/// Nodes in an order where needs come first, or the nodes of a cycle in order.
pub(crate) fn topological(needs: &[Vec<usize>]) -> (Vec<usize>, Vec<Vec<usize>>) {
    #[derive(Clone, Copy, PartialEq)]
    enum Mark {
        New,
        Open,
        Done,
    }
    let mut marks = vec![Mark::New; needs.len()];
    let (mut order, mut cycles) = (Vec::new(), Vec::new());
    for start in 0..needs.len() {
        if marks[start] != Mark::New {
            continue;
        }
        // Depth first with a stack of its own: chains may be as long as the file.
        let mut path = vec![(start, 0)];
        marks[start] = Mark::Open;
        while let Some(&mut (node, ref mut next)) = path.last_mut() {
            let Some(&need) = needs[node].get(*next) else {
                marks[node] = Mark::Done;
                order.push(node);
                path.pop();
                continue;
            };
            *next += 1;
            match marks[need] {
                Mark::Done => {}
                Mark::New => {
                    marks[need] = Mark::Open;
                    path.push((need, 0));
                }
                Mark::Open => {
                    let from = path.iter().position(|&(open, _)| open == need).unwrap_or(0);
                    cycles.push(path[from..].iter().map(|&(node, _)| node).collect());
                }
            }
        }
    }
    (order, cycles)
}

/// Edges from each item to the items it names.
pub(crate) fn edges<'a>(
    names: &[&'a str],
    needs: impl Iterator<Item = Vec<String>>,
) -> Vec<Vec<usize>> {
    let index: FxHashMap<&'a str, usize> = names
        .iter()
        .enumerate()
        .map(|(i, &name)| (name, i))
        .collect();
    needs
        .map(|needs| {
            needs
                .iter()
                .filter_map(|need| index.get(need.as_str()).copied())
                .collect()
        })
        .collect()
}

/// `a -> b -> a`
pub(crate) fn chain(cycle: &[usize], names: &[&str]) -> String {
    let closed = cycle.iter().chain(cycle.first());
    closed
        .map(|&node| names[node])
        .collect::<Vec<_>>()
        .join(" -> ")
}

/// What the members of a cycle but the first need, each where it is declared.
pub(crate) fn others(
    cycle: &[usize],
    names: &[&str],
    span: impl Fn(usize) -> Span,
) -> Vec<LabeledSpan> {
    let next = cycle.iter().cycle().skip(2);
    let pairs = cycle.iter().skip(1).zip(next);
    let label = |(&node, &next): (&usize, &usize)| {
        let text = format!("needs `{}`", names[next]);
        LabeledSpan::new_with_span(Some(text), span(node))
    };
    pairs.map(label).collect()
}

/// Where a name first stands in an expression.
pub(crate) fn name_span(expr: &Expr, name: &str) -> Option<Span> {
    let mut walk = Walk {
        looking_for: Some(name.to_owned()),
        ..Walk::default()
    };
    walk.expr(expr);
    walk.found
}
