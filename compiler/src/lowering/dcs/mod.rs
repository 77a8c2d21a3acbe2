//! Dynamic complementarity system (DCS): the last form in continuous time.
//!
//! x' = f(t, x, z, p),   0 = g(t, x, z, p),   0 <= a ⟂ b >= 0
//!
//! The switches of a [`System`] are gone: multipliers and complementarity say the same.
//! How they are stated is the [`Formulation`]; what follows sees rates, equations and pairs only.
//!
//! Invariants, checked by [`Dcs::verify`]:
//!
//! - Every rate, equation and pair has an [`Origin`], and there is one rate per state.
//! - Every variable that occurs is the time, a parameter, a state, a control that is decided or an algebraic variable,
//!   and is declared once.
//! - The members of a pair are algebraic variables, or 1 minus one.
//! - The system is square: as many equations and pairs as algebraic variables.
//! - No `step`, `sign`, `abs`, `min` or `max` is left.
//! - What impulses depend on is known on either side of a jump: it contains no algebraic variable.
//! - Guesses are finite, and α of a switch is an expression in algebraic variables alone.

mod auto;
mod dot;
mod drift;
mod error;
pub mod heaviside;
mod impact;
mod labels;
mod lift;
mod pointwise;
mod signs;
pub mod stewart;
mod tex;
mod verify;

#[cfg(test)]
pub(crate) mod fixtures;
#[cfg(test)]
mod tests;

use std::fmt;
use std::sync::Arc;

pub(crate) use auto::first_deciding;
pub use auto::{Choice, check, choose, lower, lower_as};
pub use dot::{Vertex, dot, graph};
pub use drift::Kept;
pub use error::DcsError;
pub use impact::{Friction, Impact, SlipLaw, Tangent};
pub use pointwise::{Pointwise, directed, indicators, rules, solve_in_mode, solve_pointwise};
pub use tex::tex;

use crate::expr::{Expr, Exprs, Var};
use crate::source::Span;
use crate::source::table::Table;
use crate::system::algebraic::following::following;
use crate::system::{Param, System, Task};

/// x' = f(t, x, z, p), 0 = g(t, x, z, p), 0 <= a ⟂ b >= 0.
#[derive(Clone, Debug)]
pub struct Dcs<'e> {
    /// The arena of all expressions.
    pub exprs: &'e Exprs,
    /// Name of the model.
    pub name: String,
    /// How switches are stated, and why.
    pub lowering: Lowering,
    /// Physical time t, a variable.
    pub time: Expr<'e>,
    /// Functions of time from data that occur.
    pub data: Vec<Data<'e>>,
    /// Scalar parameters p with their values.
    pub params: Vec<Param<'e>>,
    /// Scalar states x.
    pub states: Vec<State<'e>>,
    /// Algebraic variables z.
    pub algebraics: Vec<Algebraic<'e>>,
    /// f, g, a and b.
    pub rows: Rows<'e>,
    /// The way back to the switches of the system.
    pub switches: Switches<'e>,
    /// Contacts whose impulses act where elements meet; empty where no state jumps.
    pub impacts: Vec<Impact<'e>>,
    /// What is optimized, in z; none in a simulation.
    pub task: Option<Task<'e>>,
}

/// How switches are stated.
#[derive(Clone, Debug)]
pub struct Lowering {
    /// In which form.
    pub formulation: Formulation,
    /// Why in this one, where somebody chose; the first line of the printed form.
    pub reason: Option<String>,
}

/// A function of time from data.
#[derive(Clone, Debug)]
pub struct Data<'e> {
    /// Its variable.
    pub var: Expr<'e>,
    /// What it is.
    pub table: Arc<Table>,
}

/// All rows, with where they come from.
#[derive(Clone, Debug, Default)]
pub struct Rows<'e> {
    /// f: the rate of every state.
    pub rates: Vec<Expr<'e>>,
    /// g: what is zero.
    pub equations: Vec<Expr<'e>>,
    /// Complementary pairs.
    pub pairs: Vec<Pair<'e>>,
    /// Where rates, equations and pairs come from.
    pub origins: Origins,
}

