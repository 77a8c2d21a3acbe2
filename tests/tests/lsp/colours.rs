//! What names and units are, as an editor colours them: places and words are written down by hand.

use nsdc::cli::Exit;
use serde_json::{Value, json};

use super::client::{Client, memory, uri};

/// What is told of a text: line, column, length, and the type with its modifiers by their words.
fn told(text: &str) -> Vec<(u64, u64, u64, String)> {
    let mut client = Client::silent();
    let answer = client.ask("initialize", json!({ "capabilities": {} }));
    let legend = &answer["capabilities"]["semanticTokensProvider"]["legend"];
    let words = |list: &str| -> Vec<String> {
        let all = legend[list].as_array().expect("a list").iter();
        all.map(|word| word.as_str().expect("a word").to_owned())
            .collect()
    };
    let (types, modifiers) = (words("tokenTypes"), words("tokenModifiers"));
    let path = memory("colours.nsd");
    assert_eq!(client.open(&path, text), Vec::<Value>::new());
    let document = json!({ "textDocument": { "uri": uri(&path) } });
    let tokens = client.ask("textDocument/semanticTokens/full", document);
    let data: Vec<u64> = (tokens["data"].as_array().expect("numbers").iter())
        .map(|number| number.as_u64().expect("a number"))
        .collect();
    let (mut line, mut column) = (0, 0);
    let mut shown = vec![];
    for token in data.chunks(5) {
        column = token[1] + if token[0] == 0 { column } else { 0 };
        line += token[0];
        let mut said = vec![types[token[3] as usize].as_str()];
        let set = modifiers.iter().enumerate();
        said.extend(set.filter_map(|(bit, word)| (token[4] >> bit & 1 == 1).then_some(&**word)));
        shown.push((line, column, token[2], said.join(" ")));
    }
    assert_eq!(client.end(), Exit::Success);
    shown
}

/// Those of one type, or with one modifier.
fn places(shown: &[(u64, u64, u64, String)], word: &str) -> Vec<(u64, u64, u64)> {
    let shown = shown.iter();
    let its = shown.filter(|(.., said)| said.split(' ').any(|known| known == word));
    its.map(|&(line, column, length, _)| (line, column, length))
        .collect()
}

fn is_told(shown: &[(u64, u64, u64, String)], expected: &[(u64, u64, u64, &str)]) {
    for &(line, column, length, said) in expected {
        let known = (line, column, length, said.to_owned());
        assert!(shown.contains(&known), "{known:?} of {shown:?}");
    }
}

#[test]
fn names_have_colours() {
    let text = "\
fn twice(x, y) = 2*x + y;

model ball {
  const n = 2;
  param g : m/s^2 in [0, 30] = 9.81;
  state q[n] : m = [1, 2];
  state v : m/s = 0;
  control u in [-1, 1];
  switch s = sign(v);
  q' = [v, v];
  v' = -g + twice(u, 1);
  output side = 2*s;
}

simulate falls of ball {
  with { u = 0; g = 1.5; }
  horizon 0.1;
}
";
    let shown = told(text);
    is_told(
        &shown,
        &[
            (0, 3, 5, "function declaration"),
            (0, 9, 1, "parameter declaration"),
            (0, 19, 1, "parameter"),
            (2, 6, 4, "class declaration"),
            (3, 8, 1, "property declaration readonly"),
            (4, 8, 1, "property declaration readonly"),
            (4, 12, 5, "type"),
            (5, 8, 1, "variable declaration state"),
            (5, 10, 1, "property readonly"),
            (5, 15, 1, "type"),
            (6, 8, 1, "variable declaration state surface"),
            (6, 12, 3, "type"),
            (7, 10, 1, "variable declaration control"),
            (8, 9, 1, "enumMember declaration switch"),
            (8, 18, 1, "variable state surface"),
            (9, 2, 1, "variable modification state"),
            (10, 8, 1, "property readonly"),
            (10, 12, 5, "function"),
            (10, 18, 1, "variable control"),
            (11, 9, 4, "variable declaration output"),
            (11, 18, 1, "enumMember switch"),
            (14, 9, 5, "function declaration"),
            (14, 18, 4, "class"),
            (15, 9, 1, "variable modification control"),
            (15, 16, 1, "property modification readonly"),
        ],
    );
    assert_eq!(shown.len(), 30, "{shown:?}");
}

