//! Functions of functions, sixty deep: right, or told in a while, at the line of the rate.

use nsd_tests::{end, run, solved};
use nsdc::report::Failure;

/// x' = -a with a composed so many times, where A stands for the one before, over a horizon of 1 from 1/2.
fn composed(form: &str, times: usize) -> String {
    let lets = (1..=times).map(|k| {
        let before = match k {
            1 => "x".to_owned(),
            _ => format!("a{}", k - 1),
        };
        format!("let a{k} = {};\n", form.replace('A', &before))
    });
    let lets: String = lets.collect();
    format!(
        "model m {{ state x = 0.5;\n{lets}x' = -a{times};\n}}\nsimulate r of m {{ horizon 1; }}"
    )
}

/// From ∫ dx / a(x) = 1 by quadrature in 25 digits (mpmath).
#[test]
fn sixty_tangents_are_right() {
    let trajectory = solved(&composed("tanh(A)", 60), "r");
    let x = end(&trajectory, "x")[0];
    assert!((x - 0.352_367_152_188_66).abs() < 1e-8, "{x}");
}

/// Slopes of 1.1⁶⁰, 2²⁰ and 2³⁰ pull the state to zero.
#[test]
fn steep_compositions_come_to_rest() {
    for (form, times) in [
        ("A + 0.1*sin(A)", 60),
        ("A + sin(A)", 20),
        ("A + sin(A)", 30),
    ] {
        let trajectory = solved(&composed(form, times), "r");
        let x = end(&trajectory, "x")[0];
        assert!(x.abs() < 1e-8, "{form}: {x}");
    }
}

/// A slope of 2⁶⁰ turns the rate over between two numbers next to zero: a run creeps there, and none passes over it.
#[test]
fn a_rate_that_turns_over_between_two_steps_is_told() {
    let source = composed("A + sin(A)", 60);
    for method in ["event;", "fesd { scheme = radau_iia(2); }"] {
        let settings = format!("horizon 1; method {method}");
        let trajectory = run(&source.replace("horizon 1;", &settings), "r");
        let failure = trajectory.failure.as_ref().expect("it is told");
        let Failure::Limit { what, terms, .. } = failure else {
            panic!("{failure}");
        };
        assert_eq!(*what, "steps");
        let time = trajectory.samples.time.last().copied().unwrap_or_default();
        let rate = std::f64::consts::PI;
        assert!((time - 0.5 / rate).abs() < 1e-4, "{time}");
        let line = &source[terms[0].offset()..];
        assert!(line.starts_with("x' = "), "{line}");
        let label = terms[0].label().unwrap_or_default();
        assert!(
            label.contains("goes from 3") || label.contains("goes from -3"),
            "{label}"
        );
    }
}
