//! Who sets what: dynamics, regions and hidden terms, entry by entry.

use rustc_hash::{FxHashMap, FxHashSet};

use super::hidden::{self, Range};
use crate::expr::{Expr, Var};
use crate::model::expressions::Lowering;
use crate::model::hir::shared_lets;
use crate::model::names::scope::{Meaning, Reported};
use crate::model::names::target;
use crate::model::{DynamicsError, Model, Rate, Region, Statements, TargetKind};
use crate::syntax::{self, For, RegionGuard, Stmt};

/// What a walk over the statements of a model has found.
pub(crate) struct Walk<'e> {
    /// First entry of every state.
    pub(crate) offsets: Vec<usize>,
    /// Variables of all state entries.
    pub(crate) vars: Vec<Expr<'e>>,
    /// Whether each state has the rate zero by its declaration.
    discrete: Vec<bool>,
    pub(crate) switches: Vec<crate::model::NamedSwitch<'e>>,
    /// Where variables may be, where that is known.
    pub(crate) ranges: FxHashMap<Var, Range>,
    /// Indices of the loops around, as in `R[1,2]`.
    indices: Vec<i64>,
    /// What the statements say.
    pub found: Statements<'e>,
    /// States with a statement that is wrong: whether they are set is unknown.
    pub touched: FxHashSet<String>,
}

/// Where a rate goes.
pub(crate) enum Sink<'s, 'e> {
    Outside,
    Region(&'s mut Vec<Rate<'e>>),
    Hidden(&'s mut Vec<Rate<'e>>),
}

impl<'e> Walk<'e> {
    pub fn new(model: &Model<'e>) -> Self {
        let offsets = model.quantities.states.iter().scan(0, |next, state| {
            let first = *next;
            *next += state.vars.len();
            Some(first)
        });
        let offsets: Vec<usize> = offsets.collect();
        let mut found = Statements::default();
        for (state, &first) in model.quantities.states.iter().zip(&offsets) {
            let entries = if state.is_discrete {
                state.vars.len()
            } else {
                0
            };
            found.dynamics.extend((0..entries).map(|entry| Rate {
                entry: first + entry,
                value: model.exprs.constant(0.0),
                adds: false,
                span: state.span,
            }));
        }
        Walk {
            offsets,
            discrete: model
                .quantities
                .states
                .iter()
                .map(|state| state.is_discrete)
                .collect(),
            switches: model.switches.clone(),
            ranges: hidden::ranges(model),
            indices: vec![],
            found,
            vars: model.state_vars().collect(),
            touched: FxHashSet::default(),
        }
    }

    /// The statements of a model, or of a loop in it.
    pub fn block(&mut self, lowering: &mut Lowering<'_, 'e>, body: &[Stmt]) {
        let _ = self.statements(lowering, body, &mut Sink::Outside);
    }

    /// All statements are looked at; an error says that at least one was wrong.
    pub(crate) fn statements(
        &mut self,
        lowering: &mut Lowering<'_, 'e>,
        body: &[Stmt],
        sink: &mut Sink<'_, 'e>,
    ) -> Result<(), Reported> {
        let mut result = Ok(());
        for stmt in body {
            let one = match (stmt, &mut *sink) {
                (Stmt::Dynamics(dynamics), sink) => self.dynamics(lowering, dynamics, sink),
                (Stmt::For(repeat), sink) => self.repeat(lowering, repeat, sink),
                (Stmt::Region(region), Sink::Outside) => self.region(lowering, region),
                (Stmt::Hidden(hidden), Sink::Outside) => self.hidden(lowering, hidden),
                (Stmt::Jump(jump), Sink::Outside) => self.jump(lowering, jump),
                (Stmt::Mechanics(mechanics), Sink::Outside) => self.mechanics(lowering, mechanics),
                (Stmt::Contact(contact), Sink::Outside) => self.contact(lowering, contact, None),
                (Stmt::Project(project), Sink::Outside) => self.project(lowering, project),
                (Stmt::Program(program), Sink::Outside) => self.program(lowering, program),
                (Stmt::Equation { residual, span }, Sink::Outside) => {
                    self.equation(lowering, residual, *span)
                }
                (Stmt::Complementarity { left, right, span }, Sink::Outside) => {
                    self.complementarity(lowering, left, right, *span)
                }
                _ => Ok(()),
            };
            result = result.and(one);
        }
        result
    }

    fn repeat(
        &mut self,
        lowering: &mut Lowering<'_, 'e>,
        repeat: &For,
        sink: &mut Sink<'_, 'e>,
    ) -> Result<(), Reported> {
        let lets = shared_lets(&repeat.body);
        let outer = self.indices.len();
        let result = lowering.for_each(&repeat.binders, repeat.span, &mut |lowering| {
            let here = repeat
                .binders
                .iter()
                .filter_map(|binder| lowering.names.index_value(&binder.name.name));
            self.indices.extend(here);
            let base = lowering.names.open_frame(&lets);
            let result = self.statements(lowering, &repeat.body, sink);
            lowering.names.locals.truncate(base);
            self.indices.truncate(outer);
            result
        });
        if result.is_err() {
            self.touch(&lowering.names.scope.prefix, &repeat.body);
        }
        result
    }

    /// Remembers all states that some statements set.
    fn touch(&mut self, prefix: &str, body: &[Stmt]) {
        for stmt in body {
            match stmt {
                Stmt::Dynamics(dynamics) => {
                    let name = &dynamics.target.head.name;
                    self.touched.insert(format!("{prefix}{name}"));
                }
                Stmt::Mechanics(mechanics) => {
                    let name = &mechanics.v.head.name;
                    self.touched.insert(format!("{prefix}{name}"));
                }
                Stmt::For(repeat) => self.touch(prefix, &repeat.body),
                Stmt::Region(region) => self.touch(prefix, &region.body),
                _ => {}
            }
        }
    }

