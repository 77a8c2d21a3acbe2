//! Optimal control problems that are compiled once and solved with other parameters and from other initial states, beside
//! the same problems compiled for each of them, and closed forms.

use nsdc::expr::Exprs;
use nsdc::limit::Limit;
use nsdc::optimize::{PrepareError, Prepared, SolveError, Solved};
use nsdc::report::{Confirmation, EventKind, Series, Status, Trajectory};
use nsdc::{Options, Project};

use nsd_tests::{agrees, larger, times};

fn prepared<'e>(exprs: &'e Exprs, text: &str) -> (Project, Prepared<'e>) {
    let project = Project::from_text("test.nsd", text);
    let prepared = project.prepare_optimal(exprs, "o", &[], &[]);
    (project, prepared.expect("it has a program"))
}

#[track_caller]
fn solve<'e>(prepared: &mut Prepared<'e>, x0: &[f64], from: Option<&Solved<'e>>) -> Solved<'e> {
    solve_with(prepared, &[], Some(x0), from)
}

#[track_caller]
fn solve_with<'e>(
    prepared: &mut Prepared<'e>,
    parameters: &[f64],
    x0: Option<&[f64]>,
    from: Option<&Solved<'e>>,
) -> Solved<'e> {
    let solved = prepared.solve(parameters, x0, from, &Limit::default(), &mut ());
    let solved = solved.expect("the model begins there");
    let found = &solved.trajectory;
    assert_eq!(
        found.status,
        Status::Solved,
        "{parameters:?}, {x0:?}\n{}",
        prepared.messages(&solved)
    );
    found.verify().expect("the invariants of `Trajectory`");
    solved
}

fn objective(found: &Trajectory) -> f64 {
    found.objective.expect("an optimum has an objective")
}

/// The experiment compiled for some values.
fn fresh(project: &Project, names: &[String], x0: &[f64]) -> Trajectory {
    let options = Options {
        values: names.iter().cloned().zip(x0.iter().copied()).collect(),
        // As those of what is prepared.
        ends_alone: true,
        ..Options::default()
    };
    let run = project.run("o", &options, &mut ()).expect("it compiles");
    assert_eq!(run.trajectory.status, Status::Solved, "{}", run.messages());
    run.trajectory
}

fn differ(one: &[Series], other: &[Series]) -> f64 {
    let pairs = one.iter().zip(other).flat_map(|(a, b)| {
        assert_eq!(
            (a.name.as_str(), a.values.len()),
            (b.name.as_str(), b.values.len())
        );
        a.values.iter().zip(&b.values)
    });
    pairs.fold(0.0, |most, (a, b)| larger(most, (a - b).abs()))
}

/// Solves from one state after the other, each from the solution before, without a new expression, as if the problem
/// were compiled for each.
#[track_caller]
fn as_compiled(text: &str, states: &[&[f64]], [cost, controls]: [f64; 2]) -> Vec<Trajectory> {
    let exprs = Exprs::new();
    let (project, mut prepared) = prepared(&exprs, text);
    let names = prepared.states().to_vec();
    let mut last: Option<Solved> = None;
    let (mut all, mut nodes) = (Vec::new(), None);
    for x0 in states {
        let solved = solve(&mut prepared, x0, last.as_ref());
        assert_eq!(
            *nodes.get_or_insert(exprs.n_nodes()),
            exprs.n_nodes(),
            "{x0:?}: it compiles"
        );
        let (found, other) = (&solved.trajectory, fresh(&project, &names, x0));
        let apart = objective(found) - objective(&other);
        assert!(
            apart.abs() <= cost,
            "{x0:?}: the objective is off by {apart:e}"
        );
        let apart = differ(&found.samples.controls, &other.samples.controls);
        assert!(apart <= controls, "{x0:?}: controls are off by {apart:e}");
        let confirmed = |found: &Trajectory| found.optimum.as_ref().map(|o| o.confirmation);
        assert_eq!(confirmed(found), confirmed(&other), "{x0:?}");
        assert_eq!(
            found.quality.certificate.stationarity, other.quality.certificate.stationarity,
            "{x0:?}"
        );
        all.push(solved.trajectory.clone());
        last = Some(solved);
    }
    all
}

fn sliding() -> String {
    let text = include_str!("../../examples/sliding_ocp.nsd");
    text.replace("optimize reach", "optimize o")
}

