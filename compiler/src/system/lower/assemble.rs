//! Finishes a system: keeps what is used, classifies the switches, checks the partitions.

use std::sync::Arc;

use rustc_hash::{FxHashMap, FxHashSet};

use super::instance::Instance;
use super::motion::Motion;
use super::stops;
use super::translation::Translation;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::model::{Data, Model, SwitchKind};
use crate::source::Span;
use crate::source::table::{Fit, Table};
use crate::system::contacts::finished_contacts;
use crate::system::contacts::jumps::{Lowered, finished_laws};
use crate::system::experiment::Settings;
use crate::system::needs::skipped;
use crate::system::regions::partitions::Regions;
use crate::system::regions::subsystems_of;
use crate::system::switches::Switches;
use crate::system::switches::continuity::Entered;
use crate::system::switches::switched::Switched;
use crate::system::{
    Comparison, Contact, Continuity, Coupling, Exogenous, Jumps, Param, Provenance, Readings,
    Recorded, Role, State, Switch, System, SystemError, Task,
};

/// All parts of a system in α of collected switches.
pub(crate) struct Parts<'e> {
    pub motion: Motion<'e>,
    pub recorded: Recorded<'e>,
    /// α of the switches that expectations name.
    pub named: Vec<Expr<'e>>,
    /// Texts of switching functions that figures and tables show, by the names of switches.
    pub aliases: FxHashMap<String, String>,
    pub task: Option<Task<'e>>,
    pub regions: Regions<'e>,
    /// Parts of programs whose convexity was looked at in points only.
    pub sampled: Vec<Span>,
}

impl<'e> Parts<'e> {
    /// Keeps the switches that matter, and finishes their description.
    pub fn assemble(self, translation: Translation<'_, 'e>, diags: &mut Diagnostics) -> System<'e> {
        let instance = translation.instance;
        let (model, motion, regions) = (instance.model, self.motion, self.regions);
        let (collected, rates) = (&translation.switches, motion.rates());
        let guards = regions.weights.iter().chain(&regions.guards);
        let roots: Vec<Expr<'e>> = (rates.iter().copied())
            .chain(motion.exprs())
            .chain(self.recorded.exprs())
            .chain(self.task.iter().flat_map(Task::exprs))
            .chain(guards.chain(&self.named).copied())
            .collect();
        let (kept, dropped) = used(collected, &roots);
        let mut switches = kept_switches(collected, &kept, &motion.contacts);
        let alphas: Vec<Var> = kept.iter().map(|&k| collected.list[k].alpha).collect();
        let on = |psi: fn(&Switch<'e>) -> Expr<'e>| {
            let surfaces = alphas.iter().copied().zip(switches.iter().map(psi));
            surfaces.collect::<Vec<_>>()
        };
        let coefficients = motion.coefficients();
        let switched = Switched {
            rates: &rates,
            coefficients: &coefficients,
            switches: &switches,
            alphas: &alphas,
            sampler: &translation.sampler_of(on(|switch| switch.psi)),
        };
        let entered = Entered::new(collected, &kept, &switched);
        let continuity = entered.continuity(&translation.frame(on(Switch::surface)));
        entered.check_surfaces(diags);
        let mut states = states(instance, &motion.rates);
        let partitions = regions.partitions(instance, &switched, &states, diags);
        states.extend(motion.algebraics);
        states.extend(motion.integrals);
        for (switch, continuity) in switches.iter_mut().zip(continuity) {
            switch.continuity = continuity;
        }
        check_data(&translation.roundings.data, instance.settings, diags);
        let steps = translation.roundings.steps.iter();
        let steps = steps.filter_map(|&psi| Some(&collected.list[collected.find(psi)?.0]));
        let steps = steps.filter(|switch| switch.name.is_none());
        let steps = steps.map(|switch| switch.alpha).collect();
        let mut data = translation.roundings.data;
        data.extend(driven(instance));
        let named = named_readings(model, &translation.named);
        System {
            exprs: model.exprs,
            name: model.name.clone(),
            time: model.time,
            clock: None,
            exogenous: Exogenous {
                params: params(instance),
                data,
                steps,
            },
            states,
            coupling: Coupling {
                subsystems: subsystems_of(&rates, &alphas, &partitions),
                partitions,
            },
            provenance: Provenance {
                skipped: skipped(instance, collected, &switches, &motion.laws, dropped),
                sampled: self.sampled,
                aliases: self.aliases.into(),
                readings: Readings::of(collected, &kept, translation.given, named),
            },
            switches,
            jumps: Jumps {
                laws: finished_laws(instance, collected, motion.laws, &kept)
                    .chain(stops::finished(motion.stops, &collected.entries))
                    .collect(),
                comparisons: comparisons(collected, &kept),
                bodies: motion.bodies,
                contacts: finished_contacts(motion.contacts, &kept),
                impulsive: motion.impulsive,
            },
            recorded: self.recorded,
            task: self.task,
        }
    }
}

