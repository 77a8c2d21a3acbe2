//! A Runge-Kutta method in lanes over its nodes, with the interpolation that an element needs.

use wide::f64x4;

use crate::integrate::tableau::{Tableau, lagrange, monomials};

/// Nodes per lane.
pub(crate) const WIDTH: usize = 4;

/// A tableau, and what follows from it once and for all.
pub(crate) struct Scheme {
    /// s.
    pub s: usize,
    /// Lanes that hold one number per node.
    pub groups: usize,
    pub tableau: Tableau,
    /// c in lanes; places without a node are zero.
    pub nodes: Vec<f64x4>,
    /// Column j of A in lanes, at `j * groups`.
    pub columns: Vec<f64x4>,
    /// Values at the nodes to the coefficients of 1, σ, σ², .. with σ = τ/h, s × s.
    pub powers: Vec<f64>,
    /// What V of a node adds to the coefficients of σ, σ², .. of ∫ V dσ, s × s, node by node.
    pub integrals: Vec<f64>,
    /// Where members are looked at.
    pub points: Points,
}

/// 0, the nodes behind it, and 1.
pub(crate) struct Points {
    pub at: Vec<f64>,
    /// The point at every node.
    pub of_nodes: Vec<usize>,
    /// The node at every point; none at a start or end that is no node.
    pub nodes: Vec<Option<usize>>,
    /// On [0, 1].
    pub all: Interpolation,
    /// Of the points behind 0, in powers of σ - σ₁, on [σ₁, 1].
    pub inner: Interpolation,
}

/// The polynomial with given values at some points σ₀, σ₁, ..
pub(crate) struct Interpolation {
    /// Values to coefficients in σ - σ₀.
    powers: Vec<f64>,
    /// How far it may exceed its values: max_σ Σ |L_j(σ)|.
    pub lebesgue: f64,
}

impl Interpolation {
    fn new(points: &[f64]) -> Self {
        let distances: Vec<f64> = points.iter().map(|point| point - points[0]).collect();
        Interpolation {
            powers: monomials(&distances),
            lebesgue: lebesgue(points),
        }
    }

    /// Coefficients of the polynomial with these values.
    pub fn series(&self, values: &[f64], coefficients: &mut [f64]) {
        interpolate(&self.powers, values.len(), |j| values[j], coefficients);
    }
}

impl Points {
    fn new(nodes: &[f64]) -> Self {
        let mut at = Vec::with_capacity(nodes.len() + 2);
        if nodes[0] != 0.0 {
            at.push(0.0);
        }
        at.extend_from_slice(nodes);
        if nodes[nodes.len() - 1] < 1.0 {
            at.push(1.0);
        }
        at.dedup();
        let node_at = |point: &f64| nodes.iter().rposition(|node| node == point);
        let point_at = |node: &f64| at.iter().position(|point| point == node);
        Points {
            of_nodes: nodes.iter().filter_map(point_at).collect(),
            nodes: at.iter().map(node_at).collect(),
            all: Interpolation::new(&at),
            inner: Interpolation::new(&at[1..]),
            at,
        }
    }

    /// Where the polynomial of an element is compared with its equation: between nodes, early and late.
    pub fn probes(&self) -> [f64; 2] {
        let points = &self.at;
        let last = points.len() - 1;
        let end = if last > 0 { points[last - 1] } else { 0.0 };
        [0.5 * (points[0] + points[1.min(last)]), 0.5 * (end + 1.0)]
    }
}

impl Scheme {
    pub fn new(tableau: Tableau) -> Self {
        let s = tableau.n_nodes();
        let groups = s.div_ceil(WIDTH);
        let lanes = |value: &dyn Fn(usize) -> f64| -> Vec<f64x4> {
            let lane = |g: usize| {
                let at = |k: usize| (g * WIDTH + k < s).then(|| value(g * WIDTH + k));
                f64x4::from(std::array::from_fn(|k| at(k).unwrap_or(0.0)))
            };
            (0..groups).map(lane).collect()
        };
        let powers = powers(&tableau.nodes);
        let integral = |(j, k): (usize, usize)| powers[k * s + j] / (k + 1) as f64;
        let integrals = (0..s).flat_map(|j| (0..s).map(move |k| (j, k)));
        Scheme {
            s,
            integrals: integrals.map(integral).collect(),
            groups,
            nodes: lanes(&|m| tableau.nodes[m]),
            columns: (0..s)
                .flat_map(|j| lanes(&|m| tableau.a[m * s + j]))
                .collect(),
            powers,
            points: Points::new(&tableau.nodes),
            tableau,
        }
    }

    /// Coefficients in σ of the polynomial with these values at the nodes.
    pub fn series(&self, values: impl Fn(usize) -> f64, coefficients: &mut [f64]) {
        interpolate(&self.powers, self.s, values, coefficients);
    }
}

/// Values at the nodes to the coefficients in σ; where nodes coincide, their mean counts.
pub(crate) fn powers(nodes: &[f64]) -> Vec<f64> {
    let mut distinct = nodes.to_vec();
    distinct.dedup();
    let (s, d) = (nodes.len(), distinct.len());
    let matrix = monomials(&distinct);
    let mut powers = vec![0.0; s * s];
    for (j, c) in nodes.iter().enumerate() {
        let share = nodes.iter().filter(|other| *other == c).count() as f64;
        let place = distinct.iter().position(|other| other == c).unwrap_or(0);
        for k in 0..d {
            powers[k * s + j] = matrix[k * d + place] / share;
        }
    }
    powers
}

/// max Σ |L_j(σ)| between the first and the last point, as samples show it.
fn lebesgue(points: &[f64]) -> f64 {
    const SAMPLES: usize = 200;
    let (first, last) = (points[0], points[points.len() - 1]);
    let sample = |k: usize| first + (last - first) * k as f64 / SAMPLES as f64;
    let samples: Vec<f64> = (0..=SAMPLES).map(sample).collect();
    let values = lagrange(points, &samples);
    let sums = values.chunks(points.len());
    let sums = sums.map(|row| row.iter().map(|v| v.abs()).sum::<f64>());
    sums.fold(1.0, f64::max)
}

fn interpolate(powers: &[f64], n: usize, values: impl Fn(usize) -> f64, coefficients: &mut [f64]) {
    for (row, c) in powers.chunks_exact(n).zip(coefficients) {
        *c = row.iter().enumerate().map(|(j, p)| p * values(j)).sum();
    }
}
