//! Length of a step, and what its series are worth at the end and on the way.

use wide::f64x4;

use super::mode::Mode;
use super::series;
use super::terms::GOLDEN;
use crate::expansion::scales::{Bands, Scales};
use crate::hybrid::Side;
use crate::hybrid::point::Point;

/// Lengths tried before a step is as long as its series allow, and how close to that it ends.
const MAX_GROWTHS: usize = 200;
const CLOSE: f64 = 1.05;

/// Relative change of the inputs that shows the size of the terms of a function.
const PERTURBATION: f64 = 1e-7;

/// No change turns a direction by more than about this: beyond, its terms would look smaller than they are.
const TURN: f64 = 0.01;

/// The least change that is none of rounding.
const LEAST_PERTURBATION: f64 = 64.0 * f64::EPSILON;

/// Roundings of what would move a state in a step, below which it does not move.
const HELD: f64 = 8.0;

/// Magnitudes below this are zero: products of such numbers lose their digits to underflow.
pub(crate) const SMALLEST: f64 = 1e-250;

/// Where in a step the series are compared with the functions: what the expansion at the start
/// does not know of must be seen in between.
const PROBES: [f64; 4] = [0.23, 0.51, 0.77, 1.0];

/// The largest of the last three terms of some series, relative to the scale of each.
struct LastTerms {
    order: usize,
    worst: [f64; 3],
}

impl LastTerms {
    fn see(&mut self, c: &[f64], scale: f64) {
        for (worst, c) in self.worst.iter_mut().zip(&c[self.order - 2..]) {
            if *c != 0.0 {
                // Even where it overflows, it allows some step.
                *worst = worst.max((c.abs() / scale).min(f64::MAX));
            }
        }
    }

    /// Logarithm of the least radius of convergence that they show.
    fn radius(&self) -> f64 {
        let orders = self.order - 2..=self.order;
        let radii = self.worst.iter().zip(orders);
        let radii = radii.map(|(worst, k)| -worst.ln() / k as f64);
        radii.fold(f64::INFINITY, f64::min)
    }
}

/// How well the series of a step satisfy their equations.
pub(crate) struct Defect {
    /// Largest ‖x' - f‖ h, relative to the magnitude of the states.
    pub rate: f64,
    /// Whether every ψ and φ_K is what its series says.
    pub switches_agree: bool,
}

impl Mode {
    /// Measures Σ |∂f/∂(t, x, α)|·|(t, x, α)| of every rate, as one perturbation of all inputs by
    /// different amounts shows it: the size of its terms, which may cancel, and with it its rounding
    /// error.
    pub(crate) fn measure_terms(&mut self, scales: &mut Scales, bands: &mut Bands) {
        self.terms.of_rates.copy_from_slice(&self.field.f);
        self.terms
            .perturb_twice(PERTURBATION, &self.memory, &self.sliding, &self.system);
        if self.planes.any() {
            let turns = self.measure_directions(bands);
            if turns * PERTURBATION > TURN {
                self.terms.perturb_twice(
                    (TURN / turns).max(LEAST_PERTURBATION),
                    &self.memory,
                    &self.sliding,
                    &self.system,
                );
            }
            self.terms.perturbed.clone_from(&self.terms.perturbed_again);
            self.perturb_directions();
            self.field.eval(&self.terms.perturbed);
            self.terms.turned.copy_from_slice(&self.field.f);
            self.terms
                .perturb(GOLDEN, &self.memory, &self.sliding, &self.system);
        } else {
            self.terms.turned.copy_from_slice(&self.terms.of_rates);
        }
        self.field.eval(&self.terms.perturbed);
        let changed = self.field.f.iter().zip(&self.terms.turned);
        for (term, (perturbed, turned)) in self.terms.of_rates.iter_mut().zip(changed) {
            let change = (perturbed - *term).abs().max((turned - *term).abs());
            let size = change / self.terms.share;
            *term = if size.is_finite() { size } else { 0.0 };
        }
        self.forget_directions(scales);
        for (activity, &now) in scales.activity.iter_mut().zip(&self.terms.of_rates) {
            *activity = activity.max(now);
        }
    }

