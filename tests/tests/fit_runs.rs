//! Fits to several runs with common parameters: against least squares in closed form.

use nsd_tests::random::Random;
use nsdc::files::Memory;
use nsdc::report::{Fit, Status, Trajectory};
use nsdc::{Messages, Options, Project};

use crate::fit::{close, codes, estimate, normal, rows, table};

fn project(text: &str, [first, second]: [&str; 2]) -> Project {
    let files = [("model.nsd", text), ("one.csv", first), ("two.csv", second)];
    let files: Memory = files.into_iter().collect();
    Project::from_files("model.nsd", files).expect("the text is there")
}

fn fitted(text: &str, data: [&str; 2]) -> (Trajectory, Fit) {
    let project = project(text, data);
    assert!(project.check().is_empty(), "{}", project.check());
    let found = project.run("f", &Options::default(), &mut ());
    let run = found.unwrap_or_else(|errors| panic!("{errors}")).trajectory;
    let fit = run.several.fit.clone().expect("it is a fit");
    (run, fit)
}

/// Values around some function of time.
fn around(f: impl Fn(f64) -> f64, n: u32, seed: u64) -> Vec<[f64; 2]> {
    let mut random = Random(seed);
    let times = (0..n).map(|k| 0.2 * f64::from(k));
    times
        .map(|t| [t, f(t) + 0.05 * normal(&mut random)])
        .collect()
}

/// x = b + a t of one run, and x = 5 + a t of another one, whose errors have twice the weight: with r = J p - y, rows [t, 1] of
/// the first and 2 [t, 0] of the second, p = (JᵀJ)⁻¹ Jᵀy and the covariance is s² (JᵀJ)⁻¹.
#[test]
fn lines_of_two_runs_are_those_of_weighted_regression() {
    let one = around(|t| 1.5 + 0.4 * t, 12, 3);
    let two = around(|t| 5.0 + 0.4 * t, 9, 4);
    let text = "model line { param a = 1; param b = 2; state x = b; x' = a; }
        fit f of line { horizon 3;
          data \"one.csv\" { x -> y; }
          data \"two.csv\" with { b = 5; } { x -> y weight 2; }
          free { a; b; } }";
    let tables = [&one, &two].map(|points| table("time,y", rows(points)));
    let (run, fit) = fitted(text, [&tables[0], &tables[1]]);
    assert_eq!(run.status, Status::Solved);
    assert!(codes(&run).is_empty(), "{:?}", codes(&run));
    let first = one.iter().map(|&[t, y]| ([t, 1.0], y));
    let second = two.iter().map(|&[t, y]| ([2.0 * t, 0.0], 2.0 * (y - 5.0)));
    let all: Vec<([f64; 2], f64)> = first.chain(second).collect();
    let normal = |i: usize, j: usize| all.iter().map(|(row, _)| row[i] * row[j]).sum::<f64>();
    let right = |i: usize| all.iter().map(|(row, y)| row[i] * y).sum::<f64>();
    let (aa, ab, bb) = (normal(0, 0), normal(0, 1), normal(1, 1));
    let det = aa * bb - ab * ab;
    let a = (bb * right(0) - ab * right(1)) / det;
    let b = (aa * right(1) - ab * right(0)) / det;
    let squares: f64 = (all.iter())
        .map(|(row, y)| (row[0] * a + row[1] * b - y).powi(2))
        .sum();
    close(estimate(&fit, "a").value, a, 1e-8);
    close(estimate(&fit, "b").value, b, 1e-8);
    close(run.objective.expect("squares"), squares, 1e-9);
    assert_eq!(fit.degrees_of_freedom, 19);
    let variance = squares / 19.0;
    close(fit.deviation.expect("known"), variance.sqrt(), 1e-9);
    let expected = [[bb, -ab], [-ab, aa]];
    for (row, expected) in fit.covariance.iter().zip(expected) {
        for (found, expected) in row.iter().zip(expected) {
            close(found.expect("determined"), variance * expected / det, 1e-9);
        }
    }
    // Residuals are those of each run, without the weight.
    let with: Vec<Option<&str>> = fit.data.iter().map(|data| data.with.as_deref()).collect();
    assert_eq!(with, [None, Some("b = 5")]);
    for (residual, [t, y]) in fit.data[1].residuals.iter().zip(&two) {
        close(*residual, 5.0 + a * t - y, 1e-7);
    }
    // The run that is told is that of the experiment.
    close(run.samples.states[0].at(0)[0], b, 1e-8);
}

