//! Contacts: forces that push bodies apart, and friction.
//!
//! M v' = f + J_n λ_n + J_t λ_t,   gap ≥ 0 ⟂ λ_n ≥ 0,   -λ_t ∈ μ λ_n ∂|w|,
//!
//! J_nᵀ = ∂gap'/∂v, J_tᵀ = ∂w/∂v, becomes with λ_n = 1 - α_n and a switch α_t ∈ step(w)
//!
//! v' = M⁻¹f + (1 - α_n) (M⁻¹J_n - μ (2α_t - 1) M⁻¹J_t),
//!
//! affine in every α: α_n = 1 is an open contact and α_n < 1 a closed one; 0 < α_t < 1 on w = 0 sticks. A slip
//! velocity with two entries has an α_t for each, and |2α_t - 1| ≤ 1 of both together is Coulomb's cone. So the
//! motion without contacts is that for α_n = 1, and ∂v'/∂α shows the directions of impulses.

pub(crate) mod coefficients;
pub(crate) mod corners;
pub(crate) mod directions;
pub(crate) mod features;
pub(crate) mod impulsive;
pub(crate) mod jumps;
pub(crate) mod kinematics;
pub(crate) mod mechanics;
pub(crate) mod start;

use super::lower::translation::Translation;
use super::{Contact, Direction, Friction, Slip, SystemError};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, variables_of};
use crate::model;
use crate::source::Span;
use crate::system::contacts::corners::Corner;
use crate::system::contacts::features::Feature;
use crate::system::contacts::kinematics::{Kinematics, Tangent};
use crate::system::switches::surface::Form;
use crate::system::switches::{Collected, Switches};

/// What is wrong with a gap like a distance between points.
const NEVER_NEGATIVE: &str = "its gap is never negative: no side of its zeros is inside the body";

/// What is wrong with a gap that no motion changes.
const NO_POSITIONS: &str = "its gap does not depend on positions of a `mechanics` block";

/// Adds the forces of all contacts to the rates. Switches of the contacts are numbers in the collected list.
pub(crate) fn contacts<'e>(
    translation: &mut Translation<'_, 'e>,
    rates: &mut [Expr<'e>],
    diags: &mut Diagnostics,
) -> Vec<Contact<'e>> {
    let instance = translation.instance;
    let kinematics = Kinematics::of(instance);
    // Rates of positions have no forces in them.
    let free = rates.to_vec();
    features::map(translation, diags, |feature, translation| {
        finish_contact(feature, &kinematics, translation, &free, rates)
    })
}

fn finish_contact<'e>(
    feature: &Feature<'_, 'e>,
    kinematics: &Kinematics<'_, '_, 'e>,
    translation: &mut Translation<'_, 'e>,
    free: &[Expr<'e>],
    rates: &mut [Expr<'e>],
) -> Result<Contact<'e>, Box<SystemError>> {
    let (instance, contact) = (kinematics.instance, feature.contact);
    let (gap, speed, normal) = gap(feature, kinematics, translation, free)?;
    let restitution = coefficients::restitution(translation, contact)?;
    let friction = match contact.friction {
        None => None,
        Some(friction) => {
            let friction = coefficients::friction(translation, contact, friction)?;
            Some((
                friction,
                kinematics.tangents(contact, &normal, translation)?,
            ))
        }
    };
    let switch = translation
        .switches
        .unilateral(gap, &feature.name, contact.span);
    let switch = switch.map_err(|form| {
        let what = match form {
            Form::Definite(sign) if sign > 0.0 => NEVER_NEGATIVE,
            Form::Definite(_) => "its gap is never positive: the contact could not be open",
            Form::OddPower(_) => "its gap is a power, with a slope of zero where it is zero",
            _ => match translation.switches.find(gap) {
                Some((k, _)) => return shared_gap(contact, &translation.switches.list[k]),
                None => "its gap has no surface",
            },
        };
        no_contact(contact, what, contact.gap_span)
    })?;
    let force = 1.0
        - instance
            .model
            .exprs
            .expr(translation.switches.list[switch].alpha);
    for direction in &normal {
        let rate = &mut rates[direction.state];
        *rate = *rate + direction.push * force;
    }
    let friction =
        friction.map(|friction| rub(feature, friction, force, &mut translation.switches, rates));
    Ok(Contact {
        name: feature.name.clone(),
        feature_of: feature.owner(),
        gap,
        speed,
        normal,
        restitution,
        friction,
        switch,
        span: contact.span,
    })
}

