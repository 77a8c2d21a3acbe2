//! What the language reference says of words: the rows of its tables.

use std::collections::HashMap;
use std::sync::LazyLock;

use nsd_grammar::REFERENCE;

/// The sections whose tables are about statements of models.
pub const MODEL: &str = "## Statements of a model";
/// About settings of simulations.
pub const SIMULATE: &str = "## Experiments";
/// About settings of optimizations.
pub const OPTIMIZE: &str = "### Optimal control";
/// About settings of fits.
pub const FIT: &str = "### Fits";
/// About settings of closed loops.
pub const MPC: &str = "### Closed loops";
/// About settings of all kinds of experiments.
pub const EXPERIMENTS: [&str; 4] = [SIMULATE, OPTIMIZE, FIT, MPC];
/// About functions.
const FUNCTIONS: &str = "## Expressions";
/// About what is said of runs.
pub const EXPECTATIONS: &str = "## Expectations";
/// About methods.
const METHODS: &str = "### Methods";
/// About options of methods, and their words.
const OPTIONS: &str = "### Options of methods";
/// About lowerings.
const LOWERINGS: &str = "### Lowerings";

/// A row of a table, as cells.
type Row = Vec<String>;

/// The rows of all tables, by the heading in front of them.
static ROWS: LazyLock<HashMap<&str, Vec<Row>>> = LazyLock::new(|| {
    let mut found: HashMap<&str, Vec<Row>> = HashMap::new();
    let mut section = "";
    for line in REFERENCE.lines() {
        if line.starts_with('#') {
            section = line;
        } else if line.starts_with('|') && !line.starts_with("| ---") {
            // A bar in a cell stands behind a backslash.
            let line = line.trim_matches('|').replace("\\|", "\u{0}");
            let cells = line.split('|');
            let cells = cells.map(|cell| cell.trim().replace('\u{0}', "|"));
            found.entry(section).or_default().push(cells.collect());
        }
    }
    found
});

/// The rows of the tables of a section, up to the next heading.
fn rows(section: &str) -> std::slice::Iter<'static, Row> {
    ROWS.get(section).map_or(&[][..], Vec::as_slice).iter()
}

/// The pieces of code in a cell.
fn codes(cell: &str) -> impl Iterator<Item = &str> {
    cell.split('`').skip(1).step_by(2)
}

fn begins(code: &str, word: &str) -> bool {
    code.strip_prefix(word)
        .is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_'))
}

/// What a section says of a statement that begins with a word, or else where it has arguments: each form with its meaning.
pub fn of_statement(section: &str, word: &str) -> Option<String> {
    let has_arguments = |row: &&Row| {
        let mut parts = codes(&row[0]).flat_map(|code| code.split(' '));
        parts.any(|part| {
            part.strip_prefix(word)
                .is_some_and(|rest| rest.starts_with('('))
        })
    };
    told(named(section, word), &[]).or_else(|| told(rows(section).filter(has_arguments), &[]))
}

/// What is said of a function of the language: its forms and its meaning, or those of one that is told beside it.
pub fn of_function(name: &str) -> Option<String> {
    let has = |cell: &String| {
        let mut words = codes(cell).flat_map(|code| code.split(' '));
        words.any(|word| begins(word, name))
    };
    let among = |at: usize| rows(FUNCTIONS).find(|row| row.get(at).is_some_and(&has));
    let row = among(0).or_else(|| among(1))?;
    Some(format!("{}\n\n{}", row[0], row.get(1)?))
}

/// How a function of the language is called, where its arguments are told: `sat(x)`, `sat(x, lo, hi)`.
pub fn calls_of(name: &str) -> Vec<String> {
    // Of several in one piece of code nothing is told.
    let is_call =
        |code: &&str| begins(code, name) && code.ends_with(')') && code.matches('(').count() == 1;
    let codes = rows(FUNCTIONS).flatten().flat_map(|cell| codes(cell));
    codes.filter(is_call).map(str::to_owned).collect()
}

