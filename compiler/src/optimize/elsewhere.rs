//! Other minima, far away, by simulations.
//!
//! Points all over the ranges of the free quantities are simulated. Where switches act and nothing but ranges constrains,
//! the best of them are followed downhill, x⁺ = P(x - s H ∇J) with the H of Broyden, Fletcher, Goldfarb and Shanno: not to
//! a minimum, but until one of them is below the solution.

use super::descent::{Found, SMALL, Search};
use super::reduced::Quantity;

/// Shares of ranges at which all controls are tried.
const LEVELS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// How many points are taken inside the ranges.
const SPREAD: u32 = 16;
/// How many points are followed, and how far.
const FOLLOWED: usize = 8;
const MOST_STEPS: usize = 25;
/// The first step, in halves of a range.
const FIRST: f64 = 0.25;
/// A step that is not downhill is shortened to this share, so often at most.
const SHORTER: f64 = 0.25;
const MOST_SHORTER: usize = 4;
/// Behind the first ones a step has to gain this share of what is missing.
const FREE: usize = 4;
const LEAST_GAIN: f64 = 0.02;

/// A point and its merit.
struct Candidate {
    merit: f64,
    w: Vec<f64>,
}

impl Search<'_, '_, '_, '_> {
    /// A point that is far away and better.
    pub fn elsewhere(&self) -> Found {
        let target = self.objective - self.threshold(1.0);
        let mut points: Vec<Candidate> = self
            .all_over()
            .into_iter()
            .filter_map(|w| self.candidate(w))
            .collect();
        points.sort_by(|a, b| a.merit.total_cmp(&b.merit));
        let found = |point: Candidate| Found::Descent {
            rate: self.objective - point.merit,
            merit: point.merit,
            w: point.w,
            is_first_order: false,
        };
        if points.first().is_some_and(|best| best.merit < target) {
            return found(points.swap_remove(0));
        }
        if !self.has_branches() {
            return Found::Nothing;
        }
        let others = points.into_iter().filter(|point| point.w != self.w);
        let mut followed = others.take(FOLLOWED);
        let below = followed.find_map(|point| self.downhill(point, target));
        below.map_or(Found::Nothing, found)
    }

    /// Whether switches act, and nothing but ranges constrains.
    fn has_branches(&self) -> bool {
        self.reduced.is_switched() && self.reduced.bounds().next().is_none()
    }

    fn candidate(&self, w: Vec<f64>) -> Option<Candidate> {
        let merit = self.merit(&self.reduced.at(&w)?);
        Some(Candidate { merit, w })
    }

    /// The quantities that have ranges.
    fn bounded(&self) -> impl Iterator<Item = &Quantity> {
        let all = self.reduced.quantities.iter();
        all.filter(|quantity| (quantity.upper - quantity.lower).is_finite())
    }

    /// The solution with every quantity alone at its bounds, with all controls at equal shares of their ranges, and with
    /// all quantities at the points of a Kronecker sequence: multiples of g⁻¹, g⁻², .. without their integers, with
    /// gⁿ⁺¹ = g + 1.
    fn all_over(&self) -> Vec<Vec<f64>> {
        let moved = |quantities: &[&Quantity], shares: &dyn Fn(usize) -> f64| {
            let mut w = self.w.to_vec();
            for (i, quantity) in quantities.iter().enumerate() {
                let range = quantity.upper - quantity.lower;
                w[quantity.index] = quantity.lower + shares(i) * range;
            }
            w
        };
        let bounded: Vec<&Quantity> = self.bounded().collect();
        let controls = bounded
            .iter()
            .copied()
            .filter(|quantity| quantity.is_control);
        let controls: Vec<&Quantity> = controls.collect();
        let mut points = Vec::new();
        for quantity in &bounded {
            let levels = if quantity.is_control {
                &[0.0, 1.0]
            } else {
                &LEVELS[..]
            };
            points.extend(levels.iter().map(|level| moved(&[*quantity], &|_| *level)));
        }
        points.extend(LEVELS.iter().map(|level| moved(&controls, &|_| *level)));
        if self.has_branches() {
            let n = bounded.len();
            let g = (0..50).fold(2.0_f64, |g, _| (1.0 + g).powf(1.0 / (n as f64 + 1.0)));
            let share = |k: u32, i: usize| (0.5 + f64::from(k) * g.powi(-1 - i as i32)).fract();
            points.extend((1..=SPREAD).map(|k| moved(&bounded, &|i| share(k, i))));
        }
        points
    }

