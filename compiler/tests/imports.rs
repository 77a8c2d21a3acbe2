//! `use` as a user meets it: files beside each other, and what is shown of their mistakes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use insta::assert_snapshot;

/// The exit status and all that is printed.
fn nsdc(folder: &Path, args: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_nsdc"))
        .args(args)
        .current_dir(folder)
        .env_remove("COLUMNS")
        .output()
        .expect("the command starts");
    let text = [output.stdout, output.stderr].concat();
    let text = String::from_utf8(text).expect("output is UTF-8");
    (output.status.code(), text)
}

/// Writes files into a folder of their own.
fn with_files(test: &str, files: &[(&str, &str)]) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    let _ = fs::remove_dir_all(&folder);
    for (name, text) in files {
        let path = folder.join(name);
        let parent = path.parent().expect("a file has a folder");
        fs::create_dir_all(parent).expect("the folder is writable");
        fs::write(path, text).expect("the folder is writable");
    }
    folder
}

#[test]
fn files_import_each_other_from_where_they_are() {
    let files = [
        ("base.nsd", "const one = 1; fn half(v) = v/2*one; model thing { state z = 1; z' = -one*z; }"),
        (
            "lib/plant.nsd",
            "use ../base; const k = 3; fn twice(v) = base.half(v)*4*base.one;
             model plant { param gain = k; input u = 0; state x = 1; x' = u - gain*sign(x); output y = twice(x); }
             model inner { part p = base.thing; }
             simulate broken of plant { horizon 1; expect x at end ~ 9 within 1; }",
        ),
        (
            "main.nsd",
            "use ./lib/plant.{plant as p, twice, k as gain}; use ./lib/plant as lib; use ./base; use std.friction;
             const tol = 1e-9;
             model whole {
               part a = p { gain = gain/2; u = -base.one*a.y; }
               part b = lib.inner;
               part c = base.thing { z = twice(2) + base.half(2); }
               part floor = friction.coulomb { slip = a.x; }
               output q = lib.twice(b.p.z) + c.z + lib.k + floor.mu;
             }
             simulate one of whole { horizon 1; expect q at 0 ~ 2 + 5 + 3 + 0.3 within tol; expect b.p.z at end ~ exp(-1) within tol; }
             simulate two of lib.plant { with { x = base.one*2; } horizon 1; expect y at 0 ~ 4 within tol; }",
        ),
    ];
    let (_, shown) = nsdc(&with_files("imports", &files), &["test", "main.nsd"]);
    assert_snapshot!(shown, @r"
    ok      main.nsd: one
    ok      main.nsd: two

    2 passed, 0 failed, 0 not yet supported
    ");
}

#[test]
fn mistakes_in_imported_files_show_those_files() {
    let files = [
        ("main.nsd", "use ./one.{m}; simulate s of m { horizon 1; }"),
        ("one.nsd", "use ./two.{n};\nmodel m { part a = n; }"),
        ("two.nsd", "model n { state x = 1; x' = -y; }"),
        (
            "circle.nsd",
            "use ./other; use ./gone;\nmodel m { state x = 1; x' = 1; }",
        ),
        ("other.nsd", "use ./circle.{m};"),
    ];
    let folder = with_files("wrong_imports", &files);
    let (status, shown) = nsdc(&folder, &["check", "main.nsd", "circle.nsd"]);
    assert_eq!(status, Some(1));
    assert_snapshot!(shown, @r"
    E0101

      × unknown name `y`
       ╭─[two.nsd:1:30]
     1 │ model n { state x = 1; x' = -y; }
       ·                              ┬
       ·                              ╰── not declared here
       ╰────
    E0119

      × cannot import `./gone`
       ╭─[circle.nsd:1:18]
     1 │ use ./other; use ./gone;
       ·                  ───┬──
       ·                     ╰── gone.nsd: there is no such file or folder
     2 │ model m { state x = 1; x' = 1; }
       ╰────

    E0120

      × `circle.nsd` imports itself: circle.nsd -> other.nsd -> circle.nsd
       ╭─[circle.nsd:1:1]
     1 │ use ./other; use ./gone;
       · ──────┬─────
       ·       ╰── the circle begins here
     2 │ model m { state x = 1; x' = 1; }
       ╰────
       ╭─[other.nsd:1:1]
     1 │ use ./circle.{m};
       · ────────┬────────
       ·         ╰── leads back to `circle.nsd`
       ╰────
      help: move what both need into a file of its own
    ");
}
