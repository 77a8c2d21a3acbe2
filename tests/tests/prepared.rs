//! Experiments that are compiled once and run with other numbers, beside the same compiled with each.

use std::ops::ControlFlow;

use nsd_solver::event::{Event, Observer, Segment};
use nsd_solver::hybrid::Status;
use nsd_tests::{assert_near, end, run};
use nsdc::lowering::hybrid::Structural;
use nsdc::project::prepared::{NotPrepared, NotRun, Prepared};

struct Silent;

impl Observer for Silent {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {}
}

/// Ends a run behind its first step.
struct Stops;

impl Observer for Stops {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Break(())
    }

    fn event(&mut self, _: &Event) {}
}

fn prepared(text: &str, open: &[&str]) -> Result<Prepared, NotPrepared> {
    Prepared::from_text(text, "s", open)
}

/// Runs of `model` to the horizon with each of these values, prepared once and compiled for each.
fn both(model: &str, horizon: f64, names: &[&str], values: &[&[f64]], within: f64) {
    let settings = format!("horizon {horizon:?}; tolerance 1e-10;");
    both_with((model, &settings), horizon, names, values, within);
}

/// The same with these settings.
fn both_with(
    (model, settings): (&str, &str),
    horizon: f64,
    names: &[&str],
    values: &[&[f64]],
    within: f64,
) {
    let text = |with: &str| format!("{model}\nsimulate s of m {{ {settings} {with} }}");
    let prepared = prepared(&text(""), names).expect("it is prepared");
    let found: Vec<&str> = prepared
        .parameters()
        .iter()
        .map(|p| p.name.as_str())
        .collect();
    let mut wanted = names.to_vec();
    wanted.sort_unstable();
    let mut sorted = found.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, wanted);
    let mut runs = prepared.runs();
    for values in values {
        let place = |name: &&str| names.iter().position(|known| known == name);
        let ordered: Vec<f64> = (found.iter())
            .map(|name| values[place(name).expect("it is one of them")])
            .collect();
        let outcome = runs.run(&ordered, None, horizon, &mut Silent);
        let outcome = outcome.expect("the numbers are in range");
        assert_eq!(outcome.status, Status::Solved, "{model} {values:?}");
        let fresh = prepared.runs().run(&ordered, None, horizon, &mut Silent);
        let fresh = fresh.expect("the numbers are in range");
        assert_eq!(outcome.x, fresh.x, "{model} {values:?}");
        let with = names.iter().zip(*values);
        let with: String = with
            .map(|(name, value)| format!("{name} = {value:?};"))
            .collect();
        let compiled = run(&text(&format!("with {{ {with} }}")), "s");
        for (name, x) in prepared.states().iter().zip(&outcome.x) {
            let (name, entry) = match name.split_once('[') {
                Some((name, entry)) => (name, entry.trim_end_matches(']').parse().unwrap_or(1)),
                None => (name.as_str(), 1),
            };
            let exact = end(&compiled, name)[entry - 1];
            let error = (x - exact).abs();
            assert!(
                error <= within * (1.0 + exact.abs()),
                "{model} {values:?} {name}: {x}, {exact}"
            );
        }
    }
}

#[test]
fn what_follows_from_a_parameter_follows_in_every_run() {
    let derived = "model m { param p = 1.3; param q = 2*p; state y = p; y' = -q*y; }";
    both(derived, 1.0, &["p"], &[&[1.3], &[0.7], &[2.0]], 1e-9);
    let part = "model pt { param k = 1; state z = k; z' = -k*z; }
        model m { param p = 2; part a = pt { k = p^2; } state y = 0; y' = a.z - p*y; }";
    both(part, 1.0, &["p"], &[&[2.0], &[0.5]], 1e-9);
    let vector = "model m { param k[2] = [1, 3]; state x[2] = [1, 1]; x' = -k.*x; }";
    both(vector, 1.0, &["k[2]"], &[&[3.0], &[0.4]], 1e-9);
    let given = "model m { param p = 1; state y = 1; control u = p; y' = u - y; }";
    both(given, 1.0, &["p"], &[&[1.0], &[4.0]], 1e-9);
}

#[test]
fn surfaces_and_laws_follow() {
    let belt = "model m {
        param mu = 0.6; param k = 1; param speed = 0.3;
        state q = 0; state v = 0;
        q' = v; v' = -k*q - mu*sign(v - speed);
    }";
    let values: [&[f64]; 4] = [
        &[0.6, 1.0, 0.3],
        &[0.9, 1.5, 0.2],
        &[0.1, 2.0, 0.7],
        &[1.0, 1.0, 1.0],
    ];
    both(belt, 12.0, &["mu", "k", "speed"], &values, 1e-8);
    let ball = "model m {
        param g = 9.81; param e = 0.9; param floor = 0.1;
        state q = 0.5; state v = 0;
        q' = v; v' = -g;
        jump bounce when q <= floor and v < 0 { v := -e*v; }
    }";
    let values: [&[f64]; 3] = [&[9.81, 0.9, 0.1], &[3.0, 0.8, 0.2], &[9.0, 1.0, 0.05]];
    both(ball, 1.2, &["g", "e", "floor"], &values, 1e-9);
    let contact = "model m {
        param mu = 0.4; param e = 0.5;
        state q[2] = [0, 0.3]; state v[2] = [1.5, 0];
        q' = v;
        mechanics q, v { mass = 1; force = [0, -9.81]; contact floor { gap = q[2]; slip = v[1]; friction = mu; restitution = e; } }
    }";
    both(
        contact,
        0.9,
        &["mu", "e"],
        &[&[0.4, 0.5], &[0.2, 0.3], &[0.7, 0.1]],
        1e-8,
    );
}

