//! Derivatives of tapes against closed forms and against Taylor arithmetic, which shares nothing with them.

use nsd_solver::tape::{Derivative, Jet, Tape, TapeBuilder, Value};
use proptest::prelude::*;

fn eval(tape: &Tape, inputs: &[f64]) -> Vec<f64> {
    let mut outputs = vec![0.0; tape.n_outputs()];
    tape.eval(inputs, &mut outputs, &mut tape.scratch());
    outputs
}

/// The entries with their values.
fn values(derivative: &Derivative, inputs: &[f64]) -> Vec<((u32, u32), f64)> {
    let mut values = eval(&derivative.tape, inputs);
    values.extend(eval(&derivative.constant, inputs));
    derivative.entries.iter().copied().zip(values).collect()
}

fn sorted(mut entries: Vec<((u32, u32), f64)>) -> Vec<((u32, u32), f64)> {
    entries.sort_by_key(|entry| entry.0);
    entries
}

#[test]
fn patterns_have_what_is_not_zero_and_nothing_else() {
    // f = (x0 x1 + a x2, sin x2), by x with a number a.
    let mut b = Tape::builder(4);
    let [x0, x1, x2, a] = [0, 1, 2, 3].map(|i| b.input(i));
    let (product, linear) = (b.mul(x0, x1), b.mul(a, x2));
    let outputs = [b.add(product, linear), b.sin_cos(x2).0];
    let tape = b.finish(&outputs);
    let point = [2.0, 3.0, 0.5, 7.0];

    let jacobian = tape.jacobian(3);
    assert_eq!(
        sorted(values(&jacobian, &point)),
        [
            ((0, 0), 3.0),
            ((0, 1), 2.0),
            ((0, 2), 7.0),
            ((1, 2), 0.5f64.cos())
        ]
    );
    // ∂f_0/∂x_2 = a does not change with x.
    assert_eq!(jacobian.constant.n_outputs(), 1);
    assert_eq!(jacobian.entries.last(), Some(&(0, 2)));

    let hessian = tape.hessian(3);
    let with_weights = [2.0, 3.0, 0.5, 7.0, 10.0, 100.0];
    assert_eq!(
        sorted(values(&hessian, &with_weights)),
        [((1, 0), 10.0), ((2, 2), -100.0 * 0.5f64.sin())]
    );
}

#[test]
fn an_infinite_coefficient_has_no_curvature() {
    // f = x0 x1 + c x2.
    for c in [2.0, f64::INFINITY, f64::NEG_INFINITY] {
        let mut b = Tape::builder(3);
        let [x0, x1, x2] = [0, 1, 2].map(|i| b.input(i));
        let product = b.mul(x0, x1);
        let f = b.add_scaled(product, c, x2);
        let hessian = b.finish(&[f]).hessian(3);
        let with_weight = [1.0, 2.0, 3.0, 10.0];
        assert_eq!(values(&hessian, &with_weight), [((1, 0), 10.0)], "{c}");
        assert_eq!(hessian.constant.n_outputs(), 0, "{c}");
    }
}

#[test]
fn what_cancels_is_not_an_entry() {
    // (x + y)² - (x - y)² = 4 x y.
    let mut b = Tape::builder(2);
    let (x, y) = (b.input(0), b.input(1));
    let (sum, difference) = (b.add(x, y), b.sub(x, y));
    let (first, second) = (b.square(sum), b.square(difference));
    let output = b.sub(first, second);
    let hessian = b.finish(&[output]).hessian(2);
    assert_eq!(values(&hessian, &[0.3, 0.7, 1.0]), [((1, 0), 4.0)]);
}

#[test]
fn an_output_that_is_an_input_or_a_number_has_constant_derivatives() {
    let mut b = Tape::builder(2);
    let (x, number) = (b.input(0), b.constant(3.0));
    let tape = b.finish(&[x, number, x]);
    let jacobian = tape.jacobian(2);
    assert_eq!(jacobian.tape.n_outputs(), 0);
    assert_eq!(
        values(&jacobian, &[5.0, 6.0]),
        [((0, 0), 1.0), ((2, 0), 1.0)]
    );
    assert!(tape.hessian(2).entries.is_empty());
}

/// f(x, y), its gradient and its second derivatives by xx, yx, yy.
type Closed = fn(f64, f64) -> ([f64; 2], [f64; 3]);

