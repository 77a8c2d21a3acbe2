//! How contacts that hold one body together share its friction.
//!
//! Where several of them stick, motion says what their forces add up to, and not what each of them takes. Forces are
//! spread so that
//!
//! Σ |β|²/λ
//!
//! is least, which is the same share of its cone for feet that a body stands on; and as they change along a mode, the
//! least change of that kind is taken. So none of them is at its limit much before all are.

use super::problem::{Delassus, Problem};
use crate::linalg::norm;
use crate::linalg::redundancy::eliminate;

/// A rate, relative to those of the problem, that is none.
const NONE: f64 = 1e-10;

/// A force that pushes which changes with that of friction by less than this share of it does not.
const WEDGE: f64 = 1e-9;

/// How much more a force that pushes may change than one of friction.
const FREE: f64 = 1e4;

/// Halvings of the way to forces that some cone does not hold.
const MAX_HALVINGS: usize = 4;

/// Spreads the friction of contacts that stick with the forces p, which are in these units and solve the problem.
pub(crate) fn distribute(problem: &Problem, units: &[f64], forces: &mut [f64]) {
    let w = &problem.w;
    let (n, size) = (w.n_contacts(), w.size());
    let sticks = |i: &usize| {
        let slips: Vec<f64> = (w.slip_rows(*i)).map(|t| problem.rate(t, forces)).collect();
        forces[*i] > NONE && w.resistance(*i) > 0.0 && norm(&slips) <= NONE
    };
    let sticking: Vec<usize> = (0..n).filter(sticks).collect();
    if sticking.len() < 2 {
        return;
    }
    let mut weights = vec![0.0; size];
    for &i in &sticking {
        let weight = forces[i] / units[i];
        weights[i] = FREE * weight;
        weights[w.slip_rows(i)].fill(weight);
    }
    let held = forces.iter().zip(&weights);
    let held: Vec<f64> = held
        .map(|(force, weight)| if *weight > 0.0 { *force } else { 0.0 })
        .collect();
    let wanted: Vec<f64> = (0..size).map(|row| w.times(row, &held)).collect();
    let mut matrix = Vec::with_capacity(size * size);
    for row in 0..size {
        let weighted = w.row(row).iter().zip(&weights);
        let weighted: Vec<f64> = weighted.map(|(entry, weight)| entry * weight).collect();
        matrix.extend((0..size).map(|column| w.times(column, &weighted)));
    }
    let mut multipliers = wanted.clone();
    eliminate(&mut matrix, &mut multipliers, |_| false);
    let mut least = vec![0.0; size];
    for (row, multiplier) in multipliers.iter().enumerate() {
        for (force, (entry, weight)) in least.iter_mut().zip(w.row(row).iter().zip(&weights)) {
            *force += entry * weight * multiplier;
        }
    }
    let is_same = |(row, wanted): (usize, &f64)| (w.times(row, &least) - wanted).abs() <= NONE;
    if !wanted.iter().enumerate().all(is_same) {
        return;
    }
    let mut way = 1.0;
    for _ in 0..MAX_HALVINGS {
        let changes = forces.iter().zip(least.iter().zip(&held));
        let moved = changes.map(|(force, (least, held))| force + way * (least - held));
        let moved: Vec<f64> = moved.collect();
        let inside = |i: &usize| {
            let radius = problem.mu[*i] * moved[*i];
            norm(&moved[w.slip_rows(*i)]) <= radius && problem.least[*i] <= moved[*i]
        };
        if sticking.iter().all(inside) {
            forces.copy_from_slice(&moved);
            return;
        }
        way *= 0.5;
    }
}

impl Delassus {
    /// Whether contacts that stick keep another one at rest, whatever its friction does. `sides` says of each contact
    /// whether it is closed, and whether it sticks.
    pub(crate) fn keeps_slipping_one(&self, sides: &[(bool, bool)]) -> bool {
        let n = self.n_contacts();
        let mut kept: Vec<usize> = (0..n).filter(|&i| sides[i].0).collect();
        let sticking = (0..n).filter(|&i| sides[i] == (true, true));
        kept.extend(sticking.flat_map(|i| self.slip_rows(i)));
        let is_kept = |i: usize| {
            let mut rows = kept.clone();
            rows.extend(self.slip_rows(i));
            let (mut matrix, mut rhs) = (self.part(&rows), vec![0.0; rows.len()]);
            let solved = eliminate(&mut matrix, &mut rhs, |row| row >= kept.len());
            !solved[kept.len()..].contains(&true)
        };
        let slips = (0..n).filter(|&i| sides[i] == (true, false) && self.resistance(i) > 0.0);
        let mut in_a_plane = slips.filter(|&i| self.slips(i).len() > 1);
        in_a_plane.any(is_kept)
    }

    /// Whether contacts that push with the forces λ may be held apart by friction, so that how much they push is not
    /// determined where they stick.
    pub(crate) fn wedges(&self, normal: &[f64]) -> bool {
        let n = self.n_contacts();
        let mut rows: Vec<usize> = (0..n).filter(|&i| normal[i] > 0.0).collect();
        let pushing = rows.len();
        let rough = (0..pushing).filter(|&at| self.resistance(rows[at]) > 0.0);
        let slips: Vec<usize> = rough.flat_map(|at| self.slip_rows(rows[at])).collect();
        rows.extend(slips);
        let size = rows.len();
        let mut matrix = self.part(&rows);
        let solved = eliminate(&mut matrix, &mut vec![0.0; size], |row| row >= pushing);
        // Friction acts against its row, which no magnitude sees.
        let changes = |row: usize, by: usize| {
            let change = matrix[row * size + by] / matrix[row * size + row];
            solved[row] && change.abs() > WEDGE
        };
        let mut open = (pushing..size).filter(|&by| !solved[by]);
        open.any(|by| (0..pushing).any(|row| changes(row, by)))
    }
}
