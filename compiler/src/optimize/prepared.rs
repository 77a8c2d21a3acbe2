//! An optimal control problem that is compiled once and solved many times, with other parameters and initial states.
//!
//! The values of parameters that stay open and what initial values are given are inputs of its program. So other numbers
//! compile nothing: the program is solved from the last solution, and what is found has the certificate and the
//! simulations of a run by itself. An initial value of zero is one like all others; a parameter stays on its side of zero,
//! as in [`crate::prepared`]. What a parameter would compile anew, as an exponent or the regions that there are, is
//! refused.
//!
//! ```
//! use nsdc::expr::Exprs;
//! use nsdc::limit::Limit;
//! use nsdc::report::Status;
//! use nsdc::Project;
//!
//! let project = Project::from_text("brake.nsd", "
//!     model brake { param m = 1; state x = 1; control u in [-9, 9]; x' = u/m; }
//!     optimize o of brake { horizon 1; intervals 2; minimize integral(u^2); final { x = 0; } }");
//! let exprs = Exprs::new();
//! let prepared = project.prepare_optimal(&exprs, "o", &["m"], &[]);
//! let mut prepared = prepared.expect("it is a program");
//! assert_eq!(prepared.parameters()[0].name, "m");
//! assert_eq!(prepared.states(), ["x"]);
//!
//! // From x to 0 within a second: u = -m x.
//! let (limit, mut last) = (Limit::default(), None);
//! for (m, x) in [(1.0, 1.0), (1.0, 0.0), (2.0, -2.0)] {
//!     let solved = prepared.solve(&[m], Some(&[x]), last.as_ref(), &limit, &mut ());
//!     let solved = solved.expect("numbers that they may have");
//!     assert_eq!(solved.trajectory.status, Status::Solved);
//!     let u = &solved.trajectory.samples.controls[0];
//!     assert!((u.at(0)[0] + m * x).abs() < 1e-9);
//!     last = Some(solved);
//! }
//! assert!(prepared.solve(&[1.0], Some(&[f64::NAN]), None, &limit, &mut ()).is_err());
//! assert!(prepared.solve(&[-1.0], None, None, &limit, &mut ()).is_err());
//! ```

use super::problem::Given;
use super::receding::given_states;
use super::{Problem, Sampled, Solved, refused};
use crate::Compiled;
use crate::diagnostics::Diagnostics;
use crate::diagnostics::messages::Messages;
use crate::expr::Expr;
use crate::limit::Limit;
use crate::lowering::discretize::{check_given, fixed_params};
use crate::model::Domain;
use crate::optimize::start::Start;
use crate::project::clock::Instant;
use crate::project::prepared::{
    NotPrepared, NotRun, Opened, Parameter, check_count, check_parameters,
};
use crate::project::watch::Watch;
use crate::report::{Status, Warning};
use crate::simulate::Consistent;
use crate::source::SourceMap;
use crate::system::{Allowed, System};

/// An optimal control problem that is ready to be solved with other parameters and initial states.
pub struct Prepared<'e> {
    pub(super) problem: Problem<'e>,
    /// What a first solution is guessed from.
    pub(super) sampled: Vec<Sampled>,
    /// The parameters that stay open, and x(0) of the experiment as a function of them.
    opened: Opened,
    ends: Vec<MovingEnd<'e>>,
    /// The places of the states whose initial values are given.
    pub(super) given: Vec<usize>,
    names: Vec<String>,
    /// What compilation has warned of, from wherever it starts.
    warnings: Vec<Warning>,
    /// What finds algebraic states, where there are any.
    consistent: Option<Consistent>,
    sources: SourceMap,
}

/// An end of the range of a control that open parameters move.
struct MovingEnd<'e> {
    /// The number of the control in the task.
    control: usize,
    is_upper: bool,
    /// In parameters of the system.
    value: Expr<'e>,
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
    /// It is solved again and again, and differs from one time to the next.
    #[error(
        "it changes with time, or reads a table: time begins at 0 in every plan, and may only be added to the cost, by a \
         factor that is a number"
    )]
    ChangesWithTime,
    /// A parameter is none, or another value of it is another program.
    #[error(transparent)]
    Open(#[from] NotPrepared),
}

