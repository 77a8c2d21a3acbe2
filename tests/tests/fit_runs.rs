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
    // No data are compared with the run of the experiment: what is told is the first of them.
    let end = run.samples.states[0].at(run.samples.time.len() - 1)[0];
    close(end, 2.0 * (-4.0 * k.value).exp(), 1e-7);
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
    let text = "model decay { param k = 2; param a_long_name = 1; state x : m = 1; x' = -k*x; }
        fit f of decay { horizon 4; free { k; }
          data \"one.csv\" with { x = 2; } { x -> y; }
          data \"two.csv\" with { x = 3; a_long_name = 1.23456789; } { x -> y; } }";
    let project = project(
        text,
        ["time,y\n0,2\n1,0.5\n2,0.1\n", "time,y\n0,3\n1,0.7\n"],
    );
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
    let count = |text: &str| figure.matches(&format!(">\n{text}\n<")).count();
    // The run that is told, another one, and residuals of both, each point in two panels.
    assert_eq!((count("x [m]"), count("x - y")), (2, 2));
    assert_eq!(
        (count("x = 2"), count("x = 3, a_long_name = 1.23456789")),
        (1, 2)
    );
    assert_eq!(figure.matches("<circle").count(), 10);
}

/// Modes of the run that is told stand behind its panels, and behind no other: x falls by k to zero, at 1/k or at 2/k, and
/// stays there.
#[test]
fn modes_are_those_of_the_run_that_is_told() {
    let text = "model relay { param k = 0.9; state x = 1; x' = -k*sign(x); }
        fit f of relay { horizon 4; free { k in [0.1, 2]; }
          data \"one.csv\" { x -> y; } data \"two.csv\" with { x = 2; } { x -> y; } }";
    let project = project(
        text,
        [
            &exact(|t| (1.0 - t).max(0.0), 4.0),
            &exact(|t| (2.0 - t).max(0.0), 4.0),
        ],
    );
    let options = Options {
        figure: true,
        ..Options::default()
    };
    let found = project.run("f", &options, &mut ());
    let found = found.unwrap_or_else(|errors| panic!("{errors}"));
    let figure = found.figure.expect("it was asked for");
    // Of each mode a box in the legend, and one behind each of the two panels of its run, of four.
    for color in ["#E2EAF6", "#FBE8D6"] {
        let fill = format!("fill=\"{color}\"");
        assert_eq!(figure.matches(&fill).count(), 3, "{color}");
    }
}

/// Rows of a function of time, without errors.
fn exact(f: impl Fn(f64) -> f64, end: f64) -> String {
    let times = (0..11).map(|k| end * f64::from(k) / 10.0);
    table("time,y", times.map(|t| vec![t, f(t)]))
}

/// x' = n + (n > s) is n + 1 of both runs where n > 5 all along; where n may be on either side of a run's s, it is refused.
#[test]
fn comparisons_with_what_is_free_are_those_of_each_run() {
    let text = |range: &str| {
        format!(
            "model m {{ param n = 1; param s = -1; state x = 0; x' = n + (if n > s then 1 else 0); }}
            fit f of m {{ horizon 3;
              data \"one.csv\" {{ x -> y; }}
              data \"two.csv\" with {{ s = 5; }} {{ x -> y; }}
              free {{ n in {range}; }} }}"
        )
    };
    let data = exact(|t| 8.0 * t, 3.0);
    let (run, fit) = fitted(&text("[6, 10]"), [&data, &data]);
    assert_eq!(run.status, Status::Solved);
    close(estimate(&fit, "n").value, 7.0, 1e-7);
    close(fit.residual_norm, 0.0, 1e-6);
    let found = project(&text("[0, 10]"), [&data, &data]).check().list();
    let codes: Vec<_> = found.iter().filter_map(|one| one.code.as_deref()).collect();
    assert_eq!(codes, ["E0527"]);
}

/// What holds for all runs must not be another thing in one of them.
#[test]
fn what_a_fit_has_once_no_data_change() {
    let about = |declared: &str, settings: &str| {
        let text = format!(
            "model m {{ param d = 1; param w = 1; param n {declared} = 1; state x = 0; x' = n; }}
            fit f of m {{ {settings}
              data \"one.csv\" {{ x -> y; }}
              data \"two.csv\" with {{ d = 2; x = 1; }} {{ x -> y; }} }}"
        );
        let found = project(&text, [&exact(|t| t, 3.0), &exact(|t| 1.0 + t, 3.0)]).check();
        let list = found.list();
        let of = list.iter().map(|message| {
            let place = &message.labels[0].place;
            assert_eq!(message.code.as_deref(), Some("E0544"), "{found}");
            text[place.start..place.end].to_owned()
        });
        of.collect::<Vec<_>>()
    };
    assert_eq!(about("", "horizon 3; free { n in [0, 10*d]; }"), ["n"]);
    assert_eq!(about("in [0, 10*d]", "horizon 3; free { n; }"), ["n"]);
    let wrong = |setting: &str| about("", &format!("{setting} free {{ n; }}"));
    assert_eq!(wrong("horizon 3*d;"), ["horizon 3*d;"]);
    assert_eq!(wrong("horizon 3; tolerance 1e-8*d;"), ["tolerance 1e-8*d;"]);
    assert_eq!(wrong("horizon 3; loss huber(d);"), ["loss huber(d);"]);
    assert_eq!(
        wrong("horizon 3; starts 2 by gauss(d) seed 1;"),
        ["starts 2 by gauss(d) seed 1;"]
    );
    // With what data do not give, all of it is fine.
    let fine = "horizon 3; tolerance 1e-8*w; loss huber(w); starts 2 by gauss(0.1*w) seed 1; free { n in [0, 10*w]; }";
    let fine = about("in [0, 20*w]", fine);
    assert!(fine.is_empty(), "{fine:?}");
}

/// Decays of as many states as a constant says, which data give: each has its rate from the run that has its state.
#[test]
fn a_run_may_have_free_numbers_that_others_do_not_have() {
    let times = || (0..11).map(|k| 0.3 * f64::from(k));
    let decays = |rates: [f64; 2]| {
        let row = move |t: f64| vec![t, (-rates[0] * t).exp(), (-rates[1] * t).exp()];
        table("time,y,z", times().map(row))
    };
    let text = "model m { const n = 2; param k[n] = 1; state x[n] = 1; x' = -k.*x; }
        fit f of m { horizon 3;
          data \"one.csv\" { x[1] -> y; x[2] -> z; }
          data \"two.csv\" with { n = 3; } { x[1] -> y; x[3] -> z; }
          free { k; } }";
    let (run, fit) = fitted(text, [&decays([0.5, 0.8]), &decays([0.5, 1.3])]);
    assert_eq!(run.status, Status::Solved);
    let names: Vec<&str> = fit.estimates.iter().map(|one| one.name.as_str()).collect();
    assert_eq!(names, ["k[1]", "k[2]", "k[3]"]);
    for (name, rate) in names.into_iter().zip([0.5, 0.8, 1.3]) {
        close(estimate(&fit, name).value, rate, 1e-6);
    }
}

const DECAY: &str = "param k = 2; x' = -k*x;";

#[test]
fn what_every_run_warns_of_is_told_with_its_name() {
    let text = format!(
        "model decay {{ state x in [0, 1.5] = 1; {DECAY} }}
        fit f of decay {{ horizon 3;
          data \"one.csv\" {{ x -> y; }}
          data \"two.csv\" with {{ x = 2; }} {{ x -> y; }}
          free {{ k; }} }}"
    );
    let data = [1.0, 2.0].map(|c| exact(|t| c * (-t).exp(), 3.0));
    let (run, _) = fitted(&text, [&data[0], &data[1]]);
    assert_eq!((run.status, codes(&run)), (Status::Solved, vec!["W0703"]));
    let said = &run.warnings[0].message;
    assert!(said.starts_with("in the run with x = 2, "), "{said}");
}

/// x' = k x² from x(0) = 2 is 2/(1 - 2 k t), which ends at t = 1 where the search begins.
#[test]
fn where_another_run_fails_from_the_start_its_failure_is_told() {
    let text = "model m { param k = 0.5; state x = 1; x' = x^2*k; }
        fit f of m { horizon 1.5;
          data \"one.csv\" { x -> y; }
          data \"two.csv\" with { x = 2; } { x -> y; }
          free { k in [0, 3]; } }";
    let data = [1.0, 2.0].map(|c| exact(|t| c / (1.0 - 0.3 * c * t), 1.5));
    let project = project(text, [&data[0], &data[1]]);
    let found = project.run("f", &Options::default(), &mut ());
    let run = found.unwrap_or_else(|errors| panic!("{errors}")).trajectory;
    assert_eq!(run.status, Status::NumericalFailure);
    let failure = run.failure.expect("it fails").to_string();
    let end = failure.strip_prefix("in the run with x = 2, at t = ");
    let end = end.and_then(|rest| rest.split(',').next()?.parse().ok());
    close(end.unwrap_or_else(|| panic!("{failure}")), 1.0, 1e-3);
}

/// v = c exp(-t) is measured in the second run alone, with x = exp(-t) of the first one beside it, which c does not move:
/// c = Σ y exp(-t)/Σ exp(-2 t), with the residuals of both runs and one parameter.
#[test]
fn a_run_that_depends_on_nothing_free_has_residuals_all_the_same() {
    let (one, two) = (
        around(|t| (-t).exp(), 12, 21),
        around(|t| 3.0 * (-t).exp(), 10, 22),
    );
    let text =
        "model m { param k = 1; param g = 1; state x = 1; state v = 1; x' = -k*x; v' = -g*v; }
        fit f of m { horizon 3; output x;
          data \"one.csv\" { x -> y; }
          data \"two.csv\" with { x = 2; } { v -> y; }
          initial { v free; } }";
    let tables = [&one, &two].map(|points| table("time,y", rows(points)));
    let (run, fit) = fitted(text, [&tables[0], &tables[1]]);
    assert_eq!(run.status, Status::Solved);
    let sum = |f: &dyn Fn(&[f64; 2]) -> f64| two.iter().map(f).sum::<f64>();
    let (yy, of_unit) = (
        sum(&|[t, y]| y * (-t).exp()),
        sum(&|[t, _]| (-2.0 * t).exp()),
    );
    let v = estimate(&fit, "v at 0");
    close(v.value, yy / of_unit, 1e-7);
    let first: f64 = one.iter().map(|[t, y]| ((-t).exp() - y).powi(2)).sum();
    let second = sum(&|[t, y]| (v.value * (-t).exp() - y).powi(2));
    assert_eq!(fit.degrees_of_freedom, 21);
    let error = ((first + second) / 21.0 / of_unit).sqrt();
    close(v.standard_error.expect("determined"), error, 1e-7);
}

/// With a = 1.4, x passes 2.5 in the first run and not in the second one; with 0.5 it is the other way round.
#[test]
fn events_are_counted_in_each_run() {
    let text = "model m { param a = 1.4; param r = 0; param sg = 1; state x = 0; x' = r + sg*a + 0.2*step(x - 2.5); }
        fit f of m { horizon 2;
          data \"one.csv\" { x -> y; }
          data \"two.csv\" with { r = 2; sg = -1; } { x -> y; }
          free { a; } }";
    let second = |t: f64| 1.5 * t + 0.2 * (t - 2.5 / 1.5).max(0.0);
    let data = [exact(|t| 0.5 * t, 2.0), exact(second, 2.0)];
    let (run, fit) = fitted(text, [&data[0], &data[1]]);
    close(estimate(&fit, "a").value, 0.5, 1e-6);
    assert_eq!((run.status, codes(&run)), (Status::Solved, vec!["W0743"]));
    let said = &run.warnings[0].message;
    assert!(said.contains("from [1, 0] to [0, 1]"), "{said}");
}

/// Data that give the same are of one run.
#[test]
fn data_that_give_the_same_are_of_one_run() {
    let block =
        |file: &str, given: &str| format!("data \"{file}.csv\" with {{ {given} }} {{ x -> y; }}");
    let twice = [
        block("one", "x = 2; k = 1;"),
        block("one", "k = 1.0; x = 2;"),
    ]
    .concat();
    let text = |blocks: &str| {
        format!(
            "model m {{ param k = 2; param g = 1; state x = 1; x' = -k*x*g; }}
            fit f of m {{ horizon 3; {blocks} free {{ g; }} }}"
        )
    };
    let data = exact(|t| 2.0 * (-0.7 * t).exp(), 3.0);
    let found = project(&text(&twice), [&data, &data]).check();
    let codes: Vec<_> = found.list().iter().map(|one| one.code.clone()).collect();
    assert_eq!(codes, [Some("E0506".to_owned())], "{found}");
    // The files of one run may be several, and no run is that of the experiment where the data give nothing else.
    let blocks = [block("one", "x = 2; k = 1;"), block("two", "k = 1; x = 2;")].concat();
    let (run, fit) = fitted(&text(&blocks), [&data, &data]);
    assert_eq!(run.status, Status::Solved);
    close(estimate(&fit, "g").value, 0.7, 1e-7);
    assert_eq!(fit.degrees_of_freedom, 21);
}

/// u has no value but in the data.
#[test]
fn a_run_that_nobody_measured_need_not_be_there() {
    let text = "model m { param k = 2; input u; state x = 1; x' = k*(u - x); }
        fit f of m { horizon 3;
          data \"one.csv\" with { u = 3; } { x -> y; }
          data \"two.csv\" with { u = 0; } { x -> y; }
          free { k; } expect x at 0 ~ 1 within 1e-9; }";
    let data = [3.0, 0.0].map(|u| exact(|t| u + (1.0 - u) * (-0.7 * t).exp(), 3.0));
    let (run, fit) = fitted(text, [&data[0], &data[1]]);
    assert_eq!(run.status, Status::Solved);
    close(estimate(&fit, "k").value, 0.7, 1e-7);
    // The run that is told is the first one of the data.
    let end = run.samples.states[0].at(run.samples.time.len() - 1)[0];
    close(end, 3.0 - 2.0 * (-2.1f64).exp(), 1e-6);
}

#[test]
fn a_vector_of_one_entry_is_measured_by_its_entry() {
    let data = exact(|t| (-0.7 * t).exp(), 3.0);
    for named in ["x[1]", "x"] {
        let text = format!(
            "model decay {{ state x[1] = 1; {DECAY} }}
            fit f of decay {{ horizon 3; data \"one.csv\" {{ {named} -> y; }} free {{ k; }} }}"
        );
        let (run, fit) = fitted(&text, [&data, ""]);
        assert_eq!(run.status, Status::Solved);
        close(estimate(&fit, "k").value, 0.7, 1e-7);
    }
}

#[test]
fn mistakes_of_several_data_are_told_together_and_nothing_given_is_no_other_run() {
    let text = format!(
        "model decay {{ state x = 1; {DECAY} }}
        fit f of decay {{ horizon 3;
          data \"one.csv\" with {{ k = 2; }} {{ x -> y; }}
          data \"two.csv\" with {{ x = 2; }} {{ x -> z; }}
          free {{ k; }} }}"
    );
    let data = exact(|t| (-t).exp(), 3.0);
    let found = project(&text, [&data, &data]).check();
    let list = found.list();
    let codes: Vec<_> = list.iter().filter_map(|one| one.code.as_deref()).collect();
    assert_eq!(codes, ["E0541", "E0123"], "{found}");
    let said = &list[0].text;
    assert_eq!(said, "the run with k = 2 has no number that is free");
    let text = format!(
        "model decay {{ state x = 1; {DECAY} }}
        fit f of decay {{ horizon 3; data \"one.csv\" with {{ }} {{ x -> y; }} free {{ k; }} }}"
    );
    let (run, fit) = fitted(&text, [&data, ""]);
    assert_eq!(run.status, Status::Solved);
    assert_eq!(fit.data[0].with, None);
}

/// c leaves its range where data give another range.
#[test]
fn what_is_wrong_in_one_run_points_at_its_data() {
    let text = "model m { param k = 1; param most = 1; param c in [0, most] = 0.5; state x = 1; x' = -k*c*x; }
        fit f of m { horizon 3;
          data \"one.csv\" { x -> y; }
          data \"two.csv\" with { most = 0.2; } { x -> y; }
          free { k; } }";
    let data = exact(|t| (-t).exp(), 3.0);
    let list = project(text, [&data, &data]).check().list();
    let places = list[0].labels.iter().map(|label| &label.place);
    let places: Vec<_> = places.map(|place| &text[place.start..place.end]).collect();
    assert_eq!((list.len(), list[0].code.as_deref()), (1, Some("E0504")));
    assert_eq!(places, ["param c in [0, most] = 0.5;", "\"two.csv\""]);
}

/// q = v t - t²/2 of v = 2 touches the ceiling at 2, where its derivatives are lost; that of v = 1 stays below.
#[test]
fn what_is_lost_in_another_run_is_told_with_its_name() {
    let text = "model m { param u = 1; state q = 0; state v = 1; q' = v;
          mechanics q, v { mass = 1; force = -u; contact C { gap = 2 - q; restitution = 0.5; } } }
        fit f of m { horizon 3;
          data \"one.csv\" { q -> y; }
          data \"two.csv\" with { v = 2; } { q -> y; }
          free { u; } }";
    let data = [1.0, 2.0].map(|v| exact(|t| v * t - 0.5 * t * t, 3.0));
    let (run, fit) = fitted(text, [&data[0], &data[1]]);
    close(estimate(&fit, "u").value, 1.0, 1e-6);
    assert_eq!(codes(&run), ["W0710", "W0744"]);
    for warning in &run.warnings {
        let message = &warning.message;
        assert!(message.contains("in the run with v = 2, "), "{message}");
    }
}
