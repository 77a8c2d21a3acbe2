//! Taylor arithmetic against closed forms, up to order 30.

use nsd_solver::tape::{Jet, Tape, TapeBuilder, Value};

const ORDER: usize = 30;

/// A function as a tape, as a closure, and the times around which it is expanded.
struct Case {
    name: &'static str,
    tape: Tape,
    exact: fn(f64) -> f64,
    centres: &'static [f64],
    /// The distance to the nearest complex singularity is at least this.
    radius: f64,
}

/// `f(u(t))` for the inner function `u(t) = t`.
fn of_time(f: impl Fn(&mut TapeBuilder, Value) -> Value) -> Tape {
    let mut builder = Tape::builder(1);
    let time = builder.input(0);
    let output = f(&mut builder, time);
    builder.finish(&[output])
}

macro_rules! case {
    ($name:literal, |$b:ident, $t:ident| $tape:expr, |$x:ident| $exact:expr, $centres:expr, $radius:expr) => {
        Case {
            name: $name,
            tape: of_time(|$b, $t| $tape),
            exact: |$x: f64| $exact,
            centres: &$centres,
            radius: $radius,
        }
    };
}

/// Every operation of a tape, for an argument that is time itself or a function of it.
fn cases() -> impl Iterator<Item = Case> {
    let cases = [arithmetic(), circular(), inverses(), of_two()];
    cases.into_iter().flatten()
}

fn arithmetic() -> Vec<Case> {
    vec![
        case!("neg", |b, t| b.neg(t), |x| -x, [0.0, 2.0], 9.0),
        case!(
            "scale",
            |b, t| b.scale(3.0, t),
            |x| 3.0 * x,
            [0.0, 2.0],
            9.0
        ),
        case!(
            "offset",
            |b, t| b.offset(3.0, t),
            |x| 3.0 + x,
            [0.0, 2.0],
            9.0
        ),
        case!(
            "from",
            |b, t| b.subtract_from(3.0, t),
            |x| 3.0 - x,
            [0.0, 2.0],
            9.0
        ),
        case!(
            "powi",
            |b, t| b.powi(t, 13),
            |x| x.powi(13),
            [0.0, -1.5, 2.0],
            9.0
        ),
        case!("recip", |b, t| b.recip(t), |x| 1.0 / x, [1.0, -2.0], 1.0),
        case!("sqrt", |b, t| b.sqrt(t), |x| x.sqrt(), [1.0, 3.0], 1.0),
        case!(
            "power",
            |b, t| b.power(t, -1.3),
            |x| x.powf(-1.3),
            [1.0, 3.0],
            1.0
        ),
        case!("exp", |b, t| b.exp(t), |x| x.exp(), [0.0, -3.0, 2.0], 9.0),
        case!("log", |b, t| b.log(t), |x| x.ln(), [1.0, 4.0], 1.0),
    ]
}

fn circular() -> Vec<Case> {
    vec![
        case!(
            "sin",
            |b, t| b.sin_cos(t).0,
            |x| x.sin(),
            [0.0, 1.0, -4.0],
            9.0
        ),
        case!(
            "cos",
            |b, t| b.sin_cos(t).1,
            |x| x.cos(),
            [0.0, 1.0, -4.0],
            9.0
        ),
        case!(
            "sinh",
            |b, t| b.sinh_cosh(t).0,
            |x| x.sinh(),
            [0.0, 1.0, -4.0],
            9.0
        ),
        case!(
            "cosh",
            |b, t| b.sinh_cosh(t).1,
            |x| x.cosh(),
            [0.0, 1.0, -4.0],
            9.0
        ),
        case!("tan", |b, t| b.tan(t), |x| x.tan(), [0.0, 0.5, -3.0], 1.0),
        case!(
            "tanh",
            |b, t| b.tanh(t),
            |x| x.tanh(),
            [0.0, 0.5, -3.0],
            1.5
        ),
    ]
}

