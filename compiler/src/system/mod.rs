//! Piecewise smooth system of one experiment, with its switches made explicit.
//!
//! x' = f(t, x, p, α),  α_i ∈ step(ψ_i(t, x, p, α_c)),  y = g(t, x, p, α)
//!
//! where step is 0 for ψ < 0, 1 for ψ > 0, and the interval [0, 1] for ψ = 0
//! (Filippov's convexification, one factor per switch).
//! A switch is *continuous* (an NSD1 switch, as `abs` and `max` give) when f does
//! not depend on α_i while ψ_i = 0; it never slides.
//!
//! Invariants, checked by [`System::verify`]:
//!
//! - No `step`, `sign`, `abs`, `min` or `max` is left in a rate, an output or a ψ.
//! - Rates and region weights are multi-affine: affine in every α taken alone, but for rates in the α of
//!   nonlinear switches. These are discontinuous, and neither relays nor of contacts.
//! - ψ_i may contain α_j, but only of earlier switches (j < i) across whose surface ψ_i is
//!   continuous: it is smooth within a mode, and on ψ_j = 0 any value of α_j in it is as good as
//!   another. Continuity is checked by [`lower`].
//!   It may jump with α_j only of switches that are decided before the others: relays, and switches
//!   whose ψ depends on time only.
//! - A relay has memory: its α is 0 or 1 and stays until ψ, which contains it, leaves its side. Relays
//!   come before all other switches, and their y may contain α of any.
//! - A unilateral switch is discontinuous; its α occurs in rates only, in directions that push ψ up, and
//!   one law at most strikes it: none where it is a constraint of a projection.
//! - An algebraic state has the sum of one or two α as its rate, which occur nowhere else: one of an equation ψ = 0, or
//!   those of both members -ψ ≥ 0 of a pair. These switches are discontinuous, and ψ is any function, continuous but
//!   across relays and switches of time.
//! - A slip switch is discontinuous, and its α occurs in rates only, in products with 1 - α of its contact.
//! - Of a slip velocity w with two entries both have a switch, which name each other as [`Switch::across`]: u = 2α - 1
//!   is w/|w|, and any u with |u| ≤ 1 where w = 0. Both are discontinuous.
//! - No two ψ are multiples of each other but those of slip switches, and none is constant.
//! - Rates, outputs, limits, ψ and the task contain only time, parameters, data, states, controls that are decided,
//!   and α.
//! - Every α that occurs belongs to exactly one switch, every switch to exactly
//!   one subsystem; α of different subsystems never multiply each other.
//! - In every corner of α, the weights of a partition are 0 or 1, or sum to one: a region `else`
//!   is 1 minus the others also in corners that no point has. (That exactly one region holds at
//!   every point is proven by [`lower`], or else checked at samples; see [`Coverage`].)

mod about;
#[cfg(test)]
mod agreement_tests;
pub(crate) mod algebraic;
pub(crate) mod contacts;
mod display;
mod error;
pub mod experiment;
pub mod freezing;
pub(crate) mod lower;
pub(crate) mod needs;
#[cfg(test)]
mod needs_tests;
mod read;
pub(crate) mod regions;
pub(crate) mod switches;
pub mod task;
#[cfg(test)]
mod tests;
pub(crate) mod values;
mod verify;

pub use crate::system::contacts::mechanics::{Body, Contact, Direction, Friction, Impulsive, Slip};
pub(crate) use crate::system::switches::interaction::subsystems;
pub use crate::system::values::limits::{Allowed, Limit};
pub use crate::system::values::valuation::Valuation;
pub use about::About;
pub use display::Structure;
pub use error::SystemError;
pub use experiment::ExperimentError;
pub use lower::lower;
pub use needs::Extent;
pub use read::Readings;
pub use task::Task;

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::expr::{Expr, Exprs, Var, variables_of};
use crate::model::{Data, When};
use crate::source::Span;