/// A block on a belt, and what climbs a threshold that jumps with time.
const BELT: &str = "model m {
    param mu = 0.6; param speed = 0.3;
    state q = 0; state v = 0;
    q' = v; v' = -q - mu*sign(v - speed);
}";
const LED: &str = "model m {
    param k = 2; param t0 = 0.4; state x = 0;
    x' = if x > (if time > t0 then 0.7 else 0.5) then -1 else k;
}";

/// By finite elements: a switch, one of time that another contains, and a nonlinear one.
#[test]
fn finite_elements_take_other_numbers() {
    let hidden = "model m {
        param b = 1; state x = 0.9; state y = 0.05;
        switch s = sign(y) sliding nonlinear;
        x' = 2*s^2 - 1; y' = 2*s^2 - s - b*x;
    }";
    let adaptive = "tolerance 1e-10; method fesd;";
    let steps = "method fesd { steps = 40; }";
    for method in [adaptive, steps] {
        let settings = |horizon: f64| format!("horizon {horizon:?}; {method}");
        let within = if method == steps { 1e-5 } else { 1e-8 };
        let values: [&[f64]; 3] = [&[0.6, 0.3], &[0.2, 0.5], &[0.9, 0.1]];
        let names = ["mu", "speed"];
        both_with((BELT, &settings(4.0)), 4.0, &names, &values, within);
        let values: [&[f64]; 3] = [&[2.0], &[3.0], &[1.7]];
        both_with((LED, &settings(0.9)), 0.9, &["k"], &values, within);
        let values: [&[f64]; 3] = [&[1.0], &[1.1], &[0.9]];
        both_with((hidden, &settings(1.2)), 1.2, &["b"], &values, within);
    }
}

/// In steps of one length: without a switch, with friction, regions, a wall, and a threshold that jumps with time, whose
/// instants are data.
#[test]
fn steps_without_contacts_take_other_numbers() {
    let settings = "horizon 2; method timestepping { steps = 150; }";
    let both = |model: &str, names: &[&str], values: &[&[f64]]| {
        both_with((model, settings), 2.0, names, values, 1e-11);
    };
    let smooth = "model m { param p = 2; state x = 1/p; x' = -p*x + sin(p*time); }";
    both(smooth, &["p"], &[&[2.0], &[0.7], &[5.0]]);
    let values: [&[f64]; 3] = [&[0.6, 0.3], &[0.2, 0.5], &[0.9, 0.1]];
    both(BELT, &["mu", "speed"], &values);
    both(LED, &["k"], &[&[2.0], &[3.0], &[1.7]]);
    let values: [&[f64]; 3] = [&[1.0, 2.0], &[1.4, 0.5], &[0.3, 3.0]];
    both(TURNS, &["r", "w"], &values);
    let wall = "model m {
        param a = 3; param top = 0.5; state x = 0;
        project x onto { top - x >= 0; }
        x' = a*cos(a*time);
    }";
    both(
        wall,
        &["a", "top"],
        &[&[3.0, 0.5], &[4.0, 0.2], &[2.0, 0.9]],
    );
    let text = format!("{LED} simulate s of m {{ {settings} }}");
    let refused = prepared(&text, &["t0"]).expect_err("it moves an instant");
    let is_instant =
        matches!(&refused, NotPrepared::Structural(name, Structural::Instants) if name == "t0");
    assert!(is_instant, "{refused}");
}

