//! Switching functions that stay as they are while others slide.
//!
//! Where the rate of ψ_i is a multiple of ψ_j whatever z is, as that of a frozen gap is one of the speed of its contact,
//! sliding on ψ_j = 0 keeps ψ_i.

use super::complementarity::Lowering;
use crate::expr::{Evaluator, Expr, Var, variables_of};

/// Points of ψ_j = 0 where the rate is looked at.
const N_POINTS: usize = 3;

/// Newton iterations to such a point.
const ITERATIONS: usize = 30;

/// A rate this much smaller than its terms is rounding.
const ROUNDING: f64 = 1e-13;

impl<'e> Lowering<'e> {
    /// All (i, j) for which the rate of ψ_i is a multiple of ψ_j.
    pub(crate) fn followers(&self, surfaces: &[Expr<'e>]) -> Vec<(usize, usize)> {
        let is_input =
            |var: &Var| *var == self.time || self.states.contains(var) || self.is_open(*var);
        let plain = |psi: &Expr<'e>| variables_of(&[*psi]).iter().all(is_input);
        let surfaces = || surfaces.iter().enumerate();
        let surfaces = || surfaces().filter(|(_, psi)| plain(psi));
        let mut found = Vec::new();
        for (i, &psi) in surfaces() {
            let rate = self.along(psi, &variables_of(&[psi]));
            let below = variables_of(&[rate]);
            for (j, &other) in surfaces() {
                let vars = variables_of(&[other]);
                let may = i != j && vars.iter().all(|var| below.contains(var));
                if may && vanishes_on(rate, other, &vars) {
                    found.push((i, j));
                }
            }
        }
        found
    }
}

/// Whether e is zero at points of ψ = 0, next to its terms Σ |v ∂e/∂v|.
fn vanishes_on(e: Expr, psi: Expr, vars: &[Var]) -> bool {
    (0..N_POINTS).all(|k| {
        let mut vars = vars.iter().copied();
        vars.any(|var| vanishes_at_root(e, psi, var, k))
    })
}

/// The same at the k-th point, moved to the surface along one variable.
fn vanishes_at_root(e: Expr, psi: Expr, var: Var, k: usize) -> bool {
    /// Multiples of these modulo 1 are spread evenly (Roberts 2018).
    const SPREAD: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];
    let place = |other: Var| {
        let share = SPREAD[0] * (1.0 + other.index() as f64) + SPREAD[1] * (1.0 + k as f64);
        0.1 + 0.8 * share.fract()
    };
    let terms: Vec<(Var, Evaluator)> = (variables_of(&[e]).into_iter())
        .map(|var| (var, Evaluator::new(e.diff(var))))
        .collect();
    let [e, psi, slope] = [e, psi, psi.diff(var)].map(Evaluator::new);
    let start = place(var);
    let value = |other: Var, x: f64| if other == var { x } else { place(other) };
    let at = |f: &Evaluator, x: f64| f.eval(&|other| value(other, x));
    let mut x = start;
    for _ in 0..ITERATIONS {
        x -= at(&psi, x) / at(&slope, x);
    }
    let (on, off) = (at(&e, x), at(&e, start));
    let terms = terms.iter();
    let terms = terms.map(|(other, slope)| (at(slope, x) * value(*other, x)).abs());
    x.is_finite() && off.is_finite() && off != 0.0 && on.abs() <= ROUNDING * terms.sum::<f64>()
}
