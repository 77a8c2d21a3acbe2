//! Laws without a derivative at zero, against closed forms.

use nsd_tests::{end, run, solved, times};
use nsdc::report::{EventKind, Failure, Status, Trajectory, Warning};

/// By events, to 1e-12.
fn by_events(model: &str, horizon: f64) -> Trajectory {
    let text = format!(
        "model m {{ {model} }}
         simulate run of m {{ tolerance 1e-12; horizon {horizon:?}; }}"
    );
    let run = solved(&text, "run");
    let mut warnings = run.warnings.iter();
    assert!(warnings.all(|warning| warning.code != "W0719"));
    run
}

fn close(found: f64, exact: f64, within: f64) {
    assert!((found - exact).abs() <= within, "{found}, not {exact}");
}

#[test]
fn a_tank_runs_empty_and_stays_so() {
    // √h = 1 - 0.65 t.
    let model = "state h = 1; h' = -1.3*sqrt(max(h, 0));";
    let early = by_events(model, 1.2);
    close(end(&early, "h")[0], 0.22_f64.powi(2), 1e-13);
    let late = by_events(model, 4.0);
    close(end(&late, "h")[0], 0.0, 1e-13);
    close(times(&late, EventKind::EnterSliding)[0], 2.0 / 1.3, 1e-8);
    // √h = tan(π/4 - t/2) is no polynomial.
    let curved = by_events("state h = 1; h' = -sqrt(max(h, 0))*(1 + h);", 4.0);
    close(end(&curved, "h")[0], 0.0, 1e-13);
    close(
        times(&curved, EventKind::EnterSliding)[0],
        std::f64::consts::FRAC_PI_2,
        1e-7,
    );
}

#[test]
fn an_empty_tank_stays_empty_until_something_flows_in() {
    let still = by_events("state h = 0; h' = -sqrt(max(h, 0));", 1.0);
    assert_eq!(end(&still, "h"), [0.0]);
    // h = t²/4 solves h' = t - √h with √h = t/2.
    let model = "state h = 0; h' = max(time - 1, 0) - sqrt(max(h, 0));";
    close(end(&by_events(model, 2.0), "h")[0], 0.25, 1e-12);
    // The second one fills from the first, whose outflow has no series at zero: h₁ = t²/4 for an inflow t.
    let two = "state h = 0; state y = 0; h' = time - sqrt(max(h, 0)); y' = sqrt(max(h, 0)) - sqrt(max(y, 0));";
    let filled = by_events(two, 1.0);
    // y = c² t²: 2 c² = 1/2 - c.
    let c = ((5.0_f64).sqrt() - 1.0) / 4.0;
    close(end(&filled, "y")[0], c * c, 1e-11);
}

#[test]
fn an_orifice_equalizes_two_tanks() {
    // p' = -1.5 √p from 1 until 4/3.
    let model = "state a = 1; state b = 0; let p = a - b; let q = sign(p)*sqrt(abs(p)); a' = -q; b' = 0.5*q;";
    let tanks = by_events(model, 3.0);
    close(end(&tanks, "a")[0], 1.0 / 3.0, 1e-12);
    close(end(&tanks, "b")[0], 1.0 / 3.0, 1e-12);
    close(times(&tanks, EventKind::EnterSliding)[0], 4.0 / 3.0, 1e-8);
}

#[test]
fn a_hertz_impact_loses_nothing() {
    // Depth d with v²/2 = k d^2.5/2.5; 2 d/v B(2/5, 1/2)/2.5 long, B(2/5, 1/2) = 3.679 093 980 406.
    let model = "state q = 1; state v = -2; q' = v; v' = 100*max(-q, 0)^1.5;";
    let hit = by_events(model, 2.0);
    close(end(&hit, "v")[0], 2.0, 2e-12);
    let crossings = times(&hit, EventKind::Crossing);
    close(crossings[0], 0.5, 1e-13);
    let depth = 0.05_f64.powf(0.4);
    close(crossings[1] - crossings[0], depth * BETA / 2.5, 1e-11);
}

/// B(2/5, 1/2).
const BETA: f64 = 3.679_093_980_405_881;

