//! What stands in parts: `b.force`, `b[2].q`, `a.floor.s`.

use std::collections::BTreeMap;
use std::rc::Rc;

use super::scope::{Meaning, Reported, Scope, Value};
use crate::model::ModelError;
use crate::model::expressions::Lowering;
use crate::model::hir::reserved::did_you_mean;
use crate::source::Span;
use crate::syntax::{Expr, ExprKind, Ident, Index};

impl<'a, 'e> Lowering<'a, 'e> {
    #[inline(never)]
    pub fn field(
        &mut self,
        expr: &Expr,
        base: &Expr,
        field: &Ident,
    ) -> Result<Value<'e>, Reported> {
        let Some((name, meaning)) = self.meaning(expr)? else {
            let name = self.text(base);
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
            Meaning::Family { binders, .. } => self.needs_indices(name, binders.len(), expr.span),
            Meaning::Part(part) => self.is_a_part(name, part, expr.span),
            Meaning::Parts(_) => self.needs_indices(name, 1, expr.span),
            Meaning::Word(kind) => self.error(ModelError::NotAValue {
                name: name.to_owned(),
                kind,
                span: expr.span,
                help: None,
            }),
            Meaning::Module(_) => self.is_a_file(name, expr.span),
            Meaning::Unusable => Err(Reported),
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

    /// Reports a file where a value must stand.
    pub fn is_a_file<T>(&mut self, name: &str, span: Span) -> Result<T, Reported> {
        let help = Some(format!("name what is in it, as in `{name}.something`"));
        self.error(ModelError::NotAValue {
            name: name.to_owned(),
            kind: "file",
            span,
            help,
        })
    }

    fn is_local(&self, name: &str) -> bool {
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
            let part = self.member_part(name, indices, members, expr.span)?;
            return Ok(Some((name, part)));
        }
        match self.meaning(expr)? {
            Some((name, Meaning::Part(part))) => Ok(Some((name, part))),
            Some((name, Meaning::Parts(_))) => self.needs_indices(name, 1, expr.span),
            Some((_, Meaning::Unusable)) => Err(Reported),
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

    /// One of an array of parts.
    pub fn member_part<'m>(
        &mut self,
        name: &str,
        indices: &[Index],
        members: &'m BTreeMap<i64, Rc<Scope<'e>>>,
        span: Span,
    ) -> Result<&'m Rc<Scope<'e>>, Reported> {
        let index = self.member_indices(name, 1, indices, span)?[0];
        if let Some(part) = members.get(&index) {
            return Ok(part);
        }
        let valid = match (members.keys().next(), members.keys().next_back()) {
            (Some(first), Some(last)) => format!("{first}..{last}"),
            _ => "none: its range is empty".to_owned(),
        };
        self.error(ModelError::OutOfRange {
            index: index.to_string(),
            what: format!("`{name}`"),
            valid,
            span,
        })
    }

    /// Reports a part where a value must stand.
    pub fn is_a_part<T>(
        &mut self,
        name: &str,
        part: &Scope<'e>,
        span: Span,
    ) -> Result<T, Reported> {
        let example = part.own_names().min();
        let help = example.map(|field| format!("read what is in it, as in `{name}.{field}`"));
        self.error(ModelError::NotAValue {
            name: name.to_owned(),
            kind: "part",
            span,
            help,
        })
    }
}
