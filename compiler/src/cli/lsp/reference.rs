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
/// About methods.
const METHODS: &str = "### Methods";

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
    let told = |has: &dyn Fn(&str) -> bool| -> Vec<String> {
        let rows = rows(section).filter(|row| codes(&row[0]).any(has));
        rows.map(|row| format!("{}\n\n{}", row[0], row.get(1).map_or("", String::as_str)))
            .collect()
    };
    let mut texts = told(&|code| begins(code, word));
    if texts.is_empty() {
        let has_arguments = |part: &str| {
            part.strip_prefix(word)
                .is_some_and(|rest| rest.starts_with('('))
        };
        texts = told(&|code| code.split(' ').any(has_arguments));
    }
    (!texts.is_empty()).then(|| texts.join("\n\n"))
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

/// What is said of a method, and its options.
pub fn of_method(name: &str) -> Option<(String, Vec<String>)> {
    let mut rows = rows(METHODS).chain(rows(OPTIMIZE));
    let row = rows.find(|row| {
        let mut codes = codes(&row[0]);
        codes.any(|code| code == name || begins(code, &format!("method {name}")))
    })?;
    let options = match row.len() > 3 {
        true => codes(&row[1])
            .filter(|code| !code.contains(' '))
            .map(str::to_owned)
            .collect(),
        false => Vec::new(),
    };
    let meaning = match row.len() > 3 {
        true => &row[2],
        false => row.get(1)?,
    };
    Some((meaning.clone(), options))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::hir::reserved::function_names;
    use crate::syntax::{Place, starts};
    use crate::system::experiment::MethodKind;

    #[test]
    fn settings_functions_and_methods_are_told() {
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
        for word in MethodKind::words() {
            assert!(
                of_method(word).is_some(),
                "the reference has no row for `method {word}`"
            );
        }
        assert!(
            of_statement(SIMULATE, "tolerance").is_some_and(|said| said.contains("default `1e-8`"))
        );
        let said = of_statement(MODEL, "hysteresis");
        assert!(said.is_some_and(|said| said.contains("hysteresis(")));
        assert_eq!(calls_of("sat"), ["sat(x)", "sat(x, lo, hi)"]);
        assert_eq!(
            of_method("event").map(|(_, options)| options),
            Some(vec![
                "order".to_owned(),
                "branch".to_owned(),
                "max_events".to_owned()
            ])
        );
    }
}
