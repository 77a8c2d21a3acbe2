//! How contacts that hold one body together share its friction.
//!
//! Where several of them stick, motion says what their forces add up to, and not what each of them takes. Forces are
//! spread so that
//!
//! Σ |β|²/λ
//!
//! is least, which is the same share of its cone for feet that a body stands on; and as they change along a mode, the
//! least change of that kind is taken. So none of them is at its limit much before all are.

use super::cones::Cones;
use crate::contact::problem::{Forces, Meeting, norm};
use crate::contact::redundancy::eliminate;
use crate::linalg::DenseLu;

/// A rate, relative to those of the problem, that is none.
const NONE: f64 = 1e-10;

/// A force that pushes which changes with that of friction by less than this share of it does not.
const WEDGE: f64 = 1e-9;

/// How much more a force that pushes may change than one of friction.
const FREE: f64 = 1e4;

/// Halvings of the way to forces that some cone does not hold.
const MAX_HALVINGS: usize = 4;

impl Cones<'_> {
    /// Spreads the friction of contacts that stick; `slopes` are the derivatives of all rates, `rates` of all slips.
    pub(crate) fn share(
        &self,
        slopes: &[f64],
        normal: &mut [f64],
        friction: &mut [f64],
        rates: &[f64],
    ) {
        let meeting = self.meeting;
        let (n, size) = (normal.len(), normal.len() + friction.len());
        let sticks = |i: &usize| {
            let rests = norm(&rates[meeting.entries(*i)]) <= NONE;
            normal[*i] > NONE && meeting.resistance(*i) > 0.0 && rests
        };
        let sticking: Vec<usize> = (0..n).filter(sticks).collect();
        if sticking.len() < 2 {
            return;
        }
        let mut weights = vec![0.0; size];
        for &i in &sticking {
            let weight = normal[i] / self.unit[i];
            weights[i] = FREE * weight;
            weights[n..][meeting.entries(i)].fill(weight);
        }
        let effects = |row: usize| &slopes[row * size..(row + 1) * size];
        let times = |row: usize, forces: &[f64]| -> f64 {
            let terms = effects(row).iter().zip(forces);
            terms.map(|(effect, force)| effect * force).sum()
        };
        let all = normal.iter().chain(friction.iter()).zip(&weights);
        let held: Vec<f64> = all
            .map(|(force, weight)| if *weight > 0.0 { *force } else { 0.0 })
            .collect();
        let mut rhs: Vec<f64> = (0..size).map(|row| times(row, &held)).collect();
        let mut matrix = Vec::with_capacity(size * size);
        for row in 0..size {
            let weighted = effects(row).iter().zip(&weights);
            let weighted: Vec<f64> = weighted.map(|(effect, weight)| effect * weight).collect();
            matrix.extend((0..size).map(|column| times(column, &weighted)));
        }
        let wanted = rhs.clone();
        eliminate(&mut matrix, &mut rhs, |_| false);
        let mut least = vec![0.0; size];
        for (row, multiplier) in rhs.iter().enumerate() {
            let terms = effects(row).iter().zip(&weights);
            for (force, (effect, weight)) in least.iter_mut().zip(terms) {
                *force += effect * weight * multiplier;
            }
        }
        let is_same = |(row, wanted): (usize, &f64)| (times(row, &least) - wanted).abs() <= NONE;
        if !wanted.iter().enumerate().all(is_same) {
            return;
        }
        let mut way = 1.0;
        for _ in 0..MAX_HALVINGS {
            let moved = |at: usize, force: f64| force + way * (least[at] - held[at]);
            let inside = |i: &usize| {
                let entries = meeting.entries(*i);
                let forces: Vec<f64> = entries.map(|t| moved(n + t, friction[t])).collect();
                let pushes = moved(*i, normal[*i]);
                norm(&forces) <= pushes && self.rates[2][*i] <= pushes
            };
            if sticking.iter().all(inside) {
                (0..n).for_each(|i| normal[i] = moved(i, normal[i]));
                (0..size - n).for_each(|t| friction[t] = moved(n + t, friction[t]));
                return;
            }
            way *= 0.5;
        }
    }
}

