//! Random trees print and read back; random texts do no harm.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

use super::layout::formatted;
use super::{read, skeleton};
use crate::diagnostics::{Diagnostics, Fix, apply, render};
use crate::source::SourceMap;
use crate::syntax::parse;

/// Models that use most of the language.
const MODELS: [&str; 4] = [
    include_str!("samples/chain.nsd"),
    include_str!("samples/contact.nsd"),
    include_str!("samples/control.nsd"),
    include_str!("samples/parts.nsd"),
];

/// Expressions with redundant parentheses in random places.
fn expression() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        select(vec![
            "x", "y_1", "θ", "if_", "time", "2", "0.5", "1e-3", "\"s\"", "[1, 2]", "A[:, 2]"
        ])
        .prop_map(str::to_owned),
        (0.0..1e9_f64).prop_map(|value| format!("{value:?}")),
    ];
    leaf.prop_recursive(5, 60, 4, |inner| {
        let group = inner.clone().prop_map(|inner| format!("({inner})"));
        let operand = prop_oneof![
            group.clone(),
            group,
            inner.clone().prop_filter("an operand", |text| {
                !text.contains([' ', '<', '-', '+']) && !text.starts_with("if")
            })
        ];
        let infix = select(vec![
            "+", " - ", "*", "/", ".*", " ./ ", "^", ".^", " < ", ">=", " and ", " or ",
        ]);
        prop_oneof![
            (operand.clone(), vec((infix, operand.clone()), 1..4)).prop_map(|(first, rest)| {
                rest.iter().fold(first, |text, (infix, operand)| {
                    format!("{text}{infix}{operand}")
                })
            }),
            operand.clone().prop_map(|operand| format!("-{operand}")),
            operand.clone().prop_map(|operand| format!("not {operand}")),
            (operand.clone(), inner.clone()).prop_map(|(f, x)| format!("{f}({x}, fit = {x})")),
            operand.clone().prop_map(|x| format!("{x}[1, x..y-1].b")),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("[{a}, {b}; {b}, {a}]")),
            inner.clone().prop_map(|a| format!("[{a};]")),
            inner
                .clone()
                .prop_map(|a| format!("[{a} for i in 1..n, j in i+1..n]")),
            inner
                .clone()
                .prop_map(|a| format!("sum({a} for i in 1..n)")),
            (inner.clone(), inner.clone(), inner)
                .prop_map(|(a, b, c)| format!("(if {a} then {b} else {c})")),
        ]
    })
}

/// Statements of a model.
fn statement() -> impl Strategy<Value = String> {
    let simple = (expression(), 0..15).prop_map(|(e, kind)| match kind {
        0 => format!("state x[{e}, 2] : m/s in [{e}, 1] = {e};"),
        1 => format!("let a = {e};"),
        2 => format!("control u in {{0, {e}}};"),
        3 => format!("switch s = {e} sliding linear;"),
        4 => format!("part b[i in 1..n] = lib.disc {{ m[1] = {e}; q = 1; }}"),
        5 => format!("jump j when {e} {{ v := {e}; }}"),
        6 => format!("contact c {{ gap = {e}; slip = 1; }}"),
        7 => format!("0 = {e};"),
        8 => format!("0 <= ({e}) perp ({e}) >= 0;"),
        9 => format!("x[1].y' += {e};"),
        10 => format!(
            "project x onto {{ ({e}) >= 0; for i in 1..2 {{ x <= ({e}) <= 1; }} }} metric {e};"
        ),
        11 => format!("z in argmin {e} subject to {{ ({e}) = 0; }}"),
        12 => format!("z[2] in variational [0, {e}] solves {e};"),
        _ => format!("x' = {e};"),
    });
    simple.prop_recursive(3, 12, 3, |inner| {
        (vec(inner, 0..4), expression(), 0..4).prop_map(|(body, e, kind)| {
            let body = body.join(" ");
            match kind {
                0 => format!("region r where {e} {{ {body} }}"),
                1 => format!("region r else {{\n{body}\n}};"),
                2 => format!("for i in 1..n {{ {body} }}"),
                _ => format!("hidden on s {{ {body} }}"),
            }
        })
    })
}

/// Settings of an experiment.
fn setting() -> impl Strategy<Value = String> {
    (expression(), 0..16).prop_map(|(e, kind)| match kind {
        0 => format!("with {{ a.b = {e}; }}"),
        1 => format!("horizon {e};"),
        2 => format!("horizon free in [1, {e}] = {e};"),
        3 => format!("output a, b.c every {e};"),
        4 => format!("expect ({e}) at end ~ ({e}) at 0 within ({e});"),
        5 => format!("expect mode at ({e}) is {e};"),
        6 => format!("perturb every {e} by {e} seed 3;"),
        7 => format!("subject to {{ ({e}) <= 1; }} at nodes;"),
        8 => format!("initial {{ x free in [0, {e}]; y >= ({e}); }}"),
        9 => format!("guess {{ from s; u = {e}; }}"),
        10 => format!("method m {{ a = {e}; }}"),
        11 => "on chattering slide;".to_owned(),
        12 => format!("plot {{ {e}, x; phase {e}, v; title \"t\"; width 8 cm; }}"),
        13 => format!("animate {{ disc {e}, r; trace x, {e}; speed {e}; title \"t\"; }}"),
        14 => format!("intervals {e} free;"),
        _ => format!("minimize {e};"),
    })
}

