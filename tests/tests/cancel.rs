//! Runs end soon after they are canceled, wherever they are: what they still do is counted in operations on numbers.

use std::fs;
use std::path::Path;

use nsdc::limit::work::{self, Counts};
use nsdc::limit::{Cancel, Limit};
use nsdc::report::{Status, Trajectory};
use nsdc::{Options, Project};

/// Operations that take less than 50 ms: a step of a tape takes 10 ns at most, one of a factorization less.
const MOST: u64 = 5_000_000;

/// After how many operations runs are canceled.
const AFTER: [u64; 6] = [0, 3_000, 100_000, 1_000_000, 10_000_000, 30_000_000];

/// A run that is canceled after so many operations, and what was counted.
fn canceled(project: &Project, experiment: &str, after: u64) -> (Trajectory, Counts) {
    let cancel = Cancel::default();
    let limit = Limit::default().canceled_by(&cancel);
    let options = Options {
        limit,
        ..Options::default()
    };
    work::restart(Some((after, cancel)));
    let run = project.run(experiment, &options, &mut ());
    let counts = work::restart(None).expect("tests are development builds");
    (run.expect("it compiles").trajectory, counts)
}

/// What is wrong with the ways in which an experiment ends when it is canceled.
fn wrong(project: &Project, experiment: &str) -> Vec<String> {
    let mut wrong = Vec::new();
    for after in AFTER {
        let (run, counts) = canceled(project, experiment, after);
        let behind = counts.total.saturating_sub(after);
        // What had been solved before is, and so is what is known to be feasible.
        let is_told = match run.status {
            Status::Canceled => run.failure.is_some(),
            Status::Solved | Status::Feasible => true,
            _ => false,
        };
        if !is_told || behind > MOST || counts.most > MOST {
            wrong.push(format!(
                "{experiment}, canceled after {after}: {}, {behind} later; {} between looks",
                run.status.as_str(),
                counts.most
            ));
        }
        if behind == 0 {
            break;
        }
    }
    wrong
}

#[test]
fn examples_end_soon_wherever_they_are_canceled() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    let files = fs::read_dir(folder).expect("the examples are there");
    let paths = files.filter_map(|file| Some(file.ok()?.path()));
    let models = paths.filter(|path| path.extension().is_some_and(|kind| kind == "nsd"));
    let found = models.flat_map(|path| {
        let project = Project::load(&path).expect("it is there");
        let names = project.experiments().map(|one| one.name.name.clone());
        let names: Vec<String> = names.collect();
        let wrong = names.iter().flat_map(|name| wrong(&project, name));
        wrong.collect::<Vec<String>>()
    });
    let found: Vec<String> = found.collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// What ends in the run that shows the error of the one before has no estimate, and says so.
#[test]
fn a_run_without_its_estimate_says_so() {
    let text = "model m { state x[2] = [1, 0]; x' = [x[2], -x[1] - 0.2*sign(x[2])]; }
        simulate s of m { horizon 20; }";
    let project = Project::from_text("m.nsd", text);
    let mut after = 1_000;
    let mut told = 0;
    loop {
        let (run, _) = canceled(&project, "s", after);
        let has_estimate = run.quality.error_estimate.is_some();
        if run.status == Status::Solved && has_estimate {
            break;
        }
        let says_so = run.warnings.iter().any(|warning| warning.code == "W0738");
        assert_eq!(says_so, run.status == Status::Solved, "after {after}");
        told += usize::from(says_so);
        after += after / 10;
    }
    assert!(told > 0);
}

/// Seeds that have not begun end at once, too, on whatever thread.
#[test]
fn all_runs_of_an_ensemble_end() {
    let text = "model decay { state x = 1; x' = -x; }
        simulate s of decay { horizon 1; perturb every 0.1 by sphere(1e-3) seed 1; runs 50; }";
    let project = Project::from_text("decay.nsd", text);
    let failed = |cancels: bool| {
        let cancel = Cancel::default();
        if cancels {
            cancel.cancel();
        }
        let options = Options {
            limit: Limit::default().canceled_by(&cancel),
            ..Options::default()
        };
        let run = project.run("s", &options, &mut ()).expect("it compiles");
        let ensemble = run.trajectory.several.ensemble.expect("it has seeds");
        (run.trajectory.status, ensemble.failed_seeds.len())
    };
    assert_eq!(failed(false), (Status::Solved, 0));
    assert_eq!(failed(true), (Status::Canceled, 50));
}

/// Starts are counted, too: one that is not canceled in the middle would go on for long.
#[test]
fn starts_end_soon() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/sliding_ocp.nsd");
    let project = Project::load(path).expect("it is there");
    let (whole, _) = canceled(&project, "reach", u64::MAX);
    assert_eq!(whole.status, Status::Solved);
    let (run, counts) = canceled(&project, "reach", 20_000);
    assert_eq!(run.status, Status::Canceled);
    assert!(counts.total < 20_000 + MOST, "{}", counts.total);
}
