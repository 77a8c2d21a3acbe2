//! Random expressions against arithmetic that carries its own error bounds.
//!
//! A program is a list of operations on earlier values. It is run once on expressions and once, as it stands, on
//! intervals and their derivatives; what the expression gives must lie in the interval.

mod ball;

use std::ops::{Add, Div, Mul, Neg, Sub};

use ball::{Ball, Dual};
use nsd_solver::tape::Jet;
use proptest::prelude::*;

use super::{Expr, Exprs, Function, Substitution, Var, compile, gradient, jacobian};

/// The numbers of an operation: which one, its operands, a constant.
type Choice = (u8, usize, usize, f64);

fn programs() -> impl Strategy<Value = Vec<Choice>> {
    let constant = prop_oneof![Just(0.0), Just(1.0), Just(-1.0), Just(2.0), -3.0..3.0f64];
    prop::collection::vec((any::<u8>(), 0..40usize, 0..40usize, constant), 1..25)
}

/// Runs a program on anything with arithmetic; sums and products come more often than functions.
fn run<T>(
    program: &[Choice],
    inputs: &[T],
    constant: impl Fn(f64) -> T,
    apply: impl Fn(T, Function) -> T,
) -> T
where
    T: Copy
        + Add<Output = T>
        + Sub<Output = T>
        + Mul<Output = T>
        + Div<Output = T>
        + Neg<Output = T>,
{
    let mut values = inputs.to_vec();
    for &(op, i, j, c) in program {
        let (x, y) = (values[i % values.len()], values[j % values.len()]);
        let n_smooth = Function::ALL.iter().filter(|f| !f.is_nonsmooth()).count();
        values.push(match usize::from(op) % (24 + n_smooth) {
            0..=3 => x + y,
            4..=7 => x - y,
            8..=12 => x * y,
            13..=14 => x / y,
            15..=17 => constant(c) * x,
            18..=19 => x + constant(c),
            20..=21 => constant(c) / x,
            22 => -x,
            23 => x * x * x,
            // The smooth ones come first.
            op => apply(x, Function::ALL[op - 24]),
        });
    }
    values[values.len() - 1]
}

const N: usize = 3;

