//! Switches of time as data: when these change is known before a run.
//!
//! α_i ∈ step(ψ_i(t)) -> r_i(t), constant from one root of ψ_i to the next
//!
//! Where ψ of other switches jump with α_i, a method that does not look for switches has a point on either side of the
//! jump in one step. With data in its place steps end there, and each has the piece that holds in it.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::lowering::hybrid;
use crate::lowering::hybrid::variable;

use nsd_solver::event::{Event, Observer, Segment, Simulator};
use nsd_solver::hybrid::{Settings, Side, Status};

use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::model::Data;
use crate::source::Span;
use crate::source::table::{Fit, Table};
use crate::system::{Coupling, Jumps, State, Subsystem, System};

/// The system with data in place of the switches of time with which others jump. Where these have no end of changes
/// within the horizon it is what it was.
pub(crate) fn scheduled<'e>(system: &System<'e>, horizon: f64) -> System<'e> {
    let leading = system.leading();
    if leading.is_empty() {
        return system.clone();
    }
    let Some(changes) = changes(system, horizon) else {
        return system.clone();
    };
    let mut scheduled = system.clone();
    let mut steps: Vec<(usize, Var, Expr<'e>)> = Vec::new();
    for &switch in &leading {
        let place = changes.switches.iter().position(|&timed| timed == switch);
        let Some(place) = place else {
            continue;
        };
        let (times, values) = changes.of(place);
        let name = &system.switches[switch].name;
        let data = Data {
            name: name.clone(),
            var: system.exprs.variable(&format!("step({name})")),
            text: format!("step({name})"),
            table: Arc::new(Table::new(Fit::Hold, &times, &values)),
            span: Span::default(),
        };
        steps.push((switch, variable(system.switches[switch].alpha), data.var));
        scheduled.exogenous.data.push(data);
    }
    // A switch keeps its own α, by which it is told.
    let all: Substitution<'e> = steps
        .iter()
        .map(|&(_, alpha, step)| (alpha, step))
        .collect();
    for state in &mut scheduled.states {
        state.rate = state.rate.substitute(&all);
    }
    for switch in &mut scheduled.switches {
        switch.psi = switch.psi.substitute(&all);
    }
    for partition in &mut scheduled.coupling.partitions {
        partition.indicators.clear();
    }
    let rates: Vec<Expr<'e>> = scheduled.states.iter().map(|state| state.rate).collect();
    let alphas: Vec<Var> = (scheduled.switches.iter())
        .map(|switch| variable(switch.alpha))
        .collect();
    scheduled.coupling.subsystems = crate::system::subsystems(&rates, &alphas);
    scheduled
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

/// When the switches of time change, by a run from event to event in which nothing else does.
fn changes(system: &System, horizon: f64) -> Option<Changes> {
    let timed = system.timed();
    let switches: Vec<usize> = (0..timed.len()).filter(|&k| timed[k]).collect();
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
