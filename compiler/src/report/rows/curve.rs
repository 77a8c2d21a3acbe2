//! Instants of a run from which straight lines follow its curves.
//!
//! A step [a, b] of a run that takes T in all is cut into ⌈N (b - a)/T⌉ equal parts. Figures have all their ends. Of those
//! inside of a step, tables have the ones that straight lines need so that no value is further from them than δ, a share
//! of the range of its column: where it is, the furthest is kept, and both sides are looked at again (Douglas and Peucker
//! 1973).

use crate::report::{Dense, Samples, Series};

/// N, with which curves look smooth.
const PARTS: f64 = 1200.0;
/// δ as a share of the range, which no figure shows.
const DEVIATION: f64 = 5e-4;
/// The least δ relative to the size of the values, some hundred times their last digit: rounding makes no rows.
const ROUNDING: f64 = 1e-13;

/// The number of parts of a step, in a run that takes `span` in all.
fn parts(length: f64, span: f64) -> f64 {
    (length / span * PARTS).ceil().max(1.0)
}

/// Whether rows are added inside of a step.
pub fn is_divided(length: f64, span: f64) -> bool {
    parts(length, span) > 1.0
}

/// The ends of the parts of a step: its own, and those inside of it.
pub fn instants(from: f64, to: f64, span: f64) -> impl DoubleEndedIterator<Item = f64> {
    let n = parts(to - from, span);
    let before = (0..n as usize).map(move |k| from + (to - from) * (k as f64 / n));
    before.chain([to])
}

/// The samples at the ends of all parts, both ends of every piece among them.
///
/// `values` gives all reported states, outputs and controls, entry by entry, from
/// an instant and the rows of a piece there. Without pieces nothing changes.
pub fn refine(samples: &mut Samples, dense: &Dense, values: &dyn Fn(f64, &[f64]) -> Vec<f64>) {
    let (Some(first), Some(last)) = (dense.pieces.first(), dense.pieces.last()) else {
        return;
    };
    let span = last.to - first.from;
    let mut passed = Vec::new();
    let mut all: Vec<&mut Series> = samples.series_mut().collect();
    all.iter_mut().for_each(|series| series.values.clear());

    let (n_rows, mut rows) = (first.n_rows(), Vec::new());
    for piece in dense.pieces.iter() {
        let begun = passed.len();
        passed.extend(instants(piece.from, piece.to, span));
        rows.clear();
        piece.read(&passed[begun..], n_rows, &mut rows);
        for (k, &time) in passed[begun..].iter().enumerate() {
            let mut entries = values(time, &rows[k * n_rows..][..n_rows]).into_iter();
            for series in &mut all {
                series
                    .values
                    .extend(entries.by_ref().take(series.n_entries()));
            }
        }
    }
    samples.time = passed;
}

/// Leaves out rows that straight lines do without, of those that are inside of steps.
pub(crate) fn thin(samples: &mut Samples, inside: &[bool]) {
    let columns: Vec<Column> = (samples.series())
        .flat_map(|series| series.columns())
        .filter_map(|(_, values)| Column::new(values))
        .collect();
    let mut kept: Vec<bool> = inside.iter().map(|is_inside| !is_inside).collect();
    let ends: Vec<usize> = (0..kept.len()).filter(|&k| kept[k]).collect();
    let pairs = ends.windows(2).map(|pair| [pair[0], pair[1]]);
    let has_rows = |&[first, last]: &[usize; 2]| last - first > 1;
    let mut open: Vec<[usize; 2]> = pairs.filter(has_rows).collect();
    while let Some([first, last]) = open.pop() {
        if let Some(k) = furthest(&samples.time, &columns, [first, last]) {
            kept[k] = true;
            open.extend([[first, k], [k, last]].into_iter().filter(has_rows));
        }
    }
    keep(samples, &kept);
}

/// Leaves out the other rows.
pub(crate) fn keep(samples: &mut Samples, kept: &[bool]) {
    for series in samples.series_mut() {
        let n = series.n_entries().max(1);
        let mut entry = 0..;
        series
            .values
            .retain(|_| entry.next().is_some_and(|entry: usize| kept[entry / n]));
    }
    let mut row = kept.iter();
    samples.time.retain(|_| row.next() == Some(&true));
}

/// Values over time, and how far from them a straight line may be.
struct Column {
    values: Vec<f64>,
    tolerance: f64,
}

