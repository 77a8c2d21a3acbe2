//! Switches off their surface within a step.
//!
//! Those that nothing but outputs looks at may have a ψ without a series: |v| has no derivative where a body comes to
//! rest. In a rate this ends a run; in an output it must not, whose values alone are wanted. Within a step such a switch
//! is not monitored: its α is not known, and follows from ψ itself wherever an output is evaluated. At the end of the step
//! it takes the side of ψ.

use super::mode::Mode;
use super::scales::{Bands, Scales};
use super::series;
use super::step_size::StepSize;
use crate::hybrid::point::Point;
use crate::hybrid::{Effect, Guard, HybridSystem, Input, Role, Side};

/// Steps as short as this share of the longest one are not taken for an output.
const LEAST: f64 = 1e-6;

/// The switches that no rate and no law contains, nor any ψ but those of others of this kind.
fn observers(system: &HybridSystem) -> Vec<bool> {
    let n = system.n_switches();
    let is_own = |i: usize| system.role(i) == Role::Step && system.relay(i).is_none();
    let is_free = |i: usize| !system.is_unilateral(i) && system.slip_of(i).is_none();
    let mut used: Vec<bool> = (0..n).map(|i| !(is_own(i) && is_free(i))).collect();
    let of_blocks = system.blocks.iter().flat_map(|block| &block.switches);
    of_blocks.for_each(|&i| used[i] = true);
    for law in &system.laws {
        match &law.guard {
            Guard::Sides { switches, .. } => switches.iter().for_each(|&i| used[i] = true),
            Guard::Strikes(switch) => used[*switch] = true,
            Guard::Every(_) => {}
        }
        let inputs = match &law.effect {
            Effect::Reset(reset) => &reset.inputs,
            Effect::Impact(impact) => &impact.inputs,
            Effect::Stop => continue,
        };
        for input in inputs {
            if let Input::Alpha(switch) = input {
                used[*switch] = true;
            }
        }
    }
    let mut left: Vec<usize> = (0..n).filter(|&i| used[i]).collect();
    while let Some(i) = left.pop() {
        for &inner in &system.switches[i].inside {
            if !used[inner] {
                used[inner] = true;
                left.push(inner);
            }
        }
    }
    used.into_iter().map(|used| !used).collect()
}

/// Switches off their surface within a step.
pub(crate) struct Monitored {
    /// Those whose ψ might vanish.
    pub switches: Vec<usize>,
    /// How far each state may move.
    pub reach: Vec<f64>,
    /// Of each switch, whether nothing but outputs looks at it.
    pub observers: Vec<bool>,
    /// Switches that nothing but outputs looks at, without a series in this step.
    pub unobserved: Vec<usize>,
}

impl Monitored {
    /// None so far.
    pub(crate) fn new(system: &HybridSystem) -> Self {
        Monitored {
            switches: Vec::new(),
            reach: vec![0.0; system.n_states()],
            observers: observers(system),
            unobserved: Vec::new(),
        }
    }

    /// True for a switch that only outputs look at, whose series of ψ does not exist.
    pub(crate) fn is_unobserved(&self, switch: usize, series: &[f64]) -> bool {
        self.observers[switch] && !series.iter().all(|c| c.is_finite())
    }

    /// Stops monitoring what only outputs look at, within this step.
    pub(crate) fn stop_monitoring(&mut self) {
        let observers = &self.observers;
        let (unobserved, monitored) = self.switches.iter().partition(|i| observers[**i]);
        self.switches = monitored;
        let mut unobserved: Vec<usize> = unobserved;
        self.unobserved.append(&mut unobserved);
    }

    /// Whether a step of this length is too short for what only outputs look at.
    pub(crate) fn is_too_short(&self, scales: &Scales, h: f64) -> bool {
        h < LEAST * scales.longest_step && self.switches.iter().any(|&i| self.observers[i])
    }
}

/// Watches switches off their surface in a mode.
pub(crate) struct Monitor<'a> {
    pub mode: &'a mut Mode,
    pub bands: &'a mut Bands,
}

impl Monitor<'_> {
    /// Looks for the switches off their surface that may reach it within a step h, and expands their
    /// ψ. Those that are no affine functions may shorten the step, which is returned.
    ///
    /// No state moves by more than R_j = Σ_k |x_{j,k}| hᵏ from k = 1. An enclosure of ψ over this box,
    /// Σ |c_j| R_j around its value where it is affine, that does not hold zero proves that ψ has no
    /// root.
    pub(crate) fn watch(&mut self, tolerance: f64, scales: &Scales, h: f64) -> f64 {
        let mode = &mut *self.mode;
        mode.monitored.switches.clear();
        if mode.sides.len() == mode.sliding.len() {
            return h;
        }
        for i in 0..mode.n {
            mode.monitored.reach[i] = series::reach(mode.x_series(i), h);
        }
        let mut curved = false;
        for i in 0..self.mode.sides.len() {
            let mode = &*self.mode;
            if mode.sides[i] == Side::Slide
                || mode.system.is_idle(i, &mode.sides)
                || self.keeps_off(i, h)
            {
                continue;
            }
            self.expand(i);
            let mode = &mut *self.mode;
            if mode.monitored.is_unobserved(i, mode.psi_series(i)) {
                mode.monitored.unobserved.push(i);
                continue;
            }
            if !mode.system.sides_agree(i) || self.bands.armed[i] {
                mode.surfaces.linearize(i, &mode.memory.values);
            }
            mode.monitored.switches.push(i);
            curved |= !mode.planes.is_affine(i, &mode.surfaces);
        }
        let step_size = StepSize {
            mode: self.mode,
            tolerance,
        };
        let shorter = match curved {
            true => step_size.of_psi(self.bands, h),
            false => h,
        };
        if self.mode.monitored.is_too_short(scales, shorter) {
            self.mode.monitored.stop_monitoring();
            let step_size = StepSize {
                mode: self.mode,
                tolerance,
            };
            return step_size.of_psi(self.bands, h);
        }
        shorter
    }

    /// Computes the series of ψ of a switch along the expansion, and the size of its terms.
    pub(crate) fn expand(&mut self, switch: usize) {
        let mode = &mut *self.mode;
        for i in std::iter::once(switch).chain(mode.system.second(switch)) {
            let n = mode.memory.order + 1;
            mode.surfaces.expand(i, &mut mode.memory, n);
            self.bands.measure(mode, i);
        }
        mode.planes.expand(switch, &mode.surfaces, &mode.memory);
    }

    /// Whether ψ, or one of two, cannot vanish within a step.
    pub(crate) fn keeps_off(&mut self, switch: usize, h: f64) -> bool {
        let mode = &mut *self.mode;
        let all = [Some(switch), mode.system.second(switch)];
        all.into_iter().flatten().any(|i| {
            let (values, reach) = (&mode.memory.values, &mode.monitored.reach);
            mode.surfaces.excludes_root(i, values, reach, h)
        })
    }

    /// Takes the sides of switches that were not monitored in the last step.
    pub(crate) fn take_unobserved(&mut self, point: &mut Point) {
        for at in 0..self.mode.monitored.unobserved.len() {
            let switch = self.mode.monitored.unobserved[at];
            self.mode.move_to(point);
            let psi = self.mode.psi(switch);
            point.change_sides(&[switch], &[Side::of(psi)]);
            self.bands.armed[switch] = false;
        }
    }
}
