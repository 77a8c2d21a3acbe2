//! Optimal control: a system with a task becomes a program, and its solution a trajectory.
//!
//! 1. The complementarity system is discretized ([`crate::lowering::discretize`]) and compiled.
//! 2. It is solved from one or several starts: relaxation, polish, certificate ([`nsd_solver::optimization::mpcc`]); where
//!    intervals are many, with fewer of them first (`nested.rs`).
//! 3. The best solution is a trajectory (`record.rs`) of a system that has nothing left to decide (`solved.rs`).
//! 4. Where switches are read nonlinearly, it is brought into the sliding modes of the model (`branches.rs`).
//! 5. Free quantities are changed and simulated from event to event (`reduced.rs`): where there is descent
//!    (`descent.rs`), another minimum (`elsewhere.rs`) or another sequence of events (`through.rs`), the program is solved
//!    again from it (`confirm.rs`).
//! 6. That system is simulated from event to event, as a check by another method (`check.rs`).
//!
//! What is in numerical time ([`crate::system::freezing`]) comes back to physical time with the trajectory (`iterate.rs`).

mod branches;
pub mod checks;
mod duals;
mod failure;
mod grid;
mod iterate;
mod moved;
mod nested;
mod prepared;
mod problem;
pub(crate) mod progress;
pub(crate) mod receding;
mod record;
pub(crate) mod start;
pub(crate) mod steps;

use std::time::Duration;

use nsd_solver::optimization::mpcc;
use nsd_solver::optimization::mpcc::{MultiStart, Solution};
use nsd_solver::optimization::problem::Nlp;

use crate::limit::{Limit, Over};
use crate::lowering::discretize::DiscretizeError;
use crate::lowering::mpcc::Mpcc;
use crate::project::clock::Instant;
use crate::project::watch::{Counted, Watch};
use crate::report::{
    Certificate, Confirmation, Failure, Kind, Method, Optimum, Seconds, Stationarity, Stats,
    Status, Trajectory, Warning, Way,
};
use crate::simulate::{self, Request};
use crate::system::System;
use crate::system::experiment::{OPTIMIZER, Optimize, Settings};

pub use crate::optimize::start::guess::Sampled;
pub use crate::optimize::start::transfer::Point;
use crate::optimize::start::{Begin, Start};
pub use prepared::{PrepareError, Prepared, SolveError};
use problem::Given;
pub(crate) use problem::Problem;
pub use progress::Progress;
pub use receding::Plan;

/// A solved task.
pub struct Solved<'e> {
    /// What was found.
    pub trajectory: Trajectory,
    /// The system with the values that were found: controls are functions of time.
    pub system: System<'e>,
    /// What was found, for programs of other lowerings.
    pub point: Point,
    /// The point of the program.
    w: Vec<f64>,
}

/// Solves the task of a system; `sampled` are trajectories to start from, the last one counts most.
pub fn run<'e>(
    system: &System<'e>,
    settings: &Settings<'e>,
    task: &Optimize<'e>,
    sampled: &[Sampled],
    request: &Request,
    watch: &mut dyn Watch,
) -> Result<Solved<'e>, DiscretizeError> {
    let start = Start::Task(sampled);
    let solved = run_from(system, settings, task, start, request, watch)?;
    Ok(solved.expect("a task has a start"))
}

/// Solves the task again in another lowering of switches, from a solution in the branch that it is in; none where the
/// two programs have no points in common.
pub fn resume<'e>(
    system: &System<'e>,
    settings: &Settings<'e>,
    task: &Optimize<'e>,
    point: &Point,
    request: &Request,
    watch: &mut dyn Watch,
) -> Result<Option<Solved<'e>>, DiscretizeError> {
    let mut task = task.clone();
    if task.discretization.refines {
        let [elements, nodes] = point.grid();
        task.discretization.elements = elements;
        task.discretization.scheme.1 = nodes;
    }
    let start = Start::Point(point);
    run_from(system, settings, &task, start, request, watch)
}

fn run_from<'e>(
    system: &System<'e>,
    settings: &Settings<'e>,
    task: &Optimize<'e>,
    start: Start<'_>,
    request: &Request,
    watch: &mut dyn Watch,
) -> Result<Option<Solved<'e>>, DiscretizeError> {
    let started = Instant::now();
    let mut problem = Problem::new(system, settings, task, Given::Numbers)?;
    let limit = &request.limit;
    let begin = match start {
        Start::Task(sampled) => nested::begin(&problem, sampled, limit, watch),
        start => problem.begin(start, limit),
    };
    Ok(begin.map(|begin| problem.outcome(begin, started, watch)))
}

