//! A tape: straight-line code for one function from numbers to numbers.
//!
//! A tape holds its code twice. The *values* form names every intermediate result once; Taylor arithmetic
//! ([`Jet`]) needs them all. The *registers* form reuses places; plain and vectorised evaluation want few of them.
//!
//! Invariants:
//! - an instruction reads values with smaller numbers than it defines, inputs being the first values;
//! - no two instructions compute the same, and every instruction is needed by an output;
//! - a domain error gives NaN or an infinity, never a panic;
//! - no operation is fused: results do not depend on the processor.

mod allocate;
mod builder;
mod derivative;
mod elementary;
pub mod enclosures;
mod lanes;
mod partial;
mod plain;
mod specialize;
mod sums;
pub mod taylor;
mod term;

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::runtime::limit::work;

pub(crate) use crate::tape::enclosures::ball::Ball;
pub(crate) use crate::tape::enclosures::rounded::Rounded;
pub(crate) use crate::tape::enclosures::tame::{NOTHING, Tame};
pub(crate) use crate::tape::taylor::bulk::fill_all;
pub use crate::tape::taylor::jet::Jet;
pub(crate) use crate::tape::taylor::jet::{Recurrences, weights};
pub(crate) use crate::tape::taylor::row::{Depends, Row, UNBOUNDED};
pub(crate) use crate::tape::taylor::steps::{Step, advance_all, start_all};
pub use builder::{TapeBuilder, Value};
pub use derivative::Derivative;
pub use elementary::Elementary;
pub use lanes::{Lane, LaneScratch};
pub use specialize::{Linear, absorbs};
pub(crate) use sums::{Sum, Sums};
pub(crate) use term::Term;
pub use term::is_moderate;

/// The number of a value or of a register.
pub(crate) type Slot = u32;

/// The place of a result that nobody reads.
const UNUSED: Slot = Slot::MAX;

/// One operation; the operands are values or registers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Op {
    Constant(f64),
    Neg(Slot),
    /// `c * a`.
    Scale(f64, Slot),
    /// `c + a`.
    Offset(f64, Slot),
    /// `c - a`.
    SubtractFrom(f64, Slot),
    Add(Slot, Slot),
    Sub(Slot, Slot),
    /// `a + c * b`.
    AddScaled(Slot, f64, Slot),
    Mul(Slot, Slot),
    Div(Slot, Slot),
    Recip(Slot),
    Square(Slot),
    Sqrt(Slot),
    /// A constant power that is no integer.
    Power(Slot, f64),
    /// A variable power of a variable base.
    Pow(Slot, Slot),
    Apply(Elementary, Slot),
    /// Two results: sine, cosine.
    SinCos(Slot),
    /// Two results: hyperbolic sine, hyperbolic cosine.
    SinhCosh(Slot),
    /// `atan2(y, x)`.
    Atan2(Slot, Slot),
}

/// An operation and the places of its results; only the pairs have a second one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Instruction {
    op: Op,
    out: Slot,
    second: Slot,
}

/// A compiled function of `n_inputs` numbers with `n_outputs` values.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "plain::Plain", into = "plain::Plain")]
pub struct Tape {
    n_inputs: usize,
    n_values: usize,
    values: Vec<Instruction>,
    outputs: Vec<Slot>,
    n_registers: usize,
    registers: Vec<Instruction>,
    output_registers: Vec<Slot>,
}

/// The registers of one scalar evaluation.
#[derive(Clone, Debug)]
pub struct Scratch(Vec<f64>);

impl Tape {
    /// Starts a tape with this many inputs.
    pub fn builder(n_inputs: usize) -> TapeBuilder {
        TapeBuilder::new(n_inputs)
    }

    /// The number of inputs.
    pub fn n_inputs(&self) -> usize {
        self.n_inputs
    }

    /// The number of outputs.
    pub fn n_outputs(&self) -> usize {
        self.outputs.len()
    }

    /// The number of instructions.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there is nothing to compute: every output is an input.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The number of registers that an evaluation needs.
    pub fn n_registers(&self) -> usize {
        self.n_registers
    }

    /// The number that an output is, if it is one.
    pub(crate) fn number(&self, output: usize) -> Option<f64> {
        let value = self.outputs[output];
        let place = self.values.partition_point(|made| made.out < value);
        let maker = self.values.get(place).filter(|made| made.out == value);
        match maker?.op {
            Op::Constant(number) => Some(number),
            _ => None,
        }
    }

    /// Memory for [`Tape::eval`].
    pub fn scratch(&self) -> Scratch {
        Scratch(vec![0.0; self.n_registers])
    }

    /// Evaluates at one point, without allocation.
    pub fn eval(&self, inputs: &[f64], outputs: &mut [f64], scratch: &mut Scratch) {
        self.eval_lanes(inputs, outputs, &mut scratch.0);
    }

    /// Evaluates at as many points as a lane holds; `registers` has [`Tape::n_registers`] entries.
    pub fn eval_lanes<L: Lane>(&self, inputs: &[L], outputs: &mut [L], registers: &mut [L]) {
        assert_eq!(
            outputs.len(),
            self.outputs.len(),
            "one place per output of the tape"
        );
        registers[..self.n_inputs].copy_from_slice(inputs);
        self.run(registers);
        for (output, &register) in outputs.iter_mut().zip(&self.output_registers) {
            *output = registers[register as usize];
        }
    }