fn inverses() -> Vec<Case> {
    vec![
        case!(
            "asin",
            |b, t| b.asin(t),
            |x| x.asin(),
            [0.0, 0.3, -0.4],
            0.6
        ),
        case!(
            "acos",
            |b, t| b.acos(t),
            |x| x.acos(),
            [0.0, 0.3, -0.4],
            0.6
        ),
        case!(
            "atan",
            |b, t| b.atan(t),
            |x| x.atan(),
            [0.0, 1.0, -4.0],
            1.0
        ),
        case!(
            "asinh",
            |b, t| b.asinh(t),
            |x| x.asinh(),
            [0.0, 1.0, -4.0],
            1.0
        ),
        case!("acosh", |b, t| b.acosh(t), |x| x.acosh(), [2.0, 4.0], 1.0),
        case!(
            "atanh",
            |b, t| b.atanh(t),
            |x| x.atanh(),
            [0.0, 0.3, -0.4],
            0.6
        ),
    ]
}

fn of_two() -> Vec<Case> {
    vec![
        case!(
            "atan2",
            |b, t| {
                let x = b.offset(0.5, t);
                b.atan2(t, x)
            },
            |x| x.atan2(x + 0.5),
            [0.0, 1.0, -3.0],
            0.25
        ),
        case!(
            "div",
            |b, t| {
                let (sine, cosine) = b.sin_cos(t);
                b.div(cosine, sine)
            },
            |x| x.cos() / x.sin(),
            [1.0, -2.0],
            1.0
        ),
        case!(
            "mul",
            |b, t| {
                let (sine, cosine) = b.sin_cos(t);
                let product = b.mul(sine, t);
                b.add_scaled(product, -0.5, cosine)
            },
            |x| x * x.sin() - 0.5 * x.cos(),
            [0.0, 1.0],
            9.0
        ),
        case!(
            "pow",
            |b, t| {
                let (sine, _) = b.sin_cos(t);
                b.pow(t, sine)
            },
            |x| x.powf(x.sin()),
            [1.0, 2.0],
            1.0
        ),
    ]
}

/// The coefficients of `f` at `centre`; `bounded` promises that time has degree 1.
fn expand(tape: &Tape, centre: f64, bounded: bool) -> Vec<f64> {
    let mut jet = Jet::new(tape, ORDER);
    if bounded {
        jet.bound_degree(0, 1);
    }
    jet.set_input(0, 0, centre);
    jet.set_input(0, 1, 1.0);
    (0..=ORDER).for_each(|k| jet.advance(k));
    jet.output_row(0).to_vec()
}

fn horner(row: &[f64], t: f64) -> f64 {
    row.iter().rev().fold(0.0, |sum, c| sum * t + c)
}

#[test]
fn series_converge_to_their_functions() {
    for Case {
        name,
        tape,
        exact,
        centres,
        radius,
    } in cases()
    {
        for &centre in centres {
            // At a third of the radius, the remainder is below 3^-30 = 5e-15 of the size of the function.
            for step in [-radius / 3.0, radius / 4.0] {
                let (value, expected) = (
                    horner(&expand(&tape, centre, true), step),
                    exact(centre + step),
                );
                let tolerance = 1e-13 * expected.abs().max(1.0);
                assert!(
                    (value - expected).abs() <= tolerance,
                    "{name} at {centre} + {step}: {value}, not {expected}"
                );
            }
        }
    }
}

#[test]
fn a_promised_degree_changes_no_coefficient() {
    for Case {
        name,
        tape,
        centres,
        ..
    } in cases()
    {
        for &centre in centres {
            let (bounded, free) = (expand(&tape, centre, true), expand(&tape, centre, false));
            for (k, (bounded, free)) in bounded.iter().zip(&free).enumerate() {
                let tolerance = 1e-13 * free.abs().max(1e-3);
                assert!(
                    (bounded - free).abs() <= tolerance,
                    "{name} at {centre}, order {k}"
                );
            }
        }
    }
}

/// `f(sin(t) / 2 + c)` runs the recurrences with an argument of all orders.
#[test]
fn functions_of_functions_compose() {
    let compose = |f: &dyn Fn(&mut TapeBuilder, Value) -> Value| {
        of_time(|b, t| {
            let sine = b.sin_cos(t).0;
            let half = b.scale(0.5, sine);
            let inner = b.offset(0.25, half);
            f(b, inner)
        })
    };
    let inner = |t: f64| 0.25 + 0.5 * t.sin();
    type Function = (fn(&mut TapeBuilder, Value) -> Value, fn(f64) -> f64);
    let functions: [Function; 9] = [
        (|b, u| b.exp(u), f64::exp),
        (|b, u| b.sin_cos(u).0, f64::sin),
        (|b, u| b.sinh_cosh(u).1, f64::cosh),
        (|b, u| b.tan(u), f64::tan),
        (|b, u| b.tanh(u), f64::tanh),
        (|b, u| b.asin(u), f64::asin),
        (|b, u| b.acos(u), f64::acos),
        (|b, u| b.atan(u), f64::atan),
        (|b, u| b.square(u), |u| u * u),
    ];
    for (i, (build, exact)) in functions.into_iter().enumerate() {
        let tape = compose(&build);
        let row = expand(&tape, 0.1, false);
        for t in [-0.2, 0.25] {
            let (value, expected) = (horner(&row, t), exact(inner(0.1 + t)));
            assert!(
                (value - expected).abs() < 1e-14,
                "function {i} at {t}: {value}, not {expected}"
            );
        }
    }
}

