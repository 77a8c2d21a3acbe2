//! Features of a gap: min(g₁, .., gₙ) ≥ 0 is gᵢ ≥ 0 for every i, so that each gᵢ has a contact of its own.
//!
//! A gap g(z) that depends on a term z = min(a, b) with a constant slope ∂g/∂z ≥ 0 is min(g(a), g(b)), and so it is of
//! max(a, b), and of |a| = max(a, -a), with ∂g/∂z ≤ 0. What is left has no such term.

use rustc_hash::FxHashSet;

use super::{NO_POSITIONS, no_contact};
use crate::diagnostics::Diagnostics;
use crate::expr::{BinaryFunction, Expr, Function, Node, Substitution, transform};
use crate::model;
use crate::system::SystemError;
use crate::system::lower::translation::Translation;
use crate::system::switches::known::Known;

/// A gap has at most this many features.
const MAX_FEATURES: usize = 512;

/// One of the functions whose smallest value a gap is.
pub(crate) struct Feature<'c, 'e> {
    /// The contact of the model.
    pub contact: &'c model::Contact<'e>,
    /// Its name, or `C[2]` where a gap has several features.
    pub name: String,
    pub gap: Expr<'e>,
    /// Whether the gap is written as the smallest of several, some of which may be open whatever positions are.
    pub is_one_of_several: bool,
}

impl Feature<'_, '_> {
    /// The contact that has this feature, where it is written with others.
    pub fn owner(&self) -> Option<String> {
        let owner = || self.contact.name.clone();
        self.is_one_of_several.then(owner)
    }
}

/// What becomes of every feature of the contacts that an experiment needs; the first error of a contact ends it.
pub(crate) fn map<'e, T>(
    translation: &mut Translation<'_, 'e>,
    diags: &mut Diagnostics,
    mut finish: impl FnMut(&Feature<'_, 'e>, &mut Translation<'_, 'e>) -> Result<T, Box<SystemError>>,
) -> Vec<T> {
    let instance = translation.instance;
    let mut found = Vec::with_capacity(instance.model.statements.contacts.len());
    for contact in &instance.model.statements.contacts {
        if !contact.exprs().all(|e| instance.needs.holds_all(e)) {
            continue;
        }
        let finished = of(contact, translation).and_then(|features| {
            let finished = features.iter().map(|feature| finish(feature, translation));
            finished.collect::<Result<Vec<T>, _>>()
        });
        match finished {
            Ok(finished) => found.extend(finished),
            Err(error) => diags.push(*error),
        }
    }
    found
}

/// The features of the gap of a contact, with their numbers in the order in which they are written. Of those that are
/// positive multiples of each other the first is there, and none that is a positive number: values of parameters decide
/// which features there are, and never their names.
fn of<'c, 'e>(
    contact: &'c model::Contact<'e>,
    translation: &Translation<'_, 'e>,
) -> Result<Vec<Feature<'c, 'e>>, Box<SystemError>> {
    let params = &translation.instance.params;
    let written = contact.gap.substitute(&translation.given);
    let mut gaps = Vec::new();
    split(written, params, &mut gaps);
    if gaps.len() > MAX_FEATURES {
        return Err(Box::new(SystemError::ManyFeatures {
            name: contact.name.clone(),
            limit: MAX_FEATURES,
            span: contact.gap_span,
        }));
    }
    let is_one_of_several = gaps.len() > 1;
    let mut gaps: Vec<(usize, Expr<'e>)> = (1..).zip(gaps).collect();
    let mut seen = FxHashSet::default();
    gaps.retain(|&(_, gap)| {
        let (scale, form) = params.in_numbers(gap).split_scale();
        let is_open = form.as_constant().is_some_and(|value| scale * value > 0.0);
        !is_open && seen.insert((scale > 0.0, form))
    });
    if gaps.is_empty() {
        return Err(no_contact(contact, NO_POSITIONS, contact.gap_span));
    }
    let (slip, span) = &contact.slip;
    if gaps.len() > 1 && contact.friction.is_some() && !slip.is_empty() {
        return Err(Box::new(SystemError::SlipOfFeatures {
            name: contact.name.clone(),
            features: gaps.len(),
            span: *span,
        }));
    }
    let features = gaps.into_iter().map(|(number, gap)| Feature {
        contact,
        name: match is_one_of_several {
            true => format!("{}[{number}]", contact.name),
            false => contact.name.clone(),
        },
        gap,
        is_one_of_several,
    });
    Ok(features.collect())
}

/// Finds the functions whose smallest value a gap is. No more are looked for once there are more than a gap may have: of
/// a sum of n absolute values there are 2ⁿ.
fn split<'e>(gap: Expr<'e>, params: &Known, found: &mut Vec<Expr<'e>>) {
    let z = gap.exprs().variable("z");
    let Some(var) = z.as_variable() else {
        return;
    };
    if found.len() > MAX_FEATURES {
        return;
    }
    // Terms come after those in them.
    for (kink, is_least, branches) in kinks(gap).into_iter().rev() {
        let in_z = transform(&[gap], &mut |e, image| if e == kink { z } else { image })[0];
        let slope = params.in_numbers(in_z.diff(var)).as_constant();
        let is_split = |slope: f64| match is_least {
            true => slope >= 0.0,
            false => slope <= 0.0,
        };
        if slope.is_some_and(is_split) {
            let at = |branch| in_z.substitute(&Substitution::one(var, branch));
            for branch in branches {
                split(at(branch), params, found);
            }
            return;
        }
    }
    found.push(gap);
}

