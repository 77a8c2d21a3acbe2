//! The `nsdc` command as a user meets it: what it prints where, and its exit status.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::terminal::{folder, nsdc, nsdc_with_input};
use insta::assert_snapshot;

const RELAY: &str = "
model relay {
  param k = 1;
  state x = 1;
  output twice = 2*x;
  x' = -k*sign(x);
}
simulate slide of relay {
  horizon 2;
  output x, twice at [0, 0.5, 2];
  expect x at end ~ 0 within 1e-9;
  expect switches ~ [1/k] within 1e-9;
  expect mode at end is sliding(x);
}
simulate fast of relay {
  with { k = 4; }
  horizon 2;
  expect events(enter_sliding, x) ~ [0.25] within 1e-9;
}
";

/// A folder with one file `relay.nsd`.
fn with_relay(test: &str) -> PathBuf {
    let folder = folder(test);
    fs::write(folder.join("relay.nsd"), RELAY).expect("the folder is writable");
    folder
}

fn json(line: &str) -> serde_json::Value {
    serde_json::from_str(line).expect("every line is an object")
}

#[test]
fn shells_complete_the_commands() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let ran = nsdc(&folder("completions"), &["completions", shell]);
        assert_eq!(ran.status, 0, "{}", ran.err);
        assert!(
            ran.out.contains("explain") && ran.out.contains("time-limit"),
            "{shell}"
        );
    }
    assert_eq!(
        nsdc(&folder("completions"), &["completions", "bsh"]).status,
        64
    );
}

