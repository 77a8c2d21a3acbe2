//! Declarations: variables for what varies, values for what is named.

use std::collections::BTreeMap;

use super::lower::{Lazy, Local, Lowering};
use super::names::{Declared, Frame, Item};
use super::resolve::{given, switch_argument};
use super::scope::{Meaning, Reported, Scope, Value};
use super::{
    DynamicsError, Model, ModelError, Named, NamedSwitch, Quantity, Shape, TargetKind, Tensor,
    Unsupported, order,
};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, variables_of};
use crate::source::Span;
use crate::syntax::{self, Bind, DeclKind, Domain, NamedKind};

/// A model while its declarations are computed.
pub(super) struct Declaring<'d, 'e> {
    pub model: Model<'e>,
    pub diags: &'d mut Diagnostics,
}

impl<'d, 'e> Declaring<'d, 'e> {
    pub fn new(name: &str, span: Span, scope: Scope<'e>, diags: &'d mut Diagnostics) -> Self {
        let model = Model {
            name: name.to_owned(),
            exprs: scope.exprs,
            time: scope.time,
            params: vec![],
            states: vec![],
            controls: vec![],
            inputs: vec![],
            signals: vec![],
            lets: vec![],
            outputs: vec![],
            switches: vec![],
            dynamics: vec![],
            regions: vec![],
            partitions: vec![],
            hidden: vec![],
            surfaces: vec![],
            param_order: vec![],
            scope,
            span,
        };
        Declaring { model, diags }
    }

    /// Gives a declared name no meaning for now.
    pub fn unusable(&mut self, declared: &Declared<'_>) {
        let name = declared.name.name.clone();
        self.model.scope.names.insert(name, Meaning::Unusable);
    }

    /// Gives a declared name its meaning. What it needs has one already.
    pub fn declare(&mut self, declared: &Declared<'_>, with: &[Bind]) {
        let meaning = match declared.item {
            Item::Const(item) => self.constant(item, with),
            Item::Decl(decl) => self.quantity(decl),
            Item::Named(named) => self.named(named),
            Item::Switch(switch) => self.switch(switch, &declared.frames),
            Item::Word(kind) => Ok(Meaning::Word(kind)),
            Item::Unsupported => Ok(Meaning::Unusable),
        };
        let name = declared.name.name.clone();
        self.model
            .scope
            .names
            .insert(name, meaning.unwrap_or(Meaning::Unusable));
    }

    /// Runs `lower` on a fresh lowering over what is declared so far.
    fn lowering<T>(
        &mut self,
        lower: impl FnOnce(&mut Lowering<'_, 'e>) -> Result<T, Reported>,
    ) -> Result<T, Reported> {
        let mut lowering = Lowering::new(&self.model.scope, None, self.diags);
        let value = lower(&mut lowering);
        self.model.surfaces.append(&mut lowering.surfaces);
        value
    }