/// x' = f(t, x, p, α), α ∈ step(ψ(t, x, p)).
#[derive(Clone, Debug)]
pub struct System<'e> {
    /// The arena of all expressions.
    pub exprs: &'e Exprs,
    /// Name of the model.
    pub name: String,
    /// Time, a variable: physical time t, or the numerical one of a system that is frozen.
    pub time: Expr<'e>,
    /// The state that is physical time where that is not [`System::time`].
    pub clock: Option<usize>,
    /// Parameters and data.
    pub exogenous: Exogenous<'e>,
    /// Scalar states x with their rates: those of the model, algebraic ones, and integrals.
    pub states: Vec<State<'e>>,
    /// Switches α_i ∈ step(ψ_i).
    pub switches: Vec<Switch<'e>>,
    /// Which switches act together.
    pub coupling: Coupling<'e>,
    /// What makes states jump.
    pub jumps: Jumps<'e>,
    /// What is recorded or watched of a run.
    pub recorded: Recorded<'e>,
    /// What is optimized; none in a simulation.
    pub task: Option<Task<'e>>,
    /// How it follows from the model.
    pub provenance: Provenance<'e>,
}

/// Numbers and functions of time that nothing in the system moves.
#[derive(Clone, Debug, Default)]
pub struct Exogenous<'e> {
    /// Scalar parameters p with their values in this experiment.
    pub params: Vec<Param<'e>>,
    /// Functions of time from data that occur.
    pub data: Vec<Data<'e>>,
    /// α of switches of time that roundings are made of, as data is where their arguments are known: what they do is no
    /// event of the model.
    pub steps: Vec<Var>,
}

/// Which switches act together.
#[derive(Clone, Debug, Default)]
pub struct Coupling<'e> {
    /// Named regions by partition.
    pub partitions: Vec<Partition<'e>>,
    /// Switches that interact; a partition of all switches, in order of their first member.
    pub subsystems: Vec<Subsystem>,
}

/// What makes states jump: laws of their own, and contacts between bodies.
#[derive(Clone, Debug, Default)]
pub struct Jumps<'e> {
    /// Laws by which states jump, in order.
    pub laws: Vec<Law<'e>>,
    /// What stands for comparisons in laws.
    pub comparisons: Vec<Comparison>,
    /// Bodies that have contacts, and others.
    pub bodies: Vec<Body<'e>>,
    /// Contacts between bodies, in order.
    pub contacts: Vec<Contact<'e>>,
    /// Contacts of a method in steps of time, which treats them itself; then there are no others.
    pub impulsive: Vec<Impulsive<'e>>,
}

/// Functions of time, states and α that nothing moves by.
#[derive(Clone, Debug, Default)]
pub struct Recorded<'e> {
    /// The states that are recorded, made up of scalar states.
    pub groups: Vec<StateGroup>,
    /// What is recorded besides states and controls.
    pub outputs: Vec<Output<'e>>,
    /// Controls that are recorded, as functions of time and state.
    pub controls: Vec<Output<'e>>,
    /// What is watched during a run.
    pub limits: Vec<Limit<'e>>,
}

/// How a system follows from its model.
#[derive(Clone, Debug, Default)]
pub struct Provenance<'e> {
    /// What the model has and this experiment does not need, as the report tells it.
    pub skipped: Vec<String>,
    /// Parts of programs whose convexity was looked at in points only.
    pub sampled: Vec<Span>,
    /// Texts of switching functions that figures and tables show, by the names of switches.
    pub aliases: Arc<FxHashMap<String, String>>,
    /// What other expressions of the model mean here.
    pub readings: Readings<'e>,
}

/// A scalar parameter.
#[derive(Clone, Debug)]
pub struct Param<'e> {
    /// Name with index: `k`, `A[1,2]`.
    pub name: String,
    /// Its variable.
    pub var: Expr<'e>,
    /// Its value, overrides applied.
    pub value: f64,
}

/// A scalar state and its rate.
#[derive(Clone, Debug)]
pub struct State<'e> {
    /// Name with index: `x[1]`.
    pub name: String,
    /// Its variable.
    pub var: Expr<'e>,
    /// Value at t = 0.
    pub initial: f64,
    /// x' = rate(t, x, p, α).
    pub rate: Expr<'e>,
    /// The dynamics statement that sets it, else its declaration.
    pub span: Span,
}

