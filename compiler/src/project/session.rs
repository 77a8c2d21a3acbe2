//! Runs of the experiments of a project, one after another on one thread, which keep what they have compiled.

use std::cmp::Ordering;

use crate::check_names;
use crate::diagnostics::Diagnostics;
use crate::diagnostics::messages::Messages;
use crate::expr::Exprs;
use crate::project::ensemble::Source;
use crate::project::prepared::path;
use crate::project::rerun::Rerun;
use crate::project::run::{Options, Run};
use crate::project::watch::Watch;
use crate::project::{Project, bindings};
use crate::source::SourceMap;
use crate::syntax::{ExperimentKind, Path};

/// Runs of the experiments of a project with any values. What a simulation is compiled to serves all values on the same
/// sides of zero, where it can: such a run compiles nothing. What comes of a run depends on its own values alone, whatever
/// was run before.
///
/// ```
/// use nsdc::expr::Exprs;
/// use nsdc::session::Session;
/// use nsdc::{Options, Project};
///
/// let project = Project::from_text("decay.nsd", "
///     model decay { param k = 1; state x = 1; x' = -k*x; }
///     simulate d of decay { horizon 1; }");
/// let exprs = Exprs::new();
/// let mut session = Session::new(&exprs, &project);
/// for k in [0.5, 1.0, 2.0] {
///     let values = vec![("k".to_owned(), k)];
///     let options = Options { values, ..Options::default() };
///     let run = session.run("d", &options, &mut ()).expect("it compiles");
///     let x = run.trajectory.samples.states[0].values.last();
///     assert!(x.is_some_and(|x| (x - f64::exp(-k)).abs() < 1e-8));
/// }
/// assert_eq!(session.kept(), 1);
/// ```
pub struct Session<'e> {
    exprs: &'e Exprs,
    project: &'e Project,
    kept: Vec<Kept<'e>>,
}

/// An experiment with settings, and with values of which the sides of zero are known.
struct Kept<'e> {
    experiment: String,
    settings: Vec<(String, String)>,
    ends_alone: bool,
    sides: Vec<(String, Option<Ordering>)>,
    /// None where it has to be compiled for each of the values.
    rerun: Option<Rerun<'e>>,
    sources: SourceMap,
}

impl Kept<'_> {
    fn serves(&self, experiment: &str, options: &Options) -> bool {
        let sides = options
            .values
            .iter()
            .map(|(name, value)| (name, side(*value)));
        self.experiment == experiment
            && self.ends_alone == options.ends_alone
            && self.settings == options.settings
            && sides.eq(self.sides.iter().map(|(name, side)| (name, *side)))
    }
}

fn side(value: f64) -> Option<Ordering> {
    value.partial_cmp(&0.0)
}

impl<'e> Session<'e> {
    /// Nothing has been compiled; expressions are made in `exprs`.
    pub fn new(exprs: &'e Exprs, project: &'e Project) -> Self {
        let kept = Vec::new();
        Session {
            exprs,
            project,
            kept,
        }
    }

    /// How many experiments with settings and sides of values are kept.
    pub fn kept(&self) -> usize {
        self.kept.len()
    }

    /// [`Project::run`].
    ///
    /// # Errors
    ///
    /// Its own.
    pub fn run(
        &mut self,
        experiment: &str,
        options: &Options,
        watch: &mut dyn Watch,
    ) -> Result<Run, Messages> {
        let known = self.kept.iter();
        let place = { known }.position(|kept| kept.serves(experiment, options));
        let place = place.unwrap_or_else(|| {
            let kept = self.compiled(experiment, options);
            self.kept.push(kept);
            self.kept.len() - 1
        });
        let kept = &mut self.kept[place];
        if let Some(rerun) = &mut kept.rerun
            && let Some(run) = again(rerun, options, watch, &kept.sources)
        {
            return Ok(run);
        }
        self.project.run(experiment, options, watch)
    }

    /// An experiment for all values on these sides of zero.
    fn compiled(&self, experiment: &str, options: &Options) -> Kept<'e> {
        let values = options.values.iter();
        let sides = values.map(|(name, value)| (name.clone(), side(*value)));
        let mut kept = Kept {
            experiment: experiment.to_owned(),
            settings: options.settings.clone(),
            ends_alone: options.ends_alone,
            sides: sides.collect(),
            rerun: None,
            sources: SourceMap::default(),
        };
        let mut near = options.values.iter().all(|(_, value)| value.is_finite());
        // The experiment's own values first; where they are on other sides, ones.
        for own in [true, false] {
            if near && let Some((rerun, sources)) = self.rerun(experiment, options, own) {
                near = !rerun.takes(&numbers(options));
                (kept.rerun, kept.sources) = (Some(rerun).filter(|_| !near), sources);
            }
        }
        kept
    }

    /// An experiment of which values that are not zero stay open, each compiled at its own value or at one.
    fn rerun(
        &self,
        experiment: &str,
        options: &Options,
        own: bool,
    ) -> Option<(Rerun<'e>, SourceMap)> {
        let asked = self.project.ask(experiment, &[], &options.settings).ok()?;
        // An optimum is looked for with all that its experiment says, anew.
        if asked.experiment.kind == ExperimentKind::Optimize {
            return None;
        }
        let mut sources = asked.sources;
        let names = options.values.iter().map(|(name, value)| match *value {
            0.0 => Some(None),
            _ => path(name, &mut sources).map(Some),
        });
        let names: Vec<Option<Path>> = names.collect::<Option<_>>()?;
        let fixed = options.values.iter().filter_map(|(name, value)| {
            let value = match *value {
                0.0 => 0.0,
                value => (!own).then(|| value.signum())?,
            };
            Some(format!("{name}={value:?}"))
        });
        let fixed: Vec<String> = fixed.collect();
        let found = (&mut sources, &mut Diagnostics::new());
        let overrides = bindings(found, "values", &fixed)?;
        let source = Source {
            file: &self.project.file,
            experiment: &asked.experiment,
            overrides: &overrides,
        };
        let diags = &mut Diagnostics::new();
        let (states, _) = check_names(source.file, source.experiment, &overrides, diags)?;
        let rerun = Rerun::new(self.exprs, self.project, source, &names, &states)?;
        Some((rerun.following(!options.ends_alone)?, sources))
    }
}

fn numbers(options: &Options) -> Vec<f64> {
    options.values.iter().map(|(_, value)| *value).collect()
}

/// A run of what has been compiled; none where it has to be compiled for these values.
fn again(
    rerun: &mut Rerun<'_>,
    options: &Options,
    watch: &mut dyn Watch,
    sources: &SourceMap,
) -> Option<Run> {
    let mut trajectory = rerun.run(&numbers(options), &options.request(), watch)?;
    let compiled = rerun.compiled();
    trajectory.setup.parameters = compiled.parameters();
    Some(Run::new(compiled, trajectory, options, sources.clone()))
}
