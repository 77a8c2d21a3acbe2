//! Constraints that may be missed at a cost, convex kinks of objectives, and complementarity of expressions as a constraint,
//! against closed forms.

use nsdc::expr::Exprs;
use nsdc::limit::Limit;
use nsdc::report::Trajectory;
use nsdc::{Project, optimize};

use nsd_tests::{agrees, assert_near, codes, end, solved_optimum, with_experiment};

/// x'' = u from rest.
const CART: &str =
    "model m { param w = 3; state x = 0; state v = 0; control u in [-9, 9] = 0; x' = v; v' = u; }";
/// Control intervals.
const N: f64 = 10.0;

fn best(model: &str, task: &str) -> Trajectory {
    let text = format!("{model} optimize o of m {{ {task} }}");
    let found = solved_optimum(&text, "o");
    agrees(&found, 1e-8);
    found
}

fn objective(found: &Trajectory) -> f64 {
    found.objective.expect("an optimum has one")
}

/// The term of an objective that is written so.
fn term(found: &Trajectory, text: &str) -> f64 {
    let optimum = found.optimum.as_ref().expect("it is an optimum");
    let terms = &optimum.values.terms;
    let own = terms.iter().find(|term| term.text == text);
    own.unwrap_or_else(|| panic!("no `{text}` in {terms:?}"))
        .value
}

/// From rest to rest in one unit of time over d, with controls in N intervals, ∫ u² is at least e d².
fn effort() -> f64 {
    12.0 / (1.0 - 1.0 / (N * N))
}

#[test]
fn an_exact_penalty_is_the_constraint() {
    // The multiplier of x = d is 2 e d = 24.2 d.
    let strict = effort() * 0.1 * 0.1;
    for weight in ["2.5", "w", "1e4"] {
        let rows = format!("final {{ x = 0.1; }} soft l1 weight {weight}; final {{ v = 0; }}");
        let task = format!("horizon 1; intervals 10; minimize integral(u^2); {rows}");
        let found = best(CART, &task);
        assert_near(&[objective(&found)], &[strict], 1e-8);
        assert_near(&end(&found, "x"), &[0.1], 1e-8);
        assert_near(&[term(&found, "soft x = 0.1 at the end")], &[0.0], 1e-8);
    }
}

#[test]
fn what_is_not_worth_it_is_missed() {
    // e d² + w (1 - d) is least at d = w/(2 e), with a row of either side or of both.
    let (w, e) = (2.0, effort());
    let d = w / (2.0 * e);
    for rows in [
        "final { x = 1; } soft l1 weight 2;",
        "final { x >= 1; } soft l1 weight 2;",
        "final { -1 <= -x; 1 <= x <= 2; } soft l1 weight 2;",
    ] {
        let task =
            format!("horizon 1; intervals 10; minimize integral(u^2); {rows} final {{ v = 0; }}");
        let found = best(CART, &task);
        assert_near(&end(&found, "x"), &[d], 1e-7);
        assert_near(&[objective(&found)], &[e * d * d + w * (1.0 - d)], 1e-8);
    }
    // A row that holds costs nothing.
    let task = "horizon 1; intervals 10; minimize integral(u^2); final { x <= 1; } soft l1 weight 5; final { v = 0; x = 0.2; }";
    assert_near(&[objective(&best(CART, task))], &[0.04 * e], 1e-8);
}

#[test]
fn squares_are_missed_by_as_much_as_they_weigh() {
    // e d² + w (1 - d)² is least at d = w/(e + w), and nothing is missed where the row holds.
    let (w, e) = (5.0, effort());
    let d = w / (e + w);
    for rows in ["x = 1", "x >= 1", "-x <= -1"] {
        let task = format!(
            "horizon 1; intervals 10; minimize integral(u^2); final {{ {rows}; }} soft squared weight 5; final {{ v = 0; }}"
        );
        let found = best(CART, &task);
        assert_near(&end(&found, "x"), &[d], 1e-8);
        assert_near(&[objective(&found)], &[e * w / (e + w)], 1e-8);
    }
    let task = "horizon 1; intervals 10; minimize integral(u^2); final { x <= 1; } soft squared weight 5; final { v = 0; x = 0.2; }";
    assert_near(&[objective(&best(CART, task))], &[0.04 * e], 1e-8);
}

