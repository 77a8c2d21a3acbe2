//! What experiments leave out, and what that saves: writes `tests/SKIPPED.md`.
//!
//! `cargo run --profile dist -p nsd-tests --example skipped`
//!
//! Off is on with one difference: without its `output` list an experiment keeps the whole model. So each experiment of
//! the examples is run as it stands, without its list, and for one state alone, by the method that it names.
//! What has no such switch is counted and not timed: modes that are never entered, and gaps that are not looked at.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use nsd_solver::event::{Event, Segment};
use nsd_solver::moreau::{Change, Observer};
use nsd_tests::DataFolder;
use nsdc::diagnostics::Diagnostics;
use nsdc::expr::Exprs;
use nsdc::limit::Limit;
use nsdc::project::clock::Clock;
use nsdc::report::{Status, Trajectory};
use nsdc::simulate::{self, Request};
use nsdc::source::SourceMap;
use nsdc::source::imports;
use nsdc::syntax::{self, Experiment, ExperimentKind, ExperimentSetting, File, Item, SettingKind};
use nsdc::system::System;
use nsdc::system::experiment::Method;
use nsdc::{Compiled, compile, optimize};

/// Runs of which the fastest counts: at least and at most, and seconds after which there are enough.
const RUNS: (usize, usize, f64) = (3, 25, 0.3);
/// States of a model that are asked for alone: those at equal distances of more.
const ASKED: usize = 12;
/// Contacts that are worth a row.
const MANY_CONTACTS: usize = 8;

fn main() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = page(&examples(&folder.join("../examples")));
    fs::write(folder.join("SKIPPED.md"), page).expect("the folder of the tests is writable");
}

/// An experiment of an example.
struct Example {
    file: String,
    name: String,
    parsed: File,
    experiment: Experiment,
}

fn examples(folder: &Path) -> Vec<Example> {
    let entries = fs::read_dir(folder).expect("the examples are there");
    let mut paths: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "nsd"));
    paths.sort();
    let mut found = Vec::new();
    for path in paths {
        let file = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let text = fs::read_to_string(&path).expect("an example is text");
        let parsed = parse(&file, &text, folder);
        for item in &parsed.items {
            if let Item::Experiment(experiment) = item {
                found.push(Example {
                    file: file.clone(),
                    name: experiment.name.name.clone(),
                    parsed: parsed.clone(),
                    experiment: experiment.clone(),
                });
            }
        }
    }
    found
}

fn parse(name: &str, text: &str, folder: &Path) -> File {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let mut file = syntax::parse(&sources.add(name, text), &mut diags);
    let mut data = DataFolder(folder.to_path_buf());
    imports::link(&mut file, name, &mut data, &mut sources, &mut diags);
    file
}

/// What an experiment asks for.
#[derive(Clone, Copy)]
enum Asked<'a> {
    AsWritten,
    Everything,
    /// A state, and no expectation.
    Alone(&'a str),
}

impl Example {
    fn has_list(&self) -> bool {
        let mut settings = self.experiment.settings.iter();
        settings.any(|setting| matches!(&setting.kind, SettingKind::Output { paths, .. } if !paths.is_empty()))
    }

    fn asking(&self, asked: Asked<'_>) -> Experiment {
        let mut experiment = self.experiment.clone();
        let is_kept = |setting: &ExperimentSetting| match asked {
            Asked::AsWritten => true,
            Asked::Everything => !matches!(setting.kind, SettingKind::Output { .. }),
            Asked::Alone(_) => !matches!(
                setting.kind,
                SettingKind::Output { .. } | SettingKind::Expect(_)
            ),
        };
        experiment.settings.retain(is_kept);
        if let Asked::Alone(state) = asked {
            let text = format!("model m {{ }} simulate e of m {{ output {state}; }}");
            let mut sources = SourceMap::new();
            let file = syntax::parse(&sources.add("output", text), &mut Diagnostics::new());
            let settings = file.items.into_iter().filter_map(|item| match item {
                Item::Experiment(experiment) => Some(experiment.settings),
                _ => None,
            });
            experiment.settings.extend(settings.flatten());
        }
        experiment
    }

