//! `nsdc test` as a user meets it: goldens, filters, results for other programs, exit status.

use std::fs;
use std::path::{Path, PathBuf};

use crate::terminal::{Ran, folder, nsdc};
use insta::assert_snapshot;
use serde_json::{Value, json};

/// A crate that is driven over a rough floor: two switches, a name that occurs in several rows.
const CRATE: &str = "
model crate_on_floor {
  param grip = 1;
  state position = 0;
  state speed = 2;
  position' = speed;
  speed' = -grip*sign(speed);
}
simulate stop of crate_on_floor {
  horizon 3;
  expect lowering golden;
  expect numbers golden;
}
";

fn with_crate(test: &str) -> PathBuf {
    let folder = folder(test);
    write(&folder, "crate.nsd", CRATE);
    folder
}

fn write(folder: &Path, name: &str, text: &str) {
    fs::write(folder.join(name), text).expect("the folder is writable");
}

fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).expect("the file is there")
}

/// The same on all systems.
fn shown(ran: &Ran) -> String {
    ran.out.replace('\\', "/")
}

fn accepted(folder: &Path) {
    let ran = nsdc(folder, &["test", "--accept", "crate.nsd"]);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""), "{}", ran.out);
    let ran = nsdc(folder, &["test", "crate.nsd"]);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""), "{}", ran.out);
}

