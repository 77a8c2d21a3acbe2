//! A relaxed MPCC as a nonlinear program.
//!
//! minimize f(w) [+ Σ s / σ]   subject to   the rows and bounds of the vertical form,   Φ(a, b, σ or s) <= 0
//!
//! The parameter σ is set from outside, or follows the barrier parameter of an interior-point method.

pub(crate) mod dual;
pub(crate) mod relaxation;
#[cfg(test)]
mod relaxed_tests;
use super::lift::Lifted;
use crate::optimization::mpcc::relaxed::dual::{Dual, ENTRIES};
use crate::optimization::mpcc::relaxed::relaxation::{Relaxation, Steering};
use crate::optimization::problem::{HeldStructure, Intervals, Nlp, Pattern, Structure};

/// What is chosen about a relaxation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Form {
    /// The functions Φ.
    pub relaxation: Relaxation,
    /// How σ enters.
    pub steering: Steering,
    /// Φ = 0 instead of Φ <= 0, where Φ is a smooth curve.
    pub is_equation: bool,
    /// Whether second derivatives of Φ stay as they are, where the Lagrangian is not convex, too.
    pub keeps_curvature: bool,
}

/// σ as a function of the barrier parameter μ: clamp(factor μ^power, smallest, largest).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// σ at μ = 1.
    pub factor: f64,
    /// The power of μ.
    pub power: f64,
    /// Where σ stops.
    pub smallest: f64,
    /// σ is never larger.
    pub largest: f64,
}

impl Default for Coupling {
    /// σ = 100 μ: each relaxed program is nearly solved before σ falls. By trial: from 10 μ on, and with σ <= 1,
    /// problems of optimal control end in worse local minima.
    fn default() -> Self {
        Coupling {
            factor: 100.0,
            power: 1.0,
            smallest: 1e-9,
            largest: 100.0,
        }
    }
}

impl Coupling {
    /// The same σ for all μ.
    pub fn constant(sigma: f64) -> Self {
        Coupling {
            factor: sigma,
            power: 0.0,
            smallest: sigma,
            largest: sigma,
        }
    }

    /// σ(μ).
    pub fn sigma(&self, mu: f64) -> f64 {
        let sigma = self.factor * mu.powf(self.power);
        sigma.max(self.smallest).min(self.largest)
    }
}

/// The relaxed problem; its variables are those of the vertical form, then the steering variables s.
pub struct Relaxed<'l, 'p> {
    lifted: &'l mut Lifted<'p>,
    form: Form,
    sigma: f64,
    coupling: Option<Coupling>,
    structure: HeldStructure,
    /// Where the entries of the vertical form are in this Hessian.
    hessian_places: Vec<u32>,
    /// Where the second derivatives of a pair are, in the order of [`ENTRIES`]; the last three only with steering.
    pair_places: Vec<[u32; 6]>,
    entries: Vec<f64>,
}

