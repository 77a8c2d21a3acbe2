//! Optimal control on the command line: what `nsdc run` tells of it, and the way over AMPL files.

use std::fs;
use std::path::PathBuf;

use insta::assert_snapshot;

use crate::terminal::{folder, nsdc};

/// ∫ u² with x(1) = 1: u = 1, and a sliding mode that starts where x is zero.
const MODEL: &str = "
model m {
  state x = 0;
  state y = 0.5;
  control u in [-9, 9] = 0;
  x' = u;
  y' = -sign(y);
}
optimize reach of m { horizon 1; intervals 2; elements 2; minimize integral(u^2) + final(y^2); final { x = 1; } }
optimize often of m {
  horizon 1; intervals 2; elements 2; minimize integral(u^2); final { x = 1; }
  starts 3 by gauss(0.1) seed 1;
}
";

fn with_model(test: &str) -> PathBuf {
    let folder = folder(test);
    fs::write(folder.join("m.nsd"), MODEL).expect("the folder is writable");
    folder
}

#[test]
fn a_log_has_a_line_for_every_iteration() {
    let folder = with_model("optimize_log");
    let ran = nsdc(&folder, &["run", "m.nsd", "reach", "--log", "iterations"]);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""));
    for text in [
        "relaxation: scholtes",
        "branch",
        "iter     objective",
        "sigma",
    ] {
        assert!(ran.out.contains(text), "no `{text}` in {}", ran.out);
    }
    let report = nsdc(&folder, &["run", "m.nsd", "reach"]).out;
    let first = report.lines().next().expect("there is a report");
    let lines = |text: &str| text.lines().count();
    assert!(ran.out.lines().any(|line| line == first), "{}", ran.out);
    assert!(lines(&ran.out) > lines(&report) + 10, "{}", ran.out);
    // The log stays out of what programs read.
    let ran = nsdc(
        &folder,
        &[
            "run",
            "m.nsd",
            "reach",
            "--log",
            "iterations",
            "--json",
            "-",
        ],
    );
    assert_eq!(lines(&ran.out), 1, "{}", ran.out);
    assert!(ran.err.contains("relaxation: scholtes"), "{}", ran.err);
    let ran = nsdc(&folder, &["run", "m.nsd", "--log", "off"]);
    assert_eq!(
        (ran.status, ran.out.as_str(), ran.err.as_str()),
        (0, "", "")
    );
}

#[test]
fn a_log_of_several_starts_has_a_line_for_each() {
    let folder = with_model("optimize_starts");
    let ran = nsdc(&folder, &["run", "m.nsd", "often", "--log", "iterations"]);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""));
    let starts: Vec<&str> = ran
        .out
        .lines()
        .filter(|line| line.starts_with("start "))
        .collect();
    assert_eq!(starts.len(), 3, "{}", ran.out);
    for number in 1..=3 {
        let line = format!("start {number} of 3: solved, objective ");
        assert!(
            starts.iter().any(|start| start.starts_with(&line)),
            "{starts:?}"
        );
    }
}

/// From the model over a file to names of the model.
#[test]
fn files_for_ampl_have_names() {
    let folder = with_model("optimize_names");
    let args = [
        "emit", "m.nsd", "reach", "--ir", "nl", "--output", "stub.nl",
    ];
    let ran = nsdc(&folder, &args);
    assert_eq!(
        (ran.status, ran.out.as_str(), ran.err.as_str()),
        (0, "", "")
    );
    let read = |name: &str| fs::read_to_string(folder.join(name)).expect("it was written");
    let [rows, columns] = ["stub.row", "stub.col"].map(read);
    let unique = |text: &str| {
        let mut lines: Vec<&str> = text.lines().collect();
        let n = lines.len();
        lines.sort_unstable();
        lines.dedup();
        assert_eq!(lines.len(), n, "{text}");
        n
    };
    let ran = nsdc(&folder, &["solve", "stub.nl", "--json", "-"]);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""));
    let report: serde_json::Value = serde_json::from_str(&ran.out).expect("an object");
    assert_eq!(
        report["constraints"],
        unique(&rows) - 1,
        "the last name is the objective's"
    );
    assert_eq!(report["variables"], unique(&columns));
    let names = report["names"].as_array().expect("names are there");
    let value = |name: &str| {
        let place = names.iter().position(|known| known == name);
        report["x"][place.expect("the variable has a name")].as_f64()
    };
    let x = value("x[2,2,3]").expect("a number");
    assert!((x - 1.0).abs() <= 1e-8, "x ends at {x}");
    let u = value("u[1]").expect("a number");
    assert!((u - 1.0).abs() <= 1e-6, "u is {u}");
    // Without the files there are no names.
    fs::remove_file(folder.join("stub.col")).expect("it is there");
    let ran = nsdc(&folder, &["solve", "stub.nl", "--json", "-"]);
    assert!(!ran.out.contains("\"names\""), "{}", ran.out);
}

#[test]
fn nothing_is_written_after_an_error() {
    let folder = with_model("optimize_nothing");
    let ran = nsdc(
        &folder,
        &["emit", "m.nsd", "--ir", "nl", "--output", "stub.nl"],
    );
    assert_eq!(ran.status, 1);
    assert!(!folder.join("stub.nl").exists());
    let ran = nsdc(
        &folder,
        &[
            "emit",
            "m.nsd",
            "reach",
            "--ir",
            "dcs",
            "--output",
            "no/such.txt",
        ],
    );
    assert_eq!(ran.status, 1);
    assert!(
        ran.err.contains("cannot write `no/such.txt`"),
        "{}",
        ran.err
    );
}

/// At the bound of u there are three modes, for which two elements have no room.
#[test]
fn a_minimum_that_is_not_reached_is_told_with_its_experiment() {
    let folder = folder("optimize_elsewhere");
    let model = "\
model m {
  state x = 0;
  state y = 0;
  control u in [0, 4] = 0;
  x' = u;
  y' = if x > 2 then -10 else (if x > 1 then 1 else 0);
}
optimize o of m { horizon 1; intervals 1; elements 2; minimize final(y + 1); }
";
    fs::write(folder.join("m.nsd"), model).expect("the folder is writable");
    let ran = nsdc(&folder, &["run", "m.nsd", "--log", "off"]);
    assert_eq!((ran.status, ran.out.as_str()), (0, ""));
    assert_snapshot!(ran.err, @r"
    W0724

      ⚠ a simulation with other controls has the objective -3.750000, and the solver does not get
      │ there; another `guess`, or several `starts`, may
       ╭─[m.nsd:8:1]
     7 │ }
     8 │ optimize o of m { horizon 1; intervals 1; elements 2; minimize final(y + 1); }
       · ───────────────────────────────────────┬──────────────────────────────────────
       ·                                        ╰── about this
       ╰────
    ");
}
