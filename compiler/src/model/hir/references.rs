//! The walk that finds references: local names first, then values of the language, then what the model
//! and the file declare, then functions of the language.

use super::reserved::{VALUES, is_function, is_kept};
use super::{File, Global, Model, Reference, References, local_lets};
use crate::syntax::{
    Arg, Bind, Binder, Contact, Domain, Expect, ExpectWhen, Experiment, Expr, ExprKind, Function,
    OutputWhen, PlotItem, PlotKind, ProgramKind, RegionGuard, Row, Setting, SettingKind, Stmt,
};

pub(super) struct Resolver<'r, 'f> {
    pub file: &'r File<'f>,
    /// None in functions and constants of the file.
    model: Option<&'r Model<'f>>,
    /// Innermost last.
    locals: Vec<(&'f str, Reference<'f>)>,
    pub found: References<'f>,
}

impl<'r, 'f> Resolver<'r, 'f> {
    pub fn of_file(file: &'r File<'f>) -> Self {
        Resolver {
            file,
            model: None,
            locals: vec![],
            found: References::default(),
        }
    }

    pub fn of_model(model: &'r Model<'f>) -> Self {
        Resolver {
            model: Some(model),
            ..Resolver::of_file(&model.file)
        }
    }

    fn reference(&self, name: &str) -> Option<Reference<'f>> {
        let mut locals = self.locals.iter().rev();
        if let Some((_, reference)) = locals.find(|(local, _)| *local == name) {
            return Some(*reference);
        }
        if VALUES.contains(&name) {
            return Some(Reference::BuiltIn);
        }
        let own = self.model.and_then(|model| model.index.get(name));
        let own = own.map(|&index| Reference::Own(index));
        let global = || Some(Reference::Global(*self.file.index.get(name)?));
        let built_in = || is_function(name).then_some(Reference::BuiltIn);
        own.or_else(global).or_else(built_in)
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
        match &expr.kind {
            ExprKind::Name(name) => {
                let reference = self.reference(name);
                self.found.extend(reference.map(|found| (expr.span, found)));
            }
            ExprKind::Comprehension(body, binders) => self.under(binders, |r| r.expr(body)),
            ExprKind::Call(function, args) => {
                match &function.kind {
                    ExprKind::Name(name) if self.is_built_in(name) => {
                        self.found.insert(function.span, Reference::BuiltIn);
                    }
                    _ => self.expr(function),
                }
                for arg in args {
                    match arg {
                        Arg::Named(_, value) => self.expr(value),
                        Arg::Positional(value, binders) => self.under(binders, |r| r.expr(value)),
                    }
                }
            }
            _ => expr.each(&mut |inner| self.expr(inner)),
        }
    }

    fn exprs(&mut self, exprs: impl IntoIterator<Item = &'f Expr>) {
        exprs.into_iter().for_each(|expr| self.expr(expr));
    }

    /// What stands where indices hold; each holds in the bounds of those after it.
    fn under(&mut self, binders: &'f [Binder], inside: impl FnOnce(&mut Self)) {
        let outside = self.locals.len();
        for binder in binders {
            self.exprs([&binder.first, &binder.last]);
            self.locals.push((&binder.name.name, Reference::Index));
        }
        inside(self);
        self.locals.truncate(outside);
    }

    /// The body of a function.
    pub fn function(&mut self, function: &'f Function) {
        let params = function.params.iter().enumerate();
        self.locals
            .extend(params.map(|(k, param)| (&*param.name, Reference::Argument(k))));
        self.expr(&function.body);
        self.locals.clear();
    }

    fn block(&mut self, body: &'f [Stmt]) {
        let outside = self.locals.len();
        let lets = local_lets(body);
        self.locals
            .extend(lets.map(|named| (&*named.name.name, Reference::Let(named))));
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
                self.exprs(decl.shape.iter().chain(&decl.value));
                match &decl.domain {
                    None => {}
                    Some(Domain::Box(lower, upper)) => self.exprs([lower, upper]),
                    Some(Domain::Set(values)) => self.exprs(values),
                }
            }
            Stmt::Named(named) => self.expr(&named.value),
            Stmt::Switch(switch) => self.expr(&switch.value),
            Stmt::Part(part) => self.under(part.binder.as_slice(), |r| r.binds(&part.binds)),
            Stmt::Region(region) => {
                match &region.guard {
                    RegionGuard::Where(guard) | RegionGuard::Indicator(guard) => self.expr(guard),
                    RegionGuard::Else => {}
                }
                self.block(&region.body);
            }
            Stmt::Hidden(hidden) => self.block(&hidden.body),
            Stmt::For(repeat) => self.under(&repeat.binders, |r| r.block(&repeat.body)),
            Stmt::Dynamics(dynamics) => self.expr(&dynamics.value),
            Stmt::Mechanics(mechanics) => {
                self.options(&mechanics.options);
                mechanics.contacts.iter().for_each(|c| self.contact(c));
            }
            Stmt::Contact(contact) => self.contact(contact),
            Stmt::Project(project) => {
                self.rows(&project.rows);
                self.exprs(&project.metric);
            }
            Stmt::Equation { residual, .. } => self.expr(residual),
            Stmt::Complementarity { left, right, .. } => self.exprs([left, right]),
            Stmt::Jump(jump) => {
                self.expr(&jump.guard);
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

    pub fn binds(&mut self, binds: &'f [Bind]) {
        self.exprs(binds.iter().map(|bind| &bind.value));
    }

    fn options(&mut self, options: &'f [Setting]) {
        self.exprs(options.iter().map(|option| &option.value));
    }

    fn contact(&mut self, contact: &'f Contact) {
        self.options(&contact.options);
    }

    fn rows(&mut self, rows: &'f [Row]) {
        for row in rows {
            match row {
                Row::For { binders, rows, .. } => self.under(binders, |r| r.rows(rows)),
                Row::Relation { first, rest, .. } => {
                    self.expr(first);
                    self.exprs(rest.iter().map(|(_, side)| side));
                }
                Row::Bad(_) => {}
            }
        }
    }

    fn plot_items(&mut self, items: &'f [PlotItem]) {
        for item in items {
            self.exprs(item.kind.exprs());
            if let PlotKind::For(binders, items) = &item.kind {
                self.under(binders, |r| r.plot_items(items));
            }
        }
    }

    /// The settings of an experiment that say something in units.
    pub fn experiment(&mut self, experiment: &'f Experiment) {
        for setting in &experiment.settings {
            match &setting.kind {
                SettingKind::With(binds) => self.binds(binds),
                SettingKind::Horizon { value, .. } => self.exprs(value),
                SettingKind::Output {
                    when: OutputWhen::Every(instants) | OutputWhen::At(instants),
                    ..
                } => self.expr(instants),
                SettingKind::Perturb { every, .. } => self.expr(every),
                SettingKind::Plot(items) | SettingKind::Animate(items) => {
                    self.plot_items(items);
                }
                SettingKind::Expect(Expect::Mode { at, .. }) => self.expr(at),
                SettingKind::Expect(Expect::Relation(relation)) => {
                    if let ExpectWhen::At(at) = &relation.when {
                        self.expr(at);
                    }
                    self.exprs([&relation.left, &relation.right]);
                    self.exprs(relation.right_at.iter().chain(&relation.within));
                }
                _ => {}
            }
        }
    }
}
