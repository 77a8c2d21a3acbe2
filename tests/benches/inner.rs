//! Inner loops of the solver alone: tapes, series, linear complementarity, factorization.

use std::hint::black_box;

use criterion::Criterion;
use nsd_solver::linalg::DenseLu;
use nsd_solver::linalg::ldl::SparseLdl;
use nsd_solver::linalg::symmetric::KktSolver;
use nsd_solver::optimization::lcp::Lemke;
use nsd_solver::optimization::problem::Pattern;
use nsd_solver::tape::{Jet, Tape};

/// Orders of a series, and unknowns of what is solved.
const ORDER: usize = 20;
const UNKNOWNS: usize = 20;
/// Points of a tape at once.
const POINTS: usize = 64;
/// Blocks of a banded matrix, as control intervals make one.
const BLOCKS: usize = 200;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    tapes(&mut criterion);
    linear(&mut criterion);
    sparse(&mut criterion);
    criterion.final_summary();
}

/// The cart-pole's accelerations: a dozen operations with a sine, a cosine and a quotient.
fn accelerations() -> Tape {
    let mut tape = Tape::builder(3);
    let [angle, speed, force] = [0, 1, 2].map(|k| tape.input(k));
    let (sin, cos) = tape.sin_cos(angle);
    let square = tape.mul(speed, speed);
    let pull = tape.mul(sin, square);
    let pull = tape.add_scaled(force, 0.1, pull);
    let weight = tape.mul(sin, cos);
    let pull = tape.add_scaled(pull, 0.981, weight);
    let sin_square = tape.mul(sin, sin);
    let share = tape.scale(0.1, sin_square);
    let mass = tape.offset(1.0, share);
    let cart = tape.div(pull, mass);
    let turn = tape.mul(cart, cos);
    let turn = tape.add_scaled(turn, 9.81, sin);
    tape.finish(&[cart, turn])
}

fn tapes(criterion: &mut Criterion) {
    let tape = accelerations();
    let (mut scratch, mut outputs) = (tape.scratch(), [0.0; 2]);
    criterion.bench_function("tape at a point", |bencher| {
        bencher.iter(|| tape.eval(black_box(&[0.3, 1.2, 0.5]), &mut outputs, &mut scratch));
    });
    let inputs: Vec<f64> = (0..3 * POINTS).map(|k| 0.01 * k as f64).collect();
    let (mut lanes, mut many) = (tape.lane_scratch(), vec![0.0; 2 * POINTS]);
    criterion.bench_function("tape at 64 points, in lanes", |bencher| {
        bencher.iter(|| tape.eval_many(black_box(&inputs), &mut many, POINTS, &mut lanes));
    });
    let mut jet = Jet::new(&tape, ORDER);
    for input in 0..3 {
        for k in 0..=ORDER {
            jet.set_input(input, k, 0.7_f64.powi((k + input) as i32));
        }
    }
    criterion.bench_function("series of order 20, order by order", |bencher| {
        bencher.iter(|| (0..=ORDER).for_each(|k| black_box(&mut jet).advance(k)));
    });
    criterion.bench_function("series of order 20, all at once", |bencher| {
        bencher.iter(|| black_box(&mut jet).fill());
    });
}

/// A matrix that looks random, is always the same, and has a large diagonal.
fn matrix(n: usize) -> Vec<f64> {
    let scatter = |k: usize| (43_758.545 * (12.9898 * (k as f64 + 1.0)).sin()).fract();
    let entry = |k: usize| {
        scatter(k)
            + if k.is_multiple_of(n + 1) {
                n as f64
            } else {
                0.0
            }
    };
    (0..n * n).map(entry).collect()
}

fn linear(criterion: &mut Criterion) {
    let (m, cover) = (matrix(UNKNOWNS), vec![1.0; UNKNOWNS]);
    let q: Vec<f64> = (0..UNKNOWNS)
        .map(|k| if k % 3 == 0 { 1.0 } else { -1.0 })
        .collect();
    let mut lemke = Lemke::default();
    criterion.bench_function("Lemke's method, 20 unknowns", |bencher| {
        bencher.iter(|| lemke.solve(black_box(&m), &q, &cover).is_ok());
    });
    let mut lu = DenseLu::new(UNKNOWNS);
    let mut rhs = q.clone();
    criterion.bench_function("dense factors and a solution, 20 unknowns", |bencher| {
        bencher.iter(|| {
            rhs.copy_from_slice(&q);
            lu.factor(black_box(&m)).is_ok().then(|| lu.solve(&mut rhs))
        });
    });
}

/// The lower triangle of dense blocks of five along the diagonal, each coupled with the one before.
fn banded() -> (Pattern, Vec<f64>) {
    const SIZE: usize = 5;
    let (mut pattern, mut values) = (
        Pattern {
            starts: vec![0],
            columns: Vec::new(),
        },
        Vec::new(),
    );
    for row in 0..SIZE * BLOCKS {
        let first = (row / SIZE).saturating_sub(1) * SIZE;
        for column in first..=row {
            pattern.columns.push(column as u32);
            let sign = if row % SIZE < 3 { 1.0 } else { -1.0 };
            values.push(if column == row {
                20.0 * sign
            } else {
                1.0 / (1 + row - column) as f64
            });
        }
        pattern.starts.push(pattern.columns.len());
    }
    (pattern, values)
}

fn sparse(criterion: &mut Criterion) {
    let (pattern, values) = banded();
    let mut ldl = SparseLdl::new(&pattern, &[]);
    let mut rhs = vec![1.0; pattern.n_rows()];
    criterion.bench_function("sparse LDL', 200 blocks of 5", |bencher| {
        bencher.iter(|| ldl.factor(black_box(&values)).is_ok());
    });
    criterion.bench_function("a solution with its factors", |bencher| {
        bencher.iter(|| {
            rhs.fill(1.0);
            ldl.solve(black_box(&mut rhs));
        });
    });
}
