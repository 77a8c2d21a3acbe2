//! A and b of a Runge-Kutta method, from its nodes.
//!
//! With ℓ_j the Lagrange polynomials of the nodes, the simplifying assumptions have solutions in closed
//! form, because they are linear in polynomials of degree below s:
//!
//! B(s): b_j = ∫₀¹ ℓ_j
//! C(s): a_ij = ∫₀^c_i ℓ_j
//! D(s): b_i a_ij = b_j ∫_c_j^1 ℓ_i
//!
//! Lobatto IIIC takes a_i1 = b_1; with λ_j the Lagrange polynomials of the nodes after the first, C(s - 1)
//! then is a_ij = ∫₀^c_i λ_j - b_1 λ_j(c_1). (Hairer & Wanner 1996, section IV.5.)

use super::Family;
use super::extended::Extended;
use super::nodes::Quadrature;
use super::polynomials::{basis, integral, value};

/// A method before rounding.
pub(crate) struct Exact {
    pub nodes: Vec<Extended>,
    /// Row major.
    pub a: Vec<Extended>,
    pub weights: Vec<Extended>,
}

impl Exact {
    /// The method of the family with `s` nodes, which it must have.
    pub(crate) fn new(family: Family, s: usize) -> Self {
        match family {
            Family::RadauIia => Self::implicit(Quadrature::RadauRight.nodes(s), collocation),
            Family::RadauIa => Self::implicit(Quadrature::RadauLeft.nodes(s), adjoint),
            Family::GaussLegendre => Self::implicit(Quadrature::Gauss.nodes(s), collocation),
            Family::LobattoIiia => Self::implicit(Quadrature::Lobatto.nodes(s), collocation),
            Family::LobattoIiic => Self::implicit(Quadrature::Lobatto.nodes(s), lobatto_iiic),
            Family::Explicit => explicit(s),
        }
    }

    /// B(s), and A from the nodes and weights.
    fn implicit(
        nodes: Vec<Extended>,
        matrix: impl Fn(&[Extended], &[Extended]) -> Vec<Extended>,
    ) -> Self {
        let polynomials = basis(&nodes);
        let weights: Vec<Extended> = polynomials
            .iter()
            .map(|l| integral(l, Extended::ONE))
            .collect();
        Exact {
            a: matrix(&nodes, &weights),
            nodes,
            weights,
        }
    }
}

/// C(s).
fn collocation(nodes: &[Extended], _: &[Extended]) -> Vec<Extended> {
    let polynomials = basis(nodes);
    nodes
        .iter()
        .flat_map(|&c| polynomials.iter().map(move |l| integral(l, c)))
        .collect()
}

/// D(s).
fn adjoint(nodes: &[Extended], weights: &[Extended]) -> Vec<Extended> {
    let mut a = Vec::new();
    for (l, &b_i) in basis(nodes).iter().zip(weights) {
        for (&c, &b_j) in nodes.iter().zip(weights) {
            a.push(b_j * (integral(l, Extended::ONE) - integral(l, c)) / b_i);
        }
    }
    a
}

/// C(s - 1) with a_i1 = b_1.
fn lobatto_iiic(nodes: &[Extended], weights: &[Extended]) -> Vec<Extended> {
    let polynomials = basis(&nodes[1..]);
    let mut a = Vec::new();
    for &c in nodes {
        a.push(weights[0]);
        for l in &polynomials {
            a.push(integral(l, c) - weights[0] * value(l, nodes[0]));
        }
    }
    a
}

/// Euler, Heun, Kutta and the classical method (Hairer, Nørsett & Wanner 1993, section II.1).
fn explicit(s: usize) -> Exact {
    let (nodes, a, sixths): (&[f64], &[f64], &[f64]) = match s {
        1 => (&[0.0], &[0.0], &[6.0]),
        2 => (&[0.0, 1.0], &[0.0, 0.0, 1.0, 0.0], &[3.0, 3.0]),
        3 => (
            &[0.0, 0.5, 1.0],
            &[0.0, 0.0, 0.0, 0.5, 0.0, 0.0, -1.0, 2.0, 0.0],
            &[1.0, 4.0, 1.0],
        ),
        _ => (
            &[0.0, 0.5, 0.5, 1.0],
            &[
                0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0,
            ],
            &[1.0, 2.0, 2.0, 1.0],
        ),
    };
    let exact = |values: &[f64]| values.iter().map(|&value| value.into()).collect();
    let sixth = |&share: &f64| Extended::from(share) / Extended::from(6.0);
    Exact {
        nodes: exact(nodes),
        a: exact(a),
        weights: sixths.iter().map(sixth).collect(),
    }
}
