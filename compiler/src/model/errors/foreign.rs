//! What other languages call functions and values, and what to write here.
//!
//! A known foreign word is told before any spelling that is close to it: `ln` is `log`, and not `len`.

use crate::diagnostics::{
    Applicability::{self, Safe, Suggestion},
    Help,
};

/// Functions of MATLAB, Modelica, Python, Julia and C that are not built in, with what to write instead.
pub(crate) const FUNCTIONS: [(&str, &str); 85] = [
    ("ln", "write `log(x)`, the natural logarithm"),
    ("log1p", "write `log(1 + x)`"),
    ("expm1", "write `exp(x) - 1`"),
    ("pow", "write `x^n`"),
    ("power", "write `x^n`"),
    ("square", "write `x^2`"),
    ("sqr", "write `x^2`"),
    ("nthroot", "write `x^(1/n)` for a positive `x`"),
    ("fmod", MODULO),
    ("rem", MODULO),
    ("trunc", ROUNDING),
    ("fix", ROUNDING),
    ("int", ROUNDING),
    ("integer", ROUNDING),
    ("clip", "write `sat(x, low, high)`"),
    ("limit", "write `sat(x, low, high)`"),
    ("limiter", "write `sat(x, low, high)`"),
    (
        "saturate",
        "write `sat(x, low, high)`, or `sat(x)` for -1 and 1",
    ),
    (
        "saturation",
        "write `sat(x, low, high)`, or `sat(x)` for -1 and 1",
    ),
    ("deadband", "write `deadzone(x, width)`"),
    ("dead_zone", "write `deadzone(x, width)`"),
    ("heaviside", "write `step(x)`"),
    ("Heaviside", "write `step(x)`"),
    ("unitstep", "write `step(x)`"),
    ("theta", "write `step(x)` for Heaviside's function"),
    ("ramp", "write `max(0, x)`"),
    ("relu", "write `max(0, x)`"),
    ("sigmoid", "write `1/(1 + exp(-x))`"),
    ("logistic", "write `1/(1 + exp(-x))`"),
    ("sgn", "write `sign(x)`"),
    ("signum", "write `sign(x)`"),
    ("copysign", "write `abs(x)*sign(y)`"),
    ("fabs", "write `abs(x)`"),
    ("absolute", "write `abs(x)`"),
    ("fmin", "write `min(x, y)`"),
    ("minimum", "write `min(x, y)`"),
    ("fmax", "write `max(x, y)`"),
    ("maximum", "write `max(x, y)`"),
    ("arcsin", "write `asin(x)`"),
    ("arccos", "write `acos(x)`"),
    ("arctan", "write `atan(x)`"),
    ("arctan2", "write `atan2(y, x)`"),
    ("arg", "write `atan2(y, x)`"),
    ("angle", "write `atan2(y, x)`"),
    ("arcsinh", "write `asinh(x)`"),
    ("arccosh", "write `acosh(x)`"),
    ("arctanh", "write `atanh(x)`"),
    ("sec", "write `1/cos(x)`"),
    ("csc", "write `1/sin(x)`"),
    ("cot", "write `1/tan(x)`"),
    ("sind", "write `sin(x*pi/180)`"),
    ("cosd", "write `cos(x*pi/180)`"),
    ("deg2rad", "write `x*pi/180`"),
    ("rad2deg", "write `x*180/pi`"),
    ("der", DERIVATIVE),
    ("ddt", DERIVATIVE),
    ("Dt", DERIVATIVE),
    (
        "diff",
        "write `x' = ..;` for a rate, `grad(f, x)` for derivatives by states",
    ),
    ("gradient", "write `grad(f, x)`"),
    ("ifelse", CHOICE),
    ("iif", CHOICE),
    ("cond", CHOICE),
    ("piecewise", CHOICE),
    ("noEvent", "leave it out: every switch is an event"),
    (
        "smooth",
        "leave it out: kinks and jumps are found from the expression",
    ),
    (
        "pre",
        "write `jump name when guard { x := ..; }`: on its right, names have their values before the jump",
    ),
    ("edge", "write `jump name when guard { .. }`"),
    ("reinit", "write `jump name when guard { x := ..; }`"),
    ("hysteresis", MEMORY),
    ("relay", MEMORY),
    (
        "delay",
        "there are no delays: write a chain of first-order lags",
    ),
    ("interp1", DATA),
    ("interp", DATA),
    ("lookup", DATA),
    ("length", "write `len(v)`"),
    ("size", "write `len(v)`"),
    ("norm2", "write `norm(v)`"),
    ("inner", "write `dot(a, b)`"),
    ("identity", "write `eye(n)`"),
    ("prod", "write the factors with `*`"),
    ("mean", "write `sum(v)/len(v)`"),
    (
        "integral",
        "write a state: `y' = f;`; costs of an `optimize` have `integral(..)`",
    ),
    ("rand", CHANCE),
    ("randn", CHANCE),
    ("random", CHANCE),
];

const MODULO: &str = "write `mod(u, T)`, of time and numbers; put a state back with `jump wrap when x > n { x := x - n; }`";
const ROUNDING: &str = "write `floor(u)`, of time and numbers, and of states a sum of steps, `sum(step(x - i) for i in 1..n)`";
const DERIVATIVE: &str = "write the rate of a state as `x' = ..;`";
const CHOICE: &str = "write `if x > 0 then a else b`";
const MEMORY: &str = "write a statement: `switch h = hysteresis(x, on = 1, off = -1, start = 0);`";
const DATA: &str = "write a statement: `signal r = table(..);`";
const CHANCE: &str = "models have no chance in them: write `perturb` and `runs` in an experiment";

