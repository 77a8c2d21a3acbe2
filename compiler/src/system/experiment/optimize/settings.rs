//! Reads the settings of an `optimize` experiment one by one.

use nsd_solver::integrate::tableau::Family;
use nsd_solver::optimization::mpcc::{Relaxation, Steering};
use rustc_hash::FxHashSet;

use super::super::error::ExperimentError;
use super::super::fesd;
use super::super::method::MethodKind;
use super::super::reader::{Reader, out_of_range, unknown_choice};
use super::free::freed;
use super::goal::Words;
use super::kinks;
use super::rows::Constraint;
use super::start::one_argument;
use super::{
    At, Cost, Discretization, Freed, Lengths, MpccOptions, Norm, Optimize, Penalty, Shape, Starts,
    Tied,
};
use crate::expr::{Expr, Var};
use crate::model::{self, Comparison, Model};
use crate::source::Span;
use crate::syntax::{
    self, ExprKind, GuessSource, Ident, Path, Relation, Row, Setting, SettingKind,
};

/// What has been read so far.
pub(crate) struct Draft<'m, 'e> {
    words: Words<'m, 'e>,
    pub(crate) discretization: Discretization,
    /// Whether the grid refines itself, where that is said, or where a grid is given.
    refines: Option<bool>,
    /// Bounds of a free horizon.
    horizon: Option<(f64, f64)>,
    /// Nothing in it after a mistake.
    cost: Option<Option<Cost<'e>>>,
    constraints: Vec<Constraint<'e>>,
    params: Vec<Freed>,
    initial: Vec<Freed>,
    guess: Vec<(Var, Expr<'e>)>,
    sources: Vec<GuessSource>,
    starts: Option<Starts>,
    options: MpccOptions,
}

/// Where constraints hold.
pub(crate) const INSTANTS: [At; 3] = [At::Nodes, At::Elements, At::Intervals];
/// Shapes of controls.
pub(crate) const SHAPES: [(&str, Shape); 2] =
    [("constant", Shape::Constant), ("linear", Shape::Linear)];
/// Elements without detection of switches.
const PLAIN: &str = "plain";
/// Grids, and whether they refine themselves.
pub(crate) const GRIDS: [(&str, bool); 2] = [("auto", true), ("fixed", false)];
/// The method of `optimize`.
pub const OPTIMIZER: &str = "mpcc";
pub(crate) const OPTIONS: [&str; 8] = [
    "relaxation",
    "steering",
    "path",
    "sigma",
    "cross",
    "equilibration",
    "optimality",
    "max_iterations",
];
pub(crate) const RELAXATIONS: [(&str, Relaxation); 10] = [
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
pub(crate) const STEERINGS: [(&str, Steering); 3] = [
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

pub(crate) const PATHS: [(&str, bool); 2] = [("coupled", false), ("sequential", true)];

const MOST_INTERVALS: f64 = 1e6;
const MOST_ITERATIONS: f64 = 1e9;
/// Relaxations that relax something, and leave numbers digits.
const LEAST_SIGMA: f64 = 1e-9;
const LARGEST_SIGMA: f64 = 1e9;
/// Optimality errors above rounding, with which a certificate can tell what is active.
const LEAST_ERROR: f64 = 1e-15;
const LARGEST_ERROR: f64 = 1e-6;

impl<'m, 'e> Draft<'m, 'e> {
    /// The defaults.
    pub fn new(model: &'m Model<'e>) -> Self {
        Draft {
            words: Words::new(model),
            discretization: Discretization {
                intervals: 20,
                by_default: true,
                elements: 2,
                detects: true,
                scheme: (Family::RadauIia, 3),
                controls: Shape::Constant,
                lengths: Lengths::Equal,
                refines: true,
            },
            refines: None,
            horizon: None,
            cost: None,
            constraints: Vec::new(),
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
            SettingKind::FreeIntervals(value) => {
                reader.once("`intervals`", span);
                self.refines.get_or_insert(false);
                self.discretization.by_default = false;
                let count = reader.count("`intervals`", value, MOST_INTERVALS);
                self.discretization.intervals = count.unwrap_or(1);
                self.discretization.lengths = match count {
                    Some(2..) => Lengths::Free,
                    _ => Lengths::Equal,
                };
            }
            SettingKind::Value { name, value } => self.value(reader, name, value, span),
            SettingKind::SubjectTo { rows, at, soft } => {
                let at = at
                    .as_ref()
                    .map_or(Some(At::Elements), |at| instants(reader, at));
                if let Some(at) = at {
                    self.rows(reader, rows, at, soft.as_ref());
                }
            }
            SettingKind::Final { rows, soft } => {
                self.rows(reader, rows, At::End, soft.as_ref());
            }
            SettingKind::Initial { free, rows } => {
                for (path, domain) in free {
                    let freed = self.freed(reader, path, domain.as_ref(), true);
                    self.initial.extend(freed.into_iter().flatten());
                }
                self.rows(reader, rows, At::Start, None);
            }
            SettingKind::Free(list) => {
                for (path, domain) in list {
                    let freed = self.freed(reader, path, domain.as_ref(), false);
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

    /// `horizon free in [lo, hi] = guess`: bounds, and where to start. Bounds that hold free parameters are
    /// constraints.
    pub fn free_horizon(
        &mut self,
        reader: &mut Reader<'_, 'e>,
        range: Option<&(syntax::Expr, syntax::Expr)>,
        guess: Option<&syntax::Expr>,
    ) -> Option<f64> {
        let (mut lower, mut upper) = (0.0, f64::INFINITY);
        self.horizon = Some((lower, upper));
        if let Some((shortest, longest)) = range {
            let what = "the shortest horizon";
            let (low, first) = reader.follows(what, shortest, "0 or more", |x| x >= 0.0)?;
            let (what, expected) = ("the longest horizon", format!("above {low}"));
            let (high, last) = reader.follows(what, longest, &expected, |x| x > low)?;
            let is_free = |e: Expr<'e>| reader.values.free.first_in(&[e]).is_some();
            let number =
                |e: Expr<'e>, number: f64, open: f64| if is_free(e) { open } else { number };
            self.horizon = Some((number(first, low, lower), number(last, high, upper)));
            if is_free(first) || is_free(last) {
                let members = vec![first, reader.model.time, last];
                let span = shortest.span.to(longest.span);
                self.relate(At::End, members, Relation::LessEqual, span);
            }
            (lower, upper) = (low, high);
        }
        match guess {
            Some(guess) => {
                let expected = format!("positive, and in [{lower}, {upper}]");
                let fits = |x: f64| x > 0.0 && x.is_finite() && (lower..=upper).contains(&x);
                let found = reader.follows("the guess of the horizon", guess, &expected, fits);
                found.map(|(guess, _)| guess)
            }
            None if upper.is_finite() => Some(0.5 * (lower + upper)),
            None => Some(lower.max(1.0)),
        }
    }

    /// Initial values of states that are computed from what is optimized, without those that are free themselves.
    fn tied(&self, reader: &Reader<'_, 'e>) -> Vec<Tied<'e>> {
        let states: FxHashSet<Var> = (reader.model.state_vars())
            .filter_map(Expr::as_variable)
            .collect();
        let is_free = |var: Var| self.initial.iter().any(|freed| freed.var == var);
        let initial = reader.values.free.initial.iter();
        let decides = |value: Expr<'e>| reader.values.free.decided_in(&[value]).is_some();
        let tied = initial
            .filter(|(var, value, _)| states.contains(var) && !is_free(*var) && decides(*value));
        tied.map(|&(var, value, span)| Tied { var, value, span })
            .collect()
    }

    /// Constraints a R b R c between expressions of the model.
    pub fn relate(&mut self, at: At, members: Vec<Expr<'e>>, relation: Relation, span: Span) {
        let relations = vec![relation; members.len() - 1];
        let comparison = Comparison {
            members,
            relations,
            span,
        };
        self.constraints.push(Constraint {
            at,
            comparison,
            penalty: None,
        });
    }

    /// What is freed, within bounds; those that hold free parameters are constraints.
    fn freed(
        &mut self,
        reader: &mut Reader<'_, 'e>,
        path: &Path,
        domain: Option<&syntax::Domain>,
        is_state: bool,
    ) -> Option<Vec<Freed>> {
        let earlier: Vec<Freed> = self.params.iter().chain(&self.initial).copied().collect();
        let entries = freed(reader, path, domain, is_state, &earlier)?;
        let freed = entries.into_iter().map(|entry| {
            if let Some([lower, upper]) = entry.moving {
                let members = vec![lower, entry.symbol, upper];
                self.relate(At::Start, members, Relation::LessEqual, path.span);
            }
            entry.freed
        });
        Some(freed.collect())
    }

    fn rows(
        &mut self,
        reader: &mut Reader<'_, 'e>,
        rows: &[Row],
        at: At,
        soft: Option<&syntax::Soft>,
    ) {
        let penalty = soft.map(|soft| penalty(reader, soft));
        if let (Some(soft), Some(Some(Penalty { weight, .. }))) = (soft, penalty)
            && reader.values.free.first_in(&[weight]).is_some()
        {
            let members = vec![weight.exprs().constant(0.0), weight];
            self.relate(At::Start, members, Relation::LessEqual, soft.weight.span);
        }
        let found = reader.comparisons(&self.words, rows, at);
        let found = found.into_iter().map(|(at, comparison)| Constraint {
            at,
            comparison,
            penalty: penalty.flatten(),
        });
        self.constraints.extend(found);
    }

    fn value(
        &mut self,
        reader: &mut Reader<'_, 'e>,
        name: &Ident,
        value: &syntax::Expr,
        span: Span,
    ) {
        let grid = &mut self.discretization;
        match name.name.as_str() {
            "intervals" => {
                reader.once("`intervals`", span);
                self.refines.get_or_insert(false);
                grid.by_default = false;
                if let Some((count, lengths)) = intervals(reader, value) {
                    (grid.intervals, grid.lengths) = (count, lengths);
                }
            }
            "elements" => {
                reader.once("`elements`", span);
                self.refines.get_or_insert(false);
                let (count, detects) = elements(reader, value);
                grid.elements = count.unwrap_or(grid.elements);
                grid.detects = detects;
            }
            "scheme" => {
                reader.once("`scheme`", span);
                grid.scheme = fesd::scheme(reader, value).unwrap_or(grid.scheme);
            }
            "controls" => {
                reader.once("`controls`", span);
                let shape = fesd::word(reader, "shape of controls", value, &SHAPES);
                grid.controls = shape.unwrap_or(grid.controls);
            }
            "grid" => {
                reader.once("`grid`", span);
                let chosen = fesd::word(reader, "grid", value, &GRIDS);
                self.refines = chosen.or(self.refines);
            }
            "minimize" => {
                reader.once("`minimize`", span);
                self.cost = Some(reader.cost(&self.words, value));
            }
            _ => reader.not_for_optimize(&name.name, span),
        }
    }

    /// `method mpcc { .. }`
    pub fn method(&mut self, reader: &mut Reader<'_, 'e>, name: &Ident, options: &[Setting]) {
        if name.name == "auto" && options.is_empty() {
            return;
        }
        if name.name != OPTIMIZER {
            let methods = ["auto", OPTIMIZER];
            let mut error = unknown_choice("method of optimal control", name, &methods);
            if let ExperimentError::UnknownChoice { help, .. } = &mut error
                && MethodKind::named(&name.name).is_some()
            {
                let elsewhere = format!(
                    "`method {}` runs a `simulate` experiment, in which `with` gives the controls",
                    name.name
                );
                *help = Some(elsewhere.into());
            }
            return reader.error(error);
        }
        reader.once_each(options);
        options
            .iter()
            .for_each(|option| self.options.read(reader, option));
    }

    /// Everything, once all settings have been read; `None` after an error.
    pub fn finish(
        mut self,
        reader: &mut Reader<'_, 'e>,
        experiment: &syntax::Experiment,
    ) -> Option<Optimize<'e>> {
        self.ranges(reader);
        let mut rows = reader.bounded(&self.constraints);
        for row in &mut rows {
            row.name = self.words.text(row.value);
        }
        let Some(cost) = self.cost.take() else {
            reader.error(ExperimentError::NoCost {
                name: experiment.name.name.clone(),
                span: experiment.name.span,
            });
            return None;
        };
        let tied = self.tied(reader);
        Some(Optimize {
            discretization: Discretization {
                refines: self.refines.unwrap_or(true),
                ..self.discretization
            },
            horizon: self.horizon,
            integrals: self.words.into_integrals(),
            cost: kinks::soften(&cost?, &mut rows),
            rows,
            tied,
            params: self.params,
            initial: self.initial,
            guess: self.guess,
            sources: self.sources,
            starts: self.starts,
            options: self.options,
        })
    }
}

impl MpccOptions {
    /// Takes one of them; what is wrong with it is told, and leaves it as it is.
    fn read(&mut self, reader: &mut Reader<'_, '_>, option: &Setting) {
        let value = &option.value;
        match option.name.name.as_str() {
            "relaxation" => {
                let chosen = fesd::word(reader, "relaxation", value, &RELAXATIONS);
                self.relaxation = chosen.unwrap_or(self.relaxation);
            }
            "steering" => {
                let chosen = fesd::word(reader, "steering", value, &STEERINGS);
                self.steering = chosen.unwrap_or(self.steering);
            }
            "path" => {
                let chosen = fesd::word(reader, "path", value, &PATHS);
                self.is_sequential = chosen.unwrap_or(self.is_sequential);
            }
            "sigma" => {
                let fits = |x: f64| (LEAST_SIGMA..=LARGEST_SIGMA).contains(&x);
                let range = format!("in [{LEAST_SIGMA:e}, {LARGEST_SIGMA:e}]");
                self.sigma = reader.within("`sigma`", value, &range, fits);
            }
            "cross" => {
                let cross = fesd::word(reader, "sum", value, &fesd::CROSS);
                self.cross = cross.unwrap_or(self.cross);
            }
            "equilibration" => {
                let chosen = fesd::equilibration(reader, value);
                self.equilibration = chosen.unwrap_or(self.equilibration);
            }
            "optimality" => {
                let fits = |x: f64| (LEAST_ERROR..=LARGEST_ERROR).contains(&x);
                let range = format!("in [{LEAST_ERROR:e}, {LARGEST_ERROR:e}]");
                let optimality = reader.within("`optimality`", value, &range, fits);
                self.optimality = optimality.unwrap_or(self.optimality);
            }
            "max_iterations" => {
                self.max_iterations = reader.count("`max_iterations`", value, MOST_ITERATIONS);
            }
            _ => reader.error(unknown_choice("option", &option.name, &OPTIONS)),
        }
    }
}

/// A number of equal control intervals, or a list of their lengths.
fn intervals(reader: &mut Reader<'_, '_>, value: &syntax::Expr) -> Option<(usize, Lengths)> {
    let (shape, numbers) = reader.numbers("`intervals`", value)?;
    if shape == model::Shape::Scalar {
        let count = reader.count("`intervals`", value, MOST_INTERVALS)?;
        return Some((count, Lengths::Equal));
    }
    let longest = numbers.iter().copied().fold(0.0, f64::max);
    let shortest = longest / MOST_INTERVALS;
    let fits = |length: &f64| *length > 0.0 && (shortest..=longest).contains(length);
    let is_list =
        matches!(shape, model::Shape::Vector(n) if (1.0..=MOST_INTERVALS).contains(&(n as f64)));
    if !is_list || !longest.is_finite() || !numbers.iter().all(fits) {
        let expected = format!(
            "up to {MOST_INTERVALS} positive lengths, the longest at most {MOST_INTERVALS} times the shortest"
        );
        reader.error(out_of_range("`intervals`", value, &numbers, &expected));
        return None;
    }
    let lengths = match numbers.iter().all(|length| *length == longest) {
        true => Lengths::Equal,
        false => Lengths::Given(numbers.clone()),
    };
    Some((numbers.len(), lengths))
}

/// `3` with switches at their ends, `plain(3)` or `plain` without.
fn elements(reader: &mut Reader<'_, '_>, value: &syntax::Expr) -> (Option<usize>, bool) {
    let (count, detects) = match (&value.kind, one_argument(value)) {
        (ExprKind::Name(word), _) if word == PLAIN => return (Some(1), false),
        (_, Some((PLAIN, count))) => (count, false),
        (ExprKind::Call(head, _), _) if head.to_string() == PLAIN => {
            reader.error(ExperimentError::OutOfRange {
                what: "`elements`".to_owned(),
                expected: "`plain(n)`, with one whole number".to_owned(),
                found: format!("`{value}`"),
                span: value.span,
            });
            return (None, false);
        }
        _ => (value, true),
    };
    let count = reader.count("`elements`", count, fesd::MOST_ELEMENTS);
    (count, detects)
}

fn instants(reader: &mut Reader<'_, '_>, at: &Ident) -> Option<At> {
    let found = INSTANTS.into_iter().find(|known| known.as_str() == at.name);
    if found.is_none() {
        reader.error(unknown_choice("instants", at, &INSTANTS.map(At::as_str)));
    }
    found
}

/// `soft l1 weight 1e3`
fn penalty<'e>(reader: &mut Reader<'_, 'e>, soft: &syntax::Soft) -> Option<Penalty<'e>> {
    let known = Norm::ALL.iter().find(|known| known.0 == soft.norm.name);
    if known.is_none() {
        let words = Norm::ALL.map(|known| known.0);
        reader.error(unknown_choice("norm of violations", &soft.norm, &words));
    }
    let fits = |weight: f64| weight >= 0.0 && weight.is_finite();
    let (_, weight) = reader.follows("the weight", &soft.weight, "0 or more", fits)?;
    Some(Penalty {
        norm: known?.1,
        weight,
    })
}

impl<'e> Reader<'_, 'e> {
    /// `horizon 2*p;`: where p is free, T is, and T = 2 p is a constraint.
    pub(crate) fn horizon(
        &mut self,
        draft: Option<&mut Draft<'_, 'e>>,
        value: &syntax::Expr,
    ) -> Option<f64> {
        let fits = |x: f64| x > 0.0 && x.is_finite();
        let Some(draft) = draft else {
            return self.within("the horizon", value, "a positive number", fits);
        };
        let (number, end) = self.follows("the horizon", value, "a positive number", fits)?;
        if self.values.free.first_in(&[end]).is_some() {
            draft.horizon = Some((0.0, f64::INFINITY));
            let members = vec![self.model.time, end];
            draft.relate(At::End, members, Relation::Equal, value.span);
        }
        Some(number)
    }

    pub(crate) fn not_for_optimize(&mut self, setting: &str, span: Span) {
        self.error(ExperimentError::NotForOptimize {
            setting: setting.to_owned(),
            span,
        });
    }
}
