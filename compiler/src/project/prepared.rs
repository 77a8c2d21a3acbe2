//! An experiment that is compiled once and runs many times, by any method, with other parameters and initial values.
//!
//! What the parameters that stay open reach is compiled as functions of them: other parameters, initial values, rates,
//! surfaces and laws. So another value compiles nothing. It has to be on the same side of zero: a zero takes terms out,
//! and a sign turns sides of surfaces round.
//!
//! Refused are, by their names, parameters with another value of which the system may be another one: those that are zero,
//! in an exponent, or may make a function of time narrow; where elements or steps run, those that decide within their range
//! which named regions there are, or when switches of time change with which others jump; where time is frozen, those that
//! decide which contacts bounce, or whether one can be frozen at all.
//!
//! Runs give what the solver knows: steps and events to an observer, the end, and why it is one. Outputs, bounds of states,
//! expectations and the second run that estimates the error are those of [`crate::simulate::run`].
//!
//! ```
//! use std::ops::ControlFlow;
//! use nsd_solver::event::{Event, Observer, Segment};
//! use nsd_solver::hybrid::Status;
//! use nsdc::prepared::Prepared;
//!
//! let text = "model ball {
//!   param g = 9.81; param e = 0.9;
//!   state q = 1; state v = 0;
//!   q' = v; v' = -g;
//!   jump floor when q <= 0 and v < 0 { v := -e*v; }
//! }
//! simulate falls of ball { horizon 1; }";
//! let prepared = Prepared::from_text(text, "falls", &["g", "e"]).expect("it compiles");
//! assert_eq!(prepared.states(), ["q", "v"]);
//!
//! /// Counts bounces.
//! struct Bounces(usize);
//! impl Observer for Bounces {
//!     fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
//!         ControlFlow::Continue(())
//!     }
//!     fn event(&mut self, _: &Event) {
//!         self.0 += 1;
//!     }
//! }
//!
//! // 2 m/s², and a second is the time of the first fall: q = 1 - t².
//! let (mut runs, mut bounces) = (prepared.runs(), Bounces(0));
//! let outcome = runs.run(&[2.0, 0.5], None, 0.5, &mut bounces).expect("they are in range");
//! assert_eq!(outcome.status, Status::Solved);
//! assert!((outcome.x[0] - 0.75).abs() < 1e-12);
//! // From 1/2 with 9 m/s² it strikes after 1/3 and 2/3 of a second.
//! let outcome = runs.run(&[9.0, 0.5], Some(&[0.5, 0.0]), 0.7, &mut bounces).expect("they are");
//! // A zero is another system.
//! assert!(runs.run(&[0.0, 0.5], None, 0.7, &mut bounces).is_err());
//! assert_eq!((outcome.status, bounces.0), (Status::Solved, 2));
//! ```

use std::sync::Arc;

use nsd_solver::adaptive as extrapolation;
use nsd_solver::event::{Observer, Simulator};
use nsd_solver::fesd;
use nsd_solver::fesd::SteppingSettings;
use nsd_solver::fesd::jumps;
use nsd_solver::fesd::jumps::Grid;
use nsd_solver::hybrid as solver;
use nsd_solver::hybrid::{HybridSystem, Outcome};
use nsd_solver::moreau as steps;
use nsd_solver::tape::{Scratch, Tape};

use crate::diagnostics::Diagnostics;
use crate::diagnostics::messages::Messages;
use crate::expr::{self, Expr, Exprs, Interval, Var};
use crate::limit::Limit;
use crate::lowering::hybrid::{Pulses, Structural, variable};
use crate::lowering::mpcc::Program;
use crate::lowering::{dcs, hybrid};
use crate::project::clock::Clock;
use crate::project::{Project, bindings};
use crate::simulate::adaptive::{self, Jumping};
use crate::simulate::fesd::{Compiled, first_elements, impulses, stepping};
use crate::simulate::frozen::{self, FrozenRunner};
use crate::simulate::moreau::{self, Bodies};
use crate::simulate::{schedule, solver_settings};
use crate::source::SourceMap;
use crate::syntax::{Bind, Experiment, File, Path};
use crate::system::experiment::{Feature, Method, MethodKind, Settings};
use crate::system::{System, freezing};

