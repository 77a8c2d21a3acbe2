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

/// At x = 0 the objective falls to first order with x, and two constraints that touch each other leave no room for that: in
/// the pair of x and what keeps it there, both members are zero.
#[test]
fn an_end_of_a_weak_class_is_feasible_and_ends_with_2() {
    let folder = folder("optimize_weak");
    let model = "\
model m {
  state x = 0;
  state y = 0;
  control u in [-1, 1] = 0;
  x' = u;
  y' = 0;
  project x onto { x >= 0; };
}
optimize o of m {
  horizon 1; intervals 1; elements 1; scheme radau_iia(1);
  minimize 1000 - final(x) - integral(0.01*u);
  final { y >= (9e3*x)^2; y <= -(9e3*x)^2; }
}
";
    fs::write(folder.join("m.nsd"), model).expect("the folder is writable");
    let ran = nsdc(&folder, &["run", "m.nsd", "--json", "-"]);
    assert_eq!(ran.status, 2, "{}", ran.err);
    assert!(ran.err.starts_with("E0735"), "{}", ran.err);
    let found: serde_json::Value = serde_json::from_str(&ran.out).expect("it is JSON");
    assert_eq!(found["status"], "feasible");
    assert_eq!(found["certificate"]["stationarity"], "A");
    let objective = found["objective"].as_f64().expect("there is one");
    assert!((objective - 1000.0).abs() < 1e-6, "{objective}");
    let expected = model.replace("elements 1;", "elements 1; expect status is feasible;");
    fs::write(folder.join("m.nsd"), expected).expect("the folder is writable");
    let ran = nsdc(&folder, &["test", "m.nsd"]);
    assert_eq!(ran.status, 0, "{}", ran.err);
}

/// Problems whose least objective J is known for every bound c, with the value that c bounds, and dJ/dc.
const BOUNDED: [(&str, &str, &str, f64); 9] = [
    // u = c, and the switch does not matter: J = c² - c/2.
    (
        "final_value",
        "horizon 1; minimize integral(u^2) + 3*final(y^2) - 0.5*final(x); final { x = c; }",
        "x = at end",
        0.9,
    ),
    // J = c² - 2c.
    (
        "final_bound",
        "horizon 1; minimize integral(u^2) - 2*final(x); final { x <= c; }",
        "x <= at end",
        -0.6,
    ),
    // J = (1 - c)².
    (
        "at_intervals",
        "horizon 1; minimize integral((u - 1)^2); subject to { u <= c; } at intervals;",
        "u <= at intervals",
        -0.6,
    ),
    // J = -√c.
    (
        "of_the_run",
        "horizon 1; minimize -final(x); subject to { integral(u^2) <= c; }",
        "integral(u^2) <= at end",
        -0.597_614_304_667_196_8,
    ),
    // J = T + c²/T is 2c at T = c.
    (
        "free_horizon",
        "horizon free in [0.1, 2] = 1; minimize integral(1 + u^2); final { x = c; }",
        "x = at end",
        2.0,
    ),
    // J = c³ + c².
    (
        "products",
        "horizon 1; minimize integral(u^2)*final(x) + integral(u^2); final { x = c; }",
        "x = at end",
        2.87,
    ),
    // J = -c, as u <= c.
    (
        "of_a_control",
        "horizon 1; minimize -final(z);",
        "v <=",
        -1.0,
    ),
    // J = (1 - c)², as w <= c.
    (
        "of_a_state",
        "horizon 1; minimize integral((a - 1)^2);",
        "w <=",
        -0.6,
    ),
    // J = c²/4 + 1 at p = c.
    (
        "of_a_parameter",
        "horizon 1; minimize integral(u^2) + p^2/4 + 1; free { p in [0.7, 2]; }",
        "p >=",
        0.35,
    ),
];

const BOUNDS: &str = "
model m {
  param c = 0.7;
  param p = 1;
  state x = 0;
  state y = 0.5;
  state z = 0;
  state w in [-1, c] = 0;
  control u in [-9, 9] = 0;
  control v in [-1, c] = 0;
  control a in [-9, 9] = 0;
  x' = u;
  y' = -sign(y);
  z' = v;
  w' = a;
}
";

