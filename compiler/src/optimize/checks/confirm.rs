//! A certificate of the control problem, not of its program.
//!
//! A program sees what is around a point in the branch that it is in: where a switch meets the end of a control interval
//! or of the horizon, where slip comes to rest in an element that has no length, other branches describe the same
//! trajectory. So the free quantities are changed and simulated. Where there is descent, the program is solved again from
//! the simulation after a step along it.

use nsd_solver::optimization::mpcc;
use nsd_solver::optimization::mpcc::{Options, Solution, Trust};

use super::around::Around;
use super::choices;
use super::descent::{self, Candidate, Found, LARGE, SMALL, Search};
use super::reduced::{Reduced, Starts, Values};
use super::solved;
use crate::limit::Limit;
use crate::optimize::Problem;
use crate::optimize::problem::size_of_objective;
use crate::optimize::start::{Begin, reference};
use crate::project::watch::Watch;
use crate::report::{self, Confirmation, Way};

/// How often a program is solved again.
const MAX_ROUNDS: usize = 10;
/// Decreases of the objective, relative to it, that are none.
const NO_GAIN: f64 = 1e-8;
/// A minimum elsewhere is told where it is better by more than this share, and by more than that, relative to the size of
/// the objective, at all.
const WORTH: f64 = 1e-2;
const LEAST_WORTH: f64 = 1e-6;
/// Constraints that are violated by no more are kept.
const KEPT: f64 = 1e-6;
/// Multipliers of constraints are weighted by so much more.
const WEIGHT: f64 = 2.0;
/// Simulations that miss the objective by more than this, relative to the size of the objective, say nothing about it.
const CREDIBLE: f64 = 1e-3;
/// Errors of derivatives are so many times those of the objective, at most.
const DOUBT: f64 = 10.0;

/// Where a better point is looked for, in this order: what curves, and switches that are near, show in larger changes.
const LOOKS: [Look; 5] = [
    Look::Around(SMALL),
    Look::Around(LARGE),
    Look::Choices,
    Look::Elsewhere,
    Look::Through,
];

#[derive(Clone, Copy)]
enum Look {
    /// In changes of such a share of the sizes of quantities.
    Around(f64),
    /// At other values of finite sets.
    Choices,
    /// All over the ranges.
    Elsewhere,
    /// Where events come in other intervals.
    Through,
}

impl Look {
    /// What a point that it shows is found by.
    fn way(self) -> Way {
        match self {
            Look::Around(_) => Way::Descent,
            Look::Choices => Way::Values,
            Look::Elsewhere => Way::Elsewhere,
            Look::Through => Way::Sequence,
        }
    }

    /// What is said of a solution where it shows nothing, if it has to.
    fn unknown(self) -> Option<Confirmation> {
        match self {
            Look::Around(change) => (change == SMALL).then_some(Confirmation::Unfinished),
            Look::Choices => Some(Confirmation::TooLong),
            Look::Elsewhere | Look::Through => None,
        }
    }
}

/// Where other sequences of events are looked for.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Sequences {
    /// Where what follows an event depends on more than the state at it.
    WithMemory,
    /// Where anything switches: on a grid that is only the first one, the programs of them take little.
    All,
}

/// Where a better point of a problem is looked for.
fn looks(problem: &Problem, sequences: Sequences) -> &'static [Look] {
    let system = &problem.system;
    let has_relay = system.switches.iter().any(|switch| switch.relay.is_some());
    let has_memory =
        has_relay || !system.jumps.laws.is_empty() || !system.jumps.contacts.is_empty();
    // Where switches are read nonlinearly, programs have modes that the model is not in.
    let has_others = sequences == Sequences::All
        && !system.switches.is_empty()
        && problem.dcs.switches.branches.is_empty();
    match has_memory || has_others {
        true => &LOOKS,
        false => &LOOKS[..LOOKS.len() - 1],
    }
}

