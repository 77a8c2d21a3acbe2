use super::*;
use crate::optimization::problem::Member;
use crate::tape::{TapeBuilder, Value};

const INFINITY: f64 = f64::INFINITY;

fn tape(n: usize, outputs: impl Fn(&mut TapeBuilder, &[Value]) -> Vec<Value>) -> Tape {
    let mut b = Tape::builder(n);
    let inputs: Vec<Value> = (0..n).map(|i| b.input(i)).collect();
    let outputs = outputs(&mut b, &inputs);
    b.finish(&outputs)
}

/// minimize Σ_p n_p (w_p - w_{p+1})³  + 2 w_0
/// s.t. rows (a sin(b) + 3 q, a² + b a) at (w_p, w_{p+1}) for p = 0..11 and at (w_5, w_5), and a linear row.
fn program() -> Program {
    let n = 12;
    let free = vec![-INFINITY; n];
    let start: Vec<f64> = (0..n).map(|i| 0.3 + 0.1 * i as f64).collect();
    let mut program = Program::builder(&free, &vec![INFINITY; n], &start);
    program.parameters(&[0.5]);
    let pairs = |last: u32| (0..11).chain([5]).chain(1..12).chain([last]).collect();
    let rows = program.rows(
        Block {
            values: tape(3, |b, x| {
                let sine = b.sin_cos(x[1]).0;
                let product = b.mul(x[0], sine);
                let (square, both) = (b.square(x[0]), b.mul(x[0], x[1]));
                vec![b.add_scaled(product, 3.0, x[2]), b.add(square, both)]
            }),
            n_places: 12,
            variables: pairs(5),
            numbers: vec![],
            parameters: vec![0],
        },
        &[0.0; 24],
        &[INFINITY; 24],
    );
    assert_eq!(rows, 0..24);
    let rows = program.rows(
        Block {
            values: tape(4, |b, x| {
                let (first, second) = (b.mul(x[0], x[2]), b.mul(x[1], x[3]));
                vec![b.add(first, second)]
            }),
            n_places: 1,
            variables: vec![3, 7],
            numbers: vec![2.0, -5.0],
            parameters: vec![],
        },
        &[1.0],
        &[1.0],
    );
    assert_eq!(rows, 24..25);
    program.objective(Block {
        values: tape(3, |b, x| {
            let difference = b.sub(x[0], x[1]);
            let cube = b.powi(difference, 3);
            vec![b.mul(cube, x[2])]
        }),
        n_places: 11,
        variables: (0..11).chain(1..12).collect(),
        numbers: (0..11).map(f64::from).collect(),
        parameters: vec![],
    });
    program.objective(Block {
        values: tape(1, |b, x| vec![b.scale(2.0, x[0])]),
        n_places: 1,
        variables: vec![0],
        numbers: vec![],
        parameters: vec![],
    });
    program.finish()
}

fn rows_of(w: &[f64]) -> Vec<f64> {
    let at: Vec<(usize, usize)> = (0..11).map(|p| (p, p + 1)).chain([(5, 5)]).collect();
    let first = at.iter().map(|&(a, b)| w[a] * w[b].sin() + 1.5);
    let second = at.iter().map(|&(a, b)| w[a] * w[a] + w[a] * w[b]);
    let last = 2.0 * w[3] - 5.0 * w[7];
    first.chain(second).chain([last]).collect()
}

#[test]
fn values_are_those_of_the_functions() {
    let mut program = program();
    let w = program.start().to_vec();
    let mut rows = vec![0.0; program.n_rows()];
    program.rows(&w, &mut rows);
    for (row, exact) in rows.iter().zip(rows_of(&w)) {
        assert!((row - exact).abs() < 1e-15, "{row} is not {exact}");
    }
    let cubes = (0..11).map(|p| p as f64 * (w[p] - w[p + 1]).powi(3));
    let exact = cubes.sum::<f64>() + 2.0 * w[0];
    assert!((program.objective(&w) - exact).abs() < 1e-14);
}