#[test]
fn help_names_the_commands() {
    let ran = nsdc(&folder("help"), &["--help"]);
    assert_eq!(ran.status, 0);
    assert_snapshot!(ran.out, @r"
    Compiler for .nsd: nonsmooth dynamical systems as they stand in a paper

    Usage: nsdc [OPTIONS] <COMMAND>

    Commands:
      check        Check models and experiments, and print what is wrong with them
      emit         Print what the compiler makes of a model
      run          Run experiments and report what came out
      test         Run every `expect` of files and folders
      verify       Run or solve experiments by every method and lowering that takes them, and compare
      order        Measure the error of every method over step size and time
      modes        Map the sliding modes of a nonlinear switch over one or two states
      plot         Draw experiments, and what was measured, in one figure
      sweep        Run an experiment at many values of its parameters, on all cores
      solve        Solve AMPL .nl files with complementarity conditions
      fmt          Lay files out in the standard way
      new          Make a folder with a small model, its tests and a README
      watch        Check, run and draw a file again on every save, until Ctrl-C
      lsp          Serve an editor, as a language server at standard input and output
      explain      Explain a diagnostic by its code, or list all codes
      completions  Print what a shell needs to complete commands and options
      help         Print this message or the help of the given subcommand(s)

    Options:
          --color <WHEN>  When messages are coloured [default: auto] [possible values: auto, always,
                          never]
      -h, --help          Print help
      -V, --version       Print version

    Exit status: 0 all well, 1 the model or the input is wrong, 2 the numerics failed or an expectation
    was missed, 64 wrong usage.
    ");
}

#[test]
fn wrong_usage_exits_with_64() {
    let folder = with_relay("usage");
    for args in [
        &[][..],
        &["solve_everything"],
        &["run"],
        &["run", "relay.nsd", "--frobnicate"],
        &["run", "relay.nsd", "--time-limit", "0"],
        &["run", "relay.nsd", "--time-limit", "1e300"],
        &["run", "relay.nsd", "--set", "k"],
        &["run", "relay.nsd", "--plot", "figure.png"],
        &["run", "relay.nsd", "--csv", "values.json"],
        &["run", "relay.nsd", "--json", "relay.nsd"],
        &["check", "relay.nsd", "--json", "relay.nsd"],
        &["verify", "relay.nsd", "--json", "relay.nsd"],
        &["test", "relay.nsd", "--json", "relay.nsd"],
        &["test", "relay.nsd", "--junit", "relay.nsd"],
        &["solve", "relay.nl", "--json", "relay.csv"],
        &["run", "relay.nsd", "--events", "events.SVG"],
        &[
            "sweep",
            "relay.nsd",
            "slide",
            "--over",
            "k=1:2:2",
            "--csv",
            "rows.parquet",
        ],
        &["run", "relay.nsd", "--plot", "-", "--json", "-"],
        &["emit", "relay.nsd", "--ir", "assembly"],
    ] {
        let ran = nsdc(&folder, args);
        assert_eq!((ran.status, ran.out.as_str()), (64, ""), "{args:?}");
        assert!(!ran.err.is_empty(), "{args:?}");
    }
}

#[test]
fn what_is_wrong_with_files_exits_with_1() {
    let folder = with_relay("files");
    fs::write(folder.join("latin.nsd"), b"model caf\xe9 { }").expect("the folder is writable");
    fs::write(
        folder.join("models.nsd"),
        "model m { state x = 1; x' = 1; }",
    )
    .expect("the folder is writable");
    for args in [
        &["run", "missing.nsd"][..],
        &["run", "."],
        &["run", "latin.nsd"],
        &["run", "models.nsd"],
        &["run", "relay.nsd", "slid"],
        &["run", "relay.nsd", "--set", "q=1"],
        &["run", "relay.nsd", "--method", "magic"],
        &["run", "relay.nsd", "--json", "no/such/folder.json"],
        &["check", "missing.nsd"],
        &["test", "missing.nsd"],
        &["emit", "relay.nsd", "--ir", "nl"],
        &["explain", "E9999"],
    ] {
        let ran = nsdc(&folder, args);
        assert_eq!(ran.status, 1, "{args:?}\n{}", ran.err);
        assert!(!ran.err.is_empty() || args[0] == "test", "{args:?}");
    }
}

/// Settings of the command line take the place of those of the experiment, one for one.
#[test]
fn settings_may_be_given_on_the_command_line() {
    let folder = folder("settings");
    let text = "model decay { state x = 1; output y = 2*x; x' = -x; }
        simulate s of decay { horizon 1; tolerance 1e-9; output y every 0.5; }";
    fs::write(folder.join("a.nsd"), text).expect("the folder is writable");
    let csv = |options: &[&str]| {
        let ran = nsdc(
            &folder,
            &[&["run", "a.nsd", "--csv", "-"], options].concat(),
        );
        assert_eq!((ran.status, ran.err.as_str()), (0, ""), "{options:?}");
        let times = ran.out.lines().skip(1).map(|line| line.split(',').next());
        let times: Vec<f64> = times.map(|time| time.unwrap().parse().unwrap()).collect();
        (ran.out.lines().next().unwrap().to_owned(), times)
    };
    assert_eq!(csv(&[]), ("time,y".to_owned(), vec![0.0, 0.5, 1.0]));
    assert_eq!(csv(&["--horizon", "3/2"]).1, [0.0, 0.5, 1.0, 1.5]);
    // The names that are kept stay.
    let (names, times) = csv(&["--every", "1/4"]);
    assert_eq!((&*names, times.len()), ("time,y", 5));
    assert_eq!(csv(&["--tolerance", "1e-4"]).1.len(), 3);
    for (options, what) in [
        (["--horizon", "-1"], "the horizon must be a positive number"),
        (
            ["--tolerance", "5"],
            "the tolerance must be between 0 and 1",
        ),
        (["--every", "0"], "the period must be positive"),
        (["--horizon", "1; runs 3"], "more than one setting"),
        (["--horizon", "1 +"], "--horizon"),
        (
            ["--guess", "a.json"],
            "`guess` is no setting of a simulation",
        ),
    ] {
        let ran = nsdc(&folder, &[&["run", "a.nsd"], &options[..]].concat());
        assert_eq!(ran.status, 1, "{options:?}");
        assert!(ran.err.contains(what), "{}", ran.err);
    }
}

/// A file of a guess is where the command runs, and not beside the model.
#[test]
fn an_optimization_starts_from_a_file_of_the_command_line() {
    let folder = folder("guess");
    let text = "model m { state x = 0; control u in [-1, 1] = 0; x' = u; }
        optimize o of m { horizon 1; intervals 2; minimize final((x - 0.5)^2); }";
    fs::create_dir_all(folder.join("models")).expect("the folder is writable");
    fs::write(folder.join("models/a.nsd"), text).expect("the folder is writable");
    let first = nsdc(
        &folder,
        &["run", "models/a.nsd", "-q", "--json", "first.json"],
    );
    assert_eq!(
        (first.status, first.out.as_str(), first.err.as_str()),
        (0, "", "")
    );
    let again = nsdc(&folder, &["run", "models/a.nsd", "--guess", "first.json"]);
    assert_eq!(again.status, 0, "{}", again.err);
    // Of several runs it is the last one.
    let first = fs::read_to_string(folder.join("first.json")).expect("it was written");
    fs::write(folder.join("runs.json"), format!("[{first}]")).expect("the folder is writable");
    let again = nsdc(&folder, &["run", "models/a.nsd", "--guess", "runs.json"]);
    assert_eq!(again.status, 0, "{}", again.err);
    let missing = nsdc(&folder, &["run", "models/a.nsd", "--guess", "second.json"]);
    assert_eq!(missing.status, 1);
    assert!(missing.err.contains("E0519"), "{}", missing.err);
}

#[test]
fn all_events_are_written_on_request() {
    let folder = folder("events");
    let text = "model ball { state q = 1; state v = 0; q' = v; v' = -2;
          jump floor when q <= 0 and v < 0 { v := -v; } }
        simulate s of ball { horizon 60; }";
    fs::write(folder.join("a.nsd"), text).expect("the folder is writable");
    let ran = nsdc(&folder, &["run", "a.nsd", "--events", "-"]);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""));
    // It falls for 1 and bounces for 2, exactly.
    let mut lines = ran.out.lines();
    assert_eq!(lines.next(), Some("time,kind,surface,from,to"));
    let times = lines.map(|line| line.split(',').take(3).collect::<Vec<_>>());
    let events: Vec<(f64, String)> = times
        .map(|entries| (entries[0].parse().unwrap(), entries[1..].join(" ")))
        .collect();
    assert_eq!(events.len(), 30);
    for (k, (time, what)) in events.iter().enumerate() {
        assert!((time - (2 * k + 1) as f64).abs() < 1e-9, "{time}");
        assert_eq!(what, "jump floor");
    }
}

