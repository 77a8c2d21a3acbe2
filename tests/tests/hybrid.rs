//! Hybrid systems as plain data: what is written is read again, and runs the same, on one thread or on several.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::thread;

use nsd_solver::event::{Event, Observer, Segment, Simulator};
use nsd_solver::hybrid::{HybridSystem, Settings, Status};
use nsd_tests::{for_each_example, with_experiment};
use nsdc::lowering::hybrid;
use nsdc::system::System;

/// Everything that a run says: its events, and its end.
#[derive(Clone, Debug, Default, PartialEq)]
struct Seen {
    events: Vec<(u64, Vec<u64>)>,
    end: Vec<u64>,
    status: String,
}

impl Observer for Seen {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        self.events.push((event.time.to_bits(), bits(event.x)));
    }
}

fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|number| number.to_bits()).collect()
}

fn settings() -> Settings {
    Settings {
        max_steps: 100,
        ..Settings::default()
    }
}

fn run(system: Arc<HybridSystem>, x0: &[f64]) -> Seen {
    let mut seen = Seen::default();
    let outcome = Simulator::new(system, settings()).run(0.0, 1.0, x0, &mut seen);
    seen.end = bits(&outcome.x);
    seen.status = format!("{:?}", outcome.status);
    seen
}

fn start(system: &System) -> Vec<f64> {
    system.states.iter().map(|state| state.initial).collect()
}

fn written(system: &HybridSystem) -> Vec<u8> {
    let mut bytes = Vec::new();
    ciborium::into_writer(system, &mut bytes).expect("it can be written");
    bytes
}

/// The examples have all kinds of switches, laws and data.
#[test]
fn what_is_read_again_runs_the_same() {
    for_each_example(|stem, system| {
        let lowered = hybrid::lower_over(system, 1.0);
        lowered.check().expect("a lowering keeps the invariants");
        let read: HybridSystem = ciborium::from_reader(&written(&lowered)[..]).expect("it is one");
        let x0 = start(system);
        let [first, second] = [lowered, Arc::new(read)].map(|system| run(system, &x0));
        assert_eq!(first, second, "{stem}, {}", system.name);
    });
}

#[test]
fn threads_share_a_system() {
    for_each_example(|stem, system| {
        let (lowered, x0) = (hybrid::lower(system), start(system));
        let alone = run(lowered.clone(), &x0);
        let both = thread::scope(|scope| {
            let runs = [(); 2].map(|()| scope.spawn(|| run(lowered.clone(), &x0)));
            runs.map(|run| run.join().expect("it ends"))
        });
        assert_eq!(both, [alone.clone(), alone], "{stem}, {}", system.name);
    });
}

/// A simulator that has run is none the wiser.
#[test]
fn a_run_leaves_nothing_to_the_next() {
    for_each_example(|stem, system| {
        let (lowered, x0) = (hybrid::lower(system), start(system));
        let mut simulator = Simulator::new(lowered, settings());
        let ends = [(); 2].map(|()| {
            let mut seen = Seen::default();
            let outcome = simulator.run(0.0, 1.0, &x0, &mut seen);
            seen.end = bits(&outcome.x);
            seen
        });
        assert_eq!(ends[0], ends[1], "{stem}, {}", system.name);
    });
}

/// Parameters as inputs, with their values or with others, and as numbers that are compiled in.
#[test]
fn parameters_are_inputs() {
    let mut count = 0;
    for_each_example(|stem, system| {
        let open = hybrid::may_be_open(system);
        if open.is_empty() {
            return;
        }
        let x0 = start(system);
        let mut simulator = Simulator::new(hybrid::lower_open(system, 1.5, &open), settings());
        for factor in [1.0, 1.01, 0.97] {
            let mut other = system.clone();
            for &place in &open {
                other.exogenous.params[place].value *= factor;
            }
            let values: Vec<f64> = open
                .iter()
                .map(|&place| other.exogenous.params[place].value)
                .collect();
            simulator.set_parameters(&values);
            let name = format!("{stem}, {}, times {factor}", system.name);
            let found = simulator.run(0.0, 1.0, &x0, &mut Seen::default());
            let mut fixed = Simulator::new(hybrid::lower(&other), settings());
            let fixed = fixed.run(0.0, 1.0, &x0, &mut Seen::default());
            assert_eq!(
                format!("{:?}", found.status),
                format!("{:?}", fixed.status),
                "{name}"
            );
            if fixed.status == Status::Solved {
                count += 1;
                assert_eq!(found.sides, fixed.sides, "{name}");
                for (a, b) in found.x.iter().zip(&fixed.x) {
                    let error = (a - b).abs();
                    assert!(error <= 1e-7 * (1.0 + b.abs()), "{name}: {a} and {b}");
                }
            }
        }
    });
    assert!(count >= 90, "{count} runs");
}

/// The ball with other restitutions: every bounce lasts 2 v/g, and v = e v behind it.
#[test]
fn balls_with_other_restitutions() {
    let text = include_str!("../../examples/bouncing_ball.nsd");
    with_experiment(text, "bounces", |compiled| {
        let system = &compiled.system;
        let open = hybrid::may_be_open(system);
        let place = |name: &str| {
            let is_it = |&at: &usize| system.exogenous.params[open[at]].name == name;
            (0..open.len()).find(is_it).expect("it is open")
        };
        let (g, e) = (place("g"), place("e"));
        let lowered = hybrid::lower_open(system, 1.5, &open);
        let mut parameters = lowered.parameters.clone();
        let mut simulator = Simulator::new(lowered, Settings::default());
        for k in 0..1000 {
            parameters[g] = 9.0 + 0.001 * f64::from(k);
            parameters[e] = 0.8 + 0.0002 * f64::from(k);
            simulator.set_parameters(&parameters);
            let outcome = simulator.run(0.0, 1.5, &[0.5, 0.0], &mut Seen::default());
            let [q, v] = bounced(parameters[g], parameters[e], 1.5);
            let error = (outcome.x[0] - q).abs().max((outcome.x[1] - v).abs());
            assert!(error <= 1e-12, "{k}: {error:e}");
        }
    });
}

/// Where a ball is that falls from 1/2.
fn bounced(g: f64, e: f64, horizon: f64) -> [f64; 2] {
    let mut t = (1.0 / g).sqrt();
    let mut v = e * g * t;
    while t + 2.0 * v / g <= horizon {
        t += 2.0 * v / g;
        v *= e;
    }
    let s = horizon - t;
    [s * (v - 0.5 * g * s), v - g * s]
}
