//! An optimal control problem that is compiled once and solved many times, from other initial states.
//!
//! What initial values are given are inputs of its program. So another initial state compiles nothing: the program is
//! solved from the last solution, and what is found has the certificate and the simulations of a run by itself. A zero
//! is a value like all others.
//!
//! ```
//! use nsdc::expr::Exprs;
//! use nsdc::limit::Limit;
//! use nsdc::report::Status;
//! use nsdc::Project;
//!
//! let project = Project::from_text("brake.nsd", "
//!     model brake { state x = 1; control u in [-9, 9]; x' = u; }
//!     optimize o of brake { horizon 1; intervals 2; minimize integral(u^2); final { x = 0; } }");
//! let exprs = Exprs::new();
//! let mut prepared = project.prepare_optimal(&exprs, "o", &[]).expect("it is a program");
//! assert_eq!(prepared.states(), ["x"]);
//!
//! // From x to 0 within a second: u = -x.
//! let (limit, mut last) = (Limit::default(), None);
//! for x in [1.0, 0.0, -2.0] {
//!     let solved = prepared.solve(&[x], last.as_ref(), &limit, &mut ()).expect("a number for x");
//!     assert_eq!(solved.trajectory.status, Status::Solved);
//!     let u = &solved.trajectory.controls[0];
//!     assert!((u.at(0)[0] + x).abs() < 1e-9);
//!     last = Some(solved);
//! }
//! assert!(prepared.solve(&[f64::NAN], None, &limit, &mut ()).is_err());
//! ```

use super::{Given, Problem, Sampled, Solved, refused};
use crate::diagnostics::Diagnostics;
use crate::diagnostics::messages::Messages;
use crate::limit::Limit;
use crate::lowering::discretize::check_given;
use crate::optimize::start::Start;
use crate::project::clock::Instant;
use crate::project::watch::Watch;
use crate::report::{Status, Warning};
use crate::simulate::Consistent;
use crate::source::SourceMap;
use crate::system::System;
use crate::system::experiment::{Optimize, Settings};

/// An optimal control problem that is ready to be solved from other initial states.
pub struct Prepared<'e> {
    problem: Problem<'e>,
    /// What a first solution is guessed from.
    sampled: Vec<Sampled>,
    /// The places of the states whose initial values are given.
    given: Vec<usize>,
    names: Vec<String>,
    /// x(0) of the experiment, from which algebraic states are looked for.
    initial: Vec<f64>,
    /// What compilation has warned of, from wherever it starts.
    warnings: Vec<Warning>,
    /// What finds algebraic states, where there are any.
    consistent: Option<Consistent>,
    sources: SourceMap,
}

/// Why an optimal control problem is not prepared.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// There is no such experiment, or it does not compile.
    #[error("{0}")]
    NotCompiled(Messages),
    /// It is a simulation.
    #[error("`{0}` optimizes nothing")]
    NoTask(String),
    /// Which contacts and relays act where numerical time begins is compiled in.
    #[error("`{0}` is in numerical time, which is compiled for its initial state")]
    Frozen(String),
}

/// Why there is no solution from an initial state.
#[derive(Debug, thiserror::Error)]
pub enum SolveError {
    /// There are not as many numbers as states.
    #[error("{found} numbers for {wanted} initial values")]
    Count {
        /// How many were given.
        found: usize,
        /// How many there are.
        wanted: usize,
    },
    /// An initial value is no number.
    #[error("`{name}` starts at {value}")]
    NotFinite {
        /// The state.
        name: String,
        /// Its value.
        value: f64,
    },
    /// The solution to start from is one of another problem.
    #[error("the solution to start from is one of another problem")]
    Foreign,
    /// The model does not begin there.
    #[error("{0}")]
    Start(Messages),
}

impl<'e> Prepared<'e> {
    /// A compiled experiment with its task, which is guessed from trajectories as [`super::run`] takes them; `diags` is
    /// what compilation has warned of.
    ///
    /// # Errors
    ///
    /// Where it has no program that takes initial values.
    pub(crate) fn new(
        system: &System<'e>,
        settings: &Settings<'e>,
        task: &Optimize<'e>,
        sampled: Vec<Sampled>,
        mut diags: Diagnostics,
        sources: SourceMap,
    ) -> Result<Self, PrepareError> {
        if settings.freezes() {
            return Err(PrepareError::Frozen(settings.name.clone()));
        }
        let problem = Problem::new(system, settings, task, Given::Inputs).map_err(|error| {
            let mut diags = Diagnostics::new();
            diags.push(refused(&error, settings));
            PrepareError::NotCompiled(Messages::new(diags, sources.clone()))
        })?;
        let mut at_start = Diagnostics::new();
        system.check_start(&mut at_start);
        diags.remove_known(&at_start);
        let task = system.task.as_ref();
        let n_integrals = task.map_or(0, |task| task.integrals);
        let freed = task.iter().flat_map(|task| &task.initial);
        let freed = freed.map(|free| free.place);
        let algebraic = system.algebraic_states();
        let others: Vec<usize> = freed.chain(algebraic.iter().copied()).collect();
        let given = 0..system.states.len() - n_integrals;
        let given: Vec<usize> = given.filter(|place| !others.contains(place)).collect();
        let name = |&place: &usize| system.states[place].name.clone();
        Ok(Prepared {
            names: given.iter().map(name).collect(),
            initial: system.states.iter().map(|state| state.initial).collect(),
            problem,
            sampled,
            given,
            warnings: Warning::all(&diags),
            consistent: (!algebraic.is_empty()).then(|| Consistent::new(system)),
            sources,
        })
    }