    /// The values of the outputs after [`Tape::run`], in order.
    pub(crate) fn results<'r, L: Lane>(
        &'r self,
        registers: &'r [L],
    ) -> impl Iterator<Item = L> + 'r {
        let places = self.output_registers.iter();
        places.map(|&register| registers[register as usize])
    }

    /// Evaluates from the inputs in the first registers.
    pub(crate) fn run<L: Lane>(&self, r: &mut [L]) {
        work::add(self.registers.len());
        for &Instruction { op, out, second } in &self.registers {
            let at = |slot: Slot| r[slot as usize];
            let result = match op {
                Op::Constant(c) => L::splat(c),
                Op::Neg(a) => -at(a),
                Op::Scale(c, a) => L::splat(c) * at(a),
                Op::Offset(c, a) => L::splat(c) + at(a),
                Op::SubtractFrom(c, a) => L::splat(c) - at(a),
                Op::Add(a, b) => at(a) + at(b),
                Op::Sub(a, b) => at(a) - at(b),
                Op::AddScaled(a, c, b) => at(a) + L::splat(c) * at(b),
                Op::Mul(a, b) => at(a) * at(b),
                Op::Div(a, b) => at(a) / at(b),
                Op::Recip(a) => L::splat(1.0) / at(a),
                Op::Square(a) => at(a) * at(a),
                Op::Sqrt(a) => at(a).sqrt(),
                Op::Power(a, c) => at(a).pow(L::splat(c)),
                Op::Pow(a, b) => at(a).pow(at(b)),
                Op::Apply(f, a) => at(a).apply(f),
                Op::SinCos(a) | Op::SinhCosh(a) => {
                    let circular = matches!(op, Op::SinCos(_));
                    let pair = if circular {
                        at(a).sin_cos()
                    } else {
                        at(a).sinh_cosh()
                    };
                    if second != UNUSED {
                        r[second as usize] = pair.1;
                    }
                    if out == UNUSED {
                        continue;
                    }
                    pair.0
                }
                Op::Atan2(y, x) => at(y).atan2(at(x)),
            };
            r[out as usize] = result;
        }
    }
}

impl Op {
    /// The same operation on other operands.
    fn map(self, f: impl Fn(Slot) -> Slot) -> Self {
        match self {
            Self::Constant(c) => Self::Constant(c),
            Self::Neg(a) => Self::Neg(f(a)),
            Self::Scale(c, a) => Self::Scale(c, f(a)),
            Self::Offset(c, a) => Self::Offset(c, f(a)),
            Self::SubtractFrom(c, a) => Self::SubtractFrom(c, f(a)),
            Self::Add(a, b) => Self::Add(f(a), f(b)),
            Self::Sub(a, b) => Self::Sub(f(a), f(b)),
            Self::AddScaled(a, c, b) => Self::AddScaled(f(a), c, f(b)),
            Self::Mul(a, b) => Self::Mul(f(a), f(b)),
            Self::Div(a, b) => Self::Div(f(a), f(b)),
            Self::Recip(a) => Self::Recip(f(a)),
            Self::Square(a) => Self::Square(f(a)),
            Self::Sqrt(a) => Self::Sqrt(f(a)),
            Self::Power(a, c) => Self::Power(f(a), c),
            Self::Pow(a, b) => Self::Pow(f(a), f(b)),
            Self::Apply(function, a) => Self::Apply(function, f(a)),
            Self::SinCos(a) => Self::SinCos(f(a)),
            Self::SinhCosh(a) => Self::SinhCosh(f(a)),
            Self::Atan2(y, x) => Self::Atan2(f(y), f(x)),
        }
    }

    /// The operands and the number, `UNUSED` and 0 where there is none.
    fn parts(self) -> ([Slot; 2], f64) {
        match self {
            Self::Constant(c) => ([UNUSED, UNUSED], c),
            Self::Scale(c, a) | Self::Offset(c, a) | Self::SubtractFrom(c, a) => ([a, UNUSED], c),
            Self::Power(a, c) => ([a, UNUSED], c),
            Self::AddScaled(a, c, b) => ([a, b], c),
            Self::Add(a, b)
            | Self::Sub(a, b)
            | Self::Mul(a, b)
            | Self::Div(a, b)
            | Self::Pow(a, b)
            | Self::Atan2(a, b) => ([a, b], 0.0),
            Self::Neg(a)
            | Self::Recip(a)
            | Self::Square(a)
            | Self::Sqrt(a)
            | Self::Apply(_, a)
            | Self::SinCos(a)
            | Self::SinhCosh(a) => ([a, UNUSED], 0.0),
        }
    }

    fn operands(self) -> impl Iterator<Item = Slot> {
        self.parts().0.into_iter().filter(|&slot| slot != UNUSED)
    }
}

/// One instruction per line, in values: `v2 = Add(0, 1)`.
impl fmt::Display for Tape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for Instruction { op, out, second } in &self.values {
            write!(f, "v{out}")?;
            if *second != UNUSED {
                write!(f, ", v{second}")?;
            }
            match op {
                Op::Apply(function, a) => writeln!(f, " = {function:?}({a})")?,
                _ => writeln!(f, " = {op:?}")?,
            }
        }
        let outputs: Vec<String> = self
            .outputs
            .iter()
            .map(|value| format!("v{value}"))
            .collect();
        writeln!(f, "return {}", outputs.join(", "))
    }
}
