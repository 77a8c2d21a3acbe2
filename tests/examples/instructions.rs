//! Instructions that a few workloads take, counted by Valgrind: the same on a busy machine as on an idle one.
//!
//! ```sh
//! cargo run --profile dist -p nsd-tests --example instructions              # compares with tests/instructions.csv
//! cargo run --profile dist -p nsd-tests --example instructions -- --accept  # writes it
//! ```
//!
//! Each workload runs in two processes, once and some times more; the difference is what these runs take, without start and
//! compilation. Counts are those of a compiler and a profile, which the file names: with others nothing is compared.
//! Without Valgrind nothing is counted. Both are said, and are no failure.

use std::fmt::Write as _;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::thread;

use nsd_solver::event::{Event, Observer, Recording, Segment, Simulator};
use nsd_solver::fesd;
use nsd_solver::hybrid::Settings;
use nsd_solver::integrate::tableau::Family;
use nsd_solver::moreau::{self, Change};
use nsd_solver::sensitivity::{Directions, Moment, differentiate};
use nsd_tests::with_experiment;
use nsdc::lowering::dcs;
use nsdc::lowering::hybrid;
use nsdc::simulate::Request;
use nsdc::simulate::fesd::complementarity;
use nsdc::simulate::moreau::stepper;
use nsdc::study::sweep::{Axis, Grid};
use nsdc::{Compiled, Options, Project, optimize};

/// By how much a count may be above the one that is kept.
const TOLERANCE: f64 = 0.02;

/// What is run again and again: compiled once, then called so many times.
type Work = fn(usize);

/// How many runs of a workload are counted that takes few instructions: hash tables of what is compiled before differ from
/// one process to another, by up to 7000.
const MANY: usize = 20;

/// Names of workloads, and how many of their runs are counted.
const WORKLOADS: [(&str, usize, Work); 12] = [
    ("compile friction_chain", 1, |n| {
        for _ in 0..n {
            with_experiment(&example("friction_chain"), "longer", |_| ());
        }
    }),
    ("events oscillator", MANY, |n| {
        by_events("oscillator", "crossing", n)
    }),
    ("events bouncing_ball", MANY, |n| {
        by_events("bouncing_ball", "bounces", n)
    }),
    ("events stiction", MANY, |n| {
        by_events("stiction", "coulomb", n)
    }),
    ("events stick_slip", MANY, |n| {
        by_events("stick_slip", "cycles", n)
    }),
    ("events friction_chain", 1, |n| {
        by_events("friction_chain", "longer", n)
    }),
    ("events fast_actuator", MANY, |n| {
        by_events("fast_actuator", "follows", n)
    }),
    ("derivatives stick_slip", MANY, derivatives),
    ("rows oscillator", MANY, in_rows),
    ("elements oscillator", MANY, by_elements),
    ("steps ball_pile", 1, in_steps),
    ("optimize turbo_car", 1, optimum),
];

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    if let [work, name, runs] = &args[..]
        && work == "--work"
    {
        let found = WORKLOADS.iter().find(|workload| workload.0 == name);
        let work = found.expect("a workload is called by its name").2;
        work(runs.parse().expect("a number of runs"));
        return ExitCode::SUCCESS;
    }
    let valgrind = Command::new("valgrind").arg("--version").output();
    if !valgrind.is_ok_and(|output| output.status.success()) {
        print("skipped: Valgrind is not here");
        return ExitCode::SUCCESS;
    }
    compare(args.iter().any(|arg| arg == "--accept"))
}

/// The file of kept counts: toolchain, workload, instructions.
fn kept() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("instructions.csv")
}

/// Compiler and profile.
fn toolchain() -> String {
    let output = Command::new("rustc").arg("--version").output();
    let version = output.map_or_else(
        |_| "rustc".to_owned(),
        |output| String::from_utf8_lossy(&output.stdout).trim().to_owned(),
    );
    let version: Vec<&str> = version.split(' ').take(2).collect();
    // The folder of examples is in that of the profile.
    let program = std::env::current_exe().unwrap_or_default();
    let profile = program.ancestors().nth(2).and_then(Path::file_name);
    let profile = profile.unwrap_or_default().to_string_lossy();
    format!("{} {profile}", version.join(" "))
}

