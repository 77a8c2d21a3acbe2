//! Optimal control of systems with algebraic states.

use nsd_tests::{fitted_order, with_experiment};
use nsdc::optimize;
use nsdc::report::{Status, Trajectory};

/// Solves the experiment `this` of a text; a simulation by events with the controls comes to the same end and cost.
fn optimum(text: &str, within: f64) -> Trajectory {
    let found = nsd_tests::optimum(text, "this");
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    let check = found.optimum.as_ref().and_then(|optimum| optimum.check);
    let check = check.expect("what was found is simulated");
    assert!(
        check.terminal_error < within,
        "{} in {text}",
        check.terminal_error
    );
    assert!(
        check.objective_error.abs() < within,
        "{} in {text}",
        check.objective_error
    );
    found
}

fn objective(found: &Trajectory) -> f64 {
    found.objective.expect("what was minimized")
}

#[test]
fn an_equation_and_its_solution_cost_the_same() {
    let cost = |model: &str| {
        let text = format!(
            "model m {{ control u in [-2, 2] = 0; {model} }} optimize this of m {{ horizon 2; intervals 8; elements 3;
             scheme radau_iia(3); minimize integral(u^2 + x^2); final {{ x = 0.5; }} }}"
        );
        objective(&optimum(&text, 1e-6))
    };
    let explicit = cost("state z = 1; let x = z + z^3; z' = (u - z)/(1 + 3*z^2);");
    let implicit = cost("state x = 2; algebraic z = 1; 0 = z + z^3 - x; x' = u - z;");
    assert!(
        (explicit - implicit).abs() < 1e-5,
        "{explicit} and {implicit}"
    );
}

#[test]
fn pairs_with_two_continuous_members_keep_the_order_of_the_scheme() {
    // Full speed down: x' = -1 - 3x, x = 4/3 e^(-3t) - 1/3 until x = 0 at t = ln(4)/3, and x' = -1 from there.
    let exact = 4.0_f64.ln() / 3.0 - 1.0;
    for (nodes, grids) in [(2.0, &[2, 3, 4, 6, 8, 11][..]), (3.0, &[2, 3, 4, 5, 6])] {
        let errors: Vec<(usize, f64)> = grids
            .iter()
            .map(|&intervals| {
                let text = format!(
                    "model m {{ state x = 1; control u in [-1, 1] = 0; algebraic a = 1;
                     0 <= a perp a - x >= 0; x' = u - 3*a; }}
                     optimize this of m {{ horizon 1; intervals {intervals}; elements 2;
                     scheme radau_iia({nodes}); minimize final(x); }}"
                );
                let error = (objective(&optimum(&text, 0.1)) - exact).abs();
                (intervals, error)
            })
            .collect();
        let order = fitted_order(&errors);
        let least = 2.0 * nodes - 1.3;
        assert!(
            order >= least,
            "{nodes} nodes: order {order:.2} from {errors:?}"
        );
    }
}

#[test]
fn controls_act_through_equations() {
    // q³ + q = c has the root 2/√3 sinh(asinh(3√3/2 c)/3).
    let root = "let s = 1.5*sqrt(3)*c; let q = 2/sqrt(3)*sinh(log(s + sqrt(s^2 + 1))/3);";
    let cost = |equation: &str, horizon: f64| {
        let text = format!(
            "model m {{ control u in [-1.5, 1.5] = 0; state x = 1; let c = u - x; {equation} x' = q + x/4; }}
             optimize this of m {{ horizon {horizon}; intervals 6; elements 1; scheme radau_iia(3);
             minimize integral(x^2 + 0.1*u^2 + q^2/50) + final(x^2); }}"
        );
        objective(&optimum(&text, 1e-6))
    };
    let explicit = cost(root, 2.0);
    let implicit = cost("algebraic q = 0; 0 = q^3 + q - c;", 2.0);
    assert!(
        (explicit - implicit).abs() < 1e-9,
        "{explicit} and {implicit}"
    );
}

/// A switch on the side of u that x is on.
const SWITCHED: &str = "control u in [-1.5, -0.75] = -1; state x = 0;
    algebraic q = 0; 0 = q^3 + q - (u - x); x' = u - sign(q)/2;";

#[test]
fn switches_follow_controls() {
    // x falls at both sides, so that q rises through zero, where u jumps or in between.
    let s = "let s = 1.5*sqrt(3)*(u - x); let q = 2/sqrt(3)*sinh(log(s + sqrt(s^2 + 1))/3);";
    let cost = |model: &str| {
        let text = format!(
            "model m {{ {model} }} optimize this of m {{ horizon 3; intervals 4; elements 2; scheme radau_iia(3);
             minimize integral((u + 1)^2) + final((x + 3.5)^2); }}"
        );
        optimum(&text, 1e-8)
    };
    let implicit = cost(SWITCHED);
    let explicit = SWITCHED.replace("algebraic q = 0; 0 = q^3 + q - (u - x);", s);
    let (a, b) = (objective(&cost(&explicit)), objective(&implicit));
    assert!((a - b).abs() < 1e-8, "{a} and {b}");
    let crossings = implicit.history.switch_times();
    assert!(
        crossings.len() == 1 && crossings[0] > 0.5 && crossings[0] < 2.5,
        "{crossings:?}"
    );
    // At the start x = 0 and q³ + q = u.
    let all = || {
        implicit
            .samples
            .states
            .iter()
            .chain(&implicit.samples.outputs)
    };
    let q = all().find(|series| series.name == "q").map(|q| q.values[0]);
    let (q, u) = (
        q.expect("it is recorded"),
        implicit.samples.controls[0].values[0],
    );
    assert!((q.powi(3) + q - u).abs() < 1e-9, "{q} at {u}");
}