/// Exact coefficients where they are known.
#[test]
fn known_series_come_out_exactly() {
    let geometric = expand(
        &of_time(|b, t| {
            let below = b.subtract_from(1.0, t);
            b.recip(below)
        }),
        0.0,
        true,
    );
    assert!(geometric.iter().all(|&c| c == 1.0));

    let logarithm = expand(&of_time(|b, t| b.log(t)), 1.0, true);
    for (k, c) in logarithm.iter().enumerate().skip(1) {
        assert!(((c * k as f64).abs() - 1.0).abs() < 1e-14 && (*c > 0.0) == (k % 2 == 1));
    }

    let cube = expand(&of_time(|b, t| b.powi(t, 3)), 0.0, true);
    assert!(
        cube.iter()
            .enumerate()
            .all(|(k, &c)| c == f64::from(u8::from(k == 3)))
    );
}

/// An input with coefficients of all orders, and time with two.
#[test]
fn all_orders_at_once_are_those_computed_one_by_one() {
    for Case {
        name,
        tape,
        centres,
        ..
    } in cases()
    {
        for (&centre, bounded) in centres.iter().flat_map(|c| [(c, true), (c, false)]) {
            let mut jet = Jet::new(&tape, 30);
            if bounded {
                jet.bound_degree(0, 1);
            }
            jet.set_input(0, 0, centre);
            for k in 1..=if bounded { 1 } else { 30 } {
                jet.set_input(0, k, 0.3 / (1 + k * k) as f64);
            }
            let mut at_once = jet.clone();
            (0..=30).for_each(|k| jet.advance(k));
            at_once.fill();
            let mut size = 0.0_f64;
            for (k, (one, all)) in jet
                .output_row(0)
                .iter()
                .zip(at_once.output_row(0))
                .enumerate()
            {
                size = size.max(one.abs());
                let difference = (one - all).abs();
                assert!(
                    difference <= 1e-13 * size,
                    "{name} at {centre}, order {k}: {all}, not {one}"
                );
            }
        }
    }
}

#[test]
fn an_order_may_be_computed_again() {
    let tape = of_time(|b, t| {
        let exponential = b.exp(t);
        b.mul(exponential, t)
    });
    let mut jet = Jet::new(&tape, 4);
    jet.set_input(0, 0, 1.0);
    jet.advance(0);
    for guess in [7.0, -3.0, 1.0] {
        jet.set_input(0, 1, guess);
        jet.advance(1);
    }
    // (x e^x)' = (1 + x) e^x
    assert!((jet.output(0, 1) - 2.0 * 1f64.exp()).abs() < 1e-14);
}

#[test]
fn errors_of_the_domain_are_not_a_number() {
    for tape in [
        of_time(|b, t| b.log(t)),
        of_time(|b, t| b.sqrt(t)),
        of_time(|b, t| b.asin(t)),
    ] {
        assert!(expand(&tape, -2.0, false)[0].is_nan());
    }
}

/// x'' = -x from (0, 1) gives the sine.
#[test]
fn an_oscillator_gives_the_sine() {
    let mut builder = Tape::builder(2);
    let (x, v) = (builder.input(0), builder.input(1));
    let force = builder.neg(x);
    let tape = builder.finish(&[v, force]);
    let mut jet = Jet::new(&tape, 20);
    jet.set_input(1, 0, 1.0);
    for k in 0..20 {
        jet.advance(k);
        for i in 0..2 {
            jet.set_input(i, k + 1, jet.output(i, k) / (k + 1) as f64);
        }
    }
    assert!((horner(jet.input_row(0), 1.0) - 1f64.sin()).abs() < 1e-15);
}
