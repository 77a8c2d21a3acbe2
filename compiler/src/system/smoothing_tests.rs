//! Models, and the systems they become when their switches are smoothed.

use insta::assert_snapshot;

use super::tests::printed;

fn smoothed(statements: &str, law: &str) -> String {
    printed(&format!(
        "model m {{ state x = 1; {statements} }}
         simulate run of m {{ horizon 1; method smoothing {{ epsilon = 0.5; law = {law}; }} }}"
    ))
}

#[test]
fn a_switch_becomes_a_steep_function() {
    assert_snapshot!(smoothed("x' = -sign(x);", "tanh"), @"");
    assert_snapshot!(smoothed("x' = -sign(x);", "rational"), @"");
}

#[test]
fn a_polynomial_begins_and_ends_at_switches_of_its_own() {
    assert_snapshot!(smoothed("x' = if x > time then -1 else 2;", "polynomial"), @"");
}

#[test]
fn kinks_stay_and_rates_stay_affine_in_them() {
    assert_snapshot!(smoothed("x' = -sign(abs(x) - 1)*abs(x);", "tanh"), @"");
}

#[test]
fn regions_are_no_longer_told_apart() {
    let regions = "region a where x < 2 { x' = 1; } region b where x > 2 { x' = -1; }";
    assert_snapshot!(smoothed(regions, "tanh"), @"");
}
