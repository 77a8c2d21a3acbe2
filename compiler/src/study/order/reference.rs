//! The state that errors are measured against.

use std::time::Duration;

use nsd_solver::integrate::tableau::Family;

use crate::Compiled;
use crate::report::expect;
use crate::simulate::{Bench, End, Variant};
use crate::source::SourceMap;

/// The state at the end.
#[derive(Clone, Debug)]
pub struct Reference {
    /// x*.
    pub x: Vec<f64>,
    /// Where it comes from.
    pub source: String,
    /// What the user should know about it.
    pub remark: Option<String>,
    /// Errors below it are those of the reference, and of rounding.
    pub floor: f64,
    /// Size of the state, which errors are compared with.
    pub size: f64,
}

/// A reference, and how many steps an accurate run takes.
pub struct Found {
    pub reference: Reference,
    pub steps: usize,
}

/// Two orders below the smallest tolerance of a study.
const TOLERANCE: f64 = 1e-15;
/// Rounding of a run with a few hundred steps, relative to the size of the state.
const ROUNDING: f64 = 1e-13;
/// Differences of two accurate runs are this much smaller than their errors, at most.
const CAUTION: f64 = 4.0;

impl Reference {
    /// ‖x - x*‖₂.
    pub fn error(&self, x: &[f64]) -> f64 {
        distance(x, &self.x)
    }
}

/// The state that the experiment expects, where it gives all entries and an accurate run confirms it;
/// else the state that the accurate run reaches.
pub fn find(
    compiled: &Compiled<'_>,
    bench: &mut Bench<'_, '_>,
    sources: &SourceMap,
    limit: Duration,
) -> Result<Found, String> {
    let expects = &compiled.settings.expects;
    let expected = expect::final_state(&compiled.subject(sources), expects);
    let run = by_events(bench, limit).or_else(|failure| by_elements(bench, limit, failure));
    let start = norm(&bench.start());
    let size = |x: &[f64]| match start.max(norm(x)) {
        0.0 => 1.0,
        size => size,
    };
    match (expected, run) {
        (None, Err(failure)) => Err(failure),
        (Some(x), Err(failure)) => Ok(Found {
            steps: 0,
            reference: Reference {
                floor: ROUNDING * size(&x),
                size: size(&x),
                source: "the expected state".into(),
                remark: Some(format!("no accurate run confirms it: {failure}")),
                x,
            },
        }),
        (expected, Ok(run)) => {
            let size = size(&run.x);
            let floor = (CAUTION * run.difference).max(ROUNDING * size);
            let apart = expected.as_ref().map(|x| distance(x, &run.x));
            let reference = match (expected, apart) {
                (Some(x), Some(apart)) if apart <= 2.0 * floor => Reference {
                    x,
                    source: "the expected state".into(),
                    remark: None,
                    floor: floor.max(apart),
                    size,
                },
                (_, apart) => Reference {
                    x: run.x,
                    source: run.source,
                    remark: apart.map(|apart| {
                        format!(
                            "the expected state is {apart:.1e} from it, too far for a reference"
                        )
                    }),
                    floor,
                    size,
                },
            };
            Ok(Found {
                reference,
                steps: run.steps,
            })
        }
    }
}

/// An accurate run and how far another one is from it.
struct Run {
    x: Vec<f64>,
    steps: usize,
    difference: f64,
    source: String,
}

/// Two runs by the event method, of different orders.
fn by_events(bench: &mut Bench<'_, '_>, limit: Duration) -> Result<Run, String> {
    let mut run = |tolerance, more_orders| {
        let variant = Variant::Event {
            tolerance,
            more_orders,
        };
        solved(bench.run(variant, limit / 2))
    };
    let (fine, other) = (run(TOLERANCE, 0)?, run(10.0 * TOLERANCE, 3)?);
    Ok(Run {
        difference: distance(&fine.x, &other.x),
        x: fine.x,
        steps: fine.steps,
        source: format!("a run of `event` with tolerance {TOLERANCE:e}"),
    })
}

/// Two runs by finite elements, on grids of which one is twice as fine.
fn by_elements(bench: &mut Bench<'_, '_>, limit: Duration, failure: String) -> Result<Run, String> {
    if bench.without_elements().is_some() {
        return Err(failure);
    }
    let mut run = |steps| {
        let variant = Variant::Fesd {
            scheme: (Family::RadauIia, 5),
            steps,
            elements: 2,
        };
        solved(bench.run(variant, limit / 2))
    };
    let both = run(1024).and_then(|fine| Ok((fine, run(512)?)));
    let (fine, other) = both.map_err(|other| format!("event: {failure}; fesd: {other}"))?;
    Ok(Run {
        difference: distance(&fine.x, &other.x),
        x: fine.x,
        steps: 0,
        source: "a run of `fesd radau_iia(5)` with 1024 steps".to_owned(),
    })
}

fn solved(end: End) -> Result<End, String> {
    match end.failure {
        Some(failure) => Err(failure),
        None => Ok(end),
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}
