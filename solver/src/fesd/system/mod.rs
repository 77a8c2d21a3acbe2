//! A complementarity system as plain data, and its functions in one active set.
//!
//! x' = f(t, x, z),   0 = g(t, x, z),   0 ≤ a ⟂ b ≥ 0
//!
//! Each member of a pair is an algebraic variable z_i or 1 - z_i, and at least one of them is
//! *continuous* along solutions: a function of t and x, as λ is in the reformulations of switches.
//! The other, like θ or α, jumps where the active set changes, or is continuous, too.
//!
//! Functions of time that are made of pieces enter by *numbers* that hold from one breakpoint to the
//! next, as the coefficients of their polynomials, and parameters of which runs have other values are numbers, too:
//! the last inputs of every function below.

pub(crate) mod active;
pub(crate) mod balanced;
pub(crate) mod check;
pub(crate) mod evaluator;
pub(crate) mod full;
pub(crate) mod hidden;
pub(crate) mod library;
pub(crate) mod pointwise;
pub(crate) mod reduce;
pub(crate) mod units;

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::fesd::system::full::Functions;
use crate::fesd::system::pointwise::Surfaces;
use crate::hybrid::{Partials, Piecewise, Side, write_pieces};
use crate::tape::Tape;

/// A complementarity system. All of it is known before a run: what an active set needs of its functions is made of them
/// when a run meets it, and nothing is asked for elsewhere.
///
/// It can be written and read, the same bit for bit in formats that keep numbers; what is read is checked.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(remote = "Self")]
pub struct ComplementaritySystem {
    /// All functions, with every z an input.
    pub full: Full,
    /// Whether a z is continuous along solutions.
    pub continuous: Vec<bool>,
    /// The entries of x that equations determine at each instant; their rates are among z.
    pub algebraic_states: Vec<usize>,
    /// The pairs.
    pub pairs: Vec<Pair>,
    /// The switches that a pair is about.
    pub switches_of: Vec<Vec<usize>>,
    /// Slip velocities with two entries.
    pub discs: Vec<Disc>,
    /// The switches that the pairs state.
    pub switches: Vec<Switch>,
    /// ψ of all switches, and z by them.
    pub surfaces: Surfaces,
    /// (i, j) for which the rate of ψ_i is a multiple of ψ_j, whatever z is: sliding on ψ_j = 0 keeps ψ_i.
    pub followers: Vec<(usize, usize)>,
    /// Functions of time that are made of pieces. For each in turn, where the present piece begins and its coefficients
    /// are the numbers.
    pub data: Vec<Arc<Piecewise>>,
    /// The values of parameters, the last of the numbers.
    pub parameters: Vec<f64>,
    /// Instants that no element passes over whose length is free, since functions of time are narrow there, in order.
    pub stops: Vec<f64>,
}

/// What is known of a switch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Switch {
    /// Whether rates contain its α in another way than affine.
    pub is_nonlinear: bool,
    /// The pair whose member it states, and which; none where it is a member of no complementarity.
    pub member: Option<(usize, Zero)>,
}

impl ComplementaritySystem {
    /// Length of x.
    pub fn n_states(&self) -> usize {
        self.full.rates.n_outputs()
    }

    /// Length of z.
    pub fn n_algebraics(&self) -> usize {
        self.surfaces.rules.z.len()
    }

    /// Length of ψ and α of the switches that the pairs state.
    pub fn n_switches(&self) -> usize {
        self.switches.len()
    }

    /// How many numbers there are: those that change at breakpoints, and parameters.
    pub fn n_numbers(&self) -> usize {
        let of_each = self.data.iter().map(|data| 1 + data.n_coefficients());
        of_each.sum::<usize>() + self.parameters.len()
    }

    /// Writes the numbers that hold from `t` on; the next breakpoint, infinity where there is none.
    pub(crate) fn numbers(&self, t: f64, numbers: &mut [f64]) -> f64 {
        let (of_data, parameters) = numbers.split_at_mut(numbers.len() - self.parameters.len());
        parameters.copy_from_slice(&self.parameters);
        write_pieces(&self.data, t, of_data)
    }

    /// The next instant behind `t` that no element passes over whose length is free; infinity where there is none.
    pub(crate) fn stop(&self, t: f64) -> f64 {
        let next = self.stops.partition_point(|stop| *stop <= t);
        self.stops.get(next).copied().unwrap_or(f64::INFINITY)
    }

    /// Whether a variable is continuous along solutions.
    pub(crate) fn is_continuous(&self, algebraic: usize) -> bool {
        self.continuous[algebraic]
    }
}

/// An algebraic state that is smaller than this share of the largest one may be zero: the multiplier of a
/// constraint that is never active has no size of its own.
pub const NEGLIGIBLE: f64 = 1e-3;

/// Raises the sizes of all states to those of `x`; of those that equations determine none is less than negligible.
pub(crate) fn measure(sizes: &mut [f64], x: &[f64], system: &ComplementaritySystem) {
    for (size, x) in sizes.iter_mut().zip(x) {
        *size = size.max(x.abs());
    }
    let largest = system
        .surfaces
        .units
        .largest(&system.algebraic_states, sizes);
    for &i in &system.algebraic_states {
        sizes[i] = sizes[i].max(NEGLIGIBLE * largest * system.surfaces.units.of_state(i));
    }
}

