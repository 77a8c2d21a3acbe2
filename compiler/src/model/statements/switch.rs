//! `switch` statements: named `sign`, `step` and relays with memory.

use std::collections::BTreeMap;

use super::declare::{Declaring, in_frames};
use crate::expr::Expr;
use crate::model::expressions::Lowering;
use crate::model::hir::Frame;
use crate::model::names::scope::{Meaning, Reported, Value};
use crate::model::{DynamicsError, NamedSwitch, SwitchKind, TargetKind, Tensor, Thresholds};
use crate::source::Span;
use crate::syntax::{self, Arg, ExprKind, Sliding};

/// The right side of a `switch` statement.
enum Form<'f> {
    Sign(&'f syntax::Expr),
    Step(&'f syntax::Expr),
    Relay {
        y: &'f syntax::Expr,
        on: &'f syntax::Expr,
        off: &'f syntax::Expr,
        start: Option<&'f syntax::Expr>,
    },
}

impl<'f> Form<'f> {
    fn of(value: &'f syntax::Expr) -> Result<Self, DynamicsError> {
        let other = DynamicsError::SwitchForm { span: value.span };
        let ExprKind::Call(function, args) = &value.kind else {
            return Err(other);
        };
        let ExprKind::Name(name) = &function.kind else {
            return Err(other);
        };
        match (name.as_str(), &args[..]) {
            ("sign", [Arg::Positional(psi, binders)]) if binders.is_empty() => Ok(Form::Sign(psi)),
            ("step", [Arg::Positional(psi, binders)]) if binders.is_empty() => Ok(Form::Step(psi)),
            ("hysteresis", args) => Self::relay(args, value.span),
            _ => Err(other),
        }
    }

    /// `hysteresis(y, on = a, off = b, start = 1)`
    fn relay(args: &'f [Arg], span: Span) -> Result<Self, DynamicsError> {
        let wrong = |what: &str, span| DynamicsError::RelayForm {
            what: what.to_owned(),
            span,
        };
        let [Arg::Positional(y, binders), options @ ..] = args else {
            return Err(wrong("the quantity it watches comes first", span));
        };
        if !binders.is_empty() {
            return Err(wrong("it takes no `for`", span));
        }
        let (mut on, mut off, mut start) = (None, None, None);
        for option in options {
            let (name, value) = match option {
                Arg::Named(name, value) => (name, value),
                Arg::Positional(value, _) => {
                    return Err(wrong("this value has no name", value.span));
                }
            };
            let place = match name.name.as_str() {
                "on" => &mut on,
                "off" => &mut off,
                "start" => &mut start,
                other => return Err(wrong(&format!("it has no option `{other}`"), name.span)),
            };
            if place.replace(value).is_some() {
                return Err(wrong("this option is given twice", name.span));
            }
        }
        match (on, off) {
            (Some(on), Some(off)) => Ok(Form::Relay { y, on, off, start }),
            (None, _) => Err(wrong("`on` is missing", span)),
            (_, None) => Err(wrong("`off` is missing", span)),
        }
    }

    /// What is compared: ψ, or y of a relay.
    fn argument(&self) -> &'f syntax::Expr {
        match self {
            Form::Sign(psi) | Form::Step(psi) => psi,
            Form::Relay { y, .. } => y,
        }
    }

    fn kind<'e>(
        &self,
        lowering: &mut Lowering<'_, 'e>,
        y: &Tensor<'e>,
    ) -> Result<SwitchKind<'e>, Reported> {
        let Form::Relay { on, off, start, .. } = self else {
            return Ok(match self {
                Form::Sign(_) => SwitchKind::Sign,
                _ => SwitchKind::Step,
            });
        };
        let mut entries = |value: &syntax::Expr, option: &str| {
            let what = format!("`{option}`");
            Ok(lowering.numbers_as(value, y.shape, &what)?.data)
        };
        Ok(SwitchKind::Relay(Thresholds {
            on: entries(on, "on")?,
            off: entries(off, "off")?,
            start: match start {
                Some(start) => Some(entries(start, "start")?),
                None => None,
            },
        }))
    }
}

