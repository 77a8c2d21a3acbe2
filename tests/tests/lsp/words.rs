//! Words of the language: what is told of them where they stand, and what is offered there.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use nsdc::cli::Exit;
use nsdc::system::experiment::{
    FesdOptions, Lowering, MethodKind, SmoothingOptions, SteppingOptions, options_of, words_of,
    written,
};
use serde_json::Value;

use super::client::{Client, folder, memory, position};

const MODEL: &str = "\
model part_of { state y = 1; switch s = sign(y) sliding linear; y' = -s; }
model m {
  param k : 1/s = 1;
  state x = 1;
  part p = part_of;
  switch s = sign(x - 2) sliding linear;
  control u in [-1, 1] = 0;
  x' = -s + u;
}
";

/// What is told of a word behind a place that is marked with `|`; nothing where nothing is.
fn told(client: &mut Client, path: &Path, text: &str) -> Option<String> {
    let at = text.find('|').expect("it is marked");
    let text = text.replacen('|', "", 1);
    client.open(path, &text);
    let found = client.at("textDocument/hover", path, position(&text, at));
    found["contents"]["value"].as_str().map(str::to_owned)
}

/// What is offered at a place that is marked with `|`, as it would be written.
fn offered(client: &mut Client, path: &Path, text: &str) -> Vec<String> {
    let at = text.find('|').expect("it is marked");
    let text = text.replacen('|', "", 1);
    client.open(path, &text);
    let found = client.at("textDocument/completion", path, position(&text, at));
    let items = found.as_array().map_or(&[][..], Vec::as_slice).iter();
    let label = |item: &Value| item["label"].as_str().expect("a label").to_owned();
    items.map(label).collect()
}

fn experiment(kind: &str, setting: &str) -> String {
    format!("{MODEL}{kind} e of m {{ horizon 1; {setting} }}\n")
}

/// Each method with the kind of experiment that it is of.
fn methods() -> impl Iterator<Item = (&'static str, &'static str)> {
    let methods = MethodKind::words().into_iter();
    methods
        .map(|method| ("simulate", method))
        .chain([("optimize", "mpcc")])
}

