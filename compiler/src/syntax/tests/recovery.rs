//! What is said about wrong texts, and what is read beside it.

use insta::assert_snapshot;

use crate::diagnostics::Diagnostics;
use crate::source::{SourceMap, Span};
use crate::syntax::{MAX_BYTES, MAX_DEPTH, MAX_ERRORS, MAX_ITEMS, parse};

/// One line per error, and what could be read.
fn check(text: &str) -> String {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let file = sources.add("test.nsd", text);
    let ast = parse(&file, &mut diags);
    let mut shown = String::new();
    for error in diags.errors() {
        let code = error
            .code()
            .map(|code| code.to_string())
            .unwrap_or_default();
        let place = error.labels().and_then(|mut labels| labels.next());
        let place = place.map_or((0, 0), |label| file.line_column(label.offset() as u32));
        shown += &format!("{code} at {}:{}: {error}", place.0, place.1);
        if let Some(help) = error.help() {
            shown += &format!(" | {help}");
        }
        shown += "\n";
    }
    shown + &ast.to_string()
}

fn in_model(body: &str) -> String {
    check(&format!("model m {{\n{body}\n}}"))
}

fn codes(text: &str) -> Vec<String> {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    parse(&sources.add("test.nsd", text), &mut diags);
    diags.codes()
}

#[test]
fn a_bracket_takes_no_room_from_the_braces_before_an_item() {
    for text in ["{[;\nmodel m", "{{}[;\nmodel m"] {
        assert_eq!(codes(text)[..2], ["E0007", "E0007"], "{text}");
    }
}

