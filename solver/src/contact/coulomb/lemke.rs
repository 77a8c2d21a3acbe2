//! Frictional contact problems by complementary pivoting.
//!
//! In the plane β = β⁺ - β⁻ and γ = |b| make a linear complementarity problem in λ - λ₀ (Stewart & Trinkle 1996),
//!
//! a ⟂ λ - λ₀,   γ - b ⟂ β⁺,   γ + b ⟂ β⁻,   μλ - β⁺ - β⁻ ⟂ γ,
//!
//! which Lemke's method solves. A slip velocity with two entries has a β for each direction of a polygon, whose solution
//! is close to that of the disc.

use super::law::Pair;
use super::problem::Problem;
use crate::optimization::lcp;

/// Directions of the polygon inside a disc.
const FACETS: usize = 8;

/// Unknowns of the linear problem for a contact of this tangential dimension: λ - λ₀, a β for each direction, and γ.
pub(crate) fn unknowns(dim: usize) -> usize {
    match dim {
        0 => 1,
        1 => 1 + 2 + 1,
        _ => 1 + FACETS + 1,
    }
}

/// A direction of friction.
#[derive(Clone, Copy)]
struct Facet {
    contact: usize,
    direction: Pair,
}

impl Facet {
    /// The part of a row of W, or of rates, along the direction.
    fn along(&self, problem: &Problem, row: &[f64]) -> f64 {
        let of_contact = row[problem.w.slip_rows(self.contact)].iter();
        let terms = of_contact.zip(self.direction);
        terms.map(|(entry, d)| entry * d).sum()
    }
}

/// Memory for such problems.
#[derive(Default)]
pub(crate) struct Pivoting {
    lemke: lcp::Lemke,
    matrix: Vec<f64>,
    q: Vec<f64>,
    cover: Vec<f64>,
    facets: Vec<Facet>,
    /// The contacts with friction.
    rough: Vec<usize>,
    /// Rates with the forces λ₀.
    rates: Vec<f64>,
}

impl Pivoting {
    /// Sets p to a solution with polygons in place of discs; false where there is none. Forces and rates are in units of
    /// about their size.
    pub fn solve(&mut self, problem: &Problem, forces: &mut [f64]) -> bool {
        self.find_facets(problem);
        self.write(problem);
        let Ok(z) = self.lemke.solve(&self.matrix, &self.q, &self.cover) else {
            return false;
        };
        let n = problem.w.n_contacts();
        for (force, (z, least)) in forces.iter_mut().zip(z.iter().zip(&problem.least)) {
            *force = z + least;
        }
        forces[n..].fill(0.0);
        for (facet, z) in self.facets.iter().zip(&z[n..]) {
            let of_contact = forces[problem.w.slip_rows(facet.contact)].iter_mut();
            for (force, d) in of_contact.zip(facet.direction) {
                *force -= z * d;
            }
        }
        true
    }

    /// The directions of all contacts, first ones first: both of a line, or so many of a plane.
    fn find_facets(&mut self, problem: &Problem) {
        let w = &problem.w;
        let contacts = || 0..w.n_contacts();
        self.rough.clear();
        self.rough
            .extend(contacts().filter(|&i| !w.slips(i).is_empty()));
        self.facets.clear();
        for k in 0..FACETS {
            for &contact in &self.rough {
                let angle = std::f64::consts::TAU * k as f64 / FACETS as f64;
                let direction = match (w.slips(contact).len(), k) {
                    (1, 0) => [1.0, 0.0],
                    (1, 1) => [-1.0, 0.0],
                    (1, _) => continue,
                    _ => [angle.cos(), angle.sin()],
                };
                self.facets.push(Facet { contact, direction });
            }
        }
    }

    /// The linear problem: its unknowns are λ - λ₀ of all contacts, β of all directions, and γ of contacts with friction.
    fn write(&mut self, problem: &Problem) {
        let w = &problem.w;
        let (n, m) = (w.n_contacts(), self.facets.len());
        let size = n + m + self.rough.len();
        for (memory, size) in [(&mut self.matrix, size * size), (&mut self.q, size)] {
            memory.clear();
            memory.resize(size, 0.0);
        }
        self.cover.clear();
        self.cover.resize(size, 1.0);
        self.rates.clear();
        // λ₀ has no friction: it ends before that begins.
        let rate = |row: usize| problem.q[row] + w.times(row, &problem.least);
        self.rates.extend((0..w.size()).map(rate));
        for i in 0..n {
            let row = &mut self.matrix[i * size..][..size];
            self.q[i] = self.rates[i];
            row[..n].copy_from_slice(&w.row(i)[..n]);
            for (place, facet) in row[n..].iter_mut().zip(&self.facets) {
                *place = -facet.along(problem, w.row(i));
            }
        }
        for (f, facet) in self.facets.iter().enumerate() {
            let row = &mut self.matrix[(n + f) * size..][..size];
            self.q[n + f] = -facet.along(problem, &self.rates);
            for (t, d) in w.slip_rows(facet.contact).zip(facet.direction) {
                for (place, entry) in row[..n].iter_mut().zip(w.row(t)) {
                    *place -= entry * d;
                }
                for (place, other) in row[n..].iter_mut().zip(&self.facets) {
                    *place += other.along(problem, w.row(t)) * d;
                }
            }
        }
        for (r, &i) in self.rough.iter().enumerate() {
            let last = n + m + r;
            self.q[last] = problem.mu[i] * problem.least[i];
            self.matrix[last * size + i] = problem.mu[i];
            let of_contact = self.facets.iter().enumerate();
            for (f, _) in of_contact.filter(|(_, facet)| facet.contact == i) {
                self.matrix[(n + f) * size + last] = 1.0;
                self.matrix[last * size + n + f] = -1.0;
            }
        }
    }
}
