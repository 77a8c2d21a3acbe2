//! `sensitivity to mu, x[1] at 0 one_sided;`

use super::error::ExperimentError;
use super::reader::Reader;
use super::with;
use crate::expr::Expr;
use crate::model::TargetKind;
use crate::source::Span;
use crate::syntax::{Experiment, Path, SettingKind};

/// A number that a run is differentiated by.
#[derive(Clone, Debug)]
pub struct Sensed<'e> {
    /// `mu`, `x[1] at 0`
    pub name: String,
    /// The parameter, or the state whose initial value it is.
    pub var: Expr<'e>,
    /// Whether it is an initial value.
    pub is_initial: bool,
    /// Whether it is from both sides where there is no derivative.
    pub one_sided: bool,
    /// The path.
    pub span: Span,
}

impl<'e> Sensed<'e> {
    /// Adds the entries of what is named.
    pub(super) fn read(
        reader: &mut Reader<'_, 'e>,
        (path, at_start): (&Path, bool),
        one_sided: bool,
        all: &mut Vec<Self>,
    ) {
        let model = reader.model;
        let Some(target) = model.scope.target(path, reader.diags) else {
            reader.failed = true;
            return;
        };
        let quantity = match (target.kind, at_start) {
            (TargetKind::Param(k), false) => &model.quantities.params[k],
            (TargetKind::State(k), true) => &model.quantities.states[k],
            (kind, _) => {
                reader.error(ExperimentError::NotSensed {
                    name: with::path_text(model, path, &target),
                    kind: kind.word(),
                    span: path.span,
                });
                return;
            }
        };
        let at = if at_start { " at 0" } else { "" };
        for &entry in &target.entries {
            let sensed = Sensed {
                name: quantity.shape.entry_name(&quantity.name, entry) + at,
                var: quantity.vars[entry],
                is_initial: at_start,
                one_sided,
                span: path.span,
            };
            let is_it = |known: &Self| (known.var, known.is_initial) == (sensed.var, at_start);
            match all.iter().any(is_it) {
                true => reader.error(ExperimentError::SensedTwice {
                    name: sensed.name,
                    span: path.span,
                }),
                false => all.push(sensed),
            }
        }
    }
}

impl Experiment {
    /// Lets runs be differentiated as is asked for: the parameters stay open by which they are.
    pub(crate) fn open_sensed(&mut self) {
        self.differentiates = true;
        let params = self.sensed().filter(|(_, at_start)| !at_start);
        let params: Vec<Path> = params.map(|(path, _)| path.clone()).collect();
        self.open.extend(params);
    }

    /// Leaves out what runs are differentiated by.
    #[cfg(feature = "cli")]
    pub(crate) fn forget_sensed(&mut self) {
        self.settings
            .retain(|setting| !matches!(setting.kind, SettingKind::Sensitivity { .. }));
    }

    /// Whether the run is to be differentiated.
    pub(crate) fn is_sensed(&self) -> bool {
        self.sensed().next().is_some()
    }

    /// Whether the run is to be differentiated by what is named there.
    pub(super) fn senses(&self, span: Span) -> bool {
        self.sensed().any(|(path, _)| path.span == span)
    }

    fn sensed(&self) -> impl Iterator<Item = &(Path, bool)> {
        self.settings
            .iter()
            .flat_map(|setting| match &setting.kind {
                SettingKind::Sensitivity { to, .. } => &to[..],
                _ => &[],
            })
    }
}
