//! A system with what was found: nothing is left to decide, and controls are functions of time.

use std::sync::Arc;

use crate::limit::Limit;
use crate::model::Data;
use crate::optimize::Problem;
use crate::report::Trajectory;
use crate::simulate::Request;
use crate::source::table::{Fit, Table};
use crate::system::experiment::Settings;
use crate::system::task::Shape;
use crate::system::{StateGroup, System};

/// A run of the system at a point from event to event, with all states, integrals among them, in one series.
pub(crate) fn run<'e>(
    problem: &Problem<'e>,
    w: &[f64],
    limit: &Limit,
    change: impl FnOnce(&mut Settings<'e>),
) -> Trajectory {
    let mut system = system(problem, w);
    system.recorded.outputs.clear();
    system.recorded.controls.clear();
    system.recorded.groups = vec![StateGroup {
        name: "x".into(),
        shape: vec![system.states.len()],
        entries: (0..system.states.len()).collect(),
    }];
    let mut settings = problem.settings.clone();
    settings.horizon = problem.at(w).horizon();
    settings.simulate_by_events();
    change(&mut settings);
    let request = Request {
        dense: false,
        estimate: false,
        multipliers: false,
        limit: limit.clone(),
    };
    problem.simulate((&system, w), &settings, &request)
}

/// The system at a point, without its task; integrals are still states.
pub(crate) fn system<'e>(problem: &Problem<'e>, w: &[f64]) -> System<'e> {
    let layout = &problem.layout;
    let mut system = problem.system.clone();
    let Some(task) = system.task.take() else {
        return system;
    };
    for (i, free) in task.params.iter().enumerate() {
        system.exogenous.params[free.place].value = w[layout.p(i)];
    }
    for free in &task.initial {
        system.states[free.place].initial = w[layout.before(1, 1) + free.place];
    }
    for (control, table) in task.controls.iter().zip(tables(problem, w)) {
        system.exogenous.data.push(Data {
            name: control.name.clone(),
            var: control.var,
            text: format!("{}: {table}", table.fit),
            table,
            span: control.span,
        });
    }
    // Bounds are constraints of the program.
    system.recorded.limits.clear();
    system
}

/// The controls at a point as functions of time.
pub(crate) fn tables(problem: &Problem, w: &[f64]) -> Vec<Arc<Table>> {
    let layout = &problem.layout;
    let mut ends = problem.at(w).ends();
    // Lengths that are free may be below zero, as far as a solution keeps its bounds.
    for k in 1..ends.len() {
        ends[k] = ends[k].max(ends[k - 1]);
    }
    let task = problem.system.task.iter();
    let controls = task.flat_map(|task| task.controls.iter().map(|_| task.shape));
    let table = |(i, shape): (usize, Shape)| {
        let (fit, times): (Fit, Vec<f64>) = match shape {
            Shape::Constant => (Fit::Hold, ends[..layout.steps].to_vec()),
            Shape::Linear => (Fit::Linear, ends.clone()),
        };
        let values = layout.control_instants().map(|(k, _)| w[layout.u(k) + i]);
        Arc::new(Table::new(fit, &times, &values.collect::<Vec<f64>>()))
    };
    controls.enumerate().map(table).collect()
}

/// How far the end of a simulation is from that of the program.
pub(crate) fn terminal_error(problem: &Problem, w: &[f64], values: &[f64]) -> f64 {
    let (end, n) = end(problem, values);
    let differences = values.iter().zip(&w[end..][..n]);
    differences.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
}

/// Where the states at the end stand in the program, and how many of those of a simulation there are.
pub(crate) fn end(problem: &Problem, values: &[f64]) -> (usize, usize) {
    let layout = &problem.layout;
    // In numerical time the clock and what moves while it stands come behind the states of the model.
    let n = match &problem.frozen {
        Some(frozen) => frozen.n_states,
        None => layout.n_states().min(values.len()),
    };
    (layout.x(layout.steps, layout.elements, layout.end), n)
}
