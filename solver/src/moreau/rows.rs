//! Rows of contacts: how gaps and slip velocities change with velocities, and what impulses do.
//!
//! With q' = K v + c a gap has the rate J v + ∂gap/∂t + ∂gap/∂q c, J = ∂gap/∂q K, and an impulse Λ changes v by
//! D Λ, D = M⁻¹Jᵀ. M is factored body by body.

use super::scene::{Family, Free, HEAD, Scene};
use crate::tape::LaneScratch;

/// A difference this small next to its terms is rounding.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// No velocity, or no body.
const NONE: usize = usize::MAX;

/// Positions and velocities of all bodies, K, and M.
pub(crate) struct Bodies {
    /// States that are velocities, body by body.
    pub velocities: Vec<usize>,
    /// The first velocity of every body, and the end of the last.
    starts: Vec<usize>,
    /// The velocity that each state is.
    number: Vec<usize>,
    /// The body that each velocity belongs to.
    body: Vec<usize>,
    /// (velocity, slope) of every state that is a position.
    kinematics: Vec<Vec<(usize, usize)>>,
    /// Slopes of K as numbers, and c, where the step is.
    jacobian: Vec<f64>,
    pub drift: Vec<f64>,
    /// M row by row, and its Cholesky factors.
    pub masses: Vec<f64>,
    factors: Vec<f64>,
    mass_starts: Vec<usize>,
    has_masses: bool,
}

impl Bodies {
    pub fn new(scene: &Scene, free: &impl Free) -> Self {
        let n = free.n_states();
        let (mut velocities, mut starts, mut number) = (Vec::new(), vec![0], vec![NONE; n]);
        let (mut body, mut mass_starts) = (Vec::new(), vec![0]);
        for (b, of_body) in scene.bodies.iter().enumerate() {
            for &state in &of_body.velocities {
                number[state] = velocities.len();
                velocities.push(state);
                body.push(b);
            }
            starts.push(velocities.len());
            mass_starts.push(mass_starts[b] + of_body.velocities.len().pow(2));
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
        let n_masses = mass_starts[scene.bodies.len()];
        Bodies {
            velocities,
            starts,
            number,
            body,
            kinematics,
            jacobian: vec![0.0; free.slopes().len()],
            drift: vec![0.0; n],
            masses: vec![0.0; n_masses],
            factors: vec![0.0; n_masses],
            mass_starts,
            has_masses: false,
        }
    }

    pub fn n_bodies(&self) -> usize {
        self.starts.len() - 1
    }

    /// The velocity that a state is.
    pub fn velocity_of(&self, state: usize) -> usize {
        self.number[state]
    }

    pub fn body_of(&self, velocity: usize) -> usize {
        self.body[velocity]
    }

    pub fn velocities_of(&self, body: usize) -> std::ops::Range<usize> {
        self.starts[body]..self.starts[body + 1]
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
        free.masses(t, x, &mut self.masses);
        self.has_masses = true;
        self.factors.copy_from_slice(&self.masses);
        (0..self.n_bodies()).all(|b| {
            let n = self.starts[b + 1] - self.starts[b];
            cholesky(&mut self.factors[self.mass_starts[b]..], n)
        })
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

    /// vᵀMw of a body.
    pub fn product(&self, body: usize, v: &[f64], w: &[f64]) -> f64 {
        let range = self.velocities_of(body);
        let n = range.len();
        let mass = &self.masses[self.mass_starts[body]..self.mass_starts[body + 1]];
        let (v, w) = (&v[range.clone()], &w[range]);
        let rows = mass.chunks_exact(n.max(1)).zip(v);
        rows.map(|(row, vi)| vi * row.iter().zip(w).map(|(m, wj)| m * wj).sum::<f64>())
            .sum()
    }

    /// Overwrites entries of a body's velocities by L⁻¹ times them.
    fn solve_half(&self, body: usize, rhs: &mut [f64]) {
        let n = rhs.len();
        let l = &self.factors[self.mass_starts[body]..self.mass_starts[body + 1]];
        for i in 0..n {
            let known: f64 = (0..i).map(|k| l[i * n + k] * rhs[k]).sum();
            rhs[i] = (rhs[i] - known) / l[i * n + i];
        }
    }

    /// Overwrites entries of a body's velocities by M⁻¹ times them.
    fn solve(&self, body: usize, rhs: &mut [f64]) {
        self.solve_half(body, rhs);
        let n = rhs.len();
        let l = &self.factors[self.mass_starts[body]..self.mass_starts[body + 1]];
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| l[k * n + i] * rhs[k]).sum();
            rhs[i] = (rhs[i] - known) / l[i * n + i];
        }
    }
}

