//! The table of faults, `faults.csv`, fits the code. `cargo bench --bench mutations` puts them in, one after the other.

use std::collections::HashSet;
use std::fs;

use nsd_tests::faults::{root, table};

/// So many faults at least.
const LEAST: usize = 100;

#[test]
fn every_fault_has_its_line_and_its_test() {
    let faults = table().unwrap();
    assert!(faults.len() >= LEAST, "{} faults", faults.len());
    let mut wrong = Vec::new();
    for fault in &faults {
        let (file, line) = (&fault.file, &fault.line);
        let text = fs::read_to_string(root().join(file)).unwrap_or_default();
        if let Err(why) = fault.apply(&text) {
            wrong.push(format!("{file}: `{line}`: {why}"));
        }
        if !fault.test.exists() {
            let name = &fault.test.name;
            wrong.push(format!("{file}: `{line}`: there is no test `{name}`"));
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    let places: HashSet<_> = faults
        .iter()
        .map(|f| (&f.file, &f.line, &f.becomes))
        .collect();
    assert_eq!(places.len(), faults.len(), "a fault is there twice");
}

#[test]
fn every_file_of_tests_is_part_of_the_program() {
    for package in ["compiler", "solver", "tests"] {
        let manifest = fs::read_to_string(root().join(package).join("Cargo.toml")).unwrap();
        let folder = root().join(package).join("tests");
        let program = fs::read_to_string(folder.join("main.rs")).unwrap();
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let is_source = path.extension().is_some_and(|extension| extension == "rs");
            let name = path.file_stem().unwrap().to_string_lossy();
            if is_source && name != "main" {
                let module = format!("mod {name};\n");
                let own = format!("[[test]]\nname = \"{name}\"\n");
                let is_there = program.contains(&module) || manifest.contains(&own);
                assert!(is_there, "{package}: `{name}` is left out");
            }
        }
    }
}
