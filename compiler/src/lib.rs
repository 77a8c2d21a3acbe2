#![doc = include_str!("../README.md")]

#[cfg(feature = "cli")]
pub mod cli;
pub mod diagnostics;
pub mod lowering;
pub mod model;
pub mod nl;
pub mod optimize;
pub mod project;
pub mod report;
pub mod simulate;
pub mod source;
pub mod study;
pub mod syntax;
pub mod system;
#[cfg(test)]
mod testing;

use std::collections::HashMap;

pub use nsd_expr as expr;
use nsd_solver::integrate::tableau::Family;
pub use nsd_solver::runtime::{limit, threads};

pub use self::diagnostics::messages::Messages;
pub use self::project::run::{Options, Run};
pub use self::project::{Project, prepared, session, sweep, watch};
pub use self::source::files;

use self::diagnostics::Diagnostics;
use self::expr::{Expr, Exprs, Var};
use self::model::{Model, Units};
use self::project::clock::Clock;
use self::report::Series;
use self::report::expect::{self, ExpectError, Subject};
use self::source::SourceMap;
use self::syntax::{Bind, Experiment, File, GuessSource, Item, SettingKind};
use self::system::algebraic::following;
use self::system::experiment::{ExperimentError, Feature, Method, MethodKind, Settings};
use self::system::task::{Lengths, Shape};
use self::system::{Extent, Role, Switch, System, freezing};

/// An experiment that is ready to run.
pub struct Compiled<'e> {
    /// The model, with the structural constants of the experiment.
    pub model: Model<'e>,
    /// What the experiment asks for.
    pub settings: Settings<'e>,
    /// The piecewise smooth system.
    pub system: System<'e>,
    /// Of a fit, the other runs that are compared with data.
    pub others: Vec<Compiled<'e>>,
}

impl<'e> Compiled<'e> {
    /// The system after the lowerings of jumps and relays that the experiment asks for.
    pub fn lowered(&self) -> System<'e> {
        if self.settings.freezes() {
            let frozen = freezing::freeze(&self.system, self.settings.pace());
            return frozen.expect("compilation has checked it").system;
        }
        self.system.clone()
    }

    /// The parameters p of the model with their values, those that are computed from others among them: of free ones, what
    /// was found once the system is the solved one.
    pub fn parameters(&self) -> Vec<Series> {
        let values = &self.settings.values;
        let solved = self.system.exogenous.params.iter();
        let solved = solved.filter_map(|param| Some((param.var.as_variable()?, param.value)));
        let solved: HashMap<Var, f64> = solved.collect();
        let number = |var: Var| {
            let number = solved.get(&var).or_else(|| values.numbers.get(&var));
            number.copied().unwrap_or(f64::NAN)
        };
        let params = self.model.quantities.params.iter();
        let series = params.map(|param| {
            let entries = param.vars.iter();
            let entries = entries.map(|var| var.substitute(&values.signals).eval(&number));
            Series {
                name: param.name.clone(),
                shape: param.shape.sizes(),
                values: entries.collect(),
            }
        });
        series.collect()
    }

    /// What its expectations are about; a free horizon is its guess.
    pub fn subject<'s>(&'s self, sources: &'s SourceMap) -> Subject<'s, 'e> {
        Subject {
            model: &self.model,
            system: &self.system,
            horizon: self.settings.horizon,
            has_steps: self.settings.numerics.method.has_steps(),
            sources,
        }
    }
}

/// From the syntax of an experiment to the system it is about: model, settings, system.
///
/// What its outputs and expectations do not need is left out. `overrides` come from outside the file
/// and replace what `with` says. `None` after an error.
pub fn compile<'e>(
    exprs: &'e Exprs,
    file: &File,
    experiment: &Experiment,
    overrides: &[Bind],
    clock: &mut Clock,
    diags: &mut Diagnostics,
) -> Option<Compiled<'e>> {
    compile_to(
        exprs,
        file,
        experiment,
        overrides,
        Extent::Needed,
        clock,
        diags,
    )
}

