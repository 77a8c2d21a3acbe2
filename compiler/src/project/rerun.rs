//! Whole runs of one experiment, again and again, with other parameters and initial values.
//!
//! What [`crate::project::prepared`] gives is a system; here it is all that [`crate::simulate::run`] tells: outputs,
//! warnings, the second run that estimates the error. An optimal control problem is solved again without a solution to
//! start from, so that what is found does not depend on what was solved before.

use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::model::Model;
use crate::optimize;
use crate::project::clock::{Clock, Instant};
use crate::project::ensemble::Source;
use crate::project::prepared::{NotPrepared, Opened, Parameter, Target, check_parameters};
use crate::project::sensed::{self, Beside, Sensor};
use crate::project::watch::{Progress, Watch};
use crate::project::{Project, launch};
use crate::report::Trajectory;
use crate::report::expect::{Findings, Resolved};
use crate::simulate::{Plan, Request};
use crate::source::SourceMap;
use crate::syntax::Path;
use crate::system::System;
use crate::system::values::{Values, bounds};
use crate::{Compiled, compile};

/// Why an experiment has to be compiled for each value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoRerun {
    /// It does not compile at these values, or not without a warning, or others on their sides of zero are another system.
    Here,
    /// Whatever the values are.
    Ever,
}

/// An experiment that has been compiled once, for one thread.
pub(crate) struct Rerun<'e> {
    compiled: Compiled<'e>,
    work: Work<'e>,
    /// None for what stays as it is.
    changes: Vec<Option<Target>>,
    /// The tolerance of the experiment.
    own_tolerance: f64,
    /// Its expectations.
    resolved: Resolved<'e>,
    /// What it has taken to compile, until a run has told it.
    seconds: f64,
}

/// What is ready to be run.
enum Work<'e> {
    /// From event to event.
    Events {
        plan: Box<Plan<'e>>,
        /// The parameters that stay open, and by what runs are differentiated.
        sensor: Box<Sensor>,
    },
    Optimal(Box<optimize::Prepared<'e>>),
}

impl<'e> Rerun<'e> {
    /// Compiles an experiment of a project of which parameters and initial values, by their names as they stand in `with`,
    /// change from run to run, or stay as they are for none; `states` are the entries of all states.
    ///
    /// # Errors
    ///
    /// Where it has to be compiled for each of their values.
    pub fn new(
        exprs: &'e Exprs,
        project: &Project,
        source: Source<'_>,
        names: &[Option<Path>],
        states: &[String],
    ) -> Result<Self, NoRerun> {
        let started = Instant::now();
        let is_state = |path: &&Path| states.contains(&path.to_string());
        let open = names.iter().flatten().filter(|path| !is_state(path));
        let open: Vec<Path> = open.cloned().collect();
        let compiled = without_warnings(exprs, source, &open).ok_or(NoRerun::Here)?;
        let system = &compiled.system;
        let mut work = Work::of(project, &compiled).ok_or(NoRerun::Here)?;
        let parameters = work.parameters();
        let sensed = &compiled.settings.recording.sensed;
        let is_asked = |parameter: &Parameter| {
            let mut sensed = sensed.iter().map(|sensed| &sensed.name);
            let mut open = open.iter().map(Path::to_string);
            sensed.any(|name| *name == parameter.name) || open.any(|name| name == parameter.name)
        };
        if !parameters.iter().all(is_asked) || !guesses_as_declared(&compiled) {
            return Err(NoRerun::Ever);
        }
        let starts = work.states(system);
        let change = |path: &Path| {
            let name = path.to_string();
            let parameter = parameters.iter().position(|p| p.name == name);
            let initial = || {
                let place = starts.iter().position(|state| *state == name)?;
                // Where it starts outside of its bounds it is refused.
                let state = system.states.iter().find(|state| state.name == name)?;
                let mut limits = system.recorded.limits.iter();
                let is_bounded = limits.any(|limit| limit.value == state.var);
                (!is_bounded).then_some(Target::Initial(place))
            };
            parameter.map(Target::Parameter).or_else(initial)
        };
        let changes = names.iter().map(|name| match name {
            Some(name) => change(name).map(Some),
            None => Some(None),
        });
        let changes: Option<Vec<Option<Target>>> = changes.collect();
        let changes = changes.ok_or(NoRerun::Ever)?;
        if let Work::Events { sensor, .. } = &mut work {
            sensor.give_initial(changes.iter().flatten());
        }
        Ok(Rerun {
            changes,
            own_tolerance: compiled.settings.numerics.tolerance,
            resolved: Resolved::default(),
            compiled,
            work,
            seconds: started.elapsed().as_secs_f64(),
        })
    }

