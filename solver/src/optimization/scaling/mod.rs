//! Programs in units of their own.
//!
//! w = o + D w',   c = k + R c',   f = s f'
//!
//! where D, R and s are [`Sizes`], and o and k are the values nearest to zero that the bounds allow, if ranges are narrower
//! than these are far away, so that distances from bounds far from zero have digits of their own. All tolerances of a
//! solver are absolute ones of w', c' and f': those are of moderate size whatever the units of a model are. Sizes are
//! powers of two, so that they round nothing.

mod sizes;

pub use sizes::Sizes;

use crate::optimization::problem::{
    Bounds, HeldStructure, Intervals, Member, Mpcc, Nlp, Other, Pair, Pattern, Structure,
};

/// A program in w', c' and f'.
pub(crate) struct Scaled<'p> {
    problem: &'p mut dyn Mpcc,
    sizes: &'p Sizes,
    structure: HeldStructure,
    /// o and k.
    offsets: Vec<f64>,
    row_offsets: Vec<f64>,
    /// The row of every entry of the Jacobian, and the row and the column of every entry of the Hessian.
    rows: Vec<u32>,
    curvature: Vec<[u32; 2]>,
    /// A point w and multipliers y of the program itself.
    w: Vec<f64>,
    y: Vec<f64>,
}

/// The value nearest to zero between two bounds.
fn nearest(lower: f64, upper: f64) -> f64 {
    0.0_f64.max(lower).min(upper)
}

/// These, where a range is narrower than it is far from zero.
fn offsets(bounds: Bounds<'_>) -> Vec<f64> {
    let bounds = bounds.lower.iter().zip(bounds.upper);
    let offset = |(&lower, &upper): (&f64, &f64)| {
        let nearest = nearest(lower, upper);
        let is_far = lower < upper && nearest.abs() > upper - lower;
        if is_far { nearest } else { 0.0 }
    };
    bounds.map(offset).collect()
}

/// (value - offset) / size.
fn in_own_units(values: &[f64], offsets: &[f64], sizes: &[f64]) -> Vec<f64> {
    let places = values.iter().zip(offsets).zip(sizes);
    let scaled = places.map(|((value, offset), size)| (value - offset) / size);
    scaled.collect()
}

/// The row of every entry of a pattern.
fn rows(pattern: &Pattern) -> Vec<u32> {
    let rows = 0..pattern.n_rows();
    let entries = rows.flat_map(|row| pattern.row(row).iter().map(move |_| row as u32));
    entries.collect()
}

impl<'p> Scaled<'p> {
    pub fn new(problem: &'p mut dyn Mpcc, sizes: &'p Sizes) -> Self {
        let Structure {
            variables,
            rows: row_bounds,
            jacobian,
            hessian,
            start,
        } = problem.structure();
        let columns = hessian.columns.iter();
        let curvature = rows(hessian).into_iter().zip(columns);
        let mut scaled = Scaled {
            sizes,
            offsets: offsets(variables),
            row_offsets: offsets(row_bounds),
            rows: rows(jacobian),
            curvature: curvature.map(|(row, &column)| [row, column]).collect(),
            w: start.to_vec(),
            y: vec![0.0; row_bounds.lower.len()],
            structure: HeldStructure {
                variables: Intervals::extended(variables, 0, [0.0; 2]),
                rows: Intervals::extended(row_bounds, 0, [0.0; 2]),
                start: start.to_vec(),
                jacobian: jacobian.clone(),
                hessian: hessian.clone(),
            },
            problem,
        };
        scaled.structure.start = scaled.scaled(&scaled.w);
        scaled.read_bounds();
        scaled
    }

    /// Takes over the bounds, with the same offsets.
    fn read_bounds(&mut self) {
        let HeldStructure {
            variables, rows, ..
        } = &mut self.structure;
        let Sizes {
            variables: of_variables,
            rows: of_rows,
            ..
        } = self.sizes;
        let bounds = self.problem.variable_bounds();
        variables.lower = in_own_units(bounds.lower, &self.offsets, of_variables);
        variables.upper = in_own_units(bounds.upper, &self.offsets, of_variables);
        let bounds = self.problem.row_bounds();
        rows.lower = in_own_units(bounds.lower, &self.row_offsets, of_rows);
        rows.upper = in_own_units(bounds.upper, &self.row_offsets, of_rows);
    }

