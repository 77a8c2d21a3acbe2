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
}

#[test]
fn what_is_no_sweep_is_refused() {
    let folder = with_decay("sweep_refused");
    let wrong: [(&[&str], i32, &str); 8] = [
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
