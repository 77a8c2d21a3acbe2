//! Values of all fits, and what is read of a file.

use proptest::prelude::*;

use super::read::table;
use super::{Fault, Fit, Table};

fn read(text: &str, column: &str, fit: Fit) -> Result<Table, Fault> {
    table(text.as_bytes(), column, fit)
}

/// Whether two numbers agree to rounding.
fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-13 * a.abs().max(b.abs()).max(1.0)
}

#[test]
fn values_are_held_from_their_row_on() {
    let table = Table::new(Fit::Hold, &[0.0, 1.0, 3.0], &[5.0, -1.0, 2.0]);
    let at = |t| table.value(t);
    assert_eq!(
        [at(0.0), at(0.999), at(1.0), at(2.5)],
        [5.0, 5.0, -1.0, -1.0]
    );
    assert_eq!([at(3.0), at(1e9)], [2.0, 2.0]);
    assert_eq!(
        (table.piece(0.5).end, table.piece(3.0).end),
        (1.0, f64::INFINITY)
    );
}

#[test]
fn equal_values_that_are_held_are_one_piece() {
    let table = Table::new(Fit::Hold, &[0.0, 1.0, 2.0, 3.0], &[1.0, 1.0, 1.0, 0.0]);
    assert_eq!(table.piece(0.0).end, 3.0);
    assert_eq!(table.n_rows, 4);
}

/// Of rows at one time the last one holds, and a line ends at the first of them.
#[test]
fn nothing_lasts_for_no_time() {
    let (times, values) = ([0.0, 1.0, 1.0, 1.0, 3.0], [0.0, 2.0, 9.0, 4.0, 6.0]);
    for (fit, inside) in [(Fit::Hold, [0.0, 4.0]), (Fit::Linear, [1.0, 5.0])] {
        let table = Table::new(fit, &times, &values);
        assert_eq!([0.5, 2.0].map(|t| table.value(t)), inside);
        assert_eq!((table.piece(0.5).end, table.value(1.0)), (1.0, 4.0));
        let instant = Table::new(fit, &[2.0, 2.0], &[1.0, 7.0]);
        assert_eq!([1.0, 2.0, 5.0].map(|t| instant.value(t)), [7.0; 3]);
    }
}

#[test]
fn lines_lead_from_row_to_row() {
    let table = Table::new(Fit::Linear, &[0.0, 1.0, 3.0], &[0.0, 2.0, -2.0]);
    assert_eq!(
        [0.25, 1.0, 2.0, 3.0].map(|t| table.value(t)),
        [0.5, 2.0, 0.0, -2.0]
    );
    assert_eq!(table.piece(1.0).coefficients, [2.0, -2.0]);
    assert_eq!(table.end(), 3.0);
}

#[test]
fn two_and_three_rows_give_a_line_and_a_parabola() {
    let line = Table::new(Fit::Cubic, &[1.0, 3.0], &[1.0, 2.0]);
    assert!(close(line.value(2.0), 1.5));
    // t² - t through 0, 1 and 3.
    let parabola = Table::new(Fit::Cubic, &[0.0, 1.0, 3.0], &[0.0, 0.0, 6.0]);
    for t in [0.3, 0.9, 1.7, 2.9] {
        assert!(close(parabola.value(t), t * t - t), "{t}");
    }
}

/// Against `scipy.interpolate.CubicSpline(t, r, bc_type="not-a-knot")` of SciPy 1.17.1.
#[test]
fn the_spline_is_the_not_a_knot_spline() {
    let t = [0.0, 0.7, 1.1, 2.5, 3.0, 4.2];
    let r = [1.0, -0.3, 0.4, 2.2, 1.9, -1.0];
    let spline = Table::new(Fit::Cubic, &t, &r);
    let expected = [
        (0.2, 0.09314726746674555),
        (0.5, -0.39482822861524314),
        (0.9, 0.0018320021042108926),
        (1.8, 1.6559066013811279),
        (2.7, 2.1525001358202234),
        (3.3, 1.4434114387373465),
        (4.0, -0.33088280567525397),
    ];
    for (t, value) in expected {
        assert!(close(spline.value(t), value), "{t}: {}", spline.value(t));
    }
}

