//! An optimum with every lowering, each from its own start and from the best point of all.

use super::{Subject, Verified, exit, is_idle, refusal};
use crate::cli::progress::Bar;
use crate::cli::project::{self, Project};
use crate::cli::watch::Watching;
use crate::cli::{Streams, io};
use crate::compile;
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::optimize::{self, Point, Sampled};
use crate::project::clock::Clock;
use crate::project::launch::sampled;
use crate::report::Trajectory;
use crate::report::roads::{self, Found, Optima, Refusal, Resumed};
use crate::syntax::Experiment;

/// Lowerings of switches, and of what jumps.
const LOWERINGS: [&str; 6] = [
    "stewart",
    "step",
    "timefreezing, stewart",
    "timefreezing, step",
    "impact, stewart",
    "impact, step",
];
/// How often a better point is taken up by all others.
const ROUNDS: usize = 3;

/// A lowering with the best point that it knows.
struct Lowered {
    experiment: Experiment,
    point: Option<(f64, Point)>,
    /// The trajectory of that point.
    trajectory: Option<Sampled>,
}

/// Where a lowering starts.
#[derive(Clone, Copy)]
enum Origin<'f> {
    /// As the experiment says.
    Start,
    /// The point of another lowering, and its trajectory for programs that have other points.
    Best(&'f Point, &'f Sampled),
}

/// What came of it.
struct Solved {
    run: Trajectory,
    point: Point,
    /// Whether it started at the same point, and not at a trajectory.
    is_same_point: bool,
}

/// Solves an experiment with all lowerings; nothing where it is wrong as it is written, which has been printed.
pub fn verify(
    project: &mut Project,
    subject: &Subject<'_>,
    streams: &mut Streams<'_>,
) -> io::Result<Option<Verified>> {
    let experiment = subject.experiment;
    let written = match solve(project, experiment, Origin::Start, subject, streams) {
        Ok(result) => result,
        Err(Refused::Wrong(diags)) => {
            project::print(&diags, &project.sources, streams)?;
            return Ok(None);
        }
        // An experiment may ask for a lowering that it has no use for.
        Err(Refused::Idle) => return Ok(None),
    };
    let mut told = Diagnostics::new();
    if let Some(failure) = &written.run.failure {
        told.push(failure.clone());
    }
    project::print(&told, &project.sources, streams)?;
    let method = &written.run.setup.method;
    let own = method.lowering().unwrap_or_default().to_owned();
    let mut all = Optima {
        experiment: experiment.name.name.clone(),
        model: experiment.model.head.name.clone(),
        tolerance: subject.args.tolerance,
        found: Vec::new(),
        best: None,
    };
    let mut lowered = Vec::new();
    add(
        &mut all,
        &mut lowered,
        (format!("as written, {own}"), experiment.clone()),
        Ok(written),
    );
    let others = LOWERINGS.into_iter().filter(|words| *words != own);
    for words in others.take_while(|_| !subject.cancel.is_canceled()) {
        let Some(other) = project.on_road(experiment, "verify", &format!("lower {words}")) else {
            continue;
        };
        let found = match solve(project, &other, Origin::Start, subject, streams) {
            Ok(found) => Ok(found),
            Err(Refused::Wrong(diags)) => Err(refusal(&diags)),
            Err(Refused::Idle) => continue,
        };
        add(&mut all, &mut lowered, (words.to_owned(), other), found);
    }
    confirm(project, &mut all, &mut lowered, subject, streams);
    Ok(Some(Verified {
        text: roads::optima_text(&all),
        json: roads::optima_json(&all),
        exit: exit(all.agree()),
    }))
}

/// Takes note of what came of a lowering.
fn add(
    all: &mut Optima,
    lowered: &mut Vec<Lowered>,
    (name, experiment): (String, Experiment),
    result: Result<Solved, Refusal>,
) {
    let mut known = Lowered {
        experiment,
        point: None,
        trajectory: None,
    };
    if let Ok(result) = &result {
        known.learn(result);
    }
    lowered.push(known);
    all.found.push(Found {
        name,
        run: result.map(|result| Box::new(result.run)),
        resumed: None,
    });
}

