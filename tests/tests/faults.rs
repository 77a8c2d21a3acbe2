//! The table of faults in README.md fits the code. `cargo bench --bench mutations` puts them in, one after the other.

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
