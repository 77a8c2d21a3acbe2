//! The step (Heaviside) reformulation: System -> Dcs.
//!
//! α_i ∈ argmin -ψ_i α over [0, 1] is α_i ∈ step(ψ_i); the KKT conditions of all these programs replace the switches:
//!
//! x' = f(t, x, α),   0 = ψ - λᵖ + λⁿ,   0 <= λⁿ ⟂ α >= 0,   0 <= λᵖ ⟂ 1 - α >= 0
//!
//! so that λᵖ = max(ψ, 0) and λⁿ = max(-ψ, 0) are continuous. A constraint ψ ≥ 0 of a projection, whose α has any value up
//! to 1, is stated by its force λ = 1 - α: 0 = ψ - c, 0 <= c ⟂ λ >= 0 (a gradient complementarity system). The two
//! switches of a slip velocity with two entries are a point u = 2α - 1 of the unit disc, see [`super::Disc`]. Algebraic
//! states stay states with a rate of their own, z' = w: an equation is 0 = ψ, and a pair 0 = a - ψ_a, 0 = b - ψ_b,
//! 0 <= a ⟂ b >= 0, which determine z in every point and w by that. The weight of a region is a product of α and 1 - α
//! over the signs that its guard fixes; products become variables β, see `lift`.
//!
//! A switch that is read nonlinearly keeps the α that the rates hold, in powers or under functions: where it slides, α is
//! one of the solutions of φ = ∇ψ·f(t, x, α) + ∂ψ/∂t = 0, and the conditions do not say which. Those that attract have
//! ∂φ/∂α < 0, for each switch taken alone, see [`super::Branch`].
//!
//! Acary, de Jong & Brogliato 2014; Nurkanović et al. 2024. The set of rates is the multi-affine one of Dieci & Lopez
//! 2011: it is Filippov's for one surface and for switches that only add up, else a subset.

use crate::expr::{Expr, Substitution, variables_of};
use crate::system::{Role, Switch, System};

use super::lift::{Lift, Product};
use super::pointwise::Sides;
use super::{Algebraic, Branch, Cause, Dcs, Disc, Formulation, Origin, labels};
use nsd_solver::fesd::{Rule, Rules};

/// α of every switch, and its multipliers: λᵖ and λⁿ, c and λ, or |w| and 1 - |u|².
struct Declared<'e> {
    alphas: Vec<Expr<'e>>,
    multipliers: Vec<(Expr<'e>, Expr<'e>)>,
}

/// Declares α, λᵖ and λⁿ per switch, |w| and 1 - |u|² per disc, and one β per product of α.
pub fn lower<'e>(system: &System<'e>) -> Dcs<'e> {
    let mut dcs = Dcs::frame(system, Formulation::Step);
    let labels = labels::of(system);
    let declared = declare(system, &labels, &mut dcs);
    let alphas = &declared.alphas;

    // Rates and ψ, affine in α and β. A rate that all regions share does not switch.
    let rename: Substitution = (system.switches.iter().zip(alphas))
        .filter_map(|(switch, &alpha)| Some((switch.alpha.as_variable()?, alpha)))
        .collect();
    let rates = system
        .states
        .iter()
        .map(|state| without_idle(system, state.rate));
    let psi = system.switches.iter().map(|switch| switch.psi);
    let rows: Vec<Expr> = rates.chain(psi).map(|e| e.substitute(&rename)).collect();
    let zero = system.exprs.constant(0.0);
    let beta = labels::prefix(system, "beta");
    // Powers of what is read nonlinearly stay.
    let lifted = alphas.iter().zip(&system.switches);
    let lifted = lifted.map(|(&alpha, switch)| if switch.is_nonlinear { zero } else { alpha });
    let mut lift = Lift::new(system.exprs, lifted.collect(), labels, beta);
    let mut rates = lift.lift(&rows);
    let psi = rates.split_off(system.states.len());
    dcs.rows.rates = rates;
    dcs.switches.branches = branches(system, &dcs, &psi, alphas);
    relate(system, &psi, &declared, &mut dcs);
    define(system, lift.products, &mut dcs);
    dcs.switches.alphas = declared.alphas;
    dcs
}

