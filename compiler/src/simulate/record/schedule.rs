//! Switches of time as data: when these change is known before a run.
//!
//! α_i ∈ step(ψ_i(t)) -> r_i(t), constant from one root of ψ_i to the next
//!
//! Where ψ of other switches jump with α_i, a method that does not look for switches has a point on either side of the
//! jump in one step. With data in its place steps end there, and each has the piece that holds in it. A program whose
//! control intervals begin at all roots of ψ_i has nothing to detect there.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::lowering::discretize::beginning;
use crate::lowering::hybrid;
use crate::lowering::hybrid::variable;

use nsd_solver::event::{Event, Observer, Segment, Simulator};
use nsd_solver::hybrid::{Settings, Side, Status};

use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::model::Data;
use crate::source::Span;
use crate::source::table::{Fit, Table};
use crate::system::regions::subsystems_of;
use crate::system::{Coupling, Jumps, State, Subsystem, System};

/// The system with data in place of the switches of time with which others jump. Where these have no end of changes
/// within the horizon it is what it was.
pub(crate) fn scheduled<'e>(system: &System<'e>, horizon: f64) -> System<'e> {
    let timed = system.timed();
    let timed: Vec<usize> = (0..timed.len()).filter(|&k| timed[k]).collect();
    let leading = system.leading();
    let changes = |switch: usize, times| leading.contains(&switch).then_some(times);
    if leading.is_empty() {
        return system.clone();
    }
    let Some((mut scheduled, _)) = replaced(system, horizon, timed, changes) else {
        return system.clone();
    };
    for partition in &mut scheduled.coupling.partitions {
        partition.indicators.clear();
    }
    let (rates, alphas) = rates_and_alphas(&scheduled);
    scheduled.coupling.subsystems = crate::system::subsystems(&rates, &alphas);
    scheduled
}

/// The system with data in place of the switches of time that change where one of so many equal steps begins, and nowhere
/// else; without those that depend on `inputs`, which are no numbers, that decide about named regions, or that are constant
/// in each step as they are.
pub(crate) fn held<'e>(
    system: &System<'e>,
    horizon: f64,
    steps: usize,
    inputs: Vec<Var>,
) -> System<'e> {
    let changes = |_, times: Vec<f64>| {
        let begin = |t: f64| beginning(t, horizon, steps);
        times.into_iter().map(begin).collect()
    };
    let known = known(system, inputs);
    let Some((mut held, steps)) = replaced(system, horizon, known, changes) else {
        return system.clone();
    };
    // Nor is there anything to detect of their own.
    let half = system.exprs.constant(0.5);
    for (switch, step) in steps {
        held.switches[switch].psi = step - half;
    }
    let (rates, alphas) = rates_and_alphas(&held);
    held.coupling.subsystems = subsystems_of(&rates, &alphas, &held.coupling.partitions);
    held
}

/// When switches change that may be data by [`held`].
pub(crate) fn instants(system: &System, horizon: f64, inputs: Vec<Var>) -> Vec<f64> {
    let changes = changes(system, horizon, known(system, inputs));
    let sides = changes.map_or_else(Vec::new, |changes| changes.sides);
    sides.into_iter().map(|(time, _)| time).collect()
}

/// The switches of time that are known before a run, and are not constant from one step of data that are held to the next.
fn known(system: &System, mut inputs: Vec<Var>) -> Vec<usize> {
    let partitions = &system.coupling.partitions;
    let data = system.exogenous.data.iter();
    let data = data.filter(|data| data.table.fit == Fit::Hold);
    let constants: Vec<Var> = data.map(|data| variable(data.var)).collect();
    let mut known = Vec::new();
    for (k, is_timed) in system.timed().into_iter().enumerate() {
        let switch = &system.switches[k];
        let read = variables_of(&[switch.psi]);
        let is_known = is_timed
            && !inputs.iter().any(|input| read.contains(input))
            && !partitions.iter().any(|p| p.switches.contains(&k));
        match is_known {
            true => known.push((k, read)),
            false => inputs.push(variable(switch.alpha)),
        }
    }
    known.retain(|(_, read)| !read.iter().all(|var| constants.contains(var)));
    known.into_iter().map(|(k, _)| k).collect()
}

