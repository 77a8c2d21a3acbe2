//! Colours of the language for editors, and what they know of its brackets and words, from its grammar and the compiler's lists of words.
//!
//! ```sh
//! cargo run -p nsd-tests --example editors               # compares what is kept with what comes out
//! cargo run -p nsd-tests --example editors -- --accept   # writes what is kept
//! cargo run -p nsd-tests --example editors -- --tokens   # tokens of all models, as the compiler reads them, in JSON
//! ```
//!
//! `editors/nsd.template.json` says how statements and expressions are coloured, and here are its words: `<<rule>>`
//! stands for those that a rule of the grammar begins with, `<<*>>` for all.

#[path = "editors/configuration.rs"]
mod configuration;
#[path = "editors/grammar.rs"]
mod grammar;
#[path = "editors/tokens.rs"]
mod tokens;

use std::fs;
use std::path::Path;
use std::process::ExitCode;

use nsdc::model::reserved::{VALUES, function_names};
use nsdc::report::Status;
use nsdc::system::experiment::{Lowering, MethodKind};
use serde_json::Value;

use grammar::Grammar;

/// Where the grammar of colours is kept: for VS Code, and for Pygments.
const COLOURS: [&str; 2] = [
    "editors/vscode/syntaxes/nsd.tmLanguage.json",
    "python/nsdc/nsd.tmLanguage.json",
];

/// What VS Code knows of brackets, comments and words.
const CONFIGURATION: &str = "editors/vscode/language-configuration.json";

fn main() -> ExitCode {
    let has = |flag: &str| std::env::args().any(|arg| arg == flag);
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let read = |name: &str| fs::read_to_string(root.join(name)).unwrap_or_default();
    let grammar = Grammar::read(&read("grammar/nsd.pest"));
    if has("--tokens") {
        print(&tokens::of_all(&root, &grammar));
        return ExitCode::SUCCESS;
    }
    let coloured = filled(&read("editors/nsd.template.json"), &grammar);
    let configured = configuration::of(&grammar);
    let kept = COLOURS.map(|name| (name, &coloured));
    let mut exit = ExitCode::SUCCESS;
    for (name, text) in kept.into_iter().chain([(CONFIGURATION, &configured)]) {
        if has("--accept") {
            fs::write(root.join(name), text).expect("the folder of the project is writable");
        } else if read(name) != *text {
            print(&format!(
                "{name} is not what comes of the grammar; `-- --accept` writes it"
            ));
            exit = ExitCode::FAILURE;
        }
    }
    exit
}

/// The template with its words, as alternatives of regular expressions, and without what it names for itself.
fn filled(template: &str, grammar: &Grammar) -> String {
    let mut template: Value = serde_json::from_str(template).expect("the template is JSON");
    let named = template["variables"].take();
    template
        .as_object_mut()
        .and_then(|all| all.remove("variables"));
    fill(&mut template, &named, grammar);
    serde_json::to_string_pretty(&template).expect("it is JSON") + "\n"
}

fn fill(value: &mut Value, named: &Value, grammar: &Grammar) {
    match value {
        Value::String(text) => {
            while let Some((before, rest)) = text.split_once("<<") {
                let (list, after) = rest.split_once(">>").expect("a list of words is closed");
                *text = match named[list].as_str() {
                    Some(pattern) => format!("{before}{pattern}{after}"),
                    None => format!("{before}{}{after}", words(list, grammar).join("|")),
                };
            }
        }
        Value::Array(values) => values
            .iter_mut()
            .for_each(|value| fill(value, named, grammar)),
        Value::Object(all) => all
            .values_mut()
            .for_each(|value| fill(value, named, grammar)),
        _ => {}
    }
}

fn words(list: &str, grammar: &Grammar) -> Vec<String> {
    let owned = |words: Vec<&str>| words.into_iter().map(str::to_owned).collect();
    match list {
        "*" => grammar.words(),
        "functions" => owned(function_names().collect()),
        "values" => owned(VALUES.to_vec()),
        "methods" => owned(MethodKind::words()),
        "lowerings" => owned(Lowering::ALL.map(Lowering::word).to_vec()),
        "statuses" => owned(Status::ALL.map(Status::as_str).to_vec()),
        rule => grammar.starts(rule),
    }
}

#[allow(
    clippy::print_stdout,
    reason = "a program that prints what it is asked for"
)]
fn print(text: &str) {
    println!("{text}");
}
