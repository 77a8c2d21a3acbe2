//! Contacts that a method in steps of time treats itself.
//!
//! They have no switch, and no force in the rates, which are those of the motion without contacts: what an impulse
//! does follows from the gap, the slip velocity, the mass and the kinematics of the bodies.

use rustc_hash::FxHashSet;

use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, variables_of};
use crate::model;
use crate::system::contacts::kinematics::Kinematics;
use crate::system::contacts::{coefficients, no_contact};
use crate::system::lower::translation::Translation;
use crate::system::{Impulsive, SystemError};

/// All contacts that the experiment needs; `rates` are those without them.
pub(crate) fn impulsive<'e>(
    translation: &mut Translation<'_, 'e>,
    rates: &[Expr<'e>],
    diags: &mut Diagnostics,
) -> Vec<Impulsive<'e>> {
    let instance = translation.instance;
    let statements = &instance.model.statements;
    let kinematics = Kinematics::of(instance);
    let positions = statements.bodies.iter().flat_map(|body| &body.positions);
    let positions = positions.filter_map(|&entry| instance.vars[entry].as_variable());
    let positions: FxHashSet<Var> = positions.collect();
    let mut contacts = Vec::with_capacity(statements.contacts.len());
    for contact in &statements.contacts {
        match impulsive_contact(contact, &kinematics, &positions, translation, rates) {
            Ok(contact) => contacts.extend(contact),
            Err(error) => diags.push(*error),
        }
    }
    contacts
}

fn impulsive_contact<'e>(
    contact: &model::Contact<'e>,
    kinematics: &Kinematics<'_, '_, 'e>,
    positions: &FxHashSet<Var>,
    translation: &mut Translation<'_, 'e>,
    rates: &[Expr<'e>],
) -> Result<Option<Impulsive<'e>>, Box<SystemError>> {
    let instance = kinematics.instance;
    if !contact.exprs().all(|e| instance.needs.holds_all(e)) {
        return Ok(None);
    }
    let gap = translation.in_alphas(contact.gap, contact.gap_span);
    if !translation.switches.entries.alphas_of(gap).is_empty() {
        let what = "its gap, or the rate of it, has a switching term";
        return Err(no_contact(contact, what, contact.gap_span));
    }
    let vars = variables_of(&[gap]);
    let velocities = &kinematics.velocities;
    if vars.iter().any(|var| velocities.contains_key(var)) {
        let what = "its gap depends on velocities";
        return Err(no_contact(contact, what, contact.gap_span));
    }
    if !vars.iter().any(|var| positions.contains(var)) {
        let what = "its gap does not depend on positions of a `mechanics` block";
        return Err(no_contact(contact, what, contact.gap_span));
    }
    let restitution = coefficients::restitution(translation, contact)?;
    let friction = match contact.friction {
        None => None,
        Some(friction) => {
            let friction = coefficients::friction(translation, contact, friction)?;
            let speed = instance.rate_of(gap, rates);
            let normal = kinematics.directions(speed, translation);
            let tangents = kinematics.tangents(contact, &normal, translation)?;
            Some((
                friction,
                tangents.into_iter().map(|tangent| tangent.0).collect(),
            ))
        }
    };
    let numbers = [restitution.coefficient]
        .into_iter()
        .chain(friction.iter().map(|f: &(Expr, Vec<Expr>)| f.0));
    for e in numbers {
        if !translation.switches.entries.alphas_of(e).is_empty() {
            let what = "its restitution or friction has a switching term";
            return Err(no_contact(contact, what, contact.span));
        }
    }
    Ok(Some(Impulsive {
        name: contact.name.clone(),
        gap,
        restitution,
        friction,
        span: contact.span,
    }))
}
