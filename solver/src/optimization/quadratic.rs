//! Problems whose objective and rows are quadratic functions: the smallest way to state one by hand.
//!
//! ```
//! use nsd_solver::optimization::problem::{Nlp, Side};
//! use nsd_solver::optimization::quadratic::{Function, Quadratic};
//!
//! // minimize (x - 1)² + (y - 1)²   subject to   0 <= x ⟂ y >= 0
//! let objective = Function::default()
//!     .product(0, 0, 1.0)
//!     .product(1, 1, 1.0)
//!     .linear(0, -2.0)
//!     .linear(1, -2.0)
//!     .constant(2.0);
//! let mut problem = Quadratic::new(2, objective, Vec::new())
//!     .bound(0, 0.0, f64::INFINITY)
//!     .bound(1, 0.0, f64::INFINITY)
//!     .complement(Side::Variable(0), Side::Variable(1));
//! assert_eq!(problem.objective(&[1.0, 0.0]), 1.0);
//! ```

use crate::optimization::problem::{
    HeldStructure, Intervals, Mpcc, Nlp, Pair, Pattern, Side, Structure,
};

/// constant + Σ c_j w_j + Σ q_ij w_i w_j.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Function {
    constant: f64,
    linear: Vec<(u32, f64)>,
    products: Vec<(u32, u32, f64)>,
}

impl Function {
    /// Adds a constant.
    pub fn constant(mut self, value: f64) -> Self {
        self.constant += value;
        self
    }

    /// Adds `factor` w_j.
    pub fn linear(mut self, j: u32, factor: f64) -> Self {
        self.linear.push((j, factor));
        self
    }

    /// Adds `factor` w_i w_j.
    pub fn product(mut self, i: u32, j: u32, factor: f64) -> Self {
        self.products.push((i.max(j), i.min(j), factor));
        self
    }

    fn value(&self, w: &[f64]) -> f64 {
        let linear = self.linear.iter().map(|&(j, c)| c * w[j as usize]);
        let products = self.products.iter();
        let products = products.map(|&(i, j, q)| q * w[i as usize] * w[j as usize]);
        self.constant + linear.sum::<f64>() + products.sum::<f64>()
    }

    fn differentiate(&self, w: &[f64], mut add: impl FnMut(u32, f64)) {
        for &(j, c) in &self.linear {
            add(j, c);
        }
        for &(i, j, q) in &self.products {
            add(i, q * w[j as usize]);
            add(j, q * w[i as usize]);
        }
    }

    fn variables(&self) -> impl Iterator<Item = u32> {
        let products = self.products.iter().flat_map(|&(i, j, _)| [i, j]);
        self.linear.iter().map(|&(j, _)| j).chain(products)
    }
}

/// minimize f(w) subject to cl <= c(w) <= cu, l <= w <= u and pairs 0 <= a ⟂ b >= 0, all functions quadratic.
#[derive(Clone, Debug)]
pub struct Quadratic {
    objective: Function,
    rows: Vec<Function>,
    structure: HeldStructure,
    pairs: Vec<Pair>,
}

impl Quadratic {
    /// A problem with free variables; a row is a function with its bounds.
    pub fn new(n: usize, objective: Function, rows: Vec<(Function, f64, f64)>) -> Self {
        let at_row = |(row, (function, ..)): (usize, &(Function, f64, f64))| {
            let entries = function.variables().map(|j| (row as u32, j));
            entries.collect::<Vec<_>>()
        };
        let entries = rows.iter().enumerate().flat_map(at_row).collect();
        let functions = rows.iter().map(|(function, ..)| function);
        let products = functions.chain([&objective]).flat_map(|f| &f.products);
        let second = products.map(|&(i, j, _)| (i, j)).collect();
        let structure = HeldStructure {
            variables: Intervals {
                lower: vec![f64::NEG_INFINITY; n],
                upper: vec![f64::INFINITY; n],
            },
            rows: Intervals {
                lower: rows.iter().map(|row| row.1).collect(),
                upper: rows.iter().map(|row| row.2).collect(),
            },
            start: vec![0.0; n],
            jacobian: Pattern::new(rows.len(), entries),
            hessian: Pattern::new(n, second),
        };
        Quadratic {
            objective,
            rows: rows.into_iter().map(|row| row.0).collect(),
            structure,
            pairs: Vec::new(),
        }
    }

    /// Bounds a variable.
    pub fn bound(mut self, j: usize, lower: f64, upper: f64) -> Self {
        let bounds = &mut self.structure.variables;
        (bounds.lower[j], bounds.upper[j]) = (lower, upper);
        self
    }

    /// Where to start, instead of zero.
    pub fn start(mut self, start: &[f64]) -> Self {
        self.structure.start.copy_from_slice(start);
        self
    }

    /// Adds the pair 0 <= a ⟂ b >= 0.
    pub fn complement(mut self, a: Side, b: Side) -> Self {
        self.pairs.push(Pair { a, b });
        self
    }
}

impl Nlp for Quadratic {
    fn structure(&self) -> Structure<'_> {
        self.structure.view()
    }

    fn has_objective(&self) -> bool {
        !self.objective.linear.is_empty() || !self.objective.products.is_empty()
    }

    fn objective(&mut self, w: &[f64]) -> f64 {
        self.objective.value(w)
    }

    fn gradient(&mut self, w: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        let add = |j: u32, value| gradient[j as usize] += value;
        self.objective.differentiate(w, add);
    }

    fn rows(&mut self, w: &[f64], rows: &mut [f64]) {
        for (value, row) in rows.iter_mut().zip(&self.rows) {
            *value = row.value(w);
        }
    }

    fn jacobian(&mut self, w: &[f64], entries: &mut [f64]) {
        entries.fill(0.0);
        for (index, row) in self.rows.iter().enumerate() {
            let place = |j| {
                self.structure
                    .jacobian
                    .place(index, j)
                    .expect("an entry per variable")
            };
            row.differentiate(w, |j, value| entries[place(j)] += value);
        }
    }

    fn hessian(&mut self, _w: &[f64], factor: f64, y: &[f64], entries: &mut [f64]) {
        entries.fill(0.0);
        let functions = self.rows.iter().zip(y.iter().copied());
        for (function, weight) in functions.chain([(&self.objective, factor)]) {
            for &(i, j, q) in &function.products {
                let place = self
                    .structure
                    .hessian
                    .place(i as usize, j)
                    .expect("every product");
                entries[place] += weight * q * if i == j { 2.0 } else { 1.0 };
            }
        }
    }
}

impl Mpcc for Quadratic {
    fn pairs(&self) -> &[Pair] {
        &self.pairs
    }
}
