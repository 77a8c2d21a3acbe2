//! Impulses of contacts: a linear complementarity problem with Coulomb's friction, island by island.
//!
//! v⁺ = v + D_n Λ - D_t β,   0 ≤ Λ ⟂ J_n v⁺ + c ≥ 0,   β ∈ μ Λ sign(J_t v⁺ + s).
//!
//! Projected Gauss-Seidel sweeps, contact by contact (Moreau 1988; Jean 1999, *The non-smooth contact dynamics
//! method*), start from the impulses of the step before. In larger islands, and where sweeps take long, the contacts
//! that push and those that stick are taken for known, and their equations solved at once (`direct.rs`). What resists both
//! is a convex program where there is no friction (`convex.rs`), and where it is small, is pivoted (`pivoting.rs`).
//!
//! With two entries of the slip velocity, β ∈ μ Λ ∂|J_t v⁺ + s|. A sweep has the law of such a contact as a whole
//! (`cone.rs`), and Newton's method is there for what resists (`newton.rs`), as there is nothing to pivot.

use super::islands::Islands;
use super::rows::{Bodies, Contact, Linear, Pair, Rows};
use crate::moreau::solvers::cone::Cone;
use crate::moreau::solvers::direct::Direct;
use crate::moreau::solvers::newton::Newton;
use crate::moreau::solvers::pivoting::Pivoting;
use crate::moreau::solvers::{cone, convex, pivoting};

/// Residual that is accepted where sweeps and equations get no further.
const ACCEPTED: f64 = 1e-6;
/// Sweeps between two attempts to solve for all at once.
const SWEEPS: usize = 16;
/// Contacts of an island that are solved for at once before any sweep.
const MANY: usize = 4;
/// Guesses of the contacts that push, one after the other.
const GUESSES: usize = 8;
/// Guesses that bring nothing, before sweeps go on.
const MOST_WORSE: usize = 2;
/// Steps of Newton's method.
const NEWTON: usize = 24;
/// The attempts after which islands without friction are solved as programs, and small islands by pivoting.
const CONVEX: usize = 1;
const PIVOTING: usize = 3;

/// How all impulses of an island are solved for at once.
#[derive(Clone, Copy)]
enum By<'b> {
    /// The equations of guessed sets.
    Equations,
    /// A convex program.
    Program(&'b Bodies),
    /// Complementary pivots.
    Pivoting,
    /// Newton's method for all laws at once.
    Newton,
}

/// Impulses of the contacts of a [`Linear`].
#[derive(Default)]
pub(crate) struct Impulses {
    /// c and s.
    pub normal_rate: Vec<f64>,
    pub slip_rate: Vec<Pair>,
    /// μ.
    pub friction: Vec<f64>,
    /// Λ and β.
    pub normal: Vec<f64>,
    pub tangential: Vec<Pair>,
    /// Largest residual, relative to the speeds of its island.
    pub residual: f64,
    /// A rate below this is rounding.
    pub rounding: f64,
    /// Attempts to solve for all impulses at once.
    pub attempts: usize,
    /// Residual, relative to the speeds of an island, that counts as solved.
    pub tolerance: f64,
    /// Sweeps, and solved systems of equations.
    pub sweeps: usize,
    pub factorizations: usize,
    diagonals: Vec<[f64; 2]>,
    /// Of contacts with two entries, and by contact which of these would be the next.
    cones: Vec<Cone>,
    cone_of: Vec<u32>,
    direct: Direct,
    pivoting: Pivoting,
    newton: Newton,
}

/// An island of the problem.
pub(crate) struct Island<'p> {
    pub linear: &'p Linear,
    pub contacts: &'p [u32],
}

impl<'p> Island<'p> {
    /// (index, contact)
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = (usize, &'p Contact)> + '_ {
        let contacts = &self.linear.contacts;
        self.contacts
            .iter()
            .map(move |&c| (c as usize, &contacts[c as usize]))
    }

    /// The same of one place.
    pub fn contact(&self, i: usize) -> (usize, &'p Contact) {
        let c = self.contacts[i] as usize;
        (c, &self.linear.contacts[c])
    }
}

impl Impulses {
    /// Makes room for the contacts, without impulses.
    pub fn begin(&mut self, linear: &Linear) {
        let n = linear.contacts.len();
        for values in [&mut self.normal_rate, &mut self.friction, &mut self.normal] {
            values.clear();
            values.resize(n, 0.0);
        }
        for pairs in [&mut self.slip_rate, &mut self.tangential] {
            pairs.clear();
            pairs.resize(n, [0.0; 2]);
        }
        self.diagonals.clear();
        self.cones.clear();
        self.cone_of.clear();
        for contact in &linear.contacts {
            let diagonal = |row: usize| linear.rows.diagonal(row);
            self.cone_of.push(self.cones.len() as u32);
            let tangential = match contact.slips {
                0 => 0.0,
                1 => diagonal(contact.normal + 1),
                _ => {
                    let cone = Cone::of(&linear.rows, contact);
                    self.cones.push(cone);
                    cone.most()
                }
            };
            self.diagonals.push([diagonal(contact.normal), tangential]);
        }
        self.residual = 0.0;
    }

