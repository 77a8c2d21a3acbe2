//! Systems as plain data of which a whole number is another: each is refused, or runs to some end, and nothing panics, hangs
//! or eats memory.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use ciborium::Value;
use nsd_solver::event::{self, Event, Observer, Segment};
use nsd_solver::fesd::jumps::{self, Grid};
use nsd_solver::fesd::{self, ComplementaritySystem};
use nsd_solver::hybrid::{self, HybridSystem};
use nsd_solver::integrate::tableau::Family;
use nsd_solver::runtime::limit::{Cancel, Limit};
use nsd_tests::{for_each_example, with_experiment};
use nsdc::lowering::mpcc::Program;
use nsdc::lowering::{dcs, hybrid as events};
use nsdc::simulate::fesd::{complementarity, with_impulses};
use nsdc::system::System;
use serde::Serialize;
use serde::de::DeserializeOwned;

struct Silent;

impl Observer for Silent {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {}
}

impl fesd::Observer for Silent {}

/// How many damaged systems were refused, and how many run.
#[derive(Debug, Default)]
struct Met {
    refused: usize,
    run: usize,
}

impl Met {
    /// Damages a system at so many places.
    fn damage<T: Serialize + DeserializeOwned>(
        &mut self,
        system: &T,
        places: usize,
        mut run: impl FnMut(T),
    ) {
        let written = Value::serialized(system).expect("it can be written");
        let n = integers(&written);
        for (k, at) in (0..n).step_by((n / places).max(1)).enumerate() {
            let (mut damaged, mut left) = (written.clone(), at);
            let number = integer(&mut damaged, &mut left).expect("there are so many");
            let before = i128::from(number.as_integer().expect("it is one"));
            let others = [before + 1, 0, before + 7, 1 << 40];
            *number = Value::from(others[k % others.len()] as u64);
            match damaged.deserialized() {
                Ok(read) => {
                    self.run += 1;
                    run(read);
                }
                Err(_) => self.refused += 1,
            }
        }
    }
}

fn integers(value: &Value) -> usize {
    match value {
        Value::Integer(_) => 1,
        Value::Array(values) => values.iter().map(integers).sum(),
        Value::Map(entries) => entries.iter().map(|(_, value)| integers(value)).sum(),
        _ => 0,
    }
}

/// The whole number that so many are before.
fn integer<'v>(value: &'v mut Value, left: &mut usize) -> Option<&'v mut Value> {
    match value {
        Value::Integer(_) if *left == 0 => Some(value),
        Value::Integer(_) => {
            *left -= 1;
            None
        }
        Value::Array(values) => values.iter_mut().find_map(|value| integer(value, left)),
        Value::Map(entries) => (entries.iter_mut()).find_map(|(_, value)| integer(value, left)),
        _ => None,
    }
}

/// Until somebody has looked at it so often.
fn limit() -> Limit {
    let looks = AtomicUsize::new(0);
    let cancel = Cancel::asking(move || looks.fetch_add(1, Ordering::Relaxed) >= 200);
    Limit::default().canceled_by(&cancel)
}

fn start(system: &System) -> Vec<f64> {
    system.states.iter().map(|state| state.initial).collect()
}

#[test]
fn systems_event_by_event() {
    let mut met = Met::default();
    for_each_example(|_, system| {
        let (lowered, x0) = (events::lower_over(system, 1.0), start(system));
        met.damage(&*lowered, 20, |read: HybridSystem| {
            let settings = hybrid::Settings {
                max_steps: 30,
                limit: limit(),
                ..hybrid::Settings::default()
            };
            let mut simulator = event::Simulator::new(read.into(), settings);
            simulator.run(0.0, 1.0, &x0, &mut Silent);
        });
    });
    assert!(met.refused > 100 && met.run > 100, "{met:?}");
}

#[test]
fn systems_by_elements() {
    let mut met = Met::default();
    for_each_example(|_, system| {
        let Some(dcs) = dcs::check(system, &[], true)
            .ok()
            .and_then(|_| dcs::lower(system, &[]).ok())
            .filter(|dcs| dcs.impacts.is_empty() && system.first_nonlinear().is_none())
        else {
            return;
        };
        let (lowered, x0) = (complementarity(system, &dcs), start(system));
        met.damage(&lowered, 20, |read: ComplementaritySystem| {
            let settings = fesd::Settings {
                max_elements: 20,
                limit: limit(),
                ..fesd::Settings::new(Family::RadauIia, 3)
            };
            let mut simulator = fesd::Simulator::new(&read, settings).expect("nodes are allowed");
            simulator.run(0.0, 1.0, &x0, &mut Silent);
        });
    });
    assert!(met.refused > 100 && met.run > 100, "{met:?}");
}

/// A block in a plane that turns round.
#[test]
fn systems_with_impulses() {
    let text = "model m {
        state q[3] = [0, 0, 0]; state v[3] = [0.6, 0.8, 0];
        q' = v;
        mechanics q, v {
          mass = eye(3); force = [-1.8, -2.4, -10];
          contact ground { gap = q[3]; slip = [v[1], v[2]]; restitution = 0; friction = 0.2; }
        }
      }
      simulate s of m {
        horizon 1; lower impact;
        method fesd { scheme = radau_iia(3); steps = 5; elements = 3; }
      }";
    let mut met = Met::default();
    with_experiment(text, "s", |compiled| {
        let mut lowered = with_impulses(&compiled.system, &compiled.settings, &[]);
        lowered.programs.retain(|elements, _| *elements == 3);
        let x0 = start(&compiled.system);
        met.damage(&lowered, 300, |read: jumps::System<Program>| {
            let (mut runs, limit) = (jumps::Simulator::new(read), limit());
            let grid = Grid {
                horizon: 1.0,
                steps: 5,
                elements: 3,
            };
            let reference = runs.follow(grid.horizon, &x0, &limit);
            let near = (&reference, &limit);
            runs.run(grid, &x0, near, &mut |_| None, &mut Silent);
        });
    });
    assert!(met.refused > 75 && met.run > 30, "{met:?}");
}