/// x = c exp(-k t) from two known initial values: r is orthogonal to its derivative by k, -c t exp(-k t), over both runs.
#[test]
fn a_decay_is_measured_from_two_initial_values() {
    let decay = |c: f64| move |t: f64| c * (-0.7 * t).exp();
    let (one, two) = (around(decay(2.0), 20, 7), around(decay(6.0), 15, 8));
    let text = "model decay { param k = 2; state x = 1; x' = -k*x; }
        fit f of decay { horizon 4;
          data \"one.csv\" with { x = 2; } { x -> y; }
          data \"two.csv\" with { x = 6; } { x -> y; }
          free { k in [0, 10]; } }";
    let tables = [&one, &two].map(|points| table("time,y", rows(points)));
    let (run, fit) = fitted(text, [&tables[0], &tables[1]]);
    assert_eq!(run.status, Status::Solved);
    let k = estimate(&fit, "k");
    let of = |points: &[[f64; 2]], c: f64| -> Vec<[f64; 2]> {
        let row = |&[t, y]: &[f64; 2]| {
            let x = c * (-k.value * t).exp();
            [x - y, -t * x]
        };
        points.iter().map(row).collect()
    };
    let all = [of(&one, 2.0), of(&two, 6.0)].concat();
    let sum = |f: fn(&[f64; 2]) -> f64| all.iter().map(f).sum::<f64>();
    close(sum(|[r, by]| r * by), 0.0, 1e-5);
    let error = (sum(|[r, _]| r * r) / 34.0 / sum(|[_, by]| by * by)).sqrt();
    close(k.standard_error.expect("determined"), error, 1e-7);
    close(k.value, 0.7, 4.0 * error);
    // No run of the experiment is compared, but it has what was found.
    let end = run.samples.states[0].at(run.samples.time.len() - 1)[0];
    close(end, (-4.0 * k.value).exp(), 1e-7);
}

/// x' = -k x + g u: where u is zero nothing depends on g, which the second run alone determines.
#[test]
fn what_one_run_does_not_depend_on_another_one_determines() {
    let (k, g) = (0.8, 3.0);
    let data = |x: &dyn Fn(f64) -> f64| {
        let times = (0..15).map(|k| 0.2 * f64::from(k));
        table("time,y", times.map(|t| vec![t, x(t)]))
    };
    let one = data(&|t| 2.0 * (-k * t).exp());
    let two = data(&|t| g / k * (1.0 - (-k * t).exp()));
    let model =
        "model driven { param k = 1; param g = 1; param u = 1; state x = 2; x' = -k*x + g*u; }";
    let fit = |blocks: &str| {
        format!(
            "{model} fit f of driven {{ horizon 3; {blocks} free {{ k; g; }} expect g ~ 3 within 1e-6; }}"
        )
    };
    // Both with runs of their own, and the first as that of the experiment, which has another `x` and `u` then.
    for blocks in [
        "data \"one.csv\" with { u = 0; } { x -> y; } data \"two.csv\" with { x = 0; } { x -> y; }",
        "with { u = 0; } data \"one.csv\" { x -> y; } data \"two.csv\" with { x = 0; u = 1; } { x -> y; }",
    ] {
        let text = fit(blocks);
        let (run, fit) = fitted(&text, [&one, &two]);
        assert_eq!(run.status, Status::Solved);
        close(estimate(&fit, "k").value, k, 1e-7);
        close(estimate(&fit, "g").value, g, 1e-6);
        assert_eq!(estimate(&fit, "g").is_determined, Some(true));
        let parameters = run.setup.parameters.iter();
        let told = parameters
            .filter(|series| series.name == "g")
            .map(|g| g.values[0]);
        close(told.sum(), g, 1e-6);
    }
    // No run depends on it: it is given to the only one that would.
    let text = fit(
        "with { u = 0; } data \"one.csv\" { x -> y; } data \"two.csv\" with { x = 0; u = 1; g = 3; } { x -> y; }",
    );
    let text = text.replace("expect g ~ 3 within 1e-6;", "");
    let (run, fit) = fitted(&text, [&one, &two]);
    assert_eq!((run.status, codes(&run)), (Status::Solved, vec!["W0741"]));
    close(estimate(&fit, "k").value, k, 1e-6);
    assert_eq!(estimate(&fit, "g").is_determined, Some(false));
}

