//! `nsdc verify`: one experiment by events, and by finite elements with every lowering.

use std::fs;

use crate::terminal::{folder, nsdc};

const OSCILLATOR: &str = include_str!("../../examples/oscillator.nsd");
const BILLIARD: &str = include_str!("../../examples/billiard.nsd");
const CONTACT_FREE: &str = "
model relay {
  state x = 1;
  x' = -sign(x);
}
simulate slide of relay { horizon 2; }
simulate smooth of relay { horizon 2; method smoothing { epsilon = 0.1; } }
";
/// Both ways are solutions: the branch is chosen in the experiment as it is written, and nowhere else.
const FORK: &str = "
model fork {
  state x = 0;
  x' = sign(x);
}
simulate up of fork { horizon 1; method event { branch = plus; } }
simulate stuck of fork { horizon 1; }
";

#[test]
fn all_roads_agree_on_the_oscillator() {
    let folder = folder("verify_oscillator");
    fs::write(folder.join("oscillator.nsd"), OSCILLATOR).expect("the folder is writable");
    let ran = nsdc(&folder, &["verify", "oscillator.nsd", "crossing"]);
    assert_eq!(ran.status, 0, "{}{}", ran.out, ran.err);
    assert!(ran.out.contains("3 roads agree"), "{}", ran.out);
    for road in ["as written, event", "fesd", "fesd, lower step"] {
        assert!(ran.out.contains(road), "{road} in\n{}", ran.out);
    }
}

#[test]
fn all_roads_agree_on_balls_that_slip_in_a_plane() {
    let folder = folder("verify_billiard");
    fs::write(folder.join("billiard.nsd"), BILLIARD).expect("the folder is writable");
    let ran = nsdc(&folder, &["verify", "billiard.nsd"]);
    assert_eq!(ran.status, 0, "{}{}", ran.out, ran.err);
    assert_eq!(ran.out.matches("4 roads agree").count(), 2, "{}", ran.out);
    for road in ["event, lower timefreezing", "fesd, lower timefreezing"] {
        assert_eq!(ran.out.matches(road).count(), 2, "{road} in\n{}", ran.out);
    }
}

#[test]
fn a_lowering_that_finds_nothing_confirms_nothing_and_smoothing_is_another_model() {
    let folder = folder("verify_relay");
    fs::write(folder.join("relay.nsd"), CONTACT_FREE).expect("the folder is writable");
    let ran = nsdc(&folder, &["verify", "relay.nsd", "slide"]);
    assert_eq!(ran.status, 0, "{}{}", ran.out, ran.err);
    assert!(ran.out.contains("fesd, lower step"), "{}", ran.out);
    // Without contacts and relays it would be the run that is there already.
    for absent in ["lower impact", "lower timefreezing", "numerical_failure"] {
        assert!(!ran.out.contains(absent), "{absent} in\n{}", ran.out);
    }
    let ran = nsdc(&folder, &["verify", "relay.nsd", "smooth"]);
    assert_eq!(ran.status, 0, "{}{}", ran.out, ran.err);
    assert!(ran.out.contains("not compared"), "{}", ran.out);
}

#[test]
fn a_choice_that_others_do_not_make_leaves_one_road_alone() {
    let folder = folder("verify_fork");
    fs::write(folder.join("fork.nsd"), FORK).expect("the folder is writable");
    let ran = nsdc(&folder, &["verify", "fork.nsd", "up"]);
    assert_eq!(ran.status, 0, "{}{}", ran.out, ran.err);
    assert!(
        ran.out.contains("one road alone, no other one takes it"),
        "{}",
        ran.out
    );
    assert!(ran.out.contains("3 solutions go on"), "{}", ran.out);
    let ran = nsdc(&folder, &["verify", "fork.nsd", "stuck"]);
    assert_eq!(ran.status, 2, "{}{}", ran.out, ran.err);
}

/// Elements are a switch late by 1 of 2, and estimate 1e-16; events estimate 2e-2, and are right.
#[test]
fn a_run_that_knows_its_error_contradicts_one_that_does_not() {
    let folder = folder("verify_offset");
    let text =
        "model m { state t = 1e13; state y = 0; t' = 1; y' = if t > 1e13 + 1 then 1 else 0; }
        simulate s of m { horizon 2; method fesd; lower timefreezing; }";
    fs::write(folder.join("offset.nsd"), text).expect("the folder is writable");
    let ran = nsdc(&folder, &["verify", "offset.nsd"]);
    assert_eq!(ran.status, 2, "{}{}", ran.out, ran.err);
    assert!(ran.out.contains("DIFFERS"), "{}", ran.out);
    let ran = nsdc(&folder, &["run", "offset.nsd"]);
    assert!(ran.out.contains("W0727"), "{}{}", ran.out, ran.err);
}

#[test]
fn what_is_wrong_as_written_is_said_with_its_line() {
    let folder = folder("verify_wrong");
    fs::write(folder.join("wrong.nsd"), "model m { state x; x' = y; }\n")
        .expect("the folder is writable");
    let ran = nsdc(&folder, &["verify", "wrong.nsd"]);
    assert_eq!(ran.status, 1, "{}{}", ran.out, ran.err);
}

