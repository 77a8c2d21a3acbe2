//! Gradients of a functional by any number of parameters: the transpose of the forward pass.
//!
//! Tangents go through a run by linear maps, S ↦ Φ S + Ψ p for a part of a step and S ↦ S⁺ for an event. For a functional
//! J = Σ_k w_k (x, α)(t_k) the costate λ = dJ/dS goes through their transposes from the end to the start,
//!
//! λ ↦ Φᵀ λ,   dJ/dp += Ψᵀ λ,
//!
//! so that one pass serves all parameters, and its result is that of the forward pass up to rounding where both divide steps
//! alike: along parts Φᵀ and Ψᵀ are the transposed recursion of Taylor coefficients, where anything slides with φ_α
//! transposed, and at events those of saltation matrices (Cao, Li, Petzold & Serban 2003, for equations with algebraic
//! states).
//!
//! What has to hold to first order is linear in the tangent. A forward pass along one combination of all directions finds
//! what does not hold for one of them, unless terms cancel or that direction is small in it by a factor of 1e-6; it also
//! divides the steps. Where it loses its way, where a step is stiff, and where the last terms of series add more than the
//! tolerance to the derivative by a parameter, directions are followed one by one instead.

use super::asked::{Directions, Moment};
use super::forward::{Forward, Passed, Row, Sensitivities, Traced};
use super::functions::{Functions, Slots};
use super::run::Run;
use super::saltation::Slope;
use super::taylor::{ORDER, Slopes, Weighed};
use super::variational::Way;
use crate::event::recording::{Part, Recording};
use crate::events::Approach;

/// The last orders of series, which show what is missing.
const LAST: usize = 3;

/// How a functional moves with the state, with the instant of an event, and with parameters.
pub(super) struct Costate {
    pub x: Vec<f64>,
    pub time: f64,
    by: Weighed,
}

impl Costate {
    /// Adds the slopes of a function of this weight.
    pub fn add(&mut self, slots: Slots, slopes: &[(usize, f64)], weight: f64) {
        if weight == 0.0 {
            return;
        }
        for &(slot, slope) in slopes {
            match slot {
                0 => self.time += weight * slope,
                slot if slot <= slots.n_states => self.x[slot - 1] += weight * slope,
                slot => {
                    if let Some(parameter) = slot.checked_sub(slots.parameter(0)) {
                        self.by.add(parameter, weight * slope);
                    }
                }
            }
        }
    }

    /// The same of a function whose derivatives by parameters are those of all directions but the first.
    pub fn add_slope(&mut self, slope: &Slope, weight: f64) {
        if weight == 0.0 {
            return;
        }
        self.time += weight * slope.time;
        for (x, own) in self.x.iter_mut().zip(&slope.x) {
            *x += weight * own;
        }
        for (parameter, by) in slope.by.iter().skip(1).enumerate() {
            self.by.add(parameter, weight * by);
        }
    }

    /// Adds the weights of states and α at an instant.
    fn add_row(&mut self, slots: Slots, row: &Row, weights: &[f64]) {
        let (states, alphas) = weights.split_at(self.x.len());
        for (x, weight) in self.x.iter_mut().zip(states) {
            *x += weight;
        }
        for (switch, slopes) in &row.alpha {
            self.add(slots, slopes, alphas[*switch]);
        }
    }
}

/// Finds the gradient of Σ_k w_k (x, α)(t_k) by direction; none where it is not known for all of them at once.
pub(super) fn gradient(
    run: &Run,
    (recording, approaches): (&Recording, &[Approach]),
    directions: &Directions,
    instants: &[Moment],
    weigh: impl FnOnce(&Sensitivities) -> Option<Vec<Vec<f64>>>,
) -> Option<Vec<f64>> {
    let combined = combined(run, directions);
    let traced = Forward::new(run, &combined, instants).traced(recording, approaches);
    let is_read = |k: usize| traced.found.at(k, 0).is_some();
    if traced.found.lost[0].is_some() || !(0..instants.len()).all(is_read) {
        return None;
    }
    let weights = weigh(&traced.found)?;
    backward(run, recording, traced, (directions, &weights))
}