#[test]
fn along_the_horizon_penalties_are_integrals() {
    // Of (u - 1)² + w max(u - 1/2, 0) the least value is at 1 - w/2, and of (u - 1)² + w max(u - 1/2, 0)² at (1 + w/2)/(1 + w).
    let model = "model m { state x = 0; control u in [-9, 9] = 0; x' = u; }";
    let squared = |w: f64| {
        let u = (1.0 + 0.5 * w) / (1.0 + w);
        (u - 1.0) * (u - 1.0) + w * (u - 0.5) * (u - 0.5)
    };
    let l1 = |w: f64| 0.25 * w * w + w * (0.5 - 0.5 * w);
    for grid in [
        "intervals 3; elements 1; scheme radau_iia(1);",
        "intervals [1, 3, 2]; elements 2;",
        "intervals 2; elements 2; scheme gauss(2);",
        "intervals 4; elements 1; scheme lobatto_iiic(3);",
    ] {
        for at in ["nodes", "elements", "intervals"] {
            for (norm, least) in [("l1", l1(0.6)), ("squared", squared(0.6))] {
                let task = format!(
                    "horizon 2; {grid} minimize integral((u - 1)^2); subject to {{ u <= 0.5; }} at {at} soft {norm} weight 0.6;"
                );
                let found = best(model, &task);
                assert_near(&[objective(&found)], &[2.0 * least], 1e-8);
            }
        }
    }
}

#[test]
fn a_free_horizon_weighs_penalties_by_its_length() {
    // u² + max(u + 1/2, 0) is least at -1/2, where it is 1/4: T/4 + w (1 - T) is least at one of the ends of [1/5, 1].
    let model = "model m { state x = 0; control u in [-9, 9] = 0; x' = 1; }";
    for at in ["nodes", "elements", "intervals"] {
        for (weight, length) in [(0.2, 0.2), (0.3, 1.0)] {
            let task = format!(
                "horizon free in [0.2, 3] = 1.5; intervals 2; minimize integral(u^2);
                 subject to {{ u <= -0.5; }} at {at} soft l1 weight 1;
                 final {{ x = 1; }} soft l1 weight {weight};"
            );
            let found = best(model, &task);
            assert_near(&end(&found, "x"), &[length], 1e-8);
            let least = 0.25 * length + weight * (1.0 - length);
            assert_near(&[objective(&found)], &[least], 1e-8);
        }
    }
}

#[test]
fn convex_kinks_of_an_objective_are_no_switches() {
    let e = effort();
    let d = 1.5 / (2.0 * e);
    let cost = "integral(u^2) + abs(final(x) - 1) + max(final(v), 0.2) - min(final(v), 0.3) + 0.5*abs(final(x) - 1)";
    // Any v between 0.2 and 0.3 costs as much; at rest it costs 0.2.
    let task = format!("horizon 1; intervals 10; minimize {cost}; final {{ v = 0; }}");
    let text = format!("{CART} optimize o of m {{ {task} }}");
    with_experiment(&text, "o", |compiled| {
        assert!(compiled.system.switches.is_empty());
        let task = compiled.settings.optimize.as_ref().expect("a task");
        let program = optimize::program(&compiled.system, &compiled.settings, task, &[]);
        assert_eq!(program.expect("it has one").sizes().pairs, 0);
    });
    let found = best(CART, &task);
    assert_near(&end(&found, "x"), &[d], 1e-7);
    assert_near(
        &[objective(&found)],
        &[e * d * d + 1.5 * (1.0 - d) + 0.2],
        1e-8,
    );
    assert_near(
        &[term(&found, "0.5*abs(final(x) - 1)")],
        &[0.5 * (1.0 - d)],
        1e-7,
    );
    assert_near(&[term(&found, "max(final(v), 0.2)")], &[0.2], 1e-8);
    assert_near(&[term(&found, "-min(final(v), 0.3)")], &[0.0], 1e-8);
    // What is concave stays what it is: -|x| is least as far out as possible.
    let text = format!(
        "{CART} optimize o of m {{ horizon 1; intervals 4; minimize -abs(final(x) - 1); }}"
    );
    with_experiment(&text, "o", |compiled| {
        assert_eq!(compiled.system.switches.len(), 1)
    });
}

