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

pub(crate) mod directions;
pub(crate) mod impulsive;
pub(crate) mod jumps;
pub(crate) mod mechanics;
pub(crate) mod start;
use rustc_hash::FxHashMap;

use super::lower::Lowering;
use super::{Body, Contact, Direction, Friction, Slip, SystemError};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, variables_of};
use crate::model::{self, Restitution};
use crate::source::Span;
use crate::system::switches::affine::at;
use crate::system::switches::reading::check_reading;
use crate::system::switches::surface::Form;

/// Beyond this many combinations of sides, coefficients of laws are looked at in runs only.
const MANY_CORNERS: usize = 1 << 10;

/// An entry of a slip velocity, and what a force along it does.
pub(super) type Tangent<'e> = (Expr<'e>, Vec<Direction<'e>>);

/// Where states and velocities are.
pub(super) struct Places<'e> {
    /// All states of the model.
    pub all: Vec<Expr<'e>>,
    /// Of kept states among those of the system.
    pub states: FxHashMap<Var, usize>,
    /// Of velocities: (body, velocity).
    pub velocities: FxHashMap<Var, (usize, usize)>,
}

impl<'e> Lowering<'_, 'e> {
    /// Adds the forces of all contacts to the rates. Switches of the contacts are numbers in the collected list.
    pub(super) fn contacts(
        &mut self,
        rates: &mut [Expr<'e>],
        diags: &mut Diagnostics,
    ) -> Vec<Contact<'e>> {
        let model = self.model;
        if model.statements.contacts.is_empty() {
            return Vec::new();
        }
        let places = self.places();
        // Rates of positions have no forces in them.
        let free = rates.to_vec();
        let mut contacts = Vec::new();
        for contact in &model.statements.contacts {
            match self.finish_contact(contact, &free, rates, &places) {
                Ok(contact) => contacts.extend(contact),
                Err(error) => diags.push(*error),
            }
        }
        contacts
    }

    /// Where states and velocities are.
    pub(super) fn places(&self) -> Places<'e> {
        let model = self.model;
        let all: Vec<Expr<'e>> = model.state_vars().collect();
        let vars: Vec<Option<Var>> = all.iter().map(|var| var.as_variable()).collect();
        let mut velocities = FxHashMap::default();
        for (b, body) in model.statements.bodies.iter().enumerate() {
            let entries = body.velocities.iter().enumerate();
            velocities.extend(entries.filter_map(|(k, &entry)| Some((vars[entry]?, (b, k)))));
        }
        let states = self.kept_states().enumerate();
        let states = states.filter_map(|(place, (_, var))| Some((var.as_variable()?, place)));
        Places {
            all,
            states: states.collect(),
            velocities,
        }
    }

    fn finish_contact(
        &mut self,
        contact: &model::Contact<'e>,
        free: &[Expr<'e>],
        rates: &mut [Expr<'e>],
        places: &Places<'e>,
    ) -> Result<Option<Contact<'e>>, Box<SystemError>> {
        if !contact.exprs().all(|e| self.needs.holds_all(e)) {
            return Ok(None);
        }
        let (gap, speed, normal) = self.gap(contact, free, places)?;
        let restitution = self.restitution(contact)?;
        let friction = match contact.friction {
            None => None,
            Some(friction) => {
                let friction = self.friction(contact, friction)?;
                Some((friction, self.tangents(contact, &normal, places)?))
            }
        };
        let switch = self.switches.unilateral(gap, &contact.name, contact.span);
        let switch = switch.map_err(|form| {
            let what = match form {
                Form::Definite(sign) if sign > 0.0 => {
                    "its gap is never negative: no side of its zeros is inside the body"
                }
                Form::Definite(_) => "its gap is never positive: the contact could not be open",
                Form::OddPower(_) => "its gap is a power, with a slope of zero where it is zero",
                _ => "its gap is compared elsewhere too, or is that of another contact",
            };
            no_contact(contact, what, contact.gap_span)
        })?;
        let force = 1.0 - self.model.exprs.expr(self.switches.list[switch].alpha);
        for direction in &normal {
            let rate = &mut rates[direction.state];
            *rate = *rate + direction.push * force;
        }
        let friction = friction.map(|friction| self.rub(contact, friction, force, rates));
        Ok(Some(Contact {
            name: contact.name.clone(),
            gap,
            speed,
            normal,
            restitution,
            friction,
            switch,
            span: contact.span,
        }))
    }

    /// The gap with its rate in free motion and what a force along J_n does.
    fn gap(
        &mut self,
        contact: &model::Contact<'e>,
        free: &[Expr<'e>],
        places: &Places<'e>,
    ) -> Result<(Expr<'e>, Expr<'e>, Vec<Direction<'e>>), Box<SystemError>> {
        let gap = self.in_alphas(contact.gap, contact.gap_span);
        let speed = self.along(gap, free, places);
        let is_smooth = |e: Expr<'e>| self.switches.alphas_of(e).is_empty();
        if !is_smooth(gap) || !is_smooth(speed) {
            let what = "its gap, or the rate of it, has a switching term";
            return Err(no_contact(contact, what, contact.gap_span));
        }
        let vars = variables_of(&[gap]);
        if vars.iter().any(|var| places.velocities.contains_key(var)) {
            let what = "its gap depends on velocities";
            return Err(no_contact(contact, what, contact.gap_span));
        }
        let normal = self.directions(speed, places);
        if normal.is_empty() {
            let what = "its gap does not depend on positions of a `mechanics` block";
            return Err(no_contact(contact, what, contact.gap_span));
        }
        Ok((gap, speed, normal))
    }

    /// Adds friction -μ λ_n (2α_t - 1) along every entry of the slip velocity.
    fn rub(
        &mut self,
        contact: &model::Contact<'e>,
        (coefficient, tangents): (Expr<'e>, Vec<Tangent<'e>>),
        force: Expr<'e>,
        rates: &mut [Expr<'e>],
    ) -> Friction<'e> {
        let mut slips = Vec::new();
        for (velocity, tangent) in tangents {
            let switch = (self.switches).keep(velocity, &contact.name, contact.span);
            let alpha = self.model.exprs.expr(self.switches.list[switch].alpha);
            let sign = 2.0 * alpha - 1.0;
            for direction in &tangent {
                let rate = &mut rates[direction.state];
                *rate = *rate - coefficient * direction.push * force * sign;
            }
            slips.push(Slip {
                velocity,
                tangent,
                switch,
            });
        }
        Friction { coefficient, slips }
    }

    /// The law of restitution with e in α.
    pub(super) fn restitution(
        &mut self,
        contact: &model::Contact<'e>,
    ) -> Result<Restitution<'e>, Box<SystemError>> {
        let e = self.coefficient(contact.restitution.coefficient, contact.span)?;
        let all = self.model.statements.contacts.iter();
        let mut before = all.take_while(|other| other.name != contact.name);
        if let Some(other) = before.find(|other| !other.restitution.agrees(contact.restitution)) {
            let what = format!("its law of restitution is not that of `{}`", other.name);
            return Err(no_contact(contact, &what, contact.span));
        }
        if self.at_corners(e, |e| (0.0..=1.0).contains(&e)) {
            return Ok(contact.restitution.with(e));
        }
        let what = "its restitution is not in [0, 1]";
        Err(no_contact(contact, what, contact.span))
    }

    /// μ in α.
    pub(super) fn friction(
        &mut self,
        contact: &model::Contact<'e>,
        (friction, span): (Expr<'e>, Span),
    ) -> Result<Expr<'e>, Box<SystemError>> {
        let friction = self.coefficient(friction, span)?;
        if self.at_corners(friction, |mu| mu >= 0.0) {
            return Ok(friction);
        }
        Err(no_contact(contact, "its friction is negative", span))
    }

    /// A coefficient of a law in α, whose switches are read as those of rates are.
    fn coefficient(&mut self, e: Expr<'e>, span: Span) -> Result<Expr<'e>, Box<SystemError>> {
        let e = self.replace(e, span);
        let sampler = || self.sampler();
        let errors = check_reading(&self.switches, e, span, sampler, self.model);
        match errors.into_iter().next() {
            Some(error) => Err(Box::new(error)),
            None => Ok(self.switches.merged(e)),
        }
    }

    /// Whether what is a number on every side of its switches has a property there.
    fn at_corners(&self, e: Expr<'e>, holds: impl Fn(f64) -> bool) -> bool {
        let mut corners = vec![self.in_numbers(e)];
        for alpha in self.switches.alphas_of(e) {
            if corners.len() > MANY_CORNERS {
                return true;
            }
            let sides = |e: &Expr<'e>| [0.0, 1.0].map(|side| at(*e, alpha, side));
            corners = corners.iter().flat_map(sides).collect();
        }
        corners.into_iter().filter_map(Expr::as_constant).all(holds)
    }

    /// The entries of the slip velocity with M⁻¹J_t: as they are given, or else the normal turned clockwise in the
    /// plane.
    pub(super) fn tangents(
        &mut self,
        contact: &model::Contact<'e>,
        normal: &[Direction<'e>],
        places: &Places<'e>,
    ) -> Result<Vec<Tangent<'e>>, Box<SystemError>> {
        let name = || contact.name.clone();
        let (given, span) = &contact.slip;
        if given.is_empty() {
            let slip = self.turned(normal, places);
            let slip = slip.ok_or_else(|| SystemError::NoTangent {
                name: name(),
                span: contact.span,
            })?;
            return Ok(vec![(slip, self.directions(slip, places))]);
        }
        let is_velocity = |var: &Var| places.velocities.contains_key(var);
        let is_linear = |direction: &Direction<'e>| {
            let vars = variables_of(&[direction.row]);
            !vars.iter().any(is_velocity)
        };
        let mut tangents = Vec::new();
        for &slip in given {
            let slip = self.in_alphas(slip, *span);
            let tangent = self.directions(slip, places);
            let alphas = self.switches.alphas_of(slip);
            if !tangent.is_empty() && tangent.iter().all(is_linear) && !alphas.is_empty() {
                let (name, span) = (name(), *span);
                return Err(Box::new(self.slip_that_switches(name, &alphas, span)));
            }
            if tangent.is_empty() || !tangent.iter().all(is_linear) {
                let what = "its slip is not linear in velocities of a `mechanics` block";
                return Err(no_contact(contact, what, *span));
            }
            tangents.push((slip, tangent));
        }
        Ok(tangents)
    }

    /// What a slip velocity that holds switches does where these change their sides.
    fn slip_that_switches(&self, name: String, alphas: &[Var], span: Span) -> SystemError {
        let switches = alphas
            .iter()
            .filter_map(|&alpha| self.switches.of_alpha(alpha));
        let names: Vec<String> = switches
            .map(|k| format!("`{}`", self.switches.name_of(k)))
            .collect();
        SystemError::SlipSwitches {
            name,
            switches: names.join(", "),
            span,
        }
    }

    /// tᵀv for t = (n_y, -n_x)/|n| of every body with two velocities and a mass that is a number: then q' = v are
    /// positions in the plane. Nothing where some body has others.
    fn turned(&self, normal: &[Direction<'e>], places: &Places<'e>) -> Option<Expr<'e>> {
        let model = self.model;
        let vars = &places.all;
        let row = |entry: usize| {
            let place = places.states.get(&vars[entry].as_variable()?)?;
            let direction = normal.iter().find(|direction| direction.state == *place);
            Some(direction.map_or(model.exprs.constant(0.0), |direction| direction.row))
        };
        let mut length = None;
        let mut terms = Vec::new();
        for body in &model.statements.bodies {
            let touched = |&entry: &usize| row(entry).is_some_and(|row| !row.is_zero());
            if !body.velocities.iter().any(touched) {
                continue;
            }
            let &[x, y] = &body.velocities[..] else {
                return None;
            };
            let [a, b, c, d] = body.mass[..] else {
                return None;
            };
            if a != d || !b.is_zero() || !c.is_zero() {
                return None;
            }
            let (n_x, n_y) = (row(x)?, row(y)?);
            let length = *length.get_or_insert((n_x * n_x + n_y * n_y).sqrt());
            terms.push((n_y * vars[x] - n_x * vars[y]) / length);
        }
        Some(model.exprs.sum(terms))
    }

    /// An expression of the model in α.
    pub(super) fn in_alphas(&mut self, e: Expr<'e>, span: Span) -> Expr<'e> {
        let e = self.replace(e, span);
        self.switches.merged(e)
    }

    /// dc/dt = ∇c·f + ∂c/∂t
    pub(super) fn along(&self, c: Expr<'e>, rates: &[Expr<'e>], places: &Places<'e>) -> Expr<'e> {
        let vars = variables_of(&[c]);
        let states = vars
            .iter()
            .filter_map(|var| Some((*var, *places.states.get(var)?)));
        let terms = states.map(|(var, place)| c.diff(var) * rates[place]);
        let by_time = self.model.time.as_variable().map(|time| c.diff(time));
        self.model.exprs.sum(terms.chain(by_time))
    }

    /// J and M⁻¹J of a function of velocities.
    pub(super) fn directions(
        &mut self,
        speed: Expr<'e>,
        places: &Places<'e>,
    ) -> Vec<Direction<'e>> {
        let model = self.model;
        let mut slopes: Vec<(usize, usize, Expr<'e>)> = Vec::new();
        for var in variables_of(&[speed]) {
            if let Some(&(body, k)) = places.velocities.get(&var) {
                let slope = speed.diff(var);
                if !slope.is_zero() {
                    slopes.push((body, k, slope));
                }
            }
        }
        let mut bodies: Vec<usize> = slopes.iter().map(|slope| slope.0).collect();
        bodies.sort_unstable();
        bodies.dedup();
        let zero = model.exprs.constant(0.0);
        let vars = &places.all;
        let mut found = Vec::new();
        for b in bodies {
            let body = &model.statements.bodies[b];
            let n = body.velocities.len();
            let mut row = vec![zero; n];
            for &(_, k, slope) in slopes.iter().filter(|slope| slope.0 == b) {
                row[k] = slope;
            }
            for (i, &entry) in body.velocities.iter().enumerate() {
                let terms = (0..n).map(|j| body.inverse[i * n + j] * row[j]);
                let push = model.exprs.sum(terms);
                let push = self.in_alphas(push, body.span);
                let place = vars[entry].as_variable();
                let place = place.and_then(|var| places.states.get(&var));
                if let Some(&state) = place.filter(|_| !push.is_zero() || !row[i].is_zero()) {
                    let row = row[i];
                    found.push(Direction { state, row, push });
                }
            }
        }
        found
    }

    /// The blocks of mechanics that are kept.
    pub(super) fn bodies(&mut self) -> Vec<Body<'e>> {
        let model = self.model;
        let places: FxHashMap<usize, usize> = (self.kept_states().enumerate())
            .map(|(place, (entry, _))| (entry, place))
            .collect();
        let mut bodies = Vec::new();
        for body in &model.statements.bodies {
            let kept: Vec<usize> = (0..body.velocities.len())
                .filter(|&k| places.contains_key(&body.velocities[k]))
                .collect();
            if kept.is_empty() {
                continue;
            }
            let n = body.velocities.len();
            let mut mass = Vec::new();
            for &i in &kept {
                mass.extend(
                    kept.iter()
                        .map(|&j| self.in_alphas(body.mass[i * n + j], body.span)),
                );
            }
            let force = kept
                .iter()
                .map(|&k| self.in_alphas(body.force[k], body.span));
            let force = force.collect();
            bodies.push(Body {
                positions: (body.positions.iter())
                    .filter_map(|entry| places.get(entry).copied())
                    .collect(),
                velocities: kept.iter().map(|&k| places[&body.velocities[k]]).collect(),
                mass,
                force,
                span: body.span,
            });
        }
        bodies
    }

    /// The contacts, once only the switches `kept` are left.
    pub(super) fn finished_contacts(
        &self,
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
}

/// Why a contact is none.
fn no_contact(contact: &model::Contact<'_>, what: &str, span: Span) -> Box<SystemError> {
    let (name, what) = (contact.name.clone(), what.to_owned());
    Box::new(SystemError::NoContact { name, what, span })
}