/// A circle inside of which the rate is another one.
const TURNS: &str = "model m {
    param r = 1; param w = 2; state x[2] = [0.4, 0];
    region inside where norm(x) < r { x' = [1, w; -w, 1]*x; }
    region outside where norm(x) > r { x' = [1, -w; w, 1]*x; }
}";

/// Shorter runs of a schedule of time are those of the longer one.
#[test]
fn threads_share_steps_without_contacts() {
    let steps = "method timestepping { steps = 120; }";
    let text = format!("{LED} simulate s of m {{ horizon 1.5; {steps} }}");
    let prepared = prepared(&text, &["k"]).expect("it is prepared");
    let check = |numbers: &[[f64; 3]]| {
        let mut own = prepared.runs();
        for &[k, x, horizon] in numbers {
            let found = own.run(&[k], Some(&[x]), horizon, &mut Silent);
            let with = format!("with {{ k = {k:?}; x = {x:?}; }}");
            let fresh = format!("{LED} simulate s of m {{ horizon {horizon:?}; {steps} {with} }}");
            let exact = end(&run(&fresh, "s"), "x");
            assert_near(&found.expect("the numbers are in range").x, &exact, 1e-11);
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(|| check(&[[2.0, 0.1, 1.5], [1.0, 0.3, 0.35], [3.0, 0.0, 0.9]]));
        scope.spawn(|| check(&[[0.5, 0.6, 1.2], [4.0, 0.8, 0.5]]));
    });
}

/// Steps of an adaptive method that looks for no switch, and a state that is kicked.
#[test]
fn adaptive_steps_and_kicks_take_other_numbers() {
    let values: [&[f64]; 3] = [&[2.0], &[3.0], &[1.7]];
    let settings = "horizon 0.9; method adaptive;";
    let passes = LED.replace("then -1", "then 0.5");
    both_with((&passes, settings), 0.9, &["k"], &values, 1e-11);
    let smooth = "model m { param p = 2; state x = 1/p; x' = -p*x + sin(p*time); }";
    let values: [&[f64]; 3] = [&[2.0], &[0.7], &[5.0]];
    both_with((smooth, settings), 0.9, &["p"], &values, 1e-11);
    let settings = "horizon 0.9; tolerance 1e-10; perturb every 0.2 by gauss(0.1) seed 3;";
    both_with((smooth, settings), 0.9, &["p"], &values, 1e-9);
    let refused = prepared(
        &format!("{LED} simulate s of m {{ horizon 1; method adaptive; }}"),
        &["t0"],
    );
    let refused = refused.expect_err("it moves an instant");
    assert!(
        matches!(refused, NotPrepared::Structural(_, Structural::Instants)),
        "{refused}"
    );
}

/// Steep functions in place of switches.
#[test]
fn smoothed_switches_take_other_numbers() {
    let settings = "horizon 4; tolerance 1e-10; method smoothing { epsilon = 1e-2; }";
    let values: [&[f64]; 3] = [&[0.6, 0.3], &[0.2, 0.5], &[0.9, 0.1]];
    both_with((BELT, settings), 4.0, &["mu", "speed"], &values, 1e-8);
}

/// Regions with names, and those of the smallest indicator: by elements and in steps.
#[test]
fn named_regions_take_other_numbers() {
    let quadrants = "model m {
        param a = 1; param b = 0.5; state x[2] = [0, 0];
        region one where x[1] < a and x[2] < b { x' = [1, 0.3]; }
        region two where x[1] > a and x[2] < b { x' = [0.5, 1]; }
        region three where x[1] < a and x[2] > b { x' = [1, -1]; }
        region four where x[1] > a and x[2] > b { x' = [0.3, -0.5]; }
    }";
    let nearest = "model m {
        param a = 1; param b = 1.5; state x[2] = [0, 0.2];
        region left indicator x[1]^2 + x[2]^2 { x' = [1, 0.1]; }
        region right indicator (x[1] - a)^2 + x[2]^2 { x' = [0.4, 1]; }
        region top indicator x[1]^2 + (x[2] - b)^2 { x' = [0.2, -0.3]; }
    }";
    let values: [&[f64]; 3] = [&[1.0, 0.5], &[0.3, 0.9], &[0.8, 0.4]];
    for method in [
        "method fesd { steps = 20; }",
        "method timestepping { steps = 100; }",
    ] {
        let settings = format!("horizon 1.5; {method}");
        both_with((quadrants, &settings), 1.5, &["a", "b"], &values, 1e-11);
    }
    for method in [
        "method fesd { steps = 20; }",
        "method timestepping { steps = 100; }",
    ] {
        let settings = format!("horizon 1.5; {method}");
        let values: [&[f64]; 3] = [&[1.0, 1.5], &[0.6, 1.1], &[1.4, 0.8]];
        both_with((nearest, &settings), 1.5, &["a", "b"], &values, 1e-11);
    }
}

/// Which sides of two thresholds occur together is for the range of one to say; without names there are products of all
/// sides, in whatever order the thresholds are.
#[test]
fn thresholds_that_may_change_places_are_refused() {
    let settings = "horizon 1.5; method fesd { steps = 12; }";
    let named = |range: &str| {
        format!(
            "model m {{
                param low {range} = 1; param k = 1; state x = 0;
                region a where x < low {{ x' = 3*k; }}
                region b where x > low and x < 2 {{ x' = 2*k; }}
                region c where x > low and x > 2 {{ x' = k; }}
            }}"
        )
    };
    let text = format!("{} simulate s of m {{ {settings} }}", named(""));
    let refused = prepared(&text, &["k", "low"]).expect_err("low may be above 2");
    let is_low =
        matches!(&refused, NotPrepared::Structural(name, Structural::Regions) if name == "low");
    assert!(is_low, "{refused}");
    let values: [&[f64]; 3] = [&[1.0, 1.0], &[1.3, 0.5], &[1.1, 1.8]];
    let within = named("in [0.2, 1.9]");
    both_with((&within, settings), 1.5, &["k", "low"], &values, 1e-11);
    let nested = "model m {
        param low = 1; state x = 0;
        x' = if x > low then (if x > 2 then 1 else 2) else 3;
    }";
    let text = format!("{nested} simulate s of m {{ {settings} }}");
    let prepared = prepared(&text, &["low"]).expect("all sides have a product");
    for low in [1.0_f64, 0.5, 2.5] {
        let found = prepared.runs().run(&[low], None, 1.5, &mut Silent);
        let found = found.expect("it is in range");
        let (first, second) = (low / 3.0, (2.0 - low).max(0.0) / 2.0);
        assert_near(&found.x, &[low.max(2.0) + 1.5 - first - second], 1e-9);
    }
}

/// A ball that bounces, one that slips and comes to rest, and a block in a plane that turns round, by finite elements with
/// jumps between them.
#[test]
fn finite_elements_with_contacts_take_other_numbers() {
    let bounces = "model m {
        param g = 9.81; param e = 0.5; param h = 1; state q = h; state v = 0;
        q' = v;
        mechanics q, v { mass = 1; force = -g; contact floor { gap = q; restitution = e; } }
    }";
    let settings = "horizon 0.7; lower impact; method fesd { steps = 6; elements = 3; }";
    let values: [&[f64]; 3] = [&[9.81, 0.5, 1.0], &[9.0, 0.4, 1.0], &[8.0, 0.6, 0.8]];
    both_with((bounces, settings), 0.7, &["g", "e", "h"], &values, 1e-11);
    let thrown = "model m {
        param mu = 0.6; param u = 2; param floor = 0.1;
        state q[2] = [0, 0.5]; state v[2] = [u, 0];
        q' = v;
        mechanics q, v {
            mass = eye(2); force = [0, -9.81];
            contact ground { gap = q[2] - floor; slip = v[1]; restitution = 0; friction = mu; }
        }
    }";
    let settings = "horizon 1.2; lower impact;
        method fesd { scheme = radau_iia(3); steps = 6; elements = 3; }";
    let values: [&[f64]; 3] = [&[0.6, 2.0, 0.1], &[0.3, 1.5, 0.2], &[0.9, 3.0, 0.05]];
    let names = ["mu", "u", "floor"];
    both_with((thrown, settings), 1.2, &names, &values, 1e-11);
    let pushed = "model m {
        param mu = 0.2; param push = 3;
        state q[3] = [0, 0, 0]; state v[3] = [0.6, 0.8, 0];
        q' = v;
        mechanics q, v {
            mass = eye(3); force = [-0.6*push, -0.8*push, -10];
            contact ground { gap = q[3]; slip = [v[1], v[2]]; restitution = 0; friction = mu; }
        }
    }";
    let settings = "horizon 1; lower impact;
        method fesd { scheme = radau_iia(3); steps = 5; elements = 3; }";
    let values: [&[f64]; 3] = [&[0.2, 3.0], &[0.1, 3.0], &[0.15, 2.5]];
    both_with((pushed, settings), 1.0, &["mu", "push"], &values, 1e-11);
}

/// From q = h the ball falls √(2h/g), and its bounce has e of its speed.
#[test]
fn threads_share_contacts_by_finite_elements() {
    let runs = [
        [9.81, 0.5, 1.0, 0.7],
        [9.0, 0.6, 0.8, 0.8],
        [8.0, 0.7, 1.0, 0.9],
        [12.0, 0.5, 0.9, 0.6],
    ];
    let settings = "lower impact; method fesd { steps = 6; elements = 2; }";
    shares(settings, 0.0, runs, |[g, e, h, horizon]| {
        let fall = f64::sqrt(2.0 * h / g);
        let (s, speed) = (horizon - fall, e * g * fall);
        [s * (speed - 0.5 * g * s), speed - g * s]
    });
}

/// Infinitely many bounces in no time, by elements as from event to event.
#[test]
fn contacts_by_finite_elements_say_why_they_end() {
    let text = "model m {
        param e = 0.5; state q = 1; state v = 0;
        q' = v;
        mechanics q, v { mass = 1; force = -10; contact floor { gap = q; restitution = e; } }
    }
    simulate s of m { horizon 2; lower impact; method fesd { steps = 20; elements = 3; } }";
    let prepared = prepared(text, &["e"]).expect("it is prepared");
    let outcome = prepared.runs().run(&[0.5], None, 2.0, &mut Silent);
    let outcome = outcome.expect("the numbers are in range");
    // The bounces take e, e², .. of twice the fall each: √0.2 (1 + 2 e/(1 - e)) in all, in the 14th step.
    assert_eq!(outcome.status, Status::Accumulation);
    assert!((outcome.time - 1.3).abs() <= 1e-12, "{}", outcome.time);
    let beyond = prepared.runs().run(&[1.5], None, 2.0, &mut Silent);
    let beyond = beyond.expect("the run looks at laws where contacts strike");
    assert!(
        matches!(beyond.status, Status::Coefficient { .. }),
        "{:?}",
        beyond.status
    );
    let stopped = prepared.runs().run(&[0.5], None, 2.0, &mut Stops);
    let stopped = stopped.expect("the numbers are in range");
    assert_eq!(stopped.status, Status::Stopped);
    assert!(stopped.time < 2.0);
}

/// A block that is thrown and comes to rest, and a stack of two: forces, masses, laws, and a floor that moves.
const THROWN: &str = "model m {
    param m = 2; param g = 9.81; param mu = 0.4; param e = 0.5; param h = 0.1; param w = 3;
    state q[2] = [0, 0.4]; state v[2] = [1.5, 0];
    q' = v;
    mechanics q, v {
        mass = m*eye(2); force = [0.5, -m*g];
        contact floor { gap = q[2] - h*sin(w*time); slip = v[1]; friction = mu; restitution = e; }
    }
}";
const STACK: &str = "model m {
    param r = 0.3; param heavy = 5; param e = 0.2;
    state a = 0.4; state b = 1.5; state u = 0; state v = -1;
    a' = u; b' = v;
    mechanics a, u { mass = heavy*r; force = -10*heavy; contact floor { gap = a - r; restitution = e; } }
    mechanics b, v { mass = 1; force = -10; contact upper { gap = b - a - 2*r; restitution = 0; } }
}";

#[test]
fn steps_through_contacts_take_other_numbers() {
    let settings = "horizon 1; method timestepping { steps = 300; }";
    let values: [&[f64]; 3] = [
        &[2.0, 9.81, 0.4, 0.5, 0.1, 3.0],
        &[0.5, 3.0, 0.2, 0.3, 0.2, 7.0],
        &[9.0, 20.0, 0.9, 1.0, 0.05, 2.0],
    ];
    let names = ["m", "g", "mu", "e", "h", "w"];
    both_with((THROWN, settings), 1.0, &names, &values, 1e-11);
    let values: [&[f64]; 3] = [&[0.3, 5.0, 0.2], &[0.35, 1.0, 0.7], &[0.25, 9.0, 1.0]];
    let names = ["r", "heavy", "e"];
    both_with((STACK, settings), 1.0, &names, &values, 1e-11);
}

/// On two threads, a ball with other numbers g and e, from other heights h with the speed v, and to other horizons.
fn shares(
    settings: &str,
    v: f64,
    runs: [[f64; 4]; 4],
    exact: impl Fn([f64; 4]) -> [f64; 2] + Sync,
) {
    let text = format!("{BOUNCES} simulate s of m {{ horizon 1; {settings} }}");
    let prepared = prepared(&text, &["g", "e"]).expect("it is prepared");
    let check = |runs: &[[f64; 4]]| {
        let mut own = prepared.runs();
        for &[g, e, h, horizon] in runs {
            let found = own.run(&[g, e], Some(&[h, v]), horizon, &mut Silent);
            let found = found.expect("the numbers are in range");
            assert_eq!(found.status, Status::Solved);
            assert_near(&found.x, &exact([g, e, h, horizon]), 1e-11);
        }
    };
    let (first, second) = runs.split_at(2);
    std::thread::scope(|scope| {
        scope.spawn(|| check(first));
        scope.spawn(|| check(second));
    });
}

const BOUNCES: &str = "model m {
    param g = 9.81; param e = 0.5; state q = 1; state v = 0;
    q' = v;
    mechanics q, v { mass = 1; force = -g; contact floor { gap = q; restitution = e; } }
}";

#[test]
fn threads_share_steps_through_contacts() {
    let runs = [
        [9.81, 0.5, 1.0, 0.7],
        [9.0, 0.6, 0.8, 1.0],
        [20.0, 0.1, 0.3, 0.9],
        [12.0, 1.0, 0.9, 0.6],
    ];
    let steps = "method timestepping { steps = 250; }";
    shares(steps, -1.0, runs, |[g, e, h, horizon]| {
        let with = format!("with {{ g = {g:?}; e = {e:?}; q = {h:?}; v = -1; }}");
        let fresh = format!("{BOUNCES} simulate s of m {{ horizon {horizon:?}; {steps} {with} }}");
        let fresh = run(&fresh, "s");
        ["q", "v"].map(|name| end(&fresh, name)[0])
    });
}

/// While a clock stands still: a ball that bounces, one that slips in a plane as it does, a block that slips and comes to
/// rest, and a heater with memory, from event to event and by elements. Strengths and paces follow from the numbers of a
/// run.
#[test]
fn frozen_runs_take_other_numbers() {
    let thrown = "model m {
        param mu = 0.6; param u = 2; param floor = 0.1;
        state q[2] = [0, 0.5]; state v[2] = [u, 0];
        q' = v;
        mechanics q, v {
            mass = eye(2); force = [0, -9.81];
            contact ground { gap = q[2] - floor; slip = v[1]; restitution = 0; friction = mu; }
        }
    }";
    let in_space = "model m {
        param mu = 0.2; param e = 0.5; param u = 2;
        state q[3] = [0, 0, 1]; state v[3] = [u, 1, 0];
        q' = v;
        mechanics q, v {
            mass = eye(3); force = [0, 0, -10];
            contact floor { gap = q[3]; slip = [v[1], v[2]]; restitution = e; friction = mu; }
        }
    }";
    let heater = "model m {
        param power = 3; param loss = 1; param start = 0.5;
        state y = start;
        switch heats = hysteresis(y, on = 0.3, off = 1, start = 1);
        y' = power*heats - loss;
    }";
    for method in ["tolerance 1e-10;", "method fesd { steps = 20; }"] {
        let both = |model: &str, horizon: f64, names: &[&str], values: &[&[f64]]| {
            let settings = format!("horizon {horizon:?}; lower timefreezing; {method}");
            both_with((model, &settings), horizon, names, values, 1e-9);
        };
        let values: [&[f64]; 3] = [&[9.81, 0.5], &[9.0, 0.4], &[4.0, 0.9]];
        both(BOUNCES, 0.8, &["g", "e"], &values);
        let values: [&[f64]; 3] = [&[0.6, 2.0, 0.1], &[0.3, 1.5, 0.2], &[0.9, 3.0, 0.05]];
        both(thrown, 0.8, &["mu", "u", "floor"], &values);
        let values: [&[f64]; 3] = [&[0.2, 0.5, 2.0], &[0.1, 0.4, 1.0], &[0.3, 0.6, 3.0]];
        both(in_space, 0.8, &["mu", "e", "u"], &values);
        let values: [&[f64]; 3] = [&[3.0, 1.0, 0.5], &[2.0, 0.5, 1.2], &[4.0, 2.0, 0.1]];
        both(heater, 1.5, &["power", "loss", "start"], &values);
    }
}

