//! floor(u) of a function of time u -> a value that is held between the instants at which u passes an integer.
//!
//! floor(u(t)) = k where k ≤ u(t) < k + 1, the same as data that is held: y(t) = k_i for t_i ≤ t < t_{i+1}.
//! Of a u in states, a ≤ u < b for states within their ranges: floor(u) = ⌊a⌋ + Σ step(u - k), ⌊a⌋ < k ≤ ⌊b⌋.
//!
//! Crossings are enclosed. Over an interval whose enclosure of u holds no integer there is none; where that of u' has
//! one sign, there is one for every integer between the values at its ends, and bisection finds it; all else is
//! halved. So no crossing is passed over, however long the horizon.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::diagnostics::Diagnostics;
use crate::expr::{
    BinaryFunction, Evaluator, Expr, Function, Interval, Node, Var, transform, variables_of,
};
use crate::model::Data;
use crate::source::Span;
use crate::source::table::{Fit, Table};
use crate::system::SystemError;
use crate::system::experiment::Settings;
use crate::system::lower::instance::Instance;
use crate::system::switches::known::Known;
use crate::system::switches::surface::enclosure;
use crate::system::values::limits::Allowed;

/// Instants at which one function jumps, at most.
const MOST_INSTANTS: usize = 10_000;

/// Steps that a floor of states is made of, at most.
const MOST_STEPS: f64 = 64.0;

/// How deep a function of states is looked into for its range.
const DEPTH: usize = 12;

/// A least value this close to an integer, relative to its size, is the integer.
const ROUNDED: f64 = 1e-12;

/// Intervals that are looked at, at most.
const MOST_INTERVALS: usize = 20 * MOST_INSTANTS;

/// Intervals shorter than this share of the horizon are not halved.
const SHORTEST: f64 = 1e-13;

/// What touches an integer is one to rounding for no more than this share of the horizon.
const TOUCHES: f64 = 1e-6;

/// What is an integer to rounding this share of the horizon beside a jump is so flat that its instant is not known.
const FLAT: f64 = 1e-10;

/// Instants closer to each other than this share of the horizon are one.
const TOGETHER: f64 = 8.0 * f64::EPSILON;

/// Functions of time that are tables: data, and what stands for each rounding.
pub(crate) struct Roundings<'e> {
    time: Var,
    horizon: f64,
    /// Numbers of parameters that are not free.
    params: FxHashMap<Var, f64>,
    /// The same, with the ranges of states, and that of time.
    ranges: Known,
    states: Vec<Var>,
    /// The data that is kept, then the functions that are held.
    pub data: Vec<Data<'e>>,
    /// ψ of the steps that functions of time and open parameters are made of.
    pub steps: Vec<Expr<'e>>,
    /// floor(u) by u.
    values: FxHashMap<Expr<'e>, Expr<'e>>,
    /// What was wrong.
    errors: Vec<SystemError>,
}

/// Why no instants are known.
enum Fault {
    /// u depends on this.
    Depends(Var),
    /// There are too many.
    Many,
    /// Whether u passes an integer is not known.
    Unknown,
    /// Nothing bounds the horizon.
    Open,
}

