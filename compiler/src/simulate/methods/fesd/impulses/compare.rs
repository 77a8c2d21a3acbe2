//! How far a run is from a finer one.

use super::Reached;
use crate::simulate::estimate::{Estimate, Touches};

impl Reached {
    /// How far the end of a finer run, its jumps and its changes of sides are away, where it comes to the end.
    pub(crate) fn compare(&self, finer: &Self, ends: bool) -> Estimate {
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
        let [own, others] = [self, finer].map(|run| {
            let pairs = run.sides.windows(2).filter(|pair| pair[0].1 != pair[1].1);
            pairs.map(|pair| &pair[1]).collect::<Vec<_>>()
        });
        let alike = own.iter().map(|c| &c.1).eq(others.iter().map(|c| &c.1));
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
