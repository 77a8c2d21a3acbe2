//! Runs for their end state and their time alone, as a study of convergence makes many of them.
//!
//! The first run of a solver compiles its functions. Those after it are timed: they are the solve
//! and nothing else.

use crate::clock::Instant;
use crate::hybrid::{self, Pulses};
use crate::limit::Limit;
use nsd_solver::simulate::HybridSystem;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

use nsd_solver::adaptive;
use nsd_solver::fesd::{self, Grid};
use nsd_solver::simulate as solver;
use nsd_solver::tableau::Family;
use solver::{Observer, Outcome, Segment, Simulator, Status};

use super::adaptive::Jumping;
use super::fesd as elements;
use super::modes::ModeNames;
use super::{Request, outcome, solver_settings};
use crate::dcs;
use crate::system::experiment::{
    EventOptions, FesdOptions, Method, Sampling, Settings, SmoothingOptions, SteppingOptions,
    beside_branches,
};
use crate::system::{Role, Switch, System, smoothing};

/// A method with all of its options.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Variant {
    /// Integration from event to event.
    Event {
        /// Aim for the global error, in (0, 1).
        tolerance: f64,
        /// Orders above the usual one, so that two runs share no error.
        more_orders: usize,
    },
    /// Finite elements on a grid.
    Fesd {
        /// Family of Runge-Kutta methods, and number of nodes.
        scheme: (Family, usize),
        /// Steps of equal length.
        steps: usize,
        /// Finite elements per step.
        elements: usize,
    },
    /// Steps of one length, in which nothing locates switches.
    Timestepping {
        /// Family of Runge-Kutta methods, and number of nodes.
        scheme: (Family, usize),
        /// Steps of equal length.
        steps: usize,
    },
    /// Steep functions in the place of switches, integrated accurately.
    Smoothing(SmoothingOptions<'static>),
    /// An adaptive method that knows of no switches.
    Adaptive {
        /// Aim for the global error, in (0, 1).
        tolerance: f64,
    },
}

/// The end of a run.
#[derive(Clone, Debug)]
pub struct End {
    /// The state that was reached.
    pub x: Vec<f64>,
    /// Steps that were taken.
    pub steps: usize,
    /// Why the run ended before its horizon.
    pub failure: Option<String>,
    /// Median time of a solve in seconds.
    pub seconds: f64,
}

/// An experiment that is run by several methods.
pub struct Bench<'s, 'e> {
    system: &'s System<'e>,
    settings: &'s Settings<'e>,
    x0: Vec<f64>,
    hybrid: Arc<HybridSystem>,
    /// Or why there is none.
    complementarity: Result<fesd::ComplementaritySystem, String>,
    /// Solves that are timed, at most.
    repetitions: usize,
}

/// Of smoothed systems, whose own error is larger.
const SMOOTHED_TOLERANCE: f64 = 1e-12;
/// Most solves that are timed.
const MOST_REPETITIONS: usize = 9;
/// Time for the repetitions of one run.
const REPETITIONS: Duration = Duration::from_millis(20);

impl<'s, 'e> Bench<'s, 'e> {
    /// Prepares what the methods share.
    pub fn new(system: &'s System<'e>, settings: &'s Settings<'e>) -> Self {
        Bench {
            system,
            settings,
            x0: system.states.iter().map(|state| state.initial).collect(),
            hybrid: hybrid::lower_over(system, settings.horizon),
            complementarity: complementarity(system, settings),
            repetitions: MOST_REPETITIONS,
        }
    }

    /// The same for runs whose time is of no interest: each is made once.
    pub fn untimed(system: &'s System<'e>, settings: &'s Settings<'e>) -> Self {
        Bench {
            repetitions: 0,
            ..Bench::new(system, settings)
        }
    }

    /// The state at the start.
    pub fn start(&self) -> &[f64] {
        &self.x0
    }

    /// Whether the dynamics jump across some surface.
    pub fn has_jumps(&self) -> bool {
        let mut switches = self.system.switches.iter();
        switches.any(|switch| !switch.continuity.is_continuous())
    }

