//! Names that the language gives and nobody may redeclare.

use crate::diagnostics::Help;
use crate::expr::Function;
use crate::model::ModelError;
use crate::source::Span;

/// Built-in values.
pub const VALUES: [&str; 5] = ["pi", "inf", "true", "false", "time"];

/// Built-in functions beside the elementary ones, with their least and greatest number of arguments.
const FUNCTIONS: [(&str, usize, usize); 33] = [
    ("cbrt", 1, 1),
    ("log2", 1, 1),
    ("log10", 1, 1),
    ("exp2", 1, 1),
    ("hypot", 2, 2),
    ("atan2", 2, 2),
    ("min", 1, usize::MAX),
    ("max", 1, usize::MAX),
    ("ceil", 1, 1),
    ("round", 1, 1),
    ("frac", 1, 1),
    ("mod", 2, 2),
    ("pulse", 3, 3),
    ("sawtooth", 2, 2),
    ("triangle", 2, 2),
    ("sat", 1, 3),
    ("clamp", 3, 3),
    ("deadzone", 1, 2),
    ("dot", 2, 2),
    ("cross", 2, 2),
    ("norm", 1, 1),
    ("sum", 1, 1),
    ("len", 1, 1),
    ("transpose", 1, 1),
    ("inv", 1, 1),
    ("solve", 2, 2),
    ("eye", 1, 1),
    ("zeros", 1, 2),
    ("ones", 1, 2),
    ("diag", 1, 1),
    ("grad", 2, 2),
    ("jacobian", 2, 2),
    ("table", 0, usize::MAX),
];

/// The names of all built-in functions.
pub fn function_names<'n>() -> impl Iterator<Item = &'n str> {
    let elementary = Function::named().map(|function| function.name());
    elementary.chain(FUNCTIONS.iter().map(|&(name, ..)| name))
}

/// True for the name of a built-in function.
pub(crate) fn is_function(name: &str) -> bool {
    function_names().any(|known| known == name)
}

/// The least and the greatest number of arguments of a built-in function.
pub(crate) fn arity(name: &str) -> (usize, usize) {
    let mut functions = FUNCTIONS.iter();
    let known = functions.find(|(known, ..)| *known == name);
    known.map_or((1, 1), |&(_, least, most)| (least, most))
}

/// Functions whose names may be declared, functions too, and then are what they are declared to be: `table` is a word
/// of `signal` only, and the others are words of models, too.
const FREE: [&str; 19] = [
    "table", "floor", "ceil", "round", "frac", "mod", "pulse", "sawtooth", "triangle", "clamp",
    "cbrt", "log2", "log10", "exp2", "hypot", "asinh", "erf", "acosh", "atanh",
];

/// True for a function of the language whose name others may take with a warning, and functions not at all.
pub(crate) fn is_kept(name: &str) -> bool {
    is_function(name) && !FREE.contains(&name)
}

/// What is wrong with a declaration that is no function under a built-in name: all where that is a value, for a
/// function it is a warning.
pub(crate) fn taken(name: &str, span: Span) -> Option<ModelError> {
    let text = || name.to_owned();
    match VALUES.contains(&name) {
        true => Some(ModelError::BuiltIn { name: text(), span }),
        false => is_kept(name).then(|| ModelError::ShadowsFunction { name: text(), span }),
    }
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

/// Names that are listed before the rest is counted.
const MAX_NAMES: usize = 12;

/// `did you mean ..` for an error in a place where these names are all, and which they are.
pub(crate) fn one_of<'c>(
    name: &str,
    place: &str,
    candidates: impl Iterator<Item = &'c str>,
) -> Option<Help> {
    let mut names: Vec<&str> = candidates.collect();
    names.sort_unstable();
    let shown: Vec<String> = (names.iter().take(MAX_NAMES))
        .map(|name| format!("`{name}`"))
        .collect();
    let others = match names.len().saturating_sub(MAX_NAMES) {
        0 => String::new(),
        1 => " and 1 other".to_owned(),
        n => format!(" and {n} others"),
    };
    let list = format!("{place} {}{others}", shown.join(", "));
    match did_you_mean(name, names.iter().copied()) {
        Some(help) => Some(help.followed_by(&list)),
        None => (!names.is_empty()).then(|| list.into()),
    }
}

/// `did you mean ..` for an error.
pub(crate) fn did_you_mean<'c>(
    name: &str,
    candidates: impl Iterator<Item = &'c str>,
) -> Option<Help> {
    closest(name, candidates).map(|candidate| Help::did_you_mean(&candidate))
}
