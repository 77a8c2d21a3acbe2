//! What occurs where: which α in which rates and ψ, and what a change of one concerns.

use nsd_solver::hybrid::Input;
use rustc_hash::FxHashMap;

use super::substituted::variable;
use crate::expr::{self, Expr, Substitution, Var};
use crate::system::{Role, System};

/// Derivatives that are looked at for one that contains an α.
const MAX_DERIVATIVES: usize = 6;

/// The structure of x' = f, ψ.
pub(crate) struct Structure<'e> {
    /// Switches whose α is in a rate.
    pub in_rates: Vec<Vec<usize>>,
    /// Switches whose α is in ψ_i.
    pub inside: Vec<Vec<usize>>,
    /// Switches whose ψ depends on physical time and data only.
    pub timed: Vec<bool>,
    /// Switches whose α the rate φ_i may contain, or that of its last derivative.
    pub couplings: Vec<Vec<usize>>,
    /// The derivatives of ψ_i along the solution, up to the one whose rate contains an α; those inside of a gap, which
    /// are on a side, are none.
    pub chains: Vec<Vec<Expr<'e>>>,
    /// Switches whose ψ contains data, and those whose rate φ does, or that of a derivative.
    pub with_data: [Vec<bool>; 2],
}

impl<'e> Structure<'e> {
    /// `inputs` are what the variables of rates and ψ stand for.
    pub fn of(
        system: &System<'e>,
        inputs: &FxHashMap<Var, Input>,
        [rates, switching]: [&[Expr<'e>]; 2],
        resting: &[(usize, Var)],
    ) -> Self {
        let occurring = |e: &Expr<'e>| {
            let found = expr::variables_of(&[*e]).into_iter();
            let found: Vec<Input> = found.filter_map(|var| inputs.get(&var).copied()).collect();
            found
        };
        let in_f: Vec<_> = rates.iter().map(occurring).collect();
        let in_psi: Vec<_> = switching.iter().map(occurring).collect();
        let in_rates: Vec<_> = in_f.iter().map(|inputs| switches_of(inputs)).collect();
        let inside: Vec<_> = in_psi.iter().map(|inputs| switches_of(inputs)).collect();
        let is_driven = |inputs: &[Input]| {
            inputs.iter().any(|input| match input {
                Input::State(state) => in_f[*state].iter().any(is_data),
                input => is_data(input),
            })
        };
        let timed = timed(system, &in_psi);
        let (mut couplings, mut chains, mut driven) = (Vec::new(), Vec::new(), Vec::new());
        let one = system.exprs.constant(1.0);
        for (i, switch) in system.switches.iter().enumerate() {
            // On its surface roots of ψ are in no rate.
            let sigma = resting.iter().find(|(root, _)| *root == i);
            let without = sigma.map(|&(_, sigma)| {
                let rates = Substitution::one(sigma, one).apply(rates);
                let inside = rates.iter().map(|rate| switches_of(&occurring(rate)));
                let inside: Vec<_> = inside.collect();
                (rates, inside)
            });
            let (rates, in_rates) = match &without {
                Some((rates, in_rates)) => (&rates[..], &in_rates[..]),
                None => (rates, &in_rates[..]),
            };
            let (mut e, mut found) = (switching[i], coupled(&in_psi[i], in_rates));
            let mut is_among = is_driven(&in_psi[i]);
            let mut chain = Vec::new();
            let slides = switch.role == Role::Step
                && !switch.continuity.is_continuous()
                && !timed[i]
                && switch.relay.is_none();
            let passed = if switch.unilateral {
                &inside[i][..]
            } else {
                &[]
            };
            let is_free = |found: &[usize]| found.iter().all(|k| passed.contains(k));
            // Again and again until a rate contains an α.
            while slides && is_free(&found) && chain.len() < MAX_DERIVATIVES {
                e = derivative(system, inputs, e, rates);
                let inputs_of = occurring(&e);
                found = coupled(&inputs_of, in_rates);
                is_among |= is_driven(&inputs_of);
                chain.push(e);
            }
            if is_free(&found) {
                chain.clear();
            }
            couplings.push(found);
            chains.push(chain);
            driven.push(is_among);
        }
        let in_psi = in_psi.iter().map(|inputs| inputs.iter().any(is_data));
        Structure {
            with_data: [in_psi.collect(), driven],
            in_rates,
            inside,
            timed,
            couplings,
            chains,
        }
    }
}

/// Which ψ depend on physical time, parameters and data only.
fn timed(system: &System, in_psi: &[Vec<Input>]) -> Vec<bool> {
    let mut timed: Vec<bool> = Vec::new();
    for inputs in in_psi {
        // Inner switches come first; a relay holds its own α and is none of time.
        timed.push(inputs.iter().all(|input| match input {
            Input::Alpha(k) => timed.get(*k) == Some(&true),
            Input::State(state) => Some(*state) == system.clock,
            Input::Time | Input::Parameter(_) => true,
            input => is_data(input),
        }));
    }
    timed
}

/// The switches whose α are in φ = Σ ∂ψ/∂x_k f_k + ∂ψ/∂t, in order.
fn coupled(inputs: &[Input], in_rates: &[Vec<usize>]) -> Vec<usize> {
    let mut found = switches_of(inputs);
    for input in inputs {
        if let Input::State(state) = input {
            found.extend(&in_rates[*state]);
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

/// dψ/dt = Σ ∂ψ/∂x_k f_k + ∂ψ/∂t.
fn derivative<'e>(
    system: &System<'e>,
    inputs: &FxHashMap<Var, Input>,
    psi: Expr<'e>,
    rates: &[Expr<'e>],
) -> Expr<'e> {
    let by_state = expr::variables_of(&[psi]).into_iter().filter_map(|var| {
        let &Input::State(state) = inputs.get(&var)? else {
            return None;
        };
        Some(psi.diff(var) * rates[state])
    });
    system.exprs.sum(by_state) + psi.diff(variable(system.time))
}

fn is_data(input: &Input) -> bool {
    matches!(input, Input::Coefficient(_))
}

/// The switches whose α are among some inputs, in order.
fn switches_of(inputs: &[Input]) -> Vec<usize> {
    let found = inputs.iter().filter_map(|input| match input {
        Input::Alpha(switch) => Some(*switch),
        _ => None,
    });
    let mut found: Vec<usize> = found.collect();
    found.sort_unstable();
    found
}

/// For every slip velocity with two entries that belongs to no contact, as in frozen time, the switches of which one on
/// its upper side takes its α out of all rates.
pub(crate) fn idle_above<'e>(system: &System<'e>, rates: &[Expr<'e>]) -> Vec<Vec<usize>> {
    let one = system.exprs.constant(1.0);
    let frees = |switch: usize, other: usize| {
        let (alpha, above) = (
            variable(system.switches[switch].alpha),
            variable(system.switches[other].alpha),
        );
        let above = Substitution::one(above, one);
        let rates = rates.iter().filter(|rate| rate.depends_on(alpha));
        rates
            .map(|rate| rate.substitute(&above))
            .all(|rate| !rate.depends_on(alpha))
    };
    let all = system.switches.iter().enumerate();
    let of_switch = |(i, switch): (usize, &crate::system::Switch)| {
        let pair = switch.across.filter(|_| switch.slip_of.is_none())?;
        let others = system.switches.iter().enumerate();
        let others = others.filter(|(_, other)| other.across.is_none());
        let others = others.map(|(other, _)| other);
        let both = |other: &usize| frees(i, *other) && frees(pair, *other);
        Some(others.filter(both).collect())
    };
    all.map(|entry| of_switch(entry).unwrap_or_default())
        .collect()
}
