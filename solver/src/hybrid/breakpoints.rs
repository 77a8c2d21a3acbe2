//! Breakpoints: where functions of time that are made of pieces go on with their next ones.
//!
//! No step goes beyond a breakpoint, so that each sees smooth functions. There x is kept, and what depends
//! on the data may jump or bend: a ψ that has jumped is treated like one that jumps with a relay
//! (`selector/decided.rs`), and what lies on its surface then is decided by the new rates, sliding too.

use super::system::HybridSystem;

/// Which switches the data of pieces concerns.
pub(crate) struct Pieces {
    /// The next breakpoint; infinity where there is none.
    pub until: f64,
    /// Switches whose ψ may jump or bend there.
    pub switches: Vec<usize>,
    /// Switches whose rate φ may.
    pub rates: Vec<usize>,
}

impl Pieces {
    pub(crate) fn new(system: &HybridSystem) -> Self {
        let all = 0..system.n_switches();
        Pieces {
            until: f64::INFINITY,
            switches: (all.clone())
                .filter(|&i| system.switches[i].has_data[0])
                .collect(),
            rates: all.filter(|&i| system.switches[i].has_data[1]).collect(),
        }
    }
}
