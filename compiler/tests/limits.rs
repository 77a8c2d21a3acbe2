//! Runs that would not end: `nsdc` stops them at a limit, with an exit status and a reason.

use std::fs;

use crate::terminal::{folder, nsdc, nsdc_with_input};

/// A relay that switches every 4e-9.
const CHATTER: &str = "
model chatter {
  state x = 0;
  switch h = hysteresis(x, on = -1e-9, off = 1e-9, start = 1);
  x' = h - 0.5;
}
simulate few of chatter { horizon 1; method event { max_events = 100; } }
simulate many of chatter { horizon 1e9; }
";

#[test]
fn a_limit_of_events_ends_a_run_with_2() {
    let args = ["run", "-", "few", "--json", "-"];
    let ran = nsdc_with_input(&folder("events"), &args, CHATTER);
    assert_eq!(ran.status, 2, "{}", ran.err);
    let found = json(&ran.out);
    assert_eq!(found["status"], "iteration_limit");
    assert_eq!(found["events"].as_array().map(Vec::len), Some(100));
    assert!(ran.err.contains("E0708"), "{}", ran.err);
    assert!(ran.err.contains("`max_events`"), "{}", ran.err);
}

#[test]
fn a_limit_of_time_ends_a_run_with_2() {
    // It is over before the first step.
    for command in ["run", "test"] {
        let folder = folder(&format!("time_{command}"));
        fs::write(folder.join("chatter.nsd"), CHATTER).expect("the folder is writable");
        let ran = nsdc(&folder, &[command, "chatter.nsd", "--time-limit", "1e-300"]);
        assert_eq!(ran.status, 2, "{}", ran.err);
        assert!(
            ran.out.contains("the time limit was reached"),
            "{}",
            ran.out
        );
    }
    let args = ["run", "-", "many", "--time-limit", "1e-300", "--json", "-"];
    let ran = nsdc_with_input(&folder("time"), &args, CHATTER);
    assert_eq!(ran.status, 2, "{}", ran.err);
    assert_eq!(json(&ran.out)["status"], "time_limit");
    assert!(ran.err.contains("E0709"), "{}", ran.err);
}

/// The object of a run.
fn json(line: &str) -> serde_json::Value {
    serde_json::from_str(line).expect("`--json` prints an object")
}
