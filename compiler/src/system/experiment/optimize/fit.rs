//! Reads the settings of a `fit` experiment one by one.
//!
//! minimize Σ ρ(w (q(t_k; p) - y_k))   over free p and free x(0)

use nsd_solver::optimization::least_squares::Loss;
use rustc_hash::FxHashSet;

use super::super::error::ExperimentError;
use super::super::reader::{Reader, unknown_choice};
use super::super::sensed::Sensed;
use super::super::settings::Kept;
use super::super::with::Given;
use super::free::freed;
use super::{Freed, Starts, one_argument};
use crate::expr::Var;
use crate::model::TargetKind;
use crate::model::errors::tables::{Places, TableError};
use crate::source::Span;
use crate::source::table::Sources;
use crate::syntax::{self, Bind, Domain, ExprKind, Ident, Measured, Path, SettingKind};
use crate::system::values::bounds;

/// What a `fit` asks for besides what a simulation does.
#[derive(Clone, Debug, Default)]
pub struct Fit<'e> {
    /// Free parameters, then free initial values.
    pub free: Vec<Freed>,
    /// The same as what runs are differentiated by.
    pub sensed: Vec<Sensed<'e>>,
    /// What was measured.
    pub columns: Vec<Column<'e>>,
    /// ρ.
    pub loss: Loss,
    /// Several starts.
    pub starts: Option<Starts>,
    /// What is given to this run alone, as it is written; none in the run of the experiment.
    pub with: Option<String>,
    /// The data that are compared with this run, by where they stand.
    pub(crate) data: Vec<Span>,
    /// What is given to this run alone.
    own: FxHashSet<Var>,
}

/// `q -> position weight 2;`: a column of measurements.
#[derive(Clone, Debug)]
pub struct Column<'e> {
    /// What is measured, which is recorded.
    pub kept: Kept<'e>,
    /// The name of the column.
    pub name: String,
    /// The file, as it is written.
    pub file: String,
    /// w.
    pub weight: f64,
    /// t_k and y_k, within the horizon.
    pub points: Vec<[f64; 2]>,
    /// Rows without a value.
    pub missing: usize,
    /// Rows before the start or behind the horizon.
    pub outside: usize,
    /// The statement.
    pub span: Span,
}

impl<'e> Fit<'e> {
    /// Which of the data are compared with the run of an experiment.
    pub(crate) fn begin(&mut self, experiment: &syntax::Experiment, given: &Given<'e>) {
        self.own = given.own.clone();
        self.data = experiment.compared().map(|data| data.span).collect();
        let given: Vec<String> = experiment.own().iter().map(Bind::written).collect();
        self.with = (!given.is_empty()).then(|| given.join(", "));
    }

    /// Reads a setting that simulations do not have; `horizon` is known by now.
    pub(crate) fn setting(
        &mut self,
        reader: &mut Reader<'_, 'e>,
        data: &Sources,
        (kind, span): (&SettingKind, Span),
        horizon: Option<f64>,
    ) {
        match kind {
            SettingKind::Free(list) => {
                for (path, domain) in list {
                    self.frees(reader, path, domain.as_ref(), false);
                }
            }
            SettingKind::Initial { free, rows } => {
                for (path, domain) in free {
                    self.frees(reader, path, domain.as_ref(), true);
                }
                if !rows.is_empty() {
                    not_for_fit(reader, "a constraint of `initial`", span);
                }
            }
            SettingKind::Data(given) if !self.data.contains(&given.span) => {}
            SettingKind::Data(given) => {
                for measured in &given.columns {
                    let column = self.column(reader, data, given, measured, horizon);
                    reader.failed |= column.is_none();
                    self.columns.extend(column);
                }
            }
            SettingKind::Starts { count, by, seed } => {
                reader.once("`starts`", span);
                self.starts = reader.starts(count, by.as_ref(), seed.as_ref());
            }
            SettingKind::Value { name, value } if name.name == "loss" => {
                reader.once("`loss`", span);
                self.loss = loss(reader, value).unwrap_or_default();
            }
            other => not_for_fit(reader, &format!("`{}`", other.word()), span),
        }
    }

    fn frees(
        &mut self,
        reader: &mut Reader<'_, 'e>,
        path: &Path,
        domain: Option<&Domain>,
        is_state: bool,
    ) {
        let entries = freed(reader, path, domain, is_state, &self.free);
        for entry in entries.into_iter().flatten() {
            if let Some(free) = entry
                .moving
                .and_then(|ends| reader.values.free.first_in(&ends))
            {
                let what = format!("a bound of `{}`", entry.name);
                reader.error((reader.values).depends_on_free(reader.model, what, free, path.span));
            }
            if self.own.contains(&entry.freed.var) {
                continue;
            }
            self.free.push(entry.freed);
            self.sensed.push(Sensed {
                name: entry.name + if is_state { " at 0" } else { "" },
                var: entry.symbol,
                is_initial: is_state,
                one_sided: false,
                span: path.span,
            });
        }
    }

