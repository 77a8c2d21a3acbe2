//! A model while its declarations are computed.

use rustc_hash::FxHashMap;

use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, variables_of};
use crate::model::expressions::Lowering;
use crate::model::hir::order::{chain, others, topological};
use crate::model::names::scope::{Reported, Scope};
use crate::model::{
    Definitions, Model, ModelError, Named, Quantities, Quantity, Shape, Statements, TargetKind,
    Tensor,
};
use crate::source::Span;
use crate::syntax::{self, DeclKind, NamedKind};

/// The model, and which of its variables are params.
pub(crate) struct Draft<'e> {
    pub model: Model<'e>,
    /// The param that each entry declared so far belongs to.
    param_of: FxHashMap<Var, usize>,
}

impl<'e> Draft<'e> {
    pub fn new(item: &syntax::Model, scope: &Scope<'e>) -> Self {
        let model = Model {
            name: item.name.name.clone(),
            exprs: scope.exprs,
            time: scope.time,
            quantities: Quantities::default(),
            definitions: Definitions::default(),
            switches: vec![],
            statements: Statements::default(),
            partitions: vec![],
            surfaces: vec![],
            rounded: vec![],
            scope: scope.clone(),
            span: item.span,
        };
        Draft {
            model,
            param_of: FxHashMap::default(),
        }
    }

    /// Runs `lower` on a fresh lowering over a scope, and keeps the surfaces it meets.
    pub fn lowering<T>(
        &mut self,
        scope: &Scope<'e>,
        diags: &mut Diagnostics,
        lower: impl FnOnce(&mut Lowering<'_, 'e>) -> Result<T, Reported>,
    ) -> Result<T, Reported> {
        let mut lowering = Lowering::new(scope, None, diags);
        let value = lower(&mut lowering);
        self.model.surfaces.append(&mut lowering.surfaces);
        self.model.rounded.append(&mut lowering.rounded);
        value
    }

    /// Variables for the entries of something.
    pub fn variables(&self, name: &str, shape: Shape) -> Tensor<'e> {
        let variable = |k: usize| self.model.exprs.variable(&shape.entry_name(name, k));
        let data = (0..shape.len()).map(variable).collect();
        Tensor { shape, data }
    }

    /// Adds a quantity without a value.
    pub fn quantity(
        &mut self,
        kind: DeclKind,
        name: String,
        value: &Tensor<'e>,
        span: Span,
    ) -> TargetKind {
        let (list, target): (_, fn(usize) -> TargetKind) = match kind {
            DeclKind::Param => (&mut self.model.quantities.params, TargetKind::Param),
            DeclKind::State | DeclKind::Discrete => {
                (&mut self.model.quantities.states, TargetKind::State)
            }
            DeclKind::Control => (&mut self.model.quantities.controls, TargetKind::Control),
            DeclKind::Input => (&mut self.model.quantities.inputs, TargetKind::Input),
            DeclKind::Algebraic => (&mut self.model.quantities.algebraics, TargetKind::Algebraic),
        };
        let index = list.len();
        list.push(Quantity {
            name,
            unit: None,
            shape: value.shape,
            vars: value.data.clone(),
            value: None,
            domain: None,
            is_discrete: kind == DeclKind::Discrete,
            span,
        });
        if kind == DeclKind::Param {
            let vars = value.data.iter().filter_map(|var| var.as_variable());
            self.param_of.extend(vars.map(|var| (var, index)));
        }
        target(index)
    }

    /// Adds a let, output or signal.
    pub fn named(&mut self, item: &syntax::Named, name: String, value: Tensor<'e>) -> TargetKind {
        let (list, target): (_, fn(usize) -> TargetKind) = match item.kind {
            NamedKind::Let => (&mut self.model.definitions.lets, TargetKind::Let),
            NamedKind::Output => (&mut self.model.definitions.outputs, TargetKind::Output),
            NamedKind::Signal => (&mut self.model.definitions.signals, TargetKind::Signal),
        };
        list.push(Named {
            name,
            unit: item.unit.as_ref().map(ToString::to_string),
            value,
            span: item.span,
        });
        target(list.len() - 1)
    }

    /// The quantity that a target is.
    pub fn quantity_of(&mut self, kind: TargetKind) -> Option<&mut Quantity<'e>> {
        match kind {
            TargetKind::Param(index) => self.model.quantities.params.get_mut(index),
            TargetKind::State(index) => self.model.quantities.states.get_mut(index),
            TargetKind::Algebraic(index) => self.model.quantities.algebraics.get_mut(index),
            TargetKind::Control(index) => self.model.quantities.controls.get_mut(index),
            TargetKind::Input(index) => self.model.quantities.inputs.get_mut(index),
            _ => None,
        }
    }

    /// What some expressions depend on besides params, and time where that is allowed.
    pub fn depends(&self, entries: &[Expr<'e>], of_time: bool) -> Option<String> {
        let data = self.model.definitions.data.iter().map(|data| data.var);
        let given = |var: Var| {
            let mut of_time = data.clone().chain([self.model.time]);
            of_time.any(|given| given.as_variable() == Some(var))
        };
        let other = variables_of(entries)
            .into_iter()
            .find(|&var| !(self.param_of.contains_key(&var) || of_time && given(var)))?;
        Some(format!("`{}`", self.model.exprs.name(other)))
    }

    /// Defaults of params in an order in which they can be computed.
    pub fn order_params(&mut self, diags: &mut Diagnostics) {
        let names: Vec<&str> = self
            .model
            .quantities
            .params
            .iter()
            .map(|param| param.name.as_str())
            .collect();
        let needs = self.model.quantities.params.iter().map(|param| {
            let entries = param
                .value
                .iter()
                .flat_map(|value| value.data.iter().copied())
                .collect::<Vec<_>>();
            let mut needs: Vec<usize> = variables_of(&entries)
                .into_iter()
                .filter_map(|var| self.param_of.get(&var).copied())
                .collect();
            needs.dedup();
            needs
        });
        let needs: Vec<Vec<usize>> = needs.collect();
        let (sorted, cycles) = topological(&needs);
        for cycle in &cycles {
            let param = &self.model.quantities.params[cycle[0]];
            let what = format!("the default of `{}`", param.name);
            diags.push(ModelError::Cycle {
                what,
                chain: chain(cycle, &names),
                span: param.span,
                others: others(cycle, &names, |node| {
                    self.model.quantities.params[node].span
                }),
            });
        }
        self.model.quantities.param_order = sorted;
    }
}
