//! What names in an expression stand for: those of a model or its file, and what loops, functions and blocks add.

use std::rc::Rc;

use crate::model::Tensor;
use crate::model::names::scope::{Meaning, Scope, Value};
use crate::syntax::{self, Binder, ExprKind, Named};

/// A name that holds in a part of the model only.
pub(crate) enum Local<'e> {
    /// A loop index or an argument, with the text that stands for it.
    Value {
        name: String,
        value: Value<'e>,
        text: String,
    },
    /// A `let` in a region or loop; computed when first used.
    Let {
        statement: Rc<Named>,
        value: Lazy<'e>,
        frame: usize,
    },
}

/// A local `let` before and after its first use.
#[derive(Clone)]
pub(crate) enum Lazy<'e> {
    Waiting,
    Running,
    Done(Value<'e>),
    Failed,
}

impl Local<'_> {
    pub fn name(&self) -> &str {
        match self {
            Local::Value { name, .. } => name,
            Local::Let { statement, .. } => &statement.name.name,
        }
    }
}

/// The names in sight.
pub(crate) struct Environment<'a, 'e> {
    pub scope: &'a Scope<'e>,
    /// Local names, innermost last.
    pub locals: Vec<Local<'e>>,
    /// True in the body of a function, which sees the file only.
    pub in_function: bool,
}

impl<'a, 'e> Environment<'a, 'e> {
    /// The names of a model.
    pub fn of_model(scope: &'a Scope<'e>) -> Self {
        Environment {
            scope,
            locals: vec![],
            in_function: false,
        }
    }

    /// What a name means that is not local, to the model or in a function.
    pub fn visible(&self, name: &str) -> Option<&'a Meaning<'e>> {
        match self.in_function {
            true => self.scope.of_file.get(name),
            false => self.scope.get(name),
        }
    }

    /// The current value of a loop index.
    pub fn index_value(&self, binder: &str) -> Option<i64> {
        self.locals.iter().rev().find_map(|local| match local {
            Local::Value { name, value, .. } if name == binder => value
                .tensor
                .as_scalar()?
                .as_constant()
                .map(|value| value as i64),
            _ => None,
        })
    }

    /// The file that a name means.
    pub fn module<'x>(&self, expr: &'x syntax::Expr) -> Option<(&'x str, &'a Rc<Scope<'e>>)> {
        let ExprKind::Name(name) = &expr.kind else {
            return None;
        };
        match self.scope.of_file.get(name) {
            Some(Meaning::Module(module)) if !self.is_local(name) => Some((name, module)),
            _ => None,
        }
    }

    /// True for a name that holds in a part of the model only.
    pub fn is_local(&self, name: &str) -> bool {
        self.locals.iter().any(|local| local.name() == name)
    }

    /// Keeps what is known of a local `let`.
    pub fn set_lazy(&mut self, position: usize, lazy: Lazy<'e>) {
        if let Some(Local::Let { value, .. }) = self.locals.get_mut(position) {
            *value = lazy;
        }
    }

    /// Brings the index of a loop, or of an array of parts, in sight.
    pub fn push_index(&mut self, name: &str, index: i64) {
        self.locals.push(Local::Value {
            name: name.to_owned(),
            value: Tensor::scalar(self.scope.exprs.constant(index as f64)).into(),
            text: index.to_string(),
        });
    }

    /// Brings the `let`s of a block in sight; returns how many locals there were.
    pub fn open_frame(&mut self, lets: &[Rc<Named>]) -> usize {
        let base = self.locals.len();
        let frame = base + lets.len();
        self.locals.extend(lets.iter().map(|statement| Local::Let {
            statement: Rc::clone(statement),
            value: Lazy::Waiting,
            frame,
        }));
        base
    }

    /// Current values of the indices of loops.
    pub fn indices<'x>(&self, binders: impl Iterator<Item = &'x Binder>) -> Vec<i64> {
        binders
            .filter_map(|binder| self.index_value(&binder.name.name))
            .collect()
    }
}
