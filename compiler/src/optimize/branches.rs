//! Whether a solution is in the modes of the model, where switches are read nonlinearly or have memory.
//!
//! The program tells sliding modes that attract from those that repel, but not which of several is entered, nor that one
//! is not left before it ends: that depends on the side that the state comes from, which the dummy system knows
//! ([`nsd_solver::event`]). So the controls that were found are run from event to event. Where that run is in other
//! modes the program is solved again from it, in its modes. What differs still is no solution of the model.
//!
//! The memory of a relay is a state in numerical time, which goes from 0 to 1 while the clock stands. Between these it
//! may slide, as the auxiliary dynamics do, with a clock that goes on; the relay is on no side there, as no motion is.

use miette::LabeledSpan;
use nsd_solver::integrate::tableau::lagrange;
use nsd_solver::optimization::mpcc;
use nsd_solver::optimization::mpcc::{Options, Solution, Status};

use super::Problem;
use crate::limit::Limit;
use crate::optimize::checks::solved;
use crate::optimize::start::reference;
use crate::project::watch::Watch;
use crate::report::{self, Failure};
use crate::simulate::ReferenceRun;

/// How often a program is solved again.
const MAX_ROUNDS: usize = 4;
/// α that differ by less are in one mode.
const APART: f64 = 0.1;
/// Modes may differ for so long, as a share of the horizon: switches of both are not at the same instants.
const BRIEF: f64 = 1e-2;

/// Where the memory of a relay is on neither side while time goes on.
struct Undecided {
    time: f64,
    /// The switch.
    relay: usize,
}

/// Where a solution and a run with its controls are in different modes.
struct Difference {
    time: f64,
    /// The switch.
    switch: usize,
    /// Its α in the solution and in the run.
    alphas: [f64; 2],
}

impl<'e> Problem<'e> {
    /// A run from event to event with the controls of a point, for so long.
    pub(super) fn simulated(&self, w: &[f64], limit: &Limit) -> ReferenceRun<'e> {
        let mut settings = self.settings.clone();
        settings.horizon = self.at(w).horizon();
        let mut system = solved::system(self, w);
        system.recorded.outputs.clear();
        system.recorded.controls.clear();
        self.reference_run((&system, w), &settings, limit)
    }

    /// Where nonlinear switches of a point differ from those of a run first, if they do for long.
    fn difference(&self, run: &ReferenceRun, w: &[f64]) -> Option<Difference> {
        let layout = &self.layout;
        let (at, horizon) = (self.at(w), self.at(w).horizon());
        let ends = at.ends();
        let middle = lagrange(&layout.points[1..=layout.nodes], &[0.5]);
        let (mut first, mut duration) = (None, 0.0);
        for (k, j) in layout.all_elements() {
            let h = w[layout.h(k, j)].max(0.0);
            let before: f64 = (1..j).map(|j| w[layout.h(k, j)].max(0.0)).sum();
            let start = ends[k - 1] + before;
            let time = start + 0.5 * h;
            let Some(simulated) = run.run.alphas(time) else {
                continue;
            };
            let nodes: Vec<Vec<f64>> = (1..=layout.nodes).map(|m| at.alphas(k, j, m)).collect();
            let differs = self.dcs.switches.branches.iter().find_map(|branch| {
                let switch = branch.switch;
                let found = nodes.iter().zip(&middle);
                let found: f64 = found.map(|(alphas, share)| share * alphas[switch]).sum();
                let other = simulated[switch];
                ((found - other).abs() > APART).then_some(Difference {
                    time: start,
                    switch,
                    alphas: [found, other],
                })
            });
            if let Some(differs) = differs {
                duration += h;
                first.get_or_insert(differs);
            }
        }
        first.filter(|_| duration > BRIEF * horizon)
    }

    /// What is wrong with a solution in other modes than the model.
    fn in_other_mode(&self, difference: &Difference) -> Failure {
        let switch = &self.system.switches[difference.switch];
        let reading = switch.named.first();
        let shown = |alpha: f64| {
            let value = reading.map_or(alpha, |reading| reading.value(alpha));
            format!("{value:.4}")
        };
        let [found, simulated] = difference.alphas.map(shown);
        Failure::OtherMode {
            time: difference.time,
            name: switch.name.clone(),
            found,
            simulated,
            span: switch.spans.first().copied().unwrap_or(self.settings.span),
        }
    }
}

