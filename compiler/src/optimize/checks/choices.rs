//! Other values of controls that have a finite set of them.
//!
//! Between two of its values such a control is at no point, so that no small change of it is a descent. Every one of them is
//! changed in one interval, and in two where no change alone is better or keeps the constraints, and simulated.

use super::descent::{Candidate, Found, Search};
use crate::optimize::Problem;
use crate::system::Allowed;

/// How many points are looked into.
const MOST_POINTS: usize = 3;

/// Another value of a control in an interval.
#[derive(Clone)]
pub(crate) struct Choice {
    /// The control's variable of the program.
    index: usize,
    /// That and what tells the program of its value.
    entries: Vec<(usize, f64)>,
}

/// All values of controls with finite sets that they do not have.
fn other_values(problem: &Problem<'_>, w: &[f64]) -> Vec<Choice> {
    let layout = &problem.layout;
    // Where there are more than two, a weight of each tells which one it is.
    let mut weights = problem
        .mpcc
        .variables
        .iter()
        .filter(|block| block.name == "y");
    let mut choices = Vec::new();
    let tasks = problem.system.task.iter();
    for (i, control) in tasks.flat_map(|task| task.controls.iter().enumerate()) {
        let Some(Allowed::OneOf(values)) = &control.allowed else {
            continue;
        };
        let n = values.len();
        let weights = if n > 2 { weights.next() } else { None };
        for k in 1..=layout.steps {
            let index = layout.u(k) + i;
            let distance = |value: &f64| (value - w[index]).abs();
            let nearest = values.iter().map(distance).fold(f64::INFINITY, f64::min);
            let others = values
                .iter()
                .enumerate()
                .filter(|(_, value)| distance(value) > nearest);
            choices.extend(others.map(|(chosen, &value)| {
                let weight = |at: usize| f64::from(u8::from(at == chosen));
                let of_values = weights.iter().flat_map(|block| {
                    (0..n).map(move |at| (block.start + (k - 1) * n + at, weight(at)))
                });
                Choice {
                    index,
                    entries: [(index, value)].into_iter().chain(of_values).collect(),
                }
            }));
        }
    }
    choices
}

/// Whether there are other values of controls with finite sets.
pub(crate) fn are_any(problem: &Problem<'_>, w: &[f64]) -> bool {
    !other_values(problem, w).is_empty()
}

/// Points at which one or two such values are others and that are better, the best first.
pub(crate) fn look(search: &mut Search<'_, '_, '_>) -> Found {
    let changes = other_values(search.reduced.problem, search.w);
    let steps = search.base.map_or(1, |base| base.steps);
    if changes.is_empty() {
        return Found::Nothing;
    }
    if search.reduced.is_too_much(changes.len(), steps) {
        return Found::Unknown;
    }
    let alone = changes.iter().map(|change| vec![change.clone()]).collect();
    let mut points = better(search, alone);
    let pairs = changes.len() * changes.len() / 2;
    if points.is_empty() && !search.reduced.is_too_much(pairs, steps) {
        points = better(search, pairs_of(&changes));
    }
    match points.first() {
        None => Found::Nothing,
        Some(best) => Found::Descent {
            rate: search.objective - best.merit,
            points,
            is_first_order: false,
        },
    }
}

/// Those that are better, the best first.
fn better(search: &mut Search<'_, '_, '_>, changes: Vec<Vec<Choice>>) -> Vec<Candidate> {
    let target = search.objective - search.threshold(1.0);
    let changed = changes.into_iter().filter_map(|changes| {
        let mut w = search.w.to_vec();
        for (index, value) in changes.into_iter().flat_map(|choice| choice.entries) {
            w[index] = value;
        }
        let values = search.reduced.at(&w)?;
        Some(search.candidate(w, &values))
    });
    let mut points: Vec<Candidate> = changed.filter(|point| point.merit < target).collect();
    points.sort_by(|a, b| a.merit.total_cmp(&b.merit));
    points.truncate(MOST_POINTS);
    points
}

/// Two changes, not of one control in one interval.
fn pairs_of(changes: &[Choice]) -> Vec<Vec<Choice>> {
    let pairs = changes.iter().enumerate().flat_map(|(at, one)| {
        let others = changes[at + 1..].iter();
        let others = others.filter(|other| other.index != one.index);
        others.map(|other| vec![one.clone(), other.clone()])
    });
    pairs.collect()
}
