//! `nsdc order`: errors against steps and times, as a table, CSV and figures.

use std::fs;
use std::path::Path;

use crate::terminal::{folder, nsdc};

const OSCILLATOR: &str = include_str!("../../examples/oscillator.nsd");

/// The number behind `order`, `tol^` or `eps^` in the summary of a method.
fn order(text: &str, method: &str) -> f64 {
    let mut lines = text.lines().filter(|line| line.contains("least error"));
    let line = lines.find(|line| line.trim_start().starts_with(method));
    let line = line.unwrap_or_else(|| panic!("no summary of {method} in\n{text}"));
    let words = ["order ", "tol^", "eps^"];
    let rest = words.iter().find_map(|word| line.split_once(word));
    let (_, rest) = rest.unwrap_or_else(|| panic!("no order in {line}"));
    let end = rest.find([' ', ';', ',']).unwrap_or(rest.len());
    rest[..end].parse().expect("orders are numbers")
}

fn svg(path: &Path) -> String {
    fs::read_to_string(path).expect("the figure was written")
}

#[test]
fn methods_have_their_orders_on_the_oscillator() {
    let folder = folder("order_oscillator");
    fs::write(folder.join("oscillator.nsd"), OSCILLATOR).expect("the folder is writable");
    let args = ["order", "oscillator.nsd", "crossing", "--csv", "errors.csv"];
    let ran = nsdc(&folder, &args);
    assert_eq!(ran.status, 0, "{}", ran.err);
    assert!(
        ran.out.contains("against the expected state"),
        "{}",
        ran.out
    );

    // Radau IIA has order 2n - 1, Gauss-Legendre 2n. Odd laws take from one side of a crossing what they
    // give on the other, to first order.
    let others = [
        ("event", 1.0),
        ("adaptive", 1.0),
        ("smoothing tanh", 2.0),
        ("smoothing polynomial", 2.0),
    ];
    let mut methods: Vec<(String, f64)> = others.map(|(m, p)| (m.to_owned(), p)).into();
    for n in 2..=4 {
        methods.push((format!("fesd radau_iia({n})"), f64::from(2 * n - 1)));
        methods.push((format!("fesd gauss({n})"), f64::from(2 * n)));
    }
    for (method, expected) in &methods {
        let found = order(&ran.out, method);
        assert!((found - expected).abs() < 0.7, "{method}: {found}");
    }

    let mut csv = csv::Reader::from_path(folder.join("errors.csv")).expect("it was written");
    let rows: Vec<csv::StringRecord> = csv.records().map(|row| row.expect("a row")).collect();
    let number = |row: &csv::StringRecord, column: usize| row[column].parse::<f64>();
    for (method, _) in &methods {
        let solved = |row: &&csv::StringRecord| row[0] == *method && &row[8] == "solved";
        let solved: Vec<_> = rows.iter().filter(solved).collect();
        assert!(solved.len() > 5, "{method}");
        let least = solved.iter().map(|row| number(row, 5).expect("an error"));
        assert!(least.fold(1.0, f64::min) < 1e-6, "{method}");
    }
    // What failed has no error.
    let failed: Vec<_> = rows.iter().filter(|row| &row[8] != "solved").collect();
    assert!(failed.iter().all(|row| row[5].is_empty()));
    assert_eq!(failed.len(), ran.out.matches("failed: ").count());

    for (figure, title) in [
        ("step", "mean step size h"),
        ("time", "time of the solve in s"),
    ] {
        let svg = svg(&folder.join(format!("crossing.error-{figure}.svg")));
        assert!(svg.contains(title));
        // Without detection errors across a switch jump from grid to grid: no order is asked for.
        let stepped = "timestepping radau_iia(2)".to_owned();
        for method in methods.iter().map(|(method, _)| method).chain([&stepped]) {
            assert!(svg.contains(&format!(">\n{method}\n<")), "{method}");
        }
    }
}

