//! Nonlinear least squares within bounds, by the method of Levenberg and Marquardt.
//!
//! minimize Σ ρ(r_i(p))   subject to   l <= p <= u,   ρ(r) = r², or Huber's, which goes on as a straight line beyond d:
//!
//! ρ(r) = 2 d |r| - d² for |r| > d.
//!
//! With ω_i = min(1, d/|r_i|), which makes 2 Jᵀ ω r the gradient, a step s solves
//!
//! (Jᵀ ω J + λ D²) s = -Jᵀ ω r
//!
//! for those p that are not held at a bound by the gradient, D_j being the largest length of column j so far (Moré 1978), and
//! is the best one within the bounds. λ follows the ratio of what is gained
//! and what the linear model gains (Nielsen 1999). A point where r is not known, or is beyond what numbers can tell, is a step
//! that is rejected; where the gain is below the rounding of the sum, a step is judged by the offset.
//!
//! The search ends by the relative offset (Bates & Watts 1981): with Q an orthonormal basis of what columns of √ω J span,
//! those that no bound holds,
//!
//! ‖Qᵀ √ω r‖ / s,   s² = ‖ω r‖² / (m - rank),
//!
//! bounds how far p is from the minimum of the linear model, in units of its standard errors.

use nalgebra::{DMatrix, DVector};

/// r and J at a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearized {
    /// r.
    pub residuals: DVector<f64>,
    /// J = dr/dp.
    pub jacobian: DMatrix<f64>,
    /// The length of what is not known of r.
    pub noise: f64,
    /// What is not known of J: directions that change r by less than this part, columns being of length one, are rounding.
    pub rank: f64,
}

/// Residuals as functions of p.
pub trait Residuals {
    /// r and J at a point; none where they are not known.
    fn at(&mut self, p: &[f64]) -> Option<Linearized>;

    /// Told that the last point is where the search is now.
    fn taken(&mut self) {}

    /// How far p_j has to go to be somewhere else.
    fn sizes(&self, p: &[f64]) -> Vec<f64>;

    /// Whether the method should go on no more.
    fn is_over(&self) -> bool;
}

/// ρ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Loss {
    /// r²
    #[default]
    Squared,
    /// r² up to d, and a straight line beyond.
    Huber(f64),
}

impl Loss {
    /// ρ(r).
    pub fn of(self, r: f64) -> f64 {
        match self {
            Loss::Huber(d) if r.abs() > d => 2.0 * d * r.abs() - d * d,
            _ => r * r,
        }
    }

    /// ω(r).
    pub fn weight(self, r: f64) -> f64 {
        match self {
            Loss::Huber(d) if r.abs() > d => d / r.abs(),
            _ => 1.0,
        }
    }
}

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// At a point where the offset vanishes, or is that of what is not known of r: see [`Fitted::offset`].
    Solved,
    /// At a point where r, which is not small, changes to second order at most: with all p, or with the one of this number,
    /// away from which the sum is less.
    Flat(Option<usize>),
    /// At a point from where no step gains anything.
    Stalled,
    /// After as many iterations as there may be.
    IterationLimit,
    /// It was told to.
    Over,
}

/// Where a search ended.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// p.
    pub point: Vec<f64>,
    /// r and J there.
    pub at: Linearized,
    /// Σ ρ(r).
    pub cost: f64,
    /// The relative offset.
    pub offset: f64,
    /// Steps that were taken.
    pub iterations: usize,
    /// Steps that were rejected, as r was not known at their ends.
    pub failures: usize,
    /// How it ended.
    pub status: Status,
}

/// Steps, rejected ones among them.
const MOST: usize = 200;
/// The search goes on until the offset is below this, or no step gains anything ..
const TARGET: f64 = 1e-9;
/// .. and is solved where it then is below this.
const SMALL: f64 = 1e-3;
/// λ in the beginning (Nielsen 1999), and where a step is as good as none.
const FIRST: f64 = 1e-3;
const LARGEST: f64 = 1e14;
/// Changes of what a step holds at a bound, for each p: a step before the best one gains, too.
const MOST_HELD: usize = 8;
/// A step gains at least this part of what its model gains ..
const LEAST_RATIO: f64 = 1e-4;
/// .. and where that is below this part of the sum, the offset becomes this part of what it was.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
const LESS: f64 = 0.5;

