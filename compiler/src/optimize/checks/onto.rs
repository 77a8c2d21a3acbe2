//! Points that keep the equations of a task.
//!
//! Where equations constrain, as x(T) = x(0) or x(T) = r, hardly any point keeps them. One that does is near most others:
//! Newton's method on the rows that are violated, with changes of least norm in sizes of the quantities and within their
//! ranges (Gauss-Newton), leads to it. Derivatives are differences of simulations where nothing else is known, and follow
//! the steps that are made (Broyden 1965).

use nalgebra::{DMatrix, DVector};

use super::descent::{Candidate, SMALL, Search, beyond};
use super::reduced::Values;

/// Rows that are off by no more than this share of what the quantities make of them are kept.
const KEPT: f64 = 1e-6;
/// How many steps lead to the equations at most, and what each of them leaves of the violation.
const MOST_STEPS: usize = 12;
const CONTRACTION: f64 = 0.5;
/// What keeps products of slopes regular, beside the largest of them.
const SINGULAR: f64 = 1e-12;

/// How points are reached: by no more than so many simulations, and where equations constrain, by slopes of the rows.
pub(super) struct Reach {
    left: usize,
    slopes: Option<Slopes>,
    is_tied: bool,
}

/// ∂row/∂quantity, in sizes of the quantities.
#[derive(Clone)]
struct Slopes(DMatrix<f64>);

/// A point with its values.
type Point = (Vec<f64>, Values);

impl Reach {
    /// By so many simulations.
    pub fn new(search: &Search<'_, '_, '_>, left: usize) -> Self {
        Reach {
            left,
            slopes: None,
            is_tied: search.reduced.is_tied(),
        }
    }

    fn run(&mut self, search: &mut Search<'_, '_, '_>, w: Vec<f64>) -> Option<Point> {
        self.left = self.left.checked_sub(1)?;
        let values = search.reduced.at(&w)?;
        Some((w, values))
    }

    /// A point with these quantities, or where equations constrain, the one on them that is near; none where there is none,
    /// or no run is left.
    pub fn point(&mut self, search: &mut Search<'_, '_, '_>, w: Vec<f64>) -> Option<Candidate> {
        let (w, values) = self.run(search, w)?;
        let (w, values) = match self.is_tied {
            true => self.onto(search, (w, values))?,
            false => (w, values),
        };
        Some(search.candidate(w, &values))
    }

    /// The same far away from the points that have been reached, where slopes may be others.
    pub fn far(&mut self, search: &mut Search<'_, '_, '_>, w: &[f64]) -> Option<Candidate> {
        let near = self.point(search, w.to_vec());
        near.or_else(|| {
            self.learn(search, w)?;
            self.point(search, w.to_vec())
        })
    }

    /// Finds the slopes at a point by differences, where equations constrain.
    pub fn learn(&mut self, search: &mut Search<'_, '_, '_>, w: &[f64]) -> Option<()> {
        if !self.is_tied {
            return None;
        }
        let (_, base) = self.run(search, w.to_vec())?;
        let quantities = search.reduced.quantities.clone();
        let mut slopes = DMatrix::zeros(base.rows.len(), quantities.len());
        for (number, quantity) in quantities.iter().enumerate() {
            let step = SMALL * quantity.size;
            let step = match w[quantity.index] + step <= quantity.upper {
                true => step,
                false => -step,
            };
            let mut beside = w.to_vec();
            beside[quantity.index] += step;
            let (_, values) = self.run(search, beside)?;
            for (row, (to, from)) in values.rows.iter().zip(&base.rows).enumerate() {
                slopes[(row, number)] = (to - from) / step * quantity.size;
            }
        }
        self.slopes = Some(Slopes(slopes));
        Some(())
    }

