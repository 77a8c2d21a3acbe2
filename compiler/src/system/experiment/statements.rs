//! What the settings of an experiment say, read one by one.

use super::animation::Animation;
use super::capabilities::Feature;
use super::error::ExperimentError;
use super::method::{self, Lowering, Method};
use super::optimize::{Draft, Fit, LoopDraft, not_for_fit, not_for_mpc};
use super::perturb::Perturbation;
use super::plot::Plot;
use super::reader::Reader;
use super::sensed::Sensed;
use super::settings::{Kept, Numerics, Recording, Sampling, Stop};
use super::with;
use crate::expr::Expr;
use crate::model::{Model, TargetKind};
use crate::source::Span;
use crate::source::table::Sources;
use crate::syntax::{self, Expect, ExperimentKind, OutputWhen, SettingKind};

const DEFAULT_TOLERANCE: f64 = 1e-8;
/// An optimum has the accuracy of a grid that the user chose.
const DEFAULT_OPTIMIZE_TOLERANCE: f64 = 1e-6;
/// More instants than this are a mistake.
const MOST_INSTANTS: f64 = 1e8;

/// Runs of one experiment.
const MOST_RUNS: f64 = 1e4;

/// What settings have said so far; spans where a later check may complain.
pub(crate) struct Statements<'m, 'e> {
    /// Of an optimization, what only that has.
    pub draft: Option<Draft<'m, 'e>>,
    /// Of a fit, with the files of data that it may name.
    pub fit: Option<Fit<'e>>,
    /// Of a closed loop, what only that has.
    pub closed_loop: Option<LoopDraft>,
    data: &'m Sources,
    pub horizon: Option<(Option<f64>, Span)>,
    pub numerics: Numerics<'e>,
    pub recording: Recording<'e>,
    pub kicks: Option<Perturbation>,
    pub runs: Option<(usize, Span)>,
    pub averages: Option<Span>,
    pub expects: Vec<(Expect, Span)>,
}

impl<'m, 'e> Statements<'m, 'e> {
    /// What holds where nothing is said.
    pub fn new(model: &'m Model<'e>, data: &'m Sources, kind: ExperimentKind) -> Self {
        let (draft, tolerance) = match kind {
            ExperimentKind::Simulate | ExperimentKind::Fit | ExperimentKind::Mpc => {
                (None, DEFAULT_TOLERANCE)
            }
            ExperimentKind::Optimize => (Some(Draft::new(model)), DEFAULT_OPTIMIZE_TOLERANCE),
        };
        Statements {
            draft,
            fit: (kind == ExperimentKind::Fit).then(Fit::default),
            closed_loop: (kind == ExperimentKind::Mpc).then(LoopDraft::default),
            data,
            horizon: None,
            numerics: Numerics {
                tolerance,
                method: Method::Auto,
                lowerings: Vec::new(),
                averages: false,
                stops: Vec::new(),
                closed_loop: None,
            },
            recording: Recording::default(),
            kicks: None,
            runs: None,
            averages: None,
            expects: Vec::new(),
        }
    }

    pub fn setting(&mut self, reader: &mut Reader<'_, 'e>, kind: &SettingKind, span: Span) {
        match kind {
            SettingKind::With(_) | SettingKind::Bad => {}
            SettingKind::Expect(expect) => self.expects.push((expect.clone(), span)),
            SettingKind::Horizon { free, range, value } => {
                reader.once("`horizon`", span);
                self.horizon(reader, *free, range.as_ref(), value.as_ref(), span);
            }
            SettingKind::Value { name, value } if name.name == "tolerance" => {
                reader.once("`tolerance`", span);
                let fits = |x| 0.0 < x && x < 1.0;
                let number = reader.within("the tolerance", value, "between 0 and 1", fits);
                self.numerics.tolerance = number.unwrap_or(self.numerics.tolerance);
            }
            SettingKind::Method { name, options } => {
                reader.once("`method`", span);
                if let Some(draft) = &mut self.draft {
                    draft.method(reader, name, options);
                } else if let Some(chosen) = method::method(reader, name, options) {
                    if self.closed_loop.is_some() && !chosen.kind().is_by_events() {
                        not_for_mpc(reader, &format!("method {}", chosen.kind().word()), span);
                    }
                    self.numerics.method = chosen;
                }
            }
            SettingKind::Lower(names) if self.fit.is_none() && self.closed_loop.is_none() => {
                let named = names
                    .iter()
                    .filter_map(|name| method::lowering(reader, name));
                self.numerics.lowerings.extend(named);
            }
            SettingKind::Output { paths, when } => {
                reader.once("`output`", span);
                if !paths.is_empty() {
                    let kept = paths.iter().filter_map(|path| Kept::read(reader, path));
                    self.recording.outputs = Some(kept.collect());
                }
                let end = self.horizon.and_then(|(end, _)| end);
                let sampling = Sampling::read(reader, when, end);
                self.recording.sampling = sampling.unwrap_or(Sampling::Method);
            }
            SettingKind::Plot(items) => {
                reader.once("`plot`", span);
                self.recording.figures.plot = Some(Plot::read(reader, items));
            }
            SettingKind::Animate(items) => {
                reader.once("`animate`", span);
                self.recording.figures.animation = Animation::read(reader, items);
            }
            kind => self.of_one_kind(reader, kind, span),
        }
    }

