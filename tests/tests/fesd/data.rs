//! Complementarity systems as plain data: what is written is read again, and runs the same, on one thread or on several.

use std::ops::ControlFlow;
use std::thread;

use nsd_solver::event::{Event, Segment};
use nsd_solver::fesd::{ComplementaritySystem, Observer, Settings, Simulator};
use nsd_solver::integrate::tableau::Family;
use nsd_tests::for_each_example;
use nsdc::lowering::dcs;
use nsdc::simulate::fesd::complementarity;
use nsdc::system::System;

/// Everything that a run says: its events, and its end.
#[derive(Clone, Debug, Default, PartialEq)]
struct Seen {
    events: Vec<(u64, Vec<u64>)>,
    end: Vec<u64>,
    status: String,
}

impl nsd_solver::event::Observer for Seen {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        self.events.push((event.time.to_bits(), bits(event.x)));
    }
}

impl Observer for Seen {}

fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|number| number.to_bits()).collect()
}

fn run(system: &ComplementaritySystem, x0: &[f64]) -> Seen {
    let settings = Settings {
        max_elements: 50,
        ..Settings::new(Family::RadauIia, 3)
    };
    let mut simulator = Simulator::new(system, settings).expect("three nodes are allowed");
    let mut seen = Seen::default();
    let outcome = simulator.run(0.0, 1.0, x0, &mut seen).outcome;
    seen.end = bits(&outcome.x);
    seen.status = format!("{:?}", outcome.status);
    seen
}

/// The system, where it is one of complementarity, and where it starts.
fn lowered(system: &System) -> Option<(ComplementaritySystem, Vec<f64>)> {
    dcs::check(system, &[], true).ok()?;
    let dcs = dcs::lower(system, &[]).ok()?;
    let start = system.states.iter().map(|state| state.initial).collect();
    let is_plain = dcs.impacts.is_empty() && system.first_nonlinear().is_none();
    is_plain.then(|| (complementarity(system, &dcs), start))
}

#[test]
fn what_is_read_again_runs_the_same_on_every_thread() {
    let mut n_systems = 0;
    for_each_example(|stem, system| {
        let Some((lowered, x0)) = lowered(system) else {
            return;
        };
        n_systems += 1;
        lowered.check().expect("a lowering keeps the invariants");
        let mut bytes = Vec::new();
        ciborium::into_writer(&lowered, &mut bytes).expect("it can be written");
        let read: ComplementaritySystem = ciborium::from_reader(&bytes[..]).expect("it is one");
        let alone = run(&lowered, &x0);
        let both = thread::scope(|scope| {
            let runs = [&lowered, &read].map(|system| scope.spawn(|| run(system, &x0)));
            runs.map(|run| run.join().expect("it ends"))
        });
        assert_eq!(both, [alone.clone(), alone], "{stem}, {}", system.name);
    });
    assert!(n_systems > 20, "{n_systems} systems");
}

/// A simulator that takes what another one has made finds the same.
#[test]
fn what_runs_have_made_changes_nothing() {
    for_each_example(|stem, system| {
        let Some((lowered, x0)) = lowered(system) else {
            return;
        };
        let simulator = || {
            let settings = Settings {
                max_elements: 50,
                ..Settings::new(Family::RadauIia, 3)
            };
            Simulator::new(&lowered, settings).expect("three nodes are allowed")
        };
        let mut first = simulator();
        let end = |simulator: &mut Simulator| {
            bits(&simulator.run(0.0, 1.0, &x0, &mut Seen::default()).outcome.x)
        };
        let alone = end(&mut first);
        let again = end(&mut simulator().knowing(first.library().clone()));
        assert_eq!(alone, again, "{stem}, {}", system.name);
    });
}
