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

/// A relay behind a lag, x' = u, e u' = -sign(x) - u.
fn lag(e: f64, events: usize) -> String {
    format!(
        "model lag {{ state x = 0.5; state u = 0; x' = u; u' = (-sign(x) - u)/{e}; }}\n\
         simulate run of lag {{ horizon 2; method event {{ max_events = {events}; }} }}\n"
    )
}

#[test]
fn chattering_that_never_ends_is_told_early() {
    // Between two events, in units of e, 1 - exp(-d) = d/(1 + v) for the speed v, and the next speed is d - v: that is
    // d = 2v - 2v²/3 + O(v³) and v - 2v²/3 + O(v³), so that v = 3/(2n) and d = 3/n after n events, and their number
    // grows by a factor of exp(1/3) in a unit of time.
    for (e, events, n) in [(0.01, 1_000_000, 16384.0), (0.03, 100_000, 2048.0)] {
        let args = ["run", "-", "--json", "-"];
        let ran = nsdc_with_input(&folder("chattering"), &args, &lag(e, events));
        assert_eq!(ran.status, 2, "{}", ran.err);
        let found = json(&ran.out);
        assert_eq!(found["status"], "iteration_limit");
        assert_eq!(
            found["events"].as_array().map(|met| met.len() as f64),
            Some(n)
        );
        for told in ["E0733", "sign(x)", "`max_events`"] {
            assert!(ran.err.contains(told), "{}", ran.err);
        }
        assert!(!ran.err.contains("W0701"), "{}", ran.err);
        let told = ran.err.replace("\n  │ ", " ");
        let number = |after: &str| -> f64 {
            let rest = told.split(after).nth(1).expect("it is told");
            let digits = rest.split([' ', ',']).next().expect("a number follows");
            digits.parse().expect("it is a number")
        };
        let (time, spacing) = (number("at t = "), number("every "));
        assert!((spacing * n / (3.0 * e) - 1.0).abs() < 0.05, "{}", ran.err);
        let left = number("with ").ln() - n.ln();
        assert!(
            (left * 3.0 * e / (2.0 - time) - 1.0).abs() < 0.05,
            "{}",
            ran.err
        );
    }
}

#[test]
fn a_spiral_into_a_point_where_surfaces_meet_is_told() {
    // One gene furthers the other and is repressed by it: around both thresholds turns shrink as 1/n.
    let model = "model network {
           state x = 0.3; state y = 0.4;
           x' = (if y > 0.5 then 0 else 1) - x;
           y' = (if x > 0.4 then 1 else 0) - y;
         }
         simulate run of network { horizon 1000; }";
    let ran = nsdc_with_input(&folder("spiral"), &["run", "-"], model);
    assert_eq!(ran.status, 2, "{}", ran.err);
    for told in ["E0733", "x > 0.4", "y > 0.5", "`max_events`"] {
        assert!(ran.err.contains(told), "{}", ran.err);
    }
}

#[test]
fn a_limit_of_events_names_the_chattering_that_met_it() {
    let found = |model: &str| nsdc_with_input(&folder("cycles"), &["run", "-"], model).err;
    assert!(found(&lag(0.01, 500)).contains("E0733"));
    assert!(found(CHATTER).contains("E0708"));
}

#[test]
fn chattering_that_another_switch_ends_in_time_goes_on_to_it() {
    // 4000 events until the set point steps, and some hundred behind; without the step there would be millions.
    let model = "model lag {
           state x = 0.1; state u = 0;
           x' = u; u' = (-sign(x - (if time > 1.5 then 0.2 else 0)) - u)/0.06;
         }
         simulate run of lag {
           horizon 2.7; method event { max_events = 40000; }
           expect status is solved;
         }";
    let ran = nsdc_with_input(&folder("in_time"), &["run", "-"], model);
    assert_eq!(ran.status, 0, "{}", ran.err);
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

