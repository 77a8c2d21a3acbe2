//! The first ten lines.

use std::ops::Range;

use super::scan::Scanner;
use super::{Error, Fault, Place};

/// What the header says, as far as it is needed.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Options that go into the solution file as they are.
    pub options: Vec<i64>,
    /// The tolerance behind the options, if there is one.
    pub tolerance: Option<f64>,
    /// Variables.
    pub n_variables: usize,
    /// Rows.
    pub n_rows: usize,
    /// Objectives.
    pub n_objectives: usize,
    /// Variables that are binary, and those that are integer: binary where their bounds say so, which holds for all that
    /// nonlinear functions have.
    pub discrete: Discrete,
    /// Defined variables.
    pub n_defined: usize,
}

/// Where variables with whole values are.
#[derive(Clone, Debug, PartialEq)]
pub struct Discrete {
    /// Declared as binary.
    pub binary: Range<usize>,
    /// Declared as integer.
    pub integer: Vec<Range<usize>>,
    /// The line that says how many there are.
    pub(crate) place: Place,
}

impl Discrete {
    /// Variables have an order: those that are nonlinear in rows and objective, in rows alone, in the objective alone, each
    /// with its integer ones last, then linear ones, then binary ones, then integer ones (Gay 2005, *Writing .nl Files*,
    /// table 3).
    fn of(
        scanner: &Scanner,
        n: usize,
        [in_rows, in_objective, in_both]: [i64; 3],
        counts: [i64; 5],
    ) -> Result<Self, Error> {
        let [binary, integer, both, rows, objective] = counts;
        let ends = [
            (n as i64 - integer.max(0), binary, "binary variable"),
            (n as i64, integer, "integer variable"),
            (in_both, both, "integer variable"),
            (in_rows, rows, "integer variable"),
            (in_objective, objective, "integer variable"),
        ];
        let mut ranges = Vec::new();
        for (end, number, what) in ends {
            if number == 0 {
                ranges.push(0..0);
                continue;
            }
            if number < 0 || number > end || end > n as i64 {
                return scanner.error(Fault::Range {
                    what,
                    number,
                    count: n,
                });
            }
            ranges.push((end - number) as usize..end as usize);
        }
        let binary = ranges.remove(0);
        ranges.retain(|range| !range.is_empty());
        Ok(Discrete {
            binary,
            integer: ranges,
            place: scanner.place(),
        })
    }
}

/// Numbers of one line; missing ones are 0, except for the first few.
fn line<const N: usize>(
    scanner: &mut Scanner,
    expected: &'static str,
    required: usize,
) -> Result<[i64; N], Error> {
    let Some(line) = scanner.next_line() else {
        return scanner.error(Fault::End(expected));
    };
    let mut numbers = [0; N];
    let mut words = line
        .split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty());
    for (i, number) in numbers.iter_mut().enumerate() {
        let word = words.next();
        let text = word.and_then(|word| std::str::from_utf8(word).ok());
        match text.map(str::parse) {
            Some(Ok(value)) => *number = value,
            None if word.is_none() && i >= required => break,
            _ => {
                let found = String::from_utf8_lossy(line).chars().take(40).collect();
                return scanner.error(Fault::Unexpected { expected, found });
            }
        }
    }
    Ok(numbers)
}

/// A count that cannot be more than the file has bytes.
fn count(scanner: &Scanner, what: &'static str, number: i64) -> Result<usize, Error> {
    let length = scanner.length();
    match usize::try_from(number) {
        Ok(number) if number <= length => Ok(number),
        Ok(number) => scanner.error(Fault::Size {
            what,
            number,
            length,
        }),
        Err(_) => scanner.error(Fault::Unexpected {
            expected: "a count",
            found: number.to_string(),
        }),
    }
}

/// Reads the header; the scanner goes on behind it in the form of the file.
pub(crate) fn read(scanner: &mut Scanner) -> Result<Header, Error> {
    let first = scanner.next_line().unwrap_or_default();
    let binary = match first.first() {
        Some(b'g' | b'G') => false,
        Some(b'b' | b'B') => true,
        _ => return scanner.error(Fault::NotNl),
    };
    let (options, tolerance) = options(scanner, &first[1..])?;
    let sizes = "variables, constraints, objectives, ranges, equations";
    let [n, m, n_objectives, _, _, n_logical] = line(scanner, sizes, 3)?;
    let n_variables = count(scanner, "variables", n)?;
    let n_rows = count(scanner, "constraints", m)?;
    let n_objectives = count(scanner, "objectives", n_objectives)?;
    if n_logical != 0 {
        return scanner.error(Fault::Logical(n_logical.unsigned_abs() as usize));
    }
    line::<2>(
        scanner,
        "the numbers of nonlinear constraints and objectives",
        2,
    )?;
    line::<2>(scanner, "the numbers of network constraints", 2)?;
    let nonlinear = line(scanner, "the numbers of nonlinear variables", 2)?;
    let [_, n_functions, arithmetic, _] = line(scanner, "network variables and functions", 2)?;
    if n_functions != 0 {
        return scanner.error(Fault::Functions(n_functions.unsigned_abs() as usize));
    }
    /// The kind of arithmetic of a little-endian processor with IEEE numbers; 0 says nothing.
    const LITTLE_ENDIAN: i64 = 1;
    if binary && !matches!(arithmetic, 0 | LITTLE_ENDIAN) {
        return scanner.error(Fault::ByteOrder);
    }
    let counts = line(scanner, "the numbers of discrete variables", 5)?;
    let discrete = Discrete::of(scanner, n_variables, nonlinear, counts)?;
    line::<2>(scanner, "the numbers of nonzeros", 2)?;
    line::<2>(scanner, "the lengths of names", 2)?;
    let defined = line::<5>(scanner, "the numbers of defined variables", 5)?;
    let n_defined: i64 = defined.iter().copied().fold(0, i64::saturating_add);
    let n_defined = count(scanner, "defined variables", n_defined)?;
    if binary {
        scanner.set_binary();
    }
    Ok(Header {
        options,
        tolerance,
        n_variables,
        n_rows,
        n_objectives,
        discrete,
        n_defined,
    })
}

/// `3 1 1 0`: how many options, then these, and a number if the second one is 3.
fn options(scanner: &Scanner, text: &[u8]) -> Result<(Vec<i64>, Option<f64>), Error> {
    /// The format has no more.
    const MOST: usize = 9;
    /// The value of the second option that announces a tolerance.
    const WITH_TOLERANCE: i64 = 3;
    let text = String::from_utf8_lossy(text);
    let mut words = text.split_whitespace();
    let n: usize = words.next().and_then(|word| word.parse().ok()).unwrap_or(0);
    if n > MOST {
        return scanner.error(Fault::Range {
            what: "option",
            number: n as i64,
            count: MOST,
        });
    }
    let options: Vec<i64> = words
        .by_ref()
        .take(n)
        .map_while(|word| word.parse().ok())
        .collect();
    let announced = options.get(1) == Some(&WITH_TOLERANCE);
    let tolerance = words.next().and_then(|word| word.parse().ok());
    Ok((options, tolerance.filter(|_| announced)))
}
