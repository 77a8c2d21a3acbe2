//! Other values of controls that have a finite set of them.
//!
//! Between two of its values such a control is at no point, so that no small change of it is a descent. All sequences of
//! values are simulated where there are few. Where there are many, each is changed in one interval, and in two where no
//! change alone is better or keeps the constraints.

use super::descent::{Candidate, Found, Search};
use crate::lowering::discretize::chosen;
use crate::optimize::Problem;

/// How many points are looked into.
const MOST_POINTS: usize = 3;

/// Another value of a control in an interval.
struct Choice {
    /// The control's variable of the program.
    index: usize,
    /// That, and what else tells the program of its value.
    entries: Vec<(usize, f64)>,
}

/// Points at which such values are others and that are better, the best first: with all sequences of values where these are
/// few, else with one or two others.
pub(super) fn choices(search: &mut Search<'_, '_, '_>) -> Found {
    let steps = search.base.map_or(1, |base| base.steps);
    let target = search.objective - search.threshold(1.0);
    let mut points = match sequences(search, steps) {
        Some(points) => points,
        None => {
            let choices = other_values(search.reduced.problem, search.w);
            if search.reduced.is_too_much(choices.len(), steps) {
                return Found::Unknown;
            }
            let alone = choices.iter().map(|one| changed(search.w, &[one]));
            let points = search.candidates(alone.collect());
            let is_better = points.iter().any(|point| point.merit < target);
            let pairs = choices.len() * choices.len() / 2;
            match is_better || search.reduced.is_too_much(pairs, steps) {
                true => points,
                false => search.candidates(pairs_of(search.w, &choices)),
            }
        }
    };
    points.retain(|point| point.merit < target);
    points.truncate(MOST_POINTS);
    Found::better(points, search.objective)
}

/// The points with all sequences of values, the best first; none where runs of so many steps with them take too long.
pub(super) fn sequences(search: &mut Search<'_, '_, '_>, steps: usize) -> Option<Vec<Candidate>> {
    let values = values(search.reduced.problem);
    let counts = values.iter().map(|choices| choices.len() as f64);
    let count = counts.product::<f64>();
    if values.is_empty() || search.reduced.is_too_much(count as usize, steps) {
        return None;
    }
    let points = values
        .iter()
        .fold(vec![search.w.to_vec()], |points, choices| {
            let with_each = |w: Vec<f64>| choices.iter().map(move |choice| changed(&w, &[choice]));
            points.into_iter().flat_map(with_each).collect()
        });
    Some(search.candidates(points))
}

/// All values of controls with finite sets, by control and interval.
fn values(problem: &Problem<'_>) -> Vec<Vec<Choice>> {
    let (layout, mpcc) = (&problem.layout, &problem.mpcc);
    let mut all = Vec::new();
    let tasks = problem.system.task.iter();
    for (i, control) in tasks.flat_map(|task| task.controls.iter().enumerate()) {
        let Some(values) = control.values() else {
            continue;
        };
        for k in 1..=layout.steps {
            let index = layout.u(k) + i;
            let choice = |(number, &value): (usize, &f64)| {
                let other = chosen(mpcc, control, k, number);
                Choice {
                    index,
                    entries: [(index, value)].into_iter().chain(other).collect(),
                }
            };
            all.push(values.iter().enumerate().map(choice).collect());
        }
    }
    all
}

/// All values of controls with finite sets that they do not have.
fn other_values(problem: &Problem<'_>, w: &[f64]) -> Vec<Choice> {
    let others = |choices: Vec<Choice>| {
        let distance = |choice: &Choice| (choice.entries[0].1 - w[choice.index]).abs();
        let nearest = choices.iter().map(distance).fold(f64::INFINITY, f64::min);
        let mut others = choices;
        others.retain(|choice| distance(choice) > nearest);
        others
    };
    values(problem).into_iter().flat_map(others).collect()
}

/// The solution with other values.
fn changed(w: &[f64], choices: &[&Choice]) -> Vec<f64> {
    let mut w = w.to_vec();
    for &(index, value) in choices.iter().flat_map(|choice| &choice.entries) {
        w[index] = value;
    }
    w
}

/// Points with two of them, not of one control in one interval.
fn pairs_of(w: &[f64], choices: &[Choice]) -> Vec<Vec<f64>> {
    let pairs = choices.iter().enumerate().flat_map(|(at, one)| {
        let others = choices[at + 1..].iter();
        let others = others.filter(|other| other.index != one.index);
        others.map(move |other| changed(w, &[one, other]))
    });
    pairs.collect()
}
