//! By what a run is differentiated, in the parameters and states of its system, and of which sum.

mod one_sided;

use nsd_solver::sensitivity::Directions;
use nsd_solver::tape::Tape;

pub(crate) use one_sided::Beside;

use crate::Compiled;
use crate::diagnostics::Diagnostics;
use crate::project::prepared::{NotPrepared, Opened, Target};
use crate::report::{Status, Trajectory};
use crate::simulate::Sensing;
use crate::source::Span;
use crate::system::experiment::{ExperimentError, Settings};

/// By what an experiment is differentiated, if it was compiled for that.
///
/// # Errors
///
/// Where the run is not differentiated by something of it.
pub(crate) fn sensor(compiled: &Compiled<'_>) -> Result<Option<Sensor>, Diagnostics> {
    match compiled.settings.recording.sensed.is_empty() {
        true => Ok(None),
        false => Sensor::new(compiled, Opened::kept).map(Some),
    }
}

/// Lets an experiment find the gradient of a weighted sum of what it reports.
///
/// # Errors
///
/// Where it is not differentiated, or weights are not those of what it reports.
pub(crate) fn weigh(
    compiled: &mut Compiled<'_>,
    weights: &[(String, Vec<f64>)],
) -> Result<(), Diagnostics> {
    if let Some(why) = unweighed(compiled, weights) {
        return Err(no_gradient(compiled, why));
    }
    compiled.settings.recording.weights = Some(weights.to_vec());
    Ok(())
}

/// Why these are no weights of what an experiment reports.
fn unweighed(compiled: &Compiled<'_>, weights: &[(String, Vec<f64>)]) -> Option<String> {
    if compiled.settings.recording.sensed.is_empty() {
        return Some("the experiment has no `sensitivity to`".to_owned());
    }
    let recorded = &compiled.system.recorded;
    let states = recorded.groups.iter().map(|group| &group.name);
    let known: Vec<&String> = states
        .chain(recorded.signals().map(|one| &one.name))
        .collect();
    let why = |(place, (name, own)): (usize, &(String, Vec<f64>))| {
        if !known.contains(&name) {
            return Some(format!("no state, output or control `{name}` is reported"));
        }
        if weights[..place].iter().any(|(other, _)| other == name) {
            return Some(format!("`{name}` has weights twice"));
        }
        let strange = own.iter().find(|weight| !weight.is_finite())?;
        Some(format!("`{name}` has the weight {strange}"))
    };
    weights.iter().enumerate().find_map(why)
}

/// Whether a run that is done has rows for all its weights.
///
/// # Errors
///
/// Where it has reached its end and has others.
pub(crate) fn check_rows(
    compiled: &Compiled<'_>,
    sensing: Option<&Sensing>,
    run: &Trajectory,
) -> Result<(), Diagnostics> {
    let why = sensing.and_then(|sensing| sensing.misfit(&run.samples));
    match why.filter(|_| run.status == Status::Solved) {
        Some(why) => Err(no_gradient(compiled, why)),
        None => Ok(()),
    }
}

fn no_gradient(compiled: &Compiled<'_>, why: String) -> Diagnostics {
    let settings = &compiled.settings;
    let sensed = settings.recording.sensed.first();
    let span = sensed.map_or(settings.span, |sensed| sensed.span);
    let mut diags = Diagnostics::new();
    diags.push(ExperimentError::NoGradient { why, span });
    diags
}

/// By what runs of an experiment are differentiated, whatever the open parameters are.
pub(crate) struct Sensor {
    pub opened: Opened,
    pub targets: Vec<Target>,
    names: Vec<(String, Span)>,
    /// (state, parameter) of the derivatives of initial values.
    entries: Vec<(usize, usize)>,
    slopes: Tape,
    /// States whose initial values depend on no parameter, whatever the model says.
    given: Vec<usize>,
}

