//! Derivatives of what is reported of a run.
//!
//! An output that depends on a switch has no derivative where a sample is on its surface and moves off it, unless the run
//! passes it there: then it is the one behind it.

use nsd_solver::sensitivity::Sensitivities;
use nsd_solver::tape::Tape;

use super::points::is_one_instant;
use super::reported::{Given, Reported, data_at};
use crate::report::Series;
use crate::system::System;

/// What moves off a surface does so by more than this part of its terms.
const STAYS: f64 = 1e-9;

/// Functions with their derivatives by states, α and open parameters.
struct Differentiated {
    values: Tape,
    slopes: Tape,
    /// (function, input) of every slope.
    entries: Vec<(usize, usize)>,
}

impl Differentiated {
    fn of(values: Tape, first: usize) -> Self {
        let (entries, slopes) = values.partials(|input| input >= first);
        Differentiated {
            values,
            slopes,
            entries,
        }
    }

    fn values(&self, inputs: &[f64]) -> Vec<f64> {
        evaluated(&self.values, inputs)
    }
}

fn evaluated(tape: &Tape, inputs: &[f64]) -> Vec<f64> {
    let mut values = vec![0.0; tape.n_outputs()];
    tape.eval(inputs, &mut values, &mut tape.scratch());
    values
}

/// What is known of the rows of a run that is differentiated.
pub(in crate::simulate) struct Rows<'r> {
    reported: &'r Reported,
    given: Given,
    times: &'r [f64],
    found: &'r Sensitivities,
    /// Outputs and controls.
    outputs: Differentiated,
    surfaces: Differentiated,
    /// The inputs of functions by row, and the slopes of outputs and controls there; none from where on nothing is known.
    inputs: Vec<Option<Vec<f64>>>,
    partials: Vec<Option<Vec<f64>>>,
    /// How large states have been, of whose share ψ is known.
    sizes: Vec<f64>,
}

impl<'r> Rows<'r> {
    pub fn new(
        reported: &'r Reported,
        system: &'r System<'r>,
        times: &'r [f64],
        found: &'r Sensitivities,
    ) -> Self {
        let n = reported.sizes()[0];
        let given = reported.given(system);
        let inputs = |k: usize| {
            let point = found.point(k);
            let (x, alpha) = point.split_at_checked(n)?;
            let mut alpha = alpha.to_vec();
            system.see(times[k], x, &mut alpha);
            let mut inputs = vec![times[k]];
            inputs.extend(given.data.iter().map(|data| data_at(data, times, k)));
            inputs.extend(x.iter().chain(&alpha).chain(&given.parameters));
            Some(inputs)
        };
        let inputs: Vec<Option<Vec<f64>>> = (0..times.len()).map(inputs).collect();
        let first = 1 + given.data.len();
        let size = |i: usize| {
            let values = inputs
                .iter()
                .flatten()
                .map(|inputs| inputs[first + i].abs());
            values.fold(0.0, f64::max)
        };
        let outputs = Differentiated::of(reported.outputs(), first);
        let mut scratch = outputs.slopes.scratch();
        let partials = |inputs: &Option<Vec<f64>>| {
            let mut partials = vec![0.0; outputs.slopes.n_outputs()];
            (outputs.slopes).eval(inputs.as_ref()?, &mut partials, &mut scratch);
            Some(partials)
        };
        Rows {
            partials: inputs.iter().map(partials).collect(),
            outputs,
            surfaces: Differentiated::of(reported.surfaces(system), first),
            sizes: (0..n).map(size).collect(),
            inputs,
            reported,
            given,
            times,
            found,
        }
    }

    /// Derivatives of states, and of outputs and controls, from those of the open parameters.
    pub fn tangents(&self, direction: usize, parameters: &[f64]) -> [Vec<Series>; 2] {
        let rows = || (0..self.times.len()).map(|k| self.found.at(k, direction));
        let (mut entry, mut signal) = (0, 0);
        let mut states = self.given.named.states.clone();
        for series in &mut states {
            let entries = &self.given.entries[entry..][..series.n_entries()];
            entry += entries.len();
            let values = rows().flat_map(|row| {
                let value = move |&entry: &usize| row.map_or(f64::NAN, |row| row[entry]);
                entries.iter().map(value)
            });
            series.values = values.collect();
        }
        let slopes = self.slopes(direction, parameters);
        let named = &self.given.named;
        let signals = named.outputs.iter().chain(&named.controls);
        let mut signals: Vec<Series> = signals.cloned().collect();
        for series in &mut signals {
            let entries = signal..signal + series.n_entries();
            signal = entries.end;
            let values = slopes
                .iter()
                .flat_map(|row| row[entries.clone()].iter().copied());
            series.values = values.collect();
        }
        [states, signals]
    }