    /// Size of the terms of ψ of a switch where the point is.
    pub(crate) fn measure_terms_of_psi(&mut self, switch: usize, bands: &mut Bands) {
        let perturbed = [&self.terms.perturbed[..], &self.terms.perturbed_again];
        let (values, share) = (&self.memory.values, self.terms.share);
        let terms = self.surfaces.terms(switch, values, perturbed, share);
        // No change of its inputs shows what cancels within a ψ that is zero.
        bands.terms[switch] = match bands.armed[switch] && self.system.switches[switch].is_plain() {
            true => terms.max(self.surfaces.running_error(switch, values) / f64::EPSILON),
            false => terms,
        };
    }

    /// Whether something off its surface has just left it, or waits there.
    fn waits_at_surface(&self, bands: &Bands) -> bool {
        let is_off = |i: usize| self.sides[i] != Side::Slide;
        (0..self.sides.len())
            .any(|i| bands.armed[i] && is_off(i) && self.system.switches[i].is_plain())
    }

    /// Measures the same of what contacts hold at zero in the run up to here, or in a first step of length h: its
    /// present value says nothing of how well it is known. So does a surface, of a ψ next to zero.
    pub(crate) fn measure_held(
        &mut self,
        point: &Point,
        scales: &mut Scales,
        bands: &Bands,
        h: f64,
    ) {
        scales.held.clear();
        scales.held.resize(self.n, 0.0);
        let has_contacts = self
            .sliding
            .iter()
            .any(|&i| self.system.switches[i].is_contact());
        if !has_contacts && (self.sliding.is_empty() || !self.waits_at_surface(bands)) {
            return;
        }
        let step = match scales.last_step {
            last if last > 0.0 => last,
            _ => h,
        };
        let motion = |scales: &Scales, i: usize| scales.activity[i] * step;
        let is_held =
            |scales: &Scales, i: usize| point.x[i].abs() < HELD * f64::EPSILON * motion(scales, i);
        if !(0..self.n).any(|i| is_held(scales, i)) {
            return;
        }
        self.field.eval(&self.memory.values);
        scales.held.copy_from_slice(&self.field.f);
        for i in (0..self.n).filter(|&i| is_held(scales, i)) {
            self.memory.values[1 + i] += PERTURBATION * motion(scales, i);
        }
        self.field.eval(&self.memory.values);
        self.memory.values[1..=self.n].copy_from_slice(&point.x);
        for (held, f) in scales.held.iter_mut().zip(&self.field.f) {
            let size = (f - *held).abs() / PERTURBATION;
            *held = if size.is_finite() { size } else { 0.0 };
        }
    }

    /// Size of the terms of φ of a sliding switch at the expansion point.
    fn terms_of_rate(&self, switch: usize) -> f64 {
        self.surfaces.weigh(switch, |state| {
            self.terms.of_rates[state].max(self.memory.rows[self.field.rows[state]].abs())
        })
    }

    /// The magnitude an error of state i within a step h is relative to: the largest of the run or
    /// within the step, and no less than what keeps `tolerance` above the rounding errors of f. What
    /// is truncated there has the same sign in every step and in a finer run too, which would not
    /// see it: it must not be larger than rounding itself. What follows from states that are held at zero is no better
    /// known than these.
    fn error_scale(&self, i: usize, h: f64, tolerance: f64, scales: &Scales) -> f64 {
        let rounding = f64::EPSILON * scales.activity[i].max(scales.held[i]) * h;
        let magnitude = series::magnitude(self.x_series(i), h, 0);
        let scale = scales.largest[i].max(magnitude).max(rounding / tolerance);
        scale.max(SMALLEST)
    }