/// Where a relay is on neither side of a point first, if one is for long.
fn undecided(problem: &Problem<'_>, w: &[f64]) -> Option<Undecided> {
    let (frozen, at, layout) = (problem.frozen.as_ref()?, problem.at(w), &problem.layout);
    let (mut first, mut duration) = (None, 0.0);
    for (k, j) in layout.all_elements() {
        let instants = at.instants((k, j), 0.0);
        if at.stands((k, j), &instants) {
            continue;
        }
        let is_between = |state: usize| {
            let nodes = (1..=layout.nodes).map(|m| w[layout.x(k, j, m) + state]);
            let mean = nodes.sum::<f64>() / layout.nodes as f64;
            (APART..=1.0 - APART).contains(&mean)
        };
        let mut relays = frozen.relays.iter();
        if let Some(memory) = relays.find(|memory| is_between(memory.state)) {
            duration += instants[layout.end] - instants[0];
            first.get_or_insert(Undecided {
                time: instants[0],
                relay: memory.relay,
            });
        }
    }
    first.filter(|_| duration > BRIEF * at.horizon())
}

/// What is wrong with a solution in which a relay is on neither side.
fn on_no_side(problem: &Problem<'_>, undecided: &Undecided) -> Failure {
    let switch = &problem.system.switches[undecided.relay];
    let span = switch.spans.first().copied();
    let label = "its sides are all it has".to_owned();
    Failure::NotOptimal {
        what: format!(
            "in the point that was found relay `{}` is between its two sides from t = {:.6} on, which the model never is",
            switch.name, undecided.time
        ),
        end: report::Status::NumericalFailure,
        lines: vec![LabeledSpan::new_with_span(
            Some(label),
            span.unwrap_or(problem.settings.span),
        )],
    }
}

/// What is wrong with the modes of a solution, beside a run with its controls where modes are read nonlinearly.
fn failure_of_modes(problem: &Problem<'_>, run: &ReferenceRun, w: &[f64]) -> Option<Failure> {
    let undecided = undecided(problem, w);
    let undecided = undecided.map(|undecided| on_no_side(problem, &undecided));
    undecided.or_else(|| {
        let difference = problem.difference(run, w)?;
        Some(problem.in_other_mode(&difference))
    })
}

/// Whether a solution may be in modes that the model is not in.
pub(super) fn has_other_modes(problem: &Problem<'_>, w: &[f64]) -> bool {
    !problem.dcs.switches.branches.is_empty() || undecided(problem, w).is_some()
}

/// Brings a solution into the modes of the model as long as the limit allows; the failure says why it is in others, or is that
/// of the run.
pub(super) fn settle(
    problem: &mut Problem,
    solution: &mut Solution,
    options: &Options,
    limit: &Limit,
    watch: &mut dyn Watch,
) -> Option<Failure> {
    let span = problem.settings.span;
    let over = |over| Failure::over(over, 0.0, span);
    let mut rounds = 0..MAX_ROUNDS;
    loop {
        let run = problem.simulated(&solution.w, limit);
        match (&run.failure, limit.over()) {
            (Some(failure), Some(why)) if failure.is_over() => return Some(over(why)),
            (Some(failure), _) => return Some(failure.clone()),
            (None, _) => {}
        }
        let failure = failure_of_modes(problem, &run, &solution.w)?;
        if rounds.next().is_none() {
            return Some(failure);
        }
        let mut start = solution.w.clone();
        match problem.frozen {
            Some(_) => reference::in_numerical_time(problem, &mut start, limit),
            None => reference::in_modes(problem, &run, &mut start),
        };
        let options = Options {
            trust: mpcc::Trust::First,
            effort: 0,
            ..options.clone()
        };
        let found = mpcc::solve_observed(&mut problem.program, &start, &options, watch);
        if let Status::Over(why) = found.status {
            return Some(over(why));
        }
        if !found.is_feasible() {
            return Some(failure);
        }
        let iterations = solution.stats.iterations;
        *solution = found;
        solution.stats.iterations += iterations;
    }
}