#[test]
fn operations_of_two_operands_have_their_closed_derivatives() {
    type Operation = fn(&mut TapeBuilder, Value, Value) -> Value;
    let cases: [(&str, Operation, Closed); 3] = [
        ("div", TapeBuilder::div, |x, y| {
            (
                [1.0 / y, -x / y.powi(2)],
                [0.0, -y.powi(-2), 2.0 * x / y.powi(3)],
            )
        }),
        ("pow", TapeBuilder::pow, |x, y| {
            let (v, log) = (x.powf(y), x.ln());
            (
                [y * v / x, v * log],
                [
                    y * (y - 1.0) * v / x.powi(2),
                    v / x * (1.0 + y * log),
                    v * log * log,
                ],
            )
        }),
        ("atan2", TapeBuilder::atan2, |x, y| {
            // The angle of the point (y, x).
            let r = x * x + y * y;
            (
                [y / r, -x / r],
                [
                    -2.0 * x * y / r.powi(2),
                    (x * x - y * y) / r.powi(2),
                    2.0 * x * y / r.powi(2),
                ],
            )
        }),
    ];
    for (name, operation, closed) in cases {
        let mut b = Tape::builder(2);
        let (x, y) = (b.input(0), b.input(1));
        let output = operation(&mut b, x, y);
        let tape = b.finish(&[output]);
        for (x, y) in [(0.7, 1.9), (2.5, -0.4), (1.0, 3.0)] {
            let (first, second) = closed(x, y);
            let all = [(0, 0), (1, 0), (1, 1)];
            let known = |entries: Vec<((u32, u32), f64)>, at: &[(u32, u32)], exact: &[f64]| {
                for (at, exact) in at.iter().zip(exact) {
                    let found = entries.iter().find(|entry| entry.0 == *at);
                    let found = found.map_or(0.0, |entry| entry.1);
                    assert!(
                        (found - exact).abs() <= 1e-14 * (1.0 + exact.abs()),
                        "{name} at ({x}, {y}), {at:?}: {found} is not {exact}"
                    );
                }
            };
            known(
                values(&tape.jacobian(2), &[x, y]),
                &[(0, 0), (0, 1)],
                &first,
            );
            known(values(&tape.hessian(2), &[x, y, 1.0]), &all, &second);
        }
    }
}

#[test]
fn powers_have_finite_derivatives_at_zero_where_they_can() {
    let mut b = Tape::builder(1);
    let x = b.input(0);
    let outputs = [b.power(x, 2.5), b.powi(x, 3)];
    let tape = b.finish(&outputs);
    let entries = values(&tape.hessian(1), &[0.0, 1.0, 1.0]);
    assert_eq!(entries, [((0, 0), 0.0)]);
}

#[test]
fn a_sparse_sum_of_a_thousand_terms_has_a_sparse_hessian() {
    // Σ (x_i - x_{i+1})² exp(x_i)
    let n = 1000;
    let mut b = Tape::builder(n);
    let mut sum = b.constant(0.0);
    for i in 0..n - 1 {
        let (x, next) = (b.input(i), b.input(i + 1));
        let difference = b.sub(x, next);
        let (square, exp) = (b.square(difference), b.exp(x));
        let term = b.mul(square, exp);
        sum = b.add(sum, term);
    }
    let hessian = b.finish(&[sum]).hessian(n);
    assert_eq!(hessian.entries.len(), n + n - 1);
    assert!(hessian.tape.len() < 20 * n, "{}", hessian.tape.len());
}

#[test]
fn the_terms_of_a_long_sum_do_not_meet_each_other() {
    // exp(Σ sin(i x)), all terms before the sum.
    let n = 2000;
    let mut b = Tape::builder(1);
    let x = b.input(0);
    let mut terms = Vec::new();
    for i in 1..=n {
        let angle = b.scale(i as f64, x);
        terms.push(b.sin_cos(angle).0);
    }
    let first = terms[0];
    let sum = terms[1..].iter().fold(first, |sum, &term| b.add(sum, term));
    let output = b.exp(sum);
    let hessian = b.finish(&[output]).hessian(1);
    assert!(hessian.tape.len() < 20 * n, "{}", hessian.tape.len());
    // f'' = (s'' + s'²) f
    let x = 1e-6f64;
    let terms = |f: fn(f64) -> f64, power: i32| -> f64 {
        (1..=n)
            .map(|i| f64::from(i as u32).powi(power) * f(i as f64 * x))
            .sum()
    };
    let (s, slope, curvature) = (terms(f64::sin, 0), terms(f64::cos, 1), -terms(f64::sin, 2));
    let exact = (curvature + slope * slope) * s.exp();
    let found = values(&hessian, &[x, 1.0])[0].1;
    assert!(
        (found - exact).abs() <= 1e-10 * exact.abs(),
        "{found} is not {exact}"
    );
}