#[test]
fn results_are_there_for_programs() {
    let folder = folder("verify_json");
    fs::write(folder.join("relay.nsd"), CONTACT_FREE).expect("the folder is writable");
    let ran = nsdc(&folder, &["verify", "relay.nsd", "--json", "-"]);
    assert_eq!(ran.status, 0, "{}{}", ran.out, ran.err);
    let lines: Vec<serde_json::Value> = (ran.out.lines())
        .map(|line| serde_json::from_str(line).expect("every line is an object"))
        .collect();
    assert_eq!(lines.len(), 2);
    assert_eq!(lines[0]["experiment"], "slide");
    assert_eq!(lines[0]["agree"], true);
    assert_eq!(lines[0]["roads"][0]["status"], "solved");
    assert!(lines[0]["roads"][0]["residual"].is_number());
    assert!(lines[0]["differences"][0]["end"].is_number());
    assert!(lines[1]["agree"].is_null(), "smoothing is not compared");
}

/// From x < 0 the switch at t = -x/3 is chosen with the start: Stewart and Anitescu 2010; two optima without `initial`.
const OPTIMAL: &str = "
model crossing {
  state x in [-5, 5] = -1;
  x' = 2 - sign(x);
}
optimize start of crossing {
  horizon 2;
  intervals 1;
  elements 4;
  initial { x free; }
  minimize integral(x^2) + final((x - 5/3)^2);
}
model drive {
  state x = 0.5;
  control u in [-2, 2] = 0;
  x' = u - sign(x);
}
optimize stop of drive {
  horizon 1;
  intervals 5;
  minimize integral(u^2) + final((x + 0.5)^2);
}
";

#[test]
fn an_optimum_is_one_with_every_lowering() {
    let folder = folder("verify_optimum");
    fs::write(folder.join("ocp.nsd"), OPTIMAL).expect("the folder is writable");
    let ran = nsdc(&folder, &["verify", "ocp.nsd", "--json", "-"]);
    assert_eq!(ran.status, 0, "{}{}", ran.out, ran.err);
    for line in ran.out.lines() {
        let object: serde_json::Value = serde_json::from_str(line).expect("an object");
        assert_eq!(object["kind"], "optimize");
        assert_eq!(object["agree"], true, "{line}");
        let names = [0, 1].map(|k| object["roads"][k]["name"].clone());
        assert_eq!(names, ["as written, stewart", "step"]);
        let best = object["best"].as_u64().expect("one is the best") as usize - 1;
        assert!(object["roads"][best]["from_best"].is_null());
        let other = &object["roads"][1 - best]["from_best"];
        assert_eq!(other["is_same_point"], true);
        let objectives = [&object["objective"], &other["objective"]];
        let [a, b] = objectives.map(|number| number.as_f64().expect("a number"));
        // It is the same point: both programs have it to rounding.
        assert!((a - b).abs() <= 1e-9, "{a} and {b}");
    }
    // L(x0) = |x0|³/9 + (2 + x0/3)³/3 + (2 + x0/3 - 5/3)² at its minimum.
    let first = ran.out.lines().next().expect("two experiments");
    let object: serde_json::Value = serde_json::from_str(first).expect("an object");
    let objective = object["objective"].as_f64().expect("a number");
    assert!((objective - 1.523772775374957).abs() < 1e-9, "{objective}");
    let ran = nsdc(&folder, &["verify", "ocp.nsd", "start"]);
    assert_eq!(ran.status, 0, "{}{}", ran.out, ran.err);
    assert!(
        ran.out.contains("2 lowerings have the objective"),
        "{}",
        ran.out
    );
}

#[test]
fn an_optimum_that_is_not_reached_in_time_is_none() {
    let folder = folder("verify_late");
    fs::write(folder.join("ocp.nsd"), OPTIMAL).expect("the folder is writable");
    let ran = nsdc(
        &folder,
        &["verify", "ocp.nsd", "start", "--time-limit", "1e-9"],
    );
    assert_eq!(ran.status, 2, "{}{}", ran.out, ran.err);
}

/// From a guess on the wrong side of the switch, the descent stops at its surface.
const WORSE: &str = "
model side {
  state x = -0.8;
  control U in [-1, 1] = 0.1;
  x' = U + (if x > 0 then 0.1 else -0.4);
}
optimize there of side {
  horizon 2;
  intervals 2;
  elements 3;
  minimize final((x - 1.7)^2) + integral(0.1*U^2);
}
";

#[test]
fn an_optimum_is_none_of_the_worse_ones() {
    let folder = folder("verify_worse");
    fs::write(folder.join("side.nsd"), WORSE).expect("the folder is writable");
    let ran = nsdc(&folder, &["verify", "side.nsd", "--json", "-"]);
    let object: serde_json::Value = serde_json::from_str(&ran.out).expect("an object");
    let own = object["roads"][0]["objective"].as_f64();
    let own = own.expect("an objective");
    // Right is 1.134444: what is as written either gets there, or is told to be worse.
    let is_best = own < 1.134_445;
    assert_eq!(ran.status == 0, is_best, "{}{}", ran.out, ran.err);
    assert_eq!(object["agree"], is_best);
}
