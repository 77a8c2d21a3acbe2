//! A system that is lowered once and runs with other parameters and initial states, beside one in which these are
//! compiled in, and beside a run from the text.

mod support;

use std::hint::black_box;
use std::sync::Arc;
use std::thread;
use std::time::Instant;

use nsd_solver::event::Simulator;
use nsd_solver::hybrid::{HybridSystem, Settings, Status};
use nsd_tests::with_experiment;
use nsdc::Compiled;
use nsdc::lowering::hybrid;
use support::{Silent, median, print, simulator, start};

const OSCILLATOR: &str = include_str!("../../examples/oscillator.nsd");
const BELT: &str = include_str!("../../examples/stiction.nsd");
const BALL: &str = include_str!("../../examples/bouncing_ball.nsd");
const CHAIN: &str = include_str!("../../examples/friction_chain.nsd");

/// Runs of a sweep, per thread.
const SWEEP: u32 = 500_000;
/// Balls, which fall from 1/2 with this acceleration, for so long.
const BALLS: u32 = 100_000;
const G: f64 = 9.81;
const HORIZON: f64 = 1.5;

fn main() {
    print("| model | tolerance | compiled in, us | other numbers, us | from the text, us |");
    print("| --- | --- | --- | --- | --- |");
    let belt = format!("{BELT}\nsimulate bench of belt {{ horizon 20; }}");
    let ball = format!("{BALL}\nsimulate bench of ball {{ horizon 3; }}");
    row("oscillator", OSCILLATOR, "crossing", 1e-9);
    row("belt", &belt, "bench", 1e-9);
    row("bouncing ball", &ball, "bench", 1e-9);
    row("friction chain", CHAIN, "to_rest", 1e-8);
    with_experiment(OSCILLATOR, "crossing", sweep);
    with_experiment(BALL, "bounces", balls);
}

fn row(name: &str, text: &str, experiment: &str, tolerance: f64) {
    let whole = median(|| {
        with_experiment(text, experiment, |compiled| {
            let mut simulator = simulator(&hybrid::lower(&compiled.system), tolerance);
            let horizon = compiled.settings.horizon;
            black_box(simulator.run(0.0, horizon, &start(compiled), &mut Silent));
        });
    });
    with_experiment(text, experiment, |compiled| {
        let (x0, horizon) = (start(compiled), compiled.settings.horizon);
        let mut fixed = simulator(&hybrid::lower(&compiled.system), tolerance);
        let compiled_in = median(|| {
            black_box(fixed.run(0.0, horizon, &x0, &mut Silent));
        });
        let lowered = lower_open(compiled);
        let mut open = simulator(&lowered, tolerance);
        let mut turn = Turn::new(&lowered, &x0);
        let mut failed = 0;
        let other = median(|| {
            let (parameters, x0) = turn.next();
            open.set_parameters(parameters);
            let outcome = black_box(open.run(0.0, horizon, x0, &mut Silent));
            failed += usize::from(outcome.status != Status::Solved);
        });
        print(&format!(
            "| {name} | {tolerance:.0e} | {:.2} | {:.2} | {:.0} |",
            1e6 * compiled_in,
            1e6 * other,
            1e6 * whole
        ));
        assert_eq!(failed, 0, "{name}: runs that did not reach their end");
    });
}

fn lower_open(compiled: &Compiled) -> Arc<HybridSystem> {
    let system = &compiled.system;
    hybrid::lower_open(
        system,
        compiled.settings.horizon,
        &hybrid::may_be_open(system),
    )
}

/// Parameters and initial states that differ from run to run.
struct Turn {
    count: u32,
    known: [Vec<f64>; 2],
    next: [Vec<f64>; 2],
}

impl Turn {
    fn new(system: &HybridSystem, x0: &[f64]) -> Self {
        let known = [system.parameters.clone(), x0.to_vec()];
        Turn {
            count: 0,
            next: known.clone(),
            known,
        }
    }

    fn next(&mut self) -> (&[f64], &[f64]) {
        self.count += 1;
        let factor = 1.0 - 1e-4 * f64::from(self.count % 100);
        for (next, known) in self.next.iter_mut().zip(&self.known) {
            next.iter_mut()
                .zip(known)
                .for_each(|(next, known)| *next = factor * known);
        }
        (&self.next[0], &self.next[1])
    }
}

/// Balls with other restitutions, beside the closed form: a bounce with speed v lasts 2 v/g, and v = e v behind it.
fn balls(compiled: &Compiled) {
    let system = &compiled.system;
    let open = hybrid::may_be_open(system);
    let is_restitution = |&at: &usize| system.exogenous.params[open[at]].name == "e";
    let e = (0..open.len()).find(is_restitution).expect("it is open");
    let lowered = hybrid::lower_open(system, HORIZON, &open);
    let mut parameters = lowered.parameters.clone();
    let mut simulator = Simulator::new(lowered, Settings::default());
    let mut largest = 0.0_f64;
    let started = Instant::now();
    for k in 0..BALLS {
        parameters[e] = 0.75 + 0.2 * f64::from(k) / f64::from(BALLS);
        simulator.set_parameters(&parameters);
        let outcome = simulator.run(0.0, HORIZON, &[0.5, 0.0], &mut Silent);
        assert_eq!(outcome.status, Status::Solved, "e = {}", parameters[e]);
        let (mut v, mut t) = (parameters[e] * G * (1.0 / G).sqrt(), (1.0 / G).sqrt());
        while t + 2.0 * v / G <= HORIZON {
            (t, v) = (t + 2.0 * v / G, parameters[e] * v);
        }
        let s = HORIZON - t;
        let exact = [s * (v - 0.5 * G * s), v - G * s];
        let errors = outcome
            .x
            .iter()
            .zip(exact)
            .map(|(x, exact)| (x - exact).abs());
        largest = errors.fold(largest, f64::max);
    }
    let seconds = started.elapsed().as_secs_f64();
    print(&format!(
        "\n{BALLS} bouncing balls: at most {largest:.1e} from the closed form, {:.2} us a run.",
        1e6 * seconds / f64::from(BALLS)
    ));
    assert!(largest <= 1e-12, "{largest:e}");
}

/// Many runs on one thread and on two; end values are kept.
fn sweep(compiled: &Compiled) {
    let (lowered, x0) = (lower_open(compiled), start(compiled));
    let horizon = compiled.settings.horizon;
    let part = || {
        let settings = Settings {
            tolerance: 1e-9,
            ..Settings::default()
        };
        let mut simulator = Simulator::new(lowered.clone(), settings);
        let mut turn = Turn::new(&lowered, &x0);
        let mut ends = Vec::with_capacity(SWEEP as usize * x0.len());
        for _ in 0..SWEEP {
            let (parameters, x0) = turn.next();
            simulator.set_parameters(parameters);
            ends.extend(simulator.run(0.0, horizon, x0, &mut Silent).x);
        }
        ends
    };
    let started = Instant::now();
    black_box(part());
    let alone = started.elapsed().as_secs_f64();
    let started = Instant::now();
    thread::scope(|scope| {
        for part in [(); 2].map(|()| scope.spawn(part)) {
            black_box(part.join().expect("it ends"));
        }
    });
    let both = started.elapsed().as_secs_f64();
    print(&format!(
        "\nA sweep of {SWEEP} oscillators on one thread: {:.2} us a run; on two, as many each: {:.2} times as many in the \
         same time.",
        1e6 * alone / f64::from(SWEEP),
        2.0 * alone / both
    ));
}
