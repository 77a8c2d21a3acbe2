//! Set points that step.

use super::{Case, Extent, Family, Promise};
use crate::set_points::{Written, loops};

/// How set points are written, in turn.
const WRITTEN: [(Written, &str); 4] = [
    (Written::Cases, "cases of time"),
    (Written::Steps, "sums of steps"),
    (Written::Input, "inputs"),
    (Written::Table, "tables"),
];

/// What looks for switches, with every lowering.
const LOCATING: [&str; 6] = [
    "event",
    "fesd",
    "fesd; lower stewart",
    "fesd; lower step",
    "event; lower timefreezing",
    "fesd; lower timefreezing",
];

/// Methods with a grid, steep functions, or none of all that; and programs.
const OTHERS: [&str; 3] = [
    "adaptive",
    "smoothing { epsilon = 1e-5; }",
    "optimize intervals 12; elements 3",
];

pub fn families(extent: Extent) -> Vec<Family> {
    vec![set_points(extent)]
}

/// One to three loops with relays, saturations and integral action, coupled.
fn set_points(extent: Extent) -> Family {
    let seeds = extent.of(1, 60);
    let mut cases = Vec::new();
    for seed in 0..seeds {
        for (k, (written, hardness)) in WRITTEN.into_iter().enumerate() {
            let loops = loops(seed, written);
            let case = |method: &str| {
                let case = Case::new(hardness, &loops.model, loops.horizon);
                let case = case.with(&loops.data, &loops.given).by(method);
                let ends = loops.end.iter().zip(&loops.scales).enumerate();
                ends.fold(case, |case, (i, (end, scale))| {
                    case.ends(&format!("x{}", i + 1), &[*end], *scale)
                })
            };
            let frozen =
                |method: &&&str| written != Written::Table || !method.contains("timefreezing");
            cases.extend(LOCATING.iter().filter(frozen).map(|method| case(method)));
            let steps = 240;
            let grid = format!("timestepping {{ steps = {steps}; }}");
            cases.push(case(&grid).promises(Promise::Grid(steps)));
            let open = |method: &&str| case(method).promises(Promise::AccuracyOrReport).within(20);
            let others = extent.of(&OTHERS[k % OTHERS.len()..][..1], &OTHERS);
            cases.extend(others.iter().map(open));
        }
    }
    Family {
        name: "set points that step",
        about: "one to three coupled loops with relays, saturations and integral action, whose set points step up to \
                three times, some of them at once; from piece to piece by matrix exponentials. A program whose control \
                has nothing to do promises 1e-3.",
        hardness: "set points are",
        cases,
    }
}
