//! What a controller has planned, beside what has happened.

use crate::report::Warning;
use crate::report::forms::json::as_map;

/// A closed loop.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct ClosedLoop {
    /// The experiment that was solved at each sample.
    pub controller: String,
    /// The time between two samples.
    pub sample: f64,
    /// How long a solve was to take, in seconds.
    pub deadline: Option<f64>,
    /// Sample by sample.
    pub samples: Vec<Sampled>,
    /// How long solves took, which is no matter of the loop.
    #[serde(rename = "times_s")]
    pub times: Times,
}

/// A sample.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Sampled {
    /// When.
    pub time: f64,
    /// What was followed from there on.
    pub decision: Decision,
    /// The least cost from there on, where there is a new plan.
    pub objective: Option<f64>,
    /// Iterations of the solver.
    pub iterations: usize,
    /// How long it took.
    #[serde(rename = "solve_s")]
    pub seconds: f64,
    /// Why the solve has led to no solution.
    pub why: Option<Warning>,
    /// The new plan; none where the last one goes on.
    pub plan: Option<Planned>,
}

/// What is followed from a sample on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Decision {
    /// A solution that was found from the last plan.
    Warm,
    /// A solution that was found as the experiment does it.
    #[default]
    Cold,
    /// A plan that keeps all constraints, and is not known to be a minimum.
    Feasible,
    /// The last plan goes on.
    Kept,
}

/// A plan at the ends of its control intervals.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Planned {
    /// Instants, in the time of the loop.
    pub time: Vec<f64>,
    /// States, by the names of entries.
    #[serde(serialize_with = "as_map")]
    pub states: Vec<(String, Vec<f64>)>,
    /// Controls from these instants on, or at them where they are straight lines.
    #[serde(serialize_with = "as_map")]
    pub controls: Vec<(String, Vec<f64>)>,
}

/// Quantiles of times in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Times {
    /// That of the first solve, which has no plan to start from.
    pub first: f64,
    /// Half of the others take no longer.
    pub median: f64,
    /// Of the others, 19 of 20 take no longer.
    pub upper: f64,
    /// The longest of the others.
    pub longest: f64,
}

impl Times {
    /// Of times in their order.
    pub(crate) fn of(seconds: Vec<f64>) -> Self {
        let Some((&first, others)) = seconds.split_first() else {
            return Times::default();
        };
        let mut others = others.to_vec();
        others.sort_by(f64::total_cmp);
        let quantile = |share: f64| {
            let rank = (share * others.len() as f64).ceil() as usize;
            others.get(rank.max(1) - 1).copied().unwrap_or(0.0)
        };
        Times {
            first,
            median: quantile(0.5),
            upper: quantile(0.95),
            longest: quantile(1.0),
        }
    }
}

impl ClosedLoop {
    /// How often each was decided.
    pub fn count(&self, decision: Decision) -> usize {
        let samples = self.samples.iter();
        samples.filter(|one| one.decision == decision).count()
    }
}
