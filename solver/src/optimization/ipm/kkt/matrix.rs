//! The matrix of a step in the numbers of the form: entries of H and J, and what is added to its diagonal.

use crate::optimization::ipm::problem::form::{Form, Sparse};
use crate::optimization::problem::Pattern;

pub(crate) struct Matrix {
    pub n: usize,
    pub m: usize,
    pub pattern: Pattern,
    pub values: Vec<f64>,
    hessian_places: Vec<u32>,
    jacobian_places: Vec<u32>,
    diagonal_places: Vec<u32>,
    /// The diagonal of H.
    curvature: Vec<f64>,
    /// What is added to H, and -Σ 1/w.
    diagonal: Vec<f64>,
}

/// H or J at a point.
#[derive(Clone, Copy)]
pub(crate) struct Entries<'a> {
    pub sparse: &'a Sparse,
    pub values: &'a [f64],
}

impl Matrix {
    pub fn new(form: &Form<'_>) -> Self {
        let (n, m) = (form.shape.n, form.shape.m);
        let mut entries: Vec<(u32, u32)> = (0..(n + m) as u32).map(|i| (i, i)).collect();
        let list = |sparse: &Sparse, first: usize| -> Vec<(u32, u32)> {
            let rows = 0..sparse.starts.len() - 1;
            let row = |row: usize| {
                sparse.columns[sparse.range(row)]
                    .iter()
                    .map(move |&column| ((first + row) as u32, column))
            };
            rows.flat_map(row).collect()
        };
        let (hessian, jacobian) = (list(&form.hessian, 0), list(&form.jacobian, n));
        entries.extend(hessian.iter().chain(&jacobian));
        let pattern = Pattern::new(n + m, entries);
        let places = |list: &[(u32, u32)]| -> Vec<u32> {
            let place = |&(i, j): &(u32, u32)| {
                pattern.place(i as usize, j).expect("the entry was put in") as u32
            };
            list.iter().map(place).collect()
        };
        let diagonal: Vec<(u32, u32)> = (0..(n + m) as u32).map(|i| (i, i)).collect();
        Matrix {
            n,
            m,
            hessian_places: places(&hessian),
            jacobian_places: places(&jacobian),
            diagonal_places: places(&diagonal),
            values: vec![0.0; pattern.n_entries()],
            curvature: vec![0.0; n],
            diagonal: vec![0.0; n + m],
            pattern,
        }
    }

    /// Takes over entries; the diagonal of H is kept apart.
    pub fn fill(&mut self, hessian: &[f64], jacobian: &[f64]) {
        self.values.fill(0.0);
        for (&place, &entry) in self.hessian_places.iter().zip(hessian) {
            self.values[place as usize] = entry;
        }
        for (&place, &entry) in self.jacobian_places.iter().zip(jacobian) {
            self.values[place as usize] = entry;
        }
        for (curvature, &place) in self.curvature.iter_mut().zip(&self.diagonal_places) {
            *curvature = self.values[place as usize];
        }
    }

    /// The entry of a variable on the diagonal.
    pub fn at_diagonal(&self, column: u32) -> f64 {
        self.values[self.diagonal_places[column as usize] as usize]
    }

    /// Sets the diagonal for Σ of all variables, δ_w and δ_c.
    pub fn regularize(&mut self, form: &Form<'_>, sigma: &[f64], delta: f64, dual: f64) {
        let n = self.n;
        for (diagonal, sigma) in self.diagonal[..n].iter_mut().zip(sigma) {
            *diagonal = sigma + delta;
        }
        self.diagonal[n..].fill(0.0);
        for (attached, sigma) in form.shape.attached.iter().zip(&sigma[n..]) {
            self.diagonal[n + attached.row as usize] -= 1.0 / (sigma + delta);
        }
        for i in 0..n {
            self.values[self.diagonal_places[i] as usize] = self.curvature[i] + self.diagonal[i];
        }
        for i in n..n + self.m {
            self.values[self.diagonal_places[i] as usize] = self.diagonal[i] - dual;
        }
    }

    /// residual = rhs - K solution with δ_c = `delta`.
    pub fn subtract_product(
        &self,
        [hessian, jacobian]: [Entries<'_>; 2],
        rhs: &[f64],
        solution: &[f64],
        delta: f64,
        residual: &mut [f64],
    ) {
        let n = self.n;
        let (x, y) = solution.split_at(n);
        for i in 0..n {
            residual[i] = rhs[i] - self.diagonal[i] * x[i];
        }
        for i in n..n + self.m {
            residual[i] = rhs[i] - (self.diagonal[i] - delta) * solution[i];
        }
        let (dual, primal) = residual.split_at_mut(n);
        for row in 0..n {
            let mut sum = 0.0;
            for (column, h) in hessian.row(row) {
                sum += h * x[column];
                if column != row {
                    dual[column] -= h * x[row];
                }
            }
            dual[row] -= sum;
        }
        for row in 0..self.m {
            let mut sum = 0.0;
            for (column, a) in jacobian.row(row) {
                sum += a * x[column];
                dual[column] -= a * y[row];
            }
            primal[row] -= sum;
        }
    }
}

impl Entries<'_> {
    #[inline]
    fn row(&self, row: usize) -> impl Iterator<Item = (usize, f64)> {
        let range = self.sparse.range(row);
        let columns = self.sparse.columns[range.clone()].iter();
        let entries = columns.zip(&self.values[range]);
        entries.map(|(&column, &value)| (column as usize, value))
    }
}
