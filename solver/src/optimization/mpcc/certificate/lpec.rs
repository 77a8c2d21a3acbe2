//! B-stationarity: the linear program with complementarity constraints of a point.
//!
//! minimize ∇fᵀd   subject to   cl <= c + J d <= cu,   l <= w + d <= u,   0 <= a + d_a ⟂ b + d_b >= 0,   |d|_∞ <= Δ
//!
//! Pairs with a side farther than Δ from zero keep the other one at zero. A point is B-stationary when d = 0 is a
//! solution (Scheel and Scholtes 2000; Leyffer and Munson 2007). Branch and bound: a node leaves out the
//! complementarity of the pairs that it has not decided; without any it is the bound that S-stationarity is about.

use crate::optimization::mpcc::certificate::Tolerances;
use crate::optimization::mpcc::lift::Lifted;
use crate::optimization::mpcc::linear::{LinearProgram, Outcome, solve};
use crate::optimization::mpcc::local::Local;
use crate::optimization::problem::Nlp;

/// What the program says about a point.
#[derive(Clone, Debug)]
pub enum Descent {
    /// No direction of descent within the trust region: the point is B-stationary.
    None,
    /// A direction d of descent that keeps the pairs.
    Found(Vec<f64>),
    /// The limit of nodes was met first, or a program could not be solved.
    Undecided,
}

/// Looks for descent within the radius Δ.
pub fn descend(lifted: &Lifted<'_>, local: &Local, tolerances: &Tolerances) -> Descent {
    let search = Branching::new(lifted, local, tolerances);
    let needed = tolerances.stationarity;
    let mut stack = vec![(search.program.lower.clone(), search.program.upper.clone())];
    let mut is_undecided = false;
    for _ in 0..tolerances.node_limit {
        let Some((lower, upper)) = stack.pop() else {
            return match is_undecided {
                true => Descent::Undecided,
                false => Descent::None,
            };
        };
        let limit = &tolerances.limit;
        if limit.is_over() {
            return Descent::Undecided;
        }
        let d = match solve(&search.program, &lower, &upper, limit) {
            Outcome::Optimal(d) => d,
            Outcome::Infeasible => continue,
            Outcome::Failed => {
                is_undecided = true;
                continue;
            }
        };
        if search.decrease(&d) <= needed {
            continue;
        }
        let Some(pair) = search.violated(&d, &upper) else {
            return search.found(d);
        };
        // The smaller sides at zero: if that descends, it is enough.
        let mut rounded = upper.clone();
        search.round(&d, &mut rounded);
        if let Outcome::Optimal(d) = solve(&search.program, &lower, &rounded, limit)
            && search.decrease(&d) > needed
        {
            return search.found(d);
        }
        // The side that is closer to zero is tried first.
        let mut sides = lifted.pairs()[pair].map(|side| side as usize);
        sides.sort_by(|&i, &j| (d[j] - lower[j]).total_cmp(&(d[i] - lower[i])));
        for side in sides {
            let mut child = upper.clone();
            child[side] = lower[side];
            stack.push((lower.clone(), child));
        }
    }
    Descent::Undecided
}

/// The program in d / Δ, whose bounds the nodes change.
struct Branching<'a> {
    program: LinearProgram,
    pairs: &'a [[u32; 2]],
    radius: f64,
}

/// A pair is complementary when its smaller side is at most this part of the radius.
const COMPLEMENTARY: f64 = 1e-6;

impl<'a> Branching<'a> {
    fn new(lifted: &'a Lifted<'_>, local: &Local, tolerances: &Tolerances) -> Self {
        let n = local.w.len();
        let radius = tolerances.radius;
        // What is active has no room at all.
        let distance = |value: f64, bound: f64| match (value - bound).abs() {
            distance if distance <= tolerances.active * value.abs().max(1.0) => 0.0,
            distance => distance / radius,
        };
        let bounds = lifted.variable_bounds();
        let room = |i: usize| {
            let down = distance(local.w[i], bounds.lower[i]).min(1.0);
            let up = distance(local.w[i], bounds.upper[i]).min(1.0);
            (-down, up)
        };
        let (lower, mut upper): (Vec<f64>, Vec<f64>) = (0..n).map(room).unzip();
        for (pair, &[a, b]) in lifted.pairs().iter().enumerate() {
            let [p, q] = lifted.distances(pair, &local.w);
            if p.max(q) > radius {
                let smaller = if p <= q { a } else { b } as usize;
                upper[smaller] = lower[smaller];
            }
        }
        let bounds = lifted.row_bounds();
        let mut reach = vec![0.0; local.rows.len()];
        for &(row, _, value) in &local.jacobian {
            reach[row] += value.abs();
        }
        let mut program = LinearProgram {
            cost: local.gradient.iter().map(|g| g / local.scale).collect(),
            lower,
            upper,
            ..LinearProgram::default()
        };
        // Rows that the box cannot bring to their bounds are left out.
        let mut place = vec![usize::MAX; local.rows.len()];
        for (row, place) in place.iter_mut().enumerate() {
            let is_equation = bounds.lower[row] == bounds.upper[row];
            let to = |bound: f64| match is_equation {
                true => 0.0,
                false => distance(local.rows[row], bound),
            };
            let (down, up) = (-to(bounds.lower[row]), to(bounds.upper[row]));
            if -down <= reach[row] || up <= reach[row] {
                *place = program.row_lower.len();
                program.row_lower.push(down);
                program.row_upper.push(up);
            }
        }
        let entries = local.jacobian.iter();
        let kept = entries.filter(|entry| place[entry.0] != usize::MAX);
        program.entries = kept
            .map(|&(row, j, value)| (place[row], j, value))
            .collect();
        Branching {
            program,
            pairs: lifted.pairs(),
            radius,
        }
    }

    /// -∇fᵀd, over Δ and the scale of the gradient.
    fn decrease(&self, d: &[f64]) -> f64 {
        -self
            .program
            .cost
            .iter()
            .zip(d)
            .map(|(c, d)| c * d)
            .sum::<f64>()
    }

    /// How far the sides of a pair are from zero at d.
    fn distances(&self, pair: usize, d: &[f64]) -> [f64; 2] {
        self.pairs[pair].map(|side| d[side as usize] - self.program.lower[side as usize])
    }

    /// The pair that is violated most.
    fn violated(&self, d: &[f64], upper: &[f64]) -> Option<usize> {
        let residual = |&pair: &usize| {
            let is_fixed = |side: u32| upper[side as usize] == self.program.lower[side as usize];
            match self.pairs[pair].iter().any(|&side| is_fixed(side)) {
                true => 0.0,
                false => self
                    .distances(pair, d)
                    .into_iter()
                    .fold(f64::INFINITY, f64::min),
            }
        };
        let pairs = 0..self.pairs.len();
        let worst = pairs.max_by(|p, q| residual(p).total_cmp(&residual(q)))?;
        (residual(&worst) > COMPLEMENTARY).then_some(worst)
    }

    /// Puts the smaller side of every pair at zero.
    fn round(&self, d: &[f64], upper: &mut [f64]) {
        for (pair, &[a, b]) in self.pairs.iter().enumerate() {
            let is_fixed = |side: u32| upper[side as usize] == self.program.lower[side as usize];
            if !is_fixed(a) && !is_fixed(b) {
                let [p, q] = self.distances(pair, d);
                let smaller = if p <= q { a } else { b } as usize;
                upper[smaller] = self.program.lower[smaller];
            }
        }
    }

    fn found(&self, d: Vec<f64>) -> Descent {
        Descent::Found(d.into_iter().map(|d| d * self.radius).collect())
    }
}
