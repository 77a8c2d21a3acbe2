//! Model with its nonsmooth terms -> system with explicit switches.
//!
//! x' = f(t, x, p; sign(ψ), max(..), ..) + Σ_R 1_R f_R   becomes   x' = f(t, x, p, α), α_i ∈ step(ψ_i)
//!
//! What the experiment does not need is left out first ([`super::needs`]).
//!
//! 1. Parameters get numbers; controls and inputs become functions of time and state.
//! 2. Nonsmooth terms become switch variables ([`super::switches`]).
//! 3. Every expression of the user must be affine in each of its switches, or a reading is asked for.
//! 4. f = Σ w_R(α) f_R is reduced to multi-affine form (α^k -> α); inside a region whose guard is a
//!    conjunction, its switches have the values that the guard implies.
//! 5. Continuous switches are recognised, interacting ones grouped, unused ones dropped.

use rustc_hash::{FxHashMap, FxHashSet};

use super::assemble::{Motion, Recorded};
use super::experiment::Settings;
use super::needs::Needs;
use super::switches::{Entry, Switches};
use super::values::Values;
use super::{NamedReading, Output, System, SystemError};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Interval, Substitution, Var, variables_of};
use crate::model::{Data, Model, Rate, Sliding, Surface, SwitchKind, TargetKind};
use crate::source::Span;
use crate::system::regions::partitions::Regions;
use crate::system::regions::sample::Sampler;
use crate::system::switches::reading::check_reading;
use crate::system::switches::surface::{Form, Known};
use crate::system::values::rounding::Held;

/// How much of a model is lowered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// What the outputs and expectations of the experiment need.
    Needed,
    /// Everything, so that every mistake is found.
    Whole,
}

/// The system of a model under the settings of an experiment; `None` after an error.
pub fn lower<'e>(
    model: &Model<'e>,
    settings: &Settings<'e>,
    extent: Extent,
    diags: &mut Diagnostics,
) -> Option<System<'e>> {
    let errors_before = diags.errors().count();
    let needs = Needs::of(model, settings, extent);
    let mut lowering = Lowering::new(model, settings, needs);
    lowering.hold_roundings(diags);
    if diags.errors().count() > errors_before {
        return None;
    }
    let sampled = lowering.check_programs(diags);
    let implicit = lowering.solve_algebraics(diags);
    if diags.errors().count() > errors_before {
        return None;
    }
    lowering.guesses = lowering.guess_programs();
    let relays = lowering.declare_relays();
    let (direct, through) = lowering.surfaces();
    lowering.declare_surfaces(&direct, diags);
    lowering.finish_relays(&relays, diags);
    lowering.read_named_switches();
    lowering.declare_surfaces(&through, diags);
    lowering.check_counts(diags);
    lowering.check_entangled(diags);
    if diags.errors().count() > errors_before {
        return None;
    }

    let regions = lowering.regions();
    let mut rates = lowering.rates(&regions, diags);
    rates.extend(lowering.integrals(diags));
    let mut laws = lowering.laws();
    lowering.check_entangled(diags);
    if diags.errors().count() > errors_before {
        return None;
    }
    lowering.check_effort(&rates, diags);
    let (outputs, controls) = lowering.recorded();
    let named = lowering.named_surfaces();
    let limits = lowering.limits();
    let mut task = lowering.task(diags);
    lowering.find_contacts(&mut laws, &mut rates, &regions, (&outputs, &limits), diags);
    let (contacts, impulsive) = match settings.steps_through_contacts() {
        true => (Vec::new(), lowering.impulsive(&rates, diags)),
        false => (lowering.contacts(&mut rates, diags), Vec::new()),
    };
    if let Some(task) = &mut task {
        task.rows.extend(lowering.coefficient_rows(&contacts));
    }
    lowering.projections(&mut rates, diags);
    let algebraics = lowering.keep_algebraics(&implicit, &mut rates, diags);
    let bodies = lowering.bodies();
    lowering.report_refused(diags);
    lowering.report_held(diags);
    if diags.errors().count() > errors_before {
        return None;
    }
    let recorded = Recorded {
        outputs,
        controls,
        limits,
    };
    let motion = Motion {
        rates,
        algebraics,
        laws,
        bodies,
        contacts,
    };
    let mut system = lowering.assemble(motion, recorded, task, &named, regions, diags);
    (system.impulsive, system.sampled) = (impulsive, sampled);
    system.check_start(diags);
    if diags.errors().count() > errors_before {
        return None;
    }
    debug_assert_eq!(system.verify(), Ok(()));
    Some(system)
}