#[test]
fn transversal_zeros_are_crossed() {
    // t = ∫ dx/(1.5 - √|x|): with u = √|x|, 2 ∫ u du/(1.5 - u) = -2 u - 3 ln(1 - u/1.5).
    let to = |u: f64| -2.0 * u - 3.0 * (1.0 - u / 1.5).ln();
    let start = 0.5_f64.sqrt();
    let model = "state x = -0.5; x' = 1.5 - sqrt(abs(x));";
    let crossed = by_events(model, to(start) + to(1.0));
    close(end(&crossed, "x")[0], 1.0, 2e-12);
    close(times(&crossed, EventKind::Crossing)[0], to(start), 1e-12);
    // 3/4 (1 + 2^(4/3))
    let cubic = by_events("state x = -1; state y = 0; x' = 1; y' = abs(x)^(1/3);", 3.0);
    close(
        end(&cubic, "y")[0],
        0.75 * (1.0 + 2.0_f64.powf(4.0 / 3.0)),
        1e-12,
    );
}

#[test]
fn cube_roots_are_odd() {
    // 3/4 (2^(4/3) - 1)
    let crossed = by_events("state x = -1; state y = 0; x' = 1; y' = cbrt(x);", 3.0);
    let exact = 0.75 * (2.0_f64.powf(4.0 / 3.0) - 1.0);
    close(end(&crossed, "y")[0], exact, 1e-12);
    // |x|^(2/3) = 4 - 2/3 t from either side, and rest.
    for start in ["8", "cbrt(-512)"] {
        let model = format!("state x = {start}; x' = -cbrt(x);");
        let early = by_events(&model, 4.5);
        close(end(&early, "x")[0].abs(), 1.0, 1e-12);
        let late = by_events(&model, 7.0);
        close(end(&late, "x")[0], 0.0, 1e-12);
        close(times(&late, EventKind::EnterSliding)[0], 6.0, 1e-7);
    }
}

#[test]
fn cube_roots_of_what_has_one_sign_need_no_switch() {
    // The integrals of x cbrt(1 + x²), cbrt((1 + x²)³), cbrt(x²) and cbrt(x³) from -1 to 2.
    let (root, cube) = (|u: f64| 0.375 * u.powf(4.0 / 3.0), |x: f64| x.powi(3) / 3.0);
    let cases = [
        ("x*cbrt(1 + x^2)", root(5.0) - root(2.0)),
        ("-x*cbrt(-exp(log(1 + x^2)))", root(5.0) - root(2.0)),
        ("cbrt((1 + x^2)^3)", 3.0 + cube(2.0) - cube(-1.0)),
        ("cbrt(x^2)", 0.6 * (1.0 + 2.0_f64.powf(5.0 / 3.0))),
        ("cbrt(x^3)", 1.5),
    ];
    for (law, exact) in cases {
        let run = by_events(
            &format!("state x = -1; state y = 0; x' = 1; y' = {law};"),
            3.0,
        );
        close(end(&run, "y")[0], exact, 1e-11);
    }
}

#[test]
fn roots_of_time_and_norms_pass_through_zero() {
    let root = by_events("state x = 0; x' = sqrt(time);", 3.0);
    close(end(&root, "x")[0], 2.0 * 3.0_f64.sqrt(), 1e-12);
    let norm = by_events(
        "state q[2] = [-0.6, -0.8]; state y = 0; q' = [0.6, 0.8]; y' = norm(q);",
        3.0,
    );
    close(end(&norm, "y")[0], 2.5, 1e-12);
}

#[test]
fn what_starts_at_rest_in_the_zero_leaves_it() {
    let model = "state x = 0; state v = 0; state y = 0; x' = v; v' = 1; y' = sqrt(max(x, 0));";
    // y' = t/√2.
    close(end(&by_events(model, 2.0), "y")[0], 2.0_f64.sqrt(), 1e-11);
}

#[test]
fn a_root_that_repels_has_several_solutions() {
    for law in ["sqrt(abs(x))", "sqrt(max(x, 0))", "abs(x)^(2/3)", "cbrt(x)"] {
        let text =
            format!("model m {{ state x = 0; x' = {law}; }} simulate run of m {{ horizon 1; }}");
        let run = run(&text, "run");
        assert_eq!(run.status, Status::NumericalFailure);
        let failure = Warning::of(run.failure.as_ref().unwrap());
        assert_eq!(failure.code, "E0701", "{law}");
    }
    // Without a root in it the rate is Lipschitz continuous.
    let smooth = by_events("state x = 0; x' = max(x, 0)^1.5;", 1.0);
    assert_eq!(end(&smooth, "x"), [0.0]);
}

