//! Other minima, far away, by simulations.
//!
//! Points all over the ranges of the free quantities are simulated, and where equations constrain, those that keep them
//! (`onto.rs`). Where switches act, the best of those inside the ranges are followed downhill by a pattern search (Kolda,
//! Lewis, Torczon 2003): x⁺ = x ± s d where J is smaller there, and half of s where no d of a basis leads to a smaller one. It
//! asks for no slopes: where a switch meets the end of an interval J has a kink, and steps along gradients come to rest beside it. Where an impact meets
//! the end of the horizon J jumps, and the axes lead across its edge and not along it: where they fail, the columns of
//! H = I - 2 v vᵀ are polled, with another v each time (Abramson, Audet, Dennis, Le Digabel 2009, *OrthoMADS*, section 3).
//! Ends of descents that are almost as good as the solution, and not near it, are worth a program of their own.

use super::descent::{Candidate, Found, Search};
use super::onto::Reach;
use super::reduced::{Kind, Quantity};

/// Shares of ranges at which all controls are tried.
const LEVELS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// How many points are taken inside the ranges with controls in so many pieces, and how many of them are followed.
const SPREAD: u32 = 32;
const PIECES: [usize; 2] = [2, 4];
const FOLLOWED: usize = 16;
/// The first and the last s, in sizes of the quantities, and how often the directions of a basis are followed by one s.
const FIRST: f64 = 0.25;
const LAST: f64 = 0.002;
const MOST_SWEEPS: u32 = 20;
/// How many simulations all descents together may take, and so many times fewer at least where constraints are kept, too:
/// they tell less of what a program would lead to.
const MOST_RUNS: usize = 6000;
const FEWER: usize = 4;
/// From this s on one has to gain such a share of what is missing.
const FREE: f64 = 0.07;
const LEAST_GAIN: f64 = 0.1;

/// Ends of descents are looked into that are worse than the solution by less than this share of its objective, and farther
/// away than so many sizes of a quantity.
const PROMISING: f64 = 0.03;
const APART: f64 = 0.1;
/// How many ends of descents are looked into.
const MOST_ENDS: usize = 3;

