//! Parameters of a model from measurements.
//!
//! minimize Σ_k ρ(w_k (q_k(t_k; p) - y_k))   over free p and free x(0), within bounds
//!
//! It is a loop over runs of an experiment that is compiled once (`runs`): each gives r with its derivatives through every
//! event, and `nsd_solver::optimization::least_squares` takes the steps. What is found is run once more, as any simulation
//! is, and told with what the data say of it (`statistics`, `found`).

mod found;
mod runs;
mod statistics;

use nsd_solver::optimization::least_squares::{self, Fitted, Status};

use runs::{Runs, Way};

use crate::Compiled;
use crate::diagnostics::Diagnostics;
use crate::project::watch::{Progress, Watch};
use crate::report::{Failure, Kind, Trajectory};
use crate::simulate::Request;
use crate::system::experiment;

/// Objectives that differ by less than this are one; as for several starts of an optimization.
const SAME: f64 = 1e-6;

/// What has come of all starts.
struct Searched {
    /// The best of them.
    best: Option<(Fitted, Way)>,
    starts: usize,
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
    // Where no start leads anywhere, the run of the first says why.
    let mut trajectory = runs.told(compiled, &point, request, watch);
    trajectory.setup.kind = Kind::Fit;
    let Some((best, way)) = &searched.best else {
        if trajectory.failure.is_none() {
            let what = "derivatives of the run are not known where the search begins".to_owned();
            trajectory.fails(Failure::NotFitted {
                what,
                is_limit: false,
                span: compiled.settings.span,
            });
        }
        return Ok(trajectory);
    };
    let found = found::told(&runs, fit, (best, way), &searched);
    trajectory.warnings.extend(found::warnings(&found, fit));
    trajectory.warnings.extend(way.warnings(fit));
    trajectory.objective = Some(best.cost);
    if trajectory.failure.is_none()
        && let Some(failure) = failure(best, &trajectory, compiled, request)
    {
        trajectory.fails(failure);
    }
    trajectory.several.fit = Some(found);
    Ok(trajectory)
}

/// The best minimum of all starts; those that come later are told apart from the first by seed and number only.
fn search(runs: &mut Runs<'_, '_>, fit: &experiment::Fit<'_>, watch: &mut dyn Watch) -> Searched {
    let n_starts = fit.starts.map_or(1, |starts| starts.count);
    let bounds = runs.bounds();
    let mut searched = Searched {
        best: None,
        starts: 0,
        failed: 0,
        n_best: 0,
    };
    let mut costs = Vec::new();
    for number in 0..n_starts {
        if number > 0 && least_squares::Residuals::is_over(runs) {
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
    let best = costs.iter().copied().fold(f64::INFINITY, f64::min);
    let is_best = |cost: &&f64| **cost <= best + SAME * best.abs();
    searched.n_best = costs.iter().filter(is_best).count();
    searched
}

/// Why what was found is not known to be a minimum.
fn failure(
    best: &Fitted,
    trajectory: &Trajectory,
    compiled: &Compiled<'_>,
    request: &Request,
) -> Option<Failure> {
    let span = compiled.settings.span;
    let what = match best.status {
        Status::Solved => return None,
        Status::Over => {
            let time = trajectory.samples.time.last().copied().unwrap_or(0.0);
            let over = request.limit.over()?;
            return Some(Failure::over(over, time, span));
        }
        Status::IterationLimit => "the limit of iterations was reached",
        Status::Stalled => "no step makes the sum of squares smaller",
    };
    Some(Failure::NotFitted {
        what: format!(
            "{what}, and residuals are not orthogonal to what parameters change: the cosine is {:.1e}",
            best.gradient
        ),
        is_limit: best.status == Status::IterationLimit,
        span,
    })
}