impl Lowered {
    /// Keeps a point that is better than the one that is known.
    fn learn(&mut self, result: &Solved) {
        let objective = result
            .run
            .objective
            .filter(|_| roads::is_feasible(&result.run));
        let Some(objective) = objective else {
            return;
        };
        if self
            .point
            .as_ref()
            .is_none_or(|(known, _)| objective < *known)
        {
            self.point = Some((objective, result.point.clone()));
            self.trajectory = Some(Sampled::of(&result.run.samples));
        }
    }
}

/// Solves with all lowerings from the best point, until none of them comes to a better one.
fn confirm(
    project: &Project,
    all: &mut Optima,
    lowered: &mut [Lowered],
    subject: &Subject<'_>,
    streams: &mut Streams<'_>,
) {
    for _ in (0..ROUNDS).take_while(|_| !subject.cancel.is_canceled()) {
        let known = lowered.iter().enumerate();
        let known = known.filter_map(|(k, lowered)| Some((k, lowered.point.as_ref()?.0)));
        let Some((best, objective)) = known.min_by(|a, b| a.1.total_cmp(&b.1)) else {
            return;
        };
        if all.best == Some(best) {
            return;
        }
        // What is as good needs no other leader.
        let is_better = all
            .objective()
            .is_none_or(|known| objective < known - all.allowed());
        if all.best.is_some() && !is_better {
            return;
        }
        all.best = Some(best);
        let leader = &lowered[best];
        let (Some((_, point)), Some(trajectory)) =
            (leader.point.clone(), leader.trajectory.clone())
        else {
            return;
        };
        for number in (0..lowered.len()).filter(|number| *number != best) {
            if all.found[number].run.is_err() {
                continue;
            }
            let from = Origin::Best(&point, &trajectory);
            let experiment = &lowered[number].experiment;
            let Ok(result) = solve(project, experiment, from, subject, streams) else {
                continue;
            };
            lowered[number].learn(&result);
            all.found[number].resumed = Some(Resumed {
                is_same_point: result.is_same_point,
                run: Box::new(result.run),
            });
        }
    }
}

/// Why a lowering has no result.
enum Refused {
    /// It does not take the experiment.
    Wrong(Diagnostics),
    /// There is nothing that it lowers.
    Idle,
}

impl From<Diagnostics> for Refused {
    fn from(diags: Diagnostics) -> Self {
        Refused::Wrong(diags)
    }
}

fn solve(
    project: &Project,
    experiment: &Experiment,
    from: Origin<'_>,
    subject: &Subject<'_>,
    streams: &mut Streams<'_>,
) -> Result<Solved, Refused> {
    let (exprs, mut diags) = (Exprs::new(), Diagnostics::new());
    let (file, mut clock) = (&project.file, Clock::default());
    let overrides = subject.overrides;
    let compiled = compile(&exprs, file, experiment, overrides, &mut clock, &mut diags);
    let Some(compiled) = compiled.filter(|_| !diags.has_errors()) else {
        return Err(Refused::Wrong(diags));
    };
    if !std::ptr::eq(experiment, subject.experiment) && is_idle(&compiled) {
        return Err(Refused::Idle);
    }
    let (system, settings) = (&compiled.system, &compiled.settings);
    let task = settings.optimize.as_ref();
    let task = task.expect("the experiment is an `optimize`");
    let request = subject.request();
    let mut watching = Watching::new(Bar::new(&settings.name, streams.meter.clone()));
    let refused = |error| {
        let mut diags = Diagnostics::new();
        diags.push(optimize::refused(&error, settings));
        diags
    };
    let (solved, is_same_point) = match from {
        Origin::Start => {
            let sampled = sampled(project, task, &request)?;
            let solved = optimize::run(system, settings, task, &sampled, &request, &mut watching);
            (solved.map_err(refused)?, true)
        }
        Origin::Best(point, trajectory) => {
            let found = optimize::resume(system, settings, task, point, &request, &mut watching);
            match found.map_err(refused)? {
                Some(solved) => (solved, true),
                None => {
                    let mut single = task.clone();
                    single.starts = None;
                    let guess = std::slice::from_ref(trajectory);
                    let found =
                        optimize::run(system, settings, &single, guess, &request, &mut watching);
                    (found.map_err(refused)?, false)
                }
            }
        }
    };
    Ok(Solved {
        run: solved.trajectory,
        point: solved.point,
        is_same_point,
    })
}
