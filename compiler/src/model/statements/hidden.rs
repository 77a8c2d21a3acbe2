//! `hidden on s { u' += γ(s)*g; }`: terms that add, and vanish on both sides of the surface of s.
//!
//! That they vanish is proven: s gets the value of a side, and what is zero for every value of the other variables is
//! replaced by zero, node by node, up to nothing. A node is zero where the canonical form says so, or where its
//! enclosure over the ranges that are declared is zero up to rounding, as that of sin(πs) or of max(0, x - 3) for x in
//! [-1, 1] is. Where the ranges are too wide for this they are halved, a limited number of times.

use rustc_hash::FxHashMap;

use super::dynamics::{Sink, Walk};
use crate::expr::{Expr, Interval, Node, Var, transform, variables_of};
use crate::model::expressions::Lowering;
use crate::model::hir::shared_lets;
use crate::model::names::scope::Reported;
use crate::model::names::target;
use crate::model::{Domain, DynamicsError, Hidden, Model, Rate, SwitchKind, TargetKind};
use crate::syntax;

/// Entries of a switch in one term, at most: every combination of their sides has a proof of its own.
const MAX_ENTRIES: usize = 12;

/// Boxes that are looked at: combinations of the values of sets, and what is halved and its halves.
const MAX_BOXES: usize = 256;

/// Roundings of its terms within which an enclosure is zero: what a sum of so many terms is off by.
const ROUNDINGS: f64 = 64.0;

/// Points at which a counterexample is looked for: where it is in a box, or beyond a bend, a few of these are (chosen
/// by trial).
const POINTS: usize = 64;

/// Where a variable may be.
#[derive(Clone, Debug)]
pub(crate) enum Range {
    Between(Interval),
    Among(Vec<f64>),
}

impl Range {
    /// The smallest interval with all of it.
    fn hull(&self) -> Interval {
        match self {
            Range::Between(interval) => *interval,
            Range::Among(values) => {
                let low = values.iter().copied().fold(f64::INFINITY, f64::min);
                let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                Interval::new(low, high)
            }
        }
    }

    /// A place in it for every share between 0 and 1; `far` is how far out it may be where there is no end.
    fn place(&self, share: f64, far: f64) -> f64 {
        let range = match self {
            Range::Between(interval) => interval,
            Range::Among(values) => return values[(share * values.len() as f64) as usize],
        };
        match (range.low.is_finite(), range.high.is_finite()) {
            (true, true) => range.low + share * range.width(),
            (true, false) => range.low + 3.0 * share,
            (false, true) => range.high - 3.0 * share,
            (false, false) => (4.0 * share - 2.0) * far,
        }
    }
}

/// What is known of a term on a side.
enum Proof {
    Vanishes,
    /// Its value at a point.
    Differs(String),
    Open,
}

/// Where the variables of a model may be, for those where that is declared as numbers.
pub(crate) fn ranges(model: &Model<'_>) -> FxHashMap<Var, Range> {
    let mut ranges = FxHashMap::default();
    let groups = [
        &model.quantities.params,
        &model.quantities.states,
        &model.quantities.algebraics,
        &model.quantities.controls,
        &model.quantities.inputs,
        &model.quantities.connected,
    ];
    for quantity in groups.into_iter().flatten() {
        for (entry, var) in quantity.vars.iter().enumerate() {
            let range = match &quantity.domain {
                Some(Domain::Box(low, high)) => {
                    let end = |ends: &crate::model::Tensor<'_>| ends.data.get(entry)?.as_constant();
                    let ends = end(low).zip(end(high));
                    ends.map(|(low, high)| Range::Between(Interval::new(low, high)))
                }
                Some(Domain::Set(values)) => {
                    let values: Option<Vec<f64>> =
                        values.iter().map(|value| value.as_constant()).collect();
                    values.filter(|values| !values.is_empty()).map(Range::Among)
                }
                None => None,
            };
            ranges.extend(var.as_variable().zip(range));
        }
    }
    if let Some(time) = model.time.as_variable() {
        ranges.insert(time, Range::Between(Interval::new(0.0, f64::INFINITY)));
    }
    for switch in &model.switches {
        let low = lowest(&switch.kind);
        let vars = switch.vars.iter().filter_map(|var| var.as_variable());
        ranges.extend(vars.map(|var| (var, Range::Between(Interval::new(low, 1.0)))));
    }
    ranges
}

/// The value of a switch below its surface.
fn lowest(kind: &SwitchKind<'_>) -> f64 {
    match kind {
        SwitchKind::Sign => -1.0,
        SwitchKind::Step | SwitchKind::Relay(_) => 0.0,
    }
}

