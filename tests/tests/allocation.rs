//! Finite elements allocate nothing but where the active set changes.

use nsd_solver::fesd::{Grid, Observer, Settings, Simulator};
use nsd_solver::simulate::{Event, Segment, Status};
use nsd_solver::tableau::Family;
use nsd_tests::with_experiment;
use nsdc::dcs;
use nsdc::simulate::fesd::Complementarity;
use std::ops::ControlFlow;

struct Silent;

impl nsd_solver::simulate::Observer for Silent {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {}
}

impl Observer for Silent {}

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
        let system = Complementarity::new(&compiled.system, &dcs);
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
