//! The drift off the surfaces that a mode slides on, projected away after each step.

use crate::contact::stabilization::{Constraint, Stabilization};
use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::expansion::scales::{Scales, refill};
use crate::hybrid::Role;
use crate::hybrid::point::Point;
use crate::linalg::Singular;

/// Rounds of Newton's method.
const ROUNDS: usize = 3;

/// Where |ψ| is a larger share of its terms, the sizes of the states in it may be nothing but rounding, and no weights.
const ASTRAY: f64 = 1e-9;

/// Then no weight is below this share of the largest one in the same ψ (chosen by trial).
const SMALLEST: f64 = 1e-6;

/// Memory for projections.
#[derive(Default)]
pub(crate) struct Projection {
    contacts: Stabilization,
    /// The states that lower derivatives have placed.
    placed: Vec<bool>,
    /// What the weight of each state is at least, where it is not zero.
    floors: Vec<f64>,
    /// The states that are not moved: those that determine algebraic ones and nothing else that slides.
    still: Vec<bool>,
}

impl Projection {
    /// Projects x onto the sliding surfaces, those of higher relative degree from ψ to its highest derivative, and returns
    /// the largest |ψ| found, relative to the size of its terms: contacts in the metric of the mass, others in the norm of
    /// the states' sizes.
    pub(crate) fn project(&mut self, mode: &mut Mode, state: &mut State) -> f64 {
        let mut drift = 0.0_f64;
        if mode.sliding.is_empty() {
            return drift;
        }
        let others = mode
            .sliding
            .iter()
            .filter(|&&i| !mode.system.switches[i].is_contact());
        let deepest = others.map(|&i| mode.surfaces.n_derivatives(i)).max();
        let deepest = deepest.unwrap_or(0);
        mode.surfaces.stand_for_order(&mode.sliding, None);
        self.hold_still(mode);
        self.contacts.find(mode);
        let mut placed = std::mem::take(&mut self.placed);
        for round in 0..ROUNDS {
            placed.clear();
            placed.resize(state.point.x.len(), false);
            let mut below = self
                .contacts
                .correct(mode, state, &mut placed, Constraint::Gap);
            for order in 0..deepest {
                let (worst, stepped) = self.step_onto(
                    mode,
                    &mut state.point,
                    &state.scales,
                    Some(order),
                    &mut placed,
                );
                below = below.max(worst);
                // Surfaces that depend on each other make the matrix singular.
                if stepped.is_err() {
                    step_onto_each(mode, &mut state.point, &state.scales, order);
                }
            }
            let rates = self
                .contacts
                .correct(mode, state, &mut placed, Constraint::Rate);
            let (worst, stepped) =
                self.step_onto(mode, &mut state.point, &state.scales, None, &mut placed);
            let worst = worst.max(rates);
            if round == 0 {
                drift = worst;
            }
            if worst.max(below) <= f64::EPSILON || stepped.is_err() {
                break;
            }
        }
        self.placed = placed;
        drift
    }

    /// One step of Newton's method towards all sliding surfaces at once, those of higher relative degree standing for
    /// their derivative of this order or their highest. The largest |ψ| before it, relative to the size of its terms.
    fn step_onto(
        &mut self,
        mode: &mut Mode,
        point: &mut Point,
        scales: &Scales,
        order: Option<usize>,
        placed: &mut [bool],
    ) -> (f64, Result<(), Singular>) {
        mode.surfaces.stand_for_order(&mode.sliding, order);
        mode.move_to(point);
        mode.linearize_surfaces();
        let mut worst = 0.0_f64;
        for at in 0..mode.sliding.len() {
            let i = mode.equations.switches()[at];
            if self.contacts.takes(mode, i, Constraint::of(order)) {
                mode.equations.rhs[at] = 0.0;
                continue;
            }
            let psi = mode.psi(i);
            let size = mode.surfaces.weigh(i, |j| scales.size(j));
            let follows = mode.equations.tie(at).is_some() || mode.equations.is_held(at);
            mode.equations.rhs[at] = if follows { 0.0 } else { psi };
            if size > 0.0 {
                worst = worst.max(psi.abs() / size);
            }
        }
        let mut factored = Ok(());
        if worst > f64::EPSILON {
            self.find_floors(mode, scales, order, worst);
            // What lower derivatives have placed stays there, as far as the others can be met without it.
            factored = self.correct(mode, point, scales, order, |j| placed[j]);
            if factored.is_err() && placed.contains(&true) {
                factored = self.correct(mode, point, scales, order, |_| false);
            }
        }
        if order.is_some() {
            let deep = mode.sliding.iter().copied();
            for i in deep.filter(|&i| mode.surfaces.n_derivatives(i) > 0) {
                let gradient = mode.surfaces.gradient(i).iter();
                gradient.for_each(|&(j, _)| placed[j] = true);
            }
        }
        mode.surfaces.stand_for_order(&mode.sliding, None);
        (worst, factored)
    }

