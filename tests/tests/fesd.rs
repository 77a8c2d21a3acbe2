//! `method fesd` against closed forms, its orders, and the event road on the same models.

mod data;
mod elements;
mod rungs;

use std::f64::consts::{PI, SQRT_2};

use nsd_tests::{fitted_order, run, with_experiment};
use nsdc::report::{Status, Trajectory};
use nsdc::simulate::{self, Request};

const OSCILLATOR: &str = "model oscillator { \
  param omega = 2*pi; state x[2] = [exp(-1), 0]; let c = dot(x, x) - 1; \
  region inside where c < 0 { x' = [1, omega; -omega, 1]*x; } \
  region outside where c > 0 { x' = [1, -omega; omega, 1]*x; } }";

/// A block on a belt: it slips twice, sticks, and is released.
const BELT: &str = "model belt { const c = 0.3; state x = 2.4; state u = 1; \
  x' = u - 1; u' = -sign(u) - x - c*(u - 1); }";

fn simulate(model: &str, settings: &str) -> Trajectory {
    let name = model.split_whitespace().nth(1).expect("`model NAME`");
    run(
        &format!("{model}\nsimulate run of {name} {{ {settings} }}"),
        "run",
    )
}

fn end(trajectory: &Trajectory) -> Vec<f64> {
    let last = |series: &nsdc::report::Series| {
        let size = series.values.len() / trajectory.samples.time.len();
        series.values[series.values.len() - size..].to_vec()
    };
    trajectory.samples.states.iter().flat_map(last).collect()
}

/// Of the oscillator: e^(T-1) (cos 2π(T-1), sin 2π(T-1)), after its switch at t = 1.
fn exact(t: f64) -> [f64; 2] {
    let (radius, angle) = ((t - 1.0).exp(), 2.0 * PI * (t - 1.0));
    [radius * angle.cos(), radius * angle.sin()]
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt()
}

fn oscillator_error(scheme: &str, steps: usize) -> f64 {
    let settings = format!(
        "horizon pi/2; method fesd {{ scheme = {scheme}; elements = 2; steps = {steps}; }}"
    );
    let found = simulate(OSCILLATOR, &settings);
    assert_eq!(
        found.history.events.len(),
        1,
        "{scheme} with {steps} steps: {:?}",
        found.failure
    );
    distance(&end(&found), &exact(PI / 2.0))
}

#[test]
fn orders_hold_across_the_switch() {
    for (scheme, grids, least) in [
        (
            "radau_iia(2)",
            &[40, 49, 61, 75, 93, 115, 142, 176][..],
            2.9,
        ),
        ("radau_iia(3)", &[16, 19, 23, 29, 35, 43, 53, 65], 4.8),
        ("radau_iia(4)", &[9, 11, 13, 16, 19, 23, 27, 31], 6.7),
        ("gauss(2)", &[24, 29, 35, 43, 53, 65, 79, 97], 3.8),
        ("gauss(3)", &[10, 12, 15, 18, 22, 27, 33, 40], 5.7),
        ("gauss(4)", &[6, 7, 8, 10, 12, 14, 16, 19], 7.6),
    ] {
        let errors: Vec<(usize, f64)> = grids
            .iter()
            .map(|&n| (n, oscillator_error(scheme, n)))
            .collect();
        let order = fitted_order(&errors);
        assert!(order >= least, "{scheme}: order {order:.2} from {errors:?}");
    }
}

/// On y = S(t) = (exp(sin 2t) - 1)/2, x = t, where y' = 0.3 cos y - 3 s holds s = (0.3 cos S - S')/3.
const WAVE: &str = "model wave { state x = 0; state y = 0; state w = 0; x' = 1; \
  let s = sign(y - (exp(sin(2*x)) - 1)/2); y' = 0.3*cos(y) - 3*s; w' = y^2*s; }";