/// Looks for a minimum from a point, which is moved into the bounds; none where r is not known there.
pub fn solve(
    problem: &mut dyn Residuals,
    start: &[f64],
    bounds: &[[f64; 2]],
    loss: Loss,
) -> Option<Fitted> {
    let point = DVector::from_iterator(start.len(), start.iter().copied());
    let point = projected(&point, bounds);
    let mut search = Search::at(point.clone(), problem.at(point.as_slice())?, bounds, loss)?;
    problem.taken();
    let (mut lambda, mut growth) = (FIRST, 2.0);
    let (mut iterations, mut failures) = (0, 0);
    let mut status = Status::IterationLimit;
    for _ in 0..MOST {
        if search.offset <= TARGET {
            status = Status::Solved;
            break;
        }
        if problem.is_over() {
            status = Status::Over;
            break;
        }
        let step = search.step(lambda);
        let gain = search.gain(&step);
        if lambda > LARGEST || gain <= 0.0 {
            status = Status::Stalled;
            break;
        }
        let trial = projected(&(&search.point + step), bounds);
        let found = problem.at(trial.as_slice());
        let found = found.and_then(|at| Search::at(trial, at, bounds, loss));
        failures += usize::from(found.is_none());
        let is_rounding = gain <= ROUNDING * search.cost;
        let ratio = |other: &Search<'_>| search.gained(other) / gain;
        let is_better = |other: &Search<'_>| match is_rounding {
            true => other.offset < LESS * search.offset,
            false => ratio(other) > LEAST_RATIO,
        };
        match found.filter(is_better) {
            Some(other) => {
                lambda *=
                    (1.0 - (2.0 * ratio(&other) - 1.0).clamp(-1.0, 1.0).powi(3)).max(1.0 / 3.0);
                growth = 2.0;
                iterations += 1;
                problem.taken();
                search = other.after(&search);
            }
            None if is_rounding => {
                status = Status::Stalled;
                break;
            }
            None => {
                lambda *= growth;
                growth *= 2.0;
            }
        }
    }
    if status != Status::Over && search.is_solved() {
        status = search.flat(problem).map_or(Status::Solved, Status::Flat);
    }
    Some(Fitted {
        point: search.point.as_slice().to_vec(),
        at: search.at,
        cost: search.cost,
        offset: search.offset,
        iterations,
        failures,
        status,
    })
}

fn projected(p: &DVector<f64>, bounds: &[[f64; 2]]) -> DVector<f64> {
    let within = p
        .iter()
        .zip(bounds)
        .map(|(&p, &[low, high])| p.max(low).min(high));
    DVector::from_iterator(p.len(), within)
}

/// A point with what is known of it.
struct Search<'b> {
    point: DVector<f64>,
    at: Linearized,
    bounds: &'b [[f64; 2]],
    loss: Loss,
    cost: f64,
    /// √ω r and √ω J.
    residuals: DVector<f64>,
    jacobian: DMatrix<f64>,
    /// Jᵀ ω r.
    slope: DVector<f64>,
    /// D.
    scale: DVector<f64>,
    /// The relative offset, and ‖Qᵀ √ω r‖.
    offset: f64,
    inside: f64,
}

impl<'b> Search<'b> {
    /// None where sums of squares are no numbers, or are rounded to zero.
    fn at(point: DVector<f64>, at: Linearized, bounds: &'b [[f64; 2]], loss: Loss) -> Option<Self> {
        let weights = at.residuals.map(|r| loss.weight(r).sqrt());
        let residuals = at.residuals.component_mul(&weights);
        let mut jacobian = at.jacobian.clone();
        for mut column in jacobian.column_iter_mut() {
            column.component_mul_assign(&weights);
        }
        let slope = jacobian.tr_mul(&residuals);
        let is_told = |squares: f64, largest: f64| {
            squares.is_finite() && (squares >= f64::MIN_POSITIVE || largest == 0.0)
        };
        let cost = at.residuals.iter().map(|&r| loss.of(r)).sum();
        let mut columns = jacobian.column_iter();
        let is_known = is_told(cost, at.residuals.amax())
            && columns.all(|column| is_told(column.norm_squared(), column.amax()))
            && slope.iter().all(|slope| slope.is_finite());
        if !is_known {
            return None;
        }
        let mut search = Search {
            scale: DVector::from_iterator(point.len(), jacobian.column_iter().map(|c| c.norm())),
            offset: 0.0,
            inside: 0.0,
            residuals,
            jacobian,
            slope,
            cost,
            point,
            at,
            bounds,
            loss,
        };
        search.measures();
        Some(search)
    }

