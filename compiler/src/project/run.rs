//! Runs of the experiments of a [`Project`], for programs: numbers in, numbers out.

use std::borrow::Cow;

use crate::diagnostics::Diagnostics;
use crate::diagnostics::messages::Messages;
use crate::expr::Exprs;
use crate::limit::Limit;
use crate::optimize::{self, PrepareError};
use crate::project::clock::Clock;
use crate::project::prepared::{NotPrepared, Prepared};
use crate::project::watch::Watch;
use crate::project::{Project, bindings, ensemble, launch, prepared, replace_setting, sensed};
use crate::report::forms::{csv, json, text};
use crate::report::{Trajectory, Warning};
use crate::simulate::Request;
use crate::source::SourceMap;
use crate::syntax::{Bind, Experiment, File, Path};
use crate::{Compiled, compile};

/// What is asked of a run besides what its experiment says.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Values in place of those of the experiment, of parameters and initial values by their names: `k`, `x[2]`.
    pub values: Vec<(String, f64)>,
    /// Settings in place of those of the experiment: the name that diagnostics show, and the words of the language:
    /// `("horizon", "horizon 2*pi")`.
    pub settings: Vec<(String, String)>,
    /// The error that a run may have, relative to the size of each state, in place of that of the experiment: other ones
    /// compile nothing in a [`Session`](crate::session::Session).
    pub tolerance: Option<f64>,
    /// When the run ends, done or not.
    pub limit: Limit,
    /// Weights of states, outputs and controls, by name and row by row as they are reported: a run with `sensitivity to` has
    /// the gradient of their sum alone, [`Samples::gradient`](crate::report::Samples::gradient), at a cost that hardly grows with what that is by.
    /// Others are refused (E0534).
    pub weights: Option<Vec<(String, Vec<f64>)>>,
    /// Whether multipliers are kept, where the method has them.
    pub multipliers: bool,
    /// Whether rows are at the ends of steps and elements alone; else inside of them, too, where straight lines from row to
    /// row would not follow the curves. What the experiment says about it counts first.
    pub ends_alone: bool,
    /// Whether the solution between the reported instants is kept, as polynomials.
    pub dense: bool,
    /// Whether a figure is drawn.
    #[cfg(feature = "plots")]
    pub figure: bool,
}

impl Options {
    /// Settings in the words of the language, with the tolerance.
    pub(crate) fn words(&self) -> Vec<(String, String)> {
        let words = |tolerance| ("tolerance".to_owned(), format!("tolerance {tolerance:?}"));
        let tolerance = self.tolerance.map(words);
        self.settings.iter().cloned().chain(tolerance).collect()
    }

    /// What a run has to keep for them.
    pub(crate) fn request(&self) -> Request {
        #[cfg(feature = "plots")]
        let is_drawn = self.figure;
        #[cfg(not(feature = "plots"))]
        let is_drawn = false;
        Request {
            dense: self.dense || is_drawn,
            estimate: true,
            multipliers: self.multipliers,
            limit: self.limit.clone(),
        }
    }
}

/// What came of an experiment, whether it was solved or not.
#[derive(Clone, Debug)]
pub struct Run {
    /// How it ended, and what was reached until then.
    pub trajectory: Trajectory,
    /// What it looks like, as SVG, where that was asked for.
    #[cfg(feature = "plots")]
    pub figure: Option<String>,
    /// The entries of states, in the order of the first rows of its pieces.
    pub states: Vec<String>,
    sources: SourceMap,
}

impl Run {
    /// What came of an experiment with these settings.
    #[cfg_attr(
        not(feature = "plots"),
        expect(unused_variables, reason = "nothing is drawn")
    )]
    pub(crate) fn new(
        compiled: &Compiled<'_>,
        trajectory: Trajectory,
        options: &Options,
        sources: SourceMap,
    ) -> Self {
        let states = compiled.system.states.iter();
        Run {
            #[cfg(feature = "plots")]
            figure: (options.figure).then(|| crate::project::figure::draw(compiled, &trajectory)),
            states: states.map(|state| state.name.clone()).collect(),
            trajectory,
            sources,
        }
    }

    /// What there is to say about it: why it has ended before its end, and what it warns of.
    pub fn messages(&self) -> Messages {
        Messages::new(self.trajectory.diagnostics(), self.sources.clone())
    }

    /// All of it as JSON, as `nsdc run --json` writes it.
    pub fn json(&self) -> String {
        json::write(&self.trajectory)
    }

    /// The same as JSON without what has a value at each instant.
    pub fn summary(&self) -> String {
        json::summary(&self.trajectory)
    }

    /// What is reported over time, as a table.
    pub fn csv(&self) -> String {
        csv::write(&self.trajectory.samples)
    }

    /// A short report.
    pub fn text(&self) -> String {
        text::write(&self.trajectory)
    }
}

