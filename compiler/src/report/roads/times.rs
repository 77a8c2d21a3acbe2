//! Events of several runs side by side, where they differ.

use std::fmt::{self, Write};

use super::{Roads, happened};

/// Rows that are shown at most.
const MOST: usize = 12;

/// An event of one kind on one surface, the same one in all runs: the first, the second, ..
#[derive(Debug, PartialEq)]
struct Row {
    name: String,
    /// When it happens, by runs; none where it does not.
    times: Vec<Option<f64>>,
}

/// The events that some of the runs do not have, or have at other instants.
pub(super) fn write(all: &Roads, text: &mut String) -> fmt::Result {
    let solved: Vec<usize> = (0..all.roads.len())
        .filter(|&k| all.roads[k].sound().is_some())
        .collect();
    let rows = rows(all, &solved);
    if rows.is_empty() {
        return Ok(());
    }
    let width = rows.iter().map(|row| row.name.chars().count()).max();
    let width = width.unwrap_or(0);
    writeln!(text, "\n  events that are not the same in all runs")?;
    write!(text, "  {:width$}", "")?;
    for road in &solved {
        write!(text, "  {:>16}", road + 1)?;
    }
    writeln!(text)?;
    for row in rows.iter().take(MOST) {
        write!(text, "  {:width$}", row.name)?;
        for time in &row.times {
            let time = time.map_or("-".to_owned(), |time| format!("{time:.9}"));
            write!(text, "  {time:>16}")?;
        }
        writeln!(text)?;
    }
    match rows.len().saturating_sub(MOST) {
        0 => Ok(()),
        more => writeln!(text, "  .. and {more} more"),
    }
}

/// Events in order of time that differ by more than the tolerance, relative to the horizon.
fn rows(all: &Roads, solved: &[usize]) -> Vec<Row> {
    let mut rows: Vec<(Row, usize)> = Vec::new();
    let mut horizon: f64 = 0.0;
    for (column, &road) in solved.iter().enumerate() {
        let Some(run) = all.roads[road].sound() else {
            continue;
        };
        horizon = horizon.max(run.samples.time.last().copied().unwrap_or(0.0));
        for event in happened(run) {
            let name = format!("{} of {}", event.kind.as_str(), event.surface);
            let number = rows.iter().filter(|(row, _)| row.name == name);
            let number = number
                .filter(|(row, _)| row.times[column].is_some())
                .count();
            let is_it = |(row, known): &(Row, usize)| row.name == name && *known == number;
            let place = rows.iter().position(is_it).unwrap_or_else(|| {
                let times = vec![None; solved.len()];
                let row = Row { name, times };
                rows.push((row, number));
                rows.len() - 1
            });
            rows[place].0.times[column] = Some(event.time);
        }
    }
    let mut rows: Vec<Row> = rows.into_iter().map(|(row, _)| row).collect();
    rows.retain(|row| differs(row, all.tolerance * horizon));
    let first = |row: &Row| {
        row.times
            .iter()
            .flatten()
            .copied()
            .fold(f64::INFINITY, f64::min)
    };
    rows.sort_by(|a, b| first(a).total_cmp(&first(b)));
    rows
}

fn differs(row: &Row, tolerance: f64) -> bool {
    let known = || row.times.iter().flatten().copied();
    let (first, last) = (
        known().fold(f64::INFINITY, f64::min),
        known().fold(0.0, f64::max),
    );
    row.times.contains(&None) || last - first > tolerance
}