impl<'l, 'p> Relaxed<'l, 'p> {
    /// The relaxation with a parameter σ > 0, from a point of the vertical form.
    pub fn new(lifted: &'l mut Lifted<'p>, form: Form, sigma: f64, start: &[f64]) -> Self {
        let n = lifted.n_variables();
        let n_pairs = lifted.pairs().len();
        let n_steering = form.steering.n_variables(n_pairs);
        let n_rows = form.relaxation.n_rows();

        let n_all = n_pairs * n_rows;
        let limit = match form.is_equation && form.relaxation.is_curve() {
            true => 0.0,
            false => f64::NEG_INFINITY,
        };
        let bounds = lifted.variable_bounds();
        let variables = Intervals::extended(bounds, n_steering, [0.0, f64::INFINITY]);
        let rows = Intervals::extended(lifted.row_bounds(), n_all, [limit, 0.0]);

        let steering = |pair: usize| Some(form.steering.variable(n, pair)? as u32);
        let mut jacobian = lifted.jacobian_pattern().clone();
        let mut second = Vec::new();
        for (pair, &[a, b]) in lifted.pairs().iter().enumerate() {
            let mut columns = vec![a, b];
            columns.extend(steering(pair));
            columns.sort_unstable();
            columns.dedup();
            for _ in 0..n_rows {
                jacobian.columns.extend_from_slice(&columns);
                jacobian.starts.push(jacobian.columns.len());
            }
            for &column in &columns {
                second.extend(
                    columns
                        .iter()
                        .filter(|&&c| c >= column)
                        .map(|&c| (c, column)),
                );
            }
        }
        let original = lifted.hessian_pattern();
        let entries_of = |row: usize| original.row(row).iter().map(move |&c| (row as u32, c));
        second.extend((0..n).flat_map(entries_of));
        let hessian = Pattern::new(n + n_steering, second);
        let place = |(i, j): (u32, u32)| {
            let place = hessian.place(i.max(j) as usize, i.min(j));
            place.expect("the pattern has all entries") as u32
        };
        let hessian_places = (0..n).flat_map(entries_of).map(place).collect();
        let pair_places = lifted.pairs().iter().enumerate().map(|(pair, &[a, b])| {
            let members = [Some(a), Some(b), steering(pair)];
            ENTRIES.map(|(i, j)| match (members[i], members[j]) {
                (Some(i), Some(j)) => place((i, j)),
                _ => u32::MAX,
            })
        });
        let pair_places = pair_places.collect();
        let entries = vec![0.0; original.n_entries()];

        let structure = HeldStructure {
            variables,
            rows,
            start: [start, &vec![sigma; n_steering]].concat(),
            jacobian,
            hessian,
        };
        let mut relaxed = Relaxed {
            lifted,
            form,
            sigma,
            coupling: None,
            structure,
            hessian_places,
            pair_places,
            entries,
        };
        relaxed.set_sigma(sigma);
        relaxed
    }

    /// Lets σ follow the barrier parameter.
    pub fn coupled(mut self, coupling: Coupling) -> Self {
        self.coupling = Some(coupling);
        self
    }

    /// σ.
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Changes σ, and with it the bounds of the sides.
    pub fn set_sigma(&mut self, sigma: f64) {
        self.sigma = sigma;
        let excess = self.form.relaxation.excess(sigma);
        let bounds = self.lifted.variable_bounds();
        for &side in self.lifted.pairs().iter().flatten() {
            self.structure.variables.lower[side as usize] = bounds.lower[side as usize] - excess;
        }
    }

    /// The point without the steering variables.
    pub fn original<'w>(&self, w: &'w [f64]) -> &'w [f64] {
        &w[..self.lifted.n_variables()]
    }

    /// The parameter of a pair at a point: σ, or its steering variable.
    fn parameter(&self, pair: usize, w: &[f64]) -> f64 {
        let place = (self.form.steering).variable(self.lifted.n_variables(), pair);
        place.map_or(self.sigma, |i| w[i])
    }

    /// Φ of a row of a pair with its derivatives.
    fn row(&self, pair: usize, row: usize, w: &[f64]) -> Dual {
        let [a, b] = self.lifted.distances(pair, w);
        let sigma = self.parameter(pair, w);
        let sigma = match self.form.steering {
            Steering::Direct => Dual::constant(sigma),
            _ => Dual::variable(2, sigma),
        };
        let relaxation = self.form.relaxation;
        relaxation.row(row, Dual::variable(0, a), Dual::variable(1, b), sigma)
    }

    fn pair_rows(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let n_rows = self.form.relaxation.n_rows();
        (0..self.pair_places.len()).flat_map(move |pair| (0..n_rows).map(move |row| (pair, row)))
    }
}

/// What makes the second derivatives aa, ba, bb positive semidefinite in the metric of relative changes of a and b, in
/// which the eigenvalue that is negative becomes zero.
fn missing_curvature([aa, ba, bb]: [f64; 3], [a, b]: [f64; 2]) -> [f64; 3] {
    let (a, b) = (a.abs().max(f64::EPSILON), b.abs().max(f64::EPSILON));
    let (p, q, r) = (aa * a * a, ba * a * b, bb * b * b);
    let (mean, spread) = (0.5 * (p + r), (0.5 * (p - r)).hypot(q));
    let (larger, smaller) = (mean + spread, mean - spread);
    if smaller >= 0.0 {
        return [0.0; 3];
    }
    if larger <= 0.0 {
        return [-aa, -ba, -bb];
    }
    // The projection on the eigenvector of the smaller eigenvalue is (larger - M) / (larger - smaller).
    let share = -smaller / (larger - smaller);
    [
        share * (larger - p) / (a * a),
        -share * ba,
        share * (larger - r) / (b * b),
    ]
}

