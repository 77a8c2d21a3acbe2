//! Derivatives of a run by parameters and initial values, as it is reported.

use std::ops::ControlFlow;

use nsd_solver::event::{Event, Observer, Segment};
use nsd_solver::sensitivity::{Directions, Loss, Moment, Sensitivities};

use crate::report::{Moves, Samples, Sensitivity, Trajectory, Warning};
use crate::simulate::record::reported::{Reported, is_before};
use crate::simulate::record::sensed::Rows;
use crate::source::Span;
use crate::system::System;

/// By what a run is differentiated.
#[derive(Clone, Debug)]
pub(crate) struct Sensing {
    /// The parameters that stay open, by their numbers.
    pub open: Vec<usize>,
    /// What they and the initial values do, one by one.
    pub directions: Directions,
    /// What each is called, with where it is asked for.
    pub names: Vec<(String, Span)>,
    /// Of a functional, if it alone is differentiated: the weights of what is reported, by name and row.
    pub weights: Option<Vec<(String, Vec<f64>)>>,
}

/// From where a run is to the weights of states and α at its rows.
pub(super) type Weigh<'w> = dyn FnMut(&Sensitivities) -> Option<Vec<Vec<f64>>> + 'w;

/// Two observers of one run.
pub(super) struct Both<'a, A, B>(pub &'a mut A, pub &'a mut B);

impl<A: Observer, B: Observer> Observer for Both<'_, A, B> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        self.1.segment(segment)?;
        self.0.segment(segment)
    }

    fn event(&mut self, event: &Event) {
        self.1.event(event);
        self.0.event(event);
    }
}

/// The instants of rows.
pub(super) fn instants(times: &[f64]) -> Vec<Moment> {
    let instant = |(row, &time): (usize, &f64)| Moment {
        time,
        is_behind: !is_before(times, row),
    };
    times.iter().enumerate().map(instant).collect()
}

impl Sensing {
    /// Adds the derivatives of a run to its trajectory, and why they are not known where they are not.
    pub fn tell(
        &self,
        found: &Sensitivities,
        (system, reported): (&System, &Reported),
        trajectory: &mut Trajectory,
    ) {
        let rows = Rows::new(reported, system, &trajectory.samples.time, found);
        let mut all = Vec::new();
        for (d, (name, _)) in self.names.iter().enumerate() {
            let [states, outputs] = rows.tangents(d, &self.directions.parameters[d]);
            let moves = found.events.iter().map(|event| Moves {
                time: event.time,
                derivative: event.by[d],
            });
            all.push(Sensitivity {
                to: name.clone(),
                until: found.lost[d].as_ref().map(|loss| loss.time),
                states,
                outputs,
                events: moves.collect(),
            });
        }
        trajectory.samples.sensitivities = all;
        let mut told: Vec<(&Loss, Vec<usize>)> = Vec::new();
        for (d, loss) in found.lost.iter().enumerate() {
            let Some(loss) = loss else { continue };
            match told.iter_mut().find(|(other, _)| *other == loss) {
                Some((_, directions)) => directions.push(d),
                None => told.push((loss, vec![d])),
            }
        }
        let warnings = told
            .iter()
            .map(|(loss, directions)| self.lost(system, loss, directions));
        trajectory.warnings.extend(warnings);
    }

    /// Why weights are not those of the rows of a run.
    pub fn misfit(&self, samples: &Samples) -> Option<String> {
        let rows = samples.time.len();
        self.weights.iter().flatten().find_map(|(name, weights)| {
            let own = samples.series().find(|series| series.name == *name)?;
            let entries = own.n_entries();
            (weights.len() != rows * entries).then(|| {
                let each = match entries {
                    1 => String::new(),
                    entries => format!(" of {entries} entries"),
                };
                format!(
                    "{} weights of `{name}` for {rows} rows{each}",
                    weights.len()
                )
            })
        })
    }

    /// Finds the gradient of the functional in one pass back through the run: whether that is possible.
    pub fn pull(
        &self,
        weights: &[(String, Vec<f64>)],
        back: &mut dyn FnMut(&mut Weigh) -> Option<Vec<f64>>,
        (system, reported): (&System, &Reported),
        trajectory: &mut Trajectory,
    ) -> bool {
        let times = &trajectory.samples.time;
        let mut direct = Vec::new();
        let found = back(&mut |found: &Sensitivities| {
            let (rows, by) = Rows::new(reported, system, times, found).weigh(weights)?;
            direct = by;
            Some(rows)
        });
        let Some(mut gradient) = found else {
            return false;
        };
        for (sum, by) in gradient.iter_mut().zip(&self.directions.parameters) {
            let terms = direct.iter().zip(by).filter(|(_, by)| **by != 0.0);
            *sum += terms.map(|(a, b)| a * b).sum::<f64>();
        }
        trajectory.samples.gradient = Some(gradient);
        true
    }

    /// Finds the gradient of the functional from the derivatives of all that it is made of.
    pub fn weigh(&self, weights: &[(String, Vec<f64>)], trajectory: &mut Trajectory) {
        let product = |by: &Sensitivity| {
            let terms = weights.iter().flat_map(|(name, weights)| {
                let mut all = by.states.iter().chain(&by.outputs);
                let own = all.find(|series| series.name == *name).into_iter();
                own.flat_map(|series| weights.iter().zip(&series.values))
            });
            let terms = terms.filter(|(weight, _)| **weight != 0.0);
            terms.map(|(a, b)| a * b).sum()
        };
        let all = trajectory.samples.sensitivities.iter();
        trajectory.samples.gradient = Some(all.map(product).collect());
    }

    /// What is said where derivatives in these directions are not known any more.
    fn lost(&self, system: &System, loss: &Loss, directions: &[usize]) -> Warning {
        let names = directions.iter().map(|&d| format!("`{}`", self.names[d].0));
        let names: Vec<String> = names.collect();
        let switches = || loss.switches.iter().map(|&i| &system.switches[i]);
        let surfaces = switches().map(|switch| format!("`{}`", switch.name));
        let mut surfaces: Vec<String> = surfaces.collect();
        surfaces.dedup();
        let at = match surfaces.is_empty() {
            true => String::new(),
            false => format!(" at {}", surfaces.join(", ")),
        };
        let why = loss.why;
        let span = switches().find_map(|switch| switch.spans.first().copied());
        Warning {
            code: "W0735".into(),
            message: format!(
                "the sensitivity to {} is not known from time {:.6} on: {why}{at}",
                names.join(", "),
                loss.time
            ),
            span: span.or(Some(self.names[directions[0]].1)),
        }
    }
}