#[test]
fn threads_share_frozen_runs() {
    let runs = [
        [9.81, 0.5, 1.0, 0.7],
        [9.0, 0.6, 0.8, 1.0],
        [20.0, 0.3, 0.7, 0.4],
        [12.0, 0.9, 0.9, 0.6],
    ];
    for method in ["tolerance 1e-10;", "method fesd { steps = 20; }"] {
        let settings = format!("lower timefreezing; {method}");
        shares(&settings, -1.0, runs, |[g, e, h, horizon]| {
            let with = format!("with {{ g = {g:?}; e = {e:?}; q = {h:?}; v = -1; }}");
            let text =
                format!("{BOUNCES} simulate s of m {{ horizon {horizon:?}; {settings} {with} }}");
            let fresh = run(&text, "s");
            ["q", "v"].map(|name| end(&fresh, name)[0])
        });
    }
}

/// A ball below the floor, one that gains by its bounces, and bounces that accumulate.
#[test]
fn frozen_runs_say_why_they_end() {
    let text = format!("{BOUNCES} simulate s of m {{ horizon 2; lower timefreezing; }}");
    let prepared = prepared(&text, &["g", "e"]).expect("it is prepared");
    let status = |numbers: &[f64], q: f64| {
        let outcome = prepared
            .runs()
            .run(numbers, Some(&[q, 0.0]), 2.0, &mut Silent);
        outcome.expect("the numbers are in range").status
    };
    assert_eq!(status(&[9.81, 0.5], -0.1), Status::Penetrates { switch: 0 });
    let beyond = status(&[9.81, 1.5], 1.0);
    let is_beyond = matches!(beyond, Status::Coefficient { switch: 0, value, .. } if value == 1.5);
    assert!(is_beyond, "{beyond:?}");
    assert_eq!(status(&[9.81, 0.5], 1.0), Status::Accumulation);
}

