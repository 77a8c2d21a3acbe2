//! Bodies: their positions q, velocities v and masses M, and v before and after a step.
//!
//! q' = K v + c,   M v' = f + Σ Jᵀλ

use super::scene::{Body, Free, Scene};
use crate::contact::coulomb::rows::{Mass, Rows};

/// A step of length h from x at t.
#[derive(Clone, Copy)]
pub(super) struct Step<'a> {
    pub t: f64,
    pub h: f64,
    pub x: &'a [f64],
}

/// A difference this small next to its terms is rounding.
pub(super) const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// No velocity, or no body.
const NONE: usize = usize::MAX;

/// Positions and velocities of all bodies, K, and M.
pub(super) struct Bodies {
    of: Vec<Body>,
    /// States that are velocities, body by body: v_j is state `velocities[j]`.
    pub velocities: Vec<usize>,
    /// j of each state that is a v_j, else `NONE`.
    number: Vec<usize>,
    /// Row i of K for each state i that is a position: (j, where K_ij is in `jacobian`).
    kinematics: Vec<Vec<(usize, usize)>>,
    /// ∂f/∂x by [`Free::slopes`], with K among its entries, and c, both at the middle of the step.
    jacobian: Vec<f64>,
    drift: Vec<f64>,
    pub mass: Mass,
    has_masses: bool,
}

impl Bodies {
    /// Numbers the velocities, and finds the sparsity of K = ∂q'/∂v in that of ∂f/∂x.
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
        for (entry, &(i, j)) in free.slopes().iter().enumerate() {
            if is_position[i] && number[j] != NONE {
                kinematics[i].push((number[j], entry));
            }
        }
        Bodies {
            of: scene.bodies.clone(),
            velocities,
            number,
            kinematics,
            jacobian: vec![0.0; free.slopes().len()],
            drift: vec![0.0; n],
            mass: Mass::new(scene.bodies.iter().map(|body| body.velocities.len())),
            has_masses: false,
        }
    }

    /// Begins a run, which may have other masses.
    pub fn begin(&mut self) {
        self.has_masses = false;
    }

    /// The velocity that a state is.
    pub fn velocity_of(&self, state: usize) -> usize {
        self.number[state]
    }

    /// What rates f move positions by in a time h: h q' and h² v'.
    pub fn moves_in(&self, h: f64, rates: &[f64]) -> f64 {
        let positions = self.of.iter().flat_map(|body| &body.positions);
        let by_velocities = positions.fold(0.0_f64, |most, &q| most.max((h * rates[q]).abs()));
        let velocities = self.velocities.iter();
        velocities.fold(by_velocities, |most, &v| most.max((h * h * rates[v]).abs()))
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

    /// c of a position.
    pub fn drift(&self, state: usize) -> f64 {
        self.drift[state]
    }

    /// Whether a body moves without velocity.
    pub fn drifts(&self, body: usize) -> bool {
        let mut positions = self.of[body].positions.iter();
        positions.any(|&q| self.drift[q] != 0.0)
    }

    /// (K_ij, j) of a position.
    pub fn moves(&self, state: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
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

/// Bodies in a step from x to x⁺.
pub(super) struct Motion {
    pub bodies: Bodies,
    /// The most that the free motion changes a position by.
    pub moved: f64,
    /// v
    pub before: Vec<f64>,
    /// v̂
    pub free: Vec<f64>,
    /// v⁺
    pub after: Vec<f64>,
    /// v̂ - v
    pub change: Vec<f64>,
}

impl Motion {
    pub fn new(bodies: Bodies) -> Self {
        Motion {
            bodies,
            moved: 0.0,
            before: Vec::new(),
            free: Vec::new(),
            after: Vec::new(),
            change: Vec::new(),
        }
    }

    /// Takes a free motion from x to x̂.
    pub fn load(&mut self, x: &[f64], free: &[f64]) {
        let bodies = &self.bodies;
        let of_bodies = |x: &[f64], v: &mut Vec<f64>| {
            v.clear();
            v.extend(bodies.velocities.iter().map(|&state| x[state]));
        };
        of_bodies(x, &mut self.before);
        of_bodies(free, &mut self.free);
        self.after.clone_from(&self.free);
        self.change.clear();
        let changes = self.free.iter().zip(&self.before);
        self.change
            .extend(changes.map(|(free, before)| free - before));
        let positions = bodies.of.iter().flat_map(|body| &body.positions);
        self.moved = positions.fold(0.0, |most, &q| most.max((free[q] - x[q]).abs()));
    }

    /// The most that the free motion changes a rate by, had it the direction of this row:
    /// (J D)^½ (Δvᵀ M Δv)^½ of its bodies, or |J| |Δv|, which is less where masses are far apart.
    pub fn gain(&self, rows: &Rows, row: usize) -> f64 {
        let mass = &self.bodies.mass;
        let (mut last, mut sum, mut square) = (usize::MAX, 0.0, 0.0);
        for &column in rows.columns(row) {
            let body = mass.body_of(column as usize);
            if body != last {
                let change = &self.change[mass.velocities_of(body)];
                square += change.iter().map(|v| v * v).sum::<f64>();
                sum += mass.product(body, &self.change, &self.change);
                last = body;
            }
        }
        (rows.diagonal(row) * sum)
            .min(rows.square(row) * square)
            .sqrt()
    }

    /// Leaves a body where it is in x, without velocity.
    pub fn halt(&mut self, body: usize, x: &[f64], y: &mut [f64]) {
        let positions = self.bodies.of[body].positions.iter();
        positions.for_each(|&q| y[q] = x[q]);
        self.after[self.bodies.mass.velocities_of(body)].fill(0.0);
    }

    /// Writes v⁺ to the end of the step.
    pub fn store(&self, y: &mut [f64]) {
        for (&state, v) in self.bodies.velocities.iter().zip(&self.after) {
            y[state] = *v;
        }
    }
}
