//! A start from controls alone: they are run from event to event.
//!
//! Where contacts strike or switches are read nonlinearly, elements end where that run jumps or changes its mode: a guess
//! that does not know of it begins in the wrong modes. Contacts never close in them, as what stands still at an instant
//! takes time in the program.

use nsd_solver::fesd::jumps::{Impact, Lowered, Target, cut};
use nsd_solver::optimization::problem::Nlp;

use crate::expr::Var;
use crate::limit::Limit;
use crate::lowering::dcs::{Dcs, directed, solve_in_mode};
use crate::lowering::discretize::WINDOW;
use crate::optimize::checks::solved;
use crate::optimize::{Problem, Sampled};
use crate::report::{Dense, Status, Trajectory};
use crate::simulate::{self, ReferenceRun, Request, impacts};
use crate::system::experiment::Sampling;
use crate::system::task::{Control, Shape};
use crate::system::{Param, State, System};

/// Runs in numerical time are so many horizons long, the shorter ones first.
const LONGER: [f64; 3] = [2.0, 4.0, 16.0];
/// α that is so close to 0 or 1 is.
const ROUNDING: f64 = 1e-9;
/// How far inside of its element α is read, as a share of it: at its ends it belongs to others.
const INSIDE: f64 = 1e-6;

/// Gives lengths, states and multipliers the values of a run; false where there is none.
pub(crate) fn warm_start(problem: &Problem, w: &mut [f64], limit: &Limit) -> bool {
    let (layout, settings) = (&problem.layout, &problem.settings);
    let Some(task) = &problem.dcs.task else {
        return false;
    };
    if !problem.dcs.switches.branches.is_empty() {
        return in_modes(problem, &problem.simulated(w, limit), w);
    }
    if problem.frozen.is_none() && problem.dcs.impacts.is_empty() {
        return false;
    }
    if problem.frozen.is_some() {
        return in_numerical_time(problem, w, limit);
    }
    let mut system = problem.system.clone();
    system.task = None;
    system.recorded.outputs.clear();
    // Bounds are rows of the program.
    system.recorded.limits.clear();
    for (i, control) in task.controls.iter().enumerate() {
        let values: Vec<f64> = layout
            .control_instants()
            .map(|(k, _)| w[layout.u(k) + i])
            .collect();
        if values.iter().any(|value| *value != values[0]) {
            return false;
        }
        system.exogenous.params.push(known(control, values[0]));
    }
    let reference = problem.constant_run(&system, limit);
    follow(problem, &reference, settings.horizon, w);
    reference.run.begins()
}

/// A control that is a number.
fn known<'e>(control: &Control<'e>, value: f64) -> Param<'e> {
    Param {
        name: control.name.clone(),
        var: control.var,
        value,
    }
}

/// Gives lengths, states and multipliers the values of runs in numerical time with the controls of the point, from one
/// end of an interval to the next; false where one of them does not come to its end.
pub(crate) fn in_numerical_time(problem: &Problem, w: &mut [f64], limit: &Limit) -> bool {
    let layout = &problem.layout;
    let (Some(frozen), Some(task)) = (&problem.frozen, &problem.dcs.task) else {
        return false;
    };
    let mut system = frozen.system.clone();
    system.task = None;
    let (n_params, n_states) = (system.exogenous.params.len(), system.states.len());
    let clock = system.states[frozen.clock].rate;
    for (i, free) in task.params.iter().enumerate() {
        system.exogenous.params[free.place].value = w[layout.p(i)];
    }
    for free in &task.initial {
        system.states[free.place].initial = w[layout.before(1, 1) + free.place];
    }
    let ends = problem.at(w).ends();
    let mean = problem.at(w).horizon() / layout.steps as f64;
    for k in 1..=layout.steps {
        system.exogenous.params.truncate(n_params);
        system.states.truncate(n_states);
        let (instant, length) = match layout.decided.share(k) {
            Some(_) => (ends[k], ends[k] - ends[k - 1]),
            None => (k as f64 * mean, mean),
        };
        for (i, control) in task.controls.iter().enumerate() {
            let to = w[layout.u(k) + i];
            match task.shape {
                Shape::Constant => system.exogenous.params.push(known(control, to)),
                // A line in the clock.
                Shape::Linear => {
                    let from = w[layout.u(k - 1) + i];
                    system.states.push(State {
                        name: control.name.clone(),
                        var: control.var,
                        initial: from,
                        rate: clock * ((to - from) / length),
                        span: control.span,
                    });
                }
            }
        }
        let Some((run, end)) = run(problem, &system, frozen.clock, length, instant, limit) else {
            return false;
        };
        let switches = run.history.switch_times();
        let mut start = 0.0;
        for (j, h) in (1..).zip(cut(0.0, end, &switches, layout.elements)) {
            w[layout.h(k, j)] = h;
            fill(problem, &system, &run.dense, (k, j), (start, h), w);
            start += h;
        }
        let Some(row) = run.dense.at(end) else {
            return false;
        };
        for (state, &value) in system.states.iter_mut().zip(&row) {
            state.initial = value;
        }
    }
    problem.mpcc.slacken(w);
    true
}

