//! Contacts by finite elements with jumps between them (FESD-J).
//!
//! Each step of the grid is the program of an optimal control problem with nothing to control: elements, impulses where
//! they meet, and complementarity (Nurkanović, Frey, Pozharskiy & Diehl 2024). It is made once for each number of
//! elements, and started from any instant and state. A run from event to event says which branch of it is solved first,
//! and in which elements contacts stay closed, where the rates of their gaps vanish at the nodes, too (`dcs/drift.rs`);
//! then the relaxed program is solved, and then one with more elements: a step with r switches and impacts needs r + 1.
//! Pairs are sums over an element, and lengths are equal where nothing happens between them, whatever `cross` and
//! `equilibration` say of the printed form: its solutions are the same.
//! What is found satisfies all equations and signs; gaps are looked at between the nodes, too.

mod compare;
mod program;

use miette::LabeledSpan;
use nsd_solver::jumps::{CLOSED, StepStart, Stepper};
use nsd_solver::problem::Nlp;
use rustc_hash::FxHashMap;

use program::{StepProgram, contacts};

use super::super::watch::Progress;
use super::super::{Elements, Rehearsed, Request, judge, outcome};
use super::judge_grid;
use crate::clock::Instant;
use crate::dcs::{self, Dcs, solve_pointwise};
use crate::discretize::{self, Detection, Equilibration, Grid, Layout, check_start};
use crate::expr::{Expr, Var};
use crate::limit::Limit;
use crate::mpcc::Bounds;
use crate::report::{
    Certificate, Failure, Method, MethodOption, Stationarity, Stats, Status, Trajectory,
};
use crate::system::System;
use crate::system::experiment::{FesdOptions, Settings};
use crate::system::task::{Cost, Shape, Task};

/// Steps where the experiment does not say how many.
const STEPS: usize = 50;
/// Elements that are added to a step at most.
const MOST_ADDED: usize = 2;
/// Parts of a step that are foreseen at most.
const MOST_PARTS: usize = 12;
/// Steps at most where the tolerance chooses them.
const MOST_STEPS: usize = 400;

/// A run over one grid.
struct Run<'s, 'e> {
    system: &'s System<'e>,
    dcs: Dcs<'e>,
    options: discretize::Options,
    horizon: f64,
    steps: usize,
    limit: Limit,
    /// A run from event to event, where one begins.
    rehearsed: Option<&'s Rehearsed<'e>>,
    /// The programs of steps, by the number of their elements.
    programs: FxHashMap<usize, StepProgram>,
    /// The end of the last step, and the state there.
    reached: f64,
    x: Vec<f64>,
    /// The largest magnitude of a state so far.
    size: f64,
    /// Instants and laws of all jumps.
    jumps: Vec<(f64, Vec<usize>)>,
    stepper: Stepper,
    /// Elements that were added to steps.
    added: usize,
}

/// A step that is solved, and the number of its elements.
struct Step {
    elements: usize,
    w: Vec<f64>,
}

