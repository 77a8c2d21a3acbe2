//! Declarations: variables for what varies, values for what is named.

use crate::diagnostics::Diagnostics;
use crate::model::expressions::Lowering;
use crate::model::hir::order::given;
use crate::model::hir::{Declared, Definition, Frame};
use crate::model::names::draft::Draft;
use crate::model::names::parts::{Files, Given, Inner};
use crate::model::names::scope::{Meaning, Reported, Scope, Value};
use crate::model::{ModelError, Shape, TargetKind};
use crate::source::Span;
use crate::syntax::{self, Bind, DeclKind, NamedKind};

/// Gives names their meaning, instance by instance.
pub(crate) struct Declaring<'d, 'f, 'e> {
    pub draft: Draft<'e>,
    /// The instance whose names are being declared.
    pub level: Level<'f, 'e>,
    /// The models around it, with the `part` that leads from each to the next.
    pub around: Vec<(&'f syntax::Model, Span)>,
    pub files: Files<'f, 'e>,
    pub diags: &'d mut Diagnostics,
}

/// An instance of a model while its names are declared.
pub(crate) struct Level<'f, 'e> {
    pub item: &'f syntax::Model,
    pub file: &'f syntax::File,
    pub scope: Scope<'e>,
    /// Structural constants that are given from outside.
    pub given: Vec<Given<'e>>,
    pub parts: Vec<Inner<'f, 'e>>,
}

impl<'d, 'f, 'e> Declaring<'d, 'f, 'e> {
    pub fn new(
        file: &'f syntax::File,
        item: &'f syntax::Model,
        scope: Scope<'e>,
        files: Files<'f, 'e>,
        diags: &'d mut Diagnostics,
    ) -> Self {
        let draft = Draft::new(item, &scope);
        let level = Level {
            item,
            file,
            scope,
            given: vec![],
            parts: vec![],
        };
        Declaring {
            draft,
            level,
            around: vec![],
            files,
            diags,
        }
    }

    /// Gives a declared name no meaning for now.
    pub fn unusable(&mut self, declared: &Declared<'_>) {
        let name = declared.name.name.clone();
        self.level.scope.names.insert(name, Meaning::Unusable);
    }

    /// Gives a declared name its meaning. What it needs has one already.
    pub fn declare(&mut self, declared: &Declared<'f>, with: &[Bind]) {
        let meaning = match declared.item {
            Definition::Const(item) => self.constant(item, with),
            Definition::Decl(decl) => self.quantity(decl),
            Definition::Program(program) => self.program(program),
            Definition::Named(named) => self.named(named),
            Definition::Switch(switch) => self.switch(switch, &declared.frames),
            Definition::Part(part) => self.part(part, with),
            Definition::Word(kind, _) => Ok(Meaning::Word(kind)),
            Definition::Unsupported => Ok(Meaning::Unusable),
        };
        let name = declared.name.name.clone();
        let names = &mut self.level.scope.names;
        names.insert(name, meaning.unwrap_or(Meaning::Unusable));
    }

    /// The name of the whole for a name of the instance: `a.floor.s`.
    pub fn whole_name(&self, name: &str) -> String {
        format!("{}{name}", self.level.scope.prefix)
    }

    /// Runs `lower` on a fresh lowering over what is declared so far.
    pub fn lowering<T>(
        &mut self,
        lower: impl FnOnce(&mut Lowering<'_, 'e>) -> Result<T, Reported>,
    ) -> Result<T, Reported> {
        self.draft.lowering(&self.level.scope, self.diags, lower)
    }

