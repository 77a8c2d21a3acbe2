//! A model and the parts in it: whose names are meant.

use std::rc::Rc;

use rustc_hash::FxHashMap;

use super::dimension::{Dim, Ratio};
use crate::diagnostics::Diagnostics;
use crate::model::hir::{self, Definition, Hir, References, import};
use crate::source::Span;
use crate::syntax::{Bind, Decl, Expr, File, Ident, Model, Part, Path, Segment, Stmt};

/// Where names stand.
#[derive(Clone)]
pub(crate) struct Place<'f> {
    pub file: Rc<hir::File<'f>>,
    /// What they refer to.
    pub names: Rc<References<'f>>,
    /// The instance whose names are in sight; none in functions.
    pub instance: Option<usize>,
    /// Arguments of the function around, with their values where these are plain numbers.
    pub arguments: Vec<(Dim, Option<Ratio>)>,
    /// Whether `time` has a unit here: it has in a model that declares units.
    pub has_units: bool,
    /// The call or part that leads to here.
    pub call: Option<Span>,
}

/// A model or a part of it.
struct Instance<'f> {
    names: Rc<hir::Model<'f>>,
    /// Where it is a part: the statement, and the instance around it.
    part: Option<(&'f Part, usize)>,
    has_units: bool,
}

/// The model itself, which is the first, and its parts.
pub(crate) struct Instances<'f> {
    hir: Hir<'f>,
    all: Vec<Instance<'f>>,
    /// Instances by the instance around them and the `part` statement.
    parts: FxHashMap<(usize, Span), Option<usize>>,
}

impl<'f> Instances<'f> {
    pub fn new(hir: Hir<'f>, file: &'f File, item: &'f Model) -> Self {
        let mut instances = Instances {
            hir,
            all: vec![],
            parts: FxHashMap::default(),
        };
        instances.add(file, item, None);
        instances
    }

    /// The names of a file; what is wrong with them has been reported.
    pub fn file(&mut self, file: &'f File) -> Rc<hir::File<'f>> {
        self.hir.file(file, &mut Diagnostics::default())
    }

    fn add(&mut self, file: &'f File, item: &'f Model, part: Option<(&'f Part, usize)>) -> usize {
        self.all.push(Instance {
            names: self.hir.model(file, item, &mut Diagnostics::default()),
            part,
            has_units: declares_units(item),
        });
        self.all.len() - 1
    }

    /// The names of an instance.
    pub fn of(&self, instance: usize) -> &hir::Model<'f> {
        &self.all[instance].names
    }

    /// The statements of an instance as a place that a call or part leads to.
    pub fn place(&self, instance: usize, call: Option<Span>) -> Place<'f> {
        let Instance {
            names, has_units, ..
        } = &self.all[instance];
        Place {
            file: Rc::clone(&names.file),
            names: Rc::clone(&names.references),
            instance: Some(instance),
            arguments: vec![],
            call,
            has_units: *has_units,
        }
    }

    /// The instance that a `part` of an instance makes.
    pub fn part(&mut self, outer: usize, part: &'f Part) -> Option<usize> {
        if let Some(&known) = self.parts.get(&(outer, part.span)) {
            return known;
        }
        let found = import::find_silently(self.of(outer).file.file, &part.model);
        let inner = found.map(|(file, item)| self.add(file, item, Some((part, outer))));
        self.parts.insert((outer, part.span), inner);
        inner
    }

    /// The declaration that a path names in an instance, with the instance it stands in.
    pub fn target(&mut self, instance: usize, path: &Path) -> Option<(usize, Definition<'f>)> {
        let mut found = (instance, self.of(instance).get(&path.head.name)?);
        for segment in &path.rest {
            if let Segment::Field(field) = segment {
                found = self.field(found, field)?;
            }
        }
        Some(found)
    }

    /// `b.q`: what a part declares.
    pub fn field(
        &mut self,
        (instance, definition): (usize, Definition<'f>),
        field: &Ident,
    ) -> Option<(usize, Definition<'f>)> {
        let Definition::Part(part) = definition else {
            return None;
        };
        let inner = self.part(instance, part)?;
        Some((inner, self.of(inner).get(&field.name)?))
    }

    /// What a part is given for a quantity, and the instance in which that stands.
    pub fn given(&self, instance: usize, decl: &Decl) -> Option<(&'f Expr, usize)> {
        let (part, outer) = self.all[instance].part?;
        let given = part.binds.iter().find(|bind| gives(bind, decl))?;
        Some((&given.value, outer))
    }

    /// True where something without a unit of its own is given in the braces of a part.
    pub fn takes_units(&self, inner: usize, part: &Part) -> bool {
        let declared = &self.of(inner).declared;
        declared.iter().any(|declared| match declared.item {
            Definition::Decl(decl) if decl.unit.is_none() => {
                part.binds.iter().any(|bind| gives(bind, decl))
            }
            _ => false,
        })
    }
}

/// True for a line that gives a declaration as a whole.
fn gives(bind: &Bind, decl: &Decl) -> bool {
    bind.target.head.name == decl.name.name && bind.target.rest.is_empty()
}

/// True for a model that declares a unit itself.
pub(crate) fn declares_units(item: &Model) -> bool {
    item.body.iter().any(|stmt| match stmt {
        Stmt::Decl(decl) => decl.unit.is_some(),
        Stmt::Named(named) => named.unit.is_some(),
        _ => false,
    })
}