/// Which member of a pair is zero while an active set lasts.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub enum Zero {
    /// a = 0, b ≥ 0.
    Left,
    /// b = 0, a ≥ 0.
    Right,
}

impl Zero {
    /// The other member.
    pub fn other(self) -> Self {
        match self {
            Zero::Left => Zero::Right,
            Zero::Right => Zero::Left,
        }
    }
}

/// A member of a pair: z_i, or 1 - z_i.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Member {
    /// i.
    pub variable: usize,
    /// True for 1 - z_i.
    pub complement: bool,
}

impl Member {
    /// Its value.
    pub fn value(self, z: &[f64]) -> f64 {
        if self.complement {
            1.0 - z[self.variable]
        } else {
            z[self.variable]
        }
    }

    /// ∂/∂z_i, and so its rate over that of z_i.
    pub fn slope(self) -> f64 {
        if self.complement { -1.0 } else { 1.0 }
    }
}

/// 0 ≤ a ⟂ b ≥ 0.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Pair {
    /// a.
    pub left: Member,
    /// b.
    pub right: Member,
    /// Pairs of different groups share no equation.
    pub group: usize,
    /// Whether the member that jumps is 1 at most, as θ and α are; a force has no bound.
    pub is_bounded: bool,
}

impl Pair {
    /// The member that is zero, and the one that is not negative.
    pub fn split(&self, zero: Zero) -> (Member, Member) {
        match zero {
            Zero::Left => (self.left, self.right),
            Zero::Right => (self.right, self.left),
        }
    }
}

/// A slip velocity w with two entries: 0 = w_k - s u_k, 0 = 1 - |u|² - r and 0 ≤ s ⟂ r ≥ 0 for u = 2α - 1.
///
/// In the directional form u stays w/|w| where s is not zero, and s' is the rate of |w|.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Disc {
    /// The pair, s on its left.
    pub pair: usize,
    /// The equations of w among g.
    pub rows: [usize; 2],
    /// The places of α in z.
    pub alphas: [usize; 2],
    /// That of s.
    pub slip: usize,
    /// That of r.
    pub stick: usize,
    /// The equation of r.
    pub inside: usize,
    /// Both switches.
    pub switches: [usize; 2],
    /// How fast friction moves w at most, about.
    pub friction: f64,
}

impl Disc {
    /// The places of its variables in z.
    pub(crate) fn own(&self) -> [usize; 4] {
        let [first, second] = self.alphas;
        [first, second, self.slip, self.stick]
    }

    /// All of its equations.
    pub(crate) fn all_rows(&self) -> [usize; 3] {
        let [first, second] = self.rows;
        [first, second, self.inside]
    }
}

/// Functions of (t, x, z), and of the numbers that change at breakpoints.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Full {
    /// To (f, g).
    pub equations: Tape,
    /// Their partial derivatives by all inputs.
    pub slopes: Partials,
    /// (t, x, z, u) to the directional form of g, in which u_i is z_i, or z_i' of a continuous
    /// one: rows with a continuous variable are differentiated along x' = f(t, x, u).
    pub directional: Tape,
    /// Its partial derivatives by u: entries (row, u_i).
    pub directional_slopes: Partials,
    /// Whether the directional form is affine in u, so that it has one solution per active set.
    pub is_affine: bool,
    /// (t, x, z, u) to f.
    pub rates: Tape,
    /// (t, x, z) to α of all switches.
    pub alphas: Tape,
    /// Whether a row of g determines an algebraic state.
    pub determines_state: Vec<bool>,
}

/// The functions of an active set: zero members are substituted, and every z that an equation
/// gives explicitly is eliminated. What stays unknown is w, with as many residuals r.
#[derive(Clone, Debug)]
pub struct Reduced {
    /// The place in z of every w.
    pub unknowns: Vec<usize>,
    /// (t, x, w) to (f, r), by all inputs.
    pub equations: Functions,
    /// (t, x, w) to what determines w in a single point: r, or its derivative along f where it
    /// contains no w.
    pub hidden: Functions,
    /// (t, x, w) to z.
    pub algebraics: Tape,
    /// (t, x) to what keeps its value while the active set lasts, by x: ψ whose rate is a multiple of a φ on which
    /// the set slides, and these φ; none where that is nothing.
    pub kept: Option<Functions>,
    /// What must not be negative.
    pub watched: Vec<Watched>,
    /// (t, x, w) to the watched members, by all inputs.
    pub members: Functions,
    /// Where the switches stand.
    pub sides: Box<[Side]>,
    /// (t, x, w) to α of the switches that slide.
    pub alphas: Tape,
    /// Whether r are equations of the system, and none of their derivatives.
    pub is_direct: bool,
    /// Whether several w may solve the hidden equations, of which a run follows one.
    pub has_branches: bool,
    /// Whether f and r are affine in (x, w), with constant coefficients: one factorization serves
    /// all elements of one length.
    pub is_linear: bool,
}

impl Reduced {
    /// Whether a switch slides.
    pub fn slides(&self) -> bool {
        self.sides.contains(&Side::Slide)
    }
}

/// A member that is not zero by itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Watched {
    /// Its pair.
    pub pair: usize,
    /// Whether it is |w| of two entries, where elements end before it vanishes.
    pub stops: bool,
}
