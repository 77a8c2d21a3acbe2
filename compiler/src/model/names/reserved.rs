//! Names that the language gives and nobody may redeclare.

use crate::diagnostics::Help;

/// Built-in values.
pub(crate) const VALUES: [&str; 5] = ["pi", "inf", "true", "false", "time"];

/// Built-in functions.
pub(crate) const FUNCTIONS: [&str; 35] = [
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "atan2",
    "sinh",
    "cosh",
    "tanh",
    "exp",
    "log",
    "sqrt",
    "sign",
    "step",
    "abs",
    "min",
    "max",
    "sat",
    "deadzone",
    "dot",
    "cross",
    "norm",
    "sum",
    "len",
    "transpose",
    "inv",
    "solve",
    "eye",
    "zeros",
    "ones",
    "diag",
    "grad",
    "jacobian",
    "table",
];

/// True for a name that cannot be declared. `table` is a word of `signal` only.
pub(crate) fn is_builtin(name: &str) -> bool {
    VALUES.contains(&name) || (name != "table" && FUNCTIONS.contains(&name))
}

/// The candidate that was probably meant.
pub(crate) fn closest<'c>(name: &str, candidates: impl Iterator<Item = &'c str>) -> Option<String> {
    // Two edits, or one in a short name: further away a suggestion is a guess.
    let limit = if name.chars().count() <= 3 { 1 } else { 2 };
    let distance = |candidate: &str| {
        if candidate.to_lowercase() == name.to_lowercase() {
            return 0;
        }
        strsim::osa_distance(name, candidate)
    };
    candidates
        .map(|candidate| (distance(candidate), candidate))
        .filter(|&(distance, candidate)| distance <= limit && distance < candidate.chars().count())
        .min()
        .map(|(_, candidate)| candidate.to_owned())
}

/// `did you mean ..` for an error.
pub(crate) fn did_you_mean<'c>(
    name: &str,
    candidates: impl Iterator<Item = &'c str>,
) -> Option<Help> {
    closest(name, candidates).map(|candidate| Help::did_you_mean(&candidate))
}