#[test]
fn gauss_keeps_its_order_on_a_curved_surface() {
    let surface = |t: f64| ((2.0 * t).sin().exp() - 1.0) / 2.0;
    // ∫ S² (0.3 cos S - S')/3 dt = ∫ S² cos S dt/10 - S³/9, by Simpson's rule.
    let integrand = |t: f64| surface(t).powi(2) * surface(t).cos() / 10.0;
    let (n, horizon) = (20_000, 3.0);
    let h = horizon / f64::from(n);
    let weight = |k: i32| match k {
        0 => 1.0,
        k if k == n => 1.0,
        k => 2.0 + 2.0 * f64::from(k % 2),
    };
    let terms = (0..=n).map(|k| weight(k) * integrand(f64::from(k) * h));
    let exact = terms.sum::<f64>() * h / 3.0 - surface(horizon).powi(3) / 9.0;
    for (nodes, grids, least) in [
        (2, [80, 112, 160, 224, 320], 3.8),
        (3, [20, 28, 40, 56, 80], 5.6),
        (4, [8, 10, 12, 15, 19], 7.5),
    ] {
        let error = |steps: usize| {
            let settings =
                format!("horizon 3; method fesd {{ scheme = gauss({nodes}); steps = {steps}; }}");
            let found = simulate(WAVE, &settings);
            assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
            let x = end(&found);
            // No drift: the end is on the surface.
            let off = (x[1] - surface(x[0])).abs();
            assert!(off < 1e-14, "gauss({nodes}), {steps} steps: {off:e}");
            (x[2] - exact).abs()
        };
        let errors: Vec<(usize, f64)> = grids.map(|n| (n, error(n))).into();
        let order = fitted_order(&errors);
        assert!(
            order >= least,
            "gauss({nodes}): order {order:.2} from {errors:?}"
        );
    }
}

#[test]
fn without_detection_the_order_is_one() {
    for scheme in ["radau_iia(2)", "radau_iia(3)", "radau_iia(4)"] {
        let error = |steps: usize| {
            let settings = format!(
                "horizon pi/2; method timestepping {{ scheme = {scheme}; steps = {steps}; }}"
            );
            let found = simulate(OSCILLATOR, &settings);
            assert_eq!(found.status, Status::Solved, "{scheme} {steps}");
            distance(&end(&found), &exact(PI / 2.0))
        };
        // Grids in which the switch, at t = 1, is off the nodes, and in the same part of its step.
        let middle = |n: &usize| (0.4..0.5).contains(&(*n as f64 * 2.0 / PI).fract());
        let grids = (0..9).map(|k| (120.0 * 1.35_f64.powi(k)) as usize);
        let grids = grids.filter_map(|n| (n..n + 40).find(middle));
        let errors: Vec<(usize, f64)> = grids.map(|n| (n, error(n))).collect();
        assert_eq!(errors.len(), 9);
        let order = fitted_order(&errors);
        assert!(
            (0.5..=1.5).contains(&order),
            "{scheme}: order {order:.2} from {errors:?}"
        );
    }
}

#[test]
fn time_stepping_slides_where_it_finds_the_surface() {
    for lower in ["stewart", "step"] {
        let settings = format!("horizon 2; method timestepping {{ steps = 200; }} lower {lower};");
        let found = simulate(
            "model slide { state x = -sqrt(2); x' = -sign(x); }",
            &settings,
        );
        assert_eq!(found.status, Status::Solved);
        let x = end(&found)[0];
        assert!(x.abs() < 1e-12, "{lower}: {x:e}");
        assert!(
            (found.history.events[0].time - 2.0_f64.sqrt()).abs() <= 0.011,
            "{:?}",
            found.history.events
        );
    }
}

#[test]
fn the_error_comes_down_to_rounding_and_stays_there() {
    for steps in [200, 400, 800, 1600] {
        let error = oscillator_error("radau_iia(4)", steps);
        assert!(error <= 1e-13, "{steps} steps: {error:e}");
    }
}