/// A tape of bounded operations, so that rounding is not magnified without bound.
fn build(choices: &[(u8, usize, usize, f64)]) -> Tape {
    let mut b = Tape::builder(3);
    let mut values: Vec<Value> = (0..3).map(|i| b.input(i)).collect();
    for &(op, i, j, c) in choices {
        let (x, y) = (values[i % values.len()], values[j % values.len()]);
        let value = operation(&mut b, op, x, y, c);
        values.push(value);
    }
    let outputs: Vec<Value> = values.iter().rev().take(3).copied().collect();
    b.finish(&outputs)
}

fn operation(b: &mut TapeBuilder, op: u8, x: Value, y: Value, c: f64) -> Value {
    // In (-1/2, 1/2) and in (1, 3).
    let small = |b: &mut TapeBuilder, x| {
        let x = b.tanh(x);
        b.scale(0.5, x)
    };
    let positive = |b: &mut TapeBuilder, x| {
        let x = b.tanh(x);
        b.offset(2.0, x)
    };
    match op % 26 {
        0 => b.constant(c),
        1 => b.neg(x),
        2 => b.scale(c, x),
        3 => b.offset(c, x),
        4 => b.subtract_from(c, x),
        5 => b.add(x, y),
        6 => b.sub(x, y),
        7 => b.add_scaled(x, c, y),
        8 => b.mul(x, y),
        9 => {
            let y = positive(b, y);
            b.div(x, y)
        }
        10 => {
            let x = positive(b, x);
            b.recip(x)
        }
        11 => {
            let x = small(b, x);
            b.powi(x, 3)
        }
        12 => {
            let x = positive(b, x);
            b.sqrt(x)
        }
        13 => {
            let x = positive(b, x);
            b.power(x, c)
        }
        14 => {
            let (x, y) = (positive(b, x), small(b, y));
            b.pow(x, y)
        }
        15 => {
            let x = small(b, x);
            b.exp(x)
        }
        16 => {
            let x = positive(b, x);
            b.log(x)
        }
        17 => b.sin_cos(x).0,
        18 => b.sin_cos(x).1,
        19 => {
            let x = small(b, x);
            b.sinh_cosh(x).0
        }
        20 => {
            let x = small(b, x);
            b.sinh_cosh(x).1
        }
        21 => {
            let x = small(b, x);
            b.tan(x)
        }
        22 => b.tanh(x),
        23 => {
            let x = small(b, x);
            let (sine, cosine) = (b.asin(x), b.acos(x));
            b.mul(sine, cosine)
        }
        24 => b.atan(x),
        _ => {
            let y = positive(b, y);
            b.atan2(x, y)
        }
    }
}

proptest! {
    /// f(x + t d) has the coefficients J d and dᵀ H d / 2.
    #[test]
    fn derivatives_agree_with_taylor_arithmetic(
        choices in prop::collection::vec((any::<u8>(), 0..50usize, 0..50usize, -1.5..1.5f64), 1..25),
        point in prop::array::uniform3(-1.0..1.0f64),
        direction in prop::array::uniform3(-1.0..1.0f64),
        weights in prop::array::uniform3(-1.0..1.0f64),
    ) {
        let tape = build(&choices);
        let mut jet = Jet::new(&tape, 2);
        for i in 0..3 {
            jet.set_input(i, 0, point[i]);
            jet.set_input(i, 1, direction[i]);
        }
        jet.fill();
        let jacobian = values(&tape.jacobian(3), &point);
        for output in 0..tape.n_outputs() {
            let row = jacobian.iter().filter(|((i, _), _)| *i as usize == output);
            let terms: Vec<f64> = row.map(|((_, j), slope)| slope * direction[*j as usize]).collect();
            let scale = 1.0 + terms.iter().map(|term| term.abs()).sum::<f64>();
            let slope: f64 = terms.iter().sum();
            prop_assert!((slope - jet.output(output, 1)).abs() <= 1e-12 * scale, "{}", tape);
        }
        let inputs: Vec<f64> = point.iter().chain(&weights[..tape.n_outputs()]).copied().collect();
        let hessian = values(&tape.hessian(3), &inputs);
        let terms: Vec<f64> = hessian.iter().map(|&((i, j), h)| {
            prop_assert!(j <= i);
            let twice = if i == j { 1.0 } else { 2.0 };
            Ok(twice * h * direction[i as usize] * direction[j as usize])
        }).collect::<Result<_, _>>()?;
        let scale = 1.0 + terms.iter().map(|term| term.abs()).sum::<f64>();
        let expected: f64 = (0..tape.n_outputs()).map(|o| 2.0 * weights[o] * jet.output(o, 2)).sum();
        let curvature: f64 = terms.iter().sum();
        prop_assert!(
            (curvature - expected).abs() <= 1e-11 * (scale + expected.abs()),
            "{} is not {} for\n{}", curvature, expected, tape
        );
    }
}