/// A recorded state of the model, or a part of one: scalar states, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StateGroup {
    /// `q`, or `x[2]`, `x[1..3]` where `output` names a part.
    pub name: String,
    /// Empty for a scalar, `[n]` for a vector, `[m, n]` for a matrix.
    pub shape: Vec<usize>,
    /// Its entries in [`System::states`].
    pub entries: Vec<usize>,
}

/// A switch α ∈ step(ψ).
#[derive(Clone, Debug)]
pub struct Switch<'e> {
    /// Name of the surface ψ = 0 in reports: the user's text of ψ, or the name of the switch.
    pub name: String,
    /// The variable α ∈ [0, 1].
    pub alpha: Expr<'e>,
    /// The switching function, in the orientation the user wrote first.
    pub psi: Expr<'e>,
    /// Whether the dynamics are continuous across the surface.
    pub continuity: Continuity,
    /// What a relay remembers; none for the others.
    pub relay: Option<Relay>,
    /// f is what it is for every α between 0 and 1, and need not be affine in it.
    pub is_nonlinear: bool,
    /// True for a contact, and for a constraint of a projection: ψ ≥ 0, and α is 1 where ψ > 0 and any number up to 1
    /// where it is kept at zero.
    pub unilateral: bool,
    /// The unilateral switch without which it means nothing: that of the contact whose slip velocity is ψ.
    pub slip_of: Option<usize>,
    /// The switch of the other entry of a slip velocity with two: their 2α - 1 are a point of the unit disc.
    pub across: Option<usize>,
    /// What α is.
    pub role: Role,
    /// Names of `switch` statements that read this switch.
    pub named: Vec<NamedReading>,
    /// Where ψ stands in the source, in order of appearance.
    pub spans: Vec<Span>,
}

/// What the α of a switch is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Role {
    /// A step of ψ, or the force of a unilateral surface.
    #[default]
    Step,
    /// The rate of an algebraic state, by which the equation ψ = 0 is kept.
    Equation,
    /// That of one member -ψ of a pair; this is the switch of the other.
    Member(usize),
}

/// A switch with memory: α = 1 until y passes `off`, 0 until it passes `on`.
///
/// ψ = on + (off - on) α - y where on < off, y - on - (off - on) α where on > off: in either case
/// ψ > 0 keeps α = 1, ψ < 0 keeps α = 0, and a change of α takes ψ further away from zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Relay {
    /// Threshold of y for α = 1.
    pub on: f64,
    /// Threshold of y for α = 0.
    pub off: f64,
    /// Whether α = 1 at the start.
    pub start: bool,
    /// The same as the model gives it, for y between the thresholds.
    pub given: Option<bool>,
}

impl Relay {
    /// Whether α = 1 at the start, by y there: a value that the thresholds do not allow would be left at once. None where
    /// neither they nor the model say it.
    pub(crate) fn start_at(&self, y: f64) -> Option<bool> {
        match self.given {
            _ if y < self.on.min(self.off) => Some(self.on < self.off),
            _ if y > self.on.max(self.off) => Some(self.on > self.off),
            given => given,
        }
    }
}

/// A comparison with the surface of a switch in a law, which reads numbers.
#[derive(Clone, Copy, Debug)]
pub struct Comparison {
    /// What stands for it in laws.
    pub var: Var,
    /// The switch, with whose α it agrees off the surface.
    pub switch: usize,
    /// Its value on the surface: 1 for `>=`, 0 for `>`, 1/2 for `step`.
    pub on_surface: f64,
}

/// A law by which states jump: x⁺ = r(t, x, p, α).
#[derive(Clone, Debug)]
pub struct Law<'e> {
    /// Name in the model.
    pub name: String,
    /// When it happens; a guard is multi-affine in α.
    pub when: When<'e>,
    /// The unilateral switch whose surface is struck when it happens, where the law is a contact.
    pub strikes: Option<usize>,
    /// New values by index of the state; each once.
    pub resets: Vec<(usize, Expr<'e>)>,
    /// Whether the run ends when it happens.
    pub stops: bool,
    /// The statement.
    pub span: Span,
}

impl<'e> Law<'e> {
    /// What it is called in a message.
    pub fn title(&self) -> String {
        match self.stops {
            true => format!("`stop when {}`", self.name),
            false => format!("jump `{}`", self.name),
        }
    }

