//! The algebraic variables at one point.
//!
//! Off all surfaces a DCS determines z: the linear programs that it states have one solution there. On a surface this
//! takes the middle: α = 1/2, and the middle of a disc. It gives guesses, and the tests their reference.

use nsd_solver::fesd::{Rule, Rules, alpha_of, alphas_of};
use rustc_hash::FxHashMap;

use crate::expr::{Expr, Var};
use crate::system::{System, Valuation};

use super::{Dcs, Formulation, heaviside, stewart};

/// A point of the disc may be outside by so much.
const ROUNDING: f64 = 1e-6;

/// Values of the switching functions and of α at a point.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sides {
    /// ψ(t, x, p, α), and behind them the indicators of all partitions.
    pub psi: Vec<f64>,
    /// α = step(ψ), 1/2 on the surface; of a disc, 2α - 1 = w/|w|.
    pub alpha: Vec<f64>,
}

impl Sides {
    /// `value` gives time, data, parameters and states.
    pub fn at(system: &System, value: &impl Fn(Var) -> f64) -> Self {
        Sides::with(system, &[], value)
    }

    /// The same with some switches on sides that are given by their α.
    fn with(system: &System, known_sides: &[(usize, f64)], value: &impl Fn(Var) -> f64) -> Self {
        let mut known = FxHashMap::default();
        let mut sides = Sides {
            psi: Vec::new(),
            alpha: Vec::new(),
        };
        // ψ contains α of earlier switches only.
        for (k, switch) in system.switches.iter().enumerate() {
            let psi = eval(switch.psi, &known, value);
            if let Some(first) = switch.across.filter(|&other| other < k) {
                let [one, two] = alphas_of([sides.psi[first], psi]);
                let vars = [first, k].map(|k| system.switches[k].alpha.as_variable());
                let vars = vars.into_iter().zip([one, two]);
                known.extend(vars.filter_map(|(var, alpha)| Some((var?, alpha))));
                sides.alpha[first] = one;
                sides.psi.push(psi);
                sides.alpha.push(two);
                continue;
            }
            let given = known_sides.iter().find(|(switch, _)| *switch == k);
            let alpha = given.map_or_else(|| alpha_of(psi), |&(_, alpha)| alpha);
            if let Some(var) = switch.alpha.as_variable() {
                known.insert(var, alpha);
            }
            sides.psi.push(psi);
            sides.alpha.push(alpha);
        }
        let indicators = indicators(system).into_iter();
        let indicators = indicators.map(|g| eval(g, &known, value));
        sides.psi.extend(indicators);
        sides
    }

    /// At t = 0, with the system's parameters and initial values.
    pub fn at_start(system: &System) -> Self {
        let start = start(system);
        Sides::at(system, &|var| start.number(var))
    }
}

/// What regions are compared by, of all partitions.
pub fn indicators<'e>(system: &System<'e>) -> Vec<Expr<'e>> {
    let partitions = system.coupling.partitions.iter();
    partitions
        .flat_map(|partition| partition.indicators.iter().copied())
        .collect()
}

/// The algebraic variables of a lowering of `system` by ψ, with the indicators behind them, and α.
pub fn rules(system: &System, dcs: &Dcs) -> Rules {
    let mut rules = match dcs.lowering.formulation {
        Formulation::Stewart => stewart::rules(system),
        Formulation::Step => heaviside::rules(system),
    };
    // What is left are products, defined in order by the last equations: 0 = β - product.
    let n_products = dcs.algebraics.len() - rules.z.len();
    let n_rows = dcs.rows.equations.len();
    rules
        .z
        .extend((n_rows - n_products..n_rows).map(Rule::Product));
    rules
}

/// Parameters, states, time and data at t = 0.
fn start(system: &System) -> Valuation {
    let x: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
    system.valuation(0.0, &x, &[])
}

impl<'e> Dcs<'e> {
    /// Takes over the initial values of the system that this is a lowering of, and z there.
    pub fn restart(&mut self, system: &System<'e>) {
        for (own, state) in self.states.iter_mut().zip(&system.states) {
            own.initial = state.initial;
        }
        let start = start(system);
        let found = solve_pointwise(system, self, &|var| start.number(var));
        for (own, z) in self.algebraics.iter_mut().zip(found.algebraics) {
            own.guess = if z.is_finite() { z } else { 0.0 };
        }
    }
}

