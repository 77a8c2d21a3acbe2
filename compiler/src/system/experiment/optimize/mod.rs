//! Settings of an `optimize` experiment, of a `fit` and of an `mpc`.
//!
//! Costs and constraints are expressions of the model here, and what is integrated has a variable of its own; the
//! system puts switches into them as it does with rates.

mod bounds;
mod closed_loop;
mod fit;
mod free;
mod goal;
mod kinks;
mod rows;
mod settings;
mod start;

pub use closed_loop::ClosedLoop;
pub(crate) use closed_loop::{Draft as LoopDraft, not_for_mpc};
pub use fit::{Column, Fit};
pub(crate) use fit::{LOSSES, not_for_fit};
pub(crate) use settings::{Draft, INSTANTS, OPTIONS, PATHS, RELAXATIONS, SHAPES, STEERINGS};
pub use settings::{OPTIMIZER, relaxation_word, steering_word};
pub(crate) use start::{LARGEST_SEED, one_argument};

use std::fmt;

use nsd_solver::integrate::tableau::Family;
use nsd_solver::optimization::mpcc::{Relaxation, Steering};

use super::{Cross, Equilibration};
use crate::expr::{Expr, Var};
use crate::source::Span;
use crate::syntax::GuessSource;

/// What an `optimize` experiment asks for besides what a simulation does.
#[derive(Clone, Debug)]
pub struct Optimize<'e> {
    /// How the horizon is cut.
    pub discretization: Discretization,
    /// Bounds of the horizon, where it is free.
    pub horizon: Option<(f64, f64)>,
    /// Integrals over the horizon that the cost and the constraints contain.
    pub integrals: Vec<Integral<'e>>,
    /// What is minimized, in integrals and values at the end.
    pub cost: Cost<'e>,
    /// Constraints.
    pub rows: Vec<Row<'e>>,
    /// Parameters to optimize.
    pub params: Vec<Freed>,
    /// States whose initial values are free.
    pub initial: Vec<Freed>,
    /// Initial values that are computed from free parameters.
    pub tied: Vec<Tied<'e>>,
    /// Guesses as functions of time.
    pub guess: Vec<(Var, Expr<'e>)>,
    /// Where other guesses come from.
    pub sources: Vec<GuessSource>,
    /// Several starts.
    pub starts: Option<Starts>,
    /// How the program is made and solved.
    pub options: MpccOptions,
}

/// Control intervals with their finite elements.
#[derive(Clone, Debug, PartialEq)]
pub struct Discretization {
    /// Control intervals N.
    pub intervals: usize,
    /// Whether nothing is said of N.
    pub by_default: bool,
    /// Finite elements per interval.
    pub elements: usize,
    /// Whether switches get to their ends; else they have equal lengths.
    pub detects: bool,
    /// Family of Runge-Kutta methods, and number of nodes.
    pub scheme: (Family, usize),
    /// What controls are within an interval.
    pub controls: Shape,
    /// How long intervals are.
    pub lengths: Lengths,
    /// Whether elements and nodes become more until a simulation agrees.
    pub refines: bool,
}

/// How long control intervals are.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Lengths {
    /// All T/N.
    #[default]
    Equal,
    /// In proportion to these.
    Given(Vec<f64>),
    /// Chosen, each within [`Lengths::FREE`] times T/N.
    Free,
}

impl Lengths {
    /// Bounds of lengths that are free, as shares of T/N.
    pub const FREE: [f64; 2] = [0.1, 10.0];

    /// Lengths as shares of T/N: bounds and a guess, interval by interval; nothing where all are equal.
    pub fn shares(&self, intervals: usize) -> Vec<[f64; 3]> {
        match self {
            Lengths::Equal => Vec::new(),
            Lengths::Given(lengths) => {
                let longest = lengths.iter().copied().fold(0.0, f64::max);
                let shares = lengths.iter().map(|length| length / longest);
                let mean = shares.clone().sum::<f64>() / intervals as f64;
                shares.map(|share| [share / mean; 3]).collect()
            }
            Lengths::Free => {
                let [least, most] = Self::FREE;
                vec![[least, most.min(intervals as f64), 1.0]; intervals]
            }
        }
    }
}