    fn constant(&mut self, item: &syntax::Const, with: &[Bind]) -> Result<Meaning<'e>, Reported> {
        let value = given(item, with);
        let what = format!("`{}`", item.name.name);
        self.lowering(|lowering| {
            let lowered = lowering.expr(value)?;
            lowering.as_constants(&lowered.tensor, &what, value.span)?;
            Ok(Meaning::Value(lowered, TargetKind::Const))
        })
    }

    fn quantity(&mut self, decl: &syntax::Decl) -> Result<Meaning<'e>, Reported> {
        let name = &decl.name.name;
        if let Some(unit) = &decl.unit {
            self.unit(unit);
        }
        let shape = self.lowering(|lowering| {
            let mut sizes = vec![];
            for size in &decl.shape {
                sizes.push(lowering.size(size, &format!("the size of `{name}`"))?);
            }
            let shape = match sizes[..] {
                [] => Shape::Scalar,
                [n] => Shape::Vector(n),
                [m, n] => Shape::matrix(m, n),
                _ => {
                    return lowering.error(ModelError::IndexCount {
                        what: format!("the size of `{name}`"),
                        expected: "at most two numbers",
                        found: sizes.len(),
                        span: decl.span,
                    });
                }
            };
            lowering.spend(shape.len(), decl.span)?;
            Ok(shape)
        })?;
        let vars: Vec<Expr<'e>> = (0..shape.len())
            .map(|k| self.model.exprs.variable(&shape.entry_name(name, k)))
            .collect();
        let value = Tensor {
            shape,
            data: vars.clone(),
        };
        let quantity = Quantity {
            name: name.clone(),
            shape,
            vars,
            value: None,
            bounds: None,
            span: decl.span,
        };
        let (list, kind): (_, fn(usize) -> TargetKind) = match decl.kind {
            DeclKind::Param => (&mut self.model.params, TargetKind::Param),
            DeclKind::State => (&mut self.model.states, TargetKind::State),
            DeclKind::Control => (&mut self.model.controls, TargetKind::Control),
            DeclKind::Input => (&mut self.model.inputs, TargetKind::Input),
            DeclKind::Algebraic => return Err(Reported),
        };
        list.push(quantity);
        Ok(Meaning::Value(value.into(), kind(list.len() - 1)))
    }

    fn unit(&mut self, unit: &syntax::Unit) {
        // Once per model is enough.
        if !self.diags.codes().iter().any(|code| code == "W0901") {
            self.diags.push(Unsupported::Units { span: unit.span });
        }
    }

    fn named(&mut self, named: &syntax::Named) -> Result<Meaning<'e>, Reported> {
        if let Some(unit) = &named.unit {
            self.unit(unit);
        }
        let value = self.lowering(|lowering| match named.kind {
            NamedKind::Let => lowering.expr(&named.value),
            _ => lowering.numbers(&named.value).map(Value::from),
        })?;
        let name = named.name.name.clone();
        if named.kind == NamedKind::Signal
            && let Some(cause) = self.depends(&value.tensor.data, true)
        {
            self.diags.push(ModelError::SignalDepends {
                name,
                cause,
                span: named.value.span,
            });
            return Err(Reported);
        }
        let (list, kind): (_, fn(usize) -> TargetKind) = match named.kind {
            NamedKind::Let => (&mut self.model.lets, TargetKind::Let),
            NamedKind::Output => (&mut self.model.outputs, TargetKind::Output),
            NamedKind::Signal => (&mut self.model.signals, TargetKind::Signal),
        };
        list.push(Named {
            name,
            value: value.tensor.clone(),
            span: named.span,
        });
        Ok(Meaning::Value(value, kind(list.len() - 1)))
    }

    fn switch(
        &mut self,
        switch: &syntax::Switch,
        frames: &[Frame<'_>],
    ) -> Result<Meaning<'e>, Reported> {
        let Some((kind, arg)) = switch_argument(&switch.value) else {
            self.diags.push(DynamicsError::SwitchForm {
                span: switch.value.span,
            });
            return Err(Reported);
        };
        let mut psis: Vec<(Vec<i64>, Tensor<'e>)> = vec![];
        self.lowering(|lowering| {
            in_frames(lowering, frames, &mut |lowering| {
                let psi = lowering.numbers(arg)?;
                if let Some(value) = psi.data.iter().find_map(|entry| entry.as_constant()) {
                    let value = value > 0.0;
                    return lowering.error(DynamicsError::ConstantComparison {
                        value,
                        span: arg.span,
                    });
                }
                psis.push((lowering.indices(frames), psi));
                Ok(())
            })
        })?;
        let mut members = BTreeMap::new();
        for (indices, psi) in psis {
            let suffix = indices
                .iter()
                .map(i64::to_string)
                .collect::<Vec<_>>()
                .join(",");
            let name = match indices.is_empty() {
                true => switch.name.name.clone(),
                false => format!("{}[{suffix}]", switch.name.name),
            };
            let shape = psi.shape;
            let vars: Vec<Expr<'e>> = (0..shape.len())
                .map(|k| self.model.exprs.variable(&shape.entry_name(&name, k)))
                .collect();
            let value = Value::from(Tensor {
                shape,
                data: vars.clone(),
            });
            members.insert(
                indices,
                (value, TargetKind::Switch(self.model.switches.len())),
            );
            let (psi, sliding, span) = (psi.data, switch.sliding, switch.span);
            self.model.switches.push(NamedSwitch {
                name,
                kind,
                shape,
                psi,
                vars,
                sliding,
                span,
            });
        }
        if !frames.is_empty() {
            let binders = frames.iter().flat_map(|frame| frame.binders);
            let binders = binders.map(|binder| binder.name.name.clone()).collect();
            return Ok(Meaning::Family { binders, members });
        }
        let only = members.into_values().next();
        only.map(|(value, kind)| Meaning::Value(value, kind))
            .ok_or(Reported)
    }

    /// Defaults, initial values and bounds, when every name has its meaning.
    pub fn defaults(&mut self, declared: &[Declared<'_>]) {
        for declared in declared {
            let Item::Decl(decl) = declared.item else {
                continue;
            };
            let Some(Meaning::Value(value, kind)) = self.model.scope.names.get(&decl.name.name)
            else {
                continue;
            };
            let (shape, kind) = (value.tensor.shape, *kind);
            let given = self.default(decl, shape);
            let bounds = self.bounds(decl, shape);
            let quantity = match kind {
                TargetKind::Param(index) => &mut self.model.params[index],
                TargetKind::State(index) => &mut self.model.states[index],
                TargetKind::Control(index) => &mut self.model.controls[index],
                TargetKind::Input(index) => &mut self.model.inputs[index],
                _ => continue,
            };
            (quantity.value, quantity.bounds) = (given, bounds);
        }
        self.order_params();
    }

    fn default(&mut self, decl: &syntax::Decl, shape: Shape) -> Option<Tensor<'e>> {
        let value = decl.value.as_ref()?;
        let word = match decl.kind {
            DeclKind::State => "the initial value of",
            _ => "the default of",
        };
        let what = format!("{word} `{}`", decl.name.name);
        // An input may follow a signal; a control is given the same freedom.
        let of_time = matches!(decl.kind, DeclKind::Control | DeclKind::Input);
        self.over_params(
            value,
            shape,
            &format!("`{}`", decl.name.name),
            &what,
            of_time,
        )
    }

    fn bounds(&mut self, decl: &syntax::Decl, shape: Shape) -> Option<(Tensor<'e>, Tensor<'e>)> {
        let Some(Domain::Box(lo, hi)) = &decl.domain else {
            return None;
        };
        let what = format!("a bound of `{}`", decl.name.name);
        let lower = self.over_params(lo, shape, &what, &what, false)?;
        let upper = self.over_params(hi, shape, &what, &what, false)?;
        let crossed = |(a, b): (&Expr<'e>, &Expr<'e>)| matches!((a.as_constant(), b.as_constant()), (Some(a), Some(b)) if a > b);
        if lower.data.iter().zip(&upper.data).any(crossed) {
            let name = decl.name.name.clone();
            self.diags.push(ModelError::EmptyBounds {
                name,
                span: lo.span.to(hi.span),
            });
            return None;
        }
        Some((lower, upper))
    }

    fn over_params(
        &mut self,
        value: &syntax::Expr,
        shape: Shape,
        whose: &str,
        what: &str,
        of_time: bool,
    ) -> Option<Tensor<'e>> {
        // Surfaces in defaults are none of the model's.
        let tensor = Lowering::new(&self.model.scope, None, self.diags)
            .numbers_as(value, shape, whose)
            .ok()?;
        match self.depends(&tensor.data, of_time) {
            None => Some(tensor),
            Some(cause) => {
                self.diags.push(ModelError::DefaultDepends {
                    what: what.to_owned(),
                    cause,
                    span: value.span,
                });
                None
            }
        }
    }

    /// What some expressions depend on besides params, and time where that is allowed.
    fn depends(&self, entries: &[Expr<'e>], of_time: bool) -> Option<String> {
        let params: rustc_hash::FxHashSet<Var> = self
            .model
            .params
            .iter()
            .flat_map(|param| &param.vars)
            .filter_map(|var| var.as_variable())
            .collect();
        let time = self.model.time.as_variable();
        let other = variables_of(entries)
            .into_iter()
            .find(|var| !params.contains(var) && (!of_time || Some(*var) != time))?;
        Some(format!("`{}`", self.model.exprs.name(other)))
    }

    /// Defaults of params in an order in which they can be computed.
    fn order_params(&mut self) {
        let names: Vec<&str> = self
            .model
            .params
            .iter()
            .map(|param| param.name.as_str())
            .collect();
        let mut owner = rustc_hash::FxHashMap::default();
        for (index, param) in self.model.params.iter().enumerate() {
            owner.extend(
                param
                    .vars
                    .iter()
                    .filter_map(|var| var.as_variable())
                    .map(|var| (var, index)),
            );
        }
        let needs = self.model.params.iter().map(|param| {
            let entries = param
                .value
                .iter()
                .flat_map(|value| value.data.iter().copied())
                .collect::<Vec<_>>();
            let mut needs: Vec<usize> = variables_of(&entries)
                .into_iter()
                .filter_map(|var| owner.get(&var).copied())
                .collect();
            needs.dedup();
            needs
        });
        let needs: Vec<Vec<usize>> = needs.collect();
        let (sorted, cycles) = order::topological(&needs);
        for cycle in &cycles {
            let param = &self.model.params[cycle[0]];
            let what = format!("the default of `{}`", param.name);
            self.diags.push(ModelError::Cycle {
                what,
                chain: order::chain(cycle, &names),
                span: param.span,
            });
        }
        self.model.param_order = sorted;
    }
}

