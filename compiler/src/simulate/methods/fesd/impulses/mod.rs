//! Contacts by finite elements with jumps between them (FESD-J).
//!
//! Each step of the grid is the program of an optimal control problem with nothing to control: elements, impulses where
//! they meet, and complementarity (Nurkanović, Frey, Pozharskiy & Diehl 2024). It is made once for each number of
//! elements, and started from any instant and state. A run from event to event says which branch of it is solved first,
//! and in which elements contacts stay closed, where the rates of their gaps vanish at the nodes, too (`lowering/dcs/drift.rs`);
//! then the relaxed program is solved, and then one with more elements: a step with r switches and impacts needs r + 1.
//! Pairs are sums over an element, and lengths are equal where nothing happens between them, whatever `cross` and
//! `equilibration` say of the printed form: its solutions are the same.
//! What is found satisfies all equations and signs; gaps are looked at between the nodes, too.

mod compare;
mod program;

use std::sync::Arc;

use miette::LabeledSpan;
use nsd_solver::event::{Event, Observer, Segment};
use nsd_solver::fesd::jumps::{Points, StepStart, Stepper, Work};
use nsd_solver::hybrid::{Outcome, Side, Status};
use nsd_solver::integrate::tableau::Tableau;
use nsd_solver::linalg::analyses::Analyses;
use nsd_solver::optimization::problem::Nlp;
use rustc_hash::FxHashMap;

use program::{StepProgram, points};

use super::options;
use crate::expr::Expr;
use crate::limit::Limit;
use crate::lowering::dcs::{Dcs, Impact};
use crate::lowering::discretize::{Detection, Grid};
use crate::lowering::mpcc::Bounds;
use crate::lowering::{dcs, discretize};
use crate::report::{Failure, Method, MethodOption, Trajectory};
use crate::simulate::driver::{self, Accuracy, Ended, Problem, Run};
use crate::simulate::estimate::{Comparison, Estimate, Estimator};
use crate::simulate::methods::events::Events;
use crate::simulate::record::elements::{Rows, Shape};
use crate::simulate::record::reported::Reported;
use crate::simulate::{Lowered, ReferenceRun, Target, outcome};
use crate::system::System;
use crate::system::experiment::{Equilibration, FesdOptions, MethodKind, Settings};
use crate::system::task::{Cost, Shape as ControlShape, Task};

/// Steps where the experiment does not say how many.
const STEPS: usize = 50;
/// Elements that are added to a step at most.
const MOST_ADDED: usize = 2;
/// Parts of a step that are foreseen at most.
const MOST_PARTS: usize = 12;
/// Steps at most where the tolerance chooses them.
const MOST_STEPS: usize = 400;

/// A system with impulses, and the branch of its steps by events.
pub(in crate::simulate) struct WithImpulses<'e> {
    dcs: Dcs<'e>,
    points: Points,
    analyses: Analyses,
    /// The programs of steps.
    programs: Programs,
    /// The parameters that stay open, by their numbers.
    open: Vec<usize>,
    /// Runs from event to event, with what is told of them.
    events: Option<(Events, Arc<Reported>)>,
    reference: Option<ReferenceRun<'e>>,
    /// What the last runs on a grid, and on a finer one, have come to.
    coarse: Reached,
    fine: Reached,
    lowering: String,
}

/// Programs by the number of their elements and the bits of the length of their steps.
type Programs = FxHashMap<(usize, u64), StepProgram>;

/// What a run over a grid has come to.
#[derive(Clone, Debug, Default)]
struct Reached {
    steps: usize,
    horizon: f64,
    /// The end of the last step, and the state there.
    time: f64,
    x: Vec<f64>,
    /// The largest magnitude of a state so far.
    size: f64,
    /// Instants and laws of all jumps.
    jumps: Vec<(f64, Vec<usize>)>,
    /// The sides of switches from some instants on.
    sides: Vec<(f64, Box<[Side]>)>,
    work: Work,
    /// Elements that were added to steps.
    added: usize,
    /// Whether its observer has ended it.
    is_stopped: bool,
}