    fn constant(&mut self, item: &syntax::Const, with: &[Bind]) -> Result<Meaning<'e>, Reported> {
        let name = &item.name.name;
        let from_outside = self.level.given.iter().find(|given| given.is(name));
        let from_outside = from_outside.map(|given| (given.value.clone(), given.span));
        let value = given(item, with).unwrap_or(&item.value);
        let what = format!("`{name}`");
        self.lowering(|lowering| {
            let (lowered, span) = match from_outside {
                Some(given) => given,
                None => (lowering.expr(value)?, value.span),
            };
            lowering.as_constants(&lowered.tensor, &what, span)?;
            Ok(Meaning::Value(lowered, TargetKind::Const))
        })
    }

    fn quantity(&mut self, decl: &syntax::Decl) -> Result<Meaning<'e>, Reported> {
        let shape = self.shape(&decl.name.name, &decl.shape, decl.span)?;
        let name = self.whole_name(&decl.name.name);
        let value = self.draft.variables(&name, shape);
        let target = self.draft.quantity(decl.kind, name, &value, decl.span);
        if let Some(quantity) = self.draft.quantity_of(target) {
            quantity.unit = decl.unit.as_ref().map(ToString::to_string);
        }
        Ok(Meaning::Value(value.into(), target))
    }

    /// What a program solves for, from zero on: its multipliers are found from there.
    fn program(&mut self, program: &syntax::Program) -> Result<Meaning<'e>, Reported> {
        let (name, span) = (&program.name.name, program.span);
        let shape = self.shape(name, &program.shape, span)?;
        let name = self.whole_name(name);
        let value = self.draft.variables(&name, shape);
        let target = self.draft.quantity(DeclKind::Algebraic, name, &value, span);
        let zero = self.draft.model.exprs.constant(0.0);
        if let Some(quantity) = self.draft.quantity_of(target) {
            quantity.value = (!shape.is_empty()).then(|| value.map(|_| zero));
        }
        Ok(Meaning::Value(value.into(), target))
    }

    /// The shape of what is declared with these sizes.
    fn shape(&mut self, name: &str, sizes: &[syntax::Expr], span: Span) -> Result<Shape, Reported> {
        self.lowering(|lowering| {
            let mut lengths = vec![];
            for size in sizes {
                lengths.push(lowering.size(size, &format!("the size of `{name}`"))?);
            }
            let shape = match lengths[..] {
                [] => Shape::Scalar,
                [n] => Shape::Vector(n),
                [m, n] => Shape::matrix(m, n),
                _ => {
                    return lowering.error(ModelError::IndexCount {
                        what: format!("the size of `{name}`"),
                        expected: "at most two numbers",
                        found: lengths.len(),
                        span,
                    });
                }
            };
            lowering.spend(shape.len(), span)?;
            Ok(shape)
        })
    }

    fn named(&mut self, named: &'f syntax::Named) -> Result<Meaning<'e>, Reported> {
        if let Some(args) = syntax::table_of(named) {
            return self.table(named, args);
        }
        let value = self.lowering(|lowering| match named.kind {
            NamedKind::Let => lowering.expr(&named.value),
            _ => lowering.numbers(&named.value).map(Value::from),
        })?;
        let name = named.name.name.clone();
        if named.kind == NamedKind::Signal
            && let Some(cause) = self.draft.depends(&value.tensor.data, true)
        {
            self.diags.push(ModelError::SignalDepends {
                name,
                cause,
                span: named.value.span,
            });
            return Err(Reported);
        }
        let (name, tensor) = (self.whole_name(&name), value.tensor.clone());
        let target = self.draft.named(named, name, tensor);
        Ok(Meaning::Value(value, target))
    }
}

/// Runs `body` for all indices of some loops around it, their `let`s in sight.
pub(crate) fn in_frames<'e>(
    lowering: &mut Lowering<'_, 'e>,
    frames: &[Frame<'_>],
    body: &mut dyn FnMut(&mut Lowering<'_, 'e>) -> Result<(), Reported>,
) -> Result<(), Reported> {
    let Some((frame, inner)) = frames.split_first() else {
        return body(lowering);
    };
    lowering.for_each(frame.binders, frame.span, &mut |lowering| {
        let base = lowering.names.open_frame(&frame.lets);
        let result = in_frames(lowering, inner, body);
        lowering.names.locals.truncate(base);
        result
    })
}
