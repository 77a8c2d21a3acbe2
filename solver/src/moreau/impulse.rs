//! Impulses of contacts: a linear complementarity problem with Coulomb's friction, island by island.
//!
//! v⁺ = v + D_n Λ - D_t β,   0 ≤ Λ ⟂ J_n v⁺ + c ≥ 0,   β ∈ μ Λ sign(J_t v⁺ + s).
//!
//! Projected Gauss-Seidel sweeps, contact by contact (Moreau 1988; Jean 1999, *The non-smooth contact dynamics
//! method*), start from the impulses of the step before. In larger islands, and where sweeps take long, the contacts
//! that push and those that stick are taken for known, and their equations solved at once (`direct.rs`). What resists both
//! is a convex program where there is no friction (`convex.rs`), and where it is small, is pivoted (`pivoting.rs`).

use super::convex;
use super::direct::Direct;
use super::islands::Islands;
use super::pivoting::{self, Pivoting};
use super::rows::{Bodies, Contact, Linear};

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
}

/// Impulses of the contacts of a [`Linear`].
#[derive(Default)]
pub(super) struct Impulses {
    /// c and s.
    pub normal_rate: Vec<f64>,
    pub slip_rate: Vec<f64>,
    /// μ.
    pub friction: Vec<f64>,
    /// Λ and β.
    pub normal: Vec<f64>,
    pub tangential: Vec<f64>,
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
    direct: Direct,
    pivoting: Pivoting,
}

/// An island of the problem.
pub(super) struct Island<'p> {
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
}

impl Impulses {
    /// Makes room for the contacts, without impulses.
    pub fn begin(&mut self, linear: &Linear) {
        let n = linear.contacts.len();
        for values in [
            &mut self.normal_rate,
            &mut self.slip_rate,
            &mut self.friction,
            &mut self.normal,
            &mut self.tangential,
        ] {
            values.clear();
            values.resize(n, 0.0);
        }
        self.diagonals.clear();
        self.diagonals.extend(linear.contacts.iter().map(|contact| {
            let slip = contact.is_rough.then_some(contact.normal + 1);
            let diagonal = |row: usize| linear.rows.diagonal(row);
            [diagonal(contact.normal), slip.map_or(0.0, diagonal)]
        }));
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
        for (c, contact) in island.iter().filter(|(_, contact)| contact.is_rough) {
            let slip = rows.rate(contact.normal + 1, v) + self.slip_rate[c];
            scale = scale.max(if scale > 0.0 { slip.abs() } else { 0.0 });
        }
        if scale == 0.0 {
            for &c in island.contacts {
                (self.normal[c as usize], self.tangential[c as usize]) = (0.0, 0.0);
            }
            return 0.0;
        }
        for (c, contact) in island.iter() {
            rows.push_by(contact.normal, self.normal[c], v);
            if contact.is_rough {
                rows.push_by(contact.normal + 1, -self.tangential[c], v);
            }
        }
        let scale = scale.max(self.rounding / self.tolerance);
        let enough = self.tolerance * scale;
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
            let is_smooth = || island.iter().all(|(_, contact)| !contact.is_rough);
            if residual > enough && attempt == CONVEX && is_smooth() {
                residual = self.improve(island, v, residual, By::Program(bodies));
                if residual > enough {
                    residual = self.improve(island, v, residual, By::Equations);
                }
            }
            if residual > enough && attempt == PIVOTING {
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
            let next = (self.normal[c] - rate / normal).max(0.0);
            rows.push_by(contact.normal, next - self.normal[c], v);
            self.normal[c] = next;
            if contact.is_rough && tangential > 0.0 {
                let slip = rows.rate(contact.normal + 1, v) + self.slip_rate[c];
                let most = self.friction[c] * next;
                let next = (self.tangential[c] + slip / tangential).clamp(-most, most);
                rows.push_by(contact.normal + 1, self.tangential[c] - next, v);
                self.tangential[c] = next;
            }
        }
    }

    /// Largest |min(Λ J D, J v + c)|, and the same for friction.
    fn residual_of(&self, island: &Island, v: &[f64]) -> f64 {
        let rows = &island.linear.rows;
        let mut residual = 0.0_f64;
        for (c, contact) in island.iter() {
            let [normal, tangential] = self.diagonals[c];
            let rate = rows.rate(contact.normal, v) + self.normal_rate[c];
            if !(rate + self.normal[c]).is_finite() {
                return f64::NAN;
            }
            residual = residual.max(rate.min(self.normal[c] * normal).abs());
            if contact.is_rough && tangential > 0.0 {
                let slip = rows.rate(contact.normal + 1, v) + self.slip_rate[c];
                let (beta, most) = (
                    self.tangential[c],
                    self.friction[c] * self.normal[c].max(0.0),
                );
                let wanted = (beta + slip / tangential).clamp(-most, most);
                residual = residual.max((wanted - beta).abs() * tangential);
            }
        }
        residual
    }

    /// Solves the equations of contacts that push and of those that stick, or for all in another way, and keeps what has
    /// a smaller residual.
    fn improve(&mut self, island: &Island, v: &mut [f64], before: f64, by: By) -> f64 {
        let mut direct = std::mem::take(&mut self.direct);
        let mut pivoting = std::mem::take(&mut self.pivoting);
        direct.save(island, self, v);
        let (mut best, mut worse) = (before, 0);
        let guesses = match by {
            By::Equations => GUESSES,
            By::Program(_) | By::Pivoting => 1,
        };
        for _ in 0..guesses {
            self.factorizations += 1;
            let solved = match by {
                By::Equations => direct.solve(island, self, v),
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
            if direct.is_settled() || worse == MOST_WORSE {
                break;
            }
        }
        direct.restore(island, self, v);
        (self.direct, self.pivoting) = (direct, pivoting);
        best
    }

    /// The diagonal J D of a normal and of a slip velocity.
    pub(super) fn diagonal(&self, c: usize) -> [f64; 2] {
        self.diagonals[c]
    }
}