/// Columns of one file may be of several runs, and what the data give is free in others: x(0) is that of the first.
#[test]
fn what_data_give_is_not_free_in_their_run() {
    let rows = (0..10).map(|k| 0.3 * f64::from(k));
    let data = table(
        "time,y,z",
        rows.map(|t| vec![t, 1.2 * (-t).exp(), 3.0 * (-t).exp()]),
    );
    let text = "model decay { param k = 2; state x = 1; x' = -k*x; }
        fit f of decay { horizon 4;
          data \"one.csv\" { x -> y; }
          data \"one.csv\" with { x = 3; } { x -> z; }
          free { k in [0, 10]; } initial { x free; } }";
    let (run, fit) = fitted(text, [&data, ""]);
    assert_eq!(run.status, Status::Solved);
    close(estimate(&fit, "k").value, 1.0, 1e-7);
    close(estimate(&fit, "x at 0").value, 1.2, 1e-7);
}

/// What is wrong with the data of a fit, with the text that it is about.
fn error(blocks: &str) -> (String, String) {
    let text = format!(
        "model decay {{ param k = 2; state x = 1; x' = -k*x; }}
        fit f of decay {{ horizon 4; {blocks} free {{ k; }} }}"
    );
    let found: Messages = project(&text, ["time,y\n0,1\n1,0.5\n", "time,y\n0,1\n"]).check();
    let list = found.list();
    let of = list.iter().map(|message| {
        let place = &message.labels[0].place;
        let code = message.code.clone().unwrap_or_default();
        (code, text[place.start..place.end].to_owned())
    });
    let all: Vec<(String, String)> = of.collect();
    assert_eq!(all.len(), 1, "{found}");
    all.into_iter().next().expect("there is one")
}

#[test]
fn mistakes_in_runs_are_told_at_their_places() {
    let one = "data \"one.csv\" { x -> y; }";
    let is = |found: (String, String), code: &str, about: &str| {
        assert_eq!((found.0.as_str(), found.1.as_str()), (code, about));
    };
    let with = |block: &str| error(&format!("{one} {block}"));
    is(
        with("data \"two.csv\" with { x = 2; } { x -> z; }"),
        "E0123",
        "z",
    );
    is(
        with("data \"two.csv\" with { x = 2; } {}"),
        "E0541",
        "\"two.csv\"",
    );
    is(
        with("data \"two.csv\" with { k = 2; } { x -> y; }"),
        "E0541",
        "\"two.csv\"",
    );
    is(
        with("data \"two.csv\" with { x = 2; x = 3; } { x -> y; }"),
        "E0506",
        "x = 2;",
    );
    is(
        with("data \"two.csv\" with { z = 2; } { x -> y; }"),
        "E0101",
        "z",
    );
    is(error("data \"two.csv\" { }"), "E0541", "f");
}

#[test]
fn runs_are_told_in_words_as_json_and_drawn() {
    let text = "model decay { param k = 2; state x = 1; x' = -k*x; }
        fit f of decay { horizon 4; data \"one.csv\" with { x = 2; } { x -> y; } free { k; } }";
    let project = project(text, ["time,y\n0,2\n1,0.5\n2,0.1\n", ""]);
    let options = Options {
        figure: true,
        ..Options::default()
    };
    let found = project.run("f", &options, &mut ());
    let found = found.unwrap_or_else(|errors| panic!("{errors}"));
    assert!(
        found.text().contains("x of one.csv, x = 2: 3 values"),
        "{}",
        found.text()
    );
    assert!(
        found.json().contains("\"with\":\"x = 2\""),
        "{}",
        found.json()
    );
    let figure = found.figure.as_ref().expect("it was asked for");
    assert!(figure.contains("x, x = 2") && figure.contains("x - y, x = 2"));
}
