//! The drift off the surfaces that a mode slides on, projected away after each step.

use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::expansion::scales::Scales;
use crate::hybrid::Role;
use crate::hybrid::point::Point;
use crate::linalg::Singular;

/// Rounds of Newton's method.
const ROUNDS: usize = 3;

/// Where ψ is a larger share of its terms, these are rounding themselves, and no measure of how far their states may be
/// moved. Then none of them counts as smaller than a share of the largest one.
const ASTRAY: f64 = 1e-9;
const SMALLEST: f64 = 1e-6;

impl Mode {
    /// Finds the states that are not moved where drift is projected away: those that determine algebraic ones and
    /// nothing else that slides.
    pub(crate) fn hold_still(&mut self) {
        self.still.fill(false);
        for component in self.equations.components() {
            if component.iter().any(|&i| self.system.role(i) == Role::Step) {
                continue;
            }
            for &i in component {
                for &(j, _) in self.surfaces.gradient(i) {
                    self.still[j] = !self.system.is_algebraic(j);
                }
            }
        }
    }
}

/// The projection of a state onto what slides in a mode.
pub(crate) struct Projection<'a> {
    pub mode: &'a mut Mode,
}

impl Projection<'_> {
    /// Projects x onto the sliding surfaces, those of higher relative degree from ψ to its highest derivative, and returns
    /// the largest |ψ| found, relative to the size of its terms: contacts in the metric of the mass, others in the norm of
    /// the states' sizes.
    pub(crate) fn project(&mut self, state: &mut State) -> f64 {
        let mut drift = 0.0_f64;
        if self.mode.sliding.is_empty() {
            return drift;
        }
        let others = self
            .mode
            .sliding
            .iter()
            .filter(|&&i| !self.mode.is_contact(i));
        let deepest = others.map(|&i| self.mode.surfaces.n_derivatives(i)).max();
        let deepest = deepest.unwrap_or(0);
        let mut placed = std::mem::take(&mut self.mode.mend.placed);
        for round in 0..ROUNDS {
            placed.clear();
            placed.resize(state.point.x.len(), false);
            let mut below = self.mode.mend_gaps(state, &mut placed);
            for order in 0..deepest {
                let (worst, stepped) =
                    self.step_onto(&mut state.point, &state.scales, Some(order), &mut placed);
                below = below.max(worst);
                // Surfaces that depend on each other make the matrix singular.
                if stepped.is_err() {
                    self.step_onto_each(&mut state.point, &state.scales, order);
                }
            }
            let rates = self.mode.mend_rates(state, &mut placed);
            let (worst, stepped) =
                self.step_onto(&mut state.point, &state.scales, None, &mut placed);
            let worst = worst.max(rates);
            if round == 0 {
                drift = worst;
            }
            if worst.max(below) <= f64::EPSILON || stepped.is_err() {
                break;
            }
        }
        self.mode.mend.placed = placed;
        drift
    }

    /// One step of Newton's method towards all sliding surfaces at once, those of higher relative degree standing for
    /// their derivative of this order or their highest. The largest |ψ| before it, relative to the size of its terms.
    fn step_onto(
        &mut self,
        point: &mut Point,
        scales: &Scales,
        order: Option<usize>,
        placed: &mut [bool],
    ) -> (f64, Result<(), Singular>) {
        self.stand_for_order(order);
        self.mode.move_to(point);
        self.mode.linearize_surfaces();
        let mut worst = 0.0_f64;
        for at in 0..self.mode.sliding.len() {
            let i = self.mode.equations.switches[at];
            if self.mode.is_mended(i, order) {
                self.mode.equations.rhs[at] = 0.0;
                continue;
            }
            let psi = self.mode.psi(i);
            let size = self.mode.weigh(i, |j| scales.size(j));
            let follows = self.mode.equations.tie(at).is_some() || self.mode.equations.is_held(at);
            self.mode.equations.rhs[at] = if follows { 0.0 } else { psi };
            if size > 0.0 {
                worst = worst.max(psi.abs() / size);
            }
        }
        let mut factored = Ok(());
        if worst > f64::EPSILON {
            self.find_least(point, scales, order, worst);
            // What lower derivatives have placed stays there, as far as the others can be met without it.
            factored = self.correct(point, scales, order, |j| placed[j]);
            if factored.is_err() && placed.contains(&true) {
                factored = self.correct(point, scales, order, |_| false);
            }
        }
        if order.is_some() {
            let deep = self.mode.sliding.iter().copied();
            for i in deep.filter(|&i| self.mode.surfaces.n_derivatives(i) > 0) {
                let gradient = self.mode.surfaces.gradient(i).iter();
                gradient.for_each(|&(j, _)| placed[j] = true);
            }
        }
        self.stand_for_order(None);
        (worst, factored)
    }

    /// The least mobility of states that have any.
    fn find_least(&mut self, point: &Point, scales: &Scales, order: Option<usize>, worst: f64) {
        let mut least = std::mem::take(&mut self.mode.mend.least);
        least.clear();
        least.resize(point.x.len(), 0.0);
        let left = self.mode.sliding.iter().filter(|_| worst > ASTRAY);
        for &i in left.filter(|&&i| !self.mode.is_mended(i, order)) {
            let terms = self.mode.gradient(i).iter();
            let sizes = terms.map(|&(j, _)| self.mobility(scales, j));
            let share = SMALLEST * sizes.fold(0.0_f64, f64::max);
            for &(j, _) in self.mode.gradient(i) {
                least[j] = share.max(least[j]);
            }
        }
        self.mode.mend.least = least;
    }

    /// Moves x by what the right sides of the equations ask for, but for states that stay.
    fn correct(
        &mut self,
        point: &mut Point,
        scales: &Scales,
        order: Option<usize>,
        stays: impl Fn(usize) -> bool,
    ) -> Result<(), Singular> {
        let mobility = |by: &Self, j: usize| match by.mobility(scales, j) {
            _ if stays(j) => 0.0,
            // What has never moved does not begin to.
            0.0 => 0.0,
            size => size.max(by.mode.mend.least[j]),
        };
        let mut equations = std::mem::take(&mut self.mode.equations);
        let factored = equations.factor_gram(
            &self.mode.surfaces,
            |j| mobility(self, j),
            |i| self.mode.is_mended(i, order),
        );
        if factored.is_ok() {
            equations.solve();
            for (&i, multiplier) in equations.switches.iter().zip(&equations.rhs) {
                for &(j, g) in self.mode.surfaces.gradient(i) {
                    point.x[j] -= g * multiplier * mobility(self, j).powi(2);
                }
            }
        }
        self.mode.equations = equations;
        factored
    }

    /// Lets sliding switches of higher relative degree stand for their derivative of an order, or their highest.
    fn stand_for_order(&mut self, order: Option<usize>) {
        for &i in &self.mode.sliding {
            let highest = self.mode.surfaces.n_derivatives(i);
            if highest > 0 {
                let order = order.map_or(highest, |order| order.min(highest));
                self.mode.surfaces.stand_for(i, order);
            }
        }
    }

    /// Projects x onto one surface after the other.
    fn step_onto_each(&mut self, point: &mut Point, scales: &Scales, order: usize) {
        for at in 0..self.mode.sliding.len() {
            let i = self.mode.sliding[at];
            let highest = self.mode.surfaces.n_derivatives(i);
            if order >= highest || self.mode.is_mended(i, Some(order)) {
                continue;
            }
            self.mode.move_to(point);
            self.mode.surfaces.stand_for(i, order);
            self.mode.surfaces.linearize(i, &self.mode.memory.values);
            let psi = self.mode.psi(i);
            let gradient = self.mode.surfaces.gradient(i).iter();
            let square: f64 = gradient.map(|&(j, g)| (g * scales.size(j)).powi(2)).sum();
            if square > 0.0 {
                for &(j, g) in self.mode.surfaces.gradient(i) {
                    point.x[j] -= g * psi / square * scales.size(j).powi(2);
                }
            }
            self.mode.surfaces.stand_for(i, highest);
        }
    }

    /// How far state j may be moved in a projection, in relation to others.
    fn mobility(&self, scales: &Scales, j: usize) -> f64 {
        match scales.size(j) {
            _ if self.mode.still[j] => 0.0,
            0.0 if self.mode.system.is_algebraic(j) => 1.0,
            size => size,
        }
    }
}