    /// Why methods that look at the rates in the present state alone do not run the system.
    pub fn with_more_than_rates(&self) -> Option<String> {
        let switches = || self.system.switches.iter();
        if let Some(relay) = switches().find(|switch| switch.relay.is_some()) {
            return Some(format!("relay `{}` depends on the past", relay.name));
        }
        if let Some((name, _)) = self.system.first_jump() {
            return Some(format!("`{name}` sets states"));
        }
        let is_kept = |switch: &Switch| switch.unilateral || switch.role != Role::Step;
        let is_kept = switches().any(is_kept);
        is_kept.then(|| "projections and algebraic states have forces without a bound".to_owned())
    }

    /// Why methods that know nothing of sliding modes do not run the system.
    pub fn with_branches(&self) -> Option<String> {
        let nonlinear = self.system.first_nonlinear();
        nonlinear.map(|k| format!("`{}` is read nonlinearly", self.system.switches[k].name))
    }

    /// Why the system has no finite elements.
    pub fn without_elements(&self) -> Option<&str> {
        self.complementarity.as_ref().err().map(String::as_str)
    }

    /// Runs to the horizon. A run that takes longer than `limit` fails.
    pub fn run(&self, variant: Variant, limit: Duration) -> End {
        let (outcome, seconds) = match variant {
            Variant::Event {
                tolerance,
                more_orders,
            } => self.by_events(tolerance, more_orders, limit),
            Variant::Fesd {
                scheme,
                steps,
                elements,
            } => self.by_elements(scheme, Grid::Steps { steps, elements }, limit),
            Variant::Timestepping { scheme, steps } => self.by_steps(scheme, steps, limit),
            Variant::Smoothing(options) => self.by_smoothing(&options, limit),
            Variant::Adaptive { tolerance } => self.by_extrapolation(tolerance, limit),
        };
        let names = ModeNames::new(self.system);
        let failure = outcome::failure(self.system, &names, &outcome, self.settings);
        End {
            failure: failure.map(|failure| failure.to_string()),
            x: outcome.x,
            steps: outcome.stats.steps,
            seconds,
        }
    }

    fn by_events(&self, tolerance: f64, more_orders: usize, limit: Duration) -> (Outcome, f64) {
        let mut settings = solver_settings(&self.settings.method, tolerance, Limit::within(limit));
        if more_orders > 0 {
            let order = Simulator::new(self.hybrid.clone(), settings.clone()).order();
            settings.order = Some(order + more_orders);
        }
        let mut simulator = Simulator::new(self.hybrid.clone(), settings);
        let horizon = self.settings.horizon;
        self.measure(|| simulator.run(0.0, horizon, &self.x0, &mut Unseen))
    }

    fn by_elements(
        &self,
        (family, nodes): (Family, usize),
        grid: Grid,
        limit: Duration,
    ) -> (Outcome, f64) {
        let settings = fesd::Settings {
            grid,
            limit: Limit::within(limit),
            ..fesd::Settings::new(family, nodes)
        };
        let system = self.complementarity.as_ref();
        let system = system.expect("only systems with finite elements are run by them");
        let guide = self.system.first_nonlinear().map(|_| &self.hybrid);
        let mut simulator = elements::simulator(system, guide, settings);
        let horizon = self.settings.horizon;
        self.measure(|| {
            let solution = simulator.run(0.0, horizon, &self.x0, &mut Unseen);
            solution.outcome
        })
    }

    fn by_steps(
        &self,
        (family, nodes): (Family, usize),
        steps: usize,
        limit: Duration,
    ) -> (Outcome, f64) {
        let settings = fesd::SteppingSettings {
            family,
            nodes,
            steps,
            limit: Limit::within(limit),
        };
        let system = self.complementarity.as_ref();
        let system = system.expect("only systems that are lowered are stepped");
        let stepper = fesd::Stepper::new(system, settings);
        let mut stepper = stepper.expect("the number of nodes has been checked");
        let horizon = self.settings.horizon;
        self.measure(|| stepper.run(0.0, horizon, &self.x0, &mut Unseen))
    }

