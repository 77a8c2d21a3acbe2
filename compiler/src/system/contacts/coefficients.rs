//! Coefficients of the laws of contacts: 0 ≤ e ≤ 1 of restitution and μ ≥ 0 of friction, in α.

use super::no_contact;
use crate::expr::Expr;
use crate::model::{self, Restitution};
use crate::source::Span;
use crate::system::SystemError;
use crate::system::lower::translation::Translation;
use crate::system::switches::affine::at;

/// Beyond this many combinations of sides, coefficients of laws are looked at in runs only.
const MANY_CORNERS: usize = 1 << 10;

/// The law of restitution with e in α.
pub(crate) fn restitution<'e>(
    translation: &mut Translation<'_, 'e>,
    contact: &model::Contact<'e>,
) -> Result<Restitution<'e>, Box<SystemError>> {
    let instance = translation.instance;
    let e = coefficient(translation, contact.restitution.coefficient, contact.span)?;
    let all = instance.model.statements.contacts.iter();
    let mut before = all.take_while(|other| other.name != contact.name);
    if let Some(other) = before.find(|other| !other.restitution.agrees(contact.restitution)) {
        let what = format!("its law of restitution is not that of `{}`", other.name);
        return Err(no_contact(contact, &what, contact.span));
    }
    if at_corners(translation, e, |e| (0.0..=1.0).contains(&e)) {
        return Ok(contact.restitution.with(e));
    }
    let what = "its restitution is not in [0, 1]";
    Err(no_contact(contact, what, contact.span))
}

/// μ in α.
pub(crate) fn friction<'e>(
    translation: &mut Translation<'_, 'e>,
    contact: &model::Contact<'e>,
    (friction, span): (Expr<'e>, Span),
) -> Result<Expr<'e>, Box<SystemError>> {
    let friction = coefficient(translation, friction, span)?;
    if at_corners(translation, friction, |mu| mu >= 0.0) {
        return Ok(friction);
    }
    Err(no_contact(contact, "its friction is negative", span))
}

/// A coefficient of a law in α, whose switches are read as those of rates are.
fn coefficient<'e>(
    translation: &mut Translation<'_, 'e>,
    e: Expr<'e>,
    span: Span,
) -> Result<Expr<'e>, Box<SystemError>> {
    let e = translation.replace(e, span);
    match translation.misread(e, span).into_iter().next() {
        Some(error) => Err(Box::new(error)),
        None => Ok(translation.switches.entries.merged(e)),
    }
}

/// Whether what is a number on every side of its switches has a property there.
fn at_corners<'e>(
    translation: &Translation<'_, 'e>,
    e: Expr<'e>,
    holds: impl Fn(f64) -> bool,
) -> bool {
    let instance = translation.instance;
    let mut corners = vec![instance.params.in_numbers(e)];
    for alpha in translation.switches.entries.alphas_of(e) {
        if corners.len() > MANY_CORNERS {
            return true;
        }
        let sides = |e: &Expr<'e>| [0.0, 1.0].map(|side| at(*e, alpha, side));
        corners = corners.iter().flat_map(sides).collect();
    }
    corners.into_iter().filter_map(Expr::as_constant).all(holds)
}
