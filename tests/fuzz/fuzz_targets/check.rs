//! Any bytes are read, checked, reported and laid out without a panic, in bounded time and memory.
#![no_main]

use libfuzzer_sys::fuzz_target;
use nsdc::diagnostics::{Diagnostics, render};
use nsdc::source::imports;
use nsdc::source::imports::NoFiles;
use nsdc::source::SourceMap;
use nsdc::{check, syntax};

fuzz_target!(|bytes: &[u8]| {
    let mut sources = SourceMap::new();
    let mut diags = Diagnostics::new();
    let source = sources.add_bytes("fuzz.nsd", bytes.to_vec());
    let mut file = syntax::parse(&source, &mut diags);
    imports::link(&mut file, "fuzz", &mut NoFiles, &mut sources, &mut diags);
    check(&file, &sources, &mut diags);
    render(&diags, &sources, false, 100);
    // What is laid out once stays as it is.
    let mut diags = Diagnostics::new();
    if let Some(laid_out) = syntax::format(&source, &mut diags) {
        let again = sources.add("again.nsd", laid_out.clone());
        let twice = syntax::format(&again, &mut diags);
        assert_eq!(twice.as_ref(), Some(&laid_out), "the layout is stable");
    }
});
