//! What the printed blocks refer to: how the program was made, f, g, and the members of pairs.

use super::cross::Pairs;
use super::{Detection, Elements, Grid, Options, equilibrate};
use crate::diagnostics::counted;
use crate::lowering::dcs::Dcs;
use crate::lowering::mpcc::{Definition, Mpcc};
use crate::system::experiment::{Cross, Equilibration, Form};

/// The first lines of the printed form.
pub(crate) fn remarks(dcs: &Dcs, grid: Grid, form: Form, options: &Options) -> Vec<String> {
    let (family, nodes) = options.scheme;
    let form = match form {
        Form::Integral => "integral",
        Form::Differential => "differential",
    };
    let steps = counted(grid.steps, "step");
    let method = format!("{}({nodes}), {form} form", family.word());
    let grid = match options.elements {
        Elements::Plain(1) => format!("time stepping, {steps} to T = {}", grid.horizon),
        Elements::Plain(elements) => {
            let horizon = grid.horizon;
            format!("time stepping, {steps} of {elements} equal elements to T = {horizon}")
        }
        Elements::Detected(detection) => {
            let cross = match detection.cross {
                Cross::All => "pairs across all nodes",
                Cross::SumTheta => "pairs with sums of what jumps",
                Cross::SumLambda => "pairs with sums of what is continuous",
                Cross::SumBoth => "pairs of sums",
            };
            let elements = counted(detection.elements, "element");
            format!("{steps} of {elements} to T = {}, {cross}", grid.horizon)
        }
    };
    let reason = dcs.lowering.reason.as_ref();
    let reason = reason.map_or_else(String::new, |reason| format!(": {reason}"));
    vec![
        format!("{}{reason}", dcs.lowering.formulation),
        format!("{method}, {grid}"),
    ]
}

/// The rates f, the equations g, and the members a and b of pairs.
pub(crate) fn state(pairs: &Pairs, detection: Option<Detection>, mpcc: &mut Mpcc) {
    let dcs = pairs.formals.dcs;
    let mut define = |head: String, lines: Vec<String>| {
        if !lines.is_empty() {
            mpcc.definitions.push(Definition { head, lines });
        }
    };
    let arguments = pairs.formals.arguments(&dcs.time.to_string(), "x", "z");
    let rates = dcs.states.iter().zip(&dcs.rows.rates);
    let rates = rates.map(|(state, rate)| format!("der({}) = {rate}", state.var));
    define(format!("f{arguments}"), rates.collect());
    let equations = dcs.rows.equations.iter().map(|row| format!("0 = {row}"));
    define(format!("g{arguments}"), equations.collect());
    let jumps = dcs.jumps().into_iter();
    let jumps = jumps.map(|(state, by)| format!("jump({}) = {by}", dcs.states[state].var));
    define("r(x, y)".to_owned(), jumps.collect());
    for group in &pairs.groups {
        let head = match detection {
            Some(_) => group.to_string(),
            None => "a(z), b(z)".to_owned(),
        };
        define(head, group.lines());
    }
    let is_equilibrated = detection.is_some_and(|detection| {
        matches!(
            detection.equilibration,
            Equilibration::Tanh { .. } | Equilibration::Exact
        ) && detection.elements > 1
    });
    if is_equilibrated {
        let mut lines = equilibrate::eta_text(pairs);
        if !dcs.impacts.is_empty() {
            lines.push(
                "with gap[k,j+1,0] in the place of the first product for contacts".to_owned(),
            );
        }
        define("eta[k,j]".to_owned(), lines);
    }
}
