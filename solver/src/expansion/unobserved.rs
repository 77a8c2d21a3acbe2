//! Switches that nothing but outputs looks at, where their ψ has no series.
//!
//! |v| has no derivative where a body comes to rest. In a rate this ends a run; in an output it must not, whose values
//! alone are wanted. Within a step such a switch is not monitored: its α is not known, and follows from ψ itself wherever
//! an output is evaluated. At the end of the step it takes the side of ψ.

use super::mode::Mode;
use crate::expansion::scales::{Bands, Scales};
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
        }
        let inputs = match &law.effect {
            Effect::Reset(reset) => &reset.inputs,
            Effect::Impact(impact) => &impact.inputs,
        };
        for input in inputs {
            if let Input::Alpha(switch) = input {
                used[*switch] = true;
            }
        }
    }
    // Inner switches come before what they are inside of.
    for i in (0..n).rev().filter(|&i| used[i]).collect::<Vec<_>>() {
        let inside = system.switches[i].inside.iter();
        inside.for_each(|&inner| used[inner] = true);
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
    observers: Vec<bool>,
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
}

impl Mode {
    /// True for a switch that only outputs look at, whose series does not exist here.
    pub(crate) fn is_unobserved(&self, switch: usize) -> bool {
        self.monitored.observers[switch] && !self.psi_series(switch).iter().all(|c| c.is_finite())
    }

    /// Stops watching what only outputs look at, within this step.
    pub(crate) fn stop_monitoring(&mut self) {
        let observers = &self.monitored.observers;
        let (unobserved, monitored) = self.monitored.switches.iter().partition(|i| observers[**i]);
        self.monitored.switches = monitored;
        let mut unobserved: Vec<usize> = unobserved;
        self.monitored.unobserved.append(&mut unobserved);
    }

    /// Whether a step of this length is too short for what only outputs look at.
    pub(crate) fn is_too_short(&self, scales: &Scales, h: f64) -> bool {
        h < LEAST * scales.longest_step
            && self
                .monitored
                .switches
                .iter()
                .any(|&i| self.monitored.observers[i])
    }

    /// Takes the sides of switches that were not monitored in the last step.
    pub(crate) fn take_unobserved(&mut self, point: &mut Point, bands: &mut Bands) {
        for at in 0..self.monitored.unobserved.len() {
            let switch = self.monitored.unobserved[at];
            self.move_to(point);
            let psi = self.psi(switch);
            point.change_sides(&[switch], &[Side::of(psi)]);
            bands.armed[switch] = false;
        }
    }

    /// True for a switch on its surface that only outputs look at, and whose ψ has no gradient here.
    pub(crate) fn has_no_rate(&mut self, point: &Point, switch: usize) -> bool {
        if !self.monitored.observers[switch] {
            return false;
        }
        self.move_to(point);
        self.surfaces.linearize(switch, &self.memory.values);
        let mut gradient = self.gradient(switch).iter();
        !gradient.all(|(_, g)| g.is_finite()) || !self.time_gradient(switch).is_finite()
    }
}
