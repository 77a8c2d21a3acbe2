//! Statements of models, and the rows, bindings and options in them.

use nsd_grammar::Rule;
use pest::iterators::Pair;

use super::experiment::behind;
use super::expression::{binder, expr, path, relation};
use super::reading::{Parts, Reading, is_bad, parts};
use super::recover::recover;
use super::words::Place;
use crate::source::Span;
use crate::syntax::ast::*;

/// The statements of a `body`.
pub(crate) fn body(reading: &mut Reading, pair: Pair<Rule>) -> Vec<Stmt> {
    list(reading, pair, Place::Model, statement, Stmt::Bad)
}

/// The rows of a `rows`.
pub(crate) fn rows(reading: &mut Reading, pair: Pair<Rule>) -> Vec<Row> {
    list(reading, pair, Place::Rows, row, Row::Bad)
}

/// The members of a list in braces.
pub(crate) fn list<T>(
    reading: &mut Reading,
    pair: Pair<Rule>,
    place: Place,
    build: fn(&mut Reading, Pair<Rule>) -> T,
    bad: fn(Span) -> T,
) -> Vec<T> {
    members(reading, parts(pair), place, build, bad)
}

/// Builds the members of a list; wrong ones are diagnosed, and leave what could be read of them and a `bad` node.
pub(crate) fn members<T>(
    reading: &mut Reading,
    parts: Parts,
    place: Place,
    build: fn(&mut Reading, Pair<Rule>) -> T,
    bad: fn(Span) -> T,
) -> Vec<T> {
    let mut list = Vec::new();
    for pair in parts {
        member(reading, pair, place, build, bad, &mut list);
    }
    list
}

/// Builds one member of a list.
fn member<T>(
    reading: &mut Reading,
    pair: Pair<Rule>,
    place: Place,
    build: fn(&mut Reading, Pair<Rule>) -> T,
    bad: fn(Span) -> T,
    list: &mut Vec<T>,
) {
    let mut read = |reading: &mut Reading, pair: Pair<Rule>| {
        let span = reading.span(&pair);
        let wrong = reading.is_wrong(&pair);
        let member = build(reading, pair);
        list.push(if wrong { bad(span) } else { member });
    };
    if !is_bad(pair.as_rule()) {
        return read(reading, pair);
    }
    let (range, span) = (reading.range(&pair), reading.span(&pair));
    let complete = recover(reading, place, range, &mut read);
    list.extend((!complete).then(|| bad(span)));
}