    /// Changes what runs tell.
    pub fn adapted(mut self, adapt: impl FnOnce(&mut Compiled<'e>)) -> Self {
        adapt(&mut self.compiled);
        self
    }

    /// Lets rows follow curves, or stand at the ends of steps alone; none where each run is one of many seeds.
    pub fn following(mut self, follows: bool) -> Option<Self> {
        let settings = &mut self.compiled.settings;
        if follows {
            settings.follow_curves();
        }
        settings.runs.is_none().then_some(self)
    }

    /// Where something is random, runs have this seed from now on.
    pub fn seed(&mut self, seed: Option<u64>) {
        if let (Some(kicks), Some(seed)) = (&mut self.compiled.settings.kicks, seed) {
            kicks.seed = seed;
        }
    }

    /// Runs have this tolerance from now on, or that of the experiment. None where there is no such tolerance.
    pub fn with_tolerance(&mut self, tolerance: Option<f64>) -> Option<&mut Self> {
        let tolerance = tolerance.unwrap_or(self.own_tolerance);
        self.compiled.settings.numerics.tolerance = tolerance;
        (0.0 < tolerance && tolerance < 1.0).then_some(self)
    }

    /// Runs find the gradient of a sum of what they report from now on, or derivatives of all of it. None where these are no
    /// weights of that.
    pub fn weighing(&mut self, weights: Option<&[(String, Vec<f64>)]>) -> Option<&mut Self> {
        self.compiled.settings.recording.weights = None;
        if let Some(weights) = weights {
            sensed::weigh(&mut self.compiled, weights).ok()?;
        }
        Some(self)
    }

    /// The seconds of its compilation, once; of further runs there are none.
    pub fn take_seconds(&mut self) -> f64 {
        std::mem::take(&mut self.seconds)
    }

    /// The experiment.
    pub fn compiled(&self) -> &Compiled<'e> {
        &self.compiled
    }

    /// How many of its expectations its last run misses, where there are any.
    pub fn missed(&mut self, sources: &SourceMap, run: &Trajectory) -> Option<usize> {
        missed(&self.compiled, sources, &mut self.resolved, run)
    }

    /// The value with which one of the names was compiled; none of an initial value, and of what stays as it is.
    pub fn value(&self, name: usize) -> Option<f64> {
        match self.changes[name]? {
            Target::Parameter(at) => Some(self.work.parameters()[at].value),
            Target::Initial(_) => None,
        }
    }

    /// Whether parameters may have these values, in the order of the names.
    pub fn takes(&self, values: &[f64]) -> bool {
        check_parameters(self.work.parameters(), &self.open(values)).is_ok()
    }

    /// The parameters that stay open, with these values, in the order of the names.
    fn open(&self, values: &[f64]) -> Vec<f64> {
        let known = self.work.parameters().iter();
        let mut open: Vec<f64> = known.map(|parameter| parameter.value).collect();
        for (change, &value) in self.changes.iter().zip(values) {
            if let Some(Target::Parameter(at)) = *change {
                open[at] = value;
            }
        }
        open
    }

    /// A run with these values, in the order of the names. None where the experiment has to be compiled for them.
    pub fn run(
        &mut self,
        values: &[f64],
        request: &Request,
        watch: &mut dyn Watch,
    ) -> Option<Trajectory> {
        let open = self.open(values);
        let mut x0 = self.work.initial(&open)?;
        for (change, &value) in self.changes.iter().zip(values) {
            if let Some(Target::Initial(state)) = *change {
                x0[state] = value;
            }
        }
        match &mut self.work {
            Work::Events { plan, sensor } => {
                if !sensor.opened.set(&mut self.compiled.system, &open, &x0) {
                    return None;
                }
                let (system, settings) = (&self.compiled.system, &self.compiled.settings);
                let told = &mut |progress| watch.progress(&Progress::Simulation(progress));
                let sensing = sensor.asked(settings, &open);
                let asked = (request, sensing.as_ref());
                let mut run = plan.run_sensed(system, settings, asked, told);
                sensed::check_rows(&self.compiled, sensing.as_ref(), &run).ok()?;
                let beside = Beside {
                    compiled: &mut self.compiled,
                    plan,
                    sensor,
                    open: &open,
                    x0: &x0,
                };
                beside.add(request, &mut run);
                Some(run)
            }
            Work::Optimal(prepared) => {
                let solved = prepared.solve(&open, Some(&x0), None, &request.limit, watch);
                let solved = solved.ok()?;
                self.compiled.system = solved.system;
                self.resolved = Resolved::default();
                Some(solved.trajectory)
            }
        }
    }
}

