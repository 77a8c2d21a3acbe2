//! `nsdc run`

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::cli::args::{Log, RunArgs};
use crate::cli::files::{Sink, is_standard};
use crate::cli::iterations::Iterations;
use crate::cli::progress::Bar;
use crate::cli::project::Project;
use crate::cli::watch::Watching;
use crate::cli::{Exit, Streams, files, io, project};
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::limit::Limit;
use crate::project::clock::Clock;
use crate::project::{ensemble, figure, launch};
use crate::report::forms::{csv, json, text};
use crate::report::{Status, Trajectory, Warning};
use crate::simulate::Request;
use crate::syntax::{Bind, Experiment, PlotItem, PlotKind, SettingKind};
use crate::{Compiled, compile};

/// Runs experiments and reports what came out.
pub fn run(args: &RunArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let limit = Limit::from(args.time_limit);
    if let Some(message) = args.targets().misuse() {
        writeln!(streams.err, "error: {message}")?;
        return Ok(Exit::Usage);
    }
    if !files::foresee(args.targets().all(), streams)? {
        return Ok(Exit::Wrong);
    }
    let Some((mut project, overrides)) = project::open(&args.file, &args.set, streams)? else {
        return Ok(Exit::Wrong);
    };
    let Some(mut experiments) = project::selected(&project, args.experiment.as_deref(), streams)?
    else {
        return Ok(Exit::Wrong);
    };
    if !project::replace_settings(&mut project, &mut experiments, &args.settings, streams)? {
        return Ok(Exit::Wrong);
    }
    if args.animate.is_some() && !experiments.iter().any(is_animated) {
        not_animated(streams)?;
        return Ok(Exit::Wrong);
    }

    let mut exit = Exit::Success;
    let mut outputs = Outputs::new(args, experiments.len() > 1);
    let mut clock = project.clock.clone();
    let mut said = Diagnostics::new();
    let asked = Asked {
        project: &project,
        overrides: &overrides,
        args,
        limit,
    };
    for experiment in &experiments {
        let mut own = Clock::default();
        let result = one(&asked, experiment, &mut own, &mut said, streams)?;
        clock.add(&own);
        let Some((trajectory, figures)) = result else {
            exit = exit.max(Exit::Wrong);
            continue;
        };
        if trajectory.status != Status::Solved {
            exit = exit.max(Exit::Failed);
        }
        clock.time("report", || outputs.push(&trajectory, figures));
    }
    match outputs.finish(streams) {
        Ok(true) => {}
        Ok(false) => exit = exit.max(Exit::Wrong),
        // Whether the runs went well does not depend on who reads about them.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {}
        Err(error) => return Err(error),
    }
    if args.told.time {
        times(&clock, streams)?;
    }
    Ok(exit)
}

/// Whether an experiment says what its animation shows.
fn is_animated(experiment: &Experiment) -> bool {
    fn has_shapes(items: &[PlotItem]) -> bool {
        items.iter().any(|item| match &item.kind {
            PlotKind::Drawing(word, _) => word.name != "speed",
            PlotKind::For(_, items) => has_shapes(items),
            _ => false,
        })
    }
    let mut settings = experiment.settings.iter();
    settings
        .any(|setting| matches!(&setting.kind, SettingKind::Animate(items) if has_shapes(items)))
}

fn not_animated(streams: &mut Streams<'_>) -> io::Result<()> {
    let hint = "say what moves in the experiment, as `animate { disc q[1], q[2], r; }`";
    writeln!(streams.err, "error: nothing is animated: {hint}")
}

/// The SVG texts of a run, where they are asked for.
struct Figures {
    plot: Option<String>,
    animation: Option<String>,
}

/// What all experiments of a command share.
struct Asked<'a> {
    project: &'a Project,
    overrides: &'a [Bind],
    args: &'a RunArgs,
    /// That of the command.
    limit: Limit,
}

/// Compiles one experiment and tells what is new about it; with its warnings, `None` after an error.
fn compiled<'e>(
    asked: &Asked<'_>,
    exprs: &'e Exprs,
    experiment: &Experiment,
    (clock, said): (&mut Clock, &mut Diagnostics),
    streams: &mut Streams<'_>,
) -> io::Result<Option<(Compiled<'e>, Vec<Warning>)>> {
    let (file, overrides) = (&asked.project.file, asked.overrides);
    let mut diags = Diagnostics::new();
    let compiled = compile(exprs, file, experiment, overrides, clock, &mut diags);
    let warnings = Warning::all(&diags);
    // Experiments of one model meet the same mistakes.
    let failed = diags.has_errors();
    diags.remove_known(said);
    project::print(&diags, &asked.project.sources, streams)?;
    said.append(diags);
    let compiled = compiled.filter(|_| !failed);
    Ok(compiled.map(|compiled| (compiled, warnings)))
}

/// Tells what a run warns of, and why it has ended.
fn tell(trajectory: &Trajectory, project: &Project, streams: &mut Streams<'_>) -> io::Result<()> {
    project::print(&trajectory.diagnostics(), &project.sources, streams)
}

