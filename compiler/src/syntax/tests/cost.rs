//! The work on a text grows with its length, also on texts made to hurt.

use super::super::lexer::counter;
use crate::diagnostics::{Diagnostics, render};
use crate::source::SourceMap;
use crate::syntax::{format, parse};

/// Tokens that are looked at while a text is read.
fn work(text: &str) -> usize {
    counter::reset();
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let file = sources.add("test.nsd", text);
    parse(&file, &mut diags);
    format(&file, &mut Diagnostics::new());
    let shown = render(&diags, &sources, false, 80);
    assert!(shown.len() < 200_000, "{} bytes of messages", shown.len());
    counter::count()
}

#[test]
fn work_is_linear() {
    // Head, repeated unit, tail.
    let in_model: &[&str] = &[
        "x' = 1\n",
        "x' = 1 ",
        "x' = 1;",
        "foo bar;",
        "foo ",
        "a[1] ",
        "a = ",
        "a[1].b ",
        "region r where a > 0 { x' = 1 } ",
        "region r wher a > 0 { x' = 1; } ",
        "project x onto { a >= 0; } metric ; ",
        "part b = c { x = 1 } ",
        "let a = [1; ",
        "let a = (1; ",
        "x'' ",
        "x' ",
        "\"a; ",
        "\" ",
        "'",
        ";",
        "0 ",
        "} ",
        "} model a { ",
        ";\nmodel a {\n",
        "/* ",
        "for i in 1..n ",
        "y in ",
        "{}",
        "(] ",
        "@",
        "@ ",
        "= ",
        "1 == 2 ",
        "if ",
        ", ",
    ];
    let in_expression: &[&str] = &[
        "+ x", "*-x", " and x", "< x", ", x", "; x", " x", "(x", ")", "[x", "]", "(1)", ".x", "^x",
        "-", " not", " if", ".", "..", "1.", "\"\"", "'", " x y", " for",
    ];
    let in_experiment: &[&str] = &[
        "expect a at ",
        "expect a ~ 1 at 2 ",
        "horizon 1 ",
        "output every ",
        "subject to { x } at ",
        "guess { from ; } ",
        "initial { x[1] fre; } ",
    ];
    let cases = (in_model.iter().map(|unit| ("model m { ", unit, " }")))
        .chain(
            in_expression
                .iter()
                .map(|unit| ("model m { x' = x", unit, "; }")),
        )
        .chain(
            in_experiment
                .iter()
                .map(|unit| ("simulate s of m { ", unit, " }")),
        );
    for (head, unit, tail) in cases {
        let text = |times: usize| format!("{head}{}{tail}", unit.repeat(times));
        let (small, large) = (work(&text(500)), work(&text(2000)));
        assert!(
            large <= 5 * small + 2000,
            "`{head}` and many `{unit}`: {small} tokens grow to {large}"
        );
    }
}
