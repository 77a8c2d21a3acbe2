//! Steps allocate nothing.

use std::ops::ControlFlow;
use std::sync::Arc;

use nsd_solver::event::{Event, Observer, Segment, Simulator};
use nsd_solver::hybrid::{HybridSystem, Input, Settings, Side, Status, Switch, SwitchKind};
use nsd_solver::optimization::ipm::{BarrierRule, Options, solve};
use nsd_solver::optimization::problem::{Bounds, Nlp, Pattern, Structure};
use nsd_solver::tape::{Tape, TapeBuilder, Value};

/// x₁' = x₂, x₂' = -x₁, x₃' = 1 + x₁/2 - 2α on ψ₁ = x₃, and ψ₂ = x₁ - 1.001 and ψ₃ = x₁² - 1.001,
/// which are never reached but close enough for their polynomials to be looked at.
fn rotation() -> HybridSystem {
    let mut system = HybridSystem::default();
    let mut tape = Tape::builder(2);
    let (x, y) = (tape.input(0), tape.input(1));
    let down = tape.scale(-1.0, x);
    let rates = tape.finish(&[y, down]);
    system.add_block(vec![0, 1], rates, vec![Input::State(0), Input::State(1)]);
    let mut tape = Tape::builder(2);
    let rate = drift(&mut tape, 0, 1);
    let inputs = vec![Input::State(0), Input::Alpha(0)];
    system.add_block(vec![2], tape.finish(&[rate]), inputs);
    add_surface(&mut system, 2, |_, x| x);
    add_surface(&mut system, 0, |tape, x| tape.offset(-1.001, x));
    add_surface(&mut system, 0, |tape, x| {
        let square = tape.square(x);
        tape.offset(-1.001, square)
    });
    system.switches[0].couplings = vec![0];
    system
}

/// x₁' = -10⁶ (x₁ - cos t), x₂' = 1 + x₁/2 - 2α on ψ₁ = x₂, and ψ₂ = x₁² - 1.1, which is never reached.
fn stiff() -> HybridSystem {
    let mut system = HybridSystem::default();
    let mut tape = Tape::builder(3);
    let (_, cos) = tape.sin_cos(tape.input(0));
    let distance = tape.sub(cos, tape.input(1));
    let fast = tape.scale(1e6, distance);
    let rate = drift(&mut tape, 1, 2);
    let inputs = vec![Input::Time, Input::State(0), Input::Alpha(0)];
    system.add_block(vec![0, 1], tape.finish(&[fast, rate]), inputs);
    add_surface(&mut system, 1, |_, x| x);
    add_surface(&mut system, 0, |tape, x| {
        let square = tape.square(x);
        tape.offset(-1.1, square)
    });
    system.switches[0].couplings = vec![0];
    system
}

/// 1 + x/2 - 2α.
fn drift(tape: &mut TapeBuilder, x: usize, alpha: usize) -> Value {
    let half = tape.scale(0.5, tape.input(x));
    let drift = tape.offset(1.0, half);
    tape.add_scaled(drift, -2.0, tape.input(alpha))
}

/// A switch whose ψ is a function of one state.
fn add_surface(
    system: &mut HybridSystem,
    state: usize,
    psi: impl Fn(&mut TapeBuilder, Value) -> Value,
) {
    let mut tape = Tape::builder(1);
    let x = tape.input(0);
    let psi = psi(&mut tape, x);
    let switch = Switch::new(SwitchKind::Step);
    system.add_switch(switch, tape.finish(&[psi]), vec![Input::State(state)]);
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
    let system = Arc::new(rotation());
    for (start, slides) in [(1e3, false), (0.0, true)] {
        let mut simulator = Simulator::new(system.clone(), Settings::default());
        let mut measure = |horizon: f64| {
            let mut count = Count::default();
            let allocations = allocation_counter::measure(|| {
                let x0 = [1.0, 0.0, start];
                let outcome = simulator.run(0.0, horizon, &x0, &mut count);
                assert_eq!(outcome.status, Status::Solved);
            });
            (allocations.count_total, count)
        };
        // The first run compiles the mode, and gets the memory for a look at ψ.
        measure(10.0);
        let ((short, before), (long, after)) = (measure(10.0), measure(100.0));
        assert!(after.steps > before.steps + 20);
        assert_eq!(after.sliding, if slides { after.steps } else { 0 });
        assert_eq!(short, long, "by {} and {} steps", before.steps, after.steps);
    }
}