impl Meeting {
    /// Whether contacts that stick keep another one at rest, whatever its friction does. `sides` says of each contact
    /// whether it is closed, and whether it sticks.
    pub(crate) fn keeps_slipping_one(&self, sides: &[(bool, bool)]) -> bool {
        let n = self.contacts.len();
        let mut kept: Vec<usize> = (0..n).filter(|&i| sides[i].0).collect();
        let sticking = (0..n).filter(|&i| sides[i] == (true, true));
        kept.extend(sticking.flat_map(|i| self.entries(i).map(|t| n + t)));
        let is_kept = |i: usize| {
            let mut rows = kept.clone();
            rows.extend(self.entries(i).map(|t| n + t));
            let of_row = |row: &usize| {
                let row = *row;
                rows.iter().map(move |&column| (row, column))
            };
            let entries = rows.iter().flat_map(of_row);
            let mut matrix: Vec<f64> = entries
                .map(|(row, column)| self.effect(row, column))
                .collect();
            let mut rhs = vec![0.0; rows.len()];
            let solved = eliminate(&mut matrix, &mut rhs, |row| row >= kept.len());
            !solved[kept.len()..].contains(&true)
        };
        let slips = (0..n).filter(|&i| sides[i] == (true, false) && self.resistance(i) > 0.0);
        let mut in_a_plane = slips.filter(|&i| self.entries(i).len() > 1);
        in_a_plane.any(is_kept)
    }
}

impl Meeting {
    /// Whether contacts that push may be held apart by friction, so that how much they push is not determined where they
    /// stick.
    pub(crate) fn wedges(&self, forces: &Forces) -> bool {
        let n = self.contacts.len();
        let mut rows: Vec<usize> = (0..n).filter(|&i| forces.normal[i] > 0.0).collect();
        let pushing = rows.len();
        let rough = (0..pushing).filter(|&at| self.resistance(rows[at]) > 0.0);
        let slips: Vec<usize> = rough.flat_map(|at| self.entries(rows[at])).collect();
        rows.extend(slips.into_iter().map(|t| n + t));
        let size = rows.len();
        let mut matrix = Vec::with_capacity(size * size);
        for &row in &rows {
            matrix.extend(rows.iter().map(|&column| self.effect(row, column)));
        }
        let solved = eliminate(&mut matrix, &mut vec![0.0; size], |row| row >= pushing);
        let changes = |row: usize, by: usize| {
            let change = matrix[row * size + by] / matrix[row * size + row];
            solved[row] && change.abs() > WEDGE
        };
        let mut open = (pushing..size).filter(|&by| !solved[by]);
        open.any(|by| (0..pushing).any(|row| changes(row, by)))
    }

    /// What a force of a contact, or behind all of them of an entry of friction, does to a rate in that order.
    fn effect(&self, rate: usize, force: usize) -> f64 {
        let n = self.contacts.len();
        match (rate.checked_sub(n), force.checked_sub(n)) {
            (None, None) => self.row(0, rate)[force],
            (None, Some(force)) => self.row(1, rate)[force],
            (Some(rate), None) => self.row(2, rate)[force],
            (Some(rate), Some(force)) => self.row(3, rate)[force],
        }
    }
}

/// The changes of α that leave all rates as they are, one for each slip velocity that is held, as rows whose products
/// with a change vanish where it is least.
pub(crate) fn least_changes(
    matrix: &[f64],
    n: usize,
    held: &[bool],
    is_slip: impl Fn(usize) -> bool,
) -> Option<Vec<Vec<f64>>> {
    let free: Vec<usize> = (0..n).filter(|&i| !held[i]).collect();
    let own = |i: usize| matrix[i * n + i].abs();
    let slips = (0..n).filter(|&i| is_slip(i));
    let most = slips.fold(0.0_f64, |most, i| most.max(own(i)));
    let weight = |i: usize| match is_slip(i) {
        true => own(i),
        false => own(i) * own(i) / most,
    };
    let mut lu = DenseLu::new(free.len());
    let entries = free
        .iter()
        .flat_map(|&row| free.iter().map(move |&column| (row, column)));
    let entries: Vec<f64> = entries
        .map(|(row, column)| matrix[row * n + column])
        .collect();
    lu.factor(&entries).ok()?;
    let mut rows = Vec::new();
    for h in (0..n).filter(|&h| held[h]) {
        let mut change: Vec<f64> = free.iter().map(|&row| -matrix[row * n + h]).collect();
        lu.solve(&mut change);
        let mut row = vec![0.0; n];
        row[h] = weight(h);
        for (&i, change) in free.iter().zip(&change) {
            row[i] = weight(i) * change;
        }
        let largest = row.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        row.iter_mut().for_each(|v| *v /= largest);
        if !row.iter().all(|v| v.is_finite()) {
            return None;
        }
        rows.push(row);
    }
    Some(rows)
}
