use proptest::prelude::*;

use super::*;
use crate::optimization::problem::{Mpcc, Nlp, Pair, Side};

/// A header for n variables, m rows and one objective, with these numbers of binary and integer variables.
fn header(n: usize, m: usize, defined: usize, discrete: &str) -> String {
    format!(
        "g3 1 1 0\t# problem test\n {n} {m} 1 0 0\t# vars\n 0 1\n 0 0\n 0 {n} 0\n 0 0 0 1\n {discrete} 0 0 0\n 0 0\n \
         0 0\n {defined} 0 0 0 0\n"
    )
}

/// minimize (v0 - 1)² + exp(v0 v1) + 2 v1  subject to  1 <= v0 + 3 v1 <= 4,  v0² complements v1 >= 0
fn small() -> String {
    let segments = "C0\nn0\nC1\no5\nv0\nn2\nO0 0\no0\no5\no1\nv0\nn1\nn2\no44\no2\nv0\nv1\nx1\n0 0.5\nr\n0 1 4\n5 1 2\n\
                    b\n3\n2 0\nk1\n1\nJ0 2\n0 1\n1 3\nJ1 1\n0 0\nG0 2\n0 0\n1 2\n";
    header(2, 2, 0, "0 0") + segments
}

fn program(text: &str) -> Problem {
    read(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

fn fault(text: &str) -> String {
    let error = read(text.as_bytes()).expect_err("the file is wrong");
    assert!(error.fault.way_out().is_none_or(|way| !way.is_empty()));
    error.to_string()
}

fn rows(problem: &mut Problem, w: &[f64]) -> Vec<f64> {
    let mut rows = vec![0.0; problem.program.n_rows()];
    problem.program.rows(w, &mut rows);
    problem
        .rows
        .iter()
        .map(|at| rows[at.row as usize])
        .collect()
}

#[test]
fn a_small_file_is_the_program_that_it_says() {
    let mut problem = program(&small());
    assert_eq!(problem.program.start(), [0.5, 0.0]);
    let w = [2.0, 0.25];
    let exact = 1.0 + 0.5f64.exp() + 0.5;
    assert!((problem.program.objective(&w) - exact).abs() < 1e-15);
    assert_eq!(rows(&mut problem, &w), [2.75, 4.0]);
    let bounds = problem.program.row_bounds();
    let at = |row: usize| problem.rows[row].row as usize;
    assert_eq!((bounds.lower[at(0)], bounds.upper[at(0)]), (1.0, 4.0));
    assert_eq!(
        (bounds.lower[at(1)], bounds.upper[at(1)]),
        (0.0, f64::INFINITY)
    );
    let row = Side::Row(at(1) as u32);
    assert_eq!(
        problem.program.pairs(),
        [Pair {
            a: row,
            b: Side::Variable(1)
        }]
    );
    assert_eq!(problem.sizes.complementarities, 1);
    assert_eq!(problem.sense, Sense::Minimize);
}

#[test]
fn binary_form_says_the_same() {
    let mut bytes = header(2, 1, 0, "0 0").replace("g3", "b3").into_bytes();
    let int = |i: i32| i.to_le_bytes().to_vec();
    let real = |x: f64| x.to_le_bytes().to_vec();
    let mut push = |parts: &[Vec<u8>]| bytes.extend(parts.concat());
    // C0: v0 * 1.5 ^ 2, with each kind of number.
    push(&[b"C".to_vec(), int(0), b"o".to_vec(), int(54), int(3)]);
    push(&[
        b"o".to_vec(),
        int(2),
        b"v".to_vec(),
        int(0),
        b"n".to_vec(),
        real(1.5),
    ]);
    push(&[
        b"s".to_vec(),
        7i16.to_le_bytes().to_vec(),
        b"l".to_vec(),
        int(-100_000),
    ]);
    push(&[b"O".to_vec(), int(0), int(1), b"v".to_vec(), int(1)]);
    push(&[
        b"S".to_vec(),
        int(0),
        int(1),
        int(3),
        b"abc".to_vec(),
        int(1),
        int(5),
    ]);
    push(&[b"x".to_vec(), int(1), int(1), real(0.25)]);
    push(&[
        b"r4".to_vec(),
        real(8.0),
        b"b".to_vec(),
        b"0".to_vec(),
        real(-1.0),
        real(2.0),
        b"3".to_vec(),
    ]);
    push(&[b"k".to_vec(), int(1), int(1)]);
    push(&[b"J".to_vec(), int(0), int(1), int(1), real(-4.0)]);
    let mut problem = read(&bytes).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(
        rows(&mut problem, &[2.0, 10.0]),
        [3.0 + 7.0 - 100_000.0 - 40.0]
    );
    assert_eq!(problem.program.start(), [0.0, 0.25]);
    let value = problem.program.objective(&[2.0, 10.0]);
    assert_eq!(
        (problem.sense, problem.objective(value)),
        (Sense::Maximize, 10.0)
    );
    let bounds = problem.program.variable_bounds();
    assert_eq!(
        (bounds.lower, bounds.upper),
        (&[-1.0, f64::NEG_INFINITY][..], &[2.0, f64::INFINITY][..])
    );
}

#[test]
fn every_operator_has_its_value() {
    let x = 0.7f64;
    let y = 1.3f64;
    let cases: [(&str, f64); 30] = [
        ("o0\nv0\nv1", x + y),
        ("o1\nv0\nv1", x - y),
        ("o2\nv0\nv1", x * y),
        ("o3\nv0\nv1", x / y),
        ("o5\nv0\nv1", x.powf(y)),
        ("o5\nv0\nn3", x.powi(3)),
        ("o5\nn3\nv0", 3f64.powf(x)),
        ("o76\nv0\nn-2.5", x.powf(-2.5)),
        ("o77\nv0", x * x),
        ("o78\nn2\nv1", 2f64.powf(y)),
        ("o16\nv0", -x),
        ("o37\nv0", x.tanh()),
        ("o38\nv0", x.tan()),
        ("o39\nv0", x.sqrt()),
        ("o40\nv0", x.sinh()),
        ("o41\nv0", x.sin()),
        ("o42\nv0", x.log10()),
        ("o43\nv0", x.ln()),
        ("o44\nv0", x.exp()),
        ("o45\nv0", x.cosh()),
        ("o46\nv0", x.cos()),
        ("o47\nv0", x.atanh()),
        ("o48\nv0\nv1", x.atan2(y)),
        ("o49\nv0", x.atan()),
        ("o50\nv0", x.asinh()),
        ("o51\nv0", x.asin()),
        ("o52\nv1", y.acosh()),
        ("o53\nv0", x.acos()),
        ("o54\n3\nv0\nv1\nn2", x + y + 2.0),
        ("o79\nv0", 1.0 / (1.0 + (-x).exp())),
    ];
    for (expression, exact) in cases {
        let text = header(2, 1, 0, "0 0") + &format!("C0\n{expression}\nr\n3\nb\n3\n3\n");
        let value = rows(&mut program(&text), &[x, y])[0];
        assert!(
            (value - exact).abs() <= 4e-16 * (1.0 + exact.abs()),
            "{expression}: {value}, {exact}"
        );
    }
}

#[test]
fn inverse_hyperbolic_functions_are_accurate_on_both_sides_of_zero() {
    let text = header(2, 1, 0, "0 0") + "C0\no50\nv0\nr\n3\nb\n3\n3\n";
    let mut problem = program(&text);
    for x in [-1e5f64, -3.0, 1e-3, 2.0, 1e5] {
        let value = rows(&mut problem, &[x, 0.0])[0];
        assert!((value - x.asinh()).abs() < 1e-15 * (1.0 + x.abs()), "{x}");
    }
}

#[test]
fn defined_variables_have_linear_terms_and_contain_each_other() {
    // v2 = v0² + 3 v1, v3 = v2 + v2²; row: v3 + v2.
    let definitions = "V2 1 0\n1 3\no5\nv0\nn2\nV3 0 1\no0\nv2\no5\nv2\nn2\n";
    let text = header(2, 1, 2, "0 0") + definitions + "C0\no0\nv3\nv2\nr\n3\nb\n3\n3\n";
    assert_eq!(rows(&mut program(&text), &[2.0, 1.0]), [2.0 * 7.0 + 49.0]);
}

#[test]
fn rows_of_one_shape_are_one_kernel() {
    // c_i = (i + 1) v_i² + v_{i+1}; the last one has another exponent.
    let n = 20;
    let mut text = header(n, n - 1, 0, "0 0");
    for i in 0..n - 1 {
        let exponent = if i == n - 2 { 3 } else { 2 };
        text += &format!("C{i}\no2\nn{}\no5\nv{i}\nn{exponent}\n", i + 1);
    }
    text += &("r\n".to_owned() + &"3\n".repeat(n - 1) + "b\n" + &"3\n".repeat(n));
    for i in 0..n - 1 {
        text += &format!("J{i} 2\n{i} 0\n{} 1\n", i + 1);
    }
    let mut problem = program(&text);
    assert_eq!(problem.program.n_blocks(), 2);
    let w: Vec<f64> = (0..n).map(|i| i as f64).collect();
    let exact = (0..n - 1).map(|i| {
        let exponent = if i == n - 2 { 3 } else { 2 };
        (i as f64 + 1.0) * (i as f64).powi(exponent) + i as f64 + 1.0
    });
    assert_eq!(rows(&mut problem, &w), exact.collect::<Vec<f64>>());
}

#[test]
fn two_bounds_are_two_pairs() {
    // 3 v0 complements -1 <= v1 <= 2.
    let text = header(2, 1, 0, "0 0") + "C0\nn0\nr\n5 3 2\nb\n3\n0 -1 2\nJ0 1\n0 3\n";
    let mut problem = program(&text);
    assert_eq!(problem.program.n_variables(), 4);
    assert_eq!(problem.sizes.complementarities, 2);
    // v1 at its lower bound: the body, 6, is p.
    let w = [2.0, -1.0, 6.0, 0.0];
    let distances = distances(&mut problem, &w);
    assert_eq!(distances, [(6.0, 0.0), (0.0, 3.0)]);
    assert_eq!(rows(&mut problem, &w), [0.0]);
}

#[test]
fn quality_names_the_worst_row() {
    let mut problem = program(&small());
    // Row 0 is 2 + 3 · 1 = 5 > 4; the pair is (4, 1).
    let quality = problem.quality(&[2.0, 1.0]);
    assert_eq!(quality.violation, 1.0);
    assert_eq!(quality.worst, Some(Named::Row(0)));
    assert_eq!(
        (quality.complementarity_min, quality.complementarity_product),
        (1.0, 4.0)
    );
    let quality = problem.quality(&[2.0, -3.0]);
    assert_eq!(
        (quality.violation, quality.worst),
        (8.0, Some(Named::Row(0)))
    );
    assert_eq!(problem.quality(&[f64::NAN, 0.0]).violation, f64::INFINITY);
}

#[test]
fn solution_files_have_multipliers_in_the_sense_of_ampl() {
    // minimize or maximize v1 with 3 v0 <= 0 complementing v1 <= 2: the row is turned around.
    let text = header(2, 1, 0, "0 0") + "C0\nn0\nO0 1\nv1\nr\n5 2 2\nb\n3\n1 2\nJ0 1\n0 3\n";
    let problem = program(&text);
    let y = [0.25, 0.0];
    let y: Vec<f64> = (0..2)
        .map(|i| if i == problem.rows[0].row { y[0] } else { y[1] })
        .collect();
    let solution = problem.solution_file("nsdc: solved\n\nwell", &[-1.0, 2.0], &y, Code::Solved);
    assert_eq!(
        solution,
        "nsdc: solved\n \nwell\n\nOptions\n3\n1\n1\n0\n1\n1\n2\n2\n-0.25\n-1\n2\nobjno 0 0\n"
    );
}

#[test]
fn a_sum_over_dense_terms_is_refused_and_one_over_sparse_terms_is_not() {
    // √(Σ v_i²) is dense, Σ v_i² is not.
    let n = 6000;
    let squares: String = (0..n).map(|i| format!("o5\nv{i}\nn2\n")).collect();
    let bounds = "r\n3\nb\n".to_owned() + &"3\n".repeat(n);
    let sum = format!("o54\n{n}\n{squares}");
    let sparse = header(n, 1, 0, "0 0") + "C0\n" + &sum + &bounds;
    let problem = program(&sparse);
    assert_eq!(problem.program.hessian_pattern().n_entries(), n);
    let dense = header(n, 1, 0, "0 0") + "C0\no39\n" + &sum + &bounds;
    assert!(fault(&dense).contains("row 0 makes more than 10000000 second derivatives"));
}

/// Both members of all pairs.
fn distances(problem: &mut Problem, w: &[f64]) -> Vec<(f64, f64)> {
    let mut values = vec![0.0; problem.program.n_rows()];
    problem.program.rows(w, &mut values);
    let program = &problem.program;
    let distance = |side| match side {
        Side::Variable(i) => w[i as usize] - program.variable_bounds().lower[i as usize],
        Side::Row(i) => values[i as usize] - program.row_bounds().lower[i as usize],
    };
    let pairs = program.pairs().iter();
    pairs
        .map(|pair| (distance(pair.a), distance(pair.b)))
        .collect()
}

#[test]
fn an_upper_bound_turns_the_row_around() {
    // 3 v0 <= 0 complements v1 <= 2.
    let text = header(2, 1, 0, "0 0") + "C0\nn0\nr\n5 2 2\nb\n3\n1 2\nJ0 1\n0 3\n";
    let mut problem = program(&text);
    assert!(problem.rows[0].negated);
    assert_eq!(distances(&mut problem, &[-1.0, 0.5]), [(3.0, 1.5)]);
}

#[test]
fn a_row_that_complements_a_free_variable_is_an_equation() {
    let text = header(2, 1, 0, "0 0") + "C0\nv0\nr\n5 0 2\nb\n3\n3\n";
    let problem = program(&text);
    let bounds = problem.program.row_bounds();
    assert_eq!((bounds.lower, bounds.upper), (&[0.0][..], &[0.0][..]));
    assert!(problem.program.pairs().is_empty());
}

#[test]
fn binary_variables_are_pairs() {
    let text = header(2, 0, 0, "1 0") + "b\n3\n0 0 1\n";
    let mut problem = program(&text);
    assert_eq!(distances(&mut problem, &[5.0, 0.25]), [(0.25, 0.75)]);
    let text = header(2, 0, 0, "1 0") + "b\n3\n0 0 7\n";
    assert_eq!(
        fault(&text),
        "line 13: variable 1 is declared binary, but its bounds are not 0 and 1"
    );
}

#[test]
fn integers_between_zero_and_one_are_binary_wherever_they_are() {
    // (v0 - v1)² with both integer in the objective alone, and v2 integer and linear.
    let nonlinear = |bounds: &str| {
        "g3 1 1 0\n 3 0 1 0 0\n 0 1\n 0 0\n 0 2 0\n 0 0 0 1\n 0 1 0 0 2\n 0 0\n 0 0\n 0 0 0 0 0\n"
            .to_owned()
            + "O0 0\no5\no1\nv0\nv1\nn2\nb\n0 0 1\n0 0 1\n"
            + bounds
    };
    let problem = program(&nonlinear("0 0 1\n"));
    assert_eq!(
        (problem.program.pairs().len(), problem.sizes.binaries),
        (3, 3)
    );
    // One that is fixed is a number.
    let problem = program(&nonlinear("0 4 4\n"));
    assert_eq!(
        (problem.program.pairs().len(), problem.sizes.binaries),
        (2, 2)
    );
    assert_eq!(
        fault(&nonlinear("0 0 4\n")),
        "line 7: 1 variables are integer"
    );
}

#[test]
fn kinks_are_pairs_that_start_where_they_hold() {
    // |v0 - v1| + min(v0, v1, 3) - max(v0, v1)
    let expression = "o0\no15\no1\nv0\nv1\no1\no11\n3\nv0\nv1\nn3\no12\n2\nv0\nv1\n";
    let text = header(2, 1, 0, "0 0") + "C0\n" + expression + "x2\n0 5\n1 4\nr\n3\nb\n3\n3\n";
    let mut problem = program(&text);
    assert_eq!(problem.sizes.kinks, 4);
    let w = problem.program.start().to_vec();
    assert_eq!(rows(&mut problem, &w), [1.0 + 3.0 - 5.0]);
    let mut all = vec![f64::NAN; problem.program.n_rows()];
    problem.program.rows(&w, &mut all);
    let bounds = problem.program.row_bounds();
    for (row, value) in all.iter().enumerate() {
        assert!(bounds.lower[row] <= *value && *value <= bounds.upper[row]);
    }
    assert!(
        distances(&mut problem, &w)
            .iter()
            .all(|&(a, b)| a.min(b) == 0.0)
    );
}

/// Each text is refused with the message beside it.
fn refused(cases: impl IntoIterator<Item = (String, &'static str)>) {
    for (text, message) in cases {
        assert_eq!(fault(&text), message);
    }
}

#[test]
fn what_cannot_be_solved_is_refused_by_name() {
    let one = |expression: &str| header(1, 1, 0, "0 0") + "C0\n" + expression + "\nr\n3\nb\n3\n";
    refused([
        (
            one("o13\nv0"),
            "line 12: `floor` in row 0 is not differentiable",
        ),
        (
            one("o35\no23\nv0\nn1\nv0\nn0"),
            "line 12: `if` in row 0 is not differentiable",
        ),
        (one("o99\nv0"), "line 12: no operator has the number 99"),
        (one("v3"), "line 12: variable 3, but there are only 1"),
        (one("nx"), "line 12: `x` where a number should be"),
        (one("nNaN"), "line 12: NaN where a number should be"),
        (
            header(1, 1, 1, "0 0") + "C0\nv1\n",
            "line 12: defined variable 1 is used before it is defined",
        ),
        (
            header(1, 1, 0, "0 0") + "C0\no0\nv0\n",
            "line 13: the file ends where an operator, a variable or a number should be",
        ),
    ]);
}

#[test]
fn segments_that_are_wrong_are_refused_by_name() {
    refused([
        (
            header(1, 1, 0, "0 0") + "b\n3\n",
            "line 12: the file has no bounds of rows (`r`)",
        ),
        (
            header(1, 0, 0, "0 0"),
            "line 10: the file has no bounds of variables (`b`)",
        ),
        (
            header(1, 0, 0, "0 0") + "b\n0 2 1\n",
            "line 12: variable 0 has the bounds 2 and 1, between which there is nothing",
        ),
        (
            header(1, 1, 0, "0 0") + "r\n5 1 1\nb\n3\n",
            "line 14: row 0 complements variable 0 at its lower bound, which is not finite",
        ),
        (
            header(1, 1, 0, "0 0") + "r\n5 1 0\nb\n3\n",
            "line 12: variable -1, but there are only 1",
        ),
        (
            header(1, 0, 0, "0 0") + "b\n9\n",
            "line 12: `9` where the kind of a bound should be",
        ),
        (
            header(1, 0, 0, "0 0") + "b\n3\nQ\n",
            "line 13: `Q` where the letter of a segment should be",
        ),
        (
            header(1, 0, 0, "0 0") + "b\n3\nb\n3\n",
            "line 13: a second segment of bounds of variables (`b`)",
        ),
    ]);
}

#[test]
fn what_a_header_announces_is_refused_by_name() {
    refused([
        (
            header(2, 0, 0, "0 2") + "b\n3\n3\n",
            "line 7: 2 variables are integer",
        ),
        (
            header(1, 0, 0, "0 0") + "S0 1 sosno\n0 1\n",
            "line 11: the file has special ordered sets (suffix `sosno`)",
        ),
        (
            header(1, 0, 0, "0 0") + "L0\n",
            "line 11: the file has 1 logical constraints",
        ),
        (
            header(9_999_999, 0, 0, "0 0"),
            "line 2: the header announces 9999999 variables, which do not fit into 112 bytes",
        ),
        (
            "h".to_owned(),
            "line 1: this is no .nl file: it starts neither with `g` (text) nor with `b` (binary)",
        ),
        (
            String::new(),
            "line 0: this is no .nl file: it starts neither with `g` (text) nor with `b` (binary)",
        ),
        (
            "g3 1 1 0\n".to_owned(),
            "line 1: the file ends where variables, constraints, objectives, ranges, equations should be",
        ),
    ]);
}

#[test]
fn deep_and_long_expressions_are_read() {
    let depth = 100_000;
    let text = header(1, 1, 0, "0 0") + "C0\n" + &"o16\n".repeat(depth) + "v0\nr\n3\nb\n3\n";
    assert_eq!(rows(&mut program(&text), &[2.0]), [2.0]);
    let long = format!("C0\no54\n{depth}\n") + &"v0\n".repeat(depth);
    let text = header(1, 1, 0, "0 0") + &long + "r\n3\nb\n3\n";
    assert_eq!(rows(&mut program(&text), &[2.0]), [2.0 * depth as f64]);
}

#[test]
fn definitions_that_explode_are_refused() {
    // Every one of 2000 rows uses a chain of 2000 definitions.
    let n = 2000;
    let mut text = header(1, n, n, "0 0");
    for i in 1..=n {
        text += &format!("V{i} 0 0\no2\nv{}\no41\nv{}\n", i - 1, i - 1);
    }
    for i in 0..n {
        text += &format!("C{i}\no5\nv{n}\nn{i}\n");
    }
    text += &("r\n".to_owned() + &"3\n".repeat(n) + "b\n3\n");
    assert!(fault(&text).contains("makes more than 5000000 operations"));
}

proptest! {
    /// Whatever is done to a file, it is read or refused.
    #[test]
    fn mutations_do_no_harm(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..4u8), 1..6),
        binary in any::<bool>(),
    ) {
        let mut bytes = small().into_bytes();
        if binary {
            bytes[0] = b'b';
        }
        for (at, byte, kind) in edits {
            let at = at.index(bytes.len());
            match kind {
                0 => bytes[at] = byte,
                1 => bytes[at] = b'0' + byte % 10,
                2 => bytes.insert(at, byte),
                _ => _ = bytes.remove(at),
            }
        }
        if let Ok(mut problem) = read(&bytes) {
            let w = problem.program.start().to_vec();
            problem.program.objective(&w);
        }
    }

    /// Any bytes behind a header.
    #[test]
    fn any_bytes_do_no_harm(tail in prop::collection::vec(any::<u8>(), 0..200), binary in any::<bool>()) {
        let mut bytes = header(2, 2, 1, "0 0").into_bytes();
        if binary {
            bytes[0] = b'b';
        }
        bytes.extend(tail);
        let _ = read(&bytes);
    }
}
