//! Finite elements allocate nothing but where the active set changes, events and steps through contacts nothing at all.

use nsd_solver::event::{Event, Segment, Simulator as EventSimulator};
use nsd_solver::fesd::{Grid, Observer, Settings, Simulator};
use nsd_solver::hybrid::{Settings as EventSettings, Status};
use nsd_solver::integrate::tableau::Family;
use nsd_solver::moreau::{self, Change};
use nsd_tests::with_experiment;
use nsdc::limit::Limit;
use nsdc::lowering::{dcs, hybrid};
use nsdc::simulate::fesd::complementarity;
use nsdc::simulate::moreau::stepper;
use std::ops::ControlFlow;

struct Silent;

impl nsd_solver::event::Observer for Silent {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {}
}

impl Observer for Silent {}

impl moreau::Observer for Silent {
    fn change(&mut self, _: f64, _: usize, _: Change) {}
}

/// Twenty states in a chain and five switches, two of which slide in the end.
const CHAIN: &str = "model chain { const n = 20; state x[n] = [0.5*sin(i) for i in 1..n]; \
  x[1]' = 0.3 - sign(x[1]) - 0.1*x[2]; x[2]' = 0.2*x[1] - sign(x[2]); \
  x[3]' = cos(time) - 0.1*sign(x[3] + 9); x[4]' = x[3] + 0.1*sign(x[4] - 9); x[5]' = -x[5]^3 + 0.1*sign(x[5] + 8); \
  for i in 6..n { x[i]' = x[i - 1] - x[i]; } }
  simulate run of chain { horizon 4; }";

#[test]
fn steps_of_finite_elements_allocate_nothing() {
    with_experiment(CHAIN, "run", |compiled| {
        let dcs = dcs::lower(&compiled.system, &[]).expect("its switches can be lowered");
        let system = complementarity(&compiled.system, &dcs);
        let states = compiled.system.states.iter();
        let x0: Vec<f64> = states.map(|state| state.initial).collect();
        let allocations = |steps: usize| {
            let grid = Grid::Steps { steps, elements: 1 };
            let settings = Settings {
                grid,
                ..Settings::new(Family::RadauIia, 3)
            };
            let mut simulator = Simulator::new(&system, settings).expect("three nodes are allowed");
            // The first run compiles.
            simulator.run(0.0, 4.0, &x0, &mut Silent);
            let mut events = 0;
            let counted = allocation_counter::measure(|| {
                let solution = simulator.run(0.0, 4.0, &x0, &mut Silent);
                assert_eq!(solution.outcome.status, Status::Solved);
                events = solution.outcome.stats.events;
            });
            (counted.count_total, events)
        };
        let (few, many) = (allocations(100), allocations(300));
        assert!(few.1 >= 2, "{} events", few.1);
        assert_eq!(few, many);
    });
}

/// Discs that fall onto each other and into the corners of a bin.
const PILE: &str = "model disc { state q[2]; state v[2] = [0, 0]; q' = v;
  mechanics q, v { mass = eye(2); force = [-1, -9.81]; } }
  model pile { const n = 6; part ball[i in 1..n] = disc { q = [0.4 + 0.1*sin(5*i), 0.3*i]; }
  for i in 1..n {
    contact floor { gap = ball[i].q[2] - 0.1; restitution = 0.3; friction = 0.2; }
    contact wall { gap = ball[i].q[1] - 0.1; restitution = 0.3; }
  }
  for i in 1..n, j in i+1..n {
    contact pair { gap = norm(ball[i].q - ball[j].q) - 0.2; restitution = 0.3; }
  } }
  simulate run of pile { horizon 2; method timestepping { steps = 1000; } }";

#[test]
fn steps_through_contacts_allocate_nothing() {
    with_experiment(PILE, "run", |compiled| {
        let states = compiled.system.states.iter();
        let x0: Vec<f64> = states.map(|state| state.initial).collect();
        let allocations = |steps: usize| {
            let mut stepper = stepper(&compiled.system, 2.0, steps, Limit::default());
            // The first run makes room.
            stepper.run(0.0, 2.0, &x0, &mut Silent);
            let mut impulses = 0;
            let counted = allocation_counter::measure(|| {
                let solution = stepper.run(0.0, 2.0, &x0, &mut Silent);
                assert_eq!(solution.outcome.status, Status::Solved);
                impulses = solution.impulses;
            });
            (counted.count_total, impulses)
        };
        let (few, many) = (allocations(1000), allocations(3000));
        assert!(few.1 >= 1000, "{} impulses", few.1);
        assert_eq!(few.0, many.0);
    });
}

/// A ball that bounces without loss; a surface that is crossed again and again; a block on a belt that sticks and slips; and a
/// relay with two thresholds.
const EVENTS: [&str; 4] = [
    "model ball { state q = 0.5; state v = 0; q' = v; v' = -9.81; jump floor when q <= 0 and v < 0 { v := -v; } }",
    "model crossing { state x = 1; state y = 0; x' = y; y' = -x - 0.2*sign(x); }",
    "model belt { state x = 1; state v = 0; x' = v; v' = -x - (0.5 + 0.5*exp(-abs(v - 0.2)))*sign(v - 0.2); }",
    "model thermostat { state x = 0; switch heater = hysteresis(x, on = 1, off = 2); x' = 2*heater - 1; }",
];

/// What is kept of events to tell whether they accumulate grows by some entries wherever their number doubles.
#[test]
fn events_allocate_nothing() {
    const KEPT: u64 = 8;
    for model in EVENTS {
        let name = model.split_whitespace().nth(1).expect("it has a name");
        let text = format!("{model}\nsimulate run of {name} {{ horizon 10; }}");
        with_experiment(&text, "run", |compiled| {
            let states = compiled.system.states.iter();
            let x0: Vec<f64> = states.map(|state| state.initial).collect();
            let system = hybrid::lower(&compiled.system);
            let mut simulator = EventSimulator::new(system, EventSettings::default());
            let mut allocations = |horizon: f64| {
                let mut events = 0;
                let counted = allocation_counter::measure(|| {
                    let outcome = simulator.run(0.0, horizon, &x0, &mut Silent);
                    assert_eq!(outcome.status, Status::Solved, "{name}");
                    events = outcome.stats.events;
                });
                (counted.count_total, events)
            };
            // The first run compiles its modes.
            allocations(100.0);
            let (few, many) = (allocations(100.0), allocations(1000.0));
            assert!(many.1 >= few.1 + 200, "{name}: {} events", many.1);
            assert!(many.0 <= few.0 + KEPT, "{name}: {few:?} and {many:?}");
        });
    }
}