impl<'e> Walk<'e> {
    /// A block of hidden terms.
    pub(crate) fn hidden(
        &mut self,
        lowering: &mut Lowering<'_, 'e>,
        hidden: &syntax::Hidden,
    ) -> Result<(), Reported> {
        let target = target::resolve(lowering, &hidden.switch)?;
        let has_sides = |switch: usize| !matches!(self.switches[switch].kind, SwitchKind::Relay(_));
        let switch = match target.kind {
            TargetKind::Switch(switch) if has_sides(switch) => switch,
            _ => {
                let (name, span) = (
                    lowering.names.written().path(&hidden.switch),
                    hidden.switch.span,
                );
                return lowering.error(DynamicsError::NotASwitch { name, span });
            }
        };
        let lets = shared_lets(&hidden.body);
        let base = lowering.names.open_frame(&lets);
        let mut rates = vec![];
        let result = self.statements(lowering, &hidden.body, &mut Sink::Hidden(&mut rates));
        lowering.names.locals.truncate(base);
        result?;
        for rate in &rates {
            self.check_hidden(lowering, switch, &target.entries, rate)?;
        }
        self.found.hidden.push(Hidden {
            switch,
            rates,
            span: hidden.span,
        });
        Ok(())
    }

    /// A hidden term adds, and vanishes on both sides of the surface.
    fn check_hidden(
        &self,
        lowering: &mut Lowering<'_, 'e>,
        switch: usize,
        entries: &[usize],
        rate: &Rate<'e>,
    ) -> Result<(), Reported> {
        let span = rate.span;
        let switch = &self.switches[switch];
        let low = lowest(&switch.kind);
        let held = variables_of(&[rate.value]);
        let all = entries.iter().map(|&entry| switch.vars[entry]);
        let mut vars: Vec<Expr<'e>> = all.clone().collect();
        vars.retain(|var| var.as_variable().is_some_and(|var| held.contains(&var)));
        // What holds none of them is the same on all sides.
        if vars.is_empty() {
            vars.extend(all.take(1));
        }
        let factor = vars.first().map_or(String::new(), |s| match low == 0.0 {
            true => format!("{s}*(1 - {s})"),
            false => format!("1 - {s}^2"),
        });
        if vars.len() > MAX_ENTRIES {
            return lowering.error(DynamicsError::HiddenEntries {
                name: switch.name.clone(),
                count: vars.len(),
                most: MAX_ENTRIES,
                span,
            });
        }
        // Entries of a vector may be on different sides: corners in the order of counting.
        for corner in 0..1_u32 << vars.len() {
            let value = |position: usize| match (corner >> position) & 1 {
                1 => 1.0,
                _ => low,
            };
            let corner = vars.iter().enumerate().map(|(k, var)| (var, value(k)));
            let sides = corner.clone();
            let sides = sides.filter_map(|(var, value)| Some((var.as_variable()?, value)));
            let proof = prove(rate.value, &sides.collect(), &self.ranges);
            let at = || {
                let all: Vec<String> = corner.map(|(var, at)| format!("{var} = {at}")).collect();
                format!("`{}`", all.join(", "))
            };
            return lowering.error(match proof {
                Proof::Vanishes => continue,
                Proof::Differs(witness) => DynamicsError::HiddenVisible {
                    at: at(),
                    factor,
                    witness,
                    span,
                },
                Proof::Open => DynamicsError::HiddenOpen {
                    at: at(),
                    factor,
                    span,
                },
            });
        }
        Ok(())
    }
}

/// Whether a term is zero wherever its variables are, while switches have the values of a side.
fn prove<'e>(term: Expr<'e>, sides: &FxHashMap<Var, f64>, ranges: &FxHashMap<Var, Range>) -> Proof {
    let range = |var: Var| match (sides.get(&var), ranges.get(&var)) {
        (Some(&value), _) => Range::Among(vec![value]),
        (None, Some(range)) => range.clone(),
        (None, None) => Range::Between(Interval::ALL),
    };
    let vars: Vec<Var> = variables_of(&[term]);
    let whole: Vec<Range> = vars.iter().map(|&var| range(var)).collect();
    if let Some(witness) = counterexample(term, sides, &vars, &whole) {
        return Proof::Differs(witness);
    }
    let hull: Vec<Interval> = whole.iter().map(Range::hull).collect();
    if reduced(term, sides, &vars, &hull).is_zero() {
        return Proof::Vanishes;
    }
    let mut boxes = vec![hull];
    for (place, range) in whole.iter().enumerate() {
        if let Range::Among(values) = range
            && boxes.len() * values.len() <= MAX_BOXES
        {
            let with = |inside: &Vec<Interval>, value: f64| {
                let mut part = inside.clone();
                part[place] = Interval::new(value, value);
                part
            };
            let parts = boxes.iter();
            let parts = parts.flat_map(|inside| values.iter().map(move |&at| with(inside, at)));
            boxes = parts.collect();
        }
    }
    let mut looked_at = 0;
    while let Some(inside) = boxes.pop() {
        if looked_at == MAX_BOXES {
            return Proof::Open;
        }
        looked_at += 1;
        if reduced(term, sides, &vars, &inside).is_zero() {
            continue;
        }
        // The widest side that has two ends, relative to its place.
        let widths = inside.iter().enumerate();
        let relative = |range: &Interval| range.width() / (1.0 + range.magnitude());
        let widths = widths.filter(|(_, range)| range.magnitude().is_finite());
        let widest = widths.max_by(|a, b| relative(a.1).total_cmp(&relative(b.1)));
        let Some((widest, range)) = widest.filter(|(_, range)| range.width() > 0.0) else {
            return Proof::Open;
        };
        let middle = 0.5 * (range.low + range.high);
        for half in [(range.low, middle), (middle, range.high)] {
            let mut part = inside.clone();
            part[widest] = Interval::new(half.0, half.1);
            boxes.push(part);
        }
    }
    Proof::Vanishes
}

