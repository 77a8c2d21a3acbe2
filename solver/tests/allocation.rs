//! Steps allocate nothing.

use std::ops::ControlFlow;

use nsd_solver::simulate::{
    Event, ModeFunctions, Observer, Segment, Settings, Side, Simulator, Status, SwitchedSystem,
};
use nsd_solver::tape::Tape;

/// x₁' = x₂, x₂' = -x₁, x₃' = 1 + x₁/2 - 2α on ψ₁ = x₃, and ψ₂ = x₁ - 1.001, which is never reached
/// but close enough for its polynomial to be looked at.
struct Rotation;

impl SwitchedSystem for Rotation {
    fn n_states(&self) -> usize {
        3
    }

    fn n_switches(&self) -> usize {
        2
    }

    fn is_continuous(&self, _: usize) -> bool {
        false
    }

    fn couples(&self, rate: usize, alpha: usize) -> bool {
        rate == 0 && alpha == 0
    }

    fn compile(&self, sides: &[Side]) -> ModeFunctions {
        let sliding: Vec<usize> = (0..2).filter(|&i| sides[i] == Side::Slide).collect();
        let mut tape = Tape::builder(4 + sliding.len());
        let (x, y, z) = (tape.input(1), tape.input(2), tape.input(3));
        let down = tape.scale(-1.0, x);
        let half = tape.scale(0.5, x);
        let drift = tape.offset(1.0, half);
        let rate = match sides[0] {
            Side::Minus => drift,
            Side::Plus => tape.offset(-2.0, drift),
            Side::Slide => tape.add_scaled(drift, -2.0, tape.input(4)),
        };
        let near = tape.offset(-1.001, x);
        let mut outputs = vec![y, down, rate];
        outputs.extend(sliding.iter().map(|&i| [rate, y][i]));
        outputs.extend([z, near]);
        let field = tape.finish(&outputs);
        let mut tape = Tape::builder(4 + sliding.len());
        let mut numbers = Vec::new();
        for &i in &sliding {
            numbers.extend(sliding.iter().map(|&j| if i + j == 0 { -2.0 } else { 0.0 }));
        }
        for &i in &sliding {
            numbers.extend([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]][i]);
        }
        numbers.extend(sliding.iter().map(|_| 0.0));
        let outputs: Vec<_> = numbers.into_iter().map(|n| tape.constant(n)).collect();
        ModeFunctions {
            field,
            sliding: tape.finish(&outputs),
        }
    }
}

/// Counts steps, and those that slide.
#[derive(Default)]
struct Count {
    steps: usize,
    sliding: usize,
}

impl Observer for Count {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        self.steps += 1;
        self.sliding += usize::from(segment.sides[0] == Side::Slide);
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {}
}

#[test]
fn steps_off_and_on_a_surface_allocate_nothing() {
    for (start, slides) in [(1e3, false), (0.0, true)] {
        let mut simulator = Simulator::new(&Rotation, Settings::default());
        let mut measure = |horizon: f64| {
            let mut count = Count::default();
            let allocations = allocation_counter::measure(|| {
                let x0 = [1.0, 0.0, start];
                let outcome = simulator.run(0.0, horizon, &x0, &mut count);
                assert_eq!(outcome.status, Status::Solved);
            });
            (allocations.count_total, count)
        };
        // The first run compiles the mode.
        measure(1.0);
        let ((short, before), (long, after)) = (measure(10.0), measure(100.0));
        assert!(after.steps > before.steps + 20);
        assert_eq!(after.sliding, if slides { after.steps } else { 0 });
        assert_eq!(short, long, "by {} and {} steps", before.steps, after.steps);
    }
}
