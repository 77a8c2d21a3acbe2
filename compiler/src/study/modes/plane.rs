//! Sliding modes over two states.
//!
//! They are found at the nodes of a grid. Along every edge of it whose ends differ, the place where they change is found
//! by bisection, and in every cell the places on its edges are joined: what comes out are the curves of folds and of
//! bounds. What lies between neighbouring nodes that do not differ is not seen.

use std::collections::BTreeMap;
use std::ops::Range;

use super::{HALVINGS, Sampler, boundary};
use crate::report::{Boundary, Change, Plane, PlaneCurve, Sample};
use crate::system::System;

/// Cells of the grid in each direction.
const CELLS: usize = 128;

/// An edge: its first node, and whether it goes along the second state.
type Edge = (usize, usize, bool);

/// Where modes change along the edges of the grid, and what happens there.
type Crossings = BTreeMap<Edge, ([f64; 2], Boundary)>;

/// Maps the modes of a nonlinear switch while two states go through ranges.
pub fn plane(system: &System, switch: usize, states: [usize; 2], ranges: [Range<f64>; 2]) -> Plane {
    let mut sampler = Sampler::new(system, switch);
    let sides = sampler.sides();
    let mut sample = |[x, y]: [f64; 2]| sampler.sample(x, &[(states[0], x), (states[1], y)]);
    let at = ranges.map(|range| {
        let width = range.end - range.start;
        let node = |k: usize| range.start + width * k as f64 / CELLS as f64;
        (0..=CELLS).map(node).collect::<Vec<f64>>()
    });
    let nodes = (at[1].iter()).flat_map(|&y| at[0].iter().map(move |&x| [x, y]));
    let nodes: Vec<Sample> = nodes.map(&mut sample).collect();
    let crossings = crossings(&nodes, &at, sides, sample);
    Plane {
        switch: system.switches[switch].name.clone(),
        states: states.map(|state| system.states[state].name.clone()),
        patterns: nodes.iter().map(Sample::pattern).collect(),
        curves: curves(joined(&crossings), &crossings),
        at,
    }
}

/// Bisects every edge between nodes with different modes.
fn crossings(
    nodes: &[Sample],
    at: &[Vec<f64>; 2],
    sides: [f64; 2],
    mut sample: impl FnMut([f64; 2]) -> Sample,
) -> Crossings {
    let node = |i: usize, j: usize| &nodes[j * (CELLS + 1) + i];
    let mut crossings = Crossings::new();
    for (i, j) in (0..=CELLS).flat_map(|j| (0..=CELLS).map(move |i| (i, j))) {
        for (up, (ni, nj)) in [(false, (i + 1, j)), (true, (i, j + 1))] {
            if ni > CELLS || nj > CELLS || node(i, j).pattern() == node(ni, nj).pattern() {
                continue;
            }
            let ends = [[at[0][i], at[1][j]], [at[0][ni], at[1][nj]]];
            let (mut low, mut high) = (node(i, j).clone(), node(ni, nj).clone());
            let (mut from, mut to) = (0.0, 1.0);
            let place = |share: f64| [0, 1].map(|k| ends[0][k] + share * (ends[1][k] - ends[0][k]));
            for _ in 0..HALVINGS {
                let share: f64 = 0.5 * (from + to);
                let middle = sample(place(share));
                match middle.pattern() == low.pattern() {
                    true => (low, from) = (middle, share),
                    false => (high, to) = (middle, share),
                }
            }
            let found = boundary(&low, &high, sides);
            crossings.insert((i, j, up), (place(0.5 * (from + to)), found));
        }
    }
    crossings
}

/// Neighbours of an edge on its curve, by what happens there.
fn joined(crossings: &Crossings) -> BTreeMap<Edge, Vec<Edge>> {
    let mut joined: BTreeMap<Edge, Vec<Edge>> = BTreeMap::new();
    for (i, j) in (0..CELLS).flat_map(|j| (0..CELLS).map(move |i| (i, j))) {
        let edges = [
            (i, j, false),
            (i + 1, j, true),
            (i, j + 1, false),
            (i, j, true),
        ];
        for change in [Change::Fold, Change::Bound, Change::Other] {
            let changes = |edge: &Edge| crossings.get(edge).is_some_and(|c| c.1.change == change);
            let here: Vec<Edge> = edges.iter().copied().filter(changes).collect();
            // Two curves of one kind in a cell cannot be told apart; neighbours in order are taken. What is left over
            // ends in the cell.
            for pair in here.chunks(2) {
                for (edge, other) in [(0, 1), (1, 0)] {
                    if let Some(edge) = pair.get(edge) {
                        let next = joined.entry(*edge).or_default();
                        next.extend(pair.get(other));
                    }
                }
            }
        }
    }
    joined
}

/// The curves through neighbouring edges: those with ends first, then what is closed.
fn curves(joined: BTreeMap<Edge, Vec<Edge>>, crossings: &Crossings) -> Vec<PlaneCurve> {
    let ends = joined.iter().filter(|(_, next)| next.len() < 2);
    let starts: Vec<Edge> = (ends.chain(joined.iter())).map(|(edge, _)| *edge).collect();
    let mut left = joined;
    let mut curves = Vec::new();
    for start in starts {
        let mut points = Vec::new();
        let mut edge = start;
        while let Some(next) = left.remove(&edge) {
            points.push(crossings[&edge].0);
            match next.iter().find(|next| left.contains_key(next)) {
                Some(next) => edge = *next,
                None => {
                    if points.len() > 2 && next.contains(&start) {
                        points.push(crossings[&start].0);
                    }
                    break;
                }
            }
        }
        if !points.is_empty() {
            let change = crossings[&start].1.change;
            curves.push(PlaneCurve { change, points });
        }
    }
    curves
}