impl<'e> Roundings<'e> {
    /// Takes the roundings of the model, so that errors stand at their calls.
    pub fn of(instance: &Instance<'_, 'e>, diags: &mut Diagnostics) -> Self {
        let (model, values) = (instance.model, instance.values());
        let params = model.quantities.of_params();
        let params = params.filter_map(|param| param.as_variable());
        let data = model.definitions.data.iter();
        let data = data.filter(|data| instance.needs.holds(data.var.as_variable()));
        let mut roundings = Roundings {
            time: instance.time(),
            horizon: longest(instance.settings),
            params: params
                .filter_map(|param| Some((param, values.fixed(param)?)))
                .collect(),
            ranges: ranges(instance),
            states: instance.states().filter_map(Expr::as_variable).collect(),
            data: data.cloned().collect(),
            steps: Vec::new(),
            values: FxHashMap::default(),
            errors: Vec::new(),
        };
        for rounded in &model.rounded {
            if !instance.needs.holds_all(rounded.argument) {
                continue;
            }
            let span = rounded.span;
            if let Some(period) = roundings.number_of(rounded.period)
                && !(period > 0.0 && period.is_finite())
            {
                roundings.errors.push(SystemError::Period { period, span });
                continue;
            }
            if let Some(duty) = roundings.number_of(rounded.duty)
                && !(0.0..=1.0).contains(&duty)
            {
                roundings.errors.push(SystemError::Duty { duty, span });
                continue;
            }
            let argument = rounded.argument.substitute(&values.signals);
            roundings.replace(argument.apply(Function::Floor), span);
        }
        roundings.report(diags);
        roundings
    }

    /// Reports what was wrong.
    pub fn report(&mut self, diags: &mut Diagnostics) {
        for error in self.errors.drain(..) {
            diags.push(error);
        }
    }

    /// An expression with its roundings replaced.
    pub fn replace(&mut self, e: Expr<'e>, span: Span) -> Expr<'e> {
        if !e.exprs().applies(Function::Floor) {
            return e;
        }
        transform(&[e], &mut |_, e| match e.is_function().then(|| e.node()) {
            Some(Node::Unary(Function::Floor, u)) => self.floor(e, u, span),
            _ => e,
        })[0]
    }

    fn floor(&mut self, e: Expr<'e>, u: Expr<'e>, span: Span) -> Expr<'e> {
        if let Some(&known) = self.values.get(&u) {
            return known;
        }
        let value = self.steps(u).map(|steps| match steps[..] {
            [(_, value)] => e.exprs().constant(value),
            _ => self.hold(e, &steps, span),
        });
        let value = value.or_else(|fault| match fault {
            Fault::Depends(_) => self.sum_of_steps(u).ok_or(fault),
            fault => Err(fault),
        });
        let value = value.unwrap_or_else(|fault| {
            let text = e.to_string();
            let horizon = self.horizon;
            self.errors.push(match fault {
                Fault::Depends(on) => SystemError::Rounded {
                    text,
                    on: e.exprs().name(on),
                    help: match self.states.contains(&on) {
                        true => self.counted(u),
                        false => "floor, ceil, round and mod take time, parameters, and states with a range; fix it before the run".to_owned(),
                    },
                    span,
                },
                Fault::Many => SystemError::TooManyInstants {
                    text,
                    horizon,
                    limit: MOST_INSTANTS,
                    span,
                },
                Fault::Unknown => SystemError::UnknownInstants { text, span },
                Fault::Open => SystemError::OpenHorizon { text, span },
            });
            e.exprs().constant(0.5)
        });
        self.values.insert(u, value);
        value
    }

    /// ⌊a⌋, and how many integers are above it up to b, for a ≤ u ≤ b where states are within their ranges.
    fn integers(&self, u: Expr<'e>) -> (f64, f64) {
        let range = enclosure(u, &self.ranges, DEPTH);
        let lowest = (range.low + ROUNDED * range.low.abs().max(1.0)).floor();
        (lowest, range.high.floor() - lowest)
    }

