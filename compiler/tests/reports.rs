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
