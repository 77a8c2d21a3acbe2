//! The method of an experiment, with what is compiled of its system before it runs.

pub(crate) mod adaptive;
pub(super) mod blurred;
mod branching;
mod described;
mod events;
pub mod fesd;
pub(crate) mod frozen;
pub mod moreau;
mod smoothed;

use std::sync::Arc;

use nsd_solver::fesd::jumps::Reference;

use adaptive::Adaptive;
use events::Events;
pub(crate) use events::solver_settings;
use fesd::ByElements;
use fesd::impulses::WithImpulses;
use fesd::stepping::Stepping;
use frozen::InNumericalTime;
use moreau::Contacts;

use super::driver::{self, Accuracy, Problem, Run};
use super::reference::slips;
use super::sensing::Sensing;
use super::{Progress, ReferenceRun, Request, outcome};
use crate::limit::Limit;
use crate::report::Trajectory;
use crate::simulate::record::modes::ModeNames;
use crate::simulate::record::reported::Reported;
use crate::source::table::Table;
use crate::system::System;
use crate::system::experiment::{Lowering, Method, MethodKind, Settings};

/// A system that is ready to be run, again and again with other seeds and initial states.
pub struct Plan<'e> {
    run: Box<dyn Run<'e> + 'e>,
    reported: Arc<Reported>,
    /// The parameters that stay open, by their numbers.
    open: Vec<usize>,
    made: Made,
}

/// The numbers that a system was compiled with, and for which method.
struct Made {
    x0: Vec<f64>,
    params: Vec<f64>,
    tables: Vec<Arc<Table>>,
    horizon: f64,
    /// None for runs from event to event, whatever the experiment says.
    method: Option<MethodKind>,
    lowerings: Vec<Lowering>,
}

impl Made {
    fn of(system: &System, settings: &Settings) -> Self {
        Made {
            x0: system.states.iter().map(|state| state.initial).collect(),
            params: system.exogenous.numbers().map(|(_, p)| p).collect(),
            tables: system
                .exogenous
                .data
                .iter()
                .map(|data| data.table.clone())
                .collect(),
            horizon: settings.horizon,
            method: Some(settings.numerics.method.kind()),
            lowerings: settings.numerics.lowerings.clone(),
        }
    }

    /// Whether parameters that do not stay open are the same.
    fn has_params(&self, other: &Self, open: &[usize]) -> bool {
        let mut pairs = self.params.iter().zip(&other.params).enumerate();
        let same = pairs.all(|(at, (a, b))| a == b || open.contains(&at));
        same && self.params.len() == other.params.len()
    }

    /// Whether the method and its lowerings are the same.
    fn has_method(&self, other: &Self) -> bool {
        let same = self.method == other.method && self.lowerings == other.lowerings;
        self.method.is_none() || same
    }

    /// Whether starts, signals and the horizon are the same.
    fn has_numbers(&self, other: &Self) -> bool {
        let mut tables = self.tables.iter().zip(&other.tables);
        self.x0 == other.x0
            && tables.all(|(a, b)| Arc::ptr_eq(a, b))
            && self.horizon == other.horizon
    }
}

impl<'e> Plan<'e> {
    /// Compiles a system for the method of an experiment.
    pub fn new(system: &System<'e>, settings: &Settings<'e>) -> Self {
        Plan::of_method(system, settings, &[])
    }

    /// The same with some parameters open, by their numbers, for a method whose runs have other values of them.
    pub(crate) fn of_method(system: &System<'e>, settings: &Settings<'e>, open: &[usize]) -> Self {
        Plan::by(of(system, settings, open), system, settings, open)
    }

    /// Compiles a system for runs from event to event, with some parameters open, by their numbers.
    pub(crate) fn open(system: &System<'e>, settings: &Settings<'e>, open: &[usize]) -> Self {
        let events = Events::new(system, settings, open);
        let mut plan = Plan::by(Box::new(events), system, settings, open);
        plan.made.method = None;
        plan
    }

    fn by(
        run: Box<dyn Run<'e> + 'e>,
        system: &System<'e>,
        settings: &Settings<'e>,
        open: &[usize],
    ) -> Self {
        let reported = Reported::new(system, open);
        let reported = match run.sees_narrow() {
            true => reported,
            false => reported.and_hiding(system),
        };
        Plan {
            run,
            reported: Arc::new(reported),
            open: open.to_vec(),
            made: Made::of(system, settings),
        }
    }

