//! Comma-separated text -> rows of time and a column.
//!
//! The first line names the columns, the first column is time. Other columns may hold anything.

use csv::{ReaderBuilder, StringRecord, Trim};

use super::{Fit, Table};

/// Rows that are taken.
const MAX_ROWS: usize = 4_000_000;

/// What is wrong with a file of data.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// It holds more rows than are taken.
    Large {
        /// How many are taken.
        limit: usize,
    },
    /// It is no text in UTF-8.
    NotText,
    /// It has no line, or only one that names columns.
    Empty,
    /// Columns are separated by something else than commas.
    Separator {
        /// By what, in words.
        found: &'static str,
    },
    /// The first line holds numbers.
    NoHeader,
    /// There is no such column.
    NoColumn {
        /// Those that there are.
        known: Vec<String>,
    },
    /// Two columns have the name.
    TwoColumns {
        /// Their places, from 1.
        places: [usize; 2],
    },
    /// A line with more or less cells than there are columns.
    Ragged {
        /// Its number in the file.
        line: u64,
        /// How many cells it has.
        found: usize,
        /// How many columns there are.
        expected: usize,
    },
    /// A cell that holds no finite number.
    Cell {
        /// The line in the file.
        line: u64,
        /// The name of the column.
        column: String,
        /// What stands there.
        text: String,
    },
    /// A time that is not after the one before.
    Order {
        /// The line in the file.
        line: u64,
        /// The time there.
        time: f64,
        /// The time before.
        before: f64,
    },
    /// Fewer rows than the fit takes.
    Few {
        /// How many there are.
        found: usize,
        /// How many it takes.
        needed: usize,
    },
    /// Rows too close together, or values too large, for a function through them.
    Steep,
}

/// Reads a column as a function of time.
pub(crate) fn table(bytes: &[u8], column: &str, fit: Fit) -> Result<Table, Fault> {
    let (times, values) = rows(bytes, column, Rows::OfFunction)?;
    if times.len() < fit.n_rows() {
        return Err(Fault::Few {
            found: times.len(),
            needed: fit.n_rows(),
        });
    }
    let table = Table::new(fit, &times, &values);
    match table.pieces.is_finite() {
        true => Ok(table),
        false => Err(Fault::Steep),
    }
}

/// What rows are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rows {
    /// Those of a function: one for each instant, each with a value.
    OfFunction,
    /// Measurements: several may be of one instant, and some cells are empty or `nan`.
    OfMeasurements,
}

/// Times and the values of a column; a value that is missing is not a number.
pub(crate) fn rows(bytes: &[u8], column: &str, kind: Rows) -> Result<(Vec<f64>, Vec<f64>), Fault> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut reader = ReaderBuilder::new()
        .flexible(true)
        .trim(Trim::All)
        .from_reader(bytes);
    let names = match reader.headers() {
        Ok(names) => names.clone(),
        Err(_) => return Err(Fault::NotText),
    };
    let place = place(&names, column)?;
    let is_measured = kind == Rows::OfMeasurements;

    let (mut times, mut values) = (Vec::new(), Vec::new());
    let mut record = StringRecord::new();
    loop {
        match reader.read_record(&mut record) {
            Ok(true) => {}
            Ok(false) => break,
            Err(_) => return Err(Fault::NotText),
        }
        let start = record.position().map_or(0, csv::Position::byte) as usize;
        let line = || line_at(bytes, start);
        if record.len() != names.len() {
            return Err(Fault::Ragged {
                line: line(),
                found: record.len(),
                expected: names.len(),
            });
        }
        let number = |at: usize| {
            let text = &record[at];
            let number = text.parse().ok().filter(|number: &f64| number.is_finite());
            number.ok_or_else(|| Fault::Cell {
                line: line(),
                column: names[at].to_owned(),
                text: text.to_owned(),
            })
        };
        let is_missing = |text: &str| text.is_empty() || text.eq_ignore_ascii_case("nan");
        let value = match is_measured && is_missing(&record[place]) {
            true => f64::NAN,
            false => number(place)?,
        };
        let time = number(0)?;
        let follows = |before: f64| before < time || is_measured && before == time;
        if let Some(&before) = times.last().filter(|before| !follows(**before)) {
            let line = line();
            return Err(Fault::Order { line, time, before });
        }
        if times.len() == MAX_ROWS {
            return Err(Fault::Large { limit: MAX_ROWS });
        }
        times.push(time);
        values.push(value);
    }
    match times.is_empty() {
        true => Err(Fault::Empty),
        false => Ok((times, values)),
    }
}

/// The number of the line that a record is in, which begins at `start` or after empty lines there.
fn line_at(bytes: &[u8], start: usize) -> u64 {
    let is_end = |byte: &u8| matches!(byte, b'\n' | b'\r');
    let empty = bytes[start..]
        .iter()
        .take_while(|byte| is_end(byte))
        .count();
    let before = &bytes[..start + empty];
    let ends = (0..before.len()).filter(|&at| {
        before[at] == b'\n' || before[at] == b'\r' && bytes.get(at + 1) != Some(&b'\n')
    });
    1 + ends.count() as u64
}

/// The place of a column in the first line.
fn place(names: &StringRecord, column: &str) -> Result<usize, Fault> {
    if names.iter().all(str::is_empty) {
        return Err(Fault::Empty);
    }
    let mut found = (0..names.len()).filter(|&at| names[at] == *column.trim());
    match (found.next(), found.next()) {
        (Some(place), None) => return Ok(place),
        (Some(first), Some(second)) => {
            let places = [first + 1, second + 1];
            return Err(Fault::TwoColumns { places });
        }
        _ => {}
    }
    if let [only] = names.iter().collect::<Vec<_>>()[..] {
        let separators = [(';', "semicolons"), ('\t', "tabs"), ('|', "bars")];
        let used = separators.iter().find(|(mark, _)| only.contains(*mark));
        if let Some(&(_, found)) = used {
            return Err(Fault::Separator { found });
        }
        if only.split_whitespace().count() > 1 {
            return Err(Fault::Separator { found: "blanks" });
        }
    }
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        return Err(Fault::NoHeader);
    }
    let known = names.iter().map(str::to_owned).collect();
    Err(Fault::NoColumn { known })
}