/// An experiment that is ready for runs with other numbers. It is plain data: threads share it.
#[derive(Clone, Debug)]
pub struct Prepared {
    ready: Ready,
    horizon: f64,
    parameters: Vec<Parameter>,
    states: Vec<String>,
    /// From the parameters to x(0).
    start: Arc<Tape>,
}

/// A system as plain data, and how it is run.
#[derive(Clone, Debug)]
enum Ready {
    Events {
        system: Arc<HybridSystem>,
        settings: solver::Settings,
    },
    Elements {
        system: Arc<Compiled>,
        settings: fesd::Settings,
    },
    /// Elements with jumps between them.
    Impulses {
        system: Arc<jumps::System<Program>>,
        grid: Grid,
    },
    /// In numerical time.
    Frozen(Arc<FrozenRunner>),
    /// As if there were no switches.
    Adaptive {
        field: Arc<Jumping>,
        settings: extrapolation::Settings,
    },
    /// Steps without contacts.
    Steps {
        system: Arc<Compiled>,
        settings: SteppingSettings,
    },
    /// Steps through contacts.
    Bodies {
        bodies: Arc<Bodies>,
        settings: steps::Settings,
    },
}

/// A parameter that stays open.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name, with its index: `k`, `A[1,2]`.
    pub name: String,
    /// Its value in the experiment.
    pub value: f64,
    /// What it may be: where it was declared to be, on the same side of zero, which is no value of it; zero alone, where it
    /// was compiled with that.
    pub range: [f64; 2],
}

impl Parameter {
    /// Whether it may have a value.
    pub fn takes(&self, value: f64) -> bool {
        let [low, high] = self.range;
        let is_on_side = value != 0.0 || (low, high) == (0.0, 0.0);
        low <= value && value <= high && is_on_side && value.is_finite()
    }
}

/// Why an experiment is not prepared.
#[derive(Debug, thiserror::Error)]
pub enum NotPrepared {
    /// It does not compile, or what must be known before a run depends on an open parameter.
    #[error("the experiment does not compile with parameters that stay open: {}", first(.0))]
    NotCompiled(Diagnostics),
    /// There is no such experiment, or no value that is named.
    #[error("{0}")]
    NotAsked(Messages),
    /// This is no name of a parameter, or of an entry of one.
    #[error("`{0}` is no parameter")]
    NoParameter(String),
    /// It is no simulation.
    #[error("`{0}` is an optimal control problem, which `prepare_optimal` prepares")]
    Optimal(String),
    /// What its controls are is decided on while it runs.
    #[error("`{0}` is a closed loop, whose controls are decided on while it runs")]
    Loop(String),
    /// Another value of this parameter is another system.
    #[error("`{0}` {1}: it has to be compiled for each of its values")]
    Structural(String, Structural),
    /// An initial value is not smooth in the parameters.
    #[error("the initial value of `{0}` is no smooth function of the parameters")]
    Start(String),
}

/// Why there is no run with some numbers.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NotRun {
    /// There are not as many numbers as parameters, or as states.
    #[error("{found} numbers for {wanted} {what}")]
    Count {
        /// How many were given.
        found: usize,
        /// How many there are.
        wanted: usize,
        /// Of what.
        what: &'static str,
    },
    /// A parameter is where the experiment was not prepared for it.
    #[error("`{}` = {value} is not within {} and {}, or zero", .of.name, .of.range[0], .of.range[1])]
    Range {
        /// The parameter.
        of: Parameter,
        /// Its value.
        value: f64,
    },
    /// An initial value is no number.
    #[error("`{state}` = {value} is no number to start from")]
    Start {
        /// The state.
        state: String,
        /// Its value.
        value: f64,
    },
    /// Behind the end of the experiment nobody has looked where functions of time are narrow.
    #[error("a horizon of {horizon} is not within 0 and {longest}, that of the experiment")]
    Horizon {
        /// That of the run.
        horizon: f64,
        /// That of the experiment.
        longest: f64,
    },
}

