//! A solution as a point of a program on a finer grid: its controls, and its polynomials at more nodes or in parts of its
//! elements.

use nsd_solver::integrate::tableau::lagrange_distinct;

use super::transfer::{Element, Point};
use crate::lowering::discretize::Layout;

impl Point {
    /// The same on a grid whose elements are equal parts of those of its own, or these with other nodes.
    pub(crate) fn refined(&self, own: &Layout, finer: &Layout) -> Point {
        let parts = finer.elements / own.elements;
        let elements = self.elements.iter().flat_map(|element| {
            (0..parts).map(move |number| part(element, (number, parts), (own, finer)))
        });
        let mut point = self.clone();
        point.elements = elements.collect();
        point.set_grid(finer);
        point
    }
}

/// A part of an element on a finer grid.
fn part(
    element: &Element,
    (number, parts): (usize, usize),
    (own, finer): (&Layout, &Layout),
) -> Element {
    let place = |c: &f64| (number as f64 + c) / parts as f64;
    let places: Vec<f64> = finer.points[..=finer.end].iter().map(place).collect();
    let points = &own.points[..=own.end];
    let states = interpolated(points, &element.states, &places);
    let nodes = &own.points[1..=own.nodes];
    let alphas = interpolated(nodes, &element.alphas, &places[1..=finer.nodes]);
    let is_first = number == 0;
    let start = |start: f64| start + place(&0.0) * element.length;
    Element {
        length: element.length / parts as f64,
        start: element.start.map(start),
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
    let weights = lagrange_distinct(nodes, places);
    weights.chunks(nodes.len()).map(at).collect()
}