#[test]
fn without_an_expected_state_a_run_is_the_reference() {
    let folder = folder("order_reference");
    let text = "model m { state x = 1; state y = 0; x' = -x; y' = -2*sign(y - time + 0.3); }
        simulate part of m { horizon 1; output x, y; expect x at end ~ exp(-1) within 1e-9; }
        simulate wrong of m { horizon 1; expect x at end ~ 0.3679 within 1e-3;
          expect y at end ~ 0.7 within 1e-3; }
        optimize best of m { horizon 1; minimize final(x); }";
    fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
    let args = |name: &'static str| ["order", "m.nsd", name, "--time-limit", "0.5"];
    let ran = nsdc(&folder, &args("part"));
    assert_eq!(ran.status, 0, "{}", ran.err);
    assert!(ran.out.contains("against a run of `event`"), "{}", ran.out);
    let ran = nsdc(&folder, &args("wrong"));
    assert_eq!(ran.status, 0, "{}", ran.err);
    assert!(ran.out.contains("too far for a reference"), "{}", ran.out);

    let ran = nsdc(&folder, &args("best"));
    assert!(ran.status == 1 && ran.err.contains("E0521"), "{}", ran.err);
    let ran = nsdc(&folder, &args("parts"));
    assert!(
        ran.status == 1 && ran.err.contains("did you mean `part`?"),
        "{}",
        ran.err
    );
    let ran = nsdc(&folder, &["order", "m.nsd"]);
    assert!(
        ran.status == 1 && ran.err.contains("name one of `part`, `wrong`, `best`"),
        "{}",
        ran.err
    );
    let ran = nsdc(&folder, &["order", "missing.nsd", "part"]);
    assert!(ran.status == 1 && ran.err.contains("no such file"));
    let ran = nsdc(&folder, &["order", "m.nsd", "part", "--csv", "no/e.csv"]);
    assert!(ran.status == 1 && ran.err.contains("no/e.csv"));
}

#[test]
fn axes_have_units() {
    let folder = folder("order_units");
    let text = "model m { param k : 1/s = 1; state x : m = 1; state y : m = 0; state z = 0; x' = -k*x; y' = k*x; z' = k; }
        simulate all of m { horizon 1 s; } simulate some of m { horizon 1 s; output x, y; }";
    fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
    let axes = ["h [s]", "h", "| [m]", "x*|"];
    for (name, step) in [
        ("all", [true, false, false, true]),
        ("some", [true, false, true, false]),
    ] {
        let ran = nsdc(&folder, &["order", "m.nsd", name, "--time-limit", "0.2"]);
        assert_eq!(ran.status, 0, "{}", ran.err);
        let svg = svg(&folder.join(format!("{name}.error-step.svg")));
        assert_eq!(axes.map(|end| svg.contains(&format!("{end}\n<"))), step);
    }
}

#[test]
fn where_nothing_runs_there_is_no_table() {
    let folder = folder("order_nothing");
    let text = "model m { state x = 0; x' = sign(x); } simulate s of m { horizon 1; }";
    fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
    let ran = nsdc(&folder, &["order", "m.nsd", "--csv", "-"]);
    assert_eq!((ran.status, ran.out.as_str()), (2, ""));
    assert!(
        ran.err.contains("nothing to measure errors against"),
        "{}",
        ran.err
    );
}

#[test]
fn relays_are_run_from_event_to_event_and_in_frozen_time() {
    let folder = folder("order_relay");
    let text = "model m { state x = 19; x' = if h > 0.5 then 5 else -x/10;
          switch h = hysteresis(x, on = 18, off = 20, start = 1); }
        simulate s of m { horizon 3; }";
    fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
    let ran = nsdc(&folder, &["order", "m.nsd", "--csv", "-", "--plot", "f"]);
    assert_eq!(ran.status, 0, "{}", ran.err);
    let methods: Vec<&str> = ran.out.lines().skip(1).map(|l| &l[..6]).collect();
    assert!(methods.contains(&"event,") && methods.contains(&"timefr"));
    assert!(methods.iter().all(|m| ["event,", "timefr"].contains(m)));
    assert!(svg(&folder.join("f.error-time.svg")).contains("event"));
}