/// Units have a colour wherever they stand: behind numbers in any expression, too.
#[test]
fn units_have_colours() {
    let text = "\
const tick = 5 ms;
fn longer(x) = x + 2 mm;
model tank {
  param a : m = 3 mm;
  state h : m in [0 m, 2 m] = 20 cm;
  state k : 1/s = 1;
  let up = if h > 30 cm then 1 else 0;
  switch pump = hysteresis(h, on = a, off = 10 cm);
  h' = pump*1 cm/s - k*longer(h) + a/tick - 0.6 m/s;
  k' = up/(1 s)^2;
}
simulate fills of tank {
  with { h = 25 cm; }
  horizon 2 min;
  tolerance 1e-6;
  expect h at 30 s < 100 m;
}
";
    let shown = told(text);
    assert_eq!(
        places(&shown, "type"),
        [
            (0, 15, 2),
            (1, 21, 2),
            (3, 12, 1),
            (3, 18, 2),
            (4, 12, 1),
            (4, 20, 1),
            (4, 25, 1),
            (4, 33, 2),
            (5, 12, 3),
            (6, 21, 2),
            (7, 47, 2),
            (8, 14, 4),
            (8, 48, 3),
            (9, 13, 1),
            (12, 16, 2),
            (13, 12, 3),
            (15, 17, 1),
            (15, 25, 1),
        ]
    );
    // Thresholds of a relay are values, where they have names.
    is_told(&shown, &[(7, 35, 1, "property readonly")]);
}

/// A surface is the zero set of what a switch looks at; a name that is looked at by itself is told to be one.
#[test]
fn surfaces_have_colours() {
    let text = "\
fn rub(w, mu) = -mu*sign(w);
fn drag(r) = rub(r, 1);
model m {
  param p = 1;
  state x = 1;
  state y[2] = [1, 2];
  state z = 0;
  let c = x - 1;
  let d = x + 2;
  let e = x + z;
  let f = z - 3;
  let g = z + 4;
  let k = z + 5;
  region low where c < 0 {
    x' = 1;
  }
  region high where 0 < c and p > 0 {
    x' = -1;
  }
  y' = [sign(y[1]), step(-d)];
  z' = drag(e) + max(0, f) + (if g > 1 then 1 else 2) + abs(k);
  jump bump when z < 0 {
    z := -z;
  }
}
simulate s of m {
  horizon 1;
  plot { abs(x); }
  expect c at end < 0;
}
";
    let shown = told(text);
    assert_eq!(
        places(&shown, "surface"),
        [
            (0, 7, 1),
            (0, 25, 1),
            (1, 8, 1),
            (1, 17, 1),
            (5, 8, 1),
            (6, 8, 1),
            (7, 6, 1),
            (8, 6, 1),
            (9, 6, 1),
            (9, 14, 1),
            (10, 6, 1),
            (10, 10, 1),
            (11, 10, 1),
            (12, 6, 1),
            (12, 10, 1),
            (13, 19, 1),
            (16, 24, 1),
            (19, 2, 1),
            (19, 13, 1),
            (19, 26, 1),
            (20, 2, 1),
            (20, 12, 1),
            (20, 24, 1),
            (20, 60, 1),
            (21, 17, 1),
            (22, 4, 1),
            (22, 10, 1),
            (28, 9, 1),
        ]
    );
}

/// Gaps of contacts and boundaries of projections have surfaces, and members of parts may be switching functions.
#[test]
fn surfaces_of_contacts_and_parts_have_colours() {
    let text = "\
model ball {
  state q[2] = [0, 1];
  state v[2] = [1, 0];
  let h = q[2] - 0.1;
  q' = v;
  mechanics q, v {
    mass = 1;
    force = [0, -10];
  }
  contact floor { gap = h; restitution = 0.5; }
  state w = 1;
  w' = -1;
  let depth = w + 1;
  project w onto { depth >= 0; }
}
model whole {
  part b = ball;
  state r = 1;
  r' = -sign(b.w);
}
";
    let shown = told(text);
    assert_eq!(
        places(&shown, "surface"),
        [
            (3, 6, 1),
            (9, 24, 1),
            (10, 8, 1),
            (11, 2, 1),
            (12, 6, 5),
            (12, 14, 1),
            (13, 10, 1),
            (13, 19, 5),
            (18, 15, 1),
        ]
    );
}
