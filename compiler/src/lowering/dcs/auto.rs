//! Choice of the formulation of switches.
//!
//! Stewart's where it is small: one switch per subsystem, or disjoint regions of the user's; else step, which stays
//! regular where several surfaces slide at once and Stewart's θ is not unique.

use crate::expr::{Interval, Substitution};
use crate::system::experiment::{Lowering, POISSON};
use crate::system::switches::roots::Vanishing;
use crate::system::{Role, Switch, System};

use super::{Dcs, DcsError, Formulation, heaviside, impact, signs, stewart};

/// A formulation and why it was taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// The formulation.
    pub formulation: Formulation,
    /// The reason, as a reader of the printed form sees it.
    pub reason: String,
}

/// Lowers in the formulation that the experiment asks for, else in the one of [`choose`]; the reason is printed.
pub fn lower<'e>(system: &System<'e>, lowerings: &[Lowering]) -> Result<Dcs<'e>, DcsError> {
    lower_taking(system, lowerings, takes(lowerings))
}

/// The same for a reader, who takes jumps as they are: what they do is not in it.
pub(crate) fn lower_with_jumps<'e>(
    system: &System<'e>,
    lowerings: &[Lowering],
) -> Result<Dcs<'e>, DcsError> {
    lower_taking(system, lowerings, Takes::Jumps)
}

/// What is known to those who take a DCS besides rates.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Takes {
    Rates,
    /// Impulses of contacts, too.
    Impulses,
    /// All jumps of states.
    Jumps,
}

fn takes(lowerings: &[Lowering]) -> Takes {
    match lowerings.contains(&Lowering::Impact) {
        true => Takes::Impulses,
        false => Takes::Rates,
    }
}

fn lower_taking<'e>(
    system: &System<'e>,
    lowerings: &[Lowering],
    takes: Takes,
) -> Result<Dcs<'e>, DcsError> {
    let asked = asked(lowerings).map(|formulation| Choice {
        formulation,
        reason: "asked for by `lower`".to_owned(),
    });
    let Choice {
        formulation,
        reason,
    } = asked.unwrap_or_else(|| choose(system));
    let mut dcs = lowered(system, formulation, takes)?;
    dcs.lowering.reason = Some(reason);
    Ok(dcs)
}

/// Whether [`lower`] would succeed; for those who need no DCS and still tell the user. Where nothing
/// is asked for, only what `needs` one is told.
pub fn check(system: &System, lowerings: &[Lowering], needs: bool) -> Result<(), DcsError> {
    let formulation = match asked(lowerings) {
        None if !needs => return Ok(()),
        None => choose(system).formulation,
        Some(formulation) => formulation,
    };
    is_without_memory(system, takes(lowerings))?;
    match formulation {
        Formulation::Stewart => signs::check(system).and_then(|()| is_bilateral(system)),
        Formulation::Step => Ok(()),
    }
}

/// A relay depends on the past, which complementarity knows nothing of, and a jump has no rate; one of a contact is
/// an impulse, where these are taken.
fn is_without_memory(system: &System, takes: Takes) -> Result<(), DcsError> {
    if let Some(law) = system.jumps.laws.first().filter(|_| takes != Takes::Jumps) {
        return Err(DcsError::Jump {
            title: law.title(),
            help: match (law.strikes, &system.task) {
                (Some(_), None) => {
                    "`lower timefreezing;` makes motion of it, and `method event` runs it as it is"
                }
                (Some(_), Some(_)) => "`lower timefreezing;` makes motion of it",
                (None, None) => "`method event`, which is the default, runs it as it is",
                (None, Some(_)) => {
                    "`optimize` takes jumps that are contacts only: run this one in a `simulate` experiment"
                }
            },
            span: law.span,
        });
    }
    // Laws come first: what is left are contacts.
    let mut contacts = system.jumps.contacts.iter();
    let is_poisson = contacts.any(|contact| contact.restitution.newton().is_none());
    if let Some((name, span)) = system.jumps.first_jump().filter(|_| takes == Takes::Rates) {
        return Err(DcsError::Contact {
            name: name.to_owned(),
            help: match &system.task {
                _ if is_poisson => POISSON,
                None => {
                    "with `method fesd`, `lower impact;` has them where elements meet, and `lower timefreezing;` makes \
                     motion of them; `method event` needs no lowering"
                }
                Some(_) => {
                    "`lower impact;` has them where elements meet, and `lower timefreezing;` makes motion of them"
                }
            },
            span,
        });
    }
    match system.switches.iter().find(|switch| switch.relay.is_some()) {
        Some(relay) => Err(DcsError::Relay {
            name: relay.name.clone(),
            span: relay.spans[0],
        }),
        None => Ok(()),
    }
}

