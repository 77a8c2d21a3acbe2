//! Expressions of the model -> expressions in time, parameters, states and α.

use rustc_hash::FxHashMap;

use super::instance::Instance;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Substitution, Var};
use crate::model::{NamedSwitch, SwitchKind};
use crate::source::Span;
use crate::system::SystemError;
use crate::system::regions::coverage::Frame;
use crate::system::regions::sample::Sampler;
use crate::system::switches::Switches;
use crate::system::switches::reading::check_reading;
use crate::system::values::rounding::Roundings;

/// What the names and nonsmooth terms of a model are replaced by.
pub(crate) struct Translation<'m, 'e> {
    pub instance: &'m Instance<'m, 'e>,
    /// Controls and inputs, and algebraic states that an equation gives, as functions of the others.
    pub given: Substitution<'e>,
    /// Algebraic states that are computed with the others.
    implicit: Vec<Expr<'e>>,
    /// Values of named switches.
    pub named: Substitution<'e>,
    /// What these say of numbers.
    direct: Substitution<'e>,
    /// Roundings of functions of time.
    pub roundings: Roundings<'e>,
    pub switches: Switches<'e>,
}

/// Named switches as functions of ψ, but for relays, which remember.
fn direct<'e>(switches: &[NamedSwitch<'e>]) -> Substitution<'e> {
    let mut direct = Substitution::new();
    for switch in switches {
        for (var, psi) in switch.vars.iter().zip(&switch.psi) {
            let psi = psi.substitute(&direct);
            let value = match switch.kind {
                SwitchKind::Sign => psi.sign(),
                SwitchKind::Step => psi.step(),
                SwitchKind::Relay(_) => continue,
            };
            direct.extend(var.as_variable().map(|var| (var, value)));
        }
    }
    direct
}

impl<'m, 'e> Translation<'m, 'e> {
    /// No switches yet.
    pub fn new(
        instance: &'m Instance<'m, 'e>,
        given: Substitution<'e>,
        implicit: Vec<Expr<'e>>,
        roundings: Roundings<'e>,
    ) -> Self {
        let model = instance.model;
        let data = roundings.data.iter().map(|data| data.var);
        let timed = data.chain([model.time]);
        Translation {
            instance,
            given,
            implicit,
            named: Substitution::new(),
            direct: direct(&model.switches),
            switches: Switches::new(model.exprs, timed, instance.params.clone()),
            roundings,
        }
    }

    /// An expression of the model in entry variables.
    pub fn replace(&mut self, e: Expr<'e>, span: Span) -> Expr<'e> {
        let e = self.round(e, span);
        self.switches.replace(e, span)
    }

    /// The same of an expression of a law.
    pub fn replace_in_law(&mut self, e: Expr<'e>, span: Span) -> Expr<'e> {
        let e = self.round(e.substitute(&self.direct), span);
        self.switches.replace_in_law(e, span)
    }

    /// An expression in nonsmooth terms of states, time and data.
    fn round(&mut self, e: Expr<'e>, span: Span) -> Expr<'e> {
        let e = e.substitute(&self.given).substitute(&self.named);
        let n_known = self.roundings.data.len();
        let e = self.roundings.replace(e, span);
        for held in &self.roundings.data[n_known..] {
            self.switches.give(held.var);
        }
        e
    }

    /// An expression of the model in α.
    pub fn in_alphas(&mut self, e: Expr<'e>, span: Span) -> Expr<'e> {
        let e = self.replace(e, span);
        self.switches.entries.merged(e)
    }

    /// What is wrong with how switches enter an expression, which is in entry variables.
    pub fn misread(&self, e: Expr<'e>, span: Span) -> Vec<SystemError> {
        let sampler = || self.sampler();
        check_reading(&self.switches, e, span, sampler, self.instance.model)
    }

    /// Reports all of that.
    pub fn check(&self, e: Expr<'e>, span: Span, diags: &mut Diagnostics) {
        for error in self.misread(e, span) {
            diags.push(error);
        }
    }

    /// Samples around the initial point with all switches.
    pub fn sampler(&self) -> Sampler<'e> {
        let switches = self.switches.list.iter();
        let switches = switches.map(|switch| (switch.alpha, switch.psi));
        self.sampler_of(switches.collect())
    }

    /// Samples around the initial point with these switches.
    pub fn sampler_of(&self, mut switches: Vec<(Var, Expr<'e>)>) -> Sampler<'e> {
        let instance = self.instance;
        let relays: FxHashMap<Var, f64> = (self.switches.list.iter())
            .filter_map(|switch| Some((switch.alpha, f64::from(switch.relay?.start))))
            .collect();
        switches.retain(|(alpha, _)| !relays.contains_key(alpha));
        let decided = instance.decided();
        let decided = decided.iter();
        let decided = decided.filter_map(|u| Some((u.var.as_variable()?, u.guess())));
        let numbers = instance.values().numbers.iter().chain(&relays);
        let fixed = numbers.map(|(&var, &value)| (var, value));
        let states = instance.states().chain(self.implicit.iter().copied());
        let states = states.filter_map(Expr::as_variable);
        let states = states.chain(decided.clone().map(|(var, _)| var)).collect();
        let ranges = instance.params.ranges.iter();
        let mut sides: Vec<Var> = relays.keys().copied().collect();
        sides.sort_unstable();
        let data = self.roundings.data.iter();
        let data = data.filter_map(|data| Some((data.var.as_variable()?, data.table.clone())));
        let (time, horizon) = (instance.time(), instance.settings.horizon);
        Sampler::new(fixed.chain(decided), states, time, horizon, switches)
            .with_relays(sides)
            .with_free(ranges.map(|(&var, &range)| (var, range)).collect())
            .with_data(data.collect())
    }

    /// What is the same for all points: parameters that are not free, and where and when the run begins and ends.
    pub fn frame(&self, switches: Vec<(Var, Expr<'e>)>) -> Frame<'e> {
        let instance = self.instance;
        let (model, values) = (instance.model, instance.values());
        let number = |var: Var| Some((var, *values.numbers.get(&var)?));
        let params = model.quantities.of_params();
        let params = params.filter_map(|param| param.as_variable());
        let fixed = |var: Var| Some((var, model.exprs.constant(values.fixed(var)?)));
        let ranges = &instance.params.ranges;
        let states = instance.vars.iter().filter_map(|x| x.as_variable());
        let data = self.roundings.data.iter();
        let data = data.filter_map(|data| Some((data.var.as_variable()?, data.table.value(0.0))));
        let time = instance.time();
        Frame {
            switches,
            params: params.filter_map(fixed).collect(),
            origin: (states.filter_map(number))
                .chain([(time, 0.0)])
                .chain(data)
                .chain(ranges.keys().copied().filter_map(number))
                .collect(),
            free: ranges.iter().map(|(&var, &range)| (var, range)).collect(),
            time: (time, instance.settings.horizon),
        }
    }
}
