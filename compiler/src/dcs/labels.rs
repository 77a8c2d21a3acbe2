//! Short stable names of switches, for the variables that a lowering declares.

use std::collections::HashSet;

use crate::system::{Switch, System};

/// No label made of a formula is longer.
const LONGEST: usize = 24;

/// A label for every switch: the name of the surface or of the `switch` statement, a short formula, else `psi3`,
/// counted from 1.
pub(super) fn of(system: &System) -> Vec<String> {
    let mut taken = HashSet::new();
    let labels = system.switches.iter().enumerate().map(|(i, switch)| {
        let label = candidate(switch).unwrap_or_else(|| format!("psi{}", i + 1));
        unique(label, &mut taken)
    });
    labels.collect()
}

/// `label`, or `label#2`, `label#3`, ... when it is taken.
pub(super) fn unique(label: String, taken: &mut HashSet<String>) -> String {
    let numbered = (2..).map(|n| format!("{label}#{n}"));
    let free = std::iter::once(label.clone())
        .chain(numbered)
        .find(|label| !taken.contains(label))
        .unwrap_or(label);
    taken.insert(free.clone());
    free
}

fn candidate(switch: &Switch) -> Option<String> {
    let name = switch.name.trim();
    if is_path(name) {
        return Some(name.to_owned());
    }
    if let [reading] = switch.named.as_slice() {
        let index = reading.index.map(|i| format!("[{}]", i + 1));
        return Some(reading.name.clone() + &index.unwrap_or_default());
    }
    let fits = !name.is_empty() && name.chars().count() <= LONGEST && !name.contains('\n');
    fits.then(|| name.to_owned())
}

/// Names, fields and indices only: `a.floor.s`, `x[1]`, `A[1,2]`.
pub(super) fn is_path(name: &str) -> bool {
    let in_path = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.' | '[' | ']' | ',' | '#');
    name.starts_with(|c: char| c.is_alphabetic() || c == '_') && name.chars().all(in_path)
}

/// A label among others: a formula gets parentheses.
pub(super) fn listed(label: &str) -> String {
    if is_path(label) {
        label.to_owned()
    } else {
        format!("({label})")
    }
}

/// A label with the side of its surface: `x[1]+`.
pub(super) fn signed(label: &str, positive: bool) -> String {
    format!("{}{}", listed(label), if positive { '+' } else { '-' })
}

/// `word`, or `word_` where a state or parameter has that name already: `mu` is often a friction coefficient.
pub(super) fn prefix(system: &System, word: &str) -> String {
    let head = |name: &str| name.split(['[', '.']).next() == Some(word);
    let states = system.states.iter().map(|state| &state.name);
    let params = system.params.iter().map(|param| &param.name);
    let underscore = if states.chain(params).any(|name| head(name)) {
        "_"
    } else {
        ""
    };
    format!("{word}{underscore}")
}