    fn dynamics(
        &mut self,
        lowering: &mut Lowering<'_, 'e>,
        dynamics: &syntax::Dynamics,
        sink: &mut Sink<'_, 'e>,
    ) -> Result<(), Reported> {
        let mut result = self.rates(lowering, dynamics);
        if result.is_ok() && !dynamics.adds && matches!(sink, Sink::Hidden(_)) {
            result = lowering.error(DynamicsError::HiddenSets {
                span: dynamics.span,
                operator: dynamics.operator,
            });
        }
        match (&result, sink) {
            (Err(Reported), _) => {
                let name = &dynamics.target.head.name;
                let name = format!("{}{name}", lowering.names.scope.prefix);
                self.touched.insert(name);
            }
            (Ok(rates), Sink::Outside) => self.found.dynamics.extend(rates),
            (Ok(rates), Sink::Region(list) | Sink::Hidden(list)) => list.extend(rates),
        }
        result.map(|_| ())
    }

    fn rates(
        &self,
        lowering: &mut Lowering<'_, 'e>,
        dynamics: &syntax::Dynamics,
    ) -> Result<Vec<Rate<'e>>, Reported> {
        let path = &dynamics.target;
        // A wrong target does not hide what is wrong on the right.
        let target = match lowering.names.scope.get(&path.head.name) {
            Some(Meaning::Value(..)) | None => target::resolve(lowering, path),
            Some(Meaning::Word(kind)) => lowering.error(DynamicsError::not_a_state(path, kind)),
            Some(Meaning::Part(_) | Meaning::Parts(_)) => {
                let (part, span) = (path.head.name.clone(), path.span);
                lowering.error(DynamicsError::OfAPart { part, span })
            }
            Some(Meaning::Family { .. }) => {
                lowering.error(DynamicsError::not_a_state(path, "switch"))
            }
            Some(Meaning::Module(_)) => lowering.error(DynamicsError::not_a_state(path, "file")),
            Some(Meaning::Unusable) => Err(Reported),
        };
        let target = match target {
            Ok(target) => target,
            Err(Reported) => {
                let _ = lowering.numbers(&dynamics.value);
                return Err(Reported);
            }
        };
        let TargetKind::State(state) = target.kind else {
            return lowering.error(DynamicsError::not_a_state(path, target.kind.word()));
        };
        if self.discrete[state] {
            return lowering.error(DynamicsError::Discrete {
                name: path.head.name.clone(),
                span: path.span,
            });
        }
        let what = format!("`{}'`", lowering.names.written().path(path));
        let value = lowering.numbers_as(&dynamics.value, target.shape, &what)?;
        let first = self.offsets[state];
        let rate = |(&entry, &value): (&usize, &_)| Rate {
            entry: first + entry,
            value,
            adds: dynamics.adds,
            span: dynamics.span,
        };
        Ok(target.entries.iter().zip(&value.data).map(rate).collect())
    }

    fn region(
        &mut self,
        lowering: &mut Lowering<'_, 'e>,
        region: &syntax::Region,
    ) -> Result<(), Reported> {
        let zero = lowering.constant(0.0);
        let (guard, guard_span) = match &region.guard {
            RegionGuard::Where(condition) => {
                let truth = guard(lowering, condition);
                (truth.map(|guard| (guard, None)), condition.span)
            }
            RegionGuard::Indicator(indicator) => {
                let value = lowering.scalar(indicator, "an indicator");
                (value.map(|value| (zero, Some(value))), indicator.span)
            }
            RegionGuard::Else => (Ok((zero, None)), region.name.span),
        };
        let lets = shared_lets(&region.body);
        let base = lowering.names.open_frame(&lets);
        let mut rates = vec![];
        let body = self.statements(lowering, &region.body, &mut Sink::Region(&mut rates));
        // A local name that nothing reads may still be wrong.
        let unread = lets.iter().map(|named| {
            let name = syntax::Expr {
                kind: syntax::ExprKind::Name(named.name.name.clone()),
                span: named.name.span,
            };
            lowering.expr(&name).map(|_| ())
        });
        let unread = unread
            .collect::<Vec<_>>()
            .into_iter()
            .fold(Ok(()), Result::and);
        lowering.names.locals.truncate(base);
        match (guard, body.and(unread)) {
            (Ok((guard, indicator)), Ok(())) => {
                let name = self.indexed(&region.name.name);
                let name = format!("{}{name}", lowering.names.scope.prefix);
                self.found.regions.push(Region {
                    name,
                    guard,
                    indicator,
                    is_else: region.guard == RegionGuard::Else,
                    guard_span,
                    rates,
                    span: region.span,
                });
                Ok(())
            }
            _ => {
                self.touch(&lowering.names.scope.prefix, &region.body);
                Err(Reported)
            }
        }
    }

    /// `R[1,2]` in loops.
    pub(crate) fn indexed(&self, name: &str) -> String {
        let indices = self.indices.iter().map(i64::to_string).collect::<Vec<_>>();
        if indices.is_empty() {
            name.to_owned()
        } else {
            format!("{name}[{}]", indices.join(","))
        }
    }
}

/// A guard, which is not constant.
pub(crate) fn guard<'e>(
    lowering: &mut Lowering<'_, 'e>,
    guard: &syntax::Expr,
) -> Result<Expr<'e>, Reported> {
    lowering.in_guard = true;
    let truth = lowering.condition(guard);
    lowering.in_guard = false;
    let truth = truth?;
    if let Some(value) = truth.as_constant() {
        return lowering.error(DynamicsError::ConstantComparison {
            value: value > 0.5,
            span: guard.span,
        });
    }
    Ok(truth)
}
