//! `nsdc test`

use std::path::Path;
use std::time::{Duration, Instant};

use super::args::TestArgs;
use super::launch::launch;
use super::progress::Bar;
use super::project::{self, Project};
use super::watch::Watching;
use super::{Exit, Streams, files, io};
use crate::clock::Clock;
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::report::expect::{self, Check, Findings, Verdict};
use crate::simulate::Request;
use crate::source::SourceMap;
use crate::syntax::{Expect, ExpectDiagnostic, Experiment, Item};
use crate::{Compiled, compile, dcs, ensemble, order, simulate};

/// What is counted.
#[derive(Default)]
struct Count {
    passed: usize,
    failed: usize,
    unsupported: usize,
    exit: Option<Exit>,
}

/// How a test ended.
enum Outcome {
    /// With what a user may want to know, shown below its line.
    Passed(Option<String>),
    /// With what is shown below its line.
    Failed(Vec<String>, Exit),
    Unsupported(String),
}

/// Runs every expectation of files and folders.
pub fn run(args: &TestArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let mut count = Count::default();
    let paths = match files::find(&args.paths) {
        Ok(paths) => paths,
        Err(error) => {
            writeln!(streams.err, "error: {error}")?;
            return Ok(Exit::Wrong);
        }
    };
    for path in &paths {
        file(path, args, &mut count, streams)?;
    }
    let Count {
        passed,
        failed,
        unsupported,
        exit,
    } = count;
    writeln!(
        streams.out,
        "\n{passed} passed, {failed} failed, {unsupported} not yet supported"
    )?;
    Ok(exit.unwrap_or(Exit::Success))
}

impl Count {
    /// Counts a test and prints its line.
    fn record(
        &mut self,
        name: &str,
        outcome: Outcome,
        streams: &mut Streams<'_>,
    ) -> io::Result<()> {
        match outcome {
            Outcome::Passed(account) => {
                self.passed += 1;
                writeln!(streams.out, "ok      {name}")?;
                if let Some(account) = account {
                    writeln!(streams.out, "          {account}")?;
                }
            }
            Outcome::Failed(details, exit) => {
                self.failed += 1;
                self.exit = self.exit.max(Some(exit));
                writeln!(streams.out, "FAILED  {name}")?;
                for detail in details {
                    writeln!(streams.out, "          {detail}")?;
                }
            }
            Outcome::Unsupported(code) => {
                self.unsupported += 1;
                writeln!(streams.out, "--      {name}: not yet supported ({code})")?;
            }
        }
        // A long run shows where it is.
        streams.out.flush()
    }
}

fn file(
    path: &Path,
    args: &TestArgs,
    count: &mut Count,
    streams: &mut Streams<'_>,
) -> io::Result<()> {
    let name = files::display_name(path);
    let mut project = match Project::load(path) {
        Ok(project) => project,
        Err(error) => {
            let outcome = Outcome::Failed(vec![error.to_string()], Exit::Wrong);
            return count.record(&name, outcome, streams);
        }
    };
    let expected = project.file.items.iter().filter_map(|item| match item {
        Item::ExpectDiagnostic(expected) => Some(expected.clone()),
        _ => None,
    });
    let expected: Vec<ExpectDiagnostic> = expected.collect();
    let experiments: Vec<Experiment> = project.experiments().cloned().collect();
    if !expected.is_empty() {
        let diags = project.check();
        for expect in &expected {
            let outcome = diagnostic(expect, &diags);
            let name = format!(
                "{name}: expect {} {}",
                expect.severity.name, expect.code.name
            );
            count.record(&name, outcome, streams)?;
        }
        if expected
            .iter()
            .any(|expect| expect.severity.name == "error")
        {
            return Ok(());
        }
    } else if project.diags.has_errors() || experiments.is_empty() {
        let diags = project.check();
        let outcome = compilation(&diags, &project.sources, streams)?;
        return count.record(&name, outcome, streams);
    }
    for experiment in &experiments {
        let outcome = one(&project, experiment, args, streams)?;
        count.record(
            &format!("{name}: {}", experiment.name.name),
            outcome,
            streams,
        )?;
    }
    Ok(())
}