/// Experiments of one model meet one mistake.
#[test]
fn a_mistake_is_told_once_for_all_tests_of_a_file() {
    let folder = folder("once");
    let text = "model m { state x = 1; x' = -k; }
        simulate a of m { horizon 1; expect x at end ~ 1; }
        simulate b of m { horizon 2; expect x at end ~ 1; }";
    fs::write(folder.join("a.nsd"), text).expect("the folder is writable");
    let ran = nsdc(&folder, &["test", "a.nsd", "--color", "always"]);
    assert_eq!(ran.status, 1);
    assert_eq!(ran.err.matches("unknown name").count(), 1, "{}", ran.err);
    assert!(ran.err.contains('\u{1b}'), "colours are asked for");
    let plain = nsdc(&folder, &["--color", "never", "test", "a.nsd"]);
    assert!(!plain.err.contains('\u{1b}'), "{}", plain.err);
}

#[test]
fn an_experiment_that_is_not_there_gets_a_suggestion() {
    let folder = with_relay("suggestion");
    assert_snapshot!(nsdc(&folder, &["run", "relay.nsd", "slid"]).err, @r"
    error: there is no experiment `slid` in `relay.nsd`
      help: did you mean `slide`?
    ");
    assert_snapshot!(nsdc(&folder, &["run", "relay.nsd", "optimum"]).err, @r"
    error: there is no experiment `optimum` in `relay.nsd`
      help: the file has `slide`, `fast`
    ");
}

#[test]
fn check_says_all_that_is_wrong_and_nothing_else() {
    let folder = with_relay("check");
    let good = nsdc(&folder, &["check", "relay.nsd"]);
    let well = "relay.nsd: no errors in 1 model and 2 experiments\n";
    assert_eq!(
        (good.status, good.out.as_str(), good.err.as_str()),
        (0, well, "")
    );
    // JSON takes its place.
    let json = nsdc(&folder, &["check", "relay.nsd", "--json", "-"]);
    assert_eq!((json.status, json.out.as_str()), (0, ""));

    let bad = RELAY
        .replace("2*x", "2*y")
        .replace("within 1e-9;\n  expect mode", ";\n  expect mode");
    let ran = nsdc_with_input(&folder, &["check", "-"], &bad);
    assert_eq!(ran.status, 1);
    assert!(
        ran.err.contains("E0101") && ran.err.contains("<standard input>"),
        "{}",
        ran.err
    );
}

#[test]
fn a_mistake_in_an_expectation_is_found_without_a_run() {
    let folder = folder("expectation");
    let bad = RELAY.replace(
        "expect switches ~ [1/k] within 1e-9",
        "expect switches ~ [1/k]",
    );
    let ran = nsdc_with_input(&folder, &["check", "-"], &bad);
    assert_eq!(ran.status, 1);
    assert_snapshot!(ran.err, @r"
    E0601

      × `~` without a tolerance
        ╭─[<standard input>:12:3]
     11 │   expect x at end ~ 0 within 1e-9;
     12 │   expect switches ~ [1/k];
        ·   ────────────┬───────────
        ·               ╰── how close is close?
     13 │   expect mode at end is sliding(x);
        ╰────
      help: add an absolute tolerance, as in `within 1e-9`
    ");
}

#[test]
fn run_prints_one_object_per_experiment() {
    let folder = with_relay("json");
    let ran = nsdc(&folder, &["run", "relay.nsd", "--json", "-"]);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""));
    let lines: Vec<_> = ran.out.lines().map(json).collect();
    assert_eq!(lines.len(), 2);
    assert_eq!(lines[0]["experiment"], "slide");
    assert_eq!(lines[0]["status"], "solved");
    assert_eq!(lines[0]["time"], serde_json::json!([0.0, 0.5, 2.0]));
    assert_eq!(lines[0]["final"]["x"], 0.0);
    assert_eq!(lines[1]["experiment"], "fast");
    assert_eq!(lines[1]["events"][0]["kind"], "enter_sliding");
    assert!((lines[1]["events"][0]["time"].as_f64().expect("a number") - 0.25).abs() < 1e-12);
}

#[test]
fn an_object_has_the_parameters_of_its_run() {
    let folder = folder("parameters");
    let text = "model wheel { param r = 1; param rr = r^2; state a = 0; a' = rr; }
        model car {
          param k = 3; param c[2] = [k, 2*k]; param p in [0, 9] = 1; param pp = 2*p;
          state x = 0; control u in [-1, 1] = 0;
          part front = wheel { r = k; }
          x' = pp*u - c[1]*x;
        }
        simulate stands of car { horizon 1; with { c[2] = 7; p = 4; } }
        optimize goes of car { horizon 1; intervals 2; free { p; } minimize final((x - 1)^2) + (p - 5)^2; }";
    fs::write(folder.join("car.nsd"), text).expect("the folder is writable");
    let args = ["run", "car.nsd", "--set", "k=0.5", "--json", "-"];
    let ran = nsdc(&folder, &args);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""));
    let lines: Vec<_> = ran.out.lines().map(json).collect();
    let all = serde_json::json!({
        "k": 0.5, "c": [0.5, 7.0], "p": 4.0, "pp": 8.0, "front.r": 0.5, "front.rr": 0.25,
    });
    assert_eq!(lines[0]["parameters"], all);
    let [free, found] = [&lines[1]["optimum"]["free"], &lines[1]["parameters"]];
    let p = found["p"].as_f64().expect("a number");
    assert_eq!(free["p"], found["p"]);
    assert!((p - 5.0).abs() < 1.0 && found["pp"] == 2.0 * p, "{found}");
}