    /// Integrates the system, which may have other numbers than when it was compiled, over the horizon of the experiment,
    /// and calls `watch` every few steps. What was compiled in and is another number now is compiled again.
    pub fn run(
        &mut self,
        system: &System<'e>,
        settings: &Settings<'e>,
        request: &Request,
        watch: &mut dyn FnMut(Progress),
    ) -> Trajectory {
        self.run_sensed(system, settings, (request, None), watch)
    }

    /// The same, differentiated where that is asked for.
    pub(crate) fn run_sensed(
        &mut self,
        system: &System<'e>,
        settings: &Settings<'e>,
        asked: (&Request, Option<&Sensing>),
        watch: &mut dyn FnMut(Progress),
    ) -> Trajectory {
        self.renew(system, settings);
        let of = (system, settings);
        driver::drive(&mut *self.run, of, &self.reported, asked, watch)
    }

    /// Compiles again where what was compiled in is another number now.
    fn renew(&mut self, system: &System<'e>, settings: &Settings<'e>) {
        let now = Made::of(system, settings);
        let serves = self.made.has_params(&now, &self.open)
            && self.made.has_method(&now)
            && match self.run.takes_numbers() {
                true => now.horizon <= self.made.horizon,
                false => self.made.has_numbers(&now),
            };
        if !serves {
            *self = match self.made.method {
                None => Plan::open(system, settings, &self.open),
                Some(_) => Plan::of_method(system, settings, &self.open),
            };
        }
    }

    /// A run from event to event whose modes are followed, by a system that was compiled for such runs.
    pub(crate) fn reference(
        &mut self,
        system: &System<'e>,
        settings: &Settings<'e>,
        limit: &Limit,
    ) -> ReferenceRun<'e> {
        let (system, settings) = ReferenceRun::asked(system, settings);
        self.renew(&system, &settings);
        let (accuracy, events) = (Accuracy::of(&settings), &mut self.run);
        let problem = Problem::of_end(&system, &settings, limit);
        let run = Reference::follow(
            |observer| events.march(&problem, accuracy, observer).outcome,
            |time, x| slips(&system, time, x),
        );
        let names = ModeNames::new(&system);
        let failure = outcome::failure(&system, &names, &run.outcome, &settings);
        ReferenceRun {
            run,
            failure,
            system,
        }
    }
}

