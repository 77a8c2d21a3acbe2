//! Edits that are offered, and what becomes of the text.

use std::path::Path;

use nsdc::cli::Exit;
use serde_json::{Value, json};

use super::client::{Client, edited, memory, position, uri};

/// The texts that the actions make of one, with their titles.
fn mended(client: &mut Client, path: &Path, text: &str) -> Vec<(String, String)> {
    let whole = json!({ "start": position(text, 0), "end": position(text, text.len()) });
    let params = json!({ "textDocument": { "uri": uri(path) }, "range": whole, "context": { "diagnostics": [] } });
    let actions = client.ask("textDocument/codeAction", params);
    let actions = actions.as_array().expect("a list").iter();
    let mended = actions.map(|action| {
        let edits = &action["edit"]["changes"][uri(path)];
        let title = action["title"].as_str().expect("a title");
        let edits = edits.as_array().expect("edits");
        (title.to_owned(), edited(text, edits))
    });
    mended.collect()
}

/// What needs a thought of the reader is offered, and mends as it is; comments stay with what they are about.
#[test]
fn choices_are_offered_and_mend() {
    let mut client = Client::new(&[]);
    let path = memory("choices.nsd");
    let regions = "model m {
  state x = 1;
  region low where x < 0 { x' = 1; }  // rises
  region high where x > 1 { x' = -1; }  // falls
}
simulate s of m { horizon 1; }
";
    let lone = "model m {
  state x = 1;
  region low where x < 0 { x' = 1; } // rises
}
";
    let inside = "model m {
  state x = 1;
  region low where x < 0 { x' = 1; } region high where x > 1 { x' = -1; }
}
simulate s of m { horizon 1; }
";
    let switch = "model m {
  state x = 1;
  switch s = sign(x);  // a side
  x' = -s^2 - exp(s);
}
simulate s of m { horizon 1; }
";
    let value = "model m {
  param k;  // how fast
  state x = 1;
  x' = -k*x;
}
simulate s of m { horizon 1; }
";
    let rest = "\n  region rest else { x' = 0; }";
    for (text, places, all) in [
        (regions, "falls", &[rest][..]),
        (lone, "rises", &[rest]),
        (inside, "x' = -1; }", &[rest]),
        (
            switch,
            "sign(x)",
            &[" sliding linear", " sliding nonlinear"],
        ),
        (value, "param k", &[" = 0"]),
    ] {
        assert!(!client.open(&path, text).is_empty(), "{text}");
        let found = mended(&mut client, &path, text);
        let texts: Vec<&str> = found.iter().map(|(_, text)| text.as_str()).collect();
        let at = text.find(places).expect("it is there") + places.len();
        let (before, behind) = text.split_at(at);
        let expected = all.iter().map(|words| format!("{before}{words}{behind}"));
        assert_eq!(texts, expected.collect::<Vec<_>>());
        for text in texts {
            assert_eq!(client.open(&path, text), Vec::<Value>::new(), "{text}");
        }
        client.close(&path);
    }
    assert_eq!(client.end(), Exit::Success);
}

/// The layout of lines does not reach beyond them where a `;` behind a block stands alone.
#[test]
fn ranges_are_laid_out_alone() {
    let mut client = Client::new(&[]);
    let path = memory("ranges.nsd");
    let text = "model m   {\n state x=1;\n  x'=-x;\n}\n;\nmodel   n {\n state z=1;\n  z'=0; }\nsimulate  e of n {horizon 1;}\n";
    client.open(&path, text);
    let lines: Vec<&str> = text.lines().collect();
    for (line, laid) in [(0, "model m {"), (1, "  state x = 1;"), (2, "  x' = -x;")] {
        let point = |line: usize, character: usize| json!({ "line": line, "character": character });
        let range = json!({ "start": point(line, 0), "end": point(line, lines[line].len()) });
        let params = json!({ "textDocument": { "uri": uri(&path) }, "range": range, "options": { "tabSize": 2, "insertSpaces": true } });
        let edits = client.ask("textDocument/rangeFormatting", params);
        let mut expected = lines.clone();
        expected[line] = laid;
        let found = edited(text, edits.as_array().expect("edits"));
        assert_eq!(found.lines().collect::<Vec<_>>(), expected);
    }
    assert_eq!(client.end(), Exit::Success);
}
