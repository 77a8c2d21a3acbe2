//! Optimal control with friction in two directions, by impulses where finite elements meet: closed forms.
//!
//! A body of mass 1 slips with the friction c = μ g against w/|w|. With b = u - c w/|w|, which is its acceleration,
//!
//! ∫ |u|² = ∫ |b|² + 2c (|w(T)| - |w(0)|) + c² T
//!
//! as b·w/|w| is the rate of |w|: where it never rests, the motion with the least effort is the one without friction, a
//! cubic in time.

use nsd_tests::{agrees, end, solved_optimum, with_experiment};
use nsdc::lowering::dcs;
use nsdc::lowering::discretize;
use nsdc::lowering::discretize::{Grid, discretize};
use nsdc::report::{Stationarity, Trajectory};

/// The directions of slip of a scene: along the axes, and turned.
const TURNS: [f64; 3] = [0.0, 0.9, -2.3];

/// A body that is pushed over a floor by u, where friction is c = 1.
fn text(v: [f64; 2], turned: f64, task: &str) -> String {
    let (s, c) = turned.sin_cos();
    format!(
        "model puck {{
           state q[3] = [0, 0, 0];
           state v[3] = [{:?}, {:?}, 0];
           control u[2] = [0, 0];
           q' = v;
           mechanics q, v {{
             mass = eye(3);
             force = [u[1], u[2], -10];
             contact floor {{
               gap = q[3];
               slip = [{c:?}*v[1] + {s:?}*v[2], {c:?}*v[2] - {s:?}*v[1]];
               restitution = 0; friction = 0.1;
             }}
           }}
         }}
         optimize o of puck {{ lower impact; minimize integral(dot(u, u)); {task} }}",
        v[0], v[1]
    )
}

#[track_caller]
fn close(found: f64, exact: f64, within: f64) {
    assert!((found - exact).abs() <= within, "{found} is not {exact}");
}

/// An optimum whose controls, run from event to event, end as close by.
#[track_caller]
fn solved(text: &str, within: f64) -> Trajectory {
    let found = solved_optimum(text, "o");
    agrees(&found, within);
    found
}

/// Descent to first order is excluded.
#[track_caller]
fn certified(found: &Trajectory) {
    let class = found.quality.certificate.stationarity;
    assert!(
        matches!(class, Stationarity::S | Stationarity::B),
        "{class:?}"
    );
}

/// From rest to rest along a line of length d, b = (6d/T²)(1 - 2t/T): 12 d²/T³ + c² T. The controls are linear in time.
#[test]
fn a_puck_is_pushed_along_a_line() {
    let (x, y, t): (f64, f64, f64) = (1.0, 0.5, 2.0);
    let least = 12.0 * (x * x + y * y) / (t * t * t) + t;
    for (turned, intervals, elements) in [(TURNS[0], 2, 2), (TURNS[1], 2, 3), (TURNS[2], 4, 2)] {
        let task = format!(
            "horizon {t:?}; intervals {intervals}; elements {elements}; controls linear;
             final {{ q = [{x:?}, {y:?}, 0]; v = [0, 0, 0]; }}
             guess {{ u = [2, 1]; }}"
        );
        let found = solved(&text([0.0; 2], turned, &task), 1e-9);
        close(found.objective.expect("an optimum"), least, 1e-8);
        certified(&found);
        assert_eq!(found.history.modes.len(), 1, "it slips all the time");
    }
}

/// From v = (1, 0) to v = (0, 1) as fast at the end: along x, b = 1/4 - 3t/4, and along y, b = 1/2. The direction of
/// friction turns, and controls that are linear in time come close to its share with an order of four.
#[test]
fn a_puck_is_led_round_a_bend() {
    let least = (0.125 - 0.75 + 1.5) + 0.5 + 2.0;
    let above = |intervals: usize| {
        let task = format!(
            "horizon 2; intervals {intervals}; elements 2; controls linear; tolerance 1e-4;
             final {{ q = [1.5, 1, 0]; v = [0, 1, 0]; }}
             guess {{ u = [0.5, 0.5]; }}"
        );
        let found = solved(&text([1.0, 0.0], 0.9, &task), 1e-4);
        found.objective.expect("an optimum") - least
    };
    let [two, four, eight] = [2, 4, 8].map(above);
    assert!(eight > 0.0 && eight <= 2e-5, "{eight:e}");
    assert!(two >= 10.0 * four && four >= 10.0 * eight);
}

/// It slides with v₀ = 1 against the push a, rests after v₀/(a + c) for no time at all, and comes back with a - c. The
/// place at the end says what a is.
#[test]
fn a_puck_that_is_pushed_back_turns_round_at_rest() {
    let (push, friction, t): (f64, f64, f64) = (3.0, 1.0, 1.0);
    let rest = 1.0 / (push + friction);
    let place = 0.5 * rest - 0.5 * (push - friction) * (t - rest) * (t - rest);
    let (s, c) = 0.4_f64.sin_cos();
    for (turned, elements) in [(TURNS[0], 2), (TURNS[1], 3)] {
        let task = format!(
            "horizon {t:?}; intervals 1; elements {elements};
             final {{ q[1] = {:?}; q[2] = {:?}; }}
             guess {{ u = [{:?}, {:?}]; }}",
            c * place,
            s * place,
            -2.0 * c,
            -2.0 * s
        );
        let found = solved(&text([c, s], turned, &task), 1e-8);
        close(found.objective.expect("an optimum"), push * push * t, 1e-8);
        certified(&found);
        let back = -(push - friction) * (t - rest);
        close(end(&found, "v")[0], c * back, 1e-9);
        close(end(&found, "v")[1], s * back, 1e-9);
    }
}

#[test]
fn printed_form() {
    let text = text(
        [1.0, 0.0],
        0.0,
        "horizon 1; intervals 2; elements 2; scheme radau_iia(2);",
    );
    with_experiment(&text, "o", |compiled| {
        let (system, settings) = (&compiled.system, &compiled.settings);
        let dcs = dcs::lower(system, &settings.numerics.lowerings).expect("contacts give impulses");
        let task = settings.optimize.as_ref().expect("an optimization");
        let grid = Grid {
            start: 0.0,
            horizon: 1.0,
            steps: 2,
        };
        let program = discretize(&dcs, grid, &discretize::Options::optimize(task));
        let (program, _) = program.expect("it is small");
        program.verify().expect("the invariants of `Mpcc`");
        insta::assert_snapshot!("impulses_space_program", program);
    });
}