fn statement(reading: &mut Reading, pair: Pair<Rule>) -> Stmt {
    let span = reading.span(&pair);
    let rule = pair.as_rule();
    let mut parts = parts(pair);
    match rule {
        Rule::const_item => Stmt::Const(constant(reading, parts, span)),
        Rule::decl => Stmt::Decl(decl(reading, parts, span)),
        Rule::named => Stmt::Named(named(reading, parts, span)),
        Rule::switch => Stmt::Switch(Switch {
            name: reading.ident(parts.one(Rule::name)),
            value: expr(reading, parts.one(Rule::expr)),
            sliding: (parts.maybe(Rule::sliding)).and_then(|pair| Sliding::named(pair.as_str())),
            span,
        }),
        Rule::part => Stmt::Part(Part {
            name: reading.ident(parts.one(Rule::name)),
            binder: parts
                .maybe(Rule::part_index)
                .map(|index| binder(reading, self::parts(index).one(Rule::binder))),
            model: path(reading, parts.one(Rule::path)),
            binds: parts
                .maybe(Rule::binds)
                .map(|pair| binds(reading, pair))
                .unwrap_or_default(),
            span,
        }),
        Rule::region => Stmt::Region(region(reading, parts, span)),
        Rule::hidden => Stmt::Hidden(Hidden {
            switch: path(reading, parts.one(Rule::path)),
            body: body(reading, parts.one(Rule::body)),
            span,
        }),
        Rule::project => Stmt::Project(Project {
            state: path(reading, parts.one(Rule::path)),
            rows: rows(reading, parts.one(Rule::rows)),
            metric: parts
                .maybe(Rule::metric)
                .map(|metric| expr(reading, self::parts(metric).one(Rule::expr))),
            span,
        }),
        Rule::jump | Rule::sampled => Stmt::Jump(Jump {
            name: parts.maybe(Rule::name).map(|name| reading.ident(name)),
            when: jump_when(reading, &mut parts),
            resets: given(reading, parts.one(Rule::resets), Place::Resets),
            span,
        }),
        Rule::mechanics => Stmt::Mechanics(mechanics(reading, parts, span)),
        Rule::contact => Stmt::Contact(contact(reading, parts, span)),
        Rule::for_loop => Stmt::For(For {
            binders: binders(reading, &mut parts),
            body: body(reading, parts.one(Rule::body)),
            span,
        }),
        Rule::program => Stmt::Program(program(reading, parts, span)),
        Rule::equation => {
            parts.one(Rule::zero);
            let residual = expr(reading, parts.one(Rule::expr));
            Stmt::Equation { residual, span }
        }
        Rule::complementarity => {
            parts.one(Rule::zero);
            let left = expr(reading, parts.one(Rule::arith));
            let right = expr(reading, parts.one(Rule::arith));
            Stmt::Complementarity { left, right, span }
        }
        Rule::dynamics => Stmt::Dynamics(dynamics(reading, parts, span)),
        rule => unreachable!("grammar: {rule:?} is no statement"),
    }
}

pub(crate) fn constant(reading: &mut Reading, mut parts: Parts, span: Span) -> Const {
    Const {
        name: reading.ident(parts.one(Rule::name)),
        value: expr(reading, parts.one(Rule::expr)),
        span,
    }
}

fn dynamics(reading: &mut Reading, mut parts: Parts, span: Span) -> Dynamics {
    let target = path(reading, parts.one(Rule::path));
    let operator = parts.one(Rule::dynamics_op);
    Dynamics {
        target,
        adds: operator.as_str() == "+=",
        operator: reading.span(&operator),
        value: expr(reading, parts.one(Rule::expr)),
        span,
    }
}

fn decl(reading: &mut Reading, mut parts: Parts, span: Span) -> Decl {
    let kind = match parts.one(Rule::decl_kind).as_str() {
        "param" => DeclKind::Param,
        "state" => DeclKind::State,
        "discrete" => DeclKind::Discrete,
        "control" => DeclKind::Control,
        "input" => DeclKind::Input,
        _ => DeclKind::Algebraic,
    };
    Decl {
        kind,
        name: reading.ident(parts.one(Rule::name)),
        shape: sizes(reading, &mut parts),
        unit: unit(reading, &mut parts),
        domain: parts.maybe(Rule::domain).map(|pair| domain(reading, pair)),
        value: parts.maybe(Rule::expr).map(|value| expr(reading, value)),
        span,
    }
}

fn sizes(reading: &mut Reading, parts: &mut Parts) -> Vec<Expr> {
    let sizes = parts.maybe(Rule::sizes).into_iter().flat_map(self::parts);
    sizes.map(|size| expr(reading, size)).collect()
}

fn unit(reading: &mut Reading, parts: &mut Parts) -> Option<Unit> {
    let pair = parts.maybe(Rule::unit)?;
    Some(unit_of(reading, pair))
}

/// The unit of a declaration, or behind a number.
pub(crate) fn unit_of(reading: &mut Reading, pair: Pair<Rule>) -> Unit {
    let span = reading.span(&pair);
    let (mut factors, mut divides) = (Vec::new(), false);
    for part in parts(pair) {
        match part.as_rule() {
            Rule::unit_op => divides = part.as_str() == "/",
            _ => factors.push(unit_factor(reading, part, divides)),
        }
    }
    Unit { factors, span }
}

