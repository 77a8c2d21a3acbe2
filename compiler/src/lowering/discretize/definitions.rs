//! What the printed blocks refer to: how the program was made, f, g, and the members of pairs.

use super::cross::Members;
use super::{Grid, Options, Problem};
use crate::lowering::dcs::Dcs;
use crate::lowering::mpcc::{Definition, Mpcc};
use crate::system::experiment::{Cross, Equilibration, Form};
use crate::system::task::Shape;

/// The first lines of the printed form.
pub(crate) fn remarks(dcs: &Dcs, grid: Grid, form: Form, options: &Options) -> Vec<String> {
    let (family, nodes) = options.scheme;
    let form = match form {
        Form::Integral => "integral",
        Form::Differential => "differential",
    };
    let steps = counted(grid.steps, "step");
    let method = format!("{}({nodes}), {form} form", family.word());
    let grid = match options.detection {
        None => format!("time stepping, {steps} to T = {}", grid.horizon),
        Some(detection) => {
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
    let reason = dcs.reason.as_ref();
    let reason = reason.map_or_else(String::new, |reason| format!(": {reason}"));
    vec![
        format!("{}{reason}", dcs.formulation),
        format!("{method}, {grid}"),
    ]
}

fn counted(n: usize, word: &str) -> String {
    match n {
        1 => format!("1 {word}"),
        _ => format!("{n} {word}s"),
    }
}

impl Problem<'_, '_> {
    /// `u[k]` where the states are `x[k,j,m]`, `u` where they are `x`.
    fn control_text(&self, x: &str) -> String {
        let is_placed = x.contains('[');
        match self.dcs.task.as_ref().map(|task| task.shape) {
            _ if !is_placed => "u".to_owned(),
            Some(Shape::Linear) => format!("u{}", &x[1..]),
            _ => "u[k]".to_owned(),
        }
    }

    /// `(t, x, u, z)`, without what does not occur.
    pub(crate) fn arguments(&self, t: &str, x: &str, z: &str) -> String {
        let t = self.layout.t(1, 1).map(|_| t);
        let z = (!self.dcs.algebraics.is_empty()).then_some(z);
        let decides = self
            .dcs
            .task
            .as_ref()
            .is_some_and(|task| !task.controls.is_empty());
        let u = decides.then(|| self.control_text(x));
        let all: Vec<&str> = (t.into_iter().chain([x]))
            .chain(u.as_deref())
            .chain(z)
            .collect();
        format!("({})", all.join(", "))
    }

    /// The rates f, the equations g, and the members a and b of pairs.
    pub(crate) fn define(&self, mpcc: &mut Mpcc) {
        let dcs = self.dcs;
        let mut define = |head: String, lines: Vec<String>| {
            if !lines.is_empty() {
                mpcc.definitions.push(Definition { head, lines });
            }
        };
        let arguments = self.arguments(&dcs.time.to_string(), "x", "z");
        let rates = dcs.states.iter().zip(&dcs.rates);
        let rates = rates.map(|(state, rate)| format!("der({}) = {rate}", state.var));
        define(format!("f{arguments}"), rates.collect());
        let equations = dcs.equations.iter().map(|row| format!("0 = {row}"));
        define(format!("g{arguments}"), equations.collect());
        let jumps = dcs.jumps().into_iter();
        let jumps = jumps.map(|(state, by)| format!("jump({}) = {by}", dcs.states[state].var));
        define("r(x, y)".to_owned(), jumps.collect());
        if self.detection.is_none() {
            let pairs = dcs.pairs.iter();
            let pairs = pairs.map(|pair| format!("{} perp {}", pair.left, pair.right));
            return define("a(z), b(z)".to_owned(), pairs.collect());
        }
        for group in self.groups() {
            let lines = group.members.iter().map(Members::to_string).collect();
            define(format!("{}(z), {}(z)", group.names.0, group.names.1), lines);
        }
        let is_equilibrated = self.detection.is_some_and(|detection| {
            matches!(
                detection.equilibration,
                Equilibration::Tanh { .. } | Equilibration::Exact
            ) && detection.elements > 1
        });
        if is_equilibrated {
            let mut lines = self.eta_text();
            if !dcs.impacts.is_empty() {
                lines.push(
                    "with gap[k,j+1,0] in the place of the first product for contacts".to_owned(),
                );
            }
            define("eta[k,j]".to_owned(), lines);
        }
    }
}