    /// From text to a system; nothing where that is refused.
    fn compiled<T>(&self, asked: Asked<'_>, use_it: impl FnOnce(&Compiled<'_>) -> T) -> Option<T> {
        let experiment = self.asking(asked);
        let (exprs, mut clock, mut diags) = (Exprs::new(), Clock::default(), Diagnostics::new());
        let compiled = compile(
            &exprs,
            &self.parsed,
            &experiment,
            &[],
            &mut clock,
            &mut diags,
        )?;
        (!diags.has_errors()).then(|| use_it(&compiled))
    }

    /// The fastest of several runs; nothing where one does not come to its end.
    fn measure(&self, asked: Asked<'_>) -> Option<Measured> {
        let mut best: Option<Measured> = None;
        let (least, most, enough) = RUNS;
        let begun = Instant::now();
        for k in 0..most {
            if k >= least && begun.elapsed().as_secs_f64() > enough {
                break;
            }
            let run = self.once(asked).filter(|run| run.is_solved)?;
            if best.as_ref().is_none_or(|best| run.seconds < best.seconds) {
                best = Some(run);
            }
        }
        best
    }

    fn once(&self, asked: Asked<'_>) -> Option<Measured> {
        let started = Instant::now();
        let run = self.compiled(asked, |compiled| Measured::of(compiled, &run(compiled)))?;
        let seconds = started.elapsed().as_secs_f64();
        Some(Measured { seconds, ..run })
    }
}

fn run(compiled: &Compiled<'_>) -> Trajectory {
    let mut system = compiled.system.clone();
    if compiled.settings.numerics.method.kind().needs_dcs() {
        // What cannot be settled says so in the run.
        let _ = simulate::settle(&mut system, compiled.settings.horizon);
    }
    let request = Request {
        dense: false,
        estimate: false,
        ..Request::default()
    };
    match &compiled.settings.optimize {
        None => simulate::run(&system, &compiled.settings, &request),
        Some(task) => {
            let found = optimize::run(&system, &compiled.settings, task, &[], &request, &mut ());
            found.expect("examples can be discretized").trajectory
        }
    }
}

/// Sizes and costs of a run.
struct Measured {
    states: usize,
    switches: usize,
    modes: usize,
    evaluations: u64,
    skipped: Vec<String>,
    is_solved: bool,
    seconds: f64,
}

impl Measured {
    fn of(compiled: &Compiled<'_>, trajectory: &Trajectory) -> Self {
        let modes: BTreeSet<&str> = trajectory
            .history
            .modes
            .iter()
            .map(|mode| mode.mode.as_str())
            .collect();
        Measured {
            states: compiled.system.states.len(),
            switches: compiled.system.switches.len(),
            modes: modes.len(),
            evaluations: trajectory.quality.stats.rhs_evaluations,
            skipped: trajectory.setup.skipped.clone(),
            is_solved: trajectory.status == Status::Solved,
            seconds: 0.0,
        }
    }
}

fn page(examples: &[Example]) -> String {
    let mut page = String::from(
        "# What is skipped\n\n\
         Made by `cargo run --profile dist -p nsd-tests --example skipped`.\n\
         Times are those of the fastest of several runs, from the parsed text to the end, without an estimate of the error; counts are the same on every machine.\n\n",
    );
    page.push_str(&asked(examples));
    page.push_str(&modes(examples));
    page.push_str(&gaps(examples));
    page
}

/// States and switches that reach nothing that is asked for.
fn asked(examples: &[Example]) -> String {
    let mut rows = String::new();
    let mut without = Vec::new();
    for example in examples {
        let name = format!("{}: {}", example.file, example.name);
        let least = example.least();
        let alone = least
            .iter()
            .map(|state| (format!("`{state}`"), Asked::Alone(state)));
        let listed = example
            .has_list()
            .then(|| ("its list".to_owned(), Asked::AsWritten));
        let asked = listed.into_iter().chain(alone);
        let asked: Vec<(String, Asked<'_>)> =
            asked.filter(|(_, asked)| example.skips(*asked)).collect();
        if asked.is_empty() {
            without.push(name);
            continue;
        }
        let Some(whole) = example.measure(Asked::Everything) else {
            continue;
        };
        let runs = asked.into_iter();
        let found = runs.filter_map(|(what, asked)| Some((what, example.measure(asked)?)));
        for (what, run) in found {
            let _ = writeln!(
                rows,
                "| {name} | {what} | {} | {} of {} | {} of {} | {} of {} | {:.2} of {:.2} | {:.0} % |",
                run.skipped.join("; "),
                run.states,
                whole.states,
                run.switches,
                whole.switches,
                run.evaluations,
                whole.evaluations,
                1e3 * run.seconds,
                1e3 * whole.seconds,
                100.0 * (1.0 - run.seconds / whole.seconds),
            );
        }
    }
    format!(
        "## States and switches that nothing asks for\n\n\
         An experiment with an `output` list keeps what the list and its expectations reach.\n\
         Each row is an experiment with its own list, or asked for the one state that needs the least and without expectations, beside the same without a list.\n\n\
         | experiment | asked for | skipped | states | switches | evaluations | ms | saved |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n{rows}\n\
         In all others nothing is left out for any of up to twelve states: {}.\n\n",
        without.join(", ")
    )
}

impl Example {
    /// Whether something is left out.
    fn skips(&self, asked: Asked<'_>) -> bool {
        let skips = self.compiled(asked, |compiled| {
            !compiled.system.provenance.skipped.is_empty()
        });
        skips.unwrap_or(false)
    }

    /// The state that needs the fewest others.
    fn least(&self) -> Option<String> {
        let names = |compiled: &Compiled<'_>| -> Vec<String> {
            let states = compiled.system.states.iter();
            states.map(|state| state.name.clone()).collect()
        };
        let names = self.compiled(Asked::Everything, names)?;
        let stride = names.len().div_ceil(ASKED).max(1);
        let size = |name: &String| {
            let size = |compiled: &Compiled<'_>| {
                (compiled.system.states.len(), compiled.system.switches.len())
            };
            self.compiled(Asked::Alone(name), size)
        };
        let asked = names.into_iter().step_by(stride);
        let sized = asked.filter_map(|name| Some((size(&name)?, name)));
        sized.min().map(|(_, name)| name)
    }
}

