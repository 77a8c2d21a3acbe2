//! Settings of an experiment, evaluated.
//!
//! The values of `with` are given to the model first; every other setting is a number in terms of
//! its parameters. What is asserted (`expect`) stays as it was written.

mod animation;
mod branches;
mod capabilities;
mod error;
mod fesd;
mod law;
mod method;
mod optimize;
mod perturb;
mod plot;
pub(crate) mod reader;
mod sensed;
mod settings;
mod statements;
pub(crate) mod with;

use rustc_hash::FxHashMap;

use super::values;
use crate::diagnostics::Diagnostics;
use crate::model::Model;
use crate::source::table::Sources;
use crate::syntax::{self, Bind, SettingKind};

pub use animation::{Animation, Drawing, DrawingKind};
pub use branches::beside_branches;
pub(crate) use capabilities::POISSON;
pub use capabilities::{Feature, table};
pub use error::ExperimentError;
pub use fesd::{Cross, Equilibration, FesdOptions, Form, SteppingOptions, written};
pub use law::Law;
pub use method::{
    Branch, EventOptions, Lowering, Method, MethodKind, SmoothingOptions, options_of, words_of,
};
pub use optimize::{
    At, ClosedLoop, Column, Cost, Discretization, Fit, Freed, Holds, Integral, Lengths,
    MpccOptions, Norm, OPTIMIZER, Optimize, Penalty, Row, Shape, Starts, Term, Tied,
    relaxation_word, steering_word,
};
pub use perturb::Perturbation;
pub use plot::{Drawn, Figures, Plot, Sheet};
use reader::Reader;
pub use sensed::Sensed;
pub use settings::{Kept, Numerics, Recording, Sampling, Settings, Stop};
use statements::Statements;

/// The settings of an experiment of `model`; `None` after an error.
///
/// `overrides` come from outside the file and replace what `with` says; `data` are the files of data that it names.
pub fn evaluate<'e>(
    model: &Model<'e>,
    experiment: &syntax::Experiment,
    (overrides, data): (&[Bind], &Sources),
    diags: &mut Diagnostics,
) -> Option<Settings<'e>> {
    // `None` where something was reported.
    let given = with::given(model, experiment, overrides, diags);
    let values = values::evaluate(model, given.as_ref()?, diags)?;
    let mut reader = Reader {
        model,
        values: &values,
        diags,
        seen: FxHashMap::default(),
        failed: false,
    };

    let mut statements = Statements::new(model, data, experiment.kind);
    if let (Some(fit), Some(given)) = (&mut statements.fit, &given) {
        fit.begin(experiment, given);
    }
    // The horizon bounds what others may be, wherever it stands.
    let is_horizon =
        |setting: &&syntax::ExperimentSetting| matches!(setting.kind, SettingKind::Horizon { .. });
    let all = || experiment.settings.iter();
    let others = all().filter(|setting| !is_horizon(setting));
    for setting in all().filter(is_horizon).chain(others) {
        statements.setting(&mut reader, &setting.kind, setting.span);
    }
    statements.check(&mut reader, experiment);
    if !experiment.differentiates {
        statements.recording.sensed.clear();
    }
    let is_optimize = statements.draft.is_some();
    let draft = statements.draft.take();
    let optimize = draft.and_then(|draft| draft.finish(&mut reader, experiment));
    let fit = statements.fit.take();
    let fit = fit.and_then(|fit| fit.finish(&mut reader, experiment));
    if let Some(fit) = fit {
        statements.recording.follow(fit);
    }
    let closed_loop = statements.closed_loop.take();
    let closed_loop = closed_loop.and_then(|draft| draft.finish(&mut reader, experiment));
    let failed = reader.failed || optimize.is_some() != is_optimize;
    let (horizon, _) = statements.horizon?;
    let settings = Settings {
        name: experiment.name.name.clone(),
        model: model.name.clone(),
        horizon: horizon?,
        numerics: Numerics {
            averages: statements.averages.is_some(),
            closed_loop,
            ..statements.numerics
        },
        recording: statements.recording,
        optimize,
        kicks: statements.kicks,
        runs: statements.runs.map(|(n, _)| n),
        expects: statements.expects,
        span: experiment.span,
        values,
        sliding: given?.sliding,
    };
    (!failed).then_some(settings)
}
