//! Contacts that a method in steps of time treats itself.
//!
//! They have no switch, and no force in the rates, which are those of the motion without contacts: what an impulse
//! does follows from the gap, the slip velocity, the mass and the kinematics of the bodies.

use rustc_hash::FxHashSet;

use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, variables_of};
use crate::model;
use crate::system::contacts::{Places, no_contact};
use crate::system::lower::Lowering;
use crate::system::{Impulsive, SystemError};

/// What all contacts are looked at with.
struct Known<'e> {
    places: Places<'e>,
    /// Positions of bodies.
    positions: FxHashSet<Var>,
}

impl<'e> Lowering<'_, 'e> {
    /// All contacts that the experiment needs; `rates` are those without them.
    pub(crate) fn impulsive(
        &mut self,
        rates: &[Expr<'e>],
        diags: &mut Diagnostics,
    ) -> Vec<Impulsive<'e>> {
        let model = self.model;
        if model.statements.contacts.is_empty() {
            return Vec::new();
        }
        let vars: Vec<Option<Var>> = model.state_vars().map(Expr::as_variable).collect();
        let positions = model
            .statements
            .bodies
            .iter()
            .flat_map(|body| &body.positions);
        let known = Known {
            places: self.places(),
            positions: positions.filter_map(|&entry| vars[entry]).collect(),
        };
        let mut contacts = Vec::with_capacity(model.statements.contacts.len());
        for contact in &model.statements.contacts {
            match self.impulsive_contact(contact, rates, &known) {
                Ok(contact) => contacts.extend(contact),
                Err(error) => diags.push(*error),
            }
        }
        contacts
    }

    fn impulsive_contact(
        &mut self,
        contact: &model::Contact<'e>,
        rates: &[Expr<'e>],
        known: &Known<'e>,
    ) -> Result<Option<Impulsive<'e>>, Box<SystemError>> {
        if !contact.exprs().all(|e| self.needs.holds_all(e)) {
            return Ok(None);
        }
        let gap = self.in_alphas(contact.gap, contact.gap_span);
        if !self.switches.alphas_of(gap).is_empty() {
            let what = "its gap, or the rate of it, has a switching term";
            return Err(no_contact(contact, what, contact.gap_span));
        }
        let vars = variables_of(&[gap]);
        let velocities = &known.places.velocities;
        if vars.iter().any(|var| velocities.contains_key(var)) {
            let what = "its gap depends on velocities";
            return Err(no_contact(contact, what, contact.gap_span));
        }
        if !vars.iter().any(|var| known.positions.contains(var)) {
            let what = "its gap does not depend on positions of a `mechanics` block";
            return Err(no_contact(contact, what, contact.gap_span));
        }
        let restitution = self.restitution(contact)?;
        let friction = match contact.friction {
            None => None,
            Some(friction) => {
                let friction = self.friction(contact, friction)?;
                let speed = self.along(gap, rates, &known.places);
                let normal = self.directions(speed, &known.places);
                let tangents = self.tangents(contact, &normal, &known.places)?;
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
            if !self.switches.alphas_of(e).is_empty() {
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
}