/// Switches of the system, by their numbers there.
#[derive(Clone, Debug, Default)]
pub struct Switches<'e> {
    /// α of every switch, in z.
    pub alphas: Vec<Expr<'e>>,
    /// Switches of time with which ψ of others jump.
    pub leading: Vec<usize>,
    /// What tells apart the sliding modes of switches that are read nonlinearly.
    pub branches: Vec<Branch<'e>>,
    /// The slip velocities with two entries.
    pub discs: Vec<Disc>,
}

/// The reformulation of switches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Formulation {
    /// Stewart's: a linear program over the regions.
    Stewart,
    /// The step (Heaviside) reformulation: a linear program over the switches.
    Step,
}

/// A scalar differential state.
#[derive(Clone, Copy, Debug)]
pub struct State<'e> {
    /// Its variable.
    pub var: Expr<'e>,
    /// Value at t = 0.
    pub initial: f64,
    /// Whether it follows at once what is decided, as `system/algebraic/following.rs` finds.
    pub follows: bool,
}

/// An algebraic variable.
#[derive(Clone, Copy, Debug)]
pub struct Algebraic<'e> {
    /// Its variable.
    pub var: Expr<'e>,
    /// Its value at the initial point; where that is on a surface, every side has the same share.
    pub guess: f64,
    /// Whether it is continuous along solutions, as what depends on t and x alone is.
    pub continuous: bool,
}

/// 0 <= `left` ⟂ `right` >= 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair<'e> {
    /// The first member.
    pub left: Expr<'e>,
    /// The second member.
    pub right: Expr<'e>,
}

/// The sliding modes of a switch that is read nonlinearly: every α at which the rate φ of ψ vanishes.
#[derive(Clone, Copy, Debug)]
pub struct Branch<'e> {
    /// The switch, by its number in the system.
    pub switch: usize,
    /// Its α, a variable.
    pub alpha: Expr<'e>,
    /// ∂φ/∂α: a mode attracts where it is negative, and repels where it is positive.
    pub stability: Expr<'e>,
    /// Its statement.
    pub origin: Origin,
}

/// Two switches whose u = 2α - 1 are a point of the unit disc: u = w/|w| for the ψ of both as w, and any u where w = 0.
///
/// With γ = |w| and β = 1 - |u|²,
///
/// 0 = w - γ u,   0 = 1 - |u|² - β,   0 <= γ ⟂ β >= 0
///
/// As λᵖ and λⁿ of a single switch, γ is continuous along solutions. Friction -μ λ_n u is in Coulomb's cone then, and
/// against w; an open contact, λ_n = 0, leaves nothing undetermined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Disc {
    /// Both switches, by their numbers in the system.
    pub switches: [usize; 2],
    /// The places of their α among the algebraic variables.
    pub alphas: [usize; 2],
    /// The place of γ.
    pub slip: usize,
    /// The place of β.
    pub stick: usize,
}

impl Disc {
    /// The places of what follows from w: u and β.
    pub fn inside(&self) -> [usize; 3] {
        let [first, second] = self.alphas;
        [first, second, self.stick]
    }
}

/// Origins of all rows.
#[derive(Clone, Debug, Default)]
pub struct Origins {
    /// Of [`Rows::rates`].
    pub rates: Vec<Origin>,
    /// Of [`Rows::equations`].
    pub equations: Vec<Origin>,
    /// Of [`Rows::pairs`].
    pub pairs: Vec<Origin>,
}

/// Where a row comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Origin {
    /// What it states.
    pub cause: Cause,
    /// Whether it belongs to switches across which the dynamics are continuous, so that it never slides.
    pub continuous: bool,
    /// The position in the source.
    pub span: Span,
}

/// What a row states; indices are those of the [`System`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The rate of a state.
    State(usize),
    /// A switch.
    Switch(usize),
    /// A region of a partition.
    Region {
        /// The partition.
        partition: usize,
        /// The region in it.
        region: usize,
    },
    /// A combination of the switches of a subsystem, or the subsystem as a whole.
    Subsystem(usize),
    /// A product of switches of a subsystem.
    Product(usize),
}