fn compare(accept: bool) -> ExitCode {
    let toolchain = toolchain();
    let text = fs::read_to_string(kept()).unwrap_or_default();
    let rows: Vec<[&str; 3]> = text
        .lines()
        .filter_map(|line| line.split(',').collect::<Vec<_>>().try_into().ok())
        .collect();
    let mut failed = false;
    let mut new = String::from("toolchain,workload,instructions\n");
    let others = rows
        .iter()
        .filter(|row| row[0] != toolchain && row[0] != "toolchain");
    others.for_each(|row| {
        let _ = writeln!(new, "{}", row.join(","));
    });
    print(&format!(
        "{:<24} {:>14} {:>14} {:>8}",
        "workload", "instructions", "kept", "change"
    ));
    for (name, count) in counts() {
        let Some(count) = count else {
            print(&format!("{name:<24} failed under Valgrind"));
            failed = true;
            continue;
        };
        let _ = writeln!(new, "{toolchain},{name},{count:.0}");
        let row = rows
            .iter()
            .find(|row| row[0] == toolchain && row[1] == name);
        let Some(before) = row.and_then(|row| row[2].parse::<f64>().ok()) else {
            print(&format!("{name:<24} {count:>14.0} {:>14}", "-"));
            continue;
        };
        let change = count / before - 1.0;
        let worse = change > TOLERANCE;
        failed |= worse && !accept;
        let remark = if worse { "  more" } else { "" };
        print(&format!(
            "{name:<24} {count:>14.0} {before:>14.0} {:>6.1} %{remark}",
            100.0 * change
        ));
    }
    if !rows.iter().any(|row| row[0] == toolchain) && !accept {
        print(&format!(
            "nothing to compare with: no counts of {toolchain}; `--accept` keeps these"
        ));
    }
    if accept {
        fs::write(kept(), new).expect("the folder of the tests is writable");
    }
    if failed {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    }
}

/// Instructions of one run of each workload; of both processes at the same time, which changes no count.
fn counts() -> Vec<(&'static str, Option<f64>)> {
    let count = |(name, more, _): (&'static str, usize, Work)| {
        let once = thread::spawn(move || instructions(name, 1));
        let often = instructions(name, 1 + more);
        let once = once.join().ok().flatten();
        let both = once.zip(often);
        (name, both.map(|(once, often)| (often - once) / more as f64))
    };
    WORKLOADS.into_iter().map(count).collect()
}

/// Instructions of a process.
fn instructions(name: &str, runs: usize) -> Option<f64> {
    let this = std::env::current_exe().ok()?;
    let output = Command::new("valgrind")
        .args([
            "--tool=cachegrind",
            "--cache-sim=no",
            "--cachegrind-out-file=/dev/null",
        ])
        .arg(this)
        .args(["--work", name, &runs.to_string()])
        .output()
        .ok()?;
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    let line = told
        .lines()
        .find(|line| line.contains("I ") && line.contains("refs:"))?;
    let digits: String = line
        .split("refs:")
        .nth(1)?
        .chars()
        .filter(char::is_ascii_digit)
        .collect();
    output.status.success().then(|| digits.parse().ok())?
}

#[allow(clippy::print_stdout, reason = "a benchmark prints its table")]
fn print(text: &str) {
    println!("{text}");
}

fn example(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../examples/{name}.nsd"));
    fs::read_to_string(path).expect("an example is text")
}

struct Silent;

impl Observer for Silent {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {}
}

impl moreau::Observer for Silent {
    fn change(&mut self, _: f64, _: usize, _: Change) {}
}

impl fesd::Observer for Silent {}

fn start(compiled: &Compiled<'_>) -> Vec<f64> {
    compiled
        .system
        .states
        .iter()
        .map(|state| state.initial)
        .collect()
}

