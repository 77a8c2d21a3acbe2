//! How far a run is from a finer one.

use nsd_solver::simulate::Side;

use super::super::super::{Estimate, Touches};
use super::Run;

/// When sides change, and to which.
type Change = (f64, Box<[Side]>);

impl Run<'_, '_> {
    /// How far the end of a finer run, its jumps and its changes of sides are away, where it comes to the end.
    pub(super) fn compare(&self, finer: &Self, changes: [Vec<&Change>; 2], ends: bool) -> Estimate {
        // Whatever rests at zero differs by rounding alone.
        let size = match self.size > f64::EPSILON {
            true => self.size,
            false => 1.0,
        };
        let states = self
            .x
            .iter()
            .zip(&finer.x)
            .map(|(a, b)| (a - b).abs() / size);
        let mut jumps = self.jumps.iter().zip(&finer.jumps);
        let same = self.jumps.len() == finer.jumps.len() && jumps.all(|(a, b)| a.1 == b.1);
        let instants = self.jumps.iter().zip(&finer.jumps);
        let instants = instants.map(|(a, b)| (a.0 - b.0).abs() / self.horizon);
        // Where states hardly depend on when a body stops, its instant is all that shows how well that is known.
        let [own, others] = changes;
        let sides = |changes: &[&Change]| changes.iter().map(|c| c.1.clone()).collect::<Vec<_>>();
        let alike = sides(&own) == sides(&others);
        let stops = own.iter().zip(&others).filter(|_| alike);
        let stops = stops.map(|(a, b)| (a.0 - b.0).abs() / self.horizon);
        let rounding = f64::EPSILON * (self.steps as f64).sqrt();
        let all = states.chain(instants).chain(stops);
        Estimate {
            touches: Touches::default(),
            parted: None,
            error: all.fold(rounding, f64::max),
            same_modes: same && ends,
        }
    }
}