/// The optimum with a bound.
fn optimum(folder: &std::path::Path, name: &str, c: f64) -> serde_json::Value {
    let set = format!("c={c}");
    let ran = nsdc(
        folder,
        &["run", "m.nsd", name, "--set", &set, "--json", "-"],
    );
    assert_eq!(ran.status, 0, "{name}: {}", ran.err);
    serde_json::from_str(&ran.out).expect("one object")
}

#[test]
fn multipliers_are_derivatives_of_the_optimum_by_bounds() {
    let folder = folder("optimize_multipliers");
    let experiments = BOUNDED.map(|(name, settings, ..)| {
        format!("optimize {name} of m {{ intervals 3; elements 2; {settings} }}\n")
    });
    fs::write(
        folder.join("m.nsd"),
        BOUNDS.to_owned() + &experiments.concat(),
    )
    .unwrap();
    for (name, _, bound, expected) in BOUNDED {
        let found = optimum(&folder, name, 0.7);
        let constraints = found["optimum"]["constraints"].as_array().unwrap();
        let told = |constraint: &serde_json::Value| {
            let at = constraint["at"].as_str();
            let at = at.map_or_else(String::new, |at| format!(" at {at}"));
            let [value, relation] =
                ["value", "relation"].map(|key| constraint[key].as_str().unwrap());
            format!("{value} {relation}{at}")
        };
        let one = constraints.iter().find(|one| told(one) == bound);
        let one = one.unwrap_or_else(|| panic!("{name}: {constraints:?}"));
        assert_eq!(one["bound"], 0.7, "{name}");
        let multiplier = one["multiplier"].as_f64().unwrap();
        assert!((multiplier - expected).abs() < 1e-5, "{name}: {multiplier}");
        // All others are not felt.
        for other in constraints.iter().filter(|other| told(other) != bound) {
            let multiplier = other["multiplier"].as_f64().unwrap();
            assert!(multiplier.abs() < 1e-6, "{name}: {other}");
        }
        if name == "of_a_parameter" {
            continue;
        }
        let [more, less] =
            [0.701, 0.699].map(|c| optimum(&folder, name, c)["objective"].as_f64().unwrap());
        let difference = (more - less) / 0.002;
        assert!(
            (multiplier - difference).abs() < 1e-5,
            "{name}: {difference}"
        );
    }
}

/// Where a state follows its bound, single multipliers are not unique, but their sum is the derivative; and where it
/// starts there and leaves, its start does not hold it. No other bound is felt.
#[test]
fn bounds_of_states_are_felt_where_states_follow_them() {
    let folder = folder("optimize_followed");
    let text = "
        model m {
          param c = 0; param s = 0.1;
          state x in [c, 3] = s; state y = 0.5; control u in [-9, 9] = 0;
          x' = u; y' = -sign(y);
        }
        optimize followed of m {
          horizon 1; intervals 4; elements 2; minimize integral((x + 1)^2) + 0.01*integral(u^2);
        }
        optimize left of m {
          horizon 1; intervals 3; elements 2; with { s = 0; }
          minimize integral((u - 1)^2) + final((x - 0.5)^2);
        }";
    fs::write(folder.join("m.nsd"), text).unwrap();
    let j = |name, c| optimum(&folder, name, c)["objective"].as_f64().unwrap();
    for (name, derivative) in [
        (
            "followed",
            (j("followed", 1e-3) - j("followed", -1e-3)) / 2e-3,
        ),
        ("left", 0.0),
    ] {
        let found = optimum(&folder, name, 0.0);
        for constraint in found["optimum"]["constraints"].as_array().unwrap() {
            let is_it = constraint["value"] == "x" && constraint["relation"] == ">=";
            let expected = if is_it { derivative } else { 0.0 };
            let multiplier = constraint["multiplier"].as_f64();
            let multiplier = multiplier.unwrap_or_else(|| panic!("{name}: {constraint}"));
            assert!(
                (multiplier - expected).abs() < 1e-2,
                "{name}: {constraint}, {expected}"
            );
        }
    }
    assert!(j("followed", 1e-3) > j("followed", 0.0) + 1e-3);
}