    /// The weights of states and α at each row, and those of open parameters, of a sum of what is reported; none where its
    /// derivatives are not those of states alone.
    pub fn weigh(&self, weights: &[(String, Vec<f64>)]) -> Option<(Vec<Vec<f64>>, Vec<f64>)> {
        let [n, m] = self.reported.sizes();
        let (named, n_rows) = (&self.given.named, self.times.len());
        let mut rows = vec![vec![0.0; n + m]; n_rows];
        let n_outputs = self.outputs.values.n_outputs();
        let mut of_outputs = vec![vec![0.0; n_outputs]; n_rows];
        let (mut entry, mut signal) = (0, 0);
        let signals = named.outputs.iter().chain(&named.controls);
        let all = named.states.iter().map(|series| (series, true));
        for (series, is_state) in all.chain(signals.map(|series| (series, false))) {
            let count = series.n_entries();
            let first = if is_state { &mut entry } else { &mut signal };
            let own = *first..*first + count;
            *first = own.end;
            let Some((_, weights)) = weights.iter().find(|(name, _)| *name == series.name) else {
                continue;
            };
            for (k, weights) in weights.chunks(count.max(1)).enumerate() {
                for (place, weight) in own.clone().zip(weights) {
                    match is_state {
                        true => rows[k][self.given.entries[place]] += weight,
                        false => of_outputs[k][place] += weight,
                    }
                }
            }
        }
        let mut by = vec![0.0; self.given.parameters.len()];
        for (k, own) in of_outputs.iter().enumerate() {
            if own.iter().any(|weight| *weight != 0.0) {
                self.weigh_outputs(k, own, (&mut rows[k], &mut by))?;
            }
        }
        Some((rows, by))
    }

    /// Adds what weights of outputs in a row are of states and α, and of open parameters.
    fn weigh_outputs(
        &self,
        k: usize,
        weights: &[f64],
        (row, by): (&mut [f64], &mut [f64]),
    ) -> Option<()> {
        let [n, m] = self.reported.sizes();
        let first = 1 + self.given.data.len();
        let partials = self.partials[k].as_ref()?;
        for (&(output, input), partial) in self.outputs.entries.iter().zip(partials) {
            let weight = weights[output];
            if weight == 0.0 {
                continue;
            }
            let place = input - first;
            let is_switch = (n..n + m).contains(&place);
            // Whether the row moves off a surface depends on the direction.
            if is_switch && self.bends((k, place - n), |_| f64::NAN) {
                return None;
            }
            match row.get_mut(place) {
                Some(sum) => *sum += weight * partial,
                None => by[place - n - m] += weight * partial,
            }
        }
        Some(())
    }

    /// Derivatives of the entries of outputs, then of controls, instant by instant.
    fn slopes(&self, direction: usize, parameters: &[f64]) -> Vec<Vec<f64>> {
        let [n, m] = self.reported.sizes();
        let first = 1 + self.given.data.len();
        let (outputs, n_outputs) = (&self.outputs, self.outputs.values.n_outputs());
        let by_switch = |&(output, input): &(usize, usize)| {
            let switch = input.checked_sub(first + n).filter(|switch| *switch < m)?;
            Some((output, switch))
        };
        let mut looks: Vec<(usize, usize)> = outputs.entries.iter().filter_map(by_switch).collect();
        looks.sort_unstable_by_key(|&(_, switch)| switch);
        let row = |k: usize| {
            let known = self.found.at(k, direction).zip(self.partials[k].as_ref());
            let Some((tangent, partials)) = known else {
                return vec![f64::NAN; n_outputs];
            };
            let by = |input: usize| match (input - first).checked_sub(n + m) {
                None => tangent[input - first],
                Some(parameter) => parameters[parameter],
            };
            let mut slopes = vec![0.0; n_outputs];
            for (&(output, input), partial) in outputs.entries.iter().zip(partials) {
                let by = by(input);
                slopes[output] += if by == 0.0 { 0.0 } else { partial * by };
            }
            let mut last = None;
            for &(output, switch) in &looks {
                let bends = match last {
                    Some((known, bends)) if known == switch => bends,
                    _ => self.bends((k, switch), by),
                };
                last = Some((switch, bends));
                if bends {
                    slopes[output] = f64::NAN;
                }
            }
            slopes
        };
        (0..self.times.len()).map(row).collect()
    }

    /// Whether a row is on the surface of a switch, moves off it with a direction, and is not where the run passes it.
    fn bends(&self, (k, switch): (usize, usize), by: impl Fn(usize) -> f64) -> bool {
        let surfaces = &self.surfaces;
        let Some(inputs) = &self.inputs[k] else {
            return false;
        };
        let [n, _] = self.reported.sizes();
        let first = 1 + self.given.data.len();
        let alpha = inputs[first + n + switch];
        let slides = alpha > 0.0 && alpha < 1.0;
        let psi = surfaces.values(inputs)[switch];
        let partials = evaluated(&surfaces.slopes, inputs);
        let own = surfaces.entries.iter().zip(partials);
        let own = own.filter(|((function, _), _)| *function == switch);
        let (mut moves, mut size, mut terms) = (0.0, 0.0, 0.0);
        for (&(_, input), partial) in own {
            moves += partial * by(input);
            size += (partial * by(input)).abs();
            terms += partial.abs() * self.sizes.get(input - first).copied().unwrap_or(0.0);
        }
        let width = self.found.width() * terms;
        // At a corner of ψ itself there is no slope to tell.
        let is_off = psi.abs() > width || moves.abs() <= STAYS * size;
        if slides || is_off {
            return false;
        }
        let is_event = |time: f64| is_one_instant(time, self.times[k]);
        if !self.found.events.iter().any(|event| is_event(event.time)) {
            return true;
        }
        let mut others = (k + 1..self.times.len()).chain((0..k).rev());
        let other = others.find(|&other| !is_one_instant(self.times[other], self.times[k]));
        let other = other.and_then(|other| self.inputs[other].as_ref());
        other.is_none_or(|inputs| surfaces.values(inputs)[switch].abs() <= width)
    }
}
