//! Functions that a run is reported by: outputs, controls and limits, compiled once, with parameters that stay open.

use std::sync::{Arc, Mutex, PoisonError};

use nsd_solver::hybrid::Sided;
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
    outputs: Mutex<Sided>,
    /// What limits are about that are no states.
    pub limits: Sided,
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
    pub(super) named: Samples,
    /// The numbers of states whose values are reported, one behind the other.
    pub(super) entries: Vec<usize>,
    pub(super) parameters: Vec<f64>,
    pub(super) data: Vec<Arc<Table>>,
}

impl Reported {
    /// Compiles them with some parameters open, by their numbers.
    pub fn new(system: &System, open: &[usize]) -> Self {
        let sizes = [system.states.len(), system.switches.len()];
        let tape = compiler(system, open);
        let first = 1 + system.exogenous.data.len() + sizes[0];
        let alphas = first..first + sizes[1];
        let sided = |exprs| Sided::new(tape(exprs), |input| alphas.contains(&input));
        let outputs = system.recorded.signals();
        let outputs = outputs.flat_map(|output| output.exprs.iter().copied());
        Reported {
            outputs: Mutex::new(sided(outputs.collect())),
            limits: sided(evaluated(system)),
            hiding: None,
            open: open.to_vec(),
            sizes,
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

    /// All ψ as functions of what outputs are functions of.
    pub fn surfaces(&self, system: &System) -> Tape {
        compiler(system, &self.open)(switching(system))
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

    /// The functions of outputs and controls, on whatever sides.
    pub(super) fn outputs(&self) -> Tape {
        self.sided(|outputs| outputs.whole().clone())
    }

    fn sided<T>(&self, with: impl FnOnce(&mut Sided) -> T) -> T {
        with(&mut self.outputs.lock().unwrap_or_else(PoisonError::into_inner))
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
        let first = 1 + given.data.len();
        let input = |k: usize, input: usize| match input {
            0 => times[k],
            _ if input < first => data_at(&given.data[input - 1], times, k),
            _ if input < first + n => states[k * n + input - first],
            _ if input < first + n + m => alphas[k * m + input - first - n],
            _ => given.parameters[input - first - n - m],
        };
        self.sided(|outputs| {
            let (n_inputs, n_outputs) = (outputs.whole().n_inputs(), outputs.whole().n_outputs());
            let mut columns = vec![0.0; n_outputs * n_points];
            // Structures of arrays: one row per input or output, one column per point on the same sides.
            let (mut table, mut part) = (Vec::new(), Vec::new());
            let mut from = 0;
            while n_outputs > 0 && from < n_points {
                let ends = |k: &usize| !outputs.agree(|i| input(from, i), |i| input(*k, i));
                let to = (from + 1..n_points).find(ends).unwrap_or(n_points);
                table.clear();
                table.extend((0..n_inputs).flat_map(|i| (from..to).map(move |k| input(k, i))));
                part.resize(n_outputs * (to - from), 0.0);
                let tape = outputs.on(|i| input(from, i));
                tape.eval_many(&table, &mut part, to - from, &mut tape.lane_scratch());
                for (o, part) in part.chunks(to - from).enumerate() {
                    columns[o * n_points + from..o * n_points + to].copy_from_slice(part);
                }
                from = to;
            }
            columns
        })
    }
}

/// What makes functions of time, data, states, α and open parameters.
fn compiler<'s, 'e>(system: &'s System<'e>, open: &[usize]) -> impl Fn(Vec<Expr<'e>>) -> Tape + 's {
    let numbers = numbers(system, open);
    let mut inputs: Vec<Var> = vec![variable(system.time)];
    inputs.extend(system.exogenous.data.iter().map(|data| variable(data.var)));
    inputs.extend(system.states.iter().map(|state| variable(state.var)));
    inputs.extend(system.switches.iter().map(|switch| variable(switch.alpha)));
    let params = system.exogenous.chosen(open);
    inputs.extend(params.map(|param| variable(param.var)));
    let vanishing = Vanishing::of(system, &numbers.apply(&switching(system)));
    move |exprs: Vec<Expr>| {
        let exprs = vanishing.extended(&numbers.apply(&exprs));
        expr::compile(&inputs, &exprs)
            .expect("what is reported is smooth in time, data, states and α")
    }
}

/// All ψ.
fn switching<'e>(system: &System<'e>) -> Vec<Expr<'e>> {
    system.switches.iter().map(|switch| switch.psi).collect()
}

/// Data in a row.
pub(super) fn data_at(data: &Table, times: &[f64], row: usize) -> f64 {
    match is_before(times, row) {
        true => data.before(times[row]),
        false => data.value(times[row]),
    }
}

/// Whether the row of an instant is before what happens there: of two rows at one instant, the first is.
pub(in crate::simulate) fn is_before(times: &[f64], row: usize) -> bool {
    times.get(row + 1) == Some(&times[row])
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
        gradient: None,
    }
}