/// L of a = L Lᵀ in the lower triangle; false where a is not positive definite.
fn cholesky(a: &mut [f64], n: usize) -> bool {
    for i in 0..n {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| a[i * n + k] * a[j * n + k]).sum();
            let left = a[i * n + j] - known;
            if i == j {
                if left.is_nan() || left <= 0.0 {
                    return false;
                }
                a[i * n + i] = left.sqrt();
            } else {
                a[i * n + j] = left / a[j * n + j];
            }
        }
    }
    true
}

/// Rows J with D = M⁻¹Jᵀ, one after the other.
#[derive(Default)]
pub(crate) struct Rows {
    starts: Vec<usize>,
    columns: Vec<u32>,
    j: Vec<f64>,
    d: Vec<f64>,
}

impl Rows {
    pub fn clear(&mut self) {
        self.starts.clear();
        self.starts.push(0);
        self.columns.clear();
        self.j.clear();
        self.d.clear();
    }

    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Adds a row with these entries, each (velocity, value).
    fn push(&mut self, bodies: &Bodies, entries: &[(usize, f64)], touched: &mut Vec<usize>) {
        touched.clear();
        touched.extend(entries.iter().map(|&(v, _)| bodies.body[v]));
        touched.sort_unstable();
        touched.dedup();
        for &body in touched.iter() {
            let range = bodies.velocities_of(body);
            let first = self.j.len();
            self.columns.extend(range.clone().map(|v| v as u32));
            self.j.resize(first + range.len(), 0.0);
            for &(v, value) in entries.iter().filter(|(v, _)| bodies.body[*v] == body) {
                self.j[first + v - range.start] += value;
            }
            self.d.extend_from_slice(&self.j[first..]);
            bodies.solve(body, &mut self.d[first..]);
        }
        self.starts.push(self.columns.len());
    }

    fn range(&self, row: usize) -> std::ops::Range<usize> {
        self.starts[row]..self.starts[row + 1]
    }

    /// The velocities of a row.
    pub fn columns(&self, row: usize) -> &[u32] {
        &self.columns[self.range(row)]
    }

    /// J v
    pub fn rate(&self, row: usize, v: &[f64]) -> f64 {
        let range = self.range(row);
        let terms = self.columns[range.clone()].iter().zip(&self.j[range]);
        terms.map(|(&column, j)| j * v[column as usize]).sum()
    }

    /// L⁻¹Jᵀ, by velocity of the row.
    pub fn rooted(&self, row: usize, bodies: &Bodies) -> Vec<f64> {
        let mut values = self.j[self.range(row)].to_vec();
        let columns = self.columns(row);
        let mut first = 0;
        while first < columns.len() {
            let body = bodies.body_of(columns[first] as usize);
            let next = first + bodies.velocities_of(body).len();
            bodies.solve_half(body, &mut values[first..next]);
            first = next;
        }
        values
    }

    /// v += D z
    pub fn push_by(&self, row: usize, z: f64, v: &mut [f64]) {
        let range = self.range(row);
        for (&column, d) in self.columns[range.clone()].iter().zip(&self.d[range]) {
            v[column as usize] += d * z;
        }
    }