    /// The largest step up to `longest` whose first neglected terms stay below `tolerance` times
    /// the magnitude of every state and α.
    ///
    /// |c_k| = magnitude / ρᵏ gives the radius ρ, taken as the least over the last three terms (two
    /// in Jorba & Zou 2005, section 3.2); then (h/ρ)^(p+1) = tolerance.
    pub(crate) fn step_size(&self, tolerance: f64, scales: &Scales, longest: f64) -> f64 {
        self.grow(tolerance, longest, |h, last| {
            for i in 0..self.n {
                last.see(self.x_series(i), self.error_scale(i, h, tolerance, scales));
            }
            for &i in &self.sliding {
                let rounding = 8.0 * f64::EPSILON * self.terms_of_rate(i)
                    / self.equations.gain(i).max(SMALLEST);
                let c = self.alpha_series(i);
                let scale = series::magnitude(c, h, 0).max(1.0);
                last.see(c, scale.max(rounding / tolerance));
            }
        })
    }

    /// Looks for the switches off their surface that may reach it within a step h, and expands their
    /// ψ. Those that are no affine functions may shorten the step, which is returned.
    ///
    /// No state moves by more than R_j = Σ_k |x_{j,k}| hᵏ from k = 1. An enclosure of ψ over this box,
    /// Σ |c_j| R_j around its value where it is affine, that does not hold zero proves that ψ has no
    /// root.
    pub(crate) fn monitor(
        &mut self,
        tolerance: f64,
        scales: &Scales,
        bands: &mut Bands,
        h: f64,
    ) -> f64 {
        self.monitored.switches.clear();
        if self.sides.len() == self.sliding.len() {
            return h;
        }
        for i in 0..self.n {
            self.monitored.reach[i] = series::reach(self.x_series(i), h);
        }
        let mut curved = false;
        for i in 0..self.sides.len() {
            if self.sides[i] == Side::Slide
                || self.system.is_idle(i, &self.sides)
                || self.keeps_off(i, h)
            {
                continue;
            }
            self.expand_psi(i, bands);
            if self.monitored.is_unobserved(i, self.psi_series(i)) {
                self.monitored.unobserved.push(i);
                continue;
            }
            if !self.system.switches[i].sides_agree() || bands.armed[i] {
                self.surfaces.linearize(i, &self.memory.values);
            }
            self.monitored.switches.push(i);
            curved |= !self.is_monitored_affine(i);
        }
        let shorter = match curved {
            true => self.step_size_of_psi(tolerance, bands, h),
            false => h,
        };
        if self.monitored.is_too_short(scales, shorter) {
            self.monitored.stop_monitoring();
            return self.step_size_of_psi(tolerance, bands, h);
        }
        shorter
    }

    /// Computes the series of ψ of a switch along the expansion, and the size of its terms.
    pub(crate) fn expand_psi(&mut self, switch: usize, bands: &mut Bands) {
        for i in std::iter::once(switch).chain(self.system.second(switch)) {
            self.surfaces.expand(i, &mut self.memory, self.order + 1);
            self.measure_terms_of_psi(i, bands);
        }
        self.expand_along(switch);
    }

    /// The largest step up to `longest` whose first neglected terms stay below `tolerance` times
    /// the magnitude of every ψ that is monitored.
    pub(crate) fn step_size_of_psi(&self, tolerance: f64, bands: &Bands, longest: f64) -> f64 {
        self.grow(tolerance, longest, |h, last| {
            for &i in &self.monitored.switches {
                if !self.is_monitored_affine(i) {
                    let rounding = 8.0 * f64::EPSILON * bands.terms[i];
                    let c = self.psi_series(i);
                    let scale = series::magnitude(c, h, 0).max(rounding / tolerance);
                    last.see(c, scale.max(SMALLEST));
                }
            }
        })
    }

