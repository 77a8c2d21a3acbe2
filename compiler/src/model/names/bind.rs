//! Defaults of declarations, and what the braces of parts give in their place.
//!
//! `part b = disc { m = 2; q = [0, 1]; u = k*y; }`: names on the left are those of the part, expressions
//! on the right those of the model around it. Params and states get another default, inputs and controls
//! are connected ([`super::connect`]). What stands further outside counts: the braces of the whole before
//! those of a part in it.

use std::rc::Rc;

use rustc_hash::{FxHashMap, FxHashSet};

use super::draft::Draft;
use super::parts::{Inner, Instance};
use super::scope::{Meaning, Reported, Scope};
use super::target;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var};
use crate::model::expressions::Lowering;
use crate::model::hir::Definition;
use crate::model::hir::reserved::one_of;
use crate::model::{GivenError, ModelError, Shape, Target, TargetKind, Tensor};
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

/// Defaults, initial values and bounds, when every name has its meaning.
pub(crate) fn defaults<'e>(
    draft: &mut Draft<'e>,
    whole: &Instance<'_, 'e>,
    diags: &mut Diagnostics,
) -> Bound<'e> {
    let mut binding = Binding {
        draft,
        scope: Rc::clone(&whole.scope),
        bound: Bound::default(),
        diags,
    };
    binding.own_defaults(whole, None);
    let bound = binding.bound;
    draft.order_params(diags);
    bound
}

/// A model while what it declares gets its values.
struct Binding<'d, 'e> {
    draft: &'d mut Draft<'e>,
    /// The instance whose lines are read.
    scope: Rc<Scope<'e>>,
    bound: Bound<'e>,
    diags: &'d mut Diagnostics,
}

impl<'e> Binding<'_, 'e> {
    /// The defaults of an instance, then of the parts in it.
    fn own_defaults(&mut self, instance: &Instance<'_, 'e>, part: Option<&syntax::Part>) {
        let outer = std::mem::replace(&mut self.scope, Rc::clone(&instance.scope));
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
                Some(part) => self.given_or(default, decl, kind, part),
                None => default,
            };
            if let Some(quantity) = self.draft.quantity_of(kind) {
                (quantity.value, quantity.domain) = (value, domain);
            }
        }
        for inner in &instance.parts {
            self.braces(inner);
            self.own_defaults(&inner.instance, Some(inner.part));
        }
        self.scope = outer;
    }

    /// The value of a quantity of a part: what braces give, entry by entry, else its default.
    fn given_or(
        &mut self,
        default: Option<Tensor<'e>>,
        decl: &syntax::Decl,
        kind: TargetKind,
        part: &syntax::Part,
    ) -> Option<Tensor<'e>> {
        let (shape, vars) = match self.draft.quantity_of(kind) {
            Some(quantity) => (quantity.shape, quantity.vars.clone()),
            None => return default,
        };
        let vars: Vec<Var> = vars.iter().filter_map(|var| var.as_variable()).collect();
        let some_given = vars.iter().any(|var| self.bound.values.contains_key(var));
        let entries = vars.iter().enumerate().map(|(k, var)| {
            let own = || Some((*default.as_ref()?.data.get(k)?, decl.span));
            self.bound.values.get(var).copied().or_else(own)
        });
        let entries: Vec<Option<(Expr<'e>, Span)>> = entries.collect();
        let is_connected = matches!(kind, TargetKind::Input(_) | TargetKind::Control(_));
        let missing = entries.iter().position(Option::is_none);
        if let Some(missing) = missing {
            // A state may be left to the experiment, as a whole.
            let is_wrong = some_given || matches!(kind, TargetKind::Input(_));
            let is_wrong = is_wrong && !self.bound.wrong.contains(&part.span);
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
            self.bound.connections.extend(connections);
        }
        let data = entries.into_iter().map(|(value, _)| value).collect();
        Some(Tensor { shape, data })
    }

    /// What the braces of a part give to it.
    fn braces(&mut self, inner: &Inner<'_, 'e>) {
        let mut here = Here::default();
        for bind in &inner.part.binds {
            // Every line is looked at.
            if self.brace(inner, bind, &mut here).is_err() {
                self.bound.wrong.insert(inner.part.span);
            }
        }
    }

    fn brace(
        &mut self,
        inner: &Inner<'_, 'e>,
        bind: &Bind,
        here: &mut Here,
    ) -> Result<(), Reported> {
        let target = self.brace_target(inner, bind)?;
        let lowering = Lowering::new(&self.scope, None, self.diags);
        let what = format!("`{}`", lowering.names.written().path(&bind.target));
        if target.kind == TargetKind::Const {
            if let Some(error) = GivenError::constant_entry(&bind.target) {
                self.diags.push(error);
                return Err(Reported);
            }
            // Its value has been used already.
            return here.once(&what, None, bind, self.diags);
        }
        if let TargetKind::Sliding(switch) = target.kind {
            let reading = sliding(&bind.value, self.diags)?;
            here.once(&what, None, bind, self.diags)?;
            if self.bound.sliding.insert(switch) {
                self.draft.model.switches[switch].sliding = Some(reading);
            }
            return Ok(());
        }
        let Some(quantity) = self.draft.quantity_of(target.kind) else {
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
        let value = self.draft.lowering(&self.scope, self.diags, |lowering| {
            if let Some((binder, index)) = binder {
                lowering.names.push_index(&binder.name.name, index);
            }
            lowering.numbers_as(&bind.value, target.shape, &what)
        })?;
        if matches!(
            target.kind,
            TargetKind::Param(_) | TargetKind::State(_) | TargetKind::Algebraic(_)
        ) && let Some(cause) = self.draft.depends(&value.data, false)
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
            self.bound.values.entry(var).or_insert((value, bind.span));
        }
        Ok(())
    }

    /// What the left side of a line in braces means, in the part.
    fn brace_target(&mut self, inner: &Inner<'_, 'e>, bind: &Bind) -> Result<Target, Reported> {
        let scope = &inner.instance.scope;
        let head = &bind.target.head;
        if !scope.names.contains_key(&head.name) {
            if !scope.forgiving {
                let model = inner.instance.names.item.name.name.clone();
                let place = format!("`{model}` takes");
                let help = one_of(&head.name, &place, scope.given_names());
                self.diags.push(ModelError::NotInModel {
                    model,
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
            DeclKind::State | DeclKind::Discrete => "the initial value of",
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
        if matches!(decl.kind, DeclKind::State | DeclKind::Discrete) {
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
        let tensor = Lowering::new(&self.scope, None, self.diags)
            .numbers_as(value, shape, whose)
            .ok()?;
        match self.draft.depends(&tensor.data, of_time) {
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
    let reading = match &value.kind {
        ExprKind::Name(name) => Sliding::named(name),
        _ => None,
    };
    reading.ok_or_else(|| {
        diags.push(ModelError::UnknownReading { span: value.span });
        Reported
    })
}