fn program() -> impl Strategy<Value = String> {
    (vec(statement(), 0..6), vec(setting(), 0..4)).prop_map(|(body, settings)| {
        format!(
            "model m {{ {} }}\nsimulate s of m {{ {} }}",
            body.join("\n"),
            settings.join("\n")
        )
    })
}

/// Words and symbols in any order.
fn soup() -> impl Strategy<Value = String> {
    let words = "model m simulate optimize region where else for in state param let switch sliding part jump when \
                 mechanics contact project onto metric argmin subject to variational solves perp if then not and or \
                 expect at within horizon free initial guess from output every use as fn const 0 1 2.5 .5 3. x y'";
    let symbols = "{ } ( ) [ ] ; , : . .. = += := == <= >= < > ~ + - * / ^ .* ' '' \" // /* */ \n @ θ \u{a0} é \
         && | ! ** -> # % ² √ ∈ ≤ × − ’ ∧ der(x) parameter";
    let pieces: Vec<&str> = words.split_whitespace().chain(symbols.split(' ')).collect();
    vec(select(pieces), 0..120).prop_map(|pieces| pieces.join(" "))
}

/// Reads a text and shows what is wrong with it; both have to come to an end.
fn survives(bytes: Vec<u8>) -> Result<(), TestCaseError> {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let file = sources.add_bytes("test.nsd", bytes);
    let ast = parse(&file, &mut diags);
    let shown = render(&diags, &sources, false, 80);
    prop_assert_eq!(diags.is_empty(), shown.is_empty());
    if !diags.has_errors() {
        let printed = ast.to_string();
        prop_assert_eq!(skeleton(&read(&printed)), skeleton(&ast), "{}", printed);
        formatted(&file.text);
    }
    for error in diags.iter() {
        // Alone, and with all others, as far as they do not overlap.
        let Some(fix) = error.fix() else { continue };
        for edit in &fix.edits {
            prop_assert!(file.contains(edit.span), "{error}: {edit:?}");
        }
        let (mended, made) = apply(&file, vec![fix]);
        prop_assert_eq!(made.len(), 1);
        prop_assert!(mended != file.text, "{} changes nothing", error);
    }
    let all: Vec<Fix> = diags.iter().filter_map(|error| error.fix()).collect();
    let lengths = |fix: &Fix| {
        let edits = fix.edits.iter();
        edits.fold((0, 0), |(more, less), edit| {
            let removed = (edit.span.end - edit.span.start) as usize;
            (more + edit.replacement.len(), less + removed)
        })
    };
    let (mended, made) = apply(&file, all);
    let (more, less) = made
        .iter()
        .map(lengths)
        .fold((0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    prop_assert_eq!(mended.len() + less, file.text.len() + more);
    for error in diags.errors() {
        for label in error.labels().into_iter().flatten() {
            prop_assert!(
                label.offset() + label.len() <= file.span().end as usize,
                "{error}"
            );
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn random_programs_print_and_read_back(text in program()) {
        let file = read(&text);
        let printed = file.to_string();
        prop_assert_eq!(skeleton(&read(&printed)), skeleton(&file), "{}", printed);
        formatted(&text);
        prop_assert_eq!(formatted(&printed).is_empty(), false);
    }

    #[test]
    fn comments_survive_everywhere(text in program(), places in vec(any::<prop::sample::Index>(), 1..8)) {
        let broken = text.replace(';', "\n;\n").replace(" + ", "\n+ ");
        let mut lines: Vec<String> = broken.lines().map(str::to_owned).collect();
        for (count, place) in places.iter().enumerate() {
            let line = place.index(lines.len());
            // A comment would be part of the string.
            if !lines[line].contains('"') {
                lines[line].push_str(&format!(" // {count}\n\n // own {count}"));
            }
        }
        let text = lines.join("\n");
        let formatted = formatted(&text);
        prop_assert_eq!(formatted.matches("//").count(), text.matches("//").count(), "{}", formatted);
    }

    #[test]
    fn random_bytes_do_no_harm(bytes in vec(any::<u8>(), 0..300)) {
        survives(bytes)?;
    }

    #[test]
    fn random_texts_do_no_harm(text in "\\PC{0,120}") {
        survives(text.into_bytes())?;
    }

    #[test]
    fn random_words_do_no_harm(text in soup(), in_model in any::<bool>()) {
        let text = if in_model { format!("model m {{ {text} }}") } else { text };
        survives(text.into_bytes())?;
    }

    #[test]
    fn damaged_models_do_no_harm(
        model in select(&MODELS[..]),
        at in any::<prop::sample::Index>(),
        cut in 0..12_usize,
        insert in select(vec!["", " ", ";", "}", "{", ")", "(", "]", "[", "\"", "'", "=", ".", "//", "\n", "if ", "x", "0", "\u{2212}"]),
        truncate in any::<bool>(),
    ) {
        let bytes = model.as_bytes();
        let start = at.index(bytes.len());
        let end = if truncate { bytes.len() } else { (start + cut).min(bytes.len()) };
        survives([&bytes[..start], insert.as_bytes(), &bytes[end..]].concat())?;
    }
}

#[test]
fn sample_models_print_and_read_back() {
    for text in MODELS {
        let file = read(text);
        assert_eq!(skeleton(&read(&file.to_string())), skeleton(&file));
        assert_eq!(formatted(text), text);
    }
}

#[test]
fn any_missing_semicolon_does_no_harm() {
    for text in MODELS {
        for (at, _) in text.match_indices(';') {
            survives([&text[..at], &text[at + 1..]].concat().into_bytes()).unwrap();
        }
    }
}