#[test]
fn sliding_modes_are_found_from_neighbouring_states() {
    use std::f64::consts::PI;
    let (q1, q2) = (2.0 * PI / 3.0, PI / 3.0);
    let states: [&[f64]; 5] = [
        &[q1, q2, 0.0, 0.0],
        &[q1 + 0.05, q2 - 0.03, 0.1, -0.1],
        &[q1 - 0.05, q2, 0.0, 0.1],
        &[2.0, 1.1, -0.1, 0.0],
        &[q1, q2, 0.0, 0.0],
    ];
    // Elements of other branches lie otherwise, and their optima differ by errors of discretization.
    let found = as_compiled(&sliding(), &states, [1e-5, 1e-2]);
    for one in &found {
        agrees(one, 1e-6);
    }
}

/// x' = 3 below zero and 1 above, from a start that is free, and beside it y, which is given: ∫ u² from y to zero is y².
#[test]
fn a_free_start_stays_free() {
    let text = "model crossing { state x in [-5, 5] = -1; state y = 1; control u in [-9, 9]; x' = 2 - sign(x); y' = u; }
        optimize o of crossing {
          horizon 2; intervals 2; elements 4; scheme radau_iia(3);
          initial { x free; }
          minimize integral(x^2 + 2*u^2) + final((x - 5/3)^2);
          final { y = 0; }
        }";
    let states: [&[f64]; 5] = [&[1.0], &[0.5], &[0.0], &[-0.5], &[1.0]];
    let found = as_compiled(text, &states, [1e-8, 1e-6]);
    for (one, y) in found.iter().zip(states) {
        let exact = 1.523772775374957 + y[0] * y[0];
        assert!(
            (objective(one) - exact).abs() < 1e-8,
            "{y:?}: {}",
            objective(one)
        );
        assert_eq!(
            one.optimum.as_ref().map(|o| o.confirmation),
            Some(Confirmation::Confirmed)
        );
    }
}

/// A ball that bounces by itself, and is pushed along the floor from y with w to 1 in T = 0.8: with u_k over h and
/// a_k = T - (k - 1/2) h, the sum of h u_k a_k is D = 1 - y - w T, and the least ∫ u² is D² / Σ h a_k².
#[test]
fn a_ball_bounces_from_other_heights() {
    let text = "model ball {
          state q[2] = [0, 0.5]; state v[2] = [0, 0];
          control u in [-50, 50] = 0;
          q' = v;
          mechanics q, v {
            mass = eye(2); force = [u, -10];
            contact floor { gap = q[2]; restitution = 0.5; }
          }
        }
        optimize o of ball {
          horizon 0.8; intervals 4; elements 3; scheme radau_iia(2);
          lower impact;
          minimize integral(u^2);
          final { q[1] = 1; }
        }";
    let states: [&[f64]; 5] = [
        &[0.0, 0.5, 0.0, 0.0],
        &[0.1, 0.45, 0.5, 0.0],
        &[-0.1, 0.55, -0.5, 0.2],
        &[0.0, 0.5, 0.0, -0.2],
        &[0.0, 0.5, 0.0, 0.0],
    ];
    let found = as_compiled(text, &states, [1e-7, 1e-5]);
    for (one, x0) in found.iter().zip(states) {
        let &[y, height, w, speed] = x0 else {
            panic!("four states")
        };
        let arms = [0.7, 0.5, 0.3, 0.1_f64].map(|a| 0.2 * a * a);
        let exact = (1.0 - y - 0.8 * w).powi(2) / arms.iter().sum::<f64>();
        assert!(
            (objective(one) - exact).abs() < 1e-6,
            "{x0:?}: {}",
            objective(one)
        );
        let strikes = (speed + (speed * speed + 20.0 * height).sqrt()) / 10.0;
        assert!(
            (times(one, EventKind::Jump)[0] - strikes).abs() < 1e-6,
            "{x0:?}"
        );
    }
}

#[test]
fn the_horizon_stays_free() {
    let text = include_str!("../../examples/turbo_car.nsd");
    let text = text.replace("optimize hurry", "optimize o");
    let states: [&[f64]; 5] = [
        &[0.0, 0.0],
        &[5.0, 1.0],
        &[-5.0, -1.0],
        &[0.0, 2.0],
        &[0.0, 0.0],
    ];
    let found = as_compiled(&text, &states, [1e-6, 1e-2]);
    for place in [0, 4] {
        let time = objective(&found[place]);
        assert!((time - 40.0 / 3.0).abs() < 1e-6, "{time}");
    }
}

