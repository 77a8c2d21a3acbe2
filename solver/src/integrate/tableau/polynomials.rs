//! Polynomials by their coefficients or by their values at nodes.

use super::extended::Extended;

/// Values at points of the Lagrange polynomials of nodes: row major, points × nodes.
///
/// Each entry is a product of ratios (x - c_m)/(c_j - c_m), so it is accurate to rounding between the nodes and beyond
/// them, and 0 or 1 at the nodes without error. Nodes are in any order, and may stand next to themselves, as the start of
/// an element beside a node there and the two middle ones of a Runge-Kutta method: the first of them counts, and the
/// polynomials of others are zero.
pub fn lagrange(nodes: &[f64], points: &[f64]) -> Vec<f64> {
    let kept = firsts(nodes);
    let entry = |point: f64, j: usize| {
        let others = kept.iter().filter(|&&m| m != j).map(|&m| nodes[m]);
        others.fold(1.0, |product, c| product * ((point - c) / (nodes[j] - c)))
    };
    let mut values = vec![0.0; points.len() * nodes.len()];
    for (row, &point) in values.chunks_mut(nodes.len()).zip(points) {
        for &j in &kept {
            row[j] = entry(point, j);
        }
    }
    values
}

/// The nodes that do not stand next to themselves, which are distinct, and the first of others.
fn firsts(nodes: &[f64]) -> Vec<usize> {
    let is_first = |m: &usize| *m == 0 || nodes[*m] != nodes[*m - 1];
    let kept: Vec<usize> = (0..nodes.len()).filter(is_first).collect();
    assert_distinct(&kept.iter().map(|&m| nodes[m]).collect::<Vec<_>>());
    kept
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
/// Nodes are those of [`lagrange`]. Times the values at the nodes that gives the coefficients of the polynomial through
/// them. Entries are rounded once; what the sum loses by cancellation is up to the values.
pub fn monomials(nodes: &[f64]) -> Vec<f64> {
    let kept = firsts(nodes);
    let distinct: Vec<f64> = kept.iter().map(|&m| nodes[m]).collect();
    let mut matrix = vec![0.0; nodes.len() * nodes.len()];
    for (&j, polynomial) in kept.iter().zip(basis(&extended(&distinct))) {
        for (row, c) in matrix.chunks_mut(nodes.len()).zip(polynomial) {
            row[j] = c.rounded();
        }
    }
    matrix
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
