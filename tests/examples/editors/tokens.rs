//! What the compiler reads in texts: words, names, units, numbers, strings, comments and symbols.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use nsd_grammar::{NsdParser, Rule};
use nsdc::model::reserved::VALUES;
use nsdc::syntax::{self, TokenKind};
use pest::Parser;
use pest::iterators::Pair;
use serde_json::{Value, json};

use crate::grammar::Grammar;

/// Folders of models that all can be read.
const FOLDERS: [&str; 3] = ["examples", "stdlib", "compiler/src/syntax/tests/samples"];

/// Places where a word may be a name, `@`, or where it looks as if it might.
const PLACES: [&str; 67] = [
    "const @ = 1;",
    "fn @(a) = a;",
    "fn f(@, b) = @ + b*@;",
    "use std.@.{@, a as @};",
    "model @ { x' = 1; }",
    "model m { param @ = 1; state a : m = @; discrete @ = 1; input @; algebraic @ = 2; control @; signal @ = 3; }",
    "model m { state @[2] : m/s in [0, 1] = 3; }",
    "model m { @' = -@ + 2*@(@); @[1]' += @.@; }",
    "model m { @.a' = @ - b; @.@[@, 2]' = @ .* 2; }",
    "model m { let @ = if @ > 0 and @ < 1 then @ else not @; }",
    "model m { x' = @ or a; y' = a or @; }",
    "model m { output @ : m = @; }",
    "model m { switch @ = sign(@) sliding nonlinear; }",
    "model m { switch a = @; region @ where @ > 0 { @' = 1; } region b else { @' = 2; } }",
    "model m { region a indicator @ { state' = 1; } hidden on @ { @' += 1; } }",
    "model m { project @ onto { @ >= 0; a <= @ <= b; for @ in 1..@ { @[i] >= 0; } } metric @; @' = 1; }",
    "model m { jump @ when @ <= 0 and v < @ { @ := -e*@; @[1] := 2; } }",
    "model m { every @ { @ := -@; } every 0.1 offset @ { @[1] := 2; } jump @ every 2*@ offset 1 { a := @; } }",
    "model m { every' = offset; offset' = every; every[1]' += every.offset; let stop = every; }",
    "model m { mechanics @, v { @ = 1; mass = @; contact @ { gap = @; @ = 2; } } }",
    "model m { part @[i in 1..n] = @ { @ = 2; @.@ = @; } }",
    "model m { part a = @.@; for @ in 1..n, j in @+1..@ { @' = j; } }",
    "model m { @ in argmin @ subject to { @ >= 0; } x' = 1; }",
    "model m { @[2] in variational [0, @] solves @; @ in variational { @ >= 0; } solves @; }",
    "model m { 0 <= @ perp @ >= 0; 0 = @ + 1; }",
    "model m { control u in {@, 2}; x' = [@, 1; 2, @] + [@[i] for i in 1..@]; }",
    "model m { x' = f(@ = 1, @) + sum(@ for i in 1..n) - @; }",
    "model m { x' = a +\n  @\n  - 1; @ ' = 2 * // and\n @; }",
    "simulate @ of @ { horizon 1; } optimize @ of a.@ { horizon @; }",
    "simulate s of m { with { @ = 1; @.a = @; } }",
    "simulate s of m { horizon free; }",
    "simulate s of m { horizon free in [@, 2] = @; tolerance @; runs @; minimize @ + 1; }",
    "simulate s of m { horizon @ + 1; }",
    "simulate s of m { method @; } simulate t of m { method @ { @ = @; } }",
    "simulate s of m { output @, a.@; lower @, @; }",
    "simulate s of m { output a, @ every @; output a at @; output every 0.1; output at @; }",
    "simulate s of m { subject to { @ >= 0; } at @; subject to { a <= @; } final { @ = 1; } }",
    "simulate s of m { subject to { @ >= 0; } at @ soft @ weight @; subject to { 0 <= @ perp @ >= 0; } soft @ weight 2; }",
    "simulate s of m { final { @ = 1; } soft @ weight @ + 1; final { soft = weight; weight <= soft; } }",
    "simulate s of m { initial { @ = 1; @ free; @ free in [0, @]; x free in {1, @}; } }",
    "simulate s of m { free { @; @ in [0, 1]; a.@; } }",
    "simulate s of m { guess { from @; from \"a.json\"; @ = 1; @.b = 2; } }",
    "simulate s of m { guess { from = 1; from.a = 2; } }",
    "simulate s of m { perturb every @ by @ seed 3; starts @ by @(1) seed 2; on chattering slide; intervals [1, @] free; }",
    "fit @ of @ { data \"@\" { @ -> @; a.@[1] -> @ weight @; b -> \"@\" weight 2; } data \"b.csv\" with { @ = 1; b = @; } { @ -> @; } data \"b.csv\" {} }",
    "mpc @ of @ { controller @; sample @; deadline @ + 1; }",
    "fit s of m { loss squared; loss @(2); initial { @ free; } }",
    "simulate s of m { sensitivity to @, a.@[1] at 0; sensitivity to @ at 0 one_sided; }",
    "simulate s of m { stop when @ <= 0 and a > @; }",
    "simulate s of m { intervals @; elements @; scheme @; grid @; controls @; }",
    "simulate s of m { plot { @; @, a; a, @ + 1; phase @, b; title \"@\"; width 8 cm; } }",
    "simulate s of m { plot { phase - a; phase[1]; phase; phase, a; phase a, b; width - 3; width, 2; title; } }",
    "simulate s of m { animate { title \"a\"; disc @, 1; segment 0, @; for @ in 1..n { @ @, 2; } width 30 mm; } }",
    "simulate s of m { expect @ ~ 1; expect a ~ @ within @; expect @ at end ~ 1 within @; }",
    "simulate s of m { expect @ at @ <= @ at @; expect @ always <= @; expect a = @[1]; }",
    "simulate s of m { expect mode at @ is @; expect status is @; expect warning @; expect lowering golden; expect numbers golden; }",
    "simulate s of m { expect mode at end ~ 1; expect status = 1; expect warning ~ 2; expect numbers < 3; }",
    "expect error @; expect warning @;",
    "model m { param a : m^2*(kg/s)^(1/2) in [0, 1] = 9.81 m/s^2*@; }",
    "model m { param a = 2 m*@ + 20 kHz - 5 (rad/s) + 3 m; }",
    "model m { x' = 2 m*s + 2*m + 3 N*m/(kg*s)/@ + 1 h + 2 d*m(2) + 3 kg*s.a; }",
    "model m { x' = a[1..2] + a[1..@] + a[:, 2] + 2.*@ + 2./@ + 2.^@ + .5e-3 + 1.; }",
    "model m { x' = \"// no comment\"; // \"no string\n y' = 1; /// doc @\n z' = 2; }",
    "model m { θ' = -θ_0 + Ω*ﬁ + é; \u{1d6fc}' = 1 Ω; }",
    "model m { state state = 1; state' = -state; jump jump when jump < 0 { jump := 1; } }",
    "model m { let at = always*within; region free where if_ < thenceforth { for_x' = orange + nota; } }",
    "simulate s of m { expect at at at ~ at at at within within; output every every every; }",
];