/// The term with what is zero all over a box left out.
fn reduced<'e>(
    term: Expr<'e>,
    sides: &FxHashMap<Var, f64>,
    vars: &[Var],
    inside: &[Interval],
) -> Expr<'e> {
    let exprs = term.exprs();
    let mut enclosures: FxHashMap<Expr<'e>, Interval> = FxHashMap::default();
    let image = transform(&[term], &mut |node, rebuilt| {
        let of = |e: &Expr<'e>| enclosures[e];
        // An enclosure, and the size of what it was added up from.
        let (enclosure, size) = match node.node() {
            Node::Constant(value) => (Interval::rounded(value), 0.0),
            Node::Variable(var) => {
                let place = vars.iter().position(|&known| known == var);
                (place.map_or(Interval::ALL, |place| inside[place]), 0.0)
            }
            Node::Sum { constant, terms } => {
                let start = (Interval::rounded(constant), constant.abs());
                terms.iter().fold(start, |(sum, size), (factor, e)| {
                    let term = Interval::rounded(*factor) * of(e);
                    (sum + term, size + term.magnitude())
                })
            }
            Node::Product(factors) => {
                let start = Interval::new(1.0, 1.0);
                let factors = factors.iter();
                let product =
                    factors.fold(start, |product, (e, power)| product * of(e).powi(*power));
                (product, 0.0)
            }
            Node::Unary(function, a) => {
                let size = of(&a).magnitude().max(1.0);
                (of(&a).unary(function), size)
            }
            Node::Binary(function, a, b) => (of(&a).binary(function, of(&b)), 0.0),
        };
        let slack = ROUNDINGS * f64::EPSILON * if size.is_finite() { size } else { 0.0 };
        let is_zero = enclosure == Interval::ZERO
            || enclosure.contains(0.0) && enclosure.magnitude() <= slack;
        let image = match (node.as_variable(), is_zero) {
            (_, true) => exprs.constant(0.0),
            (Some(var), _) => sides.get(&var).map_or(rebuilt, |&at| exprs.constant(at)),
            _ => rebuilt,
        };
        let value = match is_zero || image.is_zero() {
            true => Interval::ZERO,
            false => enclosure,
        };
        enclosures.insert(node, value);
        image
    });
    image[0]
}

/// A point at which the term is not zero, in words.
fn counterexample(
    term: Expr<'_>,
    sides: &FxHashMap<Var, f64>,
    vars: &[Var],
    inside: &[Range],
) -> Option<String> {
    (0..POINTS).find_map(|point| {
        let place = |k: usize| {
            let share = 0.5 + 0.49 * (1.7 * ((k + 1) * (point + 1)) as f64).sin();
            // Farther out from point to point.
            inside[k].place(share, 1.2_f64.powi(point as i32))
        };
        let at = |var: Var| {
            let k = vars.binary_search(&var).unwrap_or(0);
            sides.get(&var).copied().unwrap_or_else(|| place(k))
        };
        let value = term.eval(&at);
        // The same with the switch between its sides tells what is small.
        let between = |var: Var| {
            sides
                .get(&var)
                .map_or_else(|| at(var), |&at| 0.6 * at + 0.1)
        };
        let size = term.eval(&between).abs();
        let farthest = vars.iter().map(|&var| at(var).abs()).fold(1e-3, f64::max);
        if !value.is_finite() || value.abs() <= 1e-9 * size.max(farthest) {
            return None;
        }
        let exprs = term.exprs();
        let others = vars.iter().filter(|var| !sides.contains_key(var));
        let others: Vec<String> = others
            .take(4)
            .map(|&var| format!("{} = {}", exprs.name(var), short(at(var))))
            .collect();
        Some(match others.is_empty() {
            true => short(value),
            false => format!("{} at {}", short(value), others.join(", ")),
        })
    })
}

/// Four digits.
fn short(value: f64) -> String {
    let rounded = format!("{value:.3e}").parse().unwrap_or(value);
    format!("{rounded:?}").trim_end_matches(".0").to_owned()
}
