//! Model: the meaning of one `model` of a file, before any experiment.
//!
//! ```text
//! x' = f(t, x, u, w, p) + Σ_R 1_R(t, x) f_R,     y = g(t, x, u, w, p)
//! ```
//!
//! Names are resolved, functions inlined, structural constants folded, loops
//! unrolled, parts put in and shapes known; every vector and matrix is a list of scalar
//! expressions. Switching terms still stand where they were written, as
//! `sign(ψ)`, `step(ψ)`, `abs`, `min` and `max`. A condition is a number in
//! [0, 1] made of `step(ψ)`: *and* is a product, *or* is a + b - ab, *not* is 1 - a.
//!
//! Invariants
//! - A tensor has as many entries as its shape says, row by row.
//! - Variables of params, states, controls, inputs, switches and data are distinct.
//! - Defaults and initial values depend on params only, and on each other without a cycle.
//! - Every state entry is set once: outside regions, or in each region of one partition.
//! - A region stands in at most one partition; one that only adds stands in none.

mod display;
pub(crate) mod errors;
pub(crate) mod expressions;
pub(crate) mod hir;
mod names;
mod resolve;
pub mod statements;
#[cfg(test)]
mod tests;
mod units;

pub use crate::model::errors::ModelError;
pub use crate::model::errors::dynamics::DynamicsError;
pub use crate::model::errors::given::GivenError;
pub use crate::model::errors::tables::TableError;
pub use crate::model::errors::unsupported::Unsupported;
pub use crate::model::expressions::rows::Comparison;
pub use crate::model::expressions::tensor::{Shape, Tensor};
pub use crate::model::hir::import::find;
pub use crate::model::hir::{index, reserved};
pub use crate::model::names::kind::{Target, TargetKind};
pub use crate::model::names::scope::{Hook, Scope};
pub use crate::model::statements::cones::Cone;
pub use crate::model::statements::programs::{Multiplier, Program, ProgramRow};
pub use crate::model::statements::restitution::Restitution;
pub use resolve::{check_file, resolve};
pub(crate) use units::check_experiment;
pub use units::{UnitError, Units, inferred, names as unit_names};

use std::fmt;
use std::sync::Arc;

use crate::expr::{Expr, Exprs};
use crate::source::Span;
use crate::source::table::Table;
pub use crate::syntax::Sliding;

/// A model with its names resolved.
pub struct Model<'e> {
    /// Its name.
    pub name: String,
    /// The arena of all its expressions.
    pub exprs: &'e Exprs,
    /// Physical time.
    pub time: Expr<'e>,
    /// Params, states, controls and inputs.
    pub quantities: Quantities<'e>,
    /// What names stand for.
    pub definitions: Definitions<'e>,
    /// Named switching terms.
    pub switches: Vec<NamedSwitch<'e>>,
    /// What the statements say.
    pub statements: Statements<'e>,
    /// Regions that set a common state, with the states they set.
    pub partitions: Vec<Partition>,
    /// Every switching function with the name users know it by.
    pub surfaces: Vec<Surface<'e>>,
    /// Calls of `floor` and `mod`, inner ones first.
    pub rounded: Vec<Rounded<'e>>,
    /// Names, for the expressions of an experiment.
    pub scope: Scope<'e>,
    /// The `model` item.
    pub span: Span,
}

/// The quantities of a model, those of its parts included.
#[derive(Clone, Debug, Default)]
pub struct Quantities<'e> {
    /// Constants that an experiment may override, in order of declaration.
    pub params: Vec<Quantity<'e>>,
    /// Params in an order in which their defaults can be evaluated.
    pub param_order: Vec<usize>,
    /// Differential states.
    pub states: Vec<Quantity<'e>>,
    /// Algebraic states z, with guesses.
    pub algebraics: Vec<Quantity<'e>>,
    /// Decisions.
    pub controls: Vec<Quantity<'e>>,
    /// What the enclosing model or the experiment gives.
    pub inputs: Vec<Quantity<'e>>,
    /// Controls and inputs of parts that the model gives, where they have a domain.
    pub connected: Vec<Quantity<'e>>,
}