/// [`compile`], to some extent: of a fit, each run that is compared with data.
fn compile_to<'e>(
    exprs: &'e Exprs,
    file: &File,
    experiment: &Experiment,
    overrides: &[Bind],
    extent: Extent,
    clock: &mut Clock,
    diags: &mut Diagnostics,
) -> Option<Compiled<'e>> {
    let runs = experiment.runs().into_iter().map(|run| {
        let mut found = Diagnostics::new();
        let one = compile_one(exprs, file, &run, overrides, extent, clock, &mut found);
        found.remove_known(diags);
        if let Some(data) = run.compared().next().filter(|_| !run.own().is_empty()) {
            found.point_beside("in the run of these data", data.span);
        }
        diags.append(found);
        one
    });
    // What is wrong with one run does not hide what is wrong with another one.
    let all: Vec<Option<Compiled<'e>>> = runs.collect();
    let mut all = all.into_iter().collect::<Option<Vec<_>>>()?.into_iter();
    let mut compiled = all.next()?;
    compiled.others = all.collect();
    pass(study::fit::join(&mut compiled, experiment).err(), diags)?;
    Some(compiled)
}

/// An experiment, or what a run of it is.
fn compile_one<'e>(
    exprs: &'e Exprs,
    file: &File,
    experiment: &Experiment,
    overrides: &[Bind],
    extent: Extent,
    clock: &mut Clock,
    diags: &mut Diagnostics,
) -> Option<Compiled<'e>> {
    let (home, definition) = model::find(file, &experiment.model, diags)?;
    let (name, with) = (&definition.name.name, given(experiment, overrides));
    let model = clock.time("model", || {
        resolved(exprs, file, (home, name), &with, diags)
    })?;
    clock.time("system", || {
        let mut settings =
            system::experiment::evaluate(&model, experiment, (overrides, &file.data), diags)?;
        missing_guesses(file, &settings, diags)?;
        model::check_experiment(file, home, definition, experiment, overrides, diags)?;
        // What cannot be run is refused before it is lowered, which may be long.
        pass(refused_contacts(&model, &settings), diags)?;
        let system = system::lower(&model, &settings, extent, diags)?;
        let refused = line_of_choices(&system, &settings)
            .or_else(|| line_of_lengths(&settings))
            .or_else(|| settings.refuses_branches(&system))
            .or_else(|| settings.kicks_too_much(&system));
        pass(refused, diags)?;
        if settings.freezes() {
            return frozen(model, settings, system, diags);
        }
        pass(refused_switches(&system, &settings), diags)?;
        optimize::steps::begin_intervals(&system, &mut settings);
        let system = discretizable(system, &settings, diags)?;
        pass(refused_impulses(&system, &settings), diags)?;
        Some(Compiled {
            model,
            settings,
            system,
            others: Vec::new(),
        })
    })
}

/// A model with structural constants of an experiment, as it is seen from the file of that.
fn resolved<'e>(
    exprs: &'e Exprs,
    file: &File,
    (home, name): (&File, &str),
    with: &[Bind],
    diags: &mut Diagnostics,
) -> Option<Model<'e>> {
    let mut model = model::resolve(exprs, home, name, with, diags)?;
    if !std::ptr::eq(home, file) {
        model.see_from(file, diags);
    }
    Some(model)
}

/// The entries of all states, and the units of all quantities, where the model of an experiment is sound and has what overrides name, whatever their values
/// are.
pub fn check_names(
    file: &File,
    experiment: &Experiment,
    overrides: &[Bind],
    diags: &mut Diagnostics,
) -> Option<(Vec<String>, Units)> {
    let exprs = Exprs::new();
    let (home, definition) = model::find(file, &experiment.model, diags)?;
    let (name, with) = (&definition.name.name, given(experiment, overrides));
    let model = resolved(&exprs, file, (home, name), &with, diags)?;
    for bind in overrides {
        model.scope.target(&bind.target, diags);
    }
    let entries = model.quantities.states.iter().flat_map(|state| {
        let entry = |k| state.shape.entry_name(&state.name, k);
        (0..state.vars.len()).map(entry)
    });
    (!diags.has_errors()).then(|| (entries.collect(), Units::of(&model)))
}

/// Goes on unless something is refused.
fn pass(refused: Option<ExperimentError>, diags: &mut Diagnostics) -> Option<()> {
    match refused {
        Some(error) => {
            diags.push(error);
            None
        }
        None => Some(()),
    }
}

/// Lowerings of contacts that the method does not take, and contacts without one that it does.
fn refused_contacts(model: &Model, settings: &Settings) -> Option<ExperimentError> {
    if let Some(error) = without_impulses(settings) {
        return Some(error);
    }
    if settings.freezes() && !settings.numerics.method.kind().takes(Feature::TimeFreezing) {
        return Some(ExperimentError::Lowering {
            name: "timefreezing".to_owned(),
            with: "by this method ",
            help: "leave the method out, or write `method fesd;`",
            span: settings.span,
        });
    }
    settings.refused_of_model(model)
}