/// Simulates with what was found, unless it is known already that this fails.
fn simulate_again(
    problem: &Problem,
    solution: &Solution,
    in_other_mode: Option<&Failure>,
    limit: &Limit,
    trajectory: &mut Trajectory,
) {
    match in_other_mode {
        None | Some(Failure::OtherMode { .. } | Failure::NotOptimal { .. }) => {
            checks::simulated::simulate(problem, solution, limit, trajectory);
        }
        Some(failure) if failure.is_over() => {}
        Some(failure) => {
            let warning = checks::simulated::unfinished(&problem.settings, Some(failure));
            trajectory.warnings.push(warning);
        }
    }
}

/// The program of a task, with the point to start from as its guess.
pub fn program<'e>(
    system: &System<'e>,
    settings: &Settings<'e>,
    task: &Optimize<'e>,
    sampled: &[Sampled],
) -> Result<Mpcc<'e>, DiscretizeError> {
    let mut problem = Problem::new(system, settings, task, Given::Numbers)?;
    let (guess, _) = problem.start(sampled, &Limit::default());
    problem.mpcc.set_guess(&guess);
    Ok(problem.mpcc)
}

impl<'e> Problem<'e> {
    /// What is found from a start that has been made ready since an instant, with what simulations say of it.
    fn outcome(&mut self, begin: Begin, started: Instant, watch: &mut dyn Watch) -> Solved<'e> {
        let solved = Duration::from_secs_f64(begin.before.seconds);
        let built = started.elapsed().saturating_sub(solved);
        let analyzed = self.analyses.made();
        let watch: &mut dyn Watch = &mut Counted::new(watch);
        let Begin { options, .. } = &begin;
        let limit = &options.limit;
        let (found, mut solution, way) = found(self, &begin, watch);
        let has_other_modes =
            solution.is_feasible() && branches::has_other_modes(self, &solution.w);
        let in_other_mode = match has_other_modes {
            true => branches::settle(self, &mut solution, options, limit, watch),
            false => None,
        };
        let mut before = begin.before.clone();
        before.push(&solution, way);
        solution.stats.iterations = before.iterations;
        let (mut grids, mut ways) = (Vec::new(), before.ways);
        let (confirmation, elsewhere) = match solution.is_feasible() && in_other_mode.is_none() {
            true => grid::confirm(self, &mut solution, options, (&mut grids, &mut ways), watch),
            false => (Confirmation::None, None),
        };
        let seconds = (started.elapsed() - built).as_secs_f64();
        let solution = &solution;
        let (system, mut trajectory) = self.described(solution);
        trajectory
            .warnings
            .extend(unfinished_starts(&self.settings, &begin, &found));
        trajectory.warnings.extend(
            elsewhere.map(|objective| checks::simulated::elsewhere(&self.settings, objective)),
        );
        let values = duals::values(self, solution, options);
        trajectory.optimum = Some(Optimum {
            values,
            factor_entries: solution.stats.factor_entries,
            analyses: self.analyses.made() - analyzed,
            starts: found.solutions.len(),
            spread: found.spread(),
            median_s: median(found.solutions.iter().map(|s| s.stats.seconds)),
            seconds: Seconds {
                build: built.as_secs_f64(),
                certificates: (found.solutions.iter())
                    .map(|solution| solution.stats.certificate_seconds)
                    .sum(),
                check: 0.0,
            },
            branches: solution.others,
            confirmation,
            grids,
            ways,
            ..Optimum::default()
        });
        trajectory.quality.stats.solve_s = seconds;
        if solution.is_feasible() {
            let other = in_other_mode.as_ref();
            simulate_again(self, solution, other, limit, &mut trajectory);
        }
        trajectory.failure = failure::of(self, solution)
            .or(in_other_mode)
            .or(checks::simulated::confirmation(self, &trajectory));
        match &trajectory.failure {
            Some(failure) => trajectory.status = failure.status(),
            // Where there is a failure or a better minimum, another guess is advised already; one solution after another is
            // not looked at.
            None if elsewhere.is_none() && !begin.is_solved_before => {
                let left = checks::idle::left_alone(self, &trajectory, &solution.w, limit);
                trajectory.warnings.extend(left);
            }
            None => {}
        }
        Solved {
            point: self.point(&solution.w),
            w: solution.w.clone(),
            trajectory,
            system,
        }
    }

    /// A solution as a trajectory, of a system that has nothing left to decide.
    fn described(&self, solution: &Solution) -> (System<'e>, Trajectory) {
        let mut solved = checks::solved::system(self, &solution.w);
        solved.states.truncate(self.system.n_model_states());
        let mut trajectory = record::trajectory(self, &solved, &solution.w);
        describe(self, solution, &mut trajectory);
        trajectory.warnings.extend(simulate::sampled(&solved));
        (solved, trajectory)
    }
}

