//! Parameters of a model from measurements.
//!
//! minimize Σ_k ρ(w_k (q_k(t_k; p) - y_k))   over free p and free x(0), within bounds
//!
//! It is a loop over runs of an experiment that is compiled once (`runs`): each gives r with its derivatives through every
//! event, and `nsd_solver::optimization::least_squares` takes the steps. What is found is run once more, as any simulation
//! is, and told with what the data say of it (`statistics`, `found`).

mod found;
mod runs;
mod single;
mod statistics;

use nsd_solver::optimization::least_squares::{self, Fitted, Status};

use runs::{Runs, Way};

use crate::Compiled;
use crate::diagnostics::Diagnostics;
use crate::limit::{Limit, Over};
use crate::project::watch::{Progress, Watch};
use crate::report::{Failure, Kind, Trajectory};
use crate::simulate::Request;
use crate::source::Span;
use crate::system::experiment;

/// Objectives that differ by less than this are one; as for several starts of an optimization.
const SAME: f64 = 1e-6;

/// What has come of all starts.
struct Searched {
    /// The best of them.
    best: Option<(Fitted, Way)>,
    starts: usize,
    /// Whether it had to end before all starts were tried.
    is_over: bool,
    /// Starts whose runs fail.
    failed: usize,
    /// Starts that lead to the best objective.
    n_best: usize,
}

/// Fits an experiment that has been compiled with its free parameters open; afterwards the system has what was found.
///
/// # Errors
///
/// Where a run is not differentiated by something that is free.
pub(crate) fn run<'e>(
    compiled: &mut Compiled<'e>,
    fit: &experiment::Fit<'e>,
    request: &Request,
    watch: &mut dyn Watch,
) -> Result<Trajectory, Diagnostics> {
    let mut runs = Runs::new(compiled, fit, &request.limit)?;
    let searched = search(&mut runs, fit, watch);
    let point = match &searched.best {
        Some((best, _)) => best.point.clone(),
        None => runs.guess(),
    };
    // Where no start leads anywhere, the run of the first says why. What was found is run whatever the limit of the search.
    let over = request.limit.over();
    let last = match &searched.best {
        Some(_) if over.is_some() => &Request {
            limit: Limit::default(),
            ..request.clone()
        },
        _ => request,
    };
    let mut trajectory = runs.told(compiled, &point, last, watch);
    trajectory.setup.kind = Kind::Fit;
    let Some((best, way)) = &searched.best else {
        if trajectory.failure.is_none() {
            let what = "where the search begins, derivatives of the run are not known, or squares of weighted differences are beyond the range of numbers".to_owned();
            trajectory.fails(Failure::NotFitted {
                what,
                is_limit: false,
                span: compiled.settings.span,
            });
        }
        return Ok(trajectory);
    };
    let mut found = found::told(&runs, fit, best, &searched);
    trajectory.warnings.extend(found::warnings(&found, fit));
    trajectory.warnings.extend(way.warnings(fit));
    trajectory.objective = Some(best.cost);
    let unfinished = over.filter(|_| searched.is_over || best.status == Status::Over);
    if trajectory.failure.is_none()
        && let Some(failure) = failure(best, fit, &trajectory, (compiled.settings.span, unfinished))
    {
        trajectory.fails(failure);
    }
    if best.status != Status::Solved {
        found.withholds_errors();
    }
    trajectory.several.fit = Some(found);
    Ok(trajectory)
}

/// Lets the runs of a fit be differentiated by those free numbers alone that they depend on, where some other run does.
pub(crate) fn share(compiled: &mut Compiled<'_>) {
    let needed = |run: &Compiled<'_>| -> Vec<String> {
        let sensed = run.settings.recording.sensed.iter();
        let needed = sensed.filter(|sensed| {
            let params = || run.system.exogenous.params.iter().map(|param| param.var);
            match sensed.is_initial {
                true => run
                    .system
                    .states
                    .iter()
                    .any(|state| state.var == sensed.var),
                false => params().any(|var| var == sensed.var),
            }
        });
        needed.map(|sensed| sensed.name.clone()).collect()
    };
    let of_runs = [&*compiled].into_iter().chain(&compiled.others);
    let of_runs: Vec<Vec<String>> = of_runs.map(needed).collect();
    let share_one = |(at, run): (usize, &mut Compiled<'_>)| {
        let has_others = |name: &String| of_runs.iter().flatten().any(|known| known == name);
        let is_needed = |name: &String| of_runs[at].contains(name);
        if !of_runs[at].is_empty() {
            let sensed = &mut run.settings.recording.sensed;
            sensed.retain(|sensed| is_needed(&sensed.name) || !has_others(&sensed.name));
        }
    };
    let mut others = std::mem::take(&mut compiled.others);
    share_one((0, compiled));
    (1..).zip(&mut others).for_each(share_one);
    compiled.others = others;
}

/// The best minimum of all starts; those that come later are told apart from the first by seed and number only.
fn search(runs: &mut Runs<'_, '_>, fit: &experiment::Fit<'_>, watch: &mut dyn Watch) -> Searched {
    let n_starts = fit.starts.map_or(1, |starts| starts.count);
    let bounds = runs.bounds();
    let mut searched = Searched {
        best: None,
        starts: 0,
        is_over: false,
        failed: 0,
        n_best: 0,
    };
    let mut costs = Vec::new();
    for number in 0..n_starts {
        if number > 0 && least_squares::Residuals::is_over(runs) {
            searched.is_over = true;
            break;
        }
        watch.progress(&Progress::Runs {
            done: number,
            runs: n_starts,
        });
        searched.starts += 1;
        let start = runs.start(number as u64, fit.starts.as_ref());
        let found = least_squares::solve(runs, &start, &bounds, fit.loss);
        let way = runs.take_way();
        let Some(found) = found else {
            searched.failed += 1;
            continue;
        };
        costs.push(found.cost);
        let is_better = |(best, _): &(Fitted, _)| found.cost < best.cost;
        if searched.best.as_ref().is_none_or(is_better) {
            searched.best = Some((found, way));
        }
    }
    if let Some((best, _)) = &searched.best {
        // Sums below what is not known of r are alike.
        let most = best.cost * (1.0 + SAME) + best.at.noise.powi(2);
        searched.n_best = costs.iter().filter(|cost| **cost <= most).count();
    }
    searched
}

/// Why what was found is not known to be a minimum.
fn failure(
    best: &Fitted,
    fit: &experiment::Fit<'_>,
    trajectory: &Trajectory,
    (span, unfinished): (Span, Option<Over>),
) -> Option<Failure> {
    let far = |why: &str| {
        let offset = best.offset;
        format!(
            "{why}, and the linear model has its minimum up to {offset:.1e} standard errors from here"
        )
    };
    if let Some(over) = unfinished {
        let time = trajectory.samples.time.last().copied().unwrap_or(0.0);
        return Some(Failure::over(over, time, span));
    }
    let what = match best.status {
        Status::Solved | Status::Over => return None,
        Status::Flat(None) => {
            "nothing measured changes to first order with what is free, and residuals are not small"
                .to_owned()
        }
        Status::Flat(Some(at)) => format!(
            "nothing measured changes to first order with `{}`, and the sum of squares is smaller away from here",
            fit.sensed[at].name
        ),
        Status::IterationLimit => far("the limit of iterations was reached"),
        Status::Stalled => far("no step makes the sum of squares smaller"),
    };
    Some(Failure::NotFitted {
        what,
        is_limit: best.status == Status::IterationLimit,
        span,
    })
}
