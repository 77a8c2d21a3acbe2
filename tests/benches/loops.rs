//! Closed loops: what a plan takes from the last one, beside one that is found without it from the same state, and how far
//! deadlines are overrun.
//!
//! Costs differ by the minima that are found: less than the other one is better.

#[allow(dead_code, reason = "other benchmarks use all of it")]
mod support;

use std::fmt::Write as _;

use nsdc::expr::Exprs;
use nsdc::limit::Limit;
use nsdc::report::{ClosedLoop, Decision, Trajectory};
use nsdc::{Options, Project};
use support::print;

/// Every so many plans are compared.
const EVERY: usize = 10;

const CAR: &str = include_str!("../../examples/loop_turbo_car.nsd");
const CART: &str = include_str!("../../examples/cart_pole.nsd");

fn main() {
    // Each with another plant: less gain and drag, and more friction.
    let car = CAR.replace("sample 0.25;", "sample 0.1;");
    let model = CART.replace("horizon 5;", "horizon 2.5;");
    let (model, _) = model
        .split_once("  expect objective")
        .expect("it is an example");
    let cart = format!(
        "{model} }}\n{} mpc swings of plant {{ controller swing; sample 0.025; horizon 2.5; }}",
        plant(CART)
    );
    let loops = [
        ("turbo car", car.as_str(), "late", "hurry"),
        ("cart-pole", &cart, "swings", "swing"),
    ];
    print(
        "| loop | plans | from the last one | median, ms | without it, median, ms | share | cost beside that, least and most |\n\
         | --- | --- | --- | --- | --- | --- | --- |",
    );
    for (name, text, experiment, controller) in loops {
        compared(name, text, experiment, controller);
    }
    print(
        "\n| loop | deadline, ms | longest, ms | plans | feasible | kept |\n| --- | --- | --- | --- | --- | --- |",
    );
    for (name, text, experiment, _) in loops {
        for deadline in [0.1, 0.05, 0.02, 0.01, 0.005] {
            let text = text.replace(
                "controller ",
                &format!("deadline {deadline:?}; controller "),
            );
            let (_, found) = looped(&text, experiment);
            let [feasible, kept] = [Decision::Feasible, Decision::Kept].map(|one| found.count(one));
            print(&format!(
                "| {name} | {:.0} | {:.1} | {} | {feasible} | {kept} |",
                1e3 * deadline,
                1e3 * found.times.longest,
                found.samples.len(),
            ));
        }
    }
}

/// The cart-pole with a tenth more friction.
fn plant(text: &str) -> String {
    let begins = text.find("model cart_pole").expect("it is an example");
    let ends = text.find("optimize swing").expect("it is an example");
    let plant = text[begins..ends].replace("model cart_pole", "model plant");
    plant.replace("const F = 2;", "const F = 2.2;")
}

fn looped(text: &str, experiment: &str) -> (Trajectory, ClosedLoop) {
    let project = Project::from_text("bench.nsd", text);
    let run = project.run(experiment, &Options::default(), &mut ());
    let run = run.unwrap_or_else(|errors| panic!("{errors}")).trajectory;
    let found = run.several.closed_loop.clone();
    (run, found.expect("it is a loop"))
}

/// A row of plans beside those that a controller makes which knows none.
fn compared(name: &str, text: &str, experiment: &str, controller: &str) {
    let (run, found) = looped(text, experiment);
    let project = Project::from_text("bench.nsd", text);
    let (mut cold, mut shares) = (Vec::new(), Vec::new());
    for sample in found.samples.iter().skip(1).step_by(EVERY) {
        let Some(objective) = sample.objective else {
            continue;
        };
        let exprs = Exprs::new();
        let fresh = project.controller(&exprs, controller, &[], &[], None);
        let mut fresh = fresh.expect("it compiles");
        let x = fresh
            .states()
            .iter()
            .map(|name| state(&run, name, sample.time));
        let x: Vec<f64> = x.collect();
        let step = fresh.step(0.0, &x, &[], &Limit::default());
        cold.push(step.seconds);
        shares.extend(step.plan.map(|plan| objective / plan.objective - 1.0));
    }
    cold.sort_by(f64::total_cmp);
    let [warm, cold] = [found.times.median, cold[cold.len() / 2]];
    let least = shares.iter().copied().fold(f64::INFINITY, f64::min);
    let most = shares.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut row = String::new();
    let _ = write!(
        row,
        "| {name} | {} | {} | {:.2} | {:.2} | {:.2} | {:+.1e}, {:+.1e} |",
        found.samples.len(),
        found.count(Decision::Warm),
        1e3 * warm,
        1e3 * cold,
        warm / cold,
        least,
        most
    );
    print(&row);
}

/// A state at a sample, before what jumps there.
fn state(run: &Trajectory, name: &str, time: f64) -> f64 {
    let instants = &run.samples.time;
    let row = instants
        .iter()
        .position(|&t| (t - time).abs() <= 1e-9 * (1.0 + time));
    let row = row.expect("samples are instants of the run");
    let states = run.samples.states.iter();
    let entries = states.flat_map(|series| series.entry_names().into_iter().zip(series.at(row)));
    let mut found = entries.filter(|(entry, _)| entry == name);
    *found.next().expect("it is a state").1
}
