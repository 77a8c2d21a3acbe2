//! The tests of one file.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::case::{self, Case, Missed, Outcome};
use super::goldens::{self, Compared};
use crate::cli::progress::{Bar, Meter};
use crate::cli::project::Project;
use crate::cli::watch::Watching;
use crate::cli::{Exit, files};
use crate::diagnostics::{self, Diagnostics};
use crate::expr::Exprs;
use crate::limit::{Cancel, Limit};
use crate::project::clock::Clock;
use crate::project::ensemble;
use crate::project::launch::launch;
use crate::report::Warning;
use crate::report::expect::{self, Findings};
use crate::simulate::Request;
use crate::source::Span;
use crate::source::files::Files;
use crate::study::order;
use crate::syntax::{Expect, ExpectDiagnostic, Experiment, Item};
use crate::{Compiled, compile, threads};

/// How files are tested.
pub struct Options<'o> {
    /// Whether goldens are written.
    pub accept: bool,
    /// What the names of tests contain.
    pub filter: Option<&'o str>,
    /// The only experiment that is tested, where it is one.
    pub experiment: Option<&'o str>,
    /// For each experiment.
    pub time_limit: Option<Duration>,
    /// Ends all of them.
    pub cancel: &'o Cancel,
    /// Where it is shown how far a run is.
    pub meter: Meter,
    /// How diagnostics are printed.
    pub colour: bool,
    pub width: usize,
    /// Where models come from.
    pub files: Arc<dyn Files>,
}

/// What came of a file.
#[derive(Default)]
pub struct Tested {
    pub cases: Vec<Case>,
    /// Tests that the filter leaves out.
    pub left_out: usize,
    /// What is to be printed on standard error.
    pub diagnostics: String,
}

/// Runs all tests of a file.
pub fn test(path: &Path, options: &Options<'_>) -> Tested {
    let mut file = File {
        name: files::display_name(path),
        options,
        tested: Tested::default(),
        said: Diagnostics::new(),
        expected: Vec::new(),
        warnings: Vec::new(),
        goldens: Some(Vec::new()),
    };
    file.run(path);
    file.tested
}

struct File<'o> {
    name: String,
    options: &'o Options<'o>,
    tested: Tested,
    /// What has been printed.
    said: Diagnostics,
    /// Codes of warnings that the file expects.
    expected: Vec<String>,
    /// Those of the test that runs.
    warnings: Vec<Warning>,
    /// Golden files that are asked for; nothing where it is not known of all experiments.
    goldens: Option<Vec<PathBuf>>,
}

