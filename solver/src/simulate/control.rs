//! Length of a step, and what its series are worth at the end and on the way.

use super::Side;
use super::mode::Mode;
use super::series;
use super::state::State;

/// A step from a horizon of any length shrinks by about e² at a time.
const MAX_SHRINKS: usize = 200;

/// Relative change of the inputs that shows the size of the terms of a function.
const PERTURBATION: f64 = 1e-7;

/// Magnitudes below this are zero: products of such numbers lose their digits to underflow.
const SMALLEST: f64 = 1e-250;

/// Where in a step the series are compared with the functions: what the expansion at the start
/// does not know of must be seen in between.
const PROBES: [f64; 4] = [0.23, 0.51, 0.77, 1.0];

/// One number for every probe.
type AtProbes = [f64; PROBES.len()];

/// What the series of a step say at the probes, and what differences from it are relative to.
#[derive(Default)]
pub(super) struct Probed {
    x: Vec<AtProbes>,
    rates: Vec<AtProbes>,
    /// Error scales of the states.
    scales: Vec<f64>,
    /// ψ of all switches; of sliding ones nothing is kept.
    psi: Vec<AtProbes>,
    /// Magnitudes of ψ within the step.
    sizes: Vec<f64>,
}

impl Probed {
    pub(super) fn new(n_states: usize, n_switches: usize) -> Self {
        Probed {
            x: vec![Default::default(); n_states],
            rates: vec![Default::default(); n_states],
            scales: vec![0.0; n_states],
            psi: vec![Default::default(); n_switches],
            sizes: vec![0.0; n_switches],
        }
    }
}

/// How well the series of a step satisfy their equations.
pub(super) struct Defect {
    /// Largest ‖x' - f‖ h, relative to the magnitude of the states.
    pub rate: f64,
    /// Whether every ψ and φ_K is what its series says.
    pub switches_agree: bool,
}

impl Mode {
    /// Measures Σ |∂g/∂(t, x, α)|·|(t, x, α)| of every function g, as one perturbation of all
    /// inputs by different amounts shows it: the size of its terms, which may cancel, and with it
    /// its rounding error.
    pub(crate) fn measure_terms(&mut self, state: &mut State, alpha: &[f64]) {
        self.eval(state.t, &state.x, alpha);
        self.terms.copy_from_slice(&self.field);
        let mut share = 0.0_f64;
        for input in &mut self.inputs {
            // Multiples of the golden ratio, so that no two terms are disturbed alike.
            share = (share + 0.618_033_988_749_895).fract();
            *input *= 1.0 + PERTURBATION * (2.0 * share - 1.0).signum() * (0.5 + share);
        }
        self.eval_inputs();
        for (term, perturbed) in self.terms.iter_mut().zip(&self.field) {
            let size = (perturbed - *term).abs() / PERTURBATION;
            *term = if size.is_finite() { size } else { 0.0 };
        }
        for (activity, &now) in state.activity.iter_mut().zip(&self.terms) {
            *activity = activity.max(now);
        }
        let psi = self.n + self.sliding.len();
        state.terms.copy_from_slice(&self.terms[psi..]);
    }

    /// The magnitude an error of state i within a step h is relative to: the largest of the run or
    /// within the step, and no less than what keeps `tolerance` above the rounding errors of f. What
    /// is truncated there has the same sign in every step and in a finer run too, which would not
    /// see it: it must not be larger than rounding itself.
    fn error_scale(&self, i: usize, h: f64, tolerance: f64, state: &State) -> f64 {
        let rounding = f64::EPSILON * state.activity[i] * h;
        let magnitude = series::magnitude(self.x_series(i), h, 0);
        let scale = state.scale[i].max(magnitude).max(rounding / tolerance);
        scale.max(SMALLEST)
    }

