//! Reads the settings of an `optimize` experiment one by one.

use nsd_solver::mpcc::{Relaxation, Steering};
use nsd_solver::tableau::Family;
use rustc_hash::FxHashSet;

use super::super::{ExperimentError, Reader, fesd, method, unknown_choice, with};
use super::goal::Words;
use super::{At, Freed, MpccOptions, Optimize, Shape, Starts};
use crate::expr::{Expr, Var};
use crate::model::{Comparison, Domain, Model, Quantity, TargetKind};
use crate::source::Span;
use crate::syntax::{self, GuessSource, Ident, Path, Row, Setting, SettingKind};

/// What has been read so far.
pub(in super::super) struct Draft<'m, 'e> {
    words: Words<'m, 'e>,
    intervals: usize,
    elements: usize,
    scheme: (Family, usize),
    controls: Shape,
    /// Bounds of a free horizon.
    pub horizon: Option<(f64, f64)>,
    cost: Option<(Option<Expr<'e>>, Span)>,
    comparisons: Vec<(At, Comparison<'e>)>,
    params: Vec<Freed>,
    initial: Vec<Freed>,
    guess: Vec<(Var, Expr<'e>)>,
    sources: Vec<GuessSource>,
    starts: Option<Starts>,
    options: MpccOptions,
}

const INSTANTS: [&str; 3] = ["nodes", "elements", "intervals"];
const SHAPES: [(&str, Shape); 2] = [("constant", Shape::Constant), ("linear", Shape::Linear)];
const OPTIONS: [&str; 5] = ["relaxation", "steering", "path", "cross", "equilibration"];
const RELAXATIONS: [(&str, Relaxation); 10] = [
    ("scholtes", Relaxation::Scholtes),
    ("fischer_burmeister", Relaxation::FischerBurmeister),
    ("natural_residual", Relaxation::NaturalResidual),
    ("chen_chen_kanzow", Relaxation::ChenChenKanzow),
    ("two_sided", Relaxation::TwoSided),
    ("lin_fukushima", Relaxation::LinFukushima),
    ("kanzow_schwartz", Relaxation::KanzowSchwartz),
    ("kadrani", Relaxation::Kadrani),
    (
        "steffensen_ulbrich",
        Relaxation::SteffensenUlbrichTrigonometric,
    ),
    (
        "steffensen_ulbrich_polynomial",
        Relaxation::SteffensenUlbrichPolynomial,
    ),
];
const STEERINGS: [(&str, Steering); 3] = [
    ("direct", Steering::Direct),
    ("l1", Steering::L1),
    ("linf", Steering::LInfinity),
];
/// The word of a relaxation.
pub fn relaxation_word(relaxation: Relaxation) -> &'static str {
    let entry = RELAXATIONS.iter().find(|entry| entry.1 == relaxation);
    entry.map_or("", |entry| entry.0)
}

/// The word of a steering.
pub fn steering_word(steering: Steering) -> &'static str {
    let entry = STEERINGS.iter().find(|entry| entry.1 == steering);
    entry.map_or("", |entry| entry.0)
}

const PATHS: [(&str, bool); 2] = [("coupled", false), ("sequential", true)];

const MOST_INTERVALS: f64 = 1e6;

impl<'m, 'e> Draft<'m, 'e> {
    /// The defaults.
    pub fn new(model: &'m Model<'e>) -> Self {
        Draft {
            words: Words::new(model),
            intervals: 20,
            elements: 2,
            scheme: (Family::RadauIia, 3),
            controls: Shape::Constant,
            horizon: None,
            cost: None,
            comparisons: Vec::new(),
            params: Vec::new(),
            initial: Vec::new(),
            guess: Vec::new(),
            sources: Vec::new(),
            starts: None,
            options: MpccOptions::default(),
        }
    }

    /// Reads a setting that simulations do not have; `horizon` is known by now.
    pub fn setting(
        &mut self,
        reader: &mut Reader<'_, 'e>,
        kind: &SettingKind,
        span: Span,
        horizon: Option<f64>,
    ) {
        match kind {
            SettingKind::Value { name, value } => self.value(reader, name, value, span),
            SettingKind::SubjectTo { rows, at } => {
                let at = at
                    .as_ref()
                    .map_or(Some(At::Elements), |at| instants(reader, at));
                if let Some(at) = at {
                    self.rows(reader, rows, at);
                }
            }
            SettingKind::Final(rows) => self.rows(reader, rows, At::End),
            SettingKind::Initial { free, rows } => {
                for (path, domain) in free {
                    let freed = reader.freed(path, domain.as_ref(), true);
                    self.initial.extend(freed.into_iter().flatten());
                }
                self.rows(reader, rows, At::Start);
            }
            SettingKind::Free(list) => {
                for (path, domain) in list {
                    let freed = reader.freed(path, domain.as_ref(), false);
                    self.params.extend(freed.into_iter().flatten());
                }
            }
            SettingKind::Guess { from, binds } => {
                self.sources.extend(from.iter().cloned());
                for bind in binds {
                    let guess = reader.guess(bind, horizon.unwrap_or(1.0));
                    self.guess.extend(guess.into_iter().flatten());
                }
            }
            SettingKind::Starts { count, by, seed } => {
                reader.once("`starts`", span);
                self.starts = reader.starts(count, by.as_ref(), seed.as_ref());
            }
            _ => {}
        }
    }

