//! Functions that a run is reported by: outputs, controls and limits, compiled once, with parameters that stay open.

use std::sync::Arc;

use nsd_solver::sensitivity::Recording;
use nsd_solver::tape::Tape;

use crate::expr::{self, Expr, Var};
use crate::lowering::hybrid::{numbers, variable};
use crate::report::{Samples, Series};
use crate::simulate::outcome::limits::evaluated;
use crate::simulate::outcome::overlooked::Hiding;
use crate::simulate::record::points::Points;
use crate::source::table::Table;
use crate::system::System;
use crate::system::switches::roots::Vanishing;

/// Functions of t, the values of data, x, α and the open parameters.
#[derive(Debug)]
pub(crate) struct Reported {
    /// The entries of all outputs, then those of all controls.
    outputs: Tape,
    /// What limits are about that are no states.
    pub limits: Tape,
    /// What may hide something from a step, for a method that does not see that by itself.
    pub hiding: Option<Hiding>,
    /// The numbers of the open parameters.
    open: Vec<usize>,
    /// n and m.
    sizes: [usize; 2],
}

/// What a run knows besides its states and α: what is told of it, the values of open parameters, and data.
#[derive(Debug)]
pub(crate) struct Given {
    /// What is reported, without values.
    named: Samples,
    /// The numbers of states whose values are reported, one behind the other.
    entries: Vec<usize>,
    parameters: Vec<f64>,
    data: Vec<Arc<Table>>,
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
            sizes: [system.states.len(), system.switches.len()],
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

    /// The same with data, and with what is told of a system, which may be less than when it was compiled.
    pub fn given(&self, system: &System) -> Given {
        let (data, groups) = (system.exogenous.data.iter(), system.recorded.groups.iter());
        Given {
            named: named(system),
            entries: groups.flat_map(|group| group.entries.clone()).collect(),
            parameters: self.parameters(system).collect(),
            data: data.map(|data| data.table.clone()).collect(),
        }
    }

    /// How many states and switches there are.
    pub fn sizes(&self) -> [usize; 2] {
        self.sizes
    }

    /// What is reported at points. Of two at one instant, the first is in the limit from before.
    pub fn at(&self, points: &Points, given: &Given) -> Samples {
        let n_points = points.times.len();
        let signals = self.signals(points, given);
        let [mut entry, mut signal] = [0; 2];
        let mut samples = given.named.clone();
        samples.time = points.times.clone();
        for series in &mut samples.states {
            let entries = &given.entries[entry..][..series.n_entries()];
            entry += entries.len();
            let rows = points.states.chunks(self.sizes[0].max(1));
            series.values = rows
                .flat_map(|row| entries.iter().map(|&entry| row[entry]))
                .collect();
        }
        for series in samples.outputs.iter_mut().chain(&mut samples.controls) {
            let entries = signal..signal + series.n_entries();
            signal = entries.end;
            let values = (0..n_points).flat_map(|k| entries.clone().map(move |o| (o, k)));
            series.values = values.map(|(o, k)| signals[o * n_points + k]).collect();
        }
        samples
    }

    /// Derivatives of states, and of outputs and controls, at instants, from those of states and α there, one instant after
    /// another, and those of the open parameters.
    pub fn tangents(
        &self,
        recording: &Recording,
        (times, tangents): (&[f64], &[f64]),
        parameters: &[f64],
        given: &Given,
    ) -> [Vec<Series>; 2] {
        let [n, m] = self.sizes;
        let rows = || tangents.chunks(n + m);
        let (mut entry, mut signal) = (0, 0);
        let mut states = given.named.states.clone();
        for series in &mut states {
            let entries = &given.entries[entry..][..series.n_entries()];
            entry += entries.len();
            let values = rows().flat_map(|row| entries.iter().map(|&entry| row[entry]));
            series.values = values.collect();
        }
        let slopes = self.slopes(recording, (times, tangents), parameters, given);
        let signals = given.named.outputs.iter().chain(&given.named.controls);
        let mut signals: Vec<Series> = signals.cloned().collect();
        for series in &mut signals {
            let entries = signal..signal + series.n_entries();
            signal = entries.end;
            let values = slopes
                .iter()
                .flat_map(|row| row[entries.clone()].iter().copied());
            series.values = values.collect();
        }
        [states, signals]
    }

