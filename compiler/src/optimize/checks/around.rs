//! Descent in small changes, by differences of simulations.
//!
//! Each free quantity is changed by a little in both directions, as far as its bounds allow. A linear program in these
//! changes, with one-sided differences of the objective and of the constraints that are near, says whether there is
//! descent that keeps them. What it finds counts where a simulation confirms it.

use std::time::Duration;

use nalgebra::{DMatrix, DVector};
use nsd_solver::optimization::mpcc::linear::{LinearProgram, Outcome, solve};

use super::descent::{Candidate, Found, SMALL, Search};
use super::onto::least_change;
use super::pieces::pieces;
use super::reduced::{Quantity, Values};

/// Changes that bounds leave no more than this share of are none.
const LEAST_ROOM: f64 = 1e-2;
/// Constraints that are farther away, relative to their values, are not near.
const NEAR: f64 = 1e-2;
/// By which factor steps grow, and how often.
const FACTOR: f64 = 4.0;
const MOST_STEPS: usize = 10;
/// How often a point is brought back to the constraints at most.
const MOST_RETURNS: usize = 8;
/// A penalty that is so small beside the gain counts for nothing.
const LEAST_PENALTY: f64 = 1e-4;
/// The parts of a change back to them that are taken, by how much of it the one before has reached (secant method).
const LEAST_PART: f64 = 0.25;
const MOST_PART: f64 = 4.0;
/// The most time for a linear program.
const MOST_TIME: Duration = Duration::from_secs(1);

/// Looks in changes of such a share of the sizes of quantities.
pub(super) struct Around<'a, 's, 'r, 'e> {
    search: &'a mut Search<'s, 'r, 'e>,
    change: f64,
}

/// A change of one quantity.
#[derive(Clone)]
pub(super) struct Column {
    pub index: usize,
    /// The change, with its sign.
    pub step: f64,
    /// By how much the objective and the rows change.
    pub cost: f64,
    pub rows: Vec<f64>,
    /// Where its events are.
    pub events: Vec<usize>,
}

impl<'a, 's, 'r, 'e> Around<'a, 's, 'r, 'e> {
    pub fn new(search: &'a mut Search<'s, 'r, 'e>, change: f64) -> Self {
        Around { search, change }
    }

    /// Looks along all quantities.
    pub fn descent(&mut self) -> Found {
        let change = self.change;
        let mut columns = Vec::new();
        let mut is_complete = self.search.base.is_some();
        for number in 0..self.search.reduced.quantities.len() {
            let quantity = self.search.reduced.quantities[number];
            let full = change * quantity.size;
            let first = columns.len();
            for sign in [1.0, -1.0] {
                let value = self.search.w[quantity.index];
                let room = match sign > 0.0 {
                    true => quantity.upper - value,
                    false => value - quantity.lower,
                };
                if room < LEAST_ROOM * full {
                    continue;
                }
                match self.column(quantity.index, sign * full.min(room)) {
                    Some(column) => columns.push(column),
                    None => is_complete = false,
                }
            }
            let between = match &columns[first..] {
                [up, down] => self.between(up, down),
                _ => None,
            };
            columns.extend(between);
            // At a maximum either way is down, and both together are none.
            if let [up, down] = &columns[first..]
                && up.cost < 0.0
                && down.cost < 0.0
            {
                let worse = if up.cost <= down.cost {
                    first + 1
                } else {
                    first
                };
                columns.remove(worse);
            }
        }
        let found = self.together(&columns);
        let found = found.or_else(|| {
            let pieces = (change == SMALL)
                .then(|| pieces(&columns, &self.search.reduced.quantities, self.search.w));
            let mut pieces = pieces.iter().flatten();
            pieces.find_map(|piece| self.together(piece))
        });
        match (found, is_complete) {
            (Some((point, rate)), _) => Found::Descent {
                points: vec![point],
                rate,
                is_first_order: change == SMALL,
            },
            (None, true) => Found::Nothing,
            (None, false) => Found::Unknown,
        }
    }

    /// A point that is better by changes together, or by the best of them where the objective curves and they lead too far
    /// together.
    fn together(&mut self, columns: &[Column]) -> Option<(Candidate, f64)> {
        let direction = self.direction(columns)?;
        let best = columns.iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
        let alone = best.map(|column| [(column.index, column.step)]);
        let joint = self.follow(&direction, columns);
        joint.or_else(|| self.follow(&alone?, columns))
    }

