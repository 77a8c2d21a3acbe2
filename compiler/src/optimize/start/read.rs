//! Trajectories from the JSON of earlier runs.

use serde_json::Value;

use crate::optimize::Sampled;

impl Sampled {
    /// The last object of what `nsdc run --json` wrote; the error says what is wrong with it.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        let text = std::str::from_utf8(bytes).map_err(|_| "it is no UTF-8 text".to_owned())?;
        let objects = serde_json::Deserializer::from_str(text).into_iter::<Value>();
        let objects: Result<Vec<Value>, _> = objects.collect();
        let objects = objects.map_err(|error| format!("it is no JSON: {error}"))?;
        // Several are lines, or an array.
        let object = objects.last().and_then(|last| match last {
            Value::Array(objects) => objects.last(),
            object => Some(object),
        });
        let object = object.ok_or("it is empty")?;
        let time = numbers(&object["time"]).ok_or("it has no list `time`")?;
        if time.len() < 2 || !time.is_sorted() {
            return Err("its `time` does not go on".to_owned());
        }
        let mut values = Vec::new();
        for part in ["states", "controls"] {
            for (name, series) in object[part].as_object().into_iter().flatten() {
                let instants = series.as_array().filter(|list| list.len() == time.len());
                let instants = instants.ok_or_else(|| {
                    format!("`{name}` does not have one value for each of its instants")
                })?;
                let columns = columns(name, instants);
                values.extend(columns.ok_or_else(|| format!("`{name}` has values of no shape"))?);
            }
        }
        Ok(Sampled { time, values })
    }
}

fn numbers(list: &Value) -> Option<Vec<f64>> {
    list.as_array()?.iter().map(Value::as_f64).collect()
}

/// One column per entry: `x`, `x[1]` or `A[1,2]`.
fn columns(name: &str, instants: &[Value]) -> Option<Vec<(String, Vec<f64>)>> {
    let rows = |value: &Value| -> Option<Vec<(String, f64)>> {
        let number = |value: &Value| Some(value.as_f64().unwrap_or(f64::NAN));
        let Some(list) = value.as_array() else {
            return Some(vec![(name.to_owned(), number(value)?)]);
        };
        let mut entries = Vec::new();
        for (i, entry) in list.iter().enumerate() {
            match entry.as_array() {
                None => entries.push((format!("{name}[{}]", i + 1), number(entry)?)),
                Some(row) => {
                    for (j, entry) in row.iter().enumerate() {
                        entries.push((format!("{name}[{},{}]", i + 1, j + 1), number(entry)?));
                    }
                }
            }
        }
        Some(entries)
    };
    let first = rows(instants.first()?)?;
    let mut columns: Vec<(String, Vec<f64>)> = first
        .into_iter()
        .map(|(name, _)| (name, Vec::new()))
        .collect();
    for instant in instants {
        let entries = rows(instant)?;
        if entries.len() != columns.len() {
            return None;
        }
        for (column, (_, value)) in columns.iter_mut().zip(entries) {
            column.1.push(value);
        }
    }
    Some(columns)
}
