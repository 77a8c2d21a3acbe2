//! Words of other languages: the help says what to write instead, and no spelling that is close beats it.

use std::path::Path;

use crate::terminal::{folder, nsdc_with_input};

/// Expressions with what their help names.
const EXPRESSIONS: [(&str, &str); 57] = [
    ("ln(x)", "write `log(x)`"),
    ("log1p(x)", "write `log(1 + x)`"),
    ("np.log10(x)", "write `log10(..)`"),
    ("pow(x, 2)", "write `x^n`"),
    ("x**2", "write `^`"),
    ("fmod(x, 2)", "write `mod(u, T)`"),
    ("trunc(x)", "write `floor(u)`"),
    ("clip(x, 0, 1)", "write `sat(x, low, high)`"),
    ("saturate(x)", "write `sat(x, low, high)`"),
    ("heaviside(x)", "write `step(x)`"),
    ("sgn(x)", "write `sign(x)`"),
    ("signum(x)", "write `sign(x)`"),
    ("fabs(x)", "write `abs(x)`"),
    ("arctan2(x, 1)", "write `atan2(y, x)`"),
    ("arcsin(x)", "write `asin(x)`"),
    ("arccos(x)", "write `acos(x)`"),
    ("arctan(x)", "write `atan(x)`"),
    ("arcsinh(x)", "write `asinh(x)`"),
    ("arctanh(x)", "write `atanh(x)`"),
    ("fmax(x, 1)", "write `max(x, y)`"),
    ("minimum(x, 1)", "write `min(x, y)`"),
    ("relu(x)", "write `max(0, x)`"),
    ("sigmoid(x)", "write `1/(1 + exp(-x))`"),
    ("cot(x)", "write `1/tan(x)`"),
    ("der(x)", "write the rate of a state as `x' = ..;`"),
    ("ddt(x)", "write the rate of a state as `x' = ..;`"),
    ("ifelse(x > 0, 1, 2)", "write `if x > 0 then a else b`"),
    ("piecewise(x)", "write `if x > 0 then a else b`"),
    ("noEvent(x)", "leave it out"),
    ("pre(x)", "write `jump name when guard"),
    ("hysteresis(x)", "write a statement: `switch h = hysteresis"),
    ("delay(x, 1)", "there are no delays"),
    ("lookup(x)", "write a statement: `signal r = table(..);`"),
    ("rand()", "write `perturb` and `runs`"),
    ("length([1, 2])", "write `len(v)`"),
    ("size([1, 2])", "write `len(v)`"),
    ("norm2([1, 2])", "write `norm(v)`"),
    ("np.sin(x)", "write `sin(..)`"),
    ("np.clip(x, 0, 1)", "write `sat(x, low, high)`"),
    ("pi()", "write `pi` without parentheses"),
    ("PI", "write `pi`"),
    ("π*x", "write `pi`"),
    ("e^x", "write `exp(1)`"),
    ("Inf", "write `inf`"),
    ("Infinity", "write `inf`"),
    ("nan", "every value of a model is a number"),
    ("True", "write `true`"),
    ("t", "write `time`"),
    ("x²", "write a power as `^2`"),
    ("x > 0 ? 1 : 2", "write `if x > 0 then a else b`"),
    ("2x", "write `2*x`"),
    ("if x > 0 && x < 1 then 1 else 2", "write `and`"),
    ("if x > 0 || x < 1 then 1 else 2", "write `or`"),
    ("if !(x > 0) then 1 else 2", "write `not`"),
    ("if x == 1 then 1 else 2", "write `=` in a declaration"),
    ("if x <> 1 then 1 else 2", "write `<` or `>`"),
    ("if x ~= 1 then 1 else 2", "write `<` or `>`"),
];

/// Units with what their help names.
const UNITS: [(&str, &str); 14] = [
    ("Nm", "write `N*m`"),
    ("Nms", "write `N*m*s`"),
    ("Ws", "write `W*s`"),
    ("Vs", "write `V*s`"),
    ("As", "write `A*s`"),
    ("Pas", "write `Pa*s`"),
    ("rpm", "write `rad/s`"),
    ("deg", "write `rad`"),
    ("kWh", "write `J`"),
    ("mA", "write `A`"),
    ("kN", "write `N`"),
    ("ohm", "write `Ohm`"),
    ("degC", "write `K`"),
    ("ms", "write `s`"),
];

fn is_told(folder: &Path, text: &str, what: &str, help: &str) {
    let ran = nsdc_with_input(folder, &["check", "-"], text);
    assert_eq!(ran.status, 1, "{what}: {}", ran.err);
    // Lines are broken at the width of the terminal.
    let told: Vec<&str> = ran.err.split_whitespace().collect();
    let told = told.join(" ");
    assert!(told.contains(help), "{what}: {}", ran.err);
    assert!(!told.contains("did you mean"), "{what}: {}", ran.err);
}

#[test]
fn foreign_expressions_are_told() {
    let folder = folder("words");
    for (value, help) in EXPRESSIONS {
        let text = format!("model m {{ state x = 1; x' = {value}; }}");
        is_told(&folder, &text, value, help);
    }
}

#[test]
fn foreign_words_in_functions_are_told() {
    let folder = folder("words_in_functions");
    for (value, help) in [("ln(u)", "write `log(x)`"), ("PI*u", "write `pi`")] {
        let text = format!("fn f(u) = {value};\nmodel m {{ state x = 1; x' = f(x); }}");
        is_told(&folder, &text, value, help);
    }
}

#[test]
fn foreign_units_are_told() {
    let folder = folder("words_of_units");
    for (unit, help) in UNITS {
        let text = format!("model m {{ state x: {unit} = 1; x' = -x; }}");
        is_told(&folder, &text, unit, help);
    }
}