    fn by_smoothing(&self, options: &SmoothingOptions, limit: Duration) -> (Outcome, f64) {
        let horizon = self.settings.horizon;
        let smoothed = smoothing::smooth(self.system, options);
        let settings = solver::Settings {
            tolerance: SMOOTHED_TOLERANCE,
            limit: Limit::within(limit),
            ..solver::Settings::default()
        };
        let mut simulator = Simulator::new(hybrid::lower_over(&smoothed, horizon), settings);
        let (mut outcome, seconds) =
            self.measure(|| simulator.run(0.0, horizon, &self.x0, &mut Unseen));
        // Its switches are others.
        outcome.status = match outcome.status {
            status @ (Status::Solved | Status::Over(_) | Status::StepLimit) => status,
            _ => Status::Unsolved,
        };
        (outcome, seconds)
    }

    fn by_extrapolation(&self, tolerance: f64, limit: Duration) -> (Outcome, f64) {
        let settings = adaptive::Settings {
            tolerance,
            limit: Limit::within(limit),
            ..adaptive::Settings::default()
        };
        let horizon = self.settings.horizon;
        let field = Jumping::new(self.system, Pulses::of(self.system, horizon));
        let mut simulator = adaptive::Simulator::new(field, settings);
        self.measure(|| simulator.run(0.0, horizon, &self.x0, &mut Unseen))
    }

    /// The outcome of a solve, and the median time of those after the first.
    fn measure(&self, mut solve: impl FnMut() -> Outcome) -> (Outcome, f64) {
        let started = Instant::now();
        let outcome = solve();
        let first = started.elapsed();
        let once = self.repetitions == 0 || first > REPETITIONS;
        if outcome.status != Status::Solved || once {
            return (outcome, first.as_secs_f64());
        }
        let started = Instant::now();
        let mut times = Vec::with_capacity(self.repetitions);
        while times.is_empty() || times.len() < self.repetitions && started.elapsed() < REPETITIONS
        {
            let started = Instant::now();
            solve();
            times.push(started.elapsed().as_secs_f64());
        }
        times.sort_by(f64::total_cmp);
        (outcome, times[times.len() / 2])
    }
}

/// A run of an experiment as it is, with another method, for its end; its time is that of everything. A run that takes
/// longer than `limit` fails.
pub fn whole<'e>(
    system: &System<'e>,
    settings: &Settings<'e>,
    variant: Variant,
    limit: Duration,
) -> End {
    let mut settings = settings.clone();
    settings.sampling = Sampling::Method;
    settings.outputs = None;
    settings.method = match variant {
        Variant::Event { tolerance, .. } | Variant::Adaptive { tolerance } => {
            settings.tolerance = tolerance;
            Method::Event(EventOptions::default())
        }
        Variant::Fesd {
            scheme,
            steps,
            elements,
        } => Method::Fesd(FesdOptions {
            scheme,
            steps: Some(steps),
            elements,
            ..FesdOptions::default()
        }),
        Variant::Timestepping { steps, .. } => Method::Timestepping(SteppingOptions {
            scheme: None,
            steps,
        }),
        Variant::Smoothing(options) => Method::Smoothing(options),
    };
    let request = Request {
        dense: false,
        estimate: false,
        multipliers: false,
        limit: Limit::within(limit),
    };
    let run = super::run(system, &settings, &request);
    let last = run.time.len() - 1;
    End {
        x: (run.states.iter())
            .flat_map(|series| series.at(last).to_vec())
            .collect(),
        steps: run.stats.steps as usize,
        failure: run.failure.map(|failure| failure.to_string()),
        seconds: run.stats.solve_s,
    }
}

/// The system as finite elements see it, or why they do not.
fn complementarity<'e>(
    system: &System<'e>,
    settings: &Settings,
) -> Result<fesd::ComplementaritySystem, String> {
    if let Some(k) = system.first_nonlinear()
        && let Some((beside, _)) = beside_branches(system)
    {
        let name = &system.switches[k].name;
        return Err(format!("`{name}` is read nonlinearly beside {beside}"));
    }
    let lowerings = &settings.lowerings;
    dcs::check(system, lowerings, true).map_err(|error| error.to_string())?;
    let dcs = dcs::lower(system, lowerings).map_err(|error| error.to_string())?;
    if let Some(impact) = dcs.impacts.first() {
        return Err(format!("contact `{}` gives impulses", impact.name));
    }
    Ok(elements::complementarity(system, &dcs))
}

/// Sees nothing.
struct Unseen;

impl Observer for Unseen {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &solver::Event) {}
}

impl fesd::Observer for Unseen {}
