//! Gradients of a functional by any number of parameters: the transpose of the forward pass.
//!
//! Tangents go through a run by linear maps, S ↦ Φ S + Ψ p for a part of a step and S ↦ S⁺ for an event. For a functional
//! J = Σ_k w_k (x, α)(t_k) the costate λ = dJ/dS goes through their transposes from the end to the start,
//!
//! λ ↦ Φᵀ λ,   dJ/dp += Ψᵀ λ,
//!
//! so that one pass serves all parameters: along parts Φᵀ and Ψᵀ are the transposed recursion of Taylor coefficients, where
//! anything slides with φ_α transposed, and at events those of saltation matrices. Its result is that of the forward pass up to
//! rounding where both divide steps alike, as it is the transpose of what is computed and no solution of the adjoint equations,
//! of which Cao, Li, Petzold & Serban 2003 have those with algebraic states, and Serban & Recuero 2019 those across events.
//!
//! A forward pass along one combination of all directions divides the steps, and sees what is lost whatever the direction is.
//! What else has to hold to first order are rows r S = 0, of surfaces that are stayed on. They hold for all directions where
//! they follow at their own event from its trigger, from what slides and from what jumps (`implied`); others go back to the
//! start beside the costate, and are asked of each direction there. Where one does not hold, where the combination is lost,
//! where a run rests on a surface, where a step is stiff, and where the last terms of series, which go back beside the costate
//! as well, make more than the tolerance of a derivative, directions are followed one by one instead.

use super::asked::{Directions, Moment, Sensitivities};
use super::forward::{Forward, Passed, Row, Traced};
use super::functions::Slots;
use super::run::Run;
use super::saltation::Slope;
use super::taylor::{Back, LANES, ORDER, Slopes, Weighed};
use super::variational::Way;
use crate::event::recording::Recording;
use crate::events::Approach;

/// The last orders of series, which show what is missing.
const LAST: usize = 3;

/// Rows that are asked of directions at most.
const MOST_CONDITIONS: usize = 16;
/// They are zero up to this part of their terms.
const VANISHES: f64 = 1e-9;

/// How a functional moves with the state, with the instant of an event, and with parameters.
#[derive(Clone)]
pub(super) struct Costate {
    pub x: Vec<f64>,
    pub time: f64,
    by: Weighed,
}

impl Costate {
    /// Of a function by its slopes, of so many states and parameters.
    pub fn of(slots: Slots, slopes: &[(usize, f64)], [n, parameters]: [usize; 2]) -> Self {
        let mut costate = Costate {
            x: vec![0.0; n],
            time: 0.0,
            by: Weighed::new(parameters),
        };
        costate.add(slots, slopes, 1.0);
        costate
    }