/// A kink: the term, whether it is the least of its branches, and these.
type Kink<'e> = (Expr<'e>, bool, [Expr<'e>; 2]);

/// The kinks in a gap, each after those in it.
fn kinks<'e>(gap: Expr<'e>) -> Vec<Kink<'e>> {
    let mut found = Vec::new();
    transform(&[gap], &mut |e, image| {
        match e.node() {
            Node::Unary(Function::Abs, a) => found.push((e, false, [a, -a])),
            Node::Binary(BinaryFunction::Max, a, b) => found.push((e, false, [a, b])),
            Node::Binary(BinaryFunction::Min, a, b) => found.push((e, true, [a, b])),
            _ => {}
        }
        image
    });
    found
}

#[cfg(test)]
mod tests {
    use super::split;
    use crate::expr::{Expr, Exprs};
    use crate::system::switches::known::Known;

    fn features(of: impl for<'e> Fn(Expr<'e>, Expr<'e>) -> Expr<'e>) -> String {
        let exprs = Exprs::new();
        let (x, y) = (exprs.variable("x"), exprs.variable("y"));
        let mut features = Vec::new();
        split(of(x, y), &Known::default(), &mut features);
        let features: Vec<String> = features.iter().map(Expr::to_string).collect();
        features.join(", ")
    }

    #[test]
    fn gaps_are_split_where_they_are_the_smallest_of_several() {
        insta::assert_snapshot!(features(|x, y| x.min(1.0 - x).min(y)), @"x, 1 - x, y");
        insta::assert_snapshot!(features(|x, y| 2.0 - x.abs() - 3.0 * y.abs()), @"2 - x - 3*y, x - 3*y + 2, 2 - x + 3*y, x + 3*y + 2");
        insta::assert_snapshot!(features(|x, y| 1.0 + 2.0 * x.min(-x.max(y))), @"2*x + 1, 1 - 2*x, 1 - 2*y");
        insta::assert_snapshot!(features(|x, y| x.min(y).min(x.powi(2) - y)), @"x, y, x^2 - y");
    }

    #[test]
    fn what_is_larger_than_one_of_its_branches_stays() {
        insta::assert_snapshot!(features(|x, y| x.max(y)), @"max(x, y)");
        insta::assert_snapshot!(features(|x, y| x.min(y.max(1.0 - y))), @"x, max(y, 1 - y)");
        insta::assert_snapshot!(features(|x, y| x.abs().min(y) + x.abs()), @"2*abs(x), abs(x) + y");
        insta::assert_snapshot!(features(|x, y| x.min(y).powi(2)), @"min(x, y)^2");
    }
}