#[test]
fn another_state_compiles_nothing() {
    let exprs = Exprs::new();
    let (_, mut prepared) = prepared(&exprs, &sliding());
    let start = prepared.initial(&[]).expect("it has no parameters");
    let mut last = solve(&mut prepared, &start, None);
    let (nodes, mut made) = (exprs.n_nodes(), Vec::new());
    for shift in [0.02, -0.02, 0.04] {
        let x0 = [start[0] + shift, start[1] - shift, shift, 0.0];
        last = solve(&mut prepared, &x0, Some(&last));
        assert_eq!(exprs.n_nodes(), nodes);
        made.push(last.trajectory.optimum.as_ref().map(|o| o.analyses));
    }
    assert_eq!(made, [Some(0); 3]);
}

#[test]
fn wrong_states_are_refused() {
    let exprs = Exprs::new();
    let text = "model m { state x = 1; state y = 0; control u in [-9, 9]; x' = u; y' = x; }
        optimize o of m { horizon 1; intervals 2; minimize integral(u^2); final { x = 0; } }
        optimize longer of m { horizon 1; intervals 3; minimize integral(u^2); final { x = 0; } }
        model n { state x = 1; x' = -x; }
        simulate s of n { horizon 1; }";
    let (project, mut prepared) = prepared(&exprs, text);
    assert_eq!(prepared.states(), ["x", "y"]);
    let limit = Limit::default();
    let mut refused = |x0: &[f64], from: Option<&Solved>| {
        let found = prepared.solve(&[], Some(x0), from, &limit, &mut ());
        found
            .err()
            .map_or_else(String::new, |error| error.to_string())
    };
    assert_eq!(refused(&[1.0], None), "1 numbers for 2 initial values");
    assert_eq!(
        refused(&[1.0, 0.0, 0.0], None),
        "3 numbers for 2 initial values"
    );
    assert_eq!(refused(&[1.0, f64::NAN], None), "`y` starts at NaN");
    assert_eq!(refused(&[f64::INFINITY, 0.0], None), "`x` starts at inf");
    let other = project.prepare_optimal(&exprs, "longer", &[], &[]);
    let other = solve(&mut other.expect("it has a program"), &[1.0, 0.0], None);
    assert!(refused(&[1.0, 0.0], Some(&other)).contains("another problem"));
    assert_eq!(refused(&[1.0, 0.0], None), "");
    let asked = |name: &str, values: &[(String, f64)]| {
        project.prepare_optimal(&exprs, name, &[], values).err()
    };
    assert!(matches!(asked("s", &[]), Some(PrepareError::NoTask(_))));
    assert!(matches!(
        asked("none", &[]),
        Some(PrepareError::NotCompiled(_))
    ));
    let values = [("z".to_owned(), 1.0)];
    assert!(matches!(
        asked("o", &values),
        Some(PrepareError::NotCompiled(_))
    ));
}

#[test]
fn a_start_below_the_floor_is_named() {
    let text = "model ball {
          state q = 1; state v = 0; control u in [-1, 1] = 0;
          q' = v;
          mechanics q, v { mass = 1; force = u - 10; contact floor { gap = q; restitution = 0.5; } }
        }
        optimize o of ball { horizon 0.4; intervals 2; lower impact; minimize integral(u^2); }
        optimize p of ball { horizon 0.4; intervals 2; lower timefreezing; minimize integral(u^2); }";
    let exprs = Exprs::new();
    let (project, mut prepared) = prepared(&exprs, text);
    let found = prepared.solve(&[], Some(&[-0.5, 0.0]), None, &Limit::default(), &mut ());
    let Err(SolveError::Start(messages)) = found else {
        panic!("it starts below the floor")
    };
    assert_eq!(messages.list()[0].labels[0].place.file, "test.nsd");
    solve(&mut prepared, &[1.2, 0.0], None);
    let frozen = project.prepare_optimal(&exprs, "p", &[], &[]);
    assert!(matches!(frozen.err(), Some(PrepareError::Frozen(_))));
}