/// Relays, jumps, projections, algebraic states and switches beside contacts that the method does not take.
fn refused_switches(system: &System, settings: &Settings) -> Option<ExperimentError> {
    let steps = !system.jumps.impulsive.is_empty();
    let refused = settings.refused_of_system(system);
    refused.or_else(|| beside_contacts(system, settings).filter(|_| steps))
}

/// The system as the discretization of the method takes it: smoothed where that is the method, with consistent algebraic
/// states, and with a lowering where one is needed.
fn discretizable<'e>(
    system: System<'e>,
    settings: &Settings<'e>,
    diags: &mut Diagnostics,
) -> Option<System<'e>> {
    let mut system = match &settings.numerics.method {
        Method::Smoothing(options) => system::switches::smoothing::smooth(&system, options),
        _ => system,
    };
    let steps = !system.jumps.impulsive.is_empty();
    let kind = settings.numerics.method.kind();
    let needs = kind.needs_dcs() && !steps || settings.optimize.is_some();
    let all = &system.exogenous.data;
    for data in settings.optimize.iter().flat_map(|_| all) {
        pass(bends(data, settings).err(), diags)?;
    }
    if needs && system.switches.iter().any(|k| k.role != Role::Step) {
        pass(open_algebraics(&system, settings), diags)?;
        if let Err(failure) = simulate::settle(&mut system, settings.horizon) {
            diags.push(failure);
            return None;
        }
    }
    let lowerings = lowering::dcs::check(&system, &settings.numerics.lowerings, needs);
    lowerings.map_err(|error| diags.push(error)).ok()?;
    Some(system)
}

/// What `lower impact` does not take.
fn refused_impulses(system: &System, settings: &Settings) -> Option<ExperimentError> {
    if !settings.takes_impulses() {
        return None;
    }
    let refused = |with, help, span| ExperimentError::Lowering {
        name: "impact".to_owned(),
        with,
        help,
        span,
    };
    let is_run = settings.optimize.is_none();
    if let Some(data) = system.exogenous.data.first().filter(|_| is_run) {
        return Some(refused(
            "for a run with signals from tables or with `floor` ",
            "write it as a formula in `time` without `floor` and `mod`, or leave out `lower impact` and the method",
            data.span,
        ));
    }
    switching_law(system).map(|contact| {
        refused(
            "for a contact whose law switches ",
            "give it a gap, a slip, a restitution, a friction and a mass without switches, or let `method event` run it",
            contact.span,
        )
    })
}

/// Refuses algebraic states that follow what is decided where their values at left ends of elements are read.
fn open_algebraics(system: &System, settings: &Settings) -> Option<ExperimentError> {
    let task = settings.optimize.as_ref()?;
    let follows = following::following(system);
    if !follows.states.contains(&true) {
        return None;
    }
    let what = follows.what;
    let kept = system.switches.iter().find(|k| k.role != Role::Step)?;
    if let Some(span) = following::reader(system, &follows) {
        return Some(ExperimentError::OpenAlgebraic { what, span });
    }
    // Elsewhere left ends are nodes, or right ends are none.
    let is_radau = task.discretization.scheme.0 == Family::RadauIia;
    let has_other_lefts = settings.freezes() || settings.takes_impulses();
    (!is_radau || has_other_lefts).then(|| ExperimentError::OpenAlgebraicScheme {
        what,
        span: kept.spans[0],
    })
}

/// What an experiment asks for besides `lower impact` that has no impulses.
fn without_impulses(settings: &Settings) -> Option<ExperimentError> {
    let is_run = settings.optimize.is_none();
    let takes_impulses = settings.numerics.method.kind().takes(Feature::Impulses);
    let span = settings.span;
    match settings.takes_impulses() {
        true if settings.freezes() => Some(ExperimentError::Lowering {
            name: "impact".to_owned(),
            with: "together with `timefreezing` ",
            help: "both are ways to take contacts: leave out one of them",
            span,
        }),
        true if is_run && !takes_impulses => {
            let method = match settings.numerics.method.kind() {
                MethodKind::Auto => MethodKind::Event,
                other => other,
            };
            let method = method.word();
            Some(ExperimentError::NoElements { method, span })
        }
        _ => None,
    }
}

