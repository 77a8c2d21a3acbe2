//! `nsdc sweep`: rows, their order, what fails, and files that are replaced whole.

use std::fs;
use std::path::{Path, PathBuf};

use insta::assert_snapshot;

use crate::terminal::{Ran, folder, nsdc};

/// x(1) = a exp(-k), and with k above 5 the parameter is out of its range.
const DECAY: &str = "
model decay { param k in [0, 5] = 1; state x = 1; x' = -k*x; }
simulate falls of decay { horizon 1; }
";

fn with_decay(test: &str) -> PathBuf {
    let folder = folder(test);
    fs::write(folder.join("decay.nsd"), DECAY).expect("the folder is writable");
    folder
}

fn sweep(folder: &Path, args: &[&str]) -> Ran {
    nsdc(folder, &[&["sweep", "decay.nsd"], args].concat())
}

/// Numbers of the columns of a CSV, by name.
fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().expect("there is a header");
    let at = header.iter().position(|word| *word == name);
    let at = at.expect("the column is there");
    lines
        .map(|line| line[at].parse().expect("a number"))
        .collect()
}

#[test]
fn a_row_for_each_run_in_the_order_of_the_grid() {
    let folder = with_decay("sweep_rows");
    let axes = ["--over", "k=0:2:5", "--over", "x=[1,-3]", "--csv", "-"];
    let ran = sweep(&folder, &axes);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""));
    let [k, start, end] = ["k", "x", "x at end"].map(|name| column(&ran.out, name));
    assert_eq!(k, [0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.5, 1.5, 2.0, 2.0]);
    assert_eq!(start, [1.0, -3.0].repeat(5));
    for (row, end) in end.iter().enumerate() {
        let exact = start[row] * (-k[row]).exp();
        assert!((end - exact).abs() <= 1e-7, "{end} for {exact}");
    }
    // The number of threads changes nothing.
    for jobs in ["1", "2", "7"] {
        let again = sweep(&folder, &[&axes[..], &["--jobs", jobs]].concat());
        assert_eq!(again.out, ran.out);
    }
}

/// x(1) = exp(-k) is above 1/2 for k < 0.69, and x(1/2) above 1/2 for k < 1.38.
#[test]
fn expectations_that_do_not_hold_are_counted() {
    let folder = folder("sweep_expectations");
    let text = DECAY.replace(
        "horizon 1;",
        "horizon 1; expect x at end >= 0.5; expect x at 0.5 >= 0.5; expect lowering golden;",
    );
    fs::write(folder.join("decay.nsd"), text).expect("the folder is writable");
    let ran = sweep(&folder, &["--over", "k=[0,0.5,1,2,6]", "--csv", "-"]);
    assert_eq!(ran.status, 2, "{}", ran.err);
    let missed: Vec<&str> = (ran.out.lines())
        .filter_map(|line| line.rsplit(',').next())
        .collect();
    // Above 5 there is no run.
    assert_eq!(missed, ["missed", "0", "0", "1", "2", ""]);
}

/// x(t) = exp(-b t) with b = 2 k, and b/k = 2: what follows from what is swept follows in expectations, which are about all
/// that is reported.
#[test]
fn expectations_follow_what_is_swept() {
    let folder = folder("sweep_expectations_follow");
    let text = "model decay { param k = 1; param b = 2*k; state x = 1; x' = -b*x; }
        simulate falls of decay {
          horizon 1; output x every 0.25;
          expect x at 1/b ~ exp(-1) within b*1e-6;
          expect x always <= 0.9;
        }";
    fs::write(folder.join("decay.nsd"), text).expect("the folder is writable");
    let ran = sweep(&folder, &["--over", "k=[0.7,1,1.3]", "--csv", "-"]);
    assert_eq!((ran.status, ran.err.as_str()), (0, ""));
    // It starts at 1.
    assert_eq!(column(&ran.out, "missed"), [1.0; 3]);
    fs::write(
        folder.join("decay.nsd"),
        text.replace("x always", "y always"),
    )
    .expect("it is");
    let ran = sweep(&folder, &["--over", "k=[0.7,1,1.3]", "--csv", "-"]);
    assert_eq!((ran.status, ran.out.as_str()), (1, ""));
    assert!(ran.err.contains("E0101"), "{}", ran.err);
}

