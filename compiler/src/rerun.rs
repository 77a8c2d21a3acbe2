//! Whole runs of one experiment, again and again, with other parameters and initial values.
//!
//! What [`crate::prepared`] gives is a system; here it is all that [`simulate::run`] tells: outputs, warnings, the second run
//! that estimates the error.

use nsd_solver::tape::Tape;

use crate::clock::Clock;
use crate::diagnostics::Diagnostics;
use crate::ensemble::Source;
use crate::expr::Exprs;
use crate::prepared::{Opened, Parameter};
use crate::report::{Trajectory, Warning};
use crate::simulate::{Events, Request};
use crate::syntax::Path;
use crate::system::experiment::Sampling;
use crate::{Compiled, compile};

/// What changes from run to run.
#[derive(Clone, Copy, Debug)]
enum Changes {
    /// A parameter, by its number among those that stay open.
    Parameter(usize),
    /// An initial value, by the number of its state.
    Initial(usize),
}

/// An experiment by events that has been compiled once, for one thread.
pub(crate) struct Rerun<'e> {
    compiled: Compiled<'e>,
    /// Of the compilation.
    warnings: Vec<Warning>,
    events: Events,
    changes: Vec<Changes>,
    /// The numbers of open parameters in the system, and what they may be.
    places: Vec<usize>,
    parameters: Vec<Parameter>,
    /// From these to x(0).
    start: Tape,
}

impl<'e> Rerun<'e> {
    /// Compiles an experiment of which parameters and initial values, by their names as they stand in `with`, change from
    /// run to run. None where it has to be compiled for each of their values.
    pub fn new(exprs: &'e Exprs, source: Source<'_>, names: &[Path]) -> Option<Self> {
        let states = compiled(exprs, source, &[])?.0.system.states;
        let is_state = |path: &&Path| states.iter().any(|state| state.name == path.to_string());
        let open: Vec<Path> = names
            .iter()
            .filter(|path| !is_state(path))
            .cloned()
            .collect();
        let (compiled, warnings) = compiled(exprs, source, &open)?;
        let Opened {
            places,
            parameters,
            start,
        } = Opened::of(&compiled).ok()?;
        let system = &compiled.system;
        let change = |path: &Path| {
            let name = path.to_string();
            let parameter = parameters.iter().position(|p| p.name == name);
            let state = || system.states.iter().position(|state| state.name == name);
            let initial = || state().map(Changes::Initial);
            parameter.map(Changes::Parameter).or_else(initial)
        };
        let changes: Vec<Changes> = names.iter().map(change).collect::<Option<_>>()?;
        // A relay starts, and what is warned of is found, where the experiment itself starts.
        let is_fixed = !warnings.is_empty() || system.switches.iter().any(|k| k.relay.is_some());
        let is_bounded = |change: &Changes| match *change {
            Changes::Parameter(_) => false,
            Changes::Initial(state) => {
                let var = system.states[state].var;
                system.limits.iter().any(|limit| limit.value == var)
            }
        };
        let is_refused = !names.is_empty() && is_fixed || changes.iter().any(is_bounded);
        if parameters.len() != open.len() || is_refused {
            return None;
        }
        Some(Rerun {
            events: Events::new(system, &compiled.settings, &places),
            compiled,
            warnings,
            changes,
            places,
            parameters,
            start,
        })
    }

    /// Lets runs be told at their ends alone.
    pub fn at_ends(mut self) -> Self {
        let settings = &mut self.compiled.settings;
        settings.sampling = Sampling::At(vec![settings.horizon]);
        self
    }

    /// A run with these values, in the order of the names. None where the experiment has to be compiled for them.
    pub fn run(&mut self, values: &[f64], request: &Request) -> Option<Trajectory> {
        let mut open: Vec<f64> = self.parameters.iter().map(|p| p.value).collect();
        for (change, &value) in self.changes.iter().zip(values) {
            if let Changes::Parameter(at) = *change {
                open[at] = value;
            }
        }
        if !open
            .iter()
            .zip(&self.parameters)
            .all(|(value, of)| of.takes(*value))
        {
            return None;
        }
        let system = &mut self.compiled.system;
        for (&place, &value) in self.places.iter().zip(&open) {
            system.params[place].value = value;
        }
        let mut x0 = vec![0.0; system.states.len()];
        (self.start).eval(&open, &mut x0, &mut self.start.scratch());
        for (change, &value) in self.changes.iter().zip(values) {
            if let Changes::Initial(state) = *change {
                x0[state] = value;
            }
        }
        for (state, x0) in system.states.iter_mut().zip(x0) {
            state.initial = x0;
        }
        let (system, settings) = (&self.compiled.system, &self.compiled.settings);
        let mut diags = Diagnostics::new();
        if !self.changes.is_empty() {
            system.check_start(&mut diags);
        }
        if !diags.is_empty() {
            return None;
        }
        let mut run = self.events.run(system, settings, request, &mut |_| {});
        run.warnings.splice(0..0, self.warnings.iter().cloned());
        Some(run)
    }
}

/// An experiment with parameters that stay open, and warnings.
fn compiled<'e>(
    exprs: &'e Exprs,
    source: Source<'_>,
    open: &[Path],
) -> Option<(Compiled<'e>, Vec<Warning>)> {
    let (mut clock, mut diags) = (Clock::default(), Diagnostics::new());
    let mut experiment = source.experiment.clone();
    experiment.open = open.to_vec();
    let (file, overrides) = (source.file, source.overrides);
    let compiled = compile(exprs, file, &experiment, overrides, &mut clock, &mut diags)?;
    let warnings = diags
        .warnings()
        .map(|warning| Warning::of(warning.as_ref()));
    let warnings = warnings.collect();
    (!diags.has_errors()).then_some((compiled, warnings))
}
