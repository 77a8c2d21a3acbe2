//! Every file of `events/`: models with known solutions, whose expectations all hold.

use std::path::Path;

use nsdc::cli::{self, Exit, Streams};

#[test]
fn every_expectation_holds() {
    let (mut out, mut err) = (Vec::new(), Vec::new());
    let mut streams = Streams {
        out: &mut out,
        err: &mut err,
        colour: false,
        progress: false,
        width: 100,
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("events");
    let exit = cli::run(["nsdc".into(), "test".into(), folder.into()], &mut streams);
    let text = format!(
        "{}{}",
        String::from_utf8_lossy(&out),
        String::from_utf8_lossy(&err)
    );
    assert_eq!(exit, Exit::Success, "{text}");
    assert!(text.contains("0 failed, 0 not yet supported"), "{text}");
}