/// Integrates over the horizon of the experiment, and again over twice as many steps, each of one
/// element more, for an estimate of the error.
pub(in crate::simulate) fn run(
    system: &System,
    settings: &Settings,
    options: &FesdOptions,
    request: &Request,
    watch: &mut dyn FnMut(Progress),
) -> Trajectory {
    let started = Instant::now();
    let mut steps = options.steps.unwrap_or(STEPS);
    // With as many elements, twice as many steps could cut an interval between two events as before.
    let finer = FesdOptions {
        elements: options.elements + 1,
        ..*options
    };
    let rehearsed = Rehearsed::new(system, settings, &request.limit);
    let on = (
        system,
        Some(&rehearsed).filter(|rehearsed| rehearsed.begins()),
    );
    let (coarse, elements, failure, estimate) = loop {
        let mut coarse = Run::new(on, settings, options, steps, &request.limit);
        let (elements, failure) = coarse.integrate(settings, watch, false);
        let mut second = || {
            let mut fine = Run::new(on, settings, &finer, 2 * steps, &request.limit);
            let (others, ended) = fine.integrate(settings, watch, true);
            if ended.as_ref().is_some_and(Failure::is_over) {
                return None;
            }
            let changes = [elements.changes(), others.changes()];
            Some(coarse.compare(&fine, changes, ended.is_none()))
        };
        let wanted = failure.is_none() && request.estimate;
        let estimate = wanted.then(&mut second).flatten();
        let error = estimate.as_ref().map_or(0.0, |estimate| estimate.error);
        let is_unsolved = matches!(failure, Some(Failure::Unsolved { .. }));
        let is_done = error <= settings.tolerance && !is_unsolved;
        if options.steps.is_some() || is_done || steps >= MOST_STEPS {
            break (coarse, elements, failure, estimate);
        }
        steps *= 2;
    };
    let overlooked = elements.overlooked(settings);
    let mut trajectory = elements.finish(settings, coarse.reached);
    let told = overlooked.iter().map(|note| outcome::warning(system, note));
    trajectory.warnings.extend(told);
    let (family, nodes) = options.scheme;
    let number = |name: &str, value: usize| (name.to_owned(), MethodOption::Number(value as f64));
    let word = |name: &str, value: &str| (name.to_owned(), MethodOption::Text(value.to_owned()));
    trajectory.experiment = settings.name.clone();
    trajectory.model = settings.model.clone();
    trajectory.status = Status::Solved;
    trajectory.method = Method {
        name: "fesd".into(),
        options: vec![
            word("scheme", &format!("{}({nodes})", family.word())),
            word("lowering", &format!("impact, {}", coarse.dcs.formulation)),
            number("steps", steps),
            number("elements", options.elements),
        ],
    };
    let added = (coarse.added > 0).then(|| number("added_elements", coarse.added));
    trajectory.method.options.extend(added);
    trajectory.certificate = Certificate {
        stationarity: Stationarity::None,
        max_violation: coarse.stepper.work.violation,
    };
    trajectory.stats = Stats {
        steps: steps as u64,
        newton_iterations: coarse.stepper.work.iterations as u64,
        homotopy_steps: coarse.stepper.work.relaxed as u64,
        ..Stats::default()
    };
    trajectory.skipped = system.skipped.clone();
    trajectory.failure = failure;
    if let Some(estimate) = estimate {
        match options.steps {
            None => judge(&mut trajectory, &estimate, settings),
            Some(_) => judge_grid(&mut trajectory, &estimate, settings),
        }
    }
    if let Some(failure) = &trajectory.failure {
        trajectory.status = failure.status();
    }
    trajectory.stats.solve_s = started.elapsed().as_secs_f64();
    trajectory
}

impl<'s, 'e> Run<'s, 'e> {
    fn new(
        (system, rehearsed): (&'s System<'e>, Option<&'s Rehearsed<'e>>),
        settings: &Settings<'e>,
        options: &FesdOptions,
        steps: usize,
        limit: &Limit,
    ) -> Self {
        let dcs = dcs::lower(system, &settings.lowerings);
        let mut dcs = dcs.expect("compilation has checked that the system can be lowered");
        dcs.task = Some(nothing(system.exprs.constant(0.0), settings));
        let fesd = discretize::Options::fesd(options);
        let detection = fesd.detection.unwrap_or_default();
        let x: Vec<f64> = dcs.states.iter().map(|state| state.initial).collect();
        Run {
            system,
            options: discretize::Options {
                detection: Some(Detection {
                    cross: discretize::Cross::SumBoth,
                    equilibration: Equilibration::Mean { weight: 1.0 },
                    ..detection
                }),
                ..fesd
            },
            horizon: settings.horizon,
            steps,
            limit: limit.clone(),
            rehearsed,
            programs: FxHashMap::default(),
            reached: 0.0,
            stepper: Stepper::new(contacts(&dcs), settings.horizon, &x),
            x,
            dcs,
            size: 0.0,
            jumps: Vec::new(),
            added: 0,
        }
    }

    /// Step by step.
    fn integrate(
        &mut self,
        settings: &Settings<'e>,
        watch: &mut dyn FnMut(Progress),
        estimates: bool,
    ) -> (Elements<'s, 'e>, Option<Failure>) {
        let tableau =
            nsd_solver::tableau::Tableau::new(self.options.scheme.0, self.options.scheme.1);
        let tableau = tableau.expect("the number of nodes has been checked");
        let ends = tableau.ends_at_node();
        let points: Vec<f64> = ([0.0].into_iter())
            .chain(tableau.nodes.iter().copied())
            .chain((!ends).then_some(1.0))
            .collect();
        let mut elements = Elements::new(self.system, &points, tableau.n_nodes());
        for k in 0..self.steps {
            let start = self.horizon * k as f64 / self.steps as f64;
            let end = self.horizon * (k + 1) as f64 / self.steps as f64;
            // Impulses without a motion, as those of Painlevé's paradox, may be solutions of a step.
            let rehearsed = self.rehearsed;
            let ended = rehearsed.and_then(|run| run.ended(start, end)).cloned();
            let limit = rehearsed.and_then(|run| run.accumulates(start, end));
            let step = match (ended, limit) {
                (Some(failure), _) => Err(failure),
                (None, Some(time)) => Err(Failure::Accumulation {
                    time,
                    span: settings.span,
                }),
                (None, None) => match self.step(start, end - start) {
                    Some(step) => self.outside(&step, start).map_or(Ok(step), Err),
                    None => Err(self.without_step(start, settings)),
                },
            };
            let step = match step {
                Ok(step) => step,
                Err(failure) => {
                    if k == 0 {
                        let alphas = vec![1.0; self.system.switches.len()];
                        elements.point(0.0, &self.x, &alphas);
                    }
                    return (elements, Some(failure));
                }
            };
            self.take(&step, (start, end), &mut elements);
            watch(Progress {
                time: end,
                horizon: self.horizon,
                steps: k + 1,
                events: self.jumps.len(),
                estimates,
            });
        }
        (elements, None)
    }