impl Prepared {
    /// Compiles an experiment with some parameters open; `overrides` replace what `with` says.
    ///
    /// # Errors
    ///
    /// Where it has to be compiled for each of their values.
    pub fn new(
        file: &File,
        experiment: &Experiment,
        overrides: &[Bind],
        open: &[Path],
    ) -> Result<Self, NotPrepared> {
        let exprs = Exprs::new();
        let mut diags = Diagnostics::new();
        let mut experiment = experiment.clone();
        experiment.open = open.to_vec();
        let clock = &mut Clock::default();
        let compiled = crate::compile(&exprs, file, &experiment, overrides, clock, &mut diags);
        match compiled {
            Some(compiled) if !diags.has_errors() => Self::of(&compiled),
            _ => Err(NotPrepared::NotCompiled(diags)),
        }
    }

    /// An experiment of a text, which uses no other files, with parameters open by their names: `k`, `A[1,2]`.
    ///
    /// # Errors
    ///
    /// Those of [`Prepared::new`], and names that are not there.
    pub fn from_text(text: &str, experiment: &str, open: &[&str]) -> Result<Self, NotPrepared> {
        Project::from_text("text", text).prepare(experiment, open, &[])
    }

    /// An experiment that has been compiled with open parameters.
    fn of(compiled: &crate::Compiled<'_>) -> Result<Self, NotPrepared> {
        let (system, settings) = (&compiled.system, &compiled.settings);
        let Opened {
            places,
            parameters,
            start,
        } = Opened::of(compiled)?;
        Ok(Prepared {
            start: Arc::new(start),
            ready: Ready::of(system, settings, &places),
            horizon: settings.horizon,
            parameters,
            states: system
                .states
                .iter()
                .map(|state| state.name.clone())
                .collect(),
        })
    }

    /// The parameters that stay open, in the order in which runs take their values.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// The names of the states, with their indices, in order.
    pub fn states(&self) -> &[String] {
        &self.states
    }

    /// The horizon of the experiment.
    pub fn horizon(&self) -> f64 {
        self.horizon
    }

    /// The system that is run from event to event; none where elements or steps are.
    pub fn system(&self) -> Option<&Arc<HybridSystem>> {
        match &self.ready {
            Ready::Events { system, .. } => Some(system),
            _ => None,
        }
    }

    /// Runs one after another, which keep what they compile.
    pub fn runs(&self) -> Runs<'_> {
        let work = match &self.ready {
            Ready::Events { system, settings } => {
                let simulator = Simulator::new(system.clone(), settings.clone());
                Work::Events(Box::new(simulator))
            }
            Ready::Elements { system, settings } => Work::Elements {
                system: Box::new(Compiled::clone(system)),
                settings: settings.clone(),
            },
            Ready::Impulses { system, grid } => Work::Impulses {
                runs: Box::new(jumps::Simulator::new(jumps::System::clone(system))),
                grid: *grid,
            },
            Ready::Frozen(runner) => Work::Frozen {
                runner: Box::new(FrozenRunner::clone(runner)),
                kept: Box::default(),
            },
            Ready::Adaptive { field, settings } => Work::Adaptive {
                field: Box::new(Jumping::clone(field)),
                settings: settings.clone(),
            },
            Ready::Steps { system, settings } => Work::Steps {
                system: Box::new(Compiled::clone(system)),
                settings: settings.clone(),
            },
            Ready::Bodies { bodies, settings } => {
                Work::Bodies(Box::new(bodies.stepper(settings.clone())))
            }
        };
        Runs {
            work,
            scratch: self.start.scratch(),
            x0: vec![0.0; self.states.len()],
            prepared: self,
        }
    }
}

impl Ready {
    fn of(system: &System, settings: &Settings, open: &[usize]) -> Self {
        let horizon = settings.horizon;
        match &settings.numerics.method {
            method if settings.freezes() && method.kind().takes(Feature::TimeFreezing) => {
                Ready::Frozen(Arc::new(frozen::prepared(system, settings, open)))
            }
            Method::Auto | Method::Event(_) | Method::Smoothing(_) => {
                let limit = Limit::default();
                let chosen = solver_settings(
                    &settings.numerics.method,
                    settings.numerics.tolerance,
                    limit,
                );
                let kicks = settings.kicks.as_ref();
                Ready::Events {
                    system: hybrid::lower_open(system, horizon, open),
                    settings: solver::Settings {
                        kicks: kicks.map(|kicks| kicks.kicks(system)),
                        averages: settings.numerics.averages,
                        ..chosen
                    },
                }
            }
            Method::Fesd(_) if system.jumps.contacts.is_empty() => Ready::Elements {
                system: Arc::new(Compiled::prepared(system, settings, open)),
                settings: first_elements(settings),
            },
            Method::Fesd(_) => Ready::Impulses {
                system: Arc::new(impulses::prepared(system, settings, open)),
                grid: impulses::first_grid(settings),
            },
            Method::Timestepping(_) if system.jumps.impulsive.is_empty() => Ready::Steps {
                system: Arc::new(stepping::prepared(system, settings, open)),
                settings: stepping::first_steps(settings),
            },
            Method::Timestepping(_) => Ready::Bodies {
                bodies: Arc::new(Bodies::new(system, open, Pulses::of(system, horizon))),
                settings: moreau::first_steps(settings),
            },
            Method::Adaptive => Ready::Adaptive {
                field: Arc::new(adaptive::prepared(system, settings, open)),
                settings: adaptive::first_settings(settings),
            },
        }
    }
}

