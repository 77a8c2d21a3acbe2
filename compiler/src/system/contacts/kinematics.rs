//! Kinematics of bodies: what forces along a gap or a slip velocity do.
//!
//! J_nᵀ = ∂gap'/∂v, J_tᵀ = ∂w/∂v, and M⁻¹J is how a force moves v.

use rustc_hash::FxHashMap;

use super::no_contact;
use crate::expr::{Expr, Var, variables_of};
use crate::model;
use crate::source::Span;
use crate::system::lower::instance::Instance;
use crate::system::lower::translation::Translation;
use crate::system::switches::Switches;
use crate::system::{Body, Direction, SystemError};

/// An entry of a slip velocity, and what a force along it does.
pub(crate) type Tangent<'e> = (Expr<'e>, Vec<Direction<'e>>);

/// The velocities of bodies.
pub(crate) struct Kinematics<'s, 'm, 'e> {
    pub instance: &'s Instance<'m, 'e>,
    /// Of every velocity: (body, velocity).
    pub velocities: FxHashMap<Var, (usize, usize)>,
}

impl<'s, 'm, 'e> Kinematics<'s, 'm, 'e> {
    pub fn of(instance: &'s Instance<'m, 'e>) -> Self {
        let mut velocities = FxHashMap::default();
        for (b, body) in instance.model.statements.bodies.iter().enumerate() {
            let entries = body.velocities.iter().enumerate();
            let var = |entry: usize| instance.vars[entry].as_variable();
            velocities.extend(entries.filter_map(|(k, &entry)| Some((var(entry)?, (b, k)))));
        }
        Kinematics {
            instance,
            velocities,
        }
    }

    /// The entries of the slip velocity with M⁻¹J_t: as they are given, or else the normal turned clockwise in the
    /// plane.
    pub(crate) fn tangents(
        &self,
        contact: &model::Contact<'e>,
        normal: &[Direction<'e>],
        translation: &mut Translation<'_, 'e>,
    ) -> Result<Vec<Tangent<'e>>, Box<SystemError>> {
        let name = || contact.name.clone();
        let (given, span) = &contact.slip;
        if given.is_empty() {
            let slip = self.turned(normal);
            let slip = slip.ok_or_else(|| SystemError::NoTangent {
                name: name(),
                span: contact.span,
            })?;
            return Ok(vec![(slip, self.directions(slip, translation))]);
        }
        let is_velocity = |var: &Var| self.velocities.contains_key(var);
        let mut tangents = Vec::new();
        for &slip in given {
            let slip = translation.in_alphas(slip, *span);
            let tangent = self.directions(slip, translation);
            let switches = &translation.switches;
            let rows: Vec<Expr<'e>> = tangent.iter().map(|direction| direction.row).collect();
            if rows.is_empty() || variables_of(&rows).iter().any(is_velocity) {
                let what = "its slip is not linear in velocities of a `mechanics` block";
                return Err(no_contact(contact, what, *span));
            }
            // A surface may change its speed where something else does, and its direction never.
            let leads = |alpha: &Var| {
                let switch = switches.entries.of_alpha(*alpha);
                switch.is_some_and(|k| switches.is_leading(k))
            };
            let in_rows = variables_of(&rows);
            let mut alphas = switches.entries.alphas_of(slip);
            alphas.retain(|alpha| !leads(alpha) || in_rows.contains(alpha));
            if !alphas.is_empty() {
                let (name, span) = (name(), *span);
                return Err(Box::new(slip_that_switches(switches, name, &alphas, span)));
            }
            tangents.push((slip, tangent));
        }
        Ok(tangents)
    }

    /// tᵀv for t = (n_y, -n_x)/|n| of every body with two velocities and a mass that is a number: then q' = v are
    /// positions in the plane. Nothing where some body has others.
    fn turned(&self, normal: &[Direction<'e>]) -> Option<Expr<'e>> {
        let (model, vars) = (self.instance.model, &self.instance.vars);
        let row = |entry: usize| {
            let place = self.instance.place(entry)?;
            let direction = normal.iter().find(|direction| direction.state == place);
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

    /// J and M⁻¹J of a function of velocities.
    pub(crate) fn directions(
        &self,
        speed: Expr<'e>,
        translation: &mut Translation<'_, 'e>,
    ) -> Vec<Direction<'e>> {
        let model = self.instance.model;
        let mut slopes: Vec<(usize, usize, Expr<'e>)> = Vec::new();
        for var in variables_of(&[speed]) {
            if let Some(&(body, k)) = self.velocities.get(&var) {
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
                let push = translation.in_alphas(push, body.span);
                let place = self.instance.place(entry);
                if let Some(state) = place.filter(|_| !push.is_zero() || !row[i].is_zero()) {
                    let row = row[i];
                    found.push(Direction { state, row, push });
                }
            }
        }
        found
    }
}

/// What a slip velocity that holds switches does where these change their sides.
fn slip_that_switches(
    switches: &Switches<'_>,
    name: String,
    alphas: &[Var],
    span: Span,
) -> SystemError {
    let inside = alphas.iter();
    let inside = inside.filter_map(|&alpha| switches.entries.of_alpha(alpha));
    let names: Vec<String> = inside
        .map(|k| format!("`{}`", switches.name_of(k)))
        .collect();
    SystemError::SlipSwitches {
        name,
        switches: names.join(", "),
        span,
    }
}

/// The blocks of mechanics that are kept.
pub(crate) fn bodies<'e>(translation: &mut Translation<'_, 'e>) -> Vec<Body<'e>> {
    let instance = translation.instance;
    let mut bodies = Vec::new();
    for body in &instance.model.statements.bodies {
        let kept: Vec<usize> = (0..body.velocities.len())
            .filter(|&k| instance.place(body.velocities[k]).is_some())
            .collect();
        if kept.is_empty() {
            continue;
        }
        let n = body.velocities.len();
        let mut mass = Vec::new();
        for &i in &kept {
            mass.extend(
                kept.iter()
                    .map(|&j| translation.in_alphas(body.mass[i * n + j], body.span)),
            );
        }
        let force = kept
            .iter()
            .map(|&k| translation.in_alphas(body.force[k], body.span));
        let force = force.collect();
        bodies.push(Body {
            positions: (body.positions.iter())
                .filter_map(|&entry| instance.place(entry))
                .collect(),
            velocities: (body.velocities.iter())
                .filter_map(|&entry| instance.place(entry))
                .collect(),
            mass,
            force,
            span: body.span,
        });
    }
    bodies
}
