//! Programs over second-order cones against closed forms.

use nsd_tests::{assert_near, end, optimum, run, times};
use nsdc::report::{EventKind, Status, Trajectory};

/// By events, and by finite elements of an order that leaves rounding.
const ROADS: [&str; 2] = [
    "tolerance 1e-12;",
    "method fesd { steps = 60; scheme = radau_iia(4); }",
];

fn runs(model: &str, horizon: f64, method: &str) -> Trajectory {
    let text =
        format!("model m {{ {model} }} simulate this of m {{ horizon {horizon:?}; {method} }}");
    let found = run(&text, "this");
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    found
}

#[test]
fn a_point_is_projected_onto_apex_surface_and_interior() {
    // (0.3, 0.4) at the height 2t - 1: below -1/2 the apex is nearest, above 1/2 the point itself, and in between the
    // height of the nearest point is the mean of 1/2 and 2t - 1.
    let model = "state s = 0; let h = 2*time - 1; s' = z[3];
      z[3] in argmin (z[1] - 0.3)^2 + (z[2] - 0.4)^2 + (z[3] - h)^2 subject to { norm(z[1..2]) <= z[3]; }";
    for road in ROADS {
        let found = runs(model, 1.0, road);
        assert_near(&end(&found, "z"), &[0.3, 0.4, 1.0], 1e-10);
        // ∫ (2t - 1/2)/2 from 1/4 to 3/4, and ∫ (2t - 1) to 1.
        assert_near(&end(&found, "s"), &[0.125 + 0.1875], 1e-10);
        assert_near(&times(&found, EventKind::Activate), &[0.25, 0.75], 1e-10);
    }
}

#[test]
fn a_start_on_the_surface_needs_no_guess() {
    // |x| falls with half of 1 + |x| while the nearest point is on the surface, until |x| = 1, and then with |x|.
    let model = "state x[2] = [3, 1]; x' = -z[1..2];
      z[3] in argmin dot(z - [x[1], x[2], 1], z - [x[1], x[2], 1]) subject to { norm(z[1..2]) <= z[3]; }";
    let start = 10.0_f64.sqrt();
    let met = 2.0 * (0.5 * (1.0 + start)).ln();
    let size = (met - 2.0).exp();
    for road in ROADS {
        let found = runs(model, 2.0, road);
        let exact = [3.0 * size / start, size / start];
        assert_near(&end(&found, "x"), &exact, 1e-9);
        assert_near(&times(&found, EventKind::Activate), &[met], 1e-9);
    }
}

#[test]
fn the_axis_of_a_cone_is_a_point_like_others() {
    // A force that is wanted grows from zero until friction, half of the load, is all there is.
    for cone in [
        "2*norm(z[1..2]) <= z[3];",
        "norm(k*z[1..2]) <= z[3];",
        "norm(z[1..2]) <= z[3]/k;",
    ] {
        let model = format!(
            "param k = 2; state y = 0; y' = z[1];
             z[3] in argmin (z[1] - time)^2 + z[2]^2 + (z[3] - 1)^2 subject to {{ {cone} z[3] = 1; }}"
        );
        for road in ROADS {
            let found = runs(&model, 1.0, road);
            assert_near(&end(&found, "y"), &[0.125 + 0.25], 1e-10);
            assert_near(&times(&found, EventKind::Activate), &[0.5], 1e-10);
        }
    }
}

#[test]
fn maps_without_an_objective_are_solved_over_cones() {
    // The map turns: it is monotone and no gradient. Inside of the cone z = A⁻¹ b.
    let model = "state s = 0; s' = z[3]; let h = 4 - 4*time;
      z[3] in variational { norm(z[1..2]) <= z[3]; } solves [z[1] + z[2] - 1, z[2] - z[1], z[3] - h];";
    for road in ROADS {
        let found = runs(model, 0.5, road);
        assert_near(&end(&found, "z"), &[0.5, 0.5, 2.0], 1e-10);
        assert_near(&end(&found, "s"), &[1.5], 1e-10);
    }
}

fn objective(set: &str, dimension: usize, goal: &str) -> f64 {
    let text = format!(
        "model c {{ state x[2] = [3, 4]; control u in [-1, 1] = 0; x' = -z[1..2] + [u, 0];
           z[{dimension}] in variational {{ {set} }} solves z - {goal}; }}
         optimize this of c {{ horizon 2; intervals 6; elements 2; scheme radau_iia(3);
           minimize integral(dot(x, x) + u^2); }}"
    );
    let found = optimum(&text, "this");
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    found.objective.expect("what was minimized")
}

#[test]
fn an_optimum_over_a_cone_is_that_over_its_section() {
    let ball = objective("norm(z) <= 2;", 2, "x");
    let cone = objective("norm(z[1..2]) <= z[3]; z[3] = 2;", 3, "[x[1], x[2], 0]");
    assert!((ball - cone).abs() < 1e-6, "{ball} and {cone}");
}
