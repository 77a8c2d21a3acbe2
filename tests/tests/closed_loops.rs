//! Closed loops: against the Riccati recursion, closed forms of time-optimal control, controls over a sample, what is done
//! without a plan, and plans from the last one against plans without it.

use std::time::Duration;

use nsd_tests::{assert_near, end};
use nsdc::expr::Exprs;
use nsdc::limit::{Cancel, Limit, work};
use nsdc::optimize::PrepareError;
use nsdc::report::{ClosedLoop, Decision, Sampled, Series, Status, Trajectory};
use nsdc::{Options, Project};
use serde_json::{Value, json};

fn project(text: &str) -> Project {
    Project::from_text("model.nsd", text)
}

/// The run of the loop `l` of a text.
fn ran(text: &str) -> Trajectory {
    let found = project(text).run("l", &Options::default(), &mut ());
    found.unwrap_or_else(|errors| panic!("{errors}")).trajectory
}

fn looped(text: &str) -> (Trajectory, ClosedLoop) {
    let run = ran(text);
    let found = run.several.closed_loop.clone().expect("it is a loop");
    (run, found)
}

/// What is wrong with the loop `l` of a text.
fn refused(text: &str) -> String {
    match project(text).run("l", &Options::default(), &mut ()) {
        Ok(_) => panic!("it runs"),
        Err(errors) => errors.to_string(),
    }
}

fn codes(run: &Trajectory) -> Vec<&str> {
    run.warnings.iter().map(|w| w.code.as_str()).collect()
}

/// The values of a quantity at an instant, behind what jumps there.
fn at(run: &Trajectory, series: &[Series], name: &str, t: f64) -> f64 {
    let time = &run.samples.time;
    let row = time.iter().rposition(|&known| (known - t).abs() <= 1e-9);
    let row = row.unwrap_or_else(|| panic!("there is no row at {t}"));
    let found = series.iter().find(|series| series.name == name);
    found.expect("it is recorded").at(row)[0]
}

fn state(run: &Trajectory, name: &str, t: f64) -> f64 {
    at(run, &run.samples.states, name, t)
}

fn control(run: &Trajectory, name: &str, t: f64) -> f64 {
    at(run, &run.samples.controls, name, t)
}

fn close(a: f64, b: f64, within: f64) {
    assert_near(&[a], &[b], within);
}

/// What ∫₀ʰ x² + v² + r u² ds is in (x, v, u) for x' = v, v' = u with u held: by Gauss-Legendre quadrature with three nodes,
/// which is exact for degree 5.
fn stage(h: f64, r: f64) -> [[f64; 3]; 3] {
    let root = 0.6_f64.sqrt();
    let mut cost = [[0.0; 3]; 3];
    for (node, weight) in [(-root, 5.0 / 9.0), (0.0, 8.0 / 9.0), (root, 5.0 / 9.0)] {
        let s = 0.5 * h * (1.0 + node);
        let rows = [[1.0, s, 0.5 * s * s], [0.0, 1.0, s]];
        for i in 0..3 {
            for j in 0..3 {
                let product: f64 = rows.iter().map(|row| row[i] * row[j]).sum();
                let effort = if (i, j) == (2, 2) { r } else { 0.0 };
                cost[i][j] += 0.5 * h * weight * (product + effort);
            }
        }
    }
    cost
}

/// The gain of the first of n steps of length h, by the Riccati recursion without a cost at the end.
fn gain(h: f64, r: f64, n: usize) -> [f64; 2] {
    let w = stage(h, r);
    let [phi, gamma] = [[[1.0, h], [0.0, 1.0]], [[0.5 * h * h, h], [0.0, 0.0]]];
    let gamma = gamma[0];
    let (mut p, mut k) = ([[0.0; 2]; 2], [0.0; 2]);
    for _ in 0..n {
        // Q = W + [Φ Γ]ᵀ P [Φ Γ]
        let column = |i: usize| match i {
            2 => gamma,
            i => [phi[0][i], phi[1][i]],
        };
        let mut q = w;
        for (i, row) in q.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                let (a, b) = (column(i), column(j));
                for (m, p) in p.iter().enumerate() {
                    *entry += a[m] * (p[0] * b[0] + p[1] * b[1]);
                }
            }
        }
        k = [q[2][0] / q[2][2], q[2][1] / q[2][2]];
        for i in 0..2 {
            for j in 0..2 {
                p[i][j] = q[i][j] - k[i] * q[2][j];
            }
        }
    }
    k
}

