//! Short stable names of switches, for the variables that a lowering declares.

use std::collections::HashSet;

use crate::expr::variables_of;
use crate::system::{Switch, System};

/// No label made of a formula is longer.
const LONGEST: usize = 24;

/// A label for every switch: the name of the `switch` statement, the state that ψ is, the name of the surface, a
/// short formula, else `psi3`, counted from 1.
pub(crate) fn of(system: &System) -> Vec<String> {
    let mut taken = HashSet::new();
    let labels = system.switches.iter().enumerate().map(|(i, switch)| {
        let label = candidate(system, switch).unwrap_or_else(|| format!("psi{}", i + 1));
        unique(label, &mut taken)
    });
    labels.collect()
}

/// The label of a disc: that of its contact, or else of its first switch.
pub(crate) fn of_disc<'l>(system: &System, labels: &'l [String], first: usize) -> &'l str {
    let contact = system.switches[first].slip_of;
    &labels[contact.unwrap_or(first)]
}

/// `label`, or `label#2`, `label#3`, ... when it is taken.
pub(crate) fn unique(label: String, taken: &mut HashSet<String>) -> String {
    let numbered = (2..).map(|n| format!("{label}#{n}"));
    let free = std::iter::once(label.clone())
        .chain(numbered)
        .find(|label| !taken.contains(label))
        .unwrap_or(label);
    taken.insert(free.clone());
    free
}

fn candidate(system: &System, switch: &Switch) -> Option<String> {
    let name = switch.name.trim();
    if switch.named.is_empty() && switch.psi.as_variable().is_some() {
        return Some(switch.psi.to_string());
    }
    if is_path(name) {
        return Some(name.to_owned());
    }
    if let [reading] = switch.named.as_slice() {
        let index = reading.index.map(|i| format!("[{}]", i + 1));
        return Some(reading.name.clone() + &index.unwrap_or_default());
    }
    let fits = !name.is_empty() && name.chars().count() <= LONGEST && !name.contains('\n');
    (fits && !shows_alpha(system, switch)).then(|| name.to_owned())
}

/// Whether the name is no text of the user but a printed ψ, which mentions the α of other switches.
fn shows_alpha(system: &System, switch: &Switch) -> bool {
    let is_alpha = |var| {
        system
            .switches
            .iter()
            .any(|other| other.alpha.as_variable() == Some(var))
    };
    let nested = variables_of(&[switch.psi]).into_iter().any(is_alpha);
    let in_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut words = switch.name.split(|c| !in_word(c));
    nested && words.any(|word| word == "alpha")
}

/// Names, fields and indices only: `a.floor.s`, `x[1]`, `A[1,2]`.
pub(crate) fn is_path(name: &str) -> bool {
    let in_path = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.' | '[' | ']' | ',' | '#');
    name.starts_with(|c: char| c.is_alphabetic() || c == '_') && name.chars().all(in_path)
}

/// A label among others: a formula gets parentheses.
pub(crate) fn listed(label: &str) -> String {
    if is_path(label) {
        label.to_owned()
    } else {
        format!("({label})")
    }
}

/// A label with the side of its surface: `x[1]+`.
pub(crate) fn signed(label: &str, positive: bool) -> String {
    format!("{}{}", listed(label), if positive { '+' } else { '-' })
}

/// `word`, or `word_` where a state or parameter has that name already: `mu` is often a friction coefficient.
pub(crate) fn prefix(system: &System, word: &str) -> String {
    let head = |name: &str| name.split(['[', '.']).next() == Some(word);
    let states = system.states.iter().map(|state| &state.name);
    let params = system.exogenous.params.iter().map(|param| &param.name);
    let underscore = if states.chain(params).any(|name| head(name)) {
        "_"
    } else {
        ""
    };
    format!("{word}{underscore}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::Exprs;
    use crate::lowering::dcs::fixtures::Builder;

    #[test]
    fn labels_are_short_and_distinct() {
        let exprs = Exprs::new();
        let mut b = Builder::new(&exprs, &["mu", "x"]);
        let (mu, x) = (b.states[0], b.states[1]);
        let a = b.kink("anything", x);
        b.switch("s", x - mu);
        b.switch("s", x + mu);
        b.switch("x*alpha - 1", x * a - 1.0);
        b.switch("a formula that is too long to read", x * mu);
        b.switch("mu - 1", mu - 1.0);
        let system = b.finish(&[mu, x], &[]).system;
        assert_eq!(of(&system), ["x", "s", "s#2", "psi4", "psi5", "mu - 1"]);
        assert_eq!(prefix(&system, "mu"), "mu_");
        assert_eq!(prefix(&system, "theta"), "theta");
    }
}
