//! The numbers of the Radau IIA method with s nodes.
//!
//! The method collocates: A⁻¹ is the derivative, at the nodes, of the polynomial that is 0 at 0 and z_i
//! at c_i. Its eigenvalues, one real and (s - 1)/2 complex pairs for odd s, split the linear systems of
//! Newton's method into blocks (Hairer & Wanner 1996, section IV.8).

use nalgebra::{Complex, DMatrix, DVector};

use crate::expansion::series;
use crate::integrate::tableau::{differentiation, monomials, radau_iia_nodes};
use crate::linalg::DenseLu;

/// Up to this many nodes coefficients are exact to some 1e-13, far below the tolerances for which so few
/// are chosen.
const EXACT_NODES: usize = 5;

/// Radau IIA with an odd number of nodes; matrices are row major unless they say otherwise.
#[derive(Debug)]
pub(crate) struct Tableau {
    /// s, the number of nodes; the order is 2s - 1.
    pub s: usize,
    /// c, ascending; the last is 1.
    pub nodes: Vec<f64>,
    /// A⁻¹, s × s.
    pub inverse: Vec<f64>,
    /// T and T⁻¹ with T⁻¹ A⁻¹ T = diag(γ, (a -b; b a), ..), s × s.
    pub transform: Vec<f64>,
    pub back: Vec<f64>,
    /// γ, the real eigenvalue of A⁻¹.
    pub gamma: f64,
    /// a + ib, one of each complex pair.
    pub pairs: Vec<Complex<f64>>,
    /// Points between the nodes at which the defect of the collocation polynomial is evaluated.
    pub probes: Vec<f64>,
    /// Values at the nodes to the coefficients of θ, .., θˢ of the polynomial that is 0 at 0, s × s,
    /// column by column.
    pub powers: Vec<f64>,
}

impl Tableau {
    /// The method with `s` nodes, which must be odd.
    pub(crate) fn new(s: usize) -> Self {
        assert!(s % 2 == 1, "an even number of nodes has no real eigenvalue");
        let nodes = radau_iia_nodes(s);
        let mut with_start = vec![0.0];
        with_start.extend(&nodes);
        let inverse = without_start(&differentiation(&with_start), s);
        let mut transform = DMatrix::zeros(s, s);
        let (real, complex) = eigenvalues(s, &inverse);
        let (gamma, vector) = eigenpair(s, &inverse, Complex::new(real, 0.0));
        transform.set_column(0, &vector.map(|v| v.re));
        let mut pairs = Vec::with_capacity(complex.len());
        for (j, &guess) in complex.iter().enumerate() {
            // From A⁻¹ (p - iq) = (a + ib)(p - iq): A⁻¹ (p q) = (p q) (a -b; b a).
            let (pair, vector) = eigenpair(s, &inverse, guess);
            transform.set_column(1 + 2 * j, &vector.map(|v| v.re));
            transform.set_column(2 + 2 * j, &vector.map(|v| -v.im));
            pairs.push(pair);
        }
        let back = transform
            .clone()
            .try_inverse()
            .expect("the eigenvalues are distinct");
        Tableau {
            s,
            powers: transposed(&without_start(&monomials(&with_start), s), s),
            probes: probes(&nodes),
            nodes,
            inverse,
            transform: row_major(&transform),
            back: row_major(&back),
            gamma: gamma.re,
            pairs,
        }
    }
}

impl Tableau {
    /// Coefficients in τ of the polynomial that is `start` at 0 and `start` + z_i at c_i h.
    pub(crate) fn interpolate(
        &self,
        start: f64,
        displacement: impl Fn(usize) -> f64,
        h: f64,
        series: &mut [f64],
    ) {
        series.fill(0.0);
        let columns = self.powers.chunks_exact(self.s);
        for (j, column) in columns.clone().enumerate() {
            add(column, displacement(j), &mut series[1..]);
        }
        if self.s > EXACT_NODES {
            // The coefficients lost digits that a second round brings back.
            for (j, column) in columns.enumerate() {
                let left = displacement(j) - series::value(series, self.nodes[j]);
                add(column, left, &mut series[1..]);
            }
        }
        series[0] = start;
        let mut power = 1.0;
        for c in &mut series[1..] {
            power /= h;
            *c *= power;
        }
    }
}

/// Adds a multiple of a column.
fn add(column: &[f64], factor: f64, to: &mut [f64]) {
    for (to, entry) in to.iter_mut().zip(column) {
        *to += entry * factor;
    }
}

fn transposed(matrix: &[f64], s: usize) -> Vec<f64> {
    DMatrix::from_row_slice(s, s, matrix).as_slice().to_vec()
}