/// Compiles and runs one experiment, with its figures where they are asked for; `None` after an error.
fn one(
    asked: &Asked<'_>,
    experiment: &Experiment,
    clock: &mut Clock,
    said: &mut Diagnostics,
    streams: &mut Streams<'_>,
) -> io::Result<Option<(Trajectory, Figures)>> {
    let Asked {
        project,
        overrides,
        args,
        limit,
    } = asked;
    let exprs = Exprs::new();
    let mut experiment = Cow::Borrowed(experiment);
    if experiment.is_sensed() {
        experiment.to_mut().open_sensed();
    }
    let experiment = &*experiment;
    let compiled = compiled(asked, &exprs, experiment, (clock, said), streams)?;
    let Some((mut compiled, warnings)) = compiled else {
        return Ok(None);
    };
    let has_shapes = compiled.settings.recording.figures.animation.is_some();
    if args.animate.is_some() && is_animated(experiment) && !has_shapes {
        not_animated(streams)?;
        return Ok(None);
    }
    // A report has no rows.
    if args.csv.is_some() || args.json.is_some() {
        compiled.settings.follow_curves();
    }
    let request = Request {
        dense: args.plot.is_some() || args.animate.is_some(),
        estimate: true,
        multipliers: args.multipliers,
        limit: limit.clone(),
    };
    let name = &compiled.settings.name;
    // A log shows how far the run is.
    let logs = args.told.log() == Log::Iterations && compiled.settings.optimize.is_some();
    let bar = Bar::new(name, streams.meter.only_if(!logs));
    let mut watching = match logs {
        false => Watching::new(bar),
        true => {
            let out: &mut dyn io::Write = match args.targets().to_standard() {
                true => &mut *streams.err,
                false => &mut *streams.out,
            };
            writeln!(out, "{name}")?;
            Watching::logged(bar, Iterations::new(out))
        }
    };
    let source = ensemble::Source {
        file: &project.file,
        experiment,
        overrides,
    };
    let launched = clock.time("solve", || {
        launch::whole(project, source, &mut compiled, &request, &mut watching)
    });
    let mut trajectory = match launched {
        Ok(trajectory) => trajectory,
        Err(diags) => {
            drop(watching);
            project::print(&diags, &project.sources, streams)?;
            return Ok(None);
        }
    };
    drop(watching);
    trajectory.quality.stats.compile_s = project.compile_seconds(clock);
    tell(&trajectory, project, streams)?;
    trajectory.warnings.splice(0..0, warnings);
    let figures = clock.time("report", || Figures {
        plot: (args.plot.as_ref()).map(|_| figure::draw(&compiled, &trajectory)),
        animation: (args.animate.as_ref()).and_then(|_| figure::animate(&compiled, &trajectory)),
    });
    Ok(Some((trajectory, figures)))
}

/// Where the results of a run go.
struct Outputs<'a> {
    args: &'a RunArgs,
    report: String,
    /// One object of each run on a line.
    objects: String,
    /// Files of one experiment each.
    sinks: Vec<Sink>,
    several: bool,
}

impl<'a> Outputs<'a> {
    fn new(args: &'a RunArgs, several: bool) -> Self {
        Outputs {
            args,
            report: String::new(),
            objects: String::new(),
            sinks: Vec::new(),
            several,
        }
    }

    fn push(&mut self, trajectory: &Trajectory, figures: Figures) {
        let args = self.args;
        // No report where results take its place, or where silence is asked for.
        if args.told.log() > Log::Off && !args.targets().to_standard() {
            if !self.report.is_empty() {
                self.report.push('\n');
            }
            self.report.push_str(&text::write(trajectory));
        }
        if args.json.is_some() {
            self.objects.push_str(&json::write(trajectory));
            self.objects.push('\n');
        }
        let Trajectory {
            samples, history, ..
        } = trajectory;
        let files = [
            (&args.csv, args.csv.as_ref().map(|_| csv::write(samples))),
            (
                &args.events,
                args.events.as_ref().map(|_| csv::events(history)),
            ),
            (&args.plot, figures.plot),
            (&args.animate, figures.animation),
        ];
        let files = files.into_iter().filter_map(|(path, text)| {
            let path = self.path(path.as_ref()?, trajectory);
            Some(Sink::with(&path, text?))
        });
        let mut files: Vec<Sink> = files.collect();
        self.sinks.append(&mut files);
    }

    /// The file of an experiment.
    fn path(&self, path: &Path, trajectory: &Trajectory) -> PathBuf {
        if !self.several || is_standard(path) {
            return path.to_owned();
        }
        files::of_experiment(path, &trajectory.setup.experiment)
    }

    fn finish(self, streams: &mut Streams<'_>) -> io::Result<bool> {
        streams.out.write_all(self.report.as_bytes())?;
        let mut all_written = true;
        let json = self.args.json.as_deref();
        let json = json.map(|path| Sink::objects(path, &self.objects, !self.several));
        for sink in json.into_iter().chain(self.sinks) {
            all_written &= sink.finish(streams)?;
        }
        Ok(all_written)
    }
}

/// Where the time went.
fn times(clock: &Clock, streams: &mut Streams<'_>) -> io::Result<()> {
    writeln!(streams.err, "time")?;
    for (phase, seconds) in clock.phases() {
        let share = 100.0 * seconds / clock.total();
        writeln!(
            streams.err,
            "  {phase:8} {:>10}  {share:5.1} %",
            text::duration(seconds)
        )?;
    }
    writeln!(
        streams.err,
        "  {:8} {:>10}",
        "total",
        text::duration(clock.total())
    )
}
