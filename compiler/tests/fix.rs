//! Fixes of diagnostics: what `nsdc check --fix` makes of a file, and what it leaves alone.

use std::fs;

use crate::terminal::{folder, nsdc, nsdc_with_input};
use serde_json::Value;

/// A model with a line in it, and an experiment with a setting.
fn around(line: &str, setting: &str) -> String {
    format!(
        "model m {{\n  param k = 1;\n  state x = 1;\n  {line}\n  x' = -k*x;\n}}\nsimulate s of m {{\n  \
         horizon 1;\n  {setting}\n}}\n"
    )
}

/// Mends a text; what is said, and the text afterwards.
fn mended(test: &str, text: &str) -> (i32, String, String) {
    let folder = folder(test);
    let path = folder.join("a.nsd");
    fs::write(&path, text).unwrap();
    let ran = nsdc(&folder, &["check", "--fix", "a.nsd"]);
    assert_eq!(ran.out.is_empty(), ran.status != 0, "{}", ran.out);
    (ran.status, ran.err, fs::read_to_string(path).unwrap())
}

#[test]
fn safe_fixes_leave_a_file_that_checks() {
    let lines = [
        ("let a = 2*x", "let a = 2*x;"),
        (
            "let a = x // ends\n  let b = 1;",
            "let a = x; // ends\n  let b = 1;",
        ),
        ("let a = x**2;", "let a = x^2;"),
        ("let a = k×x;", "let a = k*x;"),
        ("let a = x ^−2;", "let a = x ^ -2;"),
        ("let a = x² + (x)³;", "let a = x^2 + (x)^3;"),
        ("let a = √(x*x + 1);", "let a = sqrt(x*x + 1);"),
        (
            "let a = if x>0&&k<2 then 1 else 0;",
            "let a = if x>0 and k<2 then 1 else 0;",
        ),
        (
            "let a = if x≤0∨k≥2 then 1 else 0;",
            "let a = if x<=0 or k>=2 then 1 else 0;",
        ),
        (
            "jump j when x < -1 { x = 1; }",
            "jump j when x < -1 { x := 1; }",
        ),
        ("let a = 1;;", "let a = 1;"),
        ("parameter q = 1;", "param q = 1;"),
        ("constant q = 1;", "const q = 1;"),
        ("param q ∈[0, 1] = 1;", "param q in[0, 1] = 1;"),
        ("# the ≤ of a paper", "// the ≤ of a paper"),
        ("% one\n  # two # three\n", "// one\n  // two # three\n"),
        ("/* one\n     two */", "// one\n// two"),
        ("/* one */ let a = x;", "// one\n let a = x;"),
        ("let a = ln(x) + ln(k);", "let a = log(x) + log(k);"),
        (
            "let a = arctan2(x, np.sin(k));",
            "let a = atan2(x, sin(k));",
        ),
        (
            "let a = unitstep(x) + sgn(x);",
            "let a = step(x) + sign(x);",
        ),
        ("let a = PI + M_E^2;", "let a = pi + exp(1)^2;"),
        ("param q in [0, Inf] = 1;", "param q in [0, inf] = 1;"),
        ("state y = 0; der(y) = x;", "state y = 0; y' = x;"),
        (
            "state y[2] = 0; der(y[1]) = x; y[2]' = 0;",
            "state y[2] = 0; y[1]' = x; y[2]' = 0;",
        ),
        ("state y = 0; y’ = x;", "state y = 0; y' = x;"),
        (
            "state y = 0; switch r = sign(y) sliding nonlinear; y' = -r; hidden on r { y' = 1 - r^2; }",
            "state y = 0; switch r = sign(y) sliding nonlinear; y' = -r; hidden on r { y' += 1 - r^2; }",
        ),
    ];
    for (wrong, right) in lines {
        let (status, said, text) = mended("fix_lines", &around(wrong, ""));
        assert_eq!(text, around(right, ""), "{wrong}\n{said}");
        assert_eq!(status, 0, "{wrong}\n{said}");
        assert!(said.starts_with("fixed a.nsd:4:"), "{wrong}\n{said}");
    }
    let settings = [
        ("tolerance = 1e-6;", "tolerance   1e-6;"),
        ("tolerance=1e-6;", "tolerance 1e-6;"),
        ("with { k := 2; }", "with { k = 2; }"),
        (
            "expect x at end ≈ 0.37 within 0.1;",
            "expect x at end ~ 0.37 within 0.1;",
        ),
        ("expect x at end > 0", "expect x at end > 0;"),
    ];
    for (wrong, right) in settings {
        let (status, said, text) = mended("fix_settings", &around("", wrong));
        assert_eq!((status, text), (0, around("", right)), "{wrong}\n{said}");
    }
}

