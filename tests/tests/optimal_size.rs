//! What a longer optimal control problem needs: everything grows in proportion to the number of intervals.

use nsd_solver::optimization::mpcc;
use nsd_solver::optimization::mpcc::Options;
use nsd_solver::optimization::problem::{Mpcc, Nlp};
use nsd_tests::with_experiment;
use nsdc::optimize;

const CART: &str = include_str!("../../examples/cart_pole.nsd");

/// What memory and the time of an iteration consist of.
#[derive(Clone, Copy, Debug)]
struct Size {
    variables: usize,
    rows: usize,
    pairs: usize,
    /// Entries of the Jacobian and of the Hessian.
    derivatives: usize,
    /// Entries of the triangular factor.
    factor: usize,
}

/// The cart-pole with so many intervals.
fn size(intervals: usize, horizon: &str) -> Size {
    let text = format!(
        "{CART}
         optimize sized of cart_pole {{
           {horizon}; intervals {intervals}; elements 2; scheme radau_iia(2);
           minimize integral(p^2 + (a - pi)^2 + u^2) + final(v^2 + w^2);
         }}"
    );
    with_experiment(&text, "sized", |compiled| {
        let task = compiled.settings.optimize.as_ref().expect("a task");
        let mpcc = optimize::program(&compiled.system, &compiled.settings, task, &[]);
        let mut program = mpcc
            .expect("it fits into memory")
            .program()
            .expect("kernels are smooth");
        // One iteration factors once.
        let options = Options {
            iterations: mpcc::Iterations {
                run: 1,
                ..mpcc::Iterations::default()
            },
            max_restarts: 0,
            ..Options::default()
        };
        let solution = mpcc::solve(&mut program, &options);
        Size {
            variables: program.n_variables(),
            rows: program.n_rows(),
            pairs: program.pairs().len(),
            derivatives: program.jacobian_pattern().n_entries()
                + program.hessian_pattern().n_entries(),
            factor: solution.stats.factor_entries,
        }
    })
}

/// From n to 2n to 4n intervals, what is exactly in proportion grows by the same per interval.
fn is_affine([one, two, four]: [usize; 3]) -> bool {
    four - two == 2 * (two - one)
}

/// Factors depend on an order that is only nearly best, so their growth is in proportion but for a tenth.
#[track_caller]
fn grows_in_proportion(horizon: &str) {
    let sizes: [Size; 3] = [25, 50, 100].map(|intervals| size(intervals, horizon));
    let counted = |s: &Size| [s.variables, s.rows, s.pairs, s.derivatives];
    let [one, two, four] = sizes.each_ref().map(counted);
    for part in 0..one.len() {
        assert!(
            is_affine([one, two, four].map(|counts| counts[part])),
            "{sizes:?}"
        );
    }
    let factor = |i: usize| sizes[i].factor as f64;
    let growth = (factor(2) - factor(1)) / (2.0 * (factor(1) - factor(0)));
    assert!((0.9..1.1).contains(&growth), "by {growth}: {sizes:?}");
}

#[test]
fn sizes_are_in_proportion_to_intervals() {
    grows_in_proportion("horizon 5");
}

/// A parameter of all intervals is one column that is full.
#[test]
fn a_free_horizon_is_one_column_only() {
    grows_in_proportion("horizon free in [1, 9] = 5");
}
