//! `nsdc verify`: one experiment by events, and by finite elements with every lowering.

mod terminal;

use std::fs;

use terminal::{folder, nsdc};

const OSCILLATOR: &str = include_str!("../../examples/oscillator.nsd");
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
    assert!(ran.out.contains("5 roads agree"), "{}", ran.out);
    for road in [
        "as written, event",
        "fesd, lower step",
        "fesd, lower timefreezing",
    ] {
        assert!(ran.out.contains(road), "{road} in\n{}", ran.out);
    }
}

#[test]
fn a_lowering_of_contacts_finds_none_and_smoothing_is_another_model() {
    let folder = folder("verify_relay");
    fs::write(folder.join("relay.nsd"), CONTACT_FREE).expect("the folder is writable");
    let ran = nsdc(&folder, &["verify", "relay.nsd", "slide"]);
    assert_eq!(ran.status, 0, "{}{}", ran.out, ran.err);
    assert!(ran.out.contains("fesd, lower step"), "{}", ran.out);
    // As lowered contacts it would be the run that is there already.
    for absent in ["lower impact", "numerical_failure"] {
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
    assert!(ran.out.contains("one road alone"), "{}", ran.out);
    assert!(ran.out.contains("3 solutions go on"), "{}", ran.out);
    let ran = nsdc(&folder, &["verify", "fork.nsd", "stuck"]);
    assert_eq!(ran.status, 2, "{}{}", ran.out, ran.err);
}

#[test]
fn what_is_wrong_as_written_is_said_with_its_line() {
    let folder = folder("verify_wrong");
    fs::write(folder.join("wrong.nsd"), "model m { state x; x' = y; }\n")
        .expect("the folder is writable");
    let ran = nsdc(&folder, &["verify", "wrong.nsd"]);
    assert_eq!(ran.status, 1, "{}{}", ran.out, ran.err);
}