    fn column(
        &self,
        reader: &mut Reader<'_, 'e>,
        sources: &Sources,
        data: &syntax::Data,
        measured: &Measured,
        horizon: Option<f64>,
    ) -> Option<Column<'e>> {
        let kept = Kept::read(reader, &measured.path)?;
        let is_recorded = matches!(
            kept.kind,
            TargetKind::State(_)
                | TargetKind::Output(_)
                | TargetKind::Algebraic(_)
                | TargetKind::Control(_)
        );
        let span = measured.path.span;
        if !is_recorded || kept.entries.len() != 1 {
            let why = match is_recorded {
                true => format!("it has {} entries, and a column one", kept.entries.len()),
                false => format!("it is a {}, which runs do not record", kept.kind.word()),
            };
            let name = kept.name;
            reader.error(ExperimentError::NotMeasured { name, why, span });
            return None;
        }
        let mut earlier = self.columns.iter();
        let is_same = |other: &&Column<'_>| {
            let pairs = [
                (&other.kept.name, &kept.name),
                (&other.name, &measured.column.name),
                (&other.file, &data.file),
            ];
            pairs.iter().all(|(a, b)| a == b)
        };
        if let Some(other) = earlier.find(is_same) {
            reader.error(ExperimentError::Twice {
                what: format!("column `{}` of `{}`", other.name, kept.name),
                first: other.span,
                second: measured.span,
            });
            return None;
        }
        let weight = match &measured.weight {
            Some(weight) => reader.positive("the weight", weight)?,
            None => 1.0,
        };
        let rows = rows(sources, data, &measured.column);
        let (times, values) = rows.map_err(|error| reader.diags.push(error)).ok()?;
        let all = || times.iter().zip(&values).map(|(&t, &y)| [t, y]);
        let is_inside = |t: f64| t >= 0.0 && horizon.is_none_or(|end| t <= end);
        let inside = all().filter(|&[t, _]| is_inside(t));
        let (points, missing): (Vec<_>, Vec<_>) = inside.partition(|[_, y]| y.is_finite());
        if points.is_empty() {
            reader.error(ExperimentError::NoMeasurements {
                column: measured.column.name.clone(),
                file: data.file.clone(),
                span: measured.column.span,
            });
            return None;
        }
        Some(Column {
            kept,
            name: measured.column.name.clone(),
            file: data.file.clone(),
            weight,
            outside: times.len() - points.len() - missing.len(),
            points,
            missing: missing.len(),
            span: measured.span,
        })
    }

    /// Refuses ranges that move with what is free: what is watched in runs has numbers for bounds.
    fn watched(&self, reader: &mut Reader<'_, 'e>) {
        let quantities = &reader.model.quantities;
        let all = (quantities.states.iter().chain(&quantities.algebraics))
            .chain(quantities.controls.iter().chain(&quantities.inputs))
            .chain(&quantities.connected);
        let moving = all.filter_map(|quantity| {
            let domain = quantity.domain.as_ref()?;
            let ends = (0..quantity.vars.len()).flat_map(|k| bounds(domain, k));
            let free = reader.values.free.first_in(&ends.collect::<Vec<_>>())?;
            let what = format!("the range of `{}`", quantity.name);
            Some((reader.values).depends_on_free(reader.model, what, free, quantity.span))
        });
        for error in moving.collect::<Vec<_>>() {
            reader.error(error);
        }
    }

    /// Everything, once all settings have been read; `None` after an error.
    pub(crate) fn finish(
        self,
        reader: &mut Reader<'_, 'e>,
        experiment: &syntax::Experiment,
    ) -> Option<Self> {
        self.watched(reader);
        let has =
            |is_it: fn(&SettingKind) -> bool| experiment.settings.iter().any(|s| is_it(&s.kind));
        let missing = if !has(|kind| matches!(kind, SettingKind::Data(_))) {
            Some("`data`")
        } else if !has(|kind| matches!(kind, SettingKind::Free(_) | SettingKind::Initial { .. })) {
            Some("`free`")
        } else {
            None
        };
        let missing_here = match missing {
            None if !reader.failed && self.columns.is_empty() => Some("`data`"),
            None if !reader.failed && self.free.is_empty() => Some("number that is free"),
            _ => None,
        };
        let Some(what) = missing.or(missing_here) else {
            return Some(self);
        };
        let own = self.with.as_ref().filter(|_| missing.is_none());
        let name = &experiment.name;
        let (of, span) = match own {
            Some(with) => (format!("the run with {with}"), self.data[0]),
            None => (format!("the fit `{}`", name.name), name.span),
        };
        reader.error(ExperimentError::NothingToFit { of, what, span });
        None
    }
}

/// Times and values of a column.
fn rows(
    sources: &Sources,
    data: &syntax::Data,
    column: &Ident,
) -> Result<(Vec<f64>, Vec<f64>), TableError> {
    let missing = |why: String| TableError::Missing {
        path: data.file.clone(),
        why,
        span: data.span,
    };
    let source = sources.get(&data.file);
    let source = source.ok_or_else(|| missing("files are not read here".into()))?;
    if let Some((tried, reason)) = source.problem() {
        return Err(missing(format!("{tried}: {reason}")));
    }
    let places = Places {
        path: data.span,
        column: column.span,
        fit: data.span,
    };
    let rows = source.measured(&column.name);
    rows.map_err(|fault| TableError::of(fault, &data.file, &column.name, None, places))
}

pub(crate) fn not_for_fit(reader: &mut Reader<'_, '_>, setting: &str, span: Span) {
    reader.error(ExperimentError::NotForFit {
        setting: setting.to_owned(),
        span,
    });
}

/// The words of losses.
pub(crate) const LOSSES: [&str; 2] = ["squared", "huber"];

/// `squared` or `huber(d)`
fn loss(reader: &mut Reader<'_, '_>, value: &syntax::Expr) -> Option<Loss> {
    if matches!(&value.kind, ExprKind::Name(name) if name == "squared") {
        return Some(Loss::Squared);
    }
    if let Some(("huber", bound)) = one_argument(value) {
        return reader
            .positive("the bound of Huber's loss", bound)
            .map(Loss::Huber);
    }
    let word = Ident {
        name: value.to_string(),
        span: value.span,
    };
    reader.error(unknown_choice("loss", &word, &["squared", "huber(d)"]));
    None
}