    /// The largest step up to `longest` whose first neglected terms stay below a `share` of |w| of a slip velocity with
    /// two entries, once both have been expanded.
    pub(crate) fn step_size_of_slip(&self, of: [usize; 2], share: f64, longest: f64) -> f64 {
        let series = of.map(|i| {
            let start = self.surfaces.row(i);
            &self.memory.rows[start..=start + self.order]
        });
        let speed = series[0][0].hypot(series[1][0]).max(SMALLEST);
        self.grow(share, longest, |_, last| {
            series.into_iter().for_each(|c| last.see(c, speed));
        })
    }

    /// Lengthens a step from nothing as far as the last terms that `see` shows for it allow: a longer
    /// step has larger magnitudes, which their size is relative to. Every length on the way is allowed.
    fn grow(&self, tolerance: f64, longest: f64, see: impl Fn(f64, &mut LastTerms)) -> f64 {
        let margin = tolerance.ln() / (self.order + 1) as f64;
        let mut h = 0.0;
        for _ in 0..MAX_GROWTHS {
            let mut last = LastTerms {
                order: self.order,
                worst: [0.0; 3],
            };
            see(h, &mut last);
            let next = longest.min((last.radius() + margin).exp());
            let settled = next <= CLOSE * h;
            h = next;
            if settled || h == longest {
                break;
            }
        }
        h
    }

    /// A step in relation to the time scale of the solution, which the curvature of the states, α and
    /// monitored ψ shows: for c₂ h² = size it is 1.
    pub(crate) fn motion(&self, scales: &Scales, bands: &Bands, h: f64) -> f64 {
        let curved = |c: &[f64], size: f64| {
            let bend = c[2].abs() * h * h;
            let size = size.max(c[0].abs()).max(c[1].abs() * h);
            if bend > 0.0 { bend / size } else { 0.0 }
        };
        let states = (0..self.n).map(|i| curved(self.x_series(i), scales.largest[i]));
        let alphas = self
            .sliding
            .iter()
            .map(|&i| curved(self.alpha_series(i), 1.0));
        // A ψ that starts at its surface is no larger than its states make it.
        let size = |i: usize| {
            self.surfaces
                .weigh(i, |j| scales.largest[j])
                .max(bands.terms[i])
        };
        let monitored = self.monitored.switches.iter();
        let psis = monitored.map(|&i| curved(self.psi_series(i), size(i)));
        states.chain(alphas).chain(psis).fold(0.0, f64::max).sqrt()
    }

    /// Compares x' with f, and the series of ψ and α with the functions, within and at the end of a
    /// step `tau`; the last evaluation is at the end.
    pub(crate) fn defect(
        &mut self,
        point: &Point,
        scales: &Scales,
        bands: &Bands,
        tau: f64,
        tolerance: f64,
        allowed: f64,
    ) -> Defect {
        self.probe(point, scales, tau, tolerance);
        self.field.eval_lanes(&self.probed.values);
        let mut defect = Defect {
            rate: 0.0,
            switches_agree: true,
        };
        let rates = self.probed.rates.iter().zip(&self.probed.scales);
        for (f, (rate, scale)) in self.field.wide.iter().zip(rates) {
            let differences = (*rate - *f).abs() * f64x4::splat(tau / scale);
            for relative in differences.to_array() {
                // NaN must not be lost, as it is to `max`.
                if !(defect.rate.is_nan() || defect.rate >= relative) {
                    defect.rate = relative;
                }
            }
        }
        if !self.sliding.is_empty() || !self.monitored.switches.is_empty() {
            for (k, probe) in PROBES.iter().enumerate() {
                self.take_probe(k);
                let at = probe * tau;
                defect.switches_agree &= self.switches_agree(scales, bands, at, tau, allowed);
            }
        }
        defect
    }

