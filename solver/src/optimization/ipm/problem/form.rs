//! The program in the form that the iteration uses.
//!
//! minimize f(x)   subject to   c(x) - s - b = 0,   l <= (x, s) <= u
//!
//! x are the variables that are not fixed and c the rows that have a bound and depend on them, both scaled; a row that
//! is no equation has a slack s and b = 0. Variables v = (x, s) are numbered together. While the violation is minimized,
//! rows have elastic variables p, n >= 0 besides, c(x) - s - b - p + n = 0: what a row has besides c(x) is *attached* to
//! it.

use super::super::solution::Point;
use super::iterate::Iterate;
use crate::optimization::problem::{Bounds, Nlp};

/// A sparse matrix by rows in the numbers of the form.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sparse {
    pub starts: Vec<u32>,
    pub columns: Vec<u32>,
    /// Which entries of the problem's own pattern these are.
    sources: Vec<u32>,
}

/// A variable in one row only, with coefficient 1 or -1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Attached {
    pub row: u32,
    pub sign: f64,
}

/// Which variables and rows of the problem take part, and what is attached to rows.
pub(crate) struct Shape {
    /// The numbers of variables x, slacks and rows.
    pub n: usize,
    pub n_slacks: usize,
    pub m: usize,
    /// How many rows hold at the only values that their variables can have.
    n_empty: usize,
    /// The slacks, then p, then n.
    pub attached: Vec<Attached>,
    /// The slack of every row, or `NONE`.
    pub slacks: Vec<u32>,
    /// The variables and rows of the problem.
    pub variables: Vec<u32>,
    pub rows: Vec<u32>,
}

/// Values and derivatives as the problem has them, unscaled and of all variables and rows.
struct Unscaled {
    rows: Vec<f64>,
    y: Vec<f64>,
    gradient: Vec<f64>,
    jacobian: Vec<f64>,
    hessian: Vec<f64>,
}

pub(crate) struct Form<'a> {
    pub nlp: &'a mut dyn Nlp,
    pub shape: Shape,
    pub jacobian: Sparse,
    pub hessian: Sparse,
    pub objective_scale: f64,
    pub row_scale: Vec<f64>,
    /// b.
    targets: Vec<f64>,
    /// All variables, the fixed ones at their value.
    pub w: Vec<f64>,
    unscaled: Unscaled,
}

pub(crate) const NONE: u32 = u32::MAX;
/// Rows whose variables are fixed hold when they miss their bounds by no more, relative to their size.
const EMPTY: f64 = 1e-9;
/// Bounds of this size and more are relaxed alike, as long as rounding allows it.
const MOST_RELAXED: f64 = 10.0;
const ROUNDINGS: f64 = 1e-6;

/// What a row or variable is by its bounds.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Fixed,
    Bounded,
    Free,
}

fn kind(bounds: &Bounds<'_>, i: usize) -> Kind {
    let (lower, upper) = (bounds.lower[i], bounds.upper[i]);
    if lower == upper {
        Kind::Fixed
    } else if lower == f64::NEG_INFINITY && upper == f64::INFINITY {
        Kind::Free
    } else {
        Kind::Bounded
    }
}

/// What a bound of such a size moves by, in units of the relaxation: rows are as accurate as what moves in them, so that it is
/// little more than 1, and more than rounding. Infinite bounds stay; 0 · ∞ is no number.
fn relaxed(size: f64) -> f64 {
    size.clamp(1.0, MOST_RELAXED)
        .max(ROUNDINGS * size.min(f64::MAX))
}