/// One combination of all directions, and behind it the parameters one by one, along which nothing starts.
fn combined(run: &Run, directions: &Directions) -> Directions {
    let n = run.system.n_states();
    let (mut initial, mut by) = (vec![0.0; n], vec![0.0; run.parameters.len()]);
    let mut share = 0.0_f64;
    let all = directions.initial.iter().zip(&directions.parameters);
    for (start, parameters) in all {
        share = (share + 0.618_033_988_749_895).fract();
        let sizes = parameters.iter().zip(run.parameters);
        let size = sizes.map(|(by, value)| (by * value).abs()).sum::<f64>();
        let size = if size > 0.0 { size } else { 1.0 };
        let weight = size * (0.5 + 0.5 * share) * if share < 0.5 { 1.0 } else { -1.0 };
        for (sum, entry) in initial.iter_mut().zip(start) {
            *sum += weight * entry;
        }
        for (sum, entry) in by.iter_mut().zip(parameters) {
            *sum += weight * entry;
        }
    }
    let unit = |at: usize| {
        let mut unit = vec![0.0; by.len()];
        unit[at] = 1.0;
        unit
    };
    let units = (0..by.len()).map(unit);
    Directions {
        initial: vec![initial],
        parameters: [by.clone()].into_iter().chain(units).collect(),
    }
}

/// From the end to the start; none where something is not known for all directions.
fn backward(
    run: &Run,
    recording: &Recording,
    traced: Traced,
    (directions, weights): (&Directions, &[Vec<f64>]),
) -> Option<Vec<f64>> {
    let Traced {
        mut functions,
        sizes,
        passed,
        ..
    } = traced;
    let (n, slots) = (run.system.n_states(), functions.slots);
    let mut costate = Costate {
        x: vec![0.0; n],
        time: 0.0,
        by: Weighed::new(run.parameters.len()),
    };
    for step in passed.iter().rev() {
        run.limit.over().map_or(Some(()), |_| None)?;
        match step {
            Passed::Row(row) => costate.add_row(slots, row, &weights[row.instant]),
            Passed::Kept(algebraic) => algebraic.transpose(&functions, &mut costate),
            Passed::Event(crossing) => crossing.transpose(&functions, &mut costate),
            Passed::Part { is_stiff: true, .. } => return None,
            Passed::Part {
                place, ends, rows, ..
            } => {
                let Part::Step(step) = &recording.parts[*place] else {
                    return None;
                };
                let way = Way {
                    step,
                    mode: &functions.mode(&step.sides),
                    coefficients: &run.coefficients(step.start),
                    run,
                    sizes: &sizes,
                };
                part(&mut functions, way, (*ends, rows, weights), &mut costate)?;
            }
        }
    }
    let by = &costate.by;
    let is_known = |i: usize| by.tails[i] <= run.tolerance * by.sizes[i];
    let product = |a: &[f64], b: &[f64]| -> f64 {
        let terms = a.iter().zip(b).filter(|(_, b)| **b != 0.0);
        terms.map(|(a, b)| a * b).sum()
    };
    let all = directions.initial.iter().zip(&directions.parameters);
    let found =
        all.map(|(start, parameters)| product(&costate.x, start) + product(&by.sums, parameters));
    let found: Vec<f64> = found.collect();
    let is_all = found.iter().all(|by| by.is_finite()) && (0..by.sums.len()).all(is_known);
    is_all.then_some(found)
}

/// From the end of a part to its start.
fn part(
    functions: &mut Functions,
    way: Way,
    ([a, b], rows, weights): ([f64; 2], &[Row], &[Vec<f64>]),
    costate: &mut Costate,
) -> Option<()> {
    let n = costate.x.len();
    let slopes = Slopes::new(functions, way, a).ok()?;
    let mut ends = vec![(b - a, std::mem::replace(&mut costate.x, vec![0.0; n]))];
    for row in rows {
        costate.add_row(functions.slots, row, &weights[row.instant]);
        ends.push((row.tau, std::mem::replace(&mut costate.x, vec![0.0; n])));
    }
    let mut last = Weighed::new(way.run.parameters.len());
    slopes.transposed(&ends, (n, ORDER + 1 - LAST), &mut last);
    costate.by.add_tails(&last);
    costate.x = slopes.transposed(&ends, (n, 0), &mut costate.by);
    Some(())
}
