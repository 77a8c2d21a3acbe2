//! The search for narrow places, in everything that depends on time alone.

use rustc_hash::FxHashSet;

use super::Pulse;
use crate::expr::{self, BinaryFunction, Evaluator, Expr, Function, Node, Steep, Var};

/// Places in the horizon where a function is looked at.
const SAMPLES: usize = 4096;

/// What is wider than this fraction of the horizon is seen by every step,
pub(crate) const NARROW: f64 = 0.02;

/// and what is wider than this fraction of a period, of many, is no pulse but what it does all the time.
const OF_PERIOD: f64 = 0.1;

/// More places of one function than this cannot be told apart by samples.
const MOST: usize = SAMPLES / 4;

/// Halvings of an interval around a place, and of its width.
const HALVINGS: usize = 60;

/// Positive powers below this one make no pulses.
pub(crate) const HIGH_POWER: i32 = 4;

/// exp(u) is no term of a rate with a u above this one, but divides something.
const LARGEST: f64 = 100.0;

/// Divisors with more terms than this are not looked at.
const MOST_TERMS: usize = 8;

/// How much a function of time matters between two instants; above 1 is much.
#[derive(Clone, Copy)]
enum Measure {
    /// By its difference.
    Difference,
    /// By so many times the logarithm of its ratio.
    Ratio(f64),
}

impl Measure {
    fn change(self, from: f64, to: f64) -> f64 {
        match self {
            Measure::Difference => (to - from).abs(),
            Measure::Ratio(power) => power * (to / from).abs().ln().abs(),
        }
    }
}

pub(crate) struct Search {
    time: Var,
    horizon: f64,
    found: Vec<Pulse>,
}

impl Search {
    pub fn new(time: Var, horizon: f64) -> Self {
        Search {
            time,
            horizon,
            found: Vec::new(),
        }
    }

    /// Looks at everything below some expressions.
    pub fn run(mut self, roots: &[Expr]) -> Vec<Pulse> {
        let mut open = roots.to_vec();
        let mut seen = FxHashSet::default();
        while let Some(e) = open.pop() {
            if !seen.insert(e) {
                continue;
            }
            match e.node() {
                Node::Constant(_) | Node::Variable(_) => {}
                Node::Sum { terms, .. } => open.extend(terms.into_iter().map(|term| term.1)),
                Node::Product(factors) => {
                    for (factor, power) in factors {
                        if !(0..HIGH_POWER).contains(&power) {
                            self.turns(factor, Measure::Ratio(f64::from(power).abs()));
                        }
                        if power < 0 {
                            self.balances(factor);
                        }
                        open.push(factor);
                    }
                }
                Node::Unary(function, argument) => {
                    self.look_at(function, argument);
                    open.push(argument);
                }
                Node::Binary(function, a, b) => {
                    if function == BinaryFunction::Pow {
                        self.turns(a.log() * b, Measure::Difference);
                    }
                    open.extend([a, b]);
                }
            }
        }
        self.found.sort_by(|a, b| a.at.total_cmp(&b.at));
        self.found.dedup_by(|b, a| a.at == b.at);
        self.found
    }

    fn look_at(&mut self, function: Function, argument: Expr) {
        match function.definition().steep {
            Steep::Nowhere => {}
            Steep::Exponential => {
                self.turns(argument, Measure::Difference);
                self.layers(argument);
            }
            Steep::Hyperbolic => self.turns(argument, Measure::Difference),
            Steep::At(places) => {
                for &place in places {
                    self.turns(argument - place, Measure::Ratio(1.0));
                    self.balances(argument - place);
                }
            }
            Steep::Flank => {
                self.turns(argument, Measure::Difference);
                self.vanishes(argument);
            }
        }
    }

    fn is_timed(&self, u: Expr) -> bool {
        expr::variables_of(&[u]) == [self.time]
    }

    /// Takes the instants at which u turns, where it changes much next to them.
    fn turns(&mut self, u: Expr, measure: Measure) {
        if !self.is_timed(u) {
            return;
        }
        let slope = u.diff(self.time);
        if slope.as_constant().is_some() {
            return;
        }
        let (u, slope) = (Evaluator::new(u), Evaluator::new(slope));
        let change = |a: f64, b: f64| measure.change(u.eval(&|_| a), u.eval(&|_| b));
        self.take(|t| slope.eval(&|_| t), change);
    }