/// How many expectations do not hold in a run, where there are any; `resolved` are those of an earlier run.
pub(crate) fn missed<'e>(
    compiled: &Compiled<'e>,
    sources: &SourceMap,
    resolved: &mut Resolved<'e>,
    run: &Trajectory,
) -> Option<usize> {
    let (subject, expects) = (compiled.subject(sources), &compiled.settings.expects);
    let findings = Findings {
        warnings: run.warnings.iter().map(|w| w.code.clone()).collect(),
        ..Findings::default()
    };
    let missed = || resolved.missed(&subject, expects, run, &findings);
    (!expects.is_empty()).then(missed)
}

impl<'e> Work<'e> {
    /// None where another number is another system.
    fn of(project: &Project, compiled: &Compiled<'e>) -> Option<Self> {
        let (system, settings) = (&compiled.system, &compiled.settings);
        let Some(task) = &settings.optimize else {
            let open: fn(&Compiled<'_>) -> Result<Opened, NotPrepared> =
                match settings.recording.sensed.is_empty() {
                    true => Opened::of,
                    false => Opened::kept,
                };
            let sensor = Sensor::new(compiled, open).ok()?;
            let moves = moves_limits(&compiled.model, &settings.values);
            return (!moves).then(|| Work::Events {
                plan: Box::new(Plan::of_method(system, settings, &sensor.opened.places)),
                sensor: Box::new(sensor),
            });
        };
        let sampled = launch::sampled(project, task, &Request::default()).ok()?;
        let (diags, sources) = (Diagnostics::new(), project.sources.clone());
        let prepared = optimize::Prepared::new(compiled, sampled, diags, sources).ok()?;
        Some(Work::Optimal(Box::new(prepared)))
    }

    fn parameters(&self) -> &[Parameter] {
        match self {
            Work::Events { sensor, .. } => &sensor.opened.parameters,
            Work::Optimal(prepared) => prepared.parameters(),
        }
    }

    /// The names of the states whose initial values are numbers of a run.
    fn states(&self, system: &System<'_>) -> Vec<String> {
        match self {
            Work::Events { .. } => system.states.iter().map(|s| s.name.clone()).collect(),
            Work::Optimal(prepared) => prepared.states().to_vec(),
        }
    }

    /// Their values with those of the parameters; none where these may not have them.
    fn initial(&self, parameters: &[f64]) -> Option<Vec<f64>> {
        match self {
            Work::Events { sensor, .. } => {
                let opened = &sensor.opened;
                check_parameters(&opened.parameters, parameters).ok()?;
                Some(opened.initial(parameters))
            }
            Work::Optimal(prepared) => prepared.initial(parameters).ok(),
        }
    }
}

/// An experiment with parameters that stay open, besides its own; none where there is anything to say about it.
fn without_warnings<'e>(
    exprs: &'e Exprs,
    source: Source<'_>,
    open: &[Path],
) -> Option<Compiled<'e>> {
    let (mut clock, mut diags) = (Clock::default(), Diagnostics::new());
    let mut experiment = source.experiment.clone();
    experiment.open.extend_from_slice(open);
    let (file, overrides) = (source.file, source.overrides);
    let compiled = compile(exprs, file, &experiment, overrides, &mut clock, &mut diags)?;
    diags.is_empty().then_some(compiled)
}

/// Whether what equations solve for is guessed as it is declared: convex programs, and finite elements, start from a solution
/// at the initial values that are compiled.
fn guesses_as_declared(compiled: &Compiled<'_>) -> bool {
    let solves = compiled.settings.numerics.method.kind().needs_dcs()
        || !compiled.model.statements.programs.is_empty();
    !solves || compiled.system.algebraic_states().is_empty()
}

/// Whether parameters that stay open move the bounds of anything that is watched in a run.
fn moves_limits<'e>(model: &Model<'e>, values: &Values<'e>) -> bool {
    let watched = (model
        .quantities
        .states
        .iter()
        .chain(&model.quantities.algebraics))
    .chain(
        model
            .quantities
            .controls
            .iter()
            .chain(&model.quantities.inputs),
    )
    .chain(&model.quantities.connected);
    let mut bounds = watched.flat_map(|quantity| {
        let domain = quantity.domain.iter();
        domain.flat_map(|domain| (0..quantity.vars.len()).map(move |k| bounds(domain, k)))
    });
    bounds.any(|bounds| values.free.first_in(&bounds).is_some())
}
