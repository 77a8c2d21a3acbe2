//! One tape, three evaluators: they agree to the bit.

use nsd_solver::tape::{Tape, TapeBuilder, Value};
use proptest::prelude::*;

/// Appends operations that are chosen by numbers; operands are any earlier values.
fn build(n_inputs: usize, choices: &[(u8, usize, usize, f64)]) -> Tape {
    let mut b = Tape::builder(n_inputs);
    let mut values: Vec<Value> = (0..n_inputs).map(|i| b.input(i)).collect();
    for &(op, i, j, c) in choices {
        let (x, y) = (values[i % values.len()], values[j % values.len()]);
        let value = operation(&mut b, op, x, y, c);
        values.push(value);
    }
    let outputs: Vec<Value> = values.iter().rev().take(4).copied().collect();
    b.finish(&outputs)
}

fn operation(b: &mut TapeBuilder, op: u8, x: Value, y: Value, c: f64) -> Value {
    match op % 25 {
        0 => b.constant(c),
        1 => b.neg(x),
        2 => b.scale(c, x),
        3 => b.offset(c, x),
        4 => b.subtract_from(c, x),
        5 => b.add(x, y),
        6 => b.sub(x, y),
        7 => b.add_scaled(x, c, y),
        8 => b.mul(x, y),
        9 => b.div(x, y),
        10 => b.recip(x),
        11 => b.powi(x, 3),
        12 => b.sqrt(x),
        13 => b.power(x, c),
        14 => b.pow(x, y),
        15 => b.exp(x),
        16 => b.log(x),
        17 => b.sin_cos(x).0,
        18 => b.sin_cos(x).1,
        19 => b.sinh_cosh(x).1,
        20 => b.tan(x),
        21 => b.tanh(x),
        22 => b.asin(x),
        23 => b.atan(x),
        _ => b.atan2(x, y),
    }
}

/// Equal bits, where all NaN are one.
fn bits(x: f64) -> u64 {
    if x.is_nan() {
        f64::NAN.to_bits()
    } else {
        x.to_bits()
    }
}

proptest! {
    #[test]
    fn lanes_agree_with_one_point(
        choices in prop::collection::vec((any::<u8>(), 0..50usize, 0..50usize, -3.0..3.0f64), 1..40),
        points in prop::collection::vec(-2.0..2.0f64, 3 * 11),
    ) {
        let tape = build(3, &choices);
        let n_points = 11;
        let mut many = vec![0.0; tape.n_outputs() * n_points];
        tape.eval_many(&points, &mut many, n_points, &mut tape.lane_scratch());

        let mut scratch = tape.scratch();
        let mut one = vec![0.0; tape.n_outputs()];
        for p in 0..n_points {
            let inputs: Vec<f64> = (0..3).map(|i| points[i * n_points + p]).collect();
            tape.eval(&inputs, &mut one, &mut scratch);
            for (o, &value) in one.iter().enumerate() {
                prop_assert_eq!(bits(value), bits(many[o * n_points + p]), "output {} of\n{}", o, tape);
            }
        }
    }

    #[test]
    fn four_lanes_agree_with_one_point(
        choices in prop::collection::vec((any::<u8>(), 0..50usize, 0..50usize, -3.0..3.0f64), 1..40),
        points in prop::collection::vec(prop::array::uniform4(-2.0..2.0f64), 2),
    ) {
        let tape = build(2, &choices);
        let inputs: Vec<wide::f64x4> = points.iter().map(|&lane| lane.into()).collect();
        let zeros = |n| vec![wide::f64x4::splat(0.0); n];
        let mut outputs = zeros(tape.n_outputs());
        tape.eval_lanes(&inputs, &mut outputs, &mut zeros(tape.n_registers()));

        let mut one = vec![0.0; tape.n_outputs()];
        for (lane, (&x, &y)) in points[0].iter().zip(&points[1]).enumerate() {
            tape.eval(&[x, y], &mut one, &mut tape.scratch());
            for (value, wide) in one.iter().zip(&outputs) {
                prop_assert_eq!(bits(*value), bits(wide.to_array()[lane]));
            }
        }
    }

    /// Order 0 of a jet is the value.
    #[test]
    fn jets_start_with_the_value(
        choices in prop::collection::vec((any::<u8>(), 0..50usize, 0..50usize, -3.0..3.0f64), 1..40),
        point in prop::array::uniform3(-2.0..2.0f64),
    ) {
        let tape = build(3, &choices);
        let mut one = vec![0.0; tape.n_outputs()];
        tape.eval(&point, &mut one, &mut tape.scratch());
        let mut jet = nsd_solver::tape::Jet::new(&tape, 2);
        point.iter().enumerate().for_each(|(i, &x)| jet.set_input(i, 0, x));
        jet.advance(0);
        for (o, &value) in one.iter().enumerate() {
            prop_assert_eq!(bits(value), bits(jet.output(o, 0)));
        }
    }
}

#[test]
fn equal_operations_are_one_and_unneeded_ones_none() {
    let mut b = Tape::builder(2);
    let (x, y) = (b.input(0), b.input(1));
    let (first, second) = (b.mul(x, y), b.mul(y, x));
    b.exp(x);
    let output = b.add(first, second);
    assert_eq!(b.finish(&[output]).len(), 2);
}

#[test]
fn registers_are_reused() {
    let mut b = Tape::builder(1);
    let x = b.input(0);
    let chain = (0..100).fold(x, |value, _| {
        let sine = b.sin_cos(value).0;
        b.exp(sine)
    });
    assert_eq!(b.finish(&[chain]).n_registers(), 1);
}

#[test]
fn a_tape_without_instructions_copies() {
    let b = Tape::builder(2);
    let (x, y) = (b.input(0), b.input(1));
    let tape = b.finish(&[y, x, y]);
    let mut outputs = [0.0; 3];
    tape.eval(&[1.0, 2.0], &mut outputs, &mut tape.scratch());
    assert!(tape.is_empty());
    assert_eq!(outputs, [2.0, 1.0, 2.0]);
}