/// A spiral that ends, x' = -1.5 √|x| sign x + w, w' = -1.1 sign x + `push`, to a horizon of 10, with a tolerance.
fn twisted(s: &str, push: &str, tolerance: f64) -> Trajectory {
    let text = format!(
        "model m {{
           state x = 1; state w = 0; let s = {s};
           x' = -1.5*sqrt(abs(s))*sign(s) + w; w' = -1.1*sign(s) + {push};
         }}
         simulate run of m {{ tolerance {tolerance:e}; horizon 10; }}"
    );
    solved(&text, "run")
}

#[test]
fn super_twisting_comes_to_its_origin_and_stays_there() {
    // With √|x| and dt = 2√|x| dτ all is linear between crossings.
    let (k, l) = (1.5, 1.1);
    let omega = f64::sqrt(2.0 * l - 0.25 * k * k);
    let first = f64::atan(2.0 * omega / k) / omega;
    let speed = f64::sqrt(2.0 * l) * (-0.5 * k * first).exp();
    let ratio = (-0.5 * k * std::f64::consts::PI / omega).exp();
    for (tolerance, within) in [(1e-4, 1e-2), (1e-5, 1e-3), (1e-8, 1e-6), (1e-11, 1e-8)] {
        let run = twisted("x", "0", tolerance);
        assert!(run.warnings.iter().all(|warning| warning.code != "W0701"));
        close(end(&run, "x")[0], 0.0, 1e-15);
        close(end(&run, "w")[0], 0.0, 1e-15);
        let crossings = times(&run, EventKind::Crossing);
        close(crossings[0], speed / l, 10.0 * tolerance);
        close(crossings[1], speed / l * (2.0 + ratio), 10.0 * tolerance);
        let zeno = times(&run, EventKind::Zeno);
        close(zeno[0], 2.0 * speed / (l * (1.0 - ratio)), within);
    }
}

#[test]
fn super_twisting_stays_where_its_disturbance_is_slower_than_its_relay() {
    // w follows the disturbance, as far as the relay can.
    let held = twisted("x", "0.6*cos(3*time)", 1e-8);
    close(end(&held, "x")[0], 0.0, 1e-15);
    close(end(&held, "w")[0], 0.0, 1e-14);
    let tracked = twisted("x - 0.5*sin(time)", "0", 1e-8);
    close(end(&tracked, "x")[0], 0.5 * 10.0_f64.sin(), 1e-8);
    close(end(&tracked, "w")[0], 0.5 * 10.0_f64.cos(), 1e-8);
    // A relay that is too weak holds nothing: w' ≥ 0.4.
    let pushed = twisted("x", "1.5", 1e-8);
    assert!(end(&pushed, "w")[0] > 3.9);
    assert!(times(&pushed, EventKind::Zeno).is_empty());
}

#[test]
fn a_plain_root_that_comes_to_its_end_is_told_with_what_goes_on() {
    let text = "model m { state h = 1; h' = -0.1 - 1.3*sqrt(h); } simulate run of m { horizon 4; }";
    let run = run(text, "run");
    let failure = run.failure.as_ref().unwrap();
    assert_eq!(Warning::of(failure).code, "E0706");
    let shown = format!("{failure:?}");
    assert!(
        shown.contains("`max(h, 0)` in it goes on at zero"),
        "{shown}"
    );
}

#[test]
fn what_a_spiral_moves_is_moved_where_it_ends() {
    // ∫ sign s dt is what w has lost: w' = -2 sign s + cos(time)/2.
    let text = "model m {
          state x = 1; state w = 1; state y = 0;
          x' = -1.5*sqrt(abs(x))*sign(x) + w; w' = -2*sign(x) + 0.5*cos(time); y' = sign(x);
        }
        simulate run of m { tolerance 1e-6; horizon 10; }";
    let run = solved(text, "run");
    let lost = 1.0 + 0.5 * 10.0_f64.sin();
    close(end(&run, "w")[0], 0.0, 1e-14);
    close(end(&run, "y")[0], 0.5 * lost, 1e-9);
}