#[test]
fn run_writes_files_and_still_reports() {
    let folder = with_relay("outputs");
    let args = [
        "run",
        "relay.nsd",
        "--json",
        "r.json",
        "--csv",
        "r.csv",
        "--plot",
        "r.svg",
    ];
    let ran = nsdc(&folder, &args);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""));
    assert!(ran.out.starts_with("slide of relay: solved\n"));
    assert!(
        !ran.out.contains('\u{1b}'),
        "no colours where nobody sees them"
    );
    let text = |name: &str| fs::read_to_string(folder.join(name)).expect("it was written");
    let runs = json(&text("r.json"));
    assert_eq!(runs[1]["experiment"], "fast");
    assert_eq!(runs.as_array().map(Vec::len), Some(2));
    assert_snapshot!(text("r-slide.csv"), @r"
    time,x,twice
    0.0,1.0,2.0
    0.5,0.5,1.0
    2.0,0.0,0.0
    ");
    assert!(text("r-fast.svg").starts_with("<svg"));
}

/// A circle, with an output that bends twice as often, and a ball that bounces.
const CURVES: &str = "
model circle { state x[2] = [1, 0]; output c = x[1]^2; x' = [-x[2], x[1]]; }
model ball { state h = 1; state v = 0; h' = v; v' = -9.81; jump floor when h <= 0 and v < 0 { v := -0.5*v; } }
model pulled { state x = 0; control u in [-1, 1] = 0; state v = 0; x' = v; v' = u; }
model sound { state d[2] = [1e-4, 0]; output p = 101325 + d[1]; d' = [-d[2], d[1]]; }
simulate events of circle { horizon 2*pi; }
simulate swings of sound { horizon 60; output p; }
simulate elements of circle { horizon 2*pi; method fesd; }
simulate adaptive of circle { horizon 2*pi; method adaptive; }
simulate steps of circle { horizon 2*pi; method timestepping { steps = 40; } }
simulate every of circle { horizon 2*pi; output every pi/2; }
simulate bounces of ball { horizon 1; }
simulate stands of ball { horizon 1; lower timefreezing; }
optimize goes of pulled { horizon 2; intervals 4; final { x = 1; v = 0; } minimize integral(u^2); }
";

/// The table of an experiment: its instants and the columns behind them.
fn rows(folder: &Path, experiment: &str) -> Vec<Vec<f64>> {
    let ran = nsdc(folder, &["run", "m.nsd", experiment, "--csv", "-"]);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""), "{experiment}");
    let line = |line: &str| -> Vec<f64> {
        let numbers = line.split(',').map(str::parse);
        numbers.map(|number| number.expect("a number")).collect()
    };
    ran.out.lines().skip(1).map(line).collect()
}

