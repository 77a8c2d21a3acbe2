//! Looks for narrow functions of states that a method without such a check of its own passes over.

use std::ops::ControlFlow;

use nsd_solver::event::{Event, Observer, Segment};
use nsd_solver::events::Overlooked;
use nsd_solver::hybrid::{Function, Note};

use nsd_solver::tape::Tape;

use super::limits::tape_of;
use crate::simulate::record::reported::Reported;
use crate::system::System;
use crate::system::experiment::Settings;

/// The functions of a system that may hide something from a step, of (t, x, α, data, open parameters).
#[derive(Debug)]
pub(crate) struct Hiding {
    functions: Vec<Function>,
    tape: Tape,
}

impl Hiding {
    /// Those of a system with some parameters open, by their numbers; none where all are tame.
    pub fn of(system: &System, open: &[usize]) -> Option<Self> {
        let n = system.states.len();
        let rates = system.states.iter().enumerate();
        let rates = rates.map(|(i, state)| (Function::Rate(i), state.rate));
        let surfaces = system.switches.iter().enumerate();
        let surfaces = surfaces.map(|(i, switch)| (Function::Surface(i), switch.psi));
        let hides = |expr| tape_of(system, open, &[expr]).can_hide(1..1 + n);
        let hiding = rates.chain(surfaces).filter(|(_, expr)| hides(*expr));
        let (functions, exprs): (Vec<_>, Vec<_>) = hiding.unzip();
        (!exprs.is_empty()).then(|| Hiding {
            functions,
            tape: tape_of(system, open, &exprs),
        })
    }
}

/// Looks at steps, where a function of the system may hide something from them.
pub(crate) struct Look<'s, 'e> {
    system: &'s System<'e>,
    parameters: Vec<f64>,
    overlooked: Option<Overlooked>,
}

impl<'s, 'e> Look<'s, 'e> {
    pub fn new(system: &'s System<'e>, settings: &Settings, reported: &Reported) -> Self {
        let sizes = [system.states.len(), system.switches.len()];
        let overlooked = reported.hiding.as_ref().map(|hiding| {
            let (functions, tape) = (hiding.functions.clone(), hiding.tape.clone());
            Overlooked::new(functions, tape, sizes, settings.numerics.tolerance)
        });
        Look {
            system,
            parameters: reported.parameters(system).collect(),
            overlooked,
        }
    }

    pub fn at(&mut self, segment: &Segment) {
        if let Some(overlooked) = &mut self.overlooked {
            let data = &self.system.exogenous.data;
            overlooked.look(segment, |time, values| {
                let data = data.iter().map(|data| data.table.piece(time).value(time));
                let known = data.chain(self.parameters.iter().copied());
                for (value, known) in values.iter_mut().zip(known) {
                    *value = known;
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