    /// The change to the minimum of the parabola through two that are opposite and uphill, if it is downhill: where the
    /// objective curves, it falls less far than they reach.
    fn between(&mut self, up: &Column, down: &Column) -> Option<Column> {
        let change = self.change;
        let [slope, bend] = [-1.0, 1.0].map(|sign| 0.5 * (up.cost + sign * down.cost));
        let least = self.search.threshold(change) * change;
        let is_uphill = up.cost >= 0.0 && down.cost >= 0.0 && up.step == -down.step;
        if !is_uphill || slope * slope <= 4.0 * bend * least {
            return None;
        }
        let column = self.column(up.index, -0.5 * slope / bend * up.step)?;
        (column.cost < 0.0).then_some(column)
    }

    /// What one change does. Where the point itself has no simulation, it is the difference of two changes.
    fn column(&mut self, index: usize, step: f64) -> Option<Column> {
        let mut at = |share: f64| {
            let mut w = self.search.w.to_vec();
            w[index] += share * step;
            self.search.reduced.at(&w)
        };
        let near = at(1.0)?;
        let (from, to) = match self.search.base {
            Some(base) => (base.clone(), near),
            None => {
                let half = at(0.5)?;
                (half, near)
            }
        };
        let share = if self.search.base.is_some() { 1.0 } else { 2.0 };
        let rows = from.rows.iter().zip(&to.rows);
        Some(Column {
            index,
            step,
            cost: share * (to.cost - from.cost),
            rows: rows.map(|(from, to)| share * (to - from)).collect(),
            events: to.events,
        })
    }

    /// Changes of the quantities together that descend to first order, if there are any.
    fn direction(&self, columns: &[Column]) -> Option<Vec<(usize, f64)>> {
        let change = self.change;
        let least = self.search.threshold(change) * change;
        if columns.iter().all(|column| column.cost >= -least) && self.near_rows().is_empty() {
            return None;
        }
        let shares = self.shares(columns)?;
        let decrease: f64 = (columns.iter().zip(&shares))
            .map(|(c, s)| -c.cost * s)
            .sum();
        // Each of the changes that take part has to be worth it.
        let count: f64 = shares.iter().sum();
        (decrease > least && decrease > 0.1 * least * count).then(|| {
            let moves = columns
                .iter()
                .zip(&shares)
                .filter(|(_, share)| **share > 1e-3);
            moves
                .map(|(column, share)| (column.index, share * column.step))
                .collect()
        })
    }

    /// The constraints that are near, by their numbers, with the room that they leave.
    fn near_rows(&self) -> Vec<(usize, [f64; 2])> {
        let Some(base) = self.search.base else {
            return Vec::new();
        };
        let rows = base
            .rows
            .iter()
            .zip(self.search.reduced.bounds())
            .enumerate();
        let near = rows.filter_map(|(i, (&value, (lower, upper)))| {
            if lower == upper {
                return Some((i, [0.0, 0.0]));
            }
            let room = [value - lower, upper - value].map(|room| room.max(0.0));
            let is_near = room[0].min(room[1]) <= NEAR * value.abs().max(1.0);
            is_near.then_some((i, room))
        });
        near.collect()
    }

    /// The shares of the columns, in [0, 1], that descend most and keep the rows to first order.
    fn shares(&self, columns: &[Column]) -> Option<Vec<f64>> {
        let largest = columns
            .iter()
            .fold(0.0, |m: f64, column| m.max(-column.cost));
        let mut rows = self.near_rows();
        if let Some(base) = self.search.base {
            let plane = base.rows.len();
            let has_plane = columns.iter().any(|column| column.rows.len() > plane);
            rows.extend(has_plane.then_some((plane, [0.0, f64::INFINITY])));
        }
        if rows.is_empty() {
            // Without constraints steepest descent does.
            let share = |column: &Column| (-column.cost / largest).max(0.0);
            return (largest > 0.0).then(|| columns.iter().map(share).collect());
        }
        let n = columns.len();
        let scale = columns
            .iter()
            .fold(0.0, |m: f64, column| m.max(column.cost.abs()));
        if scale == 0.0 {
            return None;
        }
        let mut program = LinearProgram {
            cost: columns.iter().map(|column| column.cost / scale).collect(),
            lower: vec![0.0; n],
            upper: vec![1.0; n],
            ..LinearProgram::default()
        };
        for (row, room) in rows {
            let changes = columns.iter().map(|column| column.rows[row]);
            let [down, up] = [-1.0, 1.0].map(|sign| {
                changes
                    .clone()
                    .map(|change| (sign * change).max(0.0))
                    .sum::<f64>()
            });
            let reach = down + up;
            // A bound that all changes together do not reach is none.
            let bound = |room: f64, most: f64| match room < most {
                true => room / reach,
                false => f64::INFINITY,
            };
            let [lower, upper] = [bound(room[0], down), bound(room[1], up)];
            if lower.min(upper) == f64::INFINITY {
                continue;
            }
            let place = program.row_lower.len();
            program.row_lower.push(-lower);
            program.row_upper.push(upper);
            let entries = changes.enumerate().filter(|(_, change)| *change != 0.0);
            program
                .entries
                .extend(entries.map(|(column, change)| (place, column, change / reach)));
        }
        let limit = self.search.reduced.limit.sooner(MOST_TIME);
        match solve(&program, &program.lower, &program.upper, &limit) {
            Outcome::Optimal(shares) => Some(shares),
            Outcome::Infeasible | Outcome::Failed => None,
        }
    }