/// By how much straight lines between rows miss functions of time at most.
fn missed(rows: &[Vec<f64>], exact: impl Fn(f64) -> Vec<f64>) -> f64 {
    let mut largest: f64 = 0.0;
    let steps = rows.windows(2).filter(|pair| pair[0][0] < pair[1][0]);
    for pair in steps {
        for share in [0.25, 0.5, 0.75] {
            let mix = |k: usize| pair[0][k] + share * (pair[1][k] - pair[0][k]);
            let values = exact(mix(0));
            let errors = (1..).zip(&values).map(|(k, value)| (mix(k) - value).abs());
            largest = errors.fold(largest, f64::max);
        }
    }
    largest
}

/// Where nothing says when there are rows, straight lines between them are within 1/2000 of the range of the curves, which
/// is 2 for the circle and 1 for its output; steps of time have an error of their own.
#[test]
fn rows_follow_the_curves() {
    let folder = folder("curves");
    fs::write(folder.join("m.nsd"), CURVES).expect("the folder is writable");
    let circle = |t: f64| vec![t.cos(), t.sin(), t.cos().powi(2)];
    for (experiment, own) in [
        ("events", 0.0),
        ("elements", 0.0),
        ("adaptive", 0.0),
        ("steps", 1e-3),
    ] {
        let rows = rows(&folder, experiment);
        let worst = missed(&rows, circle);
        assert!(worst <= 1.1e-3 + own, "{experiment}: {worst}");
        assert!(
            rows.len() > 60 && rows.len() < 400,
            "{experiment}: {}",
            rows.len()
        );
        assert!(
            rows.windows(2).all(|pair| pair[0][0] < pair[1][0]),
            "{experiment}"
        );
    }
    assert_eq!(rows(&folder, "every").len(), 5);

    // The range is 2e-4, however large the values are, and a part of the run is 3.2e-8 from its chord.
    let swings = rows(&folder, "swings");
    let worst = missed(&swings, |t| vec![101_325.0 + 1e-4 * t.cos()]);
    assert!(worst <= 1.35e-7, "{worst}");
    assert!(swings.len() < 1200, "{}", swings.len());

    // It strikes once the height of one metre is fallen, and then after twice half the speed: two rows each time.
    let fall = (2.0_f64 / 9.81).sqrt();
    let ball = |t: f64| match t < fall {
        true => vec![1.0 - 0.5 * 9.81 * t * t, -9.81 * t],
        false => {
            let (s, v) = (t - fall, 0.5 * 9.81 * fall);
            vec![v * s - 0.5 * 9.81 * s * s, v - 9.81 * s]
        }
    };
    for experiment in ["bounces", "stands"] {
        let rows = rows(&folder, experiment);
        let until = rows.iter().position(|row| row[0] > 2.0 * fall - 1e-6);
        let first = &rows[..until.expect("it strikes again")];
        let worst = missed(first, ball);
        assert!(worst <= 1e-3 * 9.81, "{experiment}: {worst}");
        let twice = rows.windows(2).filter(|pair| pair[0][0] == pair[1][0]);
        let twice: Vec<_> = twice.map(|pair| [pair[0][2], pair[1][2]]).collect();
        assert!(twice.len() >= 2, "{experiment}: {twice:?}");
        assert!(
            twice.iter().all(|[v, w]| (w + 0.5 * v).abs() <= 1e-6),
            "{twice:?}"
        );
    }

    // Where u is constant, x is a parabola; u jumps from one to the next.
    let rows = rows(&folder, "goes");
    let instants = |k: usize| {
        rows.iter()
            .filter(move |row| row[0] == 0.5 * k as f64)
            .count()
    };
    assert_eq!([0, 1, 2, 3, 4].map(instants), [1, 2, 2, 2, 1]);
    assert!(rows.len() > 20, "{}", rows.len());
}

