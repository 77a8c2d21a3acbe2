//! `nsdc modes`: the sliding modes of nonlinear switches along a line, against closed forms.

use nsd_tests::with_experiment;
use nsdc::model::Units;
use nsdc::report::{Change, Map, plot, words_of};
use nsdc::study::modes::{map, plane, plane_text, text};

fn mapped(text: &str, state: &str, from: f64, to: f64) -> Map {
    with_experiment(text, "run", |compiled| {
        let system = &compiled.system;
        let state = system.states.iter().position(|known| known.name == state);
        map(system, 0, state.expect("the model has it"), from..to)
    })
}

/// Example 2 of Jeffrey 2014: s = (1 ± √(1 + 8x))/4, minus attracts for -1/8 < x < 3, plus repels for -1/8 < x < 1.
#[test]
fn counts_and_stabilities_change_at_the_fold_and_at_the_sides() {
    let model = "model m { state x = 0.9; state y = 0.05; switch s = sign(y) sliding nonlinear;
        x' = 2*s^2 - 1; y' = 2*s^2 - s - x; } simulate run of m { horizon 1; }";
    let map = mapped(model, "x", -1.0, 4.0);
    let found: Vec<Change> = map.boundaries.iter().map(|b| b.change).collect();
    assert_eq!(found, [Change::Fold, Change::Bound, Change::Bound]);
    for (boundary, (at, value)) in
        (map.boundaries.iter()).zip([(-0.125, 0.25), (1.0, 1.0), (3.0, -1.0)])
    {
        assert!((boundary.at - at).abs() < 1e-9, "{boundary:?}");
        assert!(
            boundary.value.is_some_and(|v| (v - value).abs() < 1e-3),
            "{boundary:?}"
        );
    }
    for sample in &map.samples {
        let Some(modes) = &sample.modes else {
            panic!("{sample:?}")
        };
        let root = (1.0 + 8.0 * sample.at).sqrt();
        let close = |at: f64| (sample.at - at).abs() < 1e-6;
        if close(-0.125) || close(1.0) || close(3.0) {
            continue;
        }
        let known = [((1.0 - root) / 4.0, -root), ((1.0 + root) / 4.0, root)];
        let known = known.into_iter().filter(|(s, _)| s.abs() < 1.0);
        let known: Vec<(f64, f64)> = known.collect();
        assert_eq!(modes.len(), known.len(), "{sample:?}");
        for (mode, (value, stability)) in modes.iter().zip(known) {
            assert!((mode.value - value).abs() < 1e-9, "{sample:?}");
            assert!((mode.stability - stability).abs() < 1e-7, "{sample:?}");
        }
    }
    let table = text(&map);
    assert!(table.contains("fold at s = 0.25"), "{table}");
    let svg = plot::branches::write(&map, &Units::default());
    assert!(svg.starts_with("<svg") && svg.contains("attracting"));
}