impl Column {
    /// None where all values are the same.
    fn new(values: Vec<f64>) -> Option<Self> {
        let finite = values.iter().copied().filter(|value| value.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        let size = low.abs().max(high.abs());
        (low < high).then(|| Column {
            tolerance: (DEVIATION * (high - low)).max(ROUNDING * size),
            values,
        })
    }
}

/// The row between two others whose values are furthest from the straight line, where that is too far.
fn furthest(time: &[f64], columns: &[Column], [first, last]: [usize; 2]) -> Option<usize> {
    let mut found = (None, 1.0);
    for Column { values, tolerance } in columns {
        let slope = (values[last] - values[first]) / (time[last] - time[first]);
        for k in first + 1..last {
            let line = values[first] + slope * (time[k] - time[first]);
            let distance = (values[k] - line).abs() / tolerance;
            if distance > found.1 {
                found = (Some(k), distance);
            }
        }
    }
    found.0
}

#[cfg(test)]
mod tests {
    use super::{PARTS, Samples, instants, refine, thin};
    use crate::report::{Dense, Piece, sample};

    #[test]
    fn pieces_are_sampled_with_both_ends() {
        let mut trajectory = sample::shapes();
        trajectory.samples.states.truncate(1);
        trajectory.samples.outputs = vec![trajectory.samples.states[0].clone()];
        let piece = |from: f64, to: f64, coefficients: [f64; 2]| Piece {
            from,
            to,
            n_coefficients: 2,
            coefficients: coefficients.to_vec(),
        };
        trajectory.dense = Dense {
            pieces: vec![piece(0.0, 0.5, [1.0, 2.0]), piece(0.5, 1.0, [5.0, 0.0])].into(),
        };
        let (fine, values) = (&mut trajectory.samples, |time, row: &[f64]| {
            vec![row[0], row[0] - time]
        });
        refine(fine, &trajectory.dense, &values);
        assert_eq!(trajectory.verify(), Ok(()));
        let fine = &trajectory.samples;
        let half = PARTS as usize / 2;
        assert_eq!(fine.time.len(), 2 * half + 2);
        assert_eq!(fine.time[half..=half + 1], [0.5, 0.5]);
        assert_eq!(fine.time[half / 2], 0.25);
        let values = &fine.states[0].values;
        assert_eq!(
            [values[half / 2], values[half], values[half + 1]],
            [1.5, 2.0, 5.0]
        );
        assert_eq!(fine.outputs[0].values[half / 2], 1.25);
    }

    /// Of 0.2 and 0.9, the first plus the difference is not the second.
    #[test]
    fn the_ends_of_a_step_are_exact() {
        for (from, to) in [(0.1, 0.7), (0.2, 0.9)] {
            let mut all = instants(from, to, to - from);
            assert_eq!((all.next(), all.next_back()), (Some(from), Some(to)));
            let most = (PARTS as usize - 1, true);
            let rising = instants(from, to, to - from).is_sorted_by(|a, b| a < b);
            assert_eq!((all.count(), rising), most);
        }
    }

    /// A parabola over [0, 1] in parts of 1/100, then a straight line: of m equal parts of the parabola, the middle of each
    /// is 1/(4 m²) below its chord, which is below 5e-4 for m = 23.
    #[test]
    fn rows_are_kept_where_the_curve_bends() {
        let mut trajectory = sample::shapes();
        let (samples, n): (&mut Samples, _) = (&mut trajectory.samples, 200);
        samples.time = (0..=n).map(|k| 0.01 * f64::from(k)).collect();
        let value = |t: &f64| if *t < 1.0 { t * t } else { 1.0 };
        samples.states[0].values = samples.time.iter().map(value).collect();
        let exact = trajectory.samples.states[0].values.clone();
        trajectory.samples.states.truncate(1);
        let inside: Vec<bool> = (0..=n).map(|k| k % n != 0).collect();
        let all = trajectory.samples.time.clone();
        thin(&mut trajectory.samples, &inside);
        assert_eq!(trajectory.verify(), Ok(()));
        let (time, values) = (
            &trajectory.samples.time,
            &trajectory.samples.states[0].values,
        );
        assert!(time.len() > 20 && time.len() < 45, "{} rows", time.len());
        assert_eq!([time[0], time[time.len() - 1]], [0.0, 2.0]);
        assert!(time.iter().filter(|t| **t > 1.005).count() == 1);
        for (t, exact) in all.iter().zip(exact) {
            let after = time.partition_point(|other| other < t).max(1);
            let share = (t - time[after - 1]) / (time[after] - time[after - 1]);
            let line = values[after - 1] + share * (values[after] - values[after - 1]);
            assert!((line - exact).abs() <= 5e-4, "{line} for {exact} at {t}");
        }
    }
}
