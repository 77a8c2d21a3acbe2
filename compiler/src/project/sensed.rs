//! By what a run is differentiated, in the parameters and states of its system.

use nsd_solver::sensitivity::Directions;

use crate::Compiled;
use crate::diagnostics::Diagnostics;
use crate::project::prepared::{NotPrepared, Opened};
use crate::simulate::Sensing;
use crate::system::experiment::{ExperimentError, Sensed};

/// What the experiment asks for, if it was compiled for that.
///
/// # Errors
///
/// Where the run is not differentiated by something of it.
pub(crate) fn sensing(compiled: &Compiled<'_>) -> Result<Option<Sensing>, Diagnostics> {
    let (settings, system) = (&compiled.settings, &compiled.system);
    if settings.recording.sensed.is_empty() {
        return Ok(None);
    }
    let opened =
        Opened::kept(compiled).map_err(|error| no_input(&settings.recording.sensed, &error))?;
    let n = system.states.len();
    let (entries, slopes) = opened.start.partials(|_| true);
    let parameters: Vec<f64> = opened.parameters.iter().map(|p| p.value).collect();
    let mut values = vec![0.0; slopes.n_outputs()];
    slopes.eval(&parameters, &mut values, &mut slopes.scratch());
    let mut directions = Directions::default();
    for sensed in &settings.recording.sensed {
        let (mut initial, mut by) = (vec![0.0; n], vec![0.0; parameters.len()]);
        let not_there = || refused(sensed, "the experiment does not need it".to_owned());
        if sensed.is_initial {
            let mut states = system.states.iter();
            let place = states.position(|state| state.var == sensed.var);
            initial[place.ok_or_else(not_there)?] = 1.0;
        } else {
            if let Some(other) = settings.values.free.follows(sensed.var) {
                let other = compiled.model.exprs.name(other);
                let why = format!("it follows from `{other}`, which is asked for, too");
                return Err(refused(sensed, why));
            }
            let is_it = |&place: &usize| system.exogenous.params[place].var == sensed.var;
            let place = opened.places.iter().position(is_it);
            let place = place.ok_or_else(not_there)?;
            by[place] = 1.0;
            for (&(state, input), value) in entries.iter().zip(&values) {
                if input == place {
                    initial[state] += value;
                }
            }
        }
        directions.initial.push(initial);
        directions.parameters.push(by);
    }
    let names = settings.recording.sensed.iter();
    Ok(Some(Sensing {
        open: opened.places,
        directions,
        names: names
            .map(|sensed| (sensed.name.clone(), sensed.span))
            .collect(),
    }))
}

fn refused(sensed: &Sensed<'_>, why: String) -> Diagnostics {
    let mut diags = Diagnostics::new();
    diags.push(ExperimentError::NoSensitivity {
        name: sensed.name.clone(),
        why,
        span: sensed.span,
    });
    diags
}

/// Why a parameter is no input of runs.
fn no_input(sensed: &[Sensed<'_>], error: &NotPrepared) -> Diagnostics {
    let (of, why) = match error {
        NotPrepared::Structural(name, why) => {
            let of = sensed.iter().find(|sensed| sensed.name == *name);
            (of, format!("it {why}"))
        }
        error => (None, error.to_string()),
    };
    refused(of.unwrap_or(&sensed[0]), why)
}
