//! A system with switches as plain data: x' = f(t, x, α), α_i ∈ step(ψ_i(t, x)).
//!
//! The rates x' = f come in *blocks*: groups of rates that are computed together. A block knows
//! the switches whose α occur in it; their sides are its *local* sides, and for each combination of
//! them that a run meets it has one function, in which α is 0 at `Minus`, 1 at `Plus` and an input
//! at `Slide`. So a switch that changes sides concerns the blocks that contain its α and no others.
//! The same holds for every ψ, which may contain α of earlier switches.
//!
//! Blocks and ψ are *instances* of *forms*: what differs between instances of one form in numbers alone is compiled once.

use std::ops::Range;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::Side;
use super::form::{Argument, Form, Instance};
use crate::hybrid::periodic::Periodic;
use crate::hybrid::piecewise::Piecewise;
use crate::tape::Tape;

/// A system with switches. All of it is known before a run: nothing is compiled or asked for elsewhere in the middle of one.
///
/// It can be written and read, the same bit for bit in formats that keep numbers; what is read is checked.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(remote = "Self")]
pub struct HybridSystem {
    /// ψ and α.
    pub switches: Vec<Switch>,
    /// Every state belongs to exactly one.
    pub blocks: Vec<Block>,
    /// Functions of time, states and α.
    pub forms: Vec<Form>,
    /// The rates of each block.
    pub rates: Vec<Instance>,
    /// All ψ, and behind them derivatives along the solution.
    pub surfaces: Vec<Instance>,
    /// The algebraic states z, in order: their rates are made of α of equations and members, which keep what
    /// determines z. Equations and pairs are as many as they are.
    pub algebraics: Vec<usize>,
    /// How the state jumps.
    pub laws: Vec<Law>,
    /// Numbers that runs may have others of: inputs of functions.
    pub parameters: Vec<f64>,
    /// Functions of time that are made of pieces. For each in turn, where the present piece begins and its coefficients
    /// are inputs of functions.
    pub data: Vec<Arc<Piecewise>>,
    /// Instants that no step passes over, in order.
    pub stops: Vec<f64>,
}

/// A switch: ψ and α.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Switch {
    /// What α is.
    pub kind: SwitchKind,
    /// Whether f is continuous across the surface, so that it never slides.
    pub is_continuous: bool,
    /// Whether ψ depends on time only: its side is decided before those of the others.
    pub is_timed: bool,
    /// Whether rates contain the α in another way than affine. It is a step of its ψ then, and its rate φ contains its α.
    pub is_nonlinear: bool,
    /// Whether rates contain powers of ψ without a derivative at ψ = 0, which are zero there and in no rate on `Slide`.
    /// Where such a switch is continuous it is said to rest on its surface, and its α is in no rate either.
    pub has_root: bool,
    /// Whether ψ contains data, so that it may jump or bend where they do; and whether its rate φ does, or that of its
    /// last derivative.
    pub has_data: [bool; 2],
    /// The switches whose α the rate φ may contain, in order; where the relative degree is higher, those in the rate of
    /// its highest derivative.
    pub couplings: Vec<usize>,
    /// The switches whose α occur in ψ, in order. With α of relays and switches of time ψ may jump, with that of others
    /// it is continuous.
    pub inside: Vec<usize>,
    /// Where the derivatives of ψ along the solution that contain no α stand among the surfaces, so that sliding keeps
    /// them at zero too: as many as the relative degree less one.
    pub derivatives: Range<usize>,
    /// Switches, in order, of which one on its upper side takes the α of a slip velocity with two entries out of all
    /// rates: these entries mean nothing there.
    pub idle_above: Vec<usize>,
}

/// What α of a switch is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum SwitchKind {
    /// A step of ψ.
    Step,
    /// A step of ψ with memory, which starts on this side: it never slides, and ψ, which contains its own α, has the
    /// sign of its side until it leaves it.
    Relay(Side),
    /// The force of a unilateral surface: ψ is above, or kept on it by an α that may have any value up to 1. Its
    /// relative degree is two where a law strikes it, else one.
    Unilateral,
    /// The friction of a slip velocity.
    Slip {
        /// The unilateral switch α_n of which α is a factor: it means nothing where that one does not slide.
        of: Option<usize>,
        /// The switch of the other entry of a slip velocity w with two: both slide, where w = 0, with u = 2α - 1 in the
        /// unit disc, or neither does, and rates have u = w/|w| in place of both α.
        across: Option<usize>,
    },
    /// The rate of an algebraic state that keeps an equation ψ = 0; it always slides, and α is any number.
    Equation,
    /// A member of a complementarity 0 ≤ -ψ_i ⟂ -ψ_j ≥ 0, of which this is the other one. One of both slides,
    /// with any α, and the other one is below its surface, with α = 0.
    Member(usize),
}

