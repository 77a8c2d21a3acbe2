//! Expressions back to text, with loop indices and arguments put in: the names of surfaces.

use crate::model::expressions::environment::{Environment, Local};
use crate::model::names::scope::Scope;
use crate::syntax::{Expr, Level, Path, Segment, Writer};

/// What stands for names in a text.
pub(crate) struct Naming<'l, 'e> {
    locals: &'l [Local<'e>],
    /// The names that the whole knows by another name: `a.v` for `v` in part `a`.
    part: Option<&'l Scope<'e>>,
}

impl<'e> Environment<'_, 'e> {
    /// Names as written, with the current indices and arguments in them.
    pub fn written(&self) -> Naming<'_, 'e> {
        let locals = &self.locals;
        Naming { locals, part: None }
    }

    /// Names as the whole knows them.
    pub fn whole(&self) -> Naming<'_, 'e> {
        let is_part = !self.in_function && !self.scope.prefix.is_empty();
        Naming {
            part: is_part.then_some(self.scope),
            ..self.written()
        }
    }
}

impl Naming<'_, '_> {
    /// The text of an expression.
    pub fn text(&self, expr: &Expr) -> String {
        self.at_level(expr, Level::Conditional)
    }

    /// The text, in parentheses unless it holds together as tightly as this.
    pub fn at_level(&self, expr: &Expr, level: Level) -> String {
        let names = |name: &str| self.name(name);
        Writer {
            names: Some(&names),
        }
        .at_level(expr, level)
    }

    /// The text of a path; its first name is as written.
    pub fn path(&self, path: &Path) -> String {
        let names = |name: &str| self.name(name);
        let writer = Writer {
            names: Some(&names),
        };
        let mut text = path.head.name.clone();
        for segment in &path.rest {
            text += &match segment {
                Segment::Field(field) => format!(".{}", field.name),
                Segment::Index(indices) => format!("[{}]", writer.indices(indices)),
            };
        }
        text
    }

    fn name(&self, name: &str) -> Option<String> {
        let mut locals = self.locals.iter().rev();
        match locals.find(|local| local.name() == name) {
            Some(Local::Value { text, .. }) => Some(text.clone()),
            Some(Local::Let { .. }) => None,
            None => {
                let part = self.part.filter(|part| part.names.contains_key(name))?;
                Some(format!("{}{name}", part.prefix))
            }
        }
    }
}