    /// The point on the equations that Newton's method leads to.
    fn onto(&mut self, search: &mut Search<'_, '_, '_>, mut point: Point) -> Option<Point> {
        let mut last = f64::INFINITY;
        for _ in 0..=MOST_STEPS {
            let missed = search.missed(&point.1);
            let slopes = self.slopes.as_ref()?;
            let share = slopes.share(&missed);
            if share <= KEPT {
                return Some(point);
            }
            if share > CONTRACTION * last {
                return None;
            }
            last = share;
            let (w, change) = slopes.back(search, &point.0, &missed)?;
            let next = self.run(search, w)?;
            self.slopes.as_mut()?.follow(&change, &point.1, &next.1);
            point = next;
        }
        None
    }
}

impl Slopes {
    /// By how much rows are missed, as a share of what all quantities make of the one that is farthest off.
    fn share(&self, missed: &DVector<f64>) -> f64 {
        let share = |(row, missed): (usize, &f64)| match *missed {
            0.0 => 0.0,
            missed => missed.abs() / self.0.row(row).lp_norm(1),
        };
        missed.iter().enumerate().map(share).fold(0.0, f64::max)
    }

    /// A point at which rows are missed to first order no more, within the ranges of quantities, with the change to it.
    fn back(
        &self,
        search: &Search<'_, '_, '_>,
        w: &[f64],
        missed: &DVector<f64>,
    ) -> Option<(Vec<f64>, DVector<f64>)> {
        let rows: Vec<usize> = (0..missed.len())
            .filter(|&row| missed[row] != 0.0)
            .collect();
        let quantities = &search.reduced.quantities;
        let mut slopes = self.0.select_rows(&rows);
        let mut rhs = missed.select_rows(&rows);
        let mut change = DVector::<f64>::zeros(quantities.len());
        // What meets its bound stays there, and the others do the rest.
        for _ in 0..=quantities.len() {
            let step = least_change(&slopes, &rhs)?;
            let mut is_inside = true;
            for (i, quantity) in quantities.iter().enumerate() {
                let value = w[quantity.index] + quantity.size * (change[i] + step[i]);
                let inside = value.max(quantity.lower).min(quantity.upper);
                let by = (inside - w[quantity.index]) / quantity.size;
                if inside != value && step[i] != 0.0 {
                    rhs += slopes.column(i) * (by - change[i]);
                    slopes.column_mut(i).fill(0.0);
                    (change[i], is_inside) = (by, false);
                }
            }
            if is_inside {
                change += step;
                break;
            }
        }
        let mut next = w.to_vec();
        for (quantity, by) in quantities.iter().zip(&change) {
            let value = w[quantity.index] + quantity.size * by;
            next[quantity.index] = value.max(quantity.lower).min(quantity.upper);
        }
        search.reduced.problem.balance(&mut next);
        Some((next, change))
    }

    /// Takes in what a change has done: S⁺ = S + (Δrows - S d) dᵀ / dᵀd.
    fn follow(&mut self, change: &DVector<f64>, from: &Values, to: &Values) {
        let square = change.norm_squared();
        if square > 0.0 {
            let [from, to] = [from, to].map(|values| DVector::from_column_slice(&values.rows));
            let error = to - from - &self.0 * change;
            self.0 += error * change.transpose() / square;
        }
    }
}

/// The least change that takes away to first order what rows are `missed` by.
pub(super) fn least_change(slopes: &DMatrix<f64>, missed: &DVector<f64>) -> Option<DVector<f64>> {
    let mut square = slopes * slopes.transpose();
    let least = SINGULAR * square.amax();
    (0..missed.len()).for_each(|i| square[(i, i)] += least);
    Some(-slopes.tr_mul(&square.cholesky()?.solve(missed)))
}

impl Search<'_, '_, '_> {
    /// By how much more each row is violated than at the point itself, with its sign.
    pub(super) fn missed(&self, values: &Values) -> DVector<f64> {
        let base = self.base.map(|base| &base.rows);
        let rows = self.reduced.bounds().enumerate().map(|(i, bounds)| {
            let by = beyond(values.rows[i], bounds);
            let known = base.map_or(0.0, |base| beyond(base[i], bounds));
            if by.abs() > known.abs() { by } else { 0.0 }
        });
        DVector::from_iterator(values.rows.len(), rows)
    }
}
