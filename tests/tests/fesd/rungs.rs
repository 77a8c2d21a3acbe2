//! What the report says about elements that were added, and about how active sets were found.

use std::time::Duration;

use nsd_tests::with_experiment;
use nsdc::report::{MethodOption, Status, Trajectory};
use nsdc::simulate::Request;

use super::{BELT, OSCILLATOR, distance, end, simulate};

/// The value of an option that the report shows, zero where it is not shown.
fn shown(trajectory: &Trajectory, name: &str) -> f64 {
    let options = &trajectory.setup.method.options;
    let found = options.iter().find(|(option, _)| option == name);
    match found {
        Some((_, MethodOption::Number(value))) => *value,
        _ => 0.0,
    }
}

#[test]
fn elements_are_added_where_there_are_too_few() {
    // Three switches in the only step.
    let model = "model m { state x = -0.5; state y = 0; x' = 1; \
      y' = sign(x) + sign(x - 0.7) + sign(x - 1.2); }";
    let found = simulate(model, "horizon 2; method fesd { steps = 1; elements = 2; }");
    assert_eq!(
        (found.history.events.len(), shown(&found, "added_elements")),
        (3, 2.0)
    );
    // y = ∫ of -3, -1, 1, 3 over 0.5, 0.7, 0.5, 0.3
    assert!((end(&found)[1] - (-1.5 - 0.7 + 0.5 + 0.9)).abs() < 1e-14);
    let enough = simulate(model, "horizon 2; method fesd { steps = 1; elements = 8; }");
    assert_eq!(shown(&enough, "added_elements"), 0.0);
}

/// Sets are found by rates; where one vanishes by trial elements; where too many pairs meet by a
/// smoothed problem.
#[test]
fn each_rung_serves_where_the_one_above_fails() {
    let crossing = simulate(OSCILLATOR, "horizon pi/2; method fesd { steps = 20; }");
    assert_eq!(
        (
            shown(&crossing, "tried_sets"),
            shown(&crossing, "smoothed_sets")
        ),
        (0.0, 0.0)
    );

    // Where the block leaves the belt, the rate of ψ is zero on the surface and off it.
    let tangent = simulate(BELT, "horizon 20; method fesd { steps = 50; }");
    assert_eq!(
        (
            shown(&tangent, "tried_sets"),
            shown(&tangent, "smoothed_sets")
        ),
        (1.0, 0.0)
    );

    // Seven surfaces are reached at once, and all slide from there: each α is (1 + 0.2)/2.
    let many = "model many { const n = 7; state x[n] = ones(n); state y = 0; \
      x' = 0.2*ones(n) - sign(x) - 0.05*sum(sign(x))*ones(n) + 0.05*7*0.2*ones(n); y' = sum(sign(x)); }";
    let many = simulate(many, "horizon 3; method fesd { steps = 10; } lower step;");
    assert_eq!(many.status, Status::Solved, "{:?}", many.failure);
    assert_eq!(shown(&many, "smoothed_sets"), 1.0);
    assert!(many.warnings.iter().any(|warning| warning.code == "W0706"));
    // sign = 1 until x' = 0.2 - 1 - 0.35 + 0.07 = -1.08 has brought x to zero, then 0.2.
    let reached = 1.0 / 1.08;
    let y = end(&many)[7];
    assert!(
        (y - (7.0 * reached + 1.4 * (3.0 - reached))).abs() < 1e-12,
        "{y}"
    );
}

const BELTS: &str = "const c = 0.3; const e = ones(5); state x[5] = 2.4*e; state u[5] = e; \
  const P = [-1, 1, 0, 0, 0; 0, -1, 1, 0, 0; 0, 0, -1, 1, 0; 0, 0, 0, -1, 1; 1, 0, 0, 0, -1]; \
  x' = u - e;";

/// Runs five equal belts, and sees that each block goes the way of one alone; returns how many sets
/// were found by trials, by smoothed problems, and by whole elements.
fn five_belts(rate: &str) -> (Trajectory, [f64; 3]) {
    let settings = "horizon 20; method fesd { scheme = radau_iia(4); steps = 20; }";
    let found = simulate(&format!("model belts {{ {BELTS} u' = {rate}; }}"), settings);
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    let (one, all) = (end(&simulate(BELT, settings)), end(&found));
    for block in 0..5 {
        let of_block = [all[block], all[5 + block]];
        assert!(distance(&of_block, &one) < 1e-12, "{of_block:?}, {one:?}");
    }
    let sets = ["tried_sets", "smoothed_sets", "element_sets"];
    let sets = sets.map(|name| shown(&found, name));
    (found, sets)
}

