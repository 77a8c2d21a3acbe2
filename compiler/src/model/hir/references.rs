//! The walk that finds references: local names first, then values of the language, then what the model
//! and the file declare, then functions of the language.

use super::index::{Holder, Kind, Recorder, Role};
use super::reserved::{VALUES, is_function, is_kept};
use super::surfaces::{boundaries, positional, switching};
use super::words::Worded;
use super::{Definition, File, Global, Model, Reference, References, import, local_lets};
use crate::source::Span;
use crate::syntax::{
    Bind, Binder, Domain, Expr, ExprKind, Function, Ident, Index, Part, Path, ProgramKind,
    RegionGuard, Row, Segment, Stmt, Unit,
};

pub(super) struct Resolver<'r, 'f> {
    pub file: &'r File<'f>,
    /// None in functions and constants of the file.
    model: Option<&'r Model<'f>>,
    /// Innermost last.
    locals: Vec<(&'f Ident, Reference<'f>)>,
    pub found: References<'f>,
    /// Words that mean something of a run, whatever is declared.
    pub(super) of_runs: &'static [&'static str],
    /// Takes down names that are no values, too, where somebody looks at the text.
    pub recorder: Option<Recorder<'r, 'f>>,
}

impl<'r, 'f> Resolver<'r, 'f> {
    pub fn of_file(file: &'r File<'f>) -> Self {
        Resolver {
            file,
            model: None,
            locals: vec![],
            found: References::default(),
            of_runs: &[],
            recorder: None,
        }
    }

    pub fn of_model(model: &'r Model<'f>) -> Self {
        Resolver {
            model: Some(model),
            ..Resolver::of_file(&model.file)
        }
    }

