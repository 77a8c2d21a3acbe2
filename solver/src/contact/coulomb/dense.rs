//! Contacts of an island as a problem of numbers: W is written out for solvers that take all of it at once.

use super::island::{Island, Motion};
use super::lemke::{Pivoting, unknowns};
use super::newton::Newton;
use super::problem::Problem;

/// Unknowns up to which pivots, and steps of Newton's method, are worth their matrix.
const MOST_PIVOTING: usize = 160;
const MOST_NEWTON: usize = 300;

/// Memory for such problems. Impulses are in units of 1/W_nn, and rates in one unit for all.
#[derive(Default)]
pub(crate) struct DenseIsland {
    problem: Problem,
    pivoting: Pivoting,
    pub newton: Newton,
    /// The contacts that take part.
    contacts: Vec<u32>,
    /// By row of W the row of J, and the unit of its impulse.
    rows: Vec<usize>,
    units: Vec<f64>,
    forces: Vec<f64>,
}

impl DenseIsland {
    /// Sets impulses to a solution with polygons in place of discs by Lemke's method; false where it finds none, or with too
    /// many unknowns.
    pub fn pivot(&mut self, island: &Island, motion: &mut Motion) -> bool {
        self.contacts.clear();
        self.contacts.extend_from_slice(island.members);
        let of_contact = |c: &u32| unknowns(tangential_dimension(island, *c as usize));
        if self.contacts.iter().map(of_contact).sum::<usize>() > MOST_PIVOTING {
            return false;
        }
        motion.clear(island);
        self.write(island, motion);
        if self.scale() == 0.0 {
            return true;
        }
        self.forces.clear();
        self.forces.resize(self.problem.w.size(), 0.0);
        let solved = self.pivoting.solve(&self.problem, &mut self.forces);
        if solved {
            self.apply(island, motion);
        }
        solved
    }

    /// Moves the impulses of contacts that push to a solution by Newton's method, without those of all others; false
    /// where there is none, or too many unknowns.
    pub fn refine(&mut self, island: &Island, motion: &mut Motion) -> bool {
        self.contacts.clear();
        self.newton.factorizations = 0;
        let pushes = |c: &u32| motion.trial_normal(island, *c as usize) > 0.0;
        self.contacts
            .extend(island.members.iter().copied().filter(pushes));
        let unknowns = |c: &u32| 1 + tangential_dimension(island, *c as usize);
        let size: usize = self.contacts.iter().map(unknowns).sum();
        if size == 0 || size > MOST_NEWTON {
            return false;
        }
        let contacts = || self.contacts.iter().map(|&c| c as usize);
        self.forces.clear();
        self.forces
            .extend(contacts().map(|c| motion.impulses.normal[c]));
        for c in contacts() {
            let dim = tangential_dimension(island, c);
            let betas = motion.impulses.tangential[c].iter().take(dim);
            self.forces.extend(betas.map(|beta| -beta));
        }
        motion.clear(island);
        self.write(island, motion);
        if self.scale() == 0.0 {
            return false;
        }
        for (force, unit) in self.forces.iter_mut().zip(&self.units) {
            *force /= unit;
        }
        let solved = self.newton.solve(&self.problem, &mut self.forces).is_some();
        if solved {
            self.apply(island, motion);
        }
        solved
    }

    /// The problem of the contacts that take part, which have no impulses.
    fn write(&mut self, island: &Island, motion: &Motion) {
        let contacts = || self.contacts.iter().map(|&c| c as usize);
        let (rows, units, problem) = (&mut self.rows, &mut self.units, &mut self.problem);
        let dim = |c: usize| tangential_dimension(island, c);
        let unit = |c: usize| 1.0 / island.diagonal(c)[0];
        let normal = |c: usize| island.laws.contacts()[c].normal;
        rows.clear();
        rows.extend(contacts().map(normal));
        units.clear();
        units.extend(contacts().map(unit));
        problem.q.clear();
        problem
            .q
            .extend(contacts().map(|c| island.rate(c, motion.v)));
        for c in contacts() {
            let slip = island.slip(c, motion.v);
            for (k, slip) in slip.iter().enumerate().take(dim(c)) {
                rows.push(normal(c) + 1 + k);
                units.push(unit(c));
                problem.q.push(*slip);
            }
        }
        problem.mu.clear();
        problem
            .mu
            .extend(contacts().map(|c| island.laws.friction[c]));
        problem.least.clear();
        problem.least.resize(self.contacts.len(), 0.0);
        problem.w.fill(contacts().map(dim), |row, column| {
            island.rows.coupling(rows[row], rows[column]) * units[column]
        });
        let scale = self.scale();
        if scale > 0.0 {
            self.problem.q.iter_mut().for_each(|rate| *rate /= scale);
            self.units.iter_mut().for_each(|unit| *unit *= scale);
        }
    }

    /// The largest rate without impulses.
    fn scale(&self) -> f64 {
        let rates = self.problem.q.iter();
        rates.fold(0.0_f64, |most, rate| most.max(rate.abs()))
    }

    /// Gives the contacts that take part the impulses that were found.
    fn apply(&self, island: &Island, motion: &mut Motion) {
        let mut forces = self
            .forces
            .iter()
            .zip(&self.units)
            .map(|(p, unit)| p * unit);
        for &c in &self.contacts {
            let impulse = forces.next().unwrap_or(0.0);
            motion.set_normal(island, c as usize, impulse);
        }
        for &c in &self.contacts {
            let dim = tangential_dimension(island, c as usize);
            let mut beta = [0.0; 2];
            for (beta, force) in beta.iter_mut().zip(forces.by_ref().take(dim)) {
                *beta = -force;
            }
            motion.set_tangential(island, c as usize, beta);
        }
    }
}

/// Entries of the slip velocity that friction changes.
fn tangential_dimension(island: &Island, c: usize) -> usize {
    match island.diagonal(c)[1] > 0.0 {
        true => island.laws.contacts()[c].slips,
        false => 0,
    }
}