#[test]
fn options_and_their_words_are_told_where_they_stand() {
    let mut client = Client::new(&[]);
    let path = memory("options.nsd");
    let (mut n_options, mut n_words) = (0, 0);
    for (kind, method) in methods() {
        let text = experiment(kind, &format!("method |{method};"));
        let said = told(&mut client, &path, &text).expect("a method is told");
        assert!(said.split_whitespace().count() > 4, "{method}: {said}");
        for option in options_of(method) {
            n_options += 1;
            let text = experiment(kind, &format!("method {method} {{ |{option} = 1; }}"));
            let said = told(&mut client, &path, &text).expect("an option is told");
            assert!(said.starts_with(&format!("`{option} = ")), "{said}");
            assert!(said.contains("default"), "{method}, {option}: {said}");
            let mut all = BTreeSet::new();
            for word in words_of(option) {
                n_words += 1;
                let value = written(&word);
                let text = experiment(kind, &format!("method {method} {{ {option} = |{value}; }}"));
                let said = told(&mut client, &path, &text).expect("a word is told");
                assert!(said.starts_with(&format!("`{word}")), "{word}: {said}");
                let (_, meaning) = said.split_once("\n\n").expect("a meaning");
                assert!(!meaning.contains("\n\n"), "{word} means one thing: {said}");
                assert!(all.insert(meaning.to_owned()), "{word}: {said}");
            }
        }
        // What is no option has no meaning there.
        let text = experiment(kind, &format!("method {method} {{ |tolerance = 1e-3; }}"));
        assert_eq!(told(&mut client, &path, &text), None, "{method}");
    }
    assert!(n_options >= 18 && n_words >= 40, "{n_options}, {n_words}");
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn defaults_are_those_of_the_compiler() {
    let mut client = Client::new(&[]);
    let path = memory("defaults.nsd");
    let [fesd, smoothing] = [
        FesdOptions::default().elements as f64,
        SmoothingOptions::default().epsilon,
    ];
    let steps = SteppingOptions::default();
    let (family, nodes) = FesdOptions::default().scheme;
    assert_eq!(steps.scheme(), (family, nodes));
    let scheme = format!("by default `{}({nodes})`", family.word());
    for (kind, method, option, expected) in [
        ("simulate", "fesd", "elements", format!("by default {fesd}")),
        ("simulate", "fesd", "scheme", scheme.clone()),
        ("simulate", "timestepping", "scheme", scheme),
        (
            "simulate",
            "timestepping",
            "steps",
            format!("by default {}", steps.steps),
        ),
        (
            "simulate",
            "smoothing",
            "epsilon",
            format!("by default {smoothing:e}"),
        ),
        ("simulate", "fesd", "cross", "by default `all`".to_owned()),
        (
            "optimize",
            "mpcc",
            "cross",
            "by default `sum_lambda`".to_owned(),
        ),
        (
            "simulate",
            "fesd",
            "equilibration",
            "by default `exact`".to_owned(),
        ),
        (
            "optimize",
            "mpcc",
            "equilibration",
            "by default `mean(0.001)`".to_owned(),
        ),
    ] {
        let text = experiment(kind, &format!("method {method} {{ |{option} = 1; }}"));
        let said = told(&mut client, &path, &text).expect("an option is told");
        assert!(said.contains(&expected), "{method}, {option}: {said}");
    }
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn words_inside_of_statements_are_told() {
    let mut client = Client::new(&[]);
    let path = memory("inside.nsd");
    for lowering in Lowering::ALL.map(Lowering::word) {
        let text = experiment("simulate", &format!("method fesd; lower |{lowering};"));
        let said = told(&mut client, &path, &text).expect("a lowering is told");
        assert!(said.starts_with(&format!("`{lowering}`")), "{said}");
        assert!(said.contains("default"), "{said}");
    }
    for (kind, setting, expected) in [
        ("simulate", "method |auto;", "`event`"),
        ("simulate", "|expect x at end < 1;", "`nsdc test`"),
        ("simulate", "expect x |always < 1;", "all reported points"),
        ("simulate", "expect x at end ~ 1 |within 1;", "that close"),
        ("simulate", "expect |status is solved;", "ends so"),
        ("simulate", "with { s.|sliding = linear; }", "Filippov"),
        (
            "simulate",
            "with { s.sliding = |nonlinear; }",
            "nonlinear sliding",
        ),
        ("simulate", "perturb every 0.1 by |gauss(1);", "deviation"),
        ("simulate", "|elements 3;", "control intervals"),
        ("simulate", "|tolerance 1e-3;", "default `1e-8`"),
        ("optimize", "controls |linear;", "straight lines"),
        ("optimize", "scheme |gauss(2);", "order 2n"),
        (
            "optimize",
            "subject to { x <= 1; } at |nodes;",
            "Runge-Kutta",
        ),
        ("fit", "loss |huber(1);", "outliers"),
    ] {
        let said = told(&mut client, &path, &experiment(kind, setting));
        let said = said.unwrap_or_else(|| panic!("{setting} is not told"));
        assert!(said.contains(expected), "{setting}: {said}");
    }
    for (old, new, expected) in [
        (
            "sliding linear;\n  control",
            "|sliding linear;\n  control",
            "Filippov",
        ),
        (
            "sliding linear;\n  control",
            "sliding |nonlinear;\n  control",
            "nonlinear sliding",
        ),
        ("sign(x - 2)", "|sign(x - 2)", "elementwise"),
    ] {
        let text = MODEL.replacen(old, new, 1);
        let said = told(&mut client, &path, &text).expect("it is told");
        assert!(said.contains(expected), "{new}: {said}");
    }
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn what_goes_on_in_a_statement_is_offered() {
    let mut client = Client::new(&[]);
    let path = memory("offers.nsd");
    let sides = "expect x at end ~ 1";
    for (kind, setting, expected) in [
        ("simulate", "with { s.sliding = | }", "linear nonlinear"),
        ("simulate", "with { s.| }", "sliding"),
        ("simulate", "with { p.s.| }", "sliding"),
        ("simulate", "expect x at |", "end k pi"),
        ("simulate", "expect x |", "always at"),
        ("simulate", "expect x + k*x |", "always at"),
        ("simulate", "expect x at end |", ""),
        ("simulate", "expect x always |", ""),
        ("simulate", &format!("{sides} |"), "at within"),
        ("simulate", &format!("{sides} at 0.5 |"), "within"),
        ("simulate", &format!("{sides} within 1 |"), ""),
        ("simulate", "expect x < 1 |", "at"),
        ("simulate", "expect mode |", "at"),
        ("simulate", "expect mode at 0.5 |", "is"),
        ("simulate", "expect status |", "is"),
        (
            "simulate",
            "method event; lower |",
            "step stewart timefreezing",
        ),
        (
            "simulate",
            "method fesd; lower |",
            "impact step stewart timefreezing",
        ),
        ("simulate", "method timestepping; lower |", "step stewart"),
        (
            "simulate",
            "method event; lower step, |",
            "step stewart timefreezing",
        ),
        ("optimize", "lower |", "impact step stewart timefreezing"),
        ("optimize", "method |", "mpcc"),
        (
            "optimize",
            "subject to { x <= 1; } at |",
            "elements intervals nodes",
        ),
    ] {
        // What is typed stands in a text that could be read before.
        let sound = setting.split("; lower").next().unwrap_or_default();
        let sound = if sound == setting {
            ""
        } else {
            &format!("{sound};")
        };
        client.open(&path, &experiment(kind, sound));
        let found = offered(&mut client, &path, &experiment(kind, setting));
        assert_eq!(found.join(" "), expected, "{setting}");
    }
    for (kind, method) in methods() {
        let text = experiment(kind, &format!("method {method} {{ | }}"));
        let mut expected = options_of(method).to_vec();
        expected.sort_unstable();
        assert_eq!(offered(&mut client, &path, &text), expected, "{method}");
    }
    assert_eq!(client.end(), Exit::Success);
}

/// What is offered as a scheme can be run.
#[test]
fn schemes_are_offered_with_their_nodes() {
    let mut client = Client::new(&[]);
    let path = memory("schemes.nsd");
    for setting in [
        "method fesd { scheme = |; }",
        "method fesd { equilibration = |; }",
    ] {
        client.open(&path, &experiment("simulate", ""));
        let found = offered(&mut client, &path, &experiment("simulate", setting));
        assert!(found.len() >= 4, "{found:?}");
        for value in found {
            let text = experiment("simulate", &setting.replacen('|', &value, 1));
            assert_eq!(client.open(&path, &text), Vec::<Value>::new(), "{value}");
        }
    }
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn experiments_units_and_files_are_offered() {
    let mut client = Client::new(&[]);
    let root = folder("offers");
    fs::write(root.join("actuators.nsd"), "const a = 1;\n").expect("it can be written");
    fs::create_dir(root.join("plants")).expect("a folder");
    let path = root.join("main.nsd");
    client.open(&root.join("unsaved.nsd"), "const b = 1;\n");
    let both = format!(
        "{}mpc loop of m {{ horizon 1; sample 0.1; controller |\n",
        experiment("optimize", "minimize final(x);")
    );
    client.open(&path, &experiment("optimize", "minimize final(x);"));
    assert_eq!(offered(&mut client, &path, &both), ["e"]);
    client.open(&path, MODEL);
    for (text, expected) in [
        (MODEL.replacen(": 1/s = 1", ": |", 1), true),
        (MODEL.replacen(": 1/s = 1", ": m/|", 1), true),
        (MODEL.replacen(": 1/s = 1", ": m = |", 1), false),
    ] {
        let found = offered(&mut client, &path, &text);
        let has = |unit: &str| found.iter().any(|found| found == unit);
        assert_eq!(has("kg") && has("Pa") && !has("sin"), expected, "{found:?}");
    }
    for (text, expected) in [
        (
            MODEL.replacen("sliding linear;\n  control", "|;\n  control", 1),
            "sliding",
        ),
        (
            MODEL.replacen("sliding linear;\n  control", "sliding |;\n  control", 1),
            "linear nonlinear",
        ),
        ("use ./|".to_owned(), "actuators plants unsaved"),
        ("use ./act|".to_owned(), "actuators plants unsaved"),
        ("use ./plants/|".to_owned(), ""),
        ("use ./plants/../|".to_owned(), "actuators plants unsaved"),
    ] {
        assert_eq!(
            offered(&mut client, &path, &text).join(" "),
            expected,
            "{text}"
        );
    }
    assert_eq!(client.end(), Exit::Success);
}
