//! Texts that are typed at random, character by character, and what is asked meanwhile.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};
use serde_json::{Value, json};

use super::client::{Client, memory, position, uri};

/// So many truncations, and as many edits.
pub const COUNT: usize = 200;

/// What is written at random places.
const PIECES: [&str; 16] = [
    "x", ";", "{", "}", "θ", " = ", "𝛼", "\n", "(", "\"", "//", "let w", "'", "else {", "if a ",
    ".",
];

/// Random numbers below others.
pub struct Random(TestRng);

impl Random {
    pub fn new() -> Self {
        Random(TestRng::deterministic_rng(RngAlgorithm::ChaCha))
    }

    pub fn below(&mut self, bound: usize) -> usize {
        (self.0.next_u64() % bound.max(1) as u64) as usize
    }
}

/// The examples with their texts, in order.
pub fn examples() -> Vec<(PathBuf, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    let entries = fs::read_dir(folder).expect("the examples are there");
    let paths = entries.map(|entry| entry.expect("a readable folder").path());
    let is_model = |path: &PathBuf| path.extension().is_some_and(|kind| kind == "nsd");
    let mut paths: Vec<PathBuf> = paths.filter(is_model).collect();
    paths.sort();
    let text = |path: &PathBuf| fs::read_to_string(path).expect("it can be read");
    paths
        .iter()
        .map(|path| (path.clone(), text(path)))
        .collect()
}

/// A model of 500 declarations, of which some switch, and an experiment.
pub fn large() -> String {
    let mut text = String::from("model large {\n");
    for k in 1..=125 {
        text.push_str(&format!("  param p{k} = {k};\n"));
        text.push_str(&format!("  state x{k} = 1;\n"));
        text.push_str(&format!("  let y{k} = p{k}*x{k};\n"));
        match k % 25 {
            0 => text.push_str(&format!("  switch s{k} = sign(x{k} - p{k});\n")),
            _ => text.push_str(&format!("  let s{k} = y{k} + p{k};\n")),
        }
    }
    for k in 1..=125 {
        text.push_str(&format!("  x{k}' = -y{k} + s{k};\n"));
    }
    text + "}\nsimulate s of large {\n  horizon 1;\n}\n"
}

/// A text that a client has open, and types in.
pub struct Typed {
    pub path: PathBuf,
    pub text: String,
}

impl Typed {
    pub fn open(client: &mut Client, path: PathBuf, text: &str) -> Self {
        client.open(&path, text);
        let text = text.to_owned();
        Typed { path, text }
    }

    /// Replaces what is between two bytes.
    fn replace(&mut self, client: &mut Client, bytes: Range<usize>, new: &str) {
        let [start, end] = [bytes.start, bytes.end].map(|at| position(&self.text, at));
        client.replace(&self.path, json!({ "start": start, "end": end }), new);
        self.text.replace_range(bytes, new);
    }

    /// Types a piece, and asks behind every character.
    pub fn write(
        &mut self,
        client: &mut Client,
        mut at: usize,
        piece: &str,
        ask: &mut dyn FnMut(&mut Client, &Path, Value),
    ) {
        for c in piece.chars() {
            self.replace(client, at..at, c.encode_utf8(&mut [0; 4]));
            at += c.len_utf8();
            ask(client, &self.path, position(&self.text, at));
        }
    }

    /// Takes away the end of an example from a random character on, and types so many of what was there.
    pub fn truncate(
        client: &mut Client,
        random: &mut Random,
        example: &str,
        most: usize,
        ask: &mut dyn FnMut(&mut Client, &Path, Value),
    ) -> Self {
        let mut typed = Typed::open(client, memory("cut.nsd"), example);
        let cut = character(example, random.below(example.len()));
        typed.replace(client, cut..example.len(), "");
        ask(client, &typed.path, position(&typed.text, cut));
        let piece: String = example[cut..].chars().take(most).collect();
        typed.write(client, cut, &piece, ask);
        typed
    }

    /// Types a random piece in the place of some characters of what is there.
    pub fn edit(
        &mut self,
        client: &mut Client,
        random: &mut Random,
        ask: &mut dyn FnMut(&mut Client, &Path, Value),
    ) {
        let from = character(&self.text, random.below(self.text.len()));
        let removed = self.text[from..].chars().take(random.below(4));
        let end = from + removed.map(char::len_utf8).sum::<usize>();
        self.replace(client, from..end, "");
        self.write(client, from, PIECES[random.below(PIECES.len())], ask);
    }
}

/// The first byte of the character that a byte is in.
fn character(text: &str, byte: usize) -> usize {
    let mut starts = (0..=byte).rev();
    let start = starts.find(|&at| text.is_char_boundary(at));
    start.expect("a text begins with a character")
}

/// What an editor asks behind a change.
pub fn questions(path: &Path, at: &Value) -> Vec<(&'static str, Value)> {
    let document = json!({ "uri": uri(path) });
    let point = json!({ "textDocument": document, "position": at });
    let whole = json!({ "textDocument": document });
    let range = json!({ "start": at, "end": at });
    let actions =
        json!({ "textDocument": document, "range": range, "context": { "diagnostics": [] } });
    vec![
        ("textDocument/completion", point.clone()),
        ("textDocument/hover", point.clone()),
        ("textDocument/definition", point.clone()),
        ("textDocument/documentHighlight", point.clone()),
        ("textDocument/signatureHelp", point),
        ("textDocument/documentSymbol", whole.clone()),
        ("textDocument/foldingRange", whole.clone()),
        ("textDocument/semanticTokens/full", whole.clone()),
        (
            "textDocument/inlayHint",
            json!({ "textDocument": document, "range": range }),
        ),
        (
            "textDocument/selectionRange",
            json!({ "textDocument": document, "positions": [at] }),
        ),
        ("textDocument/codeAction", actions),
        ("textDocument/codeLens", whole),
    ]
}