#[test]
fn one_of_two_expressions_is_zero() {
    // The way that goes up costs a² + (a - 1/2)².
    let model = "model m { state x = 0.5; control a in [-3, 3] = 1; control b in [-3, 3] = 0.5; x' = a - b; }";
    for at in ["nodes", "elements", "intervals"] {
        let task = format!(
            "horizon 1; intervals 5; minimize integral(a^2 + b^2) + final((x - 1)^2); subject to {{ 0 <= a perp b >= 0; }} at {at};"
        );
        let found = best(model, &task);
        assert_near(&[objective(&found)], &[0.125], 1e-8);
    }
    // A tank that does not run dry is filled as soon as it is empty, and only then: ∫ u = 1.
    let model = "model m { state x = 1; control u in [0, 3] = 0; x' = u - 1; }";
    let task = "horizon 2; intervals 4; minimize integral(-u^2); subject to { 0 <= x perp u >= 0; } at nodes;";
    let found = best(model, task);
    assert_near(&[objective(&found)], &[-1.0], 1e-7);
    // Entry by entry, at the end.
    let model = "model m { state x[2] = [1, 1]; control u[2] in [-1, 1] = 0; x' = u; }";
    let task = "horizon 3; intervals 3; minimize integral(dot(u, u)) - final(x[1]) - 2*final(x[2]); final { 0 <= x perp [2 - x[1], 3 - x[2]] >= 0; }";
    // 1² / 3 + 2² / 3 - 2 - 6
    let found = best(model, task);
    assert_near(&[objective(&found)], &[5.0 / 3.0 - 8.0], 1e-7);
}

#[test]
fn weights_are_numbers_of_a_run() {
    let text = format!(
        "{CART} optimize o of m {{ horizon 1; intervals 10; minimize integral(u^2); final {{ v = 0; }} final {{ x = 1; }} soft l1 weight 2*w; }}"
    );
    let exprs = Exprs::new();
    let project = Project::from_text("test.nsd", &text);
    let prepared = project.prepare_optimal(&exprs, "o", &["w"], &[]);
    let mut prepared = prepared.expect("it has a program");
    let e = effort();
    for w in [1.0, 3.0, 0.5] {
        let solved = prepared.solve(&[w], None, None, &Limit::default(), &mut ());
        let solved = solved.expect("weights are inputs");
        let d = w / e;
        let found = objective(&solved.trajectory);
        assert_near(&[found], &[e * d * d + 2.0 * w * (1.0 - d)], 1e-8);
    }
}

