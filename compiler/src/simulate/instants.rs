//! Instants that a step must not pass over: where a function of time is narrow.
//!
//! A pulse like exp(-((t - 5)/0.001)²) is zero to rounding wherever a long step looks. So steps end where
//! the argument u(t) of such a function turns, u' = 0, and where that of a sigmoid vanishes, but only if
//! what happens there is narrow compared with the horizon.

use rustc_hash::FxHashSet;

use crate::expr::{self, Evaluator, Expr, Function, Node, Var};

/// Places in the horizon where an argument is looked at.
const SAMPLES: usize = 4096;

/// What is wider than this fraction of the horizon is seen by every step.
const NARROW: f64 = 0.02;

/// More turns of one function than this are no pulses, but what it does all the time.
const MOST: usize = 256;

/// Halvings of an interval around a turn.
const HALVINGS: usize = 60;

/// The instants within the horizon at which functions of time in `roots` are narrow, in order.
pub(super) fn narrow(roots: &[Expr], time: Var, horizon: f64) -> Vec<f64> {
    let mut search = Search {
        time,
        horizon,
        found: Vec::new(),
    };
    search.visit(roots);
    let mut found = search.found;
    found.sort_by(f64::total_cmp);
    found.dedup();
    found
}

struct Search {
    time: Var,
    horizon: f64,
    found: Vec<f64>,
}

impl Search {
    /// Looks at everything below some expressions.
    fn visit<'e>(&mut self, roots: &[Expr<'e>]) {
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
                        if power < 0 {
                            self.turns(factor, true);
                        }
                        open.push(factor);
                    }
                }
                Node::Unary(function, argument) => {
                    self.look_at(function, argument);
                    open.push(argument);
                }
                Node::Binary(_, a, b) => open.extend([a, b]),
            }
        }
    }

    fn look_at(&mut self, function: Function, argument: Expr) {
        match function {
            Function::Exp | Function::Sinh | Function::Cosh => self.turns(argument, false),
            Function::Sqrt | Function::Log => self.turns(argument, true),
            Function::Tanh | Function::Atan => {
                self.turns(argument, false);
                self.vanishes(argument);
            }
            _ => {}
        }
    }

    fn is_timed(&self, u: Expr) -> bool {
        expr::variables_of(&[u]) == [self.time]
    }

    /// Takes the instants at which u turns within the narrow width: |u''| w² > 1, or |u''/u| w² > 1 where
    /// u matters in relation to itself.
    fn turns(&mut self, u: Expr, relative: bool) {
        if !self.is_timed(u) {
            return;
        }
        let slope = u.diff(self.time);
        if slope.as_constant().is_some() {
            return;
        }
        let (value, bend) = (Evaluator::new(u), Evaluator::new(slope.diff(self.time)));
        let width = NARROW * self.horizon;
        self.take(slope, |t| {
            let size = if relative {
                value.eval(&|_| t).abs()
            } else {
                1.0
            };
            bend.eval(&|_| t).abs() * width * width > size
        });
    }

    /// Takes the instants at which u vanishes within the narrow width: |u'| w > 1.
    fn vanishes(&mut self, u: Expr) {
        if self.is_timed(u) {
            let slope = Evaluator::new(u.diff(self.time));
            let width = NARROW * self.horizon;
            self.take(u, |t| slope.eval(&|_| t).abs() * width > 1.0);
        }
    }

    /// Takes the roots of f that are sharp.
    fn take(&mut self, f: Expr, is_sharp: impl Fn(f64) -> bool) {
        let f = Evaluator::new(f);
        let at = |t: f64| f.eval(&|_| t);
        let instant = |k: usize| self.horizon * k as f64 / SAMPLES as f64;
        let mut roots = Vec::new();
        let mut before = at(0.0);
        for k in 1..=SAMPLES {
            let now = at(instant(k));
            if now == 0.0 {
                roots.push(instant(k));
            } else if before * now < 0.0 {
                let (mut low, mut high) = (instant(k - 1), instant(k));
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (low + high);
                    if at(middle) * before > 0.0 {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                roots.push(high);
            }
            before = now;
        }
        if roots.len() > MOST {
            return;
        }
        let sharp = |t: &f64| *t < self.horizon && is_sharp(*t);
        self.found.extend(roots.into_iter().filter(sharp));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::Exprs;

    #[test]
    fn narrow_pulses_are_found_and_wide_ones_are_not() {
        let exprs = Exprs::new();
        let time = exprs.variable("time");
        let var = time.as_variable().expect("a variable");
        let pulse = |at: f64, width: f64| {
            let s = (time - at) * (1.0 / width);
            (s * s * -1.0).exp()
        };
        let found = narrow(&[pulse(3.7, 1e-3), pulse(5.0, 2.0), time.sin()], var, 10.0);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0] - 3.7).abs() < 1e-12, "{found:?}");
    }
}