pub(super) struct Lowering<'m, 'e> {
    pub model: &'m Model<'e>,
    pub settings: &'m Settings<'e>,
    pub values: &'m Values<'e>,
    /// Controls and inputs, and algebraic states that an equation gives, as functions of the others.
    pub given: Substitution<'e>,
    /// Algebraic states that are computed with the others.
    pub implicit: Vec<Expr<'e>>,
    /// Better guesses of these than those of the experiment.
    pub guesses: FxHashMap<Var, f64>,
    pub needs: Needs<'e>,
    pub switches: Switches<'e>,
    /// Values of named switches.
    pub named: Substitution<'e>,
    /// ψ to the user's text and span.
    pub texts: FxHashMap<Expr<'e>, (String, Span)>,
    /// What is rounded.
    pub held: Held<'e>,
}

impl<'m, 'e> Lowering<'m, 'e> {
    fn new(model: &'m Model<'e>, settings: &'m Settings<'e>, needs: Needs<'e>) -> Self {
        let values = &settings.values;
        let params = model
            .params
            .iter()
            .flat_map(|param| &param.vars)
            .filter_map(|var| var.as_variable());
        let freed = settings.optimize.iter().flat_map(|task| &task.params);
        let freed = freed.map(|freed| (freed.var, Interval::new(freed.lower, freed.upper)));
        let params = Known {
            numbers: params.map(|var| (var, values.numbers[&var])).collect(),
            ranges: match settings.optimize.is_some() {
                true => freed.collect(),
                false => values.open_ranges(model),
            },
        };
        let data = model.data.iter().map(|data| data.var);
        let switches = Switches::new(model.exprs, data.chain([model.time]), params);
        Lowering {
            model,
            settings,
            values,
            given: values.signals.clone(),
            implicit: Vec::new(),
            guesses: FxHashMap::default(),
            needs,
            switches,
            named: Substitution::new(),
            texts: FxHashMap::default(),
            held: Held::default(),
        }
    }

    /// An expression of the model in entry variables.
    pub fn replace(&mut self, e: Expr<'e>, span: Span) -> Expr<'e> {
        let e = e.substitute(&self.given).substitute(&self.named);
        let e = self.held(e, span);
        self.switches.replace(e, span)
    }

    /// The surfaces of the source: those that can be written at once, and those whose switching function
    /// holds a named switch, which comes first.
    fn surfaces(&self) -> (Vec<&'m Surface<'e>>, Vec<&'m Surface<'e>>) {
        let named: FxHashSet<Var> = (self.model.switches.iter())
            .filter(|switch| !matches!(switch.kind, SwitchKind::Relay(_)))
            .flat_map(|switch| &switch.vars)
            .filter_map(|var| var.as_variable())
            .collect();
        let is_direct = |surface: &&Surface<'e>| {
            let psi = surface.psi.substitute(&self.given);
            variables_of(&[psi]).iter().all(|var| !named.contains(var))
        };
        let surfaces = self.model.surfaces.iter();
        let kept = surfaces.filter(|surface| self.needs.holds_all(surface.psi));
        kept.partition(is_direct)
    }