/// Declares the algebraic variables of all switches, in the order of [`rules`].
fn declare<'e>(system: &System<'e>, labels: &[String], dcs: &mut Dcs<'e>) -> Declared<'e> {
    let start = Sides::at_start(system);
    let guesses = rules(system).values(&start.psi, &start.alpha);
    let mut guesses = guesses.into_iter();
    let mut guess = || guesses.next().unwrap_or(0.0);

    let [alpha, lambda_p, lambda_n] =
        ["alpha", "lambda_p", "lambda_n"].map(|word| labels::prefix(system, word));
    let [gap, force, rate, slip, stick] =
        ["gap", "force", "rate", "slip", "stick"].map(|word| labels::prefix(system, word));
    let zero = system.exprs.constant(0.0);
    let mut alphas = Vec::with_capacity(labels.len());
    let mut multipliers = Vec::with_capacity(labels.len());
    for (k, (label, switch)) in labels.iter().zip(&system.switches).enumerate() {
        match switch.role {
            Role::Step => {}
            Role::Equation => {
                alphas.push(dcs.algebraic(&format!("{rate}[{label}]"), guess()));
                multipliers.push((zero, zero));
                continue;
            }
            // The first member has the rate of both.
            Role::Member(other) => {
                let is_first = alphas.len() < other;
                alphas.push(match is_first {
                    true => dcs.algebraic(&format!("{rate}[{label}]"), guess()),
                    false => zero,
                });
                let gap = dcs.multiplier(&format!("{gap}[{label}]"), guess());
                multipliers.push((gap, zero));
                continue;
            }
        }
        if switch.unilateral {
            let force = dcs.algebraic(&format!("{force}[{label}]"), guess());
            let gap = dcs.multiplier(&format!("{gap}[{label}]"), guess());
            alphas.push(1.0 - force);
            multipliers.push((gap, force));
            continue;
        }
        alphas.push(dcs.algebraic(&format!("{alpha}[{label}]"), guess()));
        if let Some(other) = switch.across {
            // The first of both has what they share.
            multipliers.push(match k < other {
                true => {
                    let label = labels::of_disc(system, labels, k);
                    let slip = dcs.multiplier(&format!("{slip}[{label}]"), guess());
                    let stick = dcs.algebraic(&format!("{stick}[{label}]"), guess());
                    (slip, stick)
                }
                false => multipliers[other],
            });
            continue;
        }
        let lambda_p = dcs.multiplier(&format!("{lambda_p}[{label}]"), guess());
        let lambda_n = dcs.multiplier(&format!("{lambda_n}[{label}]"), guess());
        multipliers.push((lambda_p, lambda_n));
    }
    Declared {
        alphas,
        multipliers,
    }
}

/// States the conditions of all switches with these ψ.
fn relate<'e>(
    system: &System<'e>,
    psi: &[Expr<'e>],
    Declared {
        alphas,
        multipliers,
    }: &Declared<'e>,
    dcs: &mut Dcs<'e>,
) {
    let places = places(system);

    for (k, (&psi, &alpha)) in psi.iter().zip(alphas).enumerate() {
        let (lambda_p, lambda_n) = multipliers[k];
        let origin = origin(system, k, Cause::Switch(k));
        match system.switches[k].role {
            Role::Step => {}
            Role::Equation => {
                dcs.equation(psi, origin);
                continue;
            }
            Role::Member(other) => {
                let (gap, _) = multipliers[k];
                dcs.equation(-psi - gap, origin);
                if other < k {
                    dcs.pair(multipliers[other].0, gap, origin);
                }
                continue;
            }
        }
        if system.switches[k].unilateral {
            let (gap, force) = (lambda_p, lambda_n);
            dcs.equation(psi - gap, origin);
            dcs.pair(gap, force, origin);
            continue;
        }
        if let Some(other) = system.switches[k].across {
            let (slip, stick) = (lambda_p, lambda_n);
            dcs.equation(psi - slip * (2.0 * alpha - 1.0), origin);
            if other < k {
                let inside = [alphas[other], alpha].map(|alpha| (2.0 * alpha - 1.0).powi(2));
                dcs.equation(1.0 - inside[0] - inside[1] - stick, origin);
                dcs.pair(slip, stick, origin);
                dcs.switches.discs.push(Disc {
                    switches: [other, k],
                    alphas: [places[other], places[k]],
                    slip: places[other] + 1,
                    stick: places[other] + 2,
                });
            }
            continue;
        }
        dcs.equation(psi - lambda_p + lambda_n, origin);
        dcs.pair(lambda_n, alpha, origin);
        dcs.pair(lambda_p, 1.0 - alpha, origin);
    }
}

