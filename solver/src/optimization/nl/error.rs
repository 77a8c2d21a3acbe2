//! What can be wrong with a file.

use std::fmt;

/// Where in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A line of a text file, from 1.
    Line(usize),
    /// A byte of a binary file, from 0.
    Byte(usize),
}

/// Why a file cannot be solved.
#[derive(Clone, Debug, PartialEq)]
pub struct Error {
    /// Where.
    pub place: Place,
    /// What.
    pub fault: Fault,
}

/// What is wrong, or not supported.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Fault {
    /// No .nl file at all.
    #[error("this is no .nl file: it starts neither with `g` (text) nor with `b` (binary)")]
    NotNl,
    /// Made on a machine with the other byte order.
    #[error("this binary file has the byte order of another kind of processor")]
    ByteOrder,
    /// The end comes too early.
    #[error("the file ends where {0} should be")]
    End(&'static str),
    /// Something else than what the format has here.
    #[error("`{found}` where {expected} should be")]
    Unexpected {
        /// What the format has here.
        expected: &'static str,
        /// What is there.
        found: String,
    },
    /// A number beyond what it counts.
    #[error("{what} {number}, but there are only {count}")]
    Range {
        /// What is counted.
        what: &'static str,
        /// The number, from 0.
        number: i64,
        /// How many there are.
        count: usize,
    },
    /// A header that promises more than the file can hold.
    #[error("the header announces {number} {what}, which do not fit into {length} bytes")]
    Size {
        /// What is counted.
        what: &'static str,
        /// How many.
        number: usize,
        /// The length of the file.
        length: usize,
    },
    /// A segment that may be there once only.
    #[error("a second {0}")]
    Twice(String),
    /// A segment that has to be there.
    #[error("the file has no {0}")]
    Missing(&'static str),
    /// A defined variable that comes later, or never.
    #[error("defined variable {0} is used before it is defined")]
    Undefined(u32),
    /// A number that is not one.
    #[error("NaN where {0} should be")]
    NaN(&'static str),
    /// l > u.
    #[error("{what} {number} has the bounds {lower} and {upper}, between which there is nothing")]
    Empty {
        /// A row or a variable.
        what: &'static str,
        /// Its number, from 0.
        number: usize,
        /// l
        lower: f64,
        /// u
        upper: f64,
    },
    /// A complementarity condition with a bound that is not there.
    #[error("row {row} complements variable {variable} at its {bound} bound, which is not finite")]
    Unbounded {
        /// The row, from 0.
        row: usize,
        /// The variable, from 0.
        variable: u32,
        /// `lower` or `upper`.
        bound: &'static str,
    },
    /// An operator that is neither smooth nor can be made so.
    #[error("`{operator}` in {user} is not differentiable")]
    Nonsmooth {
        /// Its name in AMPL.
        operator: &'static str,
        /// `row 3`, `objective 0`, `defined variable 7`.
        user: String,
    },
    /// A number that no operator has.
    #[error("no operator has the number {0}")]
    Operator(i64),
    /// Integer variables.
    #[error("{0} variables are integer")]
    Integer(usize),
    /// Binary variables that are nonlinear, or that are not between 0 and 1.
    #[error("variable {0} is declared binary, but its bounds are not 0 and 1")]
    Binary(usize),
    /// Constraints of logic.
    #[error("the file has {0} logical constraints")]
    Logical(usize),
    /// Functions of a library.
    #[error("the file calls {0} functions of a library")]
    Functions(usize),
    /// Special ordered sets.
    #[error("the file has special ordered sets (suffix `{0}`)")]
    OrderedSets(String),
    /// More derivatives or operations than memory holds.
    #[error("{user} makes more than {limit} {what}")]
    Large {
        /// `row 3`, `objective 0`.
        user: String,
        /// `operations` or `second derivatives`.
        what: &'static str,
        /// How many may be.
        limit: usize,
    },
}

impl Fault {
    /// What to do about it.
    pub fn way_out(&self) -> Option<&'static str> {
        Some(match self {
            Self::NotNl => {
                "write it with `option solver` and `write gmodel;` in AMPL, or with `model.write('model.nl')` in Pyomo"
            }
            Self::ByteOrder => "write it as text: `write gmodel;`",
            Self::Nonsmooth { .. } => {
                "state the cases by a complementarity condition; `abs`, `min` and `max` are rewritten in this way"
            }
            Self::Integer(_) => {
                "relax them (`option relax_integrality 1;` in AMPL), or replace each by binary variables"
            }
            Self::Binary(_) => "give it the bounds 0 and 1",
            Self::Logical(_) => "state them by complementarity conditions",
            Self::Functions(_) => "write them out with the operators of AMPL",
            Self::OrderedSets(_) => {
                "state the sets by complementarity conditions between their members"
            }
            Self::Large { .. } => {
                "declare what occurs often as a variable with a row that defines it"
            }
            Self::Unbounded { .. } => "give the variable this bound",
            _ => return None,
        })
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.fault)
    }
}

impl std::error::Error for Error {}
