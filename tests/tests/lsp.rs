//! The language server, over a connection in memory, and once as a program over pipes.

mod client;
mod colours;
mod everywhere;
mod hovers;
mod mending;
mod typing;
mod typist;
mod words;

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use lsp_server::{Message, Notification, RequestId};
use nsdc::cli::Exit;
use nsdc::diagnostics::explain::{PAGES, examples};
use nsdc::expr::Exprs;
use nsdc::files::Memory;
use nsdc::project::clock::Clock;
use nsdc::syntax::Item;
use nsdc::{Project, compile};
use serde_json::{Value, json};

use self::client::{Client, PATIENCE, byte, edited, folder, memory, position, uri};

const BALL: &str = "\
/// A ball that falls.
model ball {
  const n = 2;
  /// Gravity.
  param g : m/s^2 in [0, 30] = 9.81;
  param k = 2*g;
  state q[n] : m = [1, 2];
  state v : m/s = 0;
  let height = q[1] + q[2];
  switch s = sign(v);
  fn_free: 0;
}
";

/// The model above without its wrong line, and an experiment.
fn ball() -> String {
    let rest = "  q' = [v, v];
  v' = -g;
  output scaled = k*height;
  output side = 2*s;
";
    let experiment = "
fn twice(x, y) = 2*x + y;

simulate falls of ball {
  with { g = 1.5; }
  horizon 0.1;
  tolerance 1e-6;
  expect v at end ~ -0.15 within 1e-6;
}
";
    BALL.replace("  fn_free: 0;\n", rest) + experiment
}

#[test]
fn a_client_is_served_from_its_first_word_to_its_last() {
    let mut client = Client::silent();
    let code = |answer: Result<Value, (i32, String)>| answer.expect_err("it is refused").0;
    assert_eq!(
        code(client.try_ask("textDocument/hover", json!({}))),
        -32002
    );
    client.ask("initialize", json!({ "capabilities": {} }));
    assert_eq!(
        code(client.try_ask("initialize", json!({ "capabilities": {} }))),
        -32600
    );
    assert_eq!(code(client.try_ask("nsdc/unknown", json!({}))), -32601);
    assert_eq!(
        code(client.try_ask("textDocument/hover", json!({ "no": 1 }))),
        -32602
    );
    client.tell("nsdc/unknown", json!({ "a": 1 }));
    client.tell("textDocument/didOpen", json!(["nonsense"]));
    let nothing = client.at(
        "textDocument/hover",
        &memory("missing.nsd"),
        json!({ "line": 0, "character": 0 }),
    );
    assert_eq!(nothing, Value::Null);
    client.ask("shutdown", Value::Null);
    assert_eq!(code(client.try_ask("shutdown", Value::Null)), -32600);
    client.tell("exit", Value::Null);
    assert_eq!(
        client.server.join().expect("it does not panic"),
        Exit::Success
    );
}

#[test]
fn one_that_leaves_without_a_word_is_no_success() {
    let client = Client::new(&[]);
    client.tell("exit", Value::Null);
    assert_eq!(
        client.server.join().expect("it does not panic"),
        Exit::Wrong
    );
    let Client {
        connection, server, ..
    } = Client::new(&[]);
    drop(connection);
    assert_eq!(server.join().expect("it does not panic"), Exit::Wrong);
}

/// Each wrong example gives what `nsdc check` gives, at the same places.
#[test]
fn what_is_wrong_is_told_where_it_is() {
    let mut client = Client::new(&[]);
    let (mut n_pages, mut n_codes, mut n_places) = (0, 0, 0);
    for (code, page) in PAGES {
        let folder = folder(&format!("wrong/{code}"));
        for fence in page.split("```csv ").skip(1) {
            let (name, rest) = fence.split_once('\n').expect("a name");
            let data = rest.split("```").next().unwrap_or_default();
            fs::write(folder.join(name), data).expect("it can be written");
        }
        for example in examples(page, "nsd", "wrong") {
            n_pages += 1;
            let path = folder.join("page.nsd");
            fs::write(&path, example).expect("it can be written");
            let project = Project::load(&path).expect("it is there");
            let messages = project.check().list();
            let found = client.open(&path, example);
            assert_eq!(found.len(), messages.len(), "{code}");
            for (found, message) in found.iter().zip(&messages) {
                n_codes += usize::from(message.code.as_deref() == Some(code));
                assert_eq!(found["code"].as_str(), message.code.as_deref());
                assert!(
                    found["message"]
                        .as_str()
                        .is_some_and(|text| text.starts_with(&message.text))
                );
                let severity = if message.is_error() { 1 } else { 2 };
                assert_eq!(found["severity"], severity);
                let primary = message.labels.iter().find(|label| label.is_primary);
                let Some(place) = primary.map(|label| &label.place) else {
                    continue;
                };
                if Path::new(&place.file) == path {
                    let related = found["relatedInformation"].as_array();
                    let n_related = related.map_or(0, Vec::len);
                    assert_eq!(n_related, message.labels.len() - 1, "{code}");
                    n_places += n_related;
                    assert_eq!(
                        found["range"]["start"],
                        position(example, place.start),
                        "{code}"
                    );
                    assert_eq!(
                        found["range"]["end"],
                        position(example, place.end),
                        "{code}"
                    );
                }
            }
        }
    }
    assert!(n_places >= 20, "{n_places} related places");
    // Some are only seen in a run.
    assert!(
        3 * n_codes > 2 * n_pages,
        "{n_codes} codes of {n_pages} examples"
    );
    assert_eq!(client.end(), Exit::Success);
}

/// The messages of a text without their places, which move.
fn texts(found: &[Value]) -> BTreeMap<String, usize> {
    let mut texts = BTreeMap::new();
    for found in found {
        let first = found["message"].as_str().expect("a text").lines().next();
        let text = format!("{} {}", found["code"], first.unwrap_or_default());
        *texts.entry(text).or_insert(0) += 1;
    }
    texts
}