/// A number of a run.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Target {
    /// A parameter, by its number among those that stay open.
    Parameter(usize),
    /// An initial value, by the number of its state.
    Initial(usize),
}

/// The parameters of an experiment that stay open.
pub(crate) struct Opened {
    /// Their numbers in the system.
    pub places: Vec<usize>,
    pub parameters: Vec<Parameter>,
    /// From them to x(0).
    pub start: Tape,
}

impl Opened {
    /// Those with which an experiment has been compiled, if one compilation serves all their values.
    pub fn of(compiled: &crate::Compiled<'_>) -> Result<Self, NotPrepared> {
        let settings = &compiled.settings;
        match settings.optimize {
            None if settings.numerics.closed_loop.is_some() => {
                Err(NotPrepared::Loop(settings.name.clone()))
            }
            None => Opened::inputs(compiled),
            Some(_) => Err(NotPrepared::Optimal(settings.name.clone())),
        }
    }

    /// Those with which an experiment has been compiled, if no other value of theirs is another system.
    pub fn inputs(compiled: &crate::Compiled<'_>) -> Result<Self, NotPrepared> {
        Opened::unless(compiled, |_| true)
    }

    /// The same for a simulation in which they keep their values: what is zero may be open, as its terms are there.
    pub fn kept(compiled: &crate::Compiled<'_>) -> Result<Self, NotPrepared> {
        Opened::unless(compiled, |why| why != Structural::Zero)
    }

    /// Those of which none has a value that decides about the system.
    fn unless(
        compiled: &crate::Compiled<'_>,
        decides: impl Fn(Structural) -> bool,
    ) -> Result<Self, NotPrepared> {
        let (system, settings) = (&compiled.system, &compiled.settings);
        let values = &settings.values;
        let places = open_places(compiled);
        let ranges = settings.open_ranges(&compiled.model);
        let range = |place: usize| match &system.exogenous.params[place] {
            param if param.value == 0.0 => Interval::ZERO,
            param => ranges[&variable(param.var)],
        };
        if let Some((at, why)) = deciding(compiled, &places, range, decides) {
            return Err(NotPrepared::Structural(
                system.exogenous.params[at].name.clone(),
                why,
            ));
        }
        if let Some(name) = values.moving_range(&compiled.model) {
            return Err(NotPrepared::Structural(name, Structural::Range));
        }
        let parameter = |&at: &usize| Parameter {
            name: system.exogenous.params[at].name.clone(),
            value: system.exogenous.params[at].value,
            range: [range(at).low, range(at).high],
        };
        Ok(Opened {
            parameters: places.iter().map(parameter).collect(),
            start: start(compiled, &places)?,
            places,
        })
    }

    /// x(0) with these values.
    pub fn initial(&self, parameters: &[f64]) -> Vec<f64> {
        let mut initial = vec![0.0; self.start.n_outputs()];
        (self.start).eval(parameters, &mut initial, &mut self.start.scratch());
        initial
    }

    /// Gives the system these values and x(0); whether it is the one that was compiled then.
    pub fn set(&self, system: &mut System<'_>, parameters: &[f64], x0: &[f64]) -> bool {
        for (&place, &value) in self.places.iter().zip(parameters) {
            system.exogenous.params[place].value = value;
        }
        for (state, &x0) in system.states.iter_mut().zip(x0) {
            state.initial = x0;
        }
        let mut diags = Diagnostics::new();
        system.check_start(&mut diags);
        diags.is_empty() && system.starts_relays_as_compiled()
    }
}

