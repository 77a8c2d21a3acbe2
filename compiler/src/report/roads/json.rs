//! Runs side by side as JSON: one object on one line.

use serde_json::{Value, json};

use super::optima::Verdict;
use super::{Optima, Refusal, Road, Roads};
use crate::report::Trajectory;

/// Runs of a simulation and their differences; the numbers of roads count from 1.
pub fn roads(all: &Roads) -> String {
    let road = |road: &Road| {
        let mut object = run(&road.name, &road.run);
        object["doubt"] = json!(road.doubt());
        let own = road.run.as_ref().ok();
        object["events"] = json!(own.map(|run| run.history.events.len()));
        object["error_estimate"] = json!(own.and_then(|run| run.quality.error_estimate));
        object
    };
    let n = all.roads.len();
    let pairs = (1..n).flat_map(|b| (0..b).map(move |a| (a, b)));
    let difference = |(a, b): (usize, usize)| {
        let found = all.difference(a, b)?;
        Some(json!({
            "roads": [a + 1, b + 1],
            "end": found.end,
            "along": found.along,
            "times": found.times,
            "alone": found.alone,
            "allowed": found.allowed,
            "sensitivities": found.sensed.map(|sensed| json!({
                "end": sensed.end,
                "along": sensed.along,
                "times": sensed.times,
                "allowed": found.allowed_of_derivatives(),
            })),
            "is_explained": found.is_explained(),
        }))
    };
    json!({
        "experiment": all.experiment,
        "model": all.model,
        "kind": "simulate",
        "agree": all.agree(),
        "tolerance": all.tolerance,
        "roads": all.roads.iter().map(road).collect::<Vec<Value>>(),
        "differences": pairs.filter_map(difference).collect::<Vec<Value>>(),
    })
    .to_string()
}

/// Optima with several lowerings.
pub fn optima(all: &Optima) -> String {
    let road = |(number, found): (usize, &super::Found)| {
        let mut object = run(&found.name, &found.run);
        let own = found.run.as_ref().ok();
        object["objective"] = json!(own.and_then(|run| run.objective));
        object["stationarity"] = json!(own.map(|run| run.quality.certificate.stationarity));
        object["simulation_error"] = json!(own.and_then(|run| run.quality.error_estimate));
        object["from_best"] = json!(found.resumed.as_ref().map(|resumed| json!({
            "is_same_point": resumed.is_same_point,
            "status": resumed.run.status,
            "objective": resumed.run.objective,
            "stationarity": resumed.run.quality.certificate.stationarity,
        })));
        let is_wrong = matches!(all.verdict(number), Verdict::Differs(_));
        object["is_explained"] = json!(!is_wrong);
        object
    };
    json!({
        "experiment": all.experiment,
        "model": all.model,
        "kind": "optimize",
        "agree": all.agree(),
        "tolerance": all.tolerance,
        "objective": all.objective(),
        "best": all.best.map(|best| best + 1),
        "roads": all.found.iter().enumerate().map(road).collect::<Vec<Value>>(),
    })
    .to_string()
}

/// What runs of both kinds have.
fn run(name: &str, run: &Result<Box<Trajectory>, Refusal>) -> Value {
    let refusal = run.as_ref().err();
    let run = run.as_ref().ok();
    json!({
        "name": name,
        "status": run.map_or("not_applicable", |run| run.status.as_str()),
        "code": refusal.map(|refusal| &refusal.codes),
        "reason": refusal.map(|refusal| &refusal.reason),
        "residual": run.map(|run| Road::residual(run)),
        "solve_s": run.map(|run| run.quality.stats.solve_s),
    })
}
