//! Tables in Markdown.

use nsdc::report::forms::text::{duration, significant};
use serde_json::Value;

/// A row: names of columns and values.
pub type Row = Vec<(String, Value)>;

/// A number of a row.
pub fn number(row: &Row, column: &str) -> Option<f64> {
    let value = row.iter().find(|(name, _)| name == column);
    value.and_then(|(_, value)| value.as_f64())
}

/// A word of a row.
pub fn word<'r>(row: &'r Row, column: &str) -> &'r str {
    let value = row.iter().find(|(name, _)| name == column);
    value
        .and_then(|(_, value)| value.as_str())
        .unwrap_or_default()
}

/// A table of rows that have the same columns.
pub fn table(rows: &[Row]) -> String {
    let Some(first) = rows.first() else {
        return String::new();
    };
    let names: Vec<&str> = first.iter().map(|(name, _)| name.as_str()).collect();
    let mut text = format!(
        "| {} |\n|{}\n",
        names.join(" | "),
        " --- |".repeat(names.len())
    );
    for row in rows {
        let cells: Vec<String> = row.iter().map(|(name, value)| cell(name, value)).collect();
        text.push_str(&format!("| {} |\n", cells.join(" | ")));
    }
    text
}

/// Seconds in the unit that reads best, whole numbers as they are, others by their first digits.
fn cell(name: &str, value: &Value) -> String {
    match value {
        Value::String(word) => word.clone(),
        Value::Number(number) => {
            let number = number.as_f64().unwrap_or(f64::NAN);
            match name {
                _ if name.starts_with("seconds") => duration(number),
                "objective" => significant(number, 8),
                _ if number.fract() == 0.0 && number.abs() < 1e9 => format!("{number}"),
                _ if number.abs() < 1e-3 => format!("{number:.1e}"),
                _ => significant(number, 3),
            }
        }
        _ => "-".to_owned(),
    }
}