/// Models with their ends after 4, and the state whose rate has a root.
const MODELS: [(&str, &str, f64, &str); 6] = [
    ("state h = 1; h' = -1.3*sqrt(max(h, 0));", "h", 0.0, "h"),
    ("state h = 0; h' = -2*max(h, 0)^(1/3);", "h", 0.0, "h"),
    (
        "state x = 0; state v = 0; state y = 0; x' = v; v' = 1; y' = sqrt(max(x, 0));",
        "y",
        // y' = t/√2.
        5.656_854_249_492_381,
        "y",
    ),
    (
        "state q = 0.6; state v = -1.3; q' = v; v' = 20*max(-q, 0)^1.5;",
        "v",
        1.3,
        "v",
    ),
    (
        "state a = 1; state b = 1; let p = a - b; a' = 0.5 - sign(p)*sqrt(abs(p)); b' = 0.5 + sign(p)*sqrt(abs(p));",
        "a",
        3.0,
        "a",
    ),
    (
        "state x = 1; state w = 0; x' = -1.5*sqrt(abs(x))*sign(x) + w; w' = -1.1*sign(x);",
        "w",
        0.0,
        "x",
    ),
];

#[test]
fn other_methods_are_right_or_name_the_root() {
    for method in [
        "fesd;",
        "fesd; lower step;",
        "adaptive;",
        "timestepping { steps = 400; }",
    ] {
        for (model, state, exact, rooted) in MODELS {
            let text =
                format!("model m {{ {model} }} simulate run of m {{ horizon 4; method {method} }}");
            let run = run(&text, "run");
            let is_close = (end(&run, state)[0] - exact).abs() <= 1e-5;
            let mut warnings = run.warnings.iter();
            let names =
                |w: &Warning| w.code == "W0726" && w.message.contains(&format!("`{rooted}`"));
            let is_named = run.status != Status::Solved && warnings.any(names);
            // Its label has the term with the steepest slope.
            let is_steep = matches!(run.failure, Some(Failure::NotFinite { .. }));
            assert!(is_close || is_named || is_steep, "{method} {model}");
        }
    }
}

#[test]
fn extrapolation_strikes_springs_and_stops_at_what_is_no_number() {
    let (model, state, exact, _) = MODELS[3];
    let adaptive = |model: &str| {
        let text =
            format!("model m {{ {model} }} simulate run of m {{ horizon 4; method adaptive; }}");
        run(&text, "run")
    };
    let struck = adaptive(model);
    assert_eq!(struck.status, Status::Solved);
    close(end(&struck, state)[0], exact, 1e-6);
    let ended = adaptive("state x = 1; state w = 0; x' = sqrt(0.5 - time); w' = 1;");
    assert!(matches!(ended.failure, Some(Failure::NotFinite { .. })));
}

/// From rest h = a (t - 2)² with 2 a + k √a = c: where k² is large beside c, it relaxes faster than it grows.
#[test]
fn an_empty_tank_is_filled_again() {
    for (inflow, outflow) in [(0.1, 0.3), (0.9, 0.76), (5.0, 1.0), (0.1, 2.0), (0.01, 3.0)] {
        let model =
            format!("state h = 0.02; h' = {inflow}*max(0, time - 2) - {outflow}*sqrt(max(h, 0));");
        let root = 2.0 * inflow / (outflow + f64::hypot(outflow, f64::sqrt(8.0 * inflow)));
        let text = format!("model m {{ {model} }} simulate run of m {{ horizon 4; }}");
        let h = end(&solved(&text, "run"), "h")[0];
        close(h, (2.0 * root).powi(2), 1e-8);
    }
}

/// From rest, h leaves by a (t - 2)² on the side of its root, however rounding has left it there, and no step takes a
/// slope k/(2√h) that is no longer there for the one at its end.
#[test]
fn a_tank_is_filled_again_from_what_rounding_has_left_in_it() {
    for (inflow, outflow, start) in [
        (0.253, 1.57, 0.03),
        (0.235, 1.24, 0.02),
        (0.71, 2.34, 0.02),
        (0.009631504890506523, 2.045600547845775, 0.01157171899014097),
    ] {
        let text = format!(
            "model m {{
               state h = {start};
               h' = {inflow}*max(time - 2, 0) - {outflow}*sqrt(max(h, 0));
             }}
             simulate run of m {{ horizon 4; }}"
        );
        let run = solved(&text, "run");
        let root = (f64::sqrt(outflow * outflow + 8.0 * inflow) - outflow) / 4.0;
        close(end(&run, "h")[0], (2.0 * root).powi(2), 1e-10);
        assert!(run.warnings.iter().all(|warning| warning.code != "W0701"));
    }
}
