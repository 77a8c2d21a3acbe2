//! The rows of a sweep as CSV, as JSON and as text.

use serde_json::{Map, Value, json};

use super::{Grid, Row};
use crate::model::Units;
use crate::report::Status;
#[cfg(feature = "plots")]
use crate::report::plot::Sweep;

/// Rows that are printed one by one.
const SHOWN: usize = 24;
/// Panels of a figure.
#[cfg(feature = "plots")]
const MOST_PANELS: usize = 12;

/// A sweep that has been run.
pub struct Table<'s> {
    /// What was gone through.
    pub grid: &'s Grid,
    /// The names of end values.
    pub columns: &'s [String],
    /// A row per point, none where it was not run.
    pub rows: &'s [Option<Row>],
    /// Whether the experiment has expectations.
    pub has_expectations: bool,
    /// Of what is gone through, and of end values.
    pub units: &'s Units,
}

impl Table<'_> {
    pub(crate) fn done(&self) -> impl Iterator<Item = (Vec<f64>, &Row)> {
        let rows = self.rows.iter().enumerate();
        rows.filter_map(|(k, row)| Some((self.grid.point(k), row.as_ref()?)))
    }

    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.grid.axes().iter().map(|axis| axis.name.as_str())
    }

    /// An axis may be an initial value of the same name.
    pub(crate) fn at_end(&self) -> impl Iterator<Item = String> {
        self.columns.iter().map(|name| format!("{name} at end"))
    }

    pub(crate) fn has_objective(&self) -> bool {
        self.done().any(|(_, row)| row.objective.is_some())
    }

    /// Parameters, status, code, end values, objective, number of events, error estimate, number of expectations that are
    /// missed: a line per run. Numbers round-trip, and what a run does not have is empty.
    pub fn csv(&self) -> String {
        let (has_objective, has_expectations) = (self.has_objective(), self.has_expectations);
        let mut text = csv::Writer::from_writer(Vec::new());
        let objective = has_objective.then_some("objective");
        let ends: Vec<String> = self.at_end().collect();
        let header = (self.names().chain(["status", "code"]))
            .chain(ends.iter().map(String::as_str))
            .chain(objective)
            .chain(["events", "error_estimate"])
            .chain(has_expectations.then_some("missed"));
        // Writing to memory does not fail and every record has the same length.
        let _ = text.write_record(header);
        let number = |value: f64| format!("{value:?}");
        let known = |value: Option<f64>| value.map_or_else(String::new, number);
        for (point, row) in self.done() {
            let end = (0..self.columns.len()).map(|k| known(row.end.get(k).copied()));
            let record = (point.iter().map(|&value| number(value)))
                .chain([word(row).to_owned(), row.code.clone().unwrap_or_default()])
                .chain(end)
                .chain(has_objective.then(|| known(row.objective)))
                .chain([row.events.to_string(), known(row.error_estimate)])
                .chain(has_expectations.then(|| missed(row)));
            let _ = text.write_record(record);
        }
        let bytes = text.into_inner().unwrap_or_default();
        String::from_utf8(bytes).unwrap_or_default()
    }

    /// One object per line.
    pub fn json(&self) -> String {
        let mut text = String::new();
        for (point, row) in self.done() {
            let named = |names: &mut dyn Iterator<Item = &str>, values: &[f64]| {
                let pairs = names.zip(values);
                let pairs = pairs.map(|(name, &value)| (name.to_owned(), json!(value)));
                Value::Object(pairs.collect::<Map<String, Value>>())
            };
            let ends = &mut self.columns.iter().map(String::as_str);
            let line = json!({
                "parameters": named(&mut self.names(), &point),
                "status": word(row),
                "code": row.code,
                "end": named(ends, &row.end),
                "objective": row.objective,
                "events": row.events,
                "error_estimate": row.error_estimate,
                "missed": row.missed,
            });
            text.push_str(&line.to_string());
            text.push('\n');
        }
        text
    }

    /// End values, and objectives where there are any, over one axis or two.
    #[cfg(feature = "plots")]
    pub fn figure(&self) -> String {
        let drawn = self.grid.drawn();
        let of = |value: &dyn Fn(&Row) -> Option<f64>| -> Vec<f64> {
            let rows = self.rows.iter().map(|row| row.as_ref().and_then(value));
            rows.map(|value| value.unwrap_or(f64::NAN)).collect()
        };
        let columns = self.columns.iter().zip(self.at_end());
        let names = columns.map(|(name, text)| self.units.beside(&text, name));
        let names: Vec<String> = names.collect();
        let axes = drawn.iter().map(|axis| self.units.title(&axis.name));
        let axes: Vec<String> = axes.collect();
        let ends = names.iter().enumerate();
        let ends = ends.map(|(k, name)| (name.as_str(), of(&|row| row.end.get(k).copied())));
        let objective = (self.has_objective()).then(|| ("objective", of(&|row| row.objective)));
        let figure = Sweep {
            axes: (axes.iter().zip(drawn))
                .map(|(name, axis)| (name.as_str(), &axis.values[..]))
                .collect(),
            panels: objective
                .into_iter()
                .chain(ends)
                .take(MOST_PANELS)
                .collect(),
        };
        figure.write()
    }

    /// What became of the runs, and the first of them.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let shown: Vec<Vec<String>> = std::iter::once(self.header())
            .chain(
                self.done()
                    .take(SHOWN)
                    .map(|(point, row)| self.line(&point, row)),
            )
            .collect();
        let width = |column: usize| shown.iter().map(|line| line[column].chars().count()).max();
        let widths: Vec<usize> = (0..shown[0].len()).filter_map(width).collect();
        for line in &shown {
            let cells = line.iter().zip(&widths);
            let cells: Vec<String> = cells
                .map(|(cell, &width)| format!("{cell:<width$}"))
                .collect();
            text.push_str(&format!("  {}\n", cells.join("  ").trim_end()));
        }
        let done = self.done().count();
        if done > SHOWN {
            text.push_str(&format!(
                "  .. {} more: `--csv` and `--json` have all\n",
                done - SHOWN
            ));
        }
        let solved = self
            .done()
            .filter(|(_, row)| row.status == Some(Status::Solved));
        let solved = solved.count();
        text.push_str(&format!(
            "\n  {done} of {} runs, {solved} solved\n",
            self.rows.len()
        ));
        text
    }

    fn header(&self) -> Vec<String> {
        let objective = self.has_objective().then(|| "objective".to_owned());
        (self.names().map(str::to_owned))
            .chain(["status".to_owned()])
            .chain(self.at_end())
            .chain(objective)
            .chain(["events".to_owned()])
            .chain(self.has_expectations.then(|| "missed".to_owned()))
            .chain(["code".to_owned()])
            .collect()
    }

    fn line(&self, point: &[f64], row: &Row) -> Vec<String> {
        let known = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), short);
        let end = (0..self.columns.len()).map(|k| known(row.end.get(k).copied()));
        let objective = self.has_objective().then(|| known(row.objective));
        (point.iter().map(|&value| short(value)))
            .chain([word(row).to_owned()])
            .chain(end)
            .chain(objective)
            .chain([row.events.to_string()])
            .chain(self.has_expectations.then(|| missed(row)))
            .chain([row.code.clone().unwrap_or_default()])
            .collect()
    }
}

/// How a run ended.
pub(crate) fn word(row: &Row) -> &'static str {
    row.status.map_or("not_compiled", Status::as_str)
}

/// How many expectations a run misses, in words.
fn missed(row: &Row) -> String {
    row.missed
        .map_or_else(String::new, |missed| missed.to_string())
}

/// Six digits, the fewest that say them.
fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    match rounded.abs() {
        0.0 => "0".to_owned(),
        size if (1e-4..1e6).contains(&size) => format!("{rounded}"),
        _ => format!("{rounded:e}"),
    }
}