    /// The names of the states whose initial values are given, with their indices, in order.
    pub fn states(&self) -> &[String] {
        &self.names
    }

    /// Their values in the experiment.
    pub fn initial(&self) -> Vec<f64> {
        let values = self.given.iter().map(|&place| self.initial[place]);
        values.collect()
    }

    /// Solves the problem from an initial state, in the order of [`Prepared::states`]: from a solution, if there is one
    /// that leads to another, or else as the experiment does.
    ///
    /// # Errors
    ///
    /// For numbers with which the model does not begin. Whether the problem was solved says the status of what is found.
    pub fn solve(
        &mut self,
        x0: &[f64],
        from: Option<&Solved<'_>>,
        limit: &Limit,
        watch: &mut dyn Watch,
    ) -> Result<Solved<'e>, SolveError> {
        let started = Instant::now();
        let at_start = self.restart(x0)?;
        let near = match from {
            Some(from) => {
                let begin = self.problem.begin(Start::Variables(&from.w), limit);
                let begin = begin.ok_or(SolveError::Foreign)?;
                let solved = self.problem.outcome(begin, started, watch);
                let status = solved.trajectory.status;
                (status == Status::Solved || status.is_over()).then_some(solved)
            }
            None => None,
        };
        let mut solved = near.unwrap_or_else(|| {
            let begin = self.problem.begin(Start::Task(&self.sampled), limit);
            let begin = begin.expect("a task has a start");
            self.problem.outcome(begin, started, watch)
        });
        let warnings = self.warnings.iter().cloned().chain(at_start);
        solved.trajectory.warnings.splice(0..0, warnings);
        Ok(solved)
    }

    /// What there is to say about a solution: why it is none, and what it warns of.
    pub fn messages(&self, solved: &Solved<'e>) -> Messages {
        Messages::new(solved.trajectory.diagnostics(), self.sources.clone())
    }

    /// Gives everything other initial values, and says what the start warns of.
    fn restart(&mut self, x0: &[f64]) -> Result<Vec<Warning>, SolveError> {
        let (found, wanted) = (x0.len(), self.given.len());
        if found != wanted {
            return Err(SolveError::Count { found, wanted });
        }
        let mut values = self.names.iter().zip(x0);
        if let Some((name, &value)) = values.find(|(_, value)| !value.is_finite()) {
            let name = name.clone();
            return Err(SolveError::NotFinite { name, value });
        }
        let mut initial = self.initial.clone();
        for (&place, &value) in self.given.iter().zip(x0) {
            initial[place] = value;
        }
        match self.problem.restart(&initial, self.consistent.as_mut()) {
            diags if diags.has_errors() => {
                let messages = Messages::new(diags, self.sources.clone());
                Err(SolveError::Start(messages))
            }
            diags => Ok(Warning::all(&diags)),
        }
    }
}

impl Problem<'_> {
    /// Gives x(0) to the system and all that was made of it; an error is why the model does not begin there.
    fn restart(&mut self, initial: &[f64], consistent: Option<&mut Consistent>) -> Diagnostics {
        for (state, &value) in self.system.states.iter_mut().zip(initial) {
            state.initial = value;
        }
        let mut diags = Diagnostics::new();
        self.system.check_start(&mut diags);
        let consistent = consistent.filter(|_| !diags.has_errors());
        let settled = consistent.map(|found| found.settle(&mut self.system, self.settings.horizon));
        if let Some(Err(failure)) = settled {
            diags.push(failure);
        }
        if diags.has_errors() {
            return diags;
        }
        self.dcs.restart(&self.system);
        if let Err(error) = check_given(&self.dcs, 0.0) {
            diags.push(refused(&error, &self.settings));
            return diags;
        }
        for (index, value) in self.layout.guesses(&self.dcs) {
            self.mpcc.guess(index, value);
        }
        for (index, value) in self.layout.given(&self.dcs) {
            self.mpcc.give(index, value);
            self.program.set_value(index, value);
        }
        diags
    }
}