impl<'a> Form<'a> {
    pub fn new(nlp: &'a mut dyn Nlp) -> Self {
        let (n_all, m_all) = (nlp.n_variables(), nlp.n_rows());
        let bounds = nlp.variable_bounds();
        let is_fixed: Vec<bool> = (0..n_all)
            .map(|i| kind(&bounds, i) == Kind::Fixed)
            .collect();
        let variables: Vec<u32> = (0..n_all as u32)
            .filter(|&i| !is_fixed[i as usize])
            .collect();
        let mut w = nlp.start().to_vec();
        for (i, w) in w.iter_mut().enumerate() {
            if is_fixed[i] {
                *w = bounds.lower[i];
            }
        }
        let mut values = vec![0.0; m_all];
        nlp.rows(&w, &mut values);
        let bounds = nlp.row_bounds();
        let pattern = nlp.jacobian_pattern();
        let is_empty = |row: usize| {
            let reach = EMPTY * values[row].abs().max(1.0);
            let is_within = values[row] >= bounds.lower[row] - reach;
            is_within
                && values[row] <= bounds.upper[row] + reach
                && pattern.row(row).iter().all(|&j| is_fixed[j as usize])
        };
        let bounded = (0..m_all as u32).filter(|&row| kind(&bounds, row as usize) != Kind::Free);
        let (empty, rows): (Vec<u32>, Vec<u32>) = bounded.partition(|&row| is_empty(row as usize));
        let (n, m) = (variables.len(), rows.len());
        let mut slacks = vec![NONE; m];
        let mut attached = Vec::new();
        for (j, &row) in rows.iter().enumerate() {
            if kind(&bounds, row as usize) == Kind::Bounded {
                slacks[j] = (n + attached.len()) as u32;
                attached.push(Attached {
                    row: j as u32,
                    sign: -1.0,
                });
            }
        }
        let n_slacks = attached.len();
        for sign in [-1.0, 1.0] {
            attached.extend((0..m as u32).map(|row| Attached { row, sign }));
        }
        let mut place = vec![NONE; n_all];
        for (i, &variable) in variables.iter().enumerate() {
            place[variable as usize] = i as u32;
        }
        let jacobian = Sparse::select(nlp.jacobian_pattern(), &rows, &place);
        let hessian = Sparse::select(nlp.hessian_pattern(), &variables, &place);
        let unscaled = Unscaled {
            rows: values,
            y: vec![0.0; m_all],
            gradient: vec![0.0; n_all],
            jacobian: vec![0.0; nlp.jacobian_pattern().n_entries()],
            hessian: vec![0.0; nlp.hessian_pattern().n_entries()],
        };
        Form {
            shape: Shape {
                n,
                n_slacks,
                m,
                n_empty: empty.len(),
                attached,
                slacks,
                variables,
                rows,
            },
            jacobian,
            hessian,
            objective_scale: 1.0,
            row_scale: vec![1.0; m],
            targets: vec![0.0; m],
            w,
            unscaled,
            nlp,
        }
    }

    /// Whether the bounds are such that no other variables are fixed and rows free or equations than at the start.
    pub fn has_shape(&self) -> bool {
        let bounds = self.nlp.variable_bounds();
        let fixed = (0..self.w.len()).filter(|&i| kind(&bounds, i) == Kind::Fixed);
        if fixed.count() + self.shape.n != self.w.len()
            || self
                .shape
                .variables
                .iter()
                .any(|&i| kind(&bounds, i as usize) == Kind::Fixed)
        {
            return false;
        }
        let bounds = self.nlp.row_bounds();
        let free = (0..self.unscaled.rows.len()).filter(|&i| kind(&bounds, i) == Kind::Free);
        let expected = |slack: u32| {
            if slack == NONE {
                Kind::Fixed
            } else {
                Kind::Bounded
            }
        };
        let mut rows = self.shape.rows.iter().zip(&self.shape.slacks);
        free.count() + self.shape.n_empty + self.shape.m == self.unscaled.rows.len()
            && rows.all(|(&row, &slack)| kind(&bounds, row as usize) == expected(slack))
    }

