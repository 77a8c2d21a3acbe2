//! Any bytes are a program that can be evaluated with its derivatives, or are refused.
#![no_main]

use libfuzzer_sys::fuzz_target;
use nsd_solver::optimization::nl;
use nsd_solver::optimization::problem::Nlp;

fuzz_target!(|bytes: &[u8]| {
    let Ok(mut problem) = nl::read(bytes) else {
        return;
    };
    let program = &mut problem.program;
    let w = program.start().to_vec();
    assert_eq!(w.len(), program.n_variables());
    program.objective(&w);
    let mut rows = vec![0.0; program.n_rows()];
    program.rows(&w, &mut rows);
    let mut gradient = vec![0.0; w.len()];
    program.gradient(&w, &mut gradient);
    let mut jacobian = vec![0.0; program.jacobian_pattern().n_entries()];
    program.jacobian(&w, &mut jacobian);
    let mut hessian = vec![0.0; program.hessian_pattern().n_entries()];
    program.hessian(&w, 1.0, &rows, &mut hessian);
});