fn row_major(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

/// A square matrix of the nodes and 0 in front of them, without the row and the column of 0.
fn without_start(matrix: &[f64], s: usize) -> Vec<f64> {
    let rows = matrix.chunks(s + 1).skip(1);
    rows.flat_map(|row| &row[1..]).copied().collect()
}

/// The real eigenvalue, and one of each complex pair.
fn eigenvalues(s: usize, matrix: &[f64]) -> (f64, Vec<Complex<f64>>) {
    let mut values: Vec<Complex<f64>> = DMatrix::from_row_slice(s, s, matrix)
        .complex_eigenvalues()
        .iter()
        .copied()
        .collect();
    values.sort_by(|a, b| a.im.abs().total_cmp(&b.im.abs()));
    let pairs = values.iter().copied().filter(|value| value.im > 0.0);
    (values[0].re, pairs.collect())
}

/// An eigenvalue that is known roughly, and its eigenvector, by inverse iteration.
fn eigenpair(
    s: usize,
    matrix: &[f64],
    guess: Complex<f64>,
) -> (Complex<f64>, DVector<Complex<f64>>) {
    let shift = guess * (1.0 + 1e-9);
    let mut shifted: Vec<Complex<f64>> = matrix.iter().map(|&entry| entry.into()).collect();
    for i in 0..s {
        shifted[i * s + i] -= shift;
    }
    let mut lu = DenseLu::new(s);
    lu.factor(&shifted)
        .expect("the shift is no eigenvalue itself");
    let mut vector = DVector::from_element(s, Complex::new(1.0, 0.0));
    let mut value = guess;
    for _ in 0..4 {
        let last = vector.normalize();
        vector.copy_from(&last);
        lu.solve(vector.as_mut_slice());
        // (A⁻¹ - shift)⁻¹ multiplies the eigenvector by 1/(value - shift).
        value = shift + last.dotc(&vector).inv();
    }
    (value, vector.normalize())
}

/// The middle of an early, a central and the last interval between nodes.
fn probes(nodes: &[f64]) -> Vec<f64> {
    let last = nodes.len() - 2;
    let mut intervals = vec![0, last.div_ceil(2), last];
    intervals.dedup();
    let middle = |i: usize| 0.5 * (nodes[i] + nodes[i + 1]);
    intervals.into_iter().map(middle).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const NODES: [usize; 5] = [3, 5, 7, 9, 11];

    fn assert_close(found: f64, exact: f64, tolerance: f64) {
        assert!((found - exact).abs() <= tolerance, "{found} is not {exact}");
    }

    fn matrix(s: usize, entries: &[f64]) -> DMatrix<f64> {
        DMatrix::from_row_slice(s, s, entries)
    }

    /// B(2s - 1), C(s) and D(s - 1), which imply order 2s - 1 (Butcher 1964).
    #[test]
    fn has_its_order() {
        for s in NODES {
            let tableau = Tableau::new(s);
            let c = &tableau.nodes;
            let a = matrix(s, &tableau.inverse).try_inverse().unwrap();
            let b = a.row(s - 1);
            for k in 1..2 * s {
                let sum: f64 = (0..s).map(|i| b[i] * c[i].powi(k as i32 - 1)).sum();
                assert_close(sum, 1.0 / k as f64, 1e-14);
            }
            for k in 1..=s {
                for i in 0..s {
                    let sum: f64 = (0..s).map(|j| a[(i, j)] * c[j].powi(k as i32 - 1)).sum();
                    assert_close(sum, c[i].powi(k as i32) / k as f64, 1e-14);
                }
            }
            for k in 1..s {
                for j in 0..s {
                    let terms = (0..s).map(|i| b[i] * c[i].powi(k as i32 - 1) * a[(i, j)]);
                    let exact = b[j] * (1.0 - c[j].powi(k as i32)) / k as f64;
                    assert_close(terms.sum(), exact, 1e-14);
                }
            }
        }
    }

    #[test]
    fn three_nodes_are_those_of_the_literature() {
        // Hairer & Wanner 1996, sections IV.5 and IV.8.
        let tableau = Tableau::new(3);
        let root = 6.0_f64.sqrt();
        for (found, exact) in
            tableau
                .nodes
                .iter()
                .zip([(4.0 - root) / 10.0, (4.0 + root) / 10.0, 1.0])
        {
            assert_close(*found, exact, 1e-15);
        }
        let cube = 3.0_f64.cbrt();
        assert_close(tableau.gamma, 3.0 + cube.powi(2) - cube, 1e-13);
        assert_close(
            tableau.pairs[0].re,
            3.0 - 0.5 * (cube.powi(2) - cube),
            1e-13,
        );
        let imaginary = 3.0_f64.sqrt() / 2.0 * (cube.powi(2) + cube);
        assert_close(tableau.pairs[0].im, imaginary, 1e-13);
    }

    #[test]
    fn the_transformation_separates_the_blocks() {
        for s in NODES {
            let tableau = Tableau::new(s);
            let mut blocks = DMatrix::zeros(s, s);
            blocks[(0, 0)] = tableau.gamma;
            for (j, pair) in tableau.pairs.iter().enumerate() {
                let at = 1 + 2 * j;
                blocks[(at, at)] = pair.re;
                blocks[(at + 1, at + 1)] = pair.re;
                blocks[(at, at + 1)] = -pair.im;
                blocks[(at + 1, at)] = pair.im;
            }
            let product = matrix(s, &tableau.transform) * blocks * matrix(s, &tableau.back);
            let difference = (product - matrix(s, &tableau.inverse)).amax();
            // What is missing only slows Newton's method down.
            assert!(difference < 1e-8, "{s} nodes: {difference:e}");
        }
    }

    #[test]
    fn powers_interpolate() {
        for s in NODES {
            let tableau = Tableau::new(s);
            for k in 1..=s {
                let values = tableau.nodes.iter().map(|c| c.powi(k as i32));
                let values = DVector::from_iterator(s, values);
                let coefficients = matrix(s, &tableau.powers).transpose() * values;
                for (at, found) in coefficients.iter().enumerate() {
                    let exact = if at + 1 == k { 1.0 } else { 0.0 };
                    assert_close(*found, exact, 1e-8);
                }
            }
        }
    }
}
