//! A system with switches, cut into functions that are compiled where and when they are needed.
//!
//! The rates x' = f come in *blocks*: groups of rates that are computed together. A block knows
//! the switches whose α occur in it; their sides are its *local* sides, and for each combination of
//! them that a run meets it has one function, in which α is 0 at `Minus`, 1 at `Plus` and an input
//! at `Slide`. So a switch that changes sides concerns the blocks that contain its α and no others.
//! The same holds for every ψ, which may contain α of earlier switches.
//!
//! A function of time that is made of pieces, each a polynomial in t, has their coefficients as inputs:
//! they change at breakpoints, and no step goes beyond one.

use std::sync::Arc;

use super::Side;
use crate::tape::Tape;

/// A system with switches, as the simulator sees it.
///
/// The same function is asked for once per simulator, so implementations that serve several
/// simulators keep what they have compiled.
pub trait SwitchedSystem {
    /// Length of x.
    fn n_states(&self) -> usize;
    /// Length of ψ and α.
    fn n_switches(&self) -> usize;
    /// True when f is continuous across the surface, so that it never slides.
    fn is_continuous(&self, switch: usize) -> bool;
    /// True when ψ depends on time only: its side is decided before those of the others.
    fn is_timed(&self, _switch: usize) -> bool {
        false
    }
    /// The side at the start of a relay, none for other switches. A relay has memory: it never
    /// slides, and ψ, which contains its own α, has the sign of its side until it leaves it.
    fn relay(&self, _switch: usize) -> Option<Side> {
        None
    }
    /// How many derivatives of ψ along the solution contain no α, so that sliding keeps them at zero
    /// too: the relative degree less one.
    fn n_derivatives(&self, _switch: usize) -> usize {
        0
    }
    /// The derivative of ψ of an order from 1 to `n_derivatives`.
    fn derivative(&self, switch: usize, order: usize) -> Surface {
        debug_assert_eq!(order, 0, "a switch without derivatives has none");
        self.surface(switch, &[])
    }
    /// The switches whose α the rate φ of a switch may contain, in order; where the relative degree
    /// is higher, those in the rate of its highest derivative.
    fn couplings(&self, switch: usize) -> &[usize];
    /// The blocks; every state belongs to exactly one.
    fn blocks(&self) -> &[Block];
    /// The switches whose α occur in ψ of a switch, in order. With α of relays and switches of time
    /// ψ may jump, with that of others it is continuous.
    fn inside(&self, switch: usize) -> &[usize];
    /// The rates of a block on its local sides.
    fn rates(&self, block: usize, sides: &[Side]) -> Rates;
    /// ψ of a switch, given the sides of the switches inside it. α of one that slides is 1: ψ is
    /// continuous there. Only a continuous switch makes its α an input.
    fn surface(&self, switch: usize, sides: &[Side]) -> Surface;
    /// ∂f/∂x of a block on its local sides, by the inputs of its [`Rates`]. Only implicit methods
    /// ask for it.
    fn jacobian(&self, block: usize, sides: &[Side]) -> Arc<Partials>;
    /// How many numbers change at given instants only: the coefficients of functions of time that are
    /// made of pieces.
    fn n_coefficients(&self) -> usize {
        0
    }
    /// The coefficients from `t` on, and how long they hold: the next instant at which one of them
    /// changes, infinity where there is none.
    fn coefficients(&self, _t: f64, _coefficients: &mut [f64]) -> f64 {
        f64::INFINITY
    }
    /// Whether ψ of a switch contains a coefficient, so that it may jump or bend where they change.
    fn is_piecewise(&self, _switch: usize) -> bool {
        false
    }
    /// True for a switch that is never below its surface: it is above, or kept on it by an α that may
    /// have any value up to 1. Its relative degree is two where a law strikes it, else one.
    fn is_unilateral(&self, _switch: usize) -> bool {
        false
    }
    /// The switch of the other entry of a slip velocity w with two: both slide, where w = 0, with u = 2α - 1 in the unit
    /// disc, or neither does, and rates have u = w/|w| in place of both α.
    fn across(&self, _switch: usize) -> Option<usize> {
        None
    }
    /// Switches, in order, of which one on its upper side takes the α of a slip velocity with two entries out of all
    /// rates: these entries mean nothing there.
    fn idle_above(&self, _switch: usize) -> &[usize] {
        &[]
    }
    /// The unilateral switch α_n of which the α of a switch is a factor: it means nothing where that one does
    /// not slide.
    fn slip_of(&self, _switch: usize) -> Option<usize> {
        None
    }
    /// Whether rates contain the α of a switch in another way than affine. It is a step of its ψ then, and its rate φ
    /// contains its α.
    fn is_nonlinear(&self, _switch: usize) -> bool {
        false
    }
    /// Whether rates contain powers of ψ without a derivative at ψ = 0, which are zero there and in no rate on `Slide`.
    /// Where such a switch is continuous it is said to rest on its surface, and its α is in no rate either.
    fn has_root(&self, _switch: usize) -> bool {
        false
    }
    /// What α of a switch is.
    fn role(&self, _switch: usize) -> Role {
        Role::Step
    }
    /// The algebraic states z, in order: their rates are made of α of equations and members, which keep what
    /// determines z. Equations and pairs are as many as they are.
    fn algebraics(&self) -> &[usize] {
        &[]
    }
    /// How the state jumps.
    fn laws(&self) -> &[Law] {
        &[]
    }
    /// Whether the rate φ of a switch, or that of its last derivative, contains a coefficient.
    fn has_piecewise_rate(&self, _switch: usize) -> bool {
        false
    }
}

