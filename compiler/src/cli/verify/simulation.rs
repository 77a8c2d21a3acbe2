//! A simulation by events, and by finite elements with every lowering.

use super::{Subject, Verified, exit};
use crate::cli::launch::launch;
use crate::cli::progress::Bar;
use crate::cli::project::{self, Project};
use crate::cli::watch::Watching;
use crate::cli::{Streams, io};
use crate::clock::Clock;
use crate::compile;
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::report::Trajectory;
use crate::report::roads::{self, Road, Roads};
use crate::syntax::Experiment;

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

/// Runs an experiment on all roads; nothing where it is wrong as it is written, which has been printed.
pub fn verify(
    project: &mut Project,
    subject: &Subject<'_>,
    streams: &mut Streams<'_>,
) -> io::Result<Option<Verified>> {
    let experiment = subject.experiment;
    // As it is written; what is wrong with that is wrong with the experiment.
    let written = match ride(project, experiment, subject, streams) {
        Ok(trajectory) => trajectory,
        Err(diags) => {
            project::print(&diags, &project.sources, streams)?;
            return Ok(None);
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
        let Some(other) = project.on_road(experiment, "verify", &format!("method {words}")) else {
            continue;
        };
        let name = words.replace(';', ",");
        let run = match ride(project, &other, subject, streams) {
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
        experiment: experiment.name.name.clone(),
        model: experiment.model.head.name.clone(),
        tolerance: subject.args.tolerance,
        roads: all,
    };
    Ok(Some(Verified {
        text: roads::text(&all),
        json: roads::json(&all),
        exit: exit(all.agree()),
    }))
}

/// The trajectory of an experiment with these settings, or why it has none.
fn ride(
    project: &Project,
    experiment: &Experiment,
    subject: &Subject<'_>,
    streams: &mut Streams<'_>,
) -> Result<Trajectory, Diagnostics> {
    let (exprs, mut diags) = (Exprs::new(), Diagnostics::new());
    let (file, mut clock) = (&project.file, Clock::default());
    let overrides = subject.overrides;
    let compiled = compile(&exprs, file, experiment, overrides, &mut clock, &mut diags);
    let Some(mut compiled) = compiled.filter(|_| !diags.has_errors()) else {
        return Err(diags);
    };
    let request = subject.request();
    let bar = Bar::new(&compiled.settings.name, streams.progress);
    launch(project, &mut compiled, &request, &mut Watching::new(bar))
}