/// How α of a switch is determined.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Role {
    /// By ψ or its force.
    Step,
    /// [`SwitchKind::Equation`].
    Equation,
    /// [`SwitchKind::Member`].
    Member(usize),
}

impl Switch {
    /// One of a kind that is in no other ψ, across whose surface f jumps.
    pub fn new(kind: SwitchKind) -> Self {
        Switch {
            kind,
            is_continuous: false,
            is_timed: false,
            is_nonlinear: false,
            has_root: false,
            has_data: [false; 2],
            couplings: Vec::new(),
            inside: Vec::new(),
            derivatives: 0..0,
            idle_above: Vec::new(),
        }
    }

    /// Whether ψ is the gap of a contact, whose rate has no force in it.
    pub(crate) fn is_contact(&self) -> bool {
        self.kind == SwitchKind::Unilateral && !self.derivatives.is_empty()
    }

    /// Whether nothing but a sign of ψ tells the surface: none of a contact, a projection or an equation.
    pub(crate) fn is_plain(&self) -> bool {
        matches!(
            self.kind,
            SwitchKind::Step | SwitchKind::Relay(_) | SwitchKind::Slip { of: None, .. }
        )
    }

    /// Whether ψ is an entry of a slip velocity with two.
    pub(crate) fn is_in_disc(&self) -> bool {
        matches!(
            self.kind,
            SwitchKind::Slip {
                across: Some(_),
                ..
            }
        )
    }

    /// Whether it is a slip velocity that no rate on these sides reads the α of.
    pub(crate) fn is_free(&self, sides: &[Side]) -> bool {
        let mut others = self.idle_above.iter();
        others.any(|&other| sides[other] == Side::Plus)
    }

    /// Whether the switch may rest on its surface: rates have a root of its ψ.
    pub(crate) fn rests(&self) -> bool {
        self.has_root && self.is_continuous
    }

    /// Whether it is decided before the others.
    pub(crate) fn leads(&self) -> bool {
        self.is_timed || matches!(self.kind, SwitchKind::Relay(_))
    }

    /// What α must not pass where the switch slides.
    pub(crate) fn limits(&self) -> &'static [f64] {
        match self.kind {
            SwitchKind::Equation | SwitchKind::Member(_) => &[],
            _ if self.is_in_disc() => &[],
            SwitchKind::Unilateral => &[1.0],
            _ => &[0.0, 1.0],
        }
    }
}

impl HybridSystem {
    /// Adds a block with the rates of some states, in order, as a form of its own.
    pub fn add_block(&mut self, states: Vec<usize>, rates: Tape, inputs: Vec<Input>) {
        let alpha = |input: &Input| match input {
            Input::Alpha(switch) => Some(*switch),
            _ => None,
        };
        let mut switches: Vec<usize> = inputs.iter().filter_map(alpha).collect();
        switches.sort_unstable();
        switches.dedup();
        let rates = self.add_form(rates, inputs);
        self.rates.push(rates);
        self.blocks.push(Block { states, switches });
    }

    /// Adds a switch without derivatives, with its ψ as a form of its own.
    pub fn add_switch(&mut self, switch: Switch, psi: Tape, inputs: Vec<Input>) {
        let psi = self.add_form(psi, inputs);
        self.surfaces.insert(self.switches.len(), psi);
        self.switches.push(switch);
    }

    fn add_form(&mut self, tape: Tape, inputs: Vec<Input>) -> Instance {
        let arguments = inputs.iter().map(|input| input.argument()).collect();
        self.forms.push(Form { tape, arguments });
        let form = self.forms.len() - 1;
        Instance { form, inputs }
    }

    /// Length of x.
    pub fn n_states(&self) -> usize {
        self.blocks.iter().map(|block| block.states.len()).sum()
    }

    /// Length of ψ and α.
    pub fn n_switches(&self) -> usize {
        self.switches.len()
    }

    /// How many inputs change at given instants only.
    pub fn n_coefficients(&self) -> usize {
        let of_each = self.data.iter().map(|data| 1 + data.n_coefficients());
        of_each.sum()
    }

    /// The next instant behind `t` that no step passes over; infinity where there is none.
    pub(crate) fn next_stop(&self, t: f64) -> f64 {
        let next = self.stops.partition_point(|stop| *stop <= t);
        self.stops.get(next).copied().unwrap_or(f64::INFINITY)
    }