    /// The same behind another point.
    fn after(mut self, earlier: &Self) -> Self {
        self.scale = self.scale.sup(&earlier.scale);
        self
    }

    /// Whether the gradient holds p_j at a bound.
    fn is_held(&self, j: usize) -> bool {
        let ([low, high], slope) = (self.bounds[j], self.slope[j]);
        let p = self.point[j];
        low == high || p <= low && slope > 0.0 || p >= high && slope < 0.0
    }

    /// What no bound holds, and whether r changes with it.
    fn open(&self) -> impl Iterator<Item = (usize, bool)> {
        let open = (0..self.point.len()).filter(|&j| !self.is_held(j));
        open.map(|j| (j, self.jacobian.column(j).amax() > 0.0))
    }

    /// The relative offset of columns that are of length one.
    fn measures(&mut self) {
        let felt = self.open().filter(|(_, is_felt)| *is_felt);
        let columns: Vec<DVector<f64>> = felt
            .map(|(j, _)| self.jacobian.column(j).normalize())
            .collect();
        if columns.is_empty() || self.cost == 0.0 {
            return;
        }
        let qr = DMatrix::from_columns(&columns).col_piv_qr();
        let r = qr.r();
        let rank = (0..r.nrows().min(r.ncols()))
            .take_while(|&k| r[(k, k)].abs() > self.at.rank * r[(0, 0)].abs())
            .count();
        let mut rotated = self.residuals.clone();
        qr.q_tr_mul(&mut rotated);
        self.inside = rotated.rows(0, rank).norm();
        let loss = self.loss;
        let length = self.at.residuals.map(|r| loss.weight(r) * r).norm();
        let freedom = self.residuals.len().saturating_sub(rank).max(1);
        self.offset = self.inside / length * (freedom as f64).sqrt();
    }

    /// Whether it is a minimum as far as r is known.
    fn is_solved(&self) -> bool {
        self.offset <= SMALL || self.inside <= self.at.noise
    }

    /// See [`Status::Flat`].
    fn flat(&self, problem: &mut dyn Residuals) -> Option<Option<usize>> {
        if self.residuals.norm() <= self.at.noise {
            return None;
        }
        let open: Vec<(usize, bool)> = self.open().collect();
        if !open.is_empty() && open.iter().all(|(_, is_felt)| !is_felt) {
            return Some(None);
        }
        let sizes = problem.sizes(self.point.as_slice());
        let mut still = open.iter().filter(|(_, is_felt)| !is_felt);
        let is_less = |problem: &mut dyn Residuals, j: usize, size: f64| {
            let mut other = self.point.clone();
            other[j] += size;
            let other = projected(&other, self.bounds);
            let at = problem.at(other.as_slice());
            let other = at.and_then(|at| Search::at(other, at, self.bounds, self.loss));
            other.is_some_and(|other| self.gained(&other) > ROUNDING * self.cost)
        };
        let found =
            still.find(|&&(j, _)| is_less(problem, j, sizes[j]) || is_less(problem, j, -sizes[j]));
        found.map(|&(j, _)| Some(j))
    }

    /// By how much the sum is less at another point.
    fn gained(&self, other: &Self) -> f64 {
        let pairs = self.at.residuals.iter().zip(other.at.residuals.iter());
        pairs
            .map(|(&here, &there)| self.loss.of(here) - self.loss.of(there))
            .sum()
    }

    /// The step for λ that is the best one within the bounds (Stark & Parker 1995): the first p that it would take beyond
    /// its bound is held there, until the gradient leads inside.
    fn step(&self, lambda: f64) -> DVector<f64> {
        let felt = self.open().filter(|(_, is_felt)| *is_felt);
        let open: Vec<usize> = felt.map(|(j, _)| j).collect();
        let (mut free, mut step) = (open.clone(), DVector::zeros(self.point.len()));
        for _ in 0..=MOST_HELD * open.len() {
            let mut held = step.clone();
            free.iter().for_each(|&j| held[j] = 0.0);
            let solved = self.solved(lambda, &free, &held);
            let within = |k: usize| {
                let [low, high] = self.bounds[free[k]].map(|bound| bound - self.point[free[k]]);
                solved[k].max(low).min(high)
            };
            let share = |k: usize| match within(k) {
                bound if bound == solved[k] => 1.0,
                bound => (bound - step[free[k]]) / (solved[k] - step[free[k]]),
            };
            let shares = (0..free.len()).map(|k| (k, share(k)));
            let first = shares.min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((k, share)) = first.filter(|(_, share)| *share < 1.0) else {
                free.iter().zip(&solved).for_each(|(&j, &s)| step[j] = s);
                match self.led_inside(lambda, &step, open.iter().filter(|j| !free.contains(j))) {
                    Some(j) => free.push(j),
                    None => return step,
                }
                continue;
            };
            let bound = within(k);
            for (&j, s) in free.iter().zip(&solved) {
                step[j] += share * (s - step[j]);
            }
            step[free.remove(k)] = bound;
        }
        step
    }

