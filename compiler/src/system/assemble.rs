//! Finishes a system: keeps what is used, classifies the switches, checks the partitions.

use rustc_hash::{FxHashMap, FxHashSet};

use super::lower::Lowering;
use super::regions::subsystems_of;
use super::{
    Body, Contact, Continuity, Output, Param, Role, State, StateGroup, Switch, System, SystemError,
    Task,
};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, variables_of};
use crate::model::{self, Data, SwitchKind, TargetKind};
use crate::source::Span;
use crate::system::contacts::jumps::Lowered;
use crate::system::needs::skipped;
use crate::system::regions::partitions::Regions;
use crate::system::switches::continuity::Entered;
use crate::system::values::limits::Limit;

/// What moves, in α of collected switches.
pub(super) struct Motion<'e> {
    /// Those of algebraic states are the last ones.
    pub rates: Vec<Expr<'e>>,
    pub algebraics: Vec<State<'e>>,
    pub laws: Vec<Lowered<'e>>,
    pub bodies: Vec<Body<'e>>,
    pub contacts: Vec<Contact<'e>>,
}

impl<'e> Motion<'e> {
    fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        (self.rates.iter().copied())
            .chain(self.laws.iter().flat_map(Lowered::reads))
            .chain(self.contacts.iter().flat_map(Contact::exprs))
            .chain(self.bodies.iter().flat_map(Body::exprs))
    }
}

/// What is recorded or watched.
pub(super) struct Recorded<'e> {
    pub outputs: Vec<Output<'e>>,
    pub controls: Vec<Output<'e>>,
    pub limits: Vec<Limit<'e>>,
}

impl<'e> Recorded<'e> {
    fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        let outputs = self.outputs.iter().chain(&self.controls);
        let outputs = outputs.flat_map(|output| output.exprs.iter().copied());
        outputs.chain(self.limits.iter().map(|limit| limit.value))
    }
}

