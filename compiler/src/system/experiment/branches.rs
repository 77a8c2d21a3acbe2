//! What experiments do not take of switches that are read nonlinearly.

use super::{ExperimentError, Method, Settings};
use crate::system::{Role, System};

impl Settings<'_> {
    /// Why an experiment does not take a switch that is read nonlinearly.
    pub fn refuses_branches(&self, system: &System) -> Option<ExperimentError> {
        let mut switches = system.switches.iter().enumerate();
        let (k, switch) = switches.find(|(_, switch)| switch.is_nonlinear)?;
        let by_elements = matches!(self.method, Method::Fesd(_));
        let what = if self.optimize.is_some() {
            "`optimize`".to_owned()
        } else if self.freezes() {
            "`lower timefreezing`".to_owned()
        } else if !self.method.takes_any_state() && !by_elements {
            format!("`method {}`", self.method.word())
        } else if let Some(beside) = beside_branches(system).filter(|_| by_elements) {
            format!("`method fesd` with {beside}")
        } else if !system.drives_its_surface(k) {
            format!("rates that do not move `{}` at once", switch.name)
        } else {
            return None;
        };
        Some(ExperimentError::Nonlinear {
            what,
            name: switch.name.clone(),
            span: switch.spans.first().copied().unwrap_or(self.span),
        })
    }
}

/// What finite elements do not take beside such switches.
fn beside_branches(system: &System) -> Option<&'static str> {
    let mut switches = system.switches.iter();
    if switches.any(|switch| switch.unilateral || switch.role != Role::Step) {
        Some("projections, contacts and algebraic states")
    } else if !system.data.is_empty() {
        Some("signals from tables")
    } else {
        None
    }
}
