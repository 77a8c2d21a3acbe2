//! Optimal control problems that are compiled once and solved from other initial states, beside the same problems compiled
//! for each of them, and closed forms.

use nsdc::expr::Exprs;
use nsdc::limit::Limit;
use nsdc::optimize::{PrepareError, Prepared, SolveError, Solved};
use nsdc::report::{Confirmation, EventKind, Series, Status, Trajectory};
use nsdc::{Options, Project};

use nsd_tests::{agrees, times};

fn prepared<'e>(exprs: &'e Exprs, text: &str) -> (Project, Prepared<'e>) {
    let project = Project::from_text("test.nsd", text);
    let prepared = project.prepare_optimal(exprs, "o", &[]);
    (project, prepared.expect("it has a program"))
}

#[track_caller]
fn solve<'e>(prepared: &mut Prepared<'e>, x0: &[f64], from: Option<&Solved<'e>>) -> Solved<'e> {
    let solved = prepared.solve(x0, from, &Limit::default(), &mut ());
    let solved = solved.expect("the model begins there");
    let found = &solved.trajectory;
    assert_eq!(
        found.status,
        Status::Solved,
        "{x0:?}\n{}",
        prepared.messages(&solved)
    );
    found.verify().expect("the invariants of `Trajectory`");
    solved
}

fn objective(found: &Trajectory) -> f64 {
    found.objective.expect("an optimum has an objective")
}

/// The experiment compiled for an initial state.
fn fresh(project: &Project, names: &[String], x0: &[f64]) -> Trajectory {
    let options = Options {
        values: names.iter().cloned().zip(x0.iter().copied()).collect(),
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
    pairs.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
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
        let apart = differ(&found.controls, &other.controls);
        assert!(apart <= controls, "{x0:?}: controls are off by {apart:e}");
        let confirmed = |found: &Trajectory| found.optimum.as_ref().map(|o| o.confirmation);
        assert_eq!(confirmed(found), confirmed(&other), "{x0:?}");
        assert_eq!(
            found.certificate.stationarity, other.certificate.stationarity,
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
    let start = prepared.initial();
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
        let found = prepared.solve(x0, from, &limit, &mut ());
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
    let other = project.prepare_optimal(&exprs, "longer", &[]);
    let other = solve(&mut other.expect("it has a program"), &[1.0, 0.0], None);
    assert!(refused(&[1.0, 0.0], Some(&other)).contains("another problem"));
    assert_eq!(refused(&[1.0, 0.0], None), "");
    let asked =
        |name: &str, values: &[(String, f64)]| project.prepare_optimal(&exprs, name, values).err();
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
    let found = prepared.solve(&[-0.5, 0.0], None, &Limit::default(), &mut ());
    let Err(SolveError::Start(messages)) = found else {
        panic!("it starts below the floor")
    };
    assert_eq!(messages.list()[0].labels[0].place.file, "test.nsd");
    solve(&mut prepared, &[1.2, 0.0], None);
    let frozen = project.prepare_optimal(&exprs, "p", &[]);
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
    let below = prepared.solve(&[0.25], Some(&first), &Limit::default(), &mut ());
    let below = below.expect("the model begins there");
    assert_eq!(below.trajectory.status, Status::LocallyInfeasible);
    let again = solve(&mut prepared, &[0.75], Some(&below));
    assert!((objective(&again.trajectory) - 0.5625).abs() < 1e-9);
}
