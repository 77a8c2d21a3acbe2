//! Runs of the experiments of a project, one after another on one thread, which keep what they have compiled.

use crate::check_names;
use crate::diagnostics::Diagnostics;
use crate::diagnostics::messages::Messages;
use crate::expr::Exprs;
use crate::project::Project;
use crate::project::clock::Clock;
use crate::project::rerun::Rerun;
use crate::project::reruns::Reruns;
use crate::project::run::{Options, Run};
use crate::project::watch::Watch;
use crate::source::SourceMap;
use crate::syntax::ExperimentKind;

/// Experiments with settings and names of values that are kept; beyond, those that came first are compiled again.
const MOST: usize = 16;

/// Runs of the experiments of a project with any values. What a simulation is compiled to serves all values on the same
/// sides of zero and all tolerances: such a run compiles nothing. What comes of a run depends on its own values alone, whatever
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

/// An experiment with settings, and with the names of values.
struct Kept<'e> {
    experiment: String,
    settings: Vec<(String, String)>,
    ends_alone: bool,
    names: Vec<String>,
    reruns: Reruns<'e>,
    sources: SourceMap,
}

impl Kept<'_> {
    fn serves(&self, experiment: &str, options: &Options) -> bool {
        let names = options.values.iter().map(|(name, _)| name);
        self.experiment == experiment
            && self.ends_alone == options.ends_alone
            && self.settings == options.settings
            && names.eq(&self.names)
    }
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

    /// How many experiments with settings, names and sides of values are kept.
    pub fn kept(&self) -> usize {
        self.kept.iter().map(|kept| kept.reruns.kept()).sum()
    }

    /// [`Project::run`], which it agrees with within the tolerance of the run: not in the last digits where values stay open,
    /// nor in the order of events that coincide.
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
        let values: Vec<f64> = options.values.iter().map(|(_, value)| *value).collect();
        let parsing = self.project.compile_seconds(&Clock::default());
        let again = self.known(experiment, options).and_then(|kept| {
            let following = |rerun: Rerun<'e>| rerun.following(!options.ends_alone);
            let rerun = kept.reruns.of(&values, following)?;
            let seconds = rerun.take_seconds();
            let rerun = rerun.with_tolerance(options.tolerance)?;
            let rerun = rerun.weighing(options.weights.as_deref())?;
            let mut trajectory = rerun.run(&values, &options.request(), watch)?;
            trajectory.quality.stats.compile_s = match seconds {
                0.0 => 0.0,
                seconds => parsing + seconds,
            };
            trajectory.setup.parameters = rerun.compiled().parameters();
            let sources = kept.sources.clone();
            Some(Run::new(rerun.compiled(), trajectory, options, sources))
        });
        match again {
            Some(run) => Ok(run),
            None => self.project.run(experiment, options, watch),
        }
    }

    /// What is kept of an experiment with settings and names, or will be; none where there is nothing to be kept.
    fn known(&mut self, experiment: &str, options: &Options) -> Option<&mut Kept<'e>> {
        let known = self.kept.iter();
        let place = { known }.position(|kept| kept.serves(experiment, options));
        let place = match place {
            Some(place) => place,
            None => {
                let kept = self.begun(experiment, options)?;
                if self.kept.len() == MOST {
                    self.kept.remove(0);
                }
                self.kept.push(kept);
                self.kept.len() - 1
            }
        };
        Some(&mut self.kept[place])
    }

    /// An experiment with settings and names of values, none of which is compiled.
    fn begun(&self, experiment: &str, options: &Options) -> Option<Kept<'e>> {
        let asked = self
            .project
            .ask(experiment, &options.values, &options.settings);
        let asked = asked.ok()?;
        // An optimum, or a fit, is looked for with all that its experiment says, anew.
        if asked.experiment.kind != ExperimentKind::Simulate {
            return None;
        }
        let (file, names, diags) = (&self.project.file, asked.overrides, &mut Diagnostics::new());
        let (states, _) = check_names(file, &asked.experiment, &names, diags)?;
        let mut experiment = asked.experiment.into_owned();
        if experiment.is_sensed() {
            experiment.open_sensed();
        }
        let binds = [Vec::new(), names];
        Some(Kept {
            experiment: experiment.name.name.clone(),
            settings: options.settings.clone(),
            ends_alone: options.ends_alone,
            names: options
                .values
                .iter()
                .map(|(name, _)| name.clone())
                .collect(),
            reruns: Reruns::new(self.exprs, self.project, experiment, binds, states),
            sources: asked.sources,
        })
    }
}
