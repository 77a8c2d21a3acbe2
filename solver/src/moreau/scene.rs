//! What steps of time are taken of: free motion, bodies, and contacts that are alike.

use crate::adaptive::Field;
use crate::tape::Tape;

/// x' = f(t, x) without contacts, and what contacts need to know of it.
pub trait Free: Field {
    /// (i, j) of every ∂f_i/∂x_j that is not always zero, ordered by i.
    fn slopes(&self) -> &[(usize, usize)];
    /// Their values.
    fn jacobian(&mut self, t: f64, x: &[f64], values: &mut [f64]);
    /// M of all bodies, one after the other, row by row.
    fn masses(&mut self, t: f64, x: &[f64], values: &mut [f64]);
    /// Whether no M depends on time or states.
    fn masses_are_constant(&self) -> bool;
    /// The numbers that change at breakpoints only.
    fn coefficients(&self) -> &[f64];
}

/// A body: M(q) v' = f + Σ Jᵀλ, and q' is affine in v.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Body {
    /// The states q.
    pub positions: Vec<usize>,
    /// The states v.
    pub velocities: Vec<usize>,
}

/// Contacts that one function serves.
///
/// Places count t, then x, then the coefficients, then [`Scene::numbers`].
#[derive(Clone, Debug)]
pub struct Family {
    /// To the gap.
    pub gap: Tape,
    /// To the gap, its slope by time, the restitution, the friction, every entry of the slip velocity where all
    /// velocities are zero; then the slopes of the gap by the inputs `positions`, and those of each entry of the slip
    /// velocity by its inputs in `slips`.
    pub row: Tape,
    /// Inputs that are states other than velocities.
    pub positions: Vec<usize>,
    /// Inputs that are velocities, by entry of the slip velocity: none without friction, one in the plane, two in space.
    pub slips: Vec<Vec<usize>>,
    /// The places of the inputs of every contact, one contact after the other.
    pub inputs: Vec<u32>,
    /// The contacts.
    pub contacts: Vec<u32>,
}

/// Outputs of [`Family::row`] before those of the slip velocity.
pub(super) const HEAD: usize = 4;

impl Family {
    /// Inputs of one contact.
    pub(super) fn n_inputs(&self) -> usize {
        self.gap.n_inputs()
    }

    /// The places of the inputs of a contact.
    pub(super) fn inputs_of(&self, member: usize) -> &[u32] {
        let n = self.n_inputs();
        &self.inputs[member * n..(member + 1) * n]
    }
}

/// Bodies and their contacts.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The bodies; no state is in two of them.
    pub bodies: Vec<Body>,
    /// The contacts.
    pub families: Vec<Family>,
    /// The place of the first of the numbers: behind t, x and the coefficients.
    pub first_number: usize,
    /// Numbers that contacts of one family have different values of.
    pub numbers: Vec<f64>,
    /// How many contacts there are.
    pub n_contacts: usize,
}