    /// Why there is no step from an instant.
    fn without_step(&self, time: f64, settings: &Settings) -> Failure {
        let span = settings.span;
        match self.limit.over() {
            Some(over) => Failure::over(over, time, span),
            None => Failure::Unsolved { time, span },
        }
    }

    /// A step from the present state.
    fn step(&mut self, start: f64, length: f64) -> Option<Step> {
        let elements = self
            .options
            .detection
            .map_or(1, |detection| detection.elements);
        // With fewer elements than the step has parts there is no solution.
        let parts = |run: &Rehearsed| run.parts(start, start + length).min(MOST_PARTS);
        let parts = self.rehearsed.map_or(1, parts);
        let least = parts.saturating_sub(elements);
        let from = self.begin(start);
        check_start(&self.dcs, start).ok()?;
        for added in least..=least + MOST_ADDED {
            // Making the program of many contacts may take longer than solving it.
            if self.limit.is_over() {
                return None;
            }
            if let Some(step) = self.solve(&from, length, elements + added) {
                self.added += added;
                return Some(step);
            }
        }
        None
    }

    fn solve(&mut self, from: &StepStart, length: f64, elements: usize) -> Option<Step> {
        let start = from.time;
        if !self.programs.contains_key(&elements) {
            let made = self.program(start, elements)?;
            self.programs.insert(elements, made);
        }
        let made = self.programs.get_mut(&elements)?;
        let closed = |rehearsed: &Rehearsed| rehearsed.closed(start, start + length, elements);
        let closed = self.rehearsed.map(closed).unwrap_or_default();
        let mut w = made.step.start_from(from, &closed);
        if let Some(rehearsed) = self.rehearsed {
            let interval = (start, start + length);
            let bounds = made.step.program.variable_bounds();
            let bounds = bounds.lower.iter().zip(bounds.upper).zip(&w);
            let bounds = bounds.map(|((&l, &u), &w)| Bounds::between(l, u, w));
            let bounds: Vec<Bounds> = bounds.collect();
            let of = (&self.dcs, &made.layout, &bounds[..]);
            rehearsed.fill(of, 1, interval, 0.0, &mut w);
        }
        let w = (self.stepper).solve(&mut made.step, &w, start, &self.limit)?;
        Some(Step { elements, w })
    }

    /// The program of steps with so many elements, whatever they start from.
    fn program(&self, start: f64, elements: usize) -> Option<StepProgram> {
        let mut options = self.options;
        options.detection = options.detection.map(|detection| Detection {
            elements,
            spread: elements as f64 - 1.0,
            ..detection
        });
        let grid = Grid {
            start,
            horizon: self.horizon / self.steps as f64,
            steps: 1,
        };
        StepProgram::new(self.system, &self.dcs, grid, &options)
    }

    /// Gives the complementarity system the present state, and z the values there: where a step starts.
    fn begin(&mut self, start: f64) -> StepStart {
        for (state, &x) in self.dcs.states.iter_mut().zip(&self.x) {
            state.initial = x;
        }
        let known = self.values(&self.x, start);
        let value = |var: Var| known.get(&var).copied().unwrap_or(f64::NAN);
        let mut z = solve_pointwise(self.system, &self.dcs, &value).algebraics;
        let size = self.x.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        for impact in &self.dcs.impacts {
            let gap = &mut z[impact.gap];
            if *gap <= CLOSED * size {
                *gap = 0.0;
            }
        }
        for (algebraic, &z) in self.dcs.algebraics.iter_mut().zip(&z) {
            algebraic.guess = z;
        }
        StepStart {
            time: start,
            x: self.x.clone(),
            z,
        }
    }

    /// A contact that strikes in a step with a coefficient that no contact has.
    fn outside(&mut self, Step { elements, w }: &Step, start: f64) -> Option<Failure> {
        let step = &self.programs[elements].step;
        let (time, c, of) = self.stepper.outside(step, w, start)?;
        let impact = &self.dcs.impacts[c];
        let label =
            LabeledSpan::new_with_span(Some(format!("contact `{}`", impact.name)), impact.span);
        Some(outcome::outside(
            of,
            (time, impact.name.clone()),
            vec![label],
        ))
    }

