//! Steps allocate nothing.

use std::ops::ControlFlow;
use std::sync::Arc;

use nsd_solver::ipm::{BarrierRule, Options, solve};
use nsd_solver::problem::{Bounds, Nlp, Pattern};
use nsd_solver::simulate::{
    Affine, Block, Event, Input, Observer, Partials, Rates, Segment, Settings, Side, Simulator,
    Smooth, Status, Surface, SwitchedSystem,
};
use nsd_solver::tape::Tape;

/// x₁' = x₂, x₂' = -x₁, x₃' = 1 + x₁/2 - 2α on ψ₁ = x₃, and ψ₂ = x₁ - 1.001 and ψ₃ = x₁² - 1.001,
/// which are never reached but close enough for their polynomials to be looked at.
struct Rotation {
    blocks: [Block; 2],
}

impl Rotation {
    fn new() -> Self {
        let block = |states: &[usize], switches: &[usize]| Block {
            states: states.to_vec(),
            switches: switches.to_vec(),
        };
        Rotation {
            blocks: [block(&[0, 1], &[]), block(&[2], &[0])],
        }
    }
}

impl SwitchedSystem for Rotation {
    fn n_states(&self) -> usize {
        3
    }

    fn n_switches(&self) -> usize {
        3
    }

    fn is_continuous(&self, _: usize) -> bool {
        false
    }

    fn couplings(&self, switch: usize) -> &[usize] {
        if switch == 0 { &[0] } else { &[] }
    }

    fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    fn inside(&self, _: usize) -> &[usize] {
        &[]
    }

    fn rates(&self, block: usize, sides: &[Side]) -> Rates {
        if block == 0 {
            let mut tape = Tape::builder(2);
            let (x, y) = (tape.input(0), tape.input(1));
            let down = tape.scale(-1.0, x);
            return Rates {
                inputs: vec![Input::State(0), Input::State(1)],
                field: Arc::new(tape.finish(&[y, down])),
                by_alpha: Arc::new(Partials::none(2)),
            };
        }
        let inputs = vec![Input::State(0), Input::Alpha(0)];
        let mut tape = Tape::builder(2);
        let half = tape.scale(0.5, tape.input(0));
        let drift = tape.offset(1.0, half);
        let rate = match sides[0] {
            Side::Minus => drift,
            Side::Plus => tape.offset(-2.0, drift),
            Side::Slide => tape.add_scaled(drift, -2.0, tape.input(1)),
        };
        let mut by_alpha = Partials::none(2);
        if sides[0] == Side::Slide {
            let mut slope = Tape::builder(2);
            let value = slope.constant(-2.0);
            by_alpha = Partials {
                tape: slope.finish(&[value]),
                entries: vec![(0, 1)],
            };
        }
        Rates {
            inputs,
            field: Arc::new(tape.finish(&[rate])),
            by_alpha: Arc::new(by_alpha),
        }
    }

    fn surface(&self, switch: usize, _: &[Side]) -> Surface {
        if switch < 2 {
            return Surface::Affine(Affine {
                terms: vec![([2, 0][switch], 1.0)],
                constant: [0.0, -1.001][switch],
                time: 0.0,
            });
        }
        let mut psi = Tape::builder(1);
        let square = psi.square(psi.input(0));
        let psi_value = psi.offset(-1.001, square);
        let mut gradient = Tape::builder(1);
        let twice = gradient.scale(2.0, gradient.input(0));
        Surface::Smooth(Smooth {
            inputs: vec![Input::State(0)],
            psi: Arc::new(psi.finish(&[psi_value])),
            gradient: Arc::new(Partials {
                tape: gradient.finish(&[twice]),
                entries: vec![(0, 0)],
            }),
            mixed: Arc::new(Partials::none(1)),
        })
    }

    fn jacobian(&self, _: usize, _: &[Side]) -> Arc<Partials> {
        unreachable!("no implicit method runs here")
    }
}

/// x₁' = -10⁶ (x₁ - cos t), x₂' = 1 + x₁/2 - 2α on ψ₁ = x₂, and ψ₂ = x₁² - 1.1, which is never reached.
struct Stiff {
    blocks: [Block; 1],
}