/// The system with data in place of those of the switches of time that are to be replaced, and these with their data: `kept`
/// gives the instants that are taken for those at which one changes. None where there are none, or they have no end of changes
/// within the horizon. A switch keeps its own α, by which it is told.
fn replaced<'e>(
    system: &System<'e>,
    horizon: f64,
    switches: Vec<usize>,
    kept: impl Fn(usize, Vec<f64>) -> Option<Vec<f64>>,
) -> Option<(System<'e>, Vec<(usize, Expr<'e>)>)> {
    let changes = changes(system, horizon, switches)?;
    let mut replaced = system.clone();
    let mut found = Vec::new();
    for (place, &switch) in changes.switches.iter().enumerate() {
        let (times, values) = changes.of(place);
        let Some(times) = kept(switch, times) else {
            continue;
        };
        let name = &system.switches[switch].name;
        let data = Data {
            name: name.clone(),
            var: system.exprs.variable(&format!("step({name})")),
            text: format!("step({name})"),
            table: Arc::new(Table::new(Fit::Hold, &times, &values)),
            span: Span::default(),
        };
        found.push((switch, data.var));
        replaced.exogenous.data.push(data);
    }
    let alpha = |switch: usize| variable(system.switches[switch].alpha);
    let steps = found.iter().map(|&(switch, step)| (alpha(switch), step));
    let steps: Substitution<'e> = steps.collect();
    for state in &mut replaced.states {
        state.rate = state.rate.substitute(&steps);
    }
    for switch in &mut replaced.switches {
        switch.psi = switch.psi.substitute(&steps);
    }
    (!found.is_empty()).then_some((replaced, found))
}

fn rates_and_alphas<'e>(system: &System<'e>) -> (Vec<Expr<'e>>, Vec<Var>) {
    let rates = system.states.iter().map(|state| state.rate).collect();
    let alphas = system.switches.iter();
    (rates, alphas.map(|switch| variable(switch.alpha)).collect())
}

/// What decides when switches of time change with which others jump; nothing where none do.
pub(crate) fn deciding(system: &System) -> Vec<Var> {
    if system.leading().is_empty() {
        return Vec::new();
    }
    let switches = system.switches.iter().zip(system.timed());
    let timed = switches.filter(|(_, timed)| *timed);
    variables_of(&timed.map(|(switch, _)| switch.psi).collect::<Vec<_>>())
}

/// Whether data decide it.
pub(crate) fn follows_data(system: &System) -> bool {
    let deciding = deciding(system);
    let mut data = system.exogenous.data.iter();
    data.any(|data| deciding.contains(&variable(data.var)))
}

fn alone(switch: usize) -> Subsystem {
    Subsystem {
        switches: vec![switch],
        regions: None,
    }
}

/// When switches of time change, and to which sides.
struct Changes {
    switches: Vec<usize>,
    /// From these instants on, the start first.
    sides: Vec<(f64, Box<[Side]>)>,
}

impl Changes {
    /// The instants and values of one of them.
    fn of(&self, place: usize) -> (Vec<f64>, Vec<f64>) {
        let value = |sides: &[Side]| f64::from(u8::from(sides[place] != Side::Minus));
        self.sides
            .iter()
            .map(|(time, sides)| (*time, value(sides)))
            .unzip()
    }
}

impl Observer for Changes {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        if self.sides.is_empty() {
            self.sides.push((0.0, segment.sides.into()));
        }
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        match self
            .sides
            .last_mut()
            .filter(|(time, _)| *time == event.time)
        {
            Some((_, sides)) => *sides = event.to.into(),
            None => self.sides.push((event.time, event.to.into())),
        }
    }
}

/// When these switches of time change, which read no others, by a run from event to event in which nothing else does.
fn changes(system: &System, horizon: f64, switches: Vec<usize>) -> Option<Changes> {
    if switches.is_empty() {
        return None;
    }
    let clock = State {
        name: String::new(),
        var: system.exprs.variable("still"),
        initial: 0.0,
        rate: system.exprs.constant(0.0),
        span: Span::default(),
    };
    let alone = System {
        states: vec![clock],
        switches: switches
            .iter()
            .map(|&k| system.switches[k].clone())
            .collect(),
        coupling: Coupling {
            partitions: Vec::new(),
            subsystems: (0..switches.len()).map(alone).collect(),
        },
        jumps: Jumps::default(),
        ..system.clone()
    };
    let mut simulator = Simulator::new(hybrid::lower_over(&alone, horizon), Settings::default());
    let mut changes = Changes {
        switches,
        sides: Vec::new(),
    };
    let outcome = simulator.run(0.0, horizon, &[0.0], &mut changes);
    (outcome.status == Status::Solved && !changes.sides.is_empty()).then_some(changes)
}
