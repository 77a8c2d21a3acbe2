//! `stop when g <= 0;`: laws that end a run.
//!
//! They are read behind all forces: what stops a run is no reason why a surface is not that of a contact.

use super::translation::Translation;
use crate::diagnostics::Diagnostics;
use crate::expr::Expr;
use crate::model::{DynamicsError, When};
use crate::source::Span;
use crate::system::Law;
use crate::system::switches::entries::Entries;

/// A condition of an experiment.
pub(crate) struct Stopping<'e> {
    name: String,
    /// In entry variables of collected switches.
    pub guard: Expr<'e>,
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
        let guard = translation.replace_in_law(stop.guard, span);
        let entries = &translation.switches.entries;
        // What parameters decide is none of a run; what is no surface is told elsewhere.
        if let Some(value) = entries.in_law(guard).as_constant()
            && translation.switches.refused.is_empty()
        {
            let value = value > 0.5;
            diags.push(DynamicsError::ConstantComparison { value, span });
        }
        found.push(Stopping {
            name: stop.name.clone(),
            guard,
            span,
        });
    }
    found
}

/// The laws.
pub(super) fn finished<'e>(
    stops: Vec<Stopping<'e>>,
    entries: &Entries<'e>,
) -> impl Iterator<Item = Law<'e>> {
    stops.into_iter().map(|stop| Law {
        name: stop.name,
        when: When::Guard(entries.in_law(stop.guard)),
        strikes: None,
        resets: Vec::new(),
        stops: true,
        span: stop.span,
    })
}
