//! One and the same system as kinks, regions, complementarity, a convex program, a variational inequality and a
//! projection: the ends agree, by events and by finite elements.
//!
//! What follows from states at once, as a saturation does, is a projection too: a state that would fall faster than
//! max(a, b) ever does rests on the higher one of a and b, as the voltage behind a diode does that is charged up to
//! that before it and discharged by a current.

use nsd_tests::{assert_near, codes, end, run, times};
use nsdc::report::{EventKind, Status, Trajectory};

/// By events, and by finite elements of an order that leaves rounding.
const ROADS: [&str; 2] = ["", "method fesd { steps = 400; scheme = radau_iia(4); }"];

/// Runs a model to a horizon.
fn runs(model: &str, horizon: f64, settings: &str) -> Trajectory {
    let found = run(
        &format!(
            "model m {{ {model} }} simulate this of m {{ horizon {horizon:?}; tolerance 1e-12; {settings} }}"
        ),
        "this",
    );
    assert_eq!(found.status, Status::Solved, "{:?}: {model}", found.failure);
    found
}

/// All forms end in these states, by every method, as the first one does by events.
#[track_caller]
fn assert_agree(forms: &[&str], horizon: f64, states: &[&str]) {
    let ends = |form: &str, road: &str| -> Vec<f64> {
        let found = runs(form, horizon, road);
        states.iter().flat_map(|state| end(&found, state)).collect()
    };
    let first = ends(forms[0], ROADS[0]);
    for form in forms {
        for road in ROADS {
            let found = ends(form, road);
            let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9;
            let agrees = found.len() == first.len() && found.iter().zip(&first).all(near);
            assert!(agrees, "{found:?} and {first:?}: {form} {road}");
        }
    }
}