    pub(super) fn reference(&self, name: &str) -> Option<Reference<'f>> {
        if let Some((_, reference)) = self.local(name) {
            return Some(*reference);
        }
        if VALUES.contains(&name) || self.of_runs.contains(&name) {
            return Some(Reference::BuiltIn);
        }
        let own = self.model.and_then(|model| model.index.get(name));
        let own = own.map(|&index| Reference::Own(index));
        let global = || Some(Reference::Global(*self.file.index.get(name)?));
        let built_in = || is_function(name).then_some(Reference::BuiltIn);
        own.or_else(global).or_else(built_in)
    }

    fn local(&self, name: &str) -> Option<&(&'f Ident, Reference<'f>)> {
        let mut locals = self.locals.iter().rev();
        locals.find(|(local, _)| local.name == name)
    }

    /// Takes down that a name stands at a place, where it is known.
    pub(super) fn record(&mut self, span: Span, name: &str, role: Role) {
        if self.recorder.is_none() {
            return;
        }
        self.take_down(span, self.declared_at(name), role);
    }

    /// Where a name is declared.
    pub(super) fn declared_at(&self, name: &str) -> Option<Span> {
        match self.reference(name)? {
            Reference::Index | Reference::Argument(_) | Reference::Let(_) => {
                self.local(name).map(|(local, _)| local.span)
            }
            Reference::Own(index) => self.model.map(|model| model.declared[index].name.span),
            Reference::Global(index) => Some(self.file.globals[index].declared_at()),
            Reference::BuiltIn => None,
        }
    }

    pub(super) fn take_down(&mut self, span: Span, declared: Option<Span>, role: Role) {
        if let (Some(recorder), Some(declared)) = (&mut self.recorder, declared) {
            recorder.occurs(span, declared, role);
        }
    }

    /// Declares what holds in a part of the text.
    fn declare(&mut self, name: &'f Ident, kind: Kind, whole: Span, scope: Span) {
        if let Some(recorder) = &mut self.recorder {
            recorder.declares(name, kind, whole, scope);
        }
    }

    /// What a name has members of.
    fn holder(&self, expr: &Expr) -> Option<Holder<'f>> {
        match &expr.kind {
            ExprKind::Name(name) => self.holder_of(name),
            ExprKind::Index(base, _) => self.holder(base),
            ExprKind::Field(base, field) => {
                let recorder = self.recorder.as_ref()?;
                recorder.member(self.holder(base)?, &field.name)?.1
            }
            _ => None,
        }
    }

    fn holder_of(&self, name: &str) -> Option<Holder<'f>> {
        match self.reference(name)? {
            Reference::Own(index) => match self.model?.declared[index].item {
                Definition::Part(part) => Holder::of_path(self.model?.file.file, &part.model),
                _ => None,
            },
            Reference::Global(index) => match self.file.globals[index].global {
                Global::Import(import) if import.name.is_none() => import.file.map(Holder::File),
                _ => None,
            },
            _ => None,
        }
    }

    /// A member of a part or a file.
    fn field(
        &mut self,
        holder: Option<Holder<'f>>,
        field: &Ident,
        role: Role,
    ) -> Option<Holder<'f>> {
        let (declared, inner) = self.recorder.as_ref()?.member(holder?, &field.name)?;
        self.take_down(field.span, Some(declared), role);
        inner
    }

    /// What a path names, of the model around or of one that a part is an instance of.
    pub(super) fn path(&mut self, path: &'f Path, of: Option<Holder<'f>>, role: Role) {
        if self.recorder.is_none() {
            return;
        }
        let mut holder = match of {
            None => {
                self.record(path.head.span, &path.head.name, role);
                self.holder_of(&path.head.name)
            }
            of => self.field(of, &path.head, role),
        };
        for segment in &path.rest {
            match segment {
                Segment::Field(field) => holder = self.field(holder, field, role),
                Segment::Index(indices) => self.exprs(indices.iter().flat_map(inside)),
            }
        }
    }

    /// A model of the file around, or of one that it imports.
    pub fn model_path(&mut self, file: &File<'f>, path: &'f Path) {
        let known = file.get(&path.head.name);
        self.take_down(
            path.head.span,
            known.map(|known| known.declared_at()),
            Role::Reads,
        );
        if let (Some(Segment::Field(field)), Some(Global::Import(import))) =
            (path.rest.first(), known.map(|known| known.global))
        {
            self.field(import.file.map(Holder::File), field, Role::Reads);
        }
    }

    /// Whether a call of this name is one of a function of the language, whatever else has the name.
    fn is_built_in(&self, name: &str) -> bool {
        is_function(name)
            && match self.file.get(name).map(|known| known.global) {
                Some(Global::Function(..) | Global::Import(_)) => false,
                Some(Global::Const(_)) => is_kept(name),
                Some(Global::Model(_)) | None => true,
            }
    }

    pub fn expr(&mut self, expr: &'f Expr) {
        if self.recorder.is_some() {
            Switching { resolver: self }.expr(expr);
        }
        match &expr.kind {
            ExprKind::Quantity(_, unit) => stands(&mut self.recorder, Some(unit)),
            ExprKind::Name(name) => {
                let reference = self.reference(name);
                self.found.extend(reference.map(|found| (expr.span, found)));
                self.record(expr.span, name, Role::Reads);
            }
            ExprKind::Field(base, field) => {
                self.expr(base);
                if self.recorder.is_some() {
                    self.field(self.holder(base), field, Role::Reads);
                }
            }
            ExprKind::Comprehension(body, binders) => {
                self.under(binders, expr.span, |r| r.expr(body));
            }
            ExprKind::Call(function, args) => {
                match &function.kind {
                    ExprKind::Name(name) if self.is_built_in(name) => {
                        self.found.insert(function.span, Reference::BuiltIn);
                    }
                    _ => Worded { resolver: self }.head(function),
                }
                Worded { resolver: self }.args_of(function, args, expr.span);
            }
            _ => expr.each(&mut |inner| self.expr(inner)),
        }
    }

    pub(super) fn exprs(&mut self, exprs: impl IntoIterator<Item = &'f Expr>) {
        exprs.into_iter().for_each(|expr| self.expr(expr));
    }

    /// What stands in `scope`, where indices hold; each holds in the bounds of those after it.
    pub(super) fn under(
        &mut self,
        binders: &'f [Binder],
        scope: Span,
        inside: impl FnOnce(&mut Self),
    ) {
        let outside = self.locals.len();
        for binder in binders {
            self.exprs([&binder.first, &binder.last]);
            let whole = binder.name.span.to(binder.last.span);
            self.declare(&binder.name, Kind::Index, whole, scope);
            self.locals.push((&binder.name, Reference::Index));
        }
        inside(self);
        self.locals.truncate(outside);
    }

    /// The body of a function.
    pub fn function(&mut self, function: &'f Function) {
        let params = function.params.iter().enumerate();
        self.locals
            .extend(params.map(|(k, param)| (param, Reference::Argument(k))));
        for param in &function.params {
            self.declare(param, Kind::Argument, param.span, function.span);
        }
        self.expr(&function.body);
        self.locals.clear();
    }

    fn block(&mut self, body: &'f [Stmt], scope: Span) {
        let outside = self.locals.len();
        for named in local_lets(body) {
            self.declare(&named.name, Kind::Let, named.span, scope);
            self.locals.push((&named.name, Reference::Let(named)));
        }
        self.body(body);
        self.locals.truncate(outside);
    }

    /// Statements with the names in sight that are in sight now.
    pub fn body(&mut self, body: &'f [Stmt]) {
        body.iter().for_each(|stmt| self.statement(stmt));
    }

    fn statement(&mut self, stmt: &'f Stmt) {
        match stmt {
            Stmt::Const(item) => self.expr(&item.value),
            Stmt::Decl(decl) => {
                self.exprs(&decl.shape);
                stands(&mut self.recorder, decl.unit.as_ref());
                self.domain(decl.domain.as_ref());
                self.exprs(&decl.value);
            }
            Stmt::Named(named) => {
                stands(&mut self.recorder, named.unit.as_ref());
                self.expr(&named.value);
            }
            Stmt::Switch(switch) => self.expr(&switch.value),
            Stmt::Part(part) => self.part(part),
            Stmt::Region(region) => {
                match &region.guard {
                    RegionGuard::Where(guard) | RegionGuard::Indicator(guard) => self.expr(guard),
                    RegionGuard::Else => {}
                }
                self.block(&region.body, region.span);
            }
            Stmt::Hidden(hidden) => {
                self.path(&hidden.switch, None, Role::Reads);
                self.block(&hidden.body, hidden.span);
            }
            Stmt::For(repeat) => {
                self.under(&repeat.binders, repeat.span, |r| {
                    r.block(&repeat.body, repeat.span);
                });
            }
            Stmt::Dynamics(dynamics) => {
                self.path(&dynamics.target, None, Role::Sets);
                self.expr(&dynamics.value);
            }
            Stmt::Mechanics(mechanics) => {
                self.path(&mechanics.q, None, Role::Reads);
                self.path(&mechanics.v, None, Role::Reads);
                Worded { resolver: self }.options(&mechanics.options);
                for contact in &mechanics.contacts {
                    Worded { resolver: self }.options(&contact.options);
                }
            }
            Stmt::Contact(contact) => Worded { resolver: self }.options(&contact.options),
            Stmt::Project(project) => {
                self.path(&project.state, None, Role::Sets);
                self.rows(&project.rows);
                Switching { resolver: self }.know(boundaries(&project.rows));
                self.exprs(&project.metric);
            }
            Stmt::Equation { residual, .. } => self.expr(residual),
            Stmt::Complementarity { left, right, .. } => self.exprs([left, right]),
            Stmt::Jump(jump) => {
                self.exprs(jump.when.exprs());
                self.binds(&jump.resets);
            }
            Stmt::Program(program) => {
                self.exprs(&program.shape);
                match &program.kind {
                    ProgramKind::Argmin { objective, rows } => {
                        self.expr(objective);
                        self.rows(rows);
                    }
                    ProgramKind::VariationalRows { rows, map } => {
                        self.rows(rows);
                        self.expr(map);
                    }
                    ProgramKind::VariationalBox { lower, upper, map } => {
                        self.exprs([lower, upper, map]);
                    }
                }
            }
            Stmt::Bad(_) => {}
        }
    }

    fn part(&mut self, part: &'f Part) {
        let file = self.model.map(|model| &model.file);
        let of = file.and_then(|file| Holder::of_path(file.file, &part.model));
        if let Some(file) = file.filter(|_| self.recorder.is_some()) {
            self.model_path(file, &part.model);
        }
        self.under(part.binder.as_slice(), part.span, |r| {
            for bind in &part.binds {
                if of.is_some() {
                    r.path(&bind.target, of, Role::Sets);
                }
                Worded { resolver: r }.given(bind);
            }
        });
    }

    pub fn binds(&mut self, binds: &'f [Bind]) {
        for bind in binds {
            self.path(&bind.target, None, Role::Sets);
            Worded { resolver: self }.given(bind);
        }
    }

    pub(super) fn rows(&mut self, rows: &'f [Row]) {
        for row in rows {
            match row {
                Row::For {
                    binders,
                    rows,
                    span,
                } => self.under(binders, *span, |r| r.rows(rows)),
                Row::Relation { first, rest, .. } => {
                    self.expr(first);
                    self.exprs(rest.iter().map(|(_, side)| side));
                }
                Row::Bad(_) => {}
            }
        }
    }

    pub(super) fn domain(&mut self, domain: Option<&'f Domain>) {
        match domain {
            None => {}
            Some(Domain::Box(lower, upper)) => self.exprs([lower, upper]),
            Some(Domain::Set(values)) => self.exprs(values),
        }
    }
}

