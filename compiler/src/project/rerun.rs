//! Whole runs of one experiment, again and again, with other parameters and initial values.
//!
//! What [`crate::project::prepared`] gives is a system; here it is all that [`simulate::run`] tells: outputs, warnings, the second run
//! that estimates the error.

use nsd_solver::tape::Tape;

use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::model::Model;
use crate::project::clock::Clock;
use crate::project::ensemble::Source;
use crate::project::prepared::{Opened, Parameter};
use crate::report::Trajectory;
use crate::simulate::{Plan, Request};
use crate::syntax::Path;
use crate::system::experiment::{Sampling, Settings};
use crate::system::values::{Values, bounds};
use crate::{Compiled, compile};

/// What changes from run to run.
#[derive(Clone, Copy, Debug)]
enum Change {
    /// A parameter, by its number among those that stay open.
    Parameter(usize),
    /// An initial value, by the number of its state.
    Initial(usize),
}

/// An experiment that has been compiled once, for one thread.
pub(crate) struct Rerun<'e> {
    compiled: Compiled<'e>,
    plan: Plan<'e>,
    /// None for what stays as it is.
    changes: Vec<Option<Change>>,
    /// The numbers of open parameters in the system, and what they may be.
    places: Vec<usize>,
    parameters: Vec<Parameter>,
    /// From these to x(0).
    start: Tape,
}

impl<'e> Rerun<'e> {
    /// Compiles an experiment of which parameters and initial values, by their names as they stand in `with`, change from
    /// run to run, or stay as they are for none; `states` are the entries of all states. None where it has to be compiled for
    /// each of their values.
    pub fn new(
        exprs: &'e Exprs,
        source: Source<'_>,
        names: &[Option<Path>],
        states: &[String],
    ) -> Option<Self> {
        let is_state = |path: &&Path| states.contains(&path.to_string());
        let open = names.iter().flatten().filter(|path| !is_state(path));
        let open: Vec<Path> = open.cloned().collect();
        let compiled = without_warnings(exprs, source, &open)?;
        let Opened {
            places,
            parameters,
            start,
        } = Opened::of(&compiled).ok()?;
        let Compiled {
            model,
            system,
            settings,
        } = &compiled;
        // A relay starts, and what equations solve for is guessed, where the experiment itself starts.
        let is_fixed = system.switches.iter().any(|switch| switch.relay.is_some())
            || !system.algebraic_states().is_empty()
            || moves_limits(model, &settings.values);
        if parameters.len() != open.len() || is_fixed {
            return None;
        }
        let change = |path: &Path| {
            let name = path.to_string();
            let parameter = parameters.iter().position(|p| p.name == name);
            let initial = || {
                let place = system.states.iter().position(|state| state.name == name)?;
                // Where it starts outside of its bounds it is refused.
                let is_bounded = system
                    .limits
                    .iter()
                    .any(|limit| limit.value == system.states[place].var);
                (!is_bounded).then_some(Change::Initial(place))
            };
            parameter.map(Change::Parameter).or_else(initial)
        };
        let changes = names.iter().map(|name| match name {
            Some(name) => change(name).map(Some),
            None => Some(None),
        });
        Some(Rerun {
            changes: changes.collect::<Option<_>>()?,
            plan: Plan::of_method(system, settings, &places),
            compiled,
            places,
            parameters,
            start,
        })
    }

    /// Lets runs be told at these instants.
    pub fn sampled(mut self, sampling: impl FnOnce(&Settings<'_>) -> Sampling) -> Self {
        let settings = &mut self.compiled.settings;
        settings.sampling = sampling(settings);
        self
    }

    /// The experiment.
    pub fn compiled(&self) -> &Compiled<'e> {
        &self.compiled
    }

    /// A run with these values, in the order of the names. None where the experiment has to be compiled for them.
    pub fn run(&mut self, values: &[f64], request: &Request) -> Option<Trajectory> {
        let changes = || {
            let changes = self.changes.iter().zip(values);
            changes.filter_map(|(change, &value)| Some(((*change)?, value)))
        };
        let mut open: Vec<f64> = self.parameters.iter().map(|p| p.value).collect();
        for (change, value) in changes() {
            if let Change::Parameter(at) = change {
                open[at] = value;
            }
        }
        let mut all = open.iter().zip(&self.parameters);
        if !all.all(|(value, of)| of.takes(*value)) {
            return None;
        }
        let mut x0 = vec![0.0; self.compiled.system.states.len()];
        (self.start).eval(&open, &mut x0, &mut self.start.scratch());
        for (change, value) in changes() {
            if let Change::Initial(state) = change {
                x0[state] = value;
            }
        }
        let system = &mut self.compiled.system;
        for (&place, &value) in self.places.iter().zip(&open) {
            system.params[place].value = value;
        }
        for (state, x0) in system.states.iter_mut().zip(x0) {
            state.initial = x0;
        }
        let (system, settings) = (&self.compiled.system, &self.compiled.settings);
        let mut diags = Diagnostics::new();
        system.check_start(&mut diags);
        let run = || self.plan.run(system, settings, request, &mut |_| {});
        diags.is_empty().then(run)
    }
}

/// An experiment with parameters that stay open; none where there is anything to say about it.
fn without_warnings<'e>(
    exprs: &'e Exprs,
    source: Source<'_>,
    open: &[Path],
) -> Option<Compiled<'e>> {
    let (mut clock, mut diags) = (Clock::default(), Diagnostics::new());
    let mut experiment = source.experiment.clone();
    experiment.open = open.to_vec();
    let (file, overrides) = (source.file, source.overrides);
    let compiled = compile(exprs, file, &experiment, overrides, &mut clock, &mut diags)?;
    diags.is_empty().then_some(compiled)
}

/// Whether parameters that stay open move the bounds of anything that is watched in a run.
fn moves_limits<'e>(model: &Model<'e>, values: &Values<'e>) -> bool {
    let watched = (model.states.iter().chain(&model.algebraics))
        .chain(model.controls.iter().chain(&model.inputs))
        .chain(&model.connected);
    let mut bounds = watched.flat_map(|quantity| {
        let domain = quantity.domain.iter();
        domain.flat_map(|domain| (0..quantity.vars.len()).map(move |k| bounds(domain, k)))
    });
    bounds.any(|bounds| values.free.first_in(&bounds).is_some())
}
