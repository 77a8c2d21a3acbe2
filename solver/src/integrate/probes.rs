//! The series of a step beside the functions that they stand for, within the step and at its end.

use wide::f64x4;

use super::rounding::Inputs;
use crate::event::state::{State, Trial};
use crate::expansion::dense::Dense;
use crate::expansion::mode::Mode;
use crate::expansion::scales::{Bands, ROUNDINGS, Scales};
use crate::expansion::series;

/// Where in a step the series are compared with the functions: what the expansion at the start
/// does not know of must be seen in between.
const PROBES: [f64; 4] = [0.23, 0.51, 0.77, 1.0];

/// How well the series of a step satisfy their equations.
pub(crate) struct Defect {
    /// Largest ‖x' - f‖ h, relative to the magnitude of the states.
    pub rate: f64,
    /// Whether every ψ and φ_K is what its series says.
    pub switches_agree: bool,
}

/// What the series of a step say at the probes, and what differences from it are relative to.
pub(crate) struct Probes {
    /// t, x, α and numbers, as the inputs of functions.
    values: Vec<f64x4>,
    rates: Vec<f64x4>,
    /// Error scales of the states.
    pub scales: Vec<f64>,
    /// Switches that are monitored and not affine, with the series of ψ at the probes and its magnitude.
    curved: Vec<(usize, f64x4, f64)>,
    /// Which coefficients and parameters the values have.
    version: usize,
}

impl Probes {
    /// Memory for n states.
    pub(crate) fn new(n: usize) -> Self {
        Probes {
            values: Vec::new(),
            rates: vec![f64x4::splat(0.0); n],
            scales: vec![0.0; n],
            curved: Vec::new(),
            version: 0,
        }
    }

    /// Compares x' with f, and the series of ψ and α with the functions, within and at the end of a
    /// step `tau`; the last evaluation is at the end.
    pub(crate) fn defect(
        &mut self,
        mode: &mut Mode,
        state: &State,
        tau: f64,
        tolerance: f64,
        allowed: f64,
    ) -> Defect {
        self.write(mode, state, tau, tolerance);
        mode.field.eval_lanes(&self.values);
        let mut defect = Defect {
            rate: 0.0,
            switches_agree: true,
        };
        let rates = self.rates.iter().zip(&self.scales);
        for (f, (rate, scale)) in mode.field.wide.iter().zip(rates) {
            let differences = (*rate - *f).abs() * f64x4::splat(tau / scale);
            for relative in differences.to_array() {
                // NaN must not be lost, as it is to `max`.
                if !(defect.rate.is_nan() || defect.rate >= relative) {
                    defect.rate = relative;
                }
            }
        }
        self.see_curved(mode, tau);
        if !mode.sliding.is_empty() || !mode.monitored.switches.is_empty() {
            for k in 0..PROBES.len() {
                self.place(mode, k);
                let mut step = Comparison {
                    mode,
                    scales: &state.scales,
                    bands: &state.bands,
                    length: tau,
                    allowed,
                };
                let mut curved = self.curved.iter();
                defect.switches_agree &= step.sliding_agree()
                    && curved.all(|(i, values, size)| {
                        step.psi_agrees(*i, [values.as_array()[k], *size])
                    });
            }
        }
        defect
    }

    /// Evaluates the series of ψ at all probes, where ψ does not follow from those of the states.
    fn see_curved(&mut self, mode: &Mode, tau: f64) {
        let at = f64x4::from(PROBES.map(|probe| probe * tau));
        let switches = mode.monitored.switches.iter();
        let curved = switches.filter(|i| !mode.planes.is_affine(**i, &mode.surfaces));
        let seen = curved.map(|&i| {
            let c = mode.psi_series(i);
            (i, series::values(c, at), series::magnitude(c, tau, 0))
        });
        self.curved.clear();
        self.curved.extend(seen);
    }

    /// Evaluates the series of states and α at all probes.
    fn write(&mut self, mode: &Mode, state: &State, tau: f64, tolerance: f64) {
        let at = f64x4::from(PROBES.map(|probe| probe * tau));
        let memory = &mode.memory;
        if self.version != memory.version {
            self.version = memory.version;
            for place in memory.coefficients().chain(memory.parameters()) {
                if let Some(lanes) = self.values.get_mut(place) {
                    *lanes = f64x4::splat(memory.values[place]);
                }
            }
        }
        for i in self.values.len()..memory.values.len() {
            // Numbers of functions stay what they are.
            self.values.push(f64x4::splat(memory.values[i]));
        }
        self.values[0] = f64x4::splat(state.point.t) + at;
        for i in 0..mode.n {
            let c = mode.x_series(i);
            [self.values[1 + i], self.rates[i]] = series::values_and_slopes(c, at);
            self.scales[i] = state.scales.of_error(i, c, tau, tolerance);
        }
        for &i in &mode.sliding {
            self.values[1 + mode.n + i] = series::values(mode.alpha_series(i), at);
        }
    }

    /// Whether the rate of a state is another than that of its series.
    pub(super) fn differs(&self, mode: &Mode, i: usize, tau: f64, allowed: f64) -> bool {
        let differences = (self.rates[i] - mode.field.wide[i]).abs();
        let relative = differences * f64x4::splat(tau / self.scales[i]);
        !relative.to_array().iter().all(|share| *share <= allowed)
    }

    /// Writes the inputs of functions at a probe, and the rates of the series there.
    pub(super) fn copy(&self, k: usize, inputs: &mut Inputs) {
        let at = |lanes: &f64x4| lanes.as_array()[k];
        inputs.values.clear();
        inputs.values.extend(self.values.iter().map(at));
        inputs.rates.clear();
        inputs.rates.extend(self.rates.iter().map(at));
    }

