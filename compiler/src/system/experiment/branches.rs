//! What experiments do not take of switches that are read nonlinearly.

use super::capabilities::Feature;
use super::error::ExperimentError;
use super::method::MethodKind;
use super::settings::Settings;
use crate::expr::{Expr, variables_of};
use crate::model::Data;
use crate::source::Span;
use crate::system::{Role, State, System};

/// Which simulations take them.
const BY_EVENTS: &str = "`method event`, which is the default, takes every switch that moves its surface at once, \
                         with all that is beside it; ";

impl Settings<'_> {
    /// Why an experiment does not take a switch that is read nonlinearly.
    pub fn refuses_branches(&self, system: &System) -> Option<ExperimentError> {
        let mut k = system.first_nonlinear()?;
        let mut nonlinear = (k..system.switches.len()).filter(|&k| system.switches[k].is_nonlinear);
        let method = self.numerics.method.kind();
        let by_elements = method == MethodKind::Fesd;
        let is_optimized = self.optimize.is_some();
        let mut beside = None;
        let what = if self.freezes() {
            "`lower timefreezing`".to_owned()
        } else if let Some((other, span)) = beside_forces(system).filter(|_| is_optimized) {
            beside = Some(span);
            format!("`optimize` with {other}")
        } else if !is_optimized && !method.takes(Feature::Nonlinear) {
            format!("`method {}`", method.word())
        } else if let Some((other, span)) = beside_branches(system).filter(|_| by_elements) {
            beside = Some(span);
            format!("`method fesd` with {other}")
        } else if let Some(still) = nonlinear.find(|&k| !drives_its_surface(system, k)) {
            k = still;
            format!(
                "rates that do not move `{}` at once",
                system.switches[k].name
            )
        } else {
            return None;
        };
        let switch = &system.switches[k];
        let (name, span) = (switch.name.clone(), switch.spans.first());
        let span = span.copied().unwrap_or(self.span);
        Some(ExperimentError::Nonlinear {
            what,
            others: if is_optimized { "" } else { BY_EVENTS },
            name,
            span,
            beside,
        })
    }
}

/// What finite elements do not take beside such switches, and where it stands.
pub fn beside_branches(system: &System) -> Option<(&'static str, Span)> {
    let functions: Vec<Expr> = system.switches.iter().map(|switch| switch.psi).collect();
    let inside = variables_of(&functions);
    let is_watched = |data: &&Data| {
        let var = data.var.as_variable();
        var.is_some_and(|var| inside.contains(&var))
    };
    let data = || system.exogenous.data.iter().find(is_watched);
    beside_forces(system)
        .or_else(|| Some(("switches on signals from tables and `floor`", data()?.span)))
}

/// What keeps its surface in another way than by α between 0 and 1, and where it stands.
fn beside_forces(system: &System) -> Option<(&'static str, Span)> {
    system.switches.iter().enumerate().find_map(|(k, switch)| {
        let what = match (switch.role, switch.unilateral) {
            (Role::Equation | Role::Member(_), _) => "algebraic states",
            (Role::Step, true) if system.is_projected(k) => "a projection",
            (Role::Step, true) => "a contact",
            (Role::Step, false) => return None,
        };
        Some((what, *switch.spans.first()?))
    })
}

/// Whether the rate of ψ of a switch contains its α.
fn drives_its_surface(system: &System<'_>, switch: usize) -> bool {
    let switch = &system.switches[switch];
    let Some(alpha) = switch.alpha.as_variable() else {
        return false;
    };
    let inside = variables_of(&[switch.psi]);
    let moves = |state: &&State<'_>| {
        let var = state.var.as_variable();
        var.is_some_and(|var| inside.binary_search(&var).is_ok())
    };
    let moving = system.states.iter().filter(moves);
    let mut moving = moving.map(|state| variables_of(&[state.rate]));
    moving.any(|vars| vars.binary_search(&alpha).is_ok())
}
