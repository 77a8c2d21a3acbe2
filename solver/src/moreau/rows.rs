//! Rows of contacts: how gaps and slip velocities change with velocities.
//!
//! With q' = K v + c a gap has the rate J v + ∂gap/∂t + ∂gap/∂q c, J = ∂gap/∂q K.

use super::scene::{Family, Free, HEAD, Scene};
use crate::contact::coulomb::law::Pair;
use crate::contact::coulomb::rows::{ContactRows, Mass, Rows};
use crate::tape::LaneScratch;

/// A difference this small next to its terms is rounding.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// No velocity, or no body.
const NONE: usize = usize::MAX;

/// Positions and velocities of all bodies, K, and M.
pub(crate) struct Bodies {
    /// States that are velocities, body by body.
    pub velocities: Vec<usize>,
    /// The velocity that each state is.
    number: Vec<usize>,
    /// (velocity, slope) of every state that is a position.
    kinematics: Vec<Vec<(usize, usize)>>,
    /// Slopes of K as numbers, and c, where the step is.
    jacobian: Vec<f64>,
    pub drift: Vec<f64>,
    pub mass: Mass,
    has_masses: bool,
}

impl Bodies {
    pub fn new(scene: &Scene, free: &impl Free) -> Self {
        let n = free.n_states();
        let (mut velocities, mut number) = (Vec::new(), vec![NONE; n]);
        for &state in scene.bodies.iter().flat_map(|body| &body.velocities) {
            number[state] = velocities.len();
            velocities.push(state);
        }
        let mut is_position = vec![false; n];
        for &state in scene.bodies.iter().flat_map(|body| &body.positions) {
            is_position[state] = true;
        }
        let mut kinematics = vec![Vec::new(); n];
        for (slope, &(i, j)) in free.slopes().iter().enumerate() {
            if is_position[i] && number[j] != NONE {
                kinematics[i].push((number[j], slope));
            }
        }
        Bodies {
            velocities,
            number,
            kinematics,
            jacobian: vec![0.0; free.slopes().len()],
            drift: vec![0.0; n],
            mass: Mass::new(scene.bodies.iter().map(|body| body.velocities.len())),
            has_masses: false,
        }
    }

    /// The velocity that a state is.
    pub fn velocity_of(&self, state: usize) -> usize {
        self.number[state]
    }

    /// Takes K and M of a step; `rates` are f at `x`. False where some M is not positive definite.
    pub fn load(
        &mut self,
        free: &mut impl Free,
        (t, x): (f64, &[f64]),
        jacobian: &[f64],
        rates: &[f64],
    ) -> bool {
        self.jacobian.copy_from_slice(jacobian);
        for (state, (terms, drift)) in self.kinematics.iter().zip(&mut self.drift).enumerate() {
            let along = (terms.iter()).map(|&(v, slope)| jacobian[slope] * x[self.velocities[v]]);
            let (sum, size) = along.fold((0.0, rates[state].abs()), |(sum, size), term| {
                (sum + term, size + term.abs())
            });
            // What rounding leaves of a difference is no drift.
            *drift = match rates[state] - sum {
                rest if rest.abs() <= ROUNDING * size => 0.0,
                rest => rest,
            };
        }
        if self.has_masses && free.masses_are_constant() {
            return true;
        }
        self.has_masses = true;
        self.mass.write(|masses| free.masses(t, x, masses))
    }

    /// (K_ij, j) of a position.
    fn moves(&self, state: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let terms = self.kinematics[state].iter();
        terms.map(|&(v, slope)| (v, self.jacobian[slope]))
    }

    /// x += s K w
    pub fn displace(&self, s: f64, w: &[f64], x: &mut [f64]) {
        for (state, terms) in self.kinematics.iter().enumerate() {
            if !terms.is_empty() {
                let change: f64 = self.moves(state).map(|(v, k)| k * w[v]).sum();
                x[state] += s * change;
            }
        }
    }
}

