//! Statements of models, and settings of experiments.

use super::dimension::Dimension;
use super::infer::{factor, is};
use super::{Checker, Dim, Frame, Thing, UnitError, gives};
use crate::model::statements::restitution;
use crate::syntax::{
    Bind, Contact, Decl, Domain, Dynamics, Expect, ExpectWhen, Experiment, Expr, OutputWhen, Part,
    ProgramKind, RegionGuard, Row, SettingKind, Stmt,
};

impl<'f> Checker<'f, '_> {
    /// The statements of the instance in sight, or of a block in it.
    pub fn body(&mut self, body: &'f [Stmt]) {
        for stmt in body {
            self.statement(stmt);
        }
    }

    fn block(&mut self, body: &'f [Stmt]) {
        self.frames.push(Frame::Block(body));
        self.body(body);
        self.frames.pop();
    }

    fn statement(&mut self, stmt: &'f Stmt) {
        match stmt {
            Stmt::Decl(decl) => self.decl(decl),
            Stmt::Named(named) if self.frames.is_empty() => {
                self.known_thing(Thing::Named(named));
            }
            Stmt::Named(named) => {
                self.local_let(self.frames.len() - 1, named);
            }
            Stmt::Switch(switch) => {
                self.expr(&switch.value);
            }
            Stmt::Part(part) => self.part_statement(part),
            Stmt::Region(region) => {
                self.frames.push(Frame::Block(&region.body));
                match &region.guard {
                    RegionGuard::Where(guard) | RegionGuard::Indicator(guard) => {
                        self.expr(guard);
                    }
                    RegionGuard::Else => {}
                }
                self.frames.pop();
                self.block(&region.body);
            }
            Stmt::Hidden(hidden) => self.block(&hidden.body),
            Stmt::For(repeat) => {
                self.frames.push(Frame::Indices(&repeat.binders));
                self.block(&repeat.body);
                self.frames.pop();
            }
            Stmt::Dynamics(dynamics) => self.dynamics(dynamics),
            Stmt::Mechanics(mechanics) => {
                for option in &mechanics.options {
                    self.expr(&option.value);
                }
                mechanics
                    .contacts
                    .iter()
                    .for_each(|contact| self.contact(contact));
            }
            Stmt::Contact(contact) => self.contact(contact),
            Stmt::Project(project) => self.rows(&project.rows),
            Stmt::Equation { residual, .. } => {
                self.expr(residual);
            }
            Stmt::Complementarity { left, right, .. } => {
                self.expr(left);
                self.expr(right);
            }
            Stmt::Jump(jump) => {
                self.expr(&jump.guard);
                for bind in &jump.resets {
                    let target = self.target(&bind.target);
                    self.bind(bind, target);
                }
            }
            // Refused before units are looked at, or without values of their own.
            Stmt::Program(program) => match &program.kind {
                ProgramKind::Argmin { objective, rows } => {
                    self.expr(objective);
                    self.rows(rows);
                }
                ProgramKind::VariationalRows { rows, map } => {
                    self.rows(rows);
                    self.expr(map);
                }
                ProgramKind::VariationalBox { lower, upper, map } => {
                    for e in [lower, upper, map] {
                        self.expr(e);
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
                Row::For { binders, rows, .. } => {
                    self.frames.push(Frame::Indices(binders));
                    self.rows(rows);
                    self.frames.pop();
                }
                Row::Relation { first, rest, .. } => {
                    let members = std::iter::once(first).chain(rest.iter().map(|(_, side)| side));
                    self.agree("the sides of this row", members);
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
                    let one = match self.place.has_units {
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
                        self.expect(&format!("`{name}`"), one, number, None);
                    }
                }
                _ => {
                    self.expr(&option.value);
                }
            }
        }
    }

    fn known_thing(&mut self, thing: Thing<'f>) -> Dim {
        match self.place.instance {
            Some(instance) => self.declared(instance, thing),
            None => Dim::Unknown,
        }
    }

    fn decl(&mut self, decl: &'f Decl) {
        let dim = self.known_thing(Thing::Decl(decl));
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
            self.expect(&what, expected, value, declared);
        }
    }

    fn part_statement(&mut self, part: &'f Part) {
        let Some(outer) = self.place.instance else {
            return;
        };
        let Some(inner) = self.part(outer, part) else {
            return;
        };
        self.bound(part, |checker| {
            for bind in &part.binds {
                let target = checker.within(inner, |checker| checker.target(&bind.target));
                checker.bind(bind, target);
            }
        });
        let Some((_, item)) = super::import::find_silently(self.place.file, &part.model) else {
            return;
        };
        let call = self.call;
        if self.takes_units(inner, part) {
            self.call = call.or(Some(part.span));
        }
        self.within(inner, |checker| checker.body(&item.body));
        self.call = call;
    }

    /// True where something without a unit of its own is given in the braces of a part.
    fn takes_units(&self, inner: usize, part: &Part) -> bool {
        let mut names = self.instances[inner].names.values();
        names.any(|thing| match thing {
            Thing::Decl(decl) if decl.unit.is_none() => {
                part.binds.iter().any(|bind| gives(bind, decl))
            }
            _ => false,
        })
    }

    fn bind(&mut self, bind: &'f Bind, target: Option<(usize, Thing<'f>)>) {
        let Some((instance, thing)) = target else {
            self.expr(&bind.value);
            return;
        };
        let expected = self.declared(instance, thing);
        let (what, declared) = match thing {
            Thing::Decl(decl) => (&decl.name.name, decl.unit.as_ref().map(|unit| unit.span)),
            _ => (&bind.target.head.name, None),
        };
        let expected = if declared.is_some() {
            expected
        } else {
            Dim::Unknown
        };
        self.expect(&format!("`{what}`"), expected, &bind.value, declared);
    }

    /// x' = f: the dimension of x per second.
    fn dynamics(&mut self, dynamics: &'f Dynamics) {
        let found = self.expr(&dynamics.value);
        let Some((instance, thing)) = self.target(&dynamics.target) else {
            return;
        };
        let (Dim::Known(unit), Dim::Known(found)) = (self.declared(instance, thing), found) else {
            return;
        };
        let Some(rate) = unit.divide(Dimension::TIME) else {
            return;
        };
        if rate != found {
            self.diags.push(UnitError::WrongRate {
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

    /// The settings of an experiment of the model in sight.
    pub fn experiment(&mut self, experiment: &'f Experiment, overrides: &'f [Bind]) {
        let time = match self.place.has_units {
            true => Dim::Known(Dimension::TIME),
            false => Dim::Unknown,
        };
        for bind in overrides {
            let target = self.target(&bind.target);
            self.bind(bind, target);
        }
        for setting in &experiment.settings {
            match &setting.kind {
                SettingKind::With(binds) => {
                    for bind in binds {
                        let target = self.target(&bind.target);
                        self.bind(bind, target);
                    }
                }
                SettingKind::Horizon {
                    value: Some(value), ..
                } => self.expect("the horizon", time, value, None),
                SettingKind::Output { when, .. } => match when {
                    OutputWhen::Method => {}
                    OutputWhen::Every(instants) | OutputWhen::At(instants) => {
                        self.expect("the time of an output", time, instants, None);
                    }
                },
                SettingKind::Perturb { every, .. } => {
                    self.expect("the period", time, every, None);
                }
                SettingKind::Expect(expect) => self.expectation(expect, time),
                _ => {}
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
                self.agree("the sides of this expectation", sides);
            }
            _ => {}
        }
    }

    fn instant(&mut self, at: &'f Expr, time: Dim) {
        self.expect("an instant", time, at, None);
    }
}
