//! What expectations mean: each is compared with one run and must hold or fail as listed.

use nsdc::compile;
use nsdc::diagnostics::{Diagnostics, render};
use nsdc::expr::Exprs;
use nsdc::project::clock::Clock;
use nsdc::report::expect::{Check, Findings, Verdict, check, evaluate};
use nsdc::simulate;
use nsdc::source::SourceMap;
use nsdc::syntax::{self, Item};

/// x crosses 1 at t = 1/2, y reaches 0 at t = 1 and stays there; both are known exactly.
const MODEL: &str = "
const rate = 2;
model two {
  param k = 1;
  state x = 0;
  state y[2] = [1, 0];
  let gap = y[1] - x;
  output total = x + y[1] + y[2];
  switch s = sign(y[1]);
  region low  where x < 1 { x' = rate; }
  region high where x > 1 { x' = 1; }
  y[1]' = -k*s;
  y[2]' = 1;
}
";

/// The verdicts of expectations about a run of the model over [0, 2].
fn verdicts(expects: &[&str]) -> Vec<Check> {
    let statements: String = expects
        .iter()
        .map(|expect| format!("  expect {expect};\n"))
        .collect();
    verdicts_of(&format!(
        "{MODEL}simulate run of two {{\n  horizon 2;\n{statements}}}\n"
    ))
}

/// The verdicts of the expectations of a text with one experiment.
fn verdicts_of(text: &str) -> Vec<Check> {
    let mut sources = SourceMap::new();
    let mut diags = Diagnostics::new();
    let source = sources.add("two.nsd", text);
    let file = syntax::parse(&source, &mut diags);
    let experiment = file.items.iter().find_map(|item| match item {
        Item::Experiment(experiment) => Some(experiment),
        _ => None,
    });
    let experiment = experiment.expect("the text has an experiment");
    let exprs = Exprs::new();
    let compiled = compile(
        &exprs,
        &file,
        experiment,
        &[],
        &mut Clock::default(),
        &mut diags,
    );
    let Some(compiled) = compiled.filter(|_| !diags.has_errors()) else {
        panic!("{}", render(&diags, &sources, false, 80));
    };
    let trajectory = simulate::run(&compiled.system, &compiled.settings, &Default::default());
    let subject = compiled.subject(&sources);
    check(&subject, &compiled.settings.expects, &mut diags);
    let only_unsupported = diags.codes().iter().all(|code| code.starts_with("E09"));
    assert!(only_unsupported, "{}", render(&diags, &sources, false, 80));
    evaluate(
        &subject,
        &compiled.settings.expects,
        &trajectory,
        &Findings::default(),
    )
}

fn all(expects: &[&str], is_wanted: fn(&Verdict) -> bool) {
    let checks = verdicts(expects);
    assert_eq!(checks.len(), expects.len());
    for (check, expect) in checks.iter().zip(expects) {
        assert_eq!(check.text, *expect, "the text is kept");
        assert!(is_wanted(&check.verdict), "{expect}: {:?}", check.verdict);
    }
}

#[test]
fn these_hold() {
    let holds = [
        "x at end ~ 2.5 within 1e-9",
        "x at 0 = 0",
        "y at end ~ [0, 2] within 1e-9",
        "[x, y[2]] at 0.25 ~ [0.5, 0.25] within 1e-12",
        "y at 0.25 ~ [1 - time, time] within 1e-12",
        "x at end > x at 0",
        "x at 1 - 0.5 ~ 1 within 1e-9",
        "x at end - 0.5 ~ 2 within 1e-9",
        "gap at 0.25 ~ 0.25 within 1e-12",
        "total at end <= 4.6",
        "k <= 1",
        "k >= 1",
        "x always >= 0",
        "y always <= 2.000000001",
        "y[2] always ~ time within 1e-9",
        "s at 0.5 = 1",
        "s at end ~ 0 within 1e-9",
        "k = 1",
        "k/rate = 0.5",
        "switches ~ [1/2, 1/k] within 1e-9",
        "len(switches) = 2",
        "switches[2] - switches[1] ~ 0.5 within 1e-9",
        "events(crossing) ~ [0.5] within 1e-9",
        "events(crossing, x - 1) ~ [0.5] within 1e-9",
        "events(crossing, 1 - x)[1] ~ 0.5 within 1e-9",
        "events(enter_sliding, s) ~ [1] within 1e-9",
        "len(events(jump)) = 0",
        "mode at 0.25 is low",
        "mode at 0.75 is high and not low",
        "mode at 0 is above(s) and below(x - 1)",
        "mode at 0 is below(-y[1]) and above(2 - 2*x)",
        "mode at end is sliding(s) and sliding(y[1], s)",
        "mode at 0.25 is high or low",
        "status is solved",
    ];
    all(&holds, |verdict| matches!(verdict, Verdict::Passed));
}

#[test]
fn these_fail() {
    let fails = [
        "x at end ~ 2.5001 within 1e-9",
        "y at end ~ [0, 1] within 1e-9",
        "x at 0 > 0",
        "x at end < x at 0",
        "x always <= 2",
        "y always >= [0.1, 0]",
        "switches ~ [1/2] within 1e-9",
        "events(crossing, s) ~ 0.5 within 1e-9",
        "events(crossing) ~ [0.5, 0.5] within 1e-9",
        "switches[3] ~ 1 within 1e-9",
        "len(switches) = 3",
        "events(crossing, s) ~ [0.5] within 1e-9",
        "mode at 0.25 is high",
        "mode at end is above(s)",
        "mode at end is sliding(s, x - 1)",
        "mode at 0 is above(-y[1])",
        "log(-1 - x) at 0 ~ 0 within 1",
        "warning W0104",
        "status is time_limit",
    ];
    all(&fails, |verdict| matches!(verdict, Verdict::Failed { .. }));
}

#[test]
fn a_failure_says_what_should_be_and_what_is() {
    let checks = verdicts(&[
        "len(switches) = 3",
        "mode at 0.25 is high",
        "switches ~ [1/2] within 1e-9",
        "y at 0 = [0.5, 2]",
    ]);
    let shown: Vec<String> = checks
        .iter()
        .map(|check| match &check.verdict {
            Verdict::Failed { expected, got } => format!("expected {expected}, got {got}"),
            other => format!("{other:?}"),
        })
        .collect();
    assert_eq!(shown[0], "expected 3, got 2, off by 1");
    assert_eq!(shown[1], "expected high, got low, above(s)");
    assert!(
        shown[2].starts_with("expected 0.5 within 1e-9, got ["),
        "{}",
        shown[2]
    );
    // The worst entry is told.
    let worst = "expected [0.5, 2], got [1, 0], off by 2 in entry 2";
    assert_eq!(shown[3], worst);
}

/// The speed |v| is 1 - t until it has no derivative any more, from t = 1 on; |w| turns back at t = 1/2.
#[test]
fn what_has_no_derivative_has_values() {
    let checks = verdicts_of(
        "model stops {
           state v = 1; state w = 0.5;
           v' = -sign(v); w' = -1;
           output fast = max(norm([v, 0]), 0.25);
         }
         simulate run of stops {
           horizon 2;
           expect fast at 0.5 ~ 0.5 within 1e-9;
           expect fast at end ~ 0.25 within 1e-9;
           expect fast always <= 1.000000001;
           expect max(norm([v, 0]), 0.25) at 1.5 ~ 0.25 within 1e-9;
           expect max(norm([w, 0]), 0.1) at 0.45 ~ 0.1 within 1e-9;
           expect max(norm([w, 0]), 0.1) at 0.7 ~ 0.2 within 1e-9;
           expect max(norm([w, 0]), 0.1) at end ~ 1.5 within 1e-9;
           expect fast at 0.5 ~ 0.6 within 1e-9;
         }",
    );
    let passed: Vec<bool> = checks
        .iter()
        .map(|check| check.verdict == Verdict::Passed)
        .collect();
    assert_eq!(
        passed,
        [true, true, true, true, true, true, true, false],
        "{checks:?}"
    );
}

/// x = t - t²/7 is 7/4 in the middle of a step that begins and ends at 0, and sin t is 1.
#[test]
fn what_holds_always_holds_within_steps() {
    let parabola =
        "model m { state x = 0; state v = 1; x' = v; v' = -2/7; output a = exp(-1e3*(x - 1)^2); }
        simulate run of m { horizon 7;";
    let wave = "model m { state x = 0; state v = 1; x' = v; v' = -x; }
        simulate run of m { horizon 7;";
    for (model, expect, holds) in [
        (parabola, "x always <= 0.1", false),
        (parabola, "x always <= 1.7499", false),
        (parabola, "x always <= 1.75 + 1e-9", true),
        (parabola, "a always <= 0.9", false),
        (parabola, "x always ~ 1 within 0.99", false),
        (wave, "x always <= 0.7", false),
        (wave, "x always < 0.99999999", false),
        (wave, "x always >= -1 - 1e-9", true),
        (wave, "x^2 + v^2 always ~ 1 within 1e-7", true),
        (wave, "[x, v] always <= [1 + 1e-9, 1 + 1e-9]", true),
        (wave, "[x, v] always <= [1 + 1e-9, 0.9]", false),
    ] {
        let checks = verdicts_of(&format!("{model} expect {expect}; }}"));
        assert_eq!(
            checks[0].verdict == Verdict::Passed,
            holds,
            "{expect}: {checks:?}"
        );
    }
}