proptest! {
    #[test]
    fn cubics_are_reproduced(
        c in prop::array::uniform4(-3.0..3.0_f64),
        steps in prop::collection::vec(0.05..2.0_f64, 3..12),
        share in 0.0..1.0_f64,
    ) {
        let cubic = |t: f64| c[0] + t * (c[1] + t * (c[2] + t * c[3]));
        let mut times = vec![-1.0];
        for step in steps {
            times.push(times[times.len() - 1] + step);
        }
        let values: Vec<f64> = times.iter().map(|&t| cubic(t)).collect();
        let spline = Table::new(Fit::Cubic, &times, &values);
        let (first, last) = spline.range;
        let t = first + share * (last - first);
        let size = values.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
        prop_assert!((spline.value(t) - cubic(t)).abs() <= 1e-10 * size);
    }

    #[test]
    fn splines_are_smooth_and_meet_their_rows(
        rows in prop::collection::vec((0.05..2.0_f64, -3.0..3.0_f64), 4..12),
    ) {
        let mut time = 0.0;
        let times: Vec<f64> = rows.iter().map(|(step, _)| { time += step; time }).collect();
        let values: Vec<f64> = rows.iter().map(|(_, value)| *value).collect();
        let spline = Table::new(Fit::Cubic, &times, &values);
        let n = times.len();
        for k in 1..n - 1 {
            let before = spline.piece(times[k - 1]).around(times[k]);
            let after = spline.piece(times[k]).coefficients;
            let size = before.iter().fold(1.0_f64, |m, c| m.max(c.abs()));
            // The third derivative too in the second and the last but one row.
            let smooth = if k == 1 || k == n - 2 { 4 } else { 3 };
            for (before, after) in before.iter().zip(after).take(smooth) {
                prop_assert!((before - after).abs() <= 1e-9 * size, "{k}: {before} {after}");
            }
            prop_assert_eq!(after[0], values[k]);
        }
        prop_assert!((spline.value(times[n - 1]) - values[n - 1]).abs() <= 1e-10);
    }
}

#[test]
fn a_piece_is_the_same_function_around_another_instant() {
    let spline = Table::new(Fit::Cubic, &[0.0, 1.0, 2.0, 4.0], &[0.0, 3.0, 1.0, -2.0]);
    let piece = spline.piece(1.5);
    let around = piece.around(1.75);
    for t in [1.2, 1.75, 1.9] {
        let s = t - 1.75;
        let value = around.iter().rev().fold(0.0, |sum, c| sum * s + c);
        assert!(close(value, piece.value(t)), "{t}");
    }
}

#[test]
fn marks_line_ends_and_blanks_of_other_programs_do_not_matter() {
    let expected = read("time,r\n0,1\n1,2\n", "r", Fit::Linear).unwrap();
    for text in [
        "\u{feff}time,r\r\n0,1\r\n1,2\r\n",
        "time , r\n 0 , 1\n 1, 2",
        "\"time\",\"r\"\n0,1\n\n1,2\n\n",
        "time,r\r0,1\r1,2\r",
    ] {
        assert_eq!(
            read(text, "r", Fit::Linear).as_ref(),
            Ok(&expected),
            "{text:?}"
        );
    }
}

#[test]
fn other_columns_may_hold_anything() {
    let text = "t,note,\"set point\"\n0,\"a, b\",1\n2,,3\n";
    let table = read(text, "set point", Fit::Linear).unwrap();
    assert_eq!(table.value(1.0), 2.0);
    // Time itself is a column.
    assert_eq!(read(text, "t", Fit::Linear).unwrap().value(1.5), 1.5);
}

#[test]
fn faults_name_the_line_of_the_file() {
    let fault = read("time,r\n0,1\n\n1,x\n", "r", Fit::Linear);
    let expected = Fault::Cell {
        line: 4,
        column: "r".into(),
        text: "x".into(),
    };
    assert_eq!(fault, Err(expected));
    let fault = read("time,r\n0,1\n1,2\n0.5,2\n", "r", Fit::Hold);
    let expected = Fault::Order {
        line: 4,
        time: 0.5,
        before: 1.0,
    };
    assert_eq!(fault, Err(expected));
    let fault = read("time,r\n0,NaN\n1,2\n", "r", Fit::Hold);
    let expected = Fault::Cell {
        line: 2,
        column: "r".into(),
        text: "NaN".into(),
    };
    assert_eq!(fault, Err(expected));
}

proptest! {
    /// Whatever the file holds, it is read or refused.
    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        for fit in Fit::ALL {
            if let Ok(read) = table(&bytes, "r", fit) {
                prop_assert!(read.value(0.0).is_finite());
            }
        }
    }

    #[test]
    fn any_cells_are_read_or_refused(
        cells in prop::collection::vec(("[-+.,;e0-9nif ]{0,6}", "[-+.,e0-9\"\n]{0,6}"), 0..8)
    ) {
        let rows: String = cells.iter().map(|(t, r)| format!("{t},{r}\n")).collect();
        let text = format!("time,r\n{rows}");
        for fit in Fit::ALL {
            if let Ok(read) = table(text.as_bytes(), "r", fit) {
                prop_assert!(read.range.0 <= read.range.1);
                prop_assert!(read.value(read.range.0).is_finite());
            }
        }
    }
}
