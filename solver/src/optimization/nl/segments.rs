//! The segments behind the header.

use super::expression::{Id, Nodes};
use super::header::{self, Header};
use super::scan::Scanner;
use super::{Error, Fault, Place};

/// Coefficients of variables.
pub(crate) type Linear = Vec<(u32, f64)>;

/// The contents of a file.
#[derive(Clone, Debug)]
pub(crate) struct Contents {
    pub header: Header,
    pub nodes: Nodes,
    pub rows: Vec<Function>,
    pub objectives: Vec<(Sense, Function)>,
    pub defined: Vec<Function>,
    pub row_bounds: Vec<RowBound>,
    pub variable_bounds: Vec<(f64, f64)>,
    pub start: Vec<f64>,
    /// The end of the file, for what is wrong with all of it.
    pub end: Place,
}

impl Contents {
    /// What is wrong with all of it.
    pub fn wrong(&self, fault: Fault) -> Error {
        let place = self.end;
        Error { place, fault }
    }
}

/// A nonlinear expression plus linear terms.
#[derive(Clone, Debug, Default)]
pub(crate) struct Function {
    pub nonlinear: Option<Id>,
    pub linear: Linear,
    pub place: Option<Place>,
}

/// What is asked of an objective.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// Less is better.
    Minimize,
    /// More is better.
    Maximize,
}

/// What is asked of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum RowBound {
    Between(f64, f64),
    /// The row complements a variable at its lower bound, its upper bound, both or none.
    Complements {
        variable: u32,
        lower: bool,
        upper: bool,
    },
}

/// Reads a file.
pub(crate) fn read(bytes: &[u8]) -> Result<Contents, Error> {
    let mut scanner = Scanner::new(bytes);
    let header = header::read(&mut scanner)?;
    let mut reader = Reader {
        known: vec![false; header.n_defined],
        has_row_bounds: false,
        has_variable_bounds: false,
        contents: Contents {
            nodes: Nodes::default(),
            rows: vec![Function::default(); header.n_rows],
            objectives: vec![(Sense::Minimize, Function::default()); header.n_objectives],
            defined: vec![Function::default(); header.n_defined],
            row_bounds: Vec::with_capacity(header.n_rows),
            variable_bounds: Vec::with_capacity(header.n_variables),
            start: vec![0.0; header.n_variables],
            end: scanner.place(),
            header,
        },
        scanner,
    };
    while let Some(letter) = reader.scanner.letter() {
        reader.segment(letter)?;
    }
    reader.contents.end = reader.scanner.place();
    if !reader.has_row_bounds && !reader.contents.rows.is_empty() {
        return reader.scanner.error(Fault::Missing("bounds of rows (`r`)"));
    }
    if !reader.has_variable_bounds && !reader.contents.start.is_empty() {
        return reader
            .scanner
            .error(Fault::Missing("bounds of variables (`b`)"));
    }
    Ok(reader.contents)
}

struct Reader<'f> {
    scanner: Scanner<'f>,
    contents: Contents,
    /// The defined variables that have been read.
    known: Vec<bool>,
    has_row_bounds: bool,
    has_variable_bounds: bool,
}

type Done = Result<(), Error>;