impl<'e> Quantities<'e> {
    /// All that is declared with a value, or waits for one.
    pub fn all(&self) -> impl Iterator<Item = &Quantity<'e>> {
        let lists = [
            &self.params,
            &self.states,
            &self.algebraics,
            &self.controls,
            &self.inputs,
        ];
        lists.into_iter().flatten()
    }

    /// The variables of all parameters.
    pub fn of_params(&self) -> impl Iterator<Item = &Expr<'e>> {
        self.params.iter().flat_map(|param| &param.vars)
    }

    /// What a target is, if it is one of these.
    pub fn get(&self, target: TargetKind) -> Option<&Quantity<'e>> {
        match target {
            TargetKind::Param(k) => self.params.get(k),
            TargetKind::State(k) => self.states.get(k),
            TargetKind::Algebraic(k) => self.algebraics.get(k),
            TargetKind::Control(k) => self.controls.get(k),
            TargetKind::Input(k) => self.inputs.get(k),
            _ => None,
        }
    }
}

/// Named expressions of a model, those of its parts included.
#[derive(Clone, Debug, Default)]
pub struct Definitions<'e> {
    /// Given functions of time.
    pub signals: Vec<Named<'e>>,
    /// The data of those that come from files; each column of a file once.
    pub data: Vec<Data<'e>>,
    /// Named expressions.
    pub lets: Vec<Named<'e>>,
    /// Recorded expressions.
    pub outputs: Vec<Named<'e>>,
}

impl<'e> Definitions<'e> {
    /// What a target is, if it is one of these.
    pub fn get(&self, target: TargetKind) -> Option<&Named<'e>> {
        match target {
            TargetKind::Signal(k) => self.signals.get(k),
            TargetKind::Let(k) => self.lets.get(k),
            TargetKind::Output(k) => self.outputs.get(k),
            _ => None,
        }
    }
}

/// What the statements of a model say, those of its parts included.
#[derive(Clone, Debug, Default)]
pub struct Statements<'e> {
    /// Dynamics outside regions.
    pub dynamics: Vec<Rate<'e>>,
    /// Piecewise dynamics.
    pub regions: Vec<Region<'e>>,
    /// Terms that vanish off a switch's surface.
    pub hidden: Vec<Hidden<'e>>,
    /// Laws by which states jump, in order.
    pub jumps: Vec<Jump<'e>>,
    /// `mechanics` blocks, whose dynamics are among the others.
    pub bodies: Vec<Body<'e>>,
    /// Contacts between these, in order.
    pub contacts: Vec<Contact<'e>>,
    /// Sets that states stay in, in order.
    pub projections: Vec<Projection<'e>>,
    /// Equations for algebraic states, in order.
    pub equations: Vec<Equation<'e>>,
    /// Complementarities, in order.
    pub complementarities: Vec<Complementarity<'e>>,
    /// Multipliers of programs, which are algebraic states without a name of their own.
    pub multipliers: Vec<Multiplier<'e>>,
    /// Programs, the conditions of which are among equations and complementarities.
    pub programs: Vec<Program<'e>>,
}

/// A param, state, control or input.
#[derive(Clone, Debug)]
pub struct Quantity<'e> {
    /// Declared name.
    pub name: String,
    /// Its shape.
    pub shape: Shape,
    /// Its unit as it is declared.
    pub unit: Option<String>,
    /// Its entries, row by row, as variables.
    pub vars: Vec<Expr<'e>>,
    /// Default or initial value over params.
    pub value: Option<Tensor<'e>>,
    /// Where its values may be.
    pub domain: Option<Domain<'e>>,
    /// A state with the rate zero, which only jumps set.
    pub is_discrete: bool,
    /// The declaration.
    pub span: Span,
}

/// `in [lo, hi]` or `in {a, b}`, over params.
#[derive(Clone, Debug)]
pub enum Domain<'e> {
    /// Lower and upper bounds, in the quantity's shape.
    Box(Tensor<'e>, Tensor<'e>),
    /// Every entry is one of these.
    Set(Vec<Expr<'e>>),
}

/// A let, output or signal.
#[derive(Clone, Debug)]
pub struct Named<'e> {
    /// Declared name.
    pub name: String,
    /// Its unit as it is declared.
    pub unit: Option<String>,
    /// What it stands for.
    pub value: Tensor<'e>,
    /// The declaration.
    pub span: Span,
}