impl<'f, 'e> Declaring<'_, 'f, 'e> {
    /// Declares a `switch`, in every round of the loops around it.
    pub fn switch(
        &mut self,
        switch: &syntax::Switch,
        frames: &[Frame<'_>],
    ) -> Result<Meaning<'e>, Reported> {
        let form = match Form::of(&switch.value) {
            Ok(form) => form,
            Err(error) => {
                self.diags.push(error);
                return Err(Reported);
            }
        };
        let is_relay = matches!(form, Form::Relay { .. });
        if is_relay && switch.sliding.is_some() {
            return self.sliding_relay(switch);
        }
        let arg = form.argument();
        let mut found: Vec<(Vec<i64>, Tensor<'e>, SwitchKind<'e>)> = vec![];
        self.lowering(|lowering| {
            in_frames(lowering, frames, &mut |lowering| {
                let psi = lowering.numbers(arg)?.map(Expr::cancelled);
                if let Some(value) = psi.data.iter().find_map(|entry| entry.as_constant()) {
                    let span = arg.span;
                    return lowering.error(match is_relay {
                        true => DynamicsError::RelayForm {
                            what: format!("it watches a constant, {value}"),
                            span,
                        },
                        false => DynamicsError::ConstantComparison {
                            value: value > 0.0,
                            span,
                        },
                    });
                }
                let kind = form.kind(lowering, &psi)?;
                let binders = frames.iter().flat_map(|frame| frame.binders);
                found.push((lowering.names.indices(binders), psi, kind));
                Ok(())
            })
        })?;
        for (.., kind) in &found {
            self.thresholds_over_params(kind, switch.value.span)?;
        }
        let mut members = BTreeMap::new();
        for (indices, psi, kind) in found {
            let meaning = self.named_switch(switch, &indices, psi, kind);
            members.insert(indices, meaning);
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

    /// A relay never slides.
    fn sliding_relay(&mut self, switch: &syntax::Switch) -> Result<Meaning<'e>, Reported> {
        let word = switch.sliding.unwrap_or(Sliding::Linear).word();
        self.diags.push(DynamicsError::RelayForm {
            what: format!("it never slides, so `sliding {word}` has no meaning"),
            span: switch.span,
        });
        Err(Reported)
    }

    /// Adds a switch, of these indices in the loops around it, to the model.
    fn named_switch(
        &mut self,
        switch: &syntax::Switch,
        indices: &[i64],
        psi: Tensor<'e>,
        kind: SwitchKind<'e>,
    ) -> (Value<'e>, TargetKind) {
        let suffix: Vec<String> = indices.iter().map(i64::to_string).collect();
        let name = match indices.is_empty() {
            true => self.whole_name(&switch.name.name),
            false => self.whole_name(&format!("{}[{}]", switch.name.name, suffix.join(","))),
        };
        let shape = psi.shape;
        let value = self.draft.variables(&name, shape);
        let switches = &mut self.draft.model.switches;
        let target = TargetKind::Switch(switches.len());
        switches.push(NamedSwitch {
            name,
            kind,
            shape,
            psi: psi.data,
            vars: value.data.clone(),
            sliding: switch.sliding,
            span: switch.span,
        });
        (value.into(), target)
    }

    /// The thresholds of a relay do not move.
    fn thresholds_over_params(
        &mut self,
        kind: &SwitchKind<'e>,
        span: Span,
    ) -> Result<(), Reported> {
        let SwitchKind::Relay(thresholds) = kind else {
            return Ok(());
        };
        let start = thresholds.start.as_ref();
        let options = [("on", Some(&thresholds.on)), ("off", Some(&thresholds.off))];
        for (option, entries) in options.into_iter().chain([("start", start)]) {
            if let Some(cause) = entries.and_then(|entries| self.draft.depends(entries, false)) {
                let what = format!("`{option}` depends on {cause}, which is no param");
                self.diags.push(DynamicsError::RelayForm { what, span });
                return Err(Reported);
            }
        }
        Ok(())
    }
}