impl File<'_> {
    fn run(&mut self, path: &Path) {
        let started = Instant::now();
        let project = match Project::from_files(path, Arc::clone(&self.options.files)) {
            Ok(project) => project,
            Err(error) => {
                if self.is_selected(None) {
                    let missed = Missed::plain(error.to_string());
                    self.add(None, started, Outcome::failed(missed, Exit::Wrong));
                }
                return;
            }
        };
        let expected = project.file.items.iter().filter_map(|item| match item {
            Item::ExpectDiagnostic(expected) => Some(expected.clone()),
            _ => None,
        });
        let expected: Vec<ExpectDiagnostic> = expected.collect();
        self.expected = (expected.iter().map(|expect| expect.code.name.clone())).collect();
        let experiments: Vec<Experiment> = project.experiments().cloned().collect();
        if !expected.is_empty() {
            let diags = project.checked();
            for expect in &expected {
                let test = format!("expect {} {}", expect.severity.name, expect.code.name);
                if self.is_selected(Some(&test)) {
                    self.add(Some(test), started, diagnostic(expect, &diags));
                }
            }
            let fails = |expect: &ExpectDiagnostic| expect.severity.name == "error";
            if expected.iter().any(fails) {
                return;
            }
        } else if project.diags.has_errors() || experiments.is_empty() {
            if self.is_selected(None) {
                let diags = project.checked();
                let outcome = self.compilation(diags, &project);
                self.add(None, started, outcome);
            }
            return;
        }
        let cancel = self.options.cancel;
        for experiment in experiments.iter().take_while(|_| !cancel.is_canceled()) {
            let test = &experiment.name.name;
            if !self.is_selected(Some(test)) {
                continue;
            }
            let started = Instant::now();
            let (outcome, compared) = self.one(&project, experiment);
            match (&mut self.goldens, &outcome) {
                // Goldens of what does not run are not known.
                (goldens, Outcome::Unsupported(_)) => *goldens = None,
                (goldens, outcome) if outcome.exit() == Exit::Wrong => *goldens = None,
                (Some(goldens), _) => goldens.extend(compared.paths),
                (None, _) => {}
            }
            self.add(Some(test.clone()), started, outcome);
            if let Some(case) = self.tested.cases.last_mut() {
                case.changes = compared.changes;
            }
        }
        self.left_over(path);
    }

    /// A golden that nothing is compared with any more is a test that no longer runs.
    fn left_over(&mut self, path: &Path) {
        let is_whole = self.options.filter.is_none()
            && self.options.experiment.is_none()
            && !files::is_standard(path);
        let Some(known) = self.goldens.take().filter(|_| is_whole) else {
            return;
        };
        let started = Instant::now();
        let found = goldens::left_over(path, &known);
        let test = Some("goldens".to_owned());
        let changes = match found {
            Ok(changes) if changes.is_empty() => return,
            Ok(changes) => changes,
            Err(error) => {
                let missed = Missed::plain(error.to_string());
                return self.add(test, started, Outcome::failed(missed, Exit::Wrong));
            }
        };
        if self.options.accept {
            self.add(test, started, Outcome::Passed(Vec::new()));
            if let Some(case) = self.tested.cases.last_mut() {
                case.changes = changes;
            }
            return;
        }
        let mut missed: Vec<Missed> = changes
            .iter()
            .map(|change| Missed {
                what: change.name(),
                lines: vec!["no experiment asks for it".to_owned()],
                ..Missed::default()
            })
            .collect();
        missed.push(Missed::plain(
            "`nsdc test --accept` takes away what nothing asks for".to_owned(),
        ));
        let exit = Exit::Failed;
        self.add(test, started, Outcome::Failed { missed, exit });
    }

    /// Whether the filter takes a test; counts those that it leaves out.
    fn is_selected(&mut self, test: Option<&str>) -> bool {
        let name = match test {
            Some(test) => case::name(&self.name, test),
            None => self.name.clone(),
        };
        let filter = self.options.filter;
        let only = self.options.experiment;
        let is_selected = filter.is_none_or(|filter| name.contains(filter))
            && only.is_none_or(|only| test == Some(only));
        self.tested.left_out += usize::from(!is_selected);
        is_selected
    }

    fn add(&mut self, test: Option<String>, started: Instant, outcome: Outcome) {
        self.tested.cases.push(Case {
            file: self.name.clone(),
            test,
            outcome,
            seconds: started.elapsed().as_secs_f64(),
            warnings: std::mem::take(&mut self.warnings),
            changes: Vec::new(),
        });
    }

    /// What it means that something did not compile, or did.
    fn compilation(&mut self, mut diags: Diagnostics, project: &Project) -> Outcome {
        let codes = diags.error_codes();
        if codes.is_empty() {
            self.warnings = Warning::all(&diags);
            return Outcome::Passed(Vec::new());
        }
        // Where everything that stops it is still to come, it is not wrong.
        if codes.iter().all(|code| code.starts_with("E09")) {
            return Outcome::Unsupported(codes[0].clone());
        }
        let Options { colour, width, .. } = *self.options;
        // Experiments of one model meet the same mistakes.
        diags.remove_known(&self.said);
        let text = diagnostics::render(&diags, &project.sources, colour, width);
        self.tested.diagnostics.push_str(&text);
        self.said.append(diags);
        let missed = Missed::plain(format!("does not compile: {}", codes.join(", ")));
        Outcome::failed(missed, Exit::Wrong)
    }

    /// Runs one experiment and compares it with its expectations.
    fn one(&mut self, project: &Project, experiment: &Experiment) -> (Outcome, Compared) {
        let exprs = Exprs::new();
        let mut diags = Diagnostics::new();
        let mut clock = Clock::default();
        let file = &project.file;
        let compiled = compile(&exprs, file, experiment, &[], &mut clock, &mut diags);
        let Some(compiled) = compiled.filter(|_| !diags.has_errors()) else {
            return (self.compilation(diags, project), Compared::default());
        };
        if let Some(outcome) = self.mistaken(project, &compiled) {
            return (outcome, Compared::default());
        }
        let ran = self.compare((project, experiment), compiled, &diags);
        ran.unwrap_or_else(|outcome| (outcome, Compared::default()))
    }

    /// What is wrong with what an experiment expects, before it is run.
    fn mistaken(&mut self, project: &Project, compiled: &Compiled<'_>) -> Option<Outcome> {
        let mut mistakes = Diagnostics::new();
        let expects = &compiled.settings.expects;
        expect::check(&compiled.subject(&project.sources), expects, &mut mistakes);
        let codes = mistakes.error_codes();
        if codes.iter().any(|code| !code.starts_with("E09")) {
            return Some(self.compilation(mistakes, project));
        }
        let is_refused = files::is_standard(&project.path) && goldens::is_asked_for(compiled);
        is_refused.then(|| {
            let missed = "standard input has no golden files beside it".to_owned();
            Outcome::failed(Missed::plain(missed), Exit::Wrong)
        })
    }

    /// Runs what has been compiled, and compares it.
    fn compare(
        &mut self,
        (project, experiment): (&Project, &Experiment),
        mut compiled: Compiled<'_>,
        diags: &Diagnostics,
    ) -> Result<(Outcome, Compared), Outcome> {
        let expects = compiled.settings.expects.clone();
        let forms = goldens::forms(&project.path, &compiled);
        let request = Request {
            dense: true,
            multipliers: false,
            estimate: true,
            limit: Limit::from(self.options.time_limit).canceled_by(self.options.cancel),
        };
        let bar = Bar::new(&compiled.settings.name, self.options.meter.clone());
        let mut watching = Watching::new(bar);
        let trajectory = launch(project, &mut compiled, &request, &mut watching);
        let trajectory = trajectory.map_err(|diags| self.compilation(diags, project))?;
        let subject = compiled.subject(&project.sources);
        let order = expect::asks_for_order(&subject, &expects).then(|| {
            let mut watch = |order::Progress { name, knob, done }: order::Progress<'_>| {
                watching.bar.show(done, || format!("{name}, {knob:.1e}"));
            };
            let limit = match request.limit.left() {
                Some(_) => request.limit.clone(),
                None => request.limit.sooner(STUDY),
            };
            order::of_method(&compiled, &project.sources, &limit, &mut watch)
        });
        let mut warnings = diags.warning_codes();
        self.tell(
            Warning::all(diags).iter().chain(&trajectory.warnings),
            &expects,
        );
        let all = ensemble::Source {
            file: &project.file,
            experiment,
            overrides: &[],
        };
        let others = other_seeds(project, all, &compiled, &request, &warnings, &mut watching);
        drop(watching);
        let found = trajectory.warnings.iter();
        warnings.extend(found.map(|warning| warning.code.clone()));
        let mut findings = Findings {
            warnings,
            order: order.clone(),
            ..Findings::default()
        };
        let accept = self.options.accept;
        let model = &project.path;
        let compared =
            goldens::compare(model, &compiled, forms, &trajectory, accept, &mut findings);
        let compared = compared
            .map_err(|error| Outcome::failed(Missed::plain(error.to_string()), Exit::Wrong))?;
        let mut subject = compiled.subject(&project.sources);
        // A free horizon is known by now.
        let end = trajectory.samples.time.last();
        if let (Some(_), Some(&end)) = (&compiled.settings.optimize, end) {
            subject.horizon = end;
        }
        let checks = expect::evaluate(&subject, &expects, &trajectory, &findings);
        let account = order.and_then(|order| Some(order.ok()?.account));
        let own = Outcome::of(&checks, account.into_iter().collect());
        let outcome = match (own, others) {
            (Outcome::Passed(_), Some(failed)) => failed,
            (own, _) => own,
        };
        Ok(without_model(outcome, compared))
    }

    /// Keeps the warnings that nobody expects.
    fn tell<'w>(
        &mut self,
        warnings: impl Iterator<Item = &'w Warning>,
        expects: &[(Expect, Span)],
    ) {
        let is_expected = |code: &String| {
            let own =
                |expect: &Expect| matches!(expect, Expect::Warning(name) if name.name == *code);
            self.expected.contains(code) || expects.iter().any(|(expect, _)| own(expect))
        };
        let kept = warnings.filter(|warning| !is_expected(&warning.code));
        self.warnings = kept.cloned().collect();
    }
}

