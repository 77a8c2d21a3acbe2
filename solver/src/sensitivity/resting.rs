//! Surfaces on which a run stays without sliding: where it moves off them with a direction, fields on both sides matter, and
//! there is no derivative. x' = |x| at x = 0 is so.
//!
//! A surface that is passed, or left, is on its other side for no time to first order.

use super::functions::{Functions, Moved};
use super::run::STAYS;
use super::variational::{Part, Variational, Way};
use super::why::Why;
use crate::hybrid::{HybridSystem, Role, Side};

/// ψ of a switch at a point of a step.
struct Seen {
    value: f64,
    slopes: Vec<(usize, f64)>,
    /// How large its terms have been in the run.
    terms: f64,
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
    /// The directions that move off a surface on which a part of a step stays, with its switch.
    pub fn rests(
        &self,
        functions: &mut Functions,
        method: &Variational,
        part: &Part,
    ) -> Vec<(usize, Why, Vec<usize>)> {
        let system = functions.system.clone();
        let sides = &self.step.sides;
        let mut lost = Vec::new();
        for i in 0..sides.len() {
            let slides = sides[i] == Side::Slide && !system.switches[i].rests();
            let is_other = system.role(i) != Role::Step || self.run.observers[i];
            if slides || is_other || system.is_idle(i, sides) || !is_read(&system, i) {
                continue;
            }
            let middle = method.points().len() / 2;
            let places = [middle, 0, method.points().len() - 1];
            let seen = places.map(|place| {
                let [a, b] = part.ends;
                self.stays_on(functions, i, a + (b - a) * method.points()[place])
            });
            let [Some(middle), Some(_), Some(end)] = seen else {
                continue;
            };
            for (d, values) in part.values.iter().enumerate() {
                let Some(values) = values else { continue };
                let at = |seen: &Seen, tangent: &[f64]| self.moves(functions, seen, tangent, d);
                if at(&middle, &values[places[0]]) || at(&end, &values[places[2]]) {
                    lost.push((d, Why::Rests, vec![i]));
                }
            }
        }
        lost
    }

    /// ψ where it and its rate are zero as far as the run knows them.
    fn stays_on(&self, functions: &mut Functions, switch: usize, tau: f64) -> Option<Seen> {
        let (n, m) = (functions.slots.n_states, functions.slots.n_switches);
        let (mut x, mut slope, mut alpha) = (vec![0.0; n], vec![0.0; n], vec![0.0; m]);
        self.step.state(tau, &mut x, &mut slope);
        self.step.alpha(tau, &mut alpha);
        let psi = functions.psi(switch, 0, &self.step.sides);
        let point = self.point(tau, &x, &alpha);
        let value = psi.value(&point, &mut functions.registers);
        let slopes = psi.slopes(&point, &mut functions.registers);
        let state = |slot: usize| slot.checked_sub(1).filter(|state| *state < n);
        let weigh = |sizes: &[f64]| -> f64 {
            let terms = slopes.iter();
            terms
                .filter_map(|&(slot, c)| Some(c.abs() * sizes[state(slot)?]))
                .sum()
        };
        let (terms, speeds) = (weigh(&self.sizes.largest), weigh(&self.sizes.fastest));
        let rates = slopes.iter().map(|&(slot, c)| match slot {
            0 => c,
            slot => state(slot).map_or(0.0, |state| c * slope[state]),
        });
        let (share, rate) = (self.run.width(), rates.sum::<f64>());
        let stays = value.abs() <= share * terms && rate.abs() <= share * speeds;
        stays.then_some(Seen {
            value,
            slopes,
            terms,
        })
    }

    /// Whether a direction moves ψ, and that by more than ψ is large.
    fn moves(&self, functions: &Functions, seen: &Seen, tangent: &[f64], d: usize) -> bool {
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
        let [sum, size] = functions.along(&seen.slopes, moved, d);
        let is_close = seen.value.abs() * size <= self.run.width() * sum.abs() * seen.terms;
        sum != 0.0 && sum.abs() > STAYS * self.run.faded() * size && is_close
    }
}
