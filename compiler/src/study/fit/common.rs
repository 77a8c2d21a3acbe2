//! What the runs of a fit have in common: the numbers that are free, within which bounds, and how they are looked for.

use std::collections::{HashMap, HashSet};

use nsd_solver::optimization::least_squares::Loss;

use crate::Compiled;
use crate::source::Span;
use crate::syntax::Experiment;
use crate::system::experiment::{ExperimentError, Fit, Settings};
use crate::system::values::limits::Allowed;

/// Makes one fit of runs: free is what is free in some of them, and each is differentiated by what it depends on of that, or
/// by what none depends on.
///
/// # Errors
///
/// Where something that holds for all runs is not the same in all of them.
pub(crate) fn join(
    compiled: &mut Compiled<'_>,
    experiment: &Experiment,
) -> Result<(), ExperimentError> {
    if compiled.others.is_empty() {
        return Ok(());
    }
    let all = || [&*compiled].into_iter().chain(&compiled.others);
    let fits =
        || all().filter_map(|run| Some((&run.settings, run.settings.recording.fit.as_ref()?)));
    agree(fits(), experiment)?;
    let free = fits().flat_map(|(_, fit)| fit.free.iter().copied().zip(fit.sensed.iter().cloned()));
    let mut seen = HashSet::new();
    let free = free.filter(|(_, sensed)| seen.insert(sensed.name.clone()));
    let mut free: Vec<_> = free.collect();
    // In the order of the text, initial values last.
    free.sort_by_key(|(freed, sensed)| (sensed.is_initial, freed.span.start));
    let of_all: HashSet<String> = all().flat_map(needed).collect();
    let mut others = std::mem::take(&mut compiled.others);
    for run in [&mut *compiled].into_iter().chain(&mut others) {
        let own: HashSet<String> = needed(run).collect();
        let sensed = &mut run.settings.recording.sensed;
        sensed.retain(|sensed| own.contains(&sensed.name) || !of_all.contains(&sensed.name));
    }
    compiled.others = others;
    if let Some(fit) = &mut compiled.settings.recording.fit {
        (fit.free, fit.sensed) = free.into_iter().unzip();
    }
    Ok(())
}

/// What is free, by its name, that a run depends on.
fn needed(run: &Compiled<'_>) -> impl Iterator<Item = String> {
    let system = &run.system;
    let sensed = run.settings.recording.sensed.iter();
    let needed = sensed.filter(|sensed| match sensed.is_initial {
        true => (system.states.iter()).any(|state| state.var == sensed.var),
        false => (system.exogenous.params.iter()).any(|param| param.var == sensed.var),
    });
    needed.map(|sensed| sensed.name.clone())
}

/// That what holds for all runs is the same in all of them.
fn agree<'s, 'e: 's>(
    all: impl Iterator<Item = (&'s Settings<'e>, &'s Fit<'e>)>,
    experiment: &Experiment,
) -> Result<(), ExperimentError> {
    let mut known: HashMap<String, String> = HashMap::new();
    for (settings, fit) in all {
        for (what, here, span) in common(settings, fit, experiment) {
            let first = known.entry(what.clone()).or_insert_with(|| here.clone());
            if *first != here {
                return Err(ExperimentError::NotCommon {
                    what,
                    first: first.clone(),
                    other: here,
                    with: fit.with.clone().unwrap_or_default(),
                    span,
                    data: fit.data.first().copied().unwrap_or(span),
                });
            }
        }
    }
    Ok(())
}

/// What holds for all runs, with what a run has of it, and where it is said.
fn common(
    settings: &Settings<'_>,
    fit: &Fit<'_>,
    experiment: &Experiment,
) -> Vec<(String, String, Span)> {
    let ranges = fit.free.iter().zip(&fit.sensed).map(|(freed, sensed)| {
        let range = Allowed::Between(freed.lower, freed.upper);
        let what = format!("the range of `{}`", sensed.name);
        (what, range.to_string(), freed.span)
    });
    let loss = match fit.loss {
        Loss::Squared => "squared".to_owned(),
        Loss::Huber(bound) => format!("huber({bound})"),
    };
    let starts = fit.starts.as_ref().map_or_else(String::new, |starts| {
        format!(
            "{} by gauss({}) seed {}",
            starts.count, starts.deviation, starts.seed
        )
    });
    let said = [
        ("horizon", settings.horizon.to_string()),
        ("tolerance", settings.numerics.tolerance.to_string()),
        ("loss", loss),
        ("starts", starts),
    ];
    let said = said.into_iter().map(|(word, here)| {
        let mut statements = experiment.settings.iter();
        let statement = statements.find(|statement| statement.kind.word() == word);
        let span = statement.map_or(experiment.span, |statement| statement.span);
        (format!("`{word}`"), here, span)
    });
    ranges.chain(said).collect()
}