#[test]
fn implicit_steps_allocate_nothing() {
    let system = Arc::new(stiff());
    for start in [1e3, 0.0] {
        let mut simulator = Simulator::new(system.clone(), Settings::default());
        let mut measure = |horizon: f64| {
            let mut steps = 0;
            let allocations = allocation_counter::measure(|| {
                let mut count = Count::default();
                let outcome = simulator.run(0.0, horizon, &[1.0, start], &mut count);
                assert_eq!(outcome.status, Status::Solved);
                steps = outcome.stats.implicit_steps;
            });
            (allocations.count_total, steps)
        };
        // The first run compiles the mode.
        measure(1.0);
        let ((short, before), (long, after)) = (measure(10.0), measure(100.0));
        assert!(after > before + 20 && before > 0);
        assert_eq!(short, long, "by {before} and {after} implicit steps");
    }
}

/// min Σ 100 (x_{i+1} - x_i²)² + (1 - x_i)² with 3 x_i³ + x_i x_{i+1} <= 4 and x_i >= -3/2; nothing satisfies <= -20.
struct Chain {
    start: Vec<f64>,
    bounds: [Vec<f64>; 4],
    jacobian: Pattern,
    hessian: Pattern,
}

impl Chain {
    fn new(n: u32, is_infeasible: bool) -> Self {
        let rows = n - 1;
        let infinity = |n: u32, sign: f64| vec![sign * f64::INFINITY; n as usize];
        Chain {
            start: vec![-1.2; n as usize],
            bounds: [
                vec![-1.5; n as usize],
                infinity(n, 1.0),
                infinity(rows, -1.0),
                vec![if is_infeasible { -20.0 } else { 4.0 }; rows as usize],
            ],
            jacobian: Pattern::new(
                rows as usize,
                (0..rows).flat_map(|i| [(i, i), (i, i + 1)]).collect(),
            ),
            hessian: Pattern::new(
                n as usize,
                (0..n)
                    .flat_map(|i| [(i, i), (i, i.saturating_sub(1))])
                    .collect(),
            ),
        }
    }
}

impl Nlp for Chain {
    fn structure(&self) -> Structure<'_> {
        Structure {
            variables: Bounds {
                lower: &self.bounds[0],
                upper: &self.bounds[1],
            },
            rows: Bounds {
                lower: &self.bounds[2],
                upper: &self.bounds[3],
            },
            start: &self.start,
            jacobian: &self.jacobian,
            hessian: &self.hessian,
        }
    }

    fn objective(&mut self, w: &[f64]) -> f64 {
        w.windows(2)
            .map(|w| 100.0 * (w[1] - w[0] * w[0]).powi(2) + (1.0 - w[0]).powi(2))
            .sum()
    }

    fn gradient(&mut self, w: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        for i in 0..w.len() - 1 {
            let bend = w[i + 1] - w[i] * w[i];
            gradient[i] += -400.0 * w[i] * bend - 2.0 * (1.0 - w[i]);
            gradient[i + 1] += 200.0 * bend;
        }
    }

    fn rows(&mut self, w: &[f64], rows: &mut [f64]) {
        for (row, w) in rows.iter_mut().zip(w.windows(2)) {
            *row = 3.0 * w[0].powi(3) + w[0] * w[1];
        }
    }

    fn jacobian(&mut self, w: &[f64], entries: &mut [f64]) {
        for (entries, w) in entries.chunks_mut(2).zip(w.windows(2)) {
            entries[0] = 9.0 * w[0] * w[0] + w[1];
            entries[1] = w[0];
        }
    }

    fn hessian(&mut self, w: &[f64], factor: f64, y: &[f64], entries: &mut [f64]) {
        let last = w.len() - 1;
        // Row i has the entries (i, i - 1) and (i, i).
        for i in 0..w.len() {
            let mut diagonal = 0.0;
            if i < last {
                diagonal +=
                    factor * (1200.0 * w[i] * w[i] - 400.0 * w[i + 1] + 2.0) + 18.0 * y[i] * w[i];
            }
            if i > 0 {
                diagonal += 200.0 * factor;
                entries[2 * i - 1] = -400.0 * factor * w[i - 1] + y[i - 1];
            }
            entries[2 * i] = diagonal;
        }
    }
}

#[test]
fn interior_point_iterations_allocate_nothing() {
    for barrier in [BarrierRule::Monotone, BarrierRule::Adaptive] {
        // The second goes through the restoration.
        for is_infeasible in [false, true] {
            let mut chain = Chain::new(50, is_infeasible);
            let mut measure = |max_iterations| {
                let options = Options {
                    barrier,
                    max_iterations,
                    ..Options::default()
                };
                let mut iterations = 0;
                let allocations = allocation_counter::measure(|| {
                    iterations = solve(&mut chain, &options, None, &mut ()).iterations;
                });
                (allocations.count_total, iterations)
            };
            let ((short, before), (long, after)) = (measure(1), measure(1000));
            assert!(before == 1 && after > 10, "{after} iterations");
            assert_eq!(short, long, "by {before} and {after} iterations");
        }
    }
}