    /// Solves for the impulses, from those that are there; v becomes v⁺. The contact whose residual is too large,
    /// where there is one.
    pub fn solve(
        &mut self,
        linear: &Linear,
        islands: &mut Islands,
        bodies: &Bodies,
        v: &mut [f64],
    ) -> Result<(), usize> {
        islands.sort(linear, bodies);
        let mut worst = Ok(());
        for island in 0..islands.len() {
            let island = Island {
                linear,
                contacts: islands.contacts(island),
            };
            let residual = self.solve_island(&island, bodies, v);
            if residual.is_nan() || residual > ACCEPTED {
                worst = Err(island.contacts[0] as usize);
            }
            self.residual = self.residual.max(residual);
        }
        worst
    }

    /// The relative residual.
    fn solve_island(&mut self, island: &Island, bodies: &Bodies, v: &mut [f64]) -> f64 {
        let rows = &island.linear.rows;
        // How much the laws are violated without impulses.
        let mut scale = 0.0_f64;
        for (c, contact) in island.iter() {
            scale = scale.max(-(rows.rate(contact.normal, v) + self.normal_rate[c]));
        }
        for (c, contact) in island.iter().filter(|(_, contact)| contact.is_rough()) {
            let [x, y] = self.slip(rows, c, contact, v);
            scale = scale.max(if scale > 0.0 {
                cone::length([x, y])
            } else {
                0.0
            });
        }
        if scale == 0.0 {
            for &c in island.contacts {
                (self.normal[c as usize], self.tangential[c as usize]) = (0.0, [0.0; 2]);
            }
            return 0.0;
        }
        for (c, contact) in island.iter() {
            rows.push_by(contact.normal, self.normal[c], v);
            rows.rub(contact, self.tangential[c], v);
        }
        let scale = scale.max(self.rounding / self.tolerance);
        let enough = self.tolerance * scale;
        let has_cones = island.iter().any(|(_, contact)| contact.is_conic());
        // From step to step the contacts that push are mostly the same.
        let mut residual = f64::INFINITY;
        if island.contacts.len() >= MANY {
            residual = self.residual_of(island, v);
            residual = self.improve(island, v, residual, By::Equations);
            if residual <= enough {
                return residual / scale;
            }
        }
        for attempt in 0..self.attempts {
            // Equations that have not helped are tried less often.
            let sweeps = if attempt <= PIVOTING {
                SWEEPS
            } else {
                4 * SWEEPS
            };
            for _ in 0..sweeps {
                self.sweep(island, v);
                residual = self.residual_of(island, v);
                if residual <= enough {
                    return residual / scale;
                }
            }
            residual = self.improve(island, v, residual, By::Equations);
            let is_smooth = || island.iter().all(|(_, contact)| !contact.is_rough());
            if residual > enough && attempt == CONVEX && is_smooth() {
                residual = self.improve(island, v, residual, By::Program(bodies));
                if residual > enough {
                    residual = self.improve(island, v, residual, By::Equations);
                }
            }
            if residual > enough && has_cones {
                residual = self.improve(island, v, residual, By::Newton);
            }
            if residual > enough && attempt == PIVOTING && !has_cones {
                residual = self.improve(island, v, residual, By::Pivoting);
            }
            if residual <= enough {
                break;
            }
        }
        residual / scale
    }