impl Stiff {
    fn new() -> Self {
        Stiff {
            blocks: [Block {
                states: vec![0, 1],
                switches: vec![0],
            }],
        }
    }
}

/// Partial derivatives that are numbers.
fn constants(n_inputs: usize, entries: &[((usize, usize), f64)]) -> Arc<Partials> {
    let mut tape = Tape::builder(n_inputs);
    let outputs: Vec<_> = entries.iter().map(|e| tape.constant(e.1)).collect();
    Arc::new(Partials {
        tape: tape.finish(&outputs),
        entries: entries.iter().map(|e| e.0).collect(),
    })
}

impl SwitchedSystem for Stiff {
    fn n_states(&self) -> usize {
        2
    }

    fn n_switches(&self) -> usize {
        2
    }

    fn is_continuous(&self, _: usize) -> bool {
        false
    }

    fn couplings(&self, switch: usize) -> &[usize] {
        if switch == 0 { &[0] } else { &[] }
    }

    fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    fn inside(&self, _: usize) -> &[usize] {
        &[]
    }

    fn rates(&self, _: usize, sides: &[Side]) -> Rates {
        let mut tape = Tape::builder(3);
        let (t, x) = (tape.input(0), tape.input(1));
        let (_, cos) = tape.sin_cos(t);
        let distance = tape.sub(cos, x);
        let fast = tape.scale(1e6, distance);
        let half = tape.scale(0.5, x);
        let drift = tape.offset(1.0, half);
        let rate = match sides[0] {
            Side::Minus => drift,
            Side::Plus => tape.offset(-2.0, drift),
            Side::Slide => tape.add_scaled(drift, -2.0, tape.input(2)),
        };
        let slides = sides[0] == Side::Slide;
        let by_alpha: &[_] = if slides { &[((1, 2), -2.0)] } else { &[] };
        Rates {
            inputs: vec![Input::Time, Input::State(0), Input::Alpha(0)],
            field: Arc::new(tape.finish(&[fast, rate])),
            by_alpha: constants(3, by_alpha),
        }
    }

    fn surface(&self, switch: usize, _: &[Side]) -> Surface {
        if switch == 0 {
            return Surface::Affine(Affine {
                terms: vec![(1, 1.0)],
                ..Affine::default()
            });
        }
        let mut psi = Tape::builder(1);
        let square = psi.square(psi.input(0));
        let value = psi.offset(-1.1, square);
        let mut gradient = Tape::builder(1);
        let twice = gradient.scale(2.0, gradient.input(0));
        Surface::Smooth(Smooth {
            inputs: vec![Input::State(0)],
            psi: Arc::new(psi.finish(&[value])),
            gradient: Arc::new(Partials {
                tape: gradient.finish(&[twice]),
                entries: vec![(0, 0)],
            }),
            mixed: constants(1, &[]),
        })
    }

    fn jacobian(&self, _: usize, _: &[Side]) -> Arc<Partials> {
        constants(3, &[((0, 1), -1e6), ((1, 1), 0.5)])
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
    let system = Rotation::new();
    for (start, slides) in [(1e3, false), (0.0, true)] {
        let mut simulator = Simulator::new(&system, Settings::default());
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

#[test]
fn implicit_steps_allocate_nothing() {
    let system = Stiff::new();
    for start in [1e3, 0.0] {
        let mut simulator = Simulator::new(&system, Settings::default());
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
    fn n_variables(&self) -> usize {
        self.start.len()
    }

    fn n_rows(&self) -> usize {
        self.start.len() - 1
    }

    fn variable_bounds(&self) -> Bounds<'_> {
        Bounds {
            lower: &self.bounds[0],
            upper: &self.bounds[1],
        }
    }

    fn row_bounds(&self) -> Bounds<'_> {
        Bounds {
            lower: &self.bounds[2],
            upper: &self.bounds[3],
        }
    }

    fn start(&self) -> &[f64] {
        &self.start
    }

    fn jacobian_pattern(&self) -> &Pattern {
        &self.jacobian
    }

    fn hessian_pattern(&self) -> &Pattern {
        &self.hessian
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
