//! A DCS as LaTeX: one `align*` environment of amsmath.

use std::collections::HashMap;

use crate::expr::{BinaryFunction, Expr, Function, Node, rewrite};

use super::{Dcs, labels};

/// Greek letters with a command, as users write them in words.
const GREEK: [&str; 23] = [
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa",
    "lambda", "mu", "nu", "xi", "pi", "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi",
    "omega",
];

/// The letters of [`GREEK`].
const LETTERS: &str = "αβγδεζηθικλμνξπρστυφχψω";

/// The equations of a DCS, ready to be included where amsmath is loaded.
pub fn tex(dcs: &Dcs) -> String {
    let mut lines = Vec::new();
    for (state, &rate) in dcs.states.iter().zip(&dcs.rates) {
        lines.push(format!("{} &= {}", derivative(state.var), formula(rate)));
    }
    for &row in &dcs.equations {
        lines.push(format!("0 &= {}", formula(row)));
    }
    for pair in &dcs.pairs {
        lines.push(format!(
            "0 &\\le {} \\perp {} \\ge 0",
            formula(pair.left),
            formula(pair.right)
        ));
    }
    let mut text = String::new();
    if let Some(reason) = &dcs.reason {
        // A comment ends with its line.
        text = format!(
            "% {}: {}\n",
            dcs.formulation,
            reason.replace(['\n', '\r'], " ")
        );
    }
    text + "\\begin{align*}\n" + &lines.join(" \\\\\n") + "\n\\end{align*}\n"
}

/// How tightly a formula holds together.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Sum,
    Product,
    Power,
    Atom,
}

/// A formula; a fraction binds like an atom except under a power.
#[derive(Clone)]
struct Piece {
    text: String,
    binding: Binding,
}

impl Piece {
    fn within(&self, outer: Binding) -> String {
        if self.binding < outer {
            format!("\\left({}\\right)", self.text)
        } else {
            self.text.clone()
        }
    }
}

/// An expression in math mode.
pub fn formula(expr: Expr) -> String {
    // Bottom-up, so that deep expressions do not recurse.
    let mut pieces: HashMap<Expr, Piece> = HashMap::new();
    rewrite(expr, &mut |e| {
        let piece = piece(e, &pieces);
        pieces.insert(e, piece);
        e
    });
    pieces
        .remove(&expr)
        .map(|piece| piece.text)
        .unwrap_or_default()
}

fn piece(expr: Expr, pieces: &HashMap<Expr, Piece>) -> Piece {
    match expr.printed_node() {
        Node::Constant(value) => Piece {
            text: number(value),
            binding: if value < 0.0 {
                Binding::Sum
            } else {
                Binding::Atom
            },
        },
        Node::Variable(var) => Piece {
            text: name(&expr.exprs().name(var)),
            binding: Binding::Atom,
        },
        Node::Sum { constant, terms } => sum(constant, &terms, pieces),
        Node::Product(factors) => product(1.0, &factors, pieces),
        Node::Unary(Function::Sqrt, a) => Piece {
            text: format!("\\sqrt{{{}}}", pieces[&a].text),
            binding: Binding::Atom,
        },
        Node::Unary(Function::Abs, a) => Piece {
            text: format!("\\left|{}\\right|", pieces[&a].text),
            binding: Binding::Atom,
        },
        Node::Unary(function, a) => call(operator(function.name()), &[&pieces[&a]]),
        Node::Binary(BinaryFunction::Pow, a, b) => Piece {
            text: format!(
                "{}^{{{}}}",
                pieces[&a].within(Binding::Atom),
                pieces[&b].text
            ),
            binding: Binding::Power,
        },
        Node::Binary(function, a, b) => {
            call(operator(function.name()), &[&pieces[&a], &pieces[&b]])
        }
    }
}

fn call(operator: String, arguments: &[&Piece]) -> Piece {
    let arguments: Vec<&str> = arguments.iter().map(|piece| piece.text.as_str()).collect();
    Piece {
        text: format!("{operator}\\left({}\\right)", arguments.join(", ")),
        binding: Binding::Atom,
    }
}

fn operator(name: &str) -> String {
    match name {
        "asin" => "\\arcsin".to_owned(),
        "acos" => "\\arccos".to_owned(),
        "atan" => "\\arctan".to_owned(),
        "sin" | "cos" | "tan" | "sinh" | "cosh" | "tanh" | "exp" | "log" | "min" | "max" => {
            format!("\\{name}")
        }
        _ => format!("\\operatorname{{{name}}}"),
    }
}