    /// A setting of simulations alone, or of optimizations alone.
    fn of_one_kind(&mut self, reader: &mut Reader<'_, 'e>, kind: &SettingKind, span: Span) {
        let is_optimize = self.draft.is_some();
        if let Some(fit) = &mut self.fit {
            let end = self.horizon.and_then(|(end, _)| end);
            return fit.setting(reader, self.data, (kind, span), end);
        }
        if let Some(closed_loop) = &mut self.closed_loop
            && !is_of_loops(kind)
        {
            let end = self.horizon.and_then(|(end, _)| end);
            return closed_loop.setting(reader, (kind, span), end);
        }
        match kind {
            SettingKind::Value { name, .. } if name.name == "runs" && is_optimize => {
                reader.not_for_optimize("runs", span);
            }
            SettingKind::Value { name, value } if name.name == "runs" => {
                reader.once("`runs`", span);
                let runs = reader.count("`runs`", value, MOST_RUNS);
                self.runs = runs.map(|n| (n, span));
            }
            SettingKind::OnChattering => {
                reader.once("`on chattering`", span);
                match is_optimize {
                    true => reader.not_for_optimize("on chattering", span),
                    false => self.averages = Some(span),
                }
            }
            SettingKind::Stop(_) if is_optimize => reader.not_for_optimize("stop when", span),
            SettingKind::Stop(condition) => {
                self.numerics.stops.extend(Stop::read(reader, condition))
            }
            SettingKind::Sensitivity { .. } if is_optimize => {
                reader.not_for_optimize("sensitivity to", span);
            }
            SettingKind::Sensitivity { to, one_sided } => {
                for (path, at_start) in to {
                    let all = &mut self.recording.sensed;
                    Sensed::read(reader, (path, *at_start), *one_sided, all);
                }
            }
            SettingKind::Perturb { every, by, seed } => {
                reader.once("`perturb`", span);
                match is_optimize {
                    true => reader.not_for_optimize("perturb", span),
                    false => self.kicks = reader.kicks(every, by.as_ref(), seed.as_ref(), span),
                }
            }
            kind => match &mut self.draft {
                Some(draft) => {
                    let end = self.horizon.and_then(|(end, _)| end);
                    draft.setting(reader, kind, span, end);
                }
                None => not_for_simulate(reader, kind.word(), span),
            },
        }
    }

    /// The horizon, or the range and the guess of a free one.
    fn horizon(
        &mut self,
        reader: &mut Reader<'_, 'e>,
        free: bool,
        range: Option<&(syntax::Expr, syntax::Expr)>,
        value: Option<&syntax::Expr>,
        span: Span,
    ) {
        match (&mut self.draft, free) {
            (None, true) => {
                self.horizon = Some((None, span));
                match (&self.fit, &self.closed_loop) {
                    (Some(_), _) => not_for_fit(reader, "`horizon free`", span),
                    (_, Some(_)) => not_for_mpc(reader, "horizon free", span),
                    _ => not_for_simulate(reader, "horizon free", span),
                }
            }
            (Some(draft), true) => {
                self.horizon = Some((draft.free_horizon(reader, range, value), span));
            }
            (draft, false) => {
                self.horizon =
                    value.map(|value| (reader.horizon(draft.as_mut(), value), value.span));
            }
        }
    }

    /// What settings must not say together, or leave out.
    pub fn check(&self, reader: &mut Reader<'_, 'e>, experiment: &syntax::Experiment) {
        if self.horizon.is_none() {
            reader.error(ExperimentError::NoHorizon {
                name: experiment.name.name.clone(),
                span: experiment.name.span,
            });
        }
        let disturbs = |setting: &syntax::ExperimentSetting| {
            matches!(setting.kind, SettingKind::Perturb { .. })
        };
        if let Some((_, span)) = (self.runs).filter(|_| !experiment.settings.iter().any(disturbs)) {
            reader.error(ExperimentError::SameRuns { span });
        }
        let fitted = self.fit.iter().flat_map(|fit| &fit.sensed);
        let mut sensed = self.recording.sensed.iter().chain(fitted);
        if let (Some(sensed), Some(why)) = (sensed.next(), self.undifferentiated()) {
            reader.error(ExperimentError::NoSensitivity {
                name: sensed.name.clone(),
                why,
                span: sensed.span,
            });
        }
        let averages = self.numerics.method.kind().takes(Feature::Averages);
        if let Some(span) = self.averages.filter(|_| !averages) {
            reader.error(ExperimentError::NoChattering { span });
        }
        if let (Some(stop), Some(by)) = (self.numerics.stops.first(), self.unstopped()) {
            reader.error(ExperimentError::NoStop {
                by,
                span: stop.span,
            });
        }
    }
}