/// A file is one document, whatever is in it; lines are for what reads them one by one.
#[test]
fn a_json_file_is_a_document() {
    let folder = with_relay("documents");
    let written = |args: &[&str], name: &str| {
        let ran = nsdc(&folder, &[args, &["--json", name]].concat());
        assert_eq!(ran.status, 0, "{}", ran.err);
        fs::read_to_string(folder.join(name)).expect("it was written")
    };
    let one = json(&written(&["run", "relay.nsd", "slide"], "one.json"));
    assert_eq!(one["experiment"], "slide");
    let lines = written(&["run", "relay.nsd"], "all.jsonl");
    let names = lines.lines().map(|line| json(line)["experiment"].clone());
    assert!(names.eq(["slide", "fast"]));
    // No diagnostics are a list, too.
    let none = json(&written(&["check", "relay.nsd"], "none.json"));
    assert_eq!(none, serde_json::json!([]));
    let rows = json(&written(
        &["sweep", "relay.nsd", "slide", "--over", "k=[2]"],
        "rows.json",
    ));
    assert_eq!(rows[0]["parameters"]["k"], 2.0);
}

#[test]
fn values_are_set_from_outside() {
    let folder = with_relay("set");
    let args = [
        "run",
        "relay.nsd",
        "slide",
        "--set",
        "k=2",
        "--set",
        "x=0.5",
        "--json",
        "-",
    ];
    let ran = nsdc(&folder, &args);
    assert_eq!(ran.status, 0, "{}", ran.err);
    let time = json(&ran.out)["events"][0]["time"]
        .as_f64()
        .expect("a number");
    assert!((time - 0.25).abs() < 1e-12);
}

#[test]
fn a_run_that_fails_exits_with_2_and_says_what_was_reached() {
    let folder = folder("failure");
    let model = "model m { state x = 1; x' = x^2; } simulate blow_up of m { horizon 2; }";
    let ran = nsdc_with_input(&folder, &["run", "-"], model);
    assert_eq!(ran.status, 2, "{}{}", ran.out, ran.err);
    assert!(ran.out.starts_with("blow_up of m: "), "{}", ran.out);
    assert!(ran.out.contains("reached, time = "), "{}", ran.out);

    let ran = nsdc_with_input(&folder, &["run", "-", "--csv", "-"], model);
    assert_eq!(ran.status, 2);
    assert!(ran.out.starts_with("time,x\n"), "{}", ran.out);
    assert!(ran.err.starts_with("E0706\n"), "{}", ran.err);
    assert!(ran.err.contains(":1:24]"), "{}", ran.err);
    assert!(ran.err.contains("\nW0702\n"), "{}", ran.err);
}

