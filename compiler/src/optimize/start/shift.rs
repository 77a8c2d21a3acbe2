//! A solution as a guess for the same task from a later state: what is left of it, and a rest in which it stays where it ends.
//!
//! w(t) on [0, T]   becomes   w(t + δ) on [0, T'],   with T' = T, or T - δ where T is free
//!
//! Instants of switches keep their times, so that elements end where those of the solution do but for δ: where intervals line
//! up they are the same, and elsewhere each interval is cut anew at the switches inside of it. α at nodes, and so the branch,
//! are those of the element that the instant was in.

use nsd_solver::fesd::jumps::cut;
use nsd_solver::integrate::tableau::lagrange;

use super::transfer::{Element, Point};
use crate::optimize::Problem;
use crate::system::task::Shape;

/// Elements that are so short, as a share of the horizon, are instants.
const SHORTEST: f64 = 1e-9;
/// The part of a free horizon that is left at least.
const LEAST: f64 = 1e-2;
/// α that differ from 0 or 1 by less are that.
const ROUNDING: f64 = 1e-6;
/// Impulses below this are rounding.
const IMPULSE: f64 = 1e-9;

/// An element of the solution and where it is.
struct Placed<'p> {
    from: f64,
    to: f64,
    element: &'p Element,
    /// The number of the mode that it is in, in the order of time.
    run: usize,
}

/// Where the control intervals of a point end, from 0 on.
fn ends_of(problem: &Problem<'_>, point: &Point) -> Vec<f64> {
    let steps = problem.layout.steps;
    let share = |k: usize| point.shares.get(k).copied().unwrap_or(1.0);
    let all: f64 = (0..steps).map(share).sum();
    let mut before = 0.0;
    let mut ends = vec![0.0];
    for k in 0..steps {
        before += share(k);
        ends.push(if k + 1 == steps {
            point.horizon
        } else {
            point.horizon * before / all
        });
    }
    ends
}

/// The point that goes on from a solution after δ.
pub(crate) fn shifted(problem: &Problem<'_>, point: &Point, delta: f64) -> Point {
    let layout = &problem.layout;
    let ends = ends_of(problem, point);
    let placed = placed(problem, point, &ends);
    let mut shifted = point.clone();
    if layout.horizon().is_some() {
        shifted.horizon = (point.horizon - delta).max(LEAST * point.horizon);
    }
    let new_ends = ends_of(problem, &shifted);
    shifted.controls = controls_after(problem, point, (&ends, &new_ends), delta);
    shifted.elements.clear();
    let turns: Vec<f64> = (placed.windows(2))
        .filter(|pair| pair[0].run != pair[1].run)
        .map(|pair| pair[1].from)
        .collect();
    for interval in new_ends.windows(2) {
        let (from, to) = (interval[0] + delta, interval[1] + delta);
        let mut start = from;
        for length in cut(from, to, &turns, layout.elements) {
            let element = element_after(problem, &placed, (start, length), delta);
            shifted.elements.push(element);
            start += length;
        }
    }
    shifted
}

/// The elements that have a length, with the modes that they are in.
fn placed<'p>(problem: &Problem<'_>, point: &'p Point, ends: &[f64]) -> Vec<Placed<'p>> {
    let layout = &problem.layout;
    let mut placed: Vec<Placed<'p>> = Vec::new();
    let (mut start, mut last) = (0.0, None);
    for ((k, j), element) in layout.all_elements().zip(&point.elements) {
        if j == 1 {
            start = ends[k - 1];
        }
        let length = element.length.max(0.0);
        if length > SHORTEST * point.horizon {
            let mode = mode(element);
            let is_struck = element.impulses.iter().any(|&impulse| impulse > IMPULSE);
            let run = match (&last, placed.last()) {
                (Some(last), Some(before)) if *last == mode && !is_struck => before.run,
                (_, before) => before.map_or(0, |before| before.run + 1),
            };
            placed.push(Placed {
                from: start,
                to: start + length,
                element,
                run,
            });
            last = Some(mode);
        }
        start += length;
    }
    placed
}

/// The controls of a point after δ, where it ends the last ones.
fn controls_after(
    problem: &Problem<'_>,
    point: &Point,
    (ends, new_ends): (&[f64], &[f64]),
    delta: f64,
) -> Vec<Vec<f64>> {
    let shape = problem
        .dcs
        .task
        .as_ref()
        .map_or(Shape::Constant, |t| t.shape);
    let steps = problem.layout.steps;
    let interval = |t: f64| {
        let behind = ends[1..steps].partition_point(|&end| end <= t);
        behind.min(steps - 1)
    };
    match shape {
        Shape::Constant => (new_ends.windows(2))
            .map(|ends| {
                let middle = delta + 0.5 * (ends[0] + ends[1]);
                point.controls[interval(middle)].clone()
            })
            .collect(),
        Shape::Linear => (new_ends.iter())
            .map(|end| {
                let t = (delta + end).min(point.horizon);
                let k = interval(t);
                let share = (t - ends[k]) / (ends[k + 1] - ends[k]);
                let [from, to] = [&point.controls[k], &point.controls[k + 1]];
                let pairs = from.iter().zip(to);
                pairs.map(|(a, b)| a + share * (b - a)).collect()
            })
            .collect(),
    }
}

