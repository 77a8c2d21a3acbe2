//! Steps of time, at instants that are known, found as roots and moved by a parameter, inside of everything that may read
//! them: by events, by events with the parameter open, and by finite elements.

use nsd_tests::random::Random;
use nsdc::report::{Status, Trajectory};
use nsdc::{Options, Project};

/// What a model is made of, with a step where `STEP` stands.
const READERS: [&str; 8] = [
    "state x = 0.2; x' = STEP - 0.3*x;",
    "state x = 0.2; x' = -sign(x - STEP);",
    "state x = 0; algebraic z = 0; 0 = z + z^3 - 4*STEP; x' = z;",
    "state x = 0.2; algebraic z = 0; 0 <= z perp z + x - STEP >= 0; x' = z - 0.1*x;",
    "state x = 0.2; z in variational [-1, 1] solves z - 3*STEP; x' = z;",
    "state x = 0.2; z[2] in argmin (z[1] - STEP)^2 + (z[2] - 0.5)^2 subject to { z[1] + z[2] <= 0.7; } x' = z[1];",
    "state x = 0.2; switch h = hysteresis(STEP + 0.01*x, on = 0.3, off = 0.05, start = 0); x' = h - 0.2*x;",
    "state q[2] = [0, 0]; state v[2] = [0, 0]; state x = 0; q' = v; x' = v[1];
     mechanics q, v { mass = eye(2); force = [0, -10];
       contact floor { gap = q[2]; restitution = 0; friction = 0.1; slip = v[1] - STEP; } }",
];

const STEPS: [&str; 6] = [
    "(if time < p then 0 else 0.5)",
    "0.5*step(time^2 - p)",
    "0.5*step(sin(p*time))",
    "0.5*step(p*time - 1)",
    "0.5*step(exp(time) - 1 - p)",
    "0.5*step(time^2 - p)*step(2.2 - time^3/p)",
];

/// A run of the only experiment, where it is solved.
fn solved(text: &str) -> Option<Trajectory> {
    let run = Project::from_text("model.nsd", text).run("s", &Options::default(), &mut ());
    let run = run.ok()?.trajectory;
    (run.status == Status::Solved).then_some(run)
}

fn end(run: &Trajectory) -> f64 {
    let states = run.samples.states.iter();
    let mut x = states.filter(|series| series.name == "x");
    let x = x.next().expect("it has a state x");
    x.at(run.samples.time.len() - 1)[0]
}

#[test]
fn all_roads_read_steps_of_time_alike() {
    let mut random = Random(35);
    let (mut open, mut elements) = (0, 0);
    for round in 0..160 {
        let step = random.of(&STEPS);
        let digits = 10_f64.powi(1 + random.below(5) as i32);
        let p = (random.within(0.5, 3.0) * digits).round() / digits;
        let model = READERS[round % READERS.len()].replace("STEP", step);
        let text = |method: &str| {
            format!(
                "model m {{ param p = {p:?}; {model} }} simulate s of m {{ horizon 2.3; {method} }}"
            )
        };
        let by_events = solved(&text(""));
        let x = end(&by_events.unwrap_or_else(|| panic!("{}", text(""))));
        let roads = [
            (solved(&text("sensitivity to p;")), &mut open),
            (solved(&text("method fesd;")), &mut elements),
        ];
        for (run, count) in roads {
            let Some(run) = run else { continue };
            let other = end(&run);
            assert!((other - x).abs() <= 1e-5, "{other} {x}: {}", text(""));
            *count += 1;
        }
    }
    assert!(open >= 140 && elements >= 90, "{open} {elements}");
}

/// A sample that is a rounding earlier than a step of time reads all that follows from the step as it is behind it.
#[test]
fn samples_meet_steps_that_are_one_with_them() {
    for (period, count, step) in [
        ("0.3", 3, "0.9"),
        ("0.7", 3, "2.1"),
        ("0.7", 7, "4.9"),
        ("0.5", 3, "1.5"),
    ] {
        let horizon = period.parse::<f64>().expect("a number") * (f64::from(count) + 0.5);
        let text = format!(
            "model m {{ state x = 1; discrete d = 0; discrete e = 0; discrete k = 0;
               signal g = if time < {step} then 0 else 1;
               switch h = hysteresis(g, on = 0.5, off = 0.3, start = 0);
               switch b = step(g + 0.001*x - 0.5);
               x' = -x + h + b;
               jump j every {period} {{ d := d + h; e := e + b; k := k + g; }} }}
             simulate s of m {{ horizon {horizon:?}; }}"
        );
        let run = solved(&text).expect("it is solved");
        let at_end = |name: &str| {
            let states = run.samples.states.iter();
            let own = states.clone().find(|series| series.name == name);
            own.expect("it is a state").values.last().copied()
        };
        assert_eq!(
            ["d", "e", "k"].map(at_end),
            [Some(1.0); 3],
            "{period} {step}"
        );
    }
}
