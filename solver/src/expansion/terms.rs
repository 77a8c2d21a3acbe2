//! Sizes of terms that may cancel, as changes of all inputs show them.

use super::mode::Mode;
use super::psi::Form;
use super::surfaces::Surfaces;

/// The golden and the silver ratio: their multiples disturb no two terms alike.
const GOLDEN: f64 = 0.618_033_988_749_895;
const SILVER: f64 = 0.414_213_562_373_095;

/// Relative change of the inputs that shows the size of the terms of a function.
pub(super) const PERTURBATION: f64 = 1e-7;

/// No change turns a direction by more than about this: beyond, its terms would look smaller than they are.
const TURN: f64 = 0.01;

/// The least change that is none of rounding.
const LEAST_PERTURBATION: f64 = 64.0 * f64::EPSILON;

/// Inputs next to those of the expansion point: t, x, α and numbers.
#[derive(Default)]
pub(crate) struct Perturbed {
    /// By what share they differ.
    pub share: f64,
    /// Changed in two ways: terms that happen to cancel once do not do so twice.
    pub first: Vec<f64>,
    pub second: Vec<f64>,
    /// f where these turn what slips in a plane.
    pub turned: Vec<f64>,
}

impl Perturbed {
    /// Changes all inputs by about a share of themselves in two ways.
    pub(super) fn change(&mut self, mode: &Mode) {
        self.change_by(PERTURBATION, mode);
    }

    /// The same by less, where these changes would turn a direction too far; what rounding does to w is so many times as
    /// large in w/|w|.
    pub(super) fn limit_turns(&mut self, turns: f64, mode: &Mode) {
        if turns * PERTURBATION > TURN {
            self.change_by((TURN / turns).max(LEAST_PERTURBATION), mode);
        }
    }

    fn change_by(&mut self, share: f64, mode: &Mode) {
        self.share = share;
        perturb(&mut self.second, SILVER, share, mode);
        perturb(&mut self.first, GOLDEN, share, mode);
    }

    /// Size of the terms of ψ, which may cancel, as both changes show it: one alone may change two terms by the same
    /// amount.
    pub(super) fn terms_of_psi(
        &self,
        surfaces: &mut Surfaces,
        switch: usize,
        values: &[f64],
    ) -> f64 {
        if let Form::Affine(affine) = &surfaces.now(switch).form {
            let terms = affine.terms.iter();
            let sizes = terms.map(|&(state, c)| (c * values[1 + state]).abs());
            return sizes.sum::<f64>() + (affine.time * values[0]).abs();
        }
        let psi = surfaces.value(switch, values);
        let change = |inputs: &Vec<f64>| (surfaces.value(switch, inputs) - psi).abs();
        let [first, second] = [&self.first, &self.second].map(change);
        let size = first.max(second) / self.share;
        if size.is_finite() { size } else { 0.0 }
    }

    /// Evaluates f where what each w is made of differs by a share of itself, in the way that turns w/|w| most.
    pub(super) fn turn(&mut self, mode: &mut Mode) {
        self.first.clone_from(&self.second);
        for i in 0..mode.sides.len() {
            let Some(other) = mode.planes.slips_with(i, &mode.system, &mode.sides) else {
                continue;
            };
            let [d, e] = super::planes::direction([i, other].map(|k| mode.psi(k)));
            for (k, across) in [(i, -e), (other, d)] {
                mode.surfaces.linearize(k, &mode.memory.values);
                let time = std::iter::once((0, mode.surfaces.time_gradient(k)));
                let states = mode.surfaces.gradient(k).iter();
                for (at, g) in time.chain(states.map(|&(j, g)| (1 + j, g))) {
                    let input = mode.memory.values[at];
                    self.first[at] = input + self.share * input.abs() * (across * g).signum();
                }
            }
        }
        mode.field.eval(&self.first);
        self.turned.clone_from(&mode.field.f);
        perturb(&mut self.first, GOLDEN, self.share, mode);
    }
}

/// Changes no two inputs alike: by multiples of an irrational number.
fn perturb(inputs: &mut Vec<f64>, number: f64, by: f64, mode: &Mode) {
    inputs.clone_from(&mode.memory.values);
    let mut share = 0.0_f64;
    let mut perturb = |input: &mut f64| {
        share = (share + number).fract();
        *input *= 1.0 + by * (2.0 * share - 1.0).signum() * (0.5 + share);
    };
    let n = mode.n;
    inputs[..=n].iter_mut().for_each(&mut perturb);
    for &i in &mode.sliding {
        let alpha = &mut inputs[1 + n + i];
        match mode.system.is_unilateral(i) && alpha.abs() < 0.5 {
            // A force is 1 - α, and no smaller where α is.
            true => {
                let mut force = 1.0 - *alpha;
                perturb(&mut force);
                *alpha = 1.0 - force;
            }
            false => perturb(alpha),
        }
    }
}
