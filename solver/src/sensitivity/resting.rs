//! Surfaces on which a run stays without sliding: where it moves off them with a direction, fields on both sides matter, and
//! there is no derivative. x' = |x| at x = 0 is so.
//!
//! A surface that is passed, or left, is on its other side for no time to first order.

use std::cell::OnceCell;

use super::functions::{Functions, Moved, Slots};
use super::run::STAYS;
use super::saltation::{rate_of, weigh};
use super::variational::{Part, Way};
use super::why::Why;
use crate::hybrid::{HybridSystem, Role, Side};

/// ψ of a switch at a point of a step.
pub(super) struct Surface {
    value: f64,
    slopes: Vec<(usize, f64)>,
    /// How large its terms have been in the run.
    terms: f64,
}

/// Where the run is, with its rates.
struct Place {
    tau: f64,
    x: Vec<f64>,
    slope: Vec<f64>,
    alpha: Vec<f64>,
}

/// Whether rates, other ψ or guards read a switch: what laws alone read matters where they jump.
fn is_read(system: &HybridSystem, i: usize) -> bool {
    let mut blocks = system.blocks.iter();
    let mut switches = system.switches.iter();
    blocks.any(|block| block.switches.contains(&i))
        || switches.any(|switch| switch.inside.contains(&i))
        || system.laws.iter().any(|law| law.guard.looks_at(i))
}

impl Way<'_> {
    /// The surfaces on which a part of a step stays without sliding, in its middle and at its end, by their switches.
    pub fn resting(
        &self,
        functions: &mut Functions,
        [a, b]: [f64; 2],
    ) -> Vec<(usize, [Surface; 2])> {
        let system = functions.system.clone();
        let sides = &self.step.sides;
        let slots = functions.slots;
        let middle = self.place(slots, 0.5 * (a + b));
        let ends = OnceCell::new();
        let ends = || ends.get_or_init(|| [a, b].map(|tau| self.place(slots, tau)));
        let mut found = Vec::new();
        for i in 0..sides.len() {
            let slides = sides[i] == Side::Slide && !system.switches[i].rests();
            let is_other = system.role(i) != Role::Step || self.run.observers[i];
            if slides || is_other || system.is_idle(i, sides) || !is_read(&system, i) {
                continue;
            }
            let mut at = |place| self.stays_on(functions, i, place);
            let Some(middle) = at(&middle) else { continue };
            let [start, end] = ends();
            if let (Some(_), Some(end)) = (at(start), at(end)) {
                found.push((i, [middle, end]));
            }
        }
        found
    }

    /// The directions that move off a surface on which a part of a step stays, with its switch.
    pub fn leaving(
        &self,
        functions: &Functions,
        part: &Part,
        resting: &[(usize, [Surface; 2])],
    ) -> Vec<(usize, Why, Vec<usize>)> {
        let length = part.ends[1] - part.ends[0];
        let mut lost = Vec::new();
        for (i, surfaces) in resting {
            for (d, tangent) in part.tangents.iter().enumerate() {
                let Some((tangent, _)) = tangent else {
                    continue;
                };
                let moves = |surface, share: f64| {
                    self.moves(functions, surface, &tangent.at(length * share), d)
                };
                if moves(&surfaces[0], 0.5) || moves(&surfaces[1], 1.0) {
                    lost.push((d, Why::Rests, vec![*i]));
                }
            }
        }
        lost
    }

    /// Where the run is `tau` after the start of the step.
    fn place(&self, slots: Slots, tau: f64) -> Place {
        let (n, m) = (slots.n_states, slots.n_switches);
        let (mut x, mut slope, mut alpha) = (vec![0.0; n], vec![0.0; n], vec![0.0; m]);
        self.step.state(tau, &mut x, &mut slope);
        self.step.alpha(tau, &mut alpha);
        Place {
            tau,
            x,
            slope,
            alpha,
        }
    }

    /// ψ where it and its rate are zero as far as the run knows them.
    fn stays_on(&self, functions: &mut Functions, switch: usize, at: &Place) -> Option<Surface> {
        let psi = functions.psi(switch, 0, &self.step.sides);
        let point = self.point(at.tau, &at.x, &at.alpha);
        let value = psi.value(&point, &mut functions.registers);
        let slopes = psi.slopes(&point, &mut functions.registers);
        let weighed = |sizes: &[f64]| weigh(&slopes, at.x.len(), |state| sizes[state]);
        let (terms, speeds) = (weighed(&self.sizes.largest), weighed(&self.sizes.fastest));
        let (share, rate) = (self.run.accuracy.width(), rate_of(&slopes, &at.slope));
        let stays = value.abs() <= share * terms && rate.abs() <= share * speeds;
        stays.then_some(Surface {
            value,
            slopes,
            terms,
        })
    }

    /// Whether a direction moves ψ, and that by more than ψ is large.
    fn moves(&self, functions: &Functions, surface: &Surface, tangent: &[f64], d: usize) -> bool {
        let largest = self.sizes.tangents(d);
        let size = tangent
            .iter()
            .enumerate()
            .map(|(j, s)| s.abs().max(largest(j)));
        let size: Vec<f64> = size.collect();
        let moved = Moved {
            x: tangent,
            size: &size,
            time: 0.0,
        };
        let [sum, size] = functions.along(&surface.slopes, moved, d);
        let is_close =
            surface.value.abs() * size <= self.run.accuracy.width() * sum.abs() * surface.terms;
        let is_off = sum != 0.0 && sum.abs() > STAYS * self.run.accuracy.faded() * size && is_close;
        is_off || sum.is_nan() || size.is_nan()
    }
}