    /// Reads the bounds of v, moved outward by `relaxation` of their size, and the right-hand sides b.
    pub fn read_bounds(&mut self, relaxation: f64, lower: &mut [f64], upper: &mut [f64]) {
        let bounds = self.nlp.variable_bounds();
        for (i, &variable) in self.shape.variables.iter().enumerate() {
            lower[i] = bounds.lower[variable as usize];
            upper[i] = bounds.upper[variable as usize];
        }
        let bounds = self.nlp.row_bounds();
        for (j, &row) in self.shape.rows.iter().enumerate() {
            let scale = self.row_scale[j];
            let (low, high) = (bounds.lower[row as usize], bounds.upper[row as usize]);
            if self.shape.slacks[j] == NONE {
                self.targets[j] = scale * low;
            } else {
                lower[self.shape.slacks[j] as usize] = scale * low;
                upper[self.shape.slacks[j] as usize] = scale * high;
            }
        }
        let nv = self.shape.own();
        for (low, high) in lower.iter_mut().zip(upper).take(nv) {
            *low -= relaxation * relaxed(low.abs());
            *high += relaxation * relaxed(high.abs());
        }
    }

    /// Brings w back between its bounds and adds the multipliers of variables that are fixed.
    fn complete(&mut self, point: &mut Point) {
        self.nlp.gradient(&point.w, &mut self.unscaled.gradient);
        self.nlp.jacobian(&point.w, &mut self.unscaled.jacobian);
        let pattern = self.nlp.jacobian_pattern();
        for (row, y) in point.y.iter().enumerate() {
            let range = pattern.starts[row]..pattern.starts[row + 1];
            for (&column, a) in pattern.row(row).iter().zip(&self.unscaled.jacobian[range]) {
                self.unscaled.gradient[column as usize] += a * y;
            }
        }
        let bounds = self.nlp.variable_bounds();
        for (i, &slope) in self.unscaled.gradient.iter().enumerate() {
            let (lower, upper) = (bounds.lower[i], bounds.upper[i]);
            if lower == upper {
                point.z_l[i] = slope.max(0.0);
                point.z_u[i] = (-slope).max(0.0);
            }
            point.w[i] = point.w[i].max(lower).min(upper);
        }
    }

    /// The point in the units of the problem.
    pub fn point(&mut self, at: &Iterate, mu: f64) -> Point {
        self.load(&at.v);
        let mut point = Point {
            w: self.w.clone(),
            y: vec![0.0; self.nlp.n_rows()],
            z_l: vec![0.0; self.w.len()],
            z_u: vec![0.0; self.w.len()],
            mu,
        };
        for ((&row, &y), &scale) in self.shape.rows.iter().zip(&at.y).zip(&self.row_scale) {
            point.y[row as usize] = scale * y / self.objective_scale;
        }
        for (i, &variable) in self.shape.variables.iter().enumerate() {
            point.z_l[variable as usize] = at.z_l[i] / self.objective_scale;
            point.z_u[variable as usize] = at.z_u[i] / self.objective_scale;
        }
        self.complete(&mut point);
        point
    }

    /// Brings x into w.
    pub fn load(&mut self, v: &[f64]) {
        for (&variable, &x) in self.shape.variables.iter().zip(v) {
            self.w[variable as usize] = x;
        }
    }

    /// f at the point loaded.
    pub fn objective(&mut self) -> f64 {
        self.objective_scale * self.nlp.objective(&self.w)
    }

    /// c(x) at the point loaded.
    pub fn rows(&mut self, c: &mut [f64]) {
        self.nlp.rows(&self.w, &mut self.unscaled.rows);
        for ((c, &row), &scale) in c.iter_mut().zip(&self.shape.rows).zip(&self.row_scale) {
            *c = scale * self.unscaled.rows[row as usize];
        }
    }

    /// ∇f at the point loaded.
    pub fn gradient(&mut self, gradient: &mut [f64]) {
        self.nlp.gradient(&self.w, &mut self.unscaled.gradient);
        for (g, &variable) in gradient.iter_mut().zip(&self.shape.variables) {
            *g = self.objective_scale * self.unscaled.gradient[variable as usize];
        }
    }