#[test]
fn signs_of_division_make_no_comment() {
    assert_eq!(codes("{ø/÷}"), ["E0015"]);
    assert_snapshot!(in_model("let a = 1/÷2; let b = 1÷/2; let c = 1÷÷2;"), @r"
    E0015 at 2:11: `÷` is written `/` | write `/` instead of `÷`
    E0015 at 2:24: `÷` is written `/` | write `/` instead of `÷`
    E0015 at 2:38: `÷` is written `/` | write `/` instead of `÷`
    E0015 at 2:39: `÷` is written `/` | write `/` instead of `÷`
    model m {
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
    }
    ");
}

#[test]
fn more_declarations_than_a_file_may_have_are_refused() {
    let declare =
        |count: usize| -> String { (0..count).map(|i| format!("const c{i} = {i};\n")).collect() };
    assert_eq!(codes(&declare(MAX_ITEMS)), [""; 0]);
    assert_eq!(codes(&declare(MAX_ITEMS + 1)), ["E0002"]);
}

#[test]
fn a_contact_after_a_missing_semicolon_is_read() {
    assert_snapshot!(in_model("mechanics q, v { mass = 1; force = f contact floor { gap = q; } }"), @r"
    E0011 at 2:37: expected `;` after this expression | end the statement with `;`
    model m {
      mechanics q, v {
        mass = 1;
        force = f;
        contact floor {
          gap = q;
        }
      }
    }
    ");
}

#[test]
fn statements_after_a_missing_semicolon_are_read() {
    assert_snapshot!(in_model("state x = 0\nstate y = 1\nregion r where x > 0 { y' = 2 }\nx' = 1 y' = 2;\nx' = (1\n+ 2) y;"), @r"
    E0011 at 2:12: expected `;` after this expression | end the statement with `;`
    E0011 at 3:12: expected `;` after this expression | end the statement with `;`
    E0011 at 4:30: expected `;` after this expression | end the statement with `;`
    E0011 at 5:7: expected `;` after this expression | end the statement with `;`
    E0010 at 7:6: expected `;` or an operator, found `y`
    model m {
      state x = 0;
      state y = 1;
      region r where x > 0 {
        y' = 2;
      }
      x' = 1;
      y' = 2;
      // a statement that could not be read
    }
    ");
}

#[test]
fn statements_around_an_open_bracket_are_read() {
    assert_snapshot!(in_model("state x = 0;\nx' = (1 + 2;\nlet a = [1, 2;\ny' = 1;\nlet b = f(x, [1;\nz' = 1;"), @r"
    E0007 at 3:6: `(` is never closed | close it with `)`
    E0007 at 4:9: `[` is never closed | close it with `]`
    E0007 at 6:10: `(` is never closed | close it with `)`
    E0007 at 6:14: `[` is never closed | close it with `]`
    model m {
      state x = 0;
      // a statement that could not be read
      // a statement that could not be read
      y' = 1;
      // a statement that could not be read
      z' = 1;
    }
    ");
    assert_snapshot!(in_model("region r where (x > 0 { x' = 1; }\nlet a = [f(x], 2);\nlet b = (1];"), @r"
    E0007 at 2:16: `(` is never closed | close it with `)`
    E0007 at 3:11: `(` is never closed | close it with `)`
    E0008 at 3:17: `)` closes nothing | remove it, or open it with `(`
    E0008 at 4:11: `]` closes nothing | close `(` with `)`
    model m {
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
    }
    ");
    assert_snapshot!(check("model a {\n  x' = 1;\n\n// the next\nmodel b {\n  region r where x > 0 {\n    y' = 1;\nsimulate s of a { }"), @r"
    E0007 at 1:9: `{` is never closed | close it with `}`
    E0007 at 5:9: `{` is never closed | close it with `}`
    E0007 at 6:24: `{` is never closed | close it with `}`
    E0018 at 8:1: `simulate` does not belong in a model | move it to the top level of a file; a `}` may be missing before it
    model a {
      x' = 1;
    }
    model b {
      region r where x > 0 {
        y' = 1;
        // a statement that could not be read
      }
    }
    ");
}

#[test]
fn a_stray_character_costs_one_error_only() {
    assert_snapshot!(in_model("x' = 1 @@@ 2;\ny' = § 3;\nregion r where x ? 0 { y' = 1 \\; z' = 2; }"), @r"
    E0004 at 2:8: unexpected character `@`
    E0004 at 3:6: unexpected character `§`
    E0004 at 4:18: unexpected character `?` | write `if x > 0 then a else b`
    E0004 at 4:31: unexpected character `\` | write the operator or the function by its name
    model m {
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
    }
    ");
    assert_snapshot!(check("\0\0\u{1}binary"), @r"
    E0004 at 1:1: unexpected character U+0000 | the file does not seem to be text
    E0012 at 1:4: no item of a file starts with `binary` | start with `use`, `const`, `fn`, `model`, `simulate`, `optimize`, `fit`, `mpc`, `expect`
    // a statement that could not be read
    ");
}

#[test]
fn strings_that_are_not_closed_hide_only_their_statement() {
    assert_snapshot!(in_model("signal r = f(g(\"data.csv, 2), 3);\nx' = 1;\ny' = ;"), @r#"
    E0005 at 2:16: string is not closed | close it with `"` on the same line
    E0010 at 4:6: expected an expression, found `;`
    model m {
      // a statement that could not be read
      // a statement that could not be read
    }
    "#);
}

#[test]
fn foreign_notation_is_translated() {
    assert_snapshot!(in_model("x'' = a·b − c ≤ d && !e || f ** 2;\nx' == y';\nx -> 2;\ny' = 1 ∧ 2;\nder(x) = “a”;"), @r#"
    E0014 at 2:2: there is no second derivative `x''` | declare a state for the velocity: `x' = v;` and `v' = ...;`
    E0015 at 2:8: `·` is written `*` | write `*` instead of `·`
    E0015 at 2:11: `−` is written `-` | write `-` instead of `−`
    E0015 at 2:15: `≤` is written `<=` | write `<=` instead of `≤`
    E0015 at 2:19: `&&` is written `and` | write `and` instead of `&&`
    E0015 at 2:22: `!` is written `not` | write `not` instead of `!`
    E0015 at 2:25: `||` is written `or` | write `or` instead of `||`
    E0015 at 2:30: `**` is written `^` | write `^` instead of `**`
    E0013 at 3:4: `==` does not exist | write `=` in a declaration or a constraint, `<` or `>` in a guard
    E0015 at 4:3: `->` is written `=` | write `=` instead of `->`
    E0015 at 5:8: `∧` is written `and` | write `and` instead of `∧`
    E0015 at 6:10: `“` is written `"` | write `"` instead of `“`
    E0015 at 6:12: `”` is written `"` | write `"` instead of `”`
    model m {
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
    }
    "#);
}

#[test]
fn misplaced_statements_say_where_they_belong() {
    assert_snapshot!(check("state x = 0;\nsimulate s of m {\n  param k = 1;\n  foo 3;\n}\n"), @r"
    E0018 at 1:1: `state` does not belong at the top level of a file | move it into a model
    E0018 at 3:3: `param` does not belong in an experiment | move it into a model
    E0012 at 4:3: no setting of an experiment starts with `foo` | start with `with`, `horizon`, `tolerance`, `method`, `lower`, `output`, `perturb`, `on`, `stop`, `sensitivity`, `data`, `loss`, `controller`, `sample`, `deadline`, `runs`, `intervals`, `elements`, `scheme`, `grid`, `controls`, `minimize`, `subject`, `initial`, `free`, `final`, `guess`, `starts`, `plot`, `animate`, `expect`
    // a statement that could not be read
    simulate s of m {
      // a statement that could not be read
      // a statement that could not be read
    }
    ");
    assert_snapshot!(in_model("simulate s of m { horizon 1; }\nhorizon 1;\nuse a.b;"), @r"
    E0018 at 2:1: `simulate` does not belong in a model | move it to the top level of a file; a `}` may be missing before it
    E0018 at 3:1: `horizon` does not belong in a model | move it into an experiment
    E0018 at 4:1: `use` does not belong in a model | move it to the top level of a file; a `}` may be missing before it
    model m {
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
    }
    ");
}

#[test]
fn members_of_blocks_are_checked_one_by_one() {
    assert_snapshot!(in_model("part b = disc { m = ; q = 2; r := 3; s 4; }\njump j when x > 0 { v = 1; w := 2 }\nmechanics q, v { mass 3; contact c { gap = ; slip = 2; } force = 1; }\nproject x onto { a; b >= 0; for i in 1..2 { c >= ; } } metric ;"), @r"
    E0010 at 2:21: expected an expression, found `;`
    E0010 at 2:32: expected `=`, found `:=` | write `=`; `:=` stands only in a `jump`
    E0010 at 2:40: expected `=`, found `4`
    E0010 at 3:23: expected `:=`, found `=` | write `:=`; a jump sets the value after it
    E0011 at 3:34: expected `;` after this expression | end the statement with `;`
    E0010 at 4:23: expected `=`, found `3`
    E0010 at 4:44: expected an expression, found `;`
    E0010 at 5:19: expected `<=`, `>=`, `=` or an operator, found `;`
    E0010 at 5:50: expected an expression, found `;`
    E0012 at 5:56: no statement of a model starts with `metric` | start with `const`, `param`, `state`, `discrete`, `control`, `input`, `algebraic`, `let`, `output`, `signal`, `switch`, `part`, `region`, `hidden`, `project`, `jump`, `every`, `mechanics`, `contact`, `for`, or the derivative of a state
    model m {
      part b = disc {
        q = 2;
      }
      jump j when x > 0 {
        w := 2;
      }
      mechanics q, v {
        force = 1;
        contact c {
          slip = 2;
        }
      }
      project x onto {
        // a statement that could not be read
        b >= 0;
        for i in 1..2 {
          // a statement that could not be read
        }
      }
      // a statement that could not be read
    }
    ");
    assert_snapshot!(check("optimize o of m {\n  guess { from 3; u 1; v = 2; }\n  free { k in ; l; }\n  initial { x free in; y >= ; z free; }\n  subject to { x; } at ;\n  method m { a = ; b = 2; }\n}"), @r"
    E0010 at 2:16: expected a name or a string, found `3`
    E0010 at 2:21: expected `=`, found `1`
    E0010 at 3:15: expected `{` or `[`, found `;`
    E0010 at 4:15: expected `<=`, `>=`, `=` or an operator, found `free`
    E0010 at 4:29: expected an expression, found `;`
    E0010 at 5:17: expected `<=`, `>=`, `=` or an operator, found `;`
    E0012 at 5:21: no setting of an experiment starts with `at` | start with `with`, `horizon`, `tolerance`, `method`, `lower`, `output`, `perturb`, `on`, `stop`, `sensitivity`, `data`, `loss`, `controller`, `sample`, `deadline`, `runs`, `intervals`, `elements`, `scheme`, `grid`, `controls`, `minimize`, `subject`, `initial`, `free`, `final`, `guess`, `starts`, `plot`, `animate`, `expect`
    E0010 at 6:18: expected an expression, found `;`
    optimize o of m {
      guess {
        v = 2;
      }
      free {
        l;
      }
      initial {
        z free;
      }
      subject to {
        // a statement that could not be read
      }
      // a statement that could not be read
      method m {
        b = 2;
      }
    }
    ");
}

#[test]
fn derivatives_and_names_in_the_wrong_places() {
    assert_snapshot!(in_model("x' = y' + 1;\nlet a = x';\nx = 1;\nx[1] += 2;\nstate if = 1;\nx' = and;\nlet ｏｒ = 1;"), @r"
    E0019 at 2:7: `'` stands only on the left of `=` | name the right side with `let` and use that name in both places
    E0019 at 3:10: `'` stands only on the left of `=` | name the right side with `let` and use that name in both places
    E0016 at 4:1: `x =` sets nothing in a model | write `x' = ...;` for dynamics, or `let x = ...;` for a name
    E0016 at 5:1: `x[1] +=` sets nothing in a model | write `x[1]' += ...;` for dynamics, or `let x = ...;` for a name
    E0009 at 6:7: `if` is reserved | choose another name, such as `if_1`
    E0010 at 7:6: expected an expression, found `and`
    E0009 at 8:5: `or` is reserved | choose another name, such as `or_1`
    model m {
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
      let or = 1;
    }
    ");
}

#[test]
fn what_is_no_statement_at_all() {
    assert_snapshot!(in_model("{ x' = 1; }\n[1, 2];\n+;\nif x > 0 { x' = 1; } else { x' = 2; }\n\"text\";\n3 = x;"), @r"
    E0012 at 2:1: no statement of a model starts with `{` | start with `const`, `param`, `state`, `discrete`, `control`, `input`, `algebraic`, `let`, `output`, `signal`, `switch`, `part`, `region`, `hidden`, `project`, `jump`, `every`, `mechanics`, `contact`, `for`, or the derivative of a state
    E0012 at 3:1: no statement of a model starts with `[` | start with `const`, `param`, `state`, `discrete`, `control`, `input`, `algebraic`, `let`, `output`, `signal`, `switch`, `part`, `region`, `hidden`, `project`, `jump`, `every`, `mechanics`, `contact`, `for`, or the derivative of a state
    E0012 at 4:1: no statement of a model starts with `+` | start with `const`, `param`, `state`, `discrete`, `control`, `input`, `algebraic`, `let`, `output`, `signal`, `switch`, `part`, `region`, `hidden`, `project`, `jump`, `every`, `mechanics`, `contact`, `for`, or the derivative of a state
    E0012 at 5:1: no statement of a model starts with `if` | cases of the dynamics are written `region NAME where ... { ... }`
    E0012 at 5:22: no statement of a model starts with `else` | cases of the dynamics are written `region NAME where ... { ... }`
    E0012 at 6:1: no statement of a model starts with a string | start with `const`, `param`, `state`, `discrete`, `control`, `input`, `algebraic`, `let`, `output`, `signal`, `switch`, `part`, `region`, `hidden`, `project`, `jump`, `every`, `mechanics`, `contact`, `for`, or the derivative of a state
    E0012 at 7:1: no statement of a model starts with `3` | start with `const`, `param`, `state`, `discrete`, `control`, `input`, `algebraic`, `let`, `output`, `signal`, `switch`, `part`, `region`, `hidden`, `project`, `jump`, `every`, `mechanics`, `contact`, `for`, or the derivative of a state
    model m {
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
      // a statement that could not be read
    }
    ");
    assert_eq!(codes(""), ["E0017"]);
    assert_eq!(codes(" // only a comment"), ["E0017"]);
    assert_eq!(codes("}"), ["E0008"]);
    assert_eq!(codes("model m {}};"), ["E0008"]);
}

#[test]
fn depth_is_limited_before_anything_recurses() {
    let statement = |value: String| format!("model m {{ x' = {value}; }}");
    let nested = |open: &str, close: &str, depth: usize| {
        statement(format!("{}1{}", open.repeat(depth), close.repeat(depth)))
    };
    let shapes: [(&str, &str); 10] = [
        ("(", ")"),
        ("[", "]"),
        ("f(", ")"),
        ("-", ""),
        ("not ", ""),
        ("2^", ""),
        ("if a then b else ", ""),
        ("x[", "]"),
        ("", "(1)"),
        ("", ".y"),
    ];
    for (open, close) in shapes {
        let fits = nested(open, close, MAX_DEPTH - 5).replace("1.y", "x.y");
        assert!(codes(&fits).is_empty(), "{open}{close}: {:?}", codes(&fits));
        let deep = nested(open, close, MAX_DEPTH + 1).replace("1.y", "x.y");
        assert_eq!(codes(&deep), ["E0003"], "{open}{close}");
    }
    // Each bracket adds to what is nested on its left.
    let left = statement(format!("{}x{}", "(".repeat(100), ")[1].y".repeat(100)));
    assert_eq!(codes(&left), ["E0003"]);
    assert_eq!(
        codes(&"model m { for i in 1..2 {".repeat(MAX_DEPTH)),
        ["E0003"]
    );
    assert_eq!(codes(&"([{".repeat(100_000)), ["E0003"]);
}

#[test]
fn long_chains_are_not_deep() {
    let long = |unit: &str| format!("model m {{ x' = 1{}; }}", unit.repeat(20_000));
    for unit in [
        " + x",
        " - 2^x",
        "*x",
        " .* -x",
        " and x",
        " or not x",
        " < x",
    ] {
        assert!(codes(&long(unit)).is_empty(), "{unit}");
    }
    let rows = format!(
        "model m {{ x' = [1{}{}]; }}",
        ", 1".repeat(9_000),
        "; 1".repeat(9_000)
    );
    assert!(codes(&rows).is_empty());
}

#[test]
fn files_that_are_refused_as_a_whole() {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let file = sources.add_bytes("latin.nsd", b"model m { }\n// \xfc".to_vec());
    assert!(parse(&file, &mut diags).items.is_empty());
    assert_eq!(diags.codes(), ["E0001"]);
    assert!(
        diags
            .errors()
            .any(|error| error.to_string().contains("byte 15"))
    );

    let large = format!("model m {{ }}\n// {}", "ü".repeat(MAX_BYTES / 2));
    assert_eq!(codes(&large), ["E0002"]);
}

#[test]
fn errors_are_counted_up_to_a_limit() {
    let many = codes(&format!(
        "model m {{ {} }}",
        "x' = ; ".repeat(3 * MAX_ERRORS)
    ));
    assert_eq!(many.len(), MAX_ERRORS + 1);
    assert_eq!(many.last().map(String::as_str), Some("E0021"));
    assert_eq!(codes(&"@ ".repeat(3 * MAX_ERRORS)).len(), MAX_ERRORS + 1);
}

#[test]
fn errors_point_into_their_own_file() {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    sources.add("first.nsd", "model a { }");
    let file = sources.add("second.nsd", "model b {\n  x' = ;\n");
    parse(&file, &mut diags);
    let spans = diags.errors().filter_map(|error| error.labels()?.next());
    let texts: Vec<&str> = spans
        .map(|label| sources.text(Span::new(label.offset()..label.offset() + label.len())))
        .collect();
    assert_eq!(texts, ["{", ";"]);
}
