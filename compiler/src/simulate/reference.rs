//! A run from event to event that says where a program starts.

use nsd_solver::fesd::jumps;
use nsd_solver::fesd::jumps::{Reference, Slips};

use crate::lowering::dcs::{Impact, SlipLaw};
use crate::report::Failure;
use crate::system::experiment::{Sampling, Settings};
use crate::system::{Slip, System};

/// How accurate the run is.
const TOLERANCE: f64 = 1e-11;

/// A run in the modes of the model.
pub(crate) struct ReferenceRun<'e> {
    /// What was run.
    pub system: System<'e>,
    pub run: Reference,
    /// Why it ended before its horizon.
    pub failure: Option<Failure>,
}

impl<'e> ReferenceRun<'e> {
    /// What is run for an experiment: its system without outputs, from event to event.
    pub fn asked(system: &System<'e>, settings: &Settings<'e>) -> (System<'e>, Settings<'e>) {
        let mut settings = settings.clone();
        settings.simulate_by_events();
        settings.recording.sampling = Sampling::Method;
        settings.numerics.tolerance = TOLERANCE;
        (without_outputs(system), settings)
    }
}

/// A system of which nothing is reported but its states.
pub(crate) fn without_outputs<'e>(system: &System<'e>) -> System<'e> {
    let mut system = system.clone();
    system.recorded.outputs.clear();
    system
}

/// The slip velocities at a point.
pub(crate) fn slips(system: &System, time: f64, x: &[f64]) -> Slips {
    let mut slips = Slips::default();
    let mut known = None;
    for contact in &system.jumps.contacts {
        let mut slip = |slip: &Slip| {
            let known = known.get_or_insert_with(|| system.valuation(time, x, &[]));
            slip.velocity.eval(&|var| known.number(var))
        };
        match contact.slips() {
            [] => {}
            [line] => slips.lines.push(slip(line)),
            plane => slips.planes.push([0, 1].map(|k| slip(&plane[k]))),
        }
    }
    slips
}

/// The contacts of a system as a solver of programs sees them.
pub(crate) fn impacts(system: &System, impacts: &[Impact]) -> Vec<jumps::Impact> {
    let contacts = system.jumps.contacts.iter().zip(impacts);
    let impact = contacts.map(|(contact, impact)| jumps::Impact {
        switch: contact.switch,
        gap: impact.gap,
        force: impact.force,
        slip: (impact.friction.as_ref()).map(|friction| match friction.law {
            SlipLaw::Interval(multipliers) => jumps::Slip::Interval {
                switch: contact.slips()[0].switch,
                multipliers,
            },
            SlipLaw::Disc { disc, .. } => jumps::Slip::Disc {
                alphas: disc.alphas,
                speed: disc.slip,
            },
        }),
    });
    impact.collect()
}