/// A contact whose restitution, friction or directions depend on the side of a switch.
fn switching_law<'s, 'e>(system: &'s System<'e>) -> Option<&'s system::Contact<'e>> {
    let alphas = system.switches.iter();
    let alphas: Vec<_> = alphas
        .filter_map(|switch| switch.alpha.as_variable())
        .collect();
    let switches = |e: Expr| alphas.iter().any(|&alpha| e.depends_on(alpha));
    let mut contacts = system.jumps.contacts.iter();
    contacts.find(|contact| contact.exprs().any(switches))
}

/// What steps of time with contacts do not take.
fn beside_contacts(system: &System, settings: &Settings) -> Option<ExperimentError> {
    if let Method::Timestepping(options) = &settings.numerics.method
        && options.scheme.is_some()
    {
        return Some(ExperimentError::SchemeOfContacts {
            span: settings.span,
        });
    }
    let jumps = |switch: &&Switch| !switch.continuity.is_continuous();
    let switch = system.switches.iter().find(jumps)?;
    Some(ExperimentError::SwitchBesideContacts {
        name: switch.name.clone(),
        span: switch.spans.first().copied().unwrap_or(settings.span),
    })
}

/// Refuses straight lines for controls with finite sets of values.
fn line_of_choices(system: &System, settings: &Settings) -> Option<ExperimentError> {
    let task = system.task.as_ref()?;
    let control = (task.controls.iter())
        .filter(|_| task.shape == Shape::Linear)
        .find(|control| control.values().is_some())?;
    Some(ExperimentError::LinesOfChoices {
        name: control.name.clone(),
        control: control.span,
        span: settings.span,
    })
}

/// Refuses straight lines for controls over intervals that are not equal.
fn line_of_lengths(settings: &Settings) -> Option<ExperimentError> {
    let grid = &settings.optimize.as_ref()?.discretization;
    let is_wrong = grid.controls == Shape::Linear && grid.lengths != Lengths::Equal;
    is_wrong.then_some(ExperimentError::LinesOfLengths {
        span: settings.span,
    })
}

/// Refuses data that bend inside of control intervals.
fn bends(data: &model::Data, settings: &Settings) -> Result<(), ExperimentError> {
    let Some(task) = &settings.optimize else {
        return Ok(());
    };
    let horizon = task.horizon.unwrap_or((settings.horizon, settings.horizon));
    // Intervals whose lengths are their own have ends anywhere.
    let intervals = match task.discretization.lengths {
        Lengths::Equal => task.discretization.intervals,
        _ => 1,
    };
    match lowering::discretize::inside(&data.table, horizon, intervals) {
        None => Ok(()),
        Some(time) => Err(ExperimentError::Bends {
            name: data.name.clone(),
            time,
            span: settings.span,
        }),
    }
}

/// An experiment whose jumps and relays are lowered by time-freezing.
fn frozen<'e>(
    model: Model<'e>,
    settings: Settings<'e>,
    system: System<'e>,
    diags: &mut Diagnostics,
) -> Option<Compiled<'e>> {
    let frozen = freezing::freeze(&system, settings.pace());
    let frozen = frozen.map_err(|error| diags.push(error)).ok()?;
    let needs = settings.numerics.method.kind().needs_dcs() || settings.optimize.is_some();
    let lowerings = lowering::dcs::check(&frozen.system, &settings.numerics.lowerings, needs);
    lowerings.map_err(|error| diags.push(error)).ok()?;
    Some(Compiled {
        model,
        settings,
        system,
        others: Vec::new(),
    })
}

/// Reports guesses from experiments that the file does not have.
fn missing_guesses(file: &File, settings: &Settings, diags: &mut Diagnostics) -> Option<()> {
    let sources = settings.optimize.iter().flat_map(|task| &task.sources);
    let missing = sources.filter_map(|source| match source {
        GuessSource::Experiment(path) => Some(path),
        GuessSource::File(..) => None,
    });
    let is_there = |path: &&syntax::Path| {
        file.items.iter().any(|item| match item {
            Item::Experiment(experiment) => experiment.name.name == path.head.name,
            _ => false,
        })
    };
    let missing: Vec<_> = missing.filter(|path| !is_there(path)).collect();
    for path in &missing {
        diags.push(ExperimentError::BadGuess {
            name: path.head.name.clone(),
            reason: "the file has no experiment of that name".to_owned(),
            span: path.span,
        });
    }
    missing.is_empty().then_some(())
}

