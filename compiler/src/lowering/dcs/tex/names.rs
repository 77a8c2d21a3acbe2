//! Names and numbers in math mode.

use crate::lowering::dcs::labels;

/// Greek letters with a command, as users write them in words.
const GREEK: [&str; 23] = [
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa",
    "lambda", "mu", "nu", "xi", "pi", "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi",
    "omega",
];

/// The letters of [`GREEK`].
const LETTERS: &str = "αβγδεζηθικλμνξπρστυφχψω";

/// `1.5`, `10^{-20}`, `3 \cdot 10^{20}`.
pub(crate) fn number(value: f64) -> String {
    let magnitude = value.abs();
    if !value.is_finite() {
        let sign = if value < 0.0 { "-" } else { "" };
        return if value.is_nan() {
            "\\mathrm{NaN}".to_owned()
        } else {
            format!("{sign}\\infty")
        };
    }
    if magnitude == 0.0 || (1e-4..1e16).contains(&magnitude) {
        return value.to_string();
    }
    let text = format!("{value:e}");
    match text.split_once('e') {
        Some(("1", exponent)) => format!("10^{{{exponent}}}"),
        Some((mantissa, exponent)) => format!("{mantissa} \\cdot 10^{{{exponent}}}"),
        None => text,
    }
}

/// `theta[x[1]-]` is `\theta_{x_{1}-}`, `v_max` is `v_{\mathrm{max}}`.
pub(crate) fn name(text: &str) -> String {
    let (symbol, subscript) = name_parts(text);
    symbol + &subscript
}

/// The symbol and its subscript, which may be empty.
pub(crate) fn name_parts(text: &str) -> (String, String) {
    let (head, index) = match opening(text) {
        Some(at) => (&text[..at], Some(&text[at + 1..text.len() - 1])),
        None => (text, None),
    };
    let (symbol, below) = match head.split_once('_') {
        Some((symbol, below)) if !symbol.is_empty() && !below.is_empty() => (symbol, Some(below)),
        _ => (head, None),
    };
    let below = below.map(word).into_iter();
    let index = index.into_iter().flat_map(split_top).map(index_part);
    let subscripts: Vec<String> = below.chain(index).collect();
    let subscript = match subscripts.as_slice() {
        [] => String::new(),
        _ => format!("_{{{}}}", subscripts.join(", ")),
    };
    (word(symbol), subscript)
}

/// Where the bracket opens that closes at the end.
fn opening(text: &str) -> Option<usize> {
    let mut depth = 0;
    let mut brackets = text.char_indices().rev().filter(|(_, c)| "[]".contains(*c));
    text.ends_with(']').then_some(())?;
    brackets
        .find(|&(_, c)| {
            depth += if c == ']' { 1 } else { -1 };
            depth == 0
        })
        .map(|(at, _)| at)
}

/// A number, a name with or without a sign, else text.
fn index_part(part: &str) -> String {
    let part = part.trim();
    let (body, sign) = match part.strip_suffix(['+', '-']) {
        Some(body) => (body, &part[body.len()..]),
        None => (part, ""),
    };
    if !body.is_empty() && body.chars().all(|c| c.is_ascii_digit()) {
        return part.to_owned();
    }
    // An index of an index is as deep as names go.
    if labels::is_path(body) && body.matches('[').count() <= 1 && !body.contains('#') {
        return name(body) + sign;
    }
    format!("\\text{{{}}}", escape(part))
}

/// Parts between commas outside brackets and parentheses.
fn split_top(text: &str) -> Vec<&str> {
    let (mut parts, mut depth, mut start) = (Vec::new(), 0i32, 0);
    for (at, c) in text.char_indices() {
        match c {
            '[' | '(' => depth += 1,
            ']' | ')' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&text[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&text[start..]);
    parts
}

fn word(text: &str) -> String {
    let mut chars = text.chars();
    match (chars.next(), chars.next()) {
        (Some(c), None) if c.is_ascii_alphanumeric() => return text.to_owned(),
        (Some(c), None) => {
            if let Some(i) = LETTERS.chars().position(|letter| letter == c) {
                return format!("\\{}", GREEK[i]);
            }
        }
        _ => {}
    }
    if GREEK.contains(&text) {
        return format!("\\{text}");
    }
    if text.chars().all(|c| c.is_ascii_digit()) {
        return text.to_owned();
    }
    format!("\\mathrm{{{}}}", escape(text))
}

fn escape(text: &str) -> String {
    let mut escaped = String::new();
    for c in text.chars() {
        match c {
            '_' | '&' | '%' | '#' | '{' | '}' | '$' => {
                escaped.push('\\');
                escaped.push(c);
            }
            '^' => escaped.push_str("\\textasciicircum{}"),
            '~' => escaped.push_str("\\textasciitilde{}"),
            '\\' => escaped.push_str("\\textbackslash{}"),
            _ => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_symbols_with_subscripts() {
        let names = [
            ("x", "x"),
            ("x[1]", "x_{1}"),
            ("A[1,2]", "A_{1, 2}"),
            ("omega", "\\omega"),
            ("\u{3b8}", "\\theta"),
            ("speed", "\\mathrm{speed}"),
            ("v_max[2]", "v_{\\mathrm{max}, 2}"),
            ("a.floor.s", "\\mathrm{a.floor.s}"),
            ("theta[x[1]+,x[2]-]", "\\theta_{x_{1}+, x_{2}-}"),
            ("theta[(50% of_it)+]", "\\theta_{\\text{(50\\% of\\_it)+}}"),
        ];
        for (text, expected) in names {
            assert_eq!(name(text), expected);
        }
    }
}
