//! Names of all examples: what is asked of each is what the library says.

use std::collections::BTreeMap;
use std::path::Path;

use nsdc::Project;
use nsdc::cli::Exit;
use nsdc::model::index::Definition;
use serde_json::{Value, json};

use super::client::{Client, byte, position, uri};
use super::hovers::equations;
use super::typist::examples;

/// Every so many names are asked about in full.
const STRIDE: usize = 20;

/// A file with its names.
struct Example {
    project: Project,
    text: String,
}

impl Example {
    fn is_here(&self, known: &Definition) -> bool {
        known.place.end as usize <= self.text.len()
    }

    fn word(&self, range: &Value) -> &str {
        let [start, end] = ["start", "end"].map(|end| byte(&self.text, &range[end]));
        &self.text[start..end]
    }
}

#[test]
fn every_name_of_every_example_is_known() {
    let mut client = Client::new(&[]);
    let (mut n_asked, mut n_equations) = (0, 0);
    for (path, text) in examples() {
        assert_eq!(client.open(&path, &text), Vec::<Value>::new());
        let project = Project::load(&path).expect("it is there");
        let index = project.index();
        let example = Example { project, text };
        let mut systems = BTreeMap::new();
        let inside = index.occurrences().iter();
        let inside = inside.filter(|place| place.span.end as usize <= example.text.len());
        for (k, place) in inside.enumerate() {
            let known = index.definition(place.declared).expect("it is declared");
            if !example.is_here(known) {
                continue;
            }
            let at = position(&example.text, place.span.start as usize);
            let found = client.at("textDocument/definition", &path, at.clone());
            assert_eq!(found["uri"], uri(&path));
            let declared = position(&example.text, known.place.start as usize);
            assert_eq!(found["range"]["start"], declared, "{}", known.name);
            if k % STRIDE == 0 {
                n_asked += 1;
                let places = index.places(known.place).count();
                let hover = asked(&mut client, &path, &at, (&example, known, places));
                n_equations += usize::from(hover.contains("der("));
                emitted(&mut client, &path, &hover, &mut systems);
            }
        }
        whole(&mut client, &path, &example);
        client.close(&path);
    }
    assert!(n_asked > 120, "{n_asked} names");
    assert!(n_equations > 20, "{n_equations} equations");
    assert_eq!(client.end(), Exit::Success);
}

/// What is asked at a name; what is said of it.
fn asked(
    client: &mut Client,
    path: &Path,
    at: &Value,
    (example, known, places): (&Example, &Definition, usize),
) -> String {
    let point = json!({ "textDocument": { "uri": uri(path) }, "position": at });
    let hover = client.ask("textDocument/hover", point.clone());
    let text = hover["contents"]["value"].as_str().expect("it is told");
    assert!(text.contains(&known.name), "{}: {text}", known.name);
    let mut params = point.clone();
    params["context"] = json!({ "includeDeclaration": true });
    let all = client.ask("textDocument/references", params);
    let all = all.as_array().expect("a list");
    assert!(all.len() >= places, "{}: {all:?}", known.name);
    for place in all {
        assert_eq!(example.word(&place["range"]), known.name);
    }
    let mut params = point;
    params["newName"] = json!("renamed_7");
    match client.try_ask("textDocument/rename", params) {
        Ok(found) => {
            let edits = found["changes"][uri(path)].as_array().expect("edits");
            assert_eq!(edits.len(), all.len(), "{}", known.name);
        }
        Err((code, _)) => assert_eq!(code, -32803, "{}", known.name),
    }
    text.to_owned()
}

/// The equations of a hover stand in the system of the experiment that they are of.
fn emitted(client: &mut Client, path: &Path, hover: &str, systems: &mut BTreeMap<String, String>) {
    let Some((heading, lines)) = equations(hover) else {
        return;
    };
    let name = heading
        .strip_prefix("in `")
        .expect("it is of an experiment");
    let name = name.trim_end_matches("`:").to_owned();
    let system = systems.entry(name).or_insert_with_key(|name| {
        let params = json!({ "command": "nsdc.emit", "arguments": [uri(path), name, "system"] });
        let came = client.ask("workspace/executeCommand", params);
        came["text"].as_str().expect("a text").to_owned()
    });
    for line in lines.lines().filter(|line| *line != "..") {
        let is_it = |known: &str| match line.strip_suffix(" ..") {
            Some(start) => known.starts_with(start),
            None => known == line,
        };
        assert!(system.lines().any(is_it), "{}: {line}", path.display());
    }
}

/// What is asked of a file.
fn whole(client: &mut Client, path: &Path, example: &Example) {
    let document = json!({ "textDocument": { "uri": uri(path) } });
    let lenses = client.ask("textDocument/codeLens", document);
    let n_experiments = example.project.experiments().count();
    assert_eq!(lenses.as_array().map(Vec::len), Some(5 * n_experiments));
    let mut params = json!({ "textDocument": { "uri": uri(path) }, "options": { "tabSize": 2, "insertSpaces": true } });
    let edits = client.ask("textDocument/formatting", params.clone());
    assert_eq!(edits, json!([]), "{}", path.display());
    let end = position(&example.text, example.text.len());
    params["range"] = json!({ "start": { "line": 0, "character": 0 }, "end": end });
    assert_eq!(
        client.ask("textDocument/rangeFormatting", params),
        json!([])
    );
    // In front of the last brace of an experiment stand its settings.
    let last = example.text.rfind('}').expect("it has a block");
    let at = position(&example.text, last);
    let found = client.at("textDocument/completion", path, at);
    assert!(
        found.as_array().is_some_and(|items| !items.is_empty()),
        "{}",
        path.display()
    );
}