#[test]
fn nonlinear_sliding_is_run_by_what_knows_its_modes() {
    let folder = folder("order_branches");
    // Of 2s² - s = x the lesser root is taken, from x = 1 on one of two, and left in a fold.
    let text = "model m { state x = 0.9; state y = 0.05; switch s = sign(y) sliding nonlinear;
          x' = 2*s^2 - 1; y' = 2*s^2 - s - x; }
        simulate run of m { horizon 3; }
        model held { state x = 0.9; state y = 0.05; state z = 1; switch s = sign(y) sliding nonlinear;
          x' = 2*s^2 - 1; y' = 2*s^2 - s - x; z' = -1; project z onto { z >= 0; } }
        simulate kept of held { horizon 0.5; }";
    fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
    let args = |name: &'static str| ["order", "m.nsd", name, "--time-limit", "1"];
    let ran = nsdc(&folder, &args("run"));
    assert_eq!(ran.status, 0, "{}", ran.err);
    assert!(!ran.out.contains("solutions go on"), "{}", ran.out);
    assert!(!ran.out.contains("no run reached"), "{}", ran.out);
    let reason = "left out: `s` is read nonlinearly";
    let left_out = |name: &str| {
        let mut lines = ran.out.lines();
        lines.any(|line| line.trim_start().starts_with(name) && line.contains(reason))
    };
    assert!(
        left_out("timestepping") && left_out("adaptive"),
        "{}",
        ran.out
    );
    assert!(!ran.out.contains("timestepping radau"), "{}", ran.out);
    let ran = nsdc(&folder, &args("kept"));
    assert!(
        ran.out
            .contains("`s` is read nonlinearly beside a projection"),
        "{}{}",
        ran.out,
        ran.err
    );
}

/// What does not end where a condition becomes true is left out, whether or not its switches jump.
#[test]
fn only_what_stops_is_compared_where_a_run_stops() {
    let folder = folder("order_stops");
    for rate in ["-1 - 0.5*sign(x - 0.5) - 0.2*x", "-x"] {
        let text = format!(
            "model m {{ state x = 1; x' = {rate}; }} simulate s of m {{ horizon 3; stop when x <= 0.2; }}"
        );
        fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
        let ran = nsdc(&folder, &["order", "m.nsd", "--time-limit", "1"]);
        assert_eq!(ran.status, 0, "{rate}: {}", ran.err);
        for method in ["fesd", "timestepping", "smoothing", "adaptive"] {
            let mut lines = ran.out.lines().map(str::trim_start);
            let is_left_out =
                |line: &str| line.starts_with(method) && line.contains("left out: `stop when");
            assert!(lines.any(is_left_out), "{method}: {}", ran.out);
        }
    }
}

#[test]
fn an_order_of_what_is_exact_is_none() {
    let folder = folder("order_contact");
    let text = "model ball { state q[1] = [1]; state v[1] = [0]; q' = v;
          mechanics q, v { mass = eye(1); force = [-9.81]; contact floor { gap = q[1]; restitution = 0.5; } } }
        simulate by_events of ball { horizon 0.5; }
        simulate by_impulses of ball { horizon 0.5; method fesd { steps = 5; } lower impact; expect order >= 2; }";
    fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
    let args = ["order", "m.nsd", "by_events", "--time-limit", "0.5"];
    let ran = nsdc(&folder, &args);
    assert_eq!(ran.status, 0, "{}{}", ran.out, ran.err);
    assert_eq!(ran.out.matches("left out: ").count(), 3, "{}", ran.out);
    let ran = nsdc(&folder, &["test", "m.nsd"]);
    assert_eq!(ran.status, 2, "{}{}", ran.out, ran.err);
    // Parabolas are exact in every scheme.
    let reason = "too few errors are in range";
    assert!(ran.out.contains(reason), "{}", ran.out);
}