/// What all starts lead to, and the best of it with its way. Where a program has no solution before, and they all lose
/// theirs, it begins again at a simulation.
fn found(
    problem: &mut Problem,
    begin: &Begin,
    watch: &mut dyn Watch,
) -> (MultiStart, Solution, Way) {
    let found = start::solve(problem, begin, watch);
    let best = found.best;
    let best = best.unwrap_or_else(|| least_violated(&found.solutions));
    let solution = found.solutions[best].clone();
    let is_lost = !solution.is_feasible() && !begin.is_solved_before;
    let other = is_lost
        .then(|| checks::confirm::from_simulation(problem, &solution, begin, watch))
        .flatten();
    match other {
        Some(other) => (found, other, Way::Simulation),
        None => (found, solution, begin.before.next()),
    }
}

/// That the run had to end before all starts were done, where some start led to a solution.
fn unfinished_starts(settings: &Settings, begin: &Begin, found: &MultiStart) -> Option<Warning> {
    let asked = begin.starts?.count;
    let done = found.solutions.iter();
    let done = done.filter(|solution| !matches!(solution.status, mpcc::Status::Over(_)));
    let done = done.count();
    let why = match begin.options.limit.over() {
        Some(Over::Canceled) => "the run was canceled",
        _ => "the time limit was reached",
    };
    (found.best.is_some() && done < asked).then(|| Warning {
        code: "W0718".into(),
        message: format!("{why} after {done} of {asked} starts"),
        span: Some(settings.span),
    })
}

/// Where no start led to a feasible point, the one that came closest.
fn least_violated(solutions: &[Solution]) -> usize {
    let size = |i: &usize| {
        let residuals = &solutions[*i].residuals;
        residuals.violation.max(residuals.complementarity)
    };
    let closest = (0..solutions.len()).min_by(|i, j| size(i).total_cmp(&size(j)));
    closest.expect("there is a start")
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// What the solver says about its solution.
fn describe(problem: &Problem, solution: &Solution, trajectory: &mut Trajectory) {
    let Problem { task, settings, .. } = problem;
    let grid = &task.discretization;
    let (family, nodes) = grid.scheme;
    let formulation = problem.dcs.lowering.formulation.word();
    let lowering = match &problem.frozen {
        Some(_) => format!("timefreezing, {formulation}"),
        None if settings.takes_impulses() => format!("impact, {formulation}"),
        None => formulation.to_owned(),
    };
    trajectory.setup.experiment = settings.name.clone();
    trajectory.setup.model = settings.model.clone();
    trajectory.setup.kind = Kind::Optimize;
    trajectory.status = Status::Solved;
    trajectory.objective = solution.objective.is_finite().then_some(solution.objective);
    let method = Method {
        name: OPTIMIZER.into(),
        ..Method::default()
    };
    trajectory.setup.method = method
        .word("scheme", format!("{}({nodes})", family.word()))
        .count("intervals", grid.intervals)
        .count("elements", grid.elements)
        .word("lowering", lowering)
        .count("variables", problem.program.n_variables())
        .count("rows", problem.program.n_rows())
        .count("pairs", problem.mpcc.sizes().pairs);
    trajectory.quality.certificate = Certificate {
        stationarity: Stationarity::of(solution.class, solution.b_stationary),
        max_violation: solution.residuals.violation,
    };
    trajectory.quality.stats = Stats {
        steps: (grid.intervals * grid.elements) as u64,
        newton_iterations: solution.stats.iterations as u64,
        homotopy_steps: solution.stats.relaxed as u64,
        complementarity_residual: solution.residuals.complementarity,
        ..Stats::default()
    };
    trajectory.setup.skipped = problem.system.provenance.skipped.clone();
}

/// What a failure of the discretization means for a run.
pub fn refused(error: &DiscretizeError, settings: &Settings) -> Failure {
    failure::refused(error, settings)
}