/// What is minimized: the sum of its terms.
#[derive(Clone, Debug)]
pub struct Cost<'e> {
    /// All of it.
    pub value: Expr<'e>,
    /// What is added up, in the order of the text.
    pub terms: Vec<Term<'e>>,
    /// `minimize ..`
    pub span: Span,
}

/// A term of a sum.
#[derive(Clone, Debug)]
pub struct Term<'e> {
    /// As it is written, with its sign.
    pub text: String,
    /// The same as an expression, without what is soft constraints.
    pub value: Expr<'e>,
    /// The rows whose penalties are in it besides, with its shares of them.
    pub soft: Vec<(usize, f64)>,
}

impl<'e> Cost<'e> {
    /// The same in other variables.
    pub fn map(&self, mut f: impl FnMut(Expr<'e>) -> Expr<'e>) -> Self {
        let mut cost = self.clone();
        cost.value = f(cost.value);
        for term in &mut cost.terms {
            term.value = f(term.value);
        }
        cost
    }
}

/// What a control is within an interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shape {
    /// One value.
    #[default]
    Constant,
    /// A straight line; continuous from one interval to the next.
    Linear,
}

/// ∫ value dt from 0 to T.
#[derive(Clone, Debug)]
pub struct Integral<'e> {
    /// The variable that stands for it.
    pub var: Expr<'e>,
    /// What is integrated.
    pub value: Expr<'e>,
    /// The call.
    pub span: Span,
}

/// What becomes of a constraint.
#[derive(Clone, Copy, Debug)]
pub enum Holds<'e> {
    /// It holds.
    Strictly,
    /// Missing it costs.
    Softly(Penalty<'e>),
    /// Its value is one member of 0 <= a ⟂ b >= 0, with this other one.
    Against(Expr<'e>),
}

/// What violations of a soft constraint cost: at one instant their norm, along the horizon its integral.
#[derive(Clone, Copy, Debug)]
pub struct Penalty<'e> {
    /// How they are measured.
    pub norm: Norm,
    /// Not negative, in parameters.
    pub weight: Expr<'e>,
}

/// How a violation is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Norm {
    /// By its size: with a weight above the multiplier of the constraint, it holds.
    L1,
    /// By its square.
    Squared,
}

impl Norm {
    /// All of them, with their words.
    pub const ALL: [(&str, Norm); 2] = [("l1", Norm::L1), ("squared", Norm::Squared)];

    /// The word of the language.
    pub fn word(self) -> &'static str {
        let known = Self::ALL.iter().find(|known| known.1 == self);
        known.map_or("", |known| known.0)
    }

    /// Of lower <= value <= upper.
    pub fn of(self, value: f64, [lower, upper]: [f64; 2]) -> f64 {
        let violation = (lower - value).max(value - upper).max(0.0);
        match self {
            Norm::L1 => violation,
            Norm::Squared => violation * violation,
        }
    }
}

impl<'e> Holds<'e> {
    /// The expressions besides the value.
    pub fn exprs(self) -> Option<Expr<'e>> {
        match self {
            Holds::Strictly => None,
            Holds::Softly(penalty) => Some(penalty.weight),
            Holds::Against(other) => Some(other),
        }
    }

    /// The same in other variables.
    pub fn map(self, f: impl FnOnce(Expr<'e>) -> Expr<'e>) -> Self {
        match self {
            Holds::Strictly => Holds::Strictly,
            Holds::Softly(Penalty { norm, weight }) => Holds::Softly(Penalty {
                norm,
                weight: f(weight),
            }),
            Holds::Against(other) => Holds::Against(f(other)),
        }
    }
}

