//! The law of impacts, at an instant: what the system with jumps does there.

use std::ops::ControlFlow;

use nsd_solver::event::{Event, Observer, Segment, Simulator};

/// A contact that strikes does so within this share of the horizon.
const SOON: f64 = 1e-6;

/// The state behind the impact that a system comes to from a state where a gap is zero.
pub(crate) fn impact(
    simulator: &mut Simulator,
    horizon: f64,
    t: f64,
    x: &[f64],
) -> Option<Vec<f64>> {
    let mut first = First(None);
    simulator.run(t, t + SOON * horizon, x, &mut first);
    first.0
}

/// The state behind the first jump.
struct First(Option<Vec<f64>>);

impl Observer for First {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        match self.0 {
            Some(_) => ControlFlow::Break(()),
            None => ControlFlow::Continue(()),
        }
    }

    fn event(&mut self, event: &Event) {
        if self.0.is_none() && !event.jumps.is_empty() {
            self.0 = Some(event.x.to_vec());
        }
    }
}
