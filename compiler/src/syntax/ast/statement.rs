//! Statements of models, and the rows and settings inside them.

use super::{Arg, Const, Expr, ExprKind, Ident, Path};
use crate::source::Span;

/// A statement of a model, region or hidden block.
#[derive(Clone, Debug, PartialEq)]
pub enum Stmt {
    /// `const n = 3;`
    Const(Const),
    /// `param`, `state`, `control`, `input`, `algebraic`
    Decl(Decl),
    /// `let`, `output`, `signal`
    Named(Named),
    /// `switch s = sign(psi);`
    Switch(Switch),
    /// `part b = disc { ... }`
    Part(Part),
    /// `region R where c > 0 { ... }`
    Region(Region),
    /// `hidden on s { ... }`
    Hidden(Hidden),
    /// `project x onto { ... } metric E;`
    Project(Project),
    /// `jump NAME when c <= 0 { v := -e*v; }`, `every 0.1 { u := -k*x; }`
    Jump(Jump),
    /// `mechanics q, v { ... }`
    Mechanics(Mechanics),
    /// `contact C { ... }`
    Contact(Contact),
    /// `for i in 1..n { ... }`
    For(For),
    /// `z in argmin ...` or `z in variational ...`
    Program(Program),
    /// `0 = expr;`
    Equation {
        /// The right side.
        residual: Expr,
        /// The statement.
        span: Span,
    },
    /// `0 <= a perp b >= 0;`
    Complementarity {
        /// Left member.
        left: Expr,
        /// Right member.
        right: Expr,
        /// The statement.
        span: Span,
    },
    /// `x' = expr;` or `x' += expr;`
    Dynamics(Dynamics),
    /// A statement the parser could not read.
    Bad(Span),
}

/// Which declaration a [`Decl`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeclKind {
    /// `param`
    Param,
    /// `state`
    State,
    /// `discrete`
    Discrete,
    /// `control`
    Control,
    /// `input`
    Input,
    /// `algebraic`
    Algebraic,
}

/// `state x[3] : m in [lo, hi] = expr;`
#[derive(Clone, Debug, PartialEq)]
pub struct Decl {
    /// Which of the six it is.
    pub kind: DeclKind,
    /// Declared name.
    pub name: Ident,
    /// Sizes in brackets; empty for a scalar.
    pub shape: Vec<Expr>,
    /// Unit after the colon.
    pub unit: Option<Unit>,
    /// Bounds or finite set.
    pub domain: Option<Domain>,
    /// Default or initial value.
    pub value: Option<Expr>,
    /// The statement.
    pub span: Span,
}

/// `kg*m/s^2`
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// What is multiplied and divided, in order; at least one.
    pub factors: Vec<UnitFactor>,
    /// Where it stands.
    pub span: Span,
}

/// `m^2` of a [`Unit`].
#[derive(Clone, Debug, PartialEq)]
pub struct UnitFactor {
    /// True after `/`.
    pub divides: bool,
    /// What is raised to the power.
    pub base: UnitBase,
    /// The exponent as numerator and denominator; 1 where none is written.
    pub power: Option<(f64, f64)>,
    /// Where it stands.
    pub span: Span,
}

/// What a [`UnitFactor`] is a power of.
#[derive(Clone, Debug, PartialEq)]
pub enum UnitBase {
    /// `kg`
    Name(Ident),
    /// `1`
    Number(f64),
    /// `(kg*m)`
    Group(Unit),
}

/// `in [lo, hi]` or `in {a, b, c}`
#[derive(Clone, Debug, PartialEq)]
pub enum Domain {
    /// An interval.
    Box(Expr, Expr),
    /// A finite set.
    Set(Vec<Expr>),
}

/// The arguments of `table` where a signal comes from data.
pub fn table_of(named: &Named) -> Option<&[Arg]> {
    let ExprKind::Call(function, args) = &named.value.kind else {
        return None;
    };
    let is_table = matches!(&function.kind, ExprKind::Name(name) if name == "table");
    (named.kind == NamedKind::Signal && is_table).then_some(args)
}