/// A constraint at the start bounds a state that is given: where it does not hold there is no solution, and where it
/// held when the problem was prepared it is still there.
#[test]
fn constraints_at_the_start_are_kept() {
    let text = "model m { state x = 1; control u in [-9, 9]; x' = u; }
        optimize o of m {
          horizon 1; intervals 2; minimize integral(u^2);
          initial { x >= 0.5; } final { x = 0; }
        }";
    let exprs = Exprs::new();
    let (_, mut prepared) = prepared(&exprs, text);
    let first = solve(&mut prepared, &[1.0], None);
    let below = prepared.solve(&[], Some(&[0.25]), Some(&first), &Limit::default(), &mut ());
    let below = below.expect("the model begins there");
    assert_eq!(below.trajectory.status, Status::LocallyInfeasible);
    let again = solve(&mut prepared, &[0.75], Some(&below));
    assert!((objective(&again.trajectory) - 0.5625).abs() < 1e-9);
}

/// Solves with one list of values of the open parameters after the other, as the experiment does and from the solution
/// before, without a new expression, as if the problem were compiled for each.
#[track_caller]
fn as_compiled_with(
    text: &str,
    open: &[&str],
    values: &[&[f64]],
    [cost, controls]: [f64; 2],
) -> Vec<Trajectory> {
    let exprs = Exprs::new();
    let project = Project::from_text("test.nsd", text);
    let prepared = project.prepare_optimal(&exprs, "o", open, &[]);
    let mut prepared = prepared.expect("it has a program");
    let names = prepared.parameters().iter().map(|p| p.name.clone());
    let names: Vec<String> = names.collect();
    let mut last: Option<Solved> = None;
    let (mut all, mut nodes) = (Vec::new(), None);
    for values in values {
        let alone = solve_with(&mut prepared, values, None, None);
        assert_eq!(
            *nodes.get_or_insert(exprs.n_nodes()),
            exprs.n_nodes(),
            "{values:?}: it compiles"
        );
        let other = fresh(&project, &names, values);
        let near = last.map(|last| solve_with(&mut prepared, values, None, Some(&last)));
        for found in [Some(&alone), near.as_ref()].into_iter().flatten() {
            let found = &found.trajectory;
            let apart = objective(found) - objective(&other);
            assert!(
                apart.abs() <= cost * objective(&other).abs().max(1.0),
                "{values:?}: the objective is off by {apart:e}"
            );
            let apart = differ(&found.samples.controls, &other.samples.controls);
            assert!(
                apart <= controls,
                "{values:?}: controls are off by {apart:e}"
            );
            let confirmed = |found: &Trajectory| found.optimum.as_ref().map(|o| o.confirmation);
            assert_eq!(confirmed(found), confirmed(&other), "{values:?}");
            assert_eq!(
                found.quality.certificate.stationarity,
                other.quality.certificate.stationarity
            );
        }
        let near = near.as_ref().map(|near| near.trajectory.optimum.as_ref());
        let made = near.map(|optimum| optimum.map(|o| o.analyses));
        assert!(
            made.is_none_or(|made| made == Some(0)),
            "{values:?}: {made:?}"
        );
        assert_eq!(*nodes.get_or_insert(0), exprs.n_nodes(), "{values:?}");
        all.push(alone.trajectory.clone());
        last = Some(alone);
    }
    all
}

/// x' = u - k sign(x) with a cost of u and of the end: weights, coefficients of switches and tied parameters.
#[test]
fn weights_and_coefficients_are_inputs() {
    let text = "model crossing {
          param w = 2; param k = 1; param g = 2*k;
          state x = -1; control u in [-9, 9];
          x' = g - k*sign(x) + u;
        }
        optimize o of crossing {
          horizon 2; intervals 2; elements 4;
          minimize w*integral(u^2) + final((x - 5/3)^2);
        }";
    let values: [&[f64]; 4] = [&[2.0], &[0.5], &[7.0], &[2.0]];
    as_compiled_with(text, &["w"], &values, [1e-9, 1e-8]);
    let values: [&[f64]; 4] = [&[1.0], &[0.8], &[1.5], &[1.0]];
    as_compiled_with(text, &["k"], &values, [1e-9, 1e-8]);
    let values: [&[f64]; 3] = [&[2.0, 1.0], &[1.0, 1.25], &[3.0, 0.9]];
    let found = as_compiled_with(text, &["k", "w"], &values, [1e-9, 1e-8]);
    assert!(objective(&found[0]) != objective(&found[1]));
}

