//! Events, finite elements and steps in time in all units: lengths from nanometres on, times from microseconds to months. What counts
//! as zero among gaps, forces and switching functions is a share of what they are in a run.

use nsd_tests::{end, run};
use nsdc::report::Status;

/// Units of length and of time.
#[derive(Clone, Copy, Debug)]
struct Units {
    length: f64,
    time: f64,
}

/// A model in some units, and how long it runs in units of time.
type Kind = fn(Units) -> (String, f64);

const KINDS: [(&str, Kind); 7] = [
    ("two relays", two_relays),
    ("regions by distance", by_distance),
    ("a corner of squares", corner_of_squares),
    ("a force that stops", force_that_stops),
    ("a diode", diode),
    ("a disc and a wall", disc_and_wall),
    ("a ball of multipliers", ball),
];

/// What they are run with, how far from the motion in units of one, and whether it is to be solved wherever it is in these.
const METHODS: [(&str, f64, bool); 5] = [
    ("tolerance 1e-9;", 1e-7, true),
    ("tolerance 1e-8; method fesd;", 1e-6, true),
    ("method fesd { steps = 40; }", 1e-3, true),
    (
        "tolerance 1e-8; method fesd { scheme = gauss(3); }",
        1e-6,
        true,
    ),
    ("method timestepping { steps = 500; }", 2e-2, false),
];

/// x and y drive each other through their signs, and come to rest on both surfaces.
fn two_relays(Units { length, time }: Units) -> (String, f64) {
    let speed = length / time;
    let text = format!(
        "state x = {length:e}; state y = {:e};
         x' = {:e}*y - {speed:e}*sign(x)*step(y + {:e}) - {:e}*sign(y);
         y' = -{:e}*sign(y) + {:e}*cos(3*time/{time:e});",
        0.5 * length,
        0.2 / time,
        2.0 * length,
        0.3 * speed,
        0.8 * speed,
        0.6 * speed
    );
    (text, 3.0)
}