/// The method of an experiment, with some parameters open, by their numbers, where it takes them.
pub(crate) fn of<'e>(
    system: &System<'e>,
    settings: &Settings<'e>,
    open: &[usize],
) -> Box<dyn Run<'e> + 'e> {
    assert!(
        system.jumps.impulsive.is_empty() || settings.steps_through_contacts(),
        "contacts without forces are for steps of time"
    );
    // Without contacts there are no impulses to take.
    let impulses = settings.takes_impulses() && !system.jumps.contacts.is_empty();
    match settings.numerics.method {
        Method::Adaptive => Box::new(Adaptive::new(system, settings, open)),
        Method::Timestepping(_) if !system.jumps.impulsive.is_empty() => {
            Box::new(Contacts::new(system, settings, open))
        }
        Method::Timestepping(_) => Box::new(Stepping::new(system, settings, open)),
        _ if settings.freezes() => Box::new(InNumericalTime::new(system, settings, open)),
        Method::Fesd(_) if impulses => Box::new(WithImpulses::new(system, settings, open)),
        Method::Fesd(_) => Box::new(ByElements::new(system, settings, open)),
        Method::Auto | Method::Event(_) | Method::Smoothing(_) => {
            Box::new(Events::new(system, settings, open))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Plan;
    use crate::report::Trajectory;
    use crate::simulate::Request;
    use crate::system::System;
    use crate::system::experiment::Settings;
    use crate::testing::with_last;

    fn run<'e>(plan: &mut Plan<'e>, system: &System<'e>, settings: &Settings<'e>) -> Trajectory {
        plan.run(system, settings, &Request::default(), &mut |_| {})
    }

    /// A block on a belt.
    const BELT: &str =
        "param mu = 0.6; state q = 0; state v = 1; q' = v; v' = -q - mu*sign(v - 0.3);";
    /// A threshold that jumps with time.
    const LED: &str = "param mu = 0.6; state q = 0; q' = if q > (if time > 0.4 then 0.7 else 0.5) then 0.5*mu else mu;";
    /// A block that is thrown.
    const THROWN: &str = "param mu = 0.6; state q[2] = [0, 3]; state v[2] = [2, 0]; q' = v;
        mechanics q, v {
            mass = 1; force = [0, -9.81];
            contact floor { gap = q[2]; slip = v[1]; restitution = 0.5; friction = mu; }
        }";

    /// With other friction and other starts, runs of one compilation make no expression, and end where the same compiled
    /// with these numbers ends.
    #[test]
    fn runs_take_other_numbers_without_compiling() {
        for (model, method) in [
            (BELT, "method fesd;"),
            (BELT, "method timestepping { steps = 200; }"),
            (LED, "method timestepping { steps = 200; }"),
            (LED, "method adaptive;"),
            (THROWN, "method timestepping { steps = 200; }"),
            (THROWN, "lower timefreezing;"),
            (THROWN, "lower timefreezing; method fesd { steps = 20; }"),
        ] {
            let text = format!("model m {{ {model} }} simulate o of m {{ horizon 1.5; {method} }}");
            with_last(&text, |compiled| {
                let settings = &compiled.settings;
                let mut system = compiled.system.clone();
                let mut plan = Plan::of_method(&system, settings, &[0]);
                run(&mut plan, &system, settings);
                for (mu, q) in [(0.2, 0.5), (0.9, -1.0)] {
                    system.exogenous.params[0].value = mu;
                    system.states[0].initial = q;
                    let known = system.exprs.n_nodes();
                    let found = run(&mut plan, &system, settings);
                    assert_eq!(system.exprs.n_nodes(), known, "{method} compiles");
                    let fresh = run(&mut Plan::new(&system, settings), &system, settings);
                    for (found, fresh) in found.samples.states.iter().zip(&fresh.samples.states) {
                        let [found, fresh] = [found, fresh].map(|x| x.values.last().copied());
                        let apart = found.zip(fresh).map(|(a, b)| (a - b).abs());
                        assert!(apart.is_some_and(|apart| apart <= 1e-11), "{method}");
                    }
                }
            });
        }
    }

    /// A ball bounces by elements with impulses: from other heights, with another gravity and restitution, it is where one
    /// is that is compiled with these numbers. A fall takes √(2 q/g), and a bounce has e of its speed.
    #[test]
    fn impulses_take_other_numbers() {
        let text = "model m {
                      param g = 9.81; param e = 0.5; state q = 1; state v = 0;
                      q' = v;
                      mechanics q, v {
                        mass = 1; force = -g;
                        contact floor { gap = q; restitution = e; }
                      }
                    }
                    simulate o of m {
                      horizon 0.7; lower impact; method fesd { steps = 6; elements = 3; }
                    }";
        with_last(text, |compiled| {
            let (settings, open) = (&compiled.settings, [0, 1]);
            let mut system = compiled.system.clone();
            let mut plan = Plan::of_method(&system, settings, &open);
            run(&mut plan, &system, settings);
            for (g, e, q) in [(9.0, 0.4, 1.0), (8.0, 0.6, 0.8)] {
                (
                    system.exogenous.params[0].value,
                    system.exogenous.params[1].value,
                ) = (g, e);
                system.states[0].initial = q;
                let known = system.exprs.n_nodes();
                let found = run(&mut plan, &system, settings);
                assert_eq!(system.exprs.n_nodes(), known, "{g} compiles");
                let fresh = Plan::of_method(&system, settings, &open);
                let fresh = run(&mut { fresh }, &system, settings);
                let [found, fresh] = [found, fresh].map(|run| {
                    run.samples
                        .states
                        .iter()
                        .map(|x| x.values.clone())
                        .collect::<Vec<_>>()
                });
                assert_eq!(found, fresh);
                let fall = f64::sqrt(2.0 * q / g);
                let s = 0.7 - fall;
                let exact = s * (e * g * fall - 0.5 * g * s);
                let height = found[0].last().map(|q| (q - exact).abs());
                assert!(height.is_some_and(|error| error <= 1e-9), "{height:?}");
            }
        });
    }
}
