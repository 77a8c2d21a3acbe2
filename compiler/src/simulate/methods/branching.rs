//! Several solutions that go on, where a method takes one of them without a choice.
//!
//! Steps solve equations that each of these solutions satisfies, and a field without switches has a value wherever it is
//! looked at. So the selection of events is asked how a run goes on where it starts, and where something slides, at
//! either end of the steps that have the same sides.

use std::ops::ControlFlow;

use nsd_solver::event::{Event, Observer, Segment, Simulator};
use nsd_solver::hybrid::{Side, Status};
use nsd_solver::selector::{Candidate, ModeSelector, Query};

use super::solver_settings;
use crate::expr::variables_of;
use crate::lowering::hybrid;
use crate::report::Warning;
use crate::simulate::driver::Problem;
use crate::simulate::outcome;
use crate::system::{Role, System};

/// A ψ that is no smaller than this, next to 1 and to its terms, is off its surface without a closer look.
const NEAR: f64 = 1e-9;

/// Asks the selection of events how a system goes on.
pub(super) struct Branching {
    /// The parameters that stay open, by their numbers.
    open: Vec<usize>,
    /// Compiled where it is asked first.
    selector: Option<Simulator>,
    /// Whether that has the numbers of the present run.
    is_ready: bool,
    /// The first instant from which several solutions go on, and these.
    found: Option<(f64, Vec<Candidate>)>,
}

impl Branching {
    /// For a system with some parameters open, by their numbers.
    pub fn new(open: &[usize]) -> Self {
        Branching {
            open: open.to_vec(),
            selector: None,
            is_ready: false,
            found: None,
        }
    }

    /// Looks at the start of a run.
    pub fn begin(&mut self, problem: &Problem) {
        (self.is_ready, self.found) = (false, None);
        if !meets(problem.system, &problem.x0) {
            return;
        }
        let scale: Vec<f64> = problem.x0.iter().map(|x| x.abs()).collect();
        let start = Query {
            t: 0.0,
            t1: problem.settings.horizon,
            x: &problem.x0,
            scale: &scale,
            before: None,
            triggers: &[],
            fold: None,
        };
        self.ask(problem, start);
    }

    /// Looks at the start of a run in steps, and passes on what it does, with a look where sides have changed.
    pub fn follow<'r, 'e>(
        &'r mut self,
        problem: &'r Problem<'r, 'e>,
        observer: &'r mut dyn Observer,
    ) -> Following<'r, 'e> {
        self.begin(problem);
        Following {
            branching: self,
            observer,
            scale: problem.x0.iter().map(|x| x.abs()).collect(),
            last: Last::default(),
            has_changed: true,
            problem,
        }
    }

    /// That several solutions go on, if they do.
    pub fn warning(&self, system: &System) -> Option<Warning> {
        let (time, candidates) = self.found.as_ref()?;
        Some(outcome::several(system, candidates, *time))
    }

    fn ask(&mut self, problem: &Problem, query: Query) {
        let (system, settings) = (problem.system, problem.settings);
        let selector = self.selector.get_or_insert_with(|| {
            let hybrid = hybrid::lower_at(system, &self.open);
            let numerics = &settings.numerics;
            let limit = problem.limit.clone();
            let chosen = solver_settings(&numerics.method, numerics.tolerance, limit);
            Simulator::new(hybrid, chosen)
        });
        if !std::mem::replace(&mut self.is_ready, true) {
            selector.set_limit(problem.limit.clone());
            selector.set_parameters(&system.values_of(&self.open));
            selector.set_data(0, &hybrid::data_of(system));
        }
        let time = query.t;
        if let Err(Status::NonUnique(candidates)) = selector.next(query) {
            self.found = Some((time, candidates));
        }
    }
}

/// Passes on what a run in steps does.
pub(super) struct Following<'r, 'e> {
    branching: &'r mut Branching,
    problem: &'r Problem<'r, 'e>,
    observer: &'r mut dyn Observer,
    /// The largest magnitude of each state so far.
    scale: Vec<f64>,
    last: Last,
    /// Whether the step that comes is the first one with its sides.
    has_changed: bool,
}

/// The end of a step.
#[derive(Default)]
struct Last {
    t: f64,
    x: Vec<f64>,
    sides: Vec<Side>,
    alpha: Vec<f64>,
}

impl Following<'_, '_> {
    /// Looks at the end of the run.
    pub fn finish(mut self) {
        self.look();
    }

    /// Asks about what slides at the end of the last step, unless several solutions have been found.
    fn look(&mut self) {
        let Last { t, x, sides, alpha } = &self.last;
        let switches = self.problem.system.switches.iter().zip(sides);
        let slides = switches.enumerate().filter(|(_, (switch, side))| {
            **side == Side::Slide && switch.role == Role::Step && !switch.unilateral
        });
        let triggers: Vec<usize> = slides.map(|(k, _)| k).collect();
        if triggers.is_empty() || self.branching.found.is_some() {
            return;
        }
        let query = Query {
            t: *t,
            t1: t + self.problem.settings.horizon,
            x,
            scale: &self.scale,
            before: Some((sides, alpha)),
            triggers: &triggers,
            fold: None,
        };
        self.branching.ask(self.problem, query);
    }
}

impl Observer for Following<'_, '_> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        let is_first = std::mem::take(&mut self.has_changed);
        if is_first {
            self.look();
        }
        for (scale, x) in self.scale.iter_mut().zip(segment.end) {
            *scale = scale.max(x.abs());
        }
        let last = &mut self.last;
        last.t = segment.until;
        segment.end.clone_into(&mut last.x);
        segment.sides.clone_into(&mut last.sides);
        last.alpha.resize(segment.sides.len(), 0.0);
        segment.alpha(segment.length, &mut last.alpha);
        if is_first {
            self.look();
        }
        self.observer.segment(segment)
    }

    fn event(&mut self, event: &Event) {
        self.has_changed = true;
        self.observer.event(event);
    }
}

/// Whether something may be on its surface at the start; algebraic states always are.
fn meets(system: &System, x0: &[f64]) -> bool {
    let values = system.valuation(0.0, x0, &[]);
    system.switches.iter().any(|switch| {
        let psi = values.value(switch.psi);
        let inside = variables_of(&[switch.psi]);
        let states = system.states.iter().zip(x0);
        let terms = states.filter_map(|(state, x)| {
            let var = state.var.as_variable()?;
            let is_inside = inside.binary_search(&var).is_ok() && *x != 0.0;
            is_inside.then(|| values.value(switch.psi.diff(var)) * x)
        });
        let size = terms.fold(1.0, |size: f64, term| size.max(term.abs()));
        // What reads an α has no value yet.
        switch.role != Role::Step || psi.is_nan() || psi.abs() <= NEAR * size
    })
}
