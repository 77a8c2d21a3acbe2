//! Ensembles: an experiment of which something is random, run with many seeds.
//!
//! Run number k has the seed of `perturb` plus k, whatever the number of runs or of threads is. An arena of
//! expressions belongs to one thread, so that every thread compiles the experiment once for itself.

use std::ops::Range;

use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::limit::Limit;
use crate::project::clock::Clock;
use crate::report::{Bands, Ensemble, Failure, Status, Trajectory, Warning};
use crate::simulate::{Plan, Request};
use crate::syntax::{Bind, Experiment, File};
use crate::system::experiment::{Sampling, Settings};
use crate::threads::{self, Share};
use crate::{Compiled, compile};

/// Shares of the runs below the quantiles that are reported.
pub const LEVELS: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// Instants of quantiles, where the experiment does not name fewer.
const INSTANTS: usize = 241;

/// Numbers kept before quantiles are taken; where there would be more, they are taken at fewer instants.
const MOST_NUMBERS: usize = 50_000_000;

/// An experiment as it stands in a file.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// The file with its imports.
    pub file: &'a File,
    /// The experiment.
    pub experiment: &'a Experiment,
    /// What replaces values in `with`.
    pub overrides: &'a [Bind],
}

/// What one run leaves behind.
struct Sample {
    /// Instant by instant, what is reported, entry by entry; nothing where the run failed.
    rows: Vec<Vec<f64>>,
    /// How it ended, and why.
    status: Status,
    failure: Option<Failure>,
    warnings: Vec<Warning>,
}

/// An experiment with one of its seeds, ready to be run.
pub struct Seeded<'e> {
    /// With the seed set.
    pub compiled: Compiled<'e>,
    plan: Plan<'e>,
}

impl<'e> Seeded<'e> {
    /// A run with these settings, which have the seed and the method of the experiment.
    pub fn run(&mut self, settings: &Settings<'e>, request: &Request) -> Trajectory {
        let system = &self.compiled.system;
        self.plan.run(system, settings, request, &mut |_| {})
    }
}

/// Calls `work` for every seed, on up to `n_threads` threads, with the experiment compiled once for each of these.
///
/// What it returns comes in the order of the seeds. `heard` is told how many are done, and who may end runs by their limit is
/// asked now and then. The experiment has compiled
/// without an error before.
pub fn over_seeds<T: Send>(
    source: Source<'_>,
    seeds: Range<u64>,
    (n_threads, limit): (usize, &Limit),
    work: impl Fn(&mut Seeded<'_>) -> T + Sync,
    heard: &mut dyn FnMut(usize),
) -> Vec<T> {
    let count = seeds.end.saturating_sub(seeds.start) as usize;
    let each = |share: Share<'_, T>| {
        let exprs = Exprs::new();
        let (mut clock, mut diags) = (Clock::default(), Diagnostics::new());
        let Source {
            file,
            experiment,
            overrides,
        } = source;
        let compiled = compile(&exprs, file, experiment, overrides, &mut clock, &mut diags);
        let compiled = compiled.expect("the experiment has compiled before");
        let plan = Plan::new(&compiled.system, &compiled.settings);
        let mut seeded = Seeded { compiled, plan };
        while let Some(run) = share.next() {
            if let Some(kicks) = &mut seeded.compiled.settings.kicks {
                kicks.seed = seeds.start + run as u64;
            }
            share.finish(run, work(&mut seeded));
        }
    };
    let runs = threads::in_order(count, n_threads, &limit.asked(), each, heard);
    runs.into_iter().flatten().collect()
}

/// The seeds of an experiment with `runs`; none without it.
pub fn seeds(settings: &Settings<'_>) -> Option<Range<u64>> {
    let (runs, kicks) = settings.runs.zip(settings.kicks.as_ref())?;
    Some(kicks.seed..kicks.seed + runs as u64)
}