    /// The laws that jump at known instants.
    pub(crate) fn periodic(&self) -> impl Iterator<Item = (usize, Periodic)> {
        let laws = self.laws.iter().enumerate();
        laws.filter_map(|(l, law)| match law.guard {
            Guard::Every(instants) => Some((l, instants)),
            _ => None,
        })
    }

    /// The first instant behind t at which one of them does.
    pub(crate) fn next_instant(&self, t: f64) -> f64 {
        let next = self.periodic().map(|(_, instants)| instants.next(t));
        next.fold(f64::INFINITY, f64::min)
    }

    /// Whether it is the same on which side of a surface a run is, where it touches that alone: rates are, and no law jumps.
    pub(crate) fn sides_agree(&self, switch: usize) -> bool {
        let Switch {
            kind,
            is_continuous,
            ..
        } = self.switches[switch];
        let is_kept = matches!(kind, SwitchKind::Equation | SwitchKind::Member(_));
        let mut laws = self.laws.iter();
        (is_continuous || is_kept) && !laws.any(|law| law.guard.looks_at(switch))
    }

    /// Whether f is continuous across the surface of a switch.
    pub fn is_continuous(&self, switch: usize) -> bool {
        self.switches[switch].is_continuous
    }

    /// The side at the start of a relay, none for other switches.
    pub fn relay(&self, switch: usize) -> Option<Side> {
        match self.switches[switch].kind {
            SwitchKind::Relay(start) => Some(start),
            _ => None,
        }
    }

    /// Whether a switch is that of a unilateral surface.
    pub fn is_unilateral(&self, switch: usize) -> bool {
        self.switches[switch].kind == SwitchKind::Unilateral
    }

    /// The switch of the other entry of a slip velocity with two.
    pub fn across(&self, switch: usize) -> Option<usize> {
        match self.switches[switch].kind {
            SwitchKind::Slip { across, .. } => across,
            _ => None,
        }
    }

    /// The switch of the second entry of a slip velocity with two, of that of the first one, which stands for both.
    pub(crate) fn second(&self, switch: usize) -> Option<usize> {
        self.across(switch).filter(|other| *other > switch)
    }

    /// Whether rates have roots of some ψ.
    pub(crate) fn has_roots(&self) -> bool {
        self.switches.iter().any(|switch| switch.has_root)
    }

    /// Whether a switch is that of the second entry of a slip velocity with two, for which the switch of the first stands.
    pub(crate) fn is_second(&self, switch: usize) -> bool {
        self.across(switch).is_some_and(|other| other < switch)
    }

    /// True for the slip velocity of a contact that is open on these sides, which does not matter, and for the second
    /// entry of one that slips, which the first one stands for.
    pub(crate) fn is_idle(&self, switch: usize, sides: &[Side]) -> bool {
        self.slip_of(switch)
            .is_some_and(|of| sides[of] != Side::Slide)
            || self.switches[switch].is_free(sides)
            || self.is_second(switch) && sides[switch] != Side::Slide
    }

    /// The unilateral switch of whose contact a switch is the friction.
    pub fn slip_of(&self, switch: usize) -> Option<usize> {
        match self.switches[switch].kind {
            SwitchKind::Slip { of, .. } => of,
            _ => None,
        }
    }

    /// Whether a state follows from equations that hold all the time.
    pub(crate) fn is_algebraic(&self, state: usize) -> bool {
        self.algebraics.binary_search(&state).is_ok()
    }

    /// How α of a switch is determined.
    pub fn role(&self, switch: usize) -> Role {
        match self.switches[switch].kind {
            SwitchKind::Equation => Role::Equation,
            SwitchKind::Member(other) => Role::Member(other),
            _ => Role::Step,
        }
    }

    /// True for a unilateral switch whose surface is struck; what keeps the others, as the constraints of
    /// projections, acts on their rate itself.
    pub(crate) fn is_struck(&self, switch: usize) -> bool {
        let strikes = |law: &Law| matches!(law.guard, Guard::Strikes(struck) if struck == switch);
        self.laws.iter().any(strikes)
    }
}

/// What the coefficient of restitution e multiplies.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum ImpactLaw {
    /// The speed of the gap before the impact.
    Newton,
    /// The impulse that stops the gap.
    Poisson,
}

/// A law by which states jump.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Law {
    /// When.
    pub guard: Guard,
    /// What happens.
    pub effect: Effect,
}

/// What a law does.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Effect {
    /// Sets states.
    Reset(Reset),
    /// Gives impulses along the forces of closed contacts; its guard is [`Guard::Strikes`].
    Impact(Impact),
    /// Ends the run, before anything jumps there.
    Stop,
}