const CART: &str = "model cart {
      state x = 1; state v = 0; control u; x' = v; v' = u;
    }
    optimize plan of cart {
      horizon 2; intervals 10; elements 1;
      minimize integral(x^2 + v^2 + 0.1*u^2);
    }";

/// Without constraints each plan begins with u = -K (x, v), K of the Riccati recursion over the horizon, and a sample of the
/// double integrator is x + h v + h² u/2, v + h u.
#[test]
fn a_linear_loop_has_the_gain_of_the_riccati_recursion() {
    let text = format!("{CART} mpc l of cart {{ controller plan; sample 0.2; horizon 3; }}");
    let (run, found) = looped(&text);
    assert_eq!((run.status, codes(&run)), (Status::Solved, vec![]));
    assert_eq!(found.samples.len(), 15);
    let (h, k) = (0.2, gain(0.2, 0.1, 10));
    let [mut x, mut v] = [1.0, 0.0];
    for sample in &found.samples {
        let u = -k[0] * x - k[1] * v;
        close(control(&run, "u", sample.time), u, 1e-7);
        [x, v] = [x + h * v + 0.5 * h * h * u, v + h * u];
    }
    close(end(&run, "x")[0], x, 1e-7);
    close(end(&run, "v")[0], v, 1e-7);
    assert!(
        found.samples[1..]
            .iter()
            .all(|s| s.decision == Decision::Warm)
    );
}

/// A sample of two intervals has both controls of its plan, and one of half an interval goes on with the same control.
#[test]
fn a_sample_takes_the_pieces_of_its_plan() {
    for (sample, pieces) in [(0.4, vec![0.0, 0.2]), (0.1, vec![0.0])] {
        let text =
            format!("{CART} mpc l of cart {{ controller plan; sample {sample}; horizon 0.8; }}");
        let (run, found) = looped(&text);
        for Sampled { time, plan, .. } in &found.samples {
            let plan = plan.as_ref().expect("each has a plan");
            let (_, planned) = &plan.controls[0];
            for (k, piece) in pieces.iter().enumerate() {
                close(control(&run, "u", time + piece), planned[k], 1e-12);
            }
            // The plant is the model of the controller: what is planned happens, as far as the plan goes.
            let (_, x) = &plan.states[0];
            close(state(&run, "x", *time), x[0], 1e-9);
            if pieces.len() == 2 {
                close(state(&run, "x", time + 0.2), x[1], 1e-9);
            }
        }
    }
}

/// Straight lines go on as they are planned: of a plan that is followed to its end, u is continuous.
#[test]
fn straight_lines_are_followed() {
    let text = "model m { state x = 1; control u in [-9, 9]; x' = u; }
        optimize plan of m {
          horizon 1; intervals 4; elements 1; controls linear; minimize integral(u^2); final { x = 0; }
        }
        mpc l of m { controller plan; sample 0.5; horizon 0.5; }";
    let (run, found) = looped(text);
    // From 1 to 0 within a second: u = -1.
    for t in [0.0, 0.25, 0.5] {
        close(control(&run, "u", t), -1.0, 1e-8);
        close(state(&run, "x", t), 1.0 - t, 1e-8);
    }
    assert_eq!(found.samples.len(), 1);
}

/// A double integrator from rest at 1 to rest at 0 with |u| ≤ 1 takes 2 s at least. A loop of free horizons keeps to that but
/// for its grid, whose intervals may not end where u switches, and ends with its last plan.
#[test]
fn a_free_horizon_shrinks_to_the_end_of_the_loop() {
    let text = "model m { state x = 1; state v = 0; control u in [-1, 1]; x' = v; v' = u; }
        optimize hurry of m {
          horizon free in [1e-3, 10] = 3; intervals 10; elements 1;
          minimize final(time); final { x = 0; v = 0; }
        }
        mpc l of m { controller hurry; sample 0.2; horizon 5; }";
    let (run, found) = looped(text);
    assert_eq!(run.status, Status::Solved);
    let last = *run.samples.time.last().expect("there are rows");
    assert!((2.0 - 1e-9..2.015).contains(&last), "{last}");
    close(end(&run, "x")[0], 0.0, 1e-3);
    close(end(&run, "v")[0], 0.0, 1e-3);
    for Sampled {
        time, objective, ..
    } in &found.samples
    {
        let whole = time + objective.expect("each has a plan");
        assert!((2.0 - 1e-6..2.015).contains(&whole), "{whole}");
    }
}