    /// Moves to a probe that has been evaluated.
    fn place(&self, mode: &mut Mode, k: usize) {
        let moving = 1 + mode.n;
        let values = mode.memory.values[..moving].iter_mut();
        for (value, probed) in values.zip(&self.values) {
            *value = probed.as_array()[k];
        }
        for &i in &mode.sliding {
            mode.memory.values[moving + i] = self.values[moving + i].as_array()[k];
        }
        for (f, wide) in mode.field.f.iter_mut().zip(&mode.field.wide) {
            *f = wide.as_array()[k];
        }
    }
}

/// The functions of a mode beside the series of a step of a length, which they may differ from by `allowed`.
pub(crate) struct Comparison<'a> {
    pub mode: &'a mut Mode,
    pub scales: &'a Scales,
    pub bands: &'a Bands,
    pub length: f64,
    pub allowed: f64,
}

impl Comparison<'_> {
    /// True where `tau` after the start of the step at `t` the functions are what their series say; `sizes` are what
    /// differences of states are relative to.
    pub(crate) fn agrees_at(&mut self, t: f64, tau: f64, trial: &mut Trial, sizes: &[f64]) -> bool {
        let mode = &mut *self.mode;
        Dense::Taylor(mode).states_at(tau, &mut trial.x);
        Dense::Taylor(mode).alphas_at(tau, &mut trial.alpha);
        mode.eval(t + tau, &trial.x, &trial.alpha);
        let rates_agree = (0..mode.n).all(|i| {
            let difference = series::slope(mode.x_series(i), tau) - mode.field.f[i];
            difference.abs() * self.length <= self.allowed * sizes[i]
        });
        rates_agree && self.switches_agree(tau) && self.stays_on()
    }

    /// True when at the point φ_K vanishes and every other ψ that is monitored has the value of its
    /// series, `at` after the start of the step, up to `allowed`. An affine ψ has it anyway.
    fn switches_agree(&mut self, at: f64) -> bool {
        self.sliding_agree()
            && (0..self.mode.monitored.switches.len()).all(|k| {
                let mode = &*self.mode;
                let i = mode.monitored.switches[k];
                let c = mode.psi_series(i);
                mode.planes.is_affine(i, &mode.surfaces) || {
                    let size = series::magnitude(c, self.length, 0);
                    self.psi_agrees(i, [series::value(c, at), size])
                }
            })
    }

    /// True when at the point ψ has a value, up to `allowed` of its magnitude within the step, and rounding of its terms at
    /// the start, or at the point: they may grow from nothing and cancel.
    fn psi_agrees(&mut self, switch: usize, [value, size]: [f64; 2]) -> bool {
        let difference = (value - self.mode.monitored_psi(switch)).abs();
        let least = self.allowed * size + ROUNDINGS * (self.bands.terms[switch] + size);
        difference <= least || {
            let Mode {
                surfaces, memory, ..
            } = &mut *self.mode;
            surfaces.linearize(switch, &memory.values);
            let states = surfaces.weigh(switch, |j| memory.values[1 + j].abs());
            let rounding = surfaces.running_error(switch, &memory.values);
            difference <= least + ROUNDINGS * states + rounding
        }
    }

    /// True when at the point φ_K vanishes.
    fn sliding_agree(&mut self) -> bool {
        let turned = match self.mode.sliding.is_empty() {
            true => 0.0,
            false => ROUNDINGS * self.bands.roundings_of_direction(self.mode),
        };
        for k in 0..self.mode.sliding.len() {
            let i = self.mode.sliding[k];
            if self.mode.planes.onsets.contains(&i) {
                if !self.goes_along(i) {
                    return false;
                }
                continue;
            }
            let mode = &mut *self.mode;
            mode.surfaces.linearize(i, &mode.memory.values);
            let size = self.allowed * mode.equations.gain(i)
                + (ROUNDINGS + turned) * self.scales.terms_of_rate(mode, i);
            if mode.phi(i).abs() > size {
                return false;
            }
        }
        true
    }

    /// Whether a slip velocity that sets off has the direction that its α say, where the point is.
    fn goes_along(&mut self, switch: usize) -> bool {
        let mode = &mut *self.mode;
        let Some(other) = mode.system.second(switch) else {
            return true;
        };
        let [first, second] = [switch, other].map(|i| {
            mode.surfaces.linearize(i, &mode.memory.values);
            let size = mode.surfaces.weigh(i, |j| self.scales.size(j));
            let u = 2.0 * mode.memory.values[1 + mode.n + i] - 1.0;
            (mode.psi(i), u, size)
        });
        let speed = first.0.hypot(second.0);
        let rounding = ROUNDINGS * (first.2 + second.2);
        let off = (first.0 - speed * first.1).hypot(second.0 - speed * second.1);
        off <= self.allowed * speed + rounding
    }

    /// True where every curved ψ that slides is zero at the point.
    fn stays_on(&mut self) -> bool {
        let mode = &mut *self.mode;
        (0..mode.sliding.len()).all(|at| {
            let i = mode.sliding[at];
            if mode.surfaces.is_affine(i)
                || mode.surfaces.is_deep(i)
                || mode.planes.onsets.contains(&i)
            {
                return true;
            }
            let size = mode.surfaces.weigh(i, |j| self.scales.largest[j]);
            let size = size.max(self.bands.terms[i]);
            mode.psi(i).abs() <= self.allowed.max(1e-9) * size
        })
    }
}