/// `expect error E0203;`
fn diagnostic(expect: &ExpectDiagnostic, diags: &Diagnostics) -> Outcome {
    let (codes, what) = match expect.severity.name.as_str() {
        "error" => (project::error_codes(diags), "errors"),
        _ => (project::warning_codes(diags), "warnings"),
    };
    if codes.contains(&expect.code.name) {
        return Outcome::Passed(None);
    }
    let got = match codes.is_empty() {
        true => format!("no {what}"),
        false => codes.join(", "),
    };
    Outcome::Failed(
        vec![format!("expected {}, got {got}", expect.code.name)],
        Exit::Failed,
    )
}

/// What it means that something did not compile, or did.
fn compilation(
    diags: &Diagnostics,
    sources: &SourceMap,
    streams: &mut Streams<'_>,
) -> io::Result<Outcome> {
    let codes = project::error_codes(diags);
    if codes.is_empty() {
        return Ok(Outcome::Passed(None));
    }
    // Where everything that stops it is still to come, it is not wrong.
    if codes.iter().all(|code| code.starts_with("E09")) {
        return Ok(Outcome::Unsupported(codes[0].clone()));
    }
    project::print(diags, sources, streams)?;
    Ok(Outcome::Failed(
        vec![format!("does not compile: {}", codes.join(", "))],
        Exit::Wrong,
    ))
}

/// Runs one experiment and compares it with its expectations.
fn one(
    project: &Project,
    experiment: &Experiment,
    args: &TestArgs,
    streams: &mut Streams<'_>,
) -> io::Result<Outcome> {
    let exprs = Exprs::new();
    let mut diags = Diagnostics::new();
    let mut clock = Clock::default();
    let compiled = compile(
        &exprs,
        &project.file,
        experiment,
        &[],
        &mut clock,
        &mut diags,
    );
    let Some(mut compiled) = compiled.filter(|_| !diags.has_errors()) else {
        return compilation(&diags, &project.sources, streams);
    };
    let expects = compiled.settings.expects.clone();
    let mut mistakes = Diagnostics::new();
    expect::check(&compiled.subject(&project.sources), &expects, &mut mistakes);
    let is_wrong = project::error_codes(&mistakes)
        .iter()
        .any(|code| !code.starts_with("E09"));
    if is_wrong {
        return compilation(&mistakes, &project.sources, streams);
    }

    let lowering = match lowering(project, &compiled, args) {
        Ok(lowering) => lowering,
        Err(error) => return Ok(Outcome::Failed(vec![error], Exit::Wrong)),
    };
    let request = Request {
        dense: true,
        multipliers: false,
        estimate: true,
        time_limit: args.time_limit,
    };
    let started = Instant::now();
    let mut watching = Watching::new(Bar::new(&compiled.settings.name, streams.progress));
    let trajectory = match launch(project, &mut compiled, &request, &mut watching) {
        Ok(trajectory) => trajectory,
        Err(diags) => return compilation(&diags, &project.sources, streams),
    };
    let subject = compiled.subject(&project.sources);
    let order = expect::asks_for_order(&subject, &expects).then(|| {
        let mut watch = |order::Progress { name, knob, done }: order::Progress<'_>| {
            watching.bar.show(done, || format!("{name}, {knob:.1e}"));
        };
        let limit = request.left(started).time_limit.unwrap_or(STUDY);
        order::of_method(&compiled, &project.sources, limit, &mut watch)
    });
    let mut warnings = project::warning_codes(&diags);
    let all = ensemble::Source {
        file: &project.file,
        experiment,
        overrides: &[],
    };
    let request = request.left(started);
    let others = other_seeds(project, all, &compiled, &request, &warnings, &mut watching);
    drop(watching);
    warnings.extend(
        trajectory
            .warnings
            .iter()
            .map(|warning| warning.code.clone()),
    );
    let mut subject = compiled.subject(&project.sources);
    // A free horizon is known by now.
    if let (Some(_), Some(&end)) = (&compiled.settings.optimize, trajectory.time.last()) {
        subject.horizon = end;
    }
    let checks = expect::evaluate(
        &subject,
        &expects,
        &trajectory,
        &Findings {
            warnings,
            lowering,
            order: order.clone(),
        },
    );
    let account = order.and_then(|order| Some(order.ok()?.account));
    let own = outcome(&checks, account);
    Ok(match (own, others) {
        (Outcome::Passed(_), Some(failed)) => failed,
        (own, _) => own,
    })
}