/// Controls that a controller decides on while the system runs, at their defaults until then.
fn driven<'e>(instance: &Instance<'_, 'e>) -> Vec<Data<'e>> {
    let closed_loop = instance.settings.numerics.closed_loop.as_ref();
    let controls = closed_loop.map_or_else(Vec::new, |_| instance.decided());
    let data = controls.into_iter().map(|control| Data {
        name: control.name,
        var: control.var,
        text: "a controller decides on it".to_owned(),
        table: Arc::new(Table::new(Fit::Hold, &[0.0], &[control.default])),
        span: control.span,
    });
    data.collect()
}

/// The switches of the system, which refer to each other by their places in it, with α[1], α[2], …
fn kept_switches<'e>(
    collected: &Switches<'e>,
    kept: &[usize],
    contacts: &[Contact<'e>],
) -> Vec<Switch<'e>> {
    for (place, &k) in kept.iter().enumerate() {
        let alpha = collected.list[k].alpha;
        let name = format!("alpha[{}]", place + 1);
        (collected.exprs()).rename(alpha, &name);
        let compared: Vec<(Var, f64)> = collected.entries.compared(k).collect();
        for &(var, on_surface) in &compared {
            // `>` and `>=` with one surface are told apart.
            let name = match (compared.len(), on_surface) {
                (1, _) => name.clone(),
                (_, 0.0) => format!("alpha[{}, >]", place + 1),
                (_, 1.0) => format!("alpha[{}, >=]", place + 1),
                _ => format!("alpha[{}, step]", place + 1),
            };
            (collected.exprs()).rename(var, &name);
        }
    }
    let place = |k: usize| kept.binary_search(&k).ok();
    let mut switches: Vec<Switch<'e>> = kept.iter().map(|&k| finished(collected, k)).collect();
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

/// The comparisons of laws.
fn comparisons<'e>(collected: &Switches<'e>, kept: &[usize]) -> Vec<Comparison> {
    let kept = kept.iter().enumerate();
    let compared = kept.flat_map(|(switch, &k)| {
        let compared = collected.entries.compared(k);
        compared.map(move |(var, on_surface)| Comparison {
            var,
            switch,
            on_surface,
        })
    });
    compared.collect()
}

/// What the experiment does without. What else the guard of a contact compares follows from its gap.
fn skipped<'e>(
    instance: &Instance<'_, 'e>,
    collected: &Switches<'e>,
    switches: &[Switch<'e>],
    laws: &[Lowered<'e>],
    dropped: Vec<usize>,
) -> Vec<String> {
    let guards = laws.iter().filter_map(|law| law.when.guard());
    let watched: Vec<usize> = guards
        .flat_map(|e| collected.entries.occurring(e))
        .collect();
    let dropped = (dropped.into_iter())
        .filter(|k| !watched.contains(k))
        .map(|k| (collected.name_of(k), collected.list[k].psi))
        .collect();
    skipped::describe(instance.model, &instance.needs, switches, dropped)
}

/// Named switches with their values in α, and as functions of ψ.
fn named_readings<'e>(
    model: &Model<'e>,
    named: &Substitution<'e>,
) -> impl Iterator<Item = (Var, Expr<'e>, Expr<'e>)> {
    model.switches.iter().flat_map(|switch| {
        let entries = switch.vars.iter().zip(&switch.psi);
        entries.filter_map(|(var, &psi)| {
            let symbol = var.as_variable()?;
            let direct = match switch.kind {
                SwitchKind::Sign => psi.sign(),
                SwitchKind::Step => psi.step(),
                SwitchKind::Relay(_) => *var,
            };
            Some((symbol, named.get(symbol)?, direct))
        })
    })
}

