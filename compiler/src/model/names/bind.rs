//! Defaults of declarations, and what the braces of parts give in their place.
//!
//! `part b = disc { m = 2; q = [0, 1]; u = k*y; }`: names on the left are those of the part, expressions
//! on the right those of the model around it. Params and states get another default, inputs and controls
//! are connected ([`super::connect`]). What stands further outside counts: the braces of the whole before
//! those of a part in it.

use rustc_hash::{FxHashMap, FxHashSet};

use super::parts::{Inner, Instance};
use super::scope::{Meaning, Reported};
use super::target;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, variables_of};
use crate::model::expressions::Lowering;
use crate::model::hir::Definition;
use crate::model::hir::order;
use crate::model::hir::reserved::did_you_mean;
use crate::model::statements::declare::Declaring;
use crate::model::{GivenError, ModelError, Quantity, Shape, Target, TargetKind, Tensor};
use crate::source::Span;
use crate::syntax::{self, Bind, DeclKind, Domain, ExprKind, Sliding};

/// What braces give.
#[derive(Default)]
pub(crate) struct Bound<'e> {
    /// Inputs and controls with what they are connected to.
    pub connections: Vec<Connection<'e>>,
    values: FxHashMap<Var, (Expr<'e>, Span)>,
    sliding: FxHashSet<usize>,
    /// Parts with a line that is wrong: what they miss is unknown.
    wrong: FxHashSet<Span>,
}

/// An entry of an input or control of a part.
pub(crate) struct Connection<'e> {
    pub var: Var,
    pub value: Expr<'e>,
    /// The line that gives it.
    pub span: Span,
}

