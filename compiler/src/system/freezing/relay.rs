//! A relay α ∈ {0, 1} -> a memory w ∈ [0, 1] and four cells of the (y, w) plane.
//!
//! With ŷ = 0 where the relay switches off and ŷ = 1 where it switches on, the cells are those of the points
//! s = (¼, -¼), (¼, ¼), (¾, ¾), (¾, 5/4), the nearest of which has the least indicator |s|² - 2 sᵀ(ŷ, w):
//!
//! - off:   x' = (2 - κ₀) f₀,  w' = b      - falls: x' = κ₀ f₀,  w' = -b     κ₀ = ŷ²/(1 + ŷ²)
//! - on:    x' = (2 - κ₁) f₁,  w' = -b     - rises: x' = κ₁ f₁,  w' = b      κ₁ = (ŷ - 1)²/(1 + (ŷ - 1)²)
//!
//! f₀ and f₁ are the dynamics for α = 0 and α = 1. While the relay is off, the state slides along w = 0 between the
//! first two cells, with half of each: x' = f₀. At ŷ = 1 it enters the third, where nothing but w moves, as κ₁ = 0;
//! at w = 1 it slides between the last two, x' = f₁, until ŷ = 0.
//!
//! Nurkanović & Diehl 2022 for the cells. There x does not move in the two middle ones at all, and w' vanishes at
//! the corners ŷ = 1, w = 0 and ŷ = 0, w = 1, so that resting there is a solution, too, and the weights of sliding
//! are undetermined at the corner. With κ the state has one way to go at a corner, and weights are ½ up to it.

use super::alpha;
use crate::expr::{Expr, Var};
use crate::source::Span;
use crate::system::regions::conjunction::conjunction;
use crate::system::switches::affine::at;
use crate::system::{Continuity, Coverage, Partition, Region, State, Switch, System};

/// Numerical time in which a relay switches, as a share of the pace.
const SHARE: f64 = 0.01;

/// The points in the cells.
const SITES: [[f64; 2]; 4] = [[0.25, -0.25], [0.25, 0.25], [0.75, 0.75], [0.75, 1.25]];

/// What takes the place of a relay.
pub(super) struct Cells<'e> {
    pub switches: Vec<Switch<'e>>,
    pub partition: Partition<'e>,
    pub memory: State<'e>,
    /// What f₀ is multiplied by.
    pub off: Expr<'e>,
    /// What f₁ is multiplied by.
    pub on: Expr<'e>,
}

/// How fast memories move.
pub(super) fn speed(pace: f64) -> f64 {
    1.0 / (SHARE * pace)
}

/// The cells of relay `k`, the memory of which moves with a speed; their switches are numbered from `first`.
pub(super) fn cells<'e>(system: &System<'e>, k: usize, speed: Expr<'e>, first: usize) -> Cells<'e> {
    let exprs = system.exprs;
    let switch = &system.switches[k];
    let relay = switch.relay.expect("it is a relay");
    let span = switch.spans.first().copied().unwrap_or_default();
    // ψ = on - y or y - on for α = 0.
    let y = 1.0 + at(switch.psi, alpha(system, k), 0.0) / (relay.off - relay.on).abs();
    let w = exprs.variable(&format!("memory[{}]", switch.name));
    let names = ["off", "falls", "rises", "on"].map(|cell| format!("{}.{cell}", switch.name));
    let indicators = SITES.map(|[a, b]| a * a + b * b - 2.0 * a * y - 2.0 * b * w);

    // A tournament: β_k says that cell k beats all before it.
    let mut switches: Vec<Switch<'e>> = Vec::new();
    let mut weights = vec![exprs.constant(1.0)];
    let mut smallest = indicators[0];
    for (cell, &g) in indicators.iter().enumerate().skip(1) {
        let beats = exprs.variable(&format!("alpha[{}]", names[cell]));
        switches.push(Switch {
            name: format!("{} | {}", names[..cell].join(", "), names[cell]),
            alpha: beats,
            psi: smallest - g,
            continuity: Continuity::Discontinuous,
            relay: None,
            named: Vec::new(),
            ..switch.clone()
        });
        for weight in &mut weights {
            *weight = *weight * (1.0 - beats);
        }
        weights.push(beats);
        smallest = beats * g + (1.0 - beats) * smallest;
    }

    let share = |offset: f64| {
        let square = (y - offset).powi(2);
        square / (1.0 + square)
    };
    let (still, moving) = (share(0.0), share(1.0));
    let memory = State {
        name: format!("memory[{}]", switch.name),
        var: w,
        initial: f64::from(relay.start),
        rate: speed * (weights[0] - weights[1] + weights[2] - weights[3]),
        span,
    };
    Cells {
        off: (2.0 - still) * weights[0] + still * weights[1],
        on: moving * weights[2] + (2.0 - moving) * weights[3],
        partition: partition(names, &weights, indicators, &switches, first, span),
        switches,
        memory,
    }
}

fn partition<'e>(
    names: [String; 4],
    weights: &[Expr<'e>],
    indicators: [Expr<'e>; 4],
    switches: &[Switch<'e>],
    first: usize,
    span: Span,
) -> Partition<'e> {
    let alphas = switches.iter().filter_map(|s| s.alpha.as_variable());
    let alphas: Vec<Var> = alphas.collect();
    let region = |(name, &weight): (String, &Expr<'e>)| Region {
        name,
        weight,
        literals: conjunction(weight, &alphas).map(|literals| {
            let numbered = literals.into_iter().map(|(k, on)| (first + k, on));
            numbered.collect()
        }),
        span,
    };
    Partition {
        regions: names.into_iter().zip(weights).map(region).collect(),
        switches: (first..first + switches.len()).collect(),
        states: Vec::new(),
        coverage: Coverage::Proven,
        indicators: indicators.to_vec(),
    }
}
