//! Contacts that a method in steps of time treats itself.
//!
//! They have no switch, and no force in the rates, which are those of the motion without contacts: what an impulse
//! does follows from the gap, the slip velocity, the mass and the kinematics of the bodies.

use rustc_hash::FxHashSet;

use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, variables_of};
use crate::system::contacts::features::{self, Feature};
use crate::system::contacts::kinematics::Kinematics;
use crate::system::contacts::{NO_POSITIONS, coefficients, no_contact};
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
    features::map(translation, diags, |feature, translation| {
        impulsive_contact(feature, &kinematics, &positions, translation, rates)
    })
}

fn impulsive_contact<'e>(
    feature: &Feature<'_, 'e>,
    kinematics: &Kinematics<'_, '_, 'e>,
    positions: &FxHashSet<Var>,
    translation: &mut Translation<'_, 'e>,
    rates: &[Expr<'e>],
) -> Result<Impulsive<'e>, Box<SystemError>> {
    let (instance, contact) = (kinematics.instance, feature.contact);
    let gap = translation.in_alphas(feature.gap, contact.gap_span);
    if !translation.switches.entries.alphas_of(gap).is_empty() {
        let what = "its gap has a switching term, which `method event` takes, and `method timestepping` does not";
        return Err(no_contact(contact, what, contact.gap_span));
    }
    let vars = variables_of(&[gap]);
    let velocities = &kinematics.velocities;
    if vars.iter().any(|var| velocities.contains_key(var)) {
        let what = "its gap depends on velocities";
        return Err(no_contact(contact, what, contact.gap_span));
    }
    if !vars.iter().any(|var| positions.contains(var)) {
        return Err(no_contact(contact, NO_POSITIONS, contact.gap_span));
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
    let switching = |e: Expr<'e>| !translation.switches.entries.alphas_of(e).is_empty();
    let slips = friction.iter().flat_map(|f: &(Expr, Vec<Expr>)| &f.1);
    if slips.copied().any(switching) {
        let what = "its slip has a switching term, which `method event` takes, and `method timestepping` does not";
        return Err(no_contact(contact, what, contact.slip.1));
    }
    let coefficients = friction.iter().map(|f| f.0);
    let mut coefficients = coefficients.chain([restitution.coefficient]);
    if coefficients.any(switching) {
        let what = "its restitution or friction has a switching term, which `method event` takes, and `method timestepping` does not";
        return Err(no_contact(contact, what, contact.span));
    }
    Ok(Impulsive {
        name: feature.name.clone(),
        feature_of: feature.owner(),
        gap,
        restitution,
        friction,
        span: contact.span,
    })
}