/// A first point without a run is a row like others.
#[test]
fn a_first_point_that_is_refused_is_a_row() {
    let folder = folder("sweep_first");
    let text = DECAY.replace("= 1; state", "= 6; state");
    fs::write(folder.join("decay.nsd"), text).expect("the folder is writable");
    let ran = sweep(&folder, &["--over", "k=[6,1,2]", "--csv", "-"]);
    assert_eq!(ran.status, 2, "{}", ran.err);
    assert!(
        ran.out.contains("not_compiled,E0504") && ran.out.contains("2.0,solved"),
        "{}",
        ran.out
    );
}

#[test]
fn side_by_side() {
    let folder = with_decay("sweep_zip");
    let ran = sweep(
        &folder,
        &["--over", "k=[1,2]", "--over", "x=[1,2]", "--zip"],
    );
    assert_snapshot!(ran.out, @r"
      k  x  status  x at end  events  code
      1  1  solved  0.367879  0
      2  2  solved  0.270671  0

      2 of 2 runs, 2 solved
    ");
    assert_eq!(ran.status, 0, "{}", ran.err);
}

#[test]
fn a_run_that_fails_is_a_row_with_its_code() {
    let folder = with_decay("sweep_fails");
    let ran = sweep(&folder, &["--over", "k=[1,7]", "--json", "-"]);
    assert_eq!((ran.status, ran.err.as_str()), (2, ""));
    let rows: Vec<serde_json::Value> = (ran.out.lines())
        .map(|line| serde_json::from_str(line).expect("every line is an object"))
        .collect();
    assert_eq!(rows[0]["status"], "solved");
    assert_eq!(rows[0]["parameters"]["k"], 1.0);
    let end = rows[0]["end"]["x"].as_f64().expect("a number");
    assert!((end - (-1.0_f64).exp()).abs() <= 1e-8);
    assert_eq!(rows[1]["status"], "not_compiled");
    assert_eq!(rows[1]["code"], "E0504");
    // Wherever it stands; and where no value is right, that is told with its place.
    let first = sweep(&folder, &["--over", "k=[7,1]", "--csv", "-"]);
    assert_eq!((first.status, first.err.as_str()), (2, ""));
    assert!(
        first.out.contains("7.0,not_compiled,E0504,"),
        "{}",
        first.out
    );
    let all = sweep(&folder, &["--over", "k=[7,8]", "--csv", "all.csv"]);
    assert_eq!((all.status, all.out.as_str()), (1, ""));
    assert!(
        all.err.contains("E0504") && all.err.contains("k=7.0"),
        "{}",
        all.err
    );
    assert!(!folder.join("all.csv").exists());
}

/// x' = x² from 1 is infinite at t = 1: there is no end, and none is told.
#[test]
fn a_run_that_does_not_reach_its_end_has_none() {
    let folder = folder("sweep_no_end");
    let text =
        "model m { param k = 1; state x = 1; x' = k*x^2; }\nsimulate s of m { horizon 2; }\n";
    fs::write(folder.join("decay.nsd"), text).expect("the folder is writable");
    let ran = sweep(&folder, &["--over", "k=[0.1,1]", "--csv", "-"]);
    assert_eq!(ran.status, 2, "{}", ran.err);
    let lines: Vec<Vec<&str>> = ran
        .out
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    assert!((lines[1][3].parse::<f64>().expect("a number") - 1.25).abs() <= 1e-7);
    assert_ne!(lines[2][1], "solved");
    assert!(lines[2][2].starts_with('E'), "{}", ran.out);
    assert_eq!(lines[2][3], "", "{}", ran.out);
}

#[test]
fn what_is_no_sweep_is_refused() {
    let folder = with_decay("sweep_refused");
    let axes = ["--over", "k=[1]", "--over", "x=[1]", "--over", "z=[1]"];
    let (three, two) = ([&axes[..], &["--plot", "f.svg"]].concat(), &axes[..2]);
    let wrong: [(&[&str], i32, &str); 12] = [
        (&["--over", "k=[]"], 64, "E0811"),
        (&["--over", "k=1:nan:3"], 64, "E0811"),
        (&["--over", "k=[1]", "--over", "k=[2]"], 64, "E0811"),
        (&["--over", "k=0:1:1e12"], 64, "E0812"),
        (
            &["--over", "k=[1,2]", "--over", "x=[1]", "--zip"],
            64,
            "E0813",
        ),
        (&["--over", "kk=[1,2]"], 1, "E0101"),
        (
            &["falling", "--over", "k=[1,2]"],
            1,
            "did you mean `falls`?",
        ),
        (
            &["--over", "k=[1,2]", "--csv", "nowhere/k.csv"],
            1,
            "cannot write",
        ),
        (&three, 64, "one axis or two"),
        (
            &[two, &["--csv", "-", "--json", "-"]].concat(),
            64,
            "only one of",
        ),
        (
            &[two, &["--plot", "f.png"]].concat(),
            64,
            "must end in `.svg`",
        ),
        (&[two, &["--json", "."]].concat(), 1, "it is a folder"),
    ];
    for (args, status, says) in wrong {
        let ran = sweep(&folder, args);
        assert_eq!(ran.status, status, "{args:?} {}", ran.err);
        assert!(ran.err.contains(says), "{args:?} {}", ran.err);
    }
}

#[test]
fn files_are_replaced_whole() {
    let folder = with_decay("sweep_files");
    let path = folder.join("k.csv");
    fs::write(&path, "what was there before").expect("the folder is writable");
    let ran = sweep(
        &folder,
        &["--over", "k=0:1:3", "--csv", "k.csv", "--plot", "k.svg"],
    );
    assert_eq!((ran.status, ran.err.as_str()), (0, ""));
    let text = fs::read_to_string(&path).expect("it is there");
    assert_eq!(text.lines().count(), 4);
    let figure = fs::read_to_string(folder.join("k.svg")).expect("it is there");
    assert!(figure.starts_with("<svg"));
    // Nothing is left beside them.
    let mut names: Vec<String> = (fs::read_dir(&folder).expect("it is there"))
        .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
        .collect();
    names.sort();
    assert_eq!(names, ["decay.nsd", "k.csv", "k.svg"]);
}

/// Models, an axis of values each, and what is told of every point: a run of its own.
const POINTS: [(&str, &str, &[f64]); 22] = [
    // Slides on x = 0, or crosses it.
    (
        "model m { param k = 1; state x = 1; output y = k*x; x' = -sign(x) + k*sin(4*time); }
         simulate run of m { horizon 3; }",
        "k",
        &[0.5, 1.5, 0.0, -2.0],
    ),
    // Computed from it: an initial value, another parameter, a restitution.
    (
        "model m { param h in [0.5, 4] = 1; param e = 0.2*h; state q = h; state v = 0; q' = v; v' = -9.81;
           jump floor when q <= 0 and v < 0 { v := -e*v; } }
         simulate run of m { horizon 1; }",
        "h",
        &[0.5, 2.0, 4.5, 3.0],
    ),
    // Leaves its bounds, starts outside of them.
    (
        "model m { param a = 1; state x in [-0.9, 0.9] = 0; state y = 1; x' = a*y; y' = -a*x; }
         simulate run of m { horizon 2; }",
        "a",
        &[0.3, 1.0],
    ),
    (
        "model m { state x in [-0.9, 0.9] = 0; x' = -x; } simulate run of m { horizon 1; }",
        "x",
        &[0.5, 2.0],
    ),
    // Bounds that it moves, of a state and of an input; a set that it moves.
    (
        "model m { param k = 1; state x in [-k, k] = 0; x' = 1; } simulate run of m { horizon 2; }",
        "k",
        &[1.0, 3.0, 0.5],
    ),
    (
        "model m { param k = 3; param q = 2*k; input u in [-q, q] = 4; state x = 0; x' = u; }
         simulate run of m { horizon 2; }",
        "k",
        &[3.0, 1.0],
    ),
    (
        "model m { param k = 1; input u in {0, k} = 1; state x = 0; x' = u; } simulate run of m { horizon 2; }",
        "k",
        &[1.0, 2.0],
    ),
    // Decides which solution of an equation is found.
    (
        "model m { param c = 1; state x = 1; algebraic z = 0.9; 0 = z^3 - c*z; x' = z; }
         simulate run of m { horizon 1; }",
        "c",
        &[1.0, 4.0],
    ),
    // Starts below the floor.
    (
        "model m { state q = 1; state v = 0; q' = v;
           mechanics q, v { mass = 1; force = -10; contact floor { gap = q; restitution = 0.5; } } }
         simulate run of m { horizon 0.7; }",
        "q",
        &[1.0, -1.0, 0.25],
    ),
    // Starts on the side of its memory that its thresholds allow.
    (
        "model m { param w = 2; state x = 0; switch s = hysteresis(x, on = -1, off = 1, start = 1); x' = w*(2*s - 1); }
         simulate run of m { horizon 4; }",
        "x",
        &[0.0, 3.0, -3.0],
    ),
    // Between its thresholds with and without a start; what it watches, and one that watches another.
    (
        "model m { param k = 1; state x = 19; switch on = hysteresis(x, on = 18, off = 20, start = 1); x' = 9*k*on - x/2; }
         simulate run of m { horizon 4; }",
        "k",
        &[2.0, 1.0, 5.0, -1.0],
    ),
    (
        "model m { state x = 21; switch on = hysteresis(x, on = 18, off = 20); x' = 15*on - x/2; }
         simulate run of m { horizon 4; }",
        "x",
        &[19.0, 20.0, 17.0, 25.0],
    ),
    (
        "model m { param w = 1; state x = 0; switch s = hysteresis(w*x + time - 2, on = 1, off = -1, start = 0);
           switch r = hysteresis(x - 3*s, on = 2, off = -2, start = 1); x' = 1 - 2*s + r; }
         simulate run of m { horizon 4; }",
        "w",
        &[0.5, 1.0, 2.0],
    ),
    // In a period, whose steps are data of a run: where they meet what switches, and the end.
    (
        "model m { param k = 1.053; state x = 1; x' = -x + floor(2*time) - 0.3*sign(x - mod(time, k + 1)); }
         simulate run of m { horizon 2; }",
        "k",
        &[0.5, 1.0, 0.053, 0.7],
    ),
    (
        "model m { param k = 0.5; state y = 0; y' = sign(mod(time, k + 1) - 0.25) + sign(sawtooth(time, k) - 0.5); }
         simulate run of m { horizon 1.5; }",
        "k",
        &[0.5, 0.75, 0.4, 1.0],
    ),
    // Guessed from what is swept; complementary; the solution of a convex program.
    (
        "model m { param c = 1; state x = 1; algebraic z = 0.9*c; 0 = z^3 + c*z - 2*c*x; x' = -z*sign(x - 0.5); }
         simulate run of m { horizon 1; }",
        "c",
        &[1.0, 4.0, 0.3],
    ),
    (
        "model m { param k = 1; state x = 1; algebraic a = 0; 0 <= a perp a + k*x - sin(3*time) >= 0; x' = a - x; }
         simulate run of m { horizon 3; }",
        "k",
        &[1.0, 0.2, -1.0],
    ),
    (
        "model m { param k = 1; state x = 2; z in argmin 0.5*(z - k*x)^2 subject to { 1 - z >= 0; } x' = -z; }
         simulate run of m { horizon 1; }",
        "k",
        &[1.0, 3.0],
    ),
    // Fails on the way, and in an exponent.
    (
        "model m { param k = 1; state x = 1; x' = k*x^2; } simulate run of m { horizon 1; }",
        "k",
        &[0.5, 2.0],
    ),
    (
        "model m { param p = 2; state x = 1; x' = -x^p; } simulate run of m { horizon 1; }",
        "p",
        &[1.0, 2.0, 3.0],
    ),
    (
        "model m { param p = 1; state x = 1; control u in [-p, 9]; output y = p*x; x' = u + sign(x); }
         optimize run of m { horizon 2; intervals 2; minimize integral(p*u^2) + final((x - p)^2); }",
        "p",
        &[0.5, 2.0, 1.0],
    ),
    (
        "model m { state x = 1; control u in [-9, 9]; x' = u + sign(x); }
         optimize run of m { horizon 2; intervals 2; minimize integral(u^2) + final(x^2); }",
        "x",
        &[0.5, -1.0, 0.25],
    ),
];

