//! Free parameters reach everything that is computed from them, or an error says that they cannot.

use std::time::Duration;

use nsd_tests::stress::{Extent, free};
use nsd_tests::{codes, end, solved_optimum, with_experiment};
use nsdc::limit::Limit;
use nsdc::optimize;
use nsdc::report::Status;
use nsdc::simulate::Request;

const DECAY: &str = "param p in [0.1, 3] = 1.3;";

/// The optimum `o` of a model with the free parameter p, and its state y at the end.
fn optimum(body: &str, experiment: &str) -> (f64, f64) {
    let text = format!(
        "model m {{ {DECAY} {body} }}
         optimize o of m {{ intervals 2; {experiment} free {{ p; }} }}"
    );
    let found = solved_optimum(&text, "o");
    let objective = found.objective.expect("an optimum has an objective");
    (objective, end(&found, "y")[0])
}

#[track_caller]
fn close(value: f64, exact: f64, within: f64) {
    assert!((value - exact).abs() <= within, "{value} is not {exact}");
}

/// y(1) = 1/2 is reached by p wherever p stands.
#[test]
fn a_target_is_reached_through_other_parameters() {
    let goal = "horizon 1; minimize final((y - 0.5)^2);";
    for (body, experiment) in [
        ("param q = 2*p; state y = 1; y' = -q*y;", goal),
        (
            "param q = 2*p; param r = q^2; state y = 1; y' = -r*y;",
            goal,
        ),
        ("state y = p; y' = -y;", goal),
        ("param q = p; state y = 3*q; y' = -y;", goal),
        ("param v[2] = [0, 2*p]; state y = 1; y' = -v[2]*y;", goal),
        (
            "param A[2,2] = p*[0, 0; 1, 0]; state y = 1; y' = -A[2,1]*y;",
            goal,
        ),
        ("input d = p; state y = 1; y' = -d*y;", goal),
        ("let d = 2*p; state y = 1; y' = -d*y;", goal),
        (
            "state y = 3; y' = -y;",
            "horizon 1; with { y = p; } minimize final((y - 0.5)^2);",
        ),
        (
            "param q = 2*p; state y = 1; y' = -y;",
            "horizon q; minimize final((y - 0.5)^2);",
        ),
        (
            "state y = 1; y' = -y; param q = p/2;",
            "horizon free in [q, 5]; minimize final((y - 0.5)^2);",
        ),
        ("param q = abs(p - 1); state y = 1; y' = -q*y;", goal),
    ] {
        let (objective, y) = optimum(body, experiment);
        close(objective, 0.0, 1e-12);
        close(y, 0.5, 1e-6);
    }
}

/// (p - 1)² + p²/100 with y(1) = p has the minimum 0.01/1.01; (p - 2)² + p² has 2.
#[test]
fn bounds_follow_free_parameters() {
    let least = 0.01 / 1.01;
    for control in ["u in [-p, p]", "u in [-5, p]"] {
        let body = format!("state y = 0; control {control} = 0; y' = u;");
        for shape in ["constant", "linear"] {
            let rest =
                format!("horizon 1; controls {shape}; minimize final((y - 1)^2) + 0.01*p^2;");
            close(optimum(&body, &rest).0, least, 1e-8);
        }
    }
    let body = "param q = 2*p; state y in [0, q/2] = 0; control u in [-5, 5] = 0; y' = u;";
    close(
        optimum(body, "horizon 1; minimize final((y - 2)^2) + p^2;").0,
        2.0,
        1e-8,
    );
    // The range of what is computed is one of p: q <= 1 says p <= 1/2.
    let body = "param q in [0, 3] = 2*p; state y = 1; y' = -q;";
    close(optimum(body, "horizon 1; minimize final(y);").1, -2.0, 1e-8);
}

/// Friction μ that would have to be negative for the target is zero: from 1, half a second takes it to 1/2.
#[test]
fn coefficients_of_contacts_keep_their_ranges() {
    let text = "model m {
          param mu in [-1, 2] = 0.3; param k = mu/2;
          state q[2] = [0, 0]; state v[2] = [1, 0]; q' = v;
          mechanics q, v { mass = eye(2); force = [0, -9.81];
            contact floor { gap = q[2]; slip = v[1]; friction = 2*k; restitution = 0; } }
        }
        optimize o of m { horizon 0.5; intervals 4; elements 2; lower impact;
          minimize final((q[1] - 0.8)^2); free { mu; } }";
    let found = solved_optimum(text, "o");
    close(
        found.objective.expect("an optimum has an objective"),
        0.09,
        1e-6,
    );
}