/// Stewart's program weighs regions: a projection has a force without a bound, and friction in two directions no
/// regions at all.
fn is_bilateral(system: &System) -> Result<(), DcsError> {
    if let Some(switch) = system.switches.iter().find(|switch| switch.is_nonlinear) {
        return Err(DcsError::Nonlinear {
            name: switch.name.clone(),
            span: switch.spans[0],
        });
    }
    if let Some(kept) = system.switches.iter().find(|k| k.role != Role::Step) {
        return Err(DcsError::Algebraic {
            span: kept.spans[0],
        });
    }
    // A contact with such friction has a force without a bound, too.
    if let Some(entry) = system.switches.iter().find(|k| k.across.is_some()) {
        return Err(DcsError::Disc {
            name: entry.name.clone(),
            span: entry.spans[0],
        });
    }
    match system.switches.iter().find(|switch| switch.unilateral) {
        Some(constraint) => Err(DcsError::Projection {
            name: constraint.name.clone(),
            span: constraint.spans[0],
        }),
        None => Ok(()),
    }
}

fn asked(lowerings: &[Lowering]) -> Option<Formulation> {
    lowerings.iter().find_map(|lowering| match lowering {
        Lowering::Stewart => Some(Formulation::Stewart),
        Lowering::Step => Some(Formulation::Step),
        Lowering::TimeFreezing | Lowering::Impact => None,
    })
}

/// Lowers in the given formulation.
pub fn lower_as<'e>(system: &System<'e>, formulation: Formulation) -> Result<Dcs<'e>, DcsError> {
    lowered(system, formulation, Takes::Rates)
}

/// Lowers in the given formulation, contacts with impulses where these are taken.
fn lowered<'e>(
    system: &System<'e>,
    formulation: Formulation,
    takes: Takes,
) -> Result<Dcs<'e>, DcsError> {
    is_without_memory(system, takes)?;
    let mut dcs = match formulation {
        Formulation::Stewart => {
            is_bilateral(system)?;
            stewart::lower(system)?
        }
        Formulation::Step => heaviside::lower(system),
    };
    let switching: Vec<_> = system.switches.iter().map(|switch| switch.psi).collect();
    dcs.rows.rates = Vanishing::of(system, &switching).extended(&dcs.rows.rates);
    let alphas: Substitution = (system.switches.iter().zip(&dcs.switches.alphas))
        .filter_map(|(switch, &alpha)| Some((switch.alpha.as_variable()?, alpha)))
        .collect();
    dcs.impacts = impact::impacts(system, &alphas, &dcs.switches.discs);
    let task = system.task.as_ref();
    dcs.task = task.map(|task| task.map(|e| e.substitute(&alphas)));
    debug_assert_eq!(
        dcs.verify(),
        Ok(()),
        "a lowering keeps the invariants of `Dcs`"
    );
    Ok(dcs)
}

/// Stewart's formulation for single switches and disjoint named regions, else step.
pub fn choose(system: &System) -> Choice {
    let choice = |formulation, reason: &str| Choice {
        formulation,
        reason: reason.to_owned(),
    };
    if system.switches.is_empty() {
        return choice(Formulation::Stewart, "the system has no switch");
    }
    if let Some(reason) = unnamed(system) {
        return choice(Formulation::Step, &reason);
    }
    let mut several = signs::several(system).peekable();
    if several.peek().is_none() {
        return choice(Formulation::Stewart, "no two switches multiply each other");
    }
    let Some(subsystem) = several.find(|subsystem| !signs::is_named(system, subsystem)) else {
        return choice(Formulation::Stewart, "regions are disjoint and named");
    };
    let names = subsystem
        .switches
        .iter()
        .map(|&k| system.switches[k].name.as_str());
    let reason = match names.collect::<Vec<_>>().as_slice() {
        [first, second] => format!("`{first}` and `{second}` multiply each other"),
        [first, second, rest @ ..] => {
            format!(
                "`{first}`, `{second}` and {} more multiply each other",
                rest.len()
            )
        }
        _ => "switches multiply each other".to_owned(),
    };
    choice(Formulation::Step, &reason)
}

/// Why switches have no regions with names, whatever their values.
fn unnamed(system: &System) -> Option<String> {
    let is = |of: fn(&Switch) -> bool| system.switches.iter().any(of);
    let reason = if is(|switch| switch.unilateral) {
        let strikes = system.jumps.laws.iter().any(|law| law.strikes.is_some());
        match system.jumps.contacts.is_empty() && !strikes {
            true => "projections are stated by forces",
            false => "contacts are stated by forces",
        }
    } else if is(|switch| switch.role != Role::Step) {
        "algebraic states have no regions"
    } else if is(|switch| switch.across.is_some()) {
        "friction in two directions has no regions"
    } else {
        let mut switches = system.switches.iter();
        let switch = switches.find(|switch| switch.is_nonlinear)?;
        return Some(format!("`{}` is read nonlinearly", switch.name));
    };
    Some(reason.to_owned())
}

/// The first of some parameters, by their numbers, whose value decides within its range how a system is lowered. The step
/// formulation has a product for every combination of sides, also for those that cannot happen.
pub(crate) fn first_deciding(
    system: &System,
    lowerings: &[Lowering],
    open: &[(usize, Interval)],
) -> Option<usize> {
    let is_nameless = |subsystem| signs::partition(system, subsystem).is_none();
    let is_step = match asked(lowerings) {
        Some(formulation) => formulation == Formulation::Step,
        None => unnamed(system).is_some() || signs::several(system).any(is_nameless),
    };
    match is_step {
        true => None,
        false => signs::first_deciding(system, open),
    }
}