/// A car with a turbo against a plant with less of it and drag comes to rest at its target, on the branch of the last plan
/// but for a few samples.
#[test]
fn another_plant_comes_to_the_target() {
    let text = "model car {
          param gain = 3; param drag = 0;
          state q = 0; state v in [-20, 20] = 0; control u in [-5, 5] = 0;
          q' = v; v' = (if v > 10 then gain*u else u) - drag*v;
        }
        optimize hurry of car {
          horizon free in [0.01, 100] = 20; intervals 10; elements 3; scheme radau_iia(2);
          minimize final(time); final { q = 200; v = 0; }
        }
        mpc l of car {
          with { gain = 2.9; drag = 0.01; }
          controller hurry; sample 0.25; horizon 30;
        }";
    let (run, found) = looped(text);
    assert_eq!(run.status, Status::Solved);
    close(end(&run, "q")[0], 200.0, 1e-2);
    close(end(&run, "v")[0], 0.0, 2e-2);
    let warm = found.count(Decision::Warm);
    assert!(warm + 4 >= found.samples.len(), "{warm}");
    // What was found from the last plan costs no more than 1 % more than what is found without it.
    let (project, exprs) = (project(text), Exprs::new());
    for sample in found.samples.iter().step_by(11) {
        let Some(plan) = &sample.plan else { continue };
        let x0: Vec<f64> = plan.states.iter().map(|(_, x)| x[0]).collect();
        let mut fresh = (project.controller(&exprs, "hurry", &[], &[], None)).expect("a program");
        let step = fresh.step(0.0, &x0, &[], &Limit::default());
        let cold = step.plan.expect("it has a plan").objective;
        let warm = sample.objective.expect("it has a plan");
        assert!(warm <= cold + 0.01 * cold.abs(), "{warm}, {cold}");
    }
}

/// From |x| > 1 nothing comes to 0 within a second by |u| ≤ 1. A gust d from 0.35 to 0.65 s throws the plant there: the last
/// plan goes on, and its last control behind its end, and the warning is at the row that is not met.
#[test]
fn without_a_plan_the_last_one_goes_on() {
    let text = "model m { state x = 0.5; control u in [-1, 1]; x' = u; }
        model windy {
          state x = 0.5; control u = 0; input d;
          x' = u + d;
        }
        optimize plan of m {
          horizon 1; intervals 5; elements 1; minimize integral(u^2);
          final { x = 0; }
        }
        mpc l of windy {
          with { d = if time > 0.35 and time < 0.65 then 5 else 0; }
          controller plan; sample 0.1; horizon 1.4;
        }";
    let (run, found) = looped(text);
    assert_eq!(run.status, Status::Solved);
    assert_eq!(codes(&run), ["W0745"]);
    let mut held = None;
    for Sampled { time, decision, .. } in &found.samples {
        let x = state(&run, "x", *time);
        let is_kept = *decision == Decision::Kept;
        assert_eq!(is_kept, x.abs() > 1.0 + 1e-6, "x = {x} at {time}");
        let u = control(&run, "u", *time);
        if is_kept {
            close(u, *held.get_or_insert(u), 1e-12);
        } else {
            // From x to 0 within a second.
            close(u, -x, 1e-6);
            held = Some(u);
        }
    }
    let kept = found.count(Decision::Kept);
    assert!(kept >= 3, "{kept}");
    let warning = &run.warnings[0];
    let span = warning.span.expect("it is at a line");
    assert_eq!(&text[span.start as usize..span.end as usize], "x = 0;");
    assert!(warning.message.contains("E0715"), "{}", warning.message);
    let first = found.samples.iter().find(|s| s.decision == Decision::Kept);
    let first = format!("t = {:.6}", first.expect("there is one").time);
    assert!(warning.message.contains(&first), "{}", warning.message);
}

/// A loop that has never had a plan ends where it begins, with what is not met.
#[test]
fn a_loop_without_a_first_plan_does_not_begin() {
    let text = "model m { state x = 2; control u in [-1, 1]; x' = u; }
        optimize plan of m { horizon 1; intervals 5; elements 1; minimize integral(u^2); final { x = 0; } }
        mpc l of m { controller plan; sample 0.1; horizon 1; }";
    let run = ran(text);
    assert_eq!(run.status, Status::LocallyInfeasible);
    assert_eq!(run.samples.time.last(), Some(&0.0));
    // No plan was kept.
    assert_eq!(codes(&run), [""; 0]);
}