/// What has to be a number before the run does not follow a free parameter in silence.
#[test]
fn what_cannot_follow_is_an_error() {
    let (goal, decay) = ("horizon 1; minimize final(y);", "state y = 1; y' = -p*y;");
    for (body, experiment) in [
        (decay, "horizon 1; intervals 2*p; minimize final(y);"),
        (decay, "horizon 1; tolerance 1e-6*p; minimize final(y);"),
        (decay, "horizon 1; starts p; minimize final(y);"),
        ("control u in {-p, p} = p; state y = 1; y' = u;", goal),
        ("param n in {1, 2} = p; state y = 1; y' = -n*y;", goal),
        ("state y = 1; y' = if p > 1 then -y else y;", goal),
        (
            "state y = 1; switch h = hysteresis(y, on = p, off = 0, start = 1); y' = -h;",
            goal,
        ),
    ] {
        let text = format!(
            "model m {{ param p in [0.1, 3] = 1; {body} }}
             optimize o of m {{ {experiment} free {{ p; }} }}"
        );
        assert_eq!(codes(&text), ["E0527"], "{text}");
    }
    let within = "model m { param p in [0.1, 3] = 2; state y = 1; y' = if p > 1 then -y else y; }
        optimize o of m { horizon 1; minimize final(y); free { p in [1.5, 2]; } }";
    assert!(codes(within).is_empty());
}

#[test]
fn simulations_beside_the_optimum_are_not_better() {
    let wrong: Vec<String> = (free::instances(Extent::Short).iter())
        .filter_map(|instance| Some(format!("{}: {}", instance.name, instance.judge().err()?)))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// No time is no start but the first one, and no run besides.
#[test]
fn a_time_limit_bounds_all_starts() {
    let text = "model m { state x = 1; control u in [-1, 1] = 0; x' = u - sign(x); }
        optimize o of m { horizon 1; intervals 4; minimize final((x + 0.3)^2); starts 50 by gauss(0.5); }";
    let request = Request {
        limit: Limit::within(Duration::ZERO),
        ..Request::default()
    };
    let found = with_experiment(text, "o", |compiled| {
        let (system, settings) = (&compiled.system, &compiled.settings);
        let task = settings.optimize.as_ref().expect("an optimization");
        optimize::run(system, settings, task, &[], &request, &mut ())
            .expect("the problem can be discretized")
            .trajectory
    });
    assert_eq!(found.status, Status::TimeLimit);
    let optimum = found.optimum.expect("what is known of the starts");
    assert_eq!((optimum.starts, optimum.check), (1, None));
}

/// Rows of values of the whole run hold at the end, in whatever block they stand: ∫ u² is least with u = 0.6.
#[test]
fn rows_of_the_whole_run_hold_at_the_end() {
    for rows in [
        "subject to { integral(u) >= 0.6; }",
        "subject to { final(z) >= 0.6; }",
        "subject to { final(z) = 0.6; } at nodes;",
        "initial { 2*final(z) - integral(u) >= 0.6; }",
        "final { integral(u) = 0.6; z <= 1; }",
    ] {
        let text = format!(
            "model m {{ control u in [0, 1] = 0; state z = 0; z' = u; }}
             optimize o of m {{ horizon 1; intervals 3; minimize integral(u^2); {rows} }}"
        );
        let found = solved_optimum(&text, "o");
        close(found.objective.expect("an optimum has one"), 0.36, 1e-6);
    }
}

/// The report says what free parameters are at the optimum: e^(-2p) = 0.6.
#[test]
fn the_optimum_tells_their_values() {
    let text = "model m { param p in [0.1, 3] = 1.3; param k[2] in [0, 2] = [1, 1]; state y = 1; state z = 0;
          y' = -2*p*y; z' = k[2]; }
        optimize o of m { horizon 1; intervals 2; minimize (k[2] - 0.5)^2 + k[1]^2 + p;
          subject to { final(y) <= 0.6; } free { p; k; } }";
    let found = solved_optimum(text, "o");
    let optimum = found.optimum.as_ref().expect("how it was found");
    let names: Vec<&str> = optimum
        .values
        .free
        .iter()
        .map(|(name, _)| &name[..])
        .collect();
    assert_eq!(names, ["p", "k[1]", "k[2]"]);
    for ((_, value), exact) in optimum
        .values
        .free
        .iter()
        .zip([-0.5 * 0.6_f64.ln(), 0.0, 0.5])
    {
        close(*value, exact, 1e-6);
    }
    let report = nsdc::report::forms::text::write(&found);
    assert!(report.contains("p    = 0.25541"), "{report}");
}