/// A run over one grid.
struct OnGrid<'s, 'e> {
    system: &'s System<'e>,
    dcs: &'s Dcs<'e>,
    options: discretize::Options,
    limit: &'s Limit,
    /// A run from event to event, where one begins.
    reference: Option<&'s ReferenceRun<'e>>,
    programs: &'s mut Programs,
    shape: Shape,
    reached: Reached,
    stepper: Stepper,
}

/// The functions of steps that start at a point.
struct FromStart<'s, 'e> {
    impacts: &'s [Impact<'e>],
    start: &'s StepStart,
    points: &'s mut Points,
}

impl<'e> Lowered<'e> for FromStart<'_, 'e> {
    fn impacts(&self) -> &[Impact<'e>] {
        self.impacts
    }

    fn initial(&self) -> Vec<f64> {
        self.start.x.clone()
    }

    fn direct(&mut self, alphas: &mut [f64], time: f64, x: &[f64]) {
        self.points.direct(alphas, time, x);
    }

    fn in_mode(&mut self, time: f64, x: &[f64], alphas: &[f64]) -> Vec<f64> {
        self.points.in_mode(time, x, alphas)
    }

    fn law(&mut self, contact: usize, time: f64, x: &[f64]) -> [f64; 2] {
        let law = self.points.laws(time, x).nth(contact);
        law.map_or([f64::NAN; 2], |[speed, restitution, _]| {
            [speed, restitution]
        })
    }
}

/// A step that is solved, and the number of its elements.
struct Step {
    elements: usize,
    w: Vec<f64>,
}

impl<'e> WithImpulses<'e> {
    /// Lowers a system, with some parameters open, by their numbers.
    pub fn new(system: &System<'e>, settings: &Settings<'e>, open: &[usize]) -> Self {
        let dcs = dcs::lower(system, &settings.lowerings);
        let mut dcs = dcs.expect("compilation has checked that the system can be lowered");
        dcs.task = Some(nothing(system.exprs.constant(0.0), settings));
        WithImpulses {
            lowering: format!("impact, {}", dcs.lowering.formulation),
            points: points(system, &dcs),
            analyses: Analyses::default(),
            programs: Programs::default(),
            open: open.to_vec(),
            events: None,
            dcs,
            reference: None,
            coarse: Reached::default(),
            fine: Reached::default(),
        }
    }

    /// Takes the values of all parameters of a system.
    fn load(&mut self, system: &System) {
        let values: Vec<f64> = system.params.iter().map(|param| param.value).collect();
        for (param, &value) in self.dcs.params.iter_mut().zip(&values) {
            param.value = value;
        }
        for made in self.programs.values_mut() {
            made.step.program.set_parameters(&values);
        }
        self.points.set_parameters(&values);
    }

    /// A run from event to event.
    fn follow(&mut self, problem: &Problem<'_, 'e>) -> ReferenceRun<'e> {
        let (system, settings) = ReferenceRun::asked(problem.system, problem.settings);
        let open = &self.open;
        let (events, reported) = self.events.get_or_insert_with(|| {
            let events = Events::new(&system, &settings, open);
            (events, Arc::new(Reported::new(&system, open)))
        });
        let request = ReferenceRun::request(problem.limit);
        let of = (&system, &settings);
        let run = driver::drive(events, of, reported, &request, &mut |_| {});
        ReferenceRun::of(system, run)
    }
}

/// The steps of an attempt.
fn steps(options: &FesdOptions, attempt: usize) -> usize {
    options.steps.unwrap_or(STEPS << (attempt - 1))
}