fn build<'e>(exprs: &'e Exprs, inputs: &[Expr<'e>], program: &[Choice]) -> Expr<'e> {
    run(program, inputs, |c| exprs.constant(c), Expr::apply)
}

/// The value, and the derivative by the input with the number `direction`.
fn reference(program: &[Choice], inputs: &[Ball], direction: usize) -> Dual {
    let slope = |i| Ball {
        value: f64::from(u8::from(i == direction)),
        error: 0.0,
    };
    let inputs = inputs.iter().enumerate().map(|(i, &value)| Dual {
        value,
        slope: slope(i),
    });
    run(
        program,
        &inputs.collect::<Vec<_>>(),
        Dual::constant,
        Dual::function,
    )
}

fn exact(point: &[f64]) -> Vec<Ball> {
    point
        .iter()
        .map(|&value| Ball { value, error: 0.0 })
        .collect()
}

fn points() -> impl Strategy<Value = [f64; N]> {
    prop::array::uniform3(-2.0..2.0f64)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn simplification_keeps_the_value(program in programs(), point in points()) {
        let exprs = Exprs::new();
        let expr = build(&exprs, &exprs.variables("x", N), &program);
        let value = expr.eval(&|var: Var| point[var.index()]);
        let expected = reference(&program, &exact(&point), 0).value;
        prop_assert!(expected.allows(value), "{expr} is {value}, not {expected:?}");
    }

    #[test]
    fn a_tape_computes_the_value(program in programs(), point in points()) {
        let exprs = Exprs::new();
        let x = exprs.variables("x", N);
        let expr = build(&exprs, &x, &program);
        let vars: Vec<Var> = x.iter().filter_map(|x| x.as_variable()).collect();
        let tape = compile(&vars, &[expr]).expect("smooth functions compile");
        let mut value = [0.0];
        tape.eval(&point, &mut value, &mut tape.scratch());
        let expected = reference(&program, &exact(&point), 0).value;
        prop_assert!(expected.allows(value[0]), "{expr} is {value:?}, not {expected:?}\n{tape}");
    }

    #[test]
    fn substitution_and_evaluation_commute(
        outer in programs(),
        inner in programs(),
        point in points(),
    ) {
        let exprs = Exprs::new();
        let x = exprs.variables("x", N);
        let value = build(&exprs, &x, &inner);
        let substitution = Substitution::from_iter([(x[0].as_variable().unwrap(), value)]);
        let expr = build(&exprs, &x, &outer).substitute(&substitution);

        let mut inputs = exact(&point);
        inputs[0] = reference(&inner, &inputs, 0).value;
        let expected = reference(&outer, &inputs, 0).value;
        let value = expr.eval(&|var: Var| point[var.index()]);
        prop_assert!(expected.allows(value), "{expr} is {value}, not {expected:?}");
    }

    #[test]
    fn derivatives_forward_reverse_and_by_taylor_arithmetic(program in programs(), point in points()) {
        let exprs = Exprs::new();
        let x = exprs.variables("x", N);
        let expr = build(&exprs, &x, &program);
        let vars: Vec<Var> = x.iter().filter_map(|x| x.as_variable()).collect();
        let at = |expr: Expr| expr.eval(&|var: Var| point[var.index()]);

        let mut forward = [exprs.constant(0.0); N];
        jacobian(&[expr], &vars).entries.into_iter().for_each(|(_, j, entry)| forward[j] = entry);
        let reverse = gradient(expr, &vars);
        let tape = compile(&vars, &[expr]).expect("smooth functions compile");
        for j in 0..N {
            let Dual { value, slope: expected } = reference(&program, &exact(&point), j);
            // Outside the domain of a function, its derivative may still have a value.
            if !value.value.is_finite() {
                continue;
            }
            prop_assert!(expected.allows(at(forward[j])), "d {expr} = {}, not {expected:?}", forward[j]);
            prop_assert!(expected.allows(at(reverse[j])), "d {expr} = {}, not {expected:?}", reverse[j]);

            let mut jet = Jet::new(&tape, 1);
            point.iter().enumerate().for_each(|(i, &value)| jet.set_input(i, 0, value));
            jet.set_input(j, 1, 1.0);
            jet.advance(0);
            jet.advance(1);
            let slope = jet.output(0, 1);
            prop_assert!(expected.allows(slope), "d {expr} = {slope}, not {expected:?}\n{tape}");
        }
    }

    /// What is opposite or proportional has the same normal form.
    #[test]
    fn split_scale_finds_multiples(program in programs(), power in -3..4i32, point in points()) {
        let exprs = Exprs::new();
        let expr = build(&exprs, &exprs.variables("x", N), &program);
        let factor = -(2f64.powi(power));
        let (scale, normal) = expr.split_scale();
        prop_assert_eq!((factor * expr).split_scale(), if expr.is_zero() { (1.0, expr) } else { (factor * scale, normal) });

        let at = |expr: Expr| expr.eval(&|var: Var| point[var.index()]);
        let expected = reference(&program, &exact(&point), 0).value;
        prop_assert!(expected.allows(scale * at(normal)), "{scale} * ({normal}) is not {expr}");
    }
}

/// The coefficients of a jet are the symbolic derivatives over factorials.
#[test]
fn jets_are_repeated_derivatives() {
    let exprs = Exprs::new();
    let t = exprs.variable("t");
    let var = t.as_variable().unwrap();
    let functions = [
        (t.sin() * t).exp() / (2.0 + t.cos()),
        (1.0 + t * t).sqrt().log() * t.tanh(),
        t.atan2(1.0 + t.powi(2)) + (0.5 * t).asin() - (0.3 * t).acos(),
        (1.5 + t.sin()).powf(t) * t.cosh(),
        (2.0 + t).powf(exprs.constant(-1.7)) * t.tan() + t.sinh().atan(),
    ];
    for function in functions {
        let tape = compile(&[var], &[function]).expect("smooth functions compile");
        let mut jet = Jet::new(&tape, 6);
        jet.set_input(0, 0, 0.4);
        jet.set_input(0, 1, 1.0);
        let (mut derivative, mut factorial) = (function, 1.0);
        for k in 0..=6 {
            jet.advance(k);
            let expected = derivative.eval(&|_| 0.4) / factorial;
            let error = (jet.output(0, k) - expected).abs();
            assert!(
                error < 1e-12 * expected.abs().max(1.0),
                "order {k} of {function}"
            );
            derivative = derivative.diff(var);
            factorial *= f64::from(k as u32 + 1);
        }
    }
}

#[test]
fn deep_chains_do_not_exhaust_the_stack() {
    let exprs = Exprs::new();
    let x = exprs.variable("x");
    let var = x.as_variable().unwrap();
    let chain = (0..100_000).fold(x, |p, _| (p * 0.5 + 1.0) * x);
    let doubled = chain.substitute(&Substitution::from_iter([(var, 2.0 * x)]));
    assert!((doubled.eval(&|_| 0.25) - chain.eval(&|_| 0.5)).abs() < 1e-12);
    assert!((chain.diff(var).eval(&|_| 0.5) - 4.0 / 2.25).abs() < 1e-12);
    assert!((gradient(chain, &[var])[0].eval(&|_| 0.5) - 4.0 / 2.25).abs() < 1e-12);

    let mut sum = exprs.constant(0.0);
    for i in 0..100_000 {
        sum = sum + f64::from(i) * (x + f64::from(i)).sin();
    }
    assert!(sum.depends_on(var));
}
