//! Statements of models.

use std::fmt;

use super::expression::{arith, binders, relation};
use super::{Printer, list};
use crate::syntax::ast::*;

impl Printer {
    pub(super) fn statements(&mut self, body: &[Stmt]) {
        for statement in body {
            self.statement(statement);
        }
    }

    fn statement(&mut self, statement: &Stmt) {
        match statement {
            Stmt::Const(stmt) => self.line(format!("const {} = {};", stmt.name, stmt.value)),
            Stmt::Decl(stmt) => self.line(decl(stmt)),
            Stmt::Named(stmt) => self.line(named(stmt)),
            Stmt::Switch(stmt) => {
                let sliding = stmt
                    .sliding
                    .map(|reading| format!(" sliding {}", reading.word()));
                let sliding = sliding.unwrap_or_default();
                self.line(format!("switch {} = {}{sliding};", stmt.name, stmt.value));
            }
            Stmt::Part(stmt) => self.part(stmt),
            Stmt::Region(stmt) => {
                let guard = match &stmt.guard {
                    RegionGuard::Where(guard) => format!("where {guard}"),
                    RegionGuard::Indicator(guard) => format!("indicator {guard}"),
                    RegionGuard::Else => "else".to_owned(),
                };
                self.block(format!("region {} {guard}", stmt.name), "", |printer| {
                    printer.statements(&stmt.body);
                });
            }
            Stmt::Hidden(stmt) => self.block(format!("hidden on {}", stmt.switch), "", |printer| {
                printer.statements(&stmt.body);
            }),
            Stmt::Project(stmt) => {
                let metric = stmt
                    .metric
                    .as_ref()
                    .map(|metric| format!(" metric {metric};"));
                self.block(
                    format!("project {} onto", stmt.state),
                    &metric.unwrap_or_default(),
                    |printer| printer.rows(&stmt.rows),
                );
            }
            Stmt::Jump(stmt) => self.block(jump_head(stmt), "", |printer| {
                printer.binds(&stmt.resets, ":=");
            }),
            Stmt::Mechanics(stmt) => {
                self.block(format!("mechanics {}, {}", stmt.q, stmt.v), "", |printer| {
                    printer.options(&stmt.options);
                    stmt.contacts
                        .iter()
                        .for_each(|contact| printer.contact(contact));
                })
            }
            Stmt::Contact(stmt) => self.contact(stmt),
            Stmt::For(stmt) => {
                self.block(format!("for {}", binders(&stmt.binders)), "", |printer| {
                    printer.statements(&stmt.body);
                })
            }
            Stmt::Program(stmt) => self.program(stmt),
            Stmt::Equation { residual, .. } => self.line(format!("0 = {residual};")),
            Stmt::Complementarity { left, right, .. } => {
                self.line(format!("0 <= {} perp {} >= 0;", arith(left), arith(right)));
            }
            Stmt::Dynamics(stmt) => {
                let operator = if stmt.adds { "+=" } else { "=" };
                self.line(format!("{}' {operator} {};", stmt.target, stmt.value));
            }
            Stmt::Bad(_) => self.bad(),
        }
    }

    fn part(&mut self, stmt: &Part) {
        let binder = stmt.binder.as_ref().map(std::slice::from_ref);
        let index = binder.map(|binder| format!("[{}]", binders(binder)));
        let index = index.unwrap_or_default();
        let head = format!("part {}{index} = {}", stmt.name, stmt.model);
        match stmt.binds.is_empty() {
            true => self.line(format!("{head};")),
            false => self.block(head, "", |printer| printer.binds(&stmt.binds, "=")),
        }
    }

    fn contact(&mut self, contact: &Contact) {
        self.block(format!("contact {}", contact.name), "", |printer| {
            printer.options(&contact.options);
        });
    }