/// Whether there is a bounce at all, and the thresholds of a memory, are compiled in.
#[test]
fn what_is_frozen_for_one_value_is_refused() {
    let soft = "model m {
        param p = 0.4; param g = 9.81; state q = 1; state v = 0;
        q' = v;
        mechanics q, v { mass = 1; force = -g; contact floor { gap = q; restitution = 1 - p; } }
    } simulate s of m { horizon 1; lower timefreezing; }";
    let refused = prepared(soft, &["g", "p"]).expect_err("1 - p may be zero");
    let is_p = matches!(&refused, NotPrepared::Structural(name, Structural::Frozen) if name == "p");
    assert!(is_p, "{refused}");
    for lowering in ["", "lower timefreezing;"] {
        let heater = format!(
            "model m {{
                param low = 0.3; state y = 0.5;
                switch heats = hysteresis(y, on = low, off = 1, start = 1);
                y' = 3*heats - 1;
            }} simulate s of m {{ horizon 1; {lowering} }}"
        );
        let refused = prepared(&heater, &["low"]).expect_err("thresholds are numbers");
        assert!(refused.to_string().contains("low"), "{refused}");
    }
}

/// With k = 1 the two branches happen to meet: with another k the state slides, or jumps away.
#[test]
fn what_is_continuous_by_chance_is_not_taken_for_granted() {
    let model = "model m { param k = 1; state x = 0; x' = if x > 1 then 2 - k else 1; }";
    both(model, 2.0, &["k"], &[&[1.0], &[3.0], &[1.5]], 1e-9);
}