fn by_events(file: &str, experiment: &str, runs: usize) {
    with_experiment(&example(file), experiment, |compiled| {
        let hybrid = hybrid::lower(&compiled.system);
        let settings = Settings {
            tolerance: 1e-10,
            ..Settings::default()
        };
        let mut simulator = Simulator::new(hybrid, settings);
        for _ in 0..runs {
            simulator.run(
                0.0,
                compiled.settings.horizon,
                &start(compiled),
                &mut Silent,
            );
        }
    });
}

/// By five parameters, at as many instants as a figure has.
fn derivatives(runs: usize) {
    const ROWS: usize = 200;
    with_experiment(&example("stick_slip"), "cycles", |compiled| {
        let (system, horizon) = (&compiled.system, compiled.settings.horizon);
        let open: Vec<usize> = hybrid::may_be_open(system).into_iter().take(5).collect();
        let settings = Settings {
            tolerance: 1e-10,
            ..Settings::default()
        };
        let mut simulator = Simulator::new(hybrid::lower_open(system, horizon, &open), settings);
        let unit = |d: usize| (0..5).map(|k| f64::from(u8::from(k == d))).collect();
        let directions = Directions {
            initial: vec![vec![0.0; system.states.len()]; 5],
            parameters: (0..5).map(unit).collect(),
        };
        let moment = |k: usize| Moment {
            time: horizon * k as f64 / ROWS as f64,
            is_behind: true,
        };
        let moments: Vec<Moment> = (1..=ROWS).map(moment).collect();
        for _ in 0..runs {
            let mut recording = Recording::default();
            let outcome = simulator.run(0.0, horizon, &start(compiled), &mut recording);
            let approaches = &outcome.approaches;
            let found = differentiate(&simulator, &recording, approaches, &directions, &moments);
            assert!(found.at(ROWS - 1, 4).is_some(), "it is known to the end");
        }
    });
}

fn in_rows(runs: usize) {
    let project = Project::from_text("oscillator.nsd", &example("oscillator"));
    let values = (0..runs).map(|k| 6.0 + 1e-3 * k as f64).collect();
    let name = "omega".to_owned();
    let grid = Grid::new(vec![Axis { name, values }], false).expect("there are few points");
    let sweep = project.sweep("crossing", &Options::default(), grid);
    let rows = sweep.map(|sweep| sweep.rows(0..runs, 1, &mut |_| ()));
    assert!(rows.is_ok_and(|found| found.rows.len() == runs));
}

fn by_elements(runs: usize) {
    with_experiment(&example("oscillator"), "crossing", |compiled| {
        let dcs = dcs::lower(&compiled.system, &[]).expect("one switch has Stewart's form");
        let system = complementarity(&compiled.system, &dcs);
        let settings = fesd::Settings {
            grid: fesd::Grid::Steps {
                steps: 20,
                elements: 1,
            },
            ..fesd::Settings::new(Family::RadauIia, 4)
        };
        let simulator = fesd::Simulator::new(&system, settings);
        let mut simulator = simulator.expect("four nodes are allowed");
        for _ in 0..runs {
            simulator.run(
                0.0,
                compiled.settings.horizon,
                &start(compiled),
                &mut Silent,
            );
        }
    });
}

fn in_steps(runs: usize) {
    with_experiment(&example("ball_pile"), "settles", |compiled| {
        let mut stepper = stepper(&compiled.system, 0.5, 500, Default::default());
        for _ in 0..runs {
            stepper.run(0.0, 0.5, &start(compiled), &mut Silent);
        }
    });
}

fn optimum(runs: usize) {
    with_experiment(&example("turbo_car"), "hurry", |compiled| {
        let task = compiled
            .settings
            .optimize
            .as_ref()
            .expect("an optimization");
        for _ in 0..runs {
            let (system, settings) = (&compiled.system, &compiled.settings);
            let found = optimize::run(system, settings, task, &[], &Request::default(), &mut ());
            assert!(found.is_ok(), "the problem can be discretized");
        }
    });
}
