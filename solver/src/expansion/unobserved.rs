//! Switches that nothing but outputs looks at, where their ψ has no series.
//!
//! |v| has no derivative where a body comes to rest. In a rate this ends a run; in an output it must not, whose values
//! alone are wanted. Within a step such a switch is not monitored: its α is not known, and follows from ψ itself wherever
//! an output is evaluated. At the end of the step it takes the side of ψ.

use crate::expansion::scales::Scales;
use crate::hybrid::{Effect, Guard, HybridSystem, Input, Role};

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