/// What is expected holds with every seed: the first one of those after the declared one with which it does not. All
/// runs share the time of the request.
fn other_seeds(
    project: &Project,
    source: ensemble::Source<'_>,
    compiled: &Compiled<'_>,
    request: &Request,
    warnings: &[String],
    watching: &mut Watching<'_>,
) -> Option<Outcome> {
    let seeds = ensemble::seeds(&compiled.settings)?;
    let started = Instant::now();
    let work = |compiled: &Compiled<'_>| {
        let request = request.left(started);
        let trajectory = simulate::run(&compiled.system, &compiled.settings, &request);
        let mut warnings = warnings.to_vec();
        warnings.extend(trajectory.warnings.iter().map(|w| w.code.clone()));
        let findings = Findings {
            warnings,
            ..Findings::default()
        };
        // Those are about the method and the form, not about a run.
        let mut expects = compiled.settings.expects.clone();
        expects.retain(|(expect, _)| !matches!(expect, Expect::LoweringGolden));
        let subject = compiled.subject(&project.sources);
        expects.retain(|expect| !expect::asks_for_order(&subject, std::slice::from_ref(expect)));
        outcome(
            &expect::evaluate(&subject, &expects, &trajectory, &findings),
            None,
        )
    };
    let others = seeds.start + 1..seeds.end;
    let mut heard = |done: usize| {
        let share = done as f64 / (seeds.end - seeds.start) as f64;
        watching.bar.show(share, || format!("{done} runs"));
    };
    let threads = ensemble::threads();
    let outcomes = ensemble::over_seeds(source, others.clone(), threads, work, &mut heard);
    let mut failed = others
        .zip(outcomes)
        .filter_map(|(seed, outcome)| match outcome {
            Outcome::Failed(mut details, exit) => {
                details.insert(0, format!("with seed {seed}:"));
                Some(Outcome::Failed(details, exit))
            }
            _ => None,
        });
    failed.next()
}

/// Time for the runs that show the order of a method.
const STUDY: Duration = Duration::from_secs(20);

/// What the checks say together; `account` is what to tell where all pass.
fn outcome(checks: &[Check], account: Option<String>) -> Outcome {
    let mut details = Vec::new();
    let mut unsupported = None;
    for check in checks {
        match &check.verdict {
            Verdict::Passed => {}
            Verdict::Failed { expected, got } => {
                details.push(format!("expect {}", check.text));
                details.push(format!("  expected {expected}"));
                details.push(format!("  got      {got}"));
            }
            Verdict::Unsupported { code } => unsupported = unsupported.or(Some(code.clone())),
        }
    }
    match (details.is_empty(), unsupported) {
        (false, _) => Outcome::Failed(details, Exit::Failed),
        (true, Some(code)) => Outcome::Unsupported(code),
        (true, None) => Outcome::Passed(account),
    }
}

/// The lowered form with its golden file, where one is asked for.
fn lowering(
    project: &Project,
    compiled: &Compiled<'_>,
    args: &TestArgs,
) -> Result<Option<(String, Option<String>)>, String> {
    let settings = &compiled.settings;
    let is_asked_for = settings
        .expects
        .iter()
        .any(|(expect, _)| matches!(expect, Expect::LoweringGolden));
    if !is_asked_for {
        return Ok(None);
    }
    let form =
        dcs::lower(&compiled.lowered(), &settings.lowerings).map_err(|error| error.to_string())?;
    let golden = dcs::golden(&project.path, &settings.name, &form);
    if args.accept {
        files::write(&golden.path, &golden.text).map_err(|error| error.to_string())?;
    }
    let content = files::read_if_present(&golden.path).map_err(|error| error.to_string())?;
    Ok(Some((golden.text, content)))
}