/// The solution of a [`Dcs`] at one point.
#[derive(Clone, Debug, PartialEq)]
pub struct Pointwise {
    /// Values of [`Dcs::algebraics`].
    pub algebraics: Vec<f64>,
    /// x'.
    pub rates: Vec<f64>,
    /// The largest |g|, |min(a, b)| over equations and pairs.
    pub residual: f64,
}

/// Solves `dcs`, a lowering of `system`, where `value` gives time, data, parameters and states.
pub fn solve_pointwise<'e>(
    system: &System<'e>,
    dcs: &Dcs<'e>,
    value: &impl Fn(Var) -> f64,
) -> Pointwise {
    solve_with(system, dcs, &Sides::at(system, value), value)
}

/// The same in a mode that is given by α.
pub fn solve_in_mode<'e>(
    system: &System<'e>,
    dcs: &Dcs<'e>,
    alphas: &[f64],
    value: &impl Fn(Var) -> f64,
) -> Pointwise {
    let led: Vec<(usize, f64)> = (dcs.switches.leading.iter())
        .map(|&switch| (switch, alphas[switch]))
        .collect();
    let sides = Sides {
        alpha: alphas.to_vec(),
        ..Sides::with(system, &led, value)
    };
    solve_with(system, dcs, &sides, value)
}

/// α of a run, which has the sides of what slips in a plane, with the direction of slip at a point near by: where w
/// comes to zero, its direction is that before. So have slips of open contacts, which are `idle`.
pub fn directed(system: &System, alphas: &mut [f64], idle: &[usize], near: &impl Fn(Var) -> f64) {
    let given = alphas.to_vec();
    let slips = |k: usize, other: usize| {
        let inside = [k, other].map(|k| 2.0 * given[k] - 1.0);
        inside[0].hypot(inside[1]) > 1.0 + ROUNDING
    };
    let across = |k: usize| system.switches[k].across;
    let slipping: Vec<usize> = (0..given.len())
        .filter(|&k| across(k).is_some_and(|other| slips(k, other)))
        .chain(idle.iter().copied())
        .collect();
    if slipping.is_empty() {
        return;
    }
    let there = Sides::at(system, near);
    for k in slipping {
        alphas[k] = there.alpha[k];
    }
}

/// The same for given α, which need not be those of the point.
pub(crate) fn solve_with<'e>(
    system: &System<'e>,
    dcs: &Dcs<'e>,
    sides: &Sides,
    value: &impl Fn(Var) -> f64,
) -> Pointwise {
    let mut known: FxHashMap<Var, f64> = FxHashMap::default();
    let declared = || dcs.algebraics.iter().filter_map(|z| z.var.as_variable());
    let rules = rules(system, dcs);
    known.extend(declared().zip(rules.values(&sides.psi, &sides.alpha)));
    for (var, rule) in declared().zip(&rules.z) {
        if let Rule::Product(row) = *rule {
            let product = -eval(dcs.rows.equations[row], &known, value);
            known.insert(var, product);
        }
    }

    let at = |expr: Expr<'e>| eval(expr, &known, value);
    let equations = dcs.rows.equations.iter().map(|&row| at(row).abs());
    let pairs = dcs.rows.pairs.iter();
    let pairs = pairs.map(|pair| at(pair.left).min(at(pair.right)).abs());
    Pointwise {
        algebraics: dcs.algebraics.iter().map(|z| at(z.var)).collect(),
        rates: dcs.rows.rates.iter().map(|&rate| at(rate)).collect(),
        residual: equations.chain(pairs).fold(0.0, larger),
    }
}

/// The larger number; unlike `f64::max`, it keeps what is no number.
fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

fn eval(expr: Expr, known: &FxHashMap<Var, f64>, value: &impl Fn(Var) -> f64) -> f64 {
    expr.eval(&|var| known.get(&var).copied().unwrap_or_else(|| value(var)))
}