impl Nlp for Relaxed<'_, '_> {
    fn structure(&self) -> Structure<'_> {
        self.structure.view()
    }

    fn objective(&mut self, w: &[f64]) -> f64 {
        let (original, steering) = w.split_at(self.lifted.n_variables());
        let penalty = steering.iter().sum::<f64>() / self.sigma;
        self.lifted.objective(original) + penalty
    }

    fn gradient(&mut self, w: &[f64], gradient: &mut [f64]) {
        let n = self.lifted.n_variables();
        self.lifted.gradient(&w[..n], &mut gradient[..n]);
        gradient[n..].fill(1.0 / self.sigma);
    }

    fn rows(&mut self, w: &[f64], rows: &mut [f64]) {
        let n = self.lifted.n_variables();
        let (original, relaxed) = rows.split_at_mut(self.lifted.n_rows());
        self.lifted.rows(&w[..n], original);
        for (value, (pair, row)) in relaxed.iter_mut().zip(self.pair_rows()) {
            *value = self.row(pair, row, w).value;
        }
    }

    fn jacobian(&mut self, w: &[f64], entries: &mut [f64]) {
        let n = self.lifted.n_variables();
        let end = self.lifted.jacobian_pattern().n_entries();
        let (original, relaxed) = entries.split_at_mut(end);
        self.lifted.jacobian(&w[..n], original);
        relaxed.fill(0.0);
        let mut at = 0;
        for (pair, row) in self.pair_rows() {
            let gradient = self.row(pair, row, w).gradient;
            let [a, b] = self.lifted.pairs()[pair];
            // Columns ascend: the sides, in their order, then the steering variable.
            relaxed[at + usize::from(a > b)] += gradient[0];
            relaxed[at + usize::from(b > a)] += gradient[1];
            at += if a == b { 1 } else { 2 };
            if self.form.steering != Steering::Direct {
                relaxed[at] = gradient[2];
                at += 1;
            }
        }
    }

    fn hessian(&mut self, w: &[f64], factor: f64, y: &[f64], entries: &mut [f64]) {
        let n = self.lifted.n_variables();
        let (original, relaxed) = y.split_at(self.lifted.n_rows());
        let mut values = std::mem::take(&mut self.entries);
        self.lifted.hessian(&w[..n], factor, original, &mut values);
        entries.fill(0.0);
        for (&place, value) in self.hessian_places.iter().zip(&values) {
            entries[place as usize] = *value;
        }
        self.entries = values;
        let is_direct = self.form.steering == Steering::Direct;
        for (y, (pair, row)) in relaxed.iter().zip(self.pair_rows()) {
            if *y == 0.0 {
                continue;
            }
            let second = self.row(pair, row, w).hessian;
            let [a, b] = self.lifted.pairs()[pair];
            let places = &self.pair_places[pair][..if is_direct { 3 } else { 6 }];
            for (entry, (&place, value)) in places.iter().zip(second).enumerate() {
                // The mixed derivative counts twice on the diagonal.
                let count = if entry == 1 && a == b { 2.0 } else { 1.0 };
                entries[place as usize] += y * count * value;
            }
        }
    }

    fn convexify(&mut self, w: &[f64], y: &[f64], entries: &mut [f64]) -> bool {
        if self.form.keeps_curvature {
            return false;
        }
        let relaxed = &y[self.lifted.n_rows()..];
        for (y, (pair, row)) in relaxed.iter().zip(self.pair_rows()) {
            let [a, b] = self.lifted.pairs()[pair];
            if *y == 0.0 || a == b {
                continue;
            }
            let second = self.row(pair, row, w).hessian;
            let curvature = [second[0], second[1], second[2]].map(|h| y * h);
            let missing = missing_curvature(curvature, self.lifted.distances(pair, w));
            for (&place, value) in self.pair_places[pair].iter().zip(missing) {
                entries[place as usize] += value;
            }
        }
        true
    }

    fn follow(&mut self, mu: f64) -> bool {
        let Some(coupling) = self.coupling else {
            return false;
        };
        let sigma = coupling.sigma(mu);
        let has_changed = sigma != self.sigma;
        self.set_sigma(sigma);
        has_changed
    }
}
