//! Points that are better in the free quantities of a task, as simulations say.

use super::reduced::{Reduced, Values};

/// Changes of quantities, as shares of their sizes: for derivatives, and for what curves or switches near a point.
pub(crate) const SMALL: f64 = 1e-4;
pub(crate) const LARGE: f64 = 1e-2;
/// Decreases per size of a quantity that count: relative to the objective, and others. These are smaller where the objective
/// is nowhere larger than `TINY`.
const RELATIVE: f64 = 3e-4;
const ABSOLUTE: f64 = 1e-5;
const TINY: f64 = 1e-2;

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
        let more = rows.map(|(i, (&value, bounds))| {
            let known = base.map_or(0.0, |base| beyond(base[i], bounds));
            (beyond(value, bounds).abs() - known.abs()).max(0.0)
        });
        more.sum()
    }
}

/// By how much a value is beyond its bounds, with its sign.
pub(super) fn beyond(value: f64, (lower, upper): (f64, f64)) -> f64 {
    (value - upper).max(0.0) + (value - lower).min(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::around::Around;
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
            let mut around = Around::new(&mut search, SMALL);
            let Found::Descent { points, .. } = around.descent() else {
                panic!("there is a slope");
            };
            let merit = points[0].merit;
            assert!((merit - 1.0).abs() < 1e-12, "{merit}");
        });
    }
}
