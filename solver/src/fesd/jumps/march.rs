//! A run over a grid, step by step, along a run from event to event.

use super::reference::{Reference, Target};
use super::simulator::System;
use super::{Program, StepProgram, StepStart, Stepper, Work};
use crate::event::{Cause, Event, Observer, Segment};
use crate::hybrid::{Outcome, Side, Stats, Status};
use crate::runtime::limit::Limit;

/// Elements that are added to a step at most.
pub(super) const MOST_ADDED: usize = 2;
/// Parts of a step that are foreseen at most.
pub(super) const MOST_PARTS: usize = 12;

/// What a run is over.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// Where it ends.
    pub horizon: f64,
    /// Steps of one length.
    pub steps: usize,
    /// Elements of each of them at least.
    pub elements: usize,
}

/// What a run over a grid has come to.
#[derive(Clone, Debug)]
pub struct Reached {
    /// The grid.
    pub grid: Grid,
    /// How many switches there are.
    pub n_switches: usize,
    /// Why it ended.
    pub status: Status,
    /// The instant of that: the horizon of a solved run. An impact that ends a run is behind `time`.
    pub at: f64,
    /// The end of the last step.
    pub time: f64,
    /// The state there.
    pub x: Vec<f64>,
    /// The largest magnitude of a state so far.
    pub size: f64,
    /// Instants and contacts of all jumps.
    pub jumps: Vec<(f64, Vec<usize>)>,
    /// The sides of switches from some instants on.
    pub sides: Vec<(f64, Box<[Side]>)>,
    /// What the steps have taken.
    pub work: Work,
    /// Elements that were added to steps.
    pub added: usize,
}

impl Reached {
    /// As of every run.
    pub fn outcome(&self) -> Outcome {
        let last = self.sides.last().map(|(_, sides)| sides.to_vec());
        let sides = last.unwrap_or_else(|| vec![Side::Plus; self.n_switches]);
        Outcome {
            stats: Stats {
                steps: self.grid.steps,
                newton_iterations: self.work.iterations,
                ..Stats::default()
            },
            violation: self.work.violation,
            ..Outcome::at(self.status.clone(), self.time, self.x.clone(), sides)
        }
    }
}

/// Makes the program of steps of so many elements, where there is one.
pub type Make<'m, P> = &'m mut dyn FnMut(usize) -> Option<StepProgram<P>>;

/// A run over a grid.
pub(super) struct March<'m, P> {
    pub system: &'m mut System<P>,
    pub make: Make<'m, P>,
    pub limit: &'m Limit,
    /// A run from event to event, where one begins.
    pub reference: Option<&'m Reference>,
    pub stepper: Stepper,
    pub reached: Reached,
}

/// A step that is solved, and the number of its elements.
struct Step {
    elements: usize,
    w: Vec<f64>,
}

/// Why there is no step, and when.
type Stop = (Status, f64);