/// With no time at all, every plan but the first one is the first one.
#[test]
fn a_deadline_that_has_passed_keeps_the_plan() {
    let text = format!(
        "{CART} mpc l of cart {{ controller plan; sample 0.2; deadline 1e-9; horizon 2; }}"
    );
    let (run, found) = looped(&text);
    assert_eq!(run.status, Status::Solved);
    let (first, others) = found.samples.split_first().expect("there is one");
    assert_eq!(first.decision, Decision::Cold);
    assert!(others.iter().all(|s| s.decision == Decision::Kept));
    assert_eq!(others.len(), 9);
    let (_, planned) = &first.plan.as_ref().expect("it is a plan").controls[0];
    for sample in others {
        let k = (sample.time / 0.2).round() as usize;
        close(control(&run, "u", sample.time), planned[k], 1e-12);
    }
    assert_eq!(codes(&run), ["W0745"]);
}

/// A block on a spring with a damper and Coulomb friction is brought to 1 and stays there, with a stiffness that changes from
/// 0.5 to 3 on the way as well.
#[test]
fn blocks_with_friction_reach_their_targets() {
    for (stiffness, force) in [("0.8", 0.8), ("(if x > 0.5 then 3 else 0.5)", 3.0)] {
        let text = format!(
            "model block {{
               state x = 0; state v = 0; control u in [-6, 6] = 0;
               x' = v; v' = u - {stiffness}*x - 0.5*v - 0.2*sign(v);
             }}
             optimize plan of block {{
               horizon 3; intervals 10; elements 2; scheme radau_iia(2);
               minimize integral(20*(x - 1)^2 + v^2 + 0.1*(u - {force})^2);
             }}
             mpc l of block {{ controller plan; sample 0.3; horizon 6; }}"
        );
        let (run, _) = looped(&text);
        assert_eq!(run.status, Status::Solved, "{stiffness}");
        close(end(&run, "x")[0], 1.0, 0.1);
        close(end(&run, "v")[0], 0.0, 1e-2);
    }
}

/// A plan that is prepared for the state that the last one leads to has the gain of the Riccati recursion from whatever state
/// is measured there, what is followed until then stays, and where nothing is disturbed nothing is left to do.
#[test]
fn prepared_steps_have_the_gain_of_the_riccati_recursion() {
    let (project, exprs, limit) = (project(CART), Exprs::new(), Limit::default());
    let mut controller = (project.controller(&exprs, "plan", &[], &[], None)).expect("a program");
    assert!(controller.feedback(&[1.0, 0.0], &[], &limit).is_none());
    let (h, k) = (0.2, gain(0.2, 0.1, 10));
    let [mut x, mut v] = [1.0, 0.0];
    for (sample, kick) in [0.0, 0.0, 0.3, 0.0, -1.0, 0.01].into_iter().enumerate() {
        let t = h * sample as f64;
        v += kick;
        let followed = controller.control(t);
        controller.prepare(t, &[], &limit);
        assert_eq!(controller.control(t), followed);
        let kept = serde_json::to_string(controller.memory()).expect("it is data");
        assert!(controller.remember(serde_json::from_str(&kept).expect("it is a memory")));
        let step = controller.feedback(&[x, v], &[], &limit);
        let step = step.expect("it is prepared");
        let u = controller.control(t).expect("there is a plan")[0];
        close(u, -k[0] * x - k[1] * v, 1e-7);
        if sample > 0 {
            assert_eq!(step.decision, Decision::Warm);
            assert!(kick != 0.0 || step.iterations <= 2, "{}", step.iterations);
        }
        [x, v] = [x + h * v + 0.5 * h * h * u, v + h * u];
    }
    assert!(controller.feedback(&[x, v], &[], &limit).is_none());
}