impl Search<'_, '_, '_> {
    /// Points that are far away and better, or promising, the best first.
    pub fn elsewhere(&mut self) -> Found {
        let target = self.objective - self.threshold(1.0);
        let at_bounds = self.at_bounds();
        let mut reach = Reach::new(self, at_bounds.len() + self.most_runs());
        reach.learn(self, self.w);
        let edge = self.reached(at_bounds, &mut reach).into_iter().next();
        let edge = edge.filter(|best| best.merit < target);
        let mut points: Vec<Candidate> = edge.into_iter().collect();
        if self.reduced.is_switched() {
            // Coarser ones where those with all intervals free lead to nothing better.
            for (number, inside) in self.inside().into_iter().enumerate() {
                let share = if number == 0 { 1 } else { 2 };
                points = self.compass(points, (inside, share), target);
                if points.first().is_some_and(|best| best.merit < target) {
                    break;
                }
            }
        }
        Found::better(points, self.objective)
    }

    fn simulated(&mut self, w: Vec<f64>) -> Option<Candidate> {
        let values = self.reduced.at(&w)?;
        Some(self.candidate(w, &values))
    }

    /// Other points than the solution, if they can be simulated, the best first.
    pub(super) fn candidates(&mut self, points: Vec<Vec<f64>>) -> Vec<Candidate> {
        let solution = self.w;
        let points = points.into_iter().filter(|w| *w != solution);
        let mut points: Vec<Candidate> = points.filter_map(|w| self.simulated(w)).collect();
        points.sort_by(|a, b| a.merit.total_cmp(&b.merit));
        points
    }

    /// Points beside the solution that are reached from others, the best first.
    fn reached(&mut self, points: Vec<Vec<f64>>, reach: &mut Reach) -> Vec<Candidate> {
        let solution = self.w;
        let points = points.into_iter().filter(|w| *w != solution);
        let mut points: Vec<Candidate> = points.filter_map(|w| reach.far(self, &w)).collect();
        points.sort_by(|a, b| a.merit.total_cmp(&b.merit));
        points
    }

    /// The quantities that have ranges.
    fn bounded(&self) -> impl Iterator<Item = &Quantity> {
        let all = self.reduced.quantities.iter();
        all.filter(|quantity| (quantity.upper - quantity.lower).is_finite())
    }

    /// The solution with these quantities at shares of their ranges.
    fn moved(&self, quantities: &[Quantity], share: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut w = self.w.to_vec();
        for (i, quantity) in quantities.iter().enumerate() {
            let range = quantity.upper - quantity.lower;
            w[quantity.index] = quantity.lower + share(i) * range;
        }
        self.reduced.problem.balance(&mut w);
        w
    }

    /// The solution with every quantity alone at its bounds, but for lengths, which add up, and with all controls at equal
    /// shares of their ranges.
    fn at_bounds(&self) -> Vec<Vec<f64>> {
        let bounded: Vec<Quantity> = self.bounded().copied().collect();
        let mut points = Vec::new();
        for &quantity in &bounded {
            let levels = match quantity.kind {
                Kind::Control(_) => &[0.0, 1.0][..],
                Kind::Length => &[],
                _ => &LEVELS[..],
            };
            let level = |level: &f64| self.moved(&[quantity], |_| *level);
            points.extend(levels.iter().map(level));
        }
        let is_control = |quantity: &Quantity| matches!(quantity.kind, Kind::Control(_));
        let controls: Vec<Quantity> = bounded.into_iter().filter(is_control).collect();
        points.extend(LEVELS.map(|level| self.moved(&controls, |_| level)));
        points
    }

    /// All quantities at points of a Kronecker sequence, then, where controls have more intervals than pieces, the same with one
    /// value of each control in all intervals of a piece: what values in many intervals do cancels.
    fn inside(&self) -> Vec<Vec<Vec<f64>>> {
        let bounded: Vec<Quantity> = self.bounded().copied().collect();
        let all = (0..bounded.len()).collect();
        let coarse = PIECES.into_iter().filter_map(|n| in_pieces(&bounded, n));
        let points = |piece_of: Vec<usize>| {
            let n = piece_of.iter().max().map_or(0, |last| last + 1);
            let point = |k| {
                let shares = kronecker(k, n);
                self.moved(&bounded, |i| shares[piece_of[i]])
            };
            (1..=SPREAD).map(point).collect()
        };
        [all].into_iter().chain(coarse).map(points).collect()
    }

    /// The best ends of descents from these points and from those inside the ranges, of which a share is followed: below
    /// `target` or promising.
    fn compass(
        &mut self,
        from: Vec<Candidate>,
        (inside, share): (Vec<Vec<f64>>, usize),
        mut target: f64,
    ) -> Vec<Candidate> {
        let mut reach = Reach::new(self, inside.len() + self.most_runs() / share);
        reach.learn(self, self.w);
        let inside = self.reached(inside, &mut reach).into_iter();
        let mut ends = Vec::new();
        for point in from.into_iter().chain(inside.take(FOLLOWED / share)) {
            let end = self.downhill(point, target, &mut reach);
            if end.merit < target || self.is_promising(&end) {
                target = target.min(end.merit);
                ends.push(end);
            }
        }
        ends.sort_by(|a, b| a.merit.total_cmp(&b.merit));
        let mut points: Vec<Candidate> = Vec::new();
        for end in ends {
            if points.iter().all(|point| self.are_apart(&point.w, &end.w)) {
                points.push(end);
            }
        }
        points.truncate(MOST_ENDS);
        points
    }

    /// How many simulations descents take at most.
    fn most_runs(&self) -> usize {
        let steps = self.base.map_or(1, |base| base.steps);
        match self.reduced.is_constrained() {
            true => (self.reduced.most_runs(steps) / FEWER).min(MOST_RUNS),
            false => MOST_RUNS,
        }
    }

    /// Whether the solution of a program may be better in the branch of a point.
    fn is_promising(&self, point: &Candidate) -> bool {
        point.merit < self.objective + PROMISING * self.objective.abs()
            && self.are_apart(self.w, &point.w)
    }

    fn are_apart(&self, a: &[f64], b: &[f64]) -> bool {
        let is_changed = |quantity: &Quantity| {
            let change = a[quantity.index] - b[quantity.index];
            change.abs() > APART * quantity.size
        };
        self.reduced.quantities.iter().any(is_changed)
    }

    /// The end of a descent, which is left where it does not come towards `target`.
    fn downhill(&mut self, mut point: Candidate, target: f64, reach: &mut Reach) -> Candidate {
        reach.learn(self, &point.w);
        let axes = axes(self.bounded().count());
        let mut step = FIRST;
        while step >= LAST {
            let before = point.merit;
            for sweep in 1..=MOST_SWEEPS {
                let is_better = self.poll(&mut point, &axes, step, reach)
                    || axes.len() > 1
                        && self.poll(&mut point, &reflected(sweep, &axes), step, reach);
                if !is_better {
                    break;
                }
            }
            if step < FREE && before - point.merit < LEAST_GAIN * (point.merit - target) {
                break;
            }
            step *= 0.5;
        }
        point
    }

    /// Moves along every direction of a basis by a step where the merit is smaller behind it; whether there was one.
    fn poll(
        &mut self,
        point: &mut Candidate,
        basis: &[Vec<f64>],
        step: f64,
        reach: &mut Reach,
    ) -> bool {
        let before = point.merit;
        for direction in basis {
            let better = [step, -step].into_iter().find_map(|step| {
                let w = self.along(&point.w, direction, step);
                if w == point.w {
                    return None;
                }
                let next = reach.point(self, w);
                next.filter(|next| next.merit < point.merit)
            });
            if let Some(better) = better {
                *point = better;
            }
        }
        point.merit < before
    }

    /// w + s d, with s in sizes of the quantities, inside their ranges.
    fn along(&self, w: &[f64], direction: &[f64], step: f64) -> Vec<f64> {
        let mut next = w.to_vec();
        for (quantity, d) in self.bounded().zip(direction) {
            let value = w[quantity.index] + step * d * quantity.size;
            next[quantity.index] = value.max(quantity.lower).min(quantity.upper);
        }
        self.reduced.problem.balance(&mut next);
        next
    }
}