#[test]
fn a_point_is_a_run() {
    for (at, (text, name, values)) in POINTS.iter().enumerate() {
        let folder = folder(&format!("sweep_points_{at}"));
        fs::write(folder.join("m.nsd"), text).expect("the folder is writable");
        let listed = values.iter().map(f64::to_string).collect::<Vec<_>>();
        let axis = format!("{name}=[{}]", listed.join(","));
        let swept = nsdc(&folder, &["sweep", "m.nsd", "--over", &axis, "--json", "-"]);
        assert_eq!(swept.err, "", "{text}");
        assert_eq!(swept.out.lines().count(), values.len(), "{text}");
        for (line, value) in swept.out.lines().zip(&listed) {
            let row: serde_json::Value = serde_json::from_str(line).expect("an object");
            let set = format!("{name}={value}");
            let ran = nsdc(&folder, &["run", "m.nsd", "--set", &set, "--json", "-"]);
            let run: Option<serde_json::Value> = serde_json::from_str(&ran.out).ok();
            let Some(run) = run else {
                let code = row["code"].as_str().expect("it is refused");
                assert!(ran.err.contains(code), "{row} {}", ran.err);
                continue;
            };
            assert_eq!(row["status"], run["status"], "{text} {value}");
            let events = run["events"].as_array().expect("a list").len();
            assert_eq!(row["events"], events, "{text} {value}");
            // What has ended a run early is told last.
            let told = run["warnings"].as_array().expect("a list");
            let told = match run["status"] == "solved" {
                true => told.first(),
                false => told.last(),
            };
            assert_eq!(
                row["code"].as_str(),
                told.and_then(|warning| warning["code"].as_str()),
                "{text} {value}"
            );
            let ends = row["end"].as_object().expect("values by their names");
            assert_eq!(ends.is_empty(), row["status"] != "solved", "{text} {value}");
            for (name, end) in ends {
                let both = [&run["states"][name], &run["outputs"][name]];
                let series = both.into_iter().find_map(|series| series.as_array());
                let last = series.and_then(|series| series.last()?.as_f64());
                let (last, end) = (last.expect("a number"), end.as_f64().expect("a number"));
                assert!(
                    (last - end).abs() <= 1e-8 * last.abs().max(1.0),
                    "{text} {value}: {end} for {last}"
                );
            }
        }
    }
}