/// Where nothing is found in time, the plan that was prepared is followed, and not the one before it.
#[test]
fn what_was_prepared_is_followed_without_a_feedback() {
    let text = "model m { state x = 1; control u in [-9, 9]; x' = u; }
        optimize plan of m { horizon 1; intervals 4; elements 1; minimize integral(x^2 + u^2); }";
    let (project, exprs, limit) = (project(text), Exprs::new(), Limit::default());
    let made = |deadline| project.controller(&exprs, "plan", &[], &[], deadline);
    let mut slow = made(None).expect("a program");
    let mut quick = made(Some(Duration::from_nanos(1))).expect("a program");
    let start = [1.0];
    for controller in [&mut slow, &mut quick] {
        controller.step(0.0, &start, &[], &limit);
    }
    let u = slow.control(0.0).expect("a plan")[0];
    let ahead = 1.0 + 0.25 * u;
    slow.step(0.25, &[ahead], &[], &limit);
    let expected = slow.control(0.25).expect("a plan")[0];
    quick.prepare(0.25, &[], &limit);
    let before = quick.control(0.25).expect("a plan")[0];
    let step = quick.feedback(&[ahead - 0.3], &[], &limit);
    assert_eq!(step.expect("it is prepared").decision, Decision::Kept);
    close(quick.control(0.25).expect("a plan")[0], expected, 1e-7);
    assert!((before - expected).abs() > 1e-2, "{before} {expected}");
}

/// A thousand steps make no expression: what is kept of a step is its plan.
#[test]
fn steps_make_nothing_that_stays() {
    let text = "model m { state x = 1; control u in [-9, 9]; x' = u - 0.2*sign(x); }
        optimize plan of m { horizon 1; intervals 2; elements 2; scheme radau_iia(2); minimize integral(x^2 + u^2); }";
    let (project, exprs) = (project(text), Exprs::new());
    let mut controller = (project.controller(&exprs, "plan", &[], &[], None)).expect("a program");
    let mut known = None;
    for k in 0..1000 {
        let t = 0.1 * f64::from(k);
        controller.step(t, &[(0.05 * t).cos()], &[], &Limit::default());
        // A run with the controls of a plan is compiled once.
        if k == 500 {
            known = Some(exprs.n_nodes());
        }
    }
    assert_eq!(known, Some(exprs.n_nodes()));
}

/// A controller goes on from what another one has remembered, as if it was that one, and from no plan of another problem.
#[test]
fn memory_is_handed_on() {
    let text = "model m { param p = 1; state x = 1; control u in [-9, 9]; x' = p*u; }
        optimize plan of m { horizon 1; intervals 4; elements 1; minimize integral(u^2); final { x = 0; } }
        optimize other of m { horizon 1; intervals 5; elements 1; minimize integral(u^2); final { x = 0; } }
        optimize alike of m { horizon 2; intervals 4; elements 1; minimize integral(u^2); final { x = 0; } }";
    let (project, exprs) = (project(text), Exprs::new());
    let made = |name: &str| {
        let made = project.controller(&exprs, name, &["p"], &[], None);
        made.expect("a program")
    };
    let (mut first, mut second, mut other) = (made("plan"), made("plan"), made("other"));
    let mut alike = made("alike");
    first.step(0.0, &[1.0], &[1.0], &Limit::default());
    assert!(second.remember(first.memory().clone()));
    assert!(!other.remember(first.memory().clone()));
    assert!(!alike.remember(first.memory().clone()));
    for controller in [&mut first, &mut second] {
        // From x to 0 within a second by p u.
        let step = controller.step(0.25, &[0.5], &[2.0], &Limit::default());
        assert_eq!(step.decision, Decision::Warm);
        close(controller.control(0.25).expect("a plan")[0], -0.25, 1e-8);
    }
    assert_eq!(first.memory(), second.memory());
}

/// A memory whose numbers do not fit to each other is that of no controller.
#[test]
fn memory_that_was_changed_is_refused() {
    let text = "model m { state x = 1; control u in [-9, 9]; x' = u; }
        optimize plan of m { horizon 1; intervals 4; elements 2; minimize integral(u^2); final { x = 0; } }";
    let (project, exprs) = (project(text), Exprs::new());
    let made = || (project.controller(&exprs, "plan", &[], &[], None)).expect("a program");
    let mut first = made();
    first.step(0.0, &[1.0], &[], &Limit::default());
    let known = serde_json::to_value(first.memory()).expect("it is data");
    let mut other = made();
    let mut takes = |place: &str, value: Value| {
        let mut memory = known.clone();
        *memory
            .pointer_mut(place)
            .unwrap_or_else(|| panic!("{place}")) = value;
        serde_json::from_value(memory).is_ok_and(|memory| other.remember(memory))
    };
    assert!(takes("/waits", json!(u32::MAX)));
    for (place, value) in [
        ("/last/0/plan/ends", json!([])),
        ("/last/0/plan/ends", json!([0, 0, 0, 0, 0])),
        ("/last/0/plan/controls", json!([[]])),
        ("/last/0/plan/states/0", json!([1, 2])),
        ("/last/0/point/controls", json!([])),
        ("/last/0/point/elements", json!([])),
        ("/last/0/point/elements/0/states", json!([])),
        ("/last/0/point/elements/0/alphas", json!([])),
        ("/last/0/point/elements/0/length", json!(100)),
        ("/last/0/point/horizon", json!(0)),
        ("/of/0", json!("another")),
    ] {
        assert!(!takes(place, value), "{place}");
    }
}