    /// The entries of ∂c/∂x at the point loaded.
    pub fn jacobian(&mut self, entries: &mut [f64]) {
        self.nlp.jacobian(&self.w, &mut self.unscaled.jacobian);
        for j in 0..self.shape.m {
            let scale = self.row_scale[j];
            let range = self.jacobian.range(j);
            for (entry, &source) in entries[range.clone()]
                .iter_mut()
                .zip(&self.jacobian.sources[range])
            {
                *entry = scale * self.unscaled.jacobian[source as usize];
            }
        }
    }

    /// The entries of the Hessian of `factor` f + yᵀc at the point loaded.
    pub fn hessian(&mut self, factor: f64, y: &[f64], entries: &mut [f64]) {
        for ((&row, &y), &scale) in self.shape.rows.iter().zip(y).zip(&self.row_scale) {
            self.unscaled.y[row as usize] = scale * y;
        }
        let factor = factor * self.objective_scale;
        self.nlp.hessian(
            &self.w,
            factor,
            &self.unscaled.y,
            &mut self.unscaled.hessian,
        );
        for (entry, &source) in entries.iter_mut().zip(&self.hessian.sources) {
            *entry = self.unscaled.hessian[source as usize];
        }
    }

    /// Adds what is missing for a convex Lagrangian to the entries that [`Form::hessian`] gave last.
    pub fn convexify(&mut self, entries: &mut [f64]) -> bool {
        if !(self.nlp).convexify(&self.w, &self.unscaled.y, &mut self.unscaled.hessian) {
            return false;
        }
        for (entry, &source) in entries.iter_mut().zip(&self.hessian.sources) {
            *entry = self.unscaled.hessian[source as usize];
        }
        true
    }

    /// c(x) - b plus what is attached: the first `n_attached` of them.
    pub fn residual(&self, c: &[f64], v: &[f64], residual: &mut [f64]) {
        for ((r, &c), &target) in residual.iter_mut().zip(c).zip(&self.targets) {
            *r = c - target;
        }
        for (attached, &v) in self.shape.attached.iter().zip(&v[self.shape.n..]) {
            residual[attached.row as usize] += attached.sign * v;
        }
    }
}

impl Shape {
    /// The number of variables x and slacks.
    pub fn own(&self) -> usize {
        self.n + self.n_slacks
    }

    /// The number of these with p and n.
    pub fn n_all(&self) -> usize {
        self.n + self.attached.len()
    }
}

impl Sparse {
    fn select(
        pattern: &crate::optimization::problem::Pattern,
        rows: &[u32],
        place: &[u32],
    ) -> Self {
        let mut sparse = Sparse {
            starts: vec![0],
            ..Sparse::default()
        };
        for &row in rows {
            let row = row as usize;
            let range = pattern.starts[row]..pattern.starts[row + 1];
            for (&column, source) in pattern.row(row).iter().zip(range) {
                if place[column as usize] != NONE {
                    sparse.columns.push(place[column as usize]);
                    sparse.sources.push(source as u32);
                }
            }
            sparse.starts.push(sparse.columns.len() as u32);
        }
        sparse
    }

    pub fn n_entries(&self) -> usize {
        self.columns.len()
    }

    pub fn range(&self, row: usize) -> std::ops::Range<usize> {
        self.starts[row] as usize..self.starts[row + 1] as usize
    }

    /// `product` += Aᵀ y.
    pub fn add_transposed(&self, entries: &[f64], y: &[f64], product: &mut [f64]) {
        for (row, &y) in y.iter().enumerate() {
            let range = self.range(row);
            for (&column, &a) in self.columns[range.clone()].iter().zip(&entries[range]) {
                product[column as usize] += a * y;
            }
        }
    }
}