/// The file that a signal from data names.
pub fn data_of(stmt: &Stmt) -> Option<&str> {
    let Stmt::Named(named) = stmt else {
        return None;
    };
    match &table_of(named)?.first()? {
        Arg::Positional(path, _) => match &path.kind {
            ExprKind::String(path) => Some(path),
            _ => None,
        },
        Arg::Named(..) => None,
    }
}

/// Which statement a [`Named`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NamedKind {
    /// `let`
    Let,
    /// `output`
    Output,
    /// `signal`
    Signal,
}

/// `let c = expr;`
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// Which of the three it is.
    pub kind: NamedKind,
    /// Declared name.
    pub name: Ident,
    /// Unit after the colon.
    pub unit: Option<Unit>,
    /// Its expression.
    pub value: Expr,
    /// The statement.
    pub span: Span,
}

/// How a switch that enters nonlinearly is read on its surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sliding {
    /// Filippov: the convex combination of the two sides.
    Linear,
    /// f(x; s) as written, s in [-1, 1].
    Nonlinear,
}

impl Sliding {
    /// All readings.
    pub const ALL: [Sliding; 2] = [Sliding::Linear, Sliding::Nonlinear];

    /// The word of the language.
    pub fn word(self) -> &'static str {
        match self {
            Sliding::Linear => "linear",
            Sliding::Nonlinear => "nonlinear",
        }
    }

    /// The reading with a word of the language.
    pub fn named(word: &str) -> Option<Self> {
        Sliding::ALL
            .into_iter()
            .find(|reading| reading.word() == word)
    }
}

/// `switch s = sign(psi) sliding linear;`
#[derive(Clone, Debug, PartialEq)]
pub struct Switch {
    /// Declared name.
    pub name: Ident,
    /// `sign(..)`, `step(..)` or `hysteresis(..)`.
    pub value: Expr,
    /// The reading, where declared.
    pub sliding: Option<Sliding>,
    /// The statement.
    pub span: Span,
}

/// `part b[i in 1..n] = disc { m = 2; }`
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Declared name.
    pub name: Ident,
    /// Index of an array of parts.
    pub binder: Option<Binder>,
    /// The model.
    pub model: Path,
    /// What is given to it.
    pub binds: Vec<Bind>,
    /// The statement.
    pub span: Span,
}

/// `m = 2;` in braces: of a part, a `with`, a `guess`.
#[derive(Clone, Debug, PartialEq)]
pub struct Bind {
    /// What is set.
    pub target: Path,
    /// To what.
    pub value: Expr,
    /// The line.
    pub span: Span,
}

impl Bind {
    /// `x = 2`
    pub fn written(&self) -> String {
        format!("{} = {}", self.target, self.value)
    }
}

/// `i in 1..n`
#[derive(Clone, Debug, PartialEq)]
pub struct Binder {
    /// The index.
    pub name: Ident,
    /// First value.
    pub first: Expr,
    /// Last value, included.
    pub last: Expr,
}

/// `region R where c > 0 { ... }`
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Declared name.
    pub name: Ident,
    /// When it holds.
    pub guard: RegionGuard,
    /// Statements.
    pub body: Vec<Stmt>,
    /// The statement.
    pub span: Span,
}

/// Where a region holds.
#[derive(Clone, Debug, PartialEq)]
pub enum RegionGuard {
    /// `where guard`
    Where(Expr),
    /// `indicator g`: Stewart's form.
    Indicator(Expr),
    /// `else`: the rest.
    Else,
}

/// `hidden on s { u' += ...; }`
#[derive(Clone, Debug, PartialEq)]
pub struct Hidden {
    /// The switch.
    pub switch: Path,
    /// Statements.
    pub body: Vec<Stmt>,
    /// The statement.
    pub span: Span,
}

/// `project x onto { rows } metric E;`
#[derive(Clone, Debug, PartialEq)]
pub struct Project {
    /// The projected state.
    pub state: Path,
    /// The set.
    pub rows: Vec<Row>,
    /// `metric E`
    pub metric: Option<Expr>,
    /// The statement.
    pub span: Span,
}

