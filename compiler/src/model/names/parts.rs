//! Parts: instances of models in models, each with names of its own.
//!
//! An instance declares its names in a scope of its own, under the name of its part: `a.floor.s`.
//! What the braces give is put in later ([`super::bind`]), so that parts may read each other in any
//! order; structural constants alone are needed here, because sizes depend on them.

use std::collections::BTreeMap;
use std::rc::Rc;

use rustc_hash::FxHashMap;

use super::file::file_scope;
use super::scope::{Meaning, Reported, Scope, Value};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Exprs};
use crate::model::ModelError;
use crate::model::hir::order::{names_const, order};
use crate::model::hir::{self, Hir, import};
use crate::model::statements::declare::{Declaring, Level};
use crate::source::Span;
use crate::syntax::{self, Bind, File, Index, Part, Segment, Stmt};

/// Parts inside each other; a model of a system has few levels.
const MAX_DEPTH: usize = 64;
/// What an instance costs besides its declarations.
const COST: usize = 1000;

/// An instance of a model, declared.
pub(crate) struct Instance<'f, 'e> {
    pub names: Rc<hir::Model<'f>>,
    pub scope: Rc<Scope<'e>>,
    pub parts: Vec<Inner<'f, 'e>>,
}

/// An instance in another one.
pub(crate) struct Inner<'f, 'e> {
    pub part: &'f Part,
    /// The index in an array of parts.
    pub index: Option<i64>,
    pub instance: Instance<'f, 'e>,
}

/// A structural constant of a part, given from outside.
#[derive(Clone)]
pub(crate) struct Given<'e> {
    /// The path to it from the instance: `[floor, n]`, `[b, 2, n]`.
    steps: Vec<Step>,
    pub value: Value<'e>,
    pub span: Span,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    Name(String),
    Index(i64),
}

impl Given<'_> {
    /// True for a value of that name in the instance itself.
    pub fn is(&self, name: &str) -> bool {
        matches!(&self.steps[..], [Step::Name(only)] if only == name)
    }
}

/// Files with their constants and functions, each looked at once.
pub(crate) struct Files<'f, 'e> {
    pub hir: Hir<'f>,
    /// What every scope begins with.
    empty: Scope<'e>,
    scopes: FxHashMap<Span, Rc<Scope<'e>>>,
}

impl<'f, 'e> Files<'f, 'e> {
    pub fn new(exprs: &'e Exprs, time: Expr<'e>) -> Self {
        Files {
            hir: Hir::default(),
            empty: Scope::empty(exprs, time),
            scopes: FxHashMap::default(),
        }
    }