/// Declares β of products, and says what they are.
fn define<'e>(system: &System<'e>, products: Vec<Product<'e>>, dcs: &mut Dcs<'e>) {
    for product in products {
        let (left, right) = product.factors;
        let subsystem = system
            .coupling
            .subsystems
            .iter()
            .position(|s| s.switches.contains(&product.switch));
        let cause = Cause::Product(subsystem.unwrap_or(0));
        dcs.equation(
            product.beta - left * right,
            origin(system, product.switch, cause),
        );
        let value = (left * right).eval(&|var| {
            let known = dcs
                .algebraics
                .iter()
                .find(|z| z.var.as_variable() == Some(var));
            known.map_or(f64::NAN, |z| z.guess)
        });
        dcs.algebraics.push(Algebraic {
            var: product.beta,
            guess: if value.is_finite() { value } else { 0.0 },
            continuous: false,
        });
    }
}

/// What tells the sliding modes of nonlinear switches apart, for the rates of a system with these ψ and α.
fn branches<'e>(
    system: &System<'e>,
    dcs: &Dcs<'e>,
    psi: &[Expr<'e>],
    alphas: &[Expr<'e>],
) -> Vec<Branch<'e>> {
    let nonlinear = (0..psi.len()).filter(|&k| system.switches[k].is_nonlinear);
    let branch = |k: usize| {
        let alpha = alphas[k];
        let var = alpha.as_variable()?;
        let inside = variables_of(&[psi[k]]);
        let states = dcs.states.iter().map(|state| state.var.as_variable());
        let terms = states.zip(&dcs.rows.rates).filter_map(|(state, rate)| {
            let state = state.filter(|state| inside.binary_search(state).is_ok())?;
            Some(psi[k].diff(state) * rate.diff(var))
        });
        Some(Branch {
            switch: k,
            alpha,
            stability: system.exprs.sum(terms),
            origin: origin(system, k, Cause::Switch(k)),
        })
    };
    nonlinear.filter_map(branch).collect()
}

/// The rate without those α that do not change it: x α + x (1 - α) is x.
fn without_idle<'e>(system: &System<'e>, rate: Expr<'e>) -> Expr<'e> {
    let present = variables_of(&[rate]);
    let alphas = system
        .switches
        .iter()
        .filter_map(|switch| switch.alpha.as_variable());
    let idle = alphas.filter(|alpha| present.contains(alpha) && rate.diff(*alpha).is_zero());
    let zero = system.exprs.constant(0.0);
    rate.substitute(&idle.map(|alpha| (alpha, zero)).collect())
}

/// Where the variables of every switch begin, in the order in which [`declare`] takes them.
pub(crate) fn places(system: &System) -> Vec<usize> {
    let width = |(k, switch): (usize, &Switch)| match (switch.role, switch.across) {
        (Role::Equation, _) => 1,
        (Role::Member(other), _) => 1 + usize::from(k < other),
        (Role::Step, Some(other)) => 1 + 2 * usize::from(k < other),
        (Role::Step, None) => 3 - usize::from(switch.unilateral),
    };
    let widths = system.switches.iter().enumerate().map(width);
    let starts = widths.scan(0, |next, width| {
        *next += width;
        Some(*next - width)
    });
    starts.collect()
}

/// α, λᵖ and λⁿ of every switch, or its force and c, in the order in which [`declare`] takes them.
pub(crate) fn rules(system: &System) -> Rules {
    let mut rules = Rules::default();
    for (k, switch) in system.switches.iter().enumerate() {
        let own = match (switch.role, switch.across) {
            (Role::Equation, _) => vec![Rule::Zero],
            (Role::Member(other), _) if k < other => vec![Rule::Zero, Rule::Below(k)],
            (Role::Member(_), _) => vec![Rule::Below(k)],
            (Role::Step, Some(other)) if k < other => {
                let both = [k, other];
                vec![Rule::Alpha(k), Rule::Speed(both), Rule::Inside(both)]
            }
            (Role::Step, Some(_)) => vec![Rule::Alpha(k)],
            (Role::Step, None) if switch.unilateral => vec![Rule::Force(k), Rule::Above(k)],
            (Role::Step, None) => vec![Rule::Alpha(k), Rule::Above(k), Rule::Below(k)],
        };
        rules.z.extend(own);
    }
    rules
}

fn origin(system: &System, switch: usize, cause: Cause) -> Origin {
    let switch = &system.switches[switch];
    Origin {
        cause,
        continuous: switch.continuity.is_continuous(),
        span: switch.spans.first().copied().unwrap_or_default(),
    }
}
