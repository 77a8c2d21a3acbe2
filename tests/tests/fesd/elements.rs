//! What elements are besides their ends: their lengths, and the polynomials in them.

use super::simulate;

/// Where polynomials begin and end.
fn pieces(trajectory: &nsdc::report::Trajectory) -> Vec<[f64; 2]> {
    let pieces = &trajectory.dense.pieces;
    pieces.iter().map(|piece| [piece.from, piece.to]).collect()
}

#[test]
fn elements_before_a_switch_are_equally_long() {
    // The switch at 0.35 is in the second of four elements: two are before it, and two share what is left.
    let model = "model m { state x = -0.35; state y = 0; x' = 1; y' = -y + sign(x); }";
    let found = simulate(model, "horizon 1; method fesd { steps = 1; elements = 4; }");
    let exact = [[0.0, 0.175], [0.175, 0.35], [0.35, 0.675], [0.675, 1.0]];
    let found = pieces(&found);
    assert_eq!(found.len(), exact.len(), "{found:?}");
    for (found, exact) in found.iter().flatten().zip(exact.as_flattened()) {
        assert!((found - exact).abs() < 1e-12, "{found} instead of {exact}");
    }
    // Where a scheme of low order finds the switch depends on the lengths themselves.
    let model = "model m { state x = -0.38; state y = 0; x' = 1 + x^2/2; y' = -y + sign(x); }";
    let settings = "horizon 1; method fesd { scheme = radau_iia(2); steps = 1; elements = 4; }";
    let found = pieces(&simulate(model, settings));
    let lengths: Vec<f64> = found.iter().map(|[from, to]| to - from).collect();
    let equal = |i: usize, j: usize| (lengths[i] - lengths[j]).abs() < 1e-12;
    assert!(equal(0, 1) && equal(2, 3) && !equal(1, 2), "{lengths:?}");
}

#[test]
fn a_polynomial_is_the_solution_inside_of_its_element() {
    // x' = 3t² has a polynomial of third degree as its solution, which collocation with three nodes does not miss.
    let model = "model m { state x = 0.25; x' = 3*time^2; }";
    for scheme in ["radau_iia(3)", "gauss(3)"] {
        let settings = format!("horizon 2; method fesd {{ scheme = {scheme}; steps = 4; }}");
        let found = simulate(model, &settings);
        for k in 0..=40 {
            let t = 0.05 * f64::from(k);
            let x = found.dense.at(t).expect("the run covers its horizon")[0];
            let exact = 0.25 + t.powi(3);
            assert!(
                (x - exact).abs() < 1e-13,
                "{scheme}: {x} instead of {exact}"
            );
        }
    }
}
