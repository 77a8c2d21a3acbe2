//! Model with its nonsmooth terms -> system with explicit switches.
//!
//! x' = f(t, x, p; sign(ψ), max(..), ..) + Σ_R 1_R f_R   becomes   x' = f(t, x, p, α), α_i ∈ step(ψ_i)
//!
//! What the experiment does not need is left out first ([`super::needs`]).
//!
//! 1. Parameters get numbers; controls and inputs become functions of time and state.
//! 2. Nonsmooth terms become switch variables ([`super::switches`]).
//! 3. Every expression of the user must be affine in each of its switches, or a reading is asked for.
//! 4. f = Σ w_R(α) f_R is reduced to multi-affine form (α^k -> α); inside a region whose guard is a
//!    conjunction, its switches have the values that the guard implies.
//! 5. Continuous switches are recognised, interacting ones grouped, unused ones dropped.

mod assemble;
pub(crate) mod instance;
mod motion;
mod rates;
mod recorded;
mod stops;
mod surfaces;
mod task;
pub(crate) mod translation;

use self::assemble::Parts;
use self::instance::Instance;
use self::motion::Motion;
use self::translation::Translation;
use super::algebraic::Implicit;
use super::algebraic::programs::Programs;
use super::contacts::kinematics::bodies;
use super::experiment::Settings;
use super::needs::Extent;
use super::needs::effort::{check_counts, check_effort, check_entangled};
use super::regions::partitions::Regions;
use super::values::rounding::Roundings;
use super::{Recorded, System};
use crate::diagnostics::Diagnostics;
use crate::expr::Expr;
use crate::model::Model;

/// The system of a model under the settings of an experiment; `None` after an error.
pub fn lower<'e>(
    model: &Model<'e>,
    settings: &Settings<'e>,
    extent: Extent,
    diags: &mut Diagnostics,
) -> Option<System<'e>> {
    let errors_before = diags.errors().count();
    let passed = |diags: &Diagnostics| (diags.errors().count() == errors_before).then_some(());

    let instance = &Instance::new(model, settings, extent);
    let roundings = Roundings::of(instance, diags);
    passed(diags)?;
    let data = &roundings.data;
    let programs = Programs { instance, data };
    let sampled = programs.check(diags);
    let mut given = settings.values.signals.clone();
    let implicit = Implicit::of(instance, &mut given, diags);
    passed(diags)?;
    let guesses = programs.guesses();

    let unknowns = implicit.vars().collect();
    let mut translation = Translation::new(instance, given, unknowns, roundings);
    let texts = surfaces::declare(&mut translation, diags);
    check_counts(instance, &translation.switches, diags);
    check_entangled(&translation.switches, diags);
    passed(diags)?;

    let regions = Regions::of(&mut translation);
    let mut motion = Motion::of(&mut translation, &regions, diags);
    check_entangled(&translation.switches, diags);
    passed(diags)?;
    check_effort(&translation.switches, &motion.rates(), diags);
    let (recorded, named) = Recorded::of(&mut translation);
    let aliases = surfaces::aliases(&mut translation);
    let mut task = task::lower(&mut translation, diags);
    let used = regions.weights.iter().chain(&regions.guards).copied();
    let used: Vec<Expr<'e>> = used.chain(recorded.exprs()).collect();
    motion.add_forces(&mut translation, &used, diags);
    motion.stops = stops::lower(&mut translation, diags);
    check_entangled(&translation.switches, diags);
    if let Some(task) = &mut task {
        let rows = task::coefficient_rows(instance, &motion.contacts);
        task.rows.extend(rows);
    }
    motion.algebraics = implicit.states(&mut translation, &guesses, diags);
    motion.bodies = bodies(&mut translation);
    surfaces::report_refused(&translation.switches, &texts, diags);
    translation.roundings.report(diags);
    passed(diags)?;

    let parts = Parts {
        motion,
        recorded,
        named,
        aliases,
        task,
        regions,
        sampled,
    };
    let system = parts.assemble(translation, diags);
    system.check_start(diags);
    passed(diags)?;
    debug_assert_eq!(system.verify(), Ok(()));
    Some(system)
}