/// Runs `body` for all indices of some loops around it, their `let`s in sight.
pub(super) fn in_frames<'e>(
    lowering: &mut Lowering<'_, 'e>,
    frames: &[Frame<'_>],
    body: &mut dyn FnMut(&mut Lowering<'_, 'e>) -> Result<(), Reported>,
) -> Result<(), Reported> {
    let Some((frame, inner)) = frames.split_first() else {
        return body(lowering);
    };
    lowering.for_each(frame.binders, frame.span, &mut |lowering| {
        let base = lowering.open_frame(&frame.lets);
        let result = in_frames(lowering, inner, body);
        lowering.locals.truncate(base);
        result
    })
}

impl<'e> Lowering<'_, 'e> {
    /// Brings the `let`s of a block in sight; returns how many locals there were.
    pub fn open_frame(&mut self, lets: &[std::rc::Rc<syntax::Named>]) -> usize {
        let base = self.locals.len();
        let frame = base + lets.len();
        self.locals.extend(lets.iter().map(|statement| Local::Let {
            statement: std::rc::Rc::clone(statement),
            value: Lazy::Waiting,
            frame,
        }));
        base
    }

    /// Current values of the indices of some loops.
    fn indices(&self, frames: &[Frame<'_>]) -> Vec<i64> {
        let binders = frames.iter().flat_map(|frame| frame.binders);
        binders
            .filter_map(|binder| self.index_value(&binder.name.name))
            .collect()
    }
}
