//! Products of α become variables.
//!
//! α_1 α_2 α_3   ->   β_2,   0 = β_1 - α_1 α_2,   0 = β_2 - β_1 α_3
//!
//! so that what is left is affine in α and β, and no row is worse than bilinear. Equal products share their β. A
//! product of few switches is expanded first, so that (1 - α_1) α_2 is α_2 - β_1 and all corners share one β; a
//! product of many is a chain over its factors as they stand, because its expansion would have 2^n terms.
//!
//! α_i^2 is α_i: in the linear reading only the corners {0, 1} count.

use std::collections::{BTreeMap, BTreeSet};

use crate::expr::{Expr, Exprs, Node, Substitution, Var, rewrite_all, variables_of};

use super::labels::{listed, signed};

/// Up to this many switches a product is expanded.
const EXPANDED: usize = 4;
/// Factors that share a switch are expanded up to this many switches: a chain would square α.
const EXPANDED_OVERLAP: usize = 10;

/// A set of switches, ascending.
type Switches = BTreeSet<usize>;

/// An α or β that occurs linearly in what is lifted.
#[derive(Clone, Debug)]
struct Symbol {
    /// The switches it depends on.
    switches: Switches,
    /// Whether it is the product of their α, and not of other factors.
    is_monomial: bool,
}

/// A product that got a name.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Product<'e> {
    /// The variable β.
    pub beta: Expr<'e>,
    /// β_{m-1} and the next factor, or the first two factors.
    pub factors: (Expr<'e>, Expr<'e>),
    /// The switch that comes last in it.
    pub switch: usize,
}

/// The products found so far.
pub(crate) struct Lift<'e> {
    exprs: &'e Exprs,
    labels: Vec<String>,
    prefix: String,
    alphas: Vec<Expr<'e>>,
    symbols: BTreeMap<Var, Symbol>,
    monomials: BTreeMap<Vec<usize>, Expr<'e>>,
    /// In order of definition: a product contains earlier ones only.
    pub products: Vec<Product<'e>>,
}

impl<'e> Lift<'e> {
    /// For the variables `alphas` with their labels; β are named `prefix[..]`.
    pub fn new(
        exprs: &'e Exprs,
        alphas: Vec<Expr<'e>>,
        labels: Vec<String>,
        prefix: String,
    ) -> Self {
        let symbol = |(k, alpha): (usize, &Expr<'e>)| {
            let symbol = Symbol {
                switches: [k].into(),
                is_monomial: true,
            };
            Some((alpha.as_variable()?, symbol))
        };
        Lift {
            symbols: alphas.iter().enumerate().filter_map(symbol).collect(),
            exprs,
            labels,
            prefix,
            alphas,
            monomials: BTreeMap::new(),
            products: Vec::new(),
        }
    }