/// The number of the piece that each quantity is in, where the intervals of controls are taken together to `n` pieces; none
/// where no control has more intervals.
fn in_pieces(quantities: &[Quantity], n: usize) -> Option<Vec<usize>> {
    let alike = quantities.chunk_by(|a, b| a.kind == b.kind && matches!(a.kind, Kind::Control(_)));
    let (mut pieces, mut is_coarse, mut first) = (Vec::new(), false, 0);
    for alike in alike {
        let count = alike.len().min(n);
        pieces.extend((0..alike.len()).map(|i| first + i * count / alike.len()));
        is_coarse |= count < alike.len();
        first += count;
    }
    is_coarse.then_some(pieces)
}

/// Point k of a Kronecker sequence in [0, 1]ⁿ: multiples of g⁻¹, g⁻², .. without their integers, with gⁿ⁺¹ = g + 1.
fn kronecker(k: u32, n: usize) -> Vec<f64> {
    let g = (0..50).fold(2.0_f64, |g, _| (1.0 + g).powf(1.0 / (n as f64 + 1.0)));
    let share = |i: usize| (0.5 + f64::from(k) * g.powi(-1 - i as i32)).fract();
    (0..n).map(share).collect()
}

/// e₁, .., eₙ.
fn axes(n: usize) -> Vec<Vec<f64>> {
    let axis = |i| (0..n).map(|j| f64::from(u8::from(i == j))).collect();
    (0..n).map(axis).collect()
}

/// The columns of H = I - 2 v vᵀ, v the direction of point k of a Kronecker sequence in [-1, 1]ⁿ.
fn reflected(k: u32, axes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let v: Vec<f64> = (kronecker(k, axes.len()).iter())
        .map(|share| 2.0 * share - 1.0)
        .collect();
    let square: f64 = v.iter().map(|v| v * v).sum();
    let reflect = |axis: &Vec<f64>| {
        let along: f64 = axis.iter().zip(&v).map(|(e, v)| e * v).sum();
        let reflect = |(e, v): (&f64, &f64)| e - 2.0 * along / square * v;
        axis.iter().zip(&v).map(reflect).collect()
    };
    axes.iter().map(reflect).collect()
}
