//! Optimal control: objective and time, ours beside nosnoc's with the same intervals, elements and nodes.
//!
//! A fast wrong optimum is not fast: every line has the objective, and ours the certificate and how far a simulation
//! with the controls ends from what was found.
//!
//! Both begin with one guess of their own. Our seconds contain certificates and the branches that they lead to. Three
//! runs, the quickest. Ours go on for better optima than the first; `as good` has the first stationary point with an
//! objective that is not above nosnoc's, and the time until it was known.
//! Projected dynamics (`ellipse`, `discs`) are ours alone.

#[path = "support/records.rs"]
mod records;

use std::process::Command;
use std::time::Instant;

use nsd_solver::optimization::mpcc;
use nsd_tests::with_experiment;
use nsdc::optimize::{self, Solved};
use nsdc::report::Trajectory;
use nsdc::simulate::Request;
use records::record;
use serde_json::{Value, json};

/// The model of an example, and the same problem in `peers/optimal.py`.
struct Problem {
    name: &'static str,
    text: String,
    peer: Value,
}

/// How often everything runs.
const RUNS: usize = 3;
/// What experiments are called.
const EXPERIMENT: &str = "bench";

macro_rules! example {
    ($file:literal) => {
        include_str!(concat!("../../examples/", $file))
    };
}

/// Intervals, elements and nodes are those with which the costs are published; examples may be finer.
fn problems() -> [Problem; 6] {
    [
        (
            "turbo",
            example!("turbo_car.nsd"),
            "turbo_car { horizon free in [1, 100] = 20; minimize final(time); final { q = 200; v = 0; }",
            (10, 3, 2),
        ),
        (
            "motor",
            example!("motor.nsd"),
            "voice_coil { horizon 0.08; minimize integral(U^2); final { x1 = 0.01; v1 = 0; x2 = 0.01; v2 = 0; I = 0; }",
            (30, 2, 2),
        ),
        (
            "cart",
            example!("cart_pole.nsd"),
            "cart_pole { horizon 5;
               minimize integral(10*p^2 + 100*(a - pi)^2 + v^2 + w^2 + u^2)
                 + final(500*p^2 + 100*(a - pi)^2 + 10*v^2 + 10*w^2);",
            (20, 2, 2),
        ),
        (
            "tanks",
            example!("tanks.nsd"),
            "tanks { horizon 100; minimize integral((L[1] - 0.75)^2 + (L[2] - 0.75)^2 + (L[3] - 0.75)^2);",
            (100, 2, 1),
        ),
        (
            "ellipse",
            example!("around_ellipse.nsd"),
            "ellipse { horizon 10; minimize integral(10*dot(u, u)); final { x = [0, -4]; }",
            (50, 2, 3),
        ),
        (
            "discs",
            example!("pass_discs.nsd"),
            "discs { horizon 5;
               minimize integral(1e-4*dot(u, u) + 1e-2*(x[5]^2 + (x[6] - 10)^2))
                 + final(10*((x[1] + 10)^2 + x[2]^2 + (x[3] - 10)^2 + x[4]^2) + 1e3*(x[5]^2 + (x[6] - 10)^2));
               subject to { x[1] <= -2.5; x[3] >= 2.5; }
               guess { u = if time < 1 then [7.5, -10, -2.5, 1.3] else if time < 2.5 then [5, 10, -5, 10] else [-3, -3, 3, -3]; }",
            (30, 3, 2),
        ),
    ]
    .map(|(name, model, task, (intervals, elements, nodes))| Problem {
        name,
        text: format!(
            "{model}\noptimize {EXPERIMENT} of {task}
               intervals {intervals}; elements {elements}; scheme radau_iia({nodes}); }}"
        ),
        peer: json!({ "problem": name, "intervals": intervals, "elements": elements, "nodes": nodes, "limit": 20 }),
    })
}

fn main() {
    // Names behind that of the bench are taken instead of all problems.
    let asked: Vec<String> = std::env::args().collect();
    let problems = problems();
    let is_named = |problem: &Problem| asked.iter().any(|name| name == problem.name);
    if std::env::var("NSDC_PEER_PYTHON").is_err() {
        print("nosnoc skipped: NSDC_PEER_PYTHON names no Python with it");
    }
    let takes_all = !problems.iter().any(is_named);
    print("solver   problem     objective       seconds  certificate  simulation  remarks");
    for problem in problems
        .iter()
        .filter(|problem| takes_all || is_named(problem))
    {
        let ours = problem.ours();
        let theirs = problem.peer();
        if let (Some((ours, way)), Some([objective, theirs])) = (ours, theirs) {
            print(&format!(
                "ratio    {:<11} {:.1}",
                problem.name,
                theirs / ours
            ));
            if let Some(first) = way.points.iter().find(|point| point[0] <= objective) {
                print(&format!(
                    "as good  {:<11} {:<14.9} {:>8.4}  ratio {:.1}",
                    problem.name,
                    first[0],
                    first[1],
                    theirs / first[1]
                ));
            }
        }
    }
}

