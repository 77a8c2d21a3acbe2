//! Results of tests as JUnit XML, which services for continuous integration read.
//!
//! A file is a suite, and a test of it a case. What is missed is a `failure`, what does not compile an `error`, and what
//! is not supported yet is `skipped`. Warnings are the output of a test.

use std::fmt::{self, Write};

use super::case::{Case, Outcome};
use crate::cli::Exit;

/// The document.
pub fn write(cases: &[Case]) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = document(cases, &mut text);
    text
}

fn document(cases: &[Case], text: &mut String) -> fmt::Result {
    writeln!(text, r#"<?xml version="1.0" encoding="UTF-8"?>"#)?;
    let counts = Counts::of(cases);
    writeln!(text, r#"<testsuites name="nsdc" {counts}>"#)?;
    for suite in cases.chunk_by(|a, b| a.file == b.file) {
        let (file, counts) = (escaped(&suite[0].file), Counts::of(suite));
        writeln!(text, r#"  <testsuite name="{file}" {counts}>"#)?;
        for case in suite {
            let name = escaped(case.test.as_deref().unwrap_or("compiles"));
            let head = format!(
                r#"    <testcase name="{name}" classname="{file}" time="{:.3}""#,
                case.seconds
            );
            if matches!(case.outcome, Outcome::Passed(_)) && case.warnings.is_empty() {
                writeln!(text, "{head}/>")?;
                continue;
            }
            writeln!(text, "{head}>")?;
            match &case.outcome {
                Outcome::Passed(_) => {}
                Outcome::Unsupported(code) => {
                    let message = escaped(&format!("not yet supported ({code})"));
                    writeln!(text, r#"      <skipped message="{message}"/>"#)?;
                }
                Outcome::Failed { missed, exit } => {
                    let tag = tag(*exit);
                    let message = missed.first().map_or("", |missed| &missed.what);
                    let (message, lines) = (escaped(message), case.outcome.lines().join("\n"));
                    let lines = escaped(&lines).replace("&#10;", "\n");
                    writeln!(text, r#"      <{tag} message="{message}">{lines}</{tag}>"#)?;
                }
            }
            if !case.warnings.is_empty() {
                let told = case.warnings.iter();
                let told: Vec<String> = told
                    .map(|warning| escaped(&format!("{}: {}", warning.code, warning.message)))
                    .collect();
                let told = told.join("\n");
                writeln!(text, "      <system-out>{told}</system-out>")?;
            }
            writeln!(text, "    </testcase>")?;
        }
        writeln!(text, "  </testsuite>")?;
    }
    writeln!(text, "</testsuites>")
}

/// What does not compile is an error, what is missed a failure.
fn tag(exit: Exit) -> &'static str {
    match exit {
        Exit::Wrong => "error",
        _ => "failure",
    }
}

/// The attributes of a suite.
#[derive(Default)]
struct Counts {
    tests: usize,
    failures: usize,
    errors: usize,
    skipped: usize,
    seconds: f64,
}

impl Counts {
    fn of(cases: &[Case]) -> Self {
        let mut counts = Counts::default();
        for case in cases {
            counts.tests += 1;
            counts.seconds += case.seconds;
            match &case.outcome {
                Outcome::Passed(_) => {}
                Outcome::Unsupported(_) => counts.skipped += 1,
                Outcome::Failed { exit, .. } if tag(*exit) == "error" => counts.errors += 1,
                Outcome::Failed { .. } => counts.failures += 1,
            }
        }
        counts
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Counts {
            tests,
            failures,
            errors,
            skipped,
            seconds,
        } = self;
        write!(
            f,
            r#"tests="{tests}" failures="{failures}" errors="{errors}" skipped="{skipped}" time="{seconds:.3}""#
        )
    }
}

/// A text in an attribute. Characters that XML has no way to write are U+FFFD.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&apos;"),
            '\n' => escaped.push_str("&#10;"),
            '\r' => escaped.push_str("&#13;"),
            '\t' => escaped.push_str("&#9;"),
            '\0'..'\u{20}' | '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            _ => escaped.push(character),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use insta::assert_snapshot;

    use super::{escaped, write};
    use crate::cli::Exit;
    use crate::cli::commands::test::case::{Case, Missed, Outcome};
    use crate::report::Warning;

    #[test]
    fn what_xml_cannot_write_is_replaced() {
        assert_eq!(
            escaped("a<b & \"c\" '\u{1b}[1m'\t\n\u{7f}\u{ffff}é"),
            "a&lt;b &amp; &quot;c&quot; &apos;\u{fffd}[1m&apos;&#9;&#10;\u{7f}\u{fffd}é"
        );
    }

    #[test]
    fn a_file_is_a_suite() {
        let case = |file: &str, test: Option<&str>, outcome: Outcome| Case {
            file: file.to_owned(),
            test: test.map(str::to_owned),
            outcome,
            seconds: 0.25,
            warnings: Vec::new(),
            changes: Vec::new(),
        };
        let warning = Warning {
            code: "W0703".to_owned(),
            message: "`x` is above its bound".to_owned(),
            span: None,
        };
        let warned = Case {
            warnings: vec![warning.clone(), warning],
            ..case("a.nsd", Some("warned"), Outcome::Passed(Vec::new()))
        };
        assert_eq!(warned.line(), "ok      a.nsd: warned, 2 warnings: W0703");
        let missed = Missed {
            what: "expect x at end < 1".to_owned(),
            expected: Some("less than 1".to_owned()),
            got: Some("2".to_owned()),
            lines: Vec::new(),
        };
        let cases = [
            case("a.nsd", Some("fine"), Outcome::Passed(Vec::new())),
            warned,
            case("a.nsd", Some("off"), Outcome::failed(missed, Exit::Failed)),
            case(
                "a.nsd",
                Some("later"),
                Outcome::Unsupported("E0923".to_owned()),
            ),
            case(
                "b & c.nsd",
                None,
                Outcome::failed(
                    Missed::plain("does not compile: E0101".to_owned()),
                    Exit::Wrong,
                ),
            ),
        ];
        assert_snapshot!(write(&cases), @r#"
        <?xml version="1.0" encoding="UTF-8"?>
        <testsuites name="nsdc" tests="5" failures="1" errors="1" skipped="1" time="1.250">
          <testsuite name="a.nsd" tests="4" failures="1" errors="0" skipped="1" time="1.000">
            <testcase name="fine" classname="a.nsd" time="0.250"/>
            <testcase name="warned" classname="a.nsd" time="0.250">
              <system-out>W0703: `x` is above its bound
        W0703: `x` is above its bound</system-out>
            </testcase>
            <testcase name="off" classname="a.nsd" time="0.250">
              <failure message="expect x at end &lt; 1">expect x at end &lt; 1
          expected less than 1
          got      2</failure>
            </testcase>
            <testcase name="later" classname="a.nsd" time="0.250">
              <skipped message="not yet supported (E0923)"/>
            </testcase>
          </testsuite>
          <testsuite name="b &amp; c.nsd" tests="1" failures="0" errors="1" skipped="0" time="0.250">
            <testcase name="compiles" classname="b &amp; c.nsd" time="0.250">
              <error message="does not compile: E0101">does not compile: E0101</error>
            </testcase>
          </testsuite>
        </testsuites>
        "#);
    }
}