/// From 0 to 1 with |u| <= a in the least time, x'' = u: T = 2/√a. A constraint cuts the range still.
#[test]
fn ranges_of_controls_are_inputs() {
    let text = "model cart {
          param a = 1;
          state x = 0; state v = 0; control u in [-a, 2*a] = 5;
          x' = v; v' = u;
        }
        optimize o of cart {
          horizon free in [0.1, 20] = 2; intervals 6; elements 1;
          minimize final(time); subject to { u <= 1.2; u <= a; } final { x = 1; v = 0; }
        }";
    let values: [&[f64]; 4] = [&[1.0], &[1.44], &[0.81], &[1.0]];
    let found = as_compiled_with(text, &["a"], &values, [1e-8, 1e-6]);
    for (one, a) in found.iter().zip(values) {
        let largest = one.samples.controls[0]
            .values
            .iter()
            .fold(0.0, |m: f64, u| m.max(*u));
        assert!((largest - a[0].min(1.2)).abs() < 1e-6, "{a:?}: {largest}");
        if a[0] <= 1.2 {
            let exact = 2.0 / a[0].sqrt();
            assert!((objective(one) - exact).abs() < 1e-7, "{a:?}");
        }
    }
}

/// ∫ u² from x(0) = 2 a to b within T = c: (b - 2 a)²/c.
#[test]
fn initial_values_ends_and_the_horizon_are_inputs() {
    let text = "model m { param a = 1; param b = 0.5; param c = 1; state x = 2*a; control u in [-9, 9]; x' = u; }
        optimize o of m { horizon c; intervals 2; minimize integral(u^2); final { x = b; } }";
    let values: [&[f64]; 4] = [
        &[1.0, 0.5, 1.0],
        &[2.0, 0.5, 1.0],
        &[1.0, 3.0, 1.2],
        &[1.5, 0.25, 0.9],
    ];
    let found = as_compiled_with(text, &["a", "b", "c"], &values, [1e-8, 1e-7]);
    for (one, values) in found.iter().zip(values) {
        let &[a, b, c] = values else { panic!("three") };
        let exact = (b - 2.0 * a).powi(2) / c;
        assert!((objective(one) - exact).abs() < 1e-7 * exact, "{values:?}");
    }
    // An initial state that is given counts.
    let exprs = Exprs::new();
    let project = Project::from_text("test.nsd", text);
    let prepared = project.prepare_optimal(&exprs, "o", &["a"], &[]);
    let mut prepared = prepared.expect("it has a program");
    assert_eq!(prepared.initial(&[3.0]).expect("it may be 3"), [6.0]);
    let found = solve_with(&mut prepared, &[3.0], Some(&[1.5]), None);
    assert!((objective(&found.trajectory) - 1.0).abs() < 1e-8);
}

#[test]
fn coefficients_of_contacts_are_inputs() {
    let text = "model ball {
          param e = 0.5; param m = 1;
          state q[2] = [0, 0.5]; state v[2] = [0, 0];
          control u in [-50, 50] = 0;
          q' = v;
          mechanics q, v {
            mass = m*eye(2); force = [u, -10*m];
            contact floor { gap = q[2]; restitution = e; }
          }
        }
        optimize o of ball {
          horizon 0.8; intervals 4; elements 3; scheme radau_iia(2);
          lower impact;
          minimize integral(u^2) + final(q[2]);
          final { q[1] = 1; }
        }";
    let values: [&[f64]; 3] = [&[0.5, 1.0], &[0.4, 1.0], &[0.5, 2.0]];
    as_compiled_with(text, &["e", "m"], &values, [1e-7, 1e-5]);
    let exprs = Exprs::new();
    let project = Project::from_text("test.nsd", text);
    let prepared = project.prepare_optimal(&exprs, "o", &["e"], &[]);
    let mut prepared = prepared.expect("it has a program");
    let found = prepared.solve(&[1.5], None, None, &Limit::default(), &mut ());
    let error = found.err().map(|error| error.to_string());
    let told = error.is_some_and(|error| error.contains("restitution is not in [0, 1]"));
    assert!(told, "no restitution is 1.5");
}