impl<'f, 'e> Declaring<'_, 'f, 'e> {
    /// Defaults, initial values and bounds, when every name has its meaning.
    pub fn defaults(&mut self, whole: &Instance<'f, 'e>) -> Bound<'e> {
        let mut bound = Bound::default();
        self.own_defaults(whole, None, &mut bound);
        self.order_params();
        bound
    }

    /// The defaults of an instance, then of the parts in it.
    fn own_defaults(
        &mut self,
        instance: &Instance<'f, 'e>,
        part: Option<&'f syntax::Part>,
        bound: &mut Bound<'e>,
    ) {
        let outer = std::mem::replace(&mut self.level.scope, (*instance.scope).clone());
        for declared in &instance.names.declared {
            let Definition::Decl(decl) = declared.item else {
                continue;
            };
            let Some(Meaning::Value(value, kind)) = instance.scope.names.get(&decl.name.name)
            else {
                continue;
            };
            let (shape, kind) = (value.tensor.shape, *kind);
            let default = self.default(decl, shape);
            let domain = self.domain(decl, shape);
            let value = match part {
                Some(part) => self.given_or(default, decl, kind, part, bound),
                None => default,
            };
            if let Some(quantity) = self.quantity_of(kind) {
                (quantity.value, quantity.domain) = (value, domain);
            }
        }
        for inner in &instance.parts {
            self.braces(inner, bound);
            self.own_defaults(&inner.instance, Some(inner.part), bound);
        }
        self.level.scope = outer;
    }

    fn quantity_of(&mut self, kind: TargetKind) -> Option<&mut Quantity<'e>> {
        match kind {
            TargetKind::Param(index) => self.model.params.get_mut(index),
            TargetKind::State(index) => self.model.states.get_mut(index),
            TargetKind::Algebraic(index) => self.model.algebraics.get_mut(index),
            TargetKind::Control(index) => self.model.controls.get_mut(index),
            TargetKind::Input(index) => self.model.inputs.get_mut(index),
            _ => None,
        }
    }

    /// The value of a quantity of a part: what braces give, entry by entry, else its default.
    fn given_or(
        &mut self,
        default: Option<Tensor<'e>>,
        decl: &syntax::Decl,
        kind: TargetKind,
        part: &syntax::Part,
        bound: &mut Bound<'e>,
    ) -> Option<Tensor<'e>> {
        let (shape, vars) = match self.quantity_of(kind) {
            Some(quantity) => (quantity.shape, quantity.vars.clone()),
            None => return default,
        };
        let vars: Vec<Var> = vars.iter().filter_map(|var| var.as_variable()).collect();
        let some_given = vars.iter().any(|var| bound.values.contains_key(var));
        let entries = vars.iter().enumerate().map(|(k, var)| {
            let own = || Some((*default.as_ref()?.data.get(k)?, decl.span));
            bound.values.get(var).copied().or_else(own)
        });
        let entries: Vec<Option<(Expr<'e>, Span)>> = entries.collect();
        let is_connected = matches!(kind, TargetKind::Input(_) | TargetKind::Control(_));
        let missing = entries.iter().position(Option::is_none);
        if let Some(missing) = missing {
            // A state may be left to the experiment, as a whole.
            let is_wrong = some_given || matches!(kind, TargetKind::Input(_));
            let is_wrong = is_wrong && !bound.wrong.contains(&part.span);
            if is_wrong && (decl.value.is_none() || default.is_some()) {
                self.diags.push(ModelError::NotGiven {
                    name: if some_given {
                        shape.entry_name(&decl.name.name, missing)
                    } else {
                        decl.name.name.clone()
                    },
                    kind: kind.word(),
                    part: part.name.name.clone(),
                    span: part.name.span,
                    declared: decl.name.span,
                });
            }
            return None;
        }
        let entries: Vec<(Expr<'e>, Span)> = entries.into_iter().flatten().collect();
        if is_connected && some_given {
            let connections = vars.iter().zip(&entries);
            let connections =
                connections.map(|(&var, &(value, span))| Connection { var, value, span });
            bound.connections.extend(connections);
        }
        let data = entries.into_iter().map(|(value, _)| value).collect();
        Some(Tensor { shape, data })
    }

    /// What the braces of a part give to it.
    fn braces(&mut self, inner: &Inner<'f, 'e>, bound: &mut Bound<'e>) {
        let mut here = Here::default();
        for bind in &inner.part.binds {
            // Every line is looked at.
            if self.brace(inner, bind, &mut here, bound).is_err() {
                bound.wrong.insert(inner.part.span);
            }
        }
    }

    fn brace(
        &mut self,
        inner: &Inner<'f, 'e>,
        bind: &Bind,
        here: &mut Here,
        bound: &mut Bound<'e>,
    ) -> Result<(), Reported> {
        let target = self.brace_target(inner, bind)?;
        let what = format!(
            "`{}`",
            self.lowering(|lowering| Ok(lowering.path_text(&bind.target)))?
        );
        if target.kind == TargetKind::Const {
            self.whole_constant(&bind.target)?;
            // Its value has been used already.
            return here.once(&what, None, bind, self.diags);
        }
        if let TargetKind::Sliding(switch) = target.kind {
            let reading = sliding(&bind.value, self.diags)?;
            here.once(&what, None, bind, self.diags)?;
            if bound.sliding.insert(switch) {
                self.model.switches[switch].sliding = Some(reading);
            }
            return Ok(());
        }
        let Some(quantity) = self.quantity_of(target.kind) else {
            self.diags.push(ModelError::CannotGive {
                name: what,
                kind: target.kind.word(),
                span: bind.target.span,
            });
            return Err(Reported);
        };
        let vars: Vec<Var> = (target.entries.iter())
            .filter_map(|&entry| quantity.vars.get(entry)?.as_variable())
            .collect();
        let binder = inner.part.binder.as_ref().zip(inner.index);
        let value = self.lowering(|lowering| {
            lowering.with_index(binder.map(|(binder, index)| (&*binder.name.name, index)));
            lowering.numbers_as(&bind.value, target.shape, &what)
        })?;
        if matches!(
            target.kind,
            TargetKind::Param(_) | TargetKind::State(_) | TargetKind::Algebraic(_)
        ) && let Some(cause) = self.depends(&value.data, false)
        {
            let word = match target.kind {
                TargetKind::State(_) => "the initial value of",
                TargetKind::Algebraic(_) => "the guess of",
                _ => "the value of",
            };
            self.diags.push(ModelError::DefaultDepends {
                what: format!("{word} {what}"),
                cause,
                span: bind.value.span,
            });
            return Err(Reported);
        }
        for (&var, value) in vars.iter().zip(value.data) {
            here.once(&what, Some(var), bind, self.diags)?;
            bound.values.entry(var).or_insert((value, bind.span));
        }
        Ok(())
    }

    /// Refuses `w[2] = 3;` for a structural constant.
    fn whole_constant(&mut self, path: &syntax::Path) -> Result<(), Reported> {
        match GivenError::constant_entry(path) {
            Some(error) => {
                self.diags.push(error);
                Err(Reported)
            }
            None => Ok(()),
        }
    }

    /// What the left side of a line in braces means, in the part.
    fn brace_target(&mut self, inner: &Inner<'f, 'e>, bind: &Bind) -> Result<Target, Reported> {
        let scope = &inner.instance.scope;
        let head = &bind.target.head;
        if scope.own(&head.name).is_none() {
            if !scope.forgiving {
                let help = did_you_mean(&head.name, scope.own_names());
                self.diags.push(ModelError::NotInModel {
                    model: inner.instance.names.item.name.name.clone(),
                    name: head.name.clone(),
                    span: head.span,
                    help,
                });
            }
            return Err(Reported);
        }
        target::resolve(&mut Lowering::new(scope, None, self.diags), &bind.target)
    }

    fn default(&mut self, decl: &syntax::Decl, shape: Shape) -> Option<Tensor<'e>> {
        let value = decl.value.as_ref()?;
        let word = match decl.kind {
            DeclKind::State => "the initial value of",
            DeclKind::Algebraic => "the guess of",
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

    fn domain(&mut self, decl: &syntax::Decl, shape: Shape) -> Option<crate::model::Domain<'e>> {
        let (lo, hi) = match decl.domain.as_ref()? {
            Domain::Box(lo, hi) => (lo, hi),
            Domain::Set(values) => return self.set(decl, values),
        };
        let what = format!("a bound of `{}`", decl.name.name);
        let lower = self.over_params(lo, shape, &what, &what, false)?;
        let upper = self.over_params(hi, shape, &what, &what, false)?;
        let crossed = |(a, b): (&Expr<'e>, &Expr<'e>)| matches!((a.as_constant(), b.as_constant()), (Some(a), Some(b)) if a > b);
        if lower.data.iter().zip(&upper.data).any(crossed) {
            let name = decl.name.name.clone();
            self.diags.push(GivenError::EmptyBounds {
                name,
                span: lo.span.to(hi.span),
            });
            return None;
        }
        Some(crate::model::Domain::Box(lower, upper))
    }

    fn set(
        &mut self,
        decl: &syntax::Decl,
        values: &[syntax::Expr],
    ) -> Option<crate::model::Domain<'e>> {
        if decl.kind == DeclKind::State {
            self.diags.push(GivenError::FiniteState {
                name: decl.name.name.clone(),
                span: decl.span,
            });
            return None;
        }
        let what = format!("a value of `{}`", decl.name.name);
        let values = values.iter().map(|value| {
            let value = self.over_params(value, Shape::Scalar, &what, &what, false)?;
            value.as_scalar()
        });
        Some(crate::model::Domain::Set(values.collect::<Option<_>>()?))
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
        let tensor = Lowering::new(&self.level.scope, None, self.diags)
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
    pub fn depends(&self, entries: &[Expr<'e>], of_time: bool) -> Option<String> {
        let data = self.model.data.iter().map(|data| data.var);
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
    fn order_params(&mut self) {
        let names: Vec<&str> = self
            .model
            .params
            .iter()
            .map(|param| param.name.as_str())
            .collect();
        let needs = self.model.params.iter().map(|param| {
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
        let (sorted, cycles) = order::topological(&needs);
        for cycle in &cycles {
            let param = &self.model.params[cycle[0]];
            let what = format!("the default of `{}`", param.name);
            self.diags.push(ModelError::Cycle {
                what,
                chain: order::chain(cycle, &names),
                span: param.span,
                others: order::others(cycle, &names, |node| self.model.params[node].span),
            });
        }
        self.model.param_order = sorted;
    }
}

/// What has been given in one pair of braces.
#[derive(Default)]
struct Here {
    entries: FxHashMap<Var, Span>,
    words: FxHashMap<String, Span>,
}

impl Here {
    /// Reports what is given twice: an entry, or what has none.
    fn once(
        &mut self,
        what: &str,
        entry: Option<Var>,
        bind: &Bind,
        diags: &mut Diagnostics,
    ) -> Result<(), Reported> {
        let first = match entry {
            Some(var) => self.entries.insert(var, bind.span),
            None => self.words.insert(what.to_owned(), bind.span),
        };
        let Some(first) = first else {
            return Ok(());
        };
        diags.push(ModelError::GivenTwice {
            what: what.to_owned(),
            first,
            second: bind.span,
        });
        Err(Reported)
    }
}

/// `linear` or `nonlinear`
fn sliding(value: &syntax::Expr, diags: &mut Diagnostics) -> Result<Sliding, Reported> {
    match &value.kind {
        ExprKind::Name(name) if name == "linear" => Ok(Sliding::Linear),
        ExprKind::Name(name) if name == "nonlinear" => Ok(Sliding::Nonlinear),
        _ => {
            diags.push(ModelError::UnknownReading { span: value.span });
            Err(Reported)
        }
    }
}