/// The first experiment takes all of the time, and the second one, which needs hardly any, has none left.
#[test]
fn all_experiments_share_the_time() {
    let text = "model m { state x = 1; state v = 0; x' = v; v' = -sin(x); }
        simulate long of m { horizon 1e6; }
        simulate short of m { horizon 1; }";
    let args = ["run", "-", "--time-limit", "0.2", "--json", "-"];
    let ran = nsdc_with_input(&folder("time_shared"), &args, text);
    assert_eq!(ran.status, 2, "{}", ran.err);
    let ends: Vec<serde_json::Value> = ran.out.lines().map(json).collect();
    assert_eq!([&ends[0]["status"], &ends[1]["status"]], ["time_limit"; 2]);
}

/// The object of a run.
fn json(line: &str) -> serde_json::Value {
    serde_json::from_str(line).expect("`--json` prints an object")
}

/// A model of one state whose rate is a function composed with itself; `@` is the value of the level before.
fn composed(levels: usize, first: &str, level: &str) -> String {
    let lets = (1..=levels).map(|k| {
        let value = level.replace('@', &format!("a{}", k - 1));
        format!("  let a{k} = {value};\n")
    });
    let lets: String = lets.collect();
    format!(
        "fn f(u) = u + 0.1*sin(u);\n\
         model m {{\n  state x = 0.1;\n  let a0 = {first};\n{lets}  x' = a{levels} - 100*x;\n}}\n\
         simulate s of m {{ horizon 0.01; }}\n"
    )
}

#[test]
fn composed_functions_are_looked_at_once_per_level() {
    // What two or more uses of each level share grows by a factor with every level where it is walked as a tree.
    const LEVELS: [&str; 11] = [
        "@ + sin(@)",
        "exp(-@)*@",
        "sqrt(1 + @^2) - 0.5*@",
        "@/(1 + @^2)",
        "(1 + @)/(2 + @)",
        "atan2(@, 1 + @)",
        "0.5*@*(1 - @)",
        "norm([@, 1 + @]) - @",
        "dot([@, 1], [@, @])/(1 + @^2)",
        "f(f(@))",
        "sin(@)*cos(@)",
    ];
    let folder = folder("composed");
    for level in LEVELS {
        // Of a state, and of one switch below all levels.
        for first in ["x", "if x > 0 then x else -2*x"] {
            let ran = nsdc_with_input(&folder, &["check", "-"], &composed(60, first, level));
            // A function that is not linear in a switch may need a reading: that is an answer, too.
            let is_answered = ran.status == 0 || first != "x" && ran.err.contains("E0402");
            assert!(is_answered, "{level}: {}", ran.err);
        }
    }
}

#[test]
fn every_form_of_a_composed_function_is_short() {
    const LONGEST: usize = 4_000_000;
    let folder = folder("composed_forms");
    let text = composed(60, "x", "@ + sin(@)");
    fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
    for ir in [
        "ast", "model", "system", "dcs", "fesd", "mpcc", "nl", "tex", "dot",
    ] {
        let ran = nsdc(&folder, &["emit", "m.nsd", "s", "--ir", ir]);
        assert_eq!(ran.status, 0, "{ir}: {}", ran.err);
        assert!(ran.out.len() < LONGEST, "{ir}: {} bytes", ran.out.len());
    }
}

#[test]
fn switches_inside_nonlinear_functions_of_each_other_are_refused() {
    let folder = folder("entangled");
    let check =
        |levels, level| nsdc_with_input(&folder, &["check", "-"], &composed(levels, "x", level));
    let few = check(3, "min(@, sin(@))");
    assert_eq!(few.status, 0, "{}", few.err);
    let many = check(60, "min(@, sin(@))");
    assert_eq!(many.status, 1, "{}", many.err);
    assert!(many.err.contains("E0422"), "{}", many.err);
}