impl Project {
    /// Runs an experiment: what came of it, whether it was solved or not, as [`Trajectory::status`] says.
    ///
    /// ```
    /// use nsdc::report::Status;
    /// use nsdc::{Options, Project};
    ///
    /// let project = Project::from_text("fall.nsd", "
    ///     model fall { param g = 9.81; state h = 1; state v = 0; h' = v; v' = -g; }
    ///     simulate short of fall { horizon 0.25; }");
    /// let values = vec![("g".to_owned(), 2.0), ("v".to_owned(), 0.5)];
    /// let options = Options { values, ..Options::default() };
    /// let run = project.run("short", &options, &mut ()).expect("it compiles");
    /// assert_eq!(run.trajectory.status, Status::Solved);
    /// // A row of values for each instant, and for each state a column.
    /// let height = &run.trajectory.samples.states[0];
    /// let last = run.trajectory.samples.time.len() - 1;
    /// assert_eq!((height.name.as_str(), height.at(last).len()), ("h", 1));
    /// assert!((height.at(last)[0] - (1.0 + 0.5 * 0.25 - 0.25 * 0.25)).abs() < 1e-12);
    /// ```
    ///
    /// It ends early when somebody cancels it, here from what it tells on its way:
    ///
    /// ```
    /// use nsdc::limit::{Cancel, Limit};
    /// use nsdc::report::Status;
    /// use nsdc::watch::{Progress, Told};
    /// use nsdc::{Options, Project};
    ///
    /// let project = Project::from_text("circle.nsd", "
    ///     model circle { state x = 1; state y = 0; x' = -y; y' = x; }
    ///     simulate long of circle { horizon 1e6; }");
    /// let cancel = Cancel::default();
    /// let limit = Limit::default().canceled_by(&cancel);
    /// let options = Options { limit, ..Options::default() };
    /// let mut told = Told(|progress: &Progress<'_>| {
    ///     if progress.share() > Some(1e-4) {
    ///         cancel.cancel();
    ///     }
    /// });
    /// let run = project.run("long", &options, &mut told).expect("it compiles");
    /// assert_eq!(run.trajectory.status, Status::Canceled);
    /// assert!(run.trajectory.samples.time.last() > Some(&100.0));
    /// ```
    ///
    /// # Errors
    ///
    /// Where there is no such experiment, it does not compile, or has no value that is named.
    pub fn run(
        &self,
        experiment: &str,
        options: &Options,
        watch: &mut dyn Watch,
    ) -> Result<Run, Messages> {
        let mut asked = self.ask(experiment, &options.values, &options.words())?;
        if asked.experiment.is_sensed() {
            asked.experiment.to_mut().open_sensed();
        }
        let (exprs, mut clock) = (Exprs::new(), Clock::default());
        let (mut compiled, diags) = asked.compiled(&exprs, &self.file, &mut clock)?;
        if !options.ends_alone {
            compiled.settings.follow_curves();
        }
        if let Some(weights) = &options.weights
            && let Err(diags) = sensed::weigh(&mut compiled, weights)
        {
            return Err(Messages::new(diags, asked.sources));
        }
        let request = options.request();
        let source = ensemble::Source {
            file: &self.file,
            experiment: &asked.experiment,
            overrides: &asked.overrides,
        };
        let found = launch::whole(self, source, &mut compiled, &request, watch);
        let mut trajectory = match found {
            Ok(trajectory) => trajectory,
            Err(diags) => return Err(Messages::new(diags, asked.sources)),
        };
        trajectory.quality.stats.compile_s = self.compile_seconds(&clock);
        trajectory.warnings.splice(0..0, Warning::all(&diags));
        Ok(Run::new(&compiled, trajectory, options, asked.sources))
    }

    /// What a run of an experiment with these values and settings looks like, as SVG. Of an optimization it is drawn with
    /// what was solved, by [`Options::figure`].
    ///
    /// # Errors
    ///
    /// Where there is no such experiment, or it does not compile.
    #[cfg(feature = "plots")]
    pub fn draw(
        &self,
        experiment: &str,
        options: &Options,
        trajectory: &Trajectory,
    ) -> Result<String, Messages> {
        let asked = self.ask(experiment, &options.values, &options.words())?;
        let exprs = Exprs::new();
        let (compiled, _) = asked.compiled(&exprs, &self.file, &mut Clock::default())?;
        Ok(crate::project::figure::draw(&compiled, trajectory))
    }

