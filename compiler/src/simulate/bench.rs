//! Runs for their end state and their time alone, as a study of convergence makes many of them.
//!
//! The first run of a solver compiles its functions. Those after it are timed: they are the solve
//! and nothing else.

use std::time::Duration;

use nsd_solver::integrate::tableau::Family;

use super::driver::{Accuracy, Ended, Problem, Run};
use super::{methods, outcome, solver_settings};
use crate::limit::Limit;
use crate::lowering::dcs;
use crate::project::clock::Instant;
use crate::simulate::record::modes::ModeNames;
use crate::system::experiment::{
    EventOptions, Feature, FesdOptions, Lowering, Method, MethodKind, Settings, SmoothingOptions,
    SteppingOptions, beside_branches,
};
use crate::system::switches::smoothing;
use crate::system::{Role, Switch, System};

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
    settings: Settings<'e>,
    /// Why the system has no finite elements, if it has none.
    without_elements: Option<String>,
    /// The methods that have been compiled, by their names.
    plans: Vec<(&'static str, Box<dyn Run<'e> + 'e>)>,
    /// Solves that are timed, at most.
    repetitions: usize,
    /// Of all runs together.
    limit: Limit,
}

/// Of smoothed systems, whose own error is larger.
const SMOOTHED_TOLERANCE: f64 = 1e-12;
/// Most solves that are timed.
const MOST_REPETITIONS: usize = 9;
/// Time for the repetitions of one run.
const REPETITIONS: Duration = Duration::from_millis(20);

impl<'s, 'e> Bench<'s, 'e> {
    /// For runs of the system as it is, whatever the experiment lowers its jumps to.
    pub fn new(system: &'s System<'e>, settings: &Settings<'e>) -> Self {
        let mut settings = settings.clone();
        let takes_jumps = [Lowering::TimeFreezing, Lowering::Impact];
        let lowerings = &mut settings.numerics.lowerings;
        lowerings.retain(|lowering| !takes_jumps.contains(lowering));
        let without_elements = without_elements(system, &settings);
        Bench {
            without_elements,
            ..Bench::lowered(system, &settings)
        }
    }

    /// For runs of the system as the experiment lowers it, which has been checked.
    pub fn lowered(system: &'s System<'e>, settings: &Settings<'e>) -> Self {
        let mut settings = settings.clone();
        (settings.kicks, settings.numerics.averages) = (None, false);
        Bench {
            system,
            settings,
            without_elements: None,
            plans: Vec::new(),
            repetitions: MOST_REPETITIONS,
            limit: Limit::default(),
        }
    }

    /// The same for runs that end where a limit is over.
    pub fn within(self, limit: &Limit) -> Self {
        let limit = limit.clone();
        Bench { limit, ..self }
    }

    /// The same for runs whose time is of no interest: each is made once.
    pub fn untimed(self) -> Self {
        Bench {
            repetitions: 0,
            ..self
        }
    }

    /// The state at the start.
    pub fn start(&self) -> Vec<f64> {
        let states = self.system.states.iter();
        states.map(|state| state.initial).collect()
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
        if let Some((name, _)) = self.system.jumps.first_jump() {
            return Some(format!("`{name}` sets states"));
        }
        let takes_stops = |method: MethodKind| method.takes(Feature::Stops);
        let takes_stops = [MethodKind::Smoothing, MethodKind::Adaptive].map(takes_stops);
        let mut laws = self.system.jumps.laws.iter();
        let stop = laws.find(|law| law.stops);
        if let Some(law) = stop.filter(|_| takes_stops.contains(&false)) {
            return Some(format!("{} ends the run before its horizon", law.title()));
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
        self.without_elements.as_deref()
    }

    /// Runs to the horizon. A run that takes longer than `limit` fails.
    pub fn run(&mut self, variant: Variant, limit: Duration) -> End {
        let settings = variant.settings(&self.settings);
        let limit = &self.limit.sooner(limit);
        if let Variant::Smoothing(options) = variant {
            let smoothed = smoothing::smooth(self.system, &options);
            let mut run = methods::of(&smoothed, &settings, &[]);
            return self.measure(&mut *run, &Problem::of_end(&smoothed, &settings, limit));
        }
        let (system, name) = (self.system, settings.numerics.method.kind().word());
        let known = self.plans.iter().position(|(known, _)| *known == name);
        let at = known.unwrap_or_else(|| {
            self.plans.push((name, methods::of(system, &settings, &[])));
            self.plans.len() - 1
        });
        let mut plans = std::mem::take(&mut self.plans);
        let problem = Problem::of_end(system, &settings, limit);
        let end = self.measure(&mut *plans[at].1, &problem);
        self.plans = plans;
        end
    }

    /// The end of a solve, and the median time of those after the first.
    fn measure(&self, run: &mut dyn Run<'e>, problem: &Problem<'_, 'e>) -> End {
        let accuracy = Accuracy::of(problem.settings);
        let started = Instant::now();
        let Ended { outcome, failure } = run.march(problem, accuracy, &mut ());
        let mut seconds = started.elapsed().as_secs_f64();
        let (system, settings) = (problem.system, problem.settings);
        let names = ModeNames::new(system);
        let failure = failure.or_else(|| outcome::failure(system, &names, &outcome, settings));
        let is_short = seconds <= REPETITIONS.as_secs_f64() && failure.is_none();
        if self.repetitions > 0 && is_short {
            let started = Instant::now();
            let mut times = Vec::with_capacity(self.repetitions);
            while times.is_empty()
                || times.len() < self.repetitions && started.elapsed() < REPETITIONS
            {
                let started = Instant::now();
                run.march(problem, accuracy, &mut ());
                times.push(started.elapsed().as_secs_f64());
            }
            times.sort_by(f64::total_cmp);
            seconds = times[times.len() / 2];
        }
        End {
            x: outcome.x,
            steps: outcome.stats.steps,
            failure: failure.map(|failure| failure.to_string()),
            seconds,
        }
    }
}

impl Variant {
    /// An experiment with this method in place of its own.
    fn settings<'e>(self, of: &Settings<'e>) -> Settings<'e> {
        let mut settings = of.clone();
        settings.numerics.method = match self {
            Variant::Event {
                tolerance,
                more_orders,
            } => {
                settings.numerics.tolerance = tolerance;
                let mut options = match &of.numerics.method {
                    Method::Event(options) => options.clone(),
                    _ => EventOptions::default(),
                };
                if more_orders > 0 {
                    let chosen = solver_settings(&of.numerics.method, tolerance, Limit::default());
                    options.order = Some(chosen.series_order() + more_orders);
                }
                Method::Event(options)
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
            Variant::Timestepping { scheme, steps } => Method::Timestepping(SteppingOptions {
                scheme: Some(scheme),
                steps,
            }),
            Variant::Smoothing(options) => {
                settings.numerics.tolerance = SMOOTHED_TOLERANCE;
                Method::Smoothing(options)
            }
            Variant::Adaptive { tolerance } => {
                settings.numerics.tolerance = tolerance;
                Method::Adaptive
            }
        };
        settings
    }
}

/// Why a system is not one that finite elements see.
fn without_elements(system: &System, settings: &Settings) -> Option<String> {
    if let Some(k) = system.first_nonlinear()
        && let Some((beside, _)) = beside_branches(system)
    {
        let name = &system.switches[k].name;
        return Some(format!("`{name}` is read nonlinearly beside {beside}"));
    }
    let checked = dcs::check(system, &settings.numerics.lowerings, true);
    checked.err().map(|error| error.to_string())
}