    /// Which of those that are held at a bound the gradient leads inside the most, relative to the length of its column.
    fn led_inside<'j>(
        &self,
        lambda: f64,
        step: &DVector<f64>,
        held: impl Iterator<Item = &'j usize>,
    ) -> Option<usize> {
        let left = &self.residuals + &self.jacobian * step;
        let inward = |&j: &usize| {
            let column = self.jacobian.column(j);
            let slope = column.dot(&left) + lambda * self.scale[j].powi(2) * step[j];
            let is_low = self.point[j] + step[j] <= self.bounds[j][0];
            (j, if is_low { -slope } else { slope } / column.norm())
        };
        let most = held.map(inward).max_by(|a, b| a.1.total_cmp(&b.1));
        let (j, inward) = most?;
        (inward > ROUNDING * left.norm()).then_some(j)
    }

    /// The step of some parameters where the others have theirs, and they none.
    fn solved(&self, lambda: f64, open: &[usize], step: &DVector<f64>) -> DVector<f64> {
        let (m, k) = (self.jacobian.nrows(), open.len());
        if k == 0 {
            return DVector::zeros(0);
        }
        let mut matrix = DMatrix::zeros(m + k, k);
        for (at, &j) in open.iter().enumerate() {
            let column = self.jacobian.column(j);
            matrix.view_mut((0, at), (m, 1)).copy_from(&column);
            let scale = if self.scale[j] > 0.0 {
                self.scale[j]
            } else {
                1.0
            };
            matrix[(m + at, at)] = lambda.sqrt() * scale;
        }
        let mut right = DVector::zeros(m + k);
        right
            .rows_mut(0, m)
            .copy_from(&-(&self.residuals + &self.jacobian * step));
        let qr = matrix.qr();
        qr.q_tr_mul(&mut right);
        let solved = qr
            .r()
            .solve_upper_triangular(&right.rows(0, k).into_owned());
        solved.unwrap_or_else(|| DVector::zeros(k))
    }

    /// What the linear model gains with a step.
    fn gain(&self, step: &DVector<f64>) -> f64 {
        let change = &self.jacobian * step;
        -(2.0 * self.residuals.dot(&change) + change.norm_squared())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::{Fitted, Linearized, Loss, Residuals, Status, solve};

    /// A function with its Jacobian.
    struct Problem<F>(F);

    impl<F: FnMut(&[f64]) -> Option<(Vec<f64>, Vec<f64>)>> Residuals for Problem<F> {
        fn at(&mut self, p: &[f64]) -> Option<Linearized> {
            let (r, rows) = (self.0)(p)?;
            Some(Linearized {
                jacobian: DMatrix::from_row_slice(r.len(), p.len(), &rows),
                residuals: DVector::from_vec(r),
                noise: 0.0,
                rank: 1e-12,
            })
        }

        fn sizes(&self, p: &[f64]) -> Vec<f64> {
            vec![1.0; p.len()]
        }

        fn is_over(&self) -> bool {
            false
        }
    }

    const OPEN: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

    fn rosenbrock(p: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let r = vec![10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]];
        Some((r, vec![-20.0 * p[0], 10.0, -1.0, 0.0]))
    }

    fn found(
        f: impl FnMut(&[f64]) -> Option<(Vec<f64>, Vec<f64>)>,
        start: &[f64],
        bounds: &[[f64; 2]],
    ) -> Fitted {
        solve(&mut Problem(f), start, bounds, Loss::Squared).expect("it is known at the start")
    }

    #[test]
    fn the_valley_of_rosenbrock_is_followed() {
        let found = found(rosenbrock, &[-1.2, 1.0], &[OPEN; 2]);
        assert_eq!(found.status, Status::Solved);
        assert!((found.point[0] - 1.0).abs() < 1e-7 && (found.point[1] - 1.0).abs() < 1e-7);
    }

    /// From (3/4, 3/4) the best of all steps leaves the bound of b, which then is not the first that holds.
    #[test]
    fn what_a_bound_holds_is_let_go() {
        let line = |p: &[f64]| {
            let data = [(1.0, 1.0), (1.5, 2.5), (2.0, 4.0)];
            let r = data.iter().map(|(t, q)| p[0] + p[1] * t - q);
            Some((r.collect(), vec![1.0, 1.0, 1.0, 1.5, 1.0, 2.0]))
        };
        let found = found(line, &[0.75, 0.75], &[[0.0, 1.0]; 2]);
        assert_eq!(found.status, Status::Solved);
        let near = found.point.iter().all(|p| (p - 1.0).abs() < 1e-9);
        assert!(near, "{:?}", found.point);
        assert!((found.cost - 2.0).abs() < 1e-14);
    }

    /// Linear least squares within random bounds: the gradient is zero, or holds p at a bound.
    #[test]
    fn the_conditions_of_a_minimum_hold_within_bounds() {
        let mut seed = 1_u64;
        let mut draw = |low: f64, high: f64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            low + (high - low) * ((seed >> 11) as f64 / (1_u64 << 53) as f64)
        };
        for case in 0..500 {
            let (m, n) = (6, 1 + case % 4);
            let rows: Vec<f64> = (0..m * n).map(|_| draw(-1.0, 1.0)).collect();
            let data: Vec<f64> = (0..m).map(|_| draw(-3.0, 3.0)).collect();
            let bounds: Vec<[f64; 2]> = (0..n).map(|_| [draw(-1.0, 0.0), draw(0.0, 1.0)]).collect();
            let start: Vec<f64> = bounds.iter().map(|b| draw(b[0], b[1])).collect();
            let jacobian = DMatrix::from_row_slice(m, n, &rows);
            let residuals = |p: &[f64]| {
                &jacobian * DVector::from_column_slice(p) - DVector::from_column_slice(&data)
            };
            let problem = |p: &[f64]| Some((residuals(p).as_slice().to_vec(), rows.clone()));
            let found = found(problem, &start, &bounds);
            assert_eq!(found.status, Status::Solved, "{case}");
            let gradient = jacobian.tr_mul(&residuals(&found.point));
            for ((p, slope), [low, high]) in found.point.iter().zip(&gradient).zip(bounds) {
                let holds = p <= &low && *slope > 0.0 || p >= &high && *slope < 0.0;
                assert!(holds || slope.abs() < 1e-6, "{case}: {slope:e} at {p}");
            }
        }
    }

    #[test]
    fn a_bound_is_kept_and_the_rest_is_at_its_best_there() {
        // For p <= 1/2, q = p² = 1/4.
        let found = found(rosenbrock, &[-1.2, 1.0], &[[-2.0, 0.5], OPEN]);
        assert_eq!(found.status, Status::Solved);
        assert_eq!(found.point[0], 0.5);
        assert!((found.point[1] - 0.25).abs() < 1e-7);
    }

    #[test]
    fn where_residuals_are_not_known_a_step_is_shorter() {
        // r = log p - 2, which a full step from 10 would leave.
        let f = |p: &[f64]| (p[0] > 0.0).then(|| (vec![p[0].ln() - 2.0], vec![1.0 / p[0]]));
        let found = found(f, &[1e3], &[OPEN]);
        assert!(found.failures > 0 && found.status == Status::Solved);
        assert!((found.point[0] - 2.0_f64.exp()).abs() < 1e-6);
    }

    #[test]
    fn outliers_pull_by_hubers_bound_alone() {
        // Σ ψ(p - y) = 0 for y = 0, 0.1, 0.2 and 100, with d = 1: 3 p - 0.3 - 1 = 0.
        let data = [0.0, 0.1, 0.2, 100.0];
        let f = |p: &[f64]| Some((data.iter().map(|y| p[0] - y).collect(), vec![1.0; 4]));
        let found = solve(&mut Problem(f), &[50.0], &[OPEN], Loss::Huber(1.0)).unwrap();
        assert_eq!(found.status, Status::Solved);
        assert!(
            (found.point[0] - 1.3 / 3.0).abs() < 1e-6,
            "{}",
            found.point[0]
        );
    }

    #[test]
    fn a_wrong_derivative_is_no_solution() {
        let f = |p: &[f64]| Some((vec![p[0] - 1.0, 2.0], vec![-1.0, 0.0]));
        let found = found(f, &[0.0], &[OPEN]);
        assert_eq!(found.status, Status::Stalled);
    }

    #[test]
    fn an_outlier_beyond_rounding_hides_no_step() {
        // As above, with an outlier whose cost rounds by more than the others have.
        let data = [0.0, 0.1, 0.2, 1e14];
        let f = |p: &[f64]| Some((data.iter().map(|y| p[0] - y).collect(), vec![1.0; 4]));
        let found = solve(&mut Problem(f), &[50.0], &[OPEN], Loss::Huber(1.0)).unwrap();
        assert_eq!(found.status, Status::Solved);
        assert!(
            (found.point[0] - 1.3 / 3.0).abs() < 1e-3,
            "{}",
            found.point[0]
        );
    }

    #[test]
    fn the_offset_bounds_the_distance_in_standard_errors() {
        // p + q t and p + 1.001 q t, of 40 points: columns are nearly parallel, and each alone nearly orthogonal to r.
        let at = |p: &[f64]| {
            let times = (0..40).map(|k| 1.0 + 1e-3 * f64::from(k));
            let rows: Vec<[f64; 3]> = times
                .enumerate()
                .map(|(k, t)| [p[0] + p[1] * t - [0.0, 1e-3][k % 2], 1.0, t])
                .collect();
            let r = rows.iter().map(|row| row[0]).collect();
            Some((r, rows.iter().flat_map(|row| [row[1], row[2]]).collect()))
        };
        let mut problem = Problem(at);
        let (point, bounds) = (DVector::from_vec(vec![0.2, -0.2]), [OPEN; 2]);
        let known = Residuals::at(&mut problem, point.as_slice()).unwrap();
        let there = super::Search::at(point, known, &bounds, Loss::Squared).unwrap();
        // (JᵀJ)⁻¹ in closed form.
        let sums = (0..40).map(|k| 1.0 + 1e-3 * f64::from(k));
        let (n, t, tt) = sums.fold((0.0, 0.0, 0.0), |(n, a, b), t| (n + 1.0, a + t, b + t * t));
        let scale = (there.cost / 38.0 / (n * tt - t * t)).sqrt();
        let minimum = found(at, &[0.2, -0.2], &bounds);
        let off = (minimum.point[0] - 0.2).abs() / (scale * tt.sqrt());
        assert!(
            off > 0.5 && off <= there.offset * 1.0001,
            "{off}, {}",
            there.offset
        );
    }

    #[test]
    fn where_nothing_changes_to_first_order_there_is_no_solution() {
        // A maximum of (p² - 4)², alone and beside a number that is found.
        let alone = |p: &[f64]| Some((vec![p[0] * p[0] - 4.0], vec![2.0 * p[0]]));
        assert_eq!(found(alone, &[0.0], &[OPEN]).status, Status::Flat(None));
        let beside = |p: &[f64]| {
            let r = vec![p[0] * p[0] - 4.0, p[1] - 1.0, p[1] - 1.5];
            Some((r, vec![2.0 * p[0], 0.0, 0.0, 1.0, 0.0, 1.0]))
        };
        let moved = found(beside, &[0.0, 0.0], &[OPEN; 2]);
        assert_eq!(moved.status, Status::Flat(Some(0)));
        assert!((moved.point[1] - 1.25).abs() < 1e-9);
        // What r does not depend on at all keeps nothing from being found.
        let unused = |p: &[f64]| Some((vec![p[1] - 1.0, p[1] - 1.5], vec![0.0, 1.0, 0.0, 1.0]));
        assert_eq!(
            found(unused, &[0.0, 0.0], &[OPEN; 2]).status,
            Status::Solved
        );
    }

    #[test]
    fn squares_that_are_no_numbers_are_not_known() {
        for size in [1e170, 1e-170] {
            let f = |p: &[f64]| Some((vec![size * (p[0] - 1.0)], vec![size]));
            assert!(solve(&mut Problem(f), &[0.0], &[OPEN], Loss::Squared).is_none());
        }
        let zero = |_: &[f64]| Some((vec![0.0], vec![1.0]));
        let zero = found(zero, &[0.0], &[OPEN]);
        assert_eq!((zero.status, zero.offset), (Status::Solved, 0.0));
    }
}
