//! Rates that are rounding: identities, whose terms cancel within an expression.
//!
//! a starts at zero and stays there, with a rate that is zero for every b and c. Others follow it: d' = -d + a, the chain
//! e' = a, f' = e, and a switch at a + b.

use super::{Case, Extent, Family};

const HORIZON: f64 = 2.0;

/// What is zero for 0 < b, c < 1.5.
const IDENTITIES: [&str; 24] = [
    "sin(b)^2 + cos(b)^2 - 1",
    "cosh(b)^2 - sinh(b)^2 - 1",
    "(b + c)^2 - b^2 - 2*b*c - c^2",
    "log(exp(b)) - b",
    "tan(b)*cos(b) - sin(b)",
    "exp(b)*exp(-b) - 1",
    "sqrt(b*b) - b",
    "sin(2*b) - 2*sin(b)*cos(b)",
    "(b - c)*(b + c) - b^2 + c^2",
    "atan(b) + atan(1/b) - pi/2",
    "exp(b + c) - exp(b)*exp(c)",
    "cos(b + c) - cos(b)*cos(c) + sin(b)*sin(c)",
    "log(b*c) - log(b) - log(c)",
    "1/(1 + b) + b/(1 + b) - 1",
    "tanh(b)*cosh(b) - sinh(b)",
    "b^3 - c^3 - (b - c)*(b^2 + b*c + c^2)",
    "asin(b/2) + acos(b/2) - pi/2",
    "exp(b*log(2)) - 2^b",
    "sqrt(b^2 + c^2)^2 - b^2 - c^2",
    "atan2(sin(b), cos(b)) - b",
    "2*atan(tan(b/2)) - b",
    "b*(1/b) - 1",
    "(1 + b)^3 - 1 - 3*b - 3*b^2 - b^3",
    "(sin(c)*cos(b))^2 + (sin(c)*sin(b))^2 + cos(c)^2 - 1",
];

/// How b and c move, and when b passes 1.
struct Law {
    text: &'static str,
    passes: f64,
}

fn laws() -> [Law; 3] {
    [
        Law {
            text: "state b = 0.3; state c = 0.7; b' = 0.5; c' = 0.25;",
            passes: 1.4,
        },
        // b = 0.8 + 0.5 sin t, c = 0.5 + 0.9 exp(-t): b passes 1 and comes back in π - that.
        Law {
            text: "state b = 0.8; state c = 1.4; b' = 0.5*cos(time); c' = 0.5 - c;",
            passes: 0.4_f64.asin(),
        },
        // b = 1.4/(1 + 11/3 exp(-2t)): exp(-2t) = 0.4 3/11 where it is 1.
        Law {
            text: "state b = 0.3; state c = 1; b' = 2*b*(1 - b/1.4); c' = -c/3;",
            passes: -0.5 * (1.2_f64 / 11.0).ln(),
        },
    ]
}

pub fn families(extent: Extent) -> Vec<Family> {
    let sizes = extent.sweep(&[1.0], &[1e-3, 1.0, 1e4]);
    let mut cases = Vec::new();
    for (at, identity) in IDENTITIES.iter().enumerate() {
        for (number, law) in laws().iter().enumerate() {
            if extent == Extent::Short && number != at % 3 {
                continue;
            }
            cases.extend(sizes.iter().flat_map(|&size| case(identity, law, size)));
        }
    }
    vec![Family {
        name: "rates that are rounding",
        about: "a' = k I(b, c) from a = 0 with one of 24 identities I = 0 along three laws of b and c; d' = -d + a, e' = a, \
                f' = e, and a switch at a + b = 1: closed forms.",
        hardness: "k",
        cases,
    }]
}

fn case(identity: &str, law: &Law, size: f64) -> [Case; 3] {
    // The second law comes back behind the horizon.
    let beyond = HORIZON - law.passes;
    let model = format!(
        "{} state a = 0; state d = 1; state e = 0; state f = 0; state y = 0;
         a' = {size:?}*({identity}); d' = -d + a; e' = a; f' = e; y' = if a + b > 1 then 1 else 0;",
        law.text
    );
    let case = Case::new(format!("{size:.0e}"), model, HORIZON)
        .ends_each("a", &[0.0], &[size])
        .ends("d", &[(-HORIZON).exp()], 1.0)
        .ends("e", &[0.0], size)
        .ends("f", &[0.0], size)
        .ends("y", &[beyond], beyond)
        .switches(1);
    // A few states of these are nothing but rounding that no element shows to be that.
    let grid = case.clone().by("fesd { steps = 40; }").accurate_if(false);
    let [events, elements] = case.both();
    [events, elements, grid]
}