    fn rows(&mut self, reader: &mut Reader<'_, 'e>, rows: &[Row], at: At) {
        let found = reader.comparisons(&self.words, rows).into_iter().flatten();
        self.comparisons.extend(found.map(|row| (at, row)));
    }

    fn value(
        &mut self,
        reader: &mut Reader<'_, 'e>,
        name: &Ident,
        value: &syntax::Expr,
        span: Span,
    ) {
        match name.name.as_str() {
            "intervals" => {
                reader.once("`intervals`", span);
                let count = reader.count("`intervals`", value, MOST_INTERVALS);
                self.intervals = count.unwrap_or(self.intervals);
            }
            "elements" => {
                reader.once("`elements`", span);
                let count = reader.count("`elements`", value, fesd::MOST_ELEMENTS);
                self.elements = count.unwrap_or(self.elements);
            }
            "scheme" => {
                reader.once("`scheme`", span);
                self.scheme = fesd::scheme(reader, value).unwrap_or(self.scheme);
            }
            "controls" => {
                reader.once("`controls`", span);
                let shape = fesd::word(reader, "shape of controls", value, &SHAPES);
                self.controls = shape.unwrap_or(self.controls);
            }
            "minimize" => {
                reader.once("`minimize`", span);
                self.cost = Some((reader.cost(&self.words, value), value.span));
            }
            _ => reader.not_for_optimize(&name.name, span),
        }
    }

    /// `method mpcc { .. }`
    pub fn method(&mut self, reader: &mut Reader<'_, 'e>, name: &Ident, options: &[Setting]) {
        if name.name == "auto" && options.is_empty() {
            return;
        }
        if name.name != "mpcc" {
            let methods = ["auto", "mpcc"];
            return reader.error(unknown_choice("method of optimal control", name, &methods));
        }
        method::once(reader, options);
        for option in options {
            let value = &option.value;
            match option.name.name.as_str() {
                "relaxation" => {
                    let chosen = fesd::word(reader, "relaxation", value, &RELAXATIONS);
                    self.options.relaxation = chosen.unwrap_or(self.options.relaxation);
                }
                "steering" => {
                    let chosen = fesd::word(reader, "steering", value, &STEERINGS);
                    self.options.steering = chosen.unwrap_or(self.options.steering);
                }
                "path" => {
                    let chosen = fesd::word(reader, "path", value, &PATHS);
                    self.options.is_sequential = chosen.unwrap_or(self.options.is_sequential);
                }
                "cross" => {
                    let cross = fesd::word(reader, "sum", value, &fesd::CROSS);
                    self.options.cross = cross.unwrap_or(self.options.cross);
                }
                "equilibration" => {
                    let chosen = fesd::equilibration(reader, value);
                    self.options.equilibration = chosen.unwrap_or(self.options.equilibration);
                }
                _ => reader.error(unknown_choice("option", &option.name, &OPTIONS)),
            }
        }
    }

    /// Everything, once all settings have been read; `None` after an error.
    pub fn finish(
        self,
        reader: &mut Reader<'_, 'e>,
        experiment: &syntax::Experiment,
    ) -> Option<Optimize<'e>> {
        let decided: FxHashSet<Var> = self.params.iter().map(|freed| freed.var).collect();
        let rows = reader.bounded(&self.comparisons, &decided);
        let Some((cost, cost_span)) = self.cost else {
            reader.error(ExperimentError::NoCost {
                name: experiment.name.name.clone(),
                span: experiment.name.span,
            });
            return None;
        };
        Some(Optimize {
            intervals: self.intervals,
            elements: self.elements,
            scheme: self.scheme,
            controls: self.controls,
            horizon: self.horizon,
            integrals: self.words.into_integrals(),
            cost: cost?,
            cost_span,
            rows,
            params: self.params,
            initial: self.initial,
            guess: self.guess,
            sources: self.sources,
            starts: self.starts,
            options: self.options,
        })
    }
}