impl<'e> Lowering<'_, 'e> {
    /// Keeps the switches that matter, and finishes their description.
    pub(super) fn assemble(
        self,
        motion: Motion<'e>,
        recorded: Recorded<'e>,
        task: Option<Task<'e>>,
        named: &[Expr<'e>],
        regions: Regions<'e>,
        diags: &mut Diagnostics,
    ) -> System<'e> {
        let model = self.model;
        let guards = regions.weights.iter().chain(&regions.guards);
        let roots: Vec<Expr<'e>> = (motion.exprs())
            .chain(recorded.exprs())
            .chain(task.iter().flat_map(Task::exprs))
            .chain(guards.chain(named).copied())
            .collect();
        let (kept, dropped) = self.used(&roots);
        let mut switches = self.kept_switches(&kept, &motion.contacts);
        let alphas: Vec<Var> = kept.iter().map(|&k| self.switches.list[k].alpha).collect();
        let on = |psi: fn(&Switch<'e>) -> Expr<'e>, switches: &[Switch<'e>]| {
            let surfaces = alphas.iter().copied().zip(switches.iter().map(psi));
            surfaces.collect::<Vec<_>>()
        };
        let sampler = self.sampler_of(on(|switch| switch.psi, &switches));
        let (collected, rates) = (&self.switches, &motion.rates);
        let entered = Entered::new(collected, (&kept, &alphas), rates, &switches, &sampler);
        let frame = self.frame(on(Switch::surface, &switches));
        entered.classify(&mut switches, &frame);
        entered.check_surfaces(&switches, diags);

        let states = self.states(rates, motion.algebraics);
        let partitions = self.partitions(
            &regions, rates, &switches, &alphas, &sampler, &states, diags,
        );
        let subsystems = subsystems_of(rates, &alphas, &partitions);
        let skipped = self.skipped(&switches, &motion.laws, dropped);
        let readings = collected.readings(&kept, self.given.clone(), self.named_readings());
        System {
            exprs: model.exprs,
            name: model.name.clone(),
            time: model.time,
            clock: None,
            data: self.data(diags),
            params: self.params(),
            states,
            groups: self.groups(),
            switches,
            laws: self.finished_laws(motion.laws, &kept),
            bodies: motion.bodies,
            contacts: self.finished_contacts(motion.contacts, &kept),
            impulsive: Vec::new(),
            partitions,
            outputs: recorded.outputs,
            controls: recorded.controls,
            limits: recorded.limits,
            task,
            subsystems,
            skipped,
            sampled: Vec::new(),
            readings,
        }
    }

    /// The switches of the system, which refer to each other by their places in it, with α[1], α[2], …
    fn kept_switches(&self, kept: &[usize], contacts: &[Contact<'e>]) -> Vec<Switch<'e>> {
        for (place, &k) in kept.iter().enumerate() {
            let alpha = self.switches.list[k].alpha;
            (self.model.exprs).rename(alpha, &format!("alpha[{}]", place + 1));
        }
        let place = |k: usize| kept.binary_search(&k).ok();
        let mut switches: Vec<Switch<'e>> = kept.iter().map(|&k| self.finished(k)).collect();
        for switch in &mut switches {
            if let Role::Member(other) = switch.role
                && let Some(other) = place(other)
            {
                switch.role = Role::Member(other);
            }
        }
        for contact in contacts {
            let slips = contact.slips().iter().filter_map(|slip| place(slip.switch));
            let slips: Vec<usize> = slips.collect();
            for &slip in &slips {
                switches[slip].slip_of = place(contact.switch);
                switches[slip].across = slips.iter().copied().find(|&other| other != slip);
            }
        }
        switches
    }

    /// What the experiment does without. What else the guard of a contact compares follows from its gap.
    fn skipped(
        &self,
        switches: &[Switch<'e>],
        laws: &[Lowered<'e>],
        dropped: Vec<usize>,
    ) -> Vec<String> {
        let guards = laws.iter().map(|law| law.guard);
        let watched: Vec<usize> = guards.flat_map(|e| self.switches.occurring(e)).collect();
        let dropped = (dropped.into_iter())
            .filter(|k| !watched.contains(k))
            .map(|k| (self.switches.name_of(k), self.switches.list[k].psi))
            .collect();
        skipped::describe(self.model, &self.needs, switches, dropped)
    }

    /// Named switches with their values in α, and as functions of ψ.
    fn named_readings(&self) -> impl Iterator<Item = (Var, Expr<'e>, Expr<'e>)> + '_ {
        self.model.switches.iter().flat_map(|switch| {
            let entries = switch.vars.iter().zip(&switch.psi);
            entries.filter_map(|(var, &psi)| {
                let symbol = var.as_variable()?;
                let direct = match switch.kind {
                    SwitchKind::Sign => psi.sign(),
                    SwitchKind::Step => psi.step(),
                    SwitchKind::Relay(_) => *var,
                };
                Some((symbol, self.named.get(symbol)?, direct))
            })
        })
    }

    /// The switches that the expressions reach, also through ψ, in the order of the source with
    /// inner ones first; and the others.
    fn used(&self, roots: &[Expr<'e>]) -> (Vec<usize>, Vec<usize>) {
        let list = &self.switches.list;
        let number: FxHashMap<Var, usize> = list
            .iter()
            .enumerate()
            .map(|(k, switch)| (switch.alpha, k))
            .collect();
        let inside = |e: &[Expr<'e>]| {
            variables_of(e)
                .into_iter()
                .filter_map(|var| number.get(&var).copied())
                .collect::<Vec<_>>()
        };
        let mut reached: FxHashSet<usize> = FxHashSet::default();
        let mut stack = inside(roots);
        while let Some(k) = stack.pop() {
            if reached.insert(k) {
                stack.extend(inside(&[list[k].psi]));
            }
        }
        // Creation order has inner switches first already.
        let (kept, dropped): (Vec<usize>, Vec<usize>) =
            (0..list.len()).partition(|k| reached.contains(k));
        (kept, dropped)
    }

    fn finished(&self, k: usize) -> Switch<'e> {
        let collected = &self.switches.list[k];
        Switch {
            name: self.switches.name_of(k),
            alpha: self.model.exprs.expr(collected.alpha),
            psi: collected.psi,
            continuity: Continuity::Discontinuous,
            relay: collected.relay,
            is_nonlinear: collected.is_nonlinear,
            unilateral: collected.unilateral,
            slip_of: None,
            across: None,
            role: collected.role,
            named: collected.named.clone(),
            spans: match collected.spans[..] {
                [] => vec![collected.origin],
                _ => collected.spans.clone(),
            },
        }
    }

    fn params(&self) -> Vec<Param<'e>> {
        let entries = self.model.params.iter().flat_map(|param| {
            param
                .vars
                .iter()
                .enumerate()
                .map(move |(k, &var)| (param.shape.entry_name(&param.name, k), var))
        });
        let value = |var: Expr<'e>| {
            var.as_variable()
                .and_then(|var| self.values.numbers.get(&var).copied())
        };
        // What is computed from free parameters stands as a function of them wherever it occurred.
        let is_derived = |var: Var| self.values.free.derives(var);
        entries
            .filter(|(_, var)| !var.as_variable().is_some_and(is_derived))
            .map(|(name, var)| Param {
                name,
                var,
                value: value(var).unwrap_or(f64::NAN),
            })
            .collect()
    }

    /// The data that the experiment needs, which must reach as far as the run.
    fn data(&self, diags: &mut Diagnostics) -> Vec<Data<'e>> {
        let horizon = self.settings.horizon;
        let data: Vec<Data<'e>> = self.kept_data().cloned().collect();
        for Data {
            name, table, span, ..
        } in &data
        {
            let (first, last) = table.range;
            if first > 0.0 || table.end() < horizon {
                diags.push(SystemError::ShortData {
                    name: name.clone(),
                    first,
                    last,
                    horizon,
                    span: *span,
                    run: self.settings.span,
                });
            }
        }
        data
    }

    fn states(&self, rates: &[Expr<'e>], algebraics: Vec<State<'e>>) -> Vec<State<'e>> {
        let model = self.model;
        let statements = model.statements.dynamics.iter().chain(
            model
                .statements
                .regions
                .iter()
                .flat_map(|region| &region.rates),
        );
        let mut set_at: FxHashMap<usize, Span> = FxHashMap::default();
        for rate in statements.filter(|rate| !rate.adds) {
            set_at.entry(rate.entry).or_insert(rate.span);
        }
        let declared = model.states.iter().flat_map(|state| {
            let names = (0..state.vars.len()).map(|k| state.shape.entry_name(&state.name, k));
            names.map(|name| (name, state.span))
        });
        let declared: Vec<(String, Span)> = declared.collect();
        let n_kept = self.kept_states().count();
        let (rates, kept_rates) = rates.split_at(rates.len() - algebraics.len());
        let (rates, integrals) = rates.split_at(n_kept);
        let algebraics = algebraics.into_iter().zip(kept_rates);
        let algebraics = algebraics.map(|(z, &rate)| State { rate, ..z });
        let integrals = self.integral_states(integrals);
        self.kept_states()
            .zip(rates)
            .map(|((entry, var), &rate)| {
                let initial = var
                    .as_variable()
                    .and_then(|var| self.values.numbers.get(&var).copied())
                    .unwrap_or(f64::NAN);
                let (name, span) = declared[entry].clone();
                State {
                    name,
                    var,
                    initial,
                    rate,
                    span: set_at.get(&entry).copied().unwrap_or(span),
                }
            })
            .chain(algebraics)
            .chain(integrals)
            .collect()
    }

    /// The states that are recorded: those of the model, or those that the experiment lists.
    fn groups(&self) -> Vec<StateGroup> {
        let vars = self.kept_states().enumerate();
        let place: FxHashMap<Expr<'e>, usize> =
            vars.map(|(place, (_, var))| (var, place)).collect();
        let group = |name: &str, shape: Vec<usize>, entries: &[Expr<'e>]| StateGroup {
            name: name.to_owned(),
            shape,
            entries: entries.iter().map(|var| place[var]).collect(),
        };
        match &self.settings.outputs {
            None => (self.model.states.iter())
                .map(|state| group(&state.name, state.shape.sizes(), &state.vars))
                .collect(),
            Some(listed) => (listed.iter())
                .filter(|kept| matches!(kept.kind, TargetKind::State(_)))
                .map(|kept| group(&kept.name, kept.shape.clone(), &kept.entries))
                .collect(),
        }
    }

    /// The partitions of states that are kept.
    pub(super) fn kept_partitions(&self) -> impl Iterator<Item = &model::Partition> {
        let partitions = self.model.partitions.iter();
        partitions.filter(|partition| partition.regions.iter().any(|&r| self.needs.regions[r]))
    }
}
