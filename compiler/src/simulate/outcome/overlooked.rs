//! Looks for narrow functions of states that a method without such a check of its own passes over.

use std::ops::ControlFlow;

use nsd_solver::event::{Event, Observer, Segment};
use nsd_solver::events::Overlooked;
use nsd_solver::hybrid::{Function, Note};

use super::limits::tape_of;
use crate::system::System;
use crate::system::experiment::Settings;

/// Looks at steps, where a function of the system may hide something from them.
pub(crate) struct Look<'s, 'e> {
    system: &'s System<'e>,
    overlooked: Option<Overlooked>,
}

impl<'s, 'e> Look<'s, 'e> {
    pub fn new(system: &'s System<'e>, settings: &Settings) -> Self {
        let n = system.states.len();
        let rates = system.states.iter().enumerate();
        let rates = rates.map(|(i, state)| (Function::Rate(i), state.rate));
        let surfaces = system.switches.iter().enumerate();
        let surfaces = surfaces.map(|(i, switch)| (Function::Surface(i), switch.psi));
        let hides = |expr| tape_of(system, &[expr]).0.can_hide(1..1 + n);
        let hiding = rates.chain(surfaces).filter(|(_, expr)| hides(*expr));
        let (functions, exprs): (Vec<_>, Vec<_>) = hiding.unzip();
        let looks = || {
            let (tape, _) = tape_of(system, &exprs);
            Overlooked::new(
                functions,
                tape,
                [n, system.switches.len()],
                settings.tolerance,
            )
        };
        Look {
            system,
            overlooked: (!exprs.is_empty()).then(looks),
        }
    }

    pub fn at(&mut self, segment: &Segment) {
        if let Some(overlooked) = &mut self.overlooked {
            let data = &self.system.data;
            overlooked.look(segment, |time, values| {
                for (value, data) in values.iter_mut().zip(data) {
                    *value = data.table.piece(time).value(time);
                }
            });
        }
    }

    /// What has been passed over.
    pub fn notes(self) -> Vec<Note> {
        self.overlooked.map(Overlooked::notes).unwrap_or_default()
    }
}

/// Passes on what a run does, and looks at its steps.
pub(crate) struct Looking<'s, 'e, 'o> {
    observer: &'o mut dyn Observer,
    look: Look<'s, 'e>,
}

impl<'s, 'e, 'o> Looking<'s, 'e, 'o> {
    pub fn new(look: Look<'s, 'e>, observer: &'o mut dyn Observer) -> Self {
        Looking { observer, look }
    }

    /// What has been passed over.
    pub fn notes(self) -> Vec<Note> {
        self.look.notes()
    }
}

impl Observer for Looking<'_, '_, '_> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        self.look.at(segment);
        self.observer.segment(segment)
    }

    fn event(&mut self, event: &Event) {
        self.observer.event(event);
    }
}
