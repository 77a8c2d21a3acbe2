//! KKT systems of optimal control: our sparse factors beside faer's, in microseconds.
//!
//! ( H + ρ   Jᵀ )
//! ( J      -δ  ) of the cart-pole with 100, 1000 and 4000 intervals, where it starts. Numbers behind the name of the
//! bench are taken instead of these sizes.

use std::time::Instant;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side, Spec};
use nsd_solver::linalg::ldl::SparseLdl;
use nsd_solver::linalg::matching::{self, Weights, matching};
use nsd_solver::linalg::symmetric::KktSolver;
use nsd_solver::optimization::problem::{Nlp, Pattern};
use nsd_tests::with_experiment;
use nsdc::optimize;

const SIZES: [usize; 3] = [100, 1000, 4000];
const MODEL: &str = include_str!("../../examples/cart_pole.nsd");
/// ρ and δ.
const PRIMAL: f64 = 1e-2;
const DUAL: f64 = 1e-6;
/// Each step is timed for so many seconds.
const SECONDS: f64 = 0.5;

/// A symmetric matrix, its lower triangle row by row, and a column for each row of J.
struct System {
    pattern: Pattern,
    values: Vec<f64>,
    pairs: Vec<[u32; 2]>,
}

fn main() {
    let asked: Vec<usize> = std::env::args()
        .filter_map(|arg| arg.parse().ok())
        .collect();
    let sizes = if asked.is_empty() { &SIZES[..] } else { &asked };
    print("intervals  factors            entries of L   symbolic    numeric   solution  residuals");
    for &intervals in sizes {
        let system = system(intervals);
        system.ours(intervals, "ours", &[]);
        system.ours(intervals, "ours, pairs", &system.pairs);
        let thresholds = [
            ("faer, simplicial", SupernodalThreshold::FORCE_SIMPLICIAL),
            ("faer, supernodal", SupernodalThreshold::FORCE_SUPERNODAL),
        ];
        for (name, threshold) in thresholds {
            system.faer(intervals, name, threshold);
        }
    }
}

fn system(intervals: usize) -> System {
    let text = format!(
        "{MODEL}
         optimize sized of cart_pole {{
           horizon 5; intervals {intervals}; elements 2; scheme radau_iia(2);
           minimize integral(p^2 + (a - pi)^2 + u^2) + final(v^2 + w^2);
         }}"
    );
    with_experiment(&text, "sized", |compiled| {
        let task = compiled.settings.optimize.as_ref().expect("a task");
        let mpcc = optimize::program(&compiled.system, &compiled.settings, task, &[]);
        let program = mpcc.expect("it fits into memory").program();
        kkt(&mut program.expect("kernels are smooth"))
    })
}

fn kkt(program: &mut impl Nlp) -> System {
    let (n, m) = (program.n_variables(), program.n_rows());
    let w = program.start().to_vec();
    let (h, j) = (
        program.hessian_pattern().clone(),
        program.jacobian_pattern().clone(),
    );
    let (mut hessian, mut jacobian) = (vec![0.0; h.n_entries()], vec![0.0; j.n_entries()]);
    program.hessian(&w, 1.0, &vec![0.0; m], &mut hessian);
    program.jacobian(&w, &mut jacobian);
    let of = |pattern: &Pattern, first: usize| -> Vec<(u32, u32)> {
        let row = |row: usize| {
            let columns = pattern.row(row).iter();
            columns.map(move |&column| ((first + row) as u32, column))
        };
        (0..pattern.n_rows()).flat_map(row).collect()
    };
    let diagonal = (0..(n + m) as u32).map(|i| (i, i));
    let entries = [of(&h, 0), of(&j, n), diagonal.collect()].concat();
    let pattern = Pattern::new(n + m, entries.clone());
    let mut values = vec![0.0; pattern.n_entries()];
    let regularization = (0..n + m).map(|i| if i < n { PRIMAL } else { -DUAL });
    let numbers = hessian.iter().chain(&jacobian).copied();
    for ((row, column), number) in entries.into_iter().zip(numbers.chain(regularization)) {
        let place = pattern.place(row as usize, column);
        values[place.expect("the entry was put in")] += number;
    }
    let found = matching(&Weights {
        starts: &j
            .starts
            .iter()
            .map(|&start| start as u32)
            .collect::<Vec<_>>(),
        columns: &j.columns,
        weights: &jacobian.iter().map(|a| a.abs()).collect::<Vec<_>>(),
        n_columns: n,
    });
    let rows = found.into_iter().zip(n as u32..);
    System {
        pattern,
        values,
        pairs: rows
            .filter(|pair| pair.0 != matching::NONE)
            .map(|(column, row)| [column, row])
            .collect(),
    }
}