    /// All of it in a row.
    pub fn entries(&self) -> Vec<f64> {
        [&[self.time], &self.x[..], &self.by.sums].concat()
    }

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
        self.still(|costate| {
            for (switch, slopes) in &row.alpha {
                costate.add(slots, slopes, alphas[*switch]);
            }
        });
    }

    /// The transpose of what is done at an instant that does not move.
    fn still(&mut self, transpose: impl FnOnce(&mut Self)) {
        let time = self.time;
        transpose(self);
        self.time = time;
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
    // Nobody asks for those that no direction moves.
    let moves = |at: usize| directions.parameters.iter().any(|by| by[at] != 0.0);
    let unit = |at: usize| {
        let mut unit = vec![0.0; by.len()];
        unit[at] = f64::from(moves(at));
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
    let slots = functions.slots;
    let nothing = Costate::of(slots, &[], [run.system.n_states(), run.parameters.len()]);
    // The costate, what is missing of it, and conditions.
    let mut all = vec![nothing.clone(), nothing.clone()];
    for step in passed.iter().rev() {
        run.limit.over().map_or(Some(()), |_| None)?;
        match step {
            Passed::Row(row) => all[0].add_row(slots, row, &weights[row.instant]),
            Passed::Kept(algebraic) => {
                let all = all.iter_mut();
                all.for_each(|one| one.still(|one| algebraic.transpose(&functions, one)));
            }
            Passed::Event(crossing) => {
                all.iter_mut()
                    .for_each(|one| crossing.transpose(&functions, one));
                all.extend(crossing.conditions(&functions));
            }
            Passed::Start(held) => all.extend(held.iter().map(|held| {
                let sizes = [run.system.n_states(), run.parameters.len()];
                Costate::of(slots, &held.slopes, sizes)
            })),
            Passed::Part {
                place,
                ends: [a, b],
                slopes,
                goes_back: true,
                rows,
            } => {
                let mut found = None;
                let slopes = match slopes.as_deref() {
                    Some(slopes) => slopes,
                    None => {
                        let step = recording.parts[*place].step()?;
                        let way = Way {
                            step,
                            mode: &functions.mode(&step.sides),
                            coefficients: &run.coefficients(step.start),
                            run,
                            sizes: &sizes,
                        };
                        found.insert(Slopes::new(&mut functions, way, *a).ok()?)
                    }
                };
                follow(slopes, &mut all, (slots, b - a), (rows, weights));
            }
            Passed::Part { .. } => return None,
        }
        if all.len() > 2 + MOST_CONDITIONS {
            return None;
        }
    }
    let parts = passed.iter();
    let parts = parts.filter(|step| matches!(step, Passed::Part { .. }));
    // Every part is known to the tolerance.
    along_all(&all, directions, run.tolerance * parts.count() as f64)
}

/// Takes costates from the end of a part of this length to its start. What the last terms of the first one's series make is
/// added to the second one, which is what is missing.
fn follow(
    slopes: &Slopes,
    all: &mut [Costate],
    (slots, length): (Slots, f64),
    (rows, weights): (&[Row], &[Vec<f64>]),
) {
    let (n, parameters) = (all[0].x.len(), all[0].by.sums.len());
    let ends = all.iter_mut().enumerate().map(|(at, one)| {
        let rows = if at == 0 { rows } else { &[] };
        one.ends((slots, length), (rows, weights))
    });
    let ends: Vec<Vec<(f64, Vec<f64>)>> = ends.collect();
    let mut last = Weighed::new(parameters);
    let own = all.iter_mut().zip(&ends).map(|(one, ends)| Back {
        ends,
        from: 0,
        by: &mut one.by,
    });
    let mut lanes: Vec<Back> = own.collect();
    lanes.push(Back {
        ends: &ends[0],
        from: ORDER + 1 - LAST,
        by: &mut last,
    });
    let starts = lanes.chunks_mut(LANES);
    let mut starts: Vec<Vec<f64>> = starts
        .flat_map(|lanes| slopes.transposed(lanes, n))
        .collect();
    let of_last = starts.pop().unwrap_or_default();
    for (one, x) in all.iter_mut().zip(starts) {
        one.x = x;
    }
    let missing = &mut all[1];
    for (sum, own) in missing.x.iter_mut().zip(&of_last) {
        *sum += own;
    }
    for (parameter, own) in last.sums.iter().enumerate() {
        missing.by.add(parameter, *own);
    }
}

/// A costate at the start along directions, where what is missing of it is nothing to this share and conditions hold.
fn along_all(all: &[Costate], directions: &Directions, allowed: f64) -> Option<Vec<f64>> {
    let (costate, tail, conditions) = (&all[0], &all[1], &all[2..]);
    let all = || directions.initial.iter().zip(&directions.parameters);
    let holds = |row: &Costate| all().all(|(start, by)| row.vanishes(start, by));
    let is_nothing = |(start, by): (&Vec<f64>, &Vec<f64>)| {
        let [_, size] = costate.along(start, by);
        tail.along(start, by)[0].abs() <= allowed * size
    };
    let is_known = all().all(is_nothing) && conditions.iter().all(holds);
    let found = all().map(|(start, by)| costate.along(start, by)[0]);
    let found: Vec<f64> = found.collect();
    (is_known && found.iter().all(|by| by.is_finite())).then_some(found)
}

impl Costate {
    /// The weights of x at the end of a part of this length, and at its rows, which it hands over.
    fn ends(
        &mut self,
        (slots, length): (Slots, f64),
        (rows, weights): (&[Row], &[Vec<f64>]),
    ) -> Vec<(f64, Vec<f64>)> {
        let n = self.x.len();
        let mut ends = vec![(length, std::mem::replace(&mut self.x, vec![0.0; n]))];
        for row in rows {
            self.add_row(slots, row, &weights[row.instant]);
            ends.push((row.tau, std::mem::replace(&mut self.x, vec![0.0; n])));
        }
        ends
    }

    /// Its product with a direction at the start, and the size of its terms.
    fn along(&self, start: &[f64], parameters: &[f64]) -> [f64; 2] {
        let states = self.x.iter().zip(&self.x).zip(start);
        let own = self.by.sums.iter().zip(&self.by.sizes).zip(parameters);
        let terms = states.chain(own).filter(|(_, by)| **by != 0.0);
        terms.fold([0.0, 0.0], |[sum, sizes], ((own, size), by)| {
            [sum + own * by, sizes + (size * by).abs()]
        })
    }

    /// Whether that is zero.
    fn vanishes(&self, start: &[f64], parameters: &[f64]) -> bool {
        let [sum, size] = self.along(start, parameters);
        sum.abs() <= VANISHES * size
    }
}