/// Runs an experiment with all its seeds, and adds the quantiles of what is reported to the trajectory of the first
/// one. Where a run fails, so does the whole. All runs share the limit of the request.
pub fn add(
    trajectory: &mut Trajectory,
    source: Source<'_>,
    settings: &Settings<'_>,
    request: &Request,
    n_threads: usize,
    heard: &mut dyn FnMut(usize),
) {
    let Some(seeds) = seeds(settings) else {
        return;
    };
    let reported = trajectory.samples.states_and_outputs();
    let names: Vec<String> = reported.flat_map(|series| series.entry_names()).collect();
    let count = (seeds.end - seeds.start) as usize;
    let time = instants(settings, names.len() * count);
    let request = Request {
        dense: false,
        estimate: false,
        multipliers: false,
        limit: request.limit.clone(),
    };
    let work = |seeded: &mut Seeded<'_>| {
        let mut settings = seeded.compiled.settings.clone();
        settings.recording.sampling = Sampling::At(time.clone());
        sample(&seeded.run(&settings, &request), &time)
    };
    let samples = over_seeds(
        source,
        seeds.clone(),
        (n_threads, &request.limit),
        work,
        heard,
    );
    let failed: Vec<u64> = (seeds.clone().zip(&samples))
        .filter(|(_, sample)| sample.status != Status::Solved)
        .map(|(seed, _)| seed)
        .collect();
    for (seed, sample) in seeds.clone().zip(&samples) {
        let known: Vec<String> = (trajectory.warnings.iter())
            .map(|warning| warning.code.clone())
            .collect();
        let new = sample.warnings.iter();
        let new = new.filter(|warning| !known.contains(&warning.code));
        trajectory.warnings.extend(new.map(|warning| Warning {
            message: format!("with seed {seed}, {}", warning.message),
            ..warning.clone()
        }));
        if trajectory.status == Status::Solved && sample.status != Status::Solved {
            trajectory.status = sample.status;
            trajectory.failure = sample.failure.clone();
        }
    }
    let solved: Vec<&Sample> = samples
        .iter()
        .filter(|sample| !sample.rows.is_empty())
        .collect();
    let mut column = Vec::with_capacity(solved.len());
    let bands = names.into_iter().enumerate().map(|(entry, name)| {
        let mut values = vec![Vec::with_capacity(time.len()); LEVELS.len()];
        for instant in 0..time.len() {
            column.clear();
            column.extend(solved.iter().map(|sample| sample.rows[instant][entry]));
            column.sort_by(f64::total_cmp);
            for (values, level) in values.iter_mut().zip(LEVELS) {
                values.push(quantile(&column, level));
            }
        }
        Bands { name, values }
    });
    trajectory.several.ensemble = Some(Ensemble {
        runs: count,
        first_seed: seeds.start,
        failed_seeds: failed,
        levels: LEVELS,
        bands: bands.collect(),
        time,
    });
}

/// Where quantiles are taken: at the instants of the experiment, if these are few, else at equal distances.
fn instants(settings: &Settings<'_>, numbers: usize) -> Vec<f64> {
    let most = (MOST_NUMBERS / numbers.max(1)).clamp(2, INSTANTS);
    let horizon = settings.horizon;
    match &settings.recording.sampling {
        Sampling::At(instants) if instants.len() <= most => instants.clone(),
        Sampling::Every(period) if horizon / period < (most - 1) as f64 => {
            let inner = (0..).map(|k| k as f64 * period);
            let inner = inner.take_while(|t| *t < horizon * (1.0 - 1e-12));
            inner.chain([horizon]).collect()
        }
        _ => {
            let last = (most - 1) as f64;
            (0..most).map(|k| horizon * k as f64 / last).collect()
        }
    }
}

/// What a run leaves behind at some instants.
fn sample(trajectory: &Trajectory, time: &[f64]) -> Sample {
    let (solved, samples) = (trajectory.status == Status::Solved, &trajectory.samples);
    let row = |&t: &f64| {
        let place = samples.time.partition_point(|&known| known <= t);
        let place = place.saturating_sub(1);
        (samples.states_and_outputs())
            .flat_map(|series| series.at(place).iter().copied())
            .collect()
    };
    Sample {
        rows: match solved && !samples.time.is_empty() {
            true => time.iter().map(row).collect(),
            false => Vec::new(),
        },
        status: trajectory.status,
        failure: trajectory.failure.clone(),
        warnings: trajectory.warnings.clone(),
    }
}

/// The value below which a share of sorted numbers lies, with straight lines between them: number k of n has the share
/// k/(n - 1) below it (Hyndman and Fan 1996, definition 7).
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let place = share * last as f64;
    let (below, rest) = (place.floor() as usize, place.fract());
    let above = (below + 1).min(last);
    if rest == 0.0 {
        return sorted[below];
    }
    sorted[below] + rest * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::quantile;

    #[test]
    fn quantiles_are_those_of_the_reference() {
        // quantile(c(1, 2, 4, 8, 16), type = 7) of R.
        let values = [1.0, 2.0, 4.0, 8.0, 16.0];
        for (share, known) in [
            (0.0, 1.0),
            (0.25, 2.0),
            (0.5, 4.0),
            (0.75, 8.0),
            (0.95, 14.4),
        ] {
            assert!((quantile(&values, share) - known).abs() < 1e-12, "{share}");
        }
        assert!((quantile(&[1.0, 2.0], 0.05) - 1.05).abs() < 1e-15);
        assert_eq!(quantile(&[3.0], 0.95), 3.0);
        assert!(quantile(&[], 0.5).is_nan());
    }
}
