//! Descent in the free quantities of a task, by differences of simulations.
//!
//! Each free quantity is changed by a little in both directions, as far as its bounds allow. A linear program in these
//! changes, with one-sided differences of the objective and of the constraints that are near, says whether there is
//! descent that keeps them. What it finds counts where a simulation confirms it.

use std::time::Duration;

use nsd_solver::optimization::mpcc::linear::{LinearProgram, Outcome, solve};

use super::reduced::{Reduced, Values};

/// Changes of quantities, as shares of their sizes: for derivatives, and for what curves or switches near a point.
pub(crate) const SMALL: f64 = 1e-4;
pub(crate) const LARGE: f64 = 1e-2;
/// Changes that bounds leave no more than this share of are none.
const LEAST_ROOM: f64 = 1e-2;
/// Decreases per size of a quantity that count: relative to the objective, and others. These are smaller where the objective
/// is nowhere larger than `TINY`.
const RELATIVE: f64 = 3e-4;
const ABSOLUTE: f64 = 1e-5;
const TINY: f64 = 1e-2;
/// Constraints that are farther away, relative to their values, are not near.
const NEAR: f64 = 1e-2;
/// By which factor steps grow, and how often.
const FACTOR: f64 = 4.0;
const MOST_STEPS: usize = 10;
/// The most time for a linear program.
const MOST_TIME: Duration = Duration::from_secs(1);

/// What differences say about a point.
pub(crate) enum Found {
    /// No descent along any of the quantities.
    Nothing,
    /// Points that are better or may lead to better ones, the best first, and by how much the objective falls per size of a
    /// quantity.
    Descent {
        points: Vec<Candidate>,
        rate: f64,
        /// Whether it falls so in small changes.
        is_first_order: bool,
    },
    /// Simulations do not say.
    Unknown,
}

impl Found {
    /// Points that are better than an objective by more than small changes show, the best first.
    pub(crate) fn better(points: Vec<Candidate>, objective: f64) -> Self {
        match points.first() {
            None => Found::Nothing,
            Some(best) => Found::Descent {
                rate: objective - best.merit,
                points,
                is_first_order: false,
            },
        }
    }
}

/// A point, and the objective there with what violations add.
pub(crate) struct Candidate {
    pub merit: f64,
    /// The violations that it adds.
    pub excess: f64,
    pub w: Vec<f64>,
}

/// A change of one quantity.
struct Column {
    index: usize,
    /// The change, with its sign.
    step: f64,
    /// By how much the objective and the rows change.
    cost: f64,
    rows: Vec<f64>,
}

/// Looks for descent from a point with an objective and, where it can be simulated, its values. `weight` is above the
/// multipliers of constraints, `doubt` an error of the objective, and `room` what the objective may gain from the room that
/// constraints have in the simulation and not in the program.
pub(crate) struct Search<'s, 'r, 'e> {
    pub reduced: &'s mut Reduced<'r, 'e>,
    pub w: &'s [f64],
    pub objective: f64,
    pub base: Option<&'s Values>,
    pub weight: f64,
    pub doubt: f64,
    pub room: f64,
    /// How large the objective is around the point, at most 1.
    pub scale: f64,
}

/// How large the objective is at a point and where all quantities are larger or smaller by their sizes, as a share of
/// `TINY` and at most 1.
pub(crate) fn scale(reduced: &mut Reduced<'_, '_>, w: &[f64], objective: f64) -> f64 {
    if objective.abs() >= TINY {
        return 1.0;
    }
    let costs = [1.0, -1.0].map(|sign| {
        let mut other = w.to_vec();
        for quantity in &reduced.quantities {
            let value = &mut other[quantity.index];
            *value = (*value + sign * quantity.size)
                .max(quantity.lower)
                .min(quantity.upper);
        }
        reduced.problem.balance(&mut other);
        reduced.at(&other).map_or(TINY, |values| values.cost.abs())
    });
    let largest = costs.into_iter().fold(objective.abs(), f64::max);
    (largest / TINY).min(1.0)
}

