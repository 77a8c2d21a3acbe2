//! Functions that a run is reported by: outputs, controls and limits, compiled once, with parameters that stay open.

use nsd_solver::tape::Tape;

use crate::expr::{self, Expr, Var};
use crate::lowering::hybrid::{numbers, variable};
use crate::report::Series;
use crate::simulate::outcome::limits::evaluated;
use crate::simulate::outcome::overlooked::Hiding;
use crate::system::switches::roots::Vanishing;
use crate::system::{Output, System};

/// Functions of t, the values of data, x, α and the open parameters.
pub(crate) struct Reported {
    /// The entries of all outputs, then those of all controls.
    outputs: Tape,
    /// What limits are about that are no states.
    pub limits: Tape,
    /// What may hide something from a step, for a method that does not see that by itself.
    pub hiding: Option<Hiding>,
    /// The numbers of the open parameters.
    open: Vec<usize>,
}

impl Reported {
    /// Compiles them with some parameters open, by their numbers.
    pub fn new(system: &System, open: &[usize]) -> Self {
        let numbers = numbers(system, open);
        let mut inputs: Vec<Var> = vec![variable(system.time)];
        inputs.extend(system.exogenous.data.iter().map(|data| variable(data.var)));
        inputs.extend(system.states.iter().map(|state| variable(state.var)));
        inputs.extend(system.switches.iter().map(|switch| variable(switch.alpha)));
        let params = system.exogenous.chosen(open);
        inputs.extend(params.map(|param| variable(param.var)));
        let switching: Vec<Expr> = system.switches.iter().map(|switch| switch.psi).collect();
        let vanishing = Vanishing::of(system, &numbers.apply(&switching));
        let tape = |exprs: Vec<Expr>| {
            let exprs = vanishing.extended(&numbers.apply(&exprs));
            expr::compile(&inputs, &exprs)
                .expect("what is reported is smooth in time, data, states and α")
        };
        let outputs = system.recorded.signals();
        Reported {
            outputs: tape(
                outputs
                    .flat_map(|output| output.exprs.iter().copied())
                    .collect(),
            ),
            limits: tape(evaluated(system)),
            hiding: None,
            open: open.to_vec(),
        }
    }

    /// With what may hide something from a step.
    pub fn and_hiding(mut self, system: &System) -> Self {
        self.hiding = Hiding::of(system, &self.open);
        self
    }

    /// The values of the open parameters.
    pub fn parameters(&self, system: &System) -> impl Iterator<Item = f64> {
        (system.exogenous.chosen(&self.open)).map(|param| param.value)
    }

    /// Outputs and controls at points, with times, states and α one after another. Of two points at one instant, the first
    /// is in the limit from before.
    pub fn series(
        &self,
        system: &System,
        [times, states, alphas]: [&[f64]; 3],
    ) -> [Vec<Series>; 2] {
        let n_entries = self.outputs.n_outputs();
        let (points, n, m) = (times.len(), system.states.len(), system.switches.len());
        let mut columns = vec![0.0; n_entries * points];
        if n_entries > 0 {
            // Structure of arrays: one row per input, one column per point.
            let mut table = times.to_vec();
            let is_first = |k: usize| times.get(k + 1) == Some(&times[k]);
            for data in &system.exogenous.data {
                let value = |(k, &t): (usize, &f64)| match is_first(k) {
                    true => data.table.before(t),
                    false => data.table.value(t),
                };
                table.extend(times.iter().enumerate().map(value));
            }
            table.extend((0..n).flat_map(|i| (0..points).map(move |k| states[k * n + i])));
            table.extend((0..m).flat_map(|i| (0..points).map(move |k| alphas[k * m + i])));
            for value in self.parameters(system) {
                table.extend(std::iter::repeat_n(value, points));
            }
            let scratch = &mut self.outputs.lane_scratch();
            self.outputs
                .eval_many(&table, &mut columns, points, scratch);
        }
        let mut first = 0;
        let mut series = |output: &Output| {
            let entries = first..first + output.exprs.len();
            first = entries.end;
            let values = (0..points).flat_map(|k| entries.clone().map(move |o| (o, k)));
            Series {
                name: output.name.clone(),
                shape: output.shape.clone(),
                values: values.map(|(o, k)| columns[o * points + k]).collect(),
            }
        };
        [&system.recorded.outputs, &system.recorded.controls]
            .map(|outputs| outputs.iter().map(&mut series).collect())
    }
}