/// The states of a run with the controls of a point, at all nodes; nothing where it does not reach the horizon.
pub(crate) fn sample(problem: &Problem, w: &[f64], limit: &Limit) -> Option<Sampled> {
    let layout = &problem.layout;
    let horizon = problem.settings.horizon;
    let nodes = layout.points[1..].iter();
    let elements = layout.all_elements();
    let instants = elements.flat_map(|element| nodes.clone().map(move |c| (element, *c)));
    let length = horizon / (layout.steps * layout.elements) as f64;
    let place = problem.at(w).places();
    let instants = instants.map(|((k, j), c)| match layout.decided.share(k) {
        Some(_) => place((k, j), c) * horizon,
        None => (layout.element(k, j) as f64 + c) * length,
    });
    let instants = [0.0].into_iter().chain(instants);
    let instants = instants.map(|t| t.min(horizon)).collect();
    let run = solved::run(problem, w, limit, |settings| {
        settings.horizon = horizon;
        settings.recording.sampling = Sampling::At(instants);
    });
    let states = run.samples.states.first()?;
    let entry = |i: usize| {
        (0..run.samples.time.len())
            .map(|point| states.at(point)[i])
            .collect()
    };
    let names = problem.system.states.iter();
    let names = names.map(|state| state.name.clone());
    (run.status == Status::Solved).then(|| Sampled {
        values: names
            .enumerate()
            .map(|(i, name)| (name, entry(i)))
            .collect(),
        time: run.samples.time.clone(),
    })
}

/// Gives lengths, states and multipliers the values of a run to a horizon.
///
/// The program has no impacts at gaps below τ (v⁺ + e v⁻), e <= 1, behind the end of an interval. Such a one is at the end.
fn follow<'e>(problem: &Problem<'e>, run: &ReferenceRun<'e>, horizon: f64, w: &mut [f64]) {
    let layout = &problem.layout;
    let window = 2.0 * WINDOW * horizon / (layout.steps * layout.elements) as f64;
    let bounds = problem.program.variable_bounds();
    let states = problem.dcs.states.iter();
    let initial: Vec<f64> = states.map(|state| state.initial).collect();
    let mut lowered = WithControls {
        dcs: &problem.dcs,
        system: &run.system,
        impacts: impacts(&run.system, &problem.dcs.impacts),
    };
    let ends: Vec<f64> = {
        let own = problem.at(w);
        let scale = horizon / own.horizon();
        own.ends().into_iter().map(|end| scale * end).collect()
    };
    for k in 1..=layout.steps {
        let interval = (ends[k - 1], ends[k]);
        let step = Target {
            elements: &layout.step(k),
            points: &layout.points,
            n_states: layout.n_states(),
            initial: &initial,
            bounds,
            interval,
            window,
        };
        run.run.fill(&mut lowered, &step, w);
    }
}

/// The lowering of a problem, with the controls of a run.
struct WithControls<'p, 'e> {
    dcs: &'p Dcs<'e>,
    system: &'p System<'e>,
    impacts: Vec<Impact>,
}

impl Lowered for WithControls<'_, '_> {
    fn impacts(&self) -> &[Impact] {
        &self.impacts
    }

    fn direct(&mut self, alphas: &mut [f64], instants: [f64; 2], x: &[f64]) {
        let known = self.system.valuation_around(instants, x, &[]);
        let idle = self.impacts.iter().filter_map(|impact| impact.idle(alphas));
        let idle: Vec<usize> = idle.collect();
        directed(self.system, alphas, &idle, &|var| known.number(var));
    }

    fn in_mode(&mut self, instants: [f64; 2], x: &[f64], alphas: &[f64]) -> Vec<f64> {
        let known = self.system.valuation_around(instants, x, &[]);
        solve_in_mode(self.system, self.dcs, alphas, &|var| known.number(var)).algebraics
    }

    fn law(&mut self, contact: usize, time: f64, x: &[f64]) -> [f64; 2] {
        let known = self.system.valuation(time, x, &[]);
        let impact = &self.dcs.impacts[contact];
        [impact.speed, impact.restitution].map(|e| known.value(e))
    }
}

