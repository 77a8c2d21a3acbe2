//! The walk of [`super::references`] where words of the language may stand: they are no names, whatever has theirs.

use super::Global;
use super::index::Role;
use super::references::{Resolver, Switching};
use super::surfaces::entries;
use crate::model::statements::restitution;
use crate::source::Span;
use crate::syntax::{Arg, Bind, Expr, ExprKind, Segment, Setting};

/// Options of methods whose values are words.
const WORDED: [&str; 8] = [
    "scheme",
    "form",
    "cross",
    "equilibration",
    "branch",
    "relaxation",
    "steering",
    "path",
];

/// What may be, or hold, a word of the language.
pub(super) struct Worded<'w, 'r, 'f> {
    pub resolver: &'w mut Resolver<'r, 'f>,
}

impl<'f> Worded<'_, '_, 'f> {
    /// What has arguments: a function, whatever else has its name, or a word of the language.
    pub fn head(&mut self, head: &'f Expr) {
        let ExprKind::Name(name) = &head.kind else {
            return self.resolver.expr(head);
        };
        let reference = self.resolver.reference(name);
        self.resolver
            .found
            .extend(reference.map(|found| (head.span, found)));
        let known = self.resolver.file.get(name);
        let function = known
            .filter(|known| matches!(known.global, Global::Function(..) | Global::Import(_)))
            .map(|known| known.declared_at());
        self.resolver.take_down(head.span, function, Role::Reads);
    }

    /// The arguments of a call; kinds of events are words of the language in what is said of a run. The values of named
    /// ones are words of the language, but for the thresholds of a relay.
    pub fn args_of(&mut self, function: &Expr, args: &'f [Arg], scope: Span) {
        let is_called = |word: &str| matches!(&function.kind, ExprKind::Name(name) if name == word);
        let n_words = usize::from(is_called("events") && !self.resolver.of_runs.is_empty());
        self.args(args.get(n_words..).unwrap_or_default(), scope);
        if is_called("hysteresis") {
            let named = args.iter().filter_map(|arg| match arg {
                Arg::Named(_, value) => Some(value),
                Arg::Positional(..) => None,
            });
            self.resolver.exprs(named);
        }
    }

    /// The values of named arguments are words of the language.
    fn args(&mut self, args: &'f [Arg], scope: Span) {
        for arg in args {
            if let Arg::Positional(value, binders) = arg {
                self.resolver.under(binders, scope, |r| r.expr(value));
            }
        }
    }

    /// A word of the language, with or without arguments.
    pub fn word(&mut self, value: &'f Expr) {
        if let ExprKind::Call(_, args) = &value.kind {
            self.args(args, value.span);
        }
    }

    /// The value of what is given, whose name has been taken down; that of a switch is a word.
    pub fn given(&mut self, bind: &'f Bind) {
        let last = bind.target.rest.iter().rev();
        let mut last = last.filter_map(|segment| match segment {
            Segment::Field(field) => Some(field.span),
            Segment::Index(_) => None,
        });
        let named = last.next().unwrap_or(bind.target.head.span);
        match &self.resolver.recorder {
            Some(recorder) if recorder.is_of_switch(named) => self.word(&bind.value),
            _ => self.resolver.expr(&bind.value),
        }
    }

    /// Some options have words of the language, whatever else has such a name.
    pub fn options(&mut self, options: &'f [Setting]) {
        for option in options {
            match (option.name.name.as_str(), &option.value) {
                (name, value) if WORDED.contains(&name) => self.word(value),
                ("law", value) => self.head(value),
                ("restitution", value) if restitution::is_law(value) => self.word(value),
                (name, value) => {
                    self.resolver.expr(value);
                    if name == "gap" {
                        let resolver = &mut *self.resolver;
                        Switching { resolver }.know(entries(value));
                    }
                }
            }
        }
    }
}