    /// The expressions in it.
    pub fn exprs(&self) -> impl Iterator<Item = Expr<'e>> {
        let values = self.resets.iter().map(|reset| reset.1);
        values.chain(self.when.exprs())
    }
}

impl System<'_> {
    /// The number of states of the model; integrals of the task come behind them.
    pub fn n_model_states(&self) -> usize {
        let n_integrals = self.task.as_ref().map_or(0, |task| task.integrals);
        self.states.len() - n_integrals
    }

    /// Indices of the algebraic states, ascending.
    pub fn algebraic_states(&self) -> Vec<usize> {
        let kept: Vec<Expr<'_>> = (self.switches.iter())
            .filter(|switch| switch.role != Role::Step)
            .map(|switch| switch.alpha)
            .collect();
        let is_kept = |e: Expr<'_>| {
            variables_of(&[e])
                .into_iter()
                .any(|var| kept.iter().any(|alpha| alpha.as_variable() == Some(var)))
        };
        let states = self.states.iter().enumerate();
        match kept.is_empty() {
            true => Vec::new(),
            false => states
                .filter(|(_, x)| is_kept(x.rate))
                .map(|(i, _)| i)
                .collect(),
        }
    }

    /// Whether ψ depends on physical time and data only, through switches like it too, by switch: it is decided before
    /// the others, whose ψ may jump with it.
    pub fn timed(&self) -> Vec<bool> {
        let states = self.states.iter().enumerate();
        let others = states.filter(|(place, _)| Some(*place) != self.clock);
        let relays = self.switches.iter().filter(|switch| switch.relay.is_some());
        let mut bound: Vec<Option<Var>> = (others.map(|(_, state)| state.var.as_variable()))
            .chain(relays.map(|switch| switch.alpha.as_variable()))
            .collect();
        let mut timed = Vec::with_capacity(self.switches.len());
        for switch in &self.switches {
            let inside = variables_of(&[switch.psi]);
            let follows = |var: &Var| bound.contains(&Some(*var));
            let is_timed = switch.relay.is_none() && !inside.iter().any(follows);
            if !is_timed {
                bound.push(switch.alpha.as_variable());
            }
            timed.push(is_timed);
        }
        timed
    }

    /// The switches of time with which the ψ of another switch may jump, ascending.
    pub fn leading(&self) -> Vec<usize> {
        let timed = self.timed();
        let all: Vec<Expr<'_>> = self.switches.iter().map(|switch| switch.psi).collect();
        let inside = variables_of(&all);
        let is_read = |switch: &Switch| {
            switch
                .alpha
                .as_variable()
                .is_some_and(|alpha| inside.contains(&alpha))
        };
        (0..timed.len())
            .filter(|&k| timed[k] && is_read(&self.switches[k]))
            .collect()
    }

    /// True for a constraint of a projection: what keeps it is no contact, so that nothing strikes it.
    pub fn is_projected(&self, switch: usize) -> bool {
        let mut laws = self.jumps.laws.iter();
        let struck = laws.any(|law| law.strikes == Some(switch));
        self.switches[switch].unilateral && !struck && !self.jumps.touches(switch)
    }
}

impl<'e> Exogenous<'e> {
    /// Parameters by their numbers.
    pub fn chosen(&self, places: &[usize]) -> impl Iterator<Item = &Param<'e>> {
        places.iter().map(|&place| &self.params[place])
    }

    /// All parameters with their values.
    pub fn numbers(&self) -> impl Iterator<Item = (Expr<'e>, f64)> {
        self.params.iter().map(|param| (param.var, param.value))
    }

    /// The parameter of this name.
    pub fn named(&self, name: &str) -> Option<&Param<'e>> {
        self.params.iter().find(|param| param.name == name)
    }
}

impl<'e> Recorded<'e> {
    /// Outputs, then controls.
    pub fn signals(&self) -> impl Iterator<Item = &Output<'e>> {
        self.outputs.iter().chain(&self.controls)
    }
}