/// Every action that is offered takes its diagnostic away and brings no other.
#[test]
fn fixes_mend_what_they_are_offered_for() {
    let mut client = Client::new(&[]);
    let errors = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/errors");
    let mut paths: Vec<PathBuf> = fs::read_dir(&errors)
        .expect("the cases are there")
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "nsd"))
        .collect();
    paths.sort();
    let mut n_actions = 0;
    for path in paths {
        let Ok(text) = fs::read_to_string(&path) else {
            continue;
        };
        let before = client.open(&path, &text);
        let whole =
            json!({ "start": { "line": 0, "character": 0 }, "end": position(&text, text.len()) });
        let params = json!({ "textDocument": { "uri": uri(&path) }, "range": whole, "context": { "diagnostics": [] } });
        let actions = client.ask("textDocument/codeAction", params);
        for action in actions.as_array().expect("a list") {
            n_actions += 1;
            let edits = action["edit"]["changes"][uri(&path)]
                .as_array()
                .expect("edits");
            let after = client.open(&path, &edited(&text, edits));
            let (mut expected, after) = (texts(&before), texts(&after));
            for (text, _) in texts(action["diagnostics"].as_array().expect("diagnostics")) {
                let known = expected.get_mut(&text).expect("it was told");
                *known -= 1;
                let left = after.get(&text).copied().unwrap_or(0);
                assert!(left <= *known, "{}: {text} stays", path.display());
            }
            // What is wrong behind mistakes of form is hidden by them.
            let is_form = |text: &str| text.starts_with("\"E00");
            let hides = texts(&before).keys().any(|text| is_form(text));
            for (told, count) in &after {
                let known = expected.get(told).copied().unwrap_or(0);
                let is_hidden = hides && !is_form(told);
                let title = &action["title"];
                assert!(
                    *count <= known || is_hidden,
                    "{}: {title} gives {told}",
                    path.display()
                );
            }
        }
        client.close(&path);
    }
    assert!(n_actions > 40, "{n_actions} actions");
    assert_eq!(client.end(), Exit::Success);
}

/// Columns count units of UTF-16, whatever stands in front.
#[test]
fn columns_are_those_of_the_protocol() {
    let mut client = Client::new(&[]);
    let path = memory("greek.nsd");
    let text =
        "model m { // 𝛼𝛽 \n  param 𝛼 = 1; param θ = 2; state x = θ*missing; x' = -θ*x*𝛼;\n}\n";
    let found = client.open(&path, text);
    let at = text.find("missing").expect("it is there");
    let unknown = found
        .iter()
        .find(|found| found["code"] == "E0101")
        .expect("it is unknown");
    assert_eq!(unknown["range"]["start"], position(text, at));
    assert_eq!(
        unknown["range"]["start"],
        json!({ "line": 1, "character": 41 })
    );
    // The name behind two letters that are two units each.
    let last = text.rfind('θ').expect("it is there");
    let place = client.at("textDocument/definition", &path, position(text, last));
    let declared = text.find('θ').expect("it is there");
    assert_eq!(place["range"]["start"], position(text, declared));
    // A letter is put behind an astral one.
    let behind = text.rfind('𝛼').expect("it is there") + '𝛼'.len_utf8();
    let range = json!({ "start": position(text, behind), "end": position(text, behind) });
    client.replace(&path, range, "2");
    let found = client.told(&path);
    assert!(
        found.iter().any(|found| found["message"]
            .as_str()
            .is_some_and(|text| text.contains("`α2`") || text.contains("`𝛼2`"))),
        "{found:?}"
    );
    assert_eq!(client.end(), Exit::Success);
}

/// Texts that are not written, and those on disk, use each other; tables too.
#[test]
fn files_and_buffers_are_one_world() {
    let folder = folder("world");
    let (plant, main) = (folder.join("plant.nsd"), folder.join("main.nsd"));
    fs::write(&plant, "model plant { state x = 1; x' = -x; }\n").expect("it can be written");
    fs::write(folder.join("data.csv"), "t,r\n0,1\n1,2\n").expect("it can be written");
    let text = "use ./plant.{plant};\nmodel whole { part p = plant; signal r = table(\"data.csv\", \"r\"); output y = p.x + r; }\nsimulate s of whole { horizon 1; }\n";
    let mut client = Client::new(&[&folder]);
    assert_eq!(client.open(&main, text), Vec::<Value>::new());
    // The state of the other file gets another name, in its buffer alone.
    client.open(&plant, "model plant { state z = 1; z' = -z; }\n");
    let found = loop {
        let found = client
            .notes
            .iter()
            .find(|note| note.params["uri"] == uri(&main).as_str());
        if let Some(note) = found {
            break note.params["diagnostics"].clone();
        }
        client.receive();
    };
    assert_eq!(found[0]["code"], "E0110", "{found}");
    client.close(&plant);
    client.notes.clear();
    // A table that is written anew is read anew.
    fs::write(folder.join("data.csv"), "t,other\n0,1\n1,2\n").expect("it can be written");
    let changed = json!({ "changes": [{ "uri": uri(&folder.join("data.csv")), "type": 2 }] });
    client.tell("workspace/didChangeWatchedFiles", changed);
    let found = loop {
        let mut told = client
            .notes
            .iter()
            .filter(|note| note.params["uri"] == uri(&main).as_str());
        if let Some(note) =
            told.rfind(|note| note.params["diagnostics"].to_string().contains("other"))
        {
            break note.params["diagnostics"].clone();
        }
        client.receive();
    };
    assert_eq!(found[0]["code"], "E0123", "{found}");
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn names_explain_themselves() {
    let mut client = Client::new(&[]);
    let (path, text) = (memory("ball.nsd"), ball());
    assert_eq!(client.open(&path, &text), Vec::<Value>::new());
    let mut hover = |word: &str, which: usize| {
        let (at, _) = text.match_indices(word).nth(which).expect("it is there");
        let found = client.at("textDocument/hover", &path, position(&text, at));
        found["contents"]["value"]
            .as_str()
            .unwrap_or_default()
            .to_owned()
    };
    let g = hover("g : m", 0);
    for part in [
        "param g : m/s^2 in [0, 30] = 9.81;",
        "Gravity.",
        "parameter of `ball`",
        "in m/s^2",
        "g = 1.5 in `falls`",
    ] {
        assert!(g.contains(part), "{g}");
    }
    assert!(hover("k*h", 0).contains("k = 3 in `falls`"));
    assert!(hover("height;", 0).contains("height = 3 at the start"));
    assert!(hover("q' =", 0).contains("a vector of 2"));
    assert!(hover("ball {\n  with", 0).contains("A ball that falls."));
    assert!(hover("tolerance", 0).contains("default `1e-8`"));
    assert!(hover("horizon", 0).contains("required"));
    assert!(hover("sign", 0).contains("off the surface"));
    assert!(hover("switch", 0).contains("sign"));
    client.open(
        &memory("code.nsd"),
        "expect error E0101;\nmodel m { state x = y; x' = 0; }\n",
    );
    let title = client.at(
        "textDocument/hover",
        &memory("code.nsd"),
        json!({ "line": 0, "character": 15 }),
    );
    assert!(
        title["contents"]["value"]
            .as_str()
            .is_some_and(|text| text.contains("E0101"))
    );
    assert_eq!(client.end(), Exit::Success);
}

/// While a line is broken, what was good last is known.
#[test]
fn a_broken_line_hides_nothing() {
    let mut client = Client::new(&[]);
    let (path, text) = (memory("broken.nsd"), ball());
    client.open(&path, &text);
    let broken = text.replace("state v : m/s = 0;", "state v : m/s = = ;\n  let w = v");
    assert!(!client.open(&path, &broken).is_empty());
    let at = broken.rfind("-g;").expect("it is there") + 1;
    let found = client.at("textDocument/hover", &path, position(&broken, at));
    assert!(
        found["contents"]["value"]
            .as_str()
            .is_some_and(|text| text.contains("param g : m/s^2") && !text.contains("1.5")),
        "{found}"
    );
    let at = broken.find("let w = v").expect("it is there") + "let w = ".len();
    let found = client.at("textDocument/completion", &path, position(&broken, at));
    let labels: Vec<&str> = found
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|item| item["label"].as_str())
        .collect();
    assert!(
        labels.contains(&"v") && labels.contains(&"height"),
        "{labels:?}"
    );
    assert_eq!(client.end(), Exit::Success);
}