/// A narrow function of time, which no parameter moves, and one that a parameter may move.
#[test]
fn no_run_passes_over_what_is_narrow() {
    let text = |of: &str| {
        format!(
            "model m {{ param a = 2; param t0 = 5.3; state y = 0; y' = a*exp(-((time - {of})/0.001)^2); }}
             simulate s of m {{ horizon 10; }}"
        )
    };
    let prepared = prepared(&text("5.3"), &["a"]).expect("it is prepared");
    let mut runs = prepared.runs();
    for a in [2.0, 7.0] {
        let outcome = runs.run(&[a], None, 10.0, &mut Silent);
        let outcome = outcome.expect("the numbers are in range");
        let exact = a * 0.001 * std::f64::consts::PI.sqrt();
        assert!((outcome.x[0] - exact).abs() <= 1e-9, "{}", outcome.x[0]);
    }
    let refused = self::prepared(&text("t0"), &["t0"]).expect_err("it is refused");
    assert!(matches!(refused, NotPrepared::Structural(name, Structural::Narrow) if name == "t0"));
    let forced =
        "model m { param w = 3; state y = 0; y' = sin(w*time)^2; } simulate s of m { horizon 1; }";
    assert!(self::prepared(forced, &["w"]).is_ok());
}

#[test]
fn what_cannot_stay_open_is_refused() {
    let refused = |text: &str, open: &[&str]| prepared(text, open).expect_err("it is refused");
    let model =
        "model m { param p = 2; param n = 1.5; param z = 0; state x = 1; x' = -x^n + z - p; }";
    let plain = format!("{model} simulate s of m {{ horizon 1; }}");
    assert!(
        matches!(refused(&plain, &["n"]), NotPrepared::Structural(name, Structural::Exponent) if name == "n")
    );
    assert!(
        matches!(refused(&plain, &["z"]), NotPrepared::Structural(name, Structural::Zero) if name == "z")
    );
    let optimal = "model m { param p = 2; state x = 1; control u in [-1, 1]; x' = u - p; }
        optimize s of m { horizon 1; intervals 2; minimize final(x); }";
    assert!(matches!(
        refused(optimal, &["p"]),
        NotPrepared::Optimal(name) if name == "s"
    ));
    let horizon = format!("{model} simulate s of m {{ horizon p; }}");
    let NotPrepared::NotCompiled(diags) = refused(&horizon, &["p"]) else {
        panic!("the horizon depends on p");
    };
    assert_eq!(diags.codes(), ["E0527"]);
    // Names that are none, and what is no parameter.
    for (open, code) in [("pp", "E0101"), ("x", "E0517"), ("p[2]", "E0")] {
        let error = refused(&plain, &[open]);
        assert!(
            matches!(error, NotPrepared::NotCompiled(_)),
            "{open}: {error}"
        );
        assert!(error.to_string().contains(code), "{open}: {error}");
    }
    for open in ["", "p; q", "2"] {
        let error = refused(&plain, &[open]);
        assert!(
            matches!(error, NotPrepared::NoParameter(_)),
            "{open}: {error}"
        );
    }
    let other = Prepared::from_text(&plain, "t", &["p"]).expect_err("there is none");
    assert!(matches!(other, NotPrepared::NotAsked(_)), "{other}");
}

