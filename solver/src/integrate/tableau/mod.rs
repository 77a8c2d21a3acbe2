//! Runge-Kutta methods with s nodes, computed from their definition.
//!
//! x_i = x₀ + h Σ_j a_ij f(x_j),   x₁ = x₀ + h Σ_j b_j f(x_j),   x_j at t₀ + c_j h
//!
//! The nodes c are those of a quadrature formula (`nodes.rs`), b its weights, and A follows from one
//! of the simplifying assumptions of Butcher 1964 (`matrices.rs`):
//!
//! B(p): Σ_i b_i c_i^(k-1) = 1/k                      for k = 1, .., p
//! C(q): Σ_j a_ij c_j^(k-1) = c_i^k / k               for k = 1, .., q and all i
//! D(r): Σ_i b_i c_i^(k-1) a_ij = b_j (1 - c_j^k) / k for k = 1, .., r and all j
//!
//! | family | nodes | A | order |
//! | --- | --- | --- | --- |
//! | Radau IIA | Radau, right | C(s) | 2s - 1 |
//! | Radau IA | Radau, left | D(s) | 2s - 1 |
//! | Gauss | Gauss | C(s) | 2s |
//! | Lobatto IIIA | Lobatto | C(s) | 2s - 2 |
//! | Lobatto IIIC | Lobatto | a_i1 = b_1, C(s - 1) | 2s - 2 |
//!
//! (Hairer & Wanner 1996, section IV.5.) Everything is computed with 32 digits and rounded once.
//! Runge-Kutta stages are called nodes here.

mod extended;
mod matrices;
mod nodes;
#[cfg(test)]
mod order_tests;
mod polynomials;
#[cfg(test)]
mod tests;

use std::ops::RangeInclusive;

use thiserror::Error;

use extended::Extended;
use matrices::Exact;
use nodes::Quadrature;
pub use polynomials::{differentiation, lagrange, monomials};

/// A family of Runge-Kutta methods, one for each number of nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Family {
    /// Collocation with the end as the last node; L-stable.
    RadauIia,
    /// The adjoint of Radau IIA, with the start as the first node; L-stable.
    RadauIa,
    /// Collocation at the zeros of a Legendre polynomial: the highest order; A-stable and symmetric.
    GaussLegendre,
    /// Collocation with both ends as nodes; A-stable and symmetric.
    LobattoIiia,
    /// Both ends as nodes and b_1 as the first column of A; L-stable.
    LobattoIiic,
    /// Euler, Heun with two nodes, Kutta with three, and the classical method with four.
    ///
    /// Of the methods with two and three nodes these have weights that are all positive, so that each
    /// node acts on the end of the step, and the end of the step as their last node.
    Explicit,
}

impl Family {
    /// All families.
    pub const ALL: [Family; 6] = [
        Family::RadauIia,
        Family::RadauIa,
        Family::GaussLegendre,
        Family::LobattoIiia,
        Family::LobattoIiic,
        Family::Explicit,
    ];

    /// Its name in lower case.
    pub fn word(self) -> &'static str {
        match self {
            Family::RadauIia => "radau_iia",
            Family::RadauIa => "radau_ia",
            Family::GaussLegendre => "gauss",
            Family::LobattoIiia => "lobatto_iiia",
            Family::LobattoIiic => "lobatto_iiic",
            Family::Explicit => "explicit",
        }
    }

    /// The numbers of nodes it has methods for.
    pub fn nodes(self) -> RangeInclusive<usize> {
        match self {
            Family::RadauIia | Family::RadauIa | Family::GaussLegendre => 1..=9,
            Family::LobattoIiia | Family::LobattoIiic => 2..=6,
            Family::Explicit => 1..=4,
        }
    }
}

/// Why there is no such method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum TableauError {
    /// The family has no method with this number of nodes.
    #[error("`{}` has {} to {} nodes, not {found}", .family.word(), .family.nodes().start(), .family.nodes().end())]
    NodeCount {
        /// The family.
        family: Family,
        /// The number of nodes that was asked for.
        found: usize,
    },
}