/// The expressions of an index.
fn inside(index: &Index) -> impl Iterator<Item = &Expr> {
    let ends = match index {
        Index::All(_) => [None, None],
        Index::One(one) => [Some(one), None],
        Index::Range(first, last) => [Some(first), Some(last)],
    };
    ends.into_iter().flatten()
}

/// A unit stands at its place, where somebody looks at the text.
fn stands(recorder: &mut Option<Recorder<'_, '_>>, unit: Option<&Unit>) {
    if let (Some(recorder), Some(unit)) = (recorder, unit) {
        recorder.units.push(unit.span);
    }
}

/// What finds names that are switching functions, where somebody looks at the text.
pub(super) struct Switching<'s, 'r, 'f> {
    pub resolver: &'s mut Resolver<'r, 'f>,
}

impl<'f> Switching<'_, '_, 'f> {
    /// What switches in an expression itself, and what is given to a function that may.
    fn expr(&mut self, expr: &'f Expr) {
        self.know(switching(expr));
        let ExprKind::Call(called, args) = &expr.kind else {
            return;
        };
        if let Some(function) = self.function(called) {
            let params = function.params.iter().zip(positional(args));
            let given = params.filter_map(|(param, arg)| Some((self.declared(arg)?, param.span)));
            let given: Vec<_> = given.collect();
            let recorder = self.resolver.recorder.iter_mut();
            recorder.for_each(|recorder| recorder.surfaces.given.extend(&given));
        }
    }