#[test]
fn what_may_mean_something_else_is_a_suggestion() {
    let folder = folder("suggestions");
    let lines = [
        ("let a = sin(tine);", "time"),
        ("let a = 2x;", "2*x"),
        ("let a = e*x;", "exp(1)"),
        ("let a = sin(t);", "time"),
        ("let a = sni(x);", "sin"),
        ("lett a = x;", "let"),
        ("let a = (x];", ")"),
        ("param l : Nm = 1;", "(N*m)"),
        ("let a = [1, 2; ; 3, 4];", ""),
    ];
    for (line, replacement) in lines {
        let text = around(line, "");
        fs::write(folder.join("a.nsd"), &text).unwrap();
        let ran = nsdc(&folder, &["check", "a.nsd", "--json", "-"]);
        let first: Value = serde_json::from_str(ran.out.lines().next().unwrap()).unwrap();
        let fix = &first["fix"];
        assert_eq!(fix["applicability"], "suggestion", "{line}: {first}");
        let edit = &fix["edits"][0];
        assert_eq!(edit["replacement"], replacement, "{line}: {first}");
        let ran = nsdc(&folder, &["check", "--fix", "a.nsd"]);
        assert_eq!(
            (ran.status, ran.err.contains("fixed")),
            (1, false),
            "{line}"
        );
        assert_eq!(fs::read_to_string(folder.join("a.nsd")).unwrap(), text);
    }
}

/// What would become something else, or nothing that can be read.
#[test]
fn what_cannot_be_mended_stays() {
    let lines = [
        "let a = x.max(k);",
        "let a = x.ln(k);",
        "let a = m.np.sin(k);",
        "let a = x²³;",
        "let a = x³²;",
        "let a = sin²(x);",
        "let a = x²(x + 1);",
        "let a = x; /* never closed",
        "let a = x; /*/",
        "state y = 0; der(y // a comment\n  ) = x;",
    ];
    for line in lines {
        let text = around(line, "");
        let (status, said, after) = mended("fix_nothing_safe", &text);
        assert_eq!((status, said.contains("fixed a.nsd")), (1, false), "{said}");
        assert_eq!(after, text);
    }
}

#[test]
fn json_has_places_and_fixes() {
    let folder = folder("fix_json");
    fs::write(folder.join("a.nsd"), around("let é = x**k;", "")).unwrap();
    let ran = nsdc(&folder, &["check", "a.nsd", "--json", "a.jsonl"]);
    assert_eq!((ran.status, ran.out.as_str()), (1, ""));
    let lines = fs::read_to_string(folder.join("a.jsonl")).unwrap();
    insta::assert_snapshot!(lines, @r#"{"checked":"a.nsd","code":"E0015","severity":"error","message":"`**` is written `^`","labels":[{"text":"write `^`","is_primary":true,"file":"a.nsd","start":52,"end":54,"line":4,"column":12,"end_line":4,"end_column":14}],"help":"write `^` instead of `**`","fix":{"title":"write `^`","applicability":"safe","edits":[{"file":"a.nsd","start":52,"end":54,"line":4,"column":12,"end_line":4,"end_column":14,"replacement":"^"}]}}"#);
}

#[test]
fn nothing_else_is_changed() {
    let folder = folder("fix_nothing");
    // What is right, what the file expects to be wrong, and what another file has wrong.
    let right = around("let a = 2*x;", "");
    let expected = format!("expect error E0015;\n{}", around("let a = x**2;", ""));
    let other = "fn f(x) = ln(x);\nmodel n { state x = 1; x' = ln(x); }\n";
    let main = "use ./other;\nmodel m { part n = other.n; }\n";
    let files = [
        ("right.nsd", right.as_str()),
        ("expected.nsd", &expected),
        ("other.nsd", other),
        ("main.nsd", main),
    ];
    for (name, text) in files {
        fs::write(folder.join(name), text).unwrap();
    }
    for (name, status) in [("right.nsd", 0), ("expected.nsd", 1), ("main.nsd", 1)] {
        let ran = nsdc(&folder, &["check", "--fix", name]);
        assert_eq!(
            (ran.status, ran.err.contains("fixed")),
            (status, false),
            "{}",
            ran.err
        );
    }
    for (name, text) in files {
        assert_eq!(fs::read_to_string(folder.join(name)).unwrap(), text);
    }
    let ran = nsdc_with_input(&folder, &["check", "--fix", "-"], "model m { }");
    assert_eq!(ran.status, 64);
    assert_eq!(
        ran.err,
        "error: `--fix` changes files, and standard input is none\n  help: name the file\n"
    );
}