    /// Takes the ends of the horizon from which exp(u) falls off narrowly.
    fn layers(&mut self, u: Expr) {
        if !self.is_timed(u) {
            return;
        }
        let u = Evaluator::new(u);
        let falls = |end: f64, t: f64| match 0.0 <= t && t <= self.horizon {
            true => u.eval(&|_| end) - u.eval(&|_| t),
            false => 0.0,
        };
        let ends = [0.0, self.horizon];
        let found = ends.map(|end| {
            let is_term = u.eval(&|_| end) < LARGEST;
            is_term.then(|| pulse(end, NARROW * self.horizon, falls))
        });
        self.found.extend(found.into_iter().flatten().flatten());
    }

    /// Takes the instants at which u vanishes, where it changes much next to them.
    fn vanishes(&mut self, u: Expr) {
        if self.is_timed(u) {
            let u = Evaluator::new(u);
            let at = |t: f64| u.eval(&|_| t);
            self.take(at, |a, b| Measure::Difference.change(at(a), at(b)));
        }
    }

    /// Takes the instants at which two terms of a sum are of one size, where their ratio changes much
    /// next to them: there the sum has a zero near the real axis.
    fn balances(&mut self, sum: Expr) {
        let Node::Sum { constant, terms } = sum.node() else {
            return;
        };
        if !self.is_timed(sum) || terms.len() > MOST_TERMS {
            return;
        }
        let terms = terms.into_iter().map(|(c, term)| (c, Evaluator::new(term)));
        let terms: Vec<_> = terms.collect();
        let sizes: Vec<Box<dyn Fn(f64) -> f64>> = (terms.iter())
            .map(|(c, term)| Box::new(move |t| (c * term.eval(&|_| t)).abs()) as _)
            .chain((constant != 0.0).then(|| Box::new(move |_| constant.abs()) as _))
            .collect();
        for (i, a) in sizes.iter().enumerate() {
            for b in &sizes[..i] {
                let ratio = |t: f64| (a(t) / b(t)).ln();
                self.take(|t| a(t) - b(t), |from, to| (ratio(to) - ratio(from)).abs());
            }
        }
    }

    /// Takes the roots of f next to which something changes by more than 1 within a narrow width.
    fn take(&mut self, f: impl Fn(f64) -> f64, change: impl Fn(f64, f64) -> f64) {
        let roots = self.roots(f);
        if roots.is_empty() || roots.len() > MOST {
            return;
        }
        let narrow = self.horizon * NARROW.min(OF_PERIOD / roots.len() as f64);
        let found = roots
            .into_iter()
            .filter_map(|at| pulse(at, narrow, &change));
        self.found.extend(found);
    }

    /// The roots of f within the horizon, and narrowly beyond, where its sign changes from sample to sample.
    fn roots(&self, f: impl Fn(f64) -> f64) -> Vec<f64> {
        let share = |k: usize| (1.0 + 2.0 * NARROW) * k as f64 / SAMPLES as f64 - NARROW;
        let instant = |k: usize| self.horizon * share(k);
        let mut roots = Vec::new();
        let mut before = f(instant(0));
        for k in 1..=SAMPLES {
            let now = f(instant(k));
            if now == 0.0 {
                roots.push(instant(k));
            } else if before.signum() * now.signum() < 0.0 && before != 0.0 {
                let (mut low, mut high) = (instant(k - 1), instant(k));
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (low + high);
                    if f(middle).signum() == before.signum() {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                roots.push(high);
            }
            before = now;
        }
        roots
    }
}

/// An instant next to which something changes by more than 1 within a width.
fn pulse(at: f64, mut width: f64, change: impl Fn(f64, f64) -> f64) -> Option<Pulse> {
    let is_sharp = |w: f64| change(at, at - w) > 1.0 || change(at, at + w) > 1.0;
    if !is_sharp(width) {
        return None;
    }
    for _ in 0..HALVINGS {
        if !is_sharp(0.5 * width) {
            break;
        }
        width *= 0.5;
    }
    Some(Pulse { at, width })
}