/// Why there is no solution with some numbers.
#[derive(Debug, thiserror::Error)]
pub enum SolveError {
    /// There are not as many numbers as parameters or states, or a parameter is where the problem was not prepared for it.
    #[error(transparent)]
    NotRun(#[from] NotRun),
    /// An initial value is no number.
    #[error("`{name}` starts at {value}")]
    NotFinite {
        /// The state.
        name: String,
        /// Its value.
        value: f64,
    },
    /// No value of a control is in its range.
    #[error("no value of `{name}` is in [{lower}, {upper}]")]
    EmptyRange {
        /// The control.
        name: String,
        /// The lower end of its range.
        lower: f64,
        /// The upper end.
        upper: f64,
    },
    /// The solution to start from is one of another problem.
    #[error("the solution to start from is one of another problem")]
    Foreign,
    /// The model does not begin there.
    #[error("{0}")]
    Start(Messages),
}

impl<'e> Prepared<'e> {
    /// A compiled experiment, which is guessed from trajectories as [`super::run`] takes them; `diags` is what compilation
    /// has warned of.
    ///
    /// # Errors
    ///
    /// Where it has no program that takes initial values and those of the parameters that stay open.
    pub(crate) fn new(
        compiled: &Compiled<'e>,
        sampled: Vec<Sampled>,
        mut diags: Diagnostics,
        sources: SourceMap,
    ) -> Result<Self, PrepareError> {
        let (system, settings) = (&compiled.system, &compiled.settings);
        let Some(asked) = &settings.optimize else {
            return Err(PrepareError::NoTask(settings.name.clone()));
        };
        if settings.freezes() {
            return Err(PrepareError::Frozen(settings.name.clone()));
        }
        let opened = Opened::inputs(compiled)?;
        let given = Given::Inputs(&opened.places);
        let mut asked = asked.clone();
        // One program serves all.
        asked.discretization.refines = false;
        let problem = Problem::new(system, settings, &asked, given).map_err(|error| {
            let mut diags = Diagnostics::new();
            diags.push(refused(&error, settings));
            PrepareError::NotCompiled(Messages::new(diags, sources.clone()))
        })?;
        let mut at_start = Diagnostics::new();
        system.check_start(&mut at_start);
        diags.remove_known(&at_start);
        let given = given_states(system);
        let name = |&place: &usize| system.states[place].name.clone();
        let consistent = || Consistent::new(system, &opened.places);
        Ok(Prepared {
            names: given.iter().map(name).collect(),
            problem,
            sampled,
            ends: MovingEnd::all(compiled),
            given,
            warnings: Warning::all(&diags),
            consistent: (!system.algebraic_states().is_empty()).then(consistent),
            opened,
            sources,
        })
    }

    /// The parameters that stay open, in the order in which their values are taken.
    pub fn parameters(&self) -> &[Parameter] {
        &self.opened.parameters
    }

    /// What is optimized.
    pub(crate) fn system(&self) -> &System<'e> {
        &self.problem.system
    }

    /// The names of the states whose initial values are given, with their indices, in order.
    pub fn states(&self) -> &[String] {
        &self.names
    }

    /// Their values in the experiment, with these values of the parameters.
    ///
    /// # Errors
    ///
    /// Where the problem was not prepared for them.
    pub fn initial(&self, parameters: &[f64]) -> Result<Vec<f64>, SolveError> {
        let initial = self.start(parameters)?;
        let values = self.given.iter().map(|&place| initial[place]);
        Ok(values.collect())
    }

    /// Solves the problem with these values of the parameters, in the order of [`Prepared::parameters`], and from an initial
    /// state, in the order of [`Prepared::states`], or the one that they give. It is solved from a solution, if there is
    /// one that leads to another, or else as the experiment does.
    ///
    /// # Errors
    ///
    /// For numbers that it was not prepared for, or with which the model does not begin. Whether the problem was solved
    /// says the status of what is found.
    pub fn solve(
        &mut self,
        parameters: &[f64],
        x0: Option<&[f64]>,
        from: Option<&Solved<'_>>,
        limit: &Limit,
        watch: &mut dyn Watch,
    ) -> Result<Solved<'e>, SolveError> {
        let started = Instant::now();
        let at_start = self.restart(parameters, x0)?;
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

