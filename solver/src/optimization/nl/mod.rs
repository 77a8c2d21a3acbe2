//! Programs in AMPL's .nl format, as text and in binary form, with complementarity conditions.
//!
//! Rows that differ in their variables and coefficients only become one kernel at many places, and so do the terms of
//! the objective. What is not smooth but complementary is rewritten: `abs`, `min`, `max`, and binary variables
//! (0 <= x ⟂ 1 - x >= 0). A row that complements a variable with two bounds is split, body = p - n with p ⟂ x - l and
//! n ⟂ u - x. Other kinks, integer variables, logical constraints and functions of libraries are refused.
//!
//! Gay 2005, *Writing .nl files*, and Gay 1997, *Hooking your solver to AMPL*; the meaning of `5 k i` as in `fg_read.c`
//! of the AMPL solver library.

mod error;
mod expression;
mod header;
mod lift;
mod program;
mod quality;
mod scan;
mod segments;
mod shape;
mod solution;

pub use error::{Error, Fault, Place};
pub use header::{Discrete, Header};
pub use quality::Quality;
pub use segments::Sense;
pub use solution::{Code, names};

use crate::optimization::kernels::Program;

/// A file as a program.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The program; its first variables are those of the file, and it is minimized.
    pub program: Program,
    /// How many of what the file has.
    pub sizes: Sizes,
    /// The rows of the file.
    pub rows: Vec<FileRow>,
    /// What is asked of the objective in the file.
    pub sense: Sense,
    /// The header.
    pub header: Header,
}

/// Where a row of the file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileRow {
    /// The row of the program.
    pub row: u32,
    /// Whether it has the opposite sign there.
    pub negated: bool,
}

/// A row or variable of a file, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Named {
    /// A row.
    Row(usize),
    /// A variable.
    Variable(usize),
}

/// How many of what a file has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Sizes {
    /// Variables.
    pub variables: usize,
    /// Rows.
    #[serde(rename = "constraints")]
    pub rows: usize,
    /// Complementarity conditions; two where a variable has two bounds.
    pub complementarities: usize,
    /// Occurrences of `abs`, `min` and `max`, which are pairs of the program.
    #[serde(skip)]
    pub kinks: usize,
    /// Binary variables, which are pairs of the program.
    #[serde(skip)]
    pub binaries: usize,
}

/// Reads a file.
pub fn read(bytes: &[u8]) -> Result<Problem, Error> {
    program::build(segments::read(bytes)?)
}

impl Problem {
    /// A value of the program's objective in the sense of the file.
    pub fn objective(&self, value: f64) -> f64 {
        match self.sense {
            Sense::Minimize => value,
            Sense::Maximize => -value,
        }
    }
}

#[cfg(test)]
mod tests;
