//! Impulses of contacts by the laws of Newton and of Poisson, with restitutions e.
//!
//! With the rates of gaps and slip velocities before as q, Newton's law is the contact problem with (1 + e) a in place of
//! the rates a of gaps: 0 ≤ Λ ⟂ a⁺ + e a⁻ ≥ 0. Poisson's law is that problem twice (Glocker & Pfeiffer 1995): compression
//! with e = 0, and expansion, which begins with its rates and has the share e of each of its impulses as λ₀.

use super::ladder;
use super::problem::{NoSolution, Problem, Solution};
use crate::hybrid::ImpactLaw;

impl ImpactLaw {
    /// Impulses with these restitutions; q is what rates are before, and becomes what they are without the last impulses.
    pub(crate) fn impulses(self, problem: &mut Problem, e: &[f64]) -> Result<Solution, NoSolution> {
        match self {
            ImpactLaw::Newton => by_newton(problem, e),
            ImpactLaw::Poisson => by_poisson(problem, e),
        }
    }
}

/// Impulses of Newton's law; q is what rates are before.
fn by_newton(problem: &mut Problem, e: &[f64]) -> Result<Solution, NoSolution> {
    let slips = problem.q[e.len()..].to_vec();
    for (speed, e) in problem.q.iter_mut().zip(e) {
        *speed *= 1.0 + e;
    }
    ladder::solve(problem, &slips)
}

/// The same of Poisson's law: those of compression and expansion together.
fn by_poisson(problem: &mut Problem, e: &[f64]) -> Result<Solution, NoSolution> {
    let slips = problem.q[e.len()..].to_vec();
    let compression = ladder::solve(problem, &slips)?;
    let given_back = compression.normal.iter().zip(e);
    problem.least = given_back.map(|(impulse, e)| e * impulse).collect();
    problem.q = [&compression.rates[..], &compression.slips].concat();
    let mut both = ladder::solve(problem, &compression.slips)?;
    let of_compression = compression.normal.iter().chain(&compression.tangential);
    for (sum, impulse) in (both.normal.iter_mut())
        .chain(&mut both.tangential)
        .zip(of_compression)
    {
        *sum += impulse;
    }
    both.residual = both.residual.max(compression.residual);
    Ok(both)
}
