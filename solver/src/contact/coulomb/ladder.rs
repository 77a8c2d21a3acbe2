//! Which solver comes after which.
//!
//! Few contacts are pivoted: forces are found to rounding, whatever depends on what ([`solve`]). Tangential dimensions of
//! two leave polygons, from whose solution Newton's method goes on, and what sticks shares its friction evenly.
//!
//! Many contacts are solved for island by island, from the impulses of the step before ([`Ladder`]): by sweeps, contact
//! by contact. In larger islands, and where sweeps take long, the contacts that push and those that stick are taken for
//! known, and their equations solved at once. What resists both is a convex program where there is no friction, is
//! pivoted where it is small, and is left to Newton's method where friction has two directions.

use super::active_set::ActiveSet;
use super::dense::DenseIsland;
use super::island::{Impulses, Island, Kept, Laws, Motion};
use super::islands::Islands;
use super::lemke::Pivoting;
use super::newton::{Newton, ROUNDED};
use super::problem::{NoSolution, Problem, Solution};
use super::rows::{ContactRows, Mass, Rows};
use super::sweep::sweep;
use super::{convex, distribution};

/// Residual, relative to the rates, that is accepted where solvers get no further.
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

/// Forces of a problem of few contacts. `slips` are slip velocities before: friction has their directions, and where it
/// stops them or they vanish it may have any.
pub(crate) fn solve(problem: &Problem, slips: &[f64]) -> Result<Solution, NoSolution> {
    let w = &problem.w;
    let n = w.n_contacts();
    if let Some(i) = (0..n).find(|&i| !problem.pushes(i, &slips[w.slips(i)])) {
        return Err(NoSolution::Paradox(i));
    }
    // Rates of one size, with γ measured as b is: λ is scaled by its own push.
    let units: Vec<f64> = (0..n).map(|i| 1.0 / w.push(i)).collect();
    let by_least = problem.least.iter().zip(&units);
    let rates = (problem.q.iter().copied()).chain(by_least.map(|(least, unit)| least / unit));
    let scale = rates.fold(0.0_f64, |most, rate| most.max(rate.abs()));
    let scaled = problem.scaled(&units, if scale > 0.0 { scale } else { 1.0 });
    let mut forces = vec![0.0; w.size()];
    if !Pivoting::default().solve(&scaled, &mut forces) {
        return Err(NoSolution::NotFound);
    }
    if (0..n).any(|i| w.slips(i).len() > 1) {
        let error = Newton::default().solve(&scaled, &mut forces);
        if error.is_none_or(|error| error > ROUNDED) {
            return Err(NoSolution::NotFound);
        }
        distribution::distribute(&scaled, &units, &mut forces);
    }
    let residual = scaled.residual(&forces);
    if residual > ACCEPTED {
        return Err(NoSolution::NotFound);
    }
    for i in 0..n {
        forces[i] *= scale * units[i];
        let of_contact = forces[w.slip_rows(i)].iter_mut();
        of_contact.for_each(|force| *force *= scale * units[i]);
    }
    let solution = problem.solution(&forces, residual);
    let turns = |i: usize| {
        let (slip, drag) = (&slips[w.slips(i)], &solution.tangential[w.slips(i)]);
        let along: f64 = slip.iter().zip(drag).map(|(w, drag)| w * drag).sum();
        along < 0.0 && !problem.pushes(i, drag)
    };
    match (0..n).find(|&i| turns(i)) {
        Some(i) => Err(NoSolution::Paradox(i)),
        None => Ok(solution),
    }
}

/// How all impulses of an island are solved for at once.
#[derive(Clone, Copy)]
enum By<'b> {
    /// The equations of guessed sets.
    Equations,
    /// A convex program.
    Program(&'b Mass),
    /// Complementary pivots.
    Pivoting,
    /// Newton's method for all laws at once.
    Newton,
}

/// What whoever asks wants of the solution.
#[derive(Clone, Copy, Default)]
pub(crate) struct Options {
    /// Attempts to solve for all impulses of an island at once.
    pub attempts: usize,
    /// Residual, relative to the speeds of an island, that counts as solved.
    pub tolerance: f64,
    /// A rate below this is rounding.
    pub rounding: f64,
}

/// Contacts in islands, with memory for their solvers.
#[derive(Default)]
pub(crate) struct Ladder {
    pub laws: Laws,
    pub impulses: Impulses,
    /// Largest residual, relative to the speeds of its island.
    pub residual: f64,
    pub solvers: Solvers,
}

/// The solvers of an island, with their memory.
#[derive(Default)]
pub(crate) struct Solvers {
    options: Options,
    /// Sweeps, and factorizations of what solves for all impulses of an island at once: pivots, and a convex program,
    /// count as one.
    pub sweeps: usize,
    pub factorizations: usize,
    active_set: ActiveSet,
    dense: DenseIsland,
    kept: Kept,
}

