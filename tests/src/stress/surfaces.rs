//! Surfaces that are nearly parallel, nearly tangent to the flow, or many at once.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{DMatrix, DVector};

use super::units::magnitudes;
use super::{Case, Extent, Family, root};
use crate::affine::exact::{End, solve};
use crate::affine::{Affine, Form, Kind, Surface};

const EPSILON: f64 = f64::EPSILON;

pub fn families(extent: Extent) -> Vec<Family> {
    vec![
        nearly_parallel(extent),
        close_together(extent),
        small_angles(extent),
        chords(extent),
        grazing(extent),
        one_after_another(extent),
        excursions(extent),
        nearly_repelling(extent),
    ]
}

fn powers(extent: Extent, short: &[i32], long: std::ops::RangeInclusive<i32>) -> Vec<f64> {
    let long: Vec<i32> = long.collect();
    let powers = extent.sweep(short, &long);
    powers.into_iter().map(|k| 10.0_f64.powi(-k)).collect()
}

/// x slides on 0 from 5/7 on, and x + a y = 0 is met there at y = 0.
fn nearly_parallel(extent: Extent) -> Family {
    let case = |a: f64| {
        let model = format!(
            "state x = 0.5; state y = 1; x' = 0.3 - sign(x); y' = 0.2 - sign(x + {a:e}*y);"
        );
        let times = [5.0 / 7.0, 1.25];
        let case = Case::new(format!("{a:e}"), model, 2.0).ends("x", &[0.0], 0.5);
        let case = case.ends("y", &[0.0], 1.0).switches_at(&times);
        // x is zero to its rounding, so that y is met to that over a.
        case.rounds(16.0 * EPSILON / a).conditioned(1.0 / a).both()
    };
    Family {
        name: "nearly parallel surfaces",
        about: "x' = 0.3 - sign(x), y' = 0.2 - sign(x + a y): slides on one surface, then on both; closed form, \
                to 16 roundings of x over a.",
        hardness: "angle a",
        cases: powers(extent, &[4, 8, 12, 13, 14], 1..=16)
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// Between two surfaces at the distance a the field is 1/a.
fn close_together(extent: Extent) -> Family {
    let case = |a: f64| {
        let model =
            format!("state x = 1; state z = 1; x' = -1; z' = (sign(x) - sign(x + {a:e}))/{a:e};");
        let case = Case::new(format!("{a:e}"), model, 2.0).ends("z", &[-1.0], 1.0);
        case.ends("x", &[-1.0], 1.0)
            .rounds(16.0 * EPSILON / a)
            .conditioned(1.0 / a)
            .both()
    };
    Family {
        name: "surfaces close together",
        about: "z' = (sign(x) - sign(x + a))/a while x passes both: z falls by 2; closed form, to 16 roundings \
                of x over a.",
        hardness: "distance a",
        cases: powers(extent, &[4, 8, 12, 13, 14], 1..=16)
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// x and y pass each other with speeds that differ by a.
fn small_angles(extent: Extent) -> Family {
    let case = |a: f64| {
        let line = format!(
            "state x = 0; state y = {:e}; state w = 0; x' = 1; y' = {:?}; w' = step(y - x);",
            -a,
            1.0 + a
        );
        let cube = format!(
            "state y = {:?}; state w = 0; y' = 3*(time - 1)^2 + {a:e}; w' = step(y);",
            -1.0 - a
        );
        [line, cube].into_iter().flat_map(move |model| {
            let case = Case::new(format!("{a:e}"), model, 2.0).ends("w", &[1.0], 1.0);
            // Rounding of the states, over the angle.
            let case = case.rounds(16.0 * EPSILON / a);
            case.accurate_if(a >= 1e-8).both()
        })
    };
    Family {
        name: "crossings at small angles",
        about: "y - x with x' = 1, y' = 1 + a, and y with y' = 3 (t - 1)² + a, change their signs at t = 1; \
                closed form, to 16 roundings of the states over a.",
        hardness: "angle a",
        cases: powers(extent, &[2, 5, 8], 1..=12)
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// A line cuts a circle of radius one at the depth d, at the angle √(2d).
fn chords(extent: Extent) -> Family {
    let case = |a: f64| {
        let depth = 0.5 * a * a;
        let half = (depth * (2.0 - depth)).sqrt();
        let model = format!(
            "state x = -1; state y = {depth:e}; state w = 0; x' = 1; y' = 0; w' = step(2*y - x^2 - y^2);"
        );
        let case = Case::new(format!("{a:e}"), model, 2.0).ends("w", &[2.0 * half], 2.0 * half);
        case.switches(2)
            .rounds(16.0 * EPSILON / a)
            .accurate_if(a >= 1e-6)
            .both()
    };
    Family {
        name: "chords of a circle",
        about: "A line enters a circle at the angle a and leaves it again; the time inside, relative to itself, \
                by Pythagoras, to 16 roundings of the time over a.",
        hardness: "angle a",
        cases: powers(extent, &[1, 4, 8], 1..=8)
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// x = 1 + d + sin t passes the surface at the distance d, or meets it and falls.
fn grazing(extent: Extent) -> Family {
    let case = |d: f64| {
        let model =
            |start: f64| format!("state x = {start:?}; x' = if x > 0 then cos(time) else -10;");
        let (above, below) = (1.0 + d, 1.0 - d);
        // What is left of d in the start.
        let meets = PI + FRAC_PI_2 - ((1.0 - below) * (1.0 + below)).sqrt().asin();
        let falls = -10.0 * (6.0 - meets);
        let passes = above + 6.0_f64.sin();
        [(above, passes, 2.0), (below, falls, 13.0)]
            .into_iter()
            .flat_map(move |(start, exact, scale)| {
                let case =
                    Case::new(format!("{d:e}"), model(start), 6.0).ends("x", &[exact], scale);
                case.rounds(16.0 * EPSILON / d.sqrt())
                    .accurate_if(d >= 1e-6)
                    .both()
            })
    };
    Family {
        name: "grazing",
        about: "x = 1 ± d + sin t stays above zero, or meets it and falls; closed form, to 16 roundings over √d.",
        hardness: "distance d",
        cases: powers(extent, &[2, 6, 12], 1..=15)
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// x_i' = c_i - s_i + 0.2 s_{i+1} from x_i = i/8 on: one surface after the other is met and kept.
fn one_after_another(extent: Extent) -> Family {
    let case = |n: usize| {
        let unit = |i: usize| DVector::from_fn(n + 2, |k, _| if k == i { 1.0 } else { 0.0 });
        let surface = |i: usize| {
            let mut jump = DMatrix::zeros(n, n + 2);
            jump[(i, n)] = -1.0;
            jump[((i + n - 1) % n, n)] += 0.1875;
            Surface {
                normal: unit(i),
                jump,
                kind: Kind::Jump,
            }
        };
        let mut field = DMatrix::zeros(n, n + 2);
        for i in 0..n {
            field[(i, n)] = 0.375 - 0.125 * (i % 4) as f64;
            field[(i, n + 1)] = 0.0625 * (i % 3) as f64;
        }
        let system = Affine {
            n,
            field,
            surfaces: (0..n).map(surface).collect(),
            start: DVector::from_fn(n, |i, _| 0.125 * (i + 1) as f64),
            horizon: 3.0,
            form: Form::Terms,
        };
        let solution = solve(&system);
        assert_eq!(solution.end, End::Horizon);
        let last = solution.legs.last().expect("a solution has a mode");
        assert!(
            last.sides.iter().all(|side| *side == 0),
            "all are kept at the end"
        );
        let times: Vec<f64> = solution.legs.iter().skip(1).map(|leg| leg.start).collect();
        let exact = solution.state(system.horizon);
        let case = Case::new(n, system.model(), system.horizon).switches_at(&times);
        let scales = magnitudes(&solution, &system);
        case.ends_each("x", exact.as_slice(), &scales).both()
    };
    Family {
        name: "codimension",
        about: "n coupled relays are met one after the other and all slide at last; matrix exponentials.",
        hardness: "codimension n",
        cases: extent
            .sweep(&[2, 4, 6], &[1, 2, 3, 4, 5, 6, 7, 8])
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// x' = a sin t - sign(x) slides while |a sin t| < 1; z is the integral of t sign(x), which is
/// a (sin t - t cos t) - t x and the integral of x.
fn excursions(extent: Extent) -> Family {
    let horizon = 3.0_f64;
    let case = |d: f64| {
        let of = |a: f64, excursion: f64| {
            let model = format!(
                "state x = 0; state z = 0; x' = {a:?}*sin(time) - sign(x); z' = time*sign(x);"
            );
            let exact = a * (horizon.sin() - horizon * horizon.cos()) + excursion;
            Case::new(format!("{d:e}"), model, horizon).ends("z", &[exact], exact)
        };
        // Around t = π/2 + u, x = a (g(b) + g(u)) + d (u + b) with g(u) = sin u - u, from u = -b on.
        let a = 1.0 + d;
        let b = (d * (2.0 + d)).sqrt().atan();
        let g = |u: f64| series(u, 3);
        let returns = root(|u| a * (g(b) + g(u)) + d * (u + b), b, PI);
        let length = returns + b;
        let even = series(b, 4) - series(returns, 4);
        let area = a * (g(b) * length + even) + 0.5 * d * length * length;
        let (mut stays, mut goes) = (of(1.0 - d, 0.0), of(a, area));
        if d >= 1e-6 {
            stays = stays.switches_at(&[]);
            goes = goes.switches_at(&[FRAC_PI_2 - b, FRAC_PI_2 + returns]);
        }
        [stays, goes].into_iter().flat_map(move |case| {
            let case = case.rounds(16.0 * EPSILON / d.sqrt());
            case.accurate_if(d >= 1e-8).both()
        })
    };
    Family {
        name: "sliding near its end",
        about: "x' = (1 ± d) sin t - sign(x) stays on x = 0, or leaves it for a time of 3 √(2d); the integral of \
                t sign(x), closed form and bisection, to 16 roundings over √d.",
        hardness: "distance d",
        cases: powers(extent, &[2, 6, 10], 1..=15)
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// The terms of the series of sin u (or cos u) from the power n on, with the sign that they have there.
fn series(u: f64, n: u32) -> f64 {
    let mut term = (1..=n).fold(1.0, |term, k| term * u / f64::from(k));
    if n % 4 >= 2 {
        term = -term;
    }
    let mut sum = 0.0;
    for k in 0..30 {
        sum += term;
        let k = f64::from(n + 2 * k);
        term *= -u * u / ((k + 1.0) * (k + 2.0));
    }
    sum
}

/// x' = d/2 - s_x + (1 - d) s_y, y' = d/4 - s_y + (1 - d) s_x: for d < 0 the corner repels.
fn nearly_repelling(extent: Extent) -> Family {
    let horizon = 3.0;
    let case = |power: i32| {
        let d = 2.0_f64.powi(-power);
        let (k, b1, b2) = (1.0 - d, 0.5 * d, 0.25 * d);
        let model = format!(
            "state x = {d:e}; state y = 0; state z = 0; z' = sign(x) + sign(y);
             x' = {b1:e} - sign(x) + {k:?}*sign(y); y' = {b2:e} - sign(y) + {k:?}*sign(x);"
        );
        let t = 1.0 / (1.25 - 0.75 * d);
        // (s_x + s_y) at the corner is (1 + k)(b1 + b2)/(1 - k²).
        let exact = t * (1.0 + k + b2) + (horizon - t) * (b1 + b2) / d;
        let case = Case::new(format!("2^-{power}"), model, horizon);
        let case = case.ends("z", &[exact], exact).switches_at(&[t]);
        case.rounds(16.0 * EPSILON / d).conditioned(1.0 / d).both()
    };
    Family {
        name: "near loss of attractivity",
        about: "Two relays drive each other with 1 - d times their own strength: their corner is reached along one \
                surface and attracts by d; closed form, to 16 roundings over d.",
        hardness: "d",
        cases: extent
            .sweep(
                &[4, 14, 20, 27],
                &[1, 4, 7, 10, 14, 17, 20, 24, 27, 30, 34, 37, 40],
            )
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}