    /// Compiles a simulation once, for many runs with other values of the parameters that are `open`.
    ///
    /// ```
    /// use nsdc::Project;
    ///
    /// let project = Project::from_text("decay.nsd", "
    ///     model decay { param k = 1; state x = 1; x' = -k*x; }
    ///     simulate d of decay { horizon 1; }");
    /// let prepared = project.prepare("d", &["k"], &[]).expect("it compiles");
    /// let mut runs = prepared.runs();
    /// for k in [0.5, 1.0, 2.0] {
    ///     let outcome = runs.run(&[k], None, 1.0, &mut ()).expect("it is in range");
    ///     assert!((outcome.x[0] - f64::exp(-k)).abs() < 1e-8);
    /// }
    /// ```
    ///
    /// # Errors
    ///
    /// Where it has to be compiled for each of their values, or there are none of these names.
    pub fn prepare(
        &self,
        experiment: &str,
        open: &[&str],
        values: &[(String, f64)],
    ) -> Result<Prepared, NotPrepared> {
        let mut asked = self
            .ask(experiment, values, &[])
            .map_err(NotPrepared::NotAsked)?;
        let paths = asked.paths(open)?;
        Prepared::new(&self.file, &asked.experiment, &asked.overrides, &paths)
    }

    /// Compiles an optimal control problem once, to be solved with many values of the parameters that are `open` and from
    /// many initial states: see [`optimize::Prepared`].
    ///
    /// # Errors
    ///
    /// Where there is no such experiment, it does not compile, or has no value that is named; where it optimizes nothing,
    /// or in numerical time; where another value of a parameter is another program.
    pub fn prepare_optimal<'e>(
        &self,
        exprs: &'e Exprs,
        experiment: &str,
        open: &[&str],
        values: &[(String, f64)],
    ) -> Result<optimize::Prepared<'e>, PrepareError> {
        let asked = self.ask(experiment, values, &[]);
        let mut asked = asked.map_err(PrepareError::NotCompiled)?;
        asked.experiment.to_mut().open = asked.paths(open)?;
        let compiled = asked.compiled(exprs, &self.file, &mut Clock::default());
        let (compiled, diags) = compiled.map_err(PrepareError::NotCompiled)?;
        let Some(task) = &compiled.settings.optimize else {
            return Err(PrepareError::NoTask(experiment.to_owned()));
        };
        match launch::sampled(self, task, &Request::default()) {
            Ok(sampled) => optimize::Prepared::new(&compiled, sampled, diags, asked.sources),
            Err(diags) => {
                let messages = Messages::new(diags, asked.sources);
                Err(PrepareError::NotCompiled(messages))
            }
        }
    }

    /// An experiment by its name, with values and settings that replace its own.
    pub(crate) fn ask(
        &self,
        experiment: &str,
        values: &[(String, f64)],
        settings: &[(String, String)],
    ) -> Result<Asked<'_>, Messages> {
        let mut sources = self.sources.clone();
        if self.diags.has_errors() {
            return Err(Messages::new(self.diags.clone(), sources));
        }
        let mut experiment = Cow::Borrowed(self.named(experiment).map_err(Messages::of)?);
        let values = values
            .iter()
            .map(|(name, value)| format!("{name}={value:?}"));
        let values: Vec<String> = values.collect();
        let mut diags = Diagnostics::new();
        let overrides = bindings((&mut sources, &mut diags), "values", &values);
        for (name, words) in settings {
            let found = (&mut sources, &mut diags);
            replace_setting(found, experiment.to_mut(), name, words);
        }
        match overrides.filter(|_| !diags.has_errors()) {
            Some(overrides) => Ok(Asked {
                experiment,
                overrides,
                sources,
            }),
            None => Err(Messages::new(diags, sources)),
        }
    }
}

/// What is run.
pub(crate) struct Asked<'p> {
    pub experiment: Cow<'p, Experiment>,
    pub overrides: Vec<Bind>,
    /// All texts, those of the values with them.
    pub sources: SourceMap,
}

impl Asked<'_> {
    /// It compiled, with the warnings of that.
    ///
    /// # Errors
    ///
    /// Where it does not compile.
    pub fn compiled<'e>(
        &self,
        exprs: &'e Exprs,
        file: &File,
        clock: &mut Clock,
    ) -> Result<(Compiled<'e>, Diagnostics), Messages> {
        let (of, overrides, mut diags) = (&self.experiment, &self.overrides, Diagnostics::new());
        let compiled = compile(exprs, file, of, overrides, clock, &mut diags);
        match compiled.filter(|_| !diags.has_errors()) {
            Some(compiled) => Ok((compiled, diags)),
            None => Err(Messages::new(diags, self.sources.clone())),
        }
    }

    /// Names of parameters as they stand on the left of `=` in `with`.
    pub fn paths(&mut self, names: &[&str]) -> Result<Vec<Path>, NotPrepared> {
        let paths = names.iter().map(|name| {
            let path = prepared::path(name, &mut self.sources);
            path.ok_or_else(|| NotPrepared::NoParameter((*name).to_owned()))
        });
        paths.collect()
    }
}
