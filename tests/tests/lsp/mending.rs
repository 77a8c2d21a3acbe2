//! Edits that are offered, and what becomes of the text.

use std::path::Path;

use nsdc::Project;
use nsdc::cli::Exit;
use nsdc::diagnostics::explain::{PAGES, examples};
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

/// What may be right or wrong: a model, and the experiment of it.
fn relay(experiment: &str) -> String {
    format!(
        "model m {{\n  state x = 1;\n  x' = -sign(x);\n}}\nsimulate e of m {{ horizon 1; {experiment} }}\n"
    )
}

/// A help that is an edit is offered as one, and what comes of it is right.
#[test]
fn helps_that_are_edits_mend() {
    let mut client = Client::new(&[]);
    let path = memory("helps.nsd");
    let unit = |unit: &str| {
        format!(
            "model m {{ state x : m = 1; param v : {unit} = 1; x' = -v; }}\nsimulate e of m {{ horizon 1; }}\n"
        )
    };
    let law = "model m {
  state q = 1; state v = 0;
  q' = v;
  mechanics q, v { mass = 1; force = -1; contact c { gap = q; restitution = LAW; } }
}
simulate e of m { horizon 1; }
";
    let unnamed = "model m {
  state x = 1;
  state s = 1;
  x' = sign(x)^2 - 0.5*sign(x);
  s' = 0;
}
simulate e of m { horizon 1; }
";
    for (text, code, expected) in [
        (
            unnamed.to_owned(),
            "E0401",
            "switch s1 = sign(x) sliding linear;\n}",
        ),
        (
            unnamed.to_owned(),
            "E0401",
            "switch s1 = sign(x) sliding nonlinear;\n}",
        ),
        (
            format!("use std.fricton.{{coulomb}};\n{}", relay("")),
            "E0119",
            "use std.friction.{coulomb};",
        ),
        (unit("meter/s"), "E0230", ": m/s ="),
        (unit("m/second"), "E0230", ": m/s ="),
        (unit("m*rpm"), "E0230", ": m*(rad/s) ="),
        (
            relay("method fesd { scheme = radau_iaa; }"),
            "E0508",
            "scheme = radau_ia(4);",
        ),
        (
            relay("method fesd { scheme = gauss; }"),
            "E0508",
            "scheme = gauss(4);",
        ),
        (
            relay("method fesd { scheme = gaus(2); }"),
            "E0508",
            "scheme = gauss(2);",
        ),
        (
            relay("method fesd { equilibration = mean; }"),
            "E0508",
            "equilibration = mean(0.001);",
        ),
        (
            relay("expect status is slved;"),
            "E0610",
            "status is solved;",
        ),
        (
            relay("expect staus is solved;"),
            "E0010",
            "expect status is solved;",
        ),
        (
            relay("expect mdoe at 0.5 is below(x);"),
            "E0010",
            "expect mode at",
        ),
        (
            relay("expect lowerin golden;"),
            "E0010",
            "expect lowering golden;",
        ),
        (
            relay("expect wraning W0701;"),
            "E0010",
            "expect warning W0701;",
        ),
        (
            relay("expect warning W0799;"),
            "E0614",
            "expect warning W07",
        ),
        (
            format!("{}expect warning W07O1;\n", relay("")),
            "E0614",
            "expect warning W0701;",
        ),
        (
            relay("expect events(crosing) ~ [0] within 1;"),
            "E0607",
            "events(crossing)",
        ),
        (
            law.replace("LAW", "newtn(0.5)"),
            "E0319",
            "restitution = newton(0.5);",
        ),
        (
            law.replace("LAW", "plastik"),
            "E0319",
            "restitution = plastic;",
        ),
    ] {
        let found = client.open(&path, &text);
        let codes: Vec<&str> = found
            .iter()
            .filter_map(|found| found["code"].as_str())
            .collect();
        assert_eq!(codes, [code], "{text}");
        let all = mended(&mut client, &path, &text);
        let mut all = all.iter().map(|(_, mended)| mended);
        let mended = all.find(|mended| mended.contains(expected));
        let mended = mended.unwrap_or_else(|| panic!("{code} is not mended: {text}"));
        let left = client.open(&path, mended);
        assert_eq!(left, Vec::<Value>::new(), "{mended}");
        client.close(&path);
    }
    // Nothing is close, and nothing is offered: it is wrong all the same, where it stands.
    let text = relay("expect warning Q9999;");
    let found = client.open(&path, &text);
    assert_eq!(found[0]["code"], "E0614");
    let at = text.find("Q9999").expect("it is there");
    assert_eq!(found[0]["range"]["start"], position(&text, at));
    assert_eq!(mended(&mut client, &path, &text), vec![]);
    assert_eq!(client.end(), Exit::Success);
}

/// Whatever asks whether something else was meant can be taken at its word: all pages of errors, with each of their words
/// written wrong.
#[test]
fn what_was_meant_is_an_edit() {
    let (mut n_texts, mut n_helps) = (0, 0);
    for (code, page) in PAGES {
        let all = ["wrong", "right"].map(|kind| examples(page, "nsd", kind));
        for example in all.into_iter().flatten() {
            let mut texts = vec![example.to_owned()];
            let words = nsdc::syntax::tokens(example).filter(|token| token.text.len() > 4);
            let words = words.filter(|token| token.text.chars().all(char::is_alphanumeric));
            // A letter too much in the middle.
            texts.extend(words.map(|token| {
                let middle = token.start + token.text.len() / 2;
                format!("{}q{}", &example[..middle], &example[middle..])
            }));
            for text in texts {
                n_texts += 1;
                let project = Project::from_text("page.nsd", &text);
                for message in project.check().list() {
                    let help = message.help.clone().unwrap_or_default();
                    if help.contains("did you mean") {
                        n_helps += 1;
                        assert!(message.fix.is_some(), "{code}: {help}\n{text}");
                    }
                }
            }
        }
    }
    assert!(n_texts > 2000 && n_helps > 500, "{n_texts}, {n_helps}");
}