#[test]
fn what_is_no_soft_row_and_no_pair_is_told() {
    let refused = |rows: &str| {
        let text =
            format!("{CART} optimize o of m {{ horizon 1; minimize integral(u^2); {rows} }}");
        codes(&text)
    };
    for (rows, code) in [
        ("final { x = 1; } soft l3 weight 1;", "E0508"),
        ("final { x = 1; } soft l1 weight -1;", "E0504"),
        ("final { x = 1; } soft l1 weight 0/0;", "E0216"),
        ("final { x = 1; } soft l1 weight u;", "E0502"),
        ("subject to { 0 <= x perp v; }", "E0535"),
        ("subject to { x perp v; }", "E0535"),
        ("subject to { 0 <= x perp v perp u >= 0; }", "E0535"),
        ("subject to { 0 < x perp v > 0; }", "E0535"),
        ("subject to { 0 <= x perp v >= 1; }", "E0535"),
        (
            "subject to { 0 <= x perp v >= 0; } soft l1 weight 1;",
            "E0535",
        ),
    ] {
        assert_eq!(refused(rows), [code], "{rows}");
    }
    let bounced = "model m { state q = 1; state v = 0; control u in [-1, 1] = 0; q' = v; mechanics q, v { mass = 1; force = u - 9.81; contact c { gap = q; restitution = 0.5; } } }";
    let text = |rows: &str| {
        format!(
            "{bounced} optimize o of m {{ horizon 1; lower timefreezing; minimize integral(u^2); {rows} }}"
        )
    };
    assert_eq!(codes(&text("final { q = 1; } soft l1 weight 1;")), [""; 0]);
    assert_eq!(
        codes(&text("subject to { v <= 1; } at nodes soft l1 weight 1;")),
        ["E0925"]
    );
}

#[test]
fn kinks_of_terms_are_those_of_their_sum() {
    // What cancels, and what is concave in one term of a sum that is not, does not come apart; alike kinks are one.
    let e = effort();
    for (cost, weight, terms) in [
        ("abs(final(x) - 1) - 0.5*abs(final(x) - 1)", 0.5, 0),
        ("abs(final(x) - 1) - abs(final(x) - 1)", 0.0, 0),
        (
            "max(final(x), 1) - final(x) + 3*max(1 - final(x), 0)",
            4.0,
            4,
        ),
    ] {
        let task =
            format!("horizon 1; intervals 10; minimize integral(u^2) + {cost}; final {{ v = 0; }}");
        let found = best(CART, &task);
        let d = weight / (2.0 * e);
        assert_near(
            &[objective(&found)],
            &[e * d * d + weight * (1.0 - d)],
            1e-8,
        );
        let told = &found
            .optimum
            .as_ref()
            .expect("it is an optimum")
            .values
            .terms;
        assert_eq!(told.len(), terms, "{cost}: {told:?}");
        let sum: f64 = told.iter().map(|term| term.value).sum();
        assert!(
            told.is_empty() || (sum - objective(&found)).abs() < 1e-8,
            "{cost}: {told:?}"
        );
    }
}

#[test]
fn weights_that_are_chosen_are_not_negative() {
    let model =
        "model m { param w in [-1, 10] = 3; state x = 0; control u in [-9, 9] = 0; x' = u; }";
    // Nothing is cheaper than a weight of zero.
    let task = "horizon 1; intervals 2; free { w; } minimize integral(u^2); final { x = 1; } soft l1 weight w;";
    assert_near(&[objective(&best(model, task))], &[0.0], 1e-6);
}

#[test]
fn infinite_bounds_are_none_or_never_hold() {
    for (rows, least) in [
        ("final { x <= inf; v >= -inf; }", 0.0),
        ("final { -inf <= x <= inf; x = 0.1; }", 0.0),
        ("final { x <= inf; } soft l1 weight 2;", 0.0),
        ("final { -inf <= x <= inf; } soft squared weight 2;", 0.0),
    ] {
        let task =
            format!("horizon 1; intervals 4; minimize integral(u^2) + final((v - v)^2); {rows}");
        let found = best(CART, &task);
        assert!(objective(&found) >= least - 1e-9, "{rows}");
    }
    for rows in ["x = inf", "x >= inf", "x <= -inf", "inf <= x <= inf"] {
        let text = format!(
            "{CART} optimize o of m {{ horizon 1; minimize integral(u^2); final {{ {rows}; }} }}"
        );
        assert_eq!(codes(&text), ["E0518"], "{rows}");
    }
}