/// The impulses of a contact x' = f + (1 - α_n)(D - Σ (2α_t - 1) T).
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Impact {
    /// What the coefficient of restitution multiplies.
    pub law: ImpactLaw,
    /// What the inputs of the tape are.
    pub inputs: Vec<Input>,
    /// To the coefficients of restitution and of friction.
    pub numbers: Tape,
    /// The switches α_t of the entries of the slip velocity: none without friction, one, or two that are
    /// [`across`](SwitchKind::Slip).
    pub slips: Vec<usize>,
}

/// When a law jumps.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Guard {
    /// When a function of the sides of some switches becomes 1.
    Sides {
        /// The switches.
        switches: Vec<usize>,
        /// Which of them are comparisons, by place, with their values on the surface.
        compared: Vec<(usize, f64)>,
        /// From their α to 0 or 1.
        holds: Tape,
    },
    /// When the surface of a unilateral switch is reached from above.
    Strikes(usize),
    /// At these instants, whatever the state is.
    Every(Periodic),
}

impl Guard {
    /// Whether it is about the side of a switch.
    pub(crate) fn looks_at(&self, switch: usize) -> bool {
        match self {
            Guard::Sides { switches, .. } => switches.contains(&switch),
            Guard::Strikes(struck) => *struck == switch,
            Guard::Every(_) => false,
        }
    }

    /// Whether a function of sides holds, by the α of switches at their places; false for other guards.
    pub(crate) fn holds(
        &self,
        registers: &mut Vec<f64>,
        alpha: impl Fn(usize, usize) -> f64,
    ) -> bool {
        let Guard::Sides {
            switches, holds, ..
        } = self
        else {
            return false;
        };
        registers.resize(holds.n_registers().max(switches.len()), 0.0);
        for (place, (register, &switch)) in registers.iter_mut().zip(switches).enumerate() {
            *register = alpha(place, switch);
        }
        holds.run(registers);
        holds.results(registers).next().is_some_and(|v| v > 0.75)
    }
}

/// New values of states.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Reset {
    /// What the inputs of the tape are.
    pub inputs: Vec<Input>,
    /// Which of them are comparisons, by place, with their values on the surface.
    pub compared: Vec<(usize, f64)>,
    /// The states.
    pub states: Vec<usize>,
    /// To their new values.
    pub values: Tape,
}

impl Reset {
    /// What the inputs are where the state stands on surfaces: comparisons have their values there, but for those between 0
    /// and 1 along a surface on which it slides.
    pub(crate) fn inputs_on<'r>(
        &'r self,
        on: &'r [usize],
        sides: &'r [Side],
    ) -> impl Iterator<Item = Input> + 'r {
        let inputs = self.inputs.iter().enumerate();
        inputs.map(|(place, &input)| match input {
            Input::Alpha(switch) if on.contains(&switch) => {
                match on_surface(&self.compared, place) {
                    Some(value) if value.fract() == 0.0 => Input::Number(value),
                    Some(value) if sides[switch] != Side::Slide => Input::Number(value),
                    _ => input,
                }
            }
            _ => input,
        })
    }
}

/// The value of a comparison on its surface.
pub(crate) fn on_surface(compared: &[(usize, f64)], place: usize) -> Option<f64> {
    let mut compared = compared.iter();
    compared.find(|known| known.0 == place).map(|known| known.1)
}

/// Rates that are computed together.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Block {
    /// The states whose rates they are, in order.
    pub states: Vec<usize>,
    /// The switches whose α they contain, in order.
    pub switches: Vec<usize>,
}

/// What an input of a function stands for.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub enum Input {
    /// t.
    Time,
    /// x_i.
    State(usize),
    /// α_i.
    Alpha(usize),
    /// A coefficient of a piece.
    Coefficient(usize),
    /// A parameter.
    Parameter(usize),
    /// A number that functions of the same form have different values of.
    Number(f64),
}

impl Input {
    /// Whether it is the same all through a run.
    pub(crate) fn is_constant(self) -> bool {
        matches!(self, Self::Parameter(_) | Self::Number(_))
    }

    fn argument(self) -> Argument {
        match self {
            Self::Time => Argument::Time,
            Self::State(_) => Argument::State,
            Self::Alpha(_) => Argument::Alpha,
            Self::Coefficient(_) => Argument::Coefficient,
            Self::Parameter(_) => Argument::Parameter,
            Self::Number(_) => Argument::Number,
        }
    }
}
