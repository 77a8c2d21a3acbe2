//! From values to registers: a linear scan that reuses a register after the last reader of its value.

use super::builder::slot;
use super::{Instruction, Slot, Tape, UNUSED};

/// The finished tape. `wanted` tells for every value behind the inputs whether somebody reads it: of a pair,
/// one result may go nowhere.
pub(super) fn allocate(
    n_inputs: usize,
    values: Vec<Instruction>,
    outputs: Vec<Slot>,
    wanted: &[bool],
) -> Tape {
    let n_values = n_inputs + wanted.len();

    // The instruction that reads a value last; outputs are read behind the end.
    let mut last_use = vec![0; n_values];
    for (i, instruction) in values.iter().enumerate() {
        instruction
            .op
            .operands()
            .for_each(|value| last_use[value as usize] = i);
    }
    outputs
        .iter()
        .for_each(|&value| last_use[value as usize] = values.len());

    // Inputs come in the first registers.
    let mut register: Vec<Slot> = (0..slot(n_values)).collect();
    let mut n_registers = slot(n_inputs);
    let mut free = Vec::new();
    let mut registers = Vec::with_capacity(values.len());
    for (i, instruction) in values.iter().enumerate() {
        let op = instruction.op.map(|value| register[value as usize]);
        let [a, b] = instruction.op.parts().0;
        for operand in [a, if b == a { UNUSED } else { b }] {
            if operand != UNUSED && last_use[operand as usize] == i {
                free.push(register[operand as usize]);
            }
        }
        let mut place = |value: Slot| {
            if value == UNUSED || !wanted[value as usize - n_inputs] {
                return UNUSED;
            }
            let chosen = free.pop().unwrap_or_else(|| {
                n_registers += 1;
                n_registers - 1
            });
            register[value as usize] = chosen;
            chosen
        };
        let (out, second) = (place(instruction.out), place(instruction.second));
        registers.push(Instruction { op, out, second });
    }
    let output_registers = outputs
        .iter()
        .map(|&value| register[value as usize])
        .collect();

    Tape {
        n_inputs,
        n_values,
        values,
        outputs,
        n_registers: n_registers as usize,
        registers,
        output_registers,
    }
}
