//! `restitution = e;`, `newton(e)`, `poisson(e)` and `plastic`: what a contact gives back of an impact.
//!
//! A number is the e of Newton's law, and `plastic` is e = 0 of any.

use std::fmt;

use nsd_solver::contact::ImpactLaw;

use crate::diagnostics::Help;
use crate::expr::Expr;
use crate::model::DynamicsError;
use crate::model::expressions::Lowering;
use crate::model::hir::reserved::{VALUES, closest, is_function};
use crate::model::names::scope::Reported;
use crate::source::Span;
use crate::syntax::{self, Arg, ExprKind};

/// The laws that have a coefficient, by their words.
const LAWS: [(&str, ImpactLaw); 2] = [
    ("newton", ImpactLaw::Newton),
    ("poisson", ImpactLaw::Poisson),
];
/// The word of e = 0.
const PLASTIC: &str = "plastic";

/// A law of impacts with its coefficient.
#[derive(Clone, Copy, Debug)]
pub struct Restitution<'e> {
    /// What e multiplies.
    pub law: ImpactLaw,
    /// e, in [0, 1].
    pub coefficient: Expr<'e>,
}

/// A law as it is written, with its coefficient: none is zero.
type Written<'s> = (ImpactLaw, Option<&'s syntax::Expr>);

impl<'e> Restitution<'e> {
    /// The same law with another coefficient.
    #[must_use]
    pub fn with(self, coefficient: Expr<'e>) -> Self {
        Restitution {
            coefficient,
            ..self
        }
    }

    /// Whether impacts of both have one law: e = 0 is the same in all.
    pub fn agrees(self, other: Restitution<'e>) -> bool {
        let bounce = ![self, other].iter().any(|r| r.coefficient.is_zero());
        self.law == other.law || !bounce
    }

    /// The e of Newton's law, where it is the law.
    pub fn newton(self) -> Option<Expr<'e>> {
        (self.law == ImpactLaw::Newton).then_some(self.coefficient)
    }
}

impl fmt::Display for Restitution<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.newton() {
            Some(e) => write!(f, "{e}"),
            None => write!(f, "{}({})", word(self.law), self.coefficient),
        }
    }
}

/// The word of a law.
fn word(law: ImpactLaw) -> &'static str {
    let entry = LAWS.iter().find(|(_, known)| *known == law);
    entry.expect("every law has a word").0
}

/// The law of this word; nothing where it is none.
fn named(word: &str) -> Option<ImpactLaw> {
    let entry = LAWS.iter().find(|(known, _)| *known == word);
    entry.map(|(_, law)| *law)
}

/// Whether a `restitution` is a law, and no coefficient alone.
pub(crate) fn is_law(value: &syntax::Expr) -> bool {
    head(value)
        .is_some_and(|(name, args)| named(name).is_some() || (name == PLASTIC && args.is_none()))
}

/// The word in front of a coefficient, or without one.
fn head(value: &syntax::Expr) -> Option<(&str, Option<&[Arg]>)> {
    let (of, args) = match &value.kind {
        ExprKind::Call(of, args) => (&**of, Some(&args[..])),
        _ => (value, None),
    };
    match &of.kind {
        ExprKind::Name(name) => Some((name, args)),
        _ => None,
    }
}

/// Where the word of a value is, with arguments or without.
fn word_at(value: &syntax::Expr) -> Span {
    match &value.kind {
        ExprKind::Call(of, _) => of.span,
        _ => value.span,
    }
}

/// The law of a `restitution`, or what is wrong with it and how it is written.
pub(crate) fn written(value: &syntax::Expr) -> Result<Written<'_>, (String, String)> {
    let Some((name, args)) = head(value) else {
        return Ok((ImpactLaw::Newton, Some(value)));
    };
    match (named(name), args) {
        (Some(law), Some([Arg::Positional(e, binders)])) if binders.is_empty() => {
            Ok((law, Some(e)))
        }
        (Some(_), _) => Err((
            format!("`{name}` has one coefficient"),
            format!("write `restitution = {name}(e);` with 0 <= e <= 1"),
        )),
        (None, None) if name == PLASTIC => Ok((ImpactLaw::Newton, None)),
        (None, Some(_)) if name == PLASTIC => Err((
            format!("`{PLASTIC}` has no coefficient"),
            format!("write `restitution = {PLASTIC};`, or the law that has one"),
        )),
        (None, _) => Ok((ImpactLaw::Newton, Some(value))),
    }
}

/// The law of a `restitution`.
pub(crate) fn read<'e>(
    lowering: &mut Lowering<'_, 'e>,
    value: &syntax::Expr,
) -> Result<Restitution<'e>, Reported> {
    let span = value.span;
    if let Some((name, args)) = head(value) {
        let words = || LAWS.iter().map(|(word, _)| *word).chain([PLASTIC]);
        let is_law = words().any(|word| word == name);
        match (is_law, is_declared(lowering, name, args.is_some())) {
            (true, true) => {
                let what = format!("`{name}` is a law of restitution, and declared in this model");
                return wrong(lowering, what, "declare it under another name".into(), span);
            }
            (false, false) => {
                if let Some(word) = closest(name, words()) {
                    let what = format!("there is no law of restitution `{name}`");
                    let help = Help::did_you_mean(&word);
                    return lowering.error(DynamicsError::NoLaw {
                        what,
                        help,
                        span: word_at(value),
                    });
                }
            }
            _ => {}
        }
    }
    let (law, coefficient) = match written(value) {
        Ok(written) => written,
        Err((what, help)) => return wrong(lowering, what, help, span),
    };
    let coefficient = match coefficient {
        Some(e) => lowering.scalar(e, "a restitution")?,
        None => lowering.constant(0.0),
    };
    Ok(Restitution { law, coefficient })
}

/// Whether the model gives a name a meaning, as a function or as a value.
fn is_declared(lowering: &Lowering<'_, '_>, name: &str, is_called: bool) -> bool {
    let scope = lowering.names.scope;
    if is_called {
        return is_function(name) || scope.functions.contains_key(name);
    }
    lowering.names.is_local(name) || VALUES.contains(&name) || scope.get(name).is_some()
}

fn wrong<T>(
    lowering: &mut Lowering<'_, '_>,
    what: String,
    help: String,
    span: Span,
) -> Result<T, Reported> {
    lowering.error(DynamicsError::MechanicsForm { what, help, span })
}