/// Numbers that a compilation would refuse, or make another system of.
#[test]
fn numbers_outside_of_what_was_prepared_are_refused() {
    let text = "model m { param p in [-3, -0.5] = -1; state x = 1; x' = p*x + (if p*x > -1 then 1 else 0); }
                simulate s of m { horizon 1; }";
    let prepared = prepared(text, &["p"]).expect("it is prepared");
    assert_eq!(prepared.parameters()[0].range, [-3.0, -0.5]);
    let mut runs = prepared.runs();
    for value in [-4.0, -0.4, 0.0, 1.0, f64::NAN, f64::NEG_INFINITY] {
        let refused = runs.run(&[value], None, 1.0, &mut Silent);
        assert!(matches!(refused, Err(NotRun::Range { .. })), "{value}");
    }
    for (parameters, x0) in [
        (&[][..], None),
        (&[-1.0, -1.0], None),
        (&[-1.0], Some(&[][..])),
    ] {
        let refused = runs.run(parameters, x0, 1.0, &mut Silent);
        assert!(matches!(refused, Err(NotRun::Count { .. })));
    }
    for horizon in [1.1, 0.0, -1.0, f64::NAN] {
        let refused = runs.run(&[-1.0], None, horizon, &mut Silent);
        assert!(matches!(refused, Err(NotRun::Horizon { .. })), "{horizon}");
    }
    let refused = runs.run(&[-1.0], Some(&[f64::INFINITY]), 1.0, &mut Silent);
    assert!(matches!(refused, Err(NotRun::Start { .. })));
    assert!(runs.run(&[-0.5], Some(&[2.0]), 0.5, &mut Silent).is_ok());
}