impl<'e> Run<'e> for WithImpulses<'e> {
    /// The finer run has twice as many steps, each of one element more.
    fn march(
        &mut self,
        problem: &Problem<'_, 'e>,
        accuracy: Accuracy,
        observer: &mut dyn Observer,
    ) -> Ended {
        let Problem {
            system, settings, ..
        } = problem;
        if accuracy.attempt == 1 && !accuracy.is_finer {
            self.load(system);
            self.reference = Some(self.follow(problem));
        }
        let (mut options, mut steps) = (
            *options(settings),
            steps(options(settings), accuracy.attempt),
        );
        if accuracy.is_finer {
            // With as many elements, twice as many steps could cut an interval between two events as before.
            (options.elements, steps) = (options.elements + 1, 2 * steps);
        }
        let reference = self.reference.as_ref().filter(|run| run.begins());
        let stepper = Stepper::new(
            self.points.clone(),
            self.analyses.clone(),
            problem.settings.horizon,
            &problem.x0,
        );
        let of = (&self.dcs, &mut self.programs);
        let mut run = OnGrid::new(problem, of, stepper, &options, steps);
        run.reference = reference;
        let failure = run.integrate(settings, observer);
        let reached = run.reached;
        let outcome = reached.outcome(system);
        match accuracy.is_finer {
            false => self.coarse = reached,
            true => self.fine = reached,
        }
        Ended { outcome, failure }
    }

    fn describe(&self, problem: &Problem<'_, 'e>, _: &Ended) -> Method {
        let options = options(problem.settings);
        let (family, nodes) = options.scheme;
        let number =
            |name: &str, value: usize| (name.to_owned(), MethodOption::Number(value as f64));
        let word =
            |name: &str, value: &str| (name.to_owned(), MethodOption::Text(value.to_owned()));
        let mut shown = vec![
            word("scheme", &format!("{}({nodes})", family.word())),
            word("lowering", &self.lowering),
            number("steps", self.coarse.steps),
            number("elements", options.elements),
        ];
        let added = self.coarse.added;
        shown.extend((added > 0).then(|| number("added_elements", added)));
        Method {
            name: MethodKind::Fesd.word().into(),
            options: shown,
        }
    }

    fn estimator(&self, settings: &Settings<'e>) -> Estimator {
        Estimator::of_elements(settings)
    }

    fn compares(&self, ended: &Ended) -> bool {
        ended.is_solved()
    }

    fn takes_numbers(&self) -> bool {
        self.dcs.data.is_empty()
    }

    fn estimate(
        &mut self,
        _: &Problem<'_, 'e>,
        _: &Comparison,
        [_, finer]: [&Ended; 2],
    ) -> Option<Estimate> {
        let is_over = finer.failure.as_ref().is_some_and(Failure::is_over);
        (!is_over).then(|| self.coarse.compare(&self.fine, finer.is_solved()))
    }

    /// Twice as many steps.
    fn refined(
        &mut self,
        settings: &Settings<'e>,
        accuracy: Accuracy,
        ended: &Ended,
        estimate: Option<&Estimate>,
    ) -> Option<Accuracy> {
        let options = options(settings);
        let error = estimate.map_or(0.0, |estimate| estimate.error);
        let is_unsolved = matches!(ended.failure, Some(Failure::Unsolved { .. }));
        let is_open = options.steps.is_none() && steps(options, accuracy.attempt) < MOST_STEPS;
        let is_needed = error > settings.tolerance || is_unsolved;
        (is_open && is_needed).then(|| accuracy.next(accuracy.tolerance))
    }

    fn tell(&mut self, _: &Problem<'_, 'e>, _: &Ended, trajectory: &mut Trajectory) {
        let work = self.coarse.work;
        trajectory.certificate.max_violation = work.violation;
        trajectory.stats.homotopy_steps = work.relaxed as u64;
    }
}

impl Reached {
    /// As of every simulation.
    fn outcome(&self, system: &System) -> Outcome {
        let open = || vec![Side::Plus; system.switches.len()];
        let last = self.sides.last();
        let sides = last.map_or_else(open, |(_, sides)| sides.to_vec());
        let x = self.x[..system.states.len()].to_vec();
        let status = match self.is_stopped {
            true => Status::Stopped,
            false => Status::Solved,
        };
        Outcome {
            stats: nsd_solver::hybrid::Stats {
                steps: self.steps,
                newton_iterations: self.work.iterations,
                ..nsd_solver::hybrid::Stats::default()
            },
            ..Outcome::at(status, self.time, x, sides)
        }
    }
}

