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

/// A unit goes on as long as its words are units; powers of ten move the point and round nothing.
#[test]
fn numbers_have_units() {
    let cases = [
        ("20 kHz", "20000"),
        ("3 ms", "0.003"),
        ("7 µm + 5 um", "0.000012"),
        ("2 d", "172800"),
        ("1.5 h + 2 min", "5520"),
        ("180 deg", "3.141592653589793"),
        ("60 rpm/(2 rad/s)/pi", "1"),
        ("9.81 m/s^2", "9.81"),
        ("72 km/h", "20"),
        ("5 g", "0.005"),
        ("4.2 kJ/(kg*K)", "4200"),
        ("4.2 (kJ/(kg*K))", "4200"),
        ("1 L + 3 mL", "0.001003"),
        ("2 bar", "200000"),
        ("2 mm^2", "0.000002"),
        ("(2 mm)^2", "0.000004"),
        ("2 cm^-1", "200"),
        ("4 kHz^(1/2)*0 + 1", "1"),
        ("-2 km", "-2000"),
        ("2 m*3", "6"),
        ("6 m/2 s", "3"),
        ("[1 km, 2 m][1]", "1000"),
        ("sqrt(4 km/m)*0 + 2", "2"),
        ("3 m/pi*0", "0"),
    ];
    for (text, exact) in cases {
        let found: f64 = value(text).parse().expect("a number");
        let exact: f64 = exact.parse().expect("a number");
        assert!(
            (found - exact).abs() <= 4e-16 * exact.abs(),
            "{text}: {found}"
        );
    }
}

/// Where a value has the name of a unit, either may be meant; parentheses decide.
#[test]
fn units_and_values_of_one_name_are_told_apart() {
    let of = |text: &str| {
        model(&format!(
            "model m {{ param s = 4; param kg = 2; output y = {text}; }}"
        ))
    };
    for text in [
        "3 s",
        "8 m/s",
        "2 m*kg",
        "1 J/(kg*K)",
        "sum(2 m*k for k in 1..2) + 2 s",
    ] {
        let found = of(text);
        assert!(found.starts_with("E0236"), "{text}: {found}");
    }
    for (text, exact) in [
        ("3 (s)", "3"),
        ("3 (km/s)", "3000"),
        ("(8 m)/s", "8/s"),
        ("8 m/(s + 1)", "8/(s + 1)"),
        ("8 m/(s)", "E0236"),
        ("2 m*T", "2"),
        ("sum(2 m*m for m in 1..2)", "E0236"),
    ] {
        let found = of(text);
        let shown = found
            .split_once("output y = ")
            .map_or(&found[..5], |(_, value)| value.trim_end());
        assert_eq!(shown, exact, "{text}: {found}");
    }
}