/// The numbers of a Runge-Kutta method.
#[derive(Clone, Debug)]
pub struct Tableau {
    /// The family it belongs to.
    pub family: Family,
    /// c, ascending, in [0, 1]; only the explicit method with four nodes has two that are equal.
    pub nodes: Vec<f64>,
    /// A, s × s, row major.
    pub a: Vec<f64>,
    /// b.
    pub weights: Vec<f64>,
    /// The order for x' = f(t, x).
    pub order: usize,
}

impl Tableau {
    /// The method of the family with this number of nodes.
    pub fn new(family: Family, n_nodes: usize) -> Result<Tableau, TableauError> {
        if !family.nodes().contains(&n_nodes) {
            return Err(TableauError::NodeCount {
                family,
                found: n_nodes,
            });
        }
        let exact = Exact::new(family, n_nodes);
        let order = match family {
            Family::RadauIia | Family::RadauIa => 2 * n_nodes - 1,
            Family::GaussLegendre => 2 * n_nodes,
            Family::LobattoIiia | Family::LobattoIiic => 2 * n_nodes - 2,
            Family::Explicit => n_nodes,
        };
        Ok(Tableau {
            family,
            nodes: rounded(&exact.nodes),
            a: rounded(&exact.a),
            weights: rounded(&exact.weights),
            order,
        })
    }

    /// s.
    pub fn n_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// The points of a step of length 1: its start, its nodes, and its end where that is none of them.
    pub fn points(&self) -> Vec<f64> {
        let end = (!self.ends_at_node()).then_some(1.0);
        let nodes = self.nodes.iter().copied();
        [0.0].into_iter().chain(nodes).chain(end).collect()
    }

    /// Whether the end of the step is the last node: c_s = 1 and b is the last row of A.
    pub fn ends_at_node(&self) -> bool {
        matches!(
            self.family,
            Family::RadauIia | Family::LobattoIiia | Family::LobattoIiic
        )
    }

    /// Whether the nodes are distinct and C(s) holds, so that the x_i lie on a polynomial of degree s
    /// that starts at x₀ and satisfies x' = f at the nodes. Of the explicit methods only Euler's does.
    pub fn is_collocation(&self) -> bool {
        match self.family {
            Family::RadauIia | Family::GaussLegendre | Family::LobattoIiia => true,
            Family::Explicit => self.n_nodes() == 1,
            Family::RadauIa | Family::LobattoIiic => false,
        }
    }

    /// Whether A is invertible, so that 0 = r(x) at the nodes determines the algebraic variables of
    /// x' = f(x, z), 0 = r(x).
    pub fn is_invertible(&self) -> bool {
        !matches!(self.family, Family::LobattoIiia | Family::Explicit)
    }

    /// The order of x for x' = f(x, z), 0 = r(x) with ∂r/∂x ∂f/∂z invertible, a differential-algebraic
    /// equation of index 2, with r = 0 at the nodes (Hairer & Wanner 1996, section VII.4).
    ///
    /// `None` where A is singular: z is not determined at a first node that is the start.
    pub fn sliding_order(&self) -> Option<usize> {
        let s = self.n_nodes();
        match self.family {
            Family::RadauIia => Some(2 * s - 1),
            Family::RadauIa => Some(s),
            Family::GaussLegendre => Some(s + s % 2),
            Family::LobattoIiic => Some(2 * s - 2),
            Family::LobattoIiia | Family::Explicit => None,
        }
    }
}

/// The nodes of Radau IIA, any number of them.
pub(crate) fn radau_iia_nodes(s: usize) -> Vec<f64> {
    rounded(&Quadrature::RadauRight.nodes(s))
}

fn rounded(values: &[Extended]) -> Vec<f64> {
    // The sum is 0 where the value is -0.
    values.iter().map(|value| value.rounded() + 0.0).collect()
}