impl<P: Program> March<'_, P> {
    /// Step by step.
    pub fn run(mut self, observer: &mut dyn Observer) -> Reached {
        let Grid { steps, horizon, .. } = self.reached.grid;
        for k in 0..steps {
            let start = horizon * k as f64 / steps as f64;
            let end = horizon * (k + 1) as f64 / steps as f64;
            let step = match self.step(start, end) {
                Ok(step) => step,
                Err((status, at)) => {
                    (self.reached.status, self.reached.at) = (status, at);
                    break;
                }
            };
            self.take(&step, (start, end), observer);
            self.reached.work = self.stepper.work;
            if self.reached.status == Status::Stopped {
                break;
            }
        }
        self.reached
    }

    /// A step, unless the run from event to event ends in it as every run does: impulses without a motion, as those of
    /// Painlevé's paradox, may be solutions.
    fn step(&mut self, start: f64, end: f64) -> Result<Step, Stop> {
        if let Some(run) = self.reference {
            if run.has_ended(start, end) {
                return Err((run.outcome.status.clone(), run.outcome.time));
            }
            if let Some(time) = run.accumulates(start, end) {
                return Err((Status::Accumulation, time));
            }
        }
        let Some(step) = self.solved(start, end - start) else {
            let status = self.limit.over().map_or(Status::Unsolved, Status::Over);
            return Err((status, start));
        };
        match self.outside(&step, start) {
            Some(stop) => Err(stop),
            None => Ok(step),
        }
    }

    /// A step from the present state, with more elements where there is none with fewer.
    fn solved(&mut self, start: f64, length: f64) -> Option<Step> {
        let elements = self.reached.grid.elements;
        // With fewer elements than the step has parts there is no solution.
        let parts = |run: &Reference| run.parts(start, start + length).min(MOST_PARTS);
        let parts = self.reference.map_or(1, parts);
        let least = parts.saturating_sub(elements);
        let from = self.stepper.points.start(start, &self.reached.x)?;
        for added in least..=least + MOST_ADDED {
            // Making the program of many contacts may take longer than solving it.
            if self.limit.is_over() {
                return None;
            }
            if let Some(w) = self.solve(&from, length, elements + added) {
                self.reached.added += added;
                return Some(Step {
                    elements: elements + added,
                    w,
                });
            }
        }
        None
    }

    fn solve(&mut self, from: &StepStart, length: f64, elements: usize) -> Option<Vec<f64>> {
        let start = from.time;
        let step = self
            .system
            .program(elements, self.reached.grid, self.make)?;
        let interval = (start, start + length);
        let impacts = &self.stepper.points.contacts.impacts;
        let closed = |run: &Reference| run.closed(impacts, interval, elements);
        let closed = self.reference.map(closed).unwrap_or_default();
        let mut w = step.start_from(from, &closed);
        if let Some(reference) = self.reference {
            let target = Target {
                elements: &step.elements,
                points: &step.points,
                n_states: step.n_states,
                initial: &from.x,
                bounds: step.program.variable_bounds(),
                interval,
                window: 0.0,
            };
            reference.fill(&mut self.stepper.points, &target, &mut w);
        }
        self.stepper.solve(step, &w, start, self.limit)
    }

    /// A contact that strikes in a step with a coefficient that no contact has.
    fn outside(&mut self, Step { elements, w }: &Step, start: f64) -> Option<Stop> {
        let step = &self.system.programs[elements];
        let (time, contact, (coefficient, value)) = self.stepper.outside(step, w, start)?;
        let status = Status::Coefficient {
            switch: self.stepper.points.contacts.impacts[contact].switch,
            coefficient,
            value,
        };
        Some((status, time))
    }

    /// Tells the elements of a step, and goes to its end.
    fn take(
        &mut self,
        Step { elements, w }: &Step,
        interval: (f64, f64),
        observer: &mut dyn Observer,
    ) {
        let (step, shape) = (&self.system.programs[elements], &self.system.shape);
        let (reached, end) = (&mut self.reached, step.points.len() - 1);
        let mut passed = self.stepper.pass(step, w, interval);
        // Behind the last mode there is rounding.
        if let Some(last) = passed.iter_mut().rfind(|element| element.is_long) {
            last.to = interval.1;
        }
        for (j, element) in passed.into_iter().enumerate() {
            let (from, to) = (element.from, element.to);
            let values: Vec<Vec<f64>> = (1..=step.nodes)
                .map(|m| self.stepper.alphas(step, w, j, m))
                .collect();
            let instants: Vec<f64> = step.points.iter().map(|c| from + (to - from) * c).collect();
            let x: Vec<&[f64]> = (0..=end).map(|m| step.states(w, j, m)).collect();
            let found = element.is_long.then(|| {
                let member = |k, t, x: &[f64]| self.stepper.points.member(k, t, x);
                shape.element(&instants, &x, &values, member)
            });
            let before = reached.sides.last().map(|(_, sides)| sides.clone());
            let sides = found.as_ref().map(|(_, sides)| sides.clone());
            let sides = sides.or_else(|| before.clone());
            let sides = sides.unwrap_or_else(|| vec![Side::Plus; values[0].len()].into());
            let left = before.unwrap_or_else(|| sides.clone());
            if !element.struck.is_empty() || left != sides {
                observer.event(&Event {
                    time: from,
                    x: step.states(w, j, 0),
                    before: step.before(w, j),
                    jumps: &element.struck,
                    decisions: &[],
                    from: &left,
                    to: &sides,
                    accumulates: false,
                    cause: Cause::default(),
                });
            }
            if !element.struck.is_empty() {
                reached.jumps.push((from, element.struck));
            }
            if let Some((piece, _)) = found {
                let segment = Segment::new(from, to - from, to, &sides, x[end], &piece);
                if observer.segment(&segment).is_break() {
                    reached.status = Status::Stopped;
                }
                reached.sides.push((from, sides));
            }
            reached.time = to;
            reached.x.copy_from_slice(x[end]);
            if reached.status == Status::Stopped {
                break;
            }
        }
        let sizes = reached.x.iter().map(|x| x.abs());
        reached.size = sizes.fold(reached.size, f64::max);
    }
}