#[test]
fn algebraic_states_start_where_they_are_guessed() {
    let text = format!(
        "model m {{ {SWITCHED} }} optimize this of m {{ horizon 2; intervals 2; elements 2; scheme radau_iia(1);
         minimize final(x^2); guess {{ x = -time; q = -0.5 + time/4; }} }}"
    );
    with_experiment(&text, "this", |compiled| {
        let settings = &compiled.settings;
        let task = settings.optimize.as_ref().expect("an optimization");
        let program = optimize::program(&compiled.system, settings, task, &[]);
        let program = program.expect("the program is small");
        let guess = |name: &str| {
            let place = program.names().iter().position(|known| known == name);
            program.bounds()[place.expect(name)].guess
        };
        assert_eq!(guess("start(q)[1,1,0]"), -0.5);
        assert_eq!(guess("start(q)[2,1,0]"), -0.25);
        // λ of q where the second interval begins.
        assert_eq!(guess("lambda_n[q][2,1,0]"), 0.25);
        insta::assert_snapshot!("following.fesd", program);
    });
}

#[test]
fn free_parameters_and_initial_values_act_through_equations() {
    // z³ + z = k x with x(0) = 1, ∫ z dt = ½ needs the right k, and with k = 1 the right x(0).
    let solved = |decided: &str| {
        let text = format!(
            "model m {{ param k in [0.1, 5] = 1; state x = 1; state y = 0; algebraic z = 0.5; 0 = z^3 + z - k*x;
               x' = -z; y' = z; }}
             optimize this of m {{ horizon 1; intervals 3; elements 1; scheme radau_iia(4);
               minimize integral(0*z); final {{ y = 0.5; }} {decided} }}"
        );
        optimum(&text, 1e-8)
    };
    let value = |found: &Trajectory, name: &str| {
        let mut all = found.samples.states.iter().chain(&found.samples.outputs);
        let series = all.find(|series| series.name == name);
        series.expect("it is recorded").values[0]
    };
    // (3z² + 1) z' = -k z: 3/2 (z(0)² - z(1)²) + ln(z(0)/z(1)) = k.
    let root = |c: f64| {
        (0..60).fold(c.cbrt(), |z, _| {
            z - (z.powi(3) + z - c) / (3.0 * z * z + 1.0)
        })
    };
    let missed = |k: f64, x: f64| {
        let (from, to) = (root(k * x), root(k * (x - 0.5)));
        1.5 * (from * from - to * to) + (from / to).ln() - k
    };
    // What is reported at the start belongs to what was found.
    let by_parameter = solved("free { k; }");
    let z = value(&by_parameter, "z");
    assert!((z - 0.5).abs() > 0.05, "another k than guessed: {z}");
    let error = missed(z.powi(3) + z, 1.0);
    assert!(error.abs() < 1e-5, "{error}");
    let by_start = solved("initial { x free in [0.6, 5]; }");
    let (x, z) = (value(&by_start, "x"), value(&by_start, "z"));
    assert!((x - 1.0).abs() > 0.05, "another start than guessed: {x}");
    let error = missed(1.0, x);
    assert!(error.abs() < 1e-8, "{error}");
    assert!((z - root(x)).abs() < 1e-5, "{z} at {x}");
}

#[test]
fn complementarities_follow_what_is_decided() {
    let cost = |model: &str, task: &str| {
        let text = format!(
            "model m {{ {model} }} optimize this of m {{ horizon 1; intervals 4; elements 2; {task} }}"
        );
        objective(&optimum(&text, 1e-4))
    };
    for (rest, explicit, implicit, task) in [
        // A program that clips a control.
        (
            "state x = 1; control u in [-3, 3] = 0; x' = z - x/5;",
            "let z = sat(u);",
            "z in argmin (z - u)^2 subject to { -1 <= z <= 1; }",
            "minimize integral(x^2 + u^2/100);",
        ),
        // A force of what a control pushes against.
        (
            "state x = 1; control u in [-1, 1] = 0; x' = u - 3*a;",
            "let a = max(x + u, 0);",
            "algebraic a = 0; 0 <= a perp a - x - u >= 0;",
            "minimize integral(x^2 + u^2);",
        ),
        // A free initial value.
        (
            "state x = 1; control u in [-1, 1] = 0; x' = u - 3*a;",
            "let a = max(x, 0);",
            "algebraic a = 0; 0 <= a perp a - x >= 0;",
            "minimize integral(x^2) + final(x); initial { x free in [0.5, 2]; }",
        ),
        // A free parameter.
        (
            "state x = 1; param k in [0.5, 2] = 1; x' = -1 - 3*a;",
            "let a = max(k*x, 0);",
            "algebraic a = 0; 0 <= a perp a - k*x >= 0;",
            "minimize final((x + 0.5)^2) + (k - 1.5)^2; free { k; }",
        ),
    ] {
        let explicit = cost(&format!("{rest} {explicit}"), task);
        let implicit = cost(&format!("{rest} {implicit}"), task);
        assert!(
            (explicit - implicit).abs() < 1e-6,
            "{explicit} and {implicit}: {rest}"
        );
    }
}