proptest! {
    /// A tape with numbers in place of inputs is the same function of the others, and of those that it reads only.
    #[test]
    fn a_specialized_tape_is_the_same_function(
        choices in prop::collection::vec((any::<u8>(), 0..50usize, 0..50usize, -1.5..1.5f64), 1..25),
        point in prop::array::uniform3(-1.0..1.0f64),
        known in prop::array::uniform3(prop::option::of(prop::sample::select(vec![0.0, 0.5, 1.0]))),
    ) {
        let tape = build(&choices);
        let whole: Vec<f64> = (0..3).map(|i| known[i].unwrap_or(point[i])).collect();
        let (special, inputs) = tape.specialize(|input| known[input]);
        prop_assert!(inputs.iter().all(|&input| known[input].is_none()));
        let reduced: Vec<f64> = inputs.iter().map(|&input| whole[input]).collect();
        for (found, expected) in eval(&special, &reduced).iter().zip(eval(&tape, &whole)) {
            prop_assert!((found - expected).abs() <= 1e-10 * (1.0 + expected.abs()), "{}\n{}", tape, special);
        }
    }

    /// Partial derivatives by some inputs are columns of the Jacobian.
    #[test]
    fn partials_are_columns_of_the_jacobian(
        choices in prop::collection::vec((any::<u8>(), 0..50usize, 0..50usize, -1.5..1.5f64), 1..25),
        point in prop::array::uniform3(-1.0..1.0f64),
        by in prop::array::uniform3(any::<bool>()),
    ) {
        let tape = build(&choices);
        let (entries, partials) = tape.partials(|input| by[input]);
        prop_assert!(entries.is_sorted());
        let of_all = sorted(values(&tape.jacobian(3), &point));
        let columns: Vec<_> = of_all.iter().filter(|((_, j), _)| by[*j as usize]).collect();
        prop_assert_eq!(entries.len(), columns.len());
        for ((&(i, j), found), ((row, column), expected)) in entries.iter().zip(eval(&partials, &point)).zip(columns) {
            prop_assert_eq!((i, j), (*row as usize, *column as usize));
            prop_assert!((found - expected).abs() <= 1e-12 * (1.0 + expected.abs()), "{}", tape);
        }
    }
}

/// f = a x + b² t - (x - 3)/4: with numbers for a and b it is a sum of multiples of x and t.
#[test]
fn what_is_linear_by_its_structure_is_told() {
    let mut b = Tape::builder(4);
    let [x, t, a, k] = [0, 1, 2, 3].map(|input| b.input(input));
    let (ax, square) = (b.mul(a, x), b.square(k));
    let steady = b.mul(square, t);
    let shifted = b.offset(-3.0, x);
    let four = b.constant(4.0);
    let quarter = b.div(shifted, four);
    let sum = b.add(ax, steady);
    let f = b.sub(sum, quarter);
    let tape = b.finish(&[f]);
    let known = |input: usize| [None, None, Some(2.0), Some(3.0)][input];
    let linear = tape.linear(known).unwrap();
    assert_eq!(linear.terms, [(0, 1.75), (1, 9.0)]);
    assert_eq!(linear.constant, 0.75);
    assert!(
        tape.linear(|input| known(input).filter(|_| input == 2))
            .is_none()
    );
    // Where a = 1/4 the terms of x cancel.
    let cancelled = tape.linear(|input| [None, None, Some(0.25), Some(3.0)][input]);
    assert_eq!(cancelled.unwrap().terms, [(1, 9.0)]);
}