    /// x(0) of the experiment with these values of the parameters.
    fn start(&self, parameters: &[f64]) -> Result<Vec<f64>, SolveError> {
        check_parameters(&self.opened.parameters, parameters)?;
        Ok(self.opened.initial(parameters))
    }

    /// Gives everything other numbers, and says what the start warns of.
    pub(super) fn restart(
        &mut self,
        parameters: &[f64],
        x0: Option<&[f64]>,
    ) -> Result<Vec<Warning>, SolveError> {
        let mut initial = self.start(parameters)?;
        if let Some(x0) = x0 {
            check_count(x0.len(), self.given.len(), "initial values")?;
            for (&place, &value) in self.given.iter().zip(x0) {
                initial[place] = value;
            }
        }
        let mut values = self.names.iter().zip(&self.given);
        if let Some((name, &place)) = values.find(|(_, place)| !initial[**place].is_finite()) {
            let (name, value) = (name.clone(), initial[place]);
            return Err(SolveError::NotFinite { name, value });
        }
        self.problem.set_parameters(parameters, &self.ends)?;
        match self.problem.restart(&initial, self.consistent.as_mut()) {
            diags if diags.has_errors() => {
                let messages = Messages::new(diags, self.sources.clone());
                Err(SolveError::Start(messages))
            }
            diags => Ok(Warning::all(&diags)),
        }
    }
}

impl<'e> MovingEnd<'e> {
    /// Those of an experiment; an end that depends on what is optimized, too, is a constraint.
    fn all(compiled: &Compiled<'e>) -> Vec<Self> {
        let values = &compiled.settings.values;
        let moves = |end: &Expr<'e>| {
            let (input, decided) = (
                values.free.input_in(&[*end]),
                values.free.decided_in(&[*end]),
            );
            input.is_some() && decided.is_none()
        };
        let quantities = &compiled.model.quantities.controls;
        let task = compiled.system.task.iter();
        let controls = task.flat_map(|task| task.controls.iter().enumerate());
        let ends = controls.flat_map(|(control, decided)| {
            let mut found = Vec::new();
            for quantity in quantities {
                let place = quantity.vars.iter().position(|var| *var == decided.var);
                if let (Some(k), Some(Domain::Box(low, high))) = (place, &quantity.domain) {
                    found.extend([(false, low.data[k]), (true, high.data[k])]);
                }
            }
            let found = found.into_iter().filter(|(_, end)| moves(end));
            found.map(move |(is_upper, end)| MovingEnd {
                control,
                is_upper,
                value: end.substitute(&values.signals),
            })
        });
        ends.collect()
    }
}

impl Problem<'_> {
    /// Gives the open parameters values, and the ranges of controls the ends that they have with them.
    fn set_parameters(&mut self, values: &[f64], ends: &[MovingEnd<'_>]) -> Result<(), SolveError> {
        for (&place, &value) in self.open.iter().zip(values) {
            self.system.exogenous.params[place].value = value;
            self.dcs.params[place].value = value;
        }
        self.mpcc.params = fixed_params(&self.dcs);
        self.program.set_parameters(&self.mpcc.parameters());
        let known = self.system.parameters();
        for end in ends {
            let value = known.value(end.value);
            for task in [&mut self.system.task, &mut self.dcs.task] {
                let control = task.as_mut().map(|task| &mut task.controls[end.control]);
                let range = control.and_then(|control| control.allowed.as_mut());
                if let Some(Allowed::Between(lower, upper)) = range {
                    *(if end.is_upper { upper } else { lower }) = value;
                }
            }
        }
        for end in ends {
            let (layout, stated) = (&self.layout, &self.mpcc.stated);
            for (index, bounds) in layout.control_bounds(&self.dcs, stated, end.control) {
                let (lower, upper) = (bounds.lower, bounds.upper);
                if lower > upper {
                    let task = self.dcs.task.iter();
                    let name = task.map(|task| task.controls[end.control].name.clone());
                    return Err(SolveError::EmptyRange {
                        name: name.collect(),
                        lower,
                        upper,
                    });
                }
                *self.mpcc.bound_mut(index) = bounds;
                self.program.set_bounds(index, lower, upper);
            }
        }
        Ok(())
    }

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