/// Finds what is wrong with the models and experiments of a file, each mistake once.
///
/// Nothing of a model is left out here, whatever its experiments need.
/// What could not be read, as `diags` says, does not hide what is wrong elsewhere in the models.
pub fn check(file: &File, sources: &SourceMap, diags: &mut Diagnostics) {
    let unreadable = diags.has_errors();
    let mut add = |mut found: Diagnostics| {
        found.remove_known(diags);
        diags.append(found);
    };
    let mut found = Diagnostics::new();
    model::check_file(file, &mut found);
    add(found);

    let mut broken: Vec<&str> = Vec::new();
    for item in &file.items {
        let Item::Model(definition) = item else {
            continue;
        };
        let mut found = Diagnostics::new();
        model::resolve(&Exprs::new(), file, &definition.name.name, &[], &mut found);
        if found.has_errors() {
            broken.push(&definition.name.name);
        }
        add(found);
    }
    // A setting that could not be read would seem to be missing.
    if unreadable {
        return;
    }
    for item in &file.items {
        let mut found = Diagnostics::new();
        match item {
            Item::ExpectDiagnostic(expected) => {
                let error = ExpectError::unknown_code(&expected.severity.name, &expected.code);
                error.into_iter().for_each(|error| found.push(error));
            }
            // What is wrong with the model of an experiment has been said.
            Item::Experiment(experiment)
                if !broken.contains(&experiment.model.head.name.as_str()) =>
            {
                check_experiment((file, sources), experiment, &mut found);
            }
            _ => {}
        }
        add(found);
    }
}

/// Finds what is wrong with an experiment whose model is right.
fn check_experiment(
    (file, sources): (&File, &SourceMap),
    experiment: &Experiment,
    found: &mut Diagnostics,
) {
    let (exprs, mut clock) = (Exprs::new(), Clock::default());
    let extent = Extent::Whole;
    let compiled = compile_to(&exprs, file, experiment, &[], extent, &mut clock, found);
    let Some(compiled) = compiled else {
        return;
    };
    let subject = compiled.subject(sources);
    expect::check(&subject, &compiled.settings.expects, found);
    // A lowering that is asked for by name must exist, whatever the method needs.
    let lowerings = &compiled.settings.numerics.lowerings;
    if !lowerings.is_empty()
        && let Err(error) = lowering::dcs::lower(&compiled.lowered(), lowerings)
    {
        found.push(error);
    }
    if experiment.is_sensed() && !found.has_errors() {
        check_sensed(file, experiment, found);
    }
    if let Some(closed_loop) = &compiled.settings.numerics.closed_loop
        && !found.has_errors()
    {
        found.append(study::mpc::check(file, &compiled, closed_loop));
    }
    // What a fit frees is open already.
    if compiled.settings.recording.fit.is_some() && !found.has_errors() {
        for run in [&compiled].into_iter().chain(&compiled.others) {
            if let Err(more) = project::sensed::sensor(run) {
                found.append(more);
            }
        }
        found.remove_repeated();
    }
}

/// Finds what a run is asked to be differentiated by and is not: that shows where it is compiled with that open.
fn check_sensed(file: &File, experiment: &Experiment, diags: &mut Diagnostics) {
    let mut opened = experiment.clone();
    opened.open_sensed();
    let exprs = Exprs::new();
    let mut found = Diagnostics::new();
    let compiled = compile_to(
        &exprs,
        file,
        &opened,
        &[],
        Extent::Whole,
        &mut Clock::default(),
        &mut found,
    );
    if let Some(compiled) = compiled
        && let Err(more) = project::sensed::sensor(&compiled)
    {
        found.append(more);
    }
    found.remove_known(diags);
    diags.append(found);
}

/// The `with` of an experiment, without what is overridden.
fn given(experiment: &Experiment, overrides: &[Bind]) -> Vec<Bind> {
    let is_overridden = |bind: &&Bind| {
        let name = &bind.target.head.name;
        let is_whole =
            |other: &Bind| other.target.head.name == *name && other.target.rest.is_empty();
        bind.target.rest.is_empty() && overrides.iter().any(is_whole)
    };
    let with = experiment
        .settings
        .iter()
        .filter_map(|setting| match &setting.kind {
            SettingKind::With(binds) => Some(binds),
            _ => None,
        });
    let own = experiment.own();
    let is_owned = |bind: &&Bind| {
        !own.iter()
            .any(|other| other.target.to_string() == bind.target.to_string())
    };
    let kept = with.flatten().filter(|bind| !is_overridden(bind));
    let kept = kept.chain(overrides).filter(is_owned);
    kept.chain(own).cloned().collect()
}