/// A block on a belt sticks for 0.3 - F < x < 0.3 + F at most, F = 3.018145824447.
#[test]
fn static_friction_ends_in_folds() {
    let model = "model m { state x = 2.4; state u = 1; switch s = sign(u) sliding nonlinear;
        x' = u - 1; u' = -s - x - 0.3*(u - 1); hidden on s { u' += -2*pi*s*(1 - s^2); } }
        simulate run of m { horizon 1; }";
    let map = mapped(model, "x", -4.0, 4.0);
    let folds = map.boundaries.iter().filter(|b| b.change == Change::Fold);
    let folds: Vec<f64> = folds.map(|b| b.at).collect();
    let known = [0.3 - 3.018145824447, 0.3 + 3.018145824447];
    assert_eq!(folds.len(), 2, "{:?}", map.boundaries);
    for (fold, known) in folds.iter().zip(known) {
        assert!((fold - known).abs() < 1e-8, "{fold} {known}");
    }
    // Filippov's reading sticks for -0.7 < x < 1.3; outside, the modes with |s| near 1 repel.
    let bounds = map.boundaries.iter().filter(|b| b.change == Change::Bound);
    let bounds: Vec<f64> = bounds.map(|b| b.at).collect();
    assert!(
        bounds
            .iter()
            .zip([-0.7, 1.3])
            .all(|(b, known)| (b - known).abs() < 1e-8),
        "{bounds:?}"
    );
}

/// 2s² - s = x + z²: the fold is x + z² = -1/8, and modes reach s = 1 and -1 at x + z² = 1 and 3.
#[test]
fn folds_are_curves_over_two_states() {
    let model = "model m { state x = 0.9; state y = 0.05; state z = 0;
        switch s = sign(y) sliding nonlinear;
        x' = 2*s^2 - 1; y' = 2*s^2 - s - x - z^2; z' = 1; } simulate run of m { horizon 1; }";
    let plane = with_experiment(model, "run", |compiled| {
        plane(&compiled.system, 0, [0, 2], [-2.0..3.5, -1.3..1.1])
    });
    let n = plane.at[0].len();
    for (k, pattern) in plane.patterns.iter().enumerate() {
        let level = plane.at[0][k % n] + plane.at[1][k / n].powi(2);
        if [-0.125, 1.0, 3.0]
            .iter()
            .any(|bound| (level - bound).abs() < 1e-6)
        {
            continue;
        }
        let known: &[bool] = match level {
            level if !(-0.125..=3.0).contains(&level) => &[],
            level if level < 1.0 => &[true, false],
            _ => &[true],
        };
        assert_eq!(pattern.as_deref(), Some(known), "{level}");
    }
    let of = |change: Change| {
        plane
            .curves
            .iter()
            .filter(move |curve| curve.change == change)
    };
    let folds: Vec<[f64; 2]> = of(Change::Fold).flat_map(|c| c.points.clone()).collect();
    assert!(folds.len() > 100, "{}", folds.len());
    for [x, z] in &folds {
        assert!((x + z * z + 0.125).abs() < 1e-9, "{x} {z}");
    }
    for [x, z] in of(Change::Bound).flat_map(|c| c.points.clone()) {
        let level = x + z * z;
        assert!(
            (level - 1.0).abs().min((level - 3.0).abs()) < 1e-9,
            "{level}"
        );
    }
    assert_eq!(of(Change::Other).count(), 0);
    // One curve from end to end: z from -1.3 to 1.1, as x is within its range.
    let ends = folds
        .iter()
        .fold((0.0_f64, 0.0_f64), |(a, b), p| (a.min(p[1]), b.max(p[1])));
    assert_eq!(of(Change::Fold).count(), 1);
    assert!(
        (ends.0 + 1.3).abs() < 1e-9 && (ends.1 - 1.1).abs() < 1e-9,
        "{ends:?}"
    );
    assert!(plane_text(&plane).contains("1 attracting, 1 repelling"));
    let svg = plot::plane::write(&plane, &Units::default());
    assert!(svg.starts_with("<svg") && svg.contains("fold") && !svg.contains("NaN"));
}

/// 2s² - s = x² + z² - 1/2: no mode is within the circle x² + z² = 3/8, a fold.
#[test]
fn a_closed_fold_is_a_closed_curve() {
    let model = "model m { state x = 0.7; state y = 0.05; state z = 0;
        switch s = sign(y) sliding nonlinear;
        x' = 1; y' = 2*s^2 - s - x^2 - z^2 + 0.5; z' = 1; } simulate run of m { horizon 1; }";
    let plane = with_experiment(model, "run", |compiled| {
        plane(&compiled.system, 0, [0, 2], [-0.8..0.8, -0.75..0.8])
    });
    let [fold] = &plane.curves[..] else {
        panic!("{} curves", plane.curves.len())
    };
    assert_eq!(fold.change, Change::Fold);
    for [x, z] in &fold.points {
        assert!((x * x + z * z - 0.375).abs() < 1e-9, "{x} {z}");
    }
    assert!(fold.points.len() > 100, "{}", fold.points.len());
    assert_eq!(fold.points.first(), fold.points.last());
}

#[test]
fn patterns_are_named_in_the_order_of_their_values() {
    let words = |pattern: &[bool]| words_of(Some(pattern));
    assert_eq!(words(&[true, false]), "1 attracting, 1 repelling");
    assert_eq!(words(&[false, true, true]), "1 repelling, 2 attracting");
    assert_eq!(words(&[]), "none");
    assert_eq!(words_of(None), "not on the surface");
}
