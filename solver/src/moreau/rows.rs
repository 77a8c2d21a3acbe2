//! Rows of contacts: how gaps and slip velocities change with velocities.
//!
//! With q' = K v + c a gap has the rate J v + ∂gap/∂t + ∂gap/∂q c, J = ∂gap/∂q K.

use super::bodies::Bodies;
use super::resolution::{Lengths, Resolution, TOUCH};
use super::scene::{Family, HEAD};
use crate::contact::coulomb::law::Pair;
use crate::contact::coulomb::rows::{ContactRows, Rows};
use crate::tape::LaneScratch;

/// A contact where it was looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    pub contact: u32,
    pub gap: f64,
    pub resolution: Resolution,
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

impl Contact {
    /// Whether it is not closed.
    pub fn is_open(&self) -> bool {
        self.gap > self.resolution.share(TOUCH)
    }
}

/// Contacts with their rows.
#[derive(Default)]
pub(super) struct Linear {
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
        lengths: Lengths,
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
                offset += slope * bodies.drift(state);
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
                resolution: lengths.of(family, member, memory),
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