/// Points that are better or may lead to better ones, the best first.
struct Better {
    points: Vec<Candidate>,
    /// The objective of the simulation where it was looked around.
    cost: f64,
    /// By how much the objective falls per size of a free quantity.
    rate: f64,
    /// What they are found by.
    way: Way,
    /// Whether it falls to first order.
    is_descent: bool,
    /// How many iterations may be spent on points that are not better.
    patience: usize,
    /// The looks that are left.
    left: &'static [Look],
}

/// Confirms a solution by simulations, or replaces it by a better one as long as there is descent. Where a simulation
/// far away is better and the program does not get there, its objective comes with it.
pub(crate) fn confirm(
    problem: &mut Problem,
    solution: &mut Solution,
    (options, sequences): (&Options, Sequences),
    ways: &mut Vec<report::FoundBy>,
    watch: &mut dyn Watch,
) -> (Confirmation, Option<f64>) {
    let limit = &options.limit;
    let mut rounds = 0..MAX_ROUNDS;
    let all = looks(problem, sequences);
    let (mut looks, mut unfollowed) = (all, None);
    loop {
        let better = match look(problem, solution, looks, limit) {
            Ok(better) => better,
            Err(confirmation) => return (confirmation, unfollowed),
        };
        let least_size = size_of_objective(problem, 0.0);
        let gain = NO_GAIN * solution.objective.abs().max(NO_GAIN * least_size);
        let least = solution.objective - gain;
        let is_better = |problem: &Problem, found: &Solution| {
            found.is_feasible()
                && found.objective < least
                && (runs(problem, &found.w, limit) || !runs(problem, &solution.w, limit))
        };
        let round = rounds.next();
        let mut spent = 0;
        let found = round.and_then(|_| {
            let mut points = better.points.iter();
            points.find_map(|point| {
                let trust = match better.way {
                    Way::Sequence => Trust::Below(least),
                    _ => Trust::First,
                };
                let found = (spent <= better.patience)
                    .then(|| from(problem, &point.w, (options, trust), limit, watch))??;
                spent += found.stats.iterations;
                Some(found).filter(|found| is_better(problem, found))
            })
        });
        if let Some(found) = found {
            ways.push(take(solution, found, better.way));
            (looks, unfollowed) = (all, None);
            continue;
        }
        if better.is_descent {
            let (rate, cost) = (better.rate, better.cost);
            if round.is_none() {
                return (Confirmation::Descent(rate), None);
            }
            let beyond = beyond(problem, solution, better, limit, |problem, point| {
                let found = from(problem, point, (options, Trust::First), limit, watch);
                found.filter(|found| is_better(problem, found))
            });
            match beyond {
                Ok(found) => ways.push(take(solution, found, Way::Descent)),
                // No farther than the program and simulations are apart, it does not count.
                Err(least) if cost - least <= (cost - solution.objective).abs() => {
                    return (Confirmation::Differs, None);
                }
                Err(_) => return (Confirmation::Descent(rate), None),
            }
            (looks, unfollowed) = (all, None);
            continue;
        }
        // What is only better at some distance, and keeps the constraints, is another minimum.
        let worth =
            solution.objective - (WORTH * solution.objective.abs()).max(LEAST_WORTH * least_size);
        let kept = better.points.iter().filter(|point| point.excess <= KEPT);
        let merits = kept.map(|point| point.merit);
        let best = merits.fold(unfollowed.unwrap_or(worth), f64::min);
        unfollowed = (best < worth).then_some(best);
        looks = better.left;
    }
}

/// Replaces a solution by a better one that was found so.
fn take(solution: &mut Solution, found: Solution, way: Way) -> report::FoundBy {
    let iterations = solution.stats.iterations;
    *solution = found;
    solution.stats.iterations += iterations;
    report::FoundBy {
        way,
        objective: solution.objective,
    }
}

