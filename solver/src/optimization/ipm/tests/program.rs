//! Problems made of closures.

use super::jet::Jet;
use crate::optimization::problem::{Bounds, Nlp, Pattern, Structure};

pub const INF: f64 = f64::INFINITY;

type Function = Box<dyn Fn(&[Jet]) -> Jet>;

/// minimize f(x) subject to rows and bounds, with dense derivatives.
pub struct Program {
    pub start: Vec<f64>,
    objective: Option<Function>,
    rows: Vec<Function>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    pub row_lower: Vec<f64>,
    pub row_upper: Vec<f64>,
    jacobian: Pattern,
    hessian: Pattern,
}

impl Program {
    /// Free variables and neither rows nor an objective.
    pub fn new(start: &[f64]) -> Self {
        let n = start.len();
        let lower = |i: u32| (0..=i).map(move |j| (i, j));
        Program {
            start: start.to_vec(),
            objective: None,
            rows: Vec::new(),
            lower: vec![-INF; n],
            upper: vec![INF; n],
            row_lower: Vec::new(),
            row_upper: Vec::new(),
            jacobian: Pattern::new(0, Vec::new()),
            hessian: Pattern::new(n, (0..n as u32).flat_map(lower).collect()),
        }
    }

    pub fn minimize(mut self, objective: impl Fn(&[Jet]) -> Jet + 'static) -> Self {
        self.objective = Some(Box::new(objective));
        self
    }

    pub fn row(mut self, lower: f64, row: impl Fn(&[Jet]) -> Jet + 'static, upper: f64) -> Self {
        self.rows.push(Box::new(row));
        self.row_lower.push(lower);
        self.row_upper.push(upper);
        let (n, m) = (self.start.len() as u32, self.rows.len());
        let entries = (0..m as u32).flat_map(|row| (0..n).map(move |column| (row, column)));
        self.jacobian = Pattern::new(m, entries.collect());
        self
    }

    /// row = 0.
    pub fn equal(self, row: impl Fn(&[Jet]) -> Jet + 'static) -> Self {
        self.row(0.0, row, 0.0)
    }

    /// row >= 0.
    pub fn positive(self, row: impl Fn(&[Jet]) -> Jet + 'static) -> Self {
        self.row(0.0, row, INF)
    }

    pub fn bounds(mut self, i: usize, lower: f64, upper: f64) -> Self {
        (self.lower[i], self.upper[i]) = (lower, upper);
        self
    }

    pub fn all_bounds(mut self, lower: f64, upper: f64) -> Self {
        self.lower.fill(lower);
        self.upper.fill(upper);
        self
    }
}

fn variables(w: &[f64]) -> Vec<Jet> {
    w.iter()
        .enumerate()
        .map(|(i, &x)| Jet::variable(x, i))
        .collect()
}

impl Nlp for Program {
    fn structure(&self) -> Structure<'_> {
        Structure {
            variables: Bounds {
                lower: &self.lower,
                upper: &self.upper,
            },
            rows: Bounds {
                lower: &self.row_lower,
                upper: &self.row_upper,
            },
            start: &self.start,
            jacobian: &self.jacobian,
            hessian: &self.hessian,
        }
    }

    fn objective(&mut self, w: &[f64]) -> f64 {
        self.objective
            .as_ref()
            .map_or(0.0, |f| f(&variables(w)).value)
    }

    fn gradient(&mut self, w: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        if let Some(f) = &self.objective {
            gradient.copy_from_slice(&f(&variables(w)).gradient[..w.len()]);
        }
    }

    fn rows(&mut self, w: &[f64], rows: &mut [f64]) {
        for (value, row) in rows.iter_mut().zip(&self.rows) {
            *value = row(&variables(w)).value;
        }
    }

    fn jacobian(&mut self, w: &[f64], entries: &mut [f64]) {
        for (entries, row) in entries.chunks_mut(w.len().max(1)).zip(&self.rows) {
            entries.copy_from_slice(&row(&variables(w)).gradient[..w.len()]);
        }
    }

    fn hessian(&mut self, w: &[f64], factor: f64, y: &[f64], entries: &mut [f64]) {
        let x = variables(w);
        let mut sum = Jet::constant(0.0);
        if let Some(f) = &self.objective {
            sum = sum + factor * f(&x);
        }
        for (row, &y) in self.rows.iter().zip(y) {
            sum = sum + y * row(&x);
        }
        let lower = (0..w.len()).flat_map(|i| &sum.hessian[i][..=i]);
        for (entry, &h) in entries.iter_mut().zip(lower) {
            *entry = h;
        }
    }
}