    /// ∇J per size of the quantities, by differences into their ranges.
    fn gradient(&self, point: &Candidate) -> Option<Vec<f64>> {
        let slope = |quantity: &Quantity| {
            let value = point.w[quantity.index];
            let room = quantity.upper - value;
            let change = if room > SMALL * quantity.size {
                SMALL
            } else {
                -SMALL
            };
            let mut w = point.w.clone();
            w[quantity.index] = value + change * quantity.size;
            Some((self.candidate(w)?.merit - point.merit) / change)
        };
        self.bounded().map(slope).collect()
    }

    /// A point below `target` that is downhill, if steps lead there.
    fn downhill(&self, mut point: Candidate, target: f64) -> Option<Candidate> {
        let mut slopes = self.gradient(&point)?;
        let mut hessian = InverseHessian::first(&slopes)?;
        for taken in 1..=MOST_STEPS {
            let next = match self.step(&point, &hessian.times(&self.free(&point, &slopes))) {
                Some(next) => next,
                // Behind a kink another Hessian is to be learned.
                None if !hessian.is_new => {
                    hessian = InverseHessian::first(&slopes)?;
                    continue;
                }
                None => return None,
            };
            if next.merit < target {
                return Some(next);
            }
            if taken > FREE && point.merit - next.merit < LEAST_GAIN * (point.merit - target) {
                return None;
            }
            let behind = self.gradient(&next)?;
            let change = self
                .bounded()
                .map(|quantity| (next.w[quantity.index] - point.w[quantity.index]) / quantity.size);
            let bend = behind.iter().zip(&slopes).map(|(to, from)| to - from);
            hessian.learn(&change.collect::<Vec<f64>>(), &bend.collect::<Vec<f64>>());
            (point, slopes) = (next, behind);
        }
        None
    }

    /// The slopes without those that lead out of the ranges.
    fn free(&self, point: &Candidate, slopes: &[f64]) -> Vec<f64> {
        let free = |(quantity, &slope): (&Quantity, &f64)| {
            let value = point.w[quantity.index];
            let leads_out = if slope > 0.0 {
                value <= quantity.lower
            } else {
                value >= quantity.upper
            };
            if leads_out { 0.0 } else { slope }
        };
        self.bounded().zip(slopes).map(free).collect()
    }

    /// The end of a step against `against`, or of a shorter one, where the merit is smaller.
    fn step(&self, point: &Candidate, against: &[f64]) -> Option<Candidate> {
        let at = |share: f64| {
            let mut w = point.w.clone();
            for (quantity, change) in self.bounded().zip(against) {
                let value = w[quantity.index] - share * change * quantity.size;
                w[quantity.index] = value.max(quantity.lower).min(quantity.upper);
            }
            self.candidate(w)
        };
        let shares = (0..MOST_SHORTER).map(|k| SHORTER.powi(k as i32));
        let mut ends = shares.filter_map(at);
        ends.find(|end| end.merit < point.merit)
    }
}

/// An inverse Hessian that is learned from changes of the gradient: H⁺ = (I - ρ s yᵀ) H (I - ρ y sᵀ) + ρ s sᵀ, ρ = 1/sᵀy.
struct InverseHessian {
    rows: Vec<Vec<f64>>,
    is_new: bool,
}

impl InverseHessian {
    fn new(n: usize, scale: f64) -> Self {
        let row = |i: usize| (0..n).map(|j| if i == j { scale } else { 0.0 }).collect();
        InverseHessian {
            rows: (0..n).map(row).collect(),
            is_new: true,
        }
    }

    /// One with which the largest slope gives the first step; none where all slopes are zero.
    fn first(slopes: &[f64]) -> Option<Self> {
        let steepest = slopes.iter().fold(0.0, |m: f64, slope| m.max(slope.abs()));
        (steepest > 0.0).then(|| InverseHessian::new(slopes.len(), FIRST / steepest))
    }

    fn times(&self, v: &[f64]) -> Vec<f64> {
        self.rows.iter().map(|row| dot(row, v)).collect()
    }

    fn learn(&mut self, s: &[f64], y: &[f64]) {
        let bend = dot(s, y);
        if bend <= 0.0 {
            return;
        }
        if std::mem::take(&mut self.is_new) {
            *self = InverseHessian {
                is_new: false,
                ..InverseHessian::new(s.len(), bend / dot(y, y))
            };
        }
        let h = self.times(y);
        let own = (1.0 + dot(y, &h) / bend) / bend;
        for (i, row) in self.rows.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                *entry += own * s[i] * s[j] - (h[i] * s[j] + s[i] * h[j]) / bend;
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