    /// The largest step up to `longest` whose first neglected terms stay below `tolerance` times
    /// the magnitude of every state, ψ and α.
    ///
    /// |c_k| = magnitude / ρᵏ gives the radius ρ, taken as the least over the last three terms (two
    /// in Jorba & Zou 2005, section 3.2); then (h/ρ)^(p+1) = tolerance.
    pub(crate) fn step_size(&self, tolerance: f64, state: &State, longest: f64) -> f64 {
        let last = self.order - 2..=self.order;
        let mut h = longest;
        for _ in 0..MAX_SHRINKS {
            let mut worst = [0.0_f64; 3];
            let mut see = |c: &[f64], scale: f64| {
                for (worst, k) in worst.iter_mut().zip(last.clone()) {
                    if c[k] != 0.0 {
                        *worst = worst.max(c[k].abs() / scale);
                    }
                }
            };
            for i in 0..self.n {
                see(self.x_series(i), self.error_scale(i, h, tolerance, state));
            }
            let mut sliding = 0;
            for (i, side) in self.sides.iter().enumerate() {
                if *side == Side::Slide {
                    let rounding = 8.0 * f64::EPSILON * self.terms[self.n + sliding]
                        / self.gains[sliding].max(SMALLEST);
                    let c = self.alpha_series(sliding);
                    let scale = series::magnitude(c, h, 0).max(1.0);
                    see(c, scale.max(rounding / tolerance));
                    sliding += 1;
                } else {
                    let rounding = 8.0 * f64::EPSILON * state.terms[i];
                    let c = self.psi_series(i);
                    let scale = series::magnitude(c, h, 0).max(rounding / tolerance);
                    see(c, scale.max(SMALLEST));
                }
            }
            let radius = |(worst, k): (&f64, usize)| -worst.ln() / k as f64;
            let least = worst
                .iter()
                .zip(last.clone())
                .map(radius)
                .fold(f64::INFINITY, f64::min);
            let next = h.min((least + tolerance.ln() / (self.order + 1) as f64).exp());
            let settled = next >= 0.9 * h;
            h = next;
            if settled {
                break;
            }
        }
        h
    }

    /// Compares x' with f, and the series of ψ and α with the functions, within and at the end of a
    /// step `tau`; the last evaluation is at the end.
    pub(super) fn defect(
        &mut self,
        state: &mut State,
        tau: f64,
        tolerance: f64,
        allowed: f64,
    ) -> Defect {
        self.probe(state, tau, tolerance);
        let mut defect = Defect {
            rate: 0.0,
            switches_agree: true,
        };
        for (k, probe) in PROBES.iter().enumerate() {
            let at = probe * tau;
            for (next, x) in state.next.iter_mut().zip(&self.probed.x) {
                *next = x[k];
            }
            self.alpha(at, &mut state.next_alpha);
            self.eval(state.t + at, &state.next, &state.next_alpha);
            let rates = self.probed.rates.iter().zip(&self.probed.scales);
            for (f, (rate, scale)) in self.f().iter().zip(rates) {
                let difference = (rate[k] - f).abs() * tau;
                if difference != 0.0 {
                    let relative = difference / scale;
                    // NaN must not be lost to `max`.
                    defect.rate = if defect.rate >= relative {
                        defect.rate
                    } else {
                        relative
                    };
                }
            }
            defect.switches_agree &= self.switches_agree(state, k, allowed);
        }
        defect
    }

    /// Evaluates the series at all probes.
    fn probe(&mut self, state: &State, tau: f64, tolerance: f64) {
        let at = PROBES.map(|probe| probe * tau);
        let mut probed = std::mem::take(&mut self.probed);
        for i in 0..self.n {
            [probed.x[i], probed.rates[i]] = series::values_and_slopes(self.x_series(i), at);
            probed.scales[i] = self.error_scale(i, tau, tolerance, state);
        }
        for (i, side) in self.sides.iter().enumerate() {
            if *side != Side::Slide {
                let c = self.psi_series(i);
                probed.psi[i] = at.map(|at| series::value(c, at));
                probed.sizes[i] = series::magnitude(c, tau, 0);
            }
        }
        self.probed = probed;
    }

    /// True when at a probe φ_K vanishes and every other ψ has the value of its series, up to
    /// `allowed`.
    fn switches_agree(&self, state: &State, probe: usize, allowed: f64) -> bool {
        let rounding = 64.0 * f64::EPSILON;
        let slides = self.phi().iter().enumerate().all(|(j, phi)| {
            phi.abs() <= allowed * self.gains[j] + rounding * self.terms[self.n + j]
        });
        let (psi, sides) = (self.psi(), self.sides.iter());
        let mut others = sides.enumerate().filter(|(_, side)| **side != Side::Slide);
        slides
            && others.all(|(i, _)| {
                let size = self.probed.sizes[i];
                let difference = (self.probed.psi[i][probe] - psi[i]).abs();
                difference <= allowed * size + rounding * (state.terms[i] + size)
            })
    }
}