/// What α of a switch is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Role {
    /// A step of ψ, or the force of a unilateral surface.
    Step,
    /// The rate of an algebraic state that keeps an equation ψ = 0; it always slides, and α is any number.
    Equation,
    /// A member of a complementarity 0 ≤ -ψ_i ⟂ -ψ_j ≥ 0, of which this is the other one. One of both slides,
    /// with any α, and the other one is below its surface, with α = 0.
    Member(usize),
}

/// A law by which states jump.
#[derive(Clone, Debug)]
pub struct Law {
    /// When.
    pub guard: Guard,
    /// What happens.
    pub effect: Effect,
}

/// What a law does.
#[derive(Clone, Debug)]
pub enum Effect {
    /// Sets states.
    Reset(Reset),
    /// Gives impulses along the forces of closed contacts; its guard is [`Guard::Strikes`].
    Impact(Impact),
}

/// The impulses of a contact x' = f + (1 - α_n)(D - Σ (2α_t - 1) T).
#[derive(Clone, Debug)]
pub struct Impact {
    /// What the inputs of the tape are.
    pub inputs: Vec<Input>,
    /// To the coefficients of restitution and of friction.
    pub numbers: Tape,
    /// The switches α_t of the entries of the slip velocity: none without friction, one, or two that are
    /// [`across`](SwitchedSystem::across).
    pub slips: Vec<usize>,
}

/// When a law jumps.
#[derive(Clone, Debug)]
pub enum Guard {
    /// When a function of the sides of some switches becomes 1.
    Sides {
        /// The switches.
        switches: Vec<usize>,
        /// From their α to 0 or 1.
        holds: Tape,
    },
    /// When the surface of a unilateral switch is reached from above.
    Strikes(usize),
}

/// New values of states.
#[derive(Clone, Debug)]
pub struct Reset {
    /// What the inputs of the tape are.
    pub inputs: Vec<Input>,
    /// The states.
    pub states: Vec<usize>,
    /// To their new values.
    pub values: Tape,
}

/// Rates that are computed together.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Block {
    /// The states whose rates they are, in order.
    pub states: Vec<usize>,
    /// The switches whose α they contain, in order.
    pub switches: Vec<usize>,
}

/// What an input of a function stands for.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Input {
    /// t.
    Time,
    /// x_i.
    State(usize),
    /// α_i.
    Alpha(usize),
    /// A coefficient of a piece.
    Coefficient(usize),
    /// A number that functions of the same form have different values of.
    Number(f64),
}

/// The rates of a block on certain local sides.
#[derive(Clone, Debug)]
pub struct Rates {
    /// What the inputs of both tapes are.
    pub inputs: Vec<Input>,
    /// To f of the states of the block.
    pub field: Arc<Tape>,
    /// ∂f/∂α of the switches that slide.
    pub by_alpha: Arc<Partials>,
}

/// Partial derivatives that are not structurally zero, as one tape.
#[derive(Clone, Debug)]
pub struct Partials {
    /// One output per entry.
    pub tape: Tape,
    /// (function, input) of every output, ordered by function.
    pub entries: Vec<(usize, usize)>,
}

impl Partials {
    /// No partial derivatives of functions with this many inputs.
    pub fn none(n_inputs: usize) -> Self {
        Partials {
            tape: Tape::builder(n_inputs).finish(&[]),
            entries: Vec::new(),
        }
    }
}

/// A switching function.
#[derive(Clone, Debug)]
pub enum Surface {
    /// Affine with constant coefficients, the common case: it needs no tape, and its series follows
    /// from those of the states.
    Affine(Affine),
    /// Any other.
    Smooth(Smooth),
}

/// ψ = Σ c_j x_j + d t + e.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Affine {
    /// (j, c_j), ordered by state.
    pub terms: Vec<(usize, f64)>,
    /// d.
    pub time: f64,
    /// e.
    pub constant: f64,
}

/// ψ as a tape.
#[derive(Clone, Debug)]
pub struct Smooth {
    /// What the inputs of all tapes are.
    pub inputs: Vec<Input>,
    /// To ψ.
    pub psi: Arc<Tape>,
    /// ∂ψ/∂x and ∂ψ/∂t: entries (0, input).
    pub gradient: Arc<Partials>,
    /// ∂²ψ/∂x∂α and ∂²ψ/∂t∂α of α that are inputs: entries (input x or t, input α).
    pub mixed: Arc<Partials>,
}
