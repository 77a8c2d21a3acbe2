//! What more control intervals cost an optimization: memory, and time per iteration.
//!
//! The cart-pole of the examples with 10 to 3000 intervals, each for a minute at most. Everything is to grow in
//! proportion to them. Numbers behind the name of the bench are taken instead of these sizes.

#[path = "support/records.rs"]
mod records;

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use nsd_solver::optimization::ipm;
use nsd_solver::optimization::mpcc::{Observer, Program};
use nsd_tests::with_experiment;
use nsdc::limit::Limit;
use nsdc::optimize;
use nsdc::project::watch::Watch;
use nsdc::report::{MethodOption, Trajectory};
use nsdc::simulate::Request;
use records::record;
use serde_json::json;

const SIZES: [usize; 6] = [10, 30, 100, 300, 1000, 3000];
const MODEL: &str = include_str!("../../examples/cart_pole.nsd");
const EXPERIMENT: &str = "scaling";
const LIMIT: Duration = Duration::from_secs(60);

/// Seconds between iterations of the same interior-point run.
#[derive(Default)]
struct Iterations {
    last: Option<f64>,
    count: usize,
    seconds: f64,
}

impl Observer for Iterations {
    fn program(&mut self, _: &Program) {
        self.last = None;
    }

    fn iteration(&mut self, _: &Program, _: &ipm::Progress<'_>) {
        let now = seconds();
        if let Some(last) = self.last.replace(now) {
            self.count += 1;
            self.seconds += now - last;
        }
    }
}

impl Watch for Iterations {}

fn main() {
    let asked: Vec<usize> = std::env::args()
        .filter_map(|arg| arg.parse().ok())
        .collect();
    let sizes = if asked.is_empty() {
        SIZES.to_vec()
    } else {
        asked
    };
    print(
        "intervals  variables    rows   pairs    factor  iterations  whole run  per iteration  and interval  peak memory  objective",
    );
    for intervals in sizes {
        let text = format!("{MODEL}\n{}", experiment(intervals));
        let started = seconds();
        let mut iterations = Iterations::default();
        let found = with_experiment(&text, EXPERIMENT, |compiled| {
            let settings = &compiled.settings;
            let task = settings
                .optimize
                .as_ref()
                .expect("an optimal control problem");
            let request = Request {
                limit: Limit::within(LIMIT),
                ..Request::default()
            };
            let system = &compiled.system;
            optimize::run(system, settings, task, &[], &request, &mut iterations)
                .expect("the program fits into memory")
                .trajectory
        });
        line(intervals, &found, &iterations, seconds() - started);
    }
}

/// The task of the example, with elements and nodes as in its table of costs.
fn experiment(intervals: usize) -> String {
    format!(
        "optimize {EXPERIMENT} of cart_pole {{
           horizon 5; intervals {intervals}; elements 2; scheme radau_iia(2);
           minimize integral(10*p^2 + 100*(a - pi)^2 + v^2 + w^2 + u^2)
             + final(500*p^2 + 100*(a - pi)^2 + 10*v^2 + 10*w^2);
         }}"
    )
}

fn line(intervals: usize, found: &Trajectory, iterations: &Iterations, whole: f64) {
    let option = |wanted: &str| {
        let mut options = found.setup.method.options.iter();
        options
            .find_map(|(name, value)| match value {
                MethodOption::Number(number) if name == wanted => Some(*number),
                _ => None,
            })
            .unwrap_or(f64::NAN)
    };
    let optimum = found.optimum.as_ref().expect("it is an optimization");
    let Iterations { count, seconds, .. } = *iterations;
    let each = seconds / count as f64;
    let peak = peak().map_or_else(|| "-".to_owned(), |peak| format!("{peak:.0} MiB"));
    print(&format!(
        "{intervals:9} {:>10} {:>7} {:>7} {:>9} {count:>11} {whole:>8.2} s {:>11.2} ms {:>10.1} us {peak:>12}  {:.6} {}",
        option("variables"),
        option("rows"),
        option("pairs"),
        optimum.factor_entries,
        1e3 * each,
        1e6 * each / intervals as f64,
        found.objective.unwrap_or(f64::NAN),
        found.status.as_str(),
    ));
    record(
        "intervals",
        &[
            ("intervals", json!(intervals)),
            ("variables", json!(option("variables"))),
            ("pairs", json!(option("pairs"))),
            ("factor", json!(optimum.factor_entries)),
            ("iterations", json!(count)),
            ("seconds", json!(whole)),
            ("seconds an iteration", json!(each)),
            ("end", json!(found.status.as_str())),
        ],
    );
}

/// What this thread has computed, in seconds; where the system does not tell, what has passed.
fn seconds() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    let start = START.get_or_init(Instant::now);
    let computed = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = computed.and_then(|text| text.split_whitespace().next()?.parse().ok());
    nanoseconds.map_or_else(|| start.elapsed().as_secs_f64(), |n: f64| 1e-9 * n)
}

/// The most memory that this process has had, in MiB, where the system tells.
fn peak() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes / 1024.0)
}

/// Benchmarks print their tables.
#[allow(clippy::print_stdout, reason = "a benchmark prints its table")]
fn print(text: &str) {
    println!("{text}");
}
