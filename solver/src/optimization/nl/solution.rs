//! AMPL's solution file (.sol), as text.

use std::fmt::Write;

use super::{Problem, Sense};

/// What a solver reports to AMPL: the ranges of `solve_result_num`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Code {
    /// A solution.
    Solved = 0,
    /// A point that may be one.
    Uncertain = 100,
    /// No point satisfies the constraints, as far as was seen.
    Infeasible = 200,
    /// The objective has no bound.
    Unbounded = 300,
    /// A limit of iterations.
    IterationLimit = 400,
    /// A limit of time.
    TimeLimit = 401,
    /// Anything else.
    Failure = 500,
    /// Canceled from outside.
    Interrupted = 600,
}

impl Problem {
    /// The text of the solution file for a point w of the program and multipliers y of its rows.
    ///
    /// AMPL's multipliers are the derivatives of the objective by the right-hand sides, in the sense of the file.
    pub fn solution_file(&self, message: &str, w: &[f64], y: &[f64], code: Code) -> String {
        let mut text = String::new();
        // Writing to a string does not fail.
        let mut line = |value: &dyn std::fmt::Display| _ = writeln!(text, "{value}");
        for part in message.lines() {
            // An empty line would end the message.
            line(&if part.is_empty() { " " } else { part });
        }
        line(&"");
        let n = self.sizes.variables;
        let header = &self.header;
        line(&"Options");
        // Two more where the tolerance follows.
        let announced = header.options.len() + if header.tolerance.is_some() { 2 } else { 0 };
        line(&announced);
        header.options.iter().for_each(|option| line(option));
        for count in [self.sizes.rows; 2].into_iter().chain([n; 2]) {
            line(&count);
        }
        if let Some(tolerance) = header.tolerance {
            line(&tolerance);
        }
        for row in &self.rows {
            let sign = match (self.sense, row.negated) {
                (Sense::Minimize, false) | (Sense::Maximize, true) => -1.0,
                _ => 1.0,
            };
            // Not -0.
            line(&(sign * y[row.row as usize] + 0.0));
        }
        w[..n].iter().for_each(|value| line(value));
        line(&format!("objno 0 {}", code as u32));
        text
    }
}

/// Names, one a line, as in the files that AMPL writes beside a .nl file: variables in .col, rows in .row.
pub fn names(text: &str) -> Vec<String> {
    text.lines()
        .map(|line| line.trim_end().to_owned())
        .collect()
}
