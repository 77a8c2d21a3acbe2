//! Where a program is solved from, and how.

pub(crate) mod guess;
pub(crate) mod products;
pub(crate) mod read;
pub(crate) mod reference;
mod refined;
pub(crate) mod shift;
pub(crate) mod transfer;
use nsd_solver::optimization::mpcc;
use nsd_solver::optimization::mpcc::{
    Coupling, Form, Homotopy, Iterations, MultiStart, Options, Solution, Trust,
};
use nsd_solver::optimization::problem::Nlp;

use super::nested::Before;
use super::{Point, Problem, Progress, Sampled};
use crate::expr::Var;
use crate::limit::Limit;
use crate::project::watch;
use crate::project::watch::Watch;
use crate::system::System;
use crate::system::experiment::Starts;
use crate::system::task::Task;
use crate::threads;

/// How much a single start may cost while other ways are tried for a smaller objective: next to nothing, as there are
/// `starts`.
const SINGLE_EFFORT: usize = 50_000;
/// How much it may cost until a point is stationary.
const SINGLE_PATIENCE: usize = 2_000_000;

/// Where a solver starts.
pub(crate) enum Start<'s> {
    /// As the task says, with these trajectories as guesses.
    Task(&'s [Sampled]),
    /// At a solution of the same task in another lowering.
    Point(&'s Point),
    /// At a point of the program itself, but for what is given.
    Variables(&'s [f64]),
}

/// A program that is ready to be solved.
pub(crate) struct Begin {
    /// The point to start from.
    pub guess: Vec<f64>,
    pub options: Options,
    /// Whether that is a solution for other values of what is given.
    pub is_solved_before: bool,
    /// Where there are several starts around that point.
    pub starts: Option<Starts>,
    /// What has led to that point.
    pub before: Before,
}

impl Problem<'_> {
    /// None where a solution of another program is no point of this one.
    pub(crate) fn begin(&self, start: Start<'_>, limit: &Limit) -> Option<Begin> {
        let is_solved_before = matches!(start, Start::Variables(_));
        let guess = match start {
            Start::Task(sampled) => {
                let (guess, reference) = self.start(sampled, limit);
                let starts = self.task.starts;
                let options = options(self, reference, starts, limit);
                return Some(Begin {
                    guess,
                    options,
                    is_solved_before: false,
                    starts,
                    before: Before::default(),
                });
            }
            Start::Point(point) => self.lifted(point)?,
            Start::Variables(w) => self.restarted(w)?,
        };
        let options = Options {
            // Other ways would lead elsewhere.
            effort: 0,
            ..options(self, true, None, limit)
        };
        Some(Begin {
            guess,
            options,
            is_solved_before,
            starts: None,
            before: Before::default(),
        })
    }

    /// A solution of the program with other initial values.
    fn restarted(&self, w: &[f64]) -> Option<Vec<f64>> {
        let mut guess = (w.len() == self.program.n_variables()).then(|| w.to_vec())?;
        for (index, value) in self.layout.given(&self.dcs) {
            guess[index] = value;
        }
        Some(guess)
    }

    /// The point to start from, and whether elements end and modes are those of a run: where something may jump, and
    /// where switches are read nonlinearly.
    ///
    /// Where controls are guessed and no states, these are those of a run with the controls, for the time that is left.
    pub(crate) fn start(&self, sampled: &[Sampled], limit: &Limit) -> (Vec<f64>, bool) {
        let mut guess = guess::start(self, sampled);
        let is_decided = |(var, _): &(Var, _)| is_decided(&self.system, *var);
        if !sampled.is_empty() || !self.task.guess.iter().all(is_decided) {
            return (guess, false);
        }
        if reference::warm_start(self, &mut guess, limit) {
            return (guess, true);
        }
        let asks = !self.task.guess.is_empty() && self.frozen.is_none();
        let run = asks.then(|| reference::sample(self, &guess, limit));
        let run = run.flatten();
        if let Some(run) = run {
            guess = guess::start(self, &[run]);
        }
        (guess, false)
    }
}

/// Whether a variable is a control or a parameter that is decided.
fn is_decided(system: &System, var: Var) -> bool {
    let of_task = |task: &Task<'_>| {
        let controls = task.controls.iter().map(|control| control.var);
        let params = (task.params.iter()).map(|free| system.exogenous.params[free.place].var);
        let mut all = controls.chain(params);
        all.any(|known| known.as_variable() == Some(var))
    };
    system.task.as_ref().is_some_and(of_task)
}

/// How a task is solved from one or several starts.
pub(super) fn options(
    problem: &Problem,
    reference: bool,
    starts: Option<Starts>,
    limit: &Limit,
) -> Options {
    let chosen = &problem.task.options;
    let form = Form {
        relaxation: chosen.relaxation,
        steering: chosen.steering,
        ..Form::default()
    };
    let coupling = Coupling::default();
    let homotopy = match chosen.is_sequential {
        true => Homotopy::Sequential {
            start: chosen.sigma.unwrap_or(1.0),
            factor: 0.1,
            stop: 1e-8,
        },
        false => {
            let sigma = chosen.sigma.unwrap_or(coupling.largest);
            Homotopy::Coupled(Coupling {
                factor: sigma,
                largest: sigma,
                ..coupling
            })
        }
    };
    let [effort, patience] = match starts {
        // Other ways would be cheaper in modes that the model is not in.
        None if reference && !problem.dcs.switches.branches.is_empty() => [0, SINGLE_PATIENCE],
        None => [SINGLE_EFFORT, SINGLE_PATIENCE],
        Some(_) => [Options::default().effort, Options::default().patience],
    };
    Options {
        effort,
        patience,
        form,
        homotopy,
        tolerance: chosen.optimality,
        iterations: Iterations {
            all: chosen.max_iterations.unwrap_or(usize::MAX),
            ..Iterations::default()
        },
        certificate: mpcc::Tolerances {
            sizes: Some(problem.sizes.clone()),
            ..mpcc::Tolerances::default()
        },
        limit: limit.clone(),
        analyses: problem.analyses.clone(),
        trust: match reference && starts.is_none() {
            true => Trust::First,
            false => Trust::No,
        },
        ..Options::default()
    }
}

/// All starts, several in parallel.
pub(crate) fn solve(problem: &mut Problem, begin: &Begin, watch: &mut dyn Watch) -> MultiStart {
    let Begin {
        guess,
        options,
        starts,
        ..
    } = begin;
    let count = starts.map_or(1, |starts| starts.count);
    let mut progress = Progress {
        done: 0,
        starts: count,
        last: None,
    };
    watch.progress(&watch::Progress::Starts(progress));
    let Some(starts) = starts else {
        let options = begin.before.options(options);
        let found = mpcc::solve_observed(&mut problem.program, guess, &options, watch);
        return MultiStart::new(vec![found]);
    };
    let moved = |number| mpcc::perturbed(guess, starts.deviation, starts.seed, number as u64);
    let starts: Vec<Vec<f64>> = (0..count).map(moved).collect();
    let mut heard = |start: usize, found: &Solution| {
        progress.done += 1;
        watch.progress(&watch::Progress::Starts(Progress {
            last: Some((start + 1, found)),
            ..progress
        }));
    };
    mpcc::multistart(
        &problem.program,
        &starts,
        options,
        threads::count(),
        &mut heard,
    )
}