#[test]
fn goldens_are_missing_until_they_are_accepted() {
    let folder = with_crate("goldens");
    let ran = nsdc(&folder, &["test", "crate.nsd"]);
    assert_eq!(ran.status, 2);
    assert_snapshot!(shown(&ran), @r"
    FAILED  crate.nsd: stop
              expect lowering golden
                crate.golden/stop.system is missing
                  + system crate_on_floor
                  + param grip
                  + state position
                  + state speed
                  + der(position) = speed
                  + der(speed) = -grip*(2*alpha[1] - 1)
                  + alpha[1] in step(speed)  // speed, discontinuous
                  + subsystem alpha[1]
                crate.golden/stop.stewart.dcs is missing
                  + // stewart: no two switches multiply each other
                  + der(position) = speed
                  + der(speed) = grip*theta[speed-] - grip*theta[speed+]
                  + 0 = speed - lambda[speed-] - mu
                  + 0 = -speed - lambda[speed+] - mu
                  + 0 = 1 - theta[speed-] - theta[speed+]
                  + 0 <= theta[speed-] perp lambda[speed-] >= 0
                  + 0 <= theta[speed+] perp lambda[speed+] >= 0
                `nsdc test --accept` writes it as it is now
              expect numbers golden
                crate.golden/stop.numbers is missing
                  + // Numbers of stop of crate_on_floor. Tolerances are yours to change.
                  + status is solved
                  + position at end = 2 within 2e-8
                  + speed at end = 0 within 2e-8
                  + enter_sliding of speed = 2 within 5e-8
                `nsdc test --accept` writes it as it is now

    0 passed, 1 failed, 0 not yet supported
    ");
    assert!(
        !folder.join("crate.golden").exists(),
        "a test writes nothing"
    );
    let ran = nsdc(&folder, &["test", "--accept", "crate.nsd"]);
    assert_eq!(ran.status, 0);
    assert!(
        shown(&ran).contains("wrote crate.golden/stop.stewart.dcs"),
        "{}",
        ran.out
    );
    assert_eq!(nsdc(&folder, &["test", "crate.nsd"]).status, 0);
    assert_snapshot!(read(&folder, "crate.golden/stop.system"), @r"
    system crate_on_floor
    param grip
    state position
    state speed
    der(position) = speed
    der(speed) = -grip*(2*alpha[1] - 1)
    alpha[1] in step(speed)  // speed, discontinuous
    subsystem alpha[1]
    ");
    assert_snapshot!(read(&folder, "crate.golden/stop.numbers"), @r"
    // Numbers of stop of crate_on_floor. Tolerances are yours to change.
    status is solved
    position at end = 2 within 2e-8
    speed at end = 0 within 2e-8
    enter_sliding of speed = 2 within 5e-8
    ");
}

#[test]
fn another_parameter_changes_numbers_and_not_the_form() {
    let folder = with_crate("golden_parameter");
    accepted(&folder);
    write(&folder, "crate.nsd", &CRATE.replace("grip = 1", "grip = 2"));
    let ran = nsdc(&folder, &["test", "crate.nsd"]);
    assert_eq!(ran.status, 2);
    assert_snapshot!(shown(&ran), @r"
    FAILED  crate.nsd: stop
              expect numbers golden
                crate.golden/stop.numbers differs
                    // Numbers of stop of crate_on_floor. Tolerances are yours to change.
                    status is solved
                  - position at end = 2 within 2e-8
                  + position at end = 1 within 1e-8
                    speed at end = 0 within 2e-8
                  - enter_sliding of speed = 2 within 5e-8
                  + enter_sliding of speed = 1 within 5e-8
                `nsdc test --accept` writes it as it is now

    0 passed, 1 failed, 0 not yet supported
    ");
    // What is seen first is what is written.
    let ran = nsdc(&folder, &["test", "--accept", "crate.nsd"]);
    assert_eq!(ran.status, 0);
    assert_snapshot!(shown(&ran), @r"
    ok      crate.nsd: stop
              crate.golden/stop.numbers
                  // Numbers of stop of crate_on_floor. Tolerances are yours to change.
                  status is solved
                - position at end = 2 within 2e-8
                + position at end = 1 within 1e-8
                  speed at end = 0 within 2e-8
                - enter_sliding of speed = 2 within 5e-8
                + enter_sliding of speed = 1 within 5e-8
              wrote crate.golden/stop.numbers

    1 passed, 0 failed, 0 not yet supported
    ");
    assert_eq!(nsdc(&folder, &["test", "crate.nsd"]).status, 0);
}

#[test]
fn starts_and_horizons_are_no_part_of_the_form() {
    let folder = with_crate("golden_start");
    accepted(&folder);
    let changed = CRATE
        .replace("speed = 2;", "speed = 1.5;")
        .replace("horizon 3", "horizon 4");
    write(&folder, "crate.nsd", &changed);
    let out = shown(&nsdc(&folder, &["test", "crate.nsd"]));
    assert!(out.contains("stop.numbers differs"), "{out}");
    assert!(
        !out.contains("stop.system") && !out.contains("stop.stewart.dcs"),
        "{out}"
    );
}

#[test]
fn another_rate_changes_the_form() {
    let folder = with_crate("golden_form");
    accepted(&folder);
    let changed = CRATE.replace("-grip*sign(speed)", "-grip*sign(speed) - 0.1*speed");
    write(&folder, "crate.nsd", &changed);
    let ran = nsdc(&folder, &["test", "crate.nsd"]);
    assert_eq!(ran.status, 2);
    let out = shown(&ran);
    for name in ["stop.system", "stop.stewart.dcs", "stop.numbers"] {
        assert!(
            out.contains(&format!("crate.golden/{name} differs")),
            "{name} in\n{out}"
        );
    }
}

#[test]
fn another_name_changes_the_lines_it_stands_on() {
    let folder = with_crate("golden_name");
    accepted(&folder);
    let files = ["stop.system", "stop.stewart.dcs", "stop.numbers"];
    let texts = || files.map(|name| read(&folder, &format!("crate.golden/{name}")));
    let before = texts();
    // Names that come elsewhere in the alphabet, and are longer.
    let renamed = CRATE
        .replace("position", "a_position")
        .replace("speed", "zzz");
    write(&folder, "crate.nsd", &renamed);
    accepted(&folder);
    for (before, now) in before.iter().zip(texts()) {
        let expected = before
            .replace("position", "a_position")
            .replace("speed", "zzz");
        assert_eq!(now, expected);
    }
}

#[test]
fn numbers_of_values_are_no_part_of_a_form_in_numerical_time() {
    let folder = folder("golden_frozen");
    let model = "
model room {
  param low = 18;
  state T = 15;
  switch heater = hysteresis(T, on = low, off = 20);
  T' = -0.2*T + 5*heater;
}
simulate day of room { horizon 4; lower timefreezing; expect lowering golden; expect numbers golden; }
";
    write(&folder, "crate.nsd", model);
    accepted(&folder);
    let changed = model
        .replace("low = 18", "low = 17.5")
        .replace("horizon 4", "horizon 5");
    write(&folder, "crate.nsd", &changed);
    let ran = nsdc(&folder, &["test", "crate.nsd"]);
    assert_eq!(ran.status, 2);
    let out = shown(&ran);
    assert!(
        out.contains("day.numbers differs") && !out.contains("day.stewart.dcs"),
        "{out}"
    );
}

#[test]
fn a_tolerance_that_was_written_by_hand_holds_and_stays() {
    let folder = with_crate("golden_tolerance");
    accepted(&folder);
    let numbers = read(&folder, "crate.golden/stop.numbers");
    let line = numbers
        .lines()
        .find(|line| line.starts_with("position at end"));
    let wide = numbers.replace(
        line.expect("a position"),
        "position at end = 2.001 within 0.01",
    );
    write(&folder, "crate.golden/stop.numbers", &wide);
    assert_eq!(nsdc(&folder, &["test", "crate.nsd"]).status, 0);
    let narrow = wide.replace("within 0.01", "within 1e-4");
    write(&folder, "crate.golden/stop.numbers", &narrow);
    assert_eq!(nsdc(&folder, &["test", "crate.nsd"]).status, 2);
    let crlf = wide.replace('\n', "\r\n");
    write(&folder, "crate.golden/stop.numbers", &crlf);
    assert_eq!(
        nsdc(&folder, &["test", "crate.nsd"]).status,
        0,
        "ends of lines do not count"
    );
}

#[test]
fn a_run_that_is_wrong_is_not_accepted() {
    let folder = with_crate("golden_wrong");
    accepted(&folder);
    let before = read(&folder, "crate.golden/stop.numbers");
    let changed = CRATE.replace("grip = 1", "grip = 2").replace(
        "horizon 3;",
        "horizon 3; expect position at end ~ 2 within 1e-6;",
    );
    write(&folder, "crate.nsd", &changed);
    let ran = nsdc(&folder, &["test", "--accept", "crate.nsd"]);
    assert_eq!(ran.status, 2);
    assert!(ran.out.contains("no golden was written"), "{}", ran.out);
    assert_eq!(read(&folder, "crate.golden/stop.numbers"), before);
}

#[test]
fn goldens_that_nothing_asks_for_are_told_and_taken_away() {
    let folder = with_crate("golden_left_over");
    accepted(&folder);
    let changed = CRATE.replace("  expect numbers golden;\n", "");
    write(&folder, "crate.nsd", &changed);
    write(&folder, "crate.golden/NOTES.md", "mine");
    let ran = nsdc(&folder, &["test", "crate.nsd"]);
    assert_eq!(ran.status, 2);
    assert_snapshot!(shown(&ran), @r"
    ok      crate.nsd: stop
    FAILED  crate.nsd: goldens
              crate.golden/stop.numbers
                no experiment asks for it
              `nsdc test --accept` takes away what nothing asks for

    1 passed, 1 failed, 0 not yet supported
    ");
    // One test alone says nothing about others.
    let filtered = nsdc(&folder, &["test", "crate.nsd", "--filter", "stop"]);
    assert_eq!(filtered.status, 0, "{}", filtered.out);
    let ran = nsdc(&folder, &["test", "--accept", "crate.nsd"]);
    assert_eq!(ran.status, 0, "{}", ran.out);
    assert!(!folder.join("crate.golden/stop.numbers").exists());
    assert_eq!(read(&folder, "crate.golden/NOTES.md"), "mine");
}

/// One test that passes, one that does not, one that does not compile and one of the future, over two files.
fn with_all_outcomes(test: &str) -> PathBuf {
    let folder = folder(test);
    let model = "model m { state x = 1; x' = -sign(x); }\n";
    let good = "simulate slide of m { horizon 2; expect x at end ~ 0 within 1e-9; }\n";
    let off = "simulate off of m { horizon 2; expect x at end ~ 1 within 1e-9; }\n";
    let later = "simulate later of m { horizon 1; perturb every 0.1 by gauss(1) seed 1; method adaptive; }\n";
    write(&folder, "a.nsd", &format!("{model}{good}{off}"));
    write(&folder, "b.nsd", &format!("{model}{later}"));
    write(
        &folder,
        "c.nsd",
        "model m { state x = 1; x' = y; }\nsimulate s of m { horizon 1; }\n",
    );
    folder
}

#[test]
fn the_exit_status_is_that_of_the_worst_test() {
    let folder = with_all_outcomes("exits");
    let status = |args: &[&str]| nsdc(&folder, &[&["test"], args].concat()).status;
    assert_eq!(status(&["a.nsd", "--filter", "slide"]), 0);
    assert_eq!(status(&["b.nsd"]), 0);
    assert_eq!(status(&["c.nsd"]), 1);
    assert_eq!(status(&["a.nsd"]), 2);
    assert_eq!(status(&["."]), 2);
    assert_eq!(status(&["missing.nsd"]), 1);
    assert_eq!(status(&[".", "--json", "-", "--junit", "-"]), 64);
    assert_eq!(status(&[".", "--json", "-", "--accept"]), 64);
    // What cannot be written is told before anything runs, so nothing has failed its test.
    assert_eq!(status(&[".", "--json", "no/such/folder"]), 1);
    assert_eq!(status(&["b.nsd", "--json", "no/such/folder"]), 1);
    fs::create_dir(folder.join("empty")).expect("the folder is writable");
    let ran = nsdc(&folder, &["test", "empty"]);
    assert_eq!(
        (ran.status, ran.out.as_str()),
        (1, ""),
        "nothing tested is not all well"
    );
}

#[test]
fn a_filter_takes_tests_by_their_names() {
    let folder = with_all_outcomes("filter");
    let ran = nsdc(&folder, &["test", ".", "--filter", "a.nsd: s"]);
    assert_eq!(ran.status, 0);
    assert_snapshot!(shown(&ran), @r"
    ok      ./a.nsd: slide

    1 passed, 0 failed, 0 not yet supported, 3 left out
    ");
    let ran = nsdc(&folder, &["test", ".", "--filter", "slied"]);
    assert_eq!((ran.status, ran.out.as_str()), (64, ""));
    assert_snapshot!(ran.err.replace('\\', "/"), @r"
    error: no test of 3 files has `slied` in its name
      help: names are those that `nsdc test` prints, `./a.nsd: EXPERIMENT`
    ");
}

#[test]
fn results_as_json_have_stable_fields() {
    let folder = with_all_outcomes("json_results");
    let ran = nsdc(&folder, &["test", "a.nsd", "b.nsd", "c.nsd", "--json", "-"]);
    assert_eq!(ran.status, 2);
    let lines: Vec<Value> = (ran.out.lines())
        .map(|line| serde_json::from_str(line).expect("every line is an object"))
        .map(|mut object: Value| {
            assert!(object["seconds"].is_number());
            object["seconds"] = json!(0);
            object
        })
        .collect();
    let missed = json!({
        "what": "expect x at end ~ 1 within 1e-9",
        "expected": "1 within 1e-9",
        "got": "0, off by 1",
        "lines": []
    });
    let wrong =
        json!({ "what": "does not compile: E0101", "expected": null, "got": null, "lines": [] });
    assert_eq!(
        lines,
        [
            json!({ "file": "a.nsd", "test": "slide", "outcome": "passed", "exit": 0, "code": null,
                    "seconds": 0, "failures": [], "notes": [], "warnings": [] }),
            json!({ "file": "a.nsd", "test": "off", "outcome": "failed", "exit": 2, "code": null,
                    "seconds": 0, "failures": [missed], "notes": [], "warnings": [] }),
            json!({ "file": "b.nsd", "test": "later", "outcome": "unsupported", "exit": 0, "code": "E0923",
                    "seconds": 0, "failures": [], "notes": [], "warnings": [] }),
            json!({ "file": "c.nsd", "test": "s", "outcome": "failed", "exit": 1, "code": null,
                    "seconds": 0, "failures": [wrong], "notes": [], "warnings": [] }),
        ]
    );
}

#[test]
fn warnings_are_told_and_fail_nothing() {
    let folder = folder("warnings");
    let model = "model m { state x in [-1, 1] = 0; x' = 1; }\n";
    let runs = "simulate told of m { horizon 2; }\n\
                simulate expected of m { horizon 2; expect warning W0703; }\n\
                simulate missed of m { horizon 2; expect x at end ~ 1 within 1e-9; }\n";
    write(&folder, "m.nsd", &format!("{model}{runs}"));
    let ran = nsdc(
        &folder,
        &["test", "m.nsd", "--json", "r.json", "--junit", "r.xml"],
    );
    assert_eq!((ran.status, ran.err.as_str()), (2, ""));
    assert_snapshot!(shown(&ran), @r"
    ok      m.nsd: told, 1 warning: W0703
    ok      m.nsd: expected
    FAILED  m.nsd: missed, 1 warning: W0703
              expect x at end ~ 1 within 1e-9
                expected 1 within 1e-9
                got      2, off by 1

    2 passed, 1 failed, 0 not yet supported
    ");
    let ran = nsdc(&folder, &["test", "m.nsd", "--filter", "told"]);
    assert_eq!(ran.status, 0);
    let results: Vec<Value> =
        serde_json::from_str(&read(&folder, "r.json")).expect("it is an array");
    let warnings: Vec<&Value> = results.iter().map(|result| &result["warnings"]).collect();
    assert_eq!(warnings[0][0]["code"], "W0703");
    assert!(
        warnings[0][0]["message"]
            .as_str()
            .is_some_and(|text| text.contains("`x`"))
    );
    assert_eq!(warnings[1], &json!([]));
    assert_eq!(warnings[2], warnings[0]);
    let xml = read(&folder, "r.xml");
    assert_eq!(xml.matches("<system-out>W0703: ").count(), 2, "{xml}");
}

#[test]
fn results_go_to_files_beside_the_report() {
    let folder = with_all_outcomes("junit_results");
    let args = [
        "test", "a.nsd", "b.nsd", "c.nsd", "--junit", "r.xml", "--json", "r.json",
    ];
    let ran = nsdc(&folder, &args);
    assert_eq!(ran.status, 2);
    assert!(
        ran.out.contains("1 passed, 2 failed, 1 not yet supported"),
        "{}",
        ran.out
    );
    let results: Vec<Value> =
        serde_json::from_str(&read(&folder, "r.json")).expect("it is an array");
    assert_eq!(results.len(), 4);
    let xml = read(&folder, "r.xml");
    for part in [
        r#"<testsuites name="nsdc" tests="4" failures="1" errors="1" skipped="1""#,
        r#"<testsuite name="a.nsd" tests="2" failures="1""#,
        r#"<failure message="expect x at end ~ 1 within 1e-9">"#,
        r#"<error message="does not compile: E0101">"#,
        r#"<skipped message="not yet supported (E0923)"/>"#,
    ] {
        assert!(xml.contains(part), "{part} in\n{xml}");
    }
}

#[test]
fn files_that_are_tested_at_once_are_told_in_order() {
    let folder = folder("parallel");
    // The first ones take longest.
    for (number, steps) in (10..20).zip([4000, 3000, 2000, 1000, 500, 200, 100, 50, 20, 10]) {
        let text = format!(
            "model m {{ state x = 1; x' = -sign(x - 0.5); }}\n\
             simulate s of m {{ horizon 1; method timestepping {{ steps = {steps}; }} }}\n"
        );
        write(&folder, &format!("m{number}.nsd"), &text);
    }
    let alone = nsdc(&folder, &["test", ".", "--jobs", "1"]);
    let together = nsdc(&folder, &["test", ".", "--jobs", "8"]);
    assert_eq!((alone.status, together.status), (0, 0), "{}", alone.out);
    assert_eq!(alone.out, together.out);
}