/// A function of time from data.
#[derive(Clone, Debug)]
pub struct Data<'e> {
    /// Name of the first signal that is this function.
    pub name: String,
    /// The variable that stands for its value.
    pub var: Expr<'e>,
    /// As it is printed: `table("data.csv", "r", linear): 12 rows on [0, 10]`.
    pub text: String,
    /// The function.
    pub table: Arc<Table>,
    /// The declaration.
    pub span: Span,
}

/// Which values a switch takes.
#[derive(Clone, Debug)]
pub enum SwitchKind<'e> {
    /// -1 below its surface and 1 above.
    Sign,
    /// 0 below its surface and 1 above.
    Step,
    /// 0 or 1, with memory between two thresholds.
    Relay(Thresholds<'e>),
}

impl SwitchKind<'_> {
    /// The function that declares it.
    pub fn word(&self) -> &'static str {
        match self {
            SwitchKind::Sign => "sign",
            SwitchKind::Step => "step",
            SwitchKind::Relay(_) => "hysteresis",
        }
    }
}

/// Where the entries of a relay switch, over params.
#[derive(Clone, Debug)]
pub struct Thresholds<'e> {
    /// To 1 when y passes this.
    pub on: Vec<Expr<'e>>,
    /// To 0 when y passes this.
    pub off: Vec<Expr<'e>>,
    /// The value at the start, where y is between the two.
    pub start: Option<Vec<Expr<'e>>>,
}

/// `switch s = sign(psi) sliding linear;` or `switch h = hysteresis(y, on = a, off = b);`, elementwise.
#[derive(Clone, Debug)]
pub struct NamedSwitch<'e> {
    /// Declared name, with the indices of enclosing loops.
    pub name: String,
    /// Which values it takes.
    pub kind: SwitchKind<'e>,
    /// Shape of ψ.
    pub shape: Shape,
    /// Switching functions; of a relay the quantity y that it watches.
    pub psi: Vec<Expr<'e>>,
    /// Variables that stand for the values of the entries in other expressions.
    pub vars: Vec<Expr<'e>>,
    /// The reading on the surface, where declared.
    pub sliding: Option<Sliding>,
    /// The declaration.
    pub span: Span,
}

impl NamedSwitch<'_> {
    /// Its declaration as it begins in the model that has it, which may be a part: `switch s = sign(..)`.
    pub fn statement(&self) -> String {
        let name = self.name.rsplit('.').next().unwrap_or_default();
        let name = name.split('[').next().unwrap_or_default();
        format!("switch {name} = {}(..)", self.kind.word())
    }
}

/// A right-hand side of one state entry.
#[derive(Clone, Copy, Debug)]
pub struct Rate<'e> {
    /// Index into [`Model::state_vars`].
    pub entry: usize,
    /// The derivative, or the term added to it.
    pub value: Expr<'e>,
    /// True for `+=`.
    pub adds: bool,
    /// The statement.
    pub span: Span,
}

/// `region R where guard { ... }`
#[derive(Clone, Debug)]
pub struct Region<'e> {
    /// Declared name, with the indices of enclosing loops.
    pub name: String,
    /// 1 inside, 0 outside; for `else`, 1 minus the others of its partition; for indicators, that this one is the
    /// smallest.
    pub guard: Expr<'e>,
    /// g of `region R indicator g`.
    pub indicator: Option<Expr<'e>>,
    /// True for `region R else`.
    pub is_else: bool,
    /// Where the guard stands.
    pub guard_span: Span,
    /// Right-hand sides that hold inside.
    pub rates: Vec<Rate<'e>>,
    /// The statement.
    pub span: Span,
}

/// Regions of which exactly one holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Partition {
    /// Indices into [`Statements::regions`]; the `else` region last.
    pub regions: Vec<usize>,
    /// State entries each of them sets.
    pub entries: Vec<usize>,
}

/// `hidden on s { u' += ...; }`
#[derive(Clone, Debug)]
pub struct Hidden<'e> {
    /// Index into [`Model::switches`].
    pub switch: usize,
    /// The terms; all add.
    pub rates: Vec<Rate<'e>>,
    /// The statement.
    pub span: Span,
}