/// The same with nonlinear switches, and with the controls of the point itself; false where the run ends before.
pub(crate) fn in_modes<'e>(problem: &Problem<'e>, run: &ReferenceRun<'e>, w: &mut [f64]) -> bool {
    if run.failure.is_some() {
        return false;
    }
    follow(problem, run, problem.at(w).horizon(), w);
    let layout = &problem.layout;
    for (k, j) in layout.all_elements() {
        let alphas: Vec<Vec<f64>> = (1..=layout.nodes)
            .map(|m| problem.at(w).alphas(k, j, m))
            .collect();
        for (i, branch) in problem.dcs.switches.branches.iter().enumerate() {
            // Only where it slides is its stability bounded.
            let Some(r) = layout.r(k, j) else { continue };
            for (side, end) in [0.0, 1.0].into_iter().enumerate() {
                let is_there = |alphas: &Vec<f64>| (alphas[branch.switch] - end).abs() <= ROUNDING;
                w[r + 2 * i + side] = f64::from(u8::from(alphas.iter().all(is_there)));
            }
        }
    }
    problem.mpcc.slacken(w);
    true
}

/// A run in numerical time until its clock shows an instant, and how long it takes.
fn run<'e>(
    problem: &Problem<'e>,
    system: &System<'e>,
    clock: usize,
    length: f64,
    instant: f64,
    limit: &Limit,
) -> Option<(Trajectory, f64)> {
    let mut settings = problem.settings.clone();
    settings.simulate_by_events();
    settings.recording.sampling = Sampling::Method;
    LONGER.iter().find_map(|longer| {
        let request = Request {
            dense: true,
            estimate: false,
            multipliers: false,
            limit: limit.clone(),
        };
        settings.horizon = longer * length;
        let run = simulate::run(system, &settings, &request);
        reached(&run.dense, clock, instant).map(|end| (run, end))
    })
}

/// When the clock shows a time first.
fn reached(dense: &Dense, clock: usize, time: f64) -> Option<f64> {
    let shows = |t: f64, piece: &crate::report::Piece| piece.at(t)[clock];
    let number = dense
        .pieces
        .partition_point(|piece| shows(piece.to, piece) < time);
    let piece = dense.pieces.get(number)?;
    let (mut before, mut behind) = (piece.from, piece.to);
    while behind - before > f64::EPSILON * piece.to {
        let middle = 0.5 * (before + behind);
        match shows(middle, piece) < time {
            true => before = middle,
            false => behind = middle,
        }
        if middle == before && middle == behind {
            break;
        }
    }
    Some(behind)
}

/// States and multipliers of an element.
fn fill(
    problem: &Problem,
    system: &System,
    dense: &Dense,
    (k, j): (usize, usize),
    (start, h): (f64, f64),
    w: &mut [f64],
) {
    let layout = &problem.layout;
    let bounds = problem.mpcc.bounds();
    let mut set = |index: usize, value: f64| {
        if value.is_finite() {
            w[index] = value.max(bounds[index].lower).min(bounds[index].upper);
        }
    };
    let n = system.states.len();
    for (m, c) in layout.points.iter().enumerate() {
        let inside = c.clamp(INSIDE, 1.0 - INSIDE);
        // Both values of what jumps nowhere are the same at the ends.
        let (Some(row), Some(within)) = (dense.at(start + c * h), dense.at(start + inside * h))
        else {
            continue;
        };
        if m > 0 || (k, j) == (1, 1) {
            for (i, &value) in row[..layout.n_states()].iter().enumerate() {
                set(layout.x(k, j, m) + i, value);
            }
        }
        let known = |c: f64, row: &[f64]| {
            let instants = [c, inside].map(|c| start + c * h);
            let known = system.valuation_around(instants, &row[..n], &[]);
            move |var: Var| known.number(var)
        };
        let mut alphas = within[n..n + system.switches.len()].to_vec();
        settle(problem, &mut alphas);
        directed(system, &mut alphas, &[], &known(inside, &within));
        let value = known(*c, &row);
        let found = solve_in_mode(system, &problem.dcs, &alphas, &value);
        let is_first = (k, j) == (1, 1);
        for (i, z) in found.algebraics.into_iter().enumerate() {
            if m == 0 && !is_first && !layout.algebraics.starts_anew(i) {
                continue;
            }
            if let Some(index) = layout.z(k, j, m, i) {
                set(index, z);
            }
        }
    }
}

/// Of a contact that lasts, only the weight of free flight is determined by α of its gap and of its speed: it is all
/// that of the speed.
fn settle(problem: &Problem, alphas: &mut [f64]) {
    let contacts = problem.frozen.iter().flat_map(|frozen| &frozen.contacts);
    for contact in contacts {
        let Some(rest) = &contact.rest else {
            continue;
        };
        let (apart, leaves) = (alphas[contact.switch], alphas[rest.speed]);
        let free = apart + leaves - apart * leaves;
        if free > ROUNDING && free < 1.0 - ROUNDING {
            (alphas[contact.switch], alphas[rest.speed]) = (0.0, free);
        }
    }
}