/// The first of some parameters with another value of which the system is another one, and why.
fn deciding(
    compiled: &crate::Compiled<'_>,
    places: &[usize],
    range: impl Fn(usize) -> Interval,
    decides: impl Fn(Structural) -> bool,
) -> Option<(usize, Structural)> {
    let (system, settings) = (&compiled.system, &compiled.settings);
    let why = hybrid::structural(system);
    let found = |&at: &usize| Some((at, why[at].filter(|&why| decides(why))?));
    if let Some(found) = places.iter().find_map(found) {
        return Some(found);
    }
    let is_optimal = settings.optimize.is_some();
    let method = settings.numerics.method.kind();
    if matches!(method, MethodKind::Timestepping | MethodKind::Adaptive) && !is_optimal {
        let instants = schedule::deciding(system);
        let moves = |at: &&usize| instants.contains(&variable(system.exogenous.params[**at].var));
        if let Some(&at) = places.iter().find(moves) {
            return Some((at, Structural::Instants));
        }
    }
    if settings.freezes() && !is_optimal {
        let found = freezing::first_deciding(system, settings.pace(), places);
        if let Some(at) = found {
            return Some((at, Structural::Frozen));
        }
    }
    let has_rows = is_optimal || method.needs_dcs() && system.jumps.impulsive.is_empty();
    if !has_rows {
        return None;
    }
    let open: Vec<(usize, Interval)> = places.iter().map(|&at| (at, range(at))).collect();
    let at = dcs::first_deciding(&compiled.lowered(), &settings.numerics.lowerings, &open)?;
    Some((at, Structural::Regions))
}

/// The places of the parameters that stay open.
fn open_places(compiled: &crate::Compiled<'_>) -> Vec<usize> {
    let (system, values) = (&compiled.system, &compiled.settings.values);
    let params = system.exogenous.params.iter().enumerate();
    let open = params.filter(|(_, param)| values.is_open(param.var));
    open.map(|(at, _)| at).collect()
}

/// Runs of one [`Prepared`] on one thread.
pub struct Runs<'p> {
    prepared: &'p Prepared,
    work: Work,
    scratch: Scratch,
    x0: Vec<f64>,
}

/// What has been compiled in the course of runs.
enum Work {
    Events(Box<Simulator>),
    Elements {
        system: Box<Compiled>,
        settings: fesd::Settings,
    },
    Impulses {
        runs: Box<jumps::Simulator<Program>>,
        grid: Grid,
    },
    Frozen {
        runner: Box<FrozenRunner>,
        kept: Box<Option<Simulator>>,
    },
    Adaptive {
        field: Box<Jumping>,
        settings: extrapolation::Settings,
    },
    Steps {
        system: Box<Compiled>,
        settings: SteppingSettings,
    },
    Bodies(Box<steps::Stepper<moreau::Free>>),
}

