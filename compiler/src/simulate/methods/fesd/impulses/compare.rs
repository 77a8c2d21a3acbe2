//! How far a run is from a finer one.

use nsd_solver::fesd::jumps::Reached;

use crate::simulate::estimate::{Estimate, Touches};

/// How far the end of a finer run, its jumps and its changes of sides are away, where it comes to the end.
pub(crate) fn estimate(run: &Reached, finer: &Reached, ends: bool) -> Estimate {
    // Whatever rests at zero differs by rounding alone.
    let size = match run.size > f64::EPSILON {
        true => run.size,
        false => 1.0,
    };
    let states = run
        .x
        .iter()
        .zip(&finer.x)
        .map(|(a, b)| (a - b).abs() / size);
    let mut jumps = run.jumps.iter().zip(&finer.jumps);
    let same = run.jumps.len() == finer.jumps.len() && jumps.all(|(a, b)| a.1 == b.1);
    let instants = run.jumps.iter().zip(&finer.jumps);
    let instants = instants.map(|(a, b)| (a.0 - b.0).abs() / run.grid.horizon);
    // Where states hardly depend on when a body stops, its instant is all that shows how well that is known.
    let [own, others] = [run, finer].map(|run| {
        let pairs = run.sides.windows(2).filter(|pair| pair[0].1 != pair[1].1);
        pairs.map(|pair| &pair[1]).collect::<Vec<_>>()
    });
    let alike = own.iter().map(|c| &c.1).eq(others.iter().map(|c| &c.1));
    let stops = own.iter().zip(&others).filter(|_| alike);
    let stops = stops.map(|(a, b)| (a.0 - b.0).abs() / run.grid.horizon);
    let rounding = f64::EPSILON * (run.grid.steps as f64).sqrt();
    let all = states.chain(instants).chain(stops);
    Estimate {
        touches: Touches::default(),
        parted: None,
        error: all.fold(rounding, f64::max),
        same_modes: same && ends,
    }
}
