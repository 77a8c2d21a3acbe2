//! Piles of discs in steps of time: what they cost by their number, how many gaps are looked at, what two bins cost
//! that have nothing to do with each other, how long many possible contacts take to compile, and how a hundred come to
//! rest.

#[path = "support/records.rs"]
mod records;
#[allow(dead_code, reason = "other benchmarks use all of it")]
mod support;

use std::ops::ControlFlow;
use std::time::Instant;

use nsd_solver::event::{Event, Segment};
use nsd_solver::hybrid::Status;
use nsd_solver::moreau::{Change, Observer, Solution};
use nsd_tests::with_experiment;
use nsdc::simulate::moreau::stepper;
use records::record;
use serde_json::json;
use support::{print, start};

/// Simulated seconds, and steps in each.
const HORIZON: f64 = 1.0;
const STEPS: usize = 1000;

struct Silent;

impl nsd_solver::event::Observer for Silent {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {}
}

impl Observer for Silent {
    fn change(&mut self, _: f64, _: usize, _: Change) {}
}

fn main() {
    print("one second in 1000 steps, e = 0.3, as wide as high\n");
    print(&format!(
        "{:>6} {:>10} {:>10} {:>10} {:>10} {:>12} {:>16}",
        "discs", "contacts", "seconds", "us a step", "impulses", "gaps a step", "over n log n"
    ));
    let mut first = None;
    for n in [4, 25, 50, 100, 200, 400] {
        let run = measure(&[(n, 0.0)]);
        let gaps = run.solution.gaps as f64 / STEPS as f64;
        let share = gaps / (n as f64 * (n as f64).ln());
        if n == 25 {
            first = Some(share);
        }
        let growth = first.map_or(String::new(), |first| format!("{:.2}", share / first));
        print(&format!(
            "{n:>6} {:>10} {:>10.3} {:>10.1} {:>10} {gaps:>12.0} {growth:>16}",
            n * (n - 1) / 2 + 3 * n,
            run.seconds,
            1e6 * run.seconds / STEPS as f64,
            run.solution.impulses,
        ));
        record(
            "discs",
            &[
                ("discs", json!(n)),
                ("possible contacts", json!(n * (n - 1) / 2 + 3 * n)),
                ("seconds", json!(run.seconds)),
                ("seconds a step", json!(run.seconds / STEPS as f64)),
                ("impulses", json!(run.solution.impulses)),
                ("gaps a step", json!(gaps.round())),
            ],
        );
        if n == 400 {
            print(&format!(
                "\n{:.2} s to compile 400 discs, bar 2 s",
                run.compile
            ));
        }
    }
    let alone = measure(&[(50, 0.0)]).seconds + measure(&[(50, 100.0)]).seconds;
    let both = measure(&[(50, 0.0), (50, 100.0)]).seconds;
    print(&format!(
        "{:.2} two bins of 50, 100 m apart, to the sum of each alone, bar 1.3",
        both / alone
    ));
    rest(100, 8.0);
}

/// What is seen of discs from step to step: states are x, y and their rates, disc by disc.
#[derive(Default)]
struct Falling {
    /// The state after the last step, and the impacts behind it.
    x: Vec<f64>,
    first: f64,
    least: f64,
    /// The farthest that the energy has been above the least before.
    gain: f64,
    /// Since when no disc has been faster than `SLOW`.
    slow_since: f64,
    speed: f64,
}

/// m/s.
const SLOW: f64 = 1e-3;

impl Falling {
    fn look(&mut self, time: f64) {
        let discs = self.x.chunks(4);
        let energies = discs
            .clone()
            .map(|d| 0.5 * (d[2] * d[2] + d[3] * d[3]) + 9.81 * d[1]);
        let energy: f64 = energies.sum();
        if self.first == 0.0 {
            (self.first, self.least) = (energy, energy);
        }
        self.gain = self.gain.max(energy - self.least);
        self.least = self.least.min(energy);
        self.speed = discs.map(|d| d[2].hypot(d[3])).fold(0.0, f64::max);
        if self.speed > SLOW {
            self.slow_since = time;
        }
    }
}

impl nsd_solver::event::Observer for Falling {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        self.look(segment.start);
        self.x.clear();
        self.x.extend_from_slice(segment.end);
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        self.x.clear();
        self.x.extend_from_slice(event.x);
    }
}