    /// The best point along a direction, and the rate at which the merit falls; none where it does not.
    fn follow(
        &mut self,
        direction: &[(usize, f64)],
        columns: &[Column],
    ) -> Option<(Candidate, f64)> {
        let change = self.change;
        let least = self.search.threshold(change);
        let (mut best, mut share) = (self.candidate_along(direction, columns, 1.0)?, 1.0);
        let rate = (self.objective() - best.merit) / change;
        if rate <= least {
            return None;
        }
        for _ in 0..MOST_STEPS {
            share *= FACTOR;
            let next = self.candidate_along(direction, columns, share);
            let Some(next) = next.filter(|next| next.merit < best.merit) else {
                break;
            };
            best = next;
        }
        Some((best, rate))
    }

    /// J at the point itself, as it is simulated if it can be.
    fn objective(&self) -> f64 {
        (self.search.base).map_or(self.search.objective, |base| base.cost)
    }

    /// The point so far along a direction, brought back to the constraints where that is better: a penalty with multipliers
    /// that are not unique, and may be large, outweighs any descent.
    fn candidate_along(
        &mut self,
        direction: &[(usize, f64)],
        columns: &[Column],
        share: f64,
    ) -> Option<Candidate> {
        let mut w = self.search.w.to_vec();
        for &(index, step) in direction {
            w[index] += share * step;
        }
        let (mut w, mut values) = self.evaluate(w)?;
        let mut best = self.search.candidate(w.clone(), &values);
        let (mut missed, mut part) = (self.search.missed(&values), 1.0);
        let objective = self.objective();
        for _ in 0..MOST_RETURNS {
            // What violations cost, beside what is gained.
            let (penalty, gain) = (best.merit - values.cost, objective - values.cost);
            if penalty <= LEAST_PENALTY * gain || gain <= 0.0 {
                break;
            }
            self.bring_back(&mut w, (&values, part * &missed), columns);
            let Some(returned) = self.evaluate(w) else {
                break;
            };
            (w, values) = returned;
            let next = self.search.candidate(w.clone(), &values);
            if next.merit >= best.merit {
                break;
            }
            best = next;
            let left = self.search.missed(&values);
            let ratio = left.dot(&missed) / missed.norm_squared();
            part = (part / (1.0 - ratio)).clamp(LEAST_PART, MOST_PART);
            missed = left;
        }
        Some(best)
    }

    /// A point within the bounds of quantities, with its values.
    fn evaluate(&mut self, mut w: Vec<f64>) -> Option<(Vec<f64>, Values)> {
        for quantity in &self.search.reduced.quantities {
            let value = &mut w[quantity.index];
            *value = value.max(quantity.lower).min(quantity.upper);
        }
        let values = self.search.reduced.at(&w)?;
        Some((w, values))
    }

    /// The least change, by the sizes of quantities, that takes away to first order what rows are `missed` by.
    fn bring_back(
        &self,
        w: &mut [f64],
        (values, missed): (&Values, DVector<f64>),
        columns: &[Column],
    ) {
        let rows: Vec<usize> = (0..missed.len()).filter(|&i| missed[i] != 0.0).collect();
        // A change of each quantity that leads to the same events, if there is one.
        let moves = self
            .search
            .reduced
            .quantities
            .iter()
            .filter_map(|quantity| {
                let own = |column: &&Column| column.index == quantity.index;
                let is_alike = |column: &&Column| own(column) && column.events == values.events;
                let alike = columns.iter().find(is_alike);
                Some((quantity, alike.or_else(|| columns.iter().find(own))?))
            });
        let moves: Vec<(&Quantity, &Column)> = moves.collect();
        if rows.is_empty() || moves.is_empty() {
            return;
        }
        let slopes = DMatrix::from_fn(rows.len(), moves.len(), |i, j| {
            let (quantity, column) = moves[j];
            quantity.size * column.rows[rows[i]] / column.step
        });
        let missed = missed.select_rows(&rows);
        let Some(change) = least_change(&slopes, &missed) else {
            return;
        };
        for ((quantity, _), by) in moves.iter().zip(&change) {
            w[quantity.index] += quantity.size * by;
        }
    }
}
