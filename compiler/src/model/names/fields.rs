//! What stands in parts: `b.force`, `b[2].q`, `a.floor.s`.

use std::rc::Rc;

use super::scope::{Meaning, Reported, Scope, Value};
use crate::model::ModelError;
use crate::model::expressions::Lowering;
use crate::model::hir::reserved::did_you_mean;
use crate::syntax::{Expr, ExprKind, Ident};

impl<'a, 'e> Lowering<'a, 'e> {
    #[inline(never)]
    pub fn field(
        &mut self,
        expr: &Expr,
        base: &Expr,
        field: &Ident,
    ) -> Result<Value<'e>, Reported> {
        let Some((name, meaning)) = self.meaning(expr)? else {
            let name = self.written().text(base);
            // A base that is not there at all is the better thing to report.
            self.expr(base)?;
            let (field, span) = (field.name.clone(), field.span);
            let help = Some("only parts have fields".into());
            return self.error(ModelError::NoField {
                name,
                field,
                span,
                help,
            });
        };
        match meaning {
            Meaning::Value(value, kind) => {
                self.varies |= !matches!(kind, crate::model::TargetKind::Const);
                Ok(value.clone())
            }
            _ => self.refuse(meaning.no_value(name, expr.span)),
        }
    }

    /// What a name or a field of a part means; nothing for other expressions and for local names.
    pub fn meaning<'x>(
        &mut self,
        expr: &'x Expr,
    ) -> Result<Option<(&'x str, &'a Meaning<'e>)>, Reported> {
        match &expr.kind {
            ExprKind::Name(name) if !self.is_local(name) => {
                Ok(self.visible(name).map(|meaning| (&**name, meaning)))
            }
            ExprKind::Field(base, field) if self.module(base).is_some() => {
                let Some((name, module)) = self.module(base) else {
                    return Ok(None);
                };
                match module.declared(&field.name) {
                    Some(meaning) => Ok(Some((&field.name, meaning))),
                    None => self.not_in_module(name, module, field),
                }
            }
            ExprKind::Field(base, field) => match self.place(base)? {
                Some((name, part)) => {
                    let meaning = self.own(name, part, field)?;
                    Ok(Some((&field.name, meaning)))
                }
                None => Ok(None),
            },
            _ => Ok(None),
        }
    }

    /// The file that a name means.
    pub fn module<'x>(&self, expr: &'x Expr) -> Option<(&'x str, &'a Rc<Scope<'e>>)> {
        let ExprKind::Name(name) = &expr.kind else {
            return None;
        };
        match self.scope.of_file.get(name) {
            Some(Meaning::Module(module)) if !self.is_local(name) => Some((name, module)),
            _ => None,
        }
    }

    /// Reports a name that a file does not declare, or a function without a call.
    pub fn not_in_module<T>(
        &mut self,
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
            return self.error(ModelError::NotAValue {
                name: text,
                kind: "function",
                span,
                help,
            });
        }
        let help = did_you_mean(&text, module.declares.iter().map(String::as_str));
        let name = text;
        self.error(ModelError::NotInFile { name, span, help })
    }

    /// True for a name that holds in a part of the model only.
    pub fn is_local(&self, name: &str) -> bool {
        self.locals.iter().any(|local| local.name() == name)
    }

    /// The part that an expression means.
    fn place<'x>(
        &mut self,
        expr: &'x Expr,
    ) -> Result<Option<(&'x str, &'a Rc<Scope<'e>>)>, Reported> {
        if let ExprKind::Index(base, indices) = &expr.kind {
            let Some((name, Meaning::Parts(members))) = self.meaning(base)? else {
                return Ok(None);
            };
            let part = self.member(name, indices, members, 1, "range", expr.span)?;
            return Ok(Some((name, part)));
        }
        match self.meaning(expr)? {
            Some((name, Meaning::Part(part))) => Ok(Some((name, part))),
            Some((name, meaning @ (Meaning::Parts(_) | Meaning::Unusable))) => {
                self.refuse(meaning.no_value(name, expr.span))
            }
            _ => Ok(None),
        }
    }

    /// What a field of a part means.
    pub fn own<'m>(
        &mut self,
        name: &str,
        part: &'m Scope<'e>,
        field: &Ident,
    ) -> Result<&'m Meaning<'e>, Reported> {
        match part.names.get(&field.name) {
            Some(meaning) => Ok(meaning),
            None if part.forgiving => Err(Reported),
            None => {
                let help = did_you_mean(&field.name, part.own_names());
                self.error(ModelError::NoField {
                    name: name.to_owned(),
                    field: field.name.clone(),
                    span: field.span,
                    help,
                })
            }
        }
    }
}