    /// Finds the states that are not moved in the present mode.
    fn hold_still(&mut self, mode: &Mode) {
        refill(&mut self.still, mode.n, false);
        for component in mode.equations.components() {
            if component.iter().any(|&i| mode.system.role(i) == Role::Step) {
                continue;
            }
            for &i in component {
                for &(j, _) in mode.surfaces.gradient(i) {
                    self.still[j] = !mode.system.is_algebraic(j);
                }
            }
        }
    }

    /// s_j, the weight of state j: a correction minimizes Σ (Δx_j/s_j)². It is the size of the state, and zero for one that
    /// stays.
    fn weight(&self, mode: &Mode, scales: &Scales, j: usize) -> f64 {
        match scales.size(j) {
            _ if self.still[j] => 0.0,
            0.0 if mode.system.is_algebraic(j) => 1.0,
            size => size,
        }
    }

    /// Floors of the weights: `SMALLEST` of the largest one of a state in the same ψ where some ψ is off by more than `ASTRAY`
    /// of its terms, and else zero. `worst` is the largest |ψ|/Σ |terms|.
    fn find_floors(&mut self, mode: &Mode, scales: &Scales, order: Option<usize>, worst: f64) {
        let mut floors = std::mem::take(&mut self.floors);
        refill(&mut floors, mode.n, 0.0);
        let left = match worst > ASTRAY {
            true => &mode.sliding[..],
            false => &[],
        };
        let takes = |i: &&usize| self.contacts.takes(mode, **i, Constraint::of(order));
        for &i in left.iter().filter(|i| !takes(i)) {
            let terms = mode.surfaces.gradient(i).iter();
            let sizes = terms.map(|&(j, _)| self.weight(mode, scales, j));
            let share = SMALLEST * sizes.fold(0.0_f64, f64::max);
            for &(j, _) in mode.surfaces.gradient(i) {
                floors[j] = share.max(floors[j]);
            }
        }
        self.floors = floors;
    }

    /// Moves x by what the right sides of the equations ask for, but for states that stay.
    fn correct(
        &self,
        mode: &mut Mode,
        point: &mut Point,
        scales: &Scales,
        order: Option<usize>,
        stays: impl Fn(usize) -> bool,
    ) -> Result<(), Singular> {
        let moves = |mode: &Mode, j: usize| match self.weight(mode, scales, j) {
            _ if stays(j) => 0.0,
            // What has never moved does not begin to.
            0.0 => 0.0,
            size => size.max(self.floors[j]),
        };
        let mut equations = std::mem::take(&mut mode.equations);
        let factored = equations.factor_gram(
            &mode.surfaces,
            |j| moves(mode, j),
            |i| self.contacts.takes(mode, i, Constraint::of(order)),
        );
        if factored.is_ok() {
            equations.solve();
            for (i, multiplier) in equations.solution() {
                for &(j, g) in mode.surfaces.gradient(i) {
                    point.x[j] -= g * multiplier * moves(mode, j).powi(2);
                }
            }
        }
        mode.equations = equations;
        factored
    }
}

/// Projects x onto one surface after the other.
fn step_onto_each(mode: &mut Mode, point: &mut Point, scales: &Scales, order: usize) {
    for at in 0..mode.sliding.len() {
        let i = mode.sliding[at];
        let highest = mode.surfaces.n_derivatives(i);
        if order >= highest || mode.system.switches[i].is_contact() {
            continue;
        }
        mode.move_to(point);
        mode.surfaces.stand_for(i, order);
        mode.surfaces.linearize(i, &mode.memory.values);
        let psi = mode.psi(i);
        let gradient = mode.surfaces.gradient(i).iter();
        let square: f64 = gradient.map(|&(j, g)| (g * scales.size(j)).powi(2)).sum();
        if square > 0.0 {
            for &(j, g) in mode.surfaces.gradient(i) {
                point.x[j] -= g * psi / square * scales.size(j).powi(2);
            }
        }
        mode.surfaces.stand_for(i, highest);
    }
}