impl<'s, 'e> OnGrid<'s, 'e> {
    fn new(
        problem: &Problem<'s, 'e>,
        (dcs, programs): (&'s Dcs<'e>, &'s mut Programs),
        stepper: Stepper,
        options: &FesdOptions,
        steps: usize,
    ) -> Self {
        let fesd = discretize::Options::fesd(options);
        let detection = fesd.detection.unwrap_or_default();
        let horizon = problem.settings.horizon;
        let tableau = Tableau::new(fesd.scheme.0, fesd.scheme.1);
        let tableau = tableau.expect("the number of nodes has been checked");
        let points: Vec<f64> = ([0.0].into_iter())
            .chain(tableau.nodes.iter().copied())
            .chain((!tableau.ends_at_node()).then_some(1.0))
            .collect();
        OnGrid {
            system: problem.system,
            options: discretize::Options {
                detection: Some(Detection {
                    cross: discretize::Cross::SumBoth,
                    equilibration: Equilibration::Mean { weight: 1.0 },
                    ..detection
                }),
                ..fesd
            },
            limit: problem.limit,
            reference: None,
            programs,
            shape: Shape::new(&points, tableau.n_nodes()),
            stepper,
            dcs,
            reached: Reached {
                steps,
                horizon,
                x: problem.x0.clone(),
                ..Reached::default()
            },
        }
    }

    /// Step by step.
    fn integrate(
        &mut self,
        settings: &Settings<'e>,
        observer: &mut dyn Observer,
    ) -> Option<Failure> {
        let Reached { steps, horizon, .. } = self.reached;
        for k in 0..steps {
            let start = horizon * k as f64 / steps as f64;
            let end = horizon * (k + 1) as f64 / steps as f64;
            // Impulses without a motion, as those of Painlevé's paradox, may be solutions of a step.
            let reference = self.reference;
            let ended = reference.and_then(|run| run.ended(start, end)).cloned();
            let limit = reference.and_then(|run| run.accumulates(start, end));
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
            match step {
                Ok(step) => self.take(&step, (start, end), observer),
                Err(failure) => return Some(failure),
            }
            self.reached.work = self.stepper.work;
            if self.reached.is_stopped {
                break;
            }
        }
        None
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
        let parts = |run: &ReferenceRun| run.parts(start, start + length).min(MOST_PARTS);
        let parts = self.reference.map_or(1, parts);
        let least = parts.saturating_sub(elements);
        let from = self.stepper.points.start(start, &self.reached.x)?;
        for added in least..=least + MOST_ADDED {
            // Making the program of many contacts may take longer than solving it.
            if self.limit.is_over() {
                return None;
            }
            if let Some(step) = self.solve(&from, length, elements + added) {
                self.reached.added += added;
                return Some(step);
            }
        }
        None
    }

    fn solve(&mut self, from: &StepStart, length: f64, elements: usize) -> Option<Step> {
        let start = from.time;
        let key = self.key(elements);
        if !self.programs.contains_key(&key) {
            let made = self.program(start, elements)?;
            self.programs.insert(key, made);
        }
        let made = self.programs.get_mut(&key)?;
        let closed = |reference: &ReferenceRun| reference.closed(start, start + length, elements);
        let closed = self.reference.map(closed).unwrap_or_default();
        let mut w = made.step.start_from(from, &closed);
        if let Some(reference) = self.reference {
            let bounds = made.step.program.variable_bounds();
            let bounds = bounds.lower.iter().zip(bounds.upper).zip(&w);
            let bounds = bounds.map(|((&l, &u), &w)| Bounds::between(l, u, w));
            let bounds: Vec<Bounds> = bounds.collect();
            let step = Target {
                layout: &made.layout,
                bounds: &bounds,
                number: 1,
                interval: (start, start + length),
                window: 0.0,
            };
            let mut lowered = FromStart {
                impacts: &self.dcs.impacts,
                start: from,
                points: &mut self.stepper.points,
            };
            reference.fill(&mut lowered, &step, &mut w);
        }
        let w = (self.stepper).solve(&mut made.step, &w, start, self.limit)?;
        Some(Step { elements, w })
    }

    /// The length of a step.
    fn length(&self) -> f64 {
        self.reached.horizon / self.reached.steps as f64
    }

    fn key(&self, elements: usize) -> (usize, u64) {
        (elements, self.length().to_bits())
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
            horizon: self.length(),
            steps: 1,
        };
        StepProgram::new(self.system, self.dcs, grid, &options)
    }