#[test]
fn bounds_that_hold_one_value_have_no_multiplier_of_their_own() {
    let folder = folder("optimize_not_unique");
    let experiment = "optimize twice of m { horizon 1; intervals 2; minimize integral((u - 1)^2); \
                      final { x <= 0.7; x <= 0.7; y <= 1; } }";
    fs::write(folder.join("m.nsd"), format!("{BOUNDS}{experiment}")).unwrap();
    let found = optimum(&folder, "twice", 2.0);
    for constraint in found["optimum"]["constraints"].as_array().unwrap() {
        let is_felt = constraint["value"] == "x";
        assert_eq!(constraint["multiplier"].is_null(), is_felt, "{constraint}");
    }
    let report = nsdc(&folder, &["run", "m.nsd", "twice"]).out;
    assert_eq!(
        report.matches("x <= 0.7 at end  not unique").count(),
        2,
        "{report}"
    );
}

#[test]
fn terms_add_up_to_the_objective() {
    let folder = folder("optimize_terms");
    let terms = [
        "integral(u^2)",
        "3*final(y^2)",
        "final(x)^2*integral(u^2)",
        "(integral(u) - 1)^2",
        "p^2",
        "abs(final(x) - 0.3)",
        "final([x, y])[1]",
        "2.5",
    ];
    // Signs and places of a linear congruence.
    let mut state: u32 = 7;
    let mut random = |n: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 16) % n
    };
    let mut texts = Vec::new();
    for _ in 0..12 {
        let chosen: Vec<&str> = terms.into_iter().filter(|_| random(2) == 0).collect();
        let signs = chosen.iter().map(|term| {
            // Everything that is convex is added.
            let is_linear = matches!(*term, "2.5" | "final([x, y])[1]");
            if is_linear && random(2) == 0 {
                "-"
            } else {
                "+"
            }
        });
        let signs: Vec<&str> = signs.collect();
        let rest = signs
            .iter()
            .zip(&chosen)
            .map(|(sign, term)| format!(" {sign} {term}"));
        texts.push((
            format!("0.1*integral(u^2){}", rest.collect::<String>()),
            signs,
            chosen,
        ));
    }
    let experiments = texts.iter().enumerate().map(|(k, (cost, ..))| {
        format!("optimize o{k} of m {{ horizon 1; intervals 3; elements 2; free {{ p in [0.5, 2]; }} minimize {cost}; }}\n")
    });
    let experiments: String = experiments.collect();
    fs::write(folder.join("m.nsd"), BOUNDS.to_owned() + &experiments).unwrap();
    for (k, (cost, signs, chosen)) in texts.iter().enumerate() {
        let ran = nsdc(&folder, &["run", "m.nsd", &format!("o{k}"), "--json", "-"]);
        let found: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
        let objective = found["objective"].as_f64().unwrap();
        let terms = found["optimum"]["objective_terms"].as_array().unwrap();
        let sum: f64 = terms
            .iter()
            .map(|term| term["value"].as_f64().unwrap())
            .sum();
        assert!(
            (sum - objective).abs() < 1e-12 * (1.0 + objective.abs()),
            "{cost}: {sum}, {objective}"
        );
        let told: Vec<&str> = terms
            .iter()
            .map(|term| term["text"].as_str().unwrap())
            .collect();
        let written = signs.iter().zip(chosen).map(|(sign, term)| match *sign {
            "-" => format!("-{term}"),
            _ => (*term).to_owned(),
        });
        let written: Vec<String> = ["0.1*integral(u^2)".to_owned()]
            .into_iter()
            .chain(written)
            .collect();
        assert_eq!(told, written, "{cost}");
    }
}

#[test]
fn a_report_has_terms_and_bounds_that_are_felt() {
    let folder = with_model("optimize_report");
    let report = nsdc(&folder, &["run", "m.nsd", "reach"]).out;
    for lines in [
        "  objective 1\n\n  terms of the objective\n    integral(u^2) = 1\n    final(y^2)    = ",
        "\n\n  multipliers: derivatives of the objective by bounds\n    x = 1 at end  2\n\n  at the end",
    ] {
        assert!(report.contains(lines), "{report}");
    }
    // One term is the objective itself.
    let report = nsdc(&folder, &["run", "m.nsd", "often"]).out;
    assert!(!report.contains("terms of"), "{report}");
}