/// Conditions and kinks that a parameter moves: either it is refused to keep it open, or what is prepared on one side of
/// the threshold is right on the other.
#[test]
fn thresholds_of_open_parameters_are_not_compiled_in() {
    let terms = [
        "if m > 2 then 1 else 3",
        "abs(m - 2)",
        "max(m - 2, 0)",
        "min(m, 2)",
        "sat(m, -2, 2)",
        "sign(x^2 + m - 2)",
        "if x^2 + m > 2 then 1 else 3",
        "if m*m > 4 and x < 9 then 1 else 3",
        "sign(x + m)*sign(x - 9)",
    ];
    let mut n_prepared = 0;
    for term in terms {
        let text = format!(
            "model k {{ param m = 1; state x = 0.1; control u in [-9, 9]; x' = u - 0.5*x + ({term}); }}
            optimize o of k {{ horizon 1; intervals 2; minimize integral(u^2) + final((x - 4)^2); }}"
        );
        let exprs = Exprs::new();
        let project = Project::from_text("test.nsd", &text);
        let Ok(mut prepared) = project.prepare_optimal(&exprs, "o", &["m"], &[]) else {
            continue;
        };
        n_prepared += 1;
        for m in [1.0, 3.0, 2.5, 1.5] {
            let found = prepared.solve(&[m], None, None, &Limit::default(), &mut ());
            let Ok(found) = found else {
                continue;
            };
            let other = fresh(&project, &["m".to_owned()], &[m]);
            let apart = objective(&found.trajectory) - objective(&other);
            assert!(apart.abs() <= 1e-6, "{term}, m = {m}: off by {apart:e}");
        }
    }
    assert!(n_prepared >= 2, "{n_prepared} of {}", terms.len());
}

/// What is compiled in is refused, and so are numbers for which nothing was prepared.
#[test]
fn parameters_that_change_the_program_are_refused() {
    let text = "model m {
          param n = 2; param zero = 0; param high = 1; param p = 3; param w = 1 ;
          state x = 1; control u in [-w, 9];
          x' = u*x^n + zero - sign(x)*sign(x - high);
        }
        optimize o of m { horizon 1; intervals 2; free { p in [1, 4]; } minimize integral(p*u^2); }
        optimize tabled of m { horizon 1; intervals w + 1; free { p in [1, 4]; } minimize integral(p*u^2); }
        model named {
          param high = 1; state x = 0; control u in [-9, 9];
          region low where x < high { x' = u; }
          region middle where x > high and x < 3 { x' = u - 1; }
          region top where x > high and x > 3 { x' = u - 2; }
        }
        optimize regions of named { horizon 1; intervals 2; minimize integral(u^2); }";
    let exprs = Exprs::new();
    let project = Project::from_text("test.nsd", text);
    let why = |name: &str, open: &str| {
        let found = project.prepare_optimal(&exprs, name, &[open], &[]);
        found
            .err()
            .map_or_else(String::new, |error| error.to_string())
    };
    let known =
        |of: &str, why: &str| format!("`{of}` {why}: it has to be compiled for each of its values");
    assert_eq!(why("o", "n"), known("n", "is in an exponent"));
    assert_eq!(why("o", "zero"), known("zero", "is zero"));
    assert_eq!(
        why("regions", "high"),
        known("high", "decides which regions there are")
    );
    assert_eq!(why("o", "high"), "");
    assert!(why("o", "p").contains('p'), "{}", why("o", "p"));
    assert!(why("o", "x").contains('x'), "{}", why("o", "x"));
    assert!(why("tabled", "w").contains('w'), "{}", why("tabled", "w"));
    let prepared = project.prepare_optimal(&exprs, "o", &["w"], &[]);
    let mut prepared = prepared.expect("it has a program");
    let mut refused = |parameters: &[f64]| {
        let found = prepared.solve(parameters, None, None, &Limit::default(), &mut ());
        found
            .err()
            .map_or_else(String::new, |error| error.to_string())
    };
    assert_eq!(refused(&[]), "0 numbers for 1 parameters");
    assert!(
        refused(&[-1.0]).contains("`w` = -1"),
        "{}",
        refused(&[-1.0])
    );
    assert!(refused(&[0.0]).contains("or zero"));
    assert!(refused(&[f64::NAN]).contains("`w` = NaN"));
    assert_eq!(refused(&[2.0]), "");
}