#[test]
fn an_order_can_be_expected() {
    let folder = folder("order_expected");
    let text = "model m { state x = 1; x' = if x > 0.5 then -2*x else -x*x; }
        simulate self of m { horizon 1; method fesd { scheme = radau_iia(2); steps = 8; }
          expect order >= 2.8; expect order <= 3.2; }
        simulate given of m { horizon 1; method fesd { scheme = gauss(2); elements = 1; steps = 64; }
          expect x at end ~ 1/(2 + 1 - log(2)/2) within 1e-9; expect order ~ 4 within 0.2; }
        model folds { state x = 0.9; state y = 0.05; switch s = sign(y) sliding nonlinear;
          x' = 2*s^2 - 1; y' = 2*s^2 - s - x; }
        simulate followed of folds { horizon 3; method fesd { scheme = radau_iia(2); steps = 8; }
          expect order ~ 3 within 0.3; }
        simulate crude of m { horizon 1; method timestepping { scheme = radau_iia(2); steps = 200; }
          expect order >= 2.5; }";
    fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
    let ran = nsdc(&folder, &["test", "m.nsd"]);
    assert_eq!(ran.status, 2, "{}{}", ran.out, ran.err);
    assert!(
        ran.out.contains("3 passed, 1 failed, 0 not yet supported"),
        "{}",
        ran.out
    );
    let lines: Vec<&str> = ran.out.lines().collect();
    let below = |name: &str| {
        let at = lines.iter().position(|line| line.ends_with(name));
        lines[at.expect("the experiment has a line") + 1..].to_vec()
    };
    // What was compared with what is told.
    let own = below(": self")[0];
    assert!(
        own.contains("order ") && own.contains("runs") && own.contains("a run of `event`"),
        "{own}"
    );
    assert!(below(": given")[0].contains("the expected state"));
    let failed = below(": crude")[..3].join(" ");
    assert!(
        failed.contains("expect order >= 2.5") && failed.contains("expected >= 2.5"),
        "{failed}"
    );
    assert!(failed.contains("got      order "), "{failed}");
}

/// Where states jump, lowerings and steps of time that take jumps stand beside events.
#[test]
fn contacts_have_orders_on_several_roads() {
    let folder = folder("order_contacts");
    let text = "model m { state q = 1; state v = 0; q' = v;
          mechanics q, v { mass = 1; force = -9.81*sin(q); contact wall { gap = q + 0.3; restitution = 0.7; } } }
        simulate s of m { horizon 1.5; }
        model h { state y = 15; switch on = hysteresis(y, on = 18, off = 20); y' = -0.2*y + 10*on; }
        simulate warm of h { horizon 1; }";
    fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
    let ran = nsdc(&folder, &["order", "m.nsd", "s", "--csv", "errors.csv"]);
    assert_eq!(ran.status, 0, "{}", ran.err);
    for (method, expected) in [
        ("timefreezing fesd radau_iia(2)", 3.0),
        ("timestepping, contacts", 1.0),
    ] {
        let found = order(&ran.out, method);
        assert!(
            (found - expected).abs() < 0.7,
            "{method}: {found} {}",
            ran.out
        );
    }
    for name in ["timefreezing event", "impact fesd radau_iia(2)"] {
        assert!(ran.out.contains(name), "{}", ran.out);
    }
    let ran = nsdc(&folder, &["order", "m.nsd", "warm", "--csv", "warm.csv"]);
    assert_eq!(ran.status, 0, "{}", ran.err);
    let lines = ran.out.lines().map(str::trim_start);
    let reason = |name: &str| {
        lines
            .clone()
            .any(|line| line.starts_with(name) && line.contains("left out: relay"))
    };
    assert!(reason("impact") && reason("timestepping"), "{}", ran.out);
    assert!(
        ran.out.contains("timefreezing fesd radau_iia(2)"),
        "{}",
        ran.out
    );
}
