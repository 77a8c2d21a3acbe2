//! A solution as a point of a program on a finer grid: its controls, and its polynomials at more nodes or in parts of its
//! elements.

use nsd_solver::fesd::jumps::cut;
use nsd_solver::integrate::tableau::lagrange;

use super::transfer::{Element, Point};
use crate::lowering::discretize::Layout;

impl Point {
    /// The same on a grid whose elements are equal parts of those of its own, or these with other nodes.
    pub(crate) fn refined(&self, own: &Layout, finer: &Layout) -> Point {
        let parts = finer.elements / own.elements;
        let place = |number: usize| number as f64 / parts as f64;
        let elements = self.elements.iter().flat_map(|element| {
            (0..parts).map(move |number| {
                let shares = [place(number), place(number + 1)];
                part(element, shares, (own, finer))
            })
        });
        let mut point = self.clone();
        point.elements = elements.collect();
        point.set_grid(finer);
        point
    }

    /// The same on a grid whose intervals are equal parts of those of its own, where contacts give no impulses.
    pub(crate) fn in_parts(&self, own: &Layout, finer: &Layout) -> Point {
        let parts = finer.steps / own.steps;
        let intervals = self.elements.chunks(own.elements);
        let elements = intervals.flat_map(|elements| {
            (0..parts).flat_map(move |number| interval(elements, (number, parts), (own, finer)))
        });
        let mut point = self.clone();
        point.elements = elements.collect();
        let control = |(_, share): (usize, f64)| {
            let place = share * own.steps as f64;
            let last = self.controls.len() - 1;
            let at = |k: f64| self.controls[(k as usize).min(last)].iter();
            // A value for each interval, or lines from one end to the next.
            let (to, share) = match last < own.steps {
                true => (place.floor(), 0.0),
                false => (place.ceil(), place.fract()),
            };
            let ends = at(place.floor()).zip(at(to));
            ends.map(|(from, to)| from + share * (to - from)).collect()
        };
        point.controls = finer.control_instants().map(control).collect();
        point.set_grid(finer);
        point
    }
}

/// A part of an interval on a finer grid: its elements end where those of the interval do, so that switches stay at ends.
fn interval(
    elements: &[Element],
    (number, parts): (usize, usize),
    (own, finer): (&Layout, &Layout),
) -> Vec<Element> {
    let mut ends = vec![0.0];
    for element in elements {
        ends.push(ends[ends.len() - 1] + element.length);
    }
    let place = |number: usize| ends[elements.len()] * number as f64 / parts as f64;
    let lengths = cut(place(number), place(number + 1), &ends, finer.elements);
    let mut from = place(number);
    let mut found: Vec<Element> = Vec::new();
    for length in lengths {
        let to = from + length;
        let behind = ends.partition_point(|&end| end <= 0.5 * (from + to));
        let element = &elements[behind.clamp(1, elements.len()) - 1];
        let start = ends[behind.clamp(1, elements.len()) - 1];
        let share = |place: f64| ((place - start) / element.length).clamp(0.0, 1.0);
        let mut part = part(element, [share(from), share(to)], (own, finer));
        part.length = length;
        found.push(part);
        from = to;
    }
    let first = &mut found[0];
    if number > 0 {
        let starts = elements[0].started.iter().zip(&first.states[0]);
        first.started = starts
            .map(|(started, &value)| started.map(|_| value))
            .collect();
    }
    found
}

/// A part of an element, from one share of it to another one, on a finer grid.
fn part(element: &Element, [from, to]: [f64; 2], (own, finer): (&Layout, &Layout)) -> Element {
    let place = |c: &f64| from + c * (to - from);
    let places: Vec<f64> = finer.points[..=finer.end].iter().map(place).collect();
    let points = &own.points[..=own.end];
    let states = interpolated(points, &element.states, &places);
    let nodes = &own.points[1..=own.nodes];
    let alphas = interpolated(nodes, &element.alphas, &places[1..=finer.nodes]);
    let is_first = from == 0.0;
    Element {
        length: element.length * (to - from),
        start: element.start.map(|start| start + from * element.length),
        before: match is_first {
            true => element.before.clone(),
            false => states[0].clone(),
        },
        started: (element.started.iter())
            .map(|started| started.filter(|_| is_first))
            .collect(),
        impulses: element.impulses.clone(),
        states,
        alphas,
    }
}

/// The polynomials through rows of values at nodes, at other places.
fn interpolated(nodes: &[f64], rows: &[Vec<f64>], places: &[f64]) -> Vec<Vec<f64>> {
    let width = rows.first().map_or(0, Vec::len);
    let at = |weights: &[f64]| {
        let entry = |i: usize| {
            let terms = weights.iter().zip(rows);
            terms.map(|(weight, row)| weight * row[i]).sum()
        };
        (0..width).map(entry).collect()
    };
    let weights = lagrange(nodes, places);
    weights.chunks(nodes.len()).map(at).collect()
}