    /// Contact by contact, the impulse that its own law asks for.
    fn sweep(&mut self, island: &Island, v: &mut [f64]) {
        self.sweeps += 1;
        let rows = &island.linear.rows;
        for (c, contact) in island.iter() {
            let [normal, tangential] = self.diagonals[c];
            let rate = rows.rate(contact.normal, v) + self.normal_rate[c];
            if contact.is_conic() {
                let slip = self.slip(rows, c, contact, v);
                let cone = self.cones[self.cone_of[c] as usize];
                let present = (self.normal[c], self.tangential[c]);
                let (next, beta) = cone.law(present, (rate, slip), self.friction[c]);
                rows.push_by(contact.normal, next - self.normal[c], v);
                self.normal[c] = next;
                self.rub_to(rows, c, contact, beta, v);
                continue;
            }
            let next = (self.normal[c] - rate / normal).max(0.0);
            rows.push_by(contact.normal, next - self.normal[c], v);
            self.normal[c] = next;
            if contact.is_rough() && tangential > 0.0 {
                let slip = rows.rate(contact.normal + 1, v) + self.slip_rate[c][0];
                let most = self.friction[c] * next;
                let beta = self.tangential[c][0];
                let next = (beta + slip / tangential).clamp(-most, most);
                rows.push_by(contact.normal + 1, beta - next, v);
                self.tangential[c][0] = next;
            }
        }
    }

    /// Largest |min(Λ J D, J v + c)|, and the same for friction.
    pub(super) fn residual_of(&self, island: &Island, v: &[f64]) -> f64 {
        let rows = &island.linear.rows;
        let mut residual = 0.0_f64;
        for (c, contact) in island.iter() {
            let [normal, tangential] = self.diagonals[c];
            let rate = rows.rate(contact.normal, v) + self.normal_rate[c];
            if !(rate + self.normal[c]).is_finite() {
                return f64::NAN;
            }
            residual = residual.max(rate.min(self.normal[c] * normal).abs());
            if contact.is_rough() && tangential > 0.0 {
                let most = self.friction[c] * self.normal[c].max(0.0);
                let beta = self.tangential[c];
                let wanted = cone::bounded(self.stopping(rows, c, contact, v), most);
                let missing = cone::length([wanted[0] - beta[0], wanted[1] - beta[1]]);
                residual = residual.max(missing * tangential);
            }
        }
        residual
    }

    /// Solves the equations of contacts that push and of those that stick, or for all in another way, and keeps what has
    /// a smaller residual.
    fn improve(&mut self, island: &Island, v: &mut [f64], before: f64, by: By) -> f64 {
        let mut direct = std::mem::take(&mut self.direct);
        let mut pivoting = std::mem::take(&mut self.pivoting);
        let mut newton = std::mem::take(&mut self.newton);
        direct.save(island, self, v);
        let (mut best, mut worse) = (before, 0);
        let guesses = match by {
            By::Equations => GUESSES,
            By::Newton => NEWTON,
            By::Program(_) | By::Pivoting => 1,
        };
        for _ in 0..guesses {
            self.factorizations += 1;
            let solved = match by {
                By::Equations => direct.solve(island, self, v),
                By::Newton => newton.solve(island, self, v),
                By::Program(bodies) => convex::solve(island, bodies, self, v),
                By::Pivoting => pivoting::solve(&mut pivoting, island, self, v),
            };
            let residual = self.residual_of(island, v);
            if !solved || residual.is_nan() {
                break;
            }
            if residual < best {
                best = residual;
                direct.save(island, self, v);
            } else {
                worse += 1;
            }
            let is_settled = matches!(by, By::Equations) && direct.is_settled();
            if is_settled || worse == MOST_WORSE {
                break;
            }
        }
        direct.restore(island, self, v);
        (self.direct, self.pivoting, self.newton) = (direct, pivoting, newton);
        best
    }

    /// The diagonal J D of a normal and of a slip velocity; of two entries the largest in any direction.
    pub(super) fn diagonal(&self, c: usize) -> [f64; 2] {
        self.diagonals[c]
    }

    /// J_t v + s
    pub(super) fn slip(&self, rows: &Rows, c: usize, contact: &Contact, v: &[f64]) -> Pair {
        let ([x, y], [a, b]) = (rows.slip(contact, v), self.slip_rate[c]);
        [x + a, y + b]
    }

    /// The friction that would stop a contact, if its diagonal were all that acts.
    pub(super) fn stopping(&self, rows: &Rows, c: usize, contact: &Contact, v: &[f64]) -> Pair {
        let [x, y] = self.slip(rows, c, contact, v);
        let ([a, b], tangential) = (self.tangential[c], self.diagonals[c][1]);
        [a + x / tangential, b + y / tangential]
    }

    /// Changes the friction of a contact.
    pub(super) fn rub_to(
        &mut self,
        rows: &Rows,
        c: usize,
        contact: &Contact,
        next: Pair,
        v: &mut [f64],
    ) {
        let beta = std::mem::replace(&mut self.tangential[c], next);
        rows.rub(contact, [next[0] - beta[0], next[1] - beta[1]], v);
    }
}