#[test]
#[cfg(not(feature = "parquet"))]
fn parquet_is_told_to_be_missing() {
    let folder = with_decay("sweep_parquet");
    let ran = sweep(&folder, &["--over", "k=[1,2]", "--parquet", "rows.parquet"]);
    assert_eq!(ran.status, 64, "{}", ran.err);
    assert_snapshot!(ran.err, @r"
    error: this nsdc writes no Parquet
      help: build it with `--features parquet`, or write `--csv`
    ");
}

/// Waits until a process takes SIGINT itself.
#[cfg(target_os = "linux")]
fn listens(id: u32) -> bool {
    let status = fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    let caught = caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    caught.is_some_and(|mask| mask & 0b10 != 0)
}

/// What has been run when the user interrupts it is written, and nothing else.
#[test]
#[cfg(target_os = "linux")]
fn an_interrupted_sweep_keeps_its_rows() {
    use std::process::{Command, Stdio};

    let folder = with_decay("sweep_interrupted");
    let mut child = Command::new(env!("CARGO_BIN_EXE_nsdc"))
        .current_dir(&folder)
        .args([
            "sweep",
            "decay.nsd",
            "--over",
            "k=0.1:5:200000",
            "--csv",
            "rows.csv",
        ])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("it starts");
    while !listens(child.id()) {
        assert!(
            child.try_wait().expect("it is there").is_none(),
            "it has ended by itself"
        );
        std::thread::yield_now();
    }
    // Some of so many points have been run by then.
    std::thread::sleep(std::time::Duration::from_millis(300));
    let told = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(told.expect("it is told").success());
    let status = child.wait().expect("it ends");
    // Not all points were solved.
    assert_eq!(status.code(), Some(2));
    let rows = fs::read_to_string(folder.join("rows.csv")).expect("it is written");
    assert!(rows.starts_with("k,status,code,") && rows.ends_with('\n'));
    let count = rows.lines().skip(1).count();
    assert!(0 < count && count < 200_000, "{count}");
    for line in rows.lines().skip(1) {
        assert!(line.contains(",solved,"), "{line}");
    }
}
