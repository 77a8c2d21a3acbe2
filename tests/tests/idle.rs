//! Optima in which nothing touches and nothing switches: what no control moves is named, where something could move it and
//! the objective asks for that.

use nsd_tests::{optimum, solved_optimum};
use nsdc::report::{Status, Trajectory};

/// What is said to be left alone.
fn left_alone(found: &Trajectory) -> Option<&str> {
    let mut warnings = found.warnings.iter();
    let warning = warnings.find(|warning| warning.code == "W0728")?;
    Some(&warning.message)
}

/// A disc in one dimension pushes another one in front of it: by 3 freely, and with 3 to push half as fast as the control.
/// With a price r on ∫ u² and c on what misses 3: pushed by p with one u = (3 + 2 p)/4, r (3 + 2 p)²/4 + c (3 - p)².
fn discs(r: f64, c: &str, settings: &str) -> String {
    format!(
        "model m {{
           state x[2] = [-6, 0]; control u in [-5, 5] = 0;
           x' = [u, 0];
           project x onto {{ x[2] - x[1] >= 3; }};
         }}
         optimize o of m {{ horizon 4; intervals 8; elements 2; scheme radau_iia(2);
           minimize integral({r}*u^2) + {c}; {settings} }}"
    )
}

/// Where pushing costs more than it brings, nothing is done.
#[test]
fn the_disc_that_is_not_pushed_is_named() {
    let rest = solved_optimum(&discs(4.0, "final((x[2] - 3)^2)", ""), "o");
    assert!((rest.objective.expect("an optimum") - 9.0).abs() <= 1e-6);
    let message = left_alone(&rest).expect("the other disc is left alone");
    assert!(
        message.contains("`x[2]`") && !message.contains("`x[1]`"),
        "{message}"
    );
}

/// Least at p = (3 c - 1.5 r)/(c + r).
#[test]
fn a_disc_that_is_pushed_is_not() {
    let (r, c) = (0.1_f64, 1.0_f64);
    let text = discs(r, "final((x[2] - 3)^2)", "guess { u = 2; }");
    let pushed = solved_optimum(&text, "o");
    let p = (3.0 * c - 1.5 * r) / (c + r);
    let least = r * (3.0 + 2.0 * p).powi(2) / 4.0 + c * (3.0 - p).powi(2);
    assert!((pushed.objective.expect("an optimum") - least).abs() <= 1e-6);
    assert_eq!(left_alone(&pushed), None);
}

/// Where the objective asks nothing of the other disc, or the other disc is where it is to be, it may rest.
#[test]
fn what_may_rest_is_not_named() {
    for cost in ["final((x[1] + 5)^2)", "final(x[2]^2) + final((x[1] + 5)^2)"] {
        let rest = solved_optimum(&discs(1.0, cost, ""), "o");
        assert_eq!(left_alone(&rest), None, "{cost}");
    }
}

/// A state that controls get to without a switch is not left alone by one, though they do not move it: u*y is 0.
#[test]
fn what_no_switch_moves_is_not_named() {
    let found = solved_optimum(
        "model m { state x = 1; state y = 0; state z = 1; control u in [-1, 1] = 0; x' = u*y; y' = 0; z' = -abs(z); }
         optimize o of m { horizon 1; intervals 2; scheme radau_iia(2);
           minimize final(x^2) + integral(u^2); }",
        "o",
    );
    assert!(found.history.events.is_empty());
    assert_eq!(left_alone(&found), None);
}

/// Controls with finite sets of values have no small changes, and so nothing shows what they do not move.
#[test]
fn controls_without_small_changes_are_not_judged() {
    let text = discs(4.0, "final((x[2] - 3)^2)", "");
    let rest = solved_optimum(&text.replace("in [-5, 5]", "in {-5, 0, 5}"), "o");
    assert!(rest.history.events.is_empty());
    assert_eq!(left_alone(&rest), None);
}

/// What ends otherwise is advised otherwise.
#[test]
fn only_solutions_are_looked_at() {
    let text = discs(0.1, "final((x[2] - 3)^2)", "");
    let coarse = text.replace("intervals 8; elements 2", "intervals 2; elements 1");
    let found = optimum(&coarse, "o");
    assert_eq!(found.status, Status::Feasible);
    assert_eq!(left_alone(&found), None);
}