/// A solution on the way that descent takes in simulations, to which the program has no way of its own: in between, an
/// element may have to hold more switches than it can. Where there is none, the least objective on the way.
fn beyond(
    problem: &mut Problem,
    solution: &Solution,
    mut better: Better,
    limit: &Limit,
    mut from: impl FnMut(&mut Problem, &[f64]) -> Option<Solution>,
) -> Result<Solution, f64> {
    let mut least = better.cost;
    for _ in 0..MAX_ROUNDS {
        let point = better.points.swap_remove(0);
        least = point.merit.min(least);
        let next = simulated(problem, solution, point, limit);
        let next = next.and_then(|place| look(problem, &place, &LOOKS[..1], limit).ok());
        let Some(next) = next else { break };
        better = next;
        let mut points = better.points.iter();
        if let Some(found) = points.find_map(|point| from(problem, &point.w)) {
            return Ok(found);
        }
    }
    Err(least)
}

/// Whether a simulation with the free quantities of a point reaches the end: one that does says what happens, and is not
/// given up for a smaller objective of which none can be had.
fn runs(problem: &Problem, w: &[f64], limit: &Limit) -> bool {
    let reduced = Reduced::new(problem, w, limit);
    reduced.is_some_and(|mut reduced| reduced.at(w).is_some())
}

/// A solution moved to a point, with the end of its simulation.
fn simulated(
    problem: &Problem,
    solution: &Solution,
    point: Candidate,
    limit: &Limit,
) -> Option<Solution> {
    let mut place = Solution {
        w: point.w,
        objective: point.merit,
        ..solution.clone()
    };
    let values = Reduced::new(problem, &place.w, limit)?.at(&place.w)?;
    let (end, n) = solved::end(problem, &values.end);
    place.w[end..][..n].copy_from_slice(&values.end[..n]);
    Some(place)
}

/// A point with the values of controls with finite sets that keep the constraints best, where all can be tried.
fn best_sequence(problem: &Problem, w: &[f64], limit: &Limit) -> Option<Vec<f64>> {
    let mut reduced = Reduced::new(problem, w, limit)?;
    let mut search = Search {
        reduced: &mut reduced,
        w,
        objective: 0.0,
        base: None,
        weight: WEIGHT,
        doubt: 0.0,
        room: 0.0,
        scale: 1.0,
    };
    let points = choices::sequences(&mut search, problem.layout.steps)?;
    let violation = |point: &Candidate| match point.excess > KEPT {
        true => point.excess,
        false => 0.0,
    };
    let best = points.into_iter().min_by(|a, b| {
        let by_violation = violation(a).total_cmp(&violation(b));
        by_violation.then(a.merit.total_cmp(&b.merit))
    });
    best.map(|point| point.w)
}

/// A solution from a simulation with the free quantities of a point that is none, or with those that it was started from:
/// what runs from event to event keeps all rows but those of the task.
pub(crate) fn from_simulation(
    problem: &mut Problem,
    lost: &Solution,
    Begin { guess, options, .. }: &Begin,
    watch: &mut dyn Watch,
) -> Option<Solution> {
    let mut iterations = lost.stats.iterations;
    let mut starts = vec![lost.w.clone(), guess.clone()];
    starts.splice(0..0, best_sequence(problem, &lost.w, &options.limit));
    for start in &starts {
        if options.limit.is_over() || iterations > options.iterations.all {
            return None;
        }
        let looks = (options, Trust::First);
        let Some(mut found) = from(problem, start, looks, &options.limit, watch) else {
            continue;
        };
        iterations += found.stats.iterations;
        if found.is_feasible() {
            found.stats.iterations = iterations;
            return Some(found);
        }
    }
    None
}