/// The strongly stationary points on the way to the best one: objectives, and seconds since before the program was built.
struct Way {
    started: Instant,
    points: Vec<[f64; 2]>,
}

impl mpcc::Observer for Way {
    fn stationary(&mut self, objective: f64, class: mpcc::Class) {
        if class == mpcc::Class::S {
            let seconds = self.started.elapsed().as_secs_f64();
            self.points.push([objective, seconds]);
        }
    }
}

impl nsdc::project::watch::Watch for Way {}

impl Problem {
    fn ours(&self) -> Option<(f64, Way)> {
        let mut found = None;
        with_experiment(&self.text, EXPERIMENT, |compiled| {
            let settings = &compiled.settings;
            let task = settings
                .optimize
                .as_ref()
                .expect("an optimal control problem");
            let request = Request::default();
            let run = || {
                let mut way = Way {
                    started: Instant::now(),
                    points: Vec::new(),
                };
                let system = &compiled.system;
                let solved = optimize::run(system, settings, task, &[], &request, &mut way).ok()?;
                Some((solved, way))
            };
            let runs = (0..RUNS).filter_map(|_| run());
            let best = runs.min_by(|a, b| {
                let seconds = |run: &(Solved, Way)| run.0.trajectory.quality.stats.solve_s;
                seconds(a).total_cmp(&seconds(b))
            });
            match best {
                Some((solved, way)) => {
                    self.line("nsdc", &solved.trajectory);
                    found = Some((solved.trajectory.quality.stats.solve_s, way));
                }
                None => print(&format!("nsdc     {:<11} failed", self.name)),
            }
        });
        found
    }

    fn line(&self, solver: &str, found: &Trajectory) {
        let optimum = found.optimum.clone().unwrap_or_default();
        let end = (optimum.check).map_or(f64::NAN, |check| check.terminal_error);
        print(&format!(
            "{solver:<8} {:<11} {:<14.9} {:>8.4}  {:>11.4}  {:>10.4}  {}, {}-stationary, {} iterations, \
             {} relaxations, simulated end off by {end:.1e}",
            self.name,
            found.objective.unwrap_or(f64::NAN),
            found.quality.stats.solve_s,
            optimum.seconds.certificates,
            optimum.seconds.check,
            found.status.as_str(),
            found.quality.certificate.stationarity.as_str(),
            found.quality.stats.newton_iterations,
            found.quality.stats.homotopy_steps,
        ));
        record(
            "optimal",
            &[
                ("problem", json!(self.name)),
                ("solver", json!(solver)),
                ("objective", json!(found.objective)),
                ("seconds", json!(found.quality.stats.solve_s)),
                ("iterations", json!(found.quality.stats.newton_iterations)),
                (
                    "what is known",
                    json!(format!(
                        "{}-stationary, simulated end off by {end:.1e}",
                        found.quality.certificate.stationarity.as_str()
                    )),
                ),
            ],
        );
    }

    /// Objective and seconds.
    fn peer(&self) -> Option<[f64; 2]> {
        let rows = (0..RUNS).filter_map(|_| self.peer_once());
        let seconds = |row: &Value| row["seconds"].as_f64().unwrap_or(f64::INFINITY);
        let row = rows.min_by(|a, b| seconds(a).total_cmp(&seconds(b)))?;
        self.peer_line(&row);
        Some([row["objective"].as_f64()?, seconds(&row)])
    }

    fn peer_once(&self) -> Option<Value> {
        let python = std::env::var("NSDC_PEER_PYTHON").ok()?;
        let output = Command::new(python)
            .args(["optimal.py", &self.peer.to_string()])
            .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peers"))
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .envs([("OMP_NUM_THREADS", "1"), ("OPENBLAS_NUM_THREADS", "1")])
            .output()
            .ok()?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        serde_json::from_str(text.lines().last()?).ok()
    }

    fn peer_line(&self, row: &Value) {
        let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
        print(&format!(
            "nosnoc   {:<11} {:<14.9} {:>8.4}  {:>11}  {:>10}  {}, {} iterations, complementarity {:.1e}",
            self.name,
            number("objective"),
            number("seconds"),
            "-",
            "-",
            row["status"].as_str().unwrap_or_default(),
            number("iterations"),
            number("complementarity"),
        ));
        record(
            "optimal",
            &[
                ("problem", json!(self.name)),
                ("solver", json!("nosnoc")),
                ("objective", row["objective"].clone()),
                ("seconds", row["seconds"].clone()),
                ("iterations", row["iterations"].clone()),
                (
                    "what is known",
                    json!(format!("complementarity {:.1e}", number("complementarity"))),
                ),
            ],
        );
    }
}

/// Benchmarks print their tables.
#[allow(clippy::print_stdout, reason = "a benchmark prints its table")]
fn print(text: &str) {
    println!("{text}");
}