fn sum(constant: f64, terms: &[(f64, Expr)], pieces: &HashMap<Expr, Piece>) -> Piece {
    let mut text = String::new();
    let mut append = |negative: bool, term: &str| {
        let sign = match (negative, text.is_empty()) {
            (true, true) => "-",
            (true, false) => " - ",
            (false, true) => "",
            (false, false) => " + ",
        };
        text.push_str(sign);
        text.push_str(term);
    };
    let number_first = constant > 0.0 && terms.first().is_some_and(|first| first.0 < 0.0);
    if number_first {
        append(false, &number(constant));
    }
    for &(coefficient, term) in terms {
        let term = scaled(coefficient.abs(), term, pieces);
        append(coefficient < 0.0, &term.within(Binding::Product));
    }
    if constant != 0.0 && !number_first {
        append(constant < 0.0, &number(constant.abs()));
    }
    let lone = matches!(terms, [(coefficient, _)] if constant == 0.0 && *coefficient > 0.0);
    Piece {
        text,
        binding: if lone { Binding::Product } else { Binding::Sum },
    }
}

fn scaled(coefficient: f64, term: Expr, pieces: &HashMap<Expr, Piece>) -> Piece {
    match term.printed_node() {
        _ if coefficient == 1.0 => pieces[&term].clone(),
        Node::Product(factors) => product(coefficient, &factors, pieces),
        _ => product(coefficient, &[(term, 1)], pieces),
    }
}

/// A fraction where there is something below.
fn product(coefficient: f64, factors: &[(Expr, i32)], pieces: &HashMap<Expr, Piece>) -> Piece {
    let side = |above: bool| -> Vec<String> {
        let factors = factors.iter().filter(|(_, power)| (*power > 0) == above);
        let powers = factors.map(|(factor, power)| match power.unsigned_abs() {
            1 => pieces[factor].within(Binding::Power),
            power => format!("{}^{{{power}}}", pieces[factor].within(Binding::Atom)),
        });
        powers.collect()
    };
    let (mut above, below) = (side(true), side(false));
    if coefficient != 1.0 || above.is_empty() {
        above.insert(0, number(coefficient));
    }
    let above = above.join(" \\, ");
    match below.as_slice() {
        [] => Piece {
            text: above,
            binding: Binding::Product,
        },
        _ => Piece {
            text: format!("\\frac{{{above}}}{{{}}}", below.join(" \\, ")),
            binding: Binding::Product,
        },
    }
}

/// `1.5`, `10^{-20}`, `3 \cdot 10^{20}`.
fn number(value: f64) -> String {
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
fn name(text: &str) -> String {
    let (symbol, subscript) = name_parts(text);
    symbol + &subscript
}

/// The symbol and its subscript, which may be empty.
fn name_parts(text: &str) -> (String, String) {
    let (head, index) = match text.split_once('[') {
        Some((head, rest)) => (head, rest.strip_suffix(']')),
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

/// The derivative of a state by time.
fn derivative(state: Expr) -> String {
    let name = state.as_variable().map(|var| state.exprs().name(var));
    let (symbol, subscript) = name_parts(&name.unwrap_or_default());
    format!("\\dot{{{symbol}}}{subscript}")
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

    #[test]
    fn formulas_keep_their_parentheses() {
        let exprs = crate::expr::Exprs::new();
        let [x, k, m] = ["x", "k", "m"].map(|name| exprs.variable(name));
        let cases = [
            (k / m * x, "\\frac{x \\, k}{m}"),
            ((x + 1.0) * k, "\\left(x + 1\\right) \\, k"),
            ((x + 1.0).powi(2), "\\left(x + 1\\right)^{2}"),
            (x.powi(2).sqrt(), "\\sqrt{x^{2}}"),
            (-(x * k), "-x \\, k"),
            (1e-20 * x, "10^{-20} \\, x"),
            (
                (2.0 * x).sin() - k.asin(),
                "\\sin\\left(2 \\, x\\right) - \\arcsin\\left(k\\right)",
            ),
            (x.powf(k), "x^{k}"),
            ((x / k).powf(m), "\\left(\\frac{x}{k}\\right)^{m}"),
        ];
        for (expr, expected) in cases {
            assert_eq!(formula(expr), expected);
        }
    }
}