/// Five belts at once, of which the first makes each pull at the friction of the next: where the blocks leave, all
/// rates vanish whether they slide or not; the smoothed problem, with rates in their own unit, finds the set that a trial
/// confirms.
#[test]
fn a_smoothed_problem_shows_the_set_where_no_rate_does() {
    let (belts, sets) = five_belts("-sign(u) - x - c*(u - e) + 0.1*u[1]*P*sign(u)");
    assert_eq!(sets, [1.0, 3.0, 0.0]);
    assert!(belts.warnings.iter().any(|warning| warning.code == "W0706"));
}

/// The same where the blocks leave at the start. Whole elements take long: a run without time left does not begin them.
#[test]
fn whole_elements_are_not_begun_without_time() {
    let start = BELTS
        .replace("2.4*e", "-0.7*e")
        .replace("u[5] = e", "u[5] = zeros(5)");
    let text = format!(
        "model belts {{ {start} u' = -sign(u) - x - c*(u - e) + 0.1*u[1]*P*sign(u); }}
         simulate this of belts {{ horizon 1; method fesd {{ scheme = radau_iia(4); steps = 20; }} }}"
    );
    let within = |time: Option<Duration>| {
        let request = Request {
            limit: time.into(),
            ..Request::default()
        };
        let found = with_experiment(&text, "this", |compiled| {
            simulate::run(&compiled.system, &compiled.settings, &request)
        });
        (found.status, shown(&found, "element_sets"))
    };
    assert_eq!(within(None), (Status::Solved, 1.0));
    assert_eq!(within(Some(Duration::ZERO)), (Status::TimeLimit, 0.0));
}

/// Without that the ten pairs that meet are five groups of two, and all choices of each are tried.
#[test]
fn independent_groups_are_counted_one_by_one() {
    let (belts, sets) = five_belts("-sign(u) - x - c*(u - e)");
    assert_eq!(sets, [1.0, 0.0, 0.0]);
    assert!(belts.warnings.is_empty(), "{:?}", belts.warnings);
    // Six surfaces that are slid on, and left at t = 1, 2, ..
    let model = "model relays { const n = 6; state x[n] = zeros(n); \
      for i in 1..n { x[i]' = time/i - sign(x[i]); } }";
    for lower in ["stewart", "step"] {
        let settings = format!("horizon 7; method fesd {{ steps = 10; }} lower {lower};");
        let found = simulate(model, &settings);
        assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
        for (i, x) in (1..).zip(end(&found)) {
            let i = f64::from(i);
            let exact = (49.0 - i * i) / (2.0 * i) - (7.0 - i);
            assert!((x - exact).abs() < 1e-12, "{i}: {x} instead of {exact}");
        }
    }
}

/// α - 1 = (t - 1)³/2 leaves a surface with its first two derivatives zero, at an instant that rounding
/// hides for 1e-5; behind it x = (t - 1)⁴/4. Few grids meet that instant so that they cannot tell.
#[test]
fn exits_of_third_order_are_found_on_most_grids() {
    let exact = 1.5_f64.powi(4) / 4.0;
    let (mut runs, mut refused) = (0, Vec::new());
    for side in ["", "-"] {
        let model = format!("model m {{ state x = 0; x' = {side}(1 + (time - 1)^3) - sign(x); }}");
        for scheme in ["radau_iia(3)", "radau_iia(4)", "gauss(3)"] {
            for lower in ["stewart", "step"] {
                for steps in (1..=30).chain([50, 99, 100, 101, 250]) {
                    let settings = format!(
                        "horizon 2.5; method fesd {{ scheme = {scheme}; steps = {steps}; }} lower {lower};"
                    );
                    let found = simulate(&model, &settings);
                    runs += 1;
                    if let Some(failure) = found.failure {
                        refused.push(format!("{side} {settings}: {failure}"));
                        continue;
                    }
                    let error = end(&found)[0].abs() - exact;
                    assert!(error.abs() < 1e-9, "{model} {settings}: {error:e}");
                }
            }
        }
        let found = simulate(&model, "horizon 2.5; tolerance 1e-8; method fesd;");
        let error = end(&found)[0].abs() - exact;
        assert!(error.abs() < 1e-8, "{model}: {error:e}");
    }
    assert!(10 * refused.len() <= runs, "{}", refused.join("\n"));
}
