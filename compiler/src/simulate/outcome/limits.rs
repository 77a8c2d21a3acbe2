//! Bounds of states and controls along a run: who leaves them, and when first.
//!
//! A state is a polynomial within a step, and enclosures of it on shorter and shorter intervals find
//! the instant at which it leaves its bounds. A control is looked at in a few points of every step.

use nsd_solver::event::Segment;
use nsd_solver::hybrid::Sided;
use nsd_solver::tape::Tape;

use crate::expr::{self, Expr};
use crate::lowering::hybrid::{numbers, variable};
use crate::model::Data;
use crate::report::Warning;
use crate::report::forms::text::significant;
use crate::simulate::record::reported::Reported;
use crate::system::{Allowed, Limit, System};

/// Halvings of a step before its point counts as found.
const MAX_DEPTH: usize = 30;
/// Intervals of a step that are looked at: a state that touches its bound for long is not searched further.
const MAX_INTERVALS: usize = 2000;
/// Points of a step at which a control is looked at, as shares of the step.
const SHARES: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// A value of a finite set is hit to so much, relative to its size.
const ROUNDING: f64 = 1e-9;

/// Watches the limits of a system during a run.
pub(crate) struct Limits<'s, 'e> {
    system: &'s System<'e>,
    limits: &'s [Limit<'e>],
    /// The state that a limit with bounds is about; none for what is evaluated.
    state: Vec<Option<usize>>,
    /// Relative size of a violation that is the error of the run.
    tolerance: f64,
    /// When each was left first, and its value there.
    left: Vec<Option<(f64, f64)>>,
    /// (t, data, x, α, parameters) to what is evaluated, in order.
    functions: Sided,
    inputs: Vec<f64>,
    values: Vec<f64>,
    data: &'s [Data<'e>],
    shifted: Vec<f64>,
}

impl<'s, 'e> Limits<'s, 'e> {
    pub(crate) fn new(system: &'s System<'e>, tolerance: f64, reported: &Reported) -> Self {
        let limits = &system.recorded.limits;
        let functions = reported.limits.clone();
        let mut inputs = vec![0.0; functions.whole().n_inputs()];
        let parameters: Vec<f64> = reported.parameters(system).collect();
        let first = inputs.len() - parameters.len();
        inputs[first..].copy_from_slice(&parameters);
        Limits {
            system,
            limits,
            state: limits.iter().map(|limit| place(system, limit)).collect(),
            left: vec![None; limits.len()],
            tolerance,
            values: vec![0.0; functions.whole().n_outputs()],
            inputs,
            functions,
            data: &system.exogenous.data,
            shifted: Vec::new(),
        }
    }

    /// Looks at one step.
    pub(crate) fn segment(&mut self, segment: &Segment) {
        if self.left.iter().all(Option::is_some) {
            return;
        }
        for (k, limit) in self.limits.iter().enumerate() {
            let (Some(state), None) = (self.state[k], self.left[k]) else {
                continue;
            };
            let series = segment.state_series(state);
            let slack = slack(&limit.allowed, series[0], self.tolerance);
            let mut search = Search {
                series,
                allowed: &limit.allowed,
                slack,
                shifted: &mut self.shifted,
                looked_at: 0,
            };
            let found = search.first(segment.length);
            self.left[k] = found.map(|(tau, value)| (segment.start + tau, value));
        }
        if self.values.is_empty() {
            return;
        }
        for share in SHARES {
            let tau = share * segment.length;
            let (data, rest) = self.inputs[1..].split_at_mut(self.data.len());
            let (x, rest) = rest.split_at_mut(self.system.states.len());
            let alpha = &mut rest[..segment.sides.len()];
            segment.state(tau, x);
            segment.alpha(tau, alpha);
            let time = segment.start + tau;
            self.system.see(time, x, alpha);
            for (value, data) in data.iter_mut().zip(self.data) {
                *value = data.table.piece(segment.start).value(time);
            }
            self.inputs[0] = time;
            self.functions.eval(&self.inputs, &mut self.values);
            let evaluated = (0..self.left.len()).filter(|&k| self.state[k].is_none());
            for (k, &value) in evaluated.zip(&self.values) {
                let allowed = &self.limits[k].allowed;
                let slack = slack(allowed, value, self.tolerance);
                if self.left[k].is_none() && !allowed.holds(value, slack) {
                    self.left[k] = Some((self.inputs[0], value));
                }
            }
        }
    }

    /// One warning for every limit that was left.
    pub(crate) fn warnings(&self) -> Vec<Warning> {
        let left = self.limits.iter().zip(&self.left);
        let warning = |(limit, left): (&Limit<'e>, &Option<(f64, f64)>)| {
            let (time, value) = (*left)?;
            let (code, what) = match &limit.allowed {
                Allowed::Between(lo, hi) => ("W0703", format!("leaves [{lo}, {hi}]")),
                Allowed::OneOf(_) => ("W0704", format!("is not in {}", limit.allowed)),
            };
            let (time, value) = (significant(time, 6), significant(value, 6));
            let name = &limit.name;
            let counts = match limit.is_counted {
                true => {
                    "; from there on `floor`, `ceil`, `round` and `mod` of it are wrong: they count within this range"
                }
                false => "",
            };
            Some(Warning {
                code: code.into(),
                message: format!(
                    "{} `{name}` {what} at t = {time}, where it is {value}{counts}",
                    limit.kind
                ),
                span: Some(limit.span),
            })
        };
        left.filter_map(warning).collect()
    }
}