    /// Makes the switches in the order, orientation and words of the source.
    fn declare_surfaces(&mut self, surfaces: &[&Surface<'e>], diags: &mut Diagnostics) {
        for surface in surfaces {
            let psi = self.replace(surface.psi, surface.span);
            let psi = self.switches.merged(psi);
            if psi.cancels() {
                let (name, span) = (surface.name.clone(), surface.span);
                diags.push(SystemError::ZeroSwitch { name, span });
                continue;
            }
            self.texts
                .entry(psi)
                .or_insert((surface.name.clone(), surface.span));
            self.switches.declare(psi, &surface.name, surface.span);
        }
    }

    /// Gives every named switch its value.
    fn read_named_switches(&mut self) {
        for (s, switch) in self.model.switches.iter().enumerate() {
            let entry = match self.sliding(s) {
                Some(Sliding::Linear) => Entry::Linear,
                Some(Sliding::Nonlinear) => Entry::Nonlinear,
                None => Entry::Term,
            };
            if matches!(switch.kind, SwitchKind::Relay(_)) {
                continue;
            }
            for (k, (&psi, var)) in switch.psi.iter().zip(&switch.vars).enumerate() {
                if !self.needs.holds(var.as_variable()) {
                    continue;
                }
                let psi = self.replace(psi, switch.span);
                let above = self.switches.enter(psi, psi, entry);
                let value = match switch.kind {
                    SwitchKind::Sign => 2.0 * above - 1.0,
                    _ => above,
                };
                if let Some(var) = var.as_variable() {
                    self.named.insert(var, value);
                }
                let index = (switch.psi.len() > 1).then_some(k);
                let name = switch.shape.entry_name(&switch.name, k);
                self.switches
                    .name(psi, &name, switch.span, |flipped| NamedReading {
                        name: switch.name.clone(),
                        index,
                        flipped,
                        is_sign: matches!(switch.kind, SwitchKind::Sign),
                    });
            }
        }
    }

    /// α of the switches that expectations name.
    fn named_surfaces(&mut self) -> Vec<Expr<'e>> {
        let surfaces = self.needs.surfaces.clone();
        let alpha = |surface: Expr<'e>| {
            let psi = self.replace(surface, Span::default());
            if surface
                .as_variable()
                .is_some_and(|var| self.named.get(var).is_some())
            {
                return Some(self.switches.merged(psi));
            }
            let (k, _) = self.switches.find(psi)?;
            Some(self.model.exprs.expr(self.switches.list[k].alpha))
        };
        surfaces.into_iter().filter_map(alpha).collect()
    }

    pub(super) fn sliding(&self, switch: usize) -> Option<Sliding> {
        let declared = self.model.switches[switch].sliding;
        self.settings.sliding.get(&switch).copied().or(declared)
    }

    /// x' of the states that are kept, in α.
    fn rates(&mut self, regions: &Regions<'e>, diags: &mut Diagnostics) -> Vec<Expr<'e>> {
        let model = self.model;
        let zero = model.exprs.constant(0.0);
        let mut rates = vec![Vec::new(); self.needs.entries.len()];
        let mut add = |rate: &Rate<'e>, value: Expr<'e>| {
            if let Some(terms) = rates.get_mut(rate.entry) {
                terms.push(value);
            }
        };
        for rate in &model.statements.dynamics {
            if !self.needs.entries[rate.entry] {
                continue;
            }
            let value = self.replace(rate.value, rate.span);
            self.check(value, rate.span, diags);
            add(rate, value);
        }
        for (r, region) in model.statements.regions.iter().enumerate() {
            if !self.needs.regions[r] {
                continue;
            }
            let weight = regions.weights[r];
            let implied = self.implied(regions.guards[r]);
            for rate in &region.rates {
                if !self.needs.entries[rate.entry] {
                    continue;
                }
                let value = self.replace(rate.value, rate.span).substitute(&implied);
                self.check(value, rate.span, diags);
                let value = self.switches.merged(value);
                self.check_product(weight, value, rate.span, diags);
                add(rate, weight * value);
            }
        }
        for hidden in &model.statements.hidden {
            let reading = self.sliding(hidden.switch);
            let mut asks = reading.is_none();
            for rate in &hidden.rates {
                if !self.needs.entries[rate.entry] {
                    continue;
                }
                if std::mem::take(&mut asks) {
                    diags.push(self.open_reading(hidden.switch, rate));
                }
                // What is read linearly has no terms that both sides do not have.
                if reading == Some(Sliding::Nonlinear) {
                    let value = self.replace(rate.value, rate.span);
                    self.check(value, rate.span, diags);
                    add(rate, value);
                }
            }
        }
        let kept = rates.into_iter().zip(&self.needs.entries);
        kept.filter(|(_, kept)| **kept)
            .map(|(terms, _)| {
                self.switches
                    .merged(terms.into_iter().fold(zero, |sum, term| sum + term))
            })
            .collect()
    }

    /// Asks whether a hidden term is meant, where its switch does not say so.
    fn open_reading(&self, switch: usize, rate: &Rate<'e>) -> SystemError {
        let switch = &self.model.switches[switch];
        SystemError::HiddenReading {
            name: switch.name.clone(),
            statement: switch.statement(),
            term: format!("{}' += {}", self.model.entry_name(rate.entry), rate.value),
            term_span: rate.span,
            switch: switch.span,
        }
    }

    /// A region whose guard leaves a nonlinear switch open has no rates that are written for one side of it.
    fn check_product(
        &self,
        weight: Expr<'e>,
        value: Expr<'e>,
        span: Span,
        diags: &mut Diagnostics,
    ) {
        let among = |e: Expr<'e>| self.switches.alphas_of(e);
        let common = among(weight).into_iter().find(|alpha| {
            let k = self.switches.of_alpha(*alpha);
            k.is_some_and(|k| self.switches.list[k].is_nonlinear) && among(value).contains(alpha)
        });
        if let Some(k) = common.and_then(|alpha| self.switches.of_alpha(alpha)) {
            diags.push(SystemError::NonlinearGuard {
                name: self.switches.name_of(k),
                span,
            });
        }
    }

    /// What a guard says about the switches inside it, as values of their variables.
    fn implied(&self, weight: Expr<'e>) -> Substitution<'e> {
        let literals = self.literals(weight).unwrap_or_default();
        let number = |on: bool| self.model.exprs.constant(f64::from(on));
        literals
            .into_iter()
            .flat_map(|(k, on)| {
                self.switches
                    .variables_of_switch(k)
                    .map(move |var| (var, number(on)))
            })
            .collect()
    }

    pub(super) fn weight(&mut self, guard: Expr<'e>, span: Span) -> Expr<'e> {
        let guard = self.replace(guard, span);
        self.switches.merged(guard)
    }

    pub(super) fn check(&self, value: Expr<'e>, span: Span, diags: &mut Diagnostics) {
        let sampler = || self.sampler();
        for error in check_reading(&self.switches, value, span, sampler, self.model) {
            diags.push(error);
        }
    }

    pub fn sampler(&self) -> Sampler<'e> {
        let list = self
            .switches
            .list
            .iter()
            .map(|switch| (switch.alpha, switch.psi))
            .collect();
        self.sampler_of(list)
    }

    /// The states that are kept, with their entries in the model.
    pub fn kept_states(&self) -> impl Iterator<Item = (usize, Expr<'e>)> + '_ {
        let entries = self.model.state_vars().enumerate();
        entries.filter(|(entry, _)| self.needs.entries[*entry])
    }

    /// The data that is kept.
    pub fn kept_data(&self) -> impl Iterator<Item = &Data<'e>> {
        let data = self.model.data.iter();
        let data = data.filter(|data| self.needs.holds(data.var.as_variable()));
        data.chain(&self.held.data)
    }

    /// Samples around the initial point with these switches.
    pub fn sampler_of(&self, mut switches: Vec<(Var, Expr<'e>)>) -> Sampler<'e> {
        let relays: FxHashMap<Var, f64> = (self.switches.list.iter())
            .filter_map(|switch| Some((switch.alpha, f64::from(switch.relay?.start))))
            .collect();
        switches.retain(|(alpha, _)| !relays.contains_key(alpha));
        let decided = self.decided();
        let decided = || {
            decided
                .iter()
                .filter_map(|u| Some((u.var.as_variable()?, u.guess())))
        };
        let numbers = self.values.numbers.iter().chain(&relays);
        let fixed = numbers.map(|(&var, &value)| (var, value)).chain(decided());
        let states = self.kept_states().map(|(_, var)| var);
        let states = states.chain(self.implicit.iter().copied());
        let states = states.filter_map(Expr::as_variable);
        let states = states.chain(decided().map(|(var, _)| var)).collect();
        let ranges = self.switches.params.ranges.iter();
        let time = self.model.time.as_variable().expect("time is a variable");
        let mut sides: Vec<Var> = relays.keys().copied().collect();
        sides.sort_unstable();
        let data = self.kept_data();
        let data = data.filter_map(|data| Some((data.var.as_variable()?, data.table.clone())));
        Sampler::new(fixed, states, time, self.settings.horizon, switches)
            .with_relays(sides)
            .with_free(ranges.map(|(&var, &range)| (var, range)).collect())
            .with_data(data.collect())
    }

    /// Outputs and controls: those of the model, or those that the experiment lists.
    fn recorded(&mut self) -> (Vec<Output<'e>>, Vec<Output<'e>>) {
        let (model, settings) = (self.model, self.settings);
        let Some(listed) = &settings.outputs else {
            let outputs = model.outputs.iter().map(|output| {
                let shape = output.value.shape.sizes();
                self.output(&output.name, shape, &output.value.data, output.span)
            });
            let mut outputs: Vec<Output<'e>> = outputs.collect();
            outputs.extend(model.algebraics.iter().map(|z| {
                let shape = z.shape.sizes();
                self.output(&z.name, shape, &z.vars, z.span)
            }));
            let controls = model.controls.iter().map(|control| {
                let shape = control.shape.sizes();
                self.output(&control.name, shape, &control.vars, control.span)
            });
            return (outputs, controls.collect());
        };
        let (mut outputs, mut controls) = (Vec::new(), Vec::new());
        for kept in listed {
            let list = match kept.kind {
                TargetKind::State(_) => continue,
                TargetKind::Control(_) => &mut controls,
                _ => &mut outputs,
            };
            list.push(self.output(&kept.name, kept.shape.clone(), &kept.entries, kept.span));
        }
        (outputs, controls)
    }

    fn output(
        &mut self,
        name: &str,
        shape: Vec<usize>,
        entries: &[Expr<'e>],
        span: Span,
    ) -> Output<'e> {
        let exprs = entries.iter().map(|&e| {
            let e = self.replace(e, span);
            self.switches.merged(e)
        });
        Output {
            name: name.to_owned(),
            shape,
            exprs: exprs.collect(),
            span,
        }
    }

    /// Says what is wrong with switching functions that are none.
    fn report_refused(&self, diags: &mut Diagnostics) {
        for refused in &self.switches.refused {
            let text = self.texts.get(&refused.psi).cloned();
            let (name, span) = text.unwrap_or_else(|| (refused.psi.to_string(), refused.span));
            diags.push(match refused.form {
                Form::Constant(value) | Form::Parameter(value) => {
                    SystemError::ConstantSwitch { name, span, value }
                }
                Form::Definite(sign) => {
                    let side = if sign > 0.0 { "negative" } else { "positive" };
                    SystemError::NoSurface {
                        name,
                        span,
                        why: format!("is never {side}"),
                        help: None,
                    }
                }
                Form::OddPower(base) => {
                    let help = Some(format!("write `{base}`, which has the same sign"));
                    SystemError::NoSurface {
                        name,
                        span,
                        why: "crosses zero with slope zero".into(),
                        help,
                    }
                }
                Form::Free => SystemError::FreeSwitch { name, span },
                Form::ZeroAtCorner => SystemError::ZeroAtCorner { name, span },
                Form::Regular => continue,
            });
        }
    }
}
