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
//! for those p that are not held at a bound by the gradient, D_j being the largest length of column j so far (Moré 1978). What
//! would go beyond a bound goes as far as that, and the others are solved for with it. λ follows the ratio of what is gained
//! and what the linear model gains (Nielsen 1999). A point where r is not known is a step that is rejected.

use nalgebra::{DMatrix, DVector};

/// r and J at a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearized {
    /// r.
    pub residuals: DVector<f64>,
    /// J = dr/dp.
    pub jacobian: DMatrix<f64>,
}

/// Residuals as functions of p.
pub trait Residuals {
    /// r and J at a point; none where they are not known.
    fn at(&mut self, p: &[f64]) -> Option<Linearized>;

    /// Told that the last point is where the search is now.
    fn taken(&mut self) {}

    /// The length below which a change of r is rounding.
    fn noise(&self) -> f64;

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
    /// At a point where the projected gradient vanishes: see [`Fitted::gradient`].
    Solved,
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
    /// The largest cosine of the angle between residuals and what a parameter changes, of those that no bound holds.
    pub gradient: f64,
    /// Steps that were taken.
    pub iterations: usize,
    /// Steps that were rejected, as r was not known at their ends.
    pub failures: usize,
    /// How it ended.
    pub status: Status,
}

/// Steps, rejected ones among them.
const MOST: usize = 200;
/// The search goes on until the cosine is below this, or no step gains anything ..
const TARGET: f64 = 1e-9;
/// .. and is solved where it then is below this: p is off by this times the root of the number of residuals, in units of its
/// own standard error.
const SMALL: f64 = 1e-4;
/// λ in the beginning (Nielsen 1999), and where a step is as good as none.
const FIRST: f64 = 1e-3;
const LARGEST: f64 = 1e14;
/// A step gains at least this part of what its model gains.
const LEAST_RATIO: f64 = 1e-4;

/// Looks for a minimum from a point, which is moved into the bounds; none where r is not known there.
pub fn solve(
    problem: &mut dyn Residuals,
    start: &[f64],
    bounds: &[[f64; 2]],
    loss: Loss,
) -> Option<Fitted> {
    let point = DVector::from_iterator(start.len(), start.iter().copied());
    let point = projected(&point, bounds);
    let at = problem.at(point.as_slice())?;
    problem.taken();
    let noise = problem.noise();
    let mut search = Search::new(point, at, bounds, loss);
    let (mut lambda, mut growth) = (FIRST, 2.0);
    let (mut iterations, mut failures) = (0, 0);
    let mut status = Status::IterationLimit;
    for _ in 0..MOST {
        if search.gradient(noise) <= TARGET {
            status = Status::Solved;
            break;
        }
        if problem.is_over() {
            status = Status::Over;
            break;
        }
        let step = search.step(lambda);
        let gain = search.gain(&step);
        if lambda > LARGEST || gain.abs() <= (noise * noise).max(f64::EPSILON * search.cost) {
            status = Status::Stalled;
            break;
        }
        let trial = projected(&(&search.point + step), bounds);
        let found = problem.at(trial.as_slice());
        failures += usize::from(found.is_none());
        let cost = |at: &Linearized| at.residuals.iter().map(|&r| loss.of(r)).sum::<f64>();
        let ratio = |at: &Linearized| (search.cost - cost(at)) / gain;
        match found.filter(|at| gain > 0.0 && ratio(at) > LEAST_RATIO) {
            Some(at) => {
                lambda *= (1.0 - (2.0 * ratio(&at) - 1.0).powi(3)).max(1.0 / 3.0);
                growth = 2.0;
                iterations += 1;
                problem.taken();
                search.moves(trial, at);
            }
            None => {
                lambda *= growth;
                growth *= 2.0;
            }
        }
    }
    let gradient = search.gradient(0.0);
    if status != Status::Over && search.gradient(noise) <= SMALL {
        status = Status::Solved;
    }
    Some(Fitted {
        point: search.point.as_slice().to_vec(),
        at: search.at,
        cost: search.cost,
        gradient,
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
}

impl<'b> Search<'b> {
    fn new(point: DVector<f64>, at: Linearized, bounds: &'b [[f64; 2]], loss: Loss) -> Self {
        let n = point.len();
        let mut search = Search {
            residuals: at.residuals.clone(),
            jacobian: at.jacobian.clone(),
            slope: DVector::zeros(n),
            scale: DVector::zeros(n),
            cost: 0.0,
            point: point.clone(),
            at: at.clone(),
            bounds,
            loss,
        };
        search.moves(point, at);
        search
    }

    fn moves(&mut self, point: DVector<f64>, at: Linearized) {
        let loss = self.loss;
        let weights = at.residuals.map(|r| loss.weight(r).sqrt());
        self.cost = at.residuals.iter().map(|&r| loss.of(r)).sum();
        self.residuals = at.residuals.component_mul(&weights);
        self.jacobian = at.jacobian.clone();
        for mut column in self.jacobian.column_iter_mut() {
            column.component_mul_assign(&weights);
        }
        self.slope = self.jacobian.tr_mul(&self.residuals);
        for (scale, column) in self.scale.iter_mut().zip(self.jacobian.column_iter()) {
            *scale = scale.max(column.norm());
        }
        (self.point, self.at) = (point, at);
    }

    /// Whether the gradient holds p_j at a bound.
    fn is_held(&self, j: usize) -> bool {
        let ([low, high], slope) = (self.bounds[j], self.slope[j]);
        let p = self.point[j];
        low == high || p <= low && slope > 0.0 || p >= high && slope < 0.0
    }

    /// See [`Fitted::gradient`]; less what is rounding.
    fn gradient(&self, noise: f64) -> f64 {
        let length = self.residuals.norm();
        let cosine = |j: usize| {
            let column = self.jacobian.column(j).norm();
            let along = (self.slope[j].abs() / column - noise).max(0.0);
            if along > 0.0 { along / length } else { 0.0 }
        };
        let open = (0..self.point.len()).filter(|&j| !self.is_held(j));
        open.map(cosine).fold(0.0, f64::max)
    }

    /// The step for λ: what it takes beyond a bound goes as far as that, and the others are the best with it.
    fn step(&self, lambda: f64) -> DVector<f64> {
        let n = self.point.len();
        let mut step = DVector::zeros(n);
        let mut open: Vec<usize> = (0..n).filter(|&j| !self.is_held(j)).collect();
        loop {
            let solved = self.solved(lambda, &open, &step);
            let rest = |j: usize| self.bounds[j].map(|bound| bound - self.point[j]);
            let is_within = |&k: &usize| {
                let [low, high] = rest(open[k]);
                (low..=high).contains(&solved[k])
            };
            let (within, beyond): (Vec<usize>, Vec<usize>) = (0..open.len()).partition(is_within);
            for &k in &beyond {
                let [low, high] = rest(open[k]);
                step[open[k]] = solved[k].max(low).min(high);
            }
            if beyond.is_empty() {
                for (&j, &s) in open.iter().zip(solved.iter()) {
                    step[j] = s;
                }
                return step;
            }
            open = within.into_iter().map(|k| open[k]).collect();
        }
    }

    /// The step of some parameters where the others have theirs.
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
            })
        }

        fn noise(&self) -> f64 {
            0.0
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
}
