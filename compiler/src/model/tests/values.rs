//! Expressions and the laws of their shapes.

use insta::assert_snapshot;
use proptest::prelude::*;

use super::super::Shape;
use super::{model, value};

#[test]
fn computes_values() {
    assert_snapshot!(value("[1, 2; 3, 4]*[1, 1]"), @"[3, 7]");
    assert_snapshot!(value("[1, 2;]*[3, 4]"), @"11");
    assert_snapshot!(value("[3, 4]*[1, 2;]"), @"[3, 6; 4, 8]");
    assert_snapshot!(value("[[1, 2], 3]"), @"[1, 2, 3]");
    assert_snapshot!(value("[eye(2), [5, 6]; 7, 8, 9]"), @"[1, 0, 5; 0, 1, 6; 7, 8, 9]");
    assert_snapshot!(value("transpose([1, 2; 3, 4])[1, :]"), @"[1, 3;]");
    assert_snapshot!(value("[1, 2, 3, 4][2..3]"), @"[2, 3]");
    assert_snapshot!(value("[1, 2, 3] .* [1, 2, 3] ./ 2"), @"[0.5, 2, 4.5]");
    assert_snapshot!(value("2^3^2 - -2^2"), @"516");
    assert_snapshot!(value("min([3, 1, 2]) + max(1, 2, 3)"), @"4");
    assert_snapshot!(value("max([1, 5], [2, 3])"), @"[2, 5]");
    assert_snapshot!(value("sum(i*j for i in 1..3, j in i+1..3)"), @"11");
    assert_snapshot!(value("sum(i for i in 1..0)"), @"0");
    assert_snapshot!(value("[i^2 for i in 1..3] + 1"), @"[2, 5, 10]");
    assert_snapshot!(value("cross([1, 0, 0], [0, 1, 0])"), @"[0, 0, 1]");
    assert_snapshot!(value("norm([3, 4]) + len([1, 2, 3]) + norm(-2)"), @"10");
    assert_snapshot!(value("diag([1, 2])"), @"[1, 0; 0, 2]");
    assert_snapshot!(value("inv([2, 0; 0, 4])"), @"[0.5, 0; 0, 0.25]");
    assert_snapshot!(value("solve([0, 1; 1, 0], [5, 7])"), @"[7, 5]");
    assert_snapshot!(value("if 2 > 1 and not 1 > 2 then 3 else [1, 2][5]"), @"3");
    assert_snapshot!(value("sat(2) + deadzone(3, 1) + sat(5, 0, 4)"), @"7");
}

#[test]
fn shapes_name_their_entries() {
    let shape = Shape::Matrix(2, 3);
    let names: Vec<String> = (0..shape.len()).map(|k| shape.entry_name("A", k)).collect();
    assert_eq!(
        names,
        ["A[1,1]", "A[1,2]", "A[1,3]", "A[2,1]", "A[2,2]", "A[2,3]"]
    );
}

/// The entries of a value from structural constants.
fn entries(expr: &str) -> Result<Vec<f64>, TestCaseError> {
    let shown = value(expr);
    let numbers = shown
        .split(['[', ']', ',', ';', ' '])
        .filter(|word| !word.is_empty());
    numbers
        .map(|word| word.parse().map_err(|_| TestCaseError::fail(shown.clone())))
        .collect()
}

fn matrix(rows: usize, columns: usize) -> impl Strategy<Value = String> {
    // Small integers: the laws below then hold without rounding.
    proptest::collection::vec(-9..10_i32, rows * columns).prop_map(move |entries| {
        let row = |row: &[i32]| {
            row.iter()
                .map(i32::to_string)
                .collect::<Vec<_>>()
                .join(", ")
        };
        let rows: Vec<String> = entries.chunks(columns).map(row).collect();
        let end = if rows.len() == 1 { ";" } else { "" };
        format!("[{}{end}]", rows.join("; "))
    })
}

proptest! {
    #[test]
    fn matrices_obey_their_laws(
        (a, b, c) in (1..4_usize, 1..4_usize, 1..4_usize)
            .prop_flat_map(|(m, k, n)| (matrix(m, k), matrix(k, n), matrix(k, n)))
    ) {
        let equal = |left: String, right: String| prop_assert_eq_values(&left, &right);
        equal(format!("{a}*({b} + {c})"), format!("{a}*{b} + {a}*{c}"))?;
        equal(format!("transpose(transpose({a}))"), a.clone())?;
        equal(format!("transpose({a}*{b})"), format!("transpose({b})*transpose({a})"))?;
        equal(format!("2*{a} - {a}"), a.clone())?;
    }

    #[test]
    fn solving_undoes_multiplying(a in (1..5_usize).prop_flat_map(|n| matrix(n, n).prop_map(move |a| (a, n)))) {
        let (a, n) = a;
        // Diagonally dominant, so that the inverse exists and is well conditioned.
        let a = format!("({a} + 40*eye({n}))");
        let by_numbers = entries(&format!("solve({a}, {a}*ones({n}))"))?;
        prop_assert!(by_numbers.iter().all(|entry| (entry - 1.0).abs() < 1e-12));
        let symbolic = model(&format!("model m {{ output y = inv((time/time + 0*time)*{a} + time*eye({n})); }}"));
        prop_assert!(symbolic.contains("output y"), "{}", symbolic);
    }
}

fn prop_assert_eq_values(left: &str, right: &str) -> Result<(), TestCaseError> {
    prop_assert_eq!(entries(left)?, entries(right)?, "{} and {}", left, right);
    Ok(())
}