    /// ⌊a⌋ + Σ step(u - k) for a ≤ u where states are within their ranges.
    fn sum_of_steps(&mut self, u: Expr<'e>) -> Option<Expr<'e>> {
        let (lowest, n) = self.integers(u);
        if !(0.0..=MOST_STEPS).contains(&n) {
            return None;
        }
        let steps = (1..=n as usize).map(|k| u - (lowest + k as f64));
        if variables_of(&[u])
            .iter()
            .all(|var| !self.states.contains(var))
        {
            self.steps.extend(steps.clone());
        }
        Some(lowest + u.exprs().sum(steps.map(Expr::step)))
    }

    /// How ⌊u⌋ is said in a way that a run takes, for a function u of states.
    fn counted(&self, u: Expr<'e>) -> String {
        let (_, steps) = self.integers(u);
        let first = match steps.is_finite() {
            true => format!(
                "within the ranges of its states it makes {steps} steps, and {MOST_STEPS} are the most"
            ),
            false => format!(
                "give the states in it a range, `state x in [0, 5] = ..;`, within which it is a sum of up to {MOST_STEPS} steps"
            ),
        };
        format!(
            "{first}; or count: `discrete n = 0;`, with its floor at the start for 0, and `jump up when {u} > n + 1 {{ n := n + 1; }}` and `jump down when {u} < n {{ n := n - 1; }}`"
        )
    }

    /// The variable that stands for a function that is held.
    fn hold(&mut self, e: Expr<'e>, steps: &[(f64, f64)], span: Span) -> Expr<'e> {
        let (times, values): (Vec<f64>, Vec<f64>) = steps.iter().copied().unzip();
        let table = Table::new(Fit::Hold, &times, &values);
        let name = e.to_string();
        let var = e.exprs().variable(&name);
        self.data.push(Data {
            text: table.to_string(),
            name,
            var,
            table: Arc::new(table),
            span,
        });
        var
    }

    /// The values of the parameters in an expression.
    fn numbers(&self, e: Expr<'e>) -> Result<FxHashMap<Var, f64>, Fault> {
        let vars = variables_of(&[e]).into_iter();
        let known = vars.filter(|&var| !self.is_given(var));
        let number = |var: Var| match self.params.get(&var) {
            Some(&value) => Ok((var, value)),
            None => Err(Fault::Depends(var)),
        };
        known.map(number).collect()
    }

    /// The number that an expression of parameters is.
    fn number_of(&self, e: Option<Expr<'e>>) -> Option<f64> {
        let numbers = self.numbers(e?).ok()?;
        Some(e?.eval(&|var| numbers.get(&var).copied().unwrap_or(f64::NAN)))
    }

    /// Whether a variable is time, or data that is held.
    fn is_given(&self, var: Var) -> bool {
        let mut held = self.data.iter().filter(|data| data.table.fit == Fit::Hold);
        var == self.time || held.any(|data| data.var.as_variable() == Some(var))
    }

    /// From when on floor(u) has which value.
    fn steps(&self, u: Expr<'e>) -> Result<Vec<(f64, f64)>, Fault> {
        let vars = variables_of(&[u]);
        let numbers = self.numbers(u)?;
        if vars.contains(&self.time) && self.horizon.is_infinite() {
            return Err(Fault::Open);
        }
        let data = self.data.iter();
        let data = data.filter_map(|data| Some((data.var.as_variable()?, data.table.clone())));
        let mut search = Search {
            time: self.time,
            horizon: self.horizon,
            value: Evaluator::new(u),
            slope: Evaluator::new(u.diff(self.time)),
            jumps: has_jumps(u),
            moves: vars.contains(&self.time),
            numbers,
            data: data.filter(|(var, _)| vars.contains(var)).collect(),
            found: Vec::new(),
            n_intervals: 0,
        };
        search.run()
    }
}

/// The longest horizon, be it free.
fn longest(settings: &Settings<'_>) -> f64 {
    let free = settings.optimize.as_ref().and_then(|task| task.horizon);
    free.map_or(settings.horizon, |(_, longest)| longest)
}

/// Parameters, states within their ranges, and time within the horizon.
fn ranges(instance: &Instance<'_, '_>) -> Known {
    let mut known = instance.params.clone();
    let time = Interval::new(0.0, longest(instance.settings));
    known.ranges.insert(instance.time(), time);
    for state in &instance.model.quantities.states {
        for (k, var) in state.vars.iter().enumerate() {
            let allowed = instance.allowed(state, k, |e| instance.moves(e));
            if let (Some(Allowed::Between(lo, hi)), Some(var)) = (allowed, var.as_variable()) {
                known.ranges.insert(var, Interval::new(lo, hi));
            }
        }
    }
    known
}

/// Where the pieces of data begin.
fn starts(table: &Table) -> impl Iterator<Item = f64> {
    let pieces = std::iter::successors(Some(table.piece(0.0)), |piece| {
        piece.end.is_finite().then(|| table.piece(piece.end))
    });
    pieces.map(|piece| piece.start)
}

/// Whether an expression may jump where its derivative shows nothing.
fn has_jumps(e: Expr) -> bool {
    let mut jumps = false;
    transform(&[e], &mut |_, e| {
        jumps |= matches!(
            e.node(),
            Node::Unary(Function::Sign, _) | Node::Binary(BinaryFunction::Atan2, ..)
        ) || matches!(e.node(), Node::Unary(function, _) if function.on_surface().is_some());
        e
    });
    jumps
}

/// The search for the crossings of one function.
struct Search<'e> {
    time: Var,
    horizon: f64,
    value: Evaluator<'e>,
    slope: Evaluator<'e>,
    jumps: bool,
    /// Whether u depends on time.
    moves: bool,
    /// Parameters, and data within the present piece of it.
    numbers: FxHashMap<Var, f64>,
    data: Vec<(Var, Arc<Table>)>,
    found: Vec<f64>,
    n_intervals: usize,
}

impl Search<'_> {
    fn run(&mut self) -> Result<Vec<(f64, f64)>, Fault> {
        let mut ends: Vec<f64> = (self.data.iter())
            .flat_map(|(_, table)| starts(table))
            .chain([0.0, self.horizon])
            .filter(|&t| 0.0 <= t && t <= self.horizon)
            .collect();
        ends.sort_by(f64::total_cmp);
        ends.dedup();
        for piece in ends.windows(2) {
            self.enter(0.5 * (piece[0] + piece[1]));
            self.cross(piece[0], piece[1])?;
            self.found.push(piece[1]);
        }
        let slack = TOGETHER * self.horizon;
        let mut starts = vec![0.0];
        for &t in &self.found {
            if t - starts[starts.len() - 1] > slack && self.horizon - t > slack {
                starts.push(t);
            }
        }
        let ends = starts[1..].iter().copied().chain([self.horizon]);
        let mut steps: Vec<(f64, f64)> = Vec::with_capacity(starts.len());
        for (&start, end) in starts.iter().zip(ends) {
            if let Some(value) = self.between(start, end)? {
                match steps.last() {
                    None => steps.push((0.0, value)),
                    Some(&(_, before)) if before != value => steps.push((start, value)),
                    Some(_) => {}
                }
            }
        }
        let is_sharp = |search: &mut Self, t: f64| {
            let beside = [t - FLAT * search.horizon, t + FLAT * search.horizon];
            beside
                .iter()
                .all(|&t| matches!(search.rounded(t), Ok(Some(_))))
        };
        match steps.is_empty() || !steps[1..].iter().all(|&(t, _)| is_sharp(self, t)) {
            true => Err(Fault::Unknown),
            false => Ok(steps),
        }
    }