/// `jump NAME when guard { v := -e*v; }`, `every T offset t { u := -k*x; }`
#[derive(Clone, Debug)]
pub struct Jump<'e> {
    /// Declared name, with the indices of enclosing loops; `every T` where there is none.
    pub name: String,
    /// When it happens.
    pub when: When<'e>,
    /// Where that stands.
    pub when_span: Span,
    /// New values over values before the jump; each entry once.
    pub resets: Vec<Reset<'e>>,
    /// The statement.
    pub span: Span,
}

/// When states jump.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When<'e> {
    /// Where a condition, 1 or 0, becomes 1.
    Guard(Expr<'e>),
    /// At known instants.
    Every(Periodic<'e>),
}

/// The instants t + k T, k = 0, 1, 2, ..
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Periodic<'e> {
    /// T, over parameters.
    pub period: Expr<'e>,
    /// t, over parameters.
    pub offset: Expr<'e>,
}

impl<'e> When<'e> {
    /// The condition, where it is one.
    pub fn guard(self) -> Option<Expr<'e>> {
        match self {
            When::Guard(guard) => Some(guard),
            When::Every(_) => None,
        }
    }

    /// The same with another condition, where it is one.
    pub fn map_guard(self, f: impl FnOnce(Expr<'e>) -> Expr<'e>) -> Self {
        match self {
            When::Guard(guard) => When::Guard(f(guard)),
            When::Every(instants) => When::Every(instants),
        }
    }

    /// The expressions in it.
    pub fn exprs(self) -> impl Iterator<Item = Expr<'e>> {
        match self {
            When::Guard(guard) => [Some(guard), None],
            When::Every(Periodic { period, offset }) => [Some(period), Some(offset)],
        }
        .into_iter()
        .flatten()
    }

    /// The same, to be changed.
    pub fn exprs_mut(&mut self) -> impl Iterator<Item = &mut Expr<'e>> {
        match self {
            When::Guard(guard) => [Some(guard), None],
            When::Every(Periodic { period, offset }) => [Some(period), Some(offset)],
        }
        .into_iter()
        .flatten()
    }
}

impl fmt::Display for When<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            When::Guard(guard) => write!(f, "when {guard}"),
            When::Every(Periodic { period, offset }) if offset.is_zero() => {
                write!(f, "every {period}")
            }
            When::Every(Periodic { period, offset }) => write!(f, "every {period} offset {offset}"),
        }
    }
}

/// `mechanics q, v { mass = M; force = f; }`
#[derive(Clone, Debug)]
pub struct Body<'e> {
    /// Entries of q, as indices into [`Model::state_vars`].
    pub positions: Vec<usize>,
    /// Entries of v.
    pub velocities: Vec<usize>,
    /// M, row by row.
    pub mass: Vec<Expr<'e>>,
    /// M⁻¹, row by row.
    pub inverse: Vec<Expr<'e>>,
    /// f.
    pub force: Vec<Expr<'e>>,
    /// The statement.
    pub span: Span,
}

/// `contact C { gap = c; restitution = e; slip = w; friction = mu; }`
#[derive(Clone, Debug)]
pub struct Contact<'e> {
    /// Declared name, with the indices of enclosing loops.
    pub name: String,
    /// c >= 0.
    pub gap: Expr<'e>,
    /// Where c stands.
    pub gap_span: Span,
    /// What it gives back of an impact.
    pub restitution: Restitution<'e>,
    /// μ of Coulomb's law, and where it stands.
    pub friction: Option<(Expr<'e>, Span)>,
    /// The velocity along the surface in one direction, or in two at right angles, and where it stands; empty where it
    /// follows from the gap.
    pub slip: (Vec<Expr<'e>>, Span),
    /// The statement.
    pub span: Span,
}

impl<'e> Contact<'e> {
    /// All its expressions.
    pub fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        let friction = self.friction.map(|friction| friction.0);
        [self.gap, self.restitution.coefficient]
            .into_iter()
            .chain(friction)
            .chain(self.slip.0.iter().copied())
    }
}

