//! What is compiled for hovers and hints, each experiment once until a text changes.

use std::cell::{OnceCell, RefCell};
use std::rc::Rc;

use super::super::world::Analysis;
use crate::Compiled;
use crate::expr::Exprs;
use crate::model::Model;
use crate::source::Span;
use crate::system::System;

/// With more expressions all is forgotten.
const MOST_NODES: usize = 1_000_000;

/// What a model is compiled to.
pub enum Made<'e> {
    /// By itself: what a run needs is not known.
    Alone(Box<Model<'e>>),
    /// As an experiment takes it, with the system that it asks for, once somebody looks.
    Taken(Box<Compiled<'e>>, OnceCell<Box<System<'e>>>),
}

/// What was compiled of a text, or that it cannot be.
struct Entry<'e> {
    of: Rc<Analysis>,
    what: Span,
    made: Option<Rc<Made<'e>>>,
}

/// What is compiled, with its expressions.
pub struct Cache<'e> {
    exprs: &'e Exprs,
    all: RefCell<Vec<Entry<'e>>>,
}

impl<'e> Cache<'e> {
    /// Nothing yet.
    pub fn new(exprs: &'e Exprs) -> Self {
        let all = RefCell::default();
        Cache { exprs, all }
    }

    /// The experiment, or the model by itself, that stands at a place: as it is there, or else as it is made.
    pub fn get(
        &self,
        of: &Rc<Analysis>,
        what: Span,
        make: impl FnOnce(&'e Exprs) -> Option<Made<'e>>,
    ) -> Option<Rc<Made<'e>>> {
        let is_it = |known: &&Entry<'_>| known.what == what && Rc::ptr_eq(&known.of, of);
        if let Some(known) = self.all.borrow().iter().find(is_it) {
            return known.made.clone();
        }
        let (of, made) = (Rc::clone(of), make(self.exprs).map(Rc::new));
        self.all.borrow_mut().push(Entry {
            of,
            what,
            made: made.clone(),
        });
        made
    }

    /// How many of them have been made.
    pub fn len(&self) -> usize {
        self.all.borrow().len()
    }

    /// Whether so many expressions are kept that all of it is to be dropped.
    pub fn is_full(&self) -> bool {
        self.exprs.n_nodes() > MOST_NODES
    }
}
