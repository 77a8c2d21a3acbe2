//! What all benchmarks share.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use nsd_solver::event::{Event, Observer, Segment, Simulator};
use nsd_solver::hybrid::{HybridSystem, Settings};
use nsdc::Compiled;

/// A simulator at a tolerance, otherwise as `nsdc` sets it.
pub fn simulator(system: &Arc<HybridSystem>, tolerance: f64) -> Simulator {
    let settings = Settings {
        tolerance,
        ..Settings::default()
    };
    Simulator::new(system.clone(), settings)
}

/// Initial state.
pub fn start(compiled: &Compiled) -> Vec<f64> {
    let states = compiled.system.states.iter();
    states.map(|state| state.initial).collect()
}

/// Median seconds of a call, over batches of about a millisecond and about half a second in all.
pub fn median(mut call: impl FnMut()) -> f64 {
    let started = Instant::now();
    call();
    let once = started.elapsed().as_secs_f64();
    let batch = (1e-3 / once).clamp(1.0, 1e4);
    let rounds = (0.5 / (batch * once)).clamp(3.0, 101.0);
    let mut times: Vec<f64> = (0..rounds as usize)
        .map(|_| {
            let started = Instant::now();
            (0..batch as usize).for_each(|_| call());
            started.elapsed().as_secs_f64() / batch.floor()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Benchmarks print their tables.
#[allow(clippy::print_stdout, reason = "a benchmark prints its table")]
pub fn print(text: &str) {
    if !text.is_empty() {
        println!("{text}");
    }
}

/// Keeps nothing.
pub struct Silent;

impl Observer for Silent {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {}
}
