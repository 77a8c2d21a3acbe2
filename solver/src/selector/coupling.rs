//! Which switches interact: where the rate of one contains the α of another.

use std::sync::Arc;

use crate::hybrid::{Few, HybridSystem, Role};

/// Couplings of the switches of a system.
pub(crate) struct Coupling {
    system: Arc<HybridSystem>,
    /// Switches whose rates the α of a switch may occur in.
    coupled_by: Vec<Vec<usize>>,
}

impl Coupling {
    pub(crate) fn new(system: Arc<HybridSystem>) -> Self {
        let mut coupled_by = vec![Vec::new(); system.n_switches()];
        for rate in 0..system.n_switches() {
            for &alpha in &system.switches[rate].couplings {
                coupled_by[alpha].push(rate);
            }
        }
        Coupling { system, coupled_by }
    }

    /// True for a switch whose α no rate of a switching function contains, as that of a term in an output.
    pub(crate) fn only_watches(&self, switch: usize) -> bool {
        let is_step = self.system.role(switch) == Role::Step;
        is_step
            && self.coupled_by[switch].is_empty()
            && self.system.slip_of(switch).is_none()
            && !self.system.is_unilateral(switch)
    }

    /// The surfaces among `meeting` that `switch` interacts with, in order.
    pub(crate) fn interacting(&self, switch: usize, meeting: &[usize]) -> Few<usize> {
        let mut group = Few::from_slice(&[switch]);
        if self.only_watches(switch) {
            return group;
        }
        let mut next = 0;
        while next < group.len() {
            let i = group[next];
            let linked = self.system.switches[i]
                .couplings
                .iter()
                .chain(&self.coupled_by[i]);
            let partner = match self.system.role(i) {
                Role::Member(partner) => Some(partner),
                Role::Step | Role::Equation => None,
            };
            let across = self.system.across(i);
            for &j in linked.chain(&partner).chain(&across) {
                let is_met = meeting.binary_search(&j).is_ok() && !self.only_watches(j);
                if is_met && !group.contains(&j) {
                    group.push(j);
                }
            }
            next += 1;
        }
        group.sort_unstable();
        group
    }
}