impl System {
    fn ours(&self, intervals: usize, name: &str, pairs: &[[u32; 2]]) {
        let mut ldl = SparseLdl::new(&self.pattern, pairs);
        let mut x = vec![0.0; self.pattern.n_rows()];
        let symbolic = time(|| ldl = SparseLdl::new(&self.pattern, pairs));
        let mut is_valid = false;
        let numeric = time(|| is_valid = ldl.factor(&self.values).is_ok());
        let solution = time(|| {
            x.fill(1.0);
            ldl.solve(&mut x);
        });
        if !is_valid {
            x.fill(f64::NAN);
        }
        self.line(
            intervals,
            name,
            ldl.n_entries(),
            [symbolic, numeric, solution],
            &x,
        );
    }

    fn faer(&self, intervals: usize, name: &str, threshold: SupernodalThreshold) {
        let n = self.pattern.n_rows();
        let starts: Vec<u32> = self.pattern.starts.iter().map(|&s| s as u32).collect();
        // Rows of the lower triangle are columns of the upper one.
        let pattern =
            SymbolicSparseColMatRef::new_checked(n, n, &starts, None, &self.pattern.columns);
        let matrix = SparseColMatRef::new(pattern, &self.values[..]);
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: threshold,
            ..CholeskySymbolicParams::default()
        };
        let analyze = || {
            factorize_symbolic_cholesky(pattern, Side::Upper, SymmetricOrdering::Amd, params)
                .expect("it fits into memory")
        };
        let mut symbols = analyze();
        let symbolic = time(|| symbols = analyze());
        let mut factors = vec![0.0; symbols.len_val()];
        let for_factors = symbols.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Spec::default());
        let for_solution = symbols.solve_in_place_scratch::<f64>(1, Par::Seq);
        let mut memory = MemBuffer::new(for_factors.or(for_solution));
        let mut is_valid = false;
        let numeric = time(|| {
            let (regularization, stack) = (Default::default(), MemStack::new(&mut memory));
            let spec = Spec::default();
            let found = symbols.factorize_numeric_ldlt(
                &mut factors,
                matrix,
                Side::Upper,
                regularization,
                Par::Seq,
                stack,
                spec,
            );
            is_valid = found.is_ok();
        });
        let mut x = vec![0.0; n];
        let solution = time(|| {
            x.fill(1.0);
            let rhs = MatMut::from_column_major_slice_mut(&mut x, n, 1);
            let stack = MemStack::new(&mut memory);
            LdltRef::new(&symbols, &factors).solve_in_place_with_conj(
                Conj::No,
                rhs,
                Par::Seq,
                stack,
            );
        });
        if !is_valid {
            x.fill(f64::NAN);
        }
        self.line(
            intervals,
            name,
            symbols.len_val(),
            [symbolic, numeric, solution],
            &x,
        );
    }

    /// Prints what was timed, and the sum of the residuals of A x = (1, 1, ...): NaN where a pivot was lost.
    fn line(&self, intervals: usize, name: &str, entries: usize, times: [f64; 3], x: &[f64]) {
        let mut residual = vec![-1.0; x.len()];
        for row in 0..x.len() {
            let values = &self.values[self.pattern.starts[row]..];
            for (&column, a) in self.pattern.row(row).iter().zip(values) {
                let column = column as usize;
                residual[row] += a * x[column];
                if column != row {
                    residual[column] += a * x[row];
                }
            }
        }
        let sum: f64 = residual.iter().map(|r| r.abs()).sum();
        let [symbolic, numeric, solution] = times;
        print(&format!(
            "{intervals:9}  {name:<17} {entries:>13} {symbolic:>10.0} {numeric:>10.1} {solution:>10.1}  {sum:.1e}"
        ));
    }
}

/// Microseconds of a call: the least of several groups of calls, whatever else the machine does.
fn time(mut call: impl FnMut()) -> f64 {
    let started = Instant::now();
    let mut least = f64::INFINITY;
    while started.elapsed().as_secs_f64() < SECONDS {
        let (group, mut count) = (Instant::now(), 0);
        while count == 0 || group.elapsed().as_secs_f64() < 1e-3 {
            call();
            count += 1;
        }
        least = least.min(group.elapsed().as_secs_f64() / f64::from(count));
    }
    1e6 * least
}

/// Benchmarks print their tables.
#[allow(clippy::print_stdout, reason = "a benchmark prints its table")]
fn print(text: &str) {
    println!("{text}");
}