    /// The expressions with products of α replaced.
    pub fn lift(&mut self, exprs: &[Expr<'e>]) -> Vec<Expr<'e>> {
        rewrite_all(exprs, &mut |e| match e.node() {
            Node::Product(factors) => self.lift_product(&factors).unwrap_or(e),
            _ => e,
        })
    }

    /// `None` when nothing is to do, or a factor is not affine in the symbols.
    fn lift_product(&mut self, factors: &[(Expr<'e>, i32)]) -> Option<Expr<'e>> {
        let mut smooth = Vec::new();
        let mut switching = Vec::new();
        for &(factor, power) in factors {
            let copies = usize::try_from(power).unwrap_or(0);
            if !self.switches(factor) {
                smooth.push(factor.powi(power));
            } else if copies == 0 || copies > EXPANDED_OVERLAP || !self.is_affine(factor) {
                return None;
            } else {
                switching.extend(std::iter::repeat_n(factor, copies));
            }
        }
        if switching.len() < 2 {
            return None;
        }
        let supports: Vec<Switches> = switching
            .iter()
            .map(|&factor| self.support(factor))
            .collect();
        let union: Switches = supports.iter().flatten().copied().collect();
        let disjoint = supports.iter().map(Switches::len).sum::<usize>() == union.len();
        let monomials = switching.iter().all(|&factor| self.is_polynomial(factor));
        let few = union.len() <= if disjoint { EXPANDED } else { EXPANDED_OVERLAP };
        let product = if monomials && few {
            self.expand(&switching)
        } else {
            self.chain(&switching)
        };
        Some(self.exprs.product(smooth.into_iter().chain([product])))
    }

    /// Multiplies out and names the monomials.
    fn expand(&mut self, factors: &[Expr<'e>]) -> Expr<'e> {
        let one = BTreeMap::from([(Vec::new(), self.exprs.constant(1.0))]);
        let polynomial = factors.iter().fold(one, |product, &factor| {
            let factor = self.polynomial(factor);
            let mut next: BTreeMap<Vec<usize>, Expr<'e>> = BTreeMap::new();
            for (a, &left) in &product {
                for (b, &right) in &factor {
                    let union: Switches = a.iter().chain(b).copied().collect();
                    let term = left * right;
                    next.entry(union.into_iter().collect())
                        .and_modify(|sum| *sum = *sum + term)
                        .or_insert(term);
                }
            }
            next.retain(|_, coefficient| !coefficient.is_zero());
            next
        });
        let terms: Vec<Expr<'e>> = (polynomial.iter())
            .map(|(switches, &coefficient)| coefficient * self.monomial(switches))
            .collect();
        self.exprs.sum(terms)
    }

    /// Π α over the switches, which ascend.
    fn monomial(&mut self, switches: &[usize]) -> Expr<'e> {
        let Some((&last, earlier)) = switches.split_last() else {
            return self.exprs.constant(1.0);
        };
        if earlier.is_empty() {
            return self.alphas[last];
        }
        if let Some(&beta) = self.monomials.get(switches) {
            return beta;
        }
        let factors = (self.monomial(earlier), self.alphas[last]);
        let names: Vec<String> = switches.iter().map(|&k| listed(&self.labels[k])).collect();
        let name = format!("{}[{}]", self.prefix, names.join(","));
        let symbol = Symbol {
            switches: switches.iter().copied().collect(),
            is_monomial: true,
        };
        let beta = self.name_product(&name, factors, symbol);
        self.monomials.insert(switches.to_vec(), beta);
        beta
    }

    /// β_m = β_{m-1} factor_{m+1}, the factors in order of their first switch.
    fn chain(&mut self, factors: &[Expr<'e>]) -> Expr<'e> {
        let mut factors = factors.to_vec();
        factors.sort_by_cached_key(|&factor| self.support(factor));
        let mut names: Vec<Option<String>> = Vec::new();
        let chained = factors
            .into_iter()
            .enumerate()
            .map(|(i, factor)| (i, factor, self.literal(factor)));
        let chained: Vec<_> = chained.collect();
        let mut product = self.exprs.constant(1.0);
        for (i, factor, literal) in chained {
            names.push(literal);
            if i == 0 {
                product = factor;
                continue;
            }
            let same = |known: &&Product<'e>| known.factors == (product, factor);
            if let Some(known) = self.products.iter().find(same) {
                product = known.beta;
                continue;
            }
            let literals: Option<Vec<String>> = names.iter().cloned().collect();
            let name = literals.map_or_else(
                || (self.products.len() + 1).to_string(),
                |names| names.join(","),
            );
            let symbol = Symbol {
                switches: self
                    .support(product)
                    .union(&self.support(factor))
                    .copied()
                    .collect(),
                is_monomial: false,
            };
            let name = format!("{}[{name}]", self.prefix);
            product = self.name_product(&name, (product, factor), symbol);
        }
        product
    }

    fn name_product(
        &mut self,
        name: &str,
        factors: (Expr<'e>, Expr<'e>),
        symbol: Symbol,
    ) -> Expr<'e> {
        let beta = self.exprs.variable(name);
        let switch = symbol.switches.last().copied().unwrap_or(0);
        self.products.push(Product {
            beta,
            factors,
            switch,
        });
        if let Some(var) = beta.as_variable() {
            self.symbols.insert(var, symbol);
        }
        beta
    }

    /// `x+` for α, `x-` for 1 - α.
    fn literal(&self, factor: Expr<'e>) -> Option<String> {
        let position = |e: Expr<'e>| self.alphas.iter().position(|&alpha| alpha == e);
        let plus = position(factor).map(|k| signed(&self.labels[k], true));
        plus.or_else(|| position(1.0 - factor).map(|k| signed(&self.labels[k], false)))
    }

    /// Coefficients of the monomials of an affine factor.
    fn polynomial(&self, factor: Expr<'e>) -> BTreeMap<Vec<usize>, Expr<'e>> {
        let present = self.present(factor);
        let zero = self.exprs.constant(0.0);
        let none: Substitution = present.iter().map(|&var| (var, zero)).collect();
        let linear = present.iter().map(|&var| {
            let switches = self.symbols[&var].switches.iter().copied().collect();
            (switches, factor.diff(var))
        });
        let constant = (Vec::new(), factor.substitute(&none));
        let terms = linear.chain([constant]);
        terms
            .filter(|(_, coefficient)| !coefficient.is_zero())
            .collect()
    }

    fn is_affine(&self, factor: Expr<'e>) -> bool {
        let present = self.present(factor);
        present.iter().all(|&var| !self.switches(factor.diff(var)))
    }

    fn is_polynomial(&self, factor: Expr<'e>) -> bool {
        self.present(factor)
            .iter()
            .all(|var| self.symbols[var].is_monomial)
    }

    fn support(&self, factor: Expr<'e>) -> Switches {
        let symbols = self
            .present(factor)
            .into_iter()
            .map(|var| &self.symbols[&var]);
        symbols
            .flat_map(|symbol| symbol.switches.iter().copied())
            .collect()
    }

    fn present(&self, expr: Expr<'e>) -> Vec<Var> {
        let mut vars = variables_of(&[expr]);
        vars.retain(|var| self.symbols.contains_key(var));
        vars
    }

    fn switches(&self, expr: Expr<'e>) -> bool {
        !self.present(expr).is_empty()
    }
}