#[test]
fn a_saturation() {
    let rest = "state x = 3; state y = 0; x' = y; y' = -z - 0.2*y;";
    assert_agree(
        &[
            &format!("{rest} let z = sat(x);"),
            &format!("{rest} z in argmin 0.5*(z - x)^2 subject to {{ 1 - z >= 0; z + 1 >= 0; }}"),
            &format!("{rest} z in variational [-1, 1] solves z - x;"),
            &format!("{rest} z in variational {{ -1 <= z <= 1; }} solves 2*(z - x);"),
            &format!(
                "{rest} algebraic z = 0; algebraic a = 0; algebraic b = 0; 0 = z - x + a - b;
                 0 <= a perp 1 - z >= 0; 0 <= b perp z + 1 >= 0;"
            ),
            "state x = 3; state y = 0; x' = y;
             region high where x > 1 { y' = -1 - 0.2*y; }
             region low where x < -1 { y' = 1 - 0.2*y; }
             region linear else { y' = -x - 0.2*y; }",
            &format!(
                "{rest} let z = x - w[1] + w[2]; state w[2] = [2, 0]; w' = -20;
                 project w onto {{ w[1] - x + 1 >= 0; w[2] + x + 1 >= 0; w >= 0; }}"
            ),
        ],
        12.0,
        &["x", "y"],
    );
}

#[test]
fn a_deadzone() {
    let rest = "state x = 3; state y = 0; x' = y; y' = -(z[1] - z[2]) - 0.2*y;";
    assert_agree(
        &[
            "state x = 3; state y = 0; x' = y; y' = -deadzone(x) - 0.2*y;",
            &format!(
                "{rest} z[2] in argmin 0.5*(z[1] - x + 1)^2 + 0.5*(z[2] + x + 1)^2 subject to {{ z >= 0; }}"
            ),
            &format!("{rest} z[2] in variational [0, inf] solves [z[1] - x + 1, z[2] + x + 1];"),
            &format!("{rest} algebraic z[2] = 0; 0 <= z perp [z[1] - x + 1, z[2] + x + 1] >= 0;"),
            "state x = 3; state y = 0; x' = y;
             region high where x > 1 { y' = -(x - 1) - 0.2*y; }
             region low where x < -1 { y' = -(x + 1) - 0.2*y; }
             region dead else { y' = -0.2*y; }",
            &format!(
                "{rest} state z[2] = [2, 0]; z' = -20;
                 project z onto {{ z[1] - x + 1 >= 0; z[2] + x + 1 >= 0; z >= 0; }}"
            ),
        ],
        12.0,
        &["x", "y"],
    );
}

#[test]
fn a_rectifier_with_a_capacitor() {
    // Currents of the two pairs of diodes, behind a resistance of 1/2.
    let rest = "state v = 0.1; let e = sin(6*time); v' = z[1] + z[2] - v;";
    assert_agree(
        &[
            "state v = 0.1; let e = sin(6*time); v' = 2*max(abs(e) - v, 0) - v;",
            &format!(
                "{rest} z[2] in argmin 0.25*(z[1] - z[2])^2 - e*(z[1] - z[2]) + v*sum(z) subject to {{ z >= 0; }}"
            ),
            &format!(
                "{rest} z[2] in variational [0, inf] solves [0.5*(z[1] - z[2]) - e + v, 0.5*(z[2] - z[1]) + e + v];"
            ),
            &format!(
                "{rest} algebraic z[2] = 0; algebraic d = 0; 0 = d - 0.5*(z[1] - z[2]);
                 0 <= z perp [d - e + v, e - d + v] >= 0;"
            ),
            "state v = 0.1; let e = sin(6*time);
             region forth where e > v { v' = 2*(e - v) - v; }
             region back where e < v and e < -v { v' = 2*(-e - v) - v; }
             region apart where e < v and e > -v { v' = -v; }",
            // What a resistance has on top of the capacitor.
            "state v = 0.1; let e = sin(6*time); v' = 2*w - v; state w = 0; w' = -20;
             project w onto { w - e + v >= 0; w + e + v >= 0; w >= 0; }",
        ],
        3.0,
        &["v"],
    );
}

#[test]
fn a_bridge_of_four_diodes() {
    // Resonant circuit, bridge and resistor of Acary & Brogliato (2008), and the charge that goes through the resistor.
    let circuit = "param R = 1000; param L = 1e-2; param C = 1e-6; state v = 10; state i = 0; i' = v/L; state q = 0;";
    // What two diodes block.
    let blocked = "v' = (-(a[1] - a[2])/R - i)/C; q' = sum(a)/R;";
    // The currents of two diodes, and that through the resistor.
    let currents = "v' = (j[2] - j[1] - i)/C; q' = j[3];";
    assert_agree(
        &[
            &format!("{circuit} v' = (-v/R - i)/C; q' = abs(v)/R;"),
            // The least power in the resistor, and least power there less what the source gives.
            &format!(
                "{circuit} {blocked} a[2] in argmin sum(a)^2/(2*R) subject to {{ a >= 0; a[1] >= v; a[2] >= -v; }}"
            ),
            &format!(
                "{circuit} {currents} j[3] in argmin R*j[3]^2/2 - v*(j[1] - j[2])
                 subject to {{ j[1] >= 0; j[2] >= 0; j[3] >= j[1]; j[3] >= j[2]; }}"
            ),
            &format!(
                "{circuit} {currents} j[3] in variational {{ j[1] >= 0; j[2] >= 0; j[3] >= j[1]; j[3] >= j[2]; }}
                 solves [-v, v, R*j[3]];"
            ),
            &format!(
                "{circuit} v' = (c[2] - c[1] - i)/C; q' = sum(a)/R; algebraic a[2] = 0; algebraic c[2] = 0;
                 0 <= a perp [sum(a)/R - c[1], sum(a)/R - c[2]] >= 0;
                 0 <= c perp [a[1] - v, a[2] + v] >= 0;"
            ),
            &format!(
                "{circuit}
                 region forth where v > 0 {{ v' = (-v/R - i)/C; q' = v/R; }}
                 region back where v < 0 {{ v' = (-v/R - i)/C; q' = -v/R; }}"
            ),
            &format!(
                "{circuit} {blocked} state a[2] = [10, 0]; a' = -1e6;
                 project a onto {{ a[1] >= v; a[2] >= -v; a >= 0; }}"
            ),
        ],
        2e-3,
        &["v", "i", "q"],
    );
}

#[test]
fn a_tank_over_a_weir() {
    let rest = "state h = 0; h' = 1 + sin(3*time) - z;";
    assert_agree(
        &[
            &format!("{rest} let z = 5*max(h - 1, 0);"),
            &format!("{rest} z in argmin 0.5*z^2 - 5*(h - 1)*z subject to {{ z >= 0; }}"),
            &format!("{rest} z in variational [0, inf] solves z - 5*(h - 1);"),
            &format!("{rest} algebraic z = 0; 0 <= z perp z - 5*(h - 1) >= 0;"),
            "state h = 0;
             region over where h > 1 { h' = 1 + sin(3*time) - 5*(h - 1); }
             region below else { h' = 1 + sin(3*time); }",
            &format!("{rest} state z = 0; z' = -20; project z onto {{ z >= 0; z >= 5*(h - 1); }}"),
        ],
        4.0,
        &["h"],
    );
}

#[test]
fn a_tank_with_a_brim() {
    // Nothing passes the brim. What runs over is what comes in while the level stays there: it follows from a rate, so
    // that in a complementarity, and as the multiplier of a program, its index is two.
    assert_agree(
        &[
            "state h = 0; h' = 0.5 + sin(3*time); project h onto { h <= 1; }",
            "state h = 0;
             region over where h > 1 { h' = -1; }
             region below else { h' = 0.5 + sin(3*time); }",
        ],
        4.0,
        &["h"],
    );
    for form in [
        "algebraic z = 0; 0 <= z perp 1 - h >= 0;",
        "z in variational [0, inf] solves 1 - h;",
        "z in argmin (1 - h)*z subject to { z >= 0; }",
    ] {
        let text = format!(
            "model m {{ state h = 0; h' = 0.5 + sin(3*time) - z; {form} }} simulate this of m {{ horizon 4; }}"
        );
        assert_eq!(codes(&text), ["E0414"], "{form}");
    }
}

#[test]
fn a_rectifier_without_resistance() {
    // The voltage at the load is not below that of the source, whichever sign it has.
    assert_agree(
        &[
            "state x[2] = [1, 1.5]; state i = -2; i' = x[1]; x' = [-i, -x[2]/4];
             project x onto { x[2] - x[1] >= 0; x[2] + x[1] >= 0; } metric [1, 0; 0, 0.5];",
            "state x[2] = [1, 1.5]; state i = -2; i' = x[1];
             region forth where x[1] > x[2] { x' = [-i - 8, -x[2]/4 + 4]; }
             region back where x[1] < x[2] and -x[1] > x[2] { x' = [-i + 8, -x[2]/4 + 4]; }
             region apart where x[1] < x[2] and -x[1] < x[2] { x' = [-i, -x[2]/4]; }",
        ],
        12.0,
        &["x", "i"],
    );
}

#[test]
fn a_force_may_be_of_any_size() {
    // y rests on 1 - t, although it would fall a thousand million times as fast, until that is zero.
    let model = "state y = 1; y' = -1e9; project y onto { y + time - 1 >= 0; y >= 0; }";
    for road in ROADS {
        let found = runs(model, 2.0, road);
        assert_near(&end(&found, "y"), &[0.0], 1e-9);
        assert_near(&times(&found, EventKind::Activate), &[1.0], 1e-9);
    }
}

#[test]
fn rows_that_meet_at_one_instant_do_so_in_every_run() {
    // Two envelopes bend where v = 0. Rounding tells these instants apart in some runs; that is no other mode.
    let model =
        "state v = 10; state i = 0; i' = v; v' = -0.1*v - i; state a[2] = [10, 0]; a' = -30;
      project a onto { a[1] >= v; a[2] >= -v; a >= 0; }";
    let found = runs(model, 10.0, "");
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    assert_eq!(times(&found, EventKind::Activate).len(), 6);
}

/// Saturations of a state and time inside of each other are continuous, however many terms cancel where they meet.
#[test]
fn saturations_inside_of_each_other_are_continuous() {
    for levels in [4, 5] {
        let nested: Vec<String> = (1..=levels)
            .map(|k| format!("let a{k} = sat(1.5*a{} + 0.1*sin({k}*time), -1, 1);", k - 1))
            .collect();
        let text = format!(
            "model m {{
               state x = 0; x' = cos(time);
               state z = 0;
               let a0 = 2*x; {}
               z' = a{levels};
             }}
             simulate s of m {{ horizon 3; }}",
            nested.join(" ")
        );
        let rate = |t: f64| {
            let level =
                |a: f64, k: i32| (1.5 * a + 0.1 * (f64::from(k) * t).sin()).clamp(-1.0, 1.0);
            (1..=levels).fold(2.0 * t.sin(), level)
        };
        // The midpoint rule, kinks included.
        let n = 200_000;
        let h = 3.0 / f64::from(n);
        let exact: f64 = (0..n).map(|k| h * rate((f64::from(k) + 0.5) * h)).sum();
        let found = end(&run(&text, "s"), "z")[0];
        assert!((found - exact).abs() < 1e-8, "{found} instead of {exact}");
    }
}