/// The nearest of three centres decides.
fn by_distance(Units { length, time }: Units) -> (String, f64) {
    let text = format!(
        "param l = {length:e}; state x[2] = [0.49*l, -0.46*l];
         region A indicator (x[1] - 0.5*l)^2 + x[2]^2 {{ x' = [-0.07, 1.99; -1.58, -0.17]*x/{time:e} - [0.4*l/{time:e}; 0]; }}
         region B indicator (x[1] + 0.5*l)^2 + (x[2] - 0.2*l)^2 {{ x' = [-0.45, -1.48; 2.55, -0.19]*x/{time:e}; }}
         region C indicator x[1]^2 + (x[2] + 0.6*l)^2 {{ x' = [-0.95; 0.27]*l/{time:e} - x/{time:e}; }}"
    );
    (text, 2.0)
}

/// The square of a length beside a length.
fn corner_of_squares(Units { length, time }: Units) -> (String, f64) {
    let text = format!(
        "param l = {length:e}; state x[2] = [l, 0.3*l];
         x' = [x[2] - 0.7*l*sign(dot(x, x) - 0.5*l^2); -x[1] - 0.4*l*sign(x[2] + 0.2*l)]/{time:e};"
    );
    (text, 2.0)
}

/// A force of length over time squared and 1e6 is zero from some instant on.
fn force_that_stops(Units { length, time }: Units) -> (String, f64) {
    let gain = 1e6 / (time * time);
    let text = format!(
        "state x = {:e}; state r = {:e}; algebraic f = 0; 0 <= f perp {gain:e}*{:e}*f + x >= 0;
         x' = r; r' = -x/{:e} + {:e}*f;",
        -length,
        length / time,
        time * time * time * time,
        time * time,
        0.5e6
    );
    (text, 3.0)
}

/// A capacitor of a nanofarad in series with a diode: volts are the length, and currents a billionth of them.
fn diode(Units { length, time }: Units) -> (String, f64) {
    let text = format!(
        "state v = {:e}; algebraic i = 0; 0 <= i perp v - {length:e}*sin(6*time/{time:e}) + {:e}*i >= 0;
         v' = (i - v/{:e})/1e-9;",
        0.2 * length,
        0.1 * time / 1e-9,
        10.0 * time / 1e-9
    );
    (text, 2.0)
}

/// What is pushed to and fro within a disc that a wall cuts.
fn disc_and_wall(Units { length, time }: Units) -> (String, f64) {
    let speed = length / time;
    let text = format!(
        "state x[2] = [{:e}, 0]; x' = [{:e}; {:e}*cos(2*time/{time:e})];
         project x onto {{ {:e} - dot(x, x) >= 0; x[2] >= {:e}; }}",
        0.3 * length,
        -0.4 * speed,
        1.8 * speed,
        length * length,
        -0.2 * length
    );
    (text, 3.0)
}

/// The solution of an inequality in a ball, which it enters from the edge.
fn ball(Units { length, time }: Units) -> (String, f64) {
    let text = format!(
        "state x[2] = [{:e}, {:e}];
         z[2] in variational {{ norm(z) <= {:e}; }} solves 0.5*[2, -0.3; -0.3, 1.5]*z + x;
         x' = ([0.1, 1; -2, 0.1]*x + z)/{time:e};",
        -0.16 * length,
        0.68 * length,
        0.45 * length
    );
    (text, 1.0)
}

/// The states of the model at its end, in their units; none where it is not solved.
fn ends(kind: Kind, units: Units, method: &str) -> Option<Vec<f64>> {
    let (model, horizon) = kind(units);
    let text = format!(
        "model m {{ {model} }} simulate s of m {{ horizon {:e}; {method} }}",
        horizon * units.time
    );
    let found = run(&text, "s");
    let rate = units.length / units.time;
    let named = [
        ("x", units.length),
        ("y", units.length),
        ("v", units.length),
        ("r", rate),
    ];
    let states = named.into_iter().filter(|(name, _)| {
        let mut states = found.samples.states.iter();
        states.any(|state| state.name == *name)
    });
    let ends = states.flat_map(|(name, unit)| end(&found, name).into_iter().map(move |x| x / unit));
    (found.status == Status::Solved).then(|| ends.collect())
}

#[test]
fn what_is_zero_depends_on_no_unit() {
    let one = Units {
        length: 1.0,
        time: 1.0,
    };
    let mut solved = [0; METHODS.len()];
    for (name, kind) in KINDS {
        let exact = ends(kind, one, "tolerance 1e-12;").expect("events are solved");
        for (length, time) in [
            (1e-9, 1e-3),
            (1e-6, 1e3),
            (1e-3, 1.0),
            (1e6, 1e-6),
            (1e7, 1e5),
        ] {
            let units = Units { length, time };
            for (count, (method, within, is_sure)) in solved.iter_mut().zip(METHODS) {
                let Some(found) = ends(kind, units, method) else {
                    assert!(!is_sure, "{name} in {units:?} is not solved: {method}");
                    continue;
                };
                *count += 1;
                let far = found.iter().zip(&exact);
                let far = far.map(|(x, exact)| (x - exact).abs()).fold(0.0, f64::max);
                assert!(
                    far <= within,
                    "{name} in {units:?}: {found:?} and not {exact:?}, {method}"
                );
            }
        }
    }
    assert!(solved[4] >= 34, "{solved:?}");
}

#[test]
fn a_force_of_any_gain_that_never_acts_does_nothing() {
    for gain in [1.0, 1e6, 1e10, 1e13] {
        let text = format!(
            "model m {{ state x = 1; algebraic l = 0; 0 <= l perp x + l >= 0; x' = 0.5*cos(time) + {gain:e}*l; }}
             simulate s of m {{ horizon 1; method fesd {{ steps = 20; }} }}"
        );
        let found = run(&text, "s");
        assert_eq!(found.status, Status::Solved, "{gain:e}");
        nsd_tests::assert_near(&end(&found, "x"), &[1.0 + 0.5 * 1.0_f64.sin()], 1e-9);
    }
}

#[test]
fn forces_have_no_bound() {
    // One after the other, both bounds are met and held with forces F and 2 F.
    for force in [1e3, 1e9, 1e13, 1e17] {
        let text = format!(
            "model m {{ state x[2] = [1, 1]; x' = [-{force:e}; -2*{force:e}]; project x onto {{ x[1] >= 0; x[2] >= 0; }} }}
             simulate s of m {{ horizon {:e}; }}",
            2.0 / force
        );
        let found = run(&text, "s");
        assert_eq!(found.status, Status::Solved, "{force:e}");
        nsd_tests::assert_near(&end(&found, "x"), &[0.0, 0.0], 1e-12);
    }
}

#[test]
fn steps_of_time_begin_at_rest_and_end_on_ties() {
    // Friction holds until t = 1/2: v = (t - 1/2)² and x = (t - 1/2)³/3 behind that.
    for steps in [10, 100, 400, 1000] {
        let text = format!(
            "model m {{ state x = 0; state v = 0; x' = v; v' = 2*time - sign(v); }}
             simulate s of m {{ horizon 1; method timestepping {{ steps = {steps}; }} }}"
        );
        let found = run(&text, "s");
        assert_eq!(found.status, Status::Solved, "{steps}");
        let exact = [0.25, 1.0 / 24.0];
        let ends = [end(&found, "v"), end(&found, "x")].concat();
        nsd_tests::assert_near(&ends, &exact, 1e-10);
    }
    // A node is where z jumps, while x slides.
    for length in [1.0, 0.1, 5e-3, 1e-3] {
        let model = format!(
            "model m {{ param l = {length}; state x = 0; algebraic z = 0;
               0 = z + z^3/l^2 - x - l*sin(0.9*time)*step(time - 0.65); x' = -2*z - 0.3*l*sign(x + 0.1*l); }}"
        );
        let ends = ["", "method timestepping { steps = 1000; }"].map(|method| {
            let found = run(
                &format!("{model} simulate s of m {{ horizon 2.5; {method} }}"),
                "s",
            );
            assert_eq!(found.status, Status::Solved, "{length}, {method}");
            end(&found, "x")[0] / length
        });
        nsd_tests::assert_near(&ends[..1], &ends[1..], 1e-5);
    }
}