/// A contact where it was looked at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    pub contact: u32,
    pub gap: f64,
    /// Rate of the gap where all velocities are zero.
    pub offset: f64,
    /// Whether the gap changes where all velocities are zero: with time itself, or by c.
    pub is_driven: bool,
    pub restitution: f64,
    pub friction: f64,
    pub rows: ContactRows,
    /// Slip velocity where all velocities are zero.
    pub slip: Pair,
}

/// Contacts with their rows.
#[derive(Default)]
pub(crate) struct Linear {
    pub contacts: Vec<Contact>,
    pub rows: Rows,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
    entries: Vec<(usize, f64)>,
    touched: Vec<usize>,
}

impl Linear {
    pub fn clear(&mut self) {
        self.contacts.clear();
        self.rows.clear();
    }

    /// The rows of all contacts.
    pub fn of_contacts(&self) -> impl Iterator<Item = ContactRows> + '_ {
        self.contacts.iter().map(|contact| contact.rows)
    }

    /// Adds the contacts `members` of a family, each with its gap, restitution and friction and its rows: one of J for
    /// the normal, with gap' = J v + offset, and one of H for every slip velocity, H v + slip.
    ///
    /// J = ∂gap/∂q K and offset = ∂gap/∂t + ∂gap/∂q c, where q' = K v + c. [`Family::row`] is evaluated for all members
    /// at once, with inputs from `memory`; its outputs are (gap, ∂gap/∂t, restitution, friction, slip, ∂gap/∂q, H).
    pub fn add(
        &mut self,
        family: &Family,
        members: &[u32],
        memory: &[f64],
        bodies: &Bodies,
        lanes: &mut LaneScratch,
    ) {
        let (n, n_in, n_out) = (members.len(), family.n_inputs(), family.row.n_outputs());
        gather(family, members, memory, &mut self.inputs);
        self.outputs.clear();
        self.outputs.resize(n * n_out, 0.0);
        family
            .row
            .eval_many(&self.inputs[..n * n_in], &mut self.outputs, n, lanes);
        for (p, &member) in members.iter().enumerate() {
            let output = |k: usize| self.outputs[k * n + p];
            // Places count t first: a state is at one place more than its number.
            let places = family.inputs_of(member as usize);
            self.entries.clear();
            let n_slips = family.slips.len();
            // ∂gap/∂q_i adds ∂gap/∂q_i c_i to the offset, and ∂gap/∂q_i K_ij to J_j.
            let first_slope = HEAD + n_slips;
            let mut offset = output(1);
            for (k, &input) in family.positions.iter().enumerate() {
                let (state, slope) = (places[input] as usize - 1, output(first_slope + k));
                offset += slope * bodies.drift[state];
                self.entries
                    .extend(bodies.moves(state).map(|(j, k_ij)| (j, k_ij * slope)));
            }
            let mut slip = [0.0; 2];
            for (k, slip) in slip.iter_mut().take(n_slips).enumerate() {
                *slip = output(HEAD + k);
            }
            let contact = Contact {
                contact: family.contacts[member as usize],
                gap: output(0),
                offset,
                is_driven: offset != 0.0,
                restitution: output(2),
                friction: output(3),
                rows: ContactRows {
                    normal: self.rows.len(),
                    slips: n_slips,
                },
                slip,
            };
            self.rows
                .push(&bodies.mass, &self.entries, &mut self.touched);
            // The rows of H directly follow that of the normal.
            let mut next = first_slope + family.positions.len();
            for inputs in &family.slips {
                self.entries.clear();
                for &input in inputs {
                    let velocity = bodies.velocity_of(places[input] as usize - 1);
                    self.entries.push((velocity, output(next)));
                    next += 1;
                }
                self.rows
                    .push(&bodies.mass, &self.entries, &mut self.touched);
            }
            self.contacts.push(contact);
        }
    }
}

/// The inputs of some contacts, one row per input.
pub(super) fn gather(family: &Family, members: &[u32], memory: &[f64], inputs: &mut Vec<f64>) {
    inputs.clear();
    for input in 0..family.n_inputs() {
        let places = members
            .iter()
            .map(|&member| family.inputs_of(member as usize)[input]);
        inputs.extend(places.map(|place| memory[place as usize]));
    }
}
