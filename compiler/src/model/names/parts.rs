//! Parts: instances of models in models, each with names of its own.
//!
//! An instance declares its names in a scope of its own, under the name of its part: `a.floor.s`.
//! What the braces give is put in later ([`super::bind`]), so that parts may read each other in any
//! order; structural constants alone are needed here, because sizes depend on them.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::rc::Rc;

use rustc_hash::FxHashMap;

use super::file::{self, FileNames, file_names, file_scope};
use super::import;
use super::scope::{Meaning, Reported, Scope, Value};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Exprs};
use crate::model::ModelError;
use crate::model::expressions::tensor::Tensor;
use crate::model::expressions::{Local, Lowering};
use crate::model::names::{Declared, collect};
use crate::model::resolve::{has_bad, order};
use crate::model::statements::declare::{Declaring, Level};
use crate::source::Span;
use crate::syntax::{self, Bind, File, Ident, Index, Part, Path, Segment, Stmt};

/// Parts inside each other; a model of a system has few levels.
const MAX_DEPTH: usize = 64;
/// What an instance costs besides its declarations.
const COST: usize = 1000;

/// An instance of a model, declared.
pub(crate) struct Instance<'f, 'e> {
    pub item: &'f syntax::Model,
    pub declared: Rc<Vec<Declared<'f>>>,
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
    exprs: &'e Exprs,
    time: Expr<'e>,
    budget: Rc<Cell<Option<usize>>>,
    contexts: FxHashMap<Span, Rc<Context<'f, 'e>>>,
    collected: FxHashMap<Span, Rc<Vec<Declared<'f>>>>,
}

struct Context<'f, 'e> {
    names: FileNames<'f>,
    scope: Rc<Scope<'e>>,
}

impl<'f, 'e> Files<'f, 'e> {
    pub fn new(exprs: &'e Exprs, time: Expr<'e>) -> Self {
        Files {
            exprs,
            time,
            budget: file::budget(),
            contexts: FxHashMap::default(),
            collected: FxHashMap::default(),
        }
    }

    fn context(&mut self, file: &'f File, diags: &mut Diagnostics) -> Rc<Context<'f, 'e>> {
        if let Some(context) = self.contexts.get(&file.span) {
            return Rc::clone(context);
        }
        let names = file_names(file, diags);
        // Imports are linked without circles, and not deeply.
        let mut imported = FxHashMap::default();
        for other in names.files() {
            let context = self.context(other, diags);
            imported.insert(other.span, Rc::clone(&context.scope));
        }
        let (exprs, time) = (self.exprs, self.time);
        let scope = file_scope(exprs, time, &names, &imported, &self.budget, diags);
        let scope = Rc::new(scope);
        let context = Rc::new(Context { names, scope });
        self.contexts.insert(file.span, Rc::clone(&context));
        context
    }

    /// The scope in which the model of a file begins.
    pub fn scope(&mut self, file: &'f File, diags: &mut Diagnostics) -> Scope<'e> {
        (*self.context(file, diags).scope).clone()
    }

    fn collected(
        &mut self,
        file: &'f File,
        item: &'f syntax::Model,
        diags: &mut Diagnostics,
    ) -> Rc<Vec<Declared<'f>>> {
        if let Some(declared) = self.collected.get(&item.span) {
            return Rc::clone(declared);
        }
        let context = self.context(file, diags);
        let declared = Rc::new(collect(item, &context.names, diags));
        self.collected.insert(item.span, Rc::clone(&declared));
        declared
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
        let declared = self.files.collected(file, item, self.diags);
        let level = Level {
            item,
            file,
            scope,
            given,
            parts: vec![],
        };
        let outer = std::mem::replace(&mut self.level, level);
        let order = order(&declared, file, with, self.diags);
        // What is not computed, in a cycle, stays like this.
        for declared in declared.iter() {
            self.unusable(declared);
        }
        for index in order {
            self.declare(&declared[index], with);
        }
        let level = std::mem::replace(&mut self.level, outer);
        Instance {
            item,
            declared,
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
            members.insert(index, scope);
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
            lowering.with_index(local);
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

impl Lowering<'_, '_> {
    /// Brings the index of an array of parts in sight.
    pub fn with_index(&mut self, local: Option<(&str, i64)>) {
        if let Some((name, index)) = local {
            let value = Tensor::scalar(self.constant(index as f64)).into();
            self.locals.push(Local::Value {
                name: name.to_owned(),
                value,
                text: index.to_string(),
            });
        }
    }
}

/// True for a path from a model to a structural constant, its own or one of its parts'.
pub(crate) fn names_const(file: &File, item: &syntax::Model, path: &Path) -> bool {
    let (mut file, mut item) = (file, item);
    let (mut head, mut rest): (&Ident, &[Segment]) = (&path.head, &path.rest);
    loop {
        let found = item.body.iter().find_map(|stmt| match stmt {
            Stmt::Const(known) if known.name.name == head.name => Some(None),
            Stmt::Part(part) if part.name.name == head.name => Some(Some(part)),
            _ => None,
        });
        let part = match found {
            Some(Some(part)) => part,
            Some(None) => return rest.is_empty(),
            None => return false,
        };
        if part.binder.is_some()
            && let [Segment::Index(_), after @ ..] = rest
        {
            rest = after;
        }
        let [Segment::Field(field), after @ ..] = rest else {
            return false;
        };
        (head, rest) = (field, after);
        match import::find_silently(file, &part.model) {
            Some(found) => (file, item) = found,
            None => return false,
        }
    }
}