/// The solution of the program that is found from a simulation with the free quantities of a point.
fn from(
    problem: &mut Problem,
    point: &[f64],
    (options, trust): (&Options, Trust),
    limit: &Limit,
    watch: &mut dyn Watch,
) -> Option<Solution> {
    let mut w = point.to_vec();
    problem.balance(&mut w);
    let x = &mut w[problem.layout.before(1, 1)..][..problem.system.states.len()];
    Starts::new(problem).set(problem, point, x);
    let starts = match problem.frozen {
        Some(_) => reference::in_numerical_time(problem, &mut w, limit),
        None => reference::in_modes(problem, &problem.simulated(&w, limit), &mut w),
    };
    if !starts {
        return None;
    }
    let options = Options {
        trust,
        effort: 0,
        // Those of the grid that it has now.
        certificate: mpcc::Tolerances {
            sizes: Some(problem.sizes.clone()),
            ..options.certificate.clone()
        },
        ..options.clone()
    };
    Some(mpcc::solve_observed(
        &mut problem.program,
        &w,
        &options,
        watch,
    ))
}

/// Whether a control has a finite set of values.
fn has_finite_sets(problem: &Problem) -> bool {
    let mut tasks = problem.system.task.iter();
    tasks.any(|task| {
        task.controls
            .iter()
            .any(|control| control.values().is_some())
    })
}

/// A better point by the first of these looks that shows one, or what else simulations say.
fn look(
    problem: &Problem,
    solution: &Solution,
    looks: &'static [Look],
    limit: &Limit,
) -> Result<Better, Confirmation> {
    let w = &solution.w;
    let Some(mut reduced) = Reduced::new(problem, w, limit) else {
        return Err(Confirmation::None);
    };
    if reduced.quantities.is_empty() && !has_finite_sets(problem) {
        return Err(Confirmation::Confirmed);
    }
    let base = reduced.at(w);
    let steps = base
        .as_ref()
        .map_or(problem.layout.steps, |base| base.steps);
    if reduced.is_too_much(2 * reduced.quantities.len(), steps) {
        return Err(Confirmation::TooLong);
    }
    let multipliers = &solution.multipliers;
    let all = (multipliers.rows.iter())
        .chain(&multipliers.lower)
        .chain(&multipliers.upper);
    let largest = all.fold(0.0, |m: f64, y| m.max(y.abs()));
    let error = |base: &Values| (base.cost - solution.objective).abs();
    let error = base.as_ref().map_or(0.0, error);
    let terminal = base
        .as_ref()
        .map_or(0.0, |base| solved::terminal_error(problem, w, &base.end));
    // Where simulations are that far off, no change of them is told from it.
    if error > CREDIBLE * size_of_objective(problem, solution.objective) {
        return Err(Confirmation::Differs);
    }
    let scale = descent::scale(&mut reduced, w, solution.objective);
    let mut search = Search {
        scale,
        reduced: &mut reduced,
        w,
        objective: solution.objective,
        base: base.as_ref(),
        weight: WEIGHT * largest.max(size_of_objective(problem, 0.0)),
        doubt: DOUBT * error,
        room: largest * terminal,
    };
    for (i, look) in looks.iter().enumerate() {
        let found = match look {
            Look::Around(change) => Around::new(&mut search, *change).descent(),
            Look::Choices => choices::choices(&mut search),
            Look::Elsewhere => search.elsewhere(),
            Look::Through => search.through(),
        };
        match found {
            Found::Descent {
                points,
                rate,
                is_first_order,
            } => {
                return Ok(Better {
                    points,
                    cost: base.as_ref().map_or(solution.objective, |base| base.cost),
                    rate,
                    way: look.way(),
                    is_descent: is_first_order,
                    patience: match look {
                        Look::Through => solution.stats.iterations,
                        _ => usize::MAX,
                    },
                    left: &looks[i + 1..],
                });
            }
            Found::Unknown => {
                if let Some(confirmation) = look.unknown() {
                    return Err(confirmation);
                }
            }
            Found::Nothing => {}
        }
    }
    Err(Confirmation::Confirmed)
}