    /// A contact that strikes in a step with a coefficient that no contact has.
    fn outside(&mut self, Step { elements, w }: &Step, start: f64) -> Option<Failure> {
        let step = &self.programs[&self.key(*elements)].step;
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

    /// Tells the elements of a step, and goes to its end.
    fn take(&mut self, step: &Step, interval: (f64, f64), observer: &mut dyn Observer) {
        let w = &step.w;
        let StepProgram { step, layout } = &self.programs[&self.key(step.elements)];
        let (system, reached) = (self.system, &mut self.reached);
        let n = system.states.len();
        let mut passed = self.stepper.pass(step, w, interval);
        // Behind the last mode there is rounding.
        if let Some(last) = passed.iter_mut().rfind(|element| element.is_long) {
            last.to = interval.1;
        }
        for (j, element) in passed.into_iter().enumerate() {
            let (from, to) = (element.from, element.to);
            let at = |m: usize| self.stepper.alphas(step, w, j, m);
            let values: Vec<Vec<f64>> = (1..=layout.nodes).map(at).collect();
            let points = layout.points.iter();
            let instants: Vec<f64> = points.map(|c| from + (to - from) * c).collect();
            let x: Vec<&[f64]> = (0..=layout.end).map(|m| step.states(w, j, m)).collect();
            let found = element
                .is_long
                .then(|| self.shape.element(system, &instants, &x, &values));
            let before = reached.sides.last().map(|(_, sides)| sides.clone());
            let sides = found.as_ref().map(|(_, sides)| sides.clone());
            let sides = sides.or_else(|| before.clone());
            let sides = sides.unwrap_or_else(|| vec![Side::Plus; values[0].len()].into());
            let left = before.unwrap_or_else(|| sides.clone());
            if !element.struck.is_empty() || left != sides {
                observer.event(&Event {
                    time: from,
                    x: &step.states(w, j, 0)[..n],
                    before: &step.before(w, j)[..n],
                    jumps: &element.struck,
                    decisions: &[],
                    from: &left,
                    to: &sides,
                    accumulates: false,
                });
            }
            if !element.struck.is_empty() {
                reached.jumps.push((from, element.struck));
            }
            if let Some((piece, sides)) = found {
                let rows = Rows { piece: &piece, n };
                let end = &x[layout.end][..n];
                let segment = Segment::new(from, to - from, to, &sides, end, &rows);
                reached.is_stopped = observer.segment(&segment).is_break();
                reached.sides.push((from, sides));
            }
            reached.time = to;
            reached.x.copy_from_slice(x[layout.end]);
            if reached.is_stopped {
                break;
            }
        }
        reached.size = reached
            .x
            .iter()
            .fold(reached.size, |m: f64, x| m.max(x.abs()));
    }
}

/// A task with nothing to decide.
fn nothing<'e>(cost: Expr<'e>, settings: &Settings) -> Task<'e> {
    Task {
        controls: Vec::new(),
        shape: ControlShape::Constant,
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
                assert!(counts.len() >= steps);
                assert_eq!(*counts, vec![counts[0]; counts.len()]);
            }
        });
    }
}
