//! The table of sliding modes along a line.

use std::fmt::Write;

use crate::diagnostics::counted;
use crate::report::{Change, Map, Plane, Sample, words_of};

/// One row per interval without a change.
pub fn text(map: &Map) -> String {
    let mut text = format!(
        "sliding modes of {} over {}\n\n   {:<22} {:<22} {:>5}  {:<30} {}\n",
        map.switch, map.state, "from", "to", "modes", "in the middle", "ends with"
    );
    let first = map.samples.first().map_or(0.0, |sample| sample.at);
    let last = map.samples.last().map_or(0.0, |sample| sample.at);
    let starts = std::iter::once(first).chain(map.boundaries.iter().map(|b| b.at));
    let ends = map.boundaries.iter().map(|b| b.at).chain([last]);
    for (k, (from, to)) in starts.zip(ends).enumerate() {
        let middle = 0.5 * (from + to);
        let distance = |sample: &&Sample| (sample.at - middle).abs();
        let nearest = map
            .samples
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let modes = nearest.and_then(|sample| sample.modes.as_ref());
        let count = modes.map_or("?".to_owned(), |modes| modes.len().to_string());
        let natures = modes
            .into_iter()
            .flatten()
            .map(|mode| match mode.stability {
                s if s < 0.0 => "attracting",
                _ => "repelling",
            });
        let natures = natures.collect::<Vec<_>>().join(", ");
        let end = match map.boundaries.get(k) {
            None => String::new(),
            Some(boundary) => match (boundary.change, boundary.value) {
                (Change::Fold, Some(value)) => format!("fold at {} = {value:.6}", map.switch),
                (Change::Bound, Some(value)) => format!("{} = {value:.0}", map.switch),
                _ => "another change".to_owned(),
            },
        };
        let row = format!(
            "   {:<22} {:<22} {count:>5}  {natures:<30} {end}",
            number(from),
            number(to)
        );
        let _ = writeln!(text, "{}", row.trim_end());
    }
    text
}

/// Points of a curve in the table.
const POINTS: usize = 9;

/// What occurs over two states, and points of the curves in between.
pub fn plane_text(plane: &Plane) -> String {
    let [x, y] = &plane.states;
    let mut text = format!(
        "sliding modes of {} over {x} and {y}\n\n   {:<40} {:>8}\n",
        plane.switch, "modes", "share"
    );
    for (pattern, share) in plane.shares() {
        let words = words_of(pattern.as_deref());
        let _ = writeln!(text, "   {words:<40} {:>6.1} %", 100.0 * share);
    }
    for curve in &plane.curves {
        let what = match curve.change {
            Change::Fold => "folds",
            Change::Bound => "a mode reaches a side",
            Change::Other => "other changes",
        };
        let _ = writeln!(
            text,
            "\n   {what}, {} found\n   {x:<22} {y}",
            counted(curve.points.len(), "point")
        );
        let last = curve.points.len().saturating_sub(1);
        let shown = (0..POINTS).map(|k| k * last / (POINTS - 1));
        let mut shown: Vec<usize> = shown.collect();
        shown.dedup();
        for place in shown {
            let [a, b] = curve.points[place].map(number);
            let _ = writeln!(text, "   {a:<22} {b}");
        }
    }
    text
}

/// Twelve digits, without what rounding leaves behind them.
fn number(value: f64) -> String {
    let rounded = (value * 1e10).round() / 1e10;
    (rounded + 0.0).to_string()
}
