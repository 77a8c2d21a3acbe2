//! Puts each fault of `faults.csv` into a copy of the sources, and runs the test that is to catch it.
//!
//! `cargo bench --profile dev -p nsd-tests --bench mutations -- TEXT` takes those whose file or test contains the text. The copy and
//! its builds stay in the target folder. Fails unless every fault that is put in is caught.

#![allow(clippy::print_stdout, reason = "a table is what it is for")]

use std::collections::{HashMap, HashSet};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use nsd_tests::faults::{Fault, Test, root, table};
use serde_json::Value;

/// A test that has not ended after that time does not end.
const PATIENCE: Duration = Duration::from_secs(600);

/// What became of a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    Passes,
    Fails,
    DoesNotCompile,
    DoesNotEnd,
}

fn main() -> ExitCode {
    let wanted = std::env::args().skip(1).find(|arg| !arg.starts_with('-'));
    match run(&wanted.unwrap_or_default()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            println!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether all faults are caught.
fn run(wanted: &str) -> Result<bool, String> {
    let mut faults = table()?;
    faults.retain(|fault| fault.file.contains(wanted) || name(&fault.test).contains(wanted));
    if faults.is_empty() {
        return Err(format!("no fault has to do with `{wanted}`"));
    }
    let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mutations");
    let told = |error: io::Error| format!("{}: {error}", copy.display());
    make_copy(&copy).map_err(told)?;
    // A test that fails anyway catches nothing.
    let mut sound: HashMap<&Test, Outcome> = HashMap::new();
    let mut caught = 0;
    for fault in &faults {
        let place = copy.join(&fault.file);
        let text = fs::read_to_string(&place).map_err(told)?;
        let faulty = fault.apply(&text);
        let faulty = faulty.map_err(|why| format!("{}: {why}: {}", fault.file, fault.line))?;
        let without = match sound.get(&fault.test) {
            Some(&outcome) => outcome,
            None => run_test(&copy, &fault.test).map_err(told)?,
        };
        sound.insert(&fault.test, without);
        let verdict = if without == Outcome::Passes {
            fs::write(&place, faulty).map_err(told)?;
            let outcome = run_test(&copy, &fault.test);
            fs::write(&place, text).map_err(told)?;
            match outcome.map_err(told)? {
                Outcome::Fails => "caught",
                Outcome::Passes => "NOT CAUGHT",
                Outcome::DoesNotCompile => "DOES NOT COMPILE",
                Outcome::DoesNotEnd => "DOES NOT END",
            }
        } else {
            "HAS NO TEST THAT PASSES WITHOUT IT"
        };
        caught += usize::from(verdict == "caught");
        tell(fault, verdict);
    }
    println!("\n{caught} of {} faults are caught", faults.len());
    Ok(caught == faults.len())
}

fn tell(fault: &Fault, verdict: &str) {
    println!("{verdict}: {}", fault.file);
    println!("    {}\n    {}", fault.line, fault.becomes);
    println!("    {}", name(&fault.test));
}

fn name(test: &Test) -> String {
    format!("{} {}: {}", test.package, test.target, test.name)
}

/// Makes the copy that of the tracked files as they are now; what has not changed is not written again.
fn make_copy(copy: &Path) -> io::Result<()> {
    let listed = Command::new("git")
        .args(["ls-files", "-z"])
        .current_dir(root())
        .output()?;
    if !listed.status.success() {
        return Err(io::Error::other("the sources are not in a git repository"));
    }
    let listed = String::from_utf8_lossy(&listed.stdout);
    let files: HashSet<PathBuf> = listed.split_terminator('\0').map(PathBuf::from).collect();
    for file in &files {
        let (from, to) = (root().join(file), copy.join(file));
        // What has been removed is listed until that is committed.
        let Ok(bytes) = fs::read(&from) else {
            continue;
        };
        if fs::read(&to).is_ok_and(|old| old == bytes) {
            continue;
        }
        fs::create_dir_all(to.parent().unwrap_or(copy))?;
        fs::write(&to, bytes)?;
    }
    let mut open = vec![PathBuf::new()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(copy.join(&folder))? {
            let entry = entry?;
            let path = folder.join(entry.file_name());
            if entry.file_type()?.is_dir() {
                if path != Path::new("target") {
                    open.push(path);
                }
            } else if !files.contains(&path) {
                fs::remove_file(entry.path())?;
            }
        }
    }
    Ok(())
}

/// Builds and runs one test in the copy.
fn run_test(copy: &Path, test: &Test) -> io::Result<Outcome> {
    let Some(program) = build(copy, test)? else {
        return Ok(Outcome::DoesNotCompile);
    };
    // A pipe that nobody reads would stop a test that prints much.
    let printed = copy.join("target/printed");
    let mut child = Command::new(program)
        .args(["--exact", &test.path()])
        .current_dir(copy.join(test.folder()))
        .env("INSTA_WORKSPACE_ROOT", copy)
        .env("INSTA_UPDATE", "no")
        .stdout(File::create(&printed)?)
        .stderr(Stdio::null())
        .spawn()?;
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if start.elapsed() > PATIENCE {
            child.kill()?;
            child.wait()?;
            return Ok(Outcome::DoesNotEnd);
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    match status.success() {
        // A name that no test has runs none.
        true if fs::read_to_string(&printed)?.contains("1 passed") => Ok(Outcome::Passes),
        true => Err(io::Error::other(format!("there is no test {}", name(test)))),
        false => Ok(Outcome::Fails),
    }
}

/// The program with the test, if it compiles.
fn build(copy: &Path, test: &Test) -> io::Result<Option<PathBuf>> {
    let mut command = Command::new(env!("CARGO"));
    command.args(["test", "--no-run", "--message-format", "json"]);
    command.args(["--package", &test.package]);
    match &test.target[..] {
        "lib" => command.arg("--lib"),
        _ => command.args(["--test", "all"]),
    };
    command.arg("--target-dir").arg(copy.join("target"));
    let output = command.current_dir(copy).stderr(Stdio::null()).output()?;
    if !output.status.success() {
        return Ok(None);
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let messages = text
        .lines()
        .filter_map(|line| serde_json::from_str(line).ok());
    let mut programs = messages.filter_map(|message: Value| {
        let is_test = message["profile"]["test"] == true;
        let program = message["executable"].as_str().filter(|_| is_test)?;
        Some(PathBuf::from(program))
    });
    programs
        .next_back()
        .map(Some)
        .ok_or_else(|| io::Error::other(format!("there are no tests for {}", name(test))))
}
