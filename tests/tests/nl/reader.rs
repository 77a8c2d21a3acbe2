//! Reads AMPL's text format, as far as the compiler writes it, and evaluates it at a point.

use std::str::Lines;

/// A file and its values at a point.
#[derive(Default)]
pub struct File {
    /// The numbers of the ten lines of the header.
    pub header: Vec<Vec<usize>>,
    /// Bodies of the rows.
    pub rows: Vec<f64>,
    /// Whether the nonlinear part of a row is a number.
    pub is_constant: Vec<bool>,
    pub objective: f64,
    /// Linear terms of the rows: column and coefficient.
    pub linear: Vec<Vec<(usize, f64)>>,
    /// Linear terms of the objective.
    pub gradient: Vec<(usize, f64)>,
    /// Columns that are in an expression.
    pub used: Vec<bool>,
    pub n_defined: usize,
    pub guesses: Vec<f64>,
    /// Words of the lines of the `r` and `b` segments.
    ranges: Vec<Vec<String>>,
    pub bounds: Vec<Vec<String>>,
    /// The `k` segment.
    pub cumulative: Vec<usize>,
}

impl File {
    /// What the body of a row is equal to.
    pub fn right_hand_side(&self, row: usize) -> f64 {
        match self.ranges[row][0].as_str() {
            "4" => number(&self.ranges[row][1]),
            "5" => 0.0,
            other => panic!("{other} is neither an equation nor a pair"),
        }
    }

    /// The column that a row complements, which has a lower bound.
    pub fn complement(&self, row: usize) -> Option<usize> {
        let words = &self.ranges[row];
        (words[0] == "5").then(|| {
            assert_eq!(words[1], "1");
            words[2].parse::<usize>().unwrap() - 1
        })
    }
}

fn number(word: &str) -> f64 {
    word.parse()
        .unwrap_or_else(|_| panic!("`{word}` is no number"))
}

/// The values of the columns, and which of them were asked for.
struct Point<'p> {
    columns: &'p [f64],
    defined: Vec<f64>,
    used: Vec<bool>,
}

/// Reads a file and evaluates it where the columns have these values.
pub fn read(text: &str, columns: &[f64]) -> File {
    let mut lines = text.lines();
    let mut file = File::default();
    for line in lines.by_ref().take(10) {
        let words = line.split('#').next().unwrap_or("").split_whitespace();
        file.header
            .push(words.filter_map(|word| word.parse().ok()).collect());
    }
    let (n, m) = (file.header[1][0], file.header[1][1]);
    assert_eq!(n, columns.len());
    file.rows = vec![0.0; m];
    file.is_constant = vec![false; m];
    file.linear = vec![Vec::new(); m];
    let mut point = Point {
        columns,
        defined: Vec::new(),
        used: vec![false; n],
    };
    while let Some(line) = lines.next() {
        let mut words = line[1..]
            .split_whitespace()
            .map(|word| word.parse().unwrap_or(0));
        let mut count = || words.next().unwrap_or(0);
        match &line[..1] {
            "V" => {
                assert_eq!(count(), n + point.defined.len());
                let value = point.expression(&mut lines);
                point.defined.push(value);
            }
            "C" => {
                let row = count();
                file.is_constant[row] = lines
                    .clone()
                    .next()
                    .is_some_and(|line| line.starts_with('n'));
                file.rows[row] = point.expression(&mut lines);
            }
            "O" => file.objective = point.expression(&mut lines),
            "x" => {
                for (column, line) in lines.by_ref().take(count()).enumerate() {
                    let (place, guess) = line.split_once(' ').unwrap();
                    assert_eq!(place.parse(), Ok(column));
                    file.guesses.push(number(guess));
                }
            }
            "r" => file.ranges = words_of(&mut lines, m),
            "b" => file.bounds = words_of(&mut lines, n),
            "k" => {
                let counts = lines.by_ref().take(count());
                file.cumulative = counts.map(|line| line.parse().unwrap()).collect();
            }
            "J" => {
                let row = count();
                file.linear[row] = entries(&mut lines, count());
            }
            "G" => {
                assert_eq!(count(), 0);
                file.gradient = entries(&mut lines, count());
            }
            other => panic!("a segment `{other}`"),
        }
    }
    let value = |terms: &[(usize, f64)]| -> f64 {
        terms.iter().map(|&(column, c)| c * columns[column]).sum()
    };
    for (row, terms) in file.rows.iter_mut().zip(&file.linear) {
        *row += value(terms);
    }
    file.objective += value(&file.gradient);
    file.n_defined = point.defined.len();
    file.used = point.used;
    file
}

fn words_of(lines: &mut Lines<'_>, n: usize) -> Vec<Vec<String>> {
    let words = |line: &str| line.split_whitespace().map(str::to_owned).collect();
    lines.take(n).map(words).collect()
}

fn entries(lines: &mut Lines<'_>, n: usize) -> Vec<(usize, f64)> {
    let entry = |line: &str| {
        let (column, coefficient) = line.split_once(' ').unwrap();
        (column.parse().unwrap(), number(coefficient))
    };
    lines.take(n).map(entry).collect()
}

impl Point<'_> {
    fn expression(&mut self, lines: &mut Lines<'_>) -> f64 {
        let line = lines.next().expect("an expression has its operands");
        let (kind, rest) = line.split_at(1);
        match kind {
            "n" => number(rest),
            "v" => {
                let place: usize = rest.parse().unwrap();
                let n = self.columns.len();
                if place < n {
                    self.used[place] = true;
                    return self.columns[place];
                }
                self.defined[place - n]
            }
            "o" => self.operation(rest.parse().unwrap(), lines),
            other => panic!("an operand `{other}`"),
        }
    }

    fn operation(&mut self, code: u32, lines: &mut Lines<'_>) -> f64 {
        if code == 54 {
            let n: usize = lines.next().unwrap().parse().unwrap();
            return (0..n).map(|_| self.expression(lines)).sum();
        }
        let a = self.expression(lines);
        if [0, 1, 2, 3, 5, 48].contains(&code) {
            let b = self.expression(lines);
            return match code {
                0 => a + b,
                1 => a - b,
                2 => a * b,
                3 => a / b,
                5 => a.powf(b),
                _ => a.atan2(b),
            };
        }
        match code {
            16 => -a,
            37 => a.tanh(),
            38 => a.tan(),
            39 => a.sqrt(),
            40 => a.sinh(),
            41 => a.sin(),
            43 => a.ln(),
            44 => a.exp(),
            45 => a.cosh(),
            46 => a.cos(),
            49 => a.atan(),
            51 => a.asin(),
            53 => a.acos(),
            other => panic!("an operator {other}"),
        }
    }
}
