//! A simulation by events, and by finite elements with every lowering.

use std::borrow::Cow;

use super::{Subject, Verified, exit, is_idle, refusal};
use crate::cli::progress::Bar;
use crate::cli::project::{self, Project};
use crate::cli::watch::Watching;
use crate::cli::{Streams, io};
use crate::compile;
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::project::clock::Clock;
use crate::project::launch::launch;
use crate::report::roads::{self, Refusal, Road, Roads};
use crate::report::{Failure, Trajectory};
use crate::syntax::Experiment;
use crate::system::experiment::{Lowering, Method, MethodKind, Sampling};

/// The methods that locate switches in the model as it is, with their lowerings. All choose their own steps.
fn roads() -> impl Iterator<Item = (MethodKind, Option<Lowering>)> {
    const METHODS: [MethodKind; 2] = [MethodKind::Event, MethodKind::Fesd];
    let plain = METHODS.map(|method| (method, None));
    let lowered = Lowering::ALL.into_iter().flat_map(|lowering| {
        let takes = move |method: &MethodKind| method.takes_lowering(lowering);
        let methods = METHODS.into_iter().filter(takes);
        methods.map(move |method| (method, Some(lowering)))
    });
    plain.into_iter().chain(lowered)
}

/// The parts of the horizon at whose ends runs are compared, where the experiment reports no instants of its own: a
/// number that shares few factors with those of models.
const INSTANTS: f64 = 97.0;

/// Runs an experiment on all roads; nothing where it is wrong as it is written, which has been printed.
pub fn verify(
    project: &mut Project,
    subject: &Subject<'_>,
    streams: &mut Streams<'_>,
) -> io::Result<Option<Verified>> {
    let experiment = subject.experiment;
    // As it is written; what is wrong with that is wrong with the experiment.
    let written = match ride(project, experiment, subject, streams) {
        Ok(ridden) => ridden.expect("it is a road of its own"),
        Err(diags) => {
            project::print(&diags, &project.sources, streams)?;
            return Ok(None);
        }
    };
    let Ridden {
        run: written,
        branches,
    } = written;
    let mut found = Diagnostics::new();
    if let Some(failure) = &written.failure {
        found.push(failure.clone());
    }
    project::print(&found, &project.sources, streams)?;
    let mut all = vec![Road {
        name: format!("as written, {}", written.setup.method.name),
        run: Ok(Box::new(written)),
    }];
    for (method, lowering) in roads().take_while(|_| !subject.cancel.is_canceled()) {
        let lowering = lowering.map(|lowering| format!("; lower {}", lowering.word()));
        let words = format!("{}{}", method.word(), lowering.unwrap_or_default());
        let Some(mut other) = project.on_road(experiment, "verify", &format!("method {words}"))
        else {
            continue;
        };
        let name = words.replace(';', ",");
        let run = match ride_or_forget(project, &mut other, subject, streams) {
            Err(diags) => Err(refusal(&diags)),
            // Where a lowering finds nothing, the method is that without it, and would confirm itself.
            Ok(None) => continue,
            Ok(Some(ridden)) => {
                let is_known = all.iter().any(|road| {
                    let known = road.run.as_ref();
                    known.is_ok_and(|known| known.setup.method == ridden.run.setup.method)
                });
                if is_known {
                    continue;
                }
                judged(ridden, branches)
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

/// A run on another road, unless it ends for what that road does not know, where the experiment as it is written chooses
/// among several solutions or not.
fn judged(ridden: Ridden, branches: bool) -> Result<Box<Trajectory>, Refusal> {
    let Ridden { run, branches: own } = ridden;
    match &run.failure {
        // Time-freezing has its limits, and what the experiment chooses is not known to it.
        Some(failure @ Failure::Standstill { .. }) => Err(Refusal {
            codes: "E0726".to_owned(),
            reason: failure.to_string(),
        }),
        Some(failure @ Failure::NonUnique { .. }) if branches && !own => Err(Refusal {
            codes: "E0701".to_owned(),
            reason: format!("{failure}; the choice of `branch` is of `method event`"),
        }),
        _ => Ok(Box::new(run)),
    }
}

/// The same as [`ride`], without derivatives where a road has none: it may confirm the run.
fn ride_or_forget(
    project: &Project,
    experiment: &mut Experiment,
    subject: &Subject<'_>,
    streams: &mut Streams<'_>,
) -> Result<Option<Ridden>, Diagnostics> {
    let ridden = ride(project, experiment, subject, streams);
    let refused = ridden.as_ref().err().map(Diagnostics::error_codes);
    if refused.is_some_and(|codes| codes.iter().any(|code| code == "E0532")) {
        experiment.forget_sensed();
        return ride(project, experiment, subject, streams);
    }
    ridden
}

/// A run, and whether its experiment chooses among several solutions.
struct Ridden {
    run: Trajectory,
    branches: bool,
}

/// The trajectory of an experiment with these settings, or why it has none; nothing on another road whose lowering finds
/// nothing. What it does not report at instants of its own is reported at common ones.
fn ride(
    project: &Project,
    experiment: &Experiment,
    subject: &Subject<'_>,
    streams: &mut Streams<'_>,
) -> Result<Option<Ridden>, Diagnostics> {
    let is_written = std::ptr::eq(experiment, subject.experiment);
    let (exprs, mut diags) = (Exprs::new(), Diagnostics::new());
    let (file, mut clock) = (&project.file, Clock::default());
    let overrides = subject.overrides;
    let mut experiment = Cow::Borrowed(experiment);
    if experiment.is_sensed() {
        experiment.to_mut().open_sensed();
    }
    let compiled = compile(&exprs, file, &experiment, overrides, &mut clock, &mut diags);
    let Some(mut compiled) = compiled.filter(|_| !diags.has_errors()) else {
        return Err(diags);
    };
    if !is_written && is_idle(&compiled) {
        return Ok(None);
    }
    let request = subject.request();
    let settings = &mut compiled.settings;
    if settings.recording.sampling == Sampling::Method {
        settings.recording.sampling = Sampling::Every(settings.horizon / INSTANTS);
    }
    let branches = match &settings.numerics.method {
        Method::Event(options) => !options.branch.is_empty(),
        _ => false,
    };
    let bar = Bar::new(&settings.name, streams.meter.clone());
    let run = launch(project, &mut compiled, &request, &mut Watching::new(bar))?;
    Ok(Some(Ridden { run, branches }))
}