    /// Derivatives of the entries of outputs, then of controls, instant by instant.
    fn slopes(
        &self,
        recording: &Recording,
        (times, tangents): (&[f64], &[f64]),
        parameters: &[f64],
        given: &Given,
    ) -> Vec<Vec<f64>> {
        let [n, m] = self.sizes;
        let n_data = given.data.len();
        let moving = 1 + n_data;
        let (entries, tape) = self.outputs.partials(|input| input >= moving);
        let mut scratch = tape.scratch();
        let mut partials = vec![0.0; tape.n_outputs()];
        let is_first = |k: usize| times.get(k + 1) == Some(&times[k]);
        let row = |(k, tangent): (usize, &[f64])| {
            let mut slopes = vec![0.0; self.outputs.n_outputs()];
            let (mut x, mut alpha) = (vec![f64::NAN; n], vec![f64::NAN; m]);
            recording.at(times[k], !is_first(k), &mut x, &mut alpha);
            let mut inputs = vec![times[k]];
            inputs.extend(given.data.iter().map(|data| match is_first(k) {
                true => data.before(times[k]),
                false => data.value(times[k]),
            }));
            inputs.extend(x.iter().chain(&alpha).chain(&given.parameters));
            tape.eval(&inputs, &mut partials, &mut scratch);
            for (&(output, input), partial) in entries.iter().zip(&partials) {
                let by = match (input - moving).checked_sub(n + m) {
                    None => tangent[input - moving],
                    Some(parameter) => parameters[parameter],
                };
                slopes[output] += partial * by;
            }
            // What depends on nothing that moves is known as long as the states are.
            if tangent[..n].iter().any(|t| t.is_nan()) {
                slopes.fill(f64::NAN);
            }
            slopes
        };
        tangents.chunks(n + m).enumerate().map(row).collect()
    }

    /// The entries of outputs, then of controls, each at all points.
    fn signals(&self, points: &Points, given: &Given) -> Vec<f64> {
        let Points {
            times,
            states,
            alphas,
            ..
        } = points;
        let (n_points, [n, m]) = (times.len(), self.sizes);
        let mut columns = vec![0.0; self.outputs.n_outputs() * n_points];
        if columns.is_empty() {
            return columns;
        }
        // Structure of arrays: one row per input, one column per point.
        let mut table = times.clone();
        let is_first = |k: usize| times.get(k + 1) == Some(&times[k]);
        for data in &given.data {
            let value = |(k, &t): (usize, &f64)| match is_first(k) {
                true => data.before(t),
                false => data.value(t),
            };
            table.extend(times.iter().enumerate().map(value));
        }
        table.extend((0..n).flat_map(|i| (0..n_points).map(move |k| states[k * n + i])));
        table.extend((0..m).flat_map(|i| (0..n_points).map(move |k| alphas[k * m + i])));
        for &value in &given.parameters {
            table.extend(std::iter::repeat_n(value, n_points));
        }
        let scratch = &mut self.outputs.lane_scratch();
        self.outputs
            .eval_many(&table, &mut columns, n_points, scratch);
        columns
    }
}

/// What is reported of a system, without values.
fn named(system: &System) -> Samples {
    let series = |name: &str, shape: &[usize]| Series {
        name: name.to_owned(),
        shape: shape.to_vec(),
        values: Vec::new(),
    };
    let recorded = &system.recorded;
    let signals = [&recorded.outputs, &recorded.controls].map(|outputs| {
        let outputs = outputs.iter();
        outputs.map(|one| series(&one.name, &one.shape)).collect()
    });
    let groups = recorded.groups.iter();
    let [outputs, controls] = signals;
    Samples {
        time: Vec::new(),
        states: groups
            .map(|group| series(&group.name, &group.shape))
            .collect(),
        outputs,
        controls,
        sensitivities: Vec::new(),
    }
}
