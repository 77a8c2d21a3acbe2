//! Statements of models, and settings of experiments.

use super::dimension::{Dim, Dimension};
use super::error::UnitError;
use super::infer::{Inference, factor, is};
use crate::model::hir::Definition;
use crate::model::statements::restitution;
use crate::syntax::{
    Bind, Contact, Decl, Domain, Dynamics, Expect, ExpectWhen, Experiment, Expr, JumpWhen,
    OutputWhen, Part, PlotItem, PlotKind, ProgramKind, RegionGuard, Relation, Row, SettingKind,
    Stmt,
};

/// Whether what statements and settings say fits.
pub(crate) struct Checker<'f, 'd> {
    pub dims: Inference<'f, 'd>,
}

impl<'f> Checker<'f, '_> {
    /// The statements of the instance in sight, or of a block in it.
    pub fn body(&mut self, body: &'f [Stmt]) {
        for stmt in body {
            self.statement(stmt);
        }
    }

    fn statement(&mut self, stmt: &'f Stmt) {
        match stmt {
            Stmt::Decl(decl) => self.decl(decl),
            Stmt::Named(named) => {
                self.own(Definition::Named(named));
            }
            Stmt::Switch(switch) => {
                self.dims.expr(&switch.value);
            }
            Stmt::Part(part) => self.part_statement(part),
            Stmt::Region(region) => {
                match &region.guard {
                    RegionGuard::Where(guard) | RegionGuard::Indicator(guard) => {
                        self.dims.expr(guard);
                    }
                    RegionGuard::Else => {}
                }
                self.body(&region.body);
            }
            Stmt::Hidden(hidden) => self.body(&hidden.body),
            Stmt::For(repeat) => self.body(&repeat.body),
            Stmt::Dynamics(dynamics) => self.dynamics(dynamics),
            Stmt::Mechanics(mechanics) => {
                for option in &mechanics.options {
                    self.dims.expr(&option.value);
                }
                mechanics
                    .contacts
                    .iter()
                    .for_each(|contact| self.contact(contact));
            }
            Stmt::Contact(contact) => self.contact(contact),
            Stmt::Project(project) => self.rows(&project.rows),
            Stmt::Equation { residual, .. } => {
                self.dims.expr(residual);
            }
            Stmt::Complementarity { left, right, .. } => {
                self.dims.expr(left);
                self.dims.expr(right);
            }
            Stmt::Jump(jump) => {
                if let JumpWhen::Guard(guard) = &jump.when {
                    self.dims.expr(guard);
                }
                if let JumpWhen::Every { period, offset } = &jump.when {
                    let time = self.time();
                    self.dims.expect("the period", time, period, None);
                    if let Some(offset) = offset {
                        self.dims.expect("the offset", time, offset, None);
                    }
                }
                self.binds(&jump.resets);
            }
            // Refused before units are looked at, or without values of their own.
            Stmt::Program(program) => match &program.kind {
                ProgramKind::Argmin { objective, rows } => {
                    self.dims.expr(objective);
                    self.rows(rows);
                }
                ProgramKind::VariationalRows { rows, map } => {
                    self.rows(rows);
                    self.dims.expr(map);
                }
                ProgramKind::VariationalBox { lower, upper, map } => {
                    for e in [lower, upper, map] {
                        self.dims.expr(e);
                    }
                }
            },
            Stmt::Const(_) | Stmt::Bad(_) => {}
        }
    }

    /// The sides of a row are alike.
    fn rows(&mut self, rows: &'f [Row]) {
        for row in rows {
            match row {
                Row::For { rows, .. } => self.rows(rows),
                // Members of a complementarity have units of their own.
                Row::Relation { rest, .. } if rest.iter().any(|(op, _)| *op == Relation::Perp) => {}
                Row::Relation { first, rest, .. } => {
                    let members = std::iter::once(first).chain(rest.iter().map(|(_, side)| side));
                    self.dims.agree("the sides of this row", members);
                }
                Row::Bad(_) => {}
            }
        }
    }

    /// Restitution and friction are pure numbers.
    fn contact(&mut self, contact: &'f Contact) {
        for option in &contact.options {
            match option.name.name.as_str() {
                name @ ("restitution" | "friction") => {
                    let one = match self.dims.place.has_units {
                        true => Dim::Known(Dimension::NUMBER),
                        false => Dim::Unknown,
                    };
                    let number = match name {
                        "friction" => Some(&option.value),
                        _ => restitution::written(&option.value)
                            .ok()
                            .and_then(|(_, e)| e),
                    };
                    if let Some(number) = number {
                        self.dims.expect(&format!("`{name}`"), one, number, None);
                    }
                }
                _ => {
                    self.dims.expr(&option.value);
                }
            }
        }
    }

    /// The dimension of what the instance in sight declares.
    fn own(&mut self, definition: Definition<'f>) -> Dim {
        match self.dims.place.instance {
            Some(instance) => self.dims.declared(instance, definition),
            None => Dim::Unknown,
        }
    }

    fn decl(&mut self, decl: &'f Decl) {
        let dim = self.own(Definition::Decl(decl));
        let bounds: Vec<&'f Expr> = match &decl.domain {
            None => vec![],
            Some(Domain::Box(lower, upper)) => vec![lower, upper],
            Some(Domain::Set(values)) => values.iter().collect(),
        };
        let what = format!("`{}`", decl.name.name);
        let declared = decl.unit.as_ref().map(|unit| unit.span);
        // A default that a part does not use says nothing of the unit it is given in.
        let expected = if declared.is_some() {
            dim
        } else {
            Dim::Unknown
        };
        for value in bounds.into_iter().chain(&decl.value) {
            self.dims.expect(&what, expected, value, declared);
        }
    }

    fn part_statement(&mut self, part: &'f Part) {
        let Some(outer) = self.dims.place.instance else {
            return;
        };
        let Some(inner) = self.dims.instances.part(outer, part) else {
            return;
        };
        for bind in &part.binds {
            self.bind(inner, bind);
        }
        let call = self.dims.place.call;
        let takes_units = self.dims.instances.takes_units(inner, part);
        let call = call.or(takes_units.then_some(part.span));
        let place = self.dims.instances.place(inner, call);
        let outside = std::mem::replace(&mut self.dims.place, place);
        self.body(&self.dims.instances.of(inner).item.body);
        self.dims.place = outside;
    }

    /// A line that gives something to an instance.
    fn bind(&mut self, instance: usize, bind: &'f Bind) {
        let target = self.dims.instances.target(instance, &bind.target);
        let Some((instance, definition)) = target else {
            self.dims.expr(&bind.value);
            return;
        };
        let expected = self.dims.declared(instance, definition);
        let (what, declared) = match definition {
            Definition::Decl(decl) => (&decl.name.name, decl.unit.as_ref().map(|unit| unit.span)),
            _ => (&bind.target.head.name, None),
        };
        let expected = if declared.is_some() {
            expected
        } else {
            Dim::Unknown
        };
        self.dims
            .expect(&format!("`{what}`"), expected, &bind.value, declared);
    }

    /// Lines that give something to the instance in sight.
    fn binds(&mut self, binds: &'f [Bind]) {
        if let Some(instance) = self.dims.place.instance {
            binds.iter().for_each(|bind| self.bind(instance, bind));
        }
    }

    /// x' = f: the dimension of x per second.
    fn dynamics(&mut self, dynamics: &'f Dynamics) {
        let found = self.dims.expr(&dynamics.value);
        let instance = self.dims.place.instance;
        let target = instance.and_then(|own| self.dims.instances.target(own, &dynamics.target));
        let Some((instance, state)) = target else {
            return;
        };
        let (Dim::Known(unit), Dim::Known(found)) = (self.dims.declared(instance, state), found)
        else {
            return;
        };
        let Some(rate) = unit.divide(Dimension::TIME) else {
            return;
        };
        if rate != found {
            self.dims.diags.push(UnitError::WrongRate {
                state: dynamics.target.head.name.clone(),
                unit: is(unit),
                rate: is(rate),
                found: is(found),
                help: factor(rate, found),
                span: dynamics.value.span,
                target: dynamics.target.span,
            });
        }
    }

    /// The unit of time: none where the model declares none at all.
    fn time(&self) -> Dim {
        match self.dims.place.has_units {
            true => Dim::Known(Dimension::TIME),
            false => Dim::Unknown,
        }
    }

    /// The settings of an experiment of the model in sight.
    pub fn experiment(&mut self, experiment: &'f Experiment, overrides: &'f [Bind]) {
        let time = self.time();
        self.binds(overrides);
        for setting in &experiment.settings {
            match &setting.kind {
                SettingKind::With(binds) => self.binds(binds),
                SettingKind::Data(data) => self.binds(data.with.as_deref().unwrap_or_default()),
                SettingKind::Horizon {
                    value: Some(value), ..
                } => self.dims.expect("the horizon", time, value, None),
                SettingKind::Output { when, .. } => match when {
                    OutputWhen::Method => {}
                    OutputWhen::Every(instants) | OutputWhen::At(instants) => {
                        self.dims
                            .expect("the time of an output", time, instants, None);
                    }
                },
                SettingKind::Stop(condition) => {
                    self.dims.expr(condition);
                }
                SettingKind::Perturb { every, .. } => {
                    self.dims.expect("the period", time, every, None);
                }
                SettingKind::Plot(items) => {
                    for expr in items.iter().flat_map(|item| item.kind.exprs()) {
                        self.dims.expr(expr);
                    }
                }
                SettingKind::Animate(items) => {
                    let mut lengths = Vec::new();
                    self.shapes(items, &mut lengths);
                    self.dims
                        .agree("the coordinates of this animation", lengths);
                }
                SettingKind::Expect(expect) => self.expectation(expect, time),
                _ => {}
            }
        }
    }

    /// Coordinates and lengths of shapes have one unit; the speed and the angle of a disc are pure numbers.
    fn shapes(&mut self, items: &'f [PlotItem], lengths: &mut Vec<&'f Expr>) {
        for item in items {
            if let PlotKind::For(_, items) = &item.kind {
                self.shapes(items, lengths);
            }
            let exprs = item.kind.exprs();
            let word = match &item.kind {
                PlotKind::Drawing(word, _) => word.name.as_str(),
                _ => "",
            };
            match (word, exprs) {
                ("speed", [speed, ..]) => {
                    self.dims.pure("the speed", speed);
                }
                ("disc", [x, y, radius, angle]) => {
                    self.dims.pure("the angle of a disc", angle);
                    lengths.extend([x, y, radius]);
                }
                // A radius behind x and y, or an angle behind a centre and a radius.
                ("disc", [x, y, last]) if self.dims.expr(last) == Dim::PURE => {
                    lengths.extend([x, y]);
                }
                _ => lengths.extend(exprs),
            }
        }
    }

    fn expectation(&mut self, expect: &'f Expect, time: Dim) {
        match expect {
            Expect::Mode { at, .. } => self.instant(at, time),
            Expect::Relation(relation) => {
                if let ExpectWhen::At(at) = &relation.when {
                    self.instant(at, time);
                }
                if let Some(at) = &relation.right_at {
                    self.instant(at, time);
                }
                let sides = [&relation.left, &relation.right];
                let sides = sides.into_iter().chain(&relation.within);
                self.dims.agree("the sides of this expectation", sides);
            }
            _ => {}
        }
    }

    fn instant(&mut self, at: &'f Expr, time: Dim) {
        self.dims.expect("an instant", time, at, None);
    }
}