impl Ladder {
    /// Takes these contacts, without impulses.
    pub fn begin(
        &mut self,
        rows: &Rows,
        contacts: impl Iterator<Item = ContactRows>,
        options: Options,
    ) {
        self.laws.begin(rows, contacts);
        self.impulses.begin(self.laws.contacts().len());
        self.solvers.options = options;
        self.residual = 0.0;
    }

    /// Solves for the impulses, from those that are there; v becomes v⁺. The contact whose residual is too large,
    /// where there is one.
    pub fn solve(
        &mut self,
        rows: &Rows,
        islands: &mut Islands,
        mass: &Mass,
        v: &mut [f64],
    ) -> Result<(), usize> {
        islands.sort(rows, self.laws.contacts(), mass);
        let mut worst = Ok(());
        for island in 0..islands.len() {
            let island = Island {
                rows,
                laws: &self.laws,
                members: islands.contacts(island),
            };
            let mut motion = Motion {
                impulses: &mut self.impulses,
                v,
            };
            let residual = self.solvers.solve(&island, mass, &mut motion);
            if residual.is_nan() || residual > ACCEPTED {
                worst = Err(island.members[0] as usize);
            }
            self.residual = self.residual.max(residual);
        }
        worst
    }
}

impl Solvers {
    /// Begins to count.
    pub fn begin(&mut self) {
        (self.sweeps, self.factorizations) = (0, 0);
    }

    /// Solves for the impulses of an island; the relative residual.
    fn solve(&mut self, island: &Island, mass: &Mass, motion: &mut Motion) -> f64 {
        let scale = island.scale(motion.v);
        if scale.is_nan() {
            return scale;
        }
        if scale == 0.0 {
            for (c, _) in island.iter() {
                motion.impulses.normal[c] = 0.0;
                motion.impulses.tangential[c] = [0.0; 2];
            }
            return 0.0;
        }
        for (c, contact) in island.iter() {
            let normal = motion.impulses.normal[c];
            island.rows.add_impulse(contact.normal, normal, motion.v);
            let beta = motion.impulses.tangential[c];
            island.rows.add_friction(contact, beta, motion.v);
        }
        let scale = scale.max(self.options.rounding / self.options.tolerance);
        let enough = self.options.tolerance * scale;
        let has_cones = island.has_cones();
        // From step to step the contacts that push are mostly the same.
        let mut residual = f64::INFINITY;
        if island.members.len() >= MANY {
            residual = motion.residual(island);
            residual = self.improve(island, motion, residual, By::Equations);
            if residual <= enough {
                return residual / scale;
            }
        }
        for attempt in 0..self.options.attempts {
            // Equations that have not helped are tried less often.
            let sweeps = if attempt <= PIVOTING {
                SWEEPS
            } else {
                4 * SWEEPS
            };
            for _ in 0..sweeps {
                self.sweeps += 1;
                sweep(island, motion);
                residual = motion.residual(island);
                if residual <= enough {
                    return residual / scale;
                }
            }
            residual = self.improve(island, motion, residual, By::Equations);
            let is_smooth = || island.iter().all(|(_, contact)| !contact.is_rough());
            if residual > enough && attempt == CONVEX && is_smooth() {
                residual = self.improve(island, motion, residual, By::Program(mass));
                if residual > enough {
                    residual = self.improve(island, motion, residual, By::Equations);
                }
            }
            if residual > enough && has_cones {
                residual = self.improve(island, motion, residual, By::Newton);
            }
            if residual > enough && attempt == PIVOTING && !has_cones {
                residual = self.improve(island, motion, residual, By::Pivoting);
            }
            if residual <= enough {
                break;
            }
        }
        residual / scale
    }

    /// Solves the equations of contacts that push and of those that stick, or for all in another way, and keeps what has
    /// a smaller residual.
    fn improve(&mut self, island: &Island, motion: &mut Motion, before: f64, by: By) -> f64 {
        self.kept.save(island, motion);
        let (mut best, mut worse) = (before, 0);
        let guesses = match by {
            By::Equations => GUESSES,
            By::Program(_) | By::Pivoting | By::Newton => 1,
        };
        for _ in 0..guesses {
            let solved = match by {
                By::Equations => self.active_set.solve(island, motion),
                By::Newton => self.dense.refine(island, motion),
                By::Program(mass) => convex::solve(island, mass, motion),
                By::Pivoting => self.dense.pivot(island, motion),
            };
            self.factorizations += match by {
                By::Newton => self.dense.newton.factorizations,
                By::Equations | By::Program(_) | By::Pivoting => 1,
            };
            let residual = motion.residual(island);
            if !solved || residual.is_nan() {
                break;
            }
            if residual < best {
                best = residual;
                self.kept.save(island, motion);
            } else {
                worse += 1;
            }
            let is_settled = matches!(by, By::Equations) && self.active_set.is_settled();
            if is_settled || worse == MOST_WORSE {
                break;
            }
        }
        self.kept.restore(island, motion);
        best
    }
}
