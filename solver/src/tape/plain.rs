//! Tapes as plain data: operations in the order of the values that they define. All else of a tape follows.

use serde::{Deserialize, Serialize};

use super::{Op, Slot, Tape, TapeBuilder};

/// Inputs of a tape that is read, at most.
const MOST_INPUTS: usize = 1 << 24;

/// What a tape is written as.
#[derive(Serialize, Deserialize)]
pub(super) struct Plain {
    inputs: usize,
    operations: Vec<Op>,
    outputs: Vec<Slot>,
}

impl From<Tape> for Plain {
    fn from(tape: Tape) -> Self {
        Plain {
            inputs: tape.n_inputs,
            operations: tape
                .values
                .iter()
                .map(|instruction| instruction.op)
                .collect(),
            outputs: tape.outputs,
        }
    }
}

impl TryFrom<Plain> for Tape {
    type Error = &'static str;

    fn try_from(plain: Plain) -> Result<Self, Self::Error> {
        if plain.inputs > MOST_INPUTS {
            return Err("a tape has too many inputs");
        }
        let mut builder = TapeBuilder::new(plain.inputs);
        for op in plain.operations {
            builder
                .repeat(op)
                .ok_or("an operation reads a value behind it")?;
        }
        let outputs = plain.outputs.iter().map(|&output| builder.value(output));
        let outputs: Option<Vec<_>> = outputs.collect();
        Ok(builder.finish(&outputs.ok_or("an output is no value")?))
    }
}
