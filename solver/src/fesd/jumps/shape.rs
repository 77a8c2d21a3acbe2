//! Elements as polynomials, whatever has solved for their values.
//!
//! In an element, states are polynomials through their values at its nodes, and α through its values. A switch has one
//! side in an element: α is 0 or 1 at all of its nodes, or the state slides. A contact without a force is closed where
//! its gap vanishes. The two switches of a disc slide where their 2α - 1 is inside of it, and are above where it is on
//! the edge at all nodes.

use serde::{Deserialize, Serialize};

use super::checks::CLOSED;
use super::path::Piece;
use crate::hybrid::Side;
use crate::integrate::tableau::monomials;
use crate::linalg::largest;

/// The gap of a contact without a force that is so small is zero: programs, which are in the units of the model, leave it
/// that of their rounding, also where all states are zero.
const ROUNDED: f64 = 1e-14;

/// α that is so close to 0 or 1 is.
const ROUNDING: f64 = 1e-7;

/// Nodes that are closer, as a share of their element, make no polynomial.
const CLOSEST: f64 = 1e-4;

/// What the α of a switch is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// A step of ψ.
    Step,
    /// A force, which has no bound.
    Force,
    /// That of a contact.
    Contact,
    /// The rate of an algebraic state, by which the equation ψ = 0 is kept.
    Equation,
    /// That of one member -ψ of a pair; this is the switch of the other.
    Member(usize),
    /// An entry of a point in a disc; this is the switch of the other.
    Disc(usize),
}

/// Where the nodes of elements are, and what their α mean.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Shape {
    /// Node 0, the Runge-Kutta nodes, and the end, in an element of length 1.
    nodes: Vec<f64>,
    /// How many of them are Runge-Kutta nodes.
    n_nodes: usize,
    kinds: Vec<Kind>,
}

impl Shape {
    /// With the nodes of an element of length 1: 0, those of a Runge-Kutta method, and the end where it is none of them.
    pub fn new(nodes: &[f64], n_nodes: usize, kinds: Vec<Kind>) -> Self {
        Shape {
            nodes: nodes.to_vec(),
            n_nodes,
            kinds,
        }
    }

    /// Whether its elements have so many points, of these nodes, and it is one of so many switches.
    pub(super) fn fits(&self, n_points: usize, n_nodes: usize, n_switches: usize) -> bool {
        let mut kinds = self.kinds.iter();
        let are_there = kinds.all(|kind| match *kind {
            Kind::Member(other) | Kind::Disc(other) => other < n_switches,
            Kind::Step | Kind::Force | Kind::Contact | Kind::Equation => true,
        });
        let has_nodes = 0 < n_nodes && n_nodes == self.n_nodes && n_nodes < n_points;
        has_nodes && n_points == self.nodes.len() && self.kinds.len() == n_switches && are_there
    }

    /// The polynomials and sides of an element with the instants and states of its nodes and ends, and α at its nodes;
    /// `member` is -ψ of a member of a pair, or of a contact, at an instant and a state.
    pub fn element(
        &self,
        instants: &[f64],
        x: &[&[f64]],
        alphas: &[Vec<f64>],
        mut member: impl FnMut(usize, f64, &[f64]) -> f64,
    ) -> (Piece, Box<[Side]>) {
        let length = instants[instants.len() - 1] - instants[0];
        let (n, n_switches, n_coefficients) = (x[0].len(), alphas[0].len(), self.nodes.len());
        let nodes = apart(instants, &self.nodes);
        let through = monomials(&nodes);
        let inner = monomials(&nodes[1..=self.n_nodes]);
        let mut coefficients = vec![0.0; (n + n_switches) * n_coefficients];
        let (states, rest) = coefficients.split_at_mut(n * n_coefficients);
        for (i, row) in states.chunks_exact_mut(n_coefficients).enumerate() {
            write(row, &through, x.iter().map(|x| x[i]), length);
        }
        for (i, row) in rest.chunks_exact_mut(n_coefficients).enumerate() {
            write(row, &inner, alphas.iter().map(|alpha| alpha[i]), length);
        }
        let m = x.len() / 2;
        let mut middle = |switch| member(switch, instants[m], x[m]);
        let is_closed = |value: f64| value.abs() <= (CLOSED * largest(x[m])).max(ROUNDED);
        let sides =
            (0..n_switches).map(
                |i| match (self.side(i, alphas, &mut middle), self.kinds[i]) {
                    (Side::Plus, Kind::Contact) if is_closed(middle(i)) => Side::Slide,
                    (side, _) => side,
                },
            );
        let piece = Piece {
            from: instants[0],
            to: instants[instants.len() - 1],
            n_states: n,
            n_coefficients,
            coefficients,
        };
        (piece, sides.collect())
    }

    /// The side of a switch in an element by α at its nodes, and the values of members of pairs in its middle.
    fn side(&self, i: usize, alphas: &[Vec<f64>], member: impl FnMut(usize) -> f64) -> Side {
        let values = alphas.iter().map(|alpha| alpha[i]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), a| {
            (low.min(a), high.max(a))
        });
        match self.kinds[i] {
            Kind::Equation => Side::Slide,
            Kind::Member(other) => {
                // What is smaller in the middle of the element is zero.
                let [own, others] = [i, other].map(member);
                let is_zero = own < others || own == others && i < other;
                if is_zero { Side::Slide } else { Side::Minus }
            }
            Kind::Disc(other) => {
                let inside = |alpha: f64| (2.0 * alpha - 1.0).powi(2);
                let square = |alpha: &Vec<f64>| inside(alpha[i]) + inside(alpha[other]);
                let on_edge = alphas.iter().all(|alpha| square(alpha) >= 1.0 - ROUNDING);
                if on_edge { Side::Plus } else { Side::Slide }
            }
            _ if low >= 1.0 - ROUNDING => Side::Plus,
            Kind::Step if high <= ROUNDING => Side::Minus,
            Kind::Step | Kind::Force | Kind::Contact => Side::Slide,
        }
    }
}

/// Instants as shares of an element, or where nodes are while time passes evenly, should they be too close.
fn apart(instants: &[f64], even: &[f64]) -> Vec<f64> {
    let (from, to) = (instants[0], instants[instants.len() - 1]);
    let shares: Vec<f64> = instants.iter().map(|t| (t - from) / (to - from)).collect();
    let are_apart = shares.windows(2).all(|pair| pair[1] - pair[0] > CLOSEST);
    if are_apart { shares } else { even.to_vec() }
}

/// The polynomial in t through values at nodes, in an element of length h.
fn write(
    row: &mut [f64],
    monomials: &[f64],
    values: impl ExactSizeIterator<Item = f64> + Clone,
    h: f64,
) {
    let mut scale = 1.0;
    for (c, weights) in row.iter_mut().zip(monomials.chunks_exact(values.len())) {
        let terms = weights.iter().zip(values.clone());
        *c = scale * terms.map(|(weight, value)| weight * value).sum::<f64>();
        scale /= h;
    }
}