    /// Adds a step to the elements, and goes to its end.
    fn take(&mut self, step: &Step, interval: (f64, f64), elements: &mut Elements<'s, 'e>) {
        let w = &step.w;
        let StepProgram { step, layout } = &self.programs[&step.elements];
        let passed = self.stepper.pass(step, w, interval);
        for (j, element) in passed.into_iter().enumerate() {
            let (from, to) = (element.from, element.to);
            let at = |m: usize| alphas(&self.dcs, layout, w, (j + 1, m));
            let alphas: Vec<Vec<f64>> = (1..=layout.nodes).map(at).collect();
            let [before, after] = [step.before(w, j), step.states(w, j, 0)];
            if from == 0.0 && j == 0 {
                elements.point(0.0, before, &alphas[0]);
            }
            if !element.struck.is_empty() {
                let struck = element.struck;
                elements.jump(from, struck.clone(), [before, after], &alphas[0]);
                self.jumps.push((from, struck));
            }
            if element.is_long {
                let points = layout.points.iter();
                let instants: Vec<f64> = points.map(|c| from + (to - from) * c).collect();
                let x: Vec<&[f64]> = (0..=layout.end).map(|m| step.states(w, j, m)).collect();
                elements.element(&instants, &x, &alphas);
            }
            elements.point(to, step.states(w, j, layout.end), &alphas[layout.nodes - 1]);
        }
        self.reached = interval.1;
        let last = step.states(w, layout.elements - 1, layout.end);
        self.x.copy_from_slice(last);
        self.size = self.x.iter().fold(self.size, |m: f64, x| m.max(x.abs()));
    }

    /// Parameters, states and time, as numbers.
    fn values(&self, x: &[f64], time: f64) -> FxHashMap<Var, f64> {
        let params = self.dcs.params.iter().map(|param| (param.var, param.value));
        let states = self.dcs.states.iter().map(|state| state.var);
        let known = params.chain(states.zip(x.iter().copied()));
        let known = known.chain([(self.dcs.time, time)]);
        known
            .filter_map(|(var, value)| Some((var.as_variable()?, value)))
            .collect()
    }
}

/// α of the switches at a node of an element; of a contact, 1 - λ_n.
fn alphas(dcs: &Dcs, layout: &Layout, w: &[f64], (j, m): (usize, usize)) -> Vec<f64> {
    let places = dcs.algebraics.iter().enumerate();
    let known = places.filter_map(|(i, z)| Some((z.var.as_variable()?, w[layout.z(1, j, m, i)?])));
    let known: FxHashMap<Var, f64> = known.collect();
    let value = |var: Var| known.get(&var).copied().unwrap_or(f64::NAN);
    dcs.alphas.iter().map(|alpha| alpha.eval(&value)).collect()
}

/// A task with nothing to decide.
fn nothing<'e>(cost: Expr<'e>, settings: &Settings) -> Task<'e> {
    Task {
        controls: Vec::new(),
        shape: Shape::Constant,
        horizon: None,
        params: Vec::new(),
        initial: Vec::new(),
        bounds: Vec::new(),
        integrals: 0,
        clock: None,
        cost: Cost {
            value: cost,
            terms: Vec::new(),
            span: settings.span,
        },
        rows: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use crate::report::Status;
    use crate::simulate::{Request, run_watched};
    use crate::testing::with_last;

    /// A ball that falls, slips and comes to rest in six steps, and in the twelve of the finer run: the first step of each
    /// makes the program of all.
    #[test]
    fn no_expression_is_made_behind_the_first_step() {
        let text = "model m {
                      state q[2] = [0, 0.5]; state v[2] = [2, 0];
                      q' = v;
                      mechanics q, v {
                        mass = eye(2); force = [0, -9.81];
                        contact floor { gap = q[2]; slip = v[1]; restitution = 0; friction = 0.6; }
                      }
                    }
                    simulate o of m {
                      horizon 1.2; lower impact;
                      method fesd { scheme = radau_iia(3); steps = 6; elements = 3; }
                    }";
        with_last(text, |compiled| {
            let (system, mut counts) = (&compiled.system, [Vec::new(), Vec::new()]);
            let request = Request::default();
            let run = run_watched(system, &compiled.settings, &request, &mut |progress| {
                counts[usize::from(progress.estimates)].push(system.exprs.n_nodes());
            });
            assert_eq!(run.status, Status::Solved);
            for (counts, steps) in counts.iter().zip([6, 12]) {
                assert_eq!(*counts, vec![counts[0]; steps]);
            }
        });
    }
}
