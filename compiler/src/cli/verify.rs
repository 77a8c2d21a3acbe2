//! `nsdc verify`

use std::time::Duration;

use super::args::VerifyArgs;
use super::launch::launch;
use super::progress::Bar;
use super::project::{self, Project};
use super::watch::Watching;
use super::{Exit, Streams, io};
use crate::clock::Clock;
use crate::compile;
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::report::Trajectory;
use crate::report::roads::{self, Road, Roads};
use crate::simulate::Request;
use crate::syntax::{Bind, Experiment, ExperimentKind, SettingKind};

/// Methods with their lowerings. All choose their own steps.
const ROADS: [&str; 7] = [
    "event",
    "fesd",
    "fesd; lower stewart",
    "fesd; lower step",
    "event; lower timefreezing",
    "fesd; lower timefreezing",
    "fesd; lower impact",
];

/// Runs experiments by events, and by finite elements with every lowering that takes them, and compares the ends.
pub fn run(args: &VerifyArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let Some((mut project, overrides)) = Project::open(&args.file, &args.set, streams)? else {
        return Ok(Exit::Wrong);
    };
    let Some(experiments) = project.selected(args.experiment.as_deref(), streams)? else {
        return Ok(Exit::Wrong);
    };
    let mut exit = Exit::Success;
    for (number, experiment) in experiments.iter().enumerate() {
        if number > 0 {
            writeln!(streams.out)?;
        }
        exit = exit.max(one(&mut project, experiment, &overrides, args, streams)?);
        // A long run shows where it is.
        streams.out.flush()?;
    }
    Ok(exit)
}

fn one(
    project: &mut Project,
    experiment: &Experiment,
    overrides: &[Bind],
    args: &VerifyArgs,
    streams: &mut Streams<'_>,
) -> io::Result<Exit> {
    let (name, model) = (&experiment.name.name, &experiment.model.head.name);
    if experiment.kind == ExperimentKind::Optimize {
        writeln!(
            streams.out,
            "{name} of {model}: an optimum, not compared; `nsdc run` simulates its controls"
        )?;
        return Ok(Exit::Success);
    }
    if smooths(experiment) {
        writeln!(
            streams.out,
            "{name} of {model}: smoothing changes the model, not compared"
        )?;
        return Ok(Exit::Success);
    }
    // As it is written; what is wrong with that is wrong with the experiment.
    let written = match ride(project, experiment, overrides, args.time_limit, streams) {
        Ok(trajectory) => trajectory,
        Err(diags) => {
            project::print(&diags, &project.sources, streams)?;
            return Ok(Exit::Wrong);
        }
    };
    let mut found = Diagnostics::new();
    if let Some(failure) = &written.failure {
        found.push(failure.clone());
    }
    project::print(&found, &project.sources, streams)?;
    let mut all = vec![Road {
        name: format!("as written, {}", written.method.name),
        run: Ok(Box::new(written)),
    }];
    for words in ROADS {
        let mut other = experiment.clone();
        let lowers = |kind: &SettingKind| matches!(kind, SettingKind::Lower(_));
        other.settings.retain(|setting| !lowers(&setting.kind));
        let settings = format!("method {words}");
        if project
            .replace_setting(&mut other, "verify", &settings)
            .is_none()
        {
            continue;
        }
        let name = words.replace(';', ",");
        let run = match ride(project, &other, overrides, args.time_limit, streams) {
            Err(diags) => Err(project::error_codes(&diags).join(", ")),
            Ok(run) => {
                let is_known = all.iter().any(|road| {
                    let known = road.run.as_ref();
                    known.is_ok_and(|known| known.method == run.method)
                });
                if is_known {
                    continue;
                }
                Ok(Box::new(run))
            }
        };
        all.push(Road { name, run });
    }
    let all = Roads {
        experiment: name.clone(),
        model: model.clone(),
        tolerance: args.tolerance,
        roads: all,
    };
    streams.out.write_all(roads::text(&all).as_bytes())?;
    Ok(match all.agree() {
        true => Exit::Success,
        false => Exit::Failed,
    })
}

/// Whether an experiment runs another model than the one that is written.
fn smooths(experiment: &Experiment) -> bool {
    let mut settings = experiment.settings.iter();
    settings.any(|setting| match &setting.kind {
        SettingKind::Method { name, .. } => name.name == "smoothing",
        _ => false,
    })
}

/// The trajectory of an experiment with these settings, or why it has none.
fn ride(
    project: &Project,
    experiment: &Experiment,
    overrides: &[Bind],
    time_limit: Option<Duration>,
    streams: &mut Streams<'_>,
) -> Result<Trajectory, Diagnostics> {
    let (exprs, mut diags) = (Exprs::new(), Diagnostics::new());
    let (file, mut clock) = (&project.file, Clock::default());
    let compiled = compile(&exprs, file, experiment, overrides, &mut clock, &mut diags);
    let Some(mut compiled) = compiled.filter(|_| !diags.has_errors()) else {
        return Err(diags);
    };
    let request = Request {
        dense: false,
        estimate: true,
        multipliers: false,
        time_limit,
    };
    let bar = Bar::new(&compiled.settings.name, streams.progress);
    launch(project, &mut compiled, &request, &mut Watching::new(bar))
}
