//! Statements of models, and the rows, bindings and options in them.

use nsd_grammar::Rule;
use pest::iterators::Pair;

use super::expression::relation;
use super::recover::Place;
use super::{Builder, Parts, is_bad, parts};
use crate::source::Span;
use crate::syntax::ast::*;

impl Builder<'_> {
    /// The statements of a `body`.
    pub(super) fn body(&mut self, pair: Pair<Rule>) -> Vec<Stmt> {
        self.list(pair, Place::Model, Builder::statement, Stmt::Bad)
    }

    /// The rows of a `rows`.
    pub(super) fn rows(&mut self, pair: Pair<Rule>) -> Vec<Row> {
        self.list(pair, Place::Rows, Builder::row, Row::Bad)
    }

    /// Builds the members of a list in braces; wrong ones are diagnosed, and
    /// leave what could be read of them and a `bad` node.
    pub(super) fn list<T>(
        &mut self,
        pair: Pair<Rule>,
        place: Place,
        build: fn(&mut Self, Pair<Rule>) -> T,
        bad: fn(Span) -> T,
    ) -> Vec<T> {
        let mut list = Vec::new();
        for pair in parts(pair) {
            self.member(pair, place, build, bad, &mut list);
        }
        list
    }

    /// Builds one member of a list.
    pub(super) fn member<T>(
        &mut self,
        pair: Pair<Rule>,
        place: Place,
        build: fn(&mut Self, Pair<Rule>) -> T,
        bad: fn(Span) -> T,
        list: &mut Vec<T>,
    ) {
        let mut read = |builder: &mut Self, pair: Pair<Rule>| {
            let span = builder.span(&pair);
            let wrong = builder.is_wrong(&pair);
            let member = build(builder, pair);
            list.push(if wrong { bad(span) } else { member });
        };
        if !is_bad(pair.as_rule()) {
            return read(self, pair);
        }
        let (range, span) = (self.range(&pair), self.span(&pair));
        let complete = self.recover(place, range, &mut read);
        list.extend((!complete).then(|| bad(span)));
    }

    fn statement(&mut self, pair: Pair<Rule>) -> Stmt {
        let span = self.span(&pair);
        let rule = pair.as_rule();
        let mut parts = parts(pair);
        match rule {
            Rule::const_item => Stmt::Const(self.constant(parts, span)),
            Rule::decl => Stmt::Decl(self.decl(parts, span)),
            Rule::named => Stmt::Named(self.named(parts, span)),
            Rule::switch => Stmt::Switch(Switch {
                name: self.ident(parts.one(Rule::name)),
                value: self.expr(parts.one(Rule::expr)),
                sliding: parts.maybe(Rule::sliding).map(|pair| match pair.as_str() {
                    "linear" => Sliding::Linear,
                    _ => Sliding::Nonlinear,
                }),
                span,
            }),
            Rule::part => Stmt::Part(Part {
                name: self.ident(parts.one(Rule::name)),
                binder: parts
                    .maybe(Rule::part_index)
                    .map(|index| self.binder(self::parts(index).one(Rule::binder))),
                model: self.path(parts.one(Rule::path)),
                binds: parts
                    .maybe(Rule::binds)
                    .map(|binds| self.binds(binds))
                    .unwrap_or_default(),
                span,
            }),
            Rule::region => Stmt::Region(self.region(parts, span)),
            Rule::hidden => Stmt::Hidden(Hidden {
                switch: self.path(parts.one(Rule::path)),
                body: self.body(parts.one(Rule::body)),
                span,
            }),
            Rule::project => Stmt::Project(Project {
                state: self.path(parts.one(Rule::path)),
                rows: self.rows(parts.one(Rule::rows)),
                metric: parts
                    .maybe(Rule::metric)
                    .map(|metric| self.expr(self::parts(metric).one(Rule::expr))),
                span,
            }),
            Rule::jump => Stmt::Jump(Jump {
                name: self.ident(parts.one(Rule::name)),
                guard: self.expr(parts.one(Rule::expr)),
                resets: self.given(parts.one(Rule::resets), Place::Resets),
                span,
            }),
            Rule::mechanics => Stmt::Mechanics(self.mechanics(parts, span)),
            Rule::contact => Stmt::Contact(self.contact(parts, span)),
            Rule::for_loop => Stmt::For(For {
                binders: self.binders(&mut parts),
                body: self.body(parts.one(Rule::body)),
                span,
            }),
            Rule::program => Stmt::Program(self.program(parts, span)),
            Rule::equation => {
                parts.one(Rule::zero);
                let residual = self.expr(parts.one(Rule::expr));
                Stmt::Equation { residual, span }
            }
            Rule::complementarity => {
                parts.one(Rule::zero);
                let left = self.expr(parts.one(Rule::arith));
                let right = self.expr(parts.one(Rule::arith));
                Stmt::Complementarity { left, right, span }
            }
            Rule::dynamics => Stmt::Dynamics(self.dynamics(parts, span)),
            rule => unreachable!("grammar: {rule:?} is no statement"),
        }
    }

    fn dynamics(&mut self, mut parts: Parts, span: Span) -> Dynamics {
        let target = self.path(parts.one(Rule::path));
        let operator = parts.one(Rule::dynamics_op);
        Dynamics {
            target,
            adds: operator.as_str() == "+=",
            operator: self.span(&operator),
            value: self.expr(parts.one(Rule::expr)),
            span,
        }
    }

    fn decl(&mut self, mut parts: Parts, span: Span) -> Decl {
        let kind = match parts.one(Rule::decl_kind).as_str() {
            "param" => DeclKind::Param,
            "state" => DeclKind::State,
            "control" => DeclKind::Control,
            "input" => DeclKind::Input,
            _ => DeclKind::Algebraic,
        };
        Decl {
            kind,
            name: self.ident(parts.one(Rule::name)),
            shape: self.sizes(&mut parts),
            unit: self.unit(&mut parts),
            domain: parts.maybe(Rule::domain).map(|domain| self.domain(domain)),
            value: parts.maybe(Rule::expr).map(|value| self.expr(value)),
            span,
        }
    }

    fn sizes(&mut self, parts: &mut Parts) -> Vec<Expr> {
        let sizes = parts.maybe(Rule::sizes).into_iter().flat_map(self::parts);
        sizes.map(|size| self.expr(size)).collect()
    }

    fn unit(&mut self, parts: &mut Parts) -> Option<Unit> {
        let pair = parts.maybe(Rule::unit)?;
        Some(self.unit_of(pair))
    }

    fn unit_of(&mut self, pair: Pair<Rule>) -> Unit {
        let span = self.span(&pair);
        let (mut factors, mut divides) = (Vec::new(), false);
        for part in parts(pair) {
            match part.as_rule() {
                Rule::unit_op => divides = part.as_str() == "/",
                _ => factors.push(self.unit_factor(part, divides)),
            }
        }
        Unit { factors, span }
    }

    fn unit_factor(&mut self, pair: Pair<Rule>, divides: bool) -> UnitFactor {
        let span = self.span(&pair);
        let mut parts = parts(pair);
        let base = parts
            .next()
            .expect("grammar: a factor of a unit has a base");
        let base = match base.as_rule() {
            Rule::name => UnitBase::Name(self.ident(base)),
            Rule::number => UnitBase::Number(number(&base)),
            _ => UnitBase::Group(self.unit_of(base)),
        };
        let power = parts.maybe(Rule::unit_power).map(|power| {
            let mut parts = self::parts(power);
            let sign = parts.maybe(Rule::unit_sign).map_or(1.0, |_| -1.0);
            let numerator = sign * number(&parts.one(Rule::number));
            let denominator = parts.maybe(Rule::number);
            (numerator, denominator.map_or(1.0, |pair| number(&pair)))
        });
        UnitFactor {
            divides,
            base,
            power,
            span,
        }
    }

    pub(super) fn domain(&mut self, pair: Pair<Rule>) -> Domain {
        let pair = parts(pair)
            .next()
            .expect("grammar: a domain is an interval or a set");
        match pair.as_rule() {
            Rule::interval => {
                let (lower, upper) = self.interval(pair);
                Domain::Box(lower, upper)
            }
            _ => Domain::Set(parts(pair).map(|value| self.expr(value)).collect()),
        }
    }

    pub(super) fn interval(&mut self, pair: Pair<Rule>) -> (Expr, Expr) {
        let mut parts = parts(pair);
        let lower = self.expr(parts.one(Rule::expr));
        let upper = self.expr(parts.one(Rule::expr));
        (lower, upper)
    }

    fn named(&mut self, mut parts: Parts, span: Span) -> Named {
        let kind = match parts.one(Rule::named_kind).as_str() {
            "let" => NamedKind::Let,
            "output" => NamedKind::Output,
            _ => NamedKind::Signal,
        };
        Named {
            kind,
            name: self.ident(parts.one(Rule::name)),
            unit: self.unit(&mut parts),
            value: self.expr(parts.one(Rule::expr)),
            span,
        }
    }

    fn region(&mut self, mut parts: Parts, span: Span) -> Region {
        let name = self.ident(parts.one(Rule::name));
        let guard = parts.next().expect("grammar: a region has a guard");
        let rule = guard.as_rule();
        let condition = self::parts(guard)
            .maybe(Rule::expr)
            .map(|condition| self.expr(condition));
        let guard = match (rule, condition) {
            (Rule::guard_where, Some(condition)) => RegionGuard::Where(condition),
            (Rule::guard_indicator, Some(condition)) => RegionGuard::Indicator(condition),
            _ => RegionGuard::Else,
        };
        Region {
            name,
            guard,
            body: self.body(parts.one(Rule::body)),
            span,
        }
    }

    fn mechanics(&mut self, mut parts: Parts, span: Span) -> Mechanics {
        let q = self.path(parts.one(Rule::path));
        let v = self.path(parts.one(Rule::path));
        let mut members = Vec::new();
        for pair in parts {
            let build = Builder::mechanics_member;
            self.member(pair, Place::Mechanics, build, |_| None, &mut members);
        }
        let mut mechanics = Mechanics {
            q,
            v,
            options: Vec::new(),
            contacts: Vec::new(),
            span,
        };
        for member in members.into_iter().flatten() {
            match member {
                MechanicsMember::Option(option) => mechanics.options.push(option),
                MechanicsMember::Contact(contact) => mechanics.contacts.push(contact),
            }
        }
        mechanics
    }

    fn mechanics_member(&mut self, pair: Pair<Rule>) -> Option<MechanicsMember> {
        let span = self.span(&pair);
        match pair.as_rule() {
            Rule::contact => {
                let contact = self.contact(parts(pair), span);
                Some(MechanicsMember::Contact(contact))
            }
            _ => self.option(pair).map(MechanicsMember::Option),
        }
    }

    fn contact(&mut self, mut parts: Parts, span: Span) -> Contact {
        Contact {
            name: self.ident(parts.one(Rule::name)),
            options: self.options(parts.one(Rule::options)),
            span,
        }
    }

    fn program(&mut self, mut parts: Parts, span: Span) -> Program {
        let name = self.ident(parts.one(Rule::name));
        let shape = self.sizes(&mut parts);
        let kind = match parts.maybe(Rule::argmin) {
            Some(argmin) => {
                let mut parts = self::parts(argmin);
                ProgramKind::Argmin {
                    objective: self.expr(parts.one(Rule::expr)),
                    rows: parts
                        .maybe(Rule::rows)
                        .map(|rows| self.rows(rows))
                        .unwrap_or_default(),
                }
            }
            None => self.variational(parts.one(Rule::variational)),
        };
        Program {
            name,
            shape,
            kind,
            span,
        }
    }

    fn variational(&mut self, pair: Pair<Rule>) -> ProgramKind {
        let mut parts = parts(pair);
        match parts.maybe(Rule::rows) {
            Some(rows) => ProgramKind::VariationalRows {
                rows: self.rows(rows),
                map: self.expr(parts.one(Rule::expr)),
            },
            None => {
                let (lower, upper) = self.interval(parts.one(Rule::interval));
                let map = self.expr(parts.one(Rule::expr));
                ProgramKind::VariationalBox { lower, upper, map }
            }
        }
    }

    pub(super) fn row(&mut self, pair: Pair<Rule>) -> Row {
        let span = self.span(&pair);
        let rule = pair.as_rule();
        let mut parts = parts(pair);
        if rule == Rule::row_for {
            return Row::For {
                binders: self.binders(&mut parts),
                rows: self.rows(parts.one(Rule::rows)),
                span,
            };
        }
        let first = self.expr(parts.one(Rule::arith));
        let mut rest = Vec::new();
        while let Some(relator) = parts.maybe(Rule::relator) {
            rest.push((
                relation(relator.as_str()),
                self.expr(parts.one(Rule::arith)),
            ));
        }
        Row::Relation { first, rest, span }
    }

    pub(super) fn binders(&mut self, parts: &mut Parts) -> Vec<Binder> {
        let mut binders = Vec::new();
        while let Some(binder) = parts.maybe(Rule::binder) {
            binders.push(self.binder(binder));
        }
        binders
    }

    /// The members of a `binds`.
    pub(super) fn binds(&mut self, pair: Pair<Rule>) -> Vec<Bind> {
        self.given(pair, Place::Binds)
    }

    fn given(&mut self, pair: Pair<Rule>, place: Place) -> Vec<Bind> {
        let list = self.list(
            pair,
            place,
            |builder, pair| Some(builder.bind(pair)),
            |_| None,
        );
        list.into_iter().flatten().collect()
    }

    /// A `bind` or a `reset`.
    pub(super) fn bind(&mut self, pair: Pair<Rule>) -> Bind {
        let span = self.span(&pair);
        let mut parts = parts(pair);
        Bind {
            target: self.path(parts.one(Rule::path)),
            value: self.expr(parts.one(Rule::expr)),
            span,
        }
    }

    /// The members of an `options`.
    pub(super) fn options(&mut self, pair: Pair<Rule>) -> Vec<Setting> {
        let list = self.list(pair, Place::Options, Builder::option, |_| None);
        list.into_iter().flatten().collect()
    }

    fn option(&mut self, pair: Pair<Rule>) -> Option<Setting> {
        let span = self.span(&pair);
        let mut parts = parts(pair);
        Some(Setting {
            name: self.ident(parts.one(Rule::name)),
            value: self.expr(parts.one(Rule::expr)),
            span,
        })
    }
}

/// What stands in the braces of a `mechanics`.
enum MechanicsMember {
    Option(Setting),
    Contact(Contact),
}

fn number(pair: &Pair<Rule>) -> f64 {
    pair.as_str().parse().unwrap_or(f64::NAN)
}
