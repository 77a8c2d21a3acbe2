//! Optimal control: objective and time, ours beside nosnoc's with the same intervals, elements and nodes.
//!
//! A fast wrong optimum is not fast: every line has the objective, and ours the certificate and how far a simulation
//! with the controls ends from what was found.

use std::process::Command;

use nsd_tests::with_experiment;
use nsdc::optimize;
use nsdc::report::Trajectory;
use nsdc::simulate::Request;
use serde_json::{Value, json};

/// An example and the same problem in `peers/optimal.py`.
struct Problem {
    text: &'static str,
    experiment: &'static str,
    peer: Value,
}

macro_rules! example {
    ($file:literal) => {
        include_str!(concat!("../../examples/", $file))
    };
}

fn problems() -> [Problem; 4] {
    let [turbo, motor, cart, tanks] = [
        example!("turbo_car.nsd"),
        example!("motor.nsd"),
        example!("cart_pole.nsd"),
        example!("tanks.nsd"),
    ];
    let sizes = |problem: &str, intervals: usize, elements: usize, nodes: usize| json!({ "problem": problem, "intervals": intervals, "elements": elements, "nodes": nodes, "limit": 20 });
    [
        (turbo, "hurry", sizes("turbo", 10, 3, 2)),
        (motor, "shift", sizes("motor", 30, 2, 2)),
        (cart, "swing", sizes("cart", 20, 2, 2)),
        (tanks, "level", sizes("tanks", 100, 2, 1)),
    ]
    .map(|(text, experiment, peer)| Problem {
        text,
        experiment,
        peer,
    })
}

fn main() {
    print("solver   experiment  objective       seconds  remarks");
    for problem in problems() {
        problem.ours();
        problem.peer();
    }
}

impl Problem {
    fn ours(&self) {
        with_experiment(self.text, self.experiment, |compiled| {
            let settings = &compiled.settings;
            let task = settings
                .optimize
                .as_ref()
                .expect("an optimal control problem");
            let request = Request::default();
            let solved = optimize::run(&compiled.system, settings, task, &[], &request, &mut ());
            match solved {
                Ok(solved) => self.line("nsdc", &solved.trajectory),
                Err(error) => print(&format!("nsdc     {:<11} {error}", self.experiment)),
            }
        });
    }

    fn line(&self, solver: &str, found: &Trajectory) {
        let check = found
            .optimum
            .as_ref()
            .and_then(|optimum| optimum.check.as_ref());
        let end = check.map_or(f64::NAN, |check| check.terminal_error);
        print(&format!(
            "{solver:<8} {:<11} {:<14.9} {:>8.3}  {}, {}-stationary, simulated end off by {end:.1e}",
            self.experiment,
            found.objective.unwrap_or(f64::NAN),
            found.stats.solve_s,
            found.status.as_str(),
            found.certificate.stationarity.as_str(),
        ));
    }

    fn peer(&self) {
        let Ok(python) = std::env::var("NSDC_PEER_PYTHON") else {
            print("nosnoc skipped: NSDC_PEER_PYTHON names no Python with it");
            return;
        };
        let output = Command::new(python)
            .args(["optimal.py", &self.peer.to_string()])
            .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peers"))
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .envs([("OMP_NUM_THREADS", "1"), ("OPENBLAS_NUM_THREADS", "1")])
            .output();
        let row = output.ok().and_then(|output| {
            let text = String::from_utf8_lossy(&output.stdout).into_owned();
            serde_json::from_str::<Value>(text.lines().last()?).ok()
        });
        let Some(row) = row else {
            print(&format!("nosnoc   {:<11} failed", self.experiment));
            return;
        };
        let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
        print(&format!(
            "nosnoc   {:<11} {:<14.9} {:>8.3}  {}, {} iterations, complementarity {:.1e}",
            self.experiment,
            number("objective"),
            number("seconds"),
            row["status"].as_str().unwrap_or_default(),
            number("iterations"),
            number("complementarity"),
        ));
    }
}

/// Benchmarks print their tables.
#[allow(clippy::print_stdout, reason = "a benchmark prints its table")]
fn print(text: &str) {
    println!("{text}");
}