    /// J_t v of a contact.
    pub fn slip(&self, contact: &Contact, v: &[f64]) -> Pair {
        let mut slip = [0.0; 2];
        for (slip, row) in slip.iter_mut().zip(contact.slip_rows()) {
            *slip = self.rate(row, v);
        }
        slip
    }

    /// Velocities that occur in the rows of a contact, those of each row one after the other.
    pub fn columns_of(&self, contact: &Contact) -> &[u32] {
        let (first, end) = (contact.normal, contact.slip_rows().end);
        &self.columns[self.range(first).start..self.range(end - 1).end]
    }

    /// v -= D_t β
    pub fn rub(&self, contact: &Contact, beta: Pair, v: &mut [f64]) {
        for (row, beta) in contact.slip_rows().zip(beta) {
            self.push_by(row, -beta, v);
        }
    }

    /// J_a D_b
    pub fn coupling(&self, a: usize, b: usize) -> f64 {
        let (of_a, of_b) = (self.range(a), self.range(b));
        let (mut i, mut k, mut sum) = (of_a.start, of_b.start, 0.0);
        while i < of_a.end && k < of_b.end {
            match self.columns[i].cmp(&self.columns[k]) {
                std::cmp::Ordering::Less => i += 1,
                std::cmp::Ordering::Greater => k += 1,
                std::cmp::Ordering::Equal => {
                    sum += self.j[i] * self.d[k];
                    (i, k) = (i + 1, k + 1);
                }
            }
        }
        sum
    }

    /// |J|² of a row.
    pub fn square(&self, row: usize) -> f64 {
        self.j[self.range(row)].iter().map(|j| j * j).sum()
    }

    /// J D of a row.
    pub fn diagonal(&self, row: usize) -> f64 {
        let range = self.range(row);
        let terms = self.j[range.clone()].iter().zip(&self.d[range]);
        terms.map(|(j, d)| j * d).sum()
    }
}

/// A contact where it was looked at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    pub contact: u32,
    pub gap: f64,
    /// Rate of the gap where all velocities are zero.
    pub offset: f64,
    /// Whether the gap depends on time itself.
    pub is_driven: bool,
    pub restitution: f64,
    pub friction: f64,
    /// Its row of the normal; those of the slip velocity are next.
    pub normal: usize,
    /// Entries of the slip velocity; none without friction.
    pub slips: usize,
    /// Slip velocity where all velocities are zero.
    pub slip: Pair,
}

/// Up to two numbers, of the entries of a slip velocity; zero where there are less.
pub(super) type Pair = [f64; 2];

impl Contact {
    /// Whether there is friction.
    pub fn is_rough(&self) -> bool {
        self.slips > 0
    }

    /// Whether friction has two directions.
    pub fn is_conic(&self) -> bool {
        self.slips > 1
    }

    /// The rows of the slip velocity.
    pub fn slip_rows(&self) -> std::ops::Range<usize> {
        self.normal + 1..self.normal + 1 + self.slips
    }
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

    /// Adds the rows of some contacts of a family, whose functions are evaluated at `memory`.
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
            let places = family.inputs_of(member as usize);
            self.entries.clear();
            let n_slips = family.slips.len();
            let first = HEAD + n_slips;
            let mut offset = output(1);
            for (k, &input) in family.positions.iter().enumerate() {
                let (state, slope) = (places[input] as usize - 1, output(first + k));
                offset += slope * bodies.drift[state];
                self.entries
                    .extend(bodies.moves(state).map(|(v, k)| (v, k * slope)));
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
                normal: self.rows.len(),
                slips: n_slips,
                slip,
            };
            self.rows.push(bodies, &self.entries, &mut self.touched);
            let mut slope = first + family.positions.len();
            for inputs in &family.slips {
                self.entries.clear();
                for &input in inputs {
                    let velocity = bodies.velocity_of(places[input] as usize - 1);
                    self.entries.push((velocity, output(slope)));
                    slope += 1;
                }
                self.rows.push(bodies, &self.entries, &mut self.touched);
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
