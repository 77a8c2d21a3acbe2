//! Every file of `events/`: models with known solutions, whose expectations all hold.

use std::path::Path;

use nsd_tests::test_folder;
use nsdc::cli::Exit;

#[test]
fn every_expectation_holds() {
    let (exit, out, err) = test_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("events"));
    assert_eq!(exit, Exit::Success, "{out}{err}");
    assert!(out.contains("0 failed, 0 not yet supported"), "{out}{err}");
}