    /// Those of these expressions that are names.
    pub fn know(&mut self, found: Vec<&Expr>) {
        let found = found.into_iter().filter_map(|psi| self.declared(psi));
        let found: Vec<_> = found.collect();
        let recorder = self.resolver.recorder.iter_mut();
        recorder.for_each(|recorder| recorder.surfaces.found.extend(&found));
    }

    /// Where a name is declared that stands alone, or with indices.
    fn declared(&self, expr: &Expr) -> Option<Span> {
        match &expr.kind {
            ExprKind::Name(name) => self.resolver.declared_at(name),
            ExprKind::Index(base, _) => self.declared(base),
            ExprKind::Field(base, field) => {
                let recorder = self.resolver.recorder.as_ref()?;
                let (declared, _) = recorder.member(self.resolver.holder(base)?, &field.name)?;
                Some(declared)
            }
            _ => None,
        }
    }

    /// The function of this file or another one that is called by a name.
    fn function(&self, called: &Expr) -> Option<&'f Function> {
        let global = match &called.kind {
            ExprKind::Name(name) => match self.resolver.file.get(name)?.global {
                Global::Import(import) => import.target()?,
                global => global,
            },
            ExprKind::Field(base, field) => match self.resolver.holder(base)? {
                Holder::File(file) => import::own(file, &field.name)?,
                Holder::Model(..) => return None,
            },
            _ => return None,
        };
        match global {
            Global::Function(_, function) => Some(function),
            _ => None,
        }
    }
}
