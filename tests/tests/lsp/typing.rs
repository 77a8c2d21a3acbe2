//! Whatever is typed, all that is asked is answered, in order, and nothing is kept of it.

use std::fs;
use std::path::Path;

use nsdc::Project;
use nsdc::cli::Exit;
use nsdc::files::Memory;
use serde_json::{Value, json};

use super::Program;
use super::client::{Client, memory, position};
use super::typist::{COUNT, Random, Typed, examples, large, questions};

/// Asks so many of all questions at once, others each time: answers come in their order.
struct Asks {
    each: usize,
    next: usize,
}

impl Asks {
    fn ask(&mut self, client: &mut Client, path: &Path, at: &Value) {
        let all = questions(path, at);
        let chosen = (0..self.each).map(|k| all[(self.next + k) % all.len()].clone());
        let ids: Vec<_> = chosen
            .map(|(method, params)| client.send(method, params))
            .collect();
        self.next += self.each;
        for id in ids {
            let response = client.response(&id);
            assert!(response.response_result.is_ok(), "{response:?}");
        }
    }
}

/// The server has the text that was typed: what is wrong is what is wrong with that.
fn agrees(client: &mut Client, typed: &Typed) {
    let found = client.told(&typed.path);
    let files: Memory = [(typed.path.as_path(), typed.text.as_str())]
        .into_iter()
        .collect();
    let project = Project::from_files(&typed.path, files).expect("the text is there");
    let codes = project.check().list();
    let codes = codes.iter().map(|message| message.code.as_deref());
    assert!(
        found.iter().map(|found| found["code"].as_str()).eq(codes),
        "{found:?} of {}",
        typed.text
    );
}

#[test]
fn texts_that_are_cut_are_answered_for() {
    let mut client = Client::new(&[]);
    let (mut random, mut asks) = (Random::new(), Asks { each: 2, next: 0 });
    let examples = examples();
    for k in 0..COUNT {
        let (_, text) = &examples[k % examples.len()];
        let mut ask = |client: &mut Client, path: &Path, at| asks.ask(client, path, &at);
        let typed = Typed::truncate(&mut client, &mut random, text, 2, &mut ask);
        agrees(&mut client, &typed);
        client.close(&typed.path);
    }
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn texts_that_are_edited_are_answered_for() {
    let mut client = Client::new(&[]);
    let (mut random, mut asks) = (Random::new(), Asks { each: 2, next: 0 });
    let mut n_edits = 0;
    for (path, text) in examples() {
        let mut ask = |client: &mut Client, path: &Path, at| asks.ask(client, path, &at);
        let name = path.file_name().expect("a file").to_string_lossy();
        let mut typed = Typed::open(&mut client, memory(&name), &text);
        for _ in 0..4 {
            typed.edit(&mut client, &mut random, &mut ask);
            n_edits += 1;
        }
        agrees(&mut client, &typed);
    }
    assert!(n_edits >= COUNT, "{n_edits} edits");
    assert_eq!(client.end(), Exit::Success);
}

#[test]
fn a_long_text_is_answered_for() {
    let mut client = Client::new(&[]);
    let mut asks = Asks { each: 12, next: 0 };
    let text = large();
    let mut typed = Typed::open(&mut client, memory("large.nsd"), &text);
    let mut ask = |client: &mut Client, path: &Path, at| asks.ask(client, path, &at);
    for place in ["  x7' =", "  let y99", "horizon"] {
        let at = typed.text.find(place).expect("it is there");
        typed.write(&mut client, at, " x1;", &mut ask);
    }
    agrees(&mut client, &typed);
    assert_eq!(client.end(), Exit::Success);
}

/// Bytes of a program that are in memory.
fn resident(id: u32) -> Option<usize> {
    let told = fs::read_to_string(format!("/proc/{id}/statm")).ok()?;
    let pages: usize = told.split(' ').nth(1)?.parse().ok()?;
    // No smaller page is in use.
    Some(4096 * pages)
}

/// Of 10000 edits the last 8000 take less room than a copy of the text each.
#[test]
fn nothing_is_kept_of_what_was_typed() {
    const EDITS: usize = 10_000;
    const FIRST: usize = 2_000;
    let mut program = Program::new("memory");
    program.initialize();
    let (path, text) = (
        "/nowhere/memory.nsd",
        "model m {\n  state x = 1;\n  x' = -x;\n}\n",
    );
    program.open(path, text);
    let document = json!({ "uri": format!("file://{path}"), "version": 2 });
    let at = position(text, text.find("= 1").expect("it is there") + 2);
    let after =
        json!({ "line": at["line"], "character": at["character"].as_u64().expect("a column") + 1 });
    let mut before = None;
    for k in 0..EDITS {
        let new = ["2", "y", "(", "3"][k % 4];
        let change = json!({ "range": { "start": at, "end": after }, "text": new });
        let changes = json!({ "textDocument": document, "contentChanges": [change] });
        program.tell("textDocument/didChange", &changes);
        // Who types does not wait for every answer.
        if k % 5 == 0 {
            let point = json!({ "textDocument": document, "position": at });
            let method = ["textDocument/hover", "textDocument/completion"][k / 5 % 2];
            program.ask(method, &point).expect("it is answered");
        }
        if k == FIRST {
            before = resident(program.id());
        }
    }
    let after = resident(program.id());
    let (code, _) = program.shut_down();
    assert_eq!(code, Some(0));
    let Some((before, after)) = before.zip(after) else {
        // Elsewhere than on Linux nobody tells it.
        return;
    };
    let kept = after.saturating_sub(before) / (EDITS - FIRST);
    assert!(kept < text.len(), "{kept} bytes stay of each edit");
}