impl Search<'_, '_, '_> {
    /// What counts as a decrease per size of a quantity, in changes of such a share of it.
    pub(crate) fn threshold(&self, change: f64) -> f64 {
        let least = RELATIVE * self.objective.abs() + ABSOLUTE * self.scale;
        least.max(self.doubt).max(self.room / change)
    }

    /// Looks along all quantities, in changes of such a share of their sizes.
    pub fn descent(&mut self, change: f64) -> Found {
        let mut columns = Vec::new();
        let mut is_complete = self.base.is_some();
        for number in 0..self.reduced.quantities.len() {
            let quantity = self.reduced.quantities[number];
            let full = change * quantity.size;
            let first = columns.len();
            for sign in [1.0, -1.0] {
                let value = self.w[quantity.index];
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
                [up, down] => self.between(up, down, change),
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
        let nothing = || match is_complete {
            true => Found::Nothing,
            false => Found::Unknown,
        };
        let Some(direction) = self.direction(&columns, change) else {
            return nothing();
        };
        // Where the objective curves, changes that are downhill one by one may lead too far together.
        let best = columns.iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
        let alone = best.map(|column| [(column.index, column.step)]);
        let joint = self.follow(&direction, change);
        match joint.or_else(|| self.follow(&alone?, change)) {
            Some((point, rate)) => Found::Descent {
                points: vec![point],
                rate,
                is_first_order: change == SMALL,
            },
            None => nothing(),
        }
    }

    /// The change to the minimum of the parabola through two that are opposite and uphill, if it is downhill: where the
    /// objective curves, it falls less far than they reach.
    fn between(&mut self, up: &Column, down: &Column, change: f64) -> Option<Column> {
        let [slope, bend] = [-1.0, 1.0].map(|sign| 0.5 * (up.cost + sign * down.cost));
        let least = self.threshold(change) * change;
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
            let mut w = self.w.to_vec();
            w[index] += share * step;
            self.reduced.at(&w)
        };
        let near = at(1.0)?;
        let (from, to) = match self.base {
            Some(base) => (base.clone(), near),
            None => {
                let half = at(0.5)?;
                (half, near)
            }
        };
        let share = if self.base.is_some() { 1.0 } else { 2.0 };
        let rows = from.rows.iter().zip(&to.rows);
        Some(Column {
            index,
            step,
            cost: share * (to.cost - from.cost),
            rows: rows.map(|(from, to)| share * (to - from)).collect(),
        })
    }

    /// Changes of the quantities together that descend to first order, if there are any.
    fn direction(&self, columns: &[Column], change: f64) -> Option<Vec<(usize, f64)>> {
        let least = self.threshold(change) * change;
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
        let Some(base) = self.base else {
            return Vec::new();
        };
        let rows = base.rows.iter().zip(self.reduced.bounds()).enumerate();
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
        let rows = self.near_rows();
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
        let limit = self.reduced.limit.sooner(MOST_TIME);
        match solve(&program, &program.lower, &program.upper, &limit) {
            Outcome::Optimal(shares) => Some(shares),
            Outcome::Infeasible | Outcome::Failed => None,
        }
    }

    /// A point that has been simulated.
    pub(crate) fn candidate(&self, w: Vec<f64>, values: &Values) -> Candidate {
        let excess = self.excess(values);
        Candidate {
            merit: values.cost + self.weight * excess,
            excess,
            w,
        }
    }

    /// How much more constraints are violated than at the point itself, all together.
    fn excess(&self, values: &Values) -> f64 {
        let base = self.base.map(|base| &base.rows);
        let rows = values.rows.iter().zip(self.reduced.bounds()).enumerate();
        let violation =
            |value: f64, (lower, upper): (f64, f64)| (lower - value).max(value - upper).max(0.0);
        let more = rows.map(|(i, (&value, bounds))| {
            let known = base.map_or(0.0, |base| violation(base[i], bounds));
            (violation(value, bounds) - known).max(0.0)
        });
        more.sum()
    }

    /// The best point along a direction, and the rate at which the merit falls; none where it does not.
    fn follow(&mut self, direction: &[(usize, f64)], change: f64) -> Option<(Candidate, f64)> {
        let objective = self.base.map_or(self.objective, |base| base.cost);
        let least = self.threshold(change);
        let mut at = |share: f64| {
            let mut w = self.w.to_vec();
            for &(index, step) in direction {
                w[index] += share * step;
            }
            for quantity in &self.reduced.quantities {
                let value = &mut w[quantity.index];
                *value = value.max(quantity.lower).min(quantity.upper);
            }
            let values = self.reduced.at(&w)?;
            Some(self.candidate(w, &values))
        };
        let (mut best, mut share) = (at(1.0)?, 1.0);
        let rate = (objective - best.merit) / change;
        if rate <= least {
            return None;
        }
        for _ in 0..MOST_STEPS {
            share *= FACTOR;
            let Some(next) = at(share).filter(|next| next.merit < best.merit) else {
                break;
            };
            best = next;
        }
        Some((best, rate))
    }
}

#[cfg(test)]
mod tests {
    use super::super::reduced::Reduced;
    use super::{Found, SMALL, Search};
    use crate::limit::Limit;
    use crate::optimize::{Given, Problem};
    use crate::testing::with_last;

    /// J = 1 + 100 (u - 1)², with changes of u by 2e-4, from 5e-5 beside the minimum: uphill on both sides.
    #[test]
    fn curvature_hides_no_slope() {
        let text = "model m { state x = 0; control u in [-1, 3] = 0.99995; x' = u; }
                    optimize o of m { horizon 1; intervals 1; minimize final(1 + 100*(x - 1)^2); }";
        with_last(text, |compiled| {
            let task = (compiled.settings.optimize.as_ref()).expect("it is an optimization");
            let problem = Problem::new(&compiled.system, &compiled.settings, task, Given::Numbers);
            let problem = problem.expect("it has a program");
            let (w, _) = problem.start(&[], &Limit::default());
            let mut reduced = Reduced::new(&problem, &w, &Limit::default()).expect("it has a task");
            let base = reduced.at(&w).expect("it reaches its end");
            let mut search = Search {
                reduced: &mut reduced,
                w: &w,
                objective: base.cost,
                base: Some(&base),
                weight: 1.0,
                doubt: 0.0,
                room: 0.0,
                scale: 1.0,
            };
            let Found::Descent { points, .. } = search.descent(SMALL) else {
                panic!("there is a slope");
            };
            let merit = points[0].merit;
            assert!((merit - 1.0).abs() < 1e-12, "{merit}");
        });
    }
}