fn instants(reader: &mut Reader<'_, '_>, at: &Ident) -> Option<At> {
    match at.name.as_str() {
        "nodes" => Some(At::Nodes),
        "elements" => Some(At::Elements),
        "intervals" => Some(At::Intervals),
        _ => {
            reader.error(unknown_choice("instants", at, &INSTANTS));
            None
        }
    }
}

impl<'e> Reader<'_, 'e> {
    /// `horizon free in [lo, hi] = guess`: the bounds, and where to start.
    pub(in super::super) fn free_horizon(
        &mut self,
        range: Option<&(syntax::Expr, syntax::Expr)>,
        guess: Option<&syntax::Expr>,
    ) -> Option<((f64, f64), f64)> {
        let (lower, upper) = match range {
            None => (0.0, f64::INFINITY),
            Some((lower, upper)) => {
                let low = self.within("the shortest horizon", lower, "0 or more", |x| x >= 0.0)?;
                let expected = format!("above {low}");
                let high = self.within("the longest horizon", upper, &expected, |x| x > low)?;
                (low, high)
            }
        };
        let guess = match guess {
            Some(guess) => {
                let expected = format!("positive, and in [{lower}, {upper}]");
                let fits = |x: f64| x > 0.0 && x.is_finite() && (lower..=upper).contains(&x);
                self.within("the guess of the horizon", guess, &expected, fits)?
            }
            None if upper.is_finite() => 0.5 * (lower + upper),
            None => lower.max(1.0),
        };
        Some(((lower, upper), guess))
    }

    pub(in super::super) fn not_for_optimize(&mut self, setting: &str, span: Span) {
        self.error(ExperimentError::NotForOptimize {
            setting: setting.to_owned(),
            span,
        });
    }

    /// `x[1] free in [0, 1]`, or `k` or `k in [0, 1]` of parameters.
    fn freed(
        &mut self,
        path: &Path,
        domain: Option<&syntax::Domain>,
        is_state: bool,
    ) -> Option<Vec<Freed>> {
        let model = self.model;
        let Some(target) = model.scope.target(path, self.diags) else {
            self.failed = true;
            return None;
        };
        let quantity: &Quantity<'e> = match target.kind {
            TargetKind::State(k) if is_state => &model.states[k],
            TargetKind::Param(k) if !is_state => &model.params[k],
            kind => {
                self.error(ExperimentError::NotFree {
                    name: with::path_text(model, path, &target),
                    kind: kind.word(),
                    expected: if is_state { "state" } else { "param" },
                    span: path.span,
                });
                return None;
            }
        };
        let declared = |entry: usize| match &quantity.domain {
            Some(Domain::Box(lower, upper)) => {
                let both = [lower.data[entry], upper.data[entry]];
                self.values
                    .numbers_of(model, &both)
                    .ok()
                    .map(|b| (b[0], b[1]))
            }
            _ => None,
        };
        let declared: Vec<Option<(f64, f64)>> =
            target.entries.iter().map(|&e| declared(e)).collect();
        let given = match domain {
            None => None,
            Some(syntax::Domain::Box(lower, upper)) => {
                let lower = self.entries("the lower bound", lower, target.shape)?;
                let upper = self.entries("the upper bound", upper, target.shape)?;
                Some((lower, upper))
            }
            Some(syntax::Domain::Set(_)) => {
                self.error(ExperimentError::OutOfRange {
                    what: "what is free".to_owned(),
                    expected: "in an interval `[lo, hi]`".to_owned(),
                    found: "a finite set".to_owned(),
                    span: path.span,
                });
                return None;
            }
        };
        let mut freed = Vec::new();
        for (place, (&entry, declared)) in target.entries.iter().zip(declared).enumerate() {
            let (mut lower, mut upper) = declared.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
            if let Some((low, high)) = &given {
                (lower, upper) = (lower.max(low[place]), upper.min(high[place]));
            }
            if lower > upper {
                self.error(ExperimentError::NeverHolds {
                    why: format!("no number is in [{lower}, {upper}]"),
                    span: path.span,
                });
                return None;
            }
            let var = quantity.vars[entry].as_variable()?;
            freed.push(Freed { var, lower, upper });
        }
        Some(freed)
    }

    /// Numbers in a shape.
    fn entries(
        &mut self,
        what: &str,
        value: &syntax::Expr,
        shape: crate::model::Shape,
    ) -> Option<Vec<f64>> {
        let tensor = self
            .model
            .scope
            .expr_as(value, shape, what, None, self.diags);
        let Some(tensor) = tensor else {
            self.failed = true;
            return None;
        };
        match self.values.numbers_of(self.model, &tensor.data) {
            Ok(numbers) => Some(numbers),
            Err(cause) => {
                self.error(ExperimentError::NotANumber {
                    what: what.to_owned(),
                    cause,
                    span: value.span,
                });
                None
            }
        }
    }
}