#[test]
fn only_regular_files_are_read() {
    let folder = folder("regular");
    let model = |table: &str| {
        format!(
            "model m {{ signal r = table(\"{table}\", \"v\"); \
             state x = 0; x' = r; }}\n"
        )
    };
    fs::create_dir(folder.join("folder.csv")).expect("the folder is writable");
    let mut refused = vec![("folder.csv", "it is a folder")];
    if cfg!(unix) {
        let made = std::process::Command::new("mkfifo")
            .arg(folder.join("fifo.csv"))
            .status();
        assert!(made.expect("mkfifo starts").success());
        refused.extend([
            ("fifo.csv", "it is no regular file"),
            ("/dev/zero", "it is no regular file"),
        ]);
    }
    for (table, why) in refused {
        let ran = nsdc_with_input(&folder, &["check", "-"], &model(table));
        assert_eq!(ran.status, 1, "{table}: {}", ran.err);
        assert!(ran.err.contains(why), "{table}: {}", ran.err);
    }
}

#[cfg(unix)]
#[test]
fn goldens_are_not_written_through_links() {
    const MODEL: &str = "model m { state x = 1; x' = -x; }\n\
         simulate s of m { horizon 1; expect numbers golden; }\n";
    let folder = folder("links");
    let outside = folder.join("outside");
    fs::create_dir_all(&outside).expect("the folder is writable");
    fs::write(outside.join("kept"), "kept").expect("the folder is writable");
    for (name, is_folder) in [("a", true), ("b", false)] {
        fs::write(folder.join(format!("{name}.nsd")), MODEL).expect("the folder is writable");
        let golden = folder.join(format!("{name}.golden"));
        let link = |to: &std::path::Path, from: &std::path::Path| {
            std::os::unix::fs::symlink(to, from).expect("links can be made");
        };
        if is_folder {
            link(&outside, &golden);
        } else {
            fs::create_dir_all(&golden).expect("the folder is writable");
            link(&outside.join("kept"), &golden.join("s.numbers"));
        }
        let ran = nsdc(&folder, &["test", "--accept", &format!("{name}.nsd")]);
        assert_ne!(ran.status, 0, "{}{}", ran.out, ran.err);
        let told = format!("{}{}", ran.out, ran.err);
        assert!(told.contains("is a symbolic link"), "{told}");
        let kept = fs::read_to_string(outside.join("kept"));
        assert_eq!(kept.expect("the file is there"), "kept");
        assert!(!outside.join("s.numbers").exists());
    }
}

#[test]
fn tolerances_are_finite() {
    let folder = folder("tolerances");
    for within in ["inf", "-1", "-inf"] {
        let text = format!(
            "model m {{ state x = 1; x' = -x; }}\n\
             simulate s of m {{ horizon 1; expect x at end ~ 7 within {within}; }}\n"
        );
        let ran = nsdc_with_input(&folder, &["check", "-"], &text);
        assert_eq!(ran.status, 1, "{within}: {}", ran.err);
        assert!(ran.err.contains("E06"), "{within}: {}", ran.err);
    }
    // A golden number that anything would be within is no golden number.
    let text = "model m { state x = 1; x' = -x; }\n\
         simulate s of m { horizon 1; expect numbers golden; }\n";
    fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
    assert_eq!(nsdc(&folder, &["test", "--accept", "m.nsd"]).status, 0);
    assert_eq!(nsdc(&folder, &["test", "m.nsd"]).status, 0);
    let golden = folder.join("m.golden/s.numbers");
    let kept = fs::read_to_string(&golden).expect("it was accepted");
    let line = kept.lines().find(|line| line.starts_with("x at end"));
    let line = line.expect("the end is kept");
    for within in ["inf", "nan", "-1e-3"] {
        let wide = kept.replace(line, &format!("x at end = 7 within {within}"));
        fs::write(&golden, wide).expect("the folder is writable");
        let ran = nsdc(&folder, &["test", "m.nsd"]);
        assert_eq!(ran.status, 2, "{within}: {}{}", ran.out, ran.err);
    }
}