impl Sensor {
    /// What an experiment asks for, with the parameters that `open` finds.
    ///
    /// # Errors
    ///
    /// Where the run is not differentiated by something of it.
    pub fn new(
        compiled: &Compiled<'_>,
        open: impl Fn(&Compiled<'_>) -> Result<Opened, NotPrepared>,
    ) -> Result<Self, Diagnostics> {
        let (settings, system) = (&compiled.settings, &compiled.system);
        let all = &settings.recording.sensed;
        let opened = open(compiled).map_err(|error| no_input(settings, &error))?;
        let mut targets = Vec::new();
        for sensed in all {
            let refused = |why| refused((&sensed.name, sensed.span), why);
            let not_there = || refused("the experiment does not need it".to_owned());
            let place = match sensed.is_initial {
                true => {
                    let mut states = system.states.iter();
                    let place = states.position(|state| state.var == sensed.var);
                    place.map(Target::Initial)
                }
                false => {
                    if let Some(other) = settings.values.free.follows(sensed.var) {
                        let other = compiled.model.exprs.name(other);
                        let why = format!("it follows from `{other}`, which is asked for, too");
                        return Err(refused(why));
                    }
                    let is_it = |&place: &usize| system.exogenous.params[place].var == sensed.var;
                    let place = opened.places.iter().position(is_it);
                    place.map(Target::Parameter)
                }
            };
            targets.push(place.ok_or_else(not_there)?);
        }
        let is_target = |&place: &usize| {
            (targets.iter()).any(|t| matches!(t, Target::Parameter(at) if *at == place))
        };
        let by: Vec<bool> = (0..opened.places.len())
            .map(|place| is_target(&place))
            .collect();
        let (entries, slopes) = opened.start.partials(|input| by[input]);
        let names = all.iter();
        Ok(Sensor {
            targets,
            names: names
                .map(|sensed| (sensed.name.clone(), sensed.span))
                .collect(),
            entries,
            slopes,
            given: Vec::new(),
            opened,
        })
    }

    /// Lets initial values among these be numbers of their own, as parameters are.
    pub fn give_initial<'t>(&mut self, targets: impl Iterator<Item = &'t Target>) {
        let states = targets.filter_map(|target| match *target {
            Target::Initial(state) => Some(state),
            Target::Parameter(_) => None,
        });
        self.given = states.collect();
    }

    /// The values of the open parameters with which the experiment was compiled.
    pub fn values(&self) -> Vec<f64> {
        self.opened.parameters.iter().map(|p| p.value).collect()
    }

    /// What a run asks for where the open parameters have these values; none where that is nothing.
    pub fn asked(&self, settings: &Settings<'_>, parameters: &[f64]) -> Option<Sensing> {
        (!self.targets.is_empty()).then(|| Sensing {
            weights: settings.recording.weights.clone(),
            ..self.at(parameters)
        })
    }

    /// The directions where the open parameters have these values.
    pub fn at(&self, parameters: &[f64]) -> Sensing {
        let mut values = vec![0.0; self.slopes.n_outputs()];
        (self.slopes).eval(parameters, &mut values, &mut self.slopes.scratch());
        let n = self.opened.start.n_outputs();
        let mut directions = Directions::default();
        for target in &self.targets {
            let (mut initial, mut by) = (vec![0.0; n], vec![0.0; parameters.len()]);
            match *target {
                Target::Initial(state) => initial[state] = 1.0,
                Target::Parameter(place) => {
                    by[place] = 1.0;
                    for (&(state, input), value) in self.entries.iter().zip(&values) {
                        if input == place && !self.given.contains(&state) {
                            initial[state] += value;
                        }
                    }
                }
            }
            directions.initial.push(initial);
            directions.parameters.push(by);
        }
        Sensing {
            open: self.opened.places.clone(),
            directions,
            names: self.names.clone(),
            weights: None,
        }
    }
}

fn refused((name, span): (&str, Span), why: String) -> Diagnostics {
    let mut diags = Diagnostics::new();
    diags.push(ExperimentError::NoSensitivity {
        name: name.to_owned(),
        why,
        span,
    });
    diags
}

/// Why a parameter is no input of runs.
fn no_input(settings: &Settings<'_>, error: &NotPrepared) -> Diagnostics {
    let sensed = &settings.recording.sensed;
    let (of, why) = match error {
        NotPrepared::Structural(name, why) => {
            let of = sensed.iter().find(|sensed| sensed.name == *name);
            (of, format!("it {why}"))
        }
        error => (None, error.to_string()),
    };
    let of = of.or(sensed.first());
    let of = of.map_or((&settings.name, settings.span), |of| (&of.name, of.span));
    refused((of.0, of.1), why)
}
