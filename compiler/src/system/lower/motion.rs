//! What moves and jumps, in α of collected switches.

use super::stops::Stopping;
use super::translation::Translation;
use super::{rates, task};
use crate::diagnostics::Diagnostics;
use crate::expr::Expr;
use crate::system::algebraic::projections;
use crate::system::contacts::contacts;
use crate::system::contacts::impulsive::impulsive;
use crate::system::contacts::jumps::{Lowered, find_contacts, laws};
use crate::system::regions::partitions::Regions;
use crate::system::{Body, Contact, Impulsive, State};

/// Rates, laws by which states jump, and forces.
pub(crate) struct Motion<'e> {
    /// Rates of the states of the model.
    pub rates: Vec<Expr<'e>>,
    pub integrals: Vec<State<'e>>,
    pub algebraics: Vec<State<'e>>,
    pub laws: Vec<Lowered<'e>>,
    pub stops: Vec<Stopping<'e>>,
    pub bodies: Vec<Body<'e>>,
    pub contacts: Vec<Contact<'e>>,
    pub impulsive: Vec<Impulsive<'e>>,
}

impl<'e> Motion<'e> {
    /// The motion without forces of contacts and projections, and without algebraic states.
    pub fn of(
        translation: &mut Translation<'_, 'e>,
        regions: &Regions<'e>,
        diags: &mut Diagnostics,
    ) -> Self {
        Motion {
            rates: rates::lower(translation, regions, diags),
            integrals: task::integrals(translation, diags),
            algebraics: Vec::new(),
            laws: laws(translation, diags),
            stops: Vec::new(),
            bodies: Vec::new(),
            contacts: Vec::new(),
            impulsive: Vec::new(),
        }
    }

    /// Adds the forces of laws that are contacts, of contacts and of projections; `used` is what else reads α.
    pub fn add_forces(
        &mut self,
        translation: &mut Translation<'_, 'e>,
        used: &[Expr<'e>],
        diags: &mut Diagnostics,
    ) {
        let integrals = self.integrals.iter().map(|state| state.rate);
        let used: Vec<Expr<'e>> = used.iter().copied().chain(integrals).collect();
        let (rates, laws) = (&mut self.rates, &mut self.laws);
        find_contacts(translation, laws, rates, &used, diags);
        match translation.instance.settings.steps_through_contacts() {
            true => self.impulsive = impulsive(translation, rates, diags),
            false => self.contacts = contacts(translation, rates, diags),
        }
        projections::push(translation, rates, diags);
    }

    /// f of all states, in their order in the system.
    pub fn rates(&self) -> Vec<Expr<'e>> {
        let others = self.algebraics.iter().chain(&self.integrals);
        let others = others.map(|state| state.rate);
        self.rates.iter().copied().chain(others).collect()
    }

    /// Frictions of contacts and masses of bodies.
    pub fn coefficients(&self) -> Vec<Expr<'e>> {
        let frictions = self.contacts.iter().flat_map(|contact| &contact.friction);
        let frictions = frictions.map(|friction| friction.coefficient);
        let masses = self.bodies.iter().flat_map(|body| &body.mass);
        frictions.chain(masses.copied()).collect()
    }

    /// What switches act on besides the rates: laws in entry variables, others in α.
    pub fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        (self.laws.iter().flat_map(Lowered::reads))
            .chain(self.stops.iter().map(|stop| stop.guard))
            .chain(self.contacts.iter().flat_map(Contact::exprs))
            .chain(self.bodies.iter().flat_map(Body::exprs))
    }
}
