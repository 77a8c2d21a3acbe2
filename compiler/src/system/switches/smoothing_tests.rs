//! Models, and the systems they become when their switches are smoothed.

use insta::assert_snapshot;

use crate::system::tests::printed;

fn smoothed(statements: &str, law: &str) -> String {
    printed(&format!(
        "model m {{ state x = 1; {statements} }}
         simulate run of m {{ horizon 1; method smoothing {{ epsilon = 0.5; law = {law}; }} }}"
    ))
}

#[test]
fn a_switch_becomes_a_steep_function() {
    assert_snapshot!(smoothed("x' = -sign(x);", "tanh"), @"
    system m
    state x = 1
    der(x) = -tanh(2*x)
    ");
    assert_snapshot!(smoothed("x' = -sign(x);", "rational"), @"
    system m
    state x = 1
    der(x) = -2*x/sqrt(4*x^2 + 1)
    ");
}

#[test]
fn a_polynomial_begins_and_ends_at_switches_of_its_own() {
    assert_snapshot!(smoothed("x' = if x > time then -1 else 2;", "polynomial"), @"
    system m
    state x = 1
    der(x) = 2 - 3*(0.1875*(-2*time + 2*x)^5 - 0.625*(-2*time + 2*x)^3 - 1.875*time + 1.875*x + 0.5)*(alpha[x - time + 0.5] - alpha[x - time - 0.5]) - 3*alpha[x - time - 0.5]
    alpha[x - time + 0.5] in step(0.5 - time + x)  // x - time + 0.5, continuous
    alpha[x - time - 0.5] in step(-time + x - 0.5)  // x - time - 0.5, continuous
    subsystem alpha[x - time + 0.5]
    subsystem alpha[x - time - 0.5]
    ");
}

#[test]
fn kinks_stay_and_rates_stay_affine_in_them() {
    assert_snapshot!(smoothed("x' = -sign(abs(x) - 1)*abs(x);", "tanh"), @"
    system m
    state x = 1
    der(x) = x*tanh(-2*x - 2)*(1 - alpha[1]) - x*tanh(2*x - 2)*alpha[1]
    alpha[1] in step(x)  // x, continuous
    subsystem alpha[1]
    ");
}

#[test]
fn regions_are_no_longer_told_apart() {
    let regions = "region a where x < 2 { x' = 1; } region b where x > 2 { x' = -1; }";
    assert_snapshot!(smoothed(regions, "tanh"), @"
    system m
    state x = 1
    der(x) = -tanh(2*x - 4)
    ");
}
