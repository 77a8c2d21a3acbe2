//! Runs in numerical time: a system is frozen, run event by event or by finite elements, and thawed.

use crate::clock::Instant;
use crate::hybrid;
use crate::limit::Limit;
use nsd_solver::simulate::HybridSystem;
use std::sync::Arc;
mod law;
mod stretch;
mod thaw;

use law::impact;
use nsd_solver::fesd::{self as elements, Grid};
use nsd_solver::simulate::{Coefficient, Observer, Outcome, Simulator, Status};
use thaw::{End, Law, drive};

use super::fesd::{complementarity, estimate, judge_grid};
use super::modes::ModeNames;
use super::overlooked::Looking;
use super::watch::{Progress, Watched};
use super::{
    Comparison, REFINEMENT, Recorder, Request, assemble, finer, judge, outcome, solver_settings,
    tightened,
};
use crate::dcs::{self, Formulation};
use crate::report::{Failure, Method, MethodOption, Trajectory};
use crate::system::System;
use crate::system::experiment::{self, FesdOptions, Settings};
use crate::system::freezing::{Frozen, freeze};

/// A contact may start this far below its surface, which is rounding.
const ROUNDING: f64 = 1e-9;

/// How a frozen system is run.
enum Road {
    Events(Arc<HybridSystem>),
    Elements(
        Box<elements::ComplementaritySystem>,
        FesdOptions,
        Formulation,
    ),
}

/// A run in physical time.
struct Found {
    outcome: Outcome,
    /// Order of the method.
    order: usize,
    /// Least member of a pair of complementarity.
    least_member: f64,
    failure: Option<Failure>,
}

/// Integrates the frozen system until its clock has reached the horizon of the experiment.
pub(super) fn run(
    system: &System,
    settings: &Settings,
    request: &Request,
    watch: &mut dyn FnMut(Progress),
) -> Trajectory {
    let started = Instant::now();
    let frozen = freeze(system, settings.pace());
    let frozen = frozen.expect("compilation has checked that the system can be frozen");
    let road = Road::new(&frozen, settings);
    let jumping = frozen.meeting.is_open.then(|| hybrid::lower(system));
    let x0: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
    let horizon = settings.horizon;
    let (mut tolerance, mut attempt) = (settings.tolerance, 1);
    let (found, recorder, estimated) = loop {
        let mut recorder = Recorder::new(system, settings, tolerance, request.dense);
        let mut looking = Looking::new(system, settings, &mut recorder);
        let mut watched = Watched::new(&mut looking, horizon, false, watch);
        let run = (tolerance, false);
        let mut found = road.run(
            (&frozen, jumping.as_ref()),
            settings,
            run,
            &request.limit,
            &mut watched,
        );
        found.outcome.notes.extend(looking.notes());
        let wanted = request.estimate && !matches!(found.outcome.status, Status::Over(_));
        let estimated = wanted.then(|| {
            let mut comparison = Comparison::new(&recorder, &x0);
            let mut watched = Watched::new(&mut comparison, horizon, true, watch);
            let run = (tolerance, true);
            let fine = road.run(
                (&frozen, jumping.as_ref()),
                settings,
                run,
                &request.limit,
                &mut watched,
            );
            estimate(system, &comparison, [&found.outcome, &fine.outcome])
        });
        let estimated = estimated.flatten();
        let judged = estimated.as_ref().filter(|_| !settings.method.has_steps());
        if let Some(next) = tightened(judged, settings, tolerance, attempt) {
            tolerance = next;
            attempt += 1;
            continue;
        }
        break (found, recorder, estimated);
    };
    let failure = penetration(system).or(found.failure);
    let outcome = Outcome {
        status: Status::Solved,
        ..found.outcome
    };
    let mut trajectory = assemble(system, settings, &outcome, recorder);
    if let Some(failure) = failure {
        trajectory.status = failure.status();
        trajectory.failure = Some(failure);
    }
    trajectory.method = road.method(settings, found.order);
    if let Road::Elements(..) = road {
        // As of `method fesd`.
        trajectory.certificate.max_violation = -found.least_member;
    }
    if let Some(estimate) = estimated {
        match settings.method.has_steps() {
            false => judge(&mut trajectory, &estimate, settings),
            true => judge_grid(&mut trajectory, &estimate, settings),
        }
    }
    trajectory.stats.solve_s = started.elapsed().as_secs_f64();
    trajectory
}

/// The first contact that starts below its surface.
fn penetration(system: &System) -> Option<Failure> {
    let params = system.params.iter().map(|param| (param.var, param.value));
    let states = system.states.iter().map(|state| (state.var, state.initial));
    let known: Vec<_> = params.chain(states).chain([(system.time, 0.0)]).collect();
    let contacts = system.switches.iter().enumerate();
    let mut contacts = contacts.filter(|(_, switch)| switch.unilateral);
    let (deep, switch) = contacts.find(|(_, switch)| {
        let value = |var| {
            let at = known.iter().find(|(e, _)| e.as_variable() == Some(var));
            at.map_or(f64::NAN, |(_, value)| *value)
        };
        switch.psi.eval(&value) < -ROUNDING
    })?;
    Some(Failure::Penetrates {
        time: 0.0,
        name: switch.name.clone(),
        surfaces: outcome::labels(system, &[deep]),
    })
}

impl Road {
    fn new(frozen: &Frozen, settings: &Settings) -> Self {
        let experiment::Method::Fesd(options) = &settings.method else {
            return Road::Events(hybrid::lower(&frozen.system));
        };
        let dcs = dcs::lower(&frozen.system, &settings.lowerings);
        let dcs = dcs.expect("compilation has checked that the system can be lowered");
        let complementarity = complementarity(&frozen.system, &dcs);
        Road::Elements(Box::new(complementarity), *options, dcs.formulation)
    }