#[test]
fn test_counts_what_holds_and_what_does_not() {
    let folder = with_relay("test");
    fs::create_dir(folder.join("below")).expect("the folder is writable");
    fs::write(
        folder.join("below/more.nsd"),
        RELAY
            .replace("~ 0 within", "~ 1 within")
            .replace("= 4", "= 5")
            + "simulate later of relay { horizon 1; perturb every 0.1 by gauss(1) seed 1; method adaptive; }",
    )
    .expect("the folder is writable");
    fs::write(
        folder.join("wrong.nsd"),
        "expect error E0101;\nmodel m { state x = 1; x' = y; }",
    )
    .expect("the folder is writable");
    let ran = nsdc(&folder, &["test", "."]);
    assert_eq!(ran.status, 2);
    let out = ran.out.replace('\\', "/");
    assert_snapshot!(out, @r"
    FAILED  ./below/more.nsd: slide
              expect x at end ~ 1 within 1e-9
                expected 1 within 1e-9
                got      0, off by 1
    FAILED  ./below/more.nsd: fast
              expect events(enter_sliding, x) ~ [0.25] within 1e-9
                expected 0.25 within 1e-9
                got      0.2, off by 0.05
    --      ./below/more.nsd: later: not yet supported (E0923)
    ok      ./relay.nsd: slide
    ok      ./relay.nsd: fast
    ok      ./wrong.nsd: expect error E0101

    3 passed, 2 failed, 1 not yet supported
    ");
    let good = nsdc(&folder, &["test", "relay.nsd", "wrong.nsd"]);
    assert_eq!(good.status, 0);
}

#[test]
fn what_is_not_supported_yet_fails_no_test() {
    let folder = folder("unsupported");
    let model = "model m { state x = 1; x' = 0; } simulate o of m { horizon 1; perturb every 0.1 by gauss(1); method adaptive; }";
    fs::write(folder.join("o.nsd"), model).expect("the folder is writable");
    let ran = nsdc(&folder, &["test", "o.nsd"]);
    assert_eq!(ran.status, 0);
    assert!(
        ran.out.contains("0 passed, 0 failed, 1 not yet supported"),
        "{}",
        ran.out
    );
    // A run of it is another matter.
    assert_eq!(nsdc(&folder, &["run", "o.nsd"]).status, 1);
}

#[test]
fn emit_refuses_what_is_too_large() {
    let folder = folder("large");
    let model = "model m { state x = 1; x' = -sign(x); }
      simulate read of m { horizon 1; method fesd { steps = 1000; } }
      simulate written of m { horizon 1; method fesd { steps = 30000; scheme = radau_iia(3); } }
      simulate built of m { horizon 1; method fesd { steps = 100000000; } }";
    fs::write(folder.join("m.nsd"), model).expect("the folder is writable");
    let refused = |experiment, ir| nsdc(&folder, &["emit", "m.nsd", experiment, "--ir", ir]).err;
    assert_snapshot!(refused("read", "mpcc"), @"
    error: the program has 114000 rows, too many to be read
      help: `--ir fesd` prints one line for all rows of a kind
    ");
    assert_snapshot!(refused("written", "nl"), @"
    error: the program has 2220000 rows, too many for one file
      help: `--ir fesd` prints one line for all rows of a kind
    ");
    assert_snapshot!(refused("built", "fesd"), @"
    error: the discretized system has about 3e10 arguments, more than 2e7
      help: take fewer steps or elements, or add up pairs with `cross = sum_both`
    ");
    let args = ["emit", "m.nsd", "--ir", "nl"];
    assert_snapshot!(nsdc(&folder, &args).err, @"
    error: an AMPL file holds one program
      help: name the experiment behind the file
    ");
}

#[test]
fn emit_prints_every_form() {
    let folder = with_relay("emit");
    for ir in [
        "ast", "model", "system", "dcs", "tex", "dot", "fesd", "mpcc", "nl",
    ] {
        let ran = nsdc(&folder, &["emit", "relay.nsd", "slide", "--ir", ir]);
        assert_eq!((ran.status, ran.err.as_str()), (0, ""), "{ir}");
        assert!(!ran.out.trim().is_empty(), "{ir}");
    }
    let args = [
        "emit",
        "relay.nsd",
        "slide",
        "--ir",
        "dcs",
        "--lower",
        "step",
    ];
    assert_snapshot!(nsdc(&folder, &args).out, @r"
    // step: asked for by `lower`
    der(x) = -k*(2*alpha[x] - 1)
    0 = x - lambda_p[x] + lambda_n[x]
    0 <= lambda_n[x] perp alpha[x] >= 0
    0 <= lambda_p[x] perp 1 - alpha[x] >= 0
    ");
}

#[test]
fn emit_of_discretized_forms_refuses_data() {
    let folder = folder("data");
    fs::write(folder.join("data.csv"), "t,r\n0,0\n1,1\n").expect("the folder is writable");
    let model = "model m { signal r = table(\"data.csv\", \"r\"); state x = 1; x' = r - sign(x); }
      simulate s of m { horizon 1; }";
    fs::write(folder.join("m.nsd"), model).expect("the folder is writable");
    let emit = |ir| nsdc(&folder, &["emit", "m.nsd", "--ir", ir]);
    assert_eq!(emit("dcs").status, 0);
    for ir in ["fesd", "mpcc", "nl"] {
        let ran = emit(ir);
        assert_eq!((ran.status, ran.out.as_str()), (1, ""), "{ir}");
        assert!(
            ran.err.contains("E0522") && ran.err.contains("`r`"),
            "{}",
            ran.err
        );
    }
}

#[test]
fn fmt_lays_out_and_check_only_looks() {
    let folder = folder("fmt");
    let ugly = "model m{state x=1;x'=-x;}";
    fs::write(folder.join("m.nsd"), ugly).expect("the folder is writable");
    let read = || fs::read_to_string(folder.join("m.nsd")).expect("it is there");

    let checked = nsdc(&folder, &["fmt", "--check", "m.nsd"]);
    assert_eq!((checked.status, checked.out.as_str()), (1, "m.nsd\n"));
    assert_eq!(read(), ugly);
    assert_eq!(nsdc(&folder, &["fmt", "."]).status, 0);
    assert_ne!(read(), ugly);
    assert_eq!(nsdc(&folder, &["fmt", "--check", "m.nsd"]).status, 0);
    assert_eq!(nsdc_with_input(&folder, &["fmt", "-"], ugly).out, read());

    let broken = "model m { state x = ; }";
    let ran = nsdc_with_input(&folder, &["fmt", "-"], broken);
    assert_eq!((ran.status, ran.out.as_str()), (1, ""));
    assert!(ran.err.contains("E00"), "{}", ran.err);
}

#[test]
fn explain_prints_a_page_or_lists_all() {
    let folder = folder("explain");
    let page = nsdc(&folder, &["explain", "e0601"]);
    assert_eq!(page.status, 0);
    assert!(page.out.starts_with("# E0601: "));
    let all = nsdc(&folder, &["explain"]);
    assert_eq!(all.status, 0);
    assert!(all.out.contains("E0601  "));
}

#[test]
fn a_reader_that_stops_is_no_error() {
    let folder = with_relay("pipe");
    let mut child = Command::new(env!("CARGO_BIN_EXE_nsdc"))
        .args(["run", "relay.nsd", "--json", "-"])
        .current_dir(&folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("the command ends");
    assert_eq!(output.status.code(), Some(0));
    assert!(
        output.stderr.is_empty(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn the_time_is_told_apart_from_results() {
    let folder = with_relay("time");
    let ran = nsdc(
        &folder,
        &["run", "relay.nsd", "slide", "--time", "--csv", "-"],
    );
    assert_eq!(ran.status, 0);
    assert!(ran.out.starts_with("time,x,twice\n"));
    for phase in [
        "read", "parse", "model", "system", "solve", "report", "total",
    ] {
        assert!(
            ran.err.contains(phase),
            "{phase} is missing in\n{}",
            ran.err
        );
    }
}

#[test]
fn a_file_that_cannot_be_written_has_a_code() {
    let folder = with_relay("unwritable");
    fs::create_dir(folder.join("taken.svg")).expect("the folder is writable");
    let mut before: Vec<_> = fs::read_dir(&folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    before.sort();
    for args in [
        &["run", "relay.nsd", "--csv", "no/such.csv"][..],
        &[
            "run",
            "relay.nsd",
            "--csv",
            "a.csv",
            "--json",
            "no/such.json",
        ],
        &["run", "relay.nsd", "slide", "--plot", "taken.svg"],
        &[
            "emit",
            "relay.nsd",
            "--ir",
            "ast",
            "--output",
            "no/such.txt",
        ],
        &["check", "relay.nsd", "--json", "no/such.json"],
        &["test", "relay.nsd", "--junit", "no/such.xml"],
        &["verify", "relay.nsd", "slide", "--json", "no/such.json"],
        &[
            "sweep",
            "relay.nsd",
            "slide",
            "--over",
            "k=1:2:2",
            "--csv",
            "no/such.csv",
        ],
    ] {
        let ran = nsdc(&folder, args);
        assert_eq!(ran.status, 1, "{args:?}: {}", ran.err);
        assert!(ran.err.starts_with("E0814\n"), "{args:?}: {}", ran.err);
        let mut after: Vec<_> = fs::read_dir(&folder)
            .unwrap()
            .map(|e| e.unwrap().path())
            .collect();
        after.sort();
        assert_eq!(before, after, "{args:?}");
    }
    assert_snapshot!(nsdc(&folder, &["run", "relay.nsd", "--csv", "no/such.csv"]).err, @"
    E0814

      × cannot write `no/such.csv`: there is no such file or folder
      help: name a file in a folder that is there and may be written to
    ");
}
