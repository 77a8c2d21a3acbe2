//! What hovers tell of values and equations, and of which experiment they are.

use std::path::Path;

use nsdc::cli::Exit;
use serde_json::{Value, json};

use super::client::{Client, memory, position, uri};

/// What is told of the first place of some words.
fn told(client: &mut Client, path: &Path, text: &str, words: &str) -> String {
    let at = text.find(words).expect("it is there");
    let found = client.at("textDocument/hover", path, position(text, at));
    let told = found["contents"]["value"].as_str().expect("it is told");
    told.to_owned()
}

/// The line over the equations, and these.
pub fn equations(told: &str) -> Option<(&str, &str)> {
    let (before, behind) = told.split_once("\n\n```text\n")?;
    let (_, heading) = before.rsplit_once("\n\n")?;
    Some((heading, behind.strip_suffix("\n```")?))
}

/// At a name stand the equations that are made of it, and the switches that these meet.
#[test]
fn names_tell_their_equations() {
    let mut client = Client::new(&[]);
    let path = memory("equations.nsd");
    let text = "
model belt {
  param mu = 0.3;
  state x = 0;
  state v = 1;
  state w = 2;
  switch s = sign(v - 1);
  x' = v;
  v' = -x - mu*s;
  region low where w < 2 { w' = 1; }
  region high else { w' = -abs(x); }
  output force = mu*s;
}
simulate pulls of belt { horizon 1; output force, w, x; }
";
    assert_eq!(client.open(&path, text), Vec::<Value>::new());
    let mut here = |name: &str| {
        let told = told(&mut client, &path, text, name);
        let (heading, lines) = equations(&told)?;
        assert_eq!(heading, "in `pulls`:");
        Some(lines.to_owned())
    };
    let slides = "\
der(v) = -mu*(2*alpha[3] - 1) - x
alpha[3] in step(v - 1)  // s, discontinuous
  read by s as psi";
    assert_eq!(here("v' =").as_deref(), Some(slides));
    assert_eq!(here("v = 1").as_deref(), Some(slides));
    assert_eq!(here("x' =").as_deref(), Some("der(x) = v"));
    assert_eq!(here("mu = 0.3"), None);
    let switch = slides.split_once('\n').expect("lines").1;
    assert_eq!(here("s = sign").as_deref(), Some(switch));
    let falls = "\
der(w) = 1 - x*alpha[1]*(2*alpha[2] - 1) - alpha[1]
partition of w  // one region everywhere: proven
  low: 1 - alpha[1]
  high: alpha[1]
alpha[1] in step(w - 2)  // w - 2, discontinuous
alpha[2] in step(x)  // x, continuous";
    assert_eq!(here("w' = 1").as_deref(), Some(falls));
    assert_eq!(client.end(), Exit::Success);
}

/// Regions that a parameter of zero would make empty.
const REGIONS: &str = "\
model m {
  param n;
  param k = 4;
  state x = 1;
  state y = 2;
  region low where x < n { x' = k; }
  region high where x > 2*n { x' = -1; }
  region rest else { x' = 0; }
  y' = -n*y;
}
";

/// Nothing is told at values that no experiment gives.
#[test]
fn equations_are_those_of_an_experiment() {
    let mut client = Client::new(&[]);
    let path = memory("experiments.nsd");
    for rest in [
        "",
        "simulate open of m { horizon 1; }\n",
        "simulate twice of m { with { n = 1; n = 2; } horizon 1; }\n",
    ] {
        let text = format!("{REGIONS}{rest}");
        assert_eq!(client.open(&path, &text).is_empty(), rest.is_empty());
        for name in ["x = 1", "y = 2", "low where", "k = 4"] {
            let told = told(&mut client, &path, &text, name);
            assert_eq!(equations(&told), None, "{told}");
            assert!(!told.contains(" in `"), "{told}");
            assert!(!told.contains("k = 4\n\n"), "{told}");
        }
    }
    // The first that gives all, and whose system has the name; inside of another one, that.
    let text = format!(
        "{REGIONS}\
simulate open of m {{ horizon 1; }}
simulate one of m {{ with {{ n = 1; k = 5; }} horizon 1; output y; }}
simulate two of m {{ with {{ n = 2; k = 6; }} horizon 1; }}
simulate three of m {{ with {{ n = 3; k = 7; }} horizon 1; expect k*x at end < 99; }}
"
    );
    assert_eq!(client.open(&path, &text).len(), 1);
    for (name, expected) in [
        ("k = 4", "k = 5 in `one`"),
        ("n = 2", "n = 2 in `two`"),
        ("k*x", "k = 7 in `three`"),
        ("y = 2", "\n\nin `one`:\n\n```text\nder(y) = -n*y\n```"),
        ("x = 1", "\n\nin `two`:\n\n```text\nder(x) = "),
        ("x at end", "\n\nin `three`:\n\n```text\nder(x) = "),
    ] {
        let told = told(&mut client, &path, &text, name);
        assert!(told.contains(expected), "{name}: {told}");
    }
    assert_eq!(client.end(), Exit::Success);
}

/// Models of one name in different files are different.
#[test]
fn models_of_one_name_are_not_confused() {
    let mut client = Client::new(&[]);
    let twin =
        |rate: i32| format!("model twin {{ param a = {rate}; state x = 1; x' = -{rate}*x; }}\n");
    client.open(&memory("twins_one.nsd"), &twin(111));
    client.open(&memory("twins_two.nsd"), &twin(222));
    let path = memory("twins.nsd");
    let text = "use ./twins_one;
use ./twins_two;
model twin { param a = 333; state x = 1; x' = -333*x; }
simulate one of twins_one.twin { horizon 1; expect x + a at end < 200; }
simulate two of twins_two.twin { horizon 1; expect x - a at end < 200; }
simulate here of twin { horizon 1; expect x*a at end < 400; }
simulate other of twin { horizon 1; }
";
    assert_eq!(client.open(&path, text), Vec::<Value>::new());
    let places = [
        ("one", "x + a", 111),
        ("two", "x - a", 222),
        ("here", "x*a", 333),
    ];
    for (name, words, rate) in places {
        let its = told(&mut client, &path, text, words);
        let (heading, lines) = equations(&its).expect("it has an equation");
        assert_eq!(
            (heading, lines),
            (&*format!("in `{name}`:"), &*format!("der(x) = -{rate}*x"))
        );
        let at = text.find(words).expect("it is there") + words.len() - 1;
        let found = client.at("textDocument/hover", &path, position(text, at));
        let its = found["contents"]["value"].as_str().expect("it is told");
        assert!(its.contains(&format!("a = {rate} in `{name}`")), "{its}");
    }
    // What cannot be read in another experiment changes nothing of them.
    let broken = text.replace("simulate other of twin {", "simulate other of twin { = ;");
    assert!(!client.open(&path, &broken).is_empty());
    for (name, words, rate) in places {
        let its = told(&mut client, &path, &broken, words);
        let (heading, lines) = equations(&its).expect("it has an equation");
        let expected = format!("in `{name}`:");
        assert_eq!(
            (heading, lines),
            (&*expected, &*format!("der(x) = -{rate}*x"))
        );
    }
    assert_eq!(client.end(), Exit::Success);
}

/// While a text is wrong, no value of another one is told, and equations of that only of a model that stays.
#[test]
fn what_was_before_an_error_is_told_as_that() {
    let mut client = Client::new(&[]);
    let path = memory("before.nsd");
    let text = "\
model m {
  param k = 1;
  state x = 1;
  state y = 1;
  x' = -k*x;
  y' = -y;
}
simulate one of m { with { k = 2; } horizon 1; }
";
    for (old, new, heading) in [
        // The model itself has become another.
        ("y' = -y", "y' = -q", None),
        ("y' = -y", "y' = = -y", None),
        ("-k*x;\n  y' = -y", "-3*k*x;\n  y' = -q", None),
        // The experiment has.
        (
            "k = 2;",
            "k = 3; z = 1;",
            Some("before the error, in `one`:"),
        ),
        ("k = 2;", "k = 3 3;", Some("before the error, in `one`:")),
        // Something else has, which can be read.
        (
            "simulate one",
            "model w { state z = 1; z' = q; }\nsimulate one",
            Some("in `one`:"),
        ),
    ] {
        assert_eq!(client.open(&path, text), Vec::<Value>::new());
        let sound = told(&mut client, &path, text, "k = 1");
        assert!(sound.contains("k = 2 in `one`"), "{sound}");
        let wrong = text.replace(old, new);
        assert!(!client.open(&path, &wrong).is_empty());
        let its = told(&mut client, &path, &wrong, "x = 1");
        assert_eq!(
            equations(&its),
            heading.map(|known| (known, "der(x) = -k*x")),
            "{new}"
        );
        let its = told(&mut client, &path, &wrong, "k = 1");
        let has_value = heading == Some("in `one`:");
        assert_eq!(its.contains("k = 2 in `one`"), has_value, "{new}: {its}");
        assert_eq!(its.contains(" in `one`"), has_value, "{new}: {its}");
    }
    assert_eq!(client.end(), Exit::Success);
}

/// A model with parts of one model, one inside of another, and one in an array.
const PARTS: &str = "\
model sub { param g = 2; input a; state w = 1; w' = -w*g + a; output y = w*g; switch s = sign(w - 3); }
model mid { param h = 3; part q = sub { g = h; a = 0; } output z = q.w; }
model big {
  param G = 7;
  part p = sub { g = G; a = p.s; }
  part m = mid { h = 4; }
  part legs[i in 2..3] = sub { g = 5; a = 0; }
  state z = 1;
  z' = -p.y - m.q.w - legs[2].w - legs[3].w;
}
simulate r of big { horizon 1; with { p.w = 9; m.q.w = 8; legs[2].w = 6; legs[3].w = 4; } expect p.y at end < 100; }
";

/// What a part declares has the values and equations of the part that is named, or else of the first one.
#[test]
fn members_are_those_of_their_part() {
    let mut client = Client::new(&[]);
    let path = memory("parts.nsd");
    assert_eq!(client.open(&path, PARTS), Vec::<Value>::new());
    for (words, its) in [
        (
            "w = 9",
            "p.w = 9 at the start in `r`\n\nin `r`:\n\n```text\nder(p.w) = ",
        ),
        (
            "w = 8",
            "m.q.w = 8 at the start in `r`\n\nin `r`:\n\n```text\nder(m.q.w) = ",
        ),
        ("w - legs", "m.q.w = 8 at the start"),
        ("w = 6", "legs[2].w = 6 at the start"),
        ("w;\n}", "legs[3].w = 4 at the start"),
        ("y - m", "in `r`:\n\n```text\noutput p.y = p.g*p.w"),
        ("g = G", "p.g = 7 in `r`"),
        ("g = h", "m.q.g = 4 in `r`"),
        ("g = 5", "legs[2].g = 5 in `r`"),
        // In the model of the parts, the first of them.
        ("g = 2", "p.g = 7 in `r`"),
        ("w = 1", "p.w = 9 at the start in `r`"),
        ("h = 3", "m.h = 4 in `r`"),
    ] {
        let told = told(&mut client, &path, PARTS, words);
        assert!(told.contains(its), "{words}: {told}");
    }
    // Where an experiment has the model by itself, that one.
    let text = format!("{PARTS}simulate own of sub {{ horizon 1; with {{ a = 0; g = 11; }} }}\n");
    assert_eq!(client.open(&path, &text), Vec::<Value>::new());
    for (words, its) in [
        ("g = 2", "\n\ng = 11 in `own`"),
        ("w = 9", "p.w = 9 at the start in `r`"),
    ] {
        let told = told(&mut client, &path, &text, words);
        assert!(told.contains(its), "{words}: {told}");
    }
    assert_eq!(client.end(), Exit::Success);
}

/// Parts that are made of each other, or of many levels of two, are told as far as they are found soon.
#[test]
fn parts_without_end_are_answered() {
    let mut client = Client::new(&[]);
    let path = memory("endless.nsd");
    let mut text = "model a { part x = a; part y = a; part z = b; state q = 1; q' = 0; }
model b { part x = a; part y = b; }
model sub { state w = 1; w' = -w; }
model p0 { part l = sub; part r = sub; }
"
    .to_owned();
    for k in 1..40 {
        text += &format!("model p{k} {{ part l = p{0}; part r = p{0}; }}\n", k - 1);
    }
    text += "simulate e of a { horizon 1; }\nsimulate f of p39 { horizon 1; }\n";
    assert!(!client.open(&path, &text).is_empty());
    for words in ["q = 1", "w = 1"] {
        let told = told(&mut client, &path, &text, words);
        assert!(told.contains("state"), "{told}");
    }
    assert_eq!(client.end(), Exit::Success);
}

/// What is declared without a unit has the one that follows, and its own comment alone.
#[test]
fn units_follow_and_comments_are_of_one_name() {
    let mut client = Client::new(&[]);
    let path = memory("units.nsd");
    let text = "\
/// Of the model.
model one { state n = 1; n' = 0; }
model m {
  /// Of L.
  param L : m = 2; param T : s = 3;
  let speed = L/T; let pure = 2*3;
  state q : m = 1;
  q' = speed;
  output all = [q; L];
}
simulate r of m { horizon 1; }
";
    assert_eq!(client.open(&path, text), Vec::<Value>::new());
    for (words, its, other) in [
        ("n = 1", "state of `one`", "Of the model"),
        ("L : m", "Of L.", "Of the model"),
        ("T : s", "in s", "Of L"),
        ("speed =", "let of `m`, in m/s\n", "Of"),
        ("pure =", "let of `m`\n", ", in "),
        ("all =", "output of `m`, in m, a vector of 2", "Of"),
    ] {
        let told = told(&mut client, &path, text, words);
        assert!(
            told.contains(its) && !told.contains(other),
            "{words}: {told}"
        );
    }
    assert_eq!(
        hints(&mut client, &path),
        [
            (5, ": m/s".to_owned()),
            (8, "[2]".to_owned()),
            (8, ": m".to_owned())
        ]
    );
    assert_eq!(client.end(), Exit::Success);
}

/// The hints of a text, with their lines.
fn hints(client: &mut Client, path: &Path) -> Vec<(u64, String)> {
    let range =
        json!({ "start": { "line": 0, "character": 0 }, "end": { "line": 99, "character": 0 } });
    let params = json!({ "textDocument": { "uri": uri(path) }, "range": range });
    let found = client.ask("textDocument/inlayHint", params);
    let hint = |hint: &Value| {
        let line = hint["position"]["line"].as_u64()?;
        Some((line, hint["label"].as_str()?.to_owned()))
    };
    found
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(hint)
        .collect()
}

/// What cannot be read in one model changes nothing of another one, and hints stay in lines that do.
#[test]
fn a_broken_model_is_no_other_one() {
    let mut client = Client::new(&[]);
    let path = memory("neighbours.nsd");
    let text = "\
model m { param k = 2*3; let w = [k, k];
  state x = 1; x' = -k*x; }
model n { state y = 1;
  y' = -y; let v = [y, y]; }
simulate r of m { with { k = 4; } horizon 1; }
";
    let hinted = |shift: u64| {
        let of_m = [(0, "= 4"), (0, "[2]")].map(|(line, text)| (line + shift, text.to_owned()));
        of_m.to_vec()
    };
    assert_eq!(client.open(&path, text), Vec::<Value>::new());
    let mut all = hinted(0);
    all.push((3, "[2]".to_owned()));
    assert_eq!(hints(&mut client, &path), all);
    let broken = text.replace("-y;", "-(y ;");
    assert!(!client.open(&path, &broken).is_empty());
    let its = told(&mut client, &path, &broken, "k = 2");
    assert!(its.contains("k = 4 in `r`"), "{its}");
    let its = told(&mut client, &path, &broken, "x' =");
    assert!(
        its.contains("\n\nin `r`:\n\n```text\nder(x) = -k*x"),
        "{its}"
    );
    assert_eq!(hints(&mut client, &path), hinted(0));
    assert_eq!(client.open(&path, text), Vec::<Value>::new());
    let broken = format!("model w {{\n  state v = = ; }}\n{text}");
    assert!(!client.open(&path, &broken).is_empty());
    assert_eq!(hints(&mut client, &path)[..2], hinted(2));
    // An experiment that cannot be read gives no values.
    let broken = text.replace("k = 4;", "k = ;");
    assert!(!client.open(&path, &broken).is_empty());
    let its = told(&mut client, &path, &broken, "k = 2");
    assert!(!its.contains("in `r`"), "{its}");
    assert_eq!(client.end(), Exit::Success);
}