    /// One run with a tolerance, or the finer one that shows its error; impacts are compared with those of the system
    /// with jumps, if it is given.
    fn run(
        &self,
        (frozen, jumping): (&Frozen, Option<&Arc<HybridSystem>>),
        settings: &Settings,
        (tolerance, fine): (f64, bool),
        limit: &Limit,
        observer: &mut dyn Observer,
    ) -> Found {
        let (order, mut least_member) = (self.order(settings, tolerance), 0.0_f64);
        let horizon = settings.horizon;
        // Gaps stand still at zero while contacts act on each other: these are closed.
        let below: Vec<usize> = frozen
            .contacts
            .iter()
            .map(|contact| contact.switch)
            .collect();
        let law = jumping.map(|jumping| -> Box<Law> {
            let mut simulator = Simulator::new(jumping.clone(), Default::default());
            Box::new(move |t: f64, x: &[f64]| impact(&mut simulator, horizon, t, x))
        });
        let (outcome, end) = match self {
            Road::Events(hybrid) => {
                let mut chosen = solver_settings(&settings.method, tolerance, limit.clone());
                if fine {
                    chosen = finer(&chosen, order, tolerance);
                }
                chosen.below.clone_from(&below);
                let mut simulator = Simulator::new(hybrid.clone(), chosen);
                drive(frozen, horizon, observer, law, |end, x, thaw| {
                    simulator.run(0.0, end, x, thaw)
                })
            }
            Road::Elements(complementarity, options, _) => {
                let mut library = elements::Library::default();
                drive(frozen, horizon, observer, law, |end, x, thaw| {
                    let settings = elements::Settings {
                        below: below.clone(),
                        limit: limit.clone(),
                        grid: grid(options, tolerance, fine, end / horizon),
                        ..elements::Settings::new(options.scheme.0, options.scheme.1)
                    };
                    let simulator = elements::Simulator::new(complementarity, settings);
                    let simulator = simulator.expect("the number of nodes has been checked");
                    let mut simulator = simulator.knowing(std::mem::take(&mut library));
                    let solution = simulator.run(0.0, end, x, thaw);
                    library.clone_from(simulator.library());
                    least_member = least_member.min(solution.least_member);
                    solution.outcome
                })
            }
        };
        let stops = |what: String| Failure::Standstill {
            time: outcome.time,
            what,
            span: settings.span,
        };
        let failure = match end {
            Some(End::Limit(limit)) => {
                Some(stops(format!("bounces accumulate towards t = {limit:.6}")))
            }
            Some(End::Closed) => Some(stops("a contact stays closed".to_owned())),
            Some(End::Unlawful) => {
                let what = "forces act at once, which one after the other are another impact";
                Some(stops(what.to_owned()))
            }
            Some(End::Locked(contact)) => Some(Failure::Painleve {
                time: outcome.time,
                name: frozen.system.switches[contact].name.clone(),
                surfaces: outcome::labels(&frozen.system, &[contact]),
            }),
            Some(End::Negative(contact, value)) => {
                let name = frozen.system.switches[contact].name.clone();
                let surfaces = outcome::labels(&frozen.system, &[contact]);
                let of = (Coefficient::Friction, value);
                Some(outcome::outside(of, (outcome.time, name), surfaces))
            }
            None => {
                let names = ModeNames::new(&frozen.system);
                outcome::failure(&frozen.system, &names, &outcome, settings)
            }
        };
        Found {
            outcome,
            order,
            least_member,
            failure,
        }
    }

    /// Order of the method.
    fn order(&self, settings: &Settings, tolerance: f64) -> usize {
        match self {
            Road::Events(hybrid) => {
                let chosen = solver_settings(&settings.method, tolerance, Limit::default());
                Simulator::new(hybrid.clone(), chosen).order()
            }
            Road::Elements(complementarity, options, _) => {
                let chosen = elements::Settings::new(options.scheme.0, options.scheme.1);
                let simulator = elements::Simulator::new(complementarity, chosen);
                simulator.map_or(0, |simulator| simulator.order())
            }
        }
    }

    fn method(&self, settings: &Settings, order: usize) -> Method {
        let number = |name: &str, value: f64| (name.to_owned(), MethodOption::Number(value));
        let word =
            |name: &str, value: &str| (name.to_owned(), MethodOption::Text(value.to_owned()));
        let mut shown = vec![number("order", order as f64)];
        let name = match self {
            Road::Events(_) => {
                shown.push(word("lowering", "timefreezing"));
                "event"
            }
            Road::Elements(_, options, formulation) => {
                let (family, nodes) = options.scheme;
                let lowering = format!("timefreezing, {formulation}");
                shown.push(word("scheme", &format!("{}({nodes})", family.word())));
                shown.push(word("lowering", &lowering));
                if let Some(steps) = options.steps {
                    shown.push(number("steps", steps as f64));
                    shown.push(number("elements", options.elements as f64));
                }
                "fesd"
            }
        };
        if !settings.method.has_steps() {
            shown.push(number("tolerance", settings.tolerance));
        }
        Method {
            name: name.to_owned(),
            options: shown,
        }
    }
}

/// The grid of a numerical time, as a share of the horizon: steps keep their length.
fn grid(options: &FesdOptions, tolerance: f64, fine: bool, share: f64) -> Grid {
    let refined = if fine { 2 } else { 1 };
    match options.steps {
        Some(steps) => Grid::Steps {
            steps: ((refined * steps) as f64 * share - 1e-9).ceil().max(1.0) as usize,
            elements: options.elements,
        },
        None => Grid::Adaptive {
            tolerance: if fine {
                REFINEMENT * tolerance
            } else {
                tolerance
            },
        },
    }
}
