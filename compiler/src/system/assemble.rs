//! Finishes a system: keeps what is used, classifies the switches, checks the partitions.

use rustc_hash::{FxHashMap, FxHashSet};

use super::lower::Lowering;
use super::regions::regions_of;
use super::{
    Body, Contact, Continuity, Output, Param, Role, State, StateGroup, Switch, System, SystemError,
    Task,
};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, jacobian, variables_of};
use crate::model::{self, Data, SwitchKind, TargetKind};
use crate::source::Span;
use crate::system::contacts::jumps::Lowered;
use crate::system::needs::skipped;
use crate::system::regions::corners::jumps_somewhere;
use crate::system::regions::partitions::Regions;
use crate::system::switches::continuity::{classify, is_multiple};
use crate::system::switches::interaction::{positions, subsystems};
use crate::system::switches::relay::at_all_sides;
use crate::system::values::limits::Limit;

/// Rates, algebraic states, which have the last ones, laws of jumps, bodies, and contacts with collected switches.
type Motion<'e> = (
    Vec<Expr<'e>>,
    Vec<State<'e>>,
    Vec<Lowered<'e>>,
    Vec<Body<'e>>,
    Vec<Contact<'e>>,
);

impl<'e> Lowering<'_, 'e> {
    /// Keeps the switches that matter, and finishes their description.
    pub(super) fn assemble(
        self,
        (rates, algebraics, laws, bodies, contacts): Motion<'e>,
        (outputs, controls, limits): (Vec<Output<'e>>, Vec<Output<'e>>, Vec<Limit<'e>>),
        task: Option<Task<'e>>,
        named: &[Expr<'e>],
        regions: Regions<'e>,
        diags: &mut Diagnostics,
    ) -> System<'e> {
        let model = self.model;
        let recorded = outputs
            .iter()
            .chain(&controls)
            .flat_map(|output| output.exprs.iter().copied())
            .chain(limits.iter().map(|limit| limit.value))
            .chain(task.iter().flat_map(Task::exprs));
        let roots: Vec<Expr<'e>> = rates
            .iter()
            .chain(&regions.weights)
            .chain(&regions.guards)
            .copied()
            .chain(recorded)
            .chain(named.iter().copied())
            .chain(laws.iter().flat_map(Lowered::reads))
            .chain(contacts.iter().flat_map(Contact::exprs))
            .chain(bodies.iter().flat_map(Body::exprs))
            .collect();
        let (kept, dropped) = self.used(&roots);
        for (place, &k) in kept.iter().enumerate() {
            model.exprs.rename(
                self.switches.list[k].alpha,
                &format!("alpha[{}]", place + 1),
            );
        }
        let mut switches: Vec<Switch<'e>> = kept.iter().map(|&k| self.finished(k)).collect();
        for switch in &mut switches {
            if let Role::Member(other) = switch.role
                && let Ok(place) = kept.binary_search(&other)
            {
                switch.role = Role::Member(place);
            }
        }
        for contact in &contacts {
            let place = |k: usize| kept.binary_search(&k).ok();
            let slips = contact.slips().iter().filter_map(|slip| place(slip.switch));
            let slips: Vec<usize> = slips.collect();
            for &slip in &slips {
                switches[slip].slip_of = place(contact.switch);
                switches[slip].across = slips.iter().copied().find(|&other| other != slip);
            }
        }
        let alphas: Vec<Var> = kept.iter().map(|&k| self.switches.list[k].alpha).collect();
        let sampler = self.sampler_of(
            switches
                .iter()
                .zip(&alphas)
                .map(|(switch, &alpha)| (alpha, switch.psi))
                .collect(),
        );

        // The functions each α enters: rates and the ψ of other switches, but for kinks that are continuous by form.
        let functions: Vec<Expr<'e>> = rates
            .iter()
            .copied()
            .chain(switches.iter().map(|switch| switch.psi))
            .collect();
        let kinks = (0..alphas.len()).filter(|&k| self.switches.is_kink(kept[k]));
        let (kinks, kink_alphas): (Vec<usize>, Vec<Var>) = kinks.map(|k| (k, alphas[k])).unzip();
        let slopes = jacobian(&functions, &kink_alphas).entries.into_iter();
        let continuous: FxHashSet<(usize, usize)> = slopes
            .map(|(f, j, slope)| (f, kinks[j], slope))
            .filter(|&(_, k, slope)| is_multiple(slope, (alphas[k], switches[k].psi)))
            .map(|(f, k, _)| (f, k))
            .collect();
        let mut entered: Vec<Vec<Expr<'e>>> = vec![Vec::new(); alphas.len()];
        for (number, &f) in functions.iter().enumerate() {
            for k in positions(f, &alphas) {
                if !continuous.contains(&(number, k)) {
                    entered[k].push(f);
                }
            }
        }
        let relays: Vec<Var> = (switches.iter().zip(&alphas))
            .filter_map(|(switch, &alpha)| switch.relay.map(|_| alpha))
            .collect();
        // A relay has either value on any surface, and the worse one counts.
        let across = |functions: &[Expr<'e>], (alpha, psi), is_kink| {
            let Some(sides) = at_all_sides(functions, psi, &relays) else {
                return Continuity::Discontinuous;
            };
            let classes = (sides.iter())
                .map(|(functions, psi)| classify(functions, (alpha, *psi), is_kink, &sampler));
            classes.max().unwrap_or(Continuity::Discontinuous)
        };
        let surfaces: Vec<(Var, Expr<'e>)> = switches
            .iter()
            .map(Switch::surface)
            .zip(&alphas)
            .map(|(psi, &alpha)| (alpha, psi))
            .collect();
        let frame = self.frame(surfaces);
        for (k, switch) in switches.iter_mut().enumerate() {
            // A hidden term needs no jump to slide by.
            if switch.relay.is_some()
                || switch.is_nonlinear && !entered[k].is_empty()
                || switch.unilateral
                || switch.slip_of.is_some()
                || switch.role != Role::Step
            {
                continue;
            }
            let is_kink = self.switches.is_kink(kept[k]);
            let known = across(&entered[k], (alphas[k], switch.psi), is_kink);
            let jumps =
                known == Continuity::Sampled && jumps_somewhere(&entered[k], k, &frame, &sampler);
            switch.continuity = if jumps {
                Continuity::Discontinuous
            } else {
                known
            };
        }
        for outer in &switches {
            for inner in positions(outer.psi, &alphas) {
                if self.switches.is_leading(kept[inner]) || !entered[inner].contains(&outer.psi) {
                    continue;
                }
                // What the rates do there is another matter.
                let is_kink = self.switches.is_kink(kept[inner]);
                let surface = (alphas[inner], switches[inner].psi);
                if across(&[outer.psi], surface, is_kink) == Continuity::Discontinuous {
                    diags.push(SystemError::DiscontinuousSurface {
                        outer: outer.name.clone(),
                        inner: switches[inner].name.clone(),
                        outer_span: outer.spans[0],
                        inner_span: switches[inner].spans[0],
                    });
                }
            }
        }

        let states = self.states(&rates, algebraics);
        let partitions = self.partitions(
            &regions, &rates, &switches, &alphas, &sampler, &states, diags,
        );
        let mut subsystems = subsystems(&rates, &alphas);
        for subsystem in &mut subsystems {
            subsystem.regions = regions_of(subsystem, &partitions, &rates, &alphas);
        }
        // What else the guard of a contact compares follows from its gap.
        let guards = laws.iter().map(|law| law.guard);
        let watched: Vec<usize> = guards.flat_map(|e| self.switches.occurring(e)).collect();
        let dropped: Vec<(String, Expr<'e>)> = dropped
            .into_iter()
            .filter(|k| !watched.contains(k))
            .map(|k| (self.switches.name_of(k), self.switches.list[k].psi))
            .collect();
        let skipped = skipped::describe(model, &self.needs, &switches, dropped);
        let (params, groups) = (self.params(), self.groups());
        let data = self.data(diags);
        let named = model.switches.iter().flat_map(|switch| {
            switch
                .vars
                .iter()
                .zip(&switch.psi)
                .filter_map(|(var, &psi)| {
                    let symbol = var.as_variable()?;
                    let direct = match switch.kind {
                        SwitchKind::Sign => psi.sign(),
                        SwitchKind::Step => psi.step(),
                        SwitchKind::Relay(_) => *var,
                    };
                    Some((symbol, self.named.get(symbol)?, direct))
                })
        });
        let readings = self.switches.readings(&kept, self.given.clone(), named);
        System {
            exprs: model.exprs,
            name: model.name.clone(),
            time: model.time,
            clock: None,
            data,
            params,
            states,
            groups,
            switches,
            laws: self.finished_laws(laws, &kept),
            bodies,
            contacts: self.finished_contacts(contacts, &kept),
            impulsive: Vec::new(),
            partitions,
            outputs,
            controls,
            limits,
            task,
            subsystems,
            skipped,
            sampled: Vec::new(),
            readings,
        }
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
        let statements = model
            .dynamics
            .iter()
            .chain(model.regions.iter().flat_map(|region| &region.rates));
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