/// A row of a `{ ... }` of constraints.
#[derive(Clone, Debug, PartialEq)]
pub enum Row {
    /// `for i in 1..n { rows }`
    For {
        /// Indices.
        binders: Vec<Binder>,
        /// Repeated rows.
        rows: Vec<Row>,
        /// The row.
        span: Span,
    },
    /// `a <= b <= c;` or `0 <= a perp b >= 0;`
    Relation {
        /// First member.
        first: Expr,
        /// The others, each with the relation before it.
        rest: Vec<(Relation, Expr)>,
        /// The row.
        span: Span,
    },
    /// A row the parser could not read.
    Bad(Span),
}

/// Relation of a row or a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// `<`
    Less,
    /// `<=`
    LessEqual,
    /// `>`
    Greater,
    /// `>=`
    GreaterEqual,
    /// `=`, in rows only
    Equal,
    /// `perp`, in rows only
    Perp,
}

/// `jump NAME when guard { v := -e*v; }`, or, with or without `jump NAME`, `every T offset t { u := -k*x; }`
#[derive(Clone, Debug, PartialEq)]
pub struct Jump {
    /// Declared name; what happens at given instants needs none.
    pub name: Option<Ident>,
    /// When it happens.
    pub when: JumpWhen,
    /// Resets: target and value before the jump.
    pub resets: Vec<Bind>,
    /// The statement.
    pub span: Span,
}

/// When states jump.
#[derive(Clone, Debug, PartialEq)]
pub enum JumpWhen {
    /// `when guard`: where it becomes true.
    Guard(Expr),
    /// `every T offset t`: at t + k T.
    Every {
        /// T.
        period: Expr,
        /// t; zero without it.
        offset: Option<Expr>,
    },
}

impl JumpWhen {
    /// The expressions in it.
    pub fn exprs(&self) -> impl Iterator<Item = &Expr> {
        match self {
            JumpWhen::Guard(guard) => [Some(guard), None],
            JumpWhen::Every { period, offset } => [Some(period), offset.as_ref()],
        }
        .into_iter()
        .flatten()
    }
}

/// `mechanics q, v { mass = M; force = f; contact ... }`
#[derive(Clone, Debug, PartialEq)]
pub struct Mechanics {
    /// Positions.
    pub q: Path,
    /// Velocities.
    pub v: Path,
    /// `mass`, `force`, ...
    pub options: Vec<Setting>,
    /// Contacts inside the block.
    pub contacts: Vec<Contact>,
    /// The statement.
    pub span: Span,
}

/// `contact C { gap = c; ... }`
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// Declared name.
    pub name: Ident,
    /// `gap`, `slip`, `restitution`, ...
    pub options: Vec<Setting>,
    /// The statement.
    pub span: Span,
}

/// `name = expr;` in an options block.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Option.
    pub name: Ident,
    /// Value.
    pub value: Expr,
    /// The line.
    pub span: Span,
}

/// `for i in 1..n, j in i+1..n { ... }`
#[derive(Clone, Debug, PartialEq)]
pub struct For {
    /// Indices.
    pub binders: Vec<Binder>,
    /// Repeated statements.
    pub body: Vec<Stmt>,
    /// The statement.
    pub span: Span,
}

/// `z[2] in argmin ...` or `z in variational ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// Declared name.
    pub name: Ident,
    /// Sizes in brackets.
    pub shape: Vec<Expr>,
    /// What z solves.
    pub kind: ProgramKind,
    /// The statement.
    pub span: Span,
}

/// What a [`Program`] solves.
#[derive(Clone, Debug, PartialEq)]
pub enum ProgramKind {
    /// `argmin F subject to { rows }`
    Argmin {
        /// What is minimized.
        objective: Expr,
        /// Constraints.
        rows: Vec<Row>,
    },
    /// `variational K solves F`, K given by rows.
    VariationalRows {
        /// The set.
        rows: Vec<Row>,
        /// The map.
        map: Expr,
    },
    /// `variational [lo, hi] solves F`
    VariationalBox {
        /// Lower end.
        lower: Expr,
        /// Upper end.
        upper: Expr,
        /// The map.
        map: Expr,
    },
}

/// `x' = expr;` or `x' += expr;`
#[derive(Clone, Debug, PartialEq)]
pub struct Dynamics {
    /// The state or entry.
    pub target: Path,
    /// True for `+=`.
    pub adds: bool,
    /// `=` or `+=`.
    pub operator: Span,
    /// The derivative, or the term added to it.
    pub value: Expr,
    /// The statement.
    pub span: Span,
}