/// Differences of fourth order: for these functions and steps exact to 1e-10.
fn difference(h: f64, f: impl Fn(f64) -> f64) -> f64 {
    (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
}

#[test]
fn first_derivatives_agree_with_differences() {
    let mut program = program();
    let w = program.start().to_vec();
    let pattern = program.jacobian_pattern().clone();
    let mut entries = vec![f64::NAN; pattern.n_entries()];
    program.jacobian(&w, &mut entries);
    let mut gradient = vec![f64::NAN; w.len()];
    program.gradient(&w, &mut gradient);
    // 2 for each row at two variables, 1 for those at one, and the linear row.
    assert_eq!(pattern.n_entries(), 2 * (2 * 11 + 1) + 2);
    for column in 0..w.len() {
        let at = |h: f64| {
            let mut w = w.clone();
            w[column] += h;
            w
        };
        for row in 0..program.n_rows() {
            let exact = difference(1e-3, |h| rows_of(&at(h))[row]);
            let place = pattern.place(row, column as u32);
            let found = place.map_or(0.0, |place| entries[place]);
            assert!(
                (found - exact).abs() < 1e-10,
                "{row}, {column}: {found} is not {exact}"
            );
        }
        let exact = difference(1e-3, |h| program.clone().objective(&at(h)));
        assert!((gradient[column] - exact).abs() < 1e-10, "{column}");
    }
}

#[test]
fn second_derivatives_agree_with_differences() {
    let mut program = program();
    let w = program.start().to_vec();
    let y: Vec<f64> = (0..program.n_rows())
        .map(|row| 1.0 / (2.0 + row as f64))
        .collect();
    let pattern = program.hessian_pattern().clone();
    let mut entries = vec![f64::NAN; pattern.n_entries()];
    program.hessian(&w, 0.7, &y, &mut entries);
    // The gradient of the Lagrangian.
    let lagrangian = |w: &[f64]| {
        let mut program = program.clone();
        let mut gradient = vec![0.0; w.len()];
        program.gradient(w, &mut gradient);
        gradient.iter_mut().for_each(|g| *g *= 0.7);
        let jacobian = program.jacobian_pattern().clone();
        let mut slopes = vec![0.0; jacobian.n_entries()];
        program.jacobian(w, &mut slopes);
        for (row, y) in y.iter().enumerate() {
            for place in jacobian.starts[row]..jacobian.starts[row + 1] {
                gradient[jacobian.columns[place] as usize] += y * slopes[place];
            }
        }
        gradient
    };
    for column in 0..w.len() {
        let at = |h: f64| {
            let mut w = w.clone();
            w[column] += h;
            lagrangian(&w)
        };
        for row in column..w.len() {
            let exact = difference(1e-3, |h| at(h)[row]);
            let place = pattern.place(row, column as u32);
            let found = place.map_or(0.0, |place| entries[place]);
            assert!(
                (found - exact).abs() < 1e-10,
                "{row}, {column}: {found} is not {exact}"
            );
        }
    }
    assert!((0..w.len()).all(|row| pattern.row(row).iter().all(|&c| c as usize <= row)));
}

#[test]
fn evaluation_allocates_nothing() {
    let mut program = program();
    let w = program.start().to_vec();
    let y = vec![1.0; program.n_rows()];
    let (n, m) = (program.n_variables(), program.n_rows());
    let sizes = (
        program.jacobian_pattern().n_entries(),
        program.hessian_pattern().n_entries(),
    );
    let (mut gradient, mut rows) = (vec![0.0; n], vec![0.0; m]);
    let (mut slopes, mut curvature) = (vec![0.0; sizes.0], vec![0.0; sizes.1]);
    let count = allocation_counter::measure(|| {
        program.objective(&w);
        program.gradient(&w, &mut gradient);
        program.rows(&w, &mut rows);
        program.jacobian(&w, &mut slopes);
        program.hessian(&w, 1.0, &y, &mut curvature);
    });
    assert_eq!(count.count_total, 0);
}

#[test]
fn a_program_may_be_empty() {
    let mut program = Program::builder(&[], &[], &[]).finish();
    assert_eq!(program.objective(&[]), 0.0);
    program.hessian(&[], 1.0, &[], &mut []);
    assert!(!program.settle(Some(&[] as &[Member])));
    assert_eq!(program.pairs(), []);
    assert_eq!(program.jacobian_pattern().n_rows(), 0);
}

#[test]
fn a_block_without_places_has_no_rows() {
    let mut program = Program::builder(&[0.0], &[1.0], &[0.5]);
    let block = Block {
        values: tape(2, |b, x| vec![b.mul(x[0], x[1])]),
        n_places: 0,
        variables: vec![],
        numbers: vec![],
        parameters: vec![],
    };
    assert!(program.rows(block, &[], &[]).is_empty());
    let mut program = program.finish();
    program.rows(&[0.5], &mut []);
    program.jacobian(&[0.5], &mut []);
}

/// A term that is out of the objective leaves neither values nor derivatives, constant ones included.
#[test]
fn a_term_may_be_taken_out() {
    let block = |values, variable| Block {
        values,
        n_places: 1,
        variables: vec![variable],
        numbers: vec![],
        parameters: vec![],
    };
    let mut program = Program::builder(&[0.0; 2], &[9.0; 2], &[1.0; 2]);
    program.objective(block(tape(1, |b, x| vec![b.square(x[0])]), 0));
    let linear = program.objective(block(tape(1, |b, x| vec![b.add(x[0], x[0])]), 1));
    let cube = program.objective(block(tape(1, |b, x| vec![b.powi(x[0], 3)]), 1));
    let mut program = program.finish();
    let w = [3.0, 2.0];
    let all = |program: &mut Program| {
        let (mut gradient, mut hessian) = ([0.0; 2], [0.0; 2]);
        program.gradient(&w, &mut gradient);
        program.hessian(&w, 1.0, &[], &mut hessian);
        (program.objective(&w), gradient, hessian)
    };
    assert_eq!(all(&mut program), (21.0, [6.0, 14.0], [2.0, 12.0]));
    program.weight_term(cube, 0.0);
    assert_eq!(all(&mut program), (13.0, [6.0, 2.0], [2.0, 0.0]));
    program.weight_term(linear, 0.0);
    program.weight_term(linear, 0.0);
    assert_eq!(all(&mut program), (9.0, [6.0, 0.0], [2.0, 0.0]));
    program.weight_term(linear, 1.0);
    program.weight_term(cube, 0.5);
    assert_eq!(all(&mut program), (17.0, [6.0, 8.0], [2.0, 6.0]));
    program.weight_term(linear, 2.0);
    assert_eq!(all(&mut program), (21.0, [6.0, 10.0], [2.0, 6.0]));
    program.weight_term(linear, 1.0);
    program.weight_term(cube, 1.0);
    assert_eq!(all(&mut program), (21.0, [6.0, 14.0], [2.0, 12.0]));
}

/// Values and derivatives with another parameter are those of a program that is built with it: e^(p x) + p x as a row and
/// p x as a term, of which some slopes do not depend on x.
#[test]
fn parameters_may_have_other_values() {
    let built = |p: f64| {
        let mut program = Program::builder(&[0.0; 2], &[9.0; 2], &[1.0; 2]);
        program.parameters(&[7.0, p]);
        let block = |values, variable| Block {
            values,
            n_places: 1,
            variables: vec![variable],
            numbers: vec![],
            parameters: vec![1],
        };
        let row = tape(2, |b, x| {
            let product = b.mul(x[0], x[1]);
            let exp = b.exp(product);
            vec![product, b.add(exp, product)]
        });
        program.rows(block(row, 0), &[0.0; 2], &[0.0; 2]);
        let term = program.objective(block(tape(2, |b, x| vec![b.mul(x[0], x[1])]), 1));
        (program.finish(), term)
    };
    let all = |program: &mut Program| {
        let w = [0.5, 2.0];
        let (mut rows, mut slopes) = ([0.0; 2], [0.0; 2]);
        let (mut gradient, mut hessian) = ([0.0; 2], [0.0; 1]);
        program.rows(&w, &mut rows);
        program.jacobian(&w, &mut slopes);
        program.gradient(&w, &mut gradient);
        program.hessian(&w, 1.0, &[1.0, 2.0], &mut hessian);
        (rows, slopes, gradient, hessian, program.objective(&w))
    };
    let ((mut program, term), (mut other, _)) = (built(3.0), built(-0.5));
    assert_ne!(all(&mut program), all(&mut other));
    program.set_parameters(&[7.0, -0.5]);
    assert_eq!(all(&mut program), all(&mut other));
    // A term that is out stays out, and comes back with the parameter that there is.
    program.weight_term(term, 0.0);
    program.set_parameters(&[7.0, 3.0]);
    let mut gradient = [0.0; 2];
    program.gradient(&[0.5, 2.0], &mut gradient);
    assert_eq!(gradient, [0.0; 2]);
    program.weight_term(term, 1.0);
    assert_eq!(all(&mut program), all(&mut built(3.0).0));
}
