//! What stands in parts: `b.force`, `b[2].q`, `a.floor.s`.

use std::rc::Rc;

use super::lookup::member;
use super::scope::{Meaning, Reported, Scope, Value};
use crate::model::ModelError;
use crate::model::expressions::Lowering;
use crate::model::hir::reserved::{did_you_mean, one_of};
use crate::syntax::{Expr, ExprKind, Ident};

#[inline(never)]
pub(crate) fn field<'e>(
    lowering: &mut Lowering<'_, 'e>,
    expr: &Expr,
    base: &Expr,
    field: &Ident,
) -> Result<Value<'e>, Reported> {
    let Some((name, meaning)) = meaning(lowering, expr)? else {
        let name = lowering.names.written().text(base);
        // A base that is not there at all is the better thing to report.
        lowering.expr(base)?;
        let (field, span) = (field.name.clone(), field.span);
        let help = Some("only parts have fields".into());
        return lowering.error(ModelError::NoField {
            name,
            field,
            span,
            help,
        });
    };
    match meaning {
        Meaning::Value(value, kind) => {
            lowering.varies |= !matches!(kind, crate::model::TargetKind::Const);
            Ok(value.clone())
        }
        _ => lowering.refuse(meaning.no_value(name, expr.span)),
    }
}

/// What a name or a field of a part means; nothing for other expressions and for local names.
pub(crate) fn meaning<'a, 'e, 'x>(
    lowering: &mut Lowering<'a, 'e>,
    expr: &'x Expr,
) -> Result<Option<(&'x str, &'a Meaning<'e>)>, Reported> {
    match &expr.kind {
        ExprKind::Name(name) if !lowering.names.is_local(name) => Ok(lowering
            .names
            .visible(name)
            .map(|meaning| (&**name, meaning))),
        ExprKind::Field(base, field) if lowering.names.module(base).is_some() => {
            let Some((name, module)) = lowering.names.module(base) else {
                return Ok(None);
            };
            match module.declared(&field.name) {
                Some(meaning) => Ok(Some((&field.name, meaning))),
                None => not_in_module(lowering, name, module, field),
            }
        }
        ExprKind::Field(base, field) => match place(lowering, base)? {
            Some((name, part)) => {
                let meaning = own(lowering, name, part, field)?;
                Ok(Some((&field.name, meaning)))
            }
            None => Ok(None),
        },
        _ => Ok(None),
    }
}

/// Reports a name that a file does not declare, or a function without a call.
pub(crate) fn not_in_module<'e, T>(
    lowering: &mut Lowering<'_, 'e>,
    name: &str,
    module: &Scope<'e>,
    field: &Ident,
) -> Result<T, Reported> {
    let (text, span) = (field.name.clone(), field.span);
    if module.forgiving {
        return Err(Reported);
    }
    if module.functions.contains_key(&text) && module.declares.contains(&text) {
        let help = Some(format!("call it: `{name}.{text}(..)`"));
        return lowering.error(ModelError::NotAValue {
            name: text,
            kind: "function",
            span,
            help,
        });
    }
    let help = did_you_mean(&text, module.declares.iter().map(String::as_str));
    let name = text;
    lowering.error(ModelError::NotInFile { name, span, help })
}

/// The part that an expression means.
fn place<'a, 'e, 'x>(
    lowering: &mut Lowering<'a, 'e>,
    expr: &'x Expr,
) -> Result<Option<(&'x str, &'a Rc<Scope<'e>>)>, Reported> {
    if let ExprKind::Index(base, indices) = &expr.kind {
        let Some((name, Meaning::Parts(members))) = meaning(lowering, base)? else {
            return Ok(None);
        };
        let part = member(lowering, name, indices, members, 1, "range", expr.span)?;
        return Ok(Some((name, part)));
    }
    match meaning(lowering, expr)? {
        Some((name, Meaning::Part(part))) => Ok(Some((name, part))),
        Some((name, meaning @ (Meaning::Parts(_) | Meaning::Unusable))) => {
            lowering.refuse(meaning.no_value(name, expr.span))
        }
        _ => Ok(None),
    }
}

/// What a field of a part means.
pub(crate) fn own<'e, 'm>(
    lowering: &mut Lowering<'_, 'e>,
    name: &str,
    part: &'m Scope<'e>,
    field: &Ident,
) -> Result<&'m Meaning<'e>, Reported> {
    match part.names.get(&field.name) {
        Some(meaning) => Ok(meaning),
        None if part.forgiving => Err(Reported),
        None => {
            let place = format!("`{name}` has");
            let help = one_of(&field.name, &place, part.own_names());
            lowering.error(ModelError::NoField {
                name: name.to_owned(),
                field: field.name.clone(),
                span: field.span,
                help,
            })
        }
    }
}
