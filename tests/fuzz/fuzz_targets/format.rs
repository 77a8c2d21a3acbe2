//! What parses is printed and laid out without another meaning: both read back as the same tree, with all comments.
#![no_main]

use libfuzzer_sys::fuzz_target;
use nsdc::diagnostics::Diagnostics;
use nsdc::source::SourceMap;
use nsdc::syntax;

/// The canonical text of what parses, and the same laid out.
fn read(bytes: &[u8]) -> Option<(String, String)> {
    let mut diags = Diagnostics::new();
    let source = SourceMap::new().add_bytes("fuzz.nsd", bytes.to_vec());
    let file = syntax::parse(&source, &mut diags);
    if diags.has_errors() {
        return None;
    }
    let laid_out = syntax::format(&source, &mut diags);
    Some((file.to_string(), laid_out.expect("what parses is laid out")))
}

/// Lines behind `//` are comments, and so is the rest of a line: none of these inside of strings.
fn comments(text: &str) -> Option<usize> {
    (!text.contains('"')).then(|| text.matches("//").count())
}

fuzz_target!(|bytes: &[u8]| {
    let Some((printed, laid_out)) = read(bytes) else {
        return;
    };
    let again = read(printed.as_bytes()).expect("what is printed parses");
    assert_eq!(again.0, printed, "the canonical text is that of itself");
    let again = read(laid_out.as_bytes()).expect("what is laid out parses");
    assert_eq!(again.0, printed, "what is laid out means the same");
    assert_eq!(again.1, laid_out, "the layout is stable");
    if let Ok(text) = std::str::from_utf8(bytes) {
        assert_eq!(comments(text), comments(&laid_out).filter(|_| comments(text).is_some()));
    }
});
