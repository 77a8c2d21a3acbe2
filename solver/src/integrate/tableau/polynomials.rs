//! Polynomials by their coefficients or by their values at nodes.

use super::extended::Extended;

/// Values at points of the Lagrange polynomials of nodes: row major, points × nodes.
///
/// Nodes are distinct, in any order. Each entry is a product of ratios (x - c_m)/(c_j - c_m), so it is
/// accurate to rounding between the nodes and beyond them, and 0 or 1 at the nodes without error.
pub fn lagrange(nodes: &[f64], points: &[f64]) -> Vec<f64> {
    assert_distinct(nodes);
    let entry = |point: f64, j: usize| {
        let others = nodes.iter().enumerate().filter(|(m, _)| *m != j);
        others.fold(1.0, |product, (_, c)| {
            product * ((point - c) / (nodes[j] - c))
        })
    };
    points
        .iter()
        .flat_map(|&point| (0..nodes.len()).map(move |j| (point, j)))
        .map(|(point, j)| entry(point, j))
        .collect()
}

/// The same of nodes that may stand next to themselves, as the start of an element beside a node there and the two middle
/// ones of a Runge-Kutta method: the first of them counts, and the polynomials of others are zero.
pub fn lagrange_distinct(nodes: &[f64], points: &[f64]) -> Vec<f64> {
    let is_first = |m: &usize| *m == 0 || nodes[*m] != nodes[*m - 1];
    let kept: Vec<usize> = (0..nodes.len()).filter(is_first).collect();
    let distinct: Vec<f64> = kept.iter().map(|&m| nodes[m]).collect();
    let mut values = vec![0.0; points.len() * nodes.len()];
    let rows = values.chunks_mut(nodes.len());
    let known = lagrange(&distinct, points);
    for (row, known) in rows.zip(known.chunks(kept.len())) {
        for (&m, &value) in kept.iter().zip(known) {
            row[m] = value;
        }
    }
    values
}

/// Derivatives at the nodes of the Lagrange polynomials of nodes: row major, nodes × nodes.
///
/// Nodes are distinct, in any order. With the weights w_j = 1/Π_m (c_j - c_m) the derivative of
/// polynomial j at c_i is w_j/w_i/(c_i - c_j), and Σ_m 1/(c_i - c_m) at its own node (Berrut &
/// Trefethen 2004, section 9.3).
pub fn differentiation(nodes: &[f64]) -> Vec<f64> {
    assert_distinct(nodes);
    let n = nodes.len();
    let c = extended(nodes);
    let scales: Vec<Extended> = (0..n).map(|j| scale(&c, j)).collect();
    let mut matrix = Vec::with_capacity(n * n);
    for i in 0..n {
        for j in 0..n {
            let entry = if i == j {
                let others = (0..n).filter(|m| *m != i);
                others.map(|m| Extended::ONE / (c[i] - c[m])).sum()
            } else {
                scales[i] / scales[j] / (c[i] - c[j])
            };
            matrix.push(entry.rounded());
        }
    }
    matrix
}

/// Coefficients of 1, τ, τ², .. of the Lagrange polynomials of nodes: row major, coefficients × nodes.
///
/// Nodes are distinct, in any order. Times the values at the nodes that gives the coefficients of the
/// polynomial through them. Entries are rounded once; what the sum loses by cancellation is up to the
/// values.
pub fn monomials(nodes: &[f64]) -> Vec<f64> {
    assert_distinct(nodes);
    let basis = basis(&extended(nodes));
    (0..nodes.len())
        .flat_map(|k| basis.iter().map(move |polynomial| polynomial[k].rounded()))
        .collect()
}

fn assert_distinct(nodes: &[f64]) {
    let distinct = |(i, c): (usize, &f64)| !nodes[..i].contains(c);
    assert!(
        nodes.iter().enumerate().all(distinct),
        "the nodes of a Lagrange polynomial are distinct"
    );
}

fn extended(nodes: &[f64]) -> Vec<Extended> {
    nodes.iter().map(|&c| c.into()).collect()
}

/// Π (c_j - c_m) over the other nodes.
fn scale(nodes: &[Extended], j: usize) -> Extended {
    let others = (0..nodes.len()).filter(|m| *m != j);
    others.fold(Extended::ONE, |product, m| product * (nodes[j] - nodes[m]))
}

/// The Lagrange polynomials of nodes, each by its coefficients of 1, τ, ..
pub(crate) fn basis(nodes: &[Extended]) -> Vec<Vec<Extended>> {
    let polynomial = |j: usize| {
        let others = (0..nodes.len()).filter(|m| *m != j);
        let product = others.fold(vec![Extended::ONE], |p, m| times_factor(&p, nodes[m]));
        let scale = scale(nodes, j);
        product.into_iter().map(|c| c / scale).collect()
    };
    (0..nodes.len()).map(polynomial).collect()
}

/// p(τ) (τ - root).
fn times_factor(p: &[Extended], root: Extended) -> Vec<Extended> {
    let lower = |k: usize| if k > 0 { p[k - 1] } else { Extended::ZERO };
    let own = |k: usize| p.get(k).map_or(Extended::ZERO, |&c| c * root);
    (0..=p.len()).map(|k| lower(k) - own(k)).collect()
}

/// p(τ) / (τ - root) without the remainder.
pub(crate) fn without_factor(p: &[Extended], root: Extended) -> Vec<Extended> {
    let mut quotient = p[1..].to_vec();
    for k in (1..quotient.len()).rev() {
        quotient[k - 1] = quotient[k - 1] + root * quotient[k];
    }
    quotient
}

/// p(τ) and p'(τ).
pub(crate) fn value_and_slope(p: &[Extended], tau: Extended) -> [Extended; 2] {
    let start = [Extended::ZERO; 2];
    p.iter().rev().fold(start, |[value, slope], &c| {
        [value * tau + c, slope * tau + value]
    })
}

/// p(τ).
pub(crate) fn value(p: &[Extended], tau: Extended) -> Extended {
    value_and_slope(p, tau)[0]
}

/// The integral of p from 0 to τ.
pub(crate) fn integral(p: &[Extended], tau: Extended) -> Extended {
    let terms = p.iter().enumerate().rev();
    terms.fold(Extended::ZERO, |sum, (k, &c)| {
        (sum + c / Extended::from(k + 1)) * tau
    })
}