/// A file that a command is told to write is what a shell writes behind `>`: a link stays one, and a FIFO is written to.
#[cfg(unix)]
#[test]
fn named_files_are_written_as_by_a_shell() {
    const MODEL: &str = "model m { state x = 1; x' = -x; }\nsimulate s of m { horizon 1; }\n";
    let folder = folder("written");
    let at = |name: &str| folder.join(name);
    let link = |to: &str, from: &str| {
        std::os::unix::fs::symlink(at(to), at(from)).expect("links can be made");
    };
    let is_link = |name: &str| {
        let kind = fs::symlink_metadata(at(name)).expect("it is there");
        kind.file_type().is_symlink()
    };
    let text = |name: &str| fs::read_to_string(at(name)).expect("it is there");
    fs::write(at("real.nsd"), MODEL.replace("{ ", "{   ")).expect("the folder is writable");
    link("real.nsd", "link.nsd");
    let formatted = nsdc(&folder, &["fmt", "link.nsd"]);
    assert_eq!(formatted.status, 0, "{}", formatted.err);
    assert!(is_link("link.nsd"));
    assert!(!text("real.nsd").contains("{   "));
    // A file that is there, and one that is not yet.
    fs::write(at("there"), "old").expect("the folder is writable");
    for (to, from) in [("there", "first"), ("new", "second")] {
        link(to, from);
        for option in ["--csv", "--json"] {
            let ran = nsdc(&folder, &["run", "link.nsd", option, from]);
            assert_eq!(ran.status, 0, "{}", ran.err);
            assert!(is_link(from));
            assert!(text(to).contains("time"), "{option}: {}", text(to));
        }
    }
    let made = std::process::Command::new("mkfifo")
        .arg(at("fifo"))
        .status();
    assert!(made.expect("mkfifo starts").success());
    let reader = {
        let fifo = at("fifo");
        std::thread::spawn(move || fs::read_to_string(fifo))
    };
    let ran = nsdc(&folder, &["run", "link.nsd", "--csv", "fifo"]);
    assert_eq!(ran.status, 0, "{}", ran.err);
    let read = reader.join().expect("it reads").expect("there is text");
    assert!(read.starts_with("time,x"), "{read}");
    // What is read is a file, which has an end.
    let formatted = nsdc(&folder, &["fmt", "fifo"]);
    assert_eq!(formatted.status, 1, "{}", formatted.err);
    assert!(
        formatted.err.contains("no regular file"),
        "{}",
        formatted.err
    );
}

/// A function for each of 243 regions, each with as many terms, would take minutes.
#[test]
fn saturations_inside_of_each_other_have_an_answer() {
    let nested: Vec<String> = (1..=5)
        .map(|k| format!("let a{k} = sat(1.5*a{} + 0.1*sin({k}*time), -1, 1);", k - 1))
        .collect();
    let model = format!(
        "model m {{ state x = 0.1; let a0 = 2*sin(3*time); {} x' = -x + a5; }}\n\
         simulate s of m {{ horizon 1; method fesd {{ steps = 20; }} }}\n",
        nested.join(" ")
    );
    let folder = folder("saturations");
    let by_steps = nsdc_with_input(&folder, &["run", "-"], &model);
    assert_eq!(by_steps.status, 0, "{}", by_steps.err);
    let refused = model.replace("horizon 1;", "horizon 1; lower stewart;");
    let ran = nsdc_with_input(&folder, &["run", "-"], &refused);
    assert_eq!(ran.status, 1, "{}", ran.err);
    assert!(ran.err.contains("E0421"), "{}", ran.err);
}

/// A bound whose own index has the name of an outer one depends on none: the loop is refused before it is unrolled.
#[test]
fn loops_whose_bounds_have_indices_of_their_own_are_foreseen() {
    let model = "model m { state x = 1; x' = 1;\n\
                 for i in 1..3000, j in 1..sum(i for i in 1..60) { switch s = sign(x - i*j); } }\n";
    let folder = folder("foreseen");
    let refused = nsdc_with_input(&folder, &["check", "-"], model);
    assert_eq!(refused.status, 1, "{}", refused.err);
    assert!(refused.err.contains("E0213"), "{}", refused.err);
    assert!(refused.err.contains(":2:5]"), "{}", refused.err);
}