    /// floor(u) between two crossings; none where u touches an integer, and is one to rounding for a while.
    fn between(&mut self, start: f64, end: f64) -> Result<Option<f64>, Fault> {
        let mut known = None;
        for share in [0.5, 0.382, 0.618, 0.146, 0.854] {
            let here = self.rounded(start + share * (end - start))?;
            match known == here || known.is_none() || here.is_none() {
                true => known = known.or(here),
                false => return Err(Fault::Unknown),
            }
        }
        match known.is_none() && end - start > TOUCHES * self.horizon {
            true => Err(Fault::Unknown),
            false => Ok(known),
        }
    }

    /// Puts in the data that holds at an instant.
    fn enter(&mut self, t: f64) {
        for (var, table) in &self.data {
            self.numbers.insert(*var, table.value(t));
        }
    }

    /// floor(u), none where u moves and is an integer to rounding; a constant that is one to rounding is one.
    fn rounded(&mut self, t: f64) -> Result<Option<f64>, Fault> {
        self.enter(t);
        let at = |var: Var| self.number(var, t);
        let (value, error) = (self.value.eval(&at), self.value.running_error(&at));
        if !value.is_finite() || error >= 0.5 {
            return Err(Fault::Unknown);
        }
        let nearest = value.round();
        Ok(match (value - nearest).abs() <= error {
            true => (!self.moves).then_some(nearest),
            false => Some(value.floor()),
        })
    }

