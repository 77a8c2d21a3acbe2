//! Diagnostics as a user meets them: of words of the command line, and of contacts in a run.

use std::fs;

use crate::terminal::{folder, nsdc};
use insta::assert_snapshot;

const DECAY: &str =
    "model m { param k = 1; state x = 1; x' = -k*x; }\nsimulate s of m { horizon 1; }\n";

#[test]
fn words_of_the_command_line_are_shown_alone() {
    let folder = folder("words");
    fs::write(folder.join("m.nsd"), DECAY).expect("the folder is writable");
    let told = |words: [&str; 2]| {
        let ran = nsdc(&folder, &["run", "m.nsd", words[0], words[1]]);
        assert_eq!((ran.status, ran.out.as_str()), (1, ""));
        ran.err
    };
    assert_snapshot!(told(["--set", "k=abc"]), @r"
    E0101

      × unknown name `abc`
       ╭─[--set:1:3]
     1 │ k=abc
       ·   ─┬─
       ·    ╰── not declared here
       ╰────
    ");
    assert_snapshot!(told(["--set", "k=1;x"]), @r"
    E0010

      × expected `=`, found `;`
       ╭─[--set:1:6]
     1 │ k=1;x
       ·      ▲
       ·      ╰── expected `=`
       ╰────
    ");
    assert_snapshot!(told(["--set", "k=(2"]), @r"
    E0007

      × `(` is never closed
       ╭─[--set:1:3]
     1 │ k=(2
       ·   ┬ ▲
       ·   │ ╰── should be closed before this
       ·   ╰── opened here
       ╰────
      help: close it with `)`
    ");
    assert_snapshot!(told(["--method", "rk4"]), @r"
    E0508

      × unknown method `rk4`
       ╭─[--method:1:8]
     1 │ method rk4
       ·        ─┬─
       ·         ╰── expected `auto`, `event`, `fesd`, `timestepping`, `smoothing`, `adaptive`
       ╰────
    ");
}

/// A block that sticks until there is no friction any more.
const WORN: &str = "
model worn {
  state q[3] = [0, 0, 0];
  state v[3] = [0, 0, 0];
  q' = v;
  mechanics q, v {
    mass = 1;
    force = [0, 0, -9.81];
    contact floor { gap = q[3]; slip = [v[1], v[2]]; restitution = 0; friction = max(0.3 - time, 0); }
  }
}
simulate rests of worn { horizon 1; }
";

#[test]
fn a_contact_is_named_once() {
    let folder = folder("contact_named_once");
    fs::write(folder.join("worn.nsd"), WORN).expect("the folder is writable");
    let ran = nsdc(&folder, &["run", "worn.nsd"]);
    assert_eq!(ran.status, 2);
    assert_snapshot!(ran.err, @r"
    E0704

      × at t = 0.29999999999999993, the sliding mode became singular
        ╭─[worn.nsd:9:5]
      8 │     force = [0, 0, -9.81];
      9 │     contact floor { gap = q[3]; slip = [v[1], v[2]]; restitution = 0; friction = max(0.3 - time, 0); }
        ·     ─────────────────────────────────────────────────┬────────────────────────────────────────────────
        ·                                                      ╰── on the surface of `floor`
     10 │   }
        ╰────
      help: motion does not determine the force of a contact here: friction comes to zero while a body
            sticks, or directions of contacts become parallel; keep friction above zero, as `max(mu,
            1e-6)` does, or end the horizon before
    ");
}

/// Kinks on the surfaces of switches that have a statement take nothing from their names, those of entries neither.
#[test]
fn switches_with_a_statement_keep_their_names() {
    let folder = folder("names_of_switches");
    let text = "model m {
        state x = 0; state v = 0; state w = 2;
        switch far_from_the_wall = step([x - w, 2*x - w]);
        switch belt_is_slipping = sign(v - w);
        switch heater_of_the_room = hysteresis(x, on = 1.5, off = 1);
        let kinks = max(v, w) + max(x, w) + max(2*x, w) + max(x, 1.5) + max(v - x, 1);
        x' = 1; v' = 2 - 0.1*belt_is_slipping;
        w' = 0.1*far_from_the_wall[1] + 0.01*far_from_the_wall[2] + 0.01*heater_of_the_room + 0.001*kinks;
    }
    simulate s of m { horizon 4; output x, v, w; }";
    fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
    let ran = nsdc(&folder, &["run", "m.nsd"]);
    assert_eq!(ran.status, 0, "{}", ran.err);
    for name in [
        "above(far_from_the_wall[1])",
        "above(far_from_the_wall[2])",
        "above(belt_is_slipping)",
        "on(heater_of_the_room)",
        "v - x above 1",
    ] {
        assert!(ran.out.contains(name), "{name}: {}", ran.out);
    }
    for words in ["x above w", "v above w", "x - w", "v - w"] {
        assert!(!ran.out.contains(words), "{words}: {}", ran.out);
    }
}
