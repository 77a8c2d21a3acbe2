//! Names and what they mean, for the model itself and for the expressions of its experiments.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::rc::Rc;

use rustc_hash::{FxHashMap, FxHashSet};

use crate::diagnostics::counted;
use crate::expr::{Expr, Exprs};
use crate::model::errors::ModelError;
use crate::model::hir::reserved::{VALUES, function_names};
use crate::model::{TargetKind, Tensor};
use crate::source::Span;
use crate::syntax;

/// Work a model may cost with all its parts, in entries made and expressions visited.
const BUDGET: usize = 4_000_000;

/// Gives meaning to names and calls that only an experiment knows, as `objective` or `events(..)`.
pub type Hook<'h, 'e> = dyn Fn(&syntax::Expr) -> Option<Tensor<'e>> + 'h;

/// Marks a mistake that is already among the diagnostics.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reported;

/// A value: numbers, or the truth of a condition as a number in [0, 1].
#[derive(Clone, Debug)]
pub(crate) struct Value<'e> {
    pub tensor: Tensor<'e>,
    pub is_condition: bool,
}

/// What a name stands for.
#[derive(Clone, Debug)]
pub(crate) enum Meaning<'e> {
    /// A value, and what declared it.
    Value(Value<'e>, TargetKind),
    /// Switches declared in a loop, by the values of the loop's indices.
    Family {
        binders: Vec<String>,
        members: BTreeMap<Vec<i64>, (Value<'e>, TargetKind)>,
    },
    /// An instance of a model: what it declares.
    Part(Rc<Scope<'e>>),
    /// An array of instances, by index.
    Parts(BTreeMap<Vec<i64>, Rc<Scope<'e>>>),
    /// A word for something that is not a value: a region, a model.
    Word(&'static str),
    /// A file that a `use` brings in as a whole.
    Module(Rc<Scope<'e>>),
    /// Declared, but wrong or not supported; already reported.
    Unusable,
}

impl Meaning<'_> {
    /// What is wrong where a value must stand; nothing for a value, and for what has been reported.
    pub fn no_value(&self, name: &str, span: Span) -> Option<ModelError> {
        let (kind, help) = match self {
            Meaning::Value(..) | Meaning::Unusable => return None,
            Meaning::Family { binders, .. } => {
                return Some(needs_indices(name, binders.len(), span));
            }
            Meaning::Parts(_) => return Some(needs_indices(name, 1, span)),
            Meaning::Word(kind) => (*kind, None),
            Meaning::Part(part) => {
                let example = part.own_names().min();
                let help = |field| format!("read what is in it, as in `{name}.{field}`");
                ("part", example.map(help))
            }
            Meaning::Module(_) => {
                let help = format!("name what is in it, as in `{name}.something`");
                ("file", Some(help))
            }
        };
        let name = name.to_owned();
        Some(ModelError::NotAValue {
            name,
            kind,
            span,
            help,
        })
    }
}

/// The error for something declared in a loop, without its indices.
pub(crate) fn needs_indices(name: &str, count: usize, span: Span) -> ModelError {
    ModelError::NeedsIndices {
        name: name.to_owned(),
        count: counted(count, "index"),
        span,
    }
}

/// A function, to be inlined.
#[derive(Clone, Debug)]
pub(crate) struct Callable<'e> {
    pub function: Rc<syntax::Function>,
    /// The names it sees, where it comes from another file.
    pub home: Option<Rc<Scope<'e>>>,
}

/// The names of a model and its file.
#[derive(Clone, Debug)]
pub struct Scope<'e> {
    pub(crate) exprs: &'e Exprs,
    /// What stands before the names of an instance: `a.floor.`; empty for the model itself.
    pub(crate) prefix: String,
    pub(crate) time: Expr<'e>,
    /// Names that the model declares itself.
    pub(crate) names: FxHashMap<String, Meaning<'e>>,
    pub(crate) functions: Rc<FxHashMap<String, Callable<'e>>>,
    /// Names that the file declares itself: what others can import.
    pub(crate) declares: Rc<FxHashSet<String>>,
    /// Names of the file: all that the bodies of functions see.
    pub(crate) of_file: Rc<FxHashMap<String, Meaning<'e>>>,
    /// True where a statement could not be read: an unknown name may have stood in it.
    pub(crate) forgiving: bool,
    /// Work left, in entries made and expressions visited; none after too much.
    pub(crate) budget: Rc<Cell<Option<usize>>>,
}

impl<'e> Scope<'e> {
    /// A scope without names, with a budget of its own.
    pub(crate) fn empty(exprs: &'e Exprs, time: Expr<'e>) -> Self {
        Scope {
            exprs,
            prefix: String::new(),
            time,
            names: FxHashMap::default(),
            functions: Rc::default(),
            declares: Rc::default(),
            of_file: Rc::default(),
            forgiving: false,
            budget: Rc::new(Cell::new(Some(BUDGET))),
        }
    }

    /// Whether the file has a function of this name.
    pub fn has_function(&self, name: &str) -> bool {
        self.functions.contains_key(name)
    }

    /// What a name means in the model.
    pub(crate) fn get(&self, name: &str) -> Option<&Meaning<'e>> {
        self.names.get(name).or_else(|| self.of_file.get(name))
    }

    /// What a name means that the file declares itself, functions aside.
    pub(crate) fn declared(&self, name: &str) -> Option<&Meaning<'e>> {
        self.of_file
            .get(name)
            .filter(|_| self.declares.contains(name))
    }

    /// All names that the model declares itself.
    pub(crate) fn own_names(&self) -> impl Iterator<Item = &str> {
        self.names.keys().map(String::as_str)
    }

    /// Those of them that braces may give.
    pub(crate) fn given_names(&self) -> impl Iterator<Item = &str> {
        let is_given = |meaning: &Meaning| match meaning {
            Meaning::Value(_, kind) => matches!(
                kind,
                TargetKind::Const
                    | TargetKind::Param(_)
                    | TargetKind::State(_)
                    | TargetKind::Algebraic(_)
                    | TargetKind::Control(_)
                    | TargetKind::Input(_)
            ),
            Meaning::Part(_) | Meaning::Parts(_) => true,
            _ => false,
        };
        let given = self
            .names
            .iter()
            .filter(move |(_, meaning)| is_given(meaning));
        given.map(|(name, _)| name.as_str())
    }

    /// All names that have a meaning in the model.
    pub(crate) fn declared_names(&self) -> impl Iterator<Item = &str> {
        self.own_names()
            .chain(self.of_file.keys().map(String::as_str))
    }

    /// Every name that can be read, for suggestions and completion.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.declared_names().chain(VALUES).chain(function_names())
    }
}
