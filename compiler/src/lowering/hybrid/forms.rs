//! Functions that differ in names and numbers only.
//!
//! A thousand instances of one part have a thousand copies of its equations. They have one *form*:
//! the same operations on variables numbered in order of their first occurrence, and numbers, of
//! which those that differ from copy to copy are inputs. A form is compiled once.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::expr::{self, BinaryFunction, Expr, Exprs, Function, Node, Var};

/// Functions that stand for all of their form.
pub(crate) struct ExprForm<'e> {
    /// The functions.
    pub functions: Vec<Expr<'e>>,
    /// Their variables, in order of first occurrence.
    pub vars: Vec<Var>,
    /// What takes the place of numbers that differ.
    pub holes: Vec<Var>,
}

/// Functions as one of their form.
pub(crate) struct Copy {
    /// Which form.
    pub form: usize,
    /// The variables in the places of those of the form.
    pub vars: Vec<Var>,
    /// The numbers in the places of its holes.
    pub numbers: Vec<f64>,
}

/// Finds the forms of groups of functions. Variables of different `kind` do not stand for each other.
pub(crate) fn share<'e>(
    exprs: &'e Exprs,
    groups: &[Vec<Expr<'e>>],
    kind: impl Fn(Var) -> u64,
) -> (Vec<ExprForm<'e>>, Vec<Copy>) {
    let mut known: FxHashMap<Vec<u64>, usize> = FxHashMap::default();
    let mut members: Vec<Vec<usize>> = Vec::new();
    let mut copies = Vec::with_capacity(groups.len());
    for (at, group) in groups.iter().enumerate() {
        let outline = Outline::new(group, &kind);
        let next = members.len();
        let form = *known.entry(outline.tokens).or_insert(next);
        if form == next {
            members.push(Vec::new());
        }
        members[form].push(at);
        copies.push(Copy {
            form,
            vars: outline.vars,
            numbers: outline.numbers,
        });
    }
    let mut forms = Vec::with_capacity(members.len());
    for members in members {
        let first = &copies[members[0]];
        let differs = |k: &usize| {
            let number = |&at: &usize| copies[at].numbers[*k].to_bits();
            members.iter().any(|at| number(at) != number(&members[0]))
        };
        let open: Vec<usize> = (0..first.numbers.len()).filter(differs).collect();
        let holes: Vec<Expr> = open.iter().map(|_| exprs.variable("number")).collect();
        let mut numbers: Vec<Expr> = first.numbers.iter().map(|&n| exprs.constant(n)).collect();
        for (&k, &hole) in open.iter().zip(&holes) {
            numbers[k] = hole;
        }
        let functions = &groups[members[0]];
        forms.push(ExprForm {
            functions: match holes.is_empty() {
                true => functions.clone(),
                false => fill(exprs, functions, &numbers),
            },
            vars: first.vars.clone(),
            holes: holes.iter().filter_map(|hole| hole.as_variable()).collect(),
        });
        for at in members {
            let numbers = &mut copies[at].numbers;
            *numbers = open.iter().map(|&k| numbers[k]).collect();
        }
    }
    (forms, copies)
}

/// What functions look like without the names of their variables and without their numbers.
struct Outline {
    tokens: Vec<u64>,
    vars: Vec<Var>,
    numbers: Vec<f64>,
}

impl Outline {
    fn new(functions: &[Expr], kind: &impl Fn(Var) -> u64) -> Self {
        let order = below(functions);
        let mut outline = Outline {
            tokens: Vec::with_capacity(4 * order.len()),
            vars: Vec::new(),
            numbers: Vec::new(),
        };
        let places = order.iter().enumerate();
        let places: FxHashMap<Expr, u64> = places.map(|(at, &e)| (e, at as u64)).collect();
        for e in &order {
            outline.describe(*e, &places, kind);
        }
        outline.tokens.extend(functions.iter().map(|e| places[e]));
        outline
    }

    fn describe(&mut self, e: Expr, places: &FxHashMap<Expr, u64>, kind: &impl Fn(Var) -> u64) {
        match e.node() {
            // Exponents and the like decide how a function is computed.
            Node::Constant(number) => self.tokens.extend([0, number.to_bits()]),
            Node::Variable(var) => {
                self.vars.push(var);
                self.tokens.extend([1, kind(var)]);
            }
            Node::Sum { constant, terms } => {
                self.tokens.extend([2, terms.len() as u64]);
                self.number(constant);
                for (c, term) in terms {
                    self.number(c);
                    self.tokens.push(places[&term]);
                }
            }
            Node::Product(factors) => {
                self.tokens.extend([3, factors.len() as u64]);
                for (factor, power) in factors {
                    self.tokens.extend([places[&factor], power as u64]);
                }
            }
            Node::Unary(function, a) => {
                self.tokens.extend([4, unary(function), places[&a]]);
            }
            Node::Binary(function, a, b) => {
                let function = binary(function);
                self.tokens.extend([5, function, places[&a], places[&b]]);
            }
        }
    }

    /// A number that may differ from copy to copy; 0, 1 and -1 are computed in ways of their own.
    fn number(&mut self, number: f64) {
        if is_special(number) {
            self.tokens.extend([0, number.to_bits()]);
        } else {
            self.tokens.push(1);
            self.numbers.push(number);
        }
    }
}

fn is_special(number: f64) -> bool {
    number == 0.0 || number.abs() == 1.0
}

fn unary(function: Function) -> u64 {
    function as u64
}

fn binary(function: BinaryFunction) -> u64 {
    function as u64
}

/// The functions with other numbers in their sums, in the order of an [`Outline`].
fn fill<'e>(exprs: &'e Exprs, functions: &[Expr<'e>], numbers: &[Expr<'e>]) -> Vec<Expr<'e>> {
    // The numbers of a sum, from the first to the last.
    let mut numbers = numbers.iter().copied();
    let mut next = |number: f64| match is_special(number) {
        true => exprs.constant(number),
        false => numbers.next().unwrap_or(exprs.constant(number)),
    };
    let mut of_sum: FxHashMap<Expr, Vec<Expr>> = FxHashMap::default();
    for e in below(functions) {
        if let Node::Sum { constant, terms } = e.node() {
            let all = [constant].into_iter().chain(terms.iter().map(|&(c, _)| c));
            of_sum.insert(e, all.map(&mut next).collect());
        }
    }
    let mut image: FxHashMap<Expr, Expr> = FxHashMap::default();
    expr::transform(functions, &mut |e, rebuilt| {
        let filled = match e.node() {
            Node::Sum { terms, .. } => {
                let numbers = &of_sum[&e];
                let terms = numbers[1..].iter().zip(terms);
                let terms = terms.map(|(&number, (_, term))| number * image[&term]);
                expr::sum(terms.chain([numbers[0]]))
            }
            _ => rebuilt,
        };
        image.insert(e, filled);
        filled
    })
}

/// Everything below some functions, children first, in an order that depends on nothing but form.
fn below<'e>(functions: &[Expr<'e>]) -> Vec<Expr<'e>> {
    let mut order = Vec::new();
    let mut done = FxHashSet::default();
    let mut stack: Vec<(Expr, bool)> = Vec::new();
    for &function in functions {
        stack.push((function, false));
        while let Some((e, open)) = stack.pop() {
            if open {
                if done.insert(e) {
                    order.push(e);
                }
            } else if !done.contains(&e) {
                stack.push((e, true));
                let children = expr::children(e);
                stack.extend(children.into_iter().rev().map(|child| (child, false)));
            }
        }
    }
    order
}