    fn number(&self, var: Var, t: f64) -> f64 {
        match var == self.time {
            true => t,
            false => self.numbers.get(&var).copied().unwrap_or(f64::NAN),
        }
    }

    fn at(&self, t: f64) -> f64 {
        self.value.eval(&|var| self.number(var, t))
    }

    fn enclose(&self, of: &Evaluator, from: f64, to: f64) -> Interval {
        of.enclose(&|var| match (var == self.time, self.numbers.get(&var)) {
            (true, _) => Interval::new(from, to),
            (false, Some(&number)) => Interval::rounded(number),
            (false, None) => Interval::ALL,
        })
    }

    /// Finds the crossings between two instants.
    fn cross(&mut self, from: f64, to: f64) -> Result<(), Fault> {
        let mut open = vec![(from, to)];
        while let Some((from, to)) = open.pop() {
            self.n_intervals += 1;
            if self.n_intervals > MOST_INTERVALS {
                return Err(Fault::Unknown);
            }
            let u = self.enclose(&self.value, from, to);
            if u.low.floor() == u.high.floor() {
                continue;
            }
            let slope = self.enclose(&self.slope, from, to);
            // Without bounds on both, u may have a pole, and jump.
            let is_bounded = u.magnitude().is_finite() && slope.magnitude().is_finite();
            let moves = slope.low > 0.0 || slope.high < 0.0;
            if is_bounded && moves && !self.jumps {
                self.levels(from, to, slope.low > 0.0)?;
                continue;
            }
            let rests = slope == Interval::ZERO && !self.jumps;
            let middle = 0.5 * (from + to);
            if !rests && to - from > SHORTEST * self.horizon {
                open.extend([(middle, to), (from, middle)]);
            } else if !(self.at(from).is_finite() && self.at(to).is_finite()) {
                return Err(Fault::Unknown);
            } else if self.at(from).floor() != self.at(to).floor() {
                self.found.push(to);
            }
        }
        Ok(())
    }

    /// Finds the crossing of every integer between two instants, where u rises or falls throughout.
    fn levels(&mut self, from: f64, to: f64, rises: bool) -> Result<(), Fault> {
        let (first, last) = (self.at(from).floor(), self.at(to).floor());
        let count = (last - first).abs();
        if !count.is_finite() || count > 0.0 && (last > first) != rises {
            return Err(Fault::Unknown);
        }
        if self.found.len() as f64 + count > MOST_INSTANTS as f64 {
            return Err(Fault::Many);
        }
        let mut below = from;
        for k in 0..count as usize {
            // The integer that u reaches from below, or leaves downwards.
            let is_past = |value: f64| match rises {
                true => value >= first + 1.0 + k as f64,
                false => value < first - k as f64,
            };
            let (mut low, mut high) = (below, to);
            loop {
                let middle = 0.5 * (low + high);
                if middle <= low || middle >= high {
                    break;
                }
                match is_past(self.at(middle)) {
                    true => high = middle,
                    false => low = middle,
                }
            }
            self.found.push(high);
            below = high;
        }
        Ok(())
    }
}