/// A model with a part, and an experiment.
const TWO: &str = "use std.friction as rub;\nmodel disc { param m = 1; state a = 0; input u = 0; a' = u; }\nmodel two { part b = disc { m = 2; } let c = b.a; state y = 0; y' = c; }\nsimulate s of two { horizon 1; }\n";

/// Asks what is offered at `|`, where `to` stands in the place of `from` in [`TWO`].
fn offers(client: &mut Client, from: &str, to: &str, has: &[&str], lacks: &[&str]) {
    let (path, marked) = (memory("complete.nsd"), TWO.replacen(from, to, 1));
    assert_ne!(marked, TWO, "{from}");
    client.open(&path, TWO);
    let found = client.completes(&path, &marked);
    let offered = |name: &&&str| found.iter().any(|label| label == *name);
    let missing: Vec<&&str> = has.iter().filter(|name| !offered(name)).collect();
    assert!(
        missing.is_empty(),
        "`{to}` offers {found:?} without {missing:?}"
    );
    let wrong: Vec<&&str> = lacks.iter().filter(offered).collect();
    assert!(wrong.is_empty(), "`{to}` offers {wrong:?}");
}

#[test]
fn what_fits_in_a_model_is_offered() {
    let mut client = Client::new(&[]);
    let mut offers = |from: &str, to: &str, has: &[&str], lacks: &[&str]| {
        offers(&mut client, from, to, has, lacks)
    };
    offers("b.a;", "b.|;", &["a", "m", "u"], &["c", "sin"]);
    offers(
        "= c;",
        "= |;",
        &["b", "c", "y", "sin", "pi", "rub"],
        &["m", "horizon"],
    );
    offers("= c;", "= rub.|;", &["coulomb"], &["c"]);
    offers("{ m = 2; }", "{ | }", &["m", "u"], &["c", "y"]);
    offers("= disc {", "= | {", &["disc"], &["c", "sin"]);
    offers("of two", "of |", &["two", "disc"], &["c"]);
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn what_fits_in_an_experiment_is_offered() {
    let mut client = Client::new(&[]);
    let mut offers = |from: &str, to: &str, has: &[&str], lacks: &[&str]| {
        offers(&mut client, from, to, has, lacks)
    };
    offers(
        "horizon 1;",
        "horizon 1; |",
        &["tolerance", "method", "with", "expect"],
        &["minimize", "state"],
    );
    offers(
        "horizon 1;",
        "horizon 1; method |",
        &["event", "fesd"],
        &["c"],
    );
    offers(
        "horizon 1;",
        "horizon 1; method event { | }",
        &["order", "max_events"],
        &["c"],
    );
    offers(
        "horizon 1;",
        "horizon 1; method fesd { scheme = | }",
        &["radau_iia(4)", "gauss(4)"],
        &["c", "sin"],
    );
    offers(
        "horizon 1;",
        "horizon 1; method event { branch = | }",
        &["plus", "slide"],
        &["c"],
    );
    offers(
        "horizon 1;",
        "horizon 1; lower |",
        &["step", "timefreezing"],
        &["c"],
    );
    offers(
        "horizon 1;",
        "horizon 1; with { | }",
        &["b", "y"],
        &["tolerance"],
    );
    offers(
        "horizon 1;",
        "horizon 1; expect warning |",
        &["W0701"],
        &["E0101"],
    );
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn what_fits_in_a_file_is_offered() {
    let mut client = Client::new(&[]);
    let mut offers = |from: &str, to: &str, has: &[&str], lacks: &[&str]| {
        offers(&mut client, from, to, has, lacks)
    };
    offers(
        "simulate s",
        "expect error |;\nsimulate s",
        &["E0101"],
        &["W0701"],
    );
    offers(
        "simulate s",
        "| simulate s",
        &["model", "simulate", "fn"],
        &["state"],
    );
    offers(
        "use std.friction as rub;",
        "use std.|;",
        &["friction", "prelude"],
        &[],
    );
    offers(
        "part b",
        "| part b",
        &["state", "region", "param"],
        &["horizon"],
    );
    offers("use std.friction as rub;", "// us|", &[], &["use"]);
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn calls_are_told() {
    let mut client = Client::new(&[]);
    let path = memory("calls.nsd");
    let text = ball().replace("2*s;", "2*s + twice(1, 2) + sat(k, 1, 2);");
    assert_eq!(client.open(&path, &text), Vec::<Value>::new());
    let mut help = |before: &str| {
        let at = text.find(before).expect("it is there") + before.len();
        client.at("textDocument/signatureHelp", &path, position(&text, at))
    };
    let own = help("twice(1, ");
    assert_eq!(own["signatures"][0]["label"], "twice(x, y)");
    assert_eq!(own["activeParameter"], 1);
    let sat = help("sat(k, 1, ");
    assert_eq!(sat["signatures"][1]["label"], "sat(x, lo, hi)");
    assert_eq!(
        (&sat["activeSignature"], &sat["activeParameter"]),
        (&json!(1), &json!(2))
    );
    assert_eq!(help("with { "), Value::Null);
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn texts_have_an_outline() {
    let mut client = Client::new(&[]);
    let (path, text) = (memory("outline.nsd"), ball());
    client.open(&path, &text);
    let document = json!({ "textDocument": { "uri": uri(&path) } });
    let symbols = client.ask("textDocument/documentSymbol", document.clone());
    let names = |symbols: &Value| -> Vec<String> {
        let all = symbols.as_array().expect("a list").iter();
        all.map(|symbol| symbol["name"].as_str().expect("a name").to_owned())
            .collect()
    };
    assert_eq!(names(&symbols), ["ball", "twice", "falls"]);
    assert_eq!(
        names(&symbols[0]["children"]),
        ["n", "g", "k", "q", "v", "height", "s", "scaled", "side"]
    );
    let found = client.ask("workspace/symbol", json!({ "query": "hgt" }));
    assert_eq!(found[0]["name"], "height");
    assert_eq!(found[0]["containerName"], "ball");
    let folds = client.ask("textDocument/foldingRange", document.clone());
    let first = &folds[0];
    assert_eq!(
        (&first["startLine"], &first["endLine"]),
        (&json!(1), &json!(14))
    );
    let at = position(&text, text.find("q[1]").expect("it is there") + 2);
    let params = json!({ "textDocument": { "uri": uri(&path) }, "positions": [at] });
    let mut range = client.ask("textDocument/selectionRange", params)[0].clone();
    let mut texts = Vec::new();
    while !range.is_null() {
        let [start, end] = ["start", "end"].map(|end| byte(&text, &range["range"][end]));
        texts.push(text[start..end].to_owned());
        range = range["parent"].clone();
    }
    assert_eq!(texts[..3], ["1", "[1]", "let height = q[1] + q[2];"]);
    assert_eq!(texts.last().map(String::as_str), Some(&*text));
    let messy = text.replace("  param k = 2*g;", "     param   k=2 * g ;");
    client.open(&path, &messy);
    let edits = client.ask("textDocument/formatting", json!({ "textDocument": { "uri": uri(&path) }, "options": { "tabSize": 2, "insertSpaces": true } }));
    assert_eq!(edited(&messy, edits.as_array().expect("edits")), text);
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn experiments_have_lenses_and_parameters_their_values() {
    let mut client = Client::new(&[]);
    let (path, text) = (memory("lenses.nsd"), ball());
    client.open(&path, &text);
    let hints = client.ask("textDocument/inlayHint", json!({ "textDocument": { "uri": uri(&path) }, "range": { "start": { "line": 0, "character": 0 }, "end": { "line": 99, "character": 0 } } }));
    let labels: Vec<&str> = hints
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|hint| hint["label"].as_str())
        .collect();
    assert_eq!(labels, ["= 3", ": m"]);
    let document = json!({ "textDocument": { "uri": uri(&path) } });
    let lenses = client.ask("textDocument/codeLens", document);
    let titles: Vec<&str> = lenses
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|lens| lens["command"]["title"].as_str())
        .collect();
    assert_eq!(titles, ["run", "plot", "test", "verify", "emit"]);
    assert_eq!(client.end(), Exit::Success);
}

/// The systems of all experiments of a file, as they are printed.
fn systems(path: &Path, text: &str) -> Vec<String> {
    let files: Memory = [(path, text)].into_iter().collect();
    let project = Project::from_files(path, files).expect("the text is there");
    let found = project.check();
    assert!(!found.has_errors(), "{found}");
    let file = nsdc::syntax::File {
        items: project.items().cloned().collect(),
        data: Default::default(),
        span: Default::default(),
    };
    let experiments = file.items.iter().filter_map(|item| match item {
        Item::Experiment(experiment) => Some(experiment),
        _ => None,
    });
    let mut systems = Vec::new();
    for experiment in experiments {
        let exprs = Exprs::new();
        let mut diags = nsdc::diagnostics::Diagnostics::new();
        let compiled = compile(
            &exprs,
            &file,
            experiment,
            &[],
            &mut Clock::default(),
            &mut diags,
        );
        systems.extend(compiled.map(|compiled| compiled.lowered().to_string()));
    }
    systems
}

/// Words of a text with one in the place of another.
fn with_word(text: &str, old: &str, new: &str) -> String {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let words = text.split_inclusive(|c| !is_part(c));
    let words = words.map(|word| {
        let letters = word.trim_end_matches(|c| !is_part(c));
        match letters == old {
            true => word.replacen(old, new, 1),
            false => word.to_owned(),
        }
    });
    words.collect()
}

/// Names of examples get others, here and there, and each system stays as it was but for the name.
#[test]
fn other_names_change_no_meaning() {
    let mut client = Client::new(&[]);
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    let mut n_renamed = 0;
    for name in [
        "oscillator",
        "parts",
        "stick_slip",
        "bouncing_ball",
        "hidden_modes",
        "tanks",
        "sliding_ocp",
        "servo",
    ] {
        let path = examples.join(format!("{name}.nsd"));
        let text = fs::read_to_string(&path).expect("the example is there");
        client.open(&path, &text);
        let before = systems(&path, &text);
        assert!(!before.is_empty());
        let index = Project::load(&path).expect("it is there").index();
        let inside = index
            .definitions()
            .iter()
            .filter(|known| known.place.end as usize <= text.len());
        for known in inside {
            let at = position(&text, known.place.start as usize);
            let params = json!({ "textDocument": { "uri": uri(&path) }, "position": at, "newName": "renamed_7" });
            let edits = match client.try_ask("textDocument/rename", params) {
                Ok(found) => found["changes"][uri(&path)]
                    .as_array()
                    .expect("edits")
                    .clone(),
                Err((code, _)) => {
                    assert_eq!(code, -32803);
                    continue;
                }
            };
            n_renamed += 1;
            let after = systems(&path, &edited(&text, &edits));
            assert_eq!(after.len(), before.len());
            for (before, after) in before.iter().zip(&after) {
                let back = with_word(after, "renamed_7", &known.name);
                assert_eq!(back, *before, "{name}: {}", known.name);
            }
        }
    }
    assert!(n_renamed > 80, "{n_renamed} names");
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn a_name_that_would_mean_something_else_is_refused() {
    let mut client = Client::new(&[]);
    let (path, text) = (memory("refused.nsd"), ball());
    client.open(&path, &text);
    let mut rename = |word: &str, new: &str| {
        let at = position(&text, text.find(word).expect("it is there"));
        let params =
            json!({ "textDocument": { "uri": uri(&path) }, "position": at, "newName": new });
        client
            .try_ask("textDocument/rename", params)
            .map_err(|(code, _)| code)
    };
    for taken in [
        "v",
        "height",
        "ball2 ",
        "pi",
        "if",
        "2x",
        "a b",
        "sin",
        "",
        "a = 1; const b",
        "twice",
    ] {
        let expected = taken == "ball2 ";
        assert_eq!(rename("g : m", taken).is_ok(), expected, "`{taken}`");
    }
    assert_eq!(rename("tolerance", "x"), Err(-32803));
    assert_eq!(client.end(), Exit::Success);
}

/// A name of one file is another one in all files.
#[test]
fn names_are_renamed_in_all_files() {
    let folder = folder("rename");
    let (plant, main, other) = (
        folder.join("plant.nsd"),
        folder.join("main.nsd"),
        folder.join("other.nsd"),
    );
    let plant_text = "model plant { param k = 1; state x = 1; x' = -k*x; }\n";
    let main_text = "use ./plant.{plant};\nmodel whole { part p = plant { k = 2; } output y = p.x; }\nsimulate s of whole { horizon 1; with { p.k = 3; } expect p.x at end <= 1; }\n";
    let other_text = "use ./plant;\nsimulate t of plant.plant { with { k = 3; } horizon 1; output x; expect x at end < 1; }\n";
    for (path, text) in [
        (&plant, plant_text),
        (&main, main_text),
        (&other, other_text),
    ] {
        fs::write(path, text).expect("it can be written");
    }
    let mut client = Client::new(&[&folder]);
    assert_eq!(client.open(&main, main_text), Vec::<Value>::new());
    let at = position(main_text, main_text.find("x; }").expect("it is there"));
    let place = client.at("textDocument/definition", &main, at.clone());
    assert_eq!(place["uri"], uri(&plant));
    let params = json!({ "textDocument": { "uri": uri(&main) }, "position": at.clone(), "context": { "includeDeclaration": true } });
    let all = client.ask("textDocument/references", params);
    assert_eq!(all.as_array().map(Vec::len), Some(7), "{all}");
    let params = json!({ "textDocument": { "uri": uri(&main) }, "position": at, "newName": "z" });
    let changes = client.ask("textDocument/rename", params)["changes"].clone();
    let mut renamed = Vec::new();
    for (path, text) in [
        (&plant, plant_text),
        (&main, main_text),
        (&other, other_text),
    ] {
        let edits = changes[uri(path)].as_array().expect("edits");
        let new = edited(text, edits);
        assert_eq!(with_word(&new, "z", "x"), text);
        renamed.push((path.clone(), new));
    }
    for path in [&main, &other] {
        let files: Memory = renamed.iter().cloned().collect();
        let found = Project::from_files(path, files)
            .expect("it is there")
            .check();
        assert!(found.is_empty(), "{found}");
    }
    // `k` of the plant is free in the whole, and taken where it is.
    let at = position(plant_text, plant_text.find("k = 1").expect("it is there"));
    let params = json!({ "textDocument": { "uri": uri(&plant) }, "position": at, "newName": "x" });
    assert_eq!(
        client
            .try_ask("textDocument/rename", params)
            .map_err(|(code, _)| code),
        Err(-32803)
    );
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn experiments_are_run_and_canceled_beside() {
    let mut client = Client::new(&[]);
    let (path, text) = (
        memory("runs.nsd"),
        ball()
            + "model spin { state x = 1; state y = 0; x' = -y; y' = x; }\nsimulate long of spin { horizon 1e9; }\nsimulate falls_far of ball { horizon 0.1; expect v at end > 0; }\n",
    );
    assert_eq!(client.open(&path, &text), Vec::<Value>::new());
    let command = |word: &str, name: &str| json!({ "command": format!("nsdc.{word}"), "arguments": [uri(&path), name], "workDoneToken": "shown" });
    let run = client.ask("workspace/executeCommand", command("run", "falls"));
    assert_eq!(run["status"], 0, "{run}");
    assert!(
        run["text"]
            .as_str()
            .is_some_and(|text| text.contains("solved")),
        "{run}"
    );
    let kinds: Vec<&str> = client
        .notes
        .iter()
        .filter(|note| note.method == "$/progress")
        .filter_map(|note| note.params["value"]["kind"].as_str())
        .collect();
    assert_eq!(
        (kinds.first(), kinds.last()),
        (Some(&"begin"), Some(&"end"))
    );
    let plot = client.ask("workspace/executeCommand", command("plot", "falls"));
    assert!(
        plot["figure"]
            .as_str()
            .is_some_and(|text| text.starts_with("<svg")),
        "{plot}"
    );
    for (word, part) in [
        // Of this one alone.
        ("test", "1 passed, 0 failed"),
        ("verify", "falls"),
        ("emit", "der(v) ="),
    ] {
        let came = client.ask("workspace/executeCommand", command(word, "falls"));
        assert!(
            came["text"]
                .as_str()
                .is_some_and(|text| text.contains(part)),
            "{word}: {came}"
        );
    }
    assert_eq!(
        client
            .try_ask("workspace/executeCommand", command("fly", "falls"))
            .map_err(|(code, _)| code),
        Err(-32602)
    );
    // Others are answered while one runs, which ends when it is canceled.
    let long = client.send("workspace/executeCommand", command("run", "long"));
    let symbols = client.ask(
        "textDocument/documentSymbol",
        json!({ "textDocument": { "uri": uri(&path) } }),
    );
    assert!(symbols.is_array());
    client.tell("$/cancelRequest", json!({ "id": client.last - 1 }));
    let ended = client.response(&long);
    assert_eq!(
        ended.response_result.map_err(|error| error.code),
        Err(-32800)
    );
    assert_eq!(client.end(), Exit::Success);
}

/// What an editor is shown of experiments of one name in different files stays different.
#[test]
fn results_of_files_are_not_confused() {
    let mut program = Program::new("results");
    let show = json!({ "capabilities": { "window": { "showDocument": { "support": true } } } });
    assert!(program.ask("initialize", &show).is_ok());
    let mut shown = BTreeMap::new();
    for rate in [1, 2] {
        let path = format!("/nowhere/{rate}/same.nsd");
        let text =
            format!("model m {{ state x = 0; x' = {rate}; }} simulate s of m {{ horizon 1; }}");
        program.open(&path, &text);
        let command =
            json!({ "command": "nsdc.run", "arguments": [format!("file://{path}"), "s"] });
        let came = program
            .ask("workspace/executeCommand", &command)
            .expect("it runs");
        let uri = came["uri"].as_str().expect("it is shown").to_owned();
        shown.insert(uri, came["text"].as_str().expect("a text").to_owned());
    }
    assert_eq!(shown.len(), 2);
    for (uri, text) in &shown {
        let file = fs::read_to_string(uri.trim_start_matches("file://"));
        assert_eq!(file.expect("it is there"), *text);
    }
    assert_eq!(program.shut_down().0, Some(0));
}

/// All that a lens does tells how far it is, and ends where its progress is canceled.
#[test]
fn every_lens_is_canceled() {
    let mut client = Client::new(&[]);
    let path = memory("long.nsd");
    // To write a program down, the run that it starts from is made first.
    let text = "
model swing { control u in [-1, 1] = 0; state x = 1; state y = 0; x' = -sign(y) + u; y' = x; }
simulate long of swing { horizon 1e6; }
optimize plan of swing { horizon 1; intervals 2; minimize final(x^2); guess { from long; } }
";
    assert_eq!(client.open(&path, text), Vec::<Value>::new());
    for word in ["run", "plot", "test", "verify", "emit"] {
        let (name, first) = match word {
            "emit" => ("plan", "begin"),
            _ => ("long", "report"),
        };
        let command = json!({ "command": format!("nsdc.{word}"), "arguments": [uri(&path), name, "nl"], "workDoneToken": word });
        let asked = client.send("workspace/executeCommand", command);
        let told = |note: &Notification, kind: &str| {
            note.method == "$/progress"
                && note.params["token"] == word
                && note.params["value"]["kind"] == kind
        };
        while !client.notes.iter().any(|note| told(note, first)) {
            assert!(client.receive().is_none(), "{word} has ended");
        }
        let mut begun = client.notes.iter().filter(|note| told(note, "begin"));
        let begun = begun.next().expect("it was told first");
        assert_eq!(begun.params["value"]["cancellable"], true);
        let token = json!({ "token": word });
        client.tell("window/workDoneProgress/cancel", token);
        let ended = client.response(&asked).response_result;
        let code = ended.map_err(|error| error.code);
        assert_eq!(code, Err(-32800), "{word}");
        let reports = client.notes.iter().filter(|note| told(note, "report"));
        let shares = reports.filter_map(|note| note.params["value"].get("percentage"));
        let shares: Vec<u64> = shares
            .map(|share| share.as_u64().expect("a number, where it is known"))
            .collect();
        assert!(shares.is_sorted(), "{word}: {shares:?}");
    }
    assert_eq!(client.end(), Exit::Success);
}

/// What is written again is run again, until it is interrupted.
#[cfg(unix)]
#[test]
fn saved_files_are_watched() {
    let folder = folder("watch");
    let (path, figure) = (folder.join("fall.nsd"), folder.join("fall.svg"));
    let text = |g: &str| {
        format!(
            "model fall {{ param g = {g}; state v = 0; v' = -g; }}\nsimulate s of fall {{ horizon 1; }}\n"
        )
    };
    fs::write(&path, text("2")).expect("it can be written");
    let child = Command::new(program())
        .args([
            "watch".as_ref(),
            path.as_os_str(),
            "--plot".as_ref(),
            figure.as_os_str(),
        ])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program was built");
    let mut child = Guarded(child);
    let output = BufReader::new(child.0.stdout.take().expect("a pipe"));
    let (sender, lines) = mpsc::channel();
    std::thread::spawn(move || {
        let lines = output.lines().map_while(Result::ok);
        lines
            .take_while(|line| sender.send(line.clone()).is_ok())
            .count()
    });
    let wait = |part: &str| {
        while !lines
            .recv_timeout(PATIENCE)
            .expect("it goes on")
            .contains(part)
        {}
    };
    wait("solved");
    fs::write(&path, text("30")).expect("it can be written");
    wait("other numbers");
    wait("- v at end = -2 within");
    wait("+ v at end = -30 within");
    let interrupted = Command::new("kill")
        .args(["-INT", &child.0.id().to_string()])
        .status();
    assert!(interrupted.expect("there is `kill`").success());
    assert_eq!(child.ended(), Some(0));
    assert!(
        fs::read_to_string(&figure)
            .expect("it was drawn")
            .starts_with("<svg")
    );
}

/// Tests are in a folder beside the programs.
fn program() -> PathBuf {
    let own = std::env::current_exe().expect("a program");
    own.ancestors().nth(2).expect("a folder").join("nsdc")
}

/// A program that ends with its test.
struct Guarded(Child);

impl Drop for Guarded {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Guarded {
    /// The exit status.
    fn ended(&mut self) -> Option<i32> {
        let start = Instant::now();
        loop {
            if let Some(status) = self.0.try_wait().expect("it is there") {
                return status.code();
            }
            assert!(start.elapsed() < PATIENCE, "it does not end");
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

/// The program, with pipes.
struct Program {
    child: Guarded,
    input: ChildStdin,
    /// What it sends, until it ends.
    output: mpsc::Receiver<Result<Message, String>>,
    last: i32,
}

impl Program {
    fn new(name: &str) -> Self {
        let mut child = Command::new(program())
            .arg("lsp")
            .env("XDG_CACHE_HOME", folder(&format!("cache/{name}")))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program was built");
        let input = child.stdin.take().expect("a pipe");
        let mut read = BufReader::new(child.stdout.take().expect("a pipe"));
        let (sender, output) = mpsc::channel();
        std::thread::spawn(move || {
            while let Some(found) = Message::read(&mut read).transpose() {
                let is_last = found.is_err();
                let sent = sender.send(found.map_err(|error| error.to_string()));
                if is_last || sent.is_err() {
                    break;
                }
            }
        });
        Program {
            child: Guarded(child),
            input,
            output,
            last: 100,
        }
    }

    fn send(&mut self, method: &str, params: &Value) -> i32 {
        self.last += 1;
        let (id, version) = (self.last, "2.0");
        self.write(
            &json!({ "jsonrpc": version, "id": id, "method": method, "params": params })
                .to_string(),
        );
        id
    }

    fn tell(&mut self, method: &str, params: &Value) {
        self.write(&json!({ "jsonrpc": "2.0", "method": method, "params": params }).to_string());
    }

    /// The answer, or the code of an error.
    fn ask(&mut self, method: &str, params: &Value) -> Result<Value, i32> {
        let id = RequestId::from(self.send(method, params));
        loop {
            if let Message::Response(response) = self.read() {
                assert_eq!(response.id, id, "answers come in order");
                return response.response_result.map_err(|error| error.code);
            }
        }
    }

    fn open(&mut self, path: &str, text: &str) {
        let document = json!({ "uri": format!("file://{path}"), "languageId": "nsd", "version": 1, "text": text });
        self.tell("textDocument/didOpen", &json!({ "textDocument": document }));
    }

    /// The first words.
    fn initialize(&mut self) {
        self.write(INITIALIZE);
        self.read();
    }

    /// The number of its process.
    fn id(&self) -> u32 {
        self.child.0.id()
    }

    /// The exit status after good byes, and what it has written besides.
    fn shut_down(mut self) -> (Option<i32>, String) {
        assert_eq!(self.ask("shutdown", &Value::Null), Ok(Value::Null));
        self.tell("exit", &Value::Null);
        self.end()
    }

    fn write(&mut self, body: &str) {
        write!(self.input, "Content-Length: {}\r\n\r\n{body}", body.len()).expect("it reads");
        self.input.flush().expect("it reads");
    }

    fn read(&mut self) -> Message {
        let read = self.output.recv_timeout(PATIENCE);
        read.expect("one more").expect("a message")
    }

    /// The exit status, and what it has written besides.
    fn end(self) -> (Option<i32>, String) {
        let Program {
            mut child,
            input,
            output,
            ..
        } = self;
        drop(input);
        let code = child.ended();
        let rest = output.iter().map(|message| format!("{message:?}"));
        (code, rest.collect())
    }
}

const INITIALIZE: &str = r#"{"jsonrpc":"2.0","id":1,"method":"initialize","params":{"capabilities":{"textDocument":{"publishDiagnostics":{"codeDescriptionSupport":true}}}}}"#;

#[test]
fn the_program_talks_over_pipes() {
    let mut program = Program::new("talks");
    program.write(INITIALIZE);
    assert!(
        matches!(program.read(), Message::Response(response) if response.response_result.is_ok())
    );
    program.write(r#"{"jsonrpc":"2.0","method":"textDocument/didOpen","params":{"textDocument":{"uri":"file:///nowhere/a.nsd","languageId":"nsd","version":1,"text":"model m { state x = y; x' = 0; }"}}}"#);
    let Message::Notification(note) = program.read() else {
        panic!("diagnostics come");
    };
    let page = note.params["diagnostics"][0]["codeDescription"]["href"]
        .as_str()
        .expect("a link")
        .to_owned();
    let page = fs::read_to_string(page.trim_start_matches("file://")).expect("the page is there");
    assert!(page.starts_with("# E0101: "));
    program.write(r#"{"jsonrpc":"2.0","id":2,"method":"shutdown"}"#);
    assert!(
        matches!(program.read(), Message::Response(response) if response.response_result.is_ok())
    );
    program.write(r#"{"jsonrpc":"2.0","method":"exit"}"#);
    assert_eq!(program.end(), (Some(0), String::new()));
}

#[test]
fn the_program_ends_with_what_makes_no_sense() {
    // A client that is gone, and one that sends what is no JSON.
    let mut program = Program::new("gone");
    program.initialize();
    assert_eq!(program.end(), (Some(1), String::new()));
    let mut program = Program::new("nonsense");
    program.initialize();
    program.write("{ this is no JSON");
    assert_eq!(program.end(), (Some(1), String::new()));
    // Lengths that nothing has.
    for length in ["99999999999999", "18446744073709551616", "-1", "9"] {
        let mut program = Program::new(&format!("length {length}"));
        program.initialize();
        write!(program.input, "Content-Length: {length}\r\n\r\n{{}}").expect("it reads");
        assert_eq!(program.end(), (Some(1), String::new()));
    }
}

/// The ends of the pipes are held by this process, and the client was another one.
#[cfg(unix)]
#[test]
fn the_program_ends_with_its_client() {
    let mut other = Command::new("true").spawn().expect("it is there");
    other.wait().expect("it ends");
    let mut program = Program::new("left");
    let client = json!({ "processId": other.id(), "capabilities": {} });
    program.ask("initialize", &client).expect("it is answered");
    assert_eq!(program.child.ended(), Some(1));
}

#[test]
fn the_program_does_not_wait_for_what_it_runs() {
    let text = "model spin { state x = 1; state y = 0; x' = -y; y' = x; }\nsimulate long of spin { horizon 1e9; expect x at end < 2; }\n";
    for is_told in [true, false] {
        let mut program = Program::new(&format!("runs {is_told}"));
        program.initialize();
        program.open("/nowhere/long.nsd", text);
        let command =
            json!({ "command": "nsdc.test", "arguments": ["file:///nowhere/long.nsd", "long"] });
        program.send("workspace/executeCommand", &command);
        if is_told {
            assert_eq!(program.ask("shutdown", &Value::Null), Ok(Value::Null));
            program.tell("exit", &Value::Null);
        }
        let (code, _) = program.end();
        assert_eq!(code, Some(i32::from(!is_told)));
    }
}

/// What is shown of the standard library is the standard library.
#[test]
fn the_standard_library_keeps_its_names() {
    let mut program = Program::new("standard");
    program.initialize();
    let text = "use std.friction as rub;\nmodel m { state v = 1; v' = -rub.coulomb(v, 1); }\nsimulate s of m { horizon 1; }\n";
    program.open("/nowhere/rub.nsd", text);
    let at = position(text, text.find("coulomb").expect("it is there"));
    let point = json!({ "textDocument": { "uri": "file:///nowhere/rub.nsd" }, "position": at });
    let place = program
        .ask("textDocument/definition", &point)
        .expect("a place");
    let shown = place["uri"].as_str().expect("a file").to_owned();
    let path = shown.trim_start_matches("file://").replace("%20", " ");
    program.open(&path, &fs::read_to_string(&path).expect("it is written"));
    let point = json!({ "textDocument": { "uri": shown }, "position": place["range"]["start"], "context": { "includeDeclaration": true }, "newName": "other" });
    let all = program
        .ask("textDocument/references", &point)
        .expect("places");
    let mut files: Vec<&str> = (all.as_array().expect("a list").iter())
        .filter_map(|place| place["uri"].as_str())
        .collect();
    files.sort_unstable();
    files.dedup();
    let mut expected = [shown.as_str(), "file:///nowhere/rub.nsd"];
    expected.sort_unstable();
    assert_eq!(files, expected);
    assert_eq!(program.ask("textDocument/rename", &point), Err(-32803));
    assert_eq!(
        program.ask("textDocument/prepareRename", &point),
        Err(-32803)
    );
}

/// Words of the language are no names of a model, whatever is called so.
#[test]
fn words_of_the_language_are_no_names() {
    let text = r#"
fn mean(x) = x;
model m {
  param newton = 0.5;
  state linear = 1;
  state all = 0;
  state crossing = 0;
  state q = 1;
  state v = 0;
  signal r = table("data.csv", "r", fit = linear);
  switch s = sign(linear);
  linear' = -linear + mean(r);
  mechanics q, v {
    mass = 1;
    force = all;
  }
  contact floor { gap = q; restitution = newton(newton); }
}
simulate one of m {
  horizon 1;
  with { s = linear; q = linear; }
  method fesd { cross = all; equilibration = mean(2); }
  expect len(events(crossing)) == 0;
  expect crossing at end < linear;
}
"#;
    let project = Project::from_text("words.nsd", text);
    let index = project.index();
    for (name, places) in [
        // Declared, the switch, both sides of the equation, what `q` is given, an expectation.
        ("linear", 6),
        ("newton", 2),
        ("all", 2),
        ("crossing", 2),
        ("mean", 2),
    ] {
        let found = index.occurrences().iter();
        let found = found.filter(|known| {
            text.get(known.span.start as usize..known.span.end as usize) == Some(name)
        });
        assert_eq!(found.count(), places, "{name}");
    }
}

/// What is renamed in files that are not open is what is there now.
#[test]
fn files_are_renamed_as_they_are() {
    let folder = folder("stale");
    let (plant, main) = (folder.join("plant.nsd"), folder.join("main.nsd"));
    let plant_text = "model plant { state x = 1; x' = -x; }\n";
    let main_text = "use ./plant.{plant};\nmodel whole { part p = plant; output y = p.x; }\nsimulate s of whole { horizon 1; }\n";
    fs::write(&plant, plant_text).expect("it can be written");
    fs::write(&main, main_text).expect("it can be written");
    let mut client = Client::new(&[&folder]);
    assert_eq!(client.open(&main, main_text), Vec::<Value>::new());
    let at = position(main_text, main_text.find("x; }").expect("it is there"));
    let params = json!({ "textDocument": { "uri": uri(&main) }, "position": at, "newName": "z" });
    client.ask("textDocument/rename", params.clone());
    let now = format!("// A comment above.\n{plant_text}");
    fs::write(&plant, &now).expect("it can be written");
    let changes = client.ask("textDocument/rename", params.clone())["changes"].clone();
    let edits = changes[uri(&plant)].as_array().expect("edits");
    let renamed = edited(&now, edits);
    assert_eq!(renamed, now.replace("x", "z"));
    // Where another file that knows the name is broken, it may be named in what is not understood.
    let other = folder.join("other.nsd");
    fs::write(
        &other,
        "use ./plant;\nsimulate t of plant.plant { horizon 1; expect x at at end < 1; }\n",
    )
    .expect("it can be written");
    let refused = client
        .try_ask("textDocument/rename", params.clone())
        .expect_err("it is refused");
    assert_eq!(refused.0, -32803);
    assert!(refused.1.contains("other.nsd"), "{}", refused.1);
    // Goldens have names, too.
    fs::write(
        &other,
        "use ./plant;\nsimulate t of plant.plant { horizon 1; expect numbers golden; }\n",
    )
    .expect("it can be written");
    assert!(
        client
            .try_ask("textDocument/rename", params.clone())
            .is_ok()
    );
    let goldens = folder.join("other.golden");
    fs::create_dir(&goldens).expect("it can be made");
    fs::write(goldens.join("t.numbers"), "xx at end = 1 within 1e-8\n").expect("it can be written");
    assert!(
        client
            .try_ask("textDocument/rename", params.clone())
            .is_ok()
    );
    fs::write(goldens.join("t.numbers"), "x at end = 1 within 1e-8\n").expect("it can be written");
    let refused = client
        .try_ask("textDocument/rename", params)
        .expect_err("it is refused");
    assert!(refused.1.contains("t.numbers"), "{}", refused.1);
    assert_eq!(client.end(), Exit::Success);
}

/// While a line is broken, what is found is where it is now.
#[test]
fn definitions_are_found_in_broken_texts() {
    let mut client = Client::new(&[]);
    let (path, text) = (memory("moved.nsd"), ball());
    client.open(&path, &text);
    let broken = format!("// One more line.\nmodel {{ = ;\n{text}");
    assert!(!client.open(&path, &broken).is_empty());
    for (name, declared) in [("g;", "g : m"), ("k*h", "k = 2"), ("s;", "s = sign")] {
        let at = broken.rfind(name).expect("it is there");
        let found = client.at("textDocument/definition", &path, position(&broken, at));
        let place = position(&broken, broken.find(declared).expect("it is there"));
        assert_eq!(found["range"]["start"], place, "{name}");
    }
    assert_eq!(client.end(), Exit::Success);
}

/// A text that is saved for the first time, in a folder with two names, stays the same.
#[cfg(unix)]
#[test]
fn texts_that_are_saved_stay_the_same() {
    let folder = folder("links");
    let (real, link) = (folder.join("real"), folder.join("link"));
    fs::create_dir(&real).expect("it can be made");
    std::os::unix::fs::symlink(&real, &link).expect("it can be linked");
    let path = link.join("new.nsd");
    let text = "model m { state x = 1; x' = -x; }\n";
    let mut client = Client::new(&[&link]);
    assert_eq!(client.open(&path, text), Vec::<Value>::new());
    fs::write(&path, text).expect("it can be written");
    client.tell(
        "textDocument/didSave",
        json!({ "textDocument": { "uri": uri(&path) } }),
    );
    let found = client.open(&path, "model m { state x = y; x' = -x; }\n");
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(client.end(), Exit::Success);
}
