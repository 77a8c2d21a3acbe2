//! Other values of controls that have a finite set of them.
//!
//! Between two of its values such a control is at no point, so that no small change of it is a descent. Each is changed in
//! one interval, and in two where no change alone is better or keeps the constraints, and simulated.

use super::descent::{Found, Search};
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

/// Points at which one or two such values are others and that are better, the best first.
pub(super) fn choices(search: &mut Search<'_, '_, '_>) -> Found {
    let choices = other_values(search.reduced.problem, search.w);
    let steps = search.base.map_or(1, |base| base.steps);
    if search.reduced.is_too_much(choices.len(), steps) {
        return Found::Unknown;
    }
    let target = search.objective - search.threshold(1.0);
    let pairs = choices.len() * choices.len() / 2;
    let alone = choices.iter().map(|one| changed(search.w, &[one]));
    let mut points = search.candidates(alone.collect());
    points.retain(|point| point.merit < target);
    if points.is_empty() && !search.reduced.is_too_much(pairs, steps) {
        points = search.candidates(pairs_of(search.w, &choices));
        points.retain(|point| point.merit < target);
    }
    points.truncate(MOST_POINTS);
    Found::better(points, search.objective)
}

/// All values of controls with finite sets that they do not have.
fn other_values(problem: &Problem<'_>, w: &[f64]) -> Vec<Choice> {
    let (layout, mpcc) = (&problem.layout, &problem.mpcc);
    let mut choices = Vec::new();
    let tasks = problem.system.task.iter();
    for (i, control) in tasks.flat_map(|task| task.controls.iter().enumerate()) {
        let values = control.values().unwrap_or_default();
        for k in 1..=layout.steps {
            let index = layout.u(k) + i;
            let distance = |value: f64| (value - w[index]).abs();
            let nearest = values
                .iter()
                .fold(f64::INFINITY, |least, &value| least.min(distance(value)));
            let others = values
                .iter()
                .enumerate()
                .filter(|(_, value)| distance(**value) > nearest);
            choices.extend(others.map(|(number, &value)| {
                Choice {
                    index,
                    entries: [(index, value)]
                        .into_iter()
                        .chain(chosen(mpcc, control, k, number))
                        .collect(),
                }
            }));
        }
    }
    choices
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