impl Formulation {
    /// The word of the language: `stewart` or `step`.
    pub fn word(self) -> &'static str {
        match self {
            Formulation::Stewart => "stewart",
            Formulation::Step => "step",
        }
    }
}

impl fmt::Display for Formulation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl Switches<'_> {
    /// All α for values of z.
    pub fn at(&self, value: &impl Fn(Var) -> f64) -> Vec<f64> {
        self.alphas.iter().map(|alpha| alpha.eval(value)).collect()
    }
}

impl<'e> Rows<'e> {
    /// The members of all pairs.
    pub fn members(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        self.pairs.iter().flat_map(|pair| [pair.left, pair.right])
    }
}

impl<'e> Dcs<'e> {
    /// The smooth frame of a system: nothing switches yet, and there are no rates.
    fn frame(system: &System<'e>, formulation: Formulation) -> Self {
        let state = |(state, follows): (&crate::system::State<'e>, bool)| State {
            var: state.var,
            initial: state.initial,
            follows,
        };
        let origin = |(i, state): (usize, &crate::system::State<'e>)| Origin {
            cause: Cause::State(i),
            continuous: false,
            span: state.span,
        };
        let data = |data: &crate::model::Data<'e>| Data {
            var: data.var,
            table: data.table.clone(),
        };
        let states = system.states.iter().zip(following(system).states);
        Dcs {
            exprs: system.exprs,
            name: system.name.clone(),
            lowering: Lowering {
                formulation,
                reason: None,
            },
            time: system.time,
            data: system.exogenous.data.iter().map(data).collect(),
            params: system.exogenous.params.clone(),
            states: states.map(state).collect(),
            algebraics: Vec::new(),
            rows: Rows {
                origins: Origins {
                    rates: system.states.iter().enumerate().map(origin).collect(),
                    ..Origins::default()
                },
                ..Rows::default()
            },
            switches: Switches {
                leading: system.leading(),
                ..Switches::default()
            },
            impacts: Vec::new(),
            task: None,
        }
    }

    /// Declares a variable that may jump where the mode changes.
    fn algebraic(&mut self, name: &str, guess: f64) -> Expr<'e> {
        self.declare(name, guess, false)
    }

    /// Declares a variable that is continuous along solutions.
    fn multiplier(&mut self, name: &str, guess: f64) -> Expr<'e> {
        self.declare(name, guess, true)
    }

    fn declare(&mut self, name: &str, guess: f64, continuous: bool) -> Expr<'e> {
        let var = self.exprs.variable(name);
        self.algebraics.push(Algebraic {
            var,
            guess: if guess.is_finite() { guess } else { 0.0 },
            continuous,
        });
        var
    }

    fn equation(&mut self, row: Expr<'e>, origin: Origin) {
        self.rows.equations.push(row);
        self.rows.origins.equations.push(origin);
    }

    fn pair(&mut self, left: Expr<'e>, right: Expr<'e>, origin: Origin) {
        self.rows.pairs.push(Pair { left, right });
        self.rows.origins.pairs.push(origin);
    }
}

/// One equation per line: rates, equations, pairs.
impl fmt::Display for Dcs<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(reason) = &self.lowering.reason {
            writeln!(f, "// {}: {reason}", self.lowering.formulation)?;
        }
        for (state, rate) in self.states.iter().zip(&self.rows.rates) {
            writeln!(f, "der({}) = {rate}", state.var)?;
        }
        for row in &self.rows.equations {
            writeln!(f, "0 = {row}")?;
        }
        for (pair, origin) in self.rows.pairs.iter().zip(&self.rows.origins.pairs) {
            let mark = if origin.continuous {
                "  // continuous"
            } else {
                ""
            };
            writeln!(f, "0 <= {} perp {} >= 0{mark}", pair.left, pair.right)?;
        }
        let impacts = self.impact_lines();
        impacts.iter().try_for_each(|line| writeln!(f, "{line}"))?;
        self.task.iter().try_for_each(|task| write!(f, "{task}"))
    }
}
