//! Optimal control from one initial state after the other: a problem that is prepared once and solved from the last
//! solution, beside one that is compiled for each state.
//!
//! Both have the same certificate and the same simulations. The objectives differ by what elements that lie otherwise
//! make of a program.

use std::io::Write as _;
use std::time::Instant;

use nsdc::expr::Exprs;
use nsdc::limit::Limit;
use nsdc::report::{Status, Trajectory};
use nsdc::{Options, Project};

/// How often the state is another one.
const STATES: u32 = 12;

fn main() {
    print(
        "| problem | from the text, ms | prepared, first, ms | from the last, ms | share | solved | new patterns | \
         lower by at most | higher by at most |",
    );
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let sliding = include_str!("../../examples/sliding_ocp.nsd");
    let single = sliding.replace("starts 6 by gauss(0.5) seed 1;", "");
    let turbo = include_str!("../../examples/turbo_car.nsd");
    row("sliding, 6 starts", sliding, "reach", 0.02);
    row("sliding, 1 start", &single, "reach", 0.02);
    row("turbo car", turbo, "hurry", 0.2);
}

/// The objective, where there is an optimum.
fn objective(found: &Trajectory) -> Option<f64> {
    found.objective.filter(|_| found.status == Status::Solved)
}

/// States around that of the experiment, each entry by as much as `reach`, by a Kronecker sequence.
fn row(name: &str, text: &str, experiment: &str, reach: f64) {
    let project = Project::from_text("bench.nsd", text);
    let (exprs, limit) = (Exprs::new(), Limit::default());
    let started = Instant::now();
    let prepared = project.prepare_optimal(&exprs, experiment, &[], &[]);
    let mut prepared = prepared.expect("it has a program");
    let (names, start) = (prepared.states().to_vec(), prepared.initial(&[]));
    let start = start.expect("it has no parameters");
    let mut last = (prepared.solve(&[], None, None, &limit, &mut ())).expect("it begins there");
    let first = started.elapsed().as_secs_f64();
    let (mut fresh, mut again, mut patterns, mut solved) = (0.0, 0.0, 0, [0, 0]);
    let (mut lower, mut higher) = (0.0_f64, 0.0_f64);
    for k in 1..=STATES {
        let shift = |i: usize| (f64::from(k) * 0.618_033_988_75 * (i + 1) as f64).fract() - 0.5;
        let x0 = start.iter().enumerate();
        let x0: Vec<f64> = x0.map(|(i, x)| x + 2.0 * reach * shift(i)).collect();
        let started = Instant::now();
        let found = prepared.solve(&[], Some(&x0), Some(&last), &limit, &mut ());
        last = found.expect("it begins there");
        again += started.elapsed().as_secs_f64();
        let optimum = last.trajectory.optimum.as_ref();
        patterns += optimum.map_or(0, |optimum| optimum.analyses);
        let options = Options {
            values: names.iter().cloned().zip(x0).collect(),
            ..Options::default()
        };
        let started = Instant::now();
        let run = (project.run(experiment, &options, &mut ())).expect("it compiles");
        fresh += started.elapsed().as_secs_f64();
        let found = [&run.trajectory, &last.trajectory].map(objective);
        for (count, found) in solved.iter_mut().zip(found) {
            *count += usize::from(found.is_some());
        }
        if let [Some(one), Some(other)] = found {
            lower = lower.max(one - other);
            higher = higher.max(other - one);
        }
    }
    let [fresh, again] = [fresh, again].map(|seconds| 1e3 * seconds / f64::from(STATES));
    let [of_fresh, of_again] = solved;
    print(&format!(
        "| {name} | {fresh:.1} | {:.1} | {again:.1} | {:.2} | {of_fresh} and {of_again} of {STATES} | {patterns} | \
         {lower:.1e} | {higher:.1e} |",
        1e3 * first,
        again / fresh
    ));
}

fn print(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}