    fn program(&mut self, stmt: &Program) {
        let head = format!("{}{} in", stmt.name, sizes(&stmt.shape));
        match &stmt.kind {
            ProgramKind::Argmin { objective, rows } if rows.is_empty() => {
                self.line(format!("{head} argmin {objective};"));
            }
            ProgramKind::Argmin { objective, rows } => {
                self.block(
                    format!("{head} argmin {objective} subject to"),
                    "",
                    |printer| {
                        printer.rows(rows);
                    },
                );
            }
            ProgramKind::VariationalRows { rows, map } => {
                self.block(
                    format!("{head} variational"),
                    &format!(" solves {map};"),
                    |printer| {
                        printer.rows(rows);
                    },
                );
            }
            ProgramKind::VariationalBox { lower, upper, map } => {
                self.line(format!(
                    "{head} variational [{lower}, {upper}] solves {map};"
                ));
            }
        }
    }

    pub(super) fn rows(&mut self, rows: &[Row]) {
        for row in rows {
            match row {
                Row::For { binders, rows, .. } => {
                    let head = format!("for {}", super::expression::binders(binders));
                    self.block(head, "", |printer| printer.rows(rows));
                }
                Row::Relation { first, rest, .. } => {
                    let rest = rest
                        .iter()
                        .map(|(op, member)| format!(" {} {}", relation(*op), arith(member)));
                    self.line(format!("{}{};", arith(first), rest.collect::<String>()));
                }
                Row::Bad(_) => self.bad(),
            }
        }
    }

    pub(super) fn binds(&mut self, binds: &[Bind], operator: &str) {
        for bind in binds {
            self.line(format!("{} {operator} {};", bind.target, bind.value));
        }
    }

    pub(super) fn options(&mut self, options: &[Setting]) {
        for option in options {
            self.line(format!("{} = {};", option.name, option.value));
        }
    }
}

fn decl(stmt: &Decl) -> String {
    let word = match stmt.kind {
        DeclKind::Param => "param",
        DeclKind::State => "state",
        DeclKind::Discrete => "discrete",
        DeclKind::Control => "control",
        DeclKind::Input => "input",
        DeclKind::Algebraic => "algebraic",
    };
    let value = stmt.value.as_ref().map(|value| format!(" = {value}"));
    format!(
        "{word} {}{}{}{}{};",
        stmt.name,
        sizes(&stmt.shape),
        unit(&stmt.unit),
        domain(&stmt.domain),
        value.unwrap_or_default()
    )
}

fn named(stmt: &Named) -> String {
    let word = match stmt.kind {
        NamedKind::Let => "let",
        NamedKind::Output => "output",
        NamedKind::Signal => "signal",
    };
    let unit = unit(&stmt.unit);
    format!("{word} {}{unit} = {};", stmt.name, stmt.value)
}

fn sizes(shape: &[Expr]) -> String {
    match shape.is_empty() {
        true => String::new(),
        false => format!("[{}]", list(shape)),
    }
}

/// What stands before the resets of a jump.
fn jump_head(jump: &Jump) -> String {
    let name = jump.name.iter().map(|name| format!("jump {name} "));
    let name: String = name.collect();
    match &jump.when {
        JumpWhen::Guard(guard) => format!("{name}when {guard}"),
        JumpWhen::Every { period, offset } => {
            let offset = offset.iter().map(|offset| format!(" offset {offset}"));
            format!("{name}every {period}{}", offset.collect::<String>())
        }
    }
}

fn unit(unit: &Option<Unit>) -> String {
    let unit = unit.as_ref().map(|unit| format!(" : {unit}"));
    unit.unwrap_or_default()
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (position, factor) in self.factors.iter().enumerate() {
            match (position, factor.divides) {
                (0, _) => {}
                (_, true) => write!(f, "/")?,
                (_, false) => write!(f, "*")?,
            }
            match &factor.base {
                UnitBase::Name(name) => write!(f, "{name}")?,
                UnitBase::Number(value) => write!(f, "{value}")?,
                UnitBase::Group(unit) => write!(f, "({unit})")?,
            }
            match factor.power {
                None => {}
                Some((numerator, 1.0)) => write!(f, "^{numerator}")?,
                Some((numerator, denominator)) => write!(f, "^({numerator}/{denominator})")?,
            }
        }
        Ok(())
    }
}

pub(super) fn domain(domain: &Option<Domain>) -> String {
    match domain {
        None => String::new(),
        Some(Domain::Box(lower, upper)) => format!(" in [{lower}, {upper}]"),
        Some(Domain::Set(values)) => format!(" in {{{}}}", list(values)),
    }
}