    /// Evaluates the series of states and α at all probes.
    fn probe(&mut self, point: &Point, scales: &Scales, tau: f64, tolerance: f64) {
        let at = f64x4::from(PROBES.map(|probe| probe * tau));
        let mut probed = std::mem::take(&mut self.probed);
        for i in probed.values.len()..self.memory.values.len() {
            // Numbers of functions stay what they are.
            probed.values.push(f64x4::splat(self.memory.values[i]));
        }
        probed.values[0] = f64x4::splat(point.t) + at;
        for i in 0..self.n {
            let series = series::values_and_slopes(self.x_series(i), at);
            [probed.values[1 + i], probed.rates[i]] = series;
            probed.scales[i] = self.error_scale(i, tau, tolerance, scales);
        }
        for &i in &self.sliding {
            probed.values[1 + self.n + i] = series::values(self.alpha_series(i), at);
        }
        self.probed = probed;
    }

    /// Takes what differences of states from their series are relative to.
    pub(crate) fn take_scales(&mut self, scales: &[f64]) {
        self.probed.scales.copy_from_slice(scales);
    }

    /// What differences of a state from its series are relative to, in the step probed last.
    pub(crate) fn probed_scale(&self, i: usize) -> f64 {
        self.probed.scales[i]
    }

    /// Whether the rate of a state is another than that of its series, in the step probed last.
    pub(crate) fn differs(&self, i: usize, tau: f64, allowed: f64) -> bool {
        let differences = (self.probed.rates[i] - self.field.wide[i]).abs();
        let relative = differences * f64x4::splat(tau / self.probed.scales[i]);
        !relative.to_array().iter().all(|share| *share <= allowed)
    }

    /// Writes the inputs of functions at a probe, and the rates of the series there.
    pub(crate) fn probed_point(&self, k: usize, values: &mut Vec<f64>, rates: &mut Vec<f64>) {
        let at = |lanes: &f64x4| lanes.as_array()[k];
        values.clear();
        values.extend(self.probed.values.iter().map(at));
        rates.clear();
        rates.extend(self.probed.rates.iter().map(at));
    }

    /// Moves to a probe that has been evaluated.
    fn take_probe(&mut self, k: usize) {
        let moving = 1 + self.n;
        let values = self.memory.values[..moving].iter_mut();
        for (value, probed) in values.zip(&self.probed.values) {
            *value = probed.as_array()[k];
        }
        for &i in &self.sliding {
            self.memory.values[moving + i] = self.probed.values[moving + i].as_array()[k];
        }
        for (f, wide) in self.field.f.iter_mut().zip(&self.field.wide) {
            *f = wide.as_array()[k];
        }
    }

    /// True when at the point φ_K vanishes and every other ψ that is monitored has the value of its
    /// series, `at` after the start of a step `tau`, up to `allowed`. An affine ψ has it anyway.
    pub(crate) fn switches_agree(
        &mut self,
        scales: &Scales,
        bands: &Bands,
        at: f64,
        tau: f64,
        allowed: f64,
    ) -> bool {
        let rounding = 64.0 * f64::EPSILON;
        let turned = match self.sliding.is_empty() {
            true => 0.0,
            false => rounding * self.roundings_of_direction(bands),
        };
        for k in 0..self.sliding.len() {
            let i = self.sliding[k];
            if self.planes.onsets.contains(&i) {
                if !self.goes_along(i, scales, allowed) {
                    return false;
                }
                continue;
            }
            self.surfaces.linearize(i, &self.memory.values);
            let size =
                allowed * self.equations.gain(i) + (rounding + turned) * self.terms_of_rate(i);
            if self.phi(i).abs() > size {
                return false;
            }
        }
        for k in 0..self.monitored.switches.len() {
            let i = self.monitored.switches[k];
            if self.is_monitored_affine(i) {
                continue;
            }
            let psi = self.monitored_psi(i);
            let c = self.psi_series(i);
            let size = series::magnitude(c, tau, 0);
            let difference = (series::value(c, at) - psi).abs();
            let agrees = difference <= allowed * size + rounding * (bands.terms[i] + size);
            if !agrees {
                return false;
            }
        }
        true
    }
}