impl Runs<'_> {
    /// A run from 0 to a horizon, no longer than that of the experiment, with these values of the parameters, in the order
    /// of [`Prepared::parameters`], and from an initial state, or the one that they give. A relay that this leaves between
    /// its thresholds starts as it does in the experiment.
    ///
    /// # Errors
    ///
    /// For numbers that the experiment was not prepared for.
    pub fn run(
        &mut self,
        parameters: &[f64],
        x0: Option<&[f64]>,
        horizon: f64,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, NotRun> {
        self.check(parameters, x0, horizon)?;
        match x0 {
            Some(x0) => self.x0.copy_from_slice(x0),
            None => (self.prepared.start).eval(parameters, &mut self.x0, &mut self.scratch),
        }
        Ok(match &mut self.work {
            Work::Events(simulator) => {
                simulator.set_parameters(parameters);
                simulator.run(0.0, horizon, &self.x0, observer)
            }
            Work::Elements { system, settings } => {
                system.set_parameters(parameters);
                let (settings, mut observer) = (settings.clone(), observer);
                let ran = system.by_elements(settings, horizon, &self.x0, &mut observer);
                ran.solution.outcome
            }
            Work::Impulses { runs, grid } => {
                runs.set_parameters(parameters);
                let grid = Grid { horizon, ..*grid };
                let limit = Limit::default();
                let reference = runs.follow(horizon, &self.x0, &limit);
                let near = (&reference, &limit);
                runs.run(grid, &self.x0, near, &mut |_| None, observer)
                    .outcome()
            }
            Work::Frozen { runner, kept } => {
                runner.set_parameters(parameters);
                let ran = runner.run(horizon, &self.x0, kept, observer);
                runner.told(ran)
            }
            Work::Adaptive { field, settings } => {
                field.set_parameters(parameters);
                let field = Jumping::clone(field);
                let mut simulator = extrapolation::Simulator::new(field, settings.clone());
                simulator.run(0.0, horizon, &self.x0, observer)
            }
            Work::Steps { system, settings } => {
                system.set_parameters(parameters);
                system.by_steps(settings.clone(), horizon, &self.x0, observer)
            }
            Work::Bodies(stepper) => {
                stepper.free().set_parameters(parameters);
                let mut observer = moreau::Told::to(observer);
                let solution = stepper.run(0.0, horizon, &self.x0, &mut observer);
                solution.outcome
            }
        })
    }

    fn check(&self, parameters: &[f64], x0: Option<&[f64]>, horizon: f64) -> Result<(), NotRun> {
        let Prepared {
            parameters: known,
            states,
            horizon: longest,
            ..
        } = self.prepared;
        check_parameters(known, parameters)?;
        if let Some(x0) = x0 {
            check_count(x0.len(), states.len(), "states")?;
            if let Some((name, &value)) = states.iter().zip(x0).find(|(_, x)| !x.is_finite()) {
                let state = name.clone();
                return Err(NotRun::Start { state, value });
            }
        }
        match 0.0 < horizon && horizon <= *longest {
            true => Ok(()),
            false => Err(NotRun::Horizon {
                horizon,
                longest: *longest,
            }),
        }
    }
}

/// That there are as many numbers as there is something.
pub(crate) fn check_count(found: usize, wanted: usize, what: &'static str) -> Result<(), NotRun> {
    match found == wanted {
        true => Ok(()),
        false => Err(NotRun::Count {
            found,
            wanted,
            what,
        }),
    }
}

/// That every parameter has a value, which it may have.
pub(crate) fn check_parameters(known: &[Parameter], values: &[f64]) -> Result<(), NotRun> {
    check_count(values.len(), known.len(), "parameters")?;
    let mut pairs = known.iter().zip(values);
    match pairs.find(|(of, value)| !of.takes(**value)) {
        None => Ok(()),
        Some((of, &value)) => Err(NotRun::Range {
            of: of.clone(),
            value,
        }),
    }
}

/// The first error, with its code.
fn first(diags: &Diagnostics) -> String {
    let told = diags.errors().next().map(|error| match error.code() {
        Some(code) => format!("{code}, {error}"),
        None => error.to_string(),
    });
    told.unwrap_or_default()
}

/// A name as it stands on the left of `=` in `with`.
pub(crate) fn path(name: &str, sources: &mut SourceMap) -> Option<Path> {
    let given = [format!("{name}=0")];
    let mut binds = bindings((sources, &mut Diagnostics::new()), "open", &given)?;
    (binds.len() == 1).then(|| binds.remove(0).target)
}

/// x(0) as a function of the open parameters.
fn start(compiled: &crate::Compiled<'_>, open: &[usize]) -> Result<Tape, NotPrepared> {
    let (system, values) = (&compiled.system, &compiled.settings.values);
    let fixed = hybrid::numbers(system, open);
    let initial = system.states.iter().map(|state| {
        let given = values
            .initial(state.var)
            .map(|value| value.substitute(&fixed));
        given.unwrap_or_else(|| system.exprs.constant(state.initial))
    });
    let initial: Vec<Expr> = initial.collect();
    let inputs: Vec<Var> = inputs(system, open);
    let rough = |_| {
        let is_rough = |e: &Expr| expr::compile(&inputs, &[*e]).is_err();
        let mut states = system.states.iter().zip(&initial);
        let state = states.find(|(_, value)| is_rough(value));
        NotPrepared::Start(state.map_or_else(String::new, |(state, _)| state.name.clone()))
    };
    expr::compile(&inputs, &initial).map_err(rough)
}

fn inputs(system: &System, open: &[usize]) -> Vec<Var> {
    open.iter()
        .map(|&at| variable(system.exogenous.params[at].var))
        .collect()
}
