//! Whether the switches of a model are too many to be looked at one by one.
//!
//! Continuity, readings and proofs look at every switch in everything it acts on, and at every region
//! beside all others of its partition. What that comes to is estimated first, and refused where it would
//! take longer than anybody waits for a check.

use rustc_hash::FxHashMap;

use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, n_nodes_of, variables_of};
use crate::system::SystemError;
use crate::system::lower::instance::Instance;
use crate::system::switches::{Collected, Switches};

/// Switches of a system.
const MAX_SWITCHES: usize = 10_000;

/// Regions of a partition.
const MAX_REGIONS: usize = 500;

/// Σ over the rates: nodes of the expression times switches in it.
const MAX_EFFORT: usize = 4_000_000;

/// Reports too many switches or regions, before anything looks at them.
pub(crate) fn check_counts(
    instance: &Instance<'_, '_>,
    switches: &Switches<'_>,
    diags: &mut Diagnostics,
) {
    let count = switches.list.len();
    if count > MAX_SWITCHES {
        diags.push(too_many_switches(count, &switches.list[MAX_SWITCHES]));
    }
    for partition in instance.partitions() {
        if let Some(&region) = partition.regions.get(MAX_REGIONS) {
            diags.push(SystemError::TooManyRegions {
                count: partition.regions.len(),
                limit: MAX_REGIONS,
                span: instance.model.statements.regions[region].guard_span,
            });
        }
    }
}

/// Reports nonlinear functions of too many switches inside each other.
pub(crate) fn check_entangled(switches: &Switches<'_>, diags: &mut Diagnostics) {
    if let Some((count, span)) = switches.entries.entangled() {
        diags.push(SystemError::EntangledSwitches { count, span });
    }
}

/// Reports rates in which too many switches act together.
pub(crate) fn check_effort<'e>(
    switches: &Switches<'e>,
    rates: &[Expr<'e>],
    diags: &mut Diagnostics,
) {
    let all = switches.list.iter().enumerate();
    let place: FxHashMap<Var, usize> = all.map(|(k, switch)| (switch.alpha, k)).collect();
    let (mut effort, mut most, mut first) = (0, 0, None);
    for &rate in rates {
        let vars = variables_of(&[rate]);
        let acting = || vars.iter().filter_map(|var| place.get(var));
        let count = acting().count();
        effort += count * n_nodes_of(rate);
        if count > most {
            (most, first) = (count, acting().min());
        }
    }
    if let (true, Some(&first)) = (effort > MAX_EFFORT, first) {
        diags.push(too_many_switches(most, &switches.list[first]));
    }
}

fn too_many_switches(count: usize, one: &Collected) -> SystemError {
    SystemError::TooManySwitches {
        count,
        span: one.spans.first().copied().unwrap_or(one.origin),
    }
}
