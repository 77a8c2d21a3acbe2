//! Smoothing: a system with switches -> one without.
//!
//! α_i ∈ step(ψ_i)   becomes   α_i = ½ (1 + s(ψ_i/ε))
//!
//! for every switch across which the dynamics jump; what is continuous, as `abs` and `max`, stays.
//! s is a function from -1 to 1, of the file or built in; those are odd. `tanh` and `rational`, y/√(1 + y²), are smooth. `polynomial` is
//! (15 y - 10 y³ + 3 y⁵)/8 up to |y| = 1 and constant beyond, so that it has two continuous derivatives,
//! and the switches ψ ± ε, which are continuous:
//!
//! α = β₊ + (β₋ - β₊) ½ (1 + s(ψ/ε)),   β₋ ∈ step(ψ + ε),   β₊ ∈ step(ψ - ε)
//!
//! The solution differs from that of the model by O(ε) where that one is unique and well-conditioned.
//! Relays have no place here: they depend on what was before.

use super::affine::is_affine;
use super::interaction::{positions, subsystems};
use crate::expr::{Expr, Substitution, Var};
use crate::system::experiment::{Law, SmoothingOptions};
use crate::system::{Continuity, Output, Partition, Switch, System};

/// The smoothed system, whose states are those of the model.
pub fn smooth<'e>(system: &System<'e>, options: &SmoothingOptions<'e>) -> System<'e> {
    let mut switches: Vec<Switch<'e>> = Vec::new();
    // Where each switch is now; none for those that are smoothed.
    let mut places: Vec<Option<usize>> = Vec::new();
    let mut steep = Substitution::new();
    for switch in &system.switches {
        let switch = Switch {
            psi: switch.psi.substitute(&steep),
            ..switch.clone()
        };
        if switch.continuity.is_continuous() {
            places.push(Some(switches.len()));
            switches.push(switch);
            continue;
        }
        places.push(None);
        let alpha = match options.law {
            Law::Tanh => half((switch.psi * (1.0 / options.epsilon)).tanh()),
            Law::Rational => {
                let y = switch.psi * (1.0 / options.epsilon);
                half(y / (1.0 + y.powi(2)).sqrt())
            }
            Law::Polynomial => saturated(&switch, options.epsilon, &mut switches),
            Law::Own { argument, value } => {
                let y = switch.psi * (1.0 / options.epsilon);
                half(value.substitute(&Substitution::one(argument, y)))
            }
        };
        steep.insert(variable(switch.alpha), alpha);
    }
    let alphas: Vec<Var> = switches
        .iter()
        .map(|switch| variable(switch.alpha))
        .collect();
    let replace = |e: Expr<'e>| multi_affine(e.substitute(&steep), &alphas);
    let outputs = |outputs: &[Output<'e>]| {
        let replaced = outputs.iter().map(|output| Output {
            exprs: output.exprs.iter().map(|e| e.substitute(&steep)).collect(),
            ..output.clone()
        });
        replaced.collect()
    };

    let mut smoothed = system.clone();
    smoothed.recorded.outputs = outputs(&system.recorded.outputs);
    smoothed.recorded.controls = outputs(&system.recorded.controls);
    smoothed.coupling.partitions = (system.coupling.partitions.iter())
        .filter_map(|partition| kept(partition, &places))
        .collect();
    for state in &mut smoothed.states {
        state.rate = replace(state.rate);
    }
    for limit in &mut smoothed.recorded.limits {
        limit.value = limit.value.substitute(&steep);
    }
    let rates: Vec<Expr<'e>> = smoothed.states.iter().map(|state| state.rate).collect();
    smoothed.coupling.subsystems = subsystems(&rates, &alphas);
    read(&mut smoothed, &steep, &places, &switches);
    smoothed.switches = switches;
    debug_assert_eq!(
        smoothed.verify(),
        Ok(()),
        "smoothing keeps the invariants of `System`"
    );
    smoothed
}

fn variable(e: Expr<'_>) -> Var {
    e.as_variable().expect("a declared quantity is a variable")
}

/// ½ (1 + s)
fn half(s: Expr<'_>) -> Expr<'_> {
    0.5 + 0.5 * s
}

/// The polynomial law, with two switches where it begins and ends.
fn saturated<'e>(switch: &Switch<'e>, epsilon: f64, switches: &mut Vec<Switch<'e>>) -> Expr<'e> {
    let mut edge = |offset: f64, sign: char| {
        let psi = switch.psi + offset;
        let (scale, surface) = psi.split_scale();
        let same = (switches.iter()).find(|other| other.psi.split_scale().1 == surface);
        if let Some(other) = same {
            let flipped = (other.psi.split_scale().0 > 0.0) != (scale > 0.0);
            return if flipped {
                1.0 - other.alpha
            } else {
                other.alpha
            };
        }
        let name = format!("{} {sign} {epsilon}", switch.name);
        let alpha = psi.exprs().variable(&format!("alpha[{name}]"));
        switches.push(Switch {
            name,
            alpha,
            psi,
            continuity: Continuity::Certain,
            is_nonlinear: false,
            named: Vec::new(),
            ..switch.clone()
        });
        alpha
    };
    let (begins, ends) = (edge(epsilon, '+'), edge(-epsilon, '-'));
    let y = switch.psi * (1.0 / epsilon);
    let s = (15.0 * y - 10.0 * y.powi(3) + 3.0 * y.powi(5)) * 0.125;
    ends + (begins - ends) * half(s)
}

/// The same values where every α is 0 or 1, affine in each of them: (1 - α) e(0) + α e(1).
fn multi_affine<'e>(e: Expr<'e>, alphas: &[Var]) -> Expr<'e> {
    let mut e = e;
    for k in positions(e, alphas) {
        if !is_affine(e, alphas[k]) {
            let alpha = e.exprs().expr(alphas[k]);
            let at = |value: f64| {
                let value = e.exprs().constant(value);
                e.substitute(&Substitution::one(alphas[k], value))
            };
            e = (1.0 - alpha) * at(0.0) + alpha * at(1.0);
        }
    }
    e
}

/// A partition whose regions all of its switches still tell apart.
fn kept<'e>(partition: &Partition<'e>, places: &[Option<usize>]) -> Option<Partition<'e>> {
    let switches = partition.switches.iter().map(|&k| places[k]);
    let switches: Vec<usize> = switches.collect::<Option<_>>()?;
    let mut partition = Partition {
        switches,
        ..partition.clone()
    };
    for region in &mut partition.regions {
        for (switch, _) in region.literals.iter_mut().flatten() {
            *switch = places[*switch]?;
        }
    }
    Some(partition)
}

/// What expressions of the model mean now: a smoothed switch is its steep function.
fn read<'e>(
    system: &mut System<'e>,
    steep: &Substitution<'e>,
    places: &[Option<usize>],
    switches: &[Switch<'e>],
) {
    let readings = &mut system.provenance.readings;
    let before = std::mem::take(&mut readings.alphas);
    // Of the switches that stay those in front, of the others those behind.
    readings.alphas = switches.iter().map(|switch| switch.alpha).collect();
    let mut moved = Vec::with_capacity(before.len());
    for (place, alpha) in places.iter().zip(before) {
        moved.push(place.unwrap_or(readings.alphas.len()));
        if place.is_none() {
            readings.alphas.push(alpha.substitute(steep));
        }
    }
    for (k, _) in readings.index.values_mut() {
        *k = moved[*k];
    }
    readings.named.then(steep);
    readings.signals.then(steep);
}
