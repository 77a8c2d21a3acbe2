//! A run that ends where a function loses its value names the term and its line, by every method.

use nsd_tests::run;
use nsdc::report::{Failure, Warning};

const METHODS: [&str; 5] = [
    "event",
    "fesd",
    "fesd { steps = 20; }",
    "adaptive",
    "timestepping { steps = 50; }",
];

/// The code of a failed run, and what stands at its labels.
fn cause(model: &str, method: &str) -> (String, String) {
    let semicolon = if method.ends_with('}') { "" } else { ";" };
    let text = format!(
        "model m {{ {model} }}\nsimulate run of m {{ horizon 2; method {method}{semicolon} }}"
    );
    let found = run(&text, "run");
    let failure = found.failure.expect("the run fails");
    let labels = match &failure {
        Failure::NotFinite { terms, .. } => &terms[..],
        _ => &[],
    };
    let labels = labels.iter().map(|label| {
        let line = &text[label.offset()..label.offset() + label.len()];
        format!("{line}: {}", label.label().unwrap_or_default())
    });
    let labels: Vec<String> = labels.collect();
    (Warning::of(&failure).code, labels.join("; "))
}

#[test]
fn a_term_without_a_value_is_named() {
    for (model, line, term) in [
        // Where the run starts, beside a switch that slides.
        (
            "state x = 0; state y = 0; x' = 1; y' = -sign(y - 0.1) + log(x);",
            "y'",
            "`log(x)` is -inf",
        ),
        (
            "state x = 1; x' = -sign(x - 0.5)*sqrt(time - 1);",
            "x'",
            "`sqrt(time - 1)` is no number",
        ),
        // Later, where a root ends.
        (
            "state x = 1; x' = -sqrt(x - 0.5) - 1;",
            "x'",
            "`sqrt(x - 0.5)`",
        ),
        // While the switch slides, so that the term counts for nothing before.
        (
            "state x = 1; state y = 0; x' = -1; y' = -sign(y)*acos(1.5 - x);",
            "y'",
            "`acos(",
        ),
    ] {
        for method in METHODS {
            // Without switches a sliding mode is a step limit.
            if method == "adaptive" && term == "`acos(" {
                continue;
            }
            let (code, labels) = cause(model, method);
            let told = format!("{model} by {method}: {code}, {labels}");
            assert_eq!(code, "E0706", "{told}");
            assert!(labels.contains(line) && labels.contains(term), "{told}");
        }
    }
}

#[test]
fn a_switching_function_without_a_value_is_named() {
    let model = "state x = 0; state y = 0; x' = 1; y' = if log(1 - x) > -5 then 1 else 2;";
    for method in METHODS {
        let (code, labels) = cause(model, method);
        assert_eq!(code, "E0706", "{method}");
        assert!(labels.contains("log(1 - x)"), "{method}: {labels}");
    }
}

/// Signs that contradict each other are told as before.
#[test]
fn what_is_finite_is_not_blamed() {
    let model =
        "state x = 0; region a where x < 0 { x' = 0 - 1; } region b where x > 0 { x' = 1; }";
    let (code, _) = cause(model, "event");
    assert_eq!(code, "E0701");
}
