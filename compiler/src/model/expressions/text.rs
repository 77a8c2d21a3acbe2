//! Expressions back to text, with loop indices and arguments put in: the names of surfaces.

use crate::model::expressions::{Local, Lowering};
use crate::syntax::{Expr, Level, Path, Segment, Writer};

impl Lowering<'_, '_> {
    /// The text of an expression, with the current indices and arguments in it.
    pub fn text(&self, expr: &Expr) -> String {
        self.text_at(expr, Level::Conditional)
    }

    /// [`Lowering::text`], in parentheses unless it holds together as tightly as this.
    pub fn text_at(&self, expr: &Expr, level: Level) -> String {
        let names = |name: &str| self.local_text(name);
        Writer {
            names: Some(&names),
        }
        .at_level(expr, level)
    }

    /// [`Lowering::text`] with names as the whole knows them: `a.v` for `v` in part `a`.
    pub fn whole_text(&self, expr: &Expr) -> String {
        self.whole_text_at(expr, Level::Conditional)
    }

    /// [`Lowering::whole_text`], in parentheses unless it holds together as tightly as this.
    pub fn whole_text_at(&self, expr: &Expr, level: Level) -> String {
        let names = |name: &str| self.whole_name(name);
        Writer {
            names: Some(&names),
        }
        .at_level(expr, level)
    }

    fn whole_name(&self, name: &str) -> Option<String> {
        let is_own = || !self.in_function && self.scope.names.contains_key(name);
        let is_let = self.locals.iter().any(|local| local.name() == name);
        self.local_text(name).or_else(|| {
            (!self.scope.prefix.is_empty() && !is_let && is_own())
                .then(|| format!("{}{name}", self.scope.prefix))
        })
    }

    /// A path as written, with the current indices in it.
    pub fn path_text(&self, path: &Path) -> String {
        let names = |name: &str| self.local_text(name);
        let writer = Writer {
            names: Some(&names),
        };
        path.rest
            .iter()
            .fold(path.head.name.clone(), |text, segment| match segment {
                Segment::Field(field) => format!("{text}.{}", field.name),
                Segment::Index(indices) => {
                    format!("{text}[{}]", writer.indices(indices))
                }
            })
    }

    fn local_text(&self, name: &str) -> Option<String> {
        self.locals
            .iter()
            .rev()
            .find(|local| local.name() == name)
            .and_then(|local| match local {
                Local::Value { text, .. } => Some(text.clone()),
                Local::Let { .. } => None,
            })
    }
}
