//! Runs an experiment that has been compiled, whatever its kind.

use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::optimize::{self, Sampled};
use crate::project::clock::Clock;
use crate::project::sensed::{Beside, Sensor};
use crate::project::watch::{Progress, Watch};
use crate::project::{Project, ensemble, sensed};
use crate::report::Trajectory;
use crate::simulate::{self, Plan, Request};
use crate::source::Span;
use crate::study::{fit, mpc};
use crate::syntax::{GuessSource, Path};
use crate::system::experiment::{ExperimentError, Optimize};
use crate::{Compiled, compile, threads};

/// Largest file of guesses that is read, in bytes.
const MAX_BYTES: usize = 1 << 28;
/// Experiments that start from each other.
const MAX_DEPTH: usize = 8;

/// The trajectory of an experiment; of an optimization or a fit, the system is the solved one afterwards.
pub fn launch(
    project: &Project,
    compiled: &mut Compiled<'_>,
    request: &Request,
    watch: &mut dyn Watch,
) -> Result<Trajectory, Diagnostics> {
    let mut trajectory = within(project, compiled, request, watch, MAX_DEPTH)?;
    trajectory.setup.parameters = compiled.parameters();
    Ok(trajectory)
}

fn within(
    project: &Project,
    compiled: &mut Compiled<'_>,
    request: &Request,
    watch: &mut dyn Watch,
    depth: usize,
) -> Result<Trajectory, Diagnostics> {
    if let Some(fit) = compiled.settings.recording.fit.clone() {
        return fit::run(compiled, &fit, request, watch);
    }
    if let Some(closed_loop) = compiled.settings.numerics.closed_loop.clone() {
        return mpc::run((project, depth), compiled, &closed_loop, request, watch);
    }
    let (system, settings) = (&compiled.system, &compiled.settings);
    let Some(task) = &settings.optimize else {
        return simulated(compiled, request, watch);
    };
    let sampled = sampled_within(project, task, request, depth)?;
    match optimize::run(system, settings, task, &sampled, request, watch) {
        Ok(solved) => {
            compiled.system = solved.system;
            Ok(solved.trajectory)
        }
        Err(error) => {
            let mut diags = Diagnostics::new();
            diags.push(optimize::refused(&error, settings));
            Err(diags)
        }
    }
}

/// The trajectory of a simulation, with the derivatives that are asked for.
fn simulated(
    compiled: &mut Compiled<'_>,
    request: &Request,
    watch: &mut dyn Watch,
) -> Result<Trajectory, Diagnostics> {
    let mut told = |progress| watch.progress(&Progress::Simulation(progress));
    let (system, settings) = (&compiled.system, &compiled.settings);
    let sensor = sensed::sensor(compiled)?;
    let open = sensor.as_ref().map(Sensor::values).unwrap_or_default();
    let sensing = (sensor.as_ref()).and_then(|sensor| sensor.asked(settings, &open));
    let asked = (request, sensing.as_ref());
    let mut run = simulate::run_sensed(system, settings, asked, &mut told);
    sensed::check_rows(compiled, sensing.as_ref(), &run)?;
    let mut sensed = settings.recording.sensed.iter();
    if let Some(sensor) = sensor.filter(|_| sensed.any(|sensed| sensed.one_sided)) {
        let x0: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
        let plan = &mut Plan::of_method(system, settings, &sensor.opened.places);
        let beside = Beside {
            compiled,
            plan,
            sensor: &sensor,
            open: &open,
            x0: &x0,
        };
        beside.add(request, &mut run);
    }
    Ok(run)
}

/// The same with all seeds, where it has several.
pub fn whole(
    project: &Project,
    source: ensemble::Source<'_>,
    compiled: &mut Compiled<'_>,
    request: &Request,
    watch: &mut dyn Watch,
) -> Result<Trajectory, Diagnostics> {
    let mut trajectory = launch(project, compiled, request, watch)?;
    let (settings, threads) = (&compiled.settings, threads::count());
    let runs = settings.runs.unwrap_or(1);
    let mut heard = |done: usize| watch.progress(&Progress::Runs { done, runs });
    ensemble::add(
        &mut trajectory,
        source,
        settings,
        request,
        threads,
        &mut heard,
    );
    Ok(trajectory)
}

/// The trajectories that an optimization starts from; the runs of all share the limit of the request.
pub fn sampled(
    project: &Project,
    task: &Optimize<'_>,
    request: &Request,
) -> Result<Vec<Sampled>, Diagnostics> {
    sampled_within(project, task, request, MAX_DEPTH)
}

/// The same where so many experiments may still start from each other.
pub(crate) fn sampled_within(
    project: &Project,
    task: &Optimize<'_>,
    request: &Request,
    depth: usize,
) -> Result<Vec<Sampled>, Diagnostics> {
    let sources = task.sources.iter().map(|source| match source {
        GuessSource::File(name, span) => from_file(project, name, *span),
        GuessSource::Experiment(path) => from_experiment(project, path, request, depth),
    });
    sources.collect()
}

/// The states and controls of another experiment of the file.
fn from_experiment(
    project: &Project,
    path: &Path,
    request: &Request,
    depth: usize,
) -> Result<Sampled, Diagnostics> {
    let name = &path.head.name;
    let bad = |reason: &str| bad_guess(name, reason, path.span);
    let mut experiments = project.experiments();
    let Some(experiment) = experiments.find(|experiment| experiment.name.name == *name) else {
        return Err(bad("the file has no experiment of that name"));
    };
    let Some(depth) = depth.checked_sub(1) else {
        return Err(bad("experiments start from each other without end"));
    };
    let (exprs, mut diags) = (Exprs::new(), Diagnostics::new());
    let file = &project.file;
    let compiled = compile(
        &exprs,
        file,
        experiment,
        &[],
        &mut Clock::default(),
        &mut diags,
    );
    let Some(mut compiled) = compiled.filter(|_| !diags.has_errors()) else {
        return Err(diags);
    };
    let request = Request {
        dense: false,
        estimate: false,
        multipliers: false,
        limit: request.limit.clone(),
    };
    let trajectory = within(project, &mut compiled, &request, &mut (), depth)?;
    match trajectory.samples.time.len() {
        // What starts from it is late, too.
        0 | 1 if trajectory.status.is_over() => Ok(Sampled::default()),
        0 | 1 => Err(bad("its run does not leave its start")),
        _ => Ok(Sampled::of(&trajectory.samples)),
    }
}

/// What `nsdc run --json` wrote.
fn from_file(project: &Project, name: &str, span: Span) -> Result<Sampled, Diagnostics> {
    let folder = project.path.parent();
    let path = folder.map_or_else(|| name.into(), |folder| folder.join(name));
    let bytes = project.files.read(&path, MAX_BYTES);
    let bytes = bytes.map_err(|error| bad_guess(name, &error.to_string(), span))?;
    Sampled::read(&bytes).map_err(|reason| bad_guess(name, &reason, span))
}

fn bad_guess(name: &str, reason: &str, span: Span) -> Diagnostics {
    let mut diags = Diagnostics::new();
    diags.push(ExperimentError::BadGuess {
        name: name.to_owned(),
        reason: reason.to_owned(),
        span,
    });
    diags
}