/// lower <= value <= upper at some instants.
#[derive(Clone, Debug)]
pub struct Row<'e> {
    /// The value in the names of the model; empty for what is a part of the cost.
    pub name: String,
    /// In the variables of the model and of integrals.
    pub value: Expr<'e>,
    /// A number or minus infinity.
    pub lower: f64,
    /// A number or infinity.
    pub upper: f64,
    /// When.
    pub at: At,
    /// How.
    pub holds: Holds<'e>,
    /// The row.
    pub span: Span,
}

/// `x[1] <= 2 at nodes`
impl fmt::Display for Row<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, lower, upper) = (&self.name, self.lower, self.upper);
        match (lower.is_finite(), upper.is_finite()) {
            _ if lower == upper => write!(f, "{name} = {lower}")?,
            (true, true) => write!(f, "{lower} <= {name} <= {upper}")?,
            (true, false) => write!(f, "{name} >= {lower}")?,
            _ => write!(f, "{name} <= {upper}")?,
        }
        write!(f, " at {}", self.at.as_str())
    }
}

/// When a constraint holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum At {
    /// At t = 0.
    Start,
    /// At t = T.
    End,
    /// At the ends of control intervals.
    Intervals,
    /// At the ends of finite elements.
    Elements,
    /// At all Runge-Kutta nodes.
    Nodes,
}

impl At {
    /// The words of the language: `at elements`, or the names of instants.
    pub fn as_str(self) -> &'static str {
        match self {
            At::Start => "the start",
            At::End => "the end",
            At::Intervals => "intervals",
            At::Elements => "elements",
            At::Nodes => "nodes",
        }
    }

    /// The word for it in reports.
    pub fn word(self) -> &'static str {
        match self {
            At::Start => "start",
            At::End => "end",
            other => other.as_str(),
        }
    }
}

/// A quantity that is optimized, within bounds.
#[derive(Clone, Copy, Debug)]
pub struct Freed {
    /// An entry of a parameter or state.
    pub var: Var,
    /// Lower bound, or minus infinity.
    pub lower: f64,
    /// Upper bound, or infinity.
    pub upper: f64,
    /// Where it is freed.
    pub span: Span,
}

/// x(0) = x_0(p) with free p.
#[derive(Clone, Copy, Debug)]
pub struct Tied<'e> {
    /// x, an entry of a state.
    pub var: Var,
    /// x_0, in parameters.
    pub value: Expr<'e>,
    /// Where the initial value is given.
    pub span: Span,
}

/// `starts 40 by gauss(0.5) seed 1`
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Starts {
    /// How many; the first one is not perturbed.
    pub count: usize,
    /// Standard deviation of the perturbation of every variable.
    pub deviation: f64,
    /// Of the random numbers.
    pub seed: u64,
}

/// Options of `method mpcc`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MpccOptions {
    /// How pairs across nodes are added up.
    pub cross: Cross,
    /// What steers the lengths of elements before the polish makes them equal.
    pub equilibration: Equilibration,
    /// How a pair is relaxed.
    pub relaxation: Relaxation,
    /// How the parameter of the relaxation enters.
    pub steering: Steering,
    /// Whether it follows the barrier parameter of one run, or falls from run to run.
    pub is_sequential: bool,
    /// Its first value, where that is given.
    pub sigma: Option<f64>,
    /// What the optimality error of a solution has to reach.
    pub optimality: f64,
    /// The largest number of iterations of all runs from one start.
    pub max_iterations: Option<usize>,
}

impl Default for MpccOptions {
    fn default() -> Self {
        MpccOptions {
            cross: Cross::SumLambda,
            equilibration: Equilibration::Mean { weight: 1e-3 },
            relaxation: Relaxation::Scholtes,
            steering: Steering::Direct,
            is_sequential: false,
            sigma: None,
            optimality: 1e-12,
            max_iterations: None,
        }
    }
}
