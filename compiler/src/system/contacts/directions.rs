//! Directions of friction, where they can be judged: of a point.
//!
//! A block of two velocities in the plane, or of three in space, whose mass is a number, is a point. There the rows of
//! gap' = J_n v and w = J_t v are at right angles to each other and have one length: along a row of another length
//! friction has |J_t|/|J_n| times its coefficient, and of two directions that are not at right angles none of Coulomb's
//! cones is left. Rows of a body that turns hold lever arms, and say nothing of that.
//!
//! Rows are looked at where they are constant, or where the contact is closed at the start: beyond its surface a gap
//! may grow as it likes.

use rustc_hash::FxHashMap;

use super::start::Start;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, variables_of};
use crate::source::Span;
use crate::system::{Body, System, SystemError};

/// Numbers that are written out, as 0.7071, are good for so much.
const WRITTEN: f64 = 1e-4;

/// A contact with friction.
struct Rubbing<'s, 'e> {
    name: &'s str,
    gap: Expr<'e>,
    slips: Vec<Expr<'e>>,
    span: Span,
}

/// Warns of contacts of points whose directions are none.
pub(super) fn check(system: &System<'_>, start: &Start, diags: &mut Diagnostics) {
    let contacts = system.jumps.contacts.iter().filter_map(|contact| {
        let friction = contact.friction.as_ref()?;
        Some(Rubbing {
            name: &contact.name,
            gap: contact.gap,
            slips: friction.slips.iter().map(|slip| slip.velocity).collect(),
            span: contact.span,
        })
    });
    let impulsive = system.jumps.impulsive.iter().filter_map(|contact| {
        let (_, slips) = contact.friction.as_ref()?;
        Some(Rubbing {
            name: &contact.name,
            gap: contact.gap,
            slips: slips.clone(),
            span: contact.span,
        })
    });
    let rubbing: Vec<Rubbing<'_, '_>> = contacts.chain(impulsive).collect();
    if rubbing.is_empty() {
        return;
    }
    let places = Places::of(system);
    for contact in &rubbing {
        let body = places.point(contact);
        let rows = body.and_then(|body| places.rows(contact, body, start));
        if let Some((what, help)) = rows.and_then(|rows| wrong(contact.name, &rows)) {
            let span = contact.span;
            diags.push(SystemError::Directions { what, help, span });
        }
    }
}

/// Where the variables of a system are among its states, and states among its bodies.
struct Places<'s, 'e> {
    system: &'s System<'e>,
    of: FxHashMap<Var, usize>,
    body_of: FxHashMap<usize, usize>,
}

impl<'s, 'e> Places<'s, 'e> {
    fn of(system: &'s System<'e>) -> Self {
        let states = system.states.iter().enumerate();
        let of = states.filter_map(|(place, state)| Some((state.var.as_variable()?, place)));
        let mut body_of = FxHashMap::default();
        for (b, body) in system.jumps.bodies.iter().enumerate() {
            let own = body.positions.iter().chain(&body.velocities);
            body_of.extend(own.map(|&place| (place, b)));
        }
        Places {
            of: of.collect(),
            body_of,
            system,
        }
    }

    /// The body of a contact, where it is one alone, and a point.
    fn point(&self, contact: &Rubbing<'_, 'e>) -> Option<&'s Body<'e>> {
        let occurring = [&[contact.gap], &contact.slips[..]].concat();
        let occurring = variables_of(&occurring).into_iter();
        let mut own = occurring.filter_map(|var| self.body_of.get(self.of.get(&var)?));
        let first = own.next()?;
        let is_alone = own.all(|body| body == first);
        let body = &self.system.jumps.bodies[*first];
        let n = body.velocities.len();
        let is_number = (0..n * n).all(|k| match k / n == k % n {
            true => body.mass[k] == body.mass[0],
            false => body.mass[k].is_zero(),
        });
        (is_alone && is_number && n == contact.slips.len() + 1).then_some(body)
    }

    /// J_n and J_t of a point, where they are known.
    fn rows(
        &self,
        contact: &Rubbing<'_, 'e>,
        body: &Body<'e>,
        start: &Start,
    ) -> Option<Vec<Vec<f64>>> {
        let gap = contact.gap;
        let moving = variables_of(&[gap]).into_iter();
        let moving = moving.filter_map(|var| Some((var, *self.of.get(&var)?)));
        let speed = moving.map(|(var, place)| gap.diff(var) * self.system.states[place].rate);
        let speed = self.system.exprs.sum(speed);
        let vars = body.velocities.iter();
        let vars: Vec<Var> = vars
            .filter_map(|&place| self.system.states[place].var.as_variable())
            .collect();
        let row = |e: Expr<'e>| -> Vec<Expr<'e>> { vars.iter().map(|&var| e.diff(var)).collect() };
        let mut rows = vec![row(speed)];
        rows.extend(contact.slips.iter().map(|&slip| row(slip)));
        let time = self.system.time.as_variable();
        let varies = |var: &Var| self.of.contains_key(var) || Some(*var) == time;
        let is_constant = !variables_of(&rows.concat()).iter().any(varies);
        if !is_constant && start.gap(gap) != 0.0 {
            return None;
        }
        let numbers = |row: &Vec<Expr<'e>>| row.iter().map(|&e| start.value(e)).collect();
        Some(rows.iter().map(numbers).collect())
    }
}

/// What is wrong with J_n and J_t of a point, and what to do.
fn wrong(name: &str, rows: &[Vec<f64>]) -> Option<(String, &'static str)> {
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let length = |row: &[f64]| dot(row, row).sqrt();
    let are_oblique = |a: &[f64], b: &[f64]| dot(a, b).abs() > WRITTEN * length(a) * length(b);
    let (normal, slips) = rows.split_first()?;
    // Such a gap never acts.
    if length(normal) == 0.0 {
        return None;
    }
    if let [first, second] = slips
        && are_oblique(first, second)
    {
        let cosine = dot(first, second) / (length(first) * length(second));
        let angle = (cosine.clamp(-1.0, 1.0).acos().to_degrees() * 10.0).round() / 10.0;
        return Some((
            format!("the directions in which `{name}` slips are at {angle} degrees"),
            "write the velocities along two directions of the surface at right angles",
        ));
    }
    if slips.iter().any(|slip| are_oblique(normal, slip)) {
        return Some((
            format!("`{name}` slips in a direction that changes its gap"),
            "`slip` is the velocity of the point along the surface, which leaves the gap as it is",
        ));
    }
    let factors = slips.iter().map(|slip| length(slip) / length(normal));
    let off = |factor: &f64| (factor - 1.0).abs() > WRITTEN;
    let factor = factors.into_iter().find(off)?;
    let factor = (factor * 1e4).round() / 1e4;
    Some((
        format!("friction of `{name}` acts with {factor} times its coefficient"),
        "write the gap as a distance and `slip` as a velocity in space: a factor in one of them alone changes friction",
    ))
}
