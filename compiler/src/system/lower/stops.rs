//! `stop when g <= 0;`: laws that end a run.
//!
//! They are read behind all forces: what stops a run is no reason why a surface is not that of a contact.

use super::translation::Translation;
use crate::diagnostics::Diagnostics;
use crate::expr::Expr;
use crate::model::{DynamicsError, When};
use crate::source::Span;
use crate::system::Law;
use crate::system::switches::affine::at;

/// A condition in α of collected switches.
pub(crate) struct Stopping<'e> {
    name: String,
    pub guard: Expr<'e>,
    /// Switches, with what their α counts as on their surface.
    on_surface: Vec<(usize, f64)>,
    span: Span,
}

/// All conditions of an experiment.
pub(super) fn lower<'e>(
    translation: &mut Translation<'_, 'e>,
    diags: &mut Diagnostics,
) -> Vec<Stopping<'e>> {
    let mut found = Vec::new();
    for stop in &translation.instance.settings.numerics.stops {
        let span = stop.span;
        let guard = translation.in_alphas(stop.guard, span);
        // What parameters decide is none of a run; what is no surface is told elsewhere.
        if let Some(value) = guard.as_constant()
            && translation.switches.refused.is_empty()
        {
            let value = value > 0.5;
            diags.push(DynamicsError::ConstantComparison { value, span });
        }
        let reached = stop.reached.iter().filter_map(|&comparison| {
            let holds = translation.in_alphas(comparison, span);
            on_surface(translation, holds)
        });
        found.push(Stopping {
            name: stop.name.clone(),
            guard,
            on_surface: reached.collect(),
            span,
        });
    }
    found
}

/// The switch of a comparison, and the α for which it holds; none of what a relay remembers, which has no surface.
fn on_surface<'e>(translation: &Translation<'_, 'e>, holds: Expr<'e>) -> Option<(usize, f64)> {
    let entries = &translation.switches.entries;
    let mut alphas = entries.alphas_of(holds).into_iter();
    let (alpha, None) = (alphas.next()?, alphas.next()) else {
        return None;
    };
    let side = [0.0, 1.0].into_iter();
    let mut side = side.filter(|&side| at(holds, alpha, side).as_constant() == Some(1.0));
    let switch = entries.of_alpha(alpha)?;
    let has_surface = translation.switches.list[switch].relay.is_none();
    has_surface.then_some((switch, side.next()?))
}

/// The laws, once only the switches `kept` are left.
pub(super) fn finished<'e>(
    stops: Vec<Stopping<'e>>,
    kept: &[usize],
) -> impl Iterator<Item = Law<'e>> {
    stops.into_iter().map(|stop| {
        let on_surface = stop.on_surface.iter();
        let place = |&(k, alpha): &(usize, f64)| Some((kept.binary_search(&k).ok()?, alpha));
        Law {
            name: stop.name,
            when: When::Guard(stop.guard),
            strikes: None,
            resets: Vec::new(),
            stops: Some(on_surface.filter_map(place).collect()),
            span: stop.span,
        }
    })
}