/// The switches that the expressions reach, also through ψ, in the order of the source with
/// inner ones first; and the others.
fn used<'e>(collected: &Switches<'e>, roots: &[Expr<'e>]) -> (Vec<usize>, Vec<usize>) {
    let list = &collected.list;
    let mut number: FxHashMap<Var, usize> = FxHashMap::default();
    for k in 0..list.len() {
        let vars = collected.entries.variables_of(k);
        number.extend(vars.map(|var| (var, k)));
    }
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

fn finished<'e>(switches: &Switches<'e>, k: usize) -> Switch<'e> {
    let collected = &switches.list[k];
    Switch {
        name: switches.name_of(k),
        alpha: switches.exprs().expr(collected.alpha),
        psi: collected.psi,
        continuity: Continuity::Discontinuous,
        relay: collected.relay,
        is_nonlinear: switches.entries.is_nonlinear(k),
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

fn params<'e>(instance: &Instance<'_, 'e>) -> Vec<Param<'e>> {
    let values = instance.values();
    let entries = instance.model.quantities.params.iter().flat_map(|param| {
        param
            .vars
            .iter()
            .enumerate()
            .map(move |(k, &var)| (param.shape.entry_name(&param.name, k), var))
    });
    let value = |var: Expr<'e>| {
        var.as_variable()
            .and_then(|var| values.numbers.get(&var).copied())
    };
    // What is computed from free parameters stands as a function of them wherever it occurred.
    let is_derived = |var: Var| values.free.derives(var);
    entries
        .filter(|(_, var)| !var.as_variable().is_some_and(is_derived))
        .map(|(name, var)| Param {
            name,
            var,
            value: value(var).unwrap_or(f64::NAN),
        })
        .collect()
}

/// Data must reach as far as the run.
fn check_data(data: &[Data<'_>], settings: &Settings<'_>, diags: &mut Diagnostics) {
    let horizon = settings.horizon;
    for Data {
        name, table, span, ..
    } in data
    {
        let (first, last) = table.range;
        if first > 0.0 || table.end() < horizon {
            diags.push(SystemError::ShortData {
                name: name.clone(),
                first,
                last,
                horizon,
                span: *span,
                run: settings.span,
            });
        }
    }
}

/// The states of the model that are kept.
fn states<'e>(instance: &Instance<'_, 'e>, rates: &[Expr<'e>]) -> Vec<State<'e>> {
    let statements = &instance.model.statements;
    let in_regions = statements.regions.iter().flat_map(|region| &region.rates);
    let mut set_at: FxHashMap<usize, Span> = FxHashMap::default();
    for rate in statements.dynamics.iter().chain(in_regions) {
        if !rate.adds {
            set_at.entry(rate.entry).or_insert(rate.span);
        }
    }
    let declared = instance.model.quantities.states.iter().flat_map(|state| {
        let names = (0..state.vars.len()).map(|k| state.shape.entry_name(&state.name, k));
        names.map(|name| (name, state.span))
    });
    let declared: Vec<(String, Span)> = declared.collect();
    let kept = instance.entries.iter().zip(rates);
    let states = kept.map(|(&entry, &rate)| {
        let (name, span) = declared[entry].clone();
        let var = instance.vars[entry];
        State {
            name,
            var,
            initial: instance.number(var),
            rate,
            span: set_at.get(&entry).copied().unwrap_or(span),
        }
    });
    states.collect()
}