/// Events of the plant at its horizon, which rounded multiples of samples miss, ask for no plan.
#[test]
fn events_at_the_horizon_ask_for_no_plan() {
    for (sample, horizon, n) in [(0.2, 1.0, 5), (0.1, 0.3, 3), (0.1, 0.7, 7)] {
        let text = format!(
            "model m {{ state x = 1; control u in [-9, 9]; x' = u; }}
            model p {{ state x = 1; state k = 0; control u = 0; x' = u; k' = 0; every {sample} {{ k := k + 1; }} }}
            optimize plan of m {{ horizon 1; intervals 4; elements 1; minimize integral(u^2); final {{ x = 0; }} }}
            mpc l of p {{ controller plan; sample {sample}; horizon {horizon}; }}"
        );
        let (run, found) = looped(&text);
        assert_eq!(run.status, Status::Solved);
        assert_eq!(found.samples.len(), n);
    }
}

/// A pendulum that is thrown over does not rest beside its upper equilibrium, where friction holds it: that is a minimum, and
/// with the controls that there are it comes back.
#[test]
fn what_rests_is_compared_with_other_plans() {
    let text = "model c {
          state th = 0.05; state w = 0; control u in [-8, 8] = 0;
          th' = w; w' = 9.81*sin(th) + u - 0.3*sign(w);
        }
        model p {
          state th = 0.05; state w = 0; control u = 0; input d;
          th' = w; w' = 9.81*sin(th) + u - 0.3*sign(w) + d;
        }
        optimize o of c {
          horizon 1; intervals 8; elements 2; scheme radau_iia(2);
          minimize integral(10*th^2 + w^2 + 0.01*u^2);
        }
        mpc l of p {
          with { d = if time > 1 and time < 1.1 then 8 else 0; }
          controller o; sample 0.125; horizon 8;
        }";
    let (run, _) = looped(text);
    assert_eq!(run.status, Status::Solved);
    let th = end(&run, "th")[0];
    assert!(th.abs() < 0.06, "{th}");
}

