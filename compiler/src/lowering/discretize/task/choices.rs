//! Controls with finite sets of values, by complementarity.
//!
//! 0 <= u - a ⟂ b - u >= 0   for {a, b},   u = Σ a_i y_i,   Σ y_i = 1,   0 <= y_i ⟂ 1 - y_i >= 0   for more

use crate::lowering::discretize::formals::block::Builder;
use crate::lowering::discretize::layout::{Layout, range};
use crate::lowering::mpcc::{Bounds, Kind, Mpcc, Source, Variables};
use crate::system::task::{Control, Task};

/// All variables y and rows.
pub(crate) fn state<'e>(layout: &Layout, task: &Task<'e>, mpcc: &mut Mpcc<'e>) {
    let (exprs, steps) = (mpcc.exprs, layout.each_step());
    for (i, control) in task.controls.iter().enumerate() {
        let Some(values) = control.values() else {
            continue;
        };
        let source = Source::Task(control.span);
        let (name, u) = (&control.name, control.var);
        let block = Builder::new("choice", [steps]).variable(u, |[k]| layout.u(k) + i);
        match *values {
            [] | [_] => {}
            [_, _] => {
                let [a, b] = range(values);
                let outputs = vec![u - a, b - u];
                let text = format!("0 <= {name}[k] - {a} perp {b} - {name}[k] >= 0");
                block.state(mpcc, Kind::Pair, outputs, vec![source], text);
            }
            _ => {
                let n = values.len();
                let bounds = vec![Bounds::between(0.0, 1.0, 1.0 / n as f64); n];
                let bounds = bounds.repeat(layout.steps);
                let first = mpcc.declare("y", names(control, values), &[steps], bounds);
                let y = exprs.variables("y", n);
                let index = |[k]: [usize; 1]| first + (k - 1) * n;
                let sum = exprs.sum(y.iter().zip(values).map(|(&y, &value)| value * y));
                let outputs = vec![u - sum, 1.0 - exprs.sum(y.iter().copied())];
                let text = format!("0 = {name}[k] - sum(values*y[k]), 0 = 1 - sum(y[k])");
                let block = block.vector(&y, index);
                block.state(mpcc, Kind::Equation, outputs, vec![source; 2], text);
                let others = y.iter().map(|&y| 1.0 - y);
                let outputs = y.iter().copied().chain(others).collect();
                let text = "0 <= y[k] perp 1 - y[k] >= 0";
                let block = Builder::new("choice", [steps]).vector(&y, index);
                block.state(mpcc, Kind::Pair, outputs, vec![source; n], text);
            }
        }
    }
}

/// What the y of a control are called.
fn names(control: &Control, values: &[f64]) -> Vec<String> {
    let name = &control.name;
    values
        .iter()
        .map(|value| format!("{name}={value}"))
        .collect()
}

/// The y of a control in an interval that say that it has the value of this number: variables of w, with their values.
/// None where it has two values, which say so themselves.
pub(crate) fn chosen(
    mpcc: &Mpcc,
    control: &Control,
    interval: usize,
    number: usize,
) -> Vec<(usize, f64)> {
    let values = control.values().unwrap_or_default();
    let names = names(control, values);
    let block = mpcc
        .variables
        .iter()
        .find(|block| block.components == names);
    let of_block = |block: &Variables| {
        let first = block.start + (interval - 1) * values.len();
        let y = (0..values.len()).map(|at| (first + at, f64::from(u8::from(at == number))));
        y.collect()
    };
    block.map_or(Vec::new(), of_block)
}