    /// w' of a point w.
    pub fn scaled(&self, w: &[f64]) -> Vec<f64> {
        in_own_units(w, &self.offsets, &self.sizes.variables)
    }

    fn load(&mut self, scaled: &[f64]) {
        let places = scaled.iter().zip(&self.offsets).zip(&self.sizes.variables);
        for (w, ((scaled, offset), size)) in self.w.iter_mut().zip(places) {
            *w = offset + size * scaled;
        }
    }

    /// R⁻¹ y' = y / s of multipliers y' of the rows.
    fn load_multipliers(&mut self, scaled: &[f64]) {
        let places = scaled.iter().zip(&self.sizes.rows);
        for (y, (scaled, size)) in self.y.iter_mut().zip(places) {
            *y = scaled / size;
        }
    }

    /// w of w' within the bounds, and R⁻¹ y' of multipliers y' of the rows.
    pub fn unscaled(&mut self, w: &[f64], y: &[f64]) -> [Vec<f64>; 2] {
        self.load(w);
        self.load_multipliers(y);
        let bounds = self.problem.variable_bounds();
        for (w, (lower, upper)) in self.w.iter_mut().zip(bounds.lower.iter().zip(bounds.upper)) {
            *w = w.max(*lower).min(*upper);
        }
        [self.w.clone(), self.y.clone()]
    }
}

impl Nlp for Scaled<'_> {
    fn structure(&self) -> Structure<'_> {
        self.structure.view()
    }

    fn has_objective(&self) -> bool {
        self.problem.has_objective()
    }

    fn objective(&mut self, w: &[f64]) -> f64 {
        self.load(w);
        self.problem.objective(&self.w) / self.sizes.objective
    }

    fn gradient(&mut self, w: &[f64], gradient: &mut [f64]) {
        self.load(w);
        self.problem.gradient(&self.w, gradient);
        for (slope, size) in gradient.iter_mut().zip(&self.sizes.variables) {
            *slope *= size / self.sizes.objective;
        }
    }

    fn rows(&mut self, w: &[f64], rows: &mut [f64]) {
        self.load(w);
        self.problem.rows(&self.w, rows);
        let places = self.row_offsets.iter().zip(&self.sizes.rows);
        for (row, (offset, size)) in rows.iter_mut().zip(places) {
            *row = (*row - offset) / size;
        }
    }

    fn jacobian(&mut self, w: &[f64], entries: &mut [f64]) {
        self.load(w);
        self.problem.jacobian(&self.w, entries);
        let columns = &self.structure.jacobian.columns;
        for ((entry, &row), &column) in entries.iter_mut().zip(&self.rows).zip(columns) {
            *entry *= self.sizes.variables[column as usize] / self.sizes.rows[row as usize];
        }
    }

    fn hessian(&mut self, w: &[f64], factor: f64, y: &[f64], entries: &mut [f64]) {
        self.load(w);
        self.load_multipliers(y);
        let factor = factor / self.sizes.objective;
        self.problem.hessian(&self.w, factor, &self.y, entries);
        let sizes = &self.sizes.variables;
        for (entry, [i, j]) in entries.iter_mut().zip(&self.curvature) {
            *entry *= sizes[*i as usize] * sizes[*j as usize];
        }
    }
}

impl Mpcc for Scaled<'_> {
    fn pairs(&self) -> &[Pair] {
        self.problem.pairs()
    }

    fn settle(&mut self, zeros: Option<&[Member]>) -> bool {
        let has_changed = self.problem.settle(zeros);
        if has_changed {
            self.read_bounds();
        }
        has_changed
    }

    fn terms(&self, pair: usize, member: Member) -> &[u32] {
        self.problem.terms(pair, member)
    }

    fn others(&mut self, w: &[f64], zeros: &[Member], y: &[f64]) -> Vec<Other> {
        self.load(w);
        self.load_multipliers(y);
        for y in &mut self.y {
            *y *= self.sizes.objective;
        }
        let mut others = self.problem.others(&self.w, zeros, &self.y);
        for (variable, value) in others.iter_mut().flat_map(|other| &mut other.w) {
            let place = *variable as usize;
            *value = (*value - self.offsets[place]) / self.sizes.variables[place];
        }
        others
    }
}