impl Jumps<'_> {
    /// Whether a switch is that of a contact.
    pub fn touches(&self, switch: usize) -> bool {
        self.contacts.iter().any(|contact| contact.switch == switch)
    }

    /// The names of the contacts that a name means: of one, or of all features of its gap.
    pub fn contacts_of<'s>(&'s self, name: &str) -> Vec<&'s str> {
        let features = self
            .features()
            .filter(|(own, owner)| *own == name || *owner == Some(name));
        features.map(|(own, _)| own).collect()
    }

    /// The names of all contacts, with that of the contact of several features where one is among these.
    pub fn features(&self) -> impl Iterator<Item = (&str, Option<&str>)> {
        let contacts = self.contacts.iter().map(|c| (&c.name, &c.feature_of));
        let impulsive = self.impulsive.iter().map(|c| (&c.name, &c.feature_of));
        let all = contacts.chain(impulsive);
        all.map(|(own, owner)| (own.as_str(), owner.as_deref()))
    }

    /// The first jump or contact, by which states jump.
    pub fn first_jump(&self) -> Option<(&str, Span)> {
        let laws = self.laws.iter().filter(|law| !law.stops);
        let laws = laws.map(|law| (law.name.as_str(), law.span));
        let contacts = self.contacts.iter();
        let contacts = contacts.map(|contact| (contact.name.as_str(), contact.span));
        let impulsive = self.impulsive.iter();
        let impulsive = impulsive.map(|contact| (contact.name.as_str(), contact.span));
        laws.chain(contacts).chain(impulsive).next()
    }
}

/// An entry of a `switch` statement that reads a [`Switch`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedReading {
    /// Name of the statement.
    pub name: String,
    /// Flat index from 0, where the statement is a vector or matrix.
    pub index: Option<usize>,
    /// True when its switching function is a negative multiple of ψ: above of one is below of the other.
    pub flipped: bool,
    /// Whether it goes from -1 to 1, as `sign`, not from 0.
    pub is_sign: bool,
}

/// Whether f is continuous across a surface, and how that is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Continuity {
    /// Continuous by construction, or the jump has the factor ψ.
    Certain,
    /// No jump was found at sampled points of the surface.
    Sampled,
    /// f jumps across the surface: the switch may slide.
    Discontinuous,
}

impl Continuity {
    /// True when the switch never slides.
    pub fn is_continuous(self) -> bool {
        self != Continuity::Discontinuous
    }
}

/// Regions that set common states: exactly one holds at a point off the surfaces.
#[derive(Clone, Debug)]
pub struct Partition<'e> {
    /// The regions in order of declaration.
    pub regions: Vec<Region<'e>>,
    /// Switches of the guards.
    pub switches: Vec<usize>,
    /// Indices of the scalar states it sets.
    pub states: Vec<usize>,
    /// How it is known that exactly one region holds.
    pub coverage: Coverage,
    /// g_r of every region, where each is R_r = { g_r < min_{j≠r} g_j } and nothing but the region depends on the
    /// switches; else empty.
    pub indicators: Vec<Expr<'e>>,
}

/// How it is known that the regions of a partition neither overlap nor leave gaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coverage {
    /// Every combination of sides has one region, or no point.
    Proven,
    /// No counterexample was found at sampled points.
    Sampled,
}

/// A named region of a [`Partition`].
#[derive(Clone, Debug)]
pub struct Region<'e> {
    /// Name in the model.
    pub name: String,
    /// Indicator of the region, multi-affine in α.
    pub weight: Expr<'e>,
    /// Its guard as a conjunction: (switch, true for ψ > 0), where it is one.
    pub literals: Option<Vec<(usize, bool)>>,
    /// The region statement.
    pub span: Span,
}

/// A recorded expression.
#[derive(Clone, Debug)]
pub struct Output<'e> {
    /// Name in the model.
    pub name: String,
    /// Empty for a scalar.
    pub shape: Vec<usize>,
    /// Its entries, row by row.
    pub exprs: Vec<Expr<'e>>,
    /// Its declaration.
    pub span: Span,
}

/// Switches that multiply each other in some rate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Subsystem {
    /// Indices into [`System::switches`], ascending.
    pub switches: Vec<usize>,
    /// The partition whose regions are all that these switches decide, where there is one: its regions
    /// are disjoint conjunctions that cover every corner, and the rates depend on α through them only.
    /// A region that says nothing about a switch covers several corners; -Sψ holds for full conjunctions.
    pub regions: Option<usize>,
}
