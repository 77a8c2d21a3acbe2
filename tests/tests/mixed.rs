//! Regions, a projection, an equation and a complementarity in one model: a closed form, by every method.

use nsd_tests::{assert_near, end, optimum, run, times};
use nsdc::report::{EventKind, Status, Trajectory};

/// A height over a floor falls with 1 + q in the first region and rises with 1 - q - a/10 in the second one, where q is
/// the root of q³ + q = x₁ and a = max(0, x₁ - 2).
const PLANT: &str = "
  state x[2] = [0, 1];
  algebraic q = 0;
  algebraic a = 0;
  0 = q^3 + q - x[1];
  0 <= a perp a - x[1] + 2 >= 0;
  region slow where x[1] < 1 { x' = [u, -u*(1 + q)]; }
  region fast where x[1] > 1 { x' = [2*u, u*(1 - q - a/10)]; }
  project x onto { x[2] >= 0; }";

const HORIZON: f64 = 1.9;

/// q at x₁.
fn root(x: f64) -> f64 {
    (0..60).fold(x.cbrt(), |q, _| {
        q - (q.powi(3) + q - x) / (3.0 * q * q + 1.0)
    })
}

/// ∫ q dx₁ from 0: dx₁ = (1 + 3q²) dq.
fn integral(x: f64) -> f64 {
    let q = root(x);
    q * q / 2.0 + 0.75 * q.powi(4)
}

/// When the floor is met, and the final state, for u = 1: the floor is left in the second region at t = 1.
fn exact() -> (f64, [f64; 2]) {
    let (mut low, mut high) = (0.5, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if 1.0 - middle - integral(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let x = 1.0 + 2.0 * (HORIZON - 1.0);
    let risen = 0.5 * (x - 1.0 - integral(x) + integral(1.0)) - 0.05 * (x - 2.0_f64).powi(2) / 2.0;
    (low, [x, risen])
}

fn solved(found: Trajectory) -> Trajectory {
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    found
}

#[test]
fn events_and_finite_elements_have_the_closed_form() {
    let (met, x) = exact();
    assert!(x[1] > 0.01, "the floor is left: {x:?}");
    for method in [
        "tolerance 1e-12;",
        "method fesd { steps = 60; scheme = radau_iia(4); }",
    ] {
        let text = format!(
            "model plant {{ param u = 1; {PLANT} }}
             simulate this of plant {{ horizon {HORIZON}; {method} }}"
        );
        let found = solved(run(&text, "this"));
        assert_near(&end(&found, "x"), &x, 1e-10);
        assert_near(&end(&found, "q"), &[root(x[0])], 1e-10);
        assert_near(&end(&found, "a"), &[x[0] - 2.0], 1e-10);
        // The floor, and a.
        assert_near(&times(&found, EventKind::Activate), &[met, 1.5], 1e-9);
        assert_near(&times(&found, EventKind::Deactivate), &[1.0], 1e-9);
    }
}

#[test]
fn steps_of_time_approach_the_closed_form() {
    let (_, x) = exact();
    let error = |steps: usize, nodes: usize| {
        let text = format!(
            "model plant {{ param u = 1; {PLANT} }}
             simulate this of plant {{ horizon {HORIZON}; method timestepping {{ steps = {steps}; scheme = radau_iia({nodes}); }} }}"
        );
        (end(&solved(run(&text, "this")), "x")[1] - x[1]).abs()
    };
    // Steps that are short, and of a high order, know rates of algebraic states less well than these.
    for nodes in [2, 3, 4] {
        let short = error(777, nodes);
        assert!(short < 2e-3, "{nodes} nodes: {short}");
    }
    let errors = [100, 400, 1600].map(|steps| error(steps, 1));
    assert!(
        errors[2] < errors[0] / 8.0 && errors[2] < 2e-3,
        "{errors:?}"
    );
}

#[test]
fn an_optimum_has_the_closed_form() {
    // As far as possible: u = 1 throughout.
    let (_, x) = exact();
    let text = format!(
        "model plant {{ control u in [0, 1] = 0.5; {PLANT} }}
         optimize this of plant {{ horizon {HORIZON}; intervals 6; elements 3; scheme radau_iia(4);
           minimize final(-x[1]); }}"
    );
    let found = solved(optimum(&text, "this"));
    assert_near(&end(&found, "x"), &x, 1e-8);
    let check = found.optimum.as_ref().and_then(|optimum| optimum.check);
    let check = check.expect("what was found is simulated");
    assert!(check.terminal_error < 1e-8, "{}", check.terminal_error);
}