/// Modes that a run never meets.
fn modes(examples: &[Example]) -> String {
    let mut rows = String::new();
    let simulations = examples.iter();
    let simulations =
        simulations.filter(|example| example.experiment.kind == ExperimentKind::Simulate);
    for example in simulations {
        let Some(run) = example.once(Asked::Everything) else {
            continue;
        };
        if run.switches > 1 && run.is_solved && run.modes > 0 {
            let _ = writeln!(
                rows,
                "| {}: {} | {} | {} | {} |",
                example.file,
                example.name,
                run.switches,
                power(run.switches),
                run.modes
            );
        }
    }
    format!(
        "## Modes that are never entered\n\n\
         Functions of a mode are compiled when a run first meets its sides.\n\
         n switches have 3ⁿ sides at most, above, below and sliding; each counts as many as there are.\n\
         There is no run that compiles them all, so this is counted and not timed.\n\n\
         | experiment | switches | sides | modes met |\n\
         | --- | --- | --- | --- |\n{rows}\n"
    )
}

/// 3ⁿ, in words where it is large.
fn power(n: usize) -> String {
    match u32::try_from(n).ok().and_then(|n| 3_u64.checked_pow(n)) {
        Some(sides) if sides < 1_000_000 => sides.to_string(),
        _ => format!("3^{n}"),
    }
}

struct Silent;

impl nsd_solver::event::Observer for Silent {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {}
}

impl Observer for Silent {
    fn change(&mut self, _: f64, _: usize, _: Change) {}
}

/// Contacts that cannot close.
fn gaps(examples: &[Example]) -> String {
    let mut rows = String::new();
    for example in examples {
        let row = example.compiled(Asked::Everything, |compiled| {
            let Method::Timestepping(options) = &compiled.settings.numerics.method else {
                return None;
            };
            looked_at(&compiled.system, compiled.settings.horizon, options.steps)
        });
        if let Some((contacts, steps, looked)) = row.flatten() {
            let all = contacts * steps;
            let _ = writeln!(
                rows,
                "| {}: {} | {contacts} | {steps} | {looked} of {all} | {:.0} % |",
                example.file,
                example.name,
                100.0 * (1.0 - looked as f64 / all as f64)
            );
        }
    }
    format!(
        "## Gaps that are not looked at\n\n\
         In steps of time a contact is looked at when its gap may vanish within a radius of motion.\n\
         All would be every contact once a step, at least.\n\n\
         | experiment | contacts | steps | gaps and enclosures | saved |\n\
         | --- | --- | --- | --- | --- |\n{rows}"
    )
}

/// Contacts, steps, and gaps that were evaluated or enclosed.
fn looked_at(system: &System<'_>, horizon: f64, steps: usize) -> Option<(usize, usize, usize)> {
    let contacts = system.jumps.impulsive.len();
    if contacts < MANY_CONTACTS {
        return None;
    }
    let x0: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
    let mut stepper = simulate::moreau::stepper(system, horizon, steps, Limit::default());
    let solution = stepper.run(0.0, horizon, &x0, &mut Silent);
    Some((contacts, steps, solution.gaps))
}