/// The gap with its rate in free motion and what a force along J_n does.
fn gap<'e>(
    feature: &Feature<'_, 'e>,
    kinematics: &Kinematics<'_, '_, 'e>,
    translation: &mut Translation<'_, 'e>,
    free: &[Expr<'e>],
) -> Result<(Expr<'e>, Expr<'e>, Vec<Direction<'e>>), Box<SystemError>> {
    let contact = feature.contact;
    let gap = translation.in_alphas(feature.gap, contact.gap_span);
    let gap = corners::in_signs(gap, translation);
    let speed = kinematics.instance.rate_of(gap, free);
    if let Some(corner) = corners::corner((gap, speed), translation) {
        return Err(corner_in_gap(contact, corner, &translation.switches));
    }
    if !corners::has_inside(gap, translation) {
        return Err(no_contact(contact, NEVER_NEGATIVE, contact.gap_span));
    }
    let vars = variables_of(&[gap]);
    if vars
        .iter()
        .any(|var| kinematics.velocities.contains_key(var))
    {
        let what = "its gap depends on velocities";
        return Err(no_contact(contact, what, contact.gap_span));
    }
    let normal = kinematics.directions(speed, translation);
    if normal.is_empty() {
        return Err(no_contact(contact, NO_POSITIONS, contact.gap_span));
    }
    Ok((gap, speed, normal))
}

/// Adds friction -μ λ_n (2α_t - 1) along every entry of the slip velocity.
fn rub<'e>(
    feature: &Feature<'_, 'e>,
    (coefficient, tangents): (Expr<'e>, Vec<Tangent<'e>>),
    force: Expr<'e>,
    switches: &mut Switches<'e>,
    rates: &mut [Expr<'e>],
) -> Friction<'e> {
    let mut slips = Vec::new();
    for (velocity, tangent) in tangents {
        let switch = switches.keep(velocity, &feature.name, feature.contact.span);
        let alpha = velocity.exprs().expr(switches.list[switch].alpha);
        let sign = 2.0 * alpha - 1.0;
        for direction in &tangent {
            let rate = &mut rates[direction.state];
            let push = switches.entries.merged(coefficient * direction.push);
            *rate = *rate - push * force * sign;
        }
        slips.push(Slip {
            velocity,
            tangent,
            switch,
        });
    }
    Friction { coefficient, slips }
}

/// The contacts, once only the switches `kept` are left.
pub(crate) fn finished_contacts<'e>(
    contacts: Vec<Contact<'e>>,
    kept: &[usize],
) -> Vec<Contact<'e>> {
    let place = |k: usize| kept.binary_search(&k).ok();
    let finish = |mut contact: Contact<'e>| {
        contact.switch = place(contact.switch)?;
        contact.friction = contact.friction.and_then(|friction| {
            let slips = friction.slips.into_iter().map(|slip| {
                Some(Slip {
                    switch: place(slip.switch)?,
                    ..slip
                })
            });
            Some(Friction {
                slips: slips.collect::<Option<_>>()?,
                ..friction
            })
        });
        Some(contact)
    };
    contacts.into_iter().filter_map(finish).collect()
}

/// The corner, or what may be one, of a gap that is none of a smallest of several.
fn corner_in_gap(
    contact: &model::Contact<'_>,
    corner: Corner,
    switches: &Switches<'_>,
) -> Box<SystemError> {
    let switch = switches.entries.of_alpha(corner.alpha);
    let switch = switch.map_or_else(String::new, |k| switches.name_of(k));
    let (name, span) = (contact.name.clone(), contact.gap_span);
    Box::new(match corner.is_seen {
        true => SystemError::CornerInGap { name, switch, span },
        false => SystemError::BendInside { name, switch, span },
    })
}

/// A gap that is the switching function of something else.
fn shared_gap(contact: &model::Contact<'_>, other: &Collected<'_>) -> Box<SystemError> {
    Box::new(SystemError::SharedGap {
        name: contact.name.clone(),
        span: contact.gap_span,
        other: other.spans.first().copied(),
    })
}

/// Why a contact is none.
fn no_contact(contact: &model::Contact<'_>, what: &str, span: Span) -> Box<SystemError> {
    let (name, what) = (contact.name.clone(), what.to_owned());
    Box::new(SystemError::NoContact { name, what, span })
}