/// A range that follows from what is open, or a set, would not be looked at in a run.
#[test]
fn ranges_that_move_are_refused() {
    let models = [
        "param p = 1; param q in [0, 3] = 2*p; state x = 1; x' = -q*x;",
        "param p = 1; param q in [0, 3*p] = 2; state x = 1; x' = -q*x;",
        "param p in {1, 2} = 1; state x = 1; x' = -p*x;",
    ];
    for model in models {
        let text = format!("model m {{ {model} }} simulate s of m {{ horizon 1; }}");
        let refused = prepared(&text, &["p"]).expect_err("it is refused");
        let is_range = matches!(refused, NotPrepared::Structural(_, Structural::Range));
        assert!(is_range, "{model}: {refused}");
    }
}

#[test]
fn no_run_has_the_units_of_the_one_before() {
    let model = "model m { param l = 1; state x = 1; state y = 0.5; x' = 0.2*y - l*sign(x); y' = -x - 0.4*l*sign(y + 0.3*l); }";
    for method in ["fesd", "timestepping"] {
        let text = format!("{model} simulate s of m {{ horizon 2; method {method}; }}");
        let prepared = prepared(&text, &["l"]).expect("it is prepared");
        let starts = [1e-6, 0.01, 1.0, 3e-5, 40.0].map(|size| [size, 0.5 * size]);
        let alone = starts.map(|x0| {
            let run = prepared.runs().run(&[x0[0]], Some(&x0), 2.0, &mut Silent);
            run.expect("it runs").x
        });
        let mut runner = prepared.runs();
        for at in [0, 1, 2, 3, 1, 4, 0, 2] {
            let x0 = starts[at];
            let found = runner.run(&[x0[0]], Some(&x0), 2.0, &mut Silent);
            assert_eq!(found.expect("it runs").x, alone[at], "{method}, {x0:?}");
        }
    }
}
