//! Contacts that are met at small speeds.

use std::f64::consts::FRAC_PI_2;

use super::{Case, Extent, Family};

pub fn families(extent: Extent) -> Vec<Family> {
    vec![grazing(extent)]
}

/// A mass on a spring, q = sin t, comes to a wall at 1 - d, or passes it at 1 + d.
fn grazing(extent: Extent) -> Family {
    let horizon = 4.0_f64;
    let case = |power: i32| {
        let d = 10.0_f64.powi(-power);
        let case = |wall: f64, q: f64, v: f64| {
            let model = format!(
                "state q = 0; state v = 1; q' = v;
                 mechanics q, v {{ mass = 2; force = -2*q;
                   contact wall {{ gap = {wall:?} - q; restitution = 0.5; }} }}"
            );
            let case = Case::new(format!("{d:e}"), model, horizon);
            let case = case
                .ends("q", &[q], 1.0)
                .ends("v", &[v], 1.0)
                .accurate_if(power <= 6);
            let grid = case.clone().in_steps(1000);
            // The speed of the impact is √(2d), to rounding of q over that.
            [case.rounds(16.0 * f64::EPSILON / d.sqrt()), grid]
        };
        let wall = 1.0 - d;
        let depth = 1.0 - wall;
        let speed = (depth * (2.0 - depth)).sqrt();
        let after = horizon - (FRAC_PI_2 - speed.atan2(wall));
        let (sin, cos) = after.sin_cos();
        let hit = case(
            wall,
            wall * cos - 0.5 * speed * sin,
            -wall * sin - 0.5 * speed * cos,
        );
        let passed = case(1.0 + d, horizon.sin(), horizon.cos());
        [hit, passed].concat()
    };
    Family {
        name: "grazing contacts",
        about: "q'' = -q with a wall at 1 ± d: struck with the speed √(2d) and restitution 1/2, or passed; closed \
                form, to 16 roundings over √d.",
        hardness: "distance d",
        cases: extent
            .sweep(
                &[2, 6, 10, 13],
                &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15],
            )
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}