impl Reader<'_> {
    fn segment(&mut self, letter: u8) -> Done {
        let header = &self.contents.header;
        let (n, m) = (header.n_variables, header.n_rows);
        match letter {
            b'C' => self.row()?,
            b'O' => self.objective()?,
            b'V' => self.definition()?,
            b'J' => {
                let row = self.scanner.index("row", m)?;
                let terms = self.linear()?;
                let function = &mut self.contents.rows[row];
                function.linear.extend(terms);
            }
            b'G' => {
                let objective = self
                    .scanner
                    .index("objective", self.contents.objectives.len())?;
                let terms = self.linear()?;
                self.contents.objectives[objective].1.linear.extend(terms);
            }
            b'b' => self.variable_bounds()?,
            b'r' => self.row_bounds()?,
            b'x' => {
                for _ in 0..self.count("initial values", n)? {
                    self.scanner.row("an initial value")?;
                    let variable = self.scanner.index("variable", n)?;
                    self.contents.start[variable] = self.scanner.number("an initial value")?;
                }
            }
            b'd' => {
                for _ in 0..self.count("initial multipliers", m)? {
                    self.scanner.row("an initial multiplier")?;
                    self.scanner.index("row", m)?;
                    self.scanner.number("an initial multiplier")?;
                }
            }
            // Counts of the Jacobian's columns, which its rows say already.
            b'k' | b'K' => {
                for _ in 0..self.count("columns", n)? {
                    self.scanner.row("the length of a column")?;
                    self.scanner.integer("the length of a column")?;
                }
            }
            b'S' => self.suffix()?,
            b'L' => return self.scanner.error(Fault::Logical(1)),
            b'F' => return self.scanner.error(Fault::Functions(1)),
            letter => {
                return self.scanner.error(Fault::Unexpected {
                    expected: "the letter of a segment",
                    found: char::from(letter).escape_default().to_string(),
                });
            }
        }
        Ok(())
    }

    /// `C0`: the nonlinear expression of a row.
    fn row(&mut self) -> Done {
        let row = (self.scanner).index("row", self.contents.header.n_rows)?;
        let place = Some(self.scanner.place());
        let expression = self.expression("row", row)?;
        let function = &mut self.contents.rows[row];
        let nonlinear = &mut function.nonlinear;
        once(&self.scanner, nonlinear, expression, "row", row)?;
        function.place = place;
        Ok(())
    }

    /// `O0 1`: number, sense, and the nonlinear expression.
    fn objective(&mut self) -> Done {
        let what = "objective";
        let objective = self.scanner.index(what, self.contents.objectives.len())?;
        let sense = match self.scanner.integer("the sense of an objective")? {
            0 => Sense::Minimize,
            _ => Sense::Maximize,
        };
        let expression = self.expression(what, objective)?;
        let place = Some(self.scanner.place());
        let (known, function) = &mut self.contents.objectives[objective];
        let nonlinear = &mut function.nonlinear;
        once(&self.scanner, nonlinear, expression, what, objective)?;
        (*known, function.place) = (sense, place);
        Ok(())
    }

    fn expression(&mut self, what: &str, number: usize) -> Result<Id, Error> {
        let n = self.contents.header.n_variables;
        let user = || format!("{what} {number}");
        (self.contents.nodes).read(&mut self.scanner, n, &self.known, user)
    }

    /// How many lines follow.
    fn count(&mut self, what: &'static str, most: usize) -> Result<usize, Error> {
        self.scanner.index(what, most + 1)
    }

    /// Terms of the segments J and G.
    fn linear(&mut self) -> Result<Linear, Error> {
        let n = self.contents.header.n_variables;
        let count = self.count("linear terms", n)?;
        self.terms(count)
    }

    fn terms(&mut self, count: usize) -> Result<Linear, Error> {
        let n = self.contents.header.n_variables;
        let mut terms = Vec::new();
        for _ in 0..count {
            self.scanner.row("a linear term")?;
            let variable = self.scanner.index("variable", n)?;
            let coefficient = self.scanner.number("a coefficient")?;
            terms.push((variable as u32, coefficient));
        }
        Ok(terms)
    }

    /// `V7 2 0`: number, linear terms, and who uses it.
    fn definition(&mut self) -> Done {
        let n = self.contents.header.n_variables;
        let all = n + self.known.len();
        let index = self.scanner.index("defined variable", all)?;
        let Some(number) = index.checked_sub(n) else {
            return self.scanner.error(Fault::Unexpected {
                expected: "the number of a defined variable",
                found: index.to_string(),
            });
        };
        let n_linear = self.count("linear terms", n)?;
        self.scanner.integer("what uses a defined variable")?;
        let linear = self.terms(n_linear)?;
        let expression = self.expression("defined variable", index)?;
        let place = Some(self.scanner.place());
        if self.known[number] {
            let what = format!("definition of variable {index}");
            return self.scanner.error(Fault::Twice(what));
        }
        self.known[number] = true;
        self.contents.defined[number] = Function {
            nonlinear: Some(expression),
            linear,
            place,
        };
        Ok(())
    }

    /// Two numbers for a digit 0 to 4.
    fn bounds(&mut self, kind: i64) -> Result<(f64, f64), Error> {
        /// What is as large has always been written for infinity.
        const INFINITE: f64 = 1e20;
        let infinity = f64::INFINITY;
        let expected = "a bound";
        let (lower, upper) = match kind {
            0 => (
                self.scanner.number(expected)?,
                self.scanner.number(expected)?,
            ),
            1 => (-infinity, self.scanner.number(expected)?),
            2 => (self.scanner.number(expected)?, infinity),
            3 => (-infinity, infinity),
            4 => {
                let both = self.scanner.number(expected)?;
                (both, both)
            }
            kind => {
                return self.scanner.error(Fault::Unexpected {
                    expected: "the kind of a bound",
                    found: kind.to_string(),
                });
            }
        };
        let lower = if lower <= -INFINITE { -infinity } else { lower };
        let upper = if upper >= INFINITE { infinity } else { upper };
        Ok((lower, upper))
    }

    fn nonempty(&self, what: &'static str, number: usize, (lower, upper): (f64, f64)) -> Done {
        if lower > upper || lower == f64::INFINITY || upper == f64::NEG_INFINITY {
            return self.scanner.error(Fault::Empty {
                what,
                number,
                lower,
                upper,
            });
        }
        Ok(())
    }

    fn variable_bounds(&mut self) -> Done {
        if std::mem::replace(&mut self.has_variable_bounds, true) {
            let what = "segment of bounds of variables (`b`)".to_owned();
            return self.scanner.error(Fault::Twice(what));
        }
        for variable in 0..self.contents.header.n_variables {
            self.scanner.row("the bounds of a variable")?;
            let kind = self.scanner.digit("the kind of a bound")?;
            let bounds = self.bounds(kind)?;
            self.nonempty("variable", variable, bounds)?;
            self.contents.variable_bounds.push(bounds);
        }
        Ok(())
    }

    fn row_bounds(&mut self) -> Done {
        if std::mem::replace(&mut self.has_row_bounds, true) {
            let what = "segment of bounds of rows (`r`)".to_owned();
            return self.scanner.error(Fault::Twice(what));
        }
        let n = self.contents.header.n_variables;
        for row in 0..self.contents.header.n_rows {
            self.scanner.row("the bounds of a row")?;
            let kind = self.scanner.digit("the kind of a bound")?;
            let bound = if kind == 5 {
                let sides = self.scanner.index("kind of complementarity", 4)?;
                let variable = self
                    .scanner
                    .integer("the variable that a row complements")?;
                let variable = self
                    .scanner
                    .within("variable", variable.saturating_sub(1), n)?;
                RowBound::Complements {
                    variable: variable as u32,
                    lower: sides & 1 != 0,
                    upper: sides & 2 != 0,
                }
            } else {
                let bounds = self.bounds(kind)?;
                self.nonempty("row", row, bounds)?;
                RowBound::Between(bounds.0, bounds.1)
            };
            self.contents.row_bounds.push(bound);
        }
        Ok(())
    }

    /// `S0 6 sstatus`: what it belongs to, how many values, its name.
    fn suffix(&mut self) -> Done {
        /// The bit of real numbers.
        const REAL: usize = 4;
        let kind = self.scanner.index("kind of suffix", 16)?;
        let header = &self.contents.header;
        let owners = [header.n_variables, header.n_rows, header.n_objectives, 1];
        let owners = owners[kind & 3];
        let n_values = self.count("values of a suffix", owners)?;
        let name = self.scanner.name("the name of a suffix")?;
        // They make the problem another one; all others are hints.
        if matches!(name.as_str(), "sos" | "sosno" | "ref") {
            return self.scanner.error(Fault::OrderedSets(name));
        }
        for _ in 0..n_values {
            self.scanner.row("the value of a suffix")?;
            self.scanner.index("owner of a suffix", owners)?;
            match kind & REAL {
                0 => _ = self.scanner.integer("the value of a suffix")?,
                _ => _ = self.scanner.number("the value of a suffix")?,
            }
        }
        Ok(())
    }
}

/// Sets what has not been set yet.
fn once(scanner: &Scanner, place: &mut Option<Id>, value: Id, what: &str, number: usize) -> Done {
    match place.replace(value) {
        None => Ok(()),
        Some(_) => scanner.error(Fault::Twice(format!("{what} {number}"))),
    }
}
