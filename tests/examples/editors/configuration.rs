//! What VS Code knows of brackets, comments and words, by the rules of the grammar.

use serde_json::{Value, json};

use super::grammar::Grammar;

/// The rules of brackets.
const BRACKETS: [[&str; 2]; 3] = [
    ["open_brace", "close_brace"],
    ["open_bracket", "close_bracket"],
    ["open_paren", "close_paren"],
];

/// The text of the configuration.
pub fn of(grammar: &Grammar) -> String {
    let brackets = BRACKETS.map(|pair| pair.map(|rule| grammar.symbol(rule)));
    let quote = grammar.symbol("string");
    let comment = grammar.symbol("COMMENT");
    let mut closing: Vec<Value> = brackets
        .iter()
        .map(|[open, close]| json!({ "open": open, "close": close }))
        .collect();
    closing.push(json!({ "open": quote, "close": quote, "notIn": ["string", "comment"] }));
    let mut surrounding: Vec<[&str; 2]> = brackets.to_vec();
    surrounding.push([quote, quote]);
    let word = pattern(&grammar.classes("name"));
    let configuration = json!({
        "comments": { "lineComment": comment },
        "brackets": brackets,
        "autoClosingPairs": closing,
        "surroundingPairs": surrounding,
        "wordPattern": { "pattern": word, "flags": "u" },
        "indentationRules": {
            "increaseIndentPattern": increase(&brackets, quote, comment),
            "decreaseIndentPattern": format!(r"^\s*[{}]", closers(&brackets)),
        },
        "onEnterRules": [{
            "beforeText": format!(r"^\s*{comment}/"),
            "action": { "indent": "none", "appendText": format!("{comment}/ ") },
        }],
    });
    serde_json::to_string_pretty(&configuration).expect("it is JSON") + "\n"
}

/// A line whose last bracket stays open.
fn increase(brackets: &[[&str; 2]], quote: &str, comment: &str) -> String {
    let open = brackets
        .iter()
        .map(|[open, close]| format!(r"\{open}[^\{close}{quote}]*"));
    let open: Vec<String> = open.collect();
    format!("^[^{}{quote}]*({})$", &comment[..1], open.join("|"))
}

fn closers(brackets: &[[&str; 2]]) -> String {
    brackets
        .iter()
        .map(|[_, close]| format!(r"\{close}"))
        .collect()
}

/// A name as a regular expression: the classes of its first character, and those of the others.
fn pattern(classes: &[String]) -> String {
    let class = |name: &String| match name.as_str() {
        "XID_START" => r"\p{XID_Start}".to_owned(),
        "XID_CONTINUE" => r"\p{XID_Continue}".to_owned(),
        other => other.to_owned(),
    };
    let (last, first) = classes.split_last().expect("a name has characters");
    let first: String = first.iter().map(class).collect();
    format!("[{first}][{}]*", class(last))
}
