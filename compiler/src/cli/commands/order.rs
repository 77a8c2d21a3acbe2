//! `nsdc order`

use std::path::{Path, PathBuf};

use crate::cli::args::OrderArgs;
use crate::cli::files::{Sink, is_standard};
use crate::cli::progress::Bar;
use crate::cli::project::Project;
use crate::cli::{Exit, Streams, files, io, project};
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::project::clock::Clock;
use crate::project::replace_settings;
use crate::study::order;
use crate::study::order::{Progress, Road, Study};
use crate::syntax::{Bind, Experiment, ExperimentKind, ExperimentSetting, SettingKind};
use crate::system::experiment::{ExperimentError, MethodKind};
use crate::{Compiled, compile};

/// Measures the errors of all methods for one experiment.
pub fn run(args: &OrderArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    if !files::foresee(args.csv.as_deref(), streams)? {
        return Ok(Exit::Wrong);
    }
    let Some((mut project, overrides)) = project::open(&args.file, &args.set, streams)? else {
        return Ok(Exit::Wrong);
    };
    let mut experiment =
        project::selected_one(&project, args.experiment.as_deref(), "order", streams)?;
    let Some(experiment) = &mut experiment else {
        return Ok(Exit::Wrong);
    };

    // A method that changes the system would change it for all.
    let changes = |setting: &ExperimentSetting| match &setting.kind {
        SettingKind::Method { name, .. } => {
            MethodKind::named(&name.name).is_some_and(MethodKind::is_without_switches)
        }
        _ => false,
    };
    if experiment.settings.iter().any(changes) {
        project.replace_setting(experiment, "order", "method auto");
    }
    let forms = Forms::of(&mut project, experiment);

    let exprs = Exprs::new();
    let mut diags = Diagnostics::new();
    let compiled = forms.compiled(&exprs, &project, &overrides, &mut diags);
    let failed = diags.has_errors();
    project::print(&diags, &project.sources, streams)?;
    let Some(compiled) = compiled.filter(|_| !failed) else {
        return Ok(Exit::Wrong);
    };
    let lowered = match jumps(&compiled) {
        true => forms.lowered(&exprs, &project, &overrides),
        false => Vec::new(),
    };
    let lowered: Vec<order::Lowered> = (lowered.iter())
        .map(|(road, lowered)| (*road, lowered.as_ref().map_err(Clone::clone)))
        .collect();

    let mut bar = Bar::new(&compiled.settings.name, streams.meter.clone());
    let mut watch = |progress: Progress| {
        let Progress { name, knob, done } = progress;
        bar.show(done, || format!("{name}, {knob:.1e}"));
    };
    let (sources, limit) = (&project.sources, args.time_limit);
    let study = order::study(&compiled, &lowered, sources, limit, &mut watch);
    drop(bar);
    let study = match study {
        Ok(study) => study,
        Err(failure) => {
            writeln!(
                streams.err,
                "error: there is nothing to measure errors against\n  {failure}\n  \
                 help: give the exact state, `expect x at end ~ .. within ..;`"
            )?;
            return Ok(Exit::Failed);
        }
    };
    match write(&study, args, streams)? {
        false => Ok(Exit::Wrong),
        true if study.has_errors() => Ok(Exit::Success),
        true => Ok(Exit::Failed),
    }
}

/// An experiment as it stands, by events, and for the methods and lowerings that have systems of their own where states
/// jump.
struct Forms {
    own: Experiment,
    automatic: Experiment,
    roads: Vec<(Road, Experiment)>,
}

impl Forms {
    fn of(project: &mut Project, experiment: &Experiment) -> Self {
        let mut automatic = experiment.clone();
        project.replace_setting(&mut automatic, "order", "method auto");
        let lowers = |setting: &ExperimentSetting| matches!(setting.kind, SettingKind::Lower(_));
        let road = |road: Road| {
            let mut other = experiment.clone();
            other.settings.retain(|setting| !lowers(setting));
            for words in road.settings() {
                let found = (&mut project.sources, &mut project.diags);
                replace_settings(found, &mut other, "order", words);
            }
            (road, other)
        };
        let roads = Road::ALL.into_iter().map(road).collect();
        let own = experiment.clone();
        Forms {
            own,
            automatic,
            roads,
        }
    }

    /// The system that errors are measured in.
    fn compiled<'e>(
        &self,
        exprs: &'e Exprs,
        project: &Project,
        overrides: &[Bind],
        diags: &mut Diagnostics,
    ) -> Option<Compiled<'e>> {
        let (file, mut clock) = (&project.file, Clock::default());
        let mut compiled = compile(exprs, file, &self.own, overrides, &mut clock, diags);
        let steps = |compiled: &Compiled| !compiled.system.jumps.impulsive.is_empty();
        if compiled.as_ref().is_some_and(steps) {
            compiled = compile(exprs, file, &self.automatic, overrides, &mut clock, diags);
        }
        if self.own.kind != ExperimentKind::Simulate && !diags.has_errors() {
            let (name, span) = (self.own.name.name.clone(), self.own.name.span);
            let what = "`nsdc order`";
            diags.push(ExperimentError::NotSimulated { name, what, span });
        }
        compiled
    }

    /// Those of the roads, or why there are none.
    fn lowered<'e>(
        &self,
        exprs: &'e Exprs,
        project: &Project,
        overrides: &[Bind],
    ) -> Vec<(Road, Result<Compiled<'e>, String>)> {
        let lowered = self.roads.iter().map(|(road, experiment)| {
            let (mut diags, mut clock) = (Diagnostics::new(), Clock::default());
            let file = &project.file;
            let lowered = compile(exprs, file, experiment, overrides, &mut clock, &mut diags);
            let lowered = lowered.filter(|_| !diags.has_errors());
            let reason = || diags.errors().next().map(ToString::to_string);
            (*road, lowered.ok_or_else(|| reason().unwrap_or_default()))
        });
        lowered.collect()
    }
}

/// Whether states jump or relays switch.
fn jumps(compiled: &Compiled) -> bool {
    let system = &compiled.system;
    system.jumps.first_jump().is_some() || system.switches.iter().any(|k| k.relay.is_some())
}

/// The table, or CSV in its place, and the figures; whether all could be written.
fn write(study: &Study, args: &OrderArgs, streams: &mut Streams<'_>) -> io::Result<bool> {
    let csv = args.csv.as_deref();
    let tables = !csv.is_some_and(is_standard);
    if tables {
        streams.out.write_all(order::text(study).as_bytes())?;
    }
    let prefix = match &args.plot {
        Some(prefix) => prefix.clone(),
        None => PathBuf::from(&study.experiment),
    };
    let figures = [
        ("error-step", study.error_step()),
        ("error-time", study.error_time()),
    ];
    let figures = figures.map(|(what, svg)| (named(&prefix, what), svg));
    let csv = csv.map(|path| (path.to_owned(), order::csv(study)));
    let mut all_written = true;
    for (path, text) in csv.into_iter().chain(figures) {
        let is_written = Sink::with(&path, text).finish(streams)?;
        if is_written && tables {
            writeln!(streams.out, "  {}", path.display())?;
        }
        all_written &= is_written;
    }
    Ok(all_written)
}

/// `results/crossing` becomes `results/crossing.error-step.svg`.
fn named(prefix: &Path, what: &str) -> PathBuf {
    let mut name = prefix.as_os_str().to_owned();
    name.push(format!(".{what}.svg"));
    PathBuf::from(name)
}