impl Observer for Falling {
    fn change(&mut self, _: f64, _: usize, _: Change) {}
}

/// A bin of discs for so many seconds.
fn rest(n: usize, horizon: f64) {
    with_experiment(&bins_of(&[(n, 0.0)]), "bench", |compiled| {
        let x0 = start(compiled);
        let steps = STEPS * horizon as usize;
        let mut stepper = stepper(&compiled.system, horizon, steps, Default::default());
        let mut falling = Falling {
            x: x0.clone(),
            ..Falling::default()
        };
        let started = Instant::now();
        let solution = stepper.run(0.0, horizon, &x0, &mut falling);
        let seconds = started.elapsed().as_secs_f64();
        assert_eq!(solution.outcome.status, Status::Solved);
        falling.look(horizon);
        print(&format!(
            "{n} discs for {horizon} s in {steps} steps: {seconds:.2} s; depth {:.1e}, energy gained {:.1e} of its start, \
             slower than 1 mm/s since {:.2} s, {:.1e} m/s at the end, {} steps without rebound",
            solution.outcome.violation,
            falling.gain / falling.first,
            falling.slow_since,
            falling.speed,
            solution.plastic,
        ));
    });
}

/// A run of a pile.
struct Run {
    compile: f64,
    seconds: f64,
    solution: Solution,
}

/// The fastest of three runs of bins with so many discs, each at its own place.
fn measure(bins: &[(usize, f64)]) -> Run {
    let text = bins_of(bins);
    let started = Instant::now();
    with_experiment(&text, "bench", |compiled| {
        let x0 = start(compiled);
        let mut stepper = stepper(&compiled.system, HORIZON, STEPS, Default::default());
        let compile = started.elapsed().as_secs_f64();
        let mut best: Option<Run> = None;
        for _ in 0..3 {
            let started = Instant::now();
            let solution = stepper.run(0.0, HORIZON, &x0, &mut Silent);
            let seconds = started.elapsed().as_secs_f64();
            assert_eq!(solution.outcome.status, Status::Solved);
            if best.as_ref().is_none_or(|best| seconds < best.seconds) {
                best = Some(Run {
                    compile,
                    seconds,
                    solution,
                });
            }
        }
        best.expect("three runs have a fastest")
    })
}

/// Square bins full of discs that do not touch yet, in one model in which any two discs might meet.
fn bins_of(bins: &[(usize, f64)]) -> String {
    let (mut x, mut y, mut left, mut right) = (vec![], vec![], vec![], vec![]);
    for &(n, at) in bins {
        let columns = (n as f64).sqrt().ceil() as usize;
        for i in 0..n {
            x.push(at + 0.14 + 0.23 * (i % columns) as f64 + 0.01 * (7.0 * i as f64).sin());
            y.push(0.13 + 0.23 * (i / columns) as f64);
            left.push(at);
            right.push(at + 0.05 + 0.23 * columns as f64);
        }
    }
    format!(
        "model disc {{ \
           param r = 0.1; state q[2]; state v[2] = [0, 0]; q' = v; \
           mechanics q, v {{ mass = eye(2); force = [0, -9.81]; }} \
         }}\n\
         model bins {{ \
           const n = {n}; \
           const x = {x:?}; const y = {y:?}; const left = {left:?}; const right = {right:?}; \
           part ball[i in 1..n] = disc {{ q = [x[i], y[i]]; }} \
           for i in 1..n {{ \
             contact floor {{ gap = ball[i].q[2] - ball[i].r; restitution = 0.3; }} \
             contact west {{ gap = ball[i].q[1] - left[i] - ball[i].r; restitution = 0.3; }} \
             contact east {{ gap = right[i] - ball[i].q[1] - ball[i].r; restitution = 0.3; }} \
           }} \
           for i in 1..n, j in i+1..n {{ \
             contact pair {{ gap = norm(ball[i].q - ball[j].q) - ball[i].r - ball[j].r; restitution = 0.3; }} \
           }} \
         }}\n\
         simulate bench of bins {{ horizon {HORIZON}; method timestepping {{ steps = {STEPS}; }} }}",
        n = x.len()
    )
}
