//! A few cases of every stress family; `cargo bench -p nsd-tests --bench stress` runs all.

use nsd_tests::stress::{Extent, Outcome, families};

/// Never wrong in silence, and as accurate as promised.
#[test]
fn every_family_keeps_its_promise() {
    let mut broken = Vec::new();
    for family in families(Extent::Short) {
        assert!(!family.cases.is_empty(), "{}", family.name);
        for case in &family.cases {
            let outcome = case.run();
            if !case.keeps(&outcome) {
                let what = match outcome {
                    Outcome::Wrong { .. } => "WRONG",
                    _ => "not as promised",
                };
                let (name, hardness, method) = (family.name, &case.hardness, &case.method);
                broken.push(format!("{name}, {hardness}, {method}: {what}, {outcome}"));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}