/// What a section says of a word that stands inside of a statement: the forms of the statement that have it.
pub fn of_part(section: &str, statement: &str, word: &str) -> Option<String> {
    let has = |row: &&Row| {
        let is_its = codes(&row[0]).any(|code| begins(code, statement));
        let mut words = row.iter().flat_map(|cell| codes(cell));
        is_its && words.any(|code| parts(code).any(|part| part == word))
    };
    told(rows(section).filter(has), &[])
}

/// The words of a piece of code.
fn parts(code: &str) -> impl Iterator<Item = &str> {
    code.split(|c: char| !c.is_alphanumeric() && c != '_')
}

/// What is said of a method.
pub fn of_method(name: &str) -> Option<String> {
    told(named(METHODS, name).take(1), &[])
}

/// What is said of a lowering.
pub fn of_lowering(name: &str) -> Option<String> {
    told(named(LOWERINGS, name), &[])
}

/// What is said of an option of a method, or of a word that an option takes, with what is said of the option.
pub fn of_option(holder: &str, word: &str) -> Option<String> {
    told(
        named(OPTIONS, word).filter(|row| codes(&row[1]).any(|code| code == holder)),
        &[1],
    )
}

/// The rows whose first cell begins with a word.
fn named(section: &str, word: &str) -> impl Iterator<Item = &'static Row> {
    rows(section).filter(move |row| codes(&row[0]).any(|code| begins(code, word)))
}

/// Rows in words, without some of their columns.
fn told<'r>(rows: impl Iterator<Item = &'r Row>, without: &[usize]) -> Option<String> {
    let text = |row: &Row| {
        let cells = row.iter().enumerate();
        let cells = cells.filter(|(at, cell)| !without.contains(at) && !cell.is_empty());
        let cells: Vec<&str> = cells.map(|(_, cell)| cell.as_str()).collect();
        cells.join("\n\n")
    };
    let texts: Vec<String> = rows.map(text).collect();
    (!texts.is_empty()).then(|| texts.join("\n\n"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::hir::reserved::function_names;
    use crate::syntax::{Place, starts};
    use crate::system::experiment::{Lowering, MethodKind, OPTIMIZER, options_of, words_of};

    #[test]
    fn settings_and_functions_are_told() {
        for (word, _) in starts(Place::Experiment) {
            let mut sections = EXPERIMENTS.into_iter();
            let said = sections.find_map(|section| of_statement(section, word));
            assert!(
                said.is_some(),
                "the reference has no row for the setting `{word}`"
            );
        }
        for name in function_names().filter(|name| *name != "table") {
            assert!(
                of_function(name).is_some(),
                "the reference has no row for `{name}`"
            );
        }
        assert!(
            of_statement(SIMULATE, "tolerance").is_some_and(|said| said.contains("default `1e-8`"))
        );
        let said = of_statement(MODEL, "hysteresis");
        assert!(said.is_some_and(|said| said.contains("hysteresis(")));
        assert_eq!(calls_of("sat"), ["sat(x)", "sat(x, lo, hi)"]);
    }

    #[test]
    fn methods_options_words_and_lowerings_are_told() {
        for lowering in Lowering::ALL.map(Lowering::word) {
            let said = of_lowering(lowering).unwrap_or_default();
            assert!(said.contains("default"), "`lower {lowering}`: {said}");
        }
        for method in MethodKind::words().into_iter().chain([OPTIMIZER]) {
            assert!(of_method(method).is_some(), "`method {method}`");
            for option in options_of(method) {
                let said = of_option(method, option).unwrap_or_default();
                assert!(said.contains("default"), "`{option}` of `{method}`: {said}");
                for word in words_of(option) {
                    assert!(of_option(option, &word).is_some(), "`{option} = {word}`");
                }
            }
        }
    }
}