/// The state that a limit with bounds is about; none for what is evaluated.
fn place(system: &System, limit: &Limit) -> Option<usize> {
    let bounded = matches!(limit.allowed, Allowed::Between(..));
    let mut states = system.states.iter();
    (states.position(|state| state.var == limit.value)).filter(|_| bounded)
}

/// What limits are about that are no states, in order.
pub(crate) fn evaluated<'e>(system: &System<'e>) -> Vec<Expr<'e>> {
    let evaluated = system
        .recorded
        .limits
        .iter()
        .filter(|limit| place(system, limit).is_none());
    evaluated.map(|limit| limit.value).collect()
}

/// A tape of (t, x, α, data, open parameters), these by their numbers, with the other parameters put in.
pub(crate) fn tape_of<'e>(system: &System<'e>, open: &[usize], exprs: &[Expr<'e>]) -> Tape {
    let states = system.states.iter().map(|state| state.var);
    let alphas = system.switches.iter().map(|switch| switch.alpha);
    let data = system.exogenous.data.iter().map(|data| data.var);
    let open_params = open.iter().map(|&place| system.exogenous.params[place].var);
    let inputs = [system.time].into_iter().chain(states).chain(alphas);
    let inputs = inputs.chain(data).chain(open_params);
    let inputs: Vec<_> = inputs.map(variable).collect();
    expr::compile(&inputs, &numbers(system, open).apply(exprs))
        .expect("a verified limit is smooth in time, states, α and data")
}

/// What a value may miss its limits by.
fn slack(allowed: &Allowed, value: f64, tolerance: f64) -> f64 {
    let size = |x: f64| if x.is_finite() { x.abs() } else { 0.0 };
    match allowed {
        Allowed::Between(lo, hi) => tolerance * size(value).max(size(*lo)).max(size(*hi)),
        Allowed::OneOf(_) => ROUNDING * size(value).max(1.0),
    }
}

/// Looks for the first instant of a step at which a polynomial is outside.
struct Search<'p> {
    series: &'p [f64],
    allowed: &'p Allowed,
    slack: f64,
    /// The series around another instant.
    shifted: &'p mut Vec<f64>,
    looked_at: usize,
}

impl Search<'_> {
    /// The instant, in time since the start of the step, and the value there.
    fn first(&mut self, length: f64) -> Option<(f64, f64)> {
        if !self.allowed.holds(self.series[0], self.slack) {
            return Some((0.0, self.series[0]));
        }
        self.within(0.0, length, 0)
    }

    fn within(&mut self, from: f64, to: f64, depth: usize) -> Option<(f64, f64)> {
        self.looked_at += 1;
        let (middle, radius) = (0.5 * (from + to), 0.5 * (to - from));
        // Around the middle, |x - c_0| <= Σ |c_k| r^k.
        shift(self.series, middle, self.shifted);
        let mut power = 1.0;
        let mut spread = 0.0;
        for coefficient in &self.shifted[1..] {
            power *= radius;
            spread += coefficient.abs() * power;
        }
        let value = self.shifted[0];
        let holds = |value: f64| self.allowed.holds(value, self.slack);
        if holds(value - spread) && holds(value + spread) {
            return None;
        }
        if depth == MAX_DEPTH || self.looked_at > MAX_INTERVALS {
            return (!holds(value)).then_some((middle, value));
        }
        self.within(from, middle, depth + 1)
            .or_else(|| self.within(middle, to, depth + 1))
    }
}

/// Coefficients around `center`: Horner's scheme, again and again.
fn shift(series: &[f64], center: f64, shifted: &mut Vec<f64>) {
    shifted.clear();
    shifted.extend_from_slice(series);
    for first in 0..series.len().saturating_sub(1) {
        for k in (first..series.len() - 1).rev() {
            shifted[k] += center * shifted[k + 1];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Allowed, Search};

    fn left(series: &[f64], lo: f64, hi: f64, length: f64) -> Option<(f64, f64)> {
        let mut search = Search {
            series,
            allowed: &Allowed::Between(lo, hi),
            slack: 1e-12,
            shifted: &mut Vec::new(),
            looked_at: 0,
        };
        search.first(length)
    }

    #[test]
    fn a_short_excursion_within_a_step_is_found() {
        // 1 - (t - 1)^2 is above 0.99 from 0.9 to 1.1 only.
        let (time, value) = left(&[0.0, 2.0, -1.0], -3.0, 0.99, 2.5).unwrap();
        assert!((time - 0.9).abs() < 1e-6, "{time}");
        assert!((value - 0.99).abs() < 1e-6);
    }

    #[test]
    fn what_touches_a_bound_stays_inside() {
        assert_eq!(left(&[0.0, 2.0, -1.0], -3.0, 1.0, 2.0), None);
        assert_eq!(left(&[1.0, 0.0, 0.0], 0.0, 1.0, 2.0), None);
        assert_eq!(left(&[0.0, 2.0, -1.0], f64::NEG_INFINITY, 1.0, 100.0), None);
    }

    #[test]
    fn a_start_outside_is_found_at_once() {
        assert_eq!(left(&[2.0, -1.0], 0.0, 1.0, 1.0), Some((0.0, 2.0)));
    }
}