fn unit_factor(reading: &mut Reading, pair: Pair<Rule>, divides: bool) -> UnitFactor {
    let span = reading.span(&pair);
    let mut parts = parts(pair);
    let base = parts
        .next()
        .expect("grammar: a factor of a unit has a base");
    let base = match base.as_rule() {
        Rule::name | Rule::known_unit => UnitBase::Name(reading.ident(base)),
        Rule::number => UnitBase::Number(number(&base)),
        _ => UnitBase::Group(unit_of(reading, base)),
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

pub(crate) fn domain(reading: &mut Reading, pair: Pair<Rule>) -> Domain {
    let pair = parts(pair)
        .next()
        .expect("grammar: a domain is an interval or a set");
    match pair.as_rule() {
        Rule::interval => {
            let (lower, upper) = interval(reading, pair);
            Domain::Box(lower, upper)
        }
        _ => Domain::Set(parts(pair).map(|value| expr(reading, value)).collect()),
    }
}

pub(crate) fn interval(reading: &mut Reading, pair: Pair<Rule>) -> (Expr, Expr) {
    let mut parts = parts(pair);
    let lower = expr(reading, parts.one(Rule::expr));
    let upper = expr(reading, parts.one(Rule::expr));
    (lower, upper)
}

fn named(reading: &mut Reading, mut parts: Parts, span: Span) -> Named {
    let kind = match parts.one(Rule::named_kind).as_str() {
        "let" => NamedKind::Let,
        "output" => NamedKind::Output,
        _ => NamedKind::Signal,
    };
    Named {
        kind,
        name: reading.ident(parts.one(Rule::name)),
        unit: unit(reading, &mut parts),
        value: expr(reading, parts.one(Rule::expr)),
        span,
    }
}

fn region(reading: &mut Reading, mut parts: Parts, span: Span) -> Region {
    let name = reading.ident(parts.one(Rule::name));
    let guard = parts.next().expect("grammar: a region has a guard");
    let rule = guard.as_rule();
    let condition = self::parts(guard)
        .maybe(Rule::expr)
        .map(|condition| expr(reading, condition));
    let guard = match (rule, condition) {
        (Rule::guard_where, Some(condition)) => RegionGuard::Where(condition),
        (Rule::guard_indicator, Some(condition)) => RegionGuard::Indicator(condition),
        _ => RegionGuard::Else,
    };
    Region {
        name,
        guard,
        body: body(reading, parts.one(Rule::body)),
        span,
    }
}

fn jump_when(reading: &mut Reading, parts: &mut Parts) -> JumpWhen {
    match behind(reading, parts, Rule::every) {
        Some(period) => JumpWhen::Every {
            period,
            offset: behind(reading, parts, Rule::offset),
        },
        None => JumpWhen::Guard(expr(reading, parts.one(Rule::expr))),
    }
}

fn mechanics(reading: &mut Reading, mut parts: Parts, span: Span) -> Mechanics {
    let q = path(reading, parts.one(Rule::path));
    let v = path(reading, parts.one(Rule::path));
    let members = members(reading, parts, Place::Mechanics, mechanics_member, |_| None);
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

fn mechanics_member(reading: &mut Reading, pair: Pair<Rule>) -> Option<MechanicsMember> {
    let span = reading.span(&pair);
    match pair.as_rule() {
        Rule::contact => {
            let contact = contact(reading, parts(pair), span);
            Some(MechanicsMember::Contact(contact))
        }
        _ => option(reading, pair).map(MechanicsMember::Option),
    }
}

fn contact(reading: &mut Reading, mut parts: Parts, span: Span) -> Contact {
    Contact {
        name: reading.ident(parts.one(Rule::name)),
        options: options(reading, parts.one(Rule::options)),
        span,
    }
}

fn program(reading: &mut Reading, mut parts: Parts, span: Span) -> Program {
    let name = reading.ident(parts.one(Rule::name));
    let shape = sizes(reading, &mut parts);
    let kind = match parts.maybe(Rule::argmin) {
        Some(argmin) => {
            let mut parts = self::parts(argmin);
            ProgramKind::Argmin {
                objective: expr(reading, parts.one(Rule::expr)),
                rows: parts
                    .maybe(Rule::rows)
                    .map(|pair| rows(reading, pair))
                    .unwrap_or_default(),
            }
        }
        None => variational(reading, parts.one(Rule::variational)),
    };
    Program {
        name,
        shape,
        kind,
        span,
    }
}

fn variational(reading: &mut Reading, pair: Pair<Rule>) -> ProgramKind {
    let mut parts = parts(pair);
    match parts.maybe(Rule::rows) {
        Some(pair) => ProgramKind::VariationalRows {
            rows: rows(reading, pair),
            map: expr(reading, parts.one(Rule::expr)),
        },
        None => {
            let (lower, upper) = interval(reading, parts.one(Rule::interval));
            let map = expr(reading, parts.one(Rule::expr));
            ProgramKind::VariationalBox { lower, upper, map }
        }
    }
}

pub(crate) fn row(reading: &mut Reading, pair: Pair<Rule>) -> Row {
    let span = reading.span(&pair);
    let rule = pair.as_rule();
    let mut parts = parts(pair);
    if rule == Rule::row_for {
        return Row::For {
            binders: binders(reading, &mut parts),
            rows: rows(reading, parts.one(Rule::rows)),
            span,
        };
    }
    let first = expr(reading, parts.one(Rule::arith));
    let mut rest = Vec::new();
    while let Some(relator) = parts.maybe(Rule::relator) {
        rest.push((
            relation(relator.as_str()),
            expr(reading, parts.one(Rule::arith)),
        ));
    }
    Row::Relation { first, rest, span }
}

pub(crate) fn binders(reading: &mut Reading, parts: &mut Parts) -> Vec<Binder> {
    let mut binders = Vec::new();
    while let Some(pair) = parts.maybe(Rule::binder) {
        binders.push(binder(reading, pair));
    }
    binders
}

/// The members of a `binds`.
pub(crate) fn binds(reading: &mut Reading, pair: Pair<Rule>) -> Vec<Bind> {
    given(reading, pair, Place::Binds)
}

fn given(reading: &mut Reading, pair: Pair<Rule>, place: Place) -> Vec<Bind> {
    let list = list(
        reading,
        pair,
        place,
        |reading, pair| Some(bind(reading, pair)),
        |_| None,
    );
    list.into_iter().flatten().collect()
}

/// A `bind` or a `reset`.
pub(crate) fn bind(reading: &mut Reading, pair: Pair<Rule>) -> Bind {
    let span = reading.span(&pair);
    let mut parts = parts(pair);
    Bind {
        target: path(reading, parts.one(Rule::path)),
        value: expr(reading, parts.one(Rule::expr)),
        span,
    }
}

/// The members of an `options`.
pub(crate) fn options(reading: &mut Reading, pair: Pair<Rule>) -> Vec<Setting> {
    let list = list(reading, pair, Place::Options, option, |_| None);
    list.into_iter().flatten().collect()
}

fn option(reading: &mut Reading, pair: Pair<Rule>) -> Option<Setting> {
    let span = reading.span(&pair);
    let mut parts = parts(pair);
    Some(Setting {
        name: reading.ident(parts.one(Rule::name)),
        value: expr(reading, parts.one(Rule::expr)),
        span,
    })
}

/// What stands in the braces of a `mechanics`.
enum MechanicsMember {
    Option(Setting),
    Contact(Contact),
}

fn number(pair: &Pair<Rule>) -> f64 {
    pair.as_str().parse().unwrap_or(f64::NAN)
}
