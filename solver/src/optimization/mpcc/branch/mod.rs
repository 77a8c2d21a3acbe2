//! A branch of an MPCC: one side of every pair is held at zero, the other one is not negative.

pub(crate) mod forcing;
pub(crate) mod leave;
pub(crate) mod polish;
pub(crate) mod reach;
use super::lift::Lifted;
use crate::optimization::problem::{Intervals, Member, Nlp, Structure};

/// The sides that are held at zero at a point.
///
/// Every pair needs one zero side, and one side may serve several pairs. The pairs whose sides differ most are decided
/// first, by their smaller side; a pair that a side already satisfies decides nothing.
pub fn choose(lifted: &Lifted<'_>, w: &[f64]) -> Vec<Member> {
    let n_pairs = lifted.pairs().len();
    let ratio = |pair: usize| {
        let [a, b] = lifted.distances(pair, w).map(|side| side.max(0.0));
        let larger = a.max(b);
        // Both zero: undecided.
        if larger == 0.0 {
            1.0
        } else {
            a.min(b) / larger
        }
    };
    let mut order: Vec<(f64, usize)> = (0..n_pairs).map(|pair| (ratio(pair), pair)).collect();
    order.sort_by(|p, q| p.0.total_cmp(&q.0));
    let mut zero = vec![false; lifted.n_variables()];
    let mut zeros = vec![Member::A; n_pairs];
    for (_, pair) in order {
        let [a, b] = lifted.pairs()[pair].map(|side| side as usize);
        let [p, q] = lifted.distances(pair, w);
        zeros[pair] = match (zero[a], zero[b]) {
            (true, false) => Member::A,
            (false, true) => Member::B,
            _ if p <= q => Member::A,
            _ => Member::B,
        };
        zero[[a, b][zeros[pair] as usize]] = true;
    }
    zeros
}

/// The nonlinear program of a branch.
pub struct Branch<'l, 'p> {
    lifted: &'l mut Lifted<'p>,
    bounds: Intervals,
    start: Vec<f64>,
}

impl<'l, 'p> Branch<'l, 'p> {
    /// The branch with these zeros, from a point of the vertical form. The problem is settled on it.
    pub fn new(lifted: &'l mut Lifted<'p>, zeros: &[Member], start: &[f64]) -> Self {
        lifted.settle(Some(zeros));
        let bounds = lifted.hold(zeros.iter().copied().enumerate());
        let start = start.iter().zip(bounds.lower.iter().zip(&bounds.upper));
        let start = start.map(|(&w, (&l, &u))| if l == u { l } else { w });
        Branch {
            start: start.collect(),
            lifted,
            bounds,
        }
    }
}

impl Branch<'_, '_> {
    /// The same in a box around a point, as far as that is within the bounds: no variable is farther away from it than
    /// `reach`, times max(1, |w_i|).
    pub fn within(mut self, reach: f64, middle: &[f64]) -> Self {
        let Intervals { lower, upper } = &mut self.bounds;
        for ((w, lower), upper) in middle.iter().zip(lower).zip(upper) {
            let w = w.max(*lower).min(*upper);
            let room = reach * w.abs().max(1.0);
            (*lower, *upper) = (lower.max(w - room), upper.min(w + room));
        }
        self
    }

    /// The rows whose slack is not held, with it: it is what they say.
    pub fn free_slacks(&self) -> Vec<(usize, usize)> {
        let slacks = self.lifted.slacks();
        slacks
            .filter(|&(_, slack)| self.bounds.lower[slack] < self.bounds.upper[slack])
            .collect()
    }

    /// How many variables the original problem has.
    pub fn n_original(&self) -> usize {
        self.lifted.n_original()
    }
}

impl Nlp for Branch<'_, '_> {
    fn structure(&self) -> Structure<'_> {
        Structure {
            variables: self.bounds.view(),
            start: &self.start,
            ..self.lifted.structure()
        }
    }

    fn has_objective(&self) -> bool {
        self.lifted.has_objective()
    }

    fn objective(&mut self, w: &[f64]) -> f64 {
        self.lifted.objective(w)
    }

    fn gradient(&mut self, w: &[f64], gradient: &mut [f64]) {
        self.lifted.gradient(w, gradient);
    }

    fn rows(&mut self, w: &[f64], rows: &mut [f64]) {
        self.lifted.rows(w, rows);
    }

    fn jacobian(&mut self, w: &[f64], entries: &mut [f64]) {
        self.lifted.jacobian(w, entries);
    }

    fn hessian(&mut self, w: &[f64], factor: f64, y: &[f64], entries: &mut [f64]) {
        self.lifted.hessian(w, factor, y, entries);
    }
}
