//! Compiler for `.nsd`.

pub mod cli;
pub mod clock;
pub mod dcs;
pub mod diagnostics;
pub mod explain;
pub mod expr;
pub mod model;
pub mod report;
pub mod simulate;
pub mod source;
pub mod syntax;
pub mod system;

use self::clock::Clock;
use self::diagnostics::Diagnostics;
use self::expr::Exprs;
use self::model::Model;
use self::syntax::{Bind, Experiment, File, SettingKind};
use self::system::System;
use self::system::experiment::Settings;

/// An experiment that is ready to run.
pub struct Compiled<'e> {
    /// The model, with the structural constants of the experiment.
    pub model: Model<'e>,
    /// What the experiment asks for.
    pub settings: Settings<'e>,
    /// The piecewise smooth system.
    pub system: System<'e>,
}

/// From the syntax of an experiment to the system it is about: model, settings, system.
///
/// `overrides` come from outside the file and replace what `with` says. `None` after an error.
pub fn compile<'e>(
    exprs: &'e Exprs,
    file: &File,
    experiment: &Experiment,
    overrides: &[Bind],
    clock: &mut Clock,
    diags: &mut Diagnostics,
) -> Option<Compiled<'e>> {
    let definition = model::find(file, &experiment.model, diags)?;
    let with = given(experiment, overrides);
    let name = &definition.name.name;
    let model = clock.time("model", || model::resolve(exprs, file, name, &with, diags))?;
    clock.time("system", || {
        let settings = system::experiment::evaluate(&model, experiment, overrides, diags)?;
        let system = system::lower(&model, &settings, diags)?;
        Some(Compiled {
            model,
            settings,
            system,
        })
    })
}

/// The `with` of an experiment, without what is overridden.
fn given(experiment: &Experiment, overrides: &[Bind]) -> Vec<Bind> {
    let is_overridden = |bind: &&Bind| {
        let name = &bind.target.head.name;
        let is_whole =
            |other: &Bind| other.target.head.name == *name && other.target.rest.is_empty();
        bind.target.rest.is_empty() && overrides.iter().any(is_whole)
    };
    let with = experiment
        .settings
        .iter()
        .filter_map(|setting| match &setting.kind {
            SettingKind::With(binds) => Some(binds),
            _ => None,
        });
    let kept = with.flatten().filter(|bind| !is_overridden(bind));
    kept.chain(overrides).cloned().collect()
}