/// `project x onto { c >= 0; } metric E;`: x' = f + E ∇c λ.
#[derive(Clone, Debug)]
pub struct Projection<'e> {
    /// Entries of x, as indices into [`Model::state_vars`].
    pub entries: Vec<usize>,
    /// The set.
    pub constraints: Vec<Constraint<'e>>,
    /// E, row by row; none for the identity.
    pub metric: Option<Vec<Expr<'e>>>,
    /// The statement.
    pub span: Span,
}

impl<'e> Projection<'e> {
    /// All its expressions.
    pub fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        let metric = self.metric.iter().flatten().copied();
        self.constraints.iter().map(|row| row.c).chain(metric)
    }
}

/// c >= 0.
#[derive(Clone, Copy, Debug)]
pub struct Constraint<'e> {
    /// c.
    pub c: Expr<'e>,
    /// The row.
    pub span: Span,
}

/// 0 = F, one entry of it.
#[derive(Clone, Copy, Debug)]
pub struct Equation<'e> {
    /// F.
    pub residual: Expr<'e>,
    /// The statement.
    pub span: Span,
}

/// 0 <= a ⟂ b >= 0, one entry of it.
#[derive(Clone, Copy, Debug)]
pub struct Complementarity<'e> {
    /// a and b.
    pub members: [Expr<'e>; 2],
    /// Where they stand.
    pub spans: [Span; 2],
    /// The statement.
    pub span: Span,
}

/// The value of one state entry after a jump.
#[derive(Clone, Copy, Debug)]
pub struct Reset<'e> {
    /// Index into [`Model::state_vars`].
    pub entry: usize,
    /// Its value.
    pub value: Expr<'e>,
    /// The line.
    pub span: Span,
}

/// A switching function as the user wrote it.
#[derive(Clone, Debug)]
pub struct Surface<'e> {
    /// `c`, `x[1] - 2`: the side of the comparison that is not zero, or the difference of both.
    pub name: String,
    /// Its value: positive above the surface.
    pub psi: Expr<'e>,
    /// Where it stands.
    pub span: Span,
    /// Whether the name is a text that figures and tables show alone: no switch, golden or JSON has it.
    pub is_alias: bool,
}

impl<'e> Surface<'e> {
    /// A surface with its name.
    pub(crate) fn new(name: String, psi: Expr<'e>, span: Span) -> Self {
        Surface {
            name,
            psi,
            span,
            is_alias: false,
        }
    }

    /// The same with a name that figures and tables show alone.
    pub(crate) fn alias(self) -> Self {
        Surface {
            is_alias: true,
            ..self
        }
    }
}

/// A floor, of a quotient by a period in `mod` and the like.
#[derive(Clone, Copy, Debug)]
pub struct Rounded<'e> {
    /// u in floor(u).
    pub argument: Expr<'e>,
    /// T in mod(u, T).
    pub period: Option<Expr<'e>>,
    /// d in pulse(t, T, d).
    pub duty: Option<Expr<'e>>,
    /// The call.
    pub span: Span,
}

impl<'e> Model<'e> {
    /// All state entries, in the order that [`Rate::entry`] counts.
    pub fn state_vars(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        self.quantities
            .states
            .iter()
            .flat_map(|state| state.vars.iter().copied())
    }

    /// All entries of algebraic states with their names, as `z[2]`, and declarations.
    pub fn algebraic_entries(&self) -> impl Iterator<Item = (Expr<'e>, String, Span)> + '_ {
        let declared = self.quantities.algebraics.iter().flat_map(|z| {
            let entries = z.vars.iter().enumerate();
            entries.map(|(k, &var)| (var, z.shape.entry_name(&z.name, k), z.span))
        });
        let multipliers = self.statements.multipliers.iter();
        declared.chain(multipliers.map(|m| (m.var, m.name.clone(), m.span)))
    }

    /// The name of a state entry: `x[2]`.
    pub fn entry_name(&self, entry: usize) -> String {
        let mut first = 0;
        for state in &self.quantities.states {
            if entry < first + state.vars.len() {
                return state.shape.entry_name(&state.name, entry - first);
            }
            first += state.vars.len();
        }
        format!("#{entry}")
    }
}