    fn shared(&mut self, file: &'f File, diags: &mut Diagnostics) -> Rc<Scope<'e>> {
        if let Some(scope) = self.scopes.get(&file.span) {
            return Rc::clone(scope);
        }
        let names = self.hir.file(file, diags);
        // Imports are linked without circles, and not deeply.
        let mut imported = FxHashMap::default();
        for other in names.imports().filter_map(|import| import.file) {
            imported.insert(other.span, self.shared(other, diags));
        }
        let scope = Rc::new(file_scope(self.empty.clone(), &names, &imported, diags));
        self.scopes.insert(file.span, Rc::clone(&scope));
        scope
    }

    /// The scope in which the model of a file begins.
    pub fn scope(&mut self, file: &'f File, diags: &mut Diagnostics) -> Scope<'e> {
        (*self.shared(file, diags)).clone()
    }
}

impl<'f, 'e> Declaring<'_, 'f, 'e> {
    /// Declares all names of an instance, and of the parts in it.
    pub fn instance(
        &mut self,
        file: &'f File,
        item: &'f syntax::Model,
        prefix: String,
        given: Vec<Given<'e>>,
        with: &[Bind],
    ) -> Instance<'f, 'e> {
        let mut scope = self.files.scope(file, self.diags);
        scope.prefix = prefix;
        scope.forgiving |= has_bad(&item.body);
        let names = self.files.hir.model(file, item, self.diags);
        let level = Level {
            item,
            file,
            scope,
            given,
            parts: vec![],
        };
        let outer = std::mem::replace(&mut self.level, level);
        let order = order(&names, with, self.diags);
        // What is not computed, in a cycle, stays like this.
        for declared in &names.declared {
            self.unusable(declared);
        }
        for index in order {
            self.declare(&names.declared[index], with);
        }
        let level = std::mem::replace(&mut self.level, outer);
        Instance {
            names,
            scope: Rc::new(level.scope),
            parts: level.parts,
        }
    }

    /// `part b = disc { .. }` or `part b[i in 1..n] = disc { .. }`; `with` is empty in parts.
    pub fn part(&mut self, part: &'f Part, with: &[Bind]) -> Result<Meaning<'e>, Reported> {
        let (file, item) = self.model_of(part)?;
        let Some(binder) = &part.binder else {
            let instance = self.inner(part, None, (file, item), with)?;
            return Ok(Meaning::Part(instance));
        };
        let (first, last) = self.lowering(|lowering| {
            let first = lowering.integer(&binder.first, "the first index of a part")?;
            Ok((
                first,
                lowering.integer(&binder.last, "the last index of a part")?,
            ))
        })?;
        let mut members = BTreeMap::new();
        for index in first..=last {
            let scope = self.inner(part, Some(index), (file, item), with)?;
            members.insert(vec![index], scope);
        }
        Ok(Meaning::Parts(members))
    }

    /// The model of a part, which is none of those around it.
    fn model_of(&mut self, part: &'f Part) -> Result<(&'f File, &'f syntax::Model), Reported> {
        let found = import::find(self.level.file, &part.model, self.diags).ok_or(Reported)?;
        let mut around = self.around.clone();
        around.push((self.level.item, part.model.span));
        if let Some(first) = around
            .iter()
            .position(|(model, _)| std::ptr::eq(*model, found.1))
        {
            // The same circle, wherever one enters it, is told from the model that stands first.
            let mut circle = around.split_off(first);
            let start = (0..circle.len()).min_by_key(|&k| circle[k].0.span.start);
            circle.rotate_left(start.unwrap_or(0));
            let names = circle.iter().chain(circle.first());
            let names: Vec<&str> = names.map(|(model, _)| model.name.name.as_str()).collect();
            self.diags.push(ModelError::RecursiveParts {
                name: names[0].to_owned(),
                chain: names.join(" -> "),
                span: circle[0].1,
            });
            return Err(Reported);
        }
        if around.len() > MAX_DEPTH {
            // A tree of parts has many such leaves: one is enough.
            self.level.scope.budget.set(None);
            self.diags.push(ModelError::DeepParts {
                limit: MAX_DEPTH,
                span: part.model.span,
            });
            return Err(Reported);
        }
        Ok(found)
    }

    fn inner(
        &mut self,
        part: &'f Part,
        index: Option<i64>,
        (file, item): (&'f File, &'f syntax::Model),
        with: &[Bind],
    ) -> Result<Rc<Scope<'e>>, Reported> {
        let cost = COST + item.body.len();
        self.lowering(|lowering| lowering.spend(cost, part.span))?;
        let given = self.given_to(part, index, with);
        let name = match index {
            Some(index) => format!("{}[{index}]", part.name.name),
            None => part.name.name.clone(),
        };
        let prefix = format!("{}{name}.", self.level.scope.prefix);
        self.around.push((self.level.item, part.model.span));
        let instance = self.instance(file, item, prefix, given, &[]);
        self.around.pop();
        let scope = Rc::clone(&instance.scope);
        self.level.parts.push(Inner {
            part,
            index,
            instance,
        });
        Ok(scope)
    }

    /// Structural constants that reach a part: from further outside first, those count.
    fn given_to(&mut self, part: &'f Part, index: Option<i64>, with: &[Bind]) -> Vec<Given<'e>> {
        let mut head = vec![Step::Name(part.name.name.clone())];
        head.extend(index.map(Step::Index));
        let passed = self.level.given.iter().filter_map(|given| {
            let steps = given.steps.strip_prefix(&head[..])?.to_vec();
            Some(Given {
                steps,
                value: given.value.clone(),
                span: given.span,
            })
        });
        let mut all: Vec<Given<'e>> = passed.collect();
        let (file, item) = (self.level.file, self.level.item);
        for bind in with.iter().rev() {
            if names_const(file, item, &bind.target)
                && let Ok(mut given) = self.given(bind, None)
                && given.steps.starts_with(&head)
            {
                given.steps.drain(..head.len());
                all.push(given);
            }
        }
        let local = part.binder.as_ref().zip(index);
        let local = local.map(|(binder, index)| (binder.name.name.as_str(), index));
        if let Some((file, item)) = import::find_silently(file, &part.model) {
            for bind in &part.binds {
                if names_const(file, item, &bind.target)
                    && let Ok(given) = self.given(bind, local)
                {
                    all.push(given);
                }
            }
        }
        all
    }

    fn given(&mut self, bind: &Bind, local: Option<(&str, i64)>) -> Result<Given<'e>, Reported> {
        self.lowering(|lowering| {
            if let Some((name, index)) = local {
                lowering.names.push_index(name, index);
            }
            let mut steps = vec![Step::Name(bind.target.head.name.clone())];
            for segment in &bind.target.rest {
                match segment {
                    Segment::Field(field) => steps.push(Step::Name(field.name.clone())),
                    Segment::Index(indices) => {
                        for index in indices {
                            if let Index::One(one) = index {
                                steps.push(Step::Index(lowering.integer(one, "an index")?));
                            }
                        }
                    }
                }
            }
            let value = lowering.expr(&bind.value)?;
            let span = bind.value.span;
            Ok(Given { steps, value, span })
        })
    }
}

/// True where a statement could not be read, also in blocks.
fn has_bad(body: &[Stmt]) -> bool {
    body.iter().any(|stmt| match stmt {
        Stmt::Bad(_) => true,
        Stmt::For(repeat) => has_bad(&repeat.body),
        Stmt::Region(region) => has_bad(&region.body),
        Stmt::Hidden(hidden) => has_bad(&hidden.body),
        _ => false,
    })
}