/// The element of an interval of time of the solution.
fn element_after(
    problem: &Problem<'_>,
    placed: &[Placed<'_>],
    (start, length): (f64, f64),
    delta: f64,
) -> Element {
    let layout = &problem.layout;
    let at = |t: f64| {
        let behind = placed.partition_point(|one| one.to <= t);
        behind.min(placed.len() - 1)
    };
    let middle = &placed[at(start + 0.5 * length)];
    // Instants belong to the mode of the element, whatever is beside it.
    let within = |t: f64| {
        let found = &placed[at(t)];
        match found.run.cmp(&middle.run) {
            std::cmp::Ordering::Equal => found,
            std::cmp::Ordering::Less => {
                let mut run = placed.iter();
                run.find(|one| one.run == middle.run).unwrap_or(middle)
            }
            std::cmp::Ordering::Greater => {
                let mut run = placed.iter().rev();
                run.find(|one| one.run == middle.run).unwrap_or(middle)
            }
        }
    };
    let share = |one: &Placed<'_>, t: f64| ((t - one.from) / (one.to - one.from)).clamp(0.0, 1.0);
    let n = layout.nodes;
    let state = |c: f64| {
        let t = start + c * length;
        let one = within(t);
        let through = lagrange(&layout.points[..=n], &[share(one, t)]);
        let mut x = mixed(&through, &one.element.states[..=n]);
        forget_integrals(problem, &mut x, placed, delta);
        x
    };
    let alpha = |c: f64| {
        let t = start + c * length;
        let one = within(t);
        let through = lagrange(&layout.points[1..=n], &[share(one, t)]);
        let mut alphas = mixed(&through, &one.element.alphas);
        alphas
            .iter_mut()
            .for_each(|alpha| *alpha = alpha.clamp(0.0, 1.0));
        alphas
    };
    let begins = (start - middle.from).abs() <= SHORTEST * (middle.to - middle.from).max(length);
    let states: Vec<Vec<f64>> = layout.points.iter().map(|&c| state(c)).collect();
    let mut before = match begins {
        true => middle.element.before.clone(),
        false => states[0].clone(),
    };
    if begins {
        forget_integrals(problem, &mut before, placed, delta);
    }
    let impulses = &middle.element.impulses;
    Element {
        length,
        start: middle.element.start.map(|_| start - delta),
        before,
        started: (middle.element.started.iter().zip(&states[0]))
            .map(|(started, &x)| started.map(|_| x))
            .collect(),
        states,
        alphas: layout.points[1..=n].iter().map(|&c| alpha(c)).collect(),
        impulses: match begins {
            true => impulses.clone(),
            false => vec![0.0; impulses.len()],
        },
    }
}

/// Integrals begin at zero again.
fn forget_integrals(problem: &Problem<'_>, x: &mut [f64], placed: &[Placed<'_>], delta: f64) {
    // Those that are sums over nodes are no states of the program.
    let first = problem.system.n_model_states();
    if first >= x.len() {
        return;
    }
    let behind = placed.partition_point(|one| one.to <= delta);
    let one = &placed[behind.min(placed.len() - 1)];
    let share = ((delta - one.from) / (one.to - one.from)).clamp(0.0, 1.0);
    let n = problem.layout.nodes;
    let through = lagrange(&problem.layout.points[..=n], &[share]);
    let begun = mixed(&through, &one.element.states[..=n]);
    for (x, begun) in x[first..].iter_mut().zip(&begun[first..]) {
        *x -= begun;
    }
}

/// The sides of the switches in an element: 0, 1, or between for what slides.
fn mode(element: &Element) -> Vec<u8> {
    let n_nodes = element.alphas.len().max(1) as f64;
    let n = element.alphas.first().map_or(0, Vec::len);
    let mean = |i: usize| element.alphas.iter().map(|alphas| alphas[i]).sum::<f64>() / n_nodes;
    let side = |alpha: f64| match alpha {
        alpha if alpha <= ROUNDING => 0,
        alpha if alpha >= 1.0 - ROUNDING => 2,
        _ => 1,
    };
    (0..n).map(|i| side(mean(i))).collect()
}

/// Σ w_m rows_m
fn mixed(weights: &[f64], rows: &[Vec<f64>]) -> Vec<f64> {
    let n = rows.first().map_or(0, Vec::len);
    let entry = |i: usize| weights.iter().zip(rows).map(|(w, row)| w * row[i]).sum();
    (0..n).map(entry).collect()
}
