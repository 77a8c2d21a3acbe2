//! The grammar reads nested text once: its work grows with the length of the text.
//!
//! The limit on the work is one of the whole process, so this test has its own.

use std::num::NonZeroUsize;

use nsdc::diagnostics::Diagnostics;
use nsdc::source::SourceMap;
use nsdc::syntax::{MAX_DEPTH, parse};

/// Rules that the grammar may try for each byte.
const RULES_PER_BYTE: usize = 150;

#[test]
fn nested_text_is_read_once() {
    let depth = MAX_DEPTH - 8;
    let nest = |open: &str, inside: &str, close: &str| {
        format!("{}{inside}{}", open.repeat(depth), close.repeat(depth))
    };
    let statement = |value: String| format!("model m {{ x' = {value}; }}");
    let texts = [
        statement(nest("(", "x", ")")),
        statement(nest("(", "x y", ")")),
        statement(nest("[", "x", "]")),
        statement(nest("[1, ", "x;;", "; 2]")),
        statement(nest("f(", "x", ", a = 1)")),
        statement(nest("f(a = ", "", ")")),
        statement(nest("x[", "1..", "]")),
        statement(nest("(if a then b else ", "c", ")")),
        statement(nest("[", "x", " for i in 1..n]")),
        statement(nest("sum(", "x", " for i in 1..n")),
        format!("model m {{ {} }}", nest("for i in 1..n { ", "x' = 1;", "}")),
        format!("model m {{ {} }}", nest("for i in 1..n { ", "x' = ;", "}")),
        format!(
            "model m {{ {} }}",
            nest("region r where a > 0 { ", "?", "} 1")
        ),
        format!(
            "model m {{ {} }}",
            nest("project x onto { ", "x", "} metric")
        ),
        format!("model m {{ {} }}", nest("{", "x", "}")),
        nest("foo [({", "x", "})]"),
        nest("model m {", "", ""),
    ];
    for text in texts {
        // Reading what is wrong a second time has a limit of its own.
        pest::set_call_limit(NonZeroUsize::new(RULES_PER_BYTE * text.len()));
        let mut sources = SourceMap::new();
        parse(&sources.add("test.nsd", text), &mut Diagnostics::new());
    }
}