/// Parabolas between crossings at √2 (2k - 1): elements are equally long, so that what rounding takes from a sum of
/// their lengths is the same each time, and in a finer run, too.
#[test]
fn time_does_not_drift_over_many_switches() {
    let (n, tolerance) = (5000, 1e-10);
    let model = "model m { state x = 1; state v = 0; x' = v; v' = -sign(x); }";
    let horizon = 2.0 * SQRT_2 * f64::from(n);
    let settings = format!("horizon {horizon:?}; tolerance {tolerance:e}; method fesd;");
    let found = simulate(model, &settings);
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    let error = distance(&end(&found), &[1.0, 0.0]);
    assert!(error <= tolerance, "{error:e}");
    let estimate = found.quality.error_estimate.expect("a run has an estimate");
    assert!(error <= 10.0 * estimate, "{error:e}, estimate {estimate:e}");
    let times = found.history.switch_times();
    assert_eq!(times.len(), n as usize);
    for (k, time) in times.iter().enumerate() {
        let miss = (time - SQRT_2 * (2 * k + 1) as f64).abs();
        assert!(miss <= tolerance, "switch {k}: {miss:e}");
    }
}

#[test]
fn large_steps_are_right_or_refused() {
    for scheme in [
        "radau_iia(2)",
        "radau_iia(4)",
        "radau_iia(9)",
        "gauss(4)",
        "lobatto_iiic(4)",
        "explicit(4)",
    ] {
        for steps in [1, 2, 3, 5, 8] {
            for elements in [1, 2, 3] {
                let settings = format!(
                    "horizon pi/2; method fesd {{ scheme = {scheme}; elements = {elements}; steps = {steps}; }}"
                );
                let found = simulate(OSCILLATOR, &settings);
                if found.status == Status::Solved {
                    let error = distance(&end(&found), &exact(PI / 2.0));
                    let estimate = found.quality.error_estimate.expect("a run has an estimate");
                    assert!(error <= 0.05, "{scheme}, {steps} x {elements}: {error:e}");
                    assert!(
                        error <= 10.0 * estimate,
                        "{scheme}, {steps} x {elements}: {error:e}, {estimate:e}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_tangential_exit_is_exact() {
    let reference = simulate(BELT, "horizon 20; tolerance 1e-13;");
    let mut least = f64::INFINITY;
    for steps in [50, 100, 200] {
        let settings =
            format!("horizon 20; method fesd {{ scheme = radau_iia(4); steps = {steps}; }}");
        let found = simulate(BELT, &settings);
        assert_eq!(found.history.events.len(), 3);
        least = least.min(distance(&end(&found), &end(&reference)));
    }
    assert!(least < 1e-11, "{least:e}");
}

/// x' = ±(1 + p(t - 1)) - sign(x) slides up to t = 1, where α comes to its bound. It leaves with x = ∫ p behind it, whether α
/// passes the bound steeply, hardly at all, or like a cube, and stays where α only touches it.
#[test]
fn sliding_ends_where_its_bound_is_passed() {
    let slopes = [1.0, 0.3, 1e-2, 1e-4, 1e-6].map(|s| (format!("{s}*(time - 1)"), 2.0 * s));
    let others = [
        ("0.5*(time - 1) + 0.3*(time - 1)^2".to_owned(), 1.8),
        ("(time - 1)^3".to_owned(), 4.0),
        ("-0.1*(time - 1)^2".to_owned(), 0.0),
        ("-0.1*(time - 1)^4".to_owned(), 0.0),
    ];
    for (p, exact) in slopes.into_iter().chain(others) {
        for (sign, method) in [(1, "event"), (-1, "event"), (1, "fesd"), (-1, "fesd")] {
            let model = format!("model m {{ state x = 0; x' = {sign}*(1 + {p}) - sign(x); }}");
            let found = simulate(&model, &format!("horizon 3; method {method};"));
            let x = end(&found)[0];
            let exact = f64::from(sign) * exact;
            assert!((x - exact).abs() < 1e-8, "{method}, {p}: {x} for {exact}");
        }
    }
}

#[test]
fn both_roads_agree() {
    let models: [(&str, &str, f64); 8] = [
        (OSCILLATOR, "horizon pi/2;", 1e-9),
        (BELT, "horizon 20;", 1e-9),
        (
            "model slide { state x = -sqrt(2); x' = -sign(x); }",
            "horizon 2;",
            1e-12,
        ),
        (
            "model enter { state x = -1; state y = 0; x' = 1 - 2*step(x) - 0.5*cos(y); y' = 1; }",
            "horizon 3;",
            1e-9,
        ),
        (
            "model kink { state x = 1; state v = 0; x' = v; v' = -abs(x) - x; }",
            "horizon 4;",
            1e-9,
        ),
        (
            "model corner { state x = 0.2; state y = 0.3; state z = 0; \
             x' = 0.5 - sign(x); y' = -sign(y) + 0.2*sign(x); z' = sign(x) + sign(y); }",
            "horizon 2;",
            1e-12,
        ),
        (
            "model space { state x[3] = [0.3, -0.2, 0.4]; state y = 0; \
             x' = [0.2*cos(time); 0.1; -0.3] - sign(x); y' = dot(x, x) + sign(x[1]); }",
            "horizon 2;",
            1e-9,
        ),
        (
            "model genes { state x[2] = [5, 6]; let a = step(4 - x[2]); let b = step(x[1] - 4); \
             x' = [40*a - 4.5*x[1]; 20*b - 1.5*x[2]]; }",
            "horizon 1;",
            1e-9,
        ),
    ];
    for (model, settings, tolerance) in models {
        let event = simulate(model, &format!("{settings} tolerance 1e-11;"));
        assert_eq!(event.status, Status::Solved, "{model}");
        for lower in ["stewart", "step"] {
            let settings = format!("{settings} tolerance 1e-11; method fesd; lower {lower};");
            let fesd = simulate(model, &settings);
            assert_eq!(
                fesd.status,
                Status::Solved,
                "{model} {lower}: {:?}",
                fesd.failure
            );
            let difference = distance(&end(&event), &end(&fesd));
            assert!(difference <= tolerance, "{model} {lower}: {difference:e}");
            let what = |t: &Trajectory| -> Vec<String> {
                t.history
                    .events
                    .iter()
                    .map(|e| format!("{:?} {}", e.kind, e.surface))
                    .collect()
            };
            assert_eq!(what(&event), what(&fesd), "{model} {lower}");
            for (a, b) in event.history.events.iter().zip(&fesd.history.events) {
                assert!(
                    (a.time - b.time).abs() <= tolerance,
                    "{model} {lower}: {} {}",
                    a.time,
                    b.time
                );
            }
        }
    }
}

#[test]
fn stewarts_form_refuses_a_field_that_it_leaves_open() {
    let model = "model product { state x = 0.2; state y = 0.3; state z = 0; \
      x' = 0.5 - sign(x); y' = -sign(y); z' = sign(x)*sign(y); }";
    let settings = "horizon 2; method fesd { steps = 10; }";
    let stewart = simulate(model, &format!("{settings} lower stewart;"));
    let failure = stewart
        .failure
        .expect("θ is not determined where both slide");
    assert!(
        failure.to_string().contains("does not determine"),
        "{failure}"
    );
    // The step form takes α = (3/4, 1/2), so that z stands still.
    let step = simulate(model, &format!("{settings} lower step;"));
    let z = end(&step)[2];
    assert!((z - 0.3).abs() < 1e-13, "{z}");
}

#[test]
fn accumulating_switches_are_reported() {
    let spiral = "model spiral { state x[2] = [1, 0.2]; \
      x' = [-sign(x[1]) + 2*sign(x[2]); -2*sign(x[1]) - sign(x[2])]; }";
    let found = simulate(spiral, "horizon 2; method fesd { steps = 10; }");
    assert_ne!(found.status, Status::Solved);
}

#[test]
fn a_scheme_that_cannot_slide_says_so() {
    for scheme in ["explicit(4)", "lobatto_iiia(3)"] {
        let settings = format!("horizon 2; method fesd {{ scheme = {scheme}; steps = 10; }}");
        let found = simulate("model m { state x = -1; x' = -sign(x); }", &settings);
        let failure = found.failure.expect("ψ = 0 at the first node says nothing");
        assert!(failure.to_string().contains("cannot hold"), "{failure}");
    }
}

#[test]
fn multipliers_are_continuous_where_they_should_be() {
    let cases = [
        (
            "model through { state x = -sqrt(2); x' = 2 + sign(x); }",
            "horizon 2;",
        ),
        (
            "model slide { state x = -sqrt(2); x' = -sign(x); }",
            "horizon 2;",
        ),
        (
            "model slant { state x = -sqrt(2); x' = -1 - 2*sign(x); }",
            "horizon 2;",
        ),
        (
            "model leave { state x = -0.5; state y = 0; x' = 0.8*y - sign(x); y' = 1; }",
            "horizon 2;",
        ),
    ];
    for (model, settings) in cases {
        for lower in ["stewart", "step"] {
            let name = model.split_whitespace().nth(1).unwrap();
            let text = format!(
                "{model} simulate run of {name} {{ {settings} method fesd {{ steps = 5; }} lower {lower}; }}"
            );
            let trajectory = with_experiment(&text, "run", |compiled| {
                let request = Request {
                    multipliers: true,
                    ..Request::default()
                };
                simulate::run(&compiled.system, &compiled.settings, &request)
            });
            assert!(!trajectory.history.events.is_empty(), "{name}");
            let kept = trajectory.multipliers.expect("they were asked for");
            let lambda = |name: &str| name.starts_with("lambda") || name.starts_with("mu");
            let continuous: Vec<_> = kept.values.iter().filter(|s| lambda(&s.name)).collect();
            assert!(!continuous.is_empty());
            let mut joints = 0;
            for (k, pair) in kept.time.windows(2).enumerate() {
                if pair[0] == pair[1] {
                    joints += 1;
                    for series in &continuous {
                        let jump = (series.values[k + 1] - series.values[k]).abs();
                        assert!(
                            jump <= 1e-10,
                            "{name} {lower}: {} jumps by {jump:e}",
                            series.name
                        );
                    }
                }
            }
            assert!(joints >= 5, "{name} {lower}: {joints} joints");
        }
    }
}

/// Every experiment of the examples that finite elements can run ends where the event road does.
#[test]
fn the_examples_end_where_the_event_road_does() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    let mut compared = 0;
    for entry in std::fs::read_dir(folder).expect("the examples are there") {
        let path = entry.expect("a readable folder").path();
        if path.extension().is_none_or(|extension| extension != "nsd") {
            continue;
        }
        let stem = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let text = std::fs::read_to_string(&path).expect("an example can be read");
        for (name, event, fesd) in nsd_tests::by_both_roads(&text) {
            let Some(fesd) = fesd else { continue };
            if event.status != Status::Solved {
                continue;
            }
            // Infinitely many switches are a report, and no success.
            if stem == "spiral" {
                assert_ne!(fesd.status, Status::Solved, "{name}");
                continue;
            }
            assert_eq!(
                fesd.status,
                Status::Solved,
                "{stem} {name}: {:?}",
                fesd.failure
            );
            let scale = end(&event).iter().fold(1.0_f64, |s, x| s.max(x.abs()));
            let difference = distance(&end(&event), &end(&fesd));
            assert!(difference <= 1e-9 * scale, "{stem} {name}: {difference:e}");
            compared += 1;
        }
    }
    assert!(compared >= 20, "{compared}");
}
