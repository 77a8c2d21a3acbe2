//! What the report says about elements that were added, and about how active sets were found.

use nsdc::report::{MethodOption, Status, Trajectory};

use super::{BELT, OSCILLATOR, distance, end, simulate};

/// The value of an option that the report shows, zero where it is not shown.
fn shown(trajectory: &Trajectory, name: &str) -> f64 {
    let options = &trajectory.method.options;
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
        (found.events.len(), shown(&found, "added_elements")),
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

/// Five belts at once: where the blocks leave, all rates vanish whether they slide or not, and the
/// smoothed problem has no reason to take one set rather than another; a trial refuses what it takes.
#[test]
fn a_whole_element_shows_the_set_where_no_rate_does() {
    let belts = "model belts { const c = 0.3; const e = ones(5); state x[5] = 2.4*e; \
      state u[5] = e; x' = u - e; u' = -sign(u) - x - c*(u - e); }";
    let settings = "horizon 20; method fesd { scheme = radau_iia(4); steps = 20; }";
    let belts = simulate(belts, settings);
    assert_eq!(belts.status, Status::Solved, "{:?}", belts.failure);
    assert_eq!(
        (
            shown(&belts, "tried_sets"),
            shown(&belts, "smoothed_sets"),
            shown(&belts, "element_sets")
        ),
        (0.0, 2.0, 1.0)
    );
    assert!(belts.warnings.iter().any(|warning| warning.code == "W0706"));
    // Each block goes the way of one alone.
    let one = end(&simulate(BELT, settings));
    let all = end(&belts);
    for block in 0..5 {
        let of_block = [all[block], all[5 + block]];
        assert!(distance(&of_block, &one) < 1e-12, "{of_block:?}, {one:?}");
    }
}