/// Values of other languages that are not built in.
pub(crate) const VALUES: [(&str, &str); 22] = [
    ("PI", "write `pi`"),
    ("Pi", "write `pi`"),
    ("π", "write `pi`"),
    ("M_PI", "write `pi`"),
    ("e", "write `exp(1)`"),
    ("E", "write `exp(1)`"),
    ("M_E", "write `exp(1)`"),
    ("Inf", "write `inf`"),
    ("Infinity", "write `inf`"),
    ("infinity", "write `inf`"),
    ("INFINITY", "write `inf`"),
    ("∞", "write `inf`"),
    ("oo", "write `inf`"),
    ("nan", "every value of a model is a number: leave it out"),
    ("NaN", "every value of a model is a number: leave it out"),
    ("True", "write `true`"),
    ("TRUE", "write `true`"),
    ("False", "write `false`"),
    ("FALSE", "write `false`"),
    ("t", "write `time`"),
    ("elif", "write `else if`"),
    ("elseif", "write `else if`"),
];

/// Functions and values that go by another name and are the same in all else; a name that may well be meant for
/// something else is not replaced unseen.
const SAME: [(&str, &str, Applicability); 50] = [
    ("ln", "log", Safe),
    ("clip", "sat", Safe),
    ("limit", "sat", Suggestion),
    ("limiter", "sat", Suggestion),
    ("saturate", "sat", Suggestion),
    ("saturation", "sat", Suggestion),
    ("deadband", "deadzone", Suggestion),
    ("dead_zone", "deadzone", Suggestion),
    ("heaviside", "step", Suggestion),
    ("Heaviside", "step", Suggestion),
    ("unitstep", "step", Safe),
    ("theta", "step", Suggestion),
    ("sgn", "sign", Safe),
    ("signum", "sign", Safe),
    ("fabs", "abs", Safe),
    ("absolute", "abs", Suggestion),
    ("fmin", "min", Safe),
    ("minimum", "min", Suggestion),
    ("fmax", "max", Safe),
    ("maximum", "max", Suggestion),
    ("arcsin", "asin", Safe),
    ("arccos", "acos", Safe),
    ("arctan", "atan", Safe),
    ("arctan2", "atan2", Safe),
    ("arcsinh", "asinh", Safe),
    ("arccosh", "acosh", Safe),
    ("arctanh", "atanh", Safe),
    ("gradient", "grad", Suggestion),
    ("length", "len", Suggestion),
    ("size", "len", Suggestion),
    ("norm2", "norm", Suggestion),
    ("inner", "dot", Suggestion),
    ("identity", "eye", Suggestion),
    ("PI", "pi", Safe),
    ("Pi", "pi", Safe),
    ("π", "pi", Safe),
    ("M_PI", "pi", Safe),
    ("e", "exp(1)", Suggestion),
    ("E", "exp(1)", Suggestion),
    ("M_E", "exp(1)", Safe),
    ("Inf", "inf", Safe),
    ("Infinity", "inf", Safe),
    ("infinity", "inf", Safe),
    ("INFINITY", "inf", Safe),
    ("oo", "inf", Suggestion),
    ("True", "true", Safe),
    ("TRUE", "true", Safe),
    ("False", "false", Safe),
    ("FALSE", "false", Safe),
    ("t", "time", Suggestion),
];

/// Names by which libraries of functions go elsewhere: what is in front of other functions may be an operand.
const LIBRARIES: [&str; 10] = [
    "np", "numpy", "jnp", "math", "Math", "cmath", "std", "ca", "casadi", "torch",
];

/// What to write instead of a function of another language.
pub(crate) fn function(name: &str) -> Option<Help> {
    if crate::model::hir::reserved::VALUES.contains(&name) {
        return Some(format!("write `{name}` without parentheses").into());
    }
    let Some((library, own)) = name.rsplit_once('.') else {
        return find(&FUNCTIONS, name);
    };
    // A function of a library, as in `np.sin`, is meant by its own name.
    let help = match crate::model::hir::reserved::is_function(own) {
        true => Help::edit(format!("write `{own}(..)`"), own, Safe),
        false => find(&FUNCTIONS, own)?,
    };
    Some(match LIBRARIES.contains(&library) {
        true => help,
        false => help.without_edit(),
    })
}

/// What to write instead of a value of another language.
pub(crate) fn value(name: &str) -> Option<Help> {
    find(&VALUES, name)
}

fn find(table: &[(&str, &str)], name: &str) -> Option<Help> {
    let (_, help) = table.iter().find(|(foreign, _)| *foreign == name)?;
    let same = SAME.iter().find(|(foreign, ..)| *foreign == name);
    Some(match same {
        Some(&(_, own, applicability)) => Help::edit(*help, own, applicability),
        None => (*help).into(),
    })
}

#[cfg(test)]
mod tests {
    use super::{FUNCTIONS, SAME, VALUES};

    /// What is replaced is what the help says.
    #[test]
    fn the_same_word_is_in_the_help() {
        for (foreign, own, _) in SAME {
            let mut all = FUNCTIONS.iter().chain(&VALUES);
            let help = all
                .find(|(known, _)| *known == foreign)
                .map(|(_, help)| *help);
            let help = help.unwrap_or_else(|| panic!("`{foreign}` has no help"));
            assert!(help.contains(&format!("`{own}")), "{foreign}: {help}");
        }
    }
}