/// No plan leads from x > 1.2 to 0 within 1.2 s by |u| ≤ 1: the plan that is kept ends, and the loop does not, as nothing has
/// come to 0. With u = -1, x' = 2 behind 0.2 s.
#[test]
fn a_plan_of_another_sample_ends_no_loop() {
    let text = "model cart { state x = 1; control u in [-1, 1] = 0; x' = u; }
        model plant { state x = 1; control u = 0; input d; x' = u + d; }
        optimize plan of cart {
          horizon free in [0.1, 1.2] = 1; intervals 5; elements 1; minimize final(time); final { x = 0; }
        }
        mpc l of plant {
          with { d = if time > 0.2 then 3 else 0; }
          controller plan; sample 0.1; horizon 3;
        }";
    let (run, _) = looped(text);
    assert_eq!(run.status, Status::Solved);
    assert_eq!(codes(&run), ["W0745"]);
    assert_eq!(run.samples.time.last(), Some(&3.0));
    close(end(&run, "x")[0], 0.8 + 2.0 * 2.8, 1e-6);
}

/// Time begins at 0 in every plan: nothing may depend on it but a cost that it moves.
#[test]
fn controllers_do_not_change_with_time() {
    let text = |rate: &str, horizon: &str, asks: &str| {
        format!(
            "model m {{ state x = 1; control u in [-9, 9] = 0; x' = {rate}; }}
            optimize plan of m {{ horizon {horizon}; intervals 4; elements 1; {asks} }}
            mpc l of m {{ controller plan; sample 0.25; horizon 0.5; }}"
        )
    };
    let free = "free in [0.1, 5] = 1";
    for (rate, horizon, asks) in [
        ("u + sin(3*time)", "1", "minimize integral(u^2);"),
        (
            "u",
            free,
            "minimize integral(u^2) + final(time); final { x = 0.5*time; }",
        ),
        (
            "u",
            free,
            "minimize integral(u^2) + final((time - 3)^2); final { x = 0; }",
        ),
        (
            "u",
            free,
            "minimize integral(u^2) + final(x*time); final { x = 0; }",
        ),
    ] {
        let text = text(rate, horizon, asks);
        let (project, exprs) = (project(&text), Exprs::new());
        let made = project.controller(&exprs, "plan", &[], &[], None);
        assert!(matches!(made, Err(PrepareError::ChangesWithTime)), "{asks}");
        assert!(refused(&text).contains("changes with time"), "{asks}");
    }
    // To 0 in T by u = -x/T costs x²/T + 4 T: T = x/2.
    let asks = "minimize integral(u^2) + 4*final(time); final { x = 0; }";
    let (run, _) = looped(&text("u", free, asks));
    close(control(&run, "u", 0.25), -2.0, 1e-5);
}

/// The plant says where a plan begins, and `with` gives entries of states that it does not have.
#[test]
fn states_belong_together_by_entry() {
    let plant = "model p { state x = 1; control u = 0; x' = u; }";
    let asks = "horizon 1; intervals 4; elements 1; minimize integral(u^2); final { x = 0; }";
    let text = |model: &str, with: &str, more: &str| {
        format!(
            "{plant} model f {{ state f = 0; input c; f' = c - f; }} model m {{ {model} }}
            optimize plan of m {{ {with} {asks} {more} }}
            mpc l of p {{ controller plan; sample 0.25; horizon 0.5; }}"
        )
    };
    let one = "state x = 1; control u in [-9, 9] = 0; x' = u;";
    let errors = refused(&text(one, "", "initial { x free in [-1, 1]; }"));
    assert!(errors.contains("chooses its initial value"), "{errors}");
    let part = format!("{one} part a = f {{ c = u; }}");
    let (run, _) = looped(&text(&part, "with { a.f = 0.5; }", ""));
    assert_eq!(run.status, Status::Solved);
    let errors = refused(&text(&part, "", ""));
    assert!(errors.contains("`a.f`"), "{errors}");
    let two = format!("{one} state y[2] = [0, 0]; y' = [u, u];");
    let errors = refused(&text(&two, "with { y[1] = 0; }", ""));
    assert!(
        errors.contains("`y[2]`") && !errors.contains("`y[1]`"),
        "{errors}"
    );
}

/// What is too long, or too much, is told.
#[test]
fn samples_and_deadlines_have_bounds() {
    for (settings, told) in [
        (
            "sample 0.2; deadline 1e300; horizon 1;",
            "at most 1e9 seconds",
        ),
        ("sample 1e-6; horizon 1;", "has at most 100000 samples"),
    ] {
        let errors = refused(&format!(
            "{CART} mpc l of cart {{ controller plan; {settings} }}"
        ));
        assert!(errors.contains(told), "{errors}");
    }
}

/// A loop that is canceled ends as canceled, with the samples that it had, all of which have their plans.
#[test]
fn canceled_loops_end_as_other_runs_do() {
    let text = format!("{CART} mpc l of cart {{ controller plan; sample 0.2; horizon 3; }}");
    let project = project(&text);
    let mut cut = Vec::new();
    for after in (0..).map(|k| 40_000 * k) {
        let cancel = Cancel::default();
        let options = Options {
            limit: Limit::default().canceled_by(&cancel),
            ..Options::default()
        };
        work::restart(Some((after, cancel)));
        let run = project.run("l", &options, &mut ());
        work::restart(None);
        let run = run.expect("it compiles").trajectory;
        if run.status == Status::Solved {
            break;
        }
        assert_eq!(run.status, Status::Canceled);
        assert!(run.failure.is_some());
        assert!(run.samples.time.last().is_some_and(|&t| t < 3.0));
        let found = run.several.closed_loop.as_ref().expect("it is a loop");
        // The first plan is followed where it is feasible.
        assert!(found.samples.len() == 1 || codes(&run).is_empty());
        cut.push(found.samples.len());
    }
    assert!(cut.iter().any(|&n| n > 1), "{cut:?}");
}