/// A run that is wrong is no model for others.
fn without_model(mut outcome: Outcome, mut compared: Compared) -> (Outcome, Compared) {
    if let (Outcome::Failed { missed, .. }, false) = (&mut outcome, compared.changes.is_empty()) {
        compared.changes.clear();
        let nothing = "no golden was written: what else is expected comes first";
        missed.push(Missed::plain(nothing.to_owned()));
    }
    (outcome, compared)
}

/// `expect error E0203;`
fn diagnostic(expect: &ExpectDiagnostic, diags: &Diagnostics) -> Outcome {
    let (codes, what) = match expect.severity.name.as_str() {
        "error" => (diags.error_codes(), "errors"),
        _ => (diags.warning_codes(), "warnings"),
    };
    if codes.contains(&expect.code.name) {
        return Outcome::Passed(Vec::new());
    }
    let got = match codes.is_empty() {
        true => format!("no {what}"),
        false => codes.join(", "),
    };
    let missed = Missed::plain(format!("expected {}, got {got}", expect.code.name));
    Outcome::failed(missed, Exit::Failed)
}

/// What is expected holds with every seed: the first one of those after the declared one with which it does not. All
/// runs share the limit of the request.
fn other_seeds(
    project: &Project,
    source: ensemble::Source<'_>,
    compiled: &Compiled<'_>,
    request: &Request,
    warnings: &[String],
    watching: &mut Watching<'_>,
) -> Option<Outcome> {
    let seeds = ensemble::seeds(&compiled.settings)?;
    let work = |seeded: &mut ensemble::Seeded<'_>| {
        let settings = seeded.compiled.settings.clone();
        let trajectory = seeded.run(&settings, request);
        let compiled = &seeded.compiled;
        let mut warnings = warnings.to_vec();
        warnings.extend(trajectory.warnings.iter().map(|w| w.code.clone()));
        let findings = Findings {
            warnings,
            ..Findings::default()
        };
        let subject = compiled.subject(&project.sources);
        let expects = expect::of_any_run(&subject, &compiled.settings.expects);
        let checks = expect::evaluate(&subject, &expects, &trajectory, &findings);
        Outcome::of(&checks, Vec::new())
    };
    let others = seeds.start + 1..seeds.end;
    let mut heard = |done: usize| {
        let share = done as f64 / (seeds.end - seeds.start) as f64;
        watching.bar.show(share, || format!("{done} runs"));
    };
    let threads = threads::count();
    let outcomes = ensemble::over_seeds(
        source,
        others.clone(),
        (threads, &request.limit),
        work,
        &mut heard,
    );
    let mut failed = others
        .zip(outcomes)
        .filter_map(|(seed, outcome)| match outcome {
            Outcome::Failed { mut missed, exit } => {
                missed.insert(0, Missed::plain(format!("with seed {seed}:")));
                Some(Outcome::Failed { missed, exit })
            }
            _ => None,
        });
    failed.next()
}

/// Time for the runs that show the order of a method.
const STUDY: Duration = Duration::from_secs(20);