impl Statements<'_, '_> {
    /// What does not end runs at conditions.
    fn unstopped(&self) -> Option<String> {
        let method = self.numerics.method.kind();
        if !method.takes(Feature::Stops) {
            return Some(format!("method {}", method.word()));
        }
        let is_frozen = self.numerics.lowerings.contains(&Lowering::TimeFreezing);
        is_frozen.then(|| "lower timefreezing".to_owned())
    }

    /// Why runs are not differentiated.
    fn undifferentiated(&self) -> Option<String> {
        let method = self.numerics.method.kind();
        let word = method.word();
        if !method.takes(Feature::Derivatives) {
            return Some(format!("runs by `method {word}` are not differentiated"));
        }
        if self.fit.is_some() && !method.is_by_events() {
            return Some(format!(
                "a fit runs from event to event, not by `method {word}`"
            ));
        }
        let is_frozen = self.numerics.lowerings.contains(&Lowering::TimeFreezing);
        let why = if is_frozen && !method.needs_dcs() {
            "time is frozen where states jump"
        } else if self.numerics.lowerings.contains(&Lowering::Impact) {
            "impulses of `lower impact` come from programs of their own, which are not differentiated"
        } else if self.kicks.is_some() {
            "`perturb` moves the state"
        } else if self.averages.is_some() {
            "`on chattering slide` goes on from what is no limit of runs"
        } else {
            return None;
        };
        Some(why.to_owned())
    }
}

/// Whether closed loops have a setting of simulations.
fn is_of_loops(kind: &SettingKind) -> bool {
    matches!(
        kind,
        SettingKind::Perturb { .. } | SettingKind::Stop(_) | SettingKind::OnChattering
    )
}

fn not_for_simulate(reader: &mut Reader<'_, '_>, setting: &str, span: Span) {
    reader.error(ExperimentError::NotForSimulate {
        setting: setting.to_owned(),
        home: home_of(setting),
        span,
    });
}

/// What a setting belongs to that simulations do not have.
fn home_of(setting: &str) -> &'static str {
    match setting {
        "data" | "loss" => "`fit`",
        "controller" | "sample" | "deadline" => "`mpc`",
        "free" | "starts" => "`optimize` or `fit`",
        _ => "`optimize`",
    }
}

impl Sampling {
    /// What an `output` statement says, within a horizon that may be unknown.
    fn read(reader: &mut Reader<'_, '_>, when: &OutputWhen, horizon: Option<f64>) -> Option<Self> {
        match when {
            OutputWhen::Method => Some(Sampling::Method),
            OutputWhen::Every(period) => {
                let fits = |x: f64| x > 0.0 && horizon.is_none_or(|end| end / x <= MOST_INSTANTS);
                let period = reader.within("the period", period, "positive, and not tiny", fits)?;
                Some(Sampling::Every(period))
            }
            OutputWhen::At(instants) => {
                let (_, mut times) = reader.numbers("the instants", instants)?;
                if let Some(bad) = times
                    .iter()
                    .find(|time| !(**time >= 0.0 && horizon.is_none_or(|end| **time <= end)))
                {
                    let (what, found) = ("every instant".to_owned(), bad.to_string());
                    let expected = "between 0 and the horizon".to_owned();
                    reader.error(ExperimentError::OutOfRange {
                        what,
                        expected,
                        found,
                        span: instants.span,
                    });
                    return None;
                }
                times.sort_by(f64::total_cmp);
                Some(Sampling::At(times))
            }
        }
    }
}

impl<'e> Stop<'e> {
    /// What a `stop when` statement says.
    fn read(reader: &mut Reader<'_, 'e>, condition: &syntax::Expr) -> Option<Self> {
        let guard = reader.model.scope.condition(condition, None, reader.diags);
        reader.failed |= guard.is_none();
        let (guard, span) = (guard?, condition.span);
        Some(Stop {
            name: condition.to_string(),
            guard,
            span,
        })
    }
}

impl<'e> Kept<'e> {
    /// What a path of an `output` statement names.
    pub(super) fn read(reader: &mut Reader<'_, 'e>, path: &syntax::Path) -> Option<Self> {
        let Some(target) = reader.model.scope.target(path, reader.diags) else {
            reader.failed = true;
            return None;
        };
        let model = reader.model;
        let all: Option<&[Expr<'e>]> = match target.kind {
            TargetKind::Switch(k) => Some(&model.switches[k].vars),
            TargetKind::Const | TargetKind::Param(_) | TargetKind::Sliding(_) => None,
            kind => {
                let quantity = model.quantities.get(kind).map(|quantity| &quantity.vars);
                quantity
                    .or_else(|| Some(&model.definitions.get(kind)?.value.data))
                    .map(Vec::as_slice)
            }
        };
        let name = with::path_text(model, path, &target);
        let Some(all) = all else {
            let kind = target.kind.word();
            reader.error(ExperimentError::NoTrajectory {
                name,
                kind,
                span: path.span,
            });
            return None;
        };
        Some(Kept {
            name,
            kind: target.kind,
            entries: target.entries.iter().map(|&entry| all[entry]).collect(),
            shape: target.shape.sizes(),
            span: path.span,
        })
    }
}