/// The tokens of each text: kinds with what is written there.
pub fn of_all(root: &Path, grammar: &Grammar) -> String {
    let mut all = serde_json::Map::new();
    for folder in FOLDERS {
        let entries = fs::read_dir(root.join(folder)).expect("the folder is there");
        for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
            if path.extension().is_some_and(|known| known == "nsd") {
                let text = fs::read_to_string(&path).expect("a model is text");
                let tokens = tokens(&text).unwrap_or_else(|| panic!("{path:?} can be read"));
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                all.insert(
                    format!("{folder}/{name}"),
                    json!({ "text": text, "tokens": tokens }),
                );
            }
        }
    }
    let words = grammar.words();
    let words = words.iter().map(String::as_str).chain(["x", "θ_1", "sin"]);
    for word in words {
        let texts = PLACES.map(|place| place.replace('@', word));
        // Some words cannot stand in some places.
        let read = texts.into_iter().filter(|text| {
            let is_read = tokens(text).is_some();
            assert!(is_read || word != "x", "{text} can be read");
            is_read
        });
        let text = read.collect::<Vec<_>>().join("\n");
        let tokens = tokens(&text);
        all.insert(
            format!("{word} as a name"),
            json!({ "text": text, "tokens": tokens }),
        );
    }
    let text = VALUES.map(|value| format!("const a = {value};")).join("\n");
    let tokens = tokens(&text);
    all.insert(
        "values".to_owned(),
        json!({ "text": text, "tokens": tokens }),
    );
    Value::Object(all).to_string()
}

/// What is in a text; nothing where it cannot be read.
fn tokens(text: &str) -> Option<Vec<(&'static str, &str)>> {
    let mut words = HashMap::new();
    for pair in NsdParser::parse(Rule::file, text).ok()? {
        walk(pair, "name", &mut words)?;
    }
    let tokens = syntax::tokens(text).filter(|token| token.kind != TokenKind::Blank);
    Some(
        tokens
            .map(|token| {
                let kind = match token.kind {
                    TokenKind::Comment => "comment",
                    TokenKind::String => "string",
                    TokenKind::Number => "number",
                    TokenKind::Word => words.get(&token.start).copied().unwrap_or("path"),
                    _ => "symbol",
                };
                (kind, token.text)
            })
            .collect(),
    )
}

/// Takes down what words are, by where they begin; nothing where a statement is wrong.
fn walk(
    pair: Pair<'_, Rule>,
    names: &'static str,
    words: &mut HashMap<usize, &'static str>,
) -> Option<()> {
    let (rule, start, text) = (pair.as_rule(), pair.as_span().start(), pair.as_str());
    if format!("{rule:?}").starts_with("bad_") {
        return None;
    }
    let names = if rule == Rule::unit { "unit" } else { names };
    let mut inner = pair.into_inner().peekable();
    if inner.peek().is_none() && text.starts_with(|c: char| c == '_' || c.is_alphabetic()) {
        let kind = match rule {
            Rule::name => names,
            Rule::known_unit | Rule::length => "unit",
            _ => "word",
        };
        words.insert(start, kind);
    }
    inner.try_for_each(|pair| walk(pair, names, words))
}
