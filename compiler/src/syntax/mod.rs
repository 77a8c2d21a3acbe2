//! Abstract syntax of a `.nsd` file: structure without layout and comments.
//!
//! Every node carries its [`Span`]. Wrong statements that the parser recovered
//! from stand as `Bad` nodes, each with a diagnostic of its own, so later stages
//! pass over them in silence.

use crate::source::Span;

/// A whole file.
#[derive(Clone, Debug, PartialEq)]
pub struct File {
    /// Items in order of appearance.
    pub items: Vec<Item>,
    /// The whole text.
    pub span: Span,
}

/// What stands at the top level of a file.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// `use std.friction.{coulomb};`
    Use(Use),
    /// `const g = 9.81;`
    Const(Const),
    /// `fn f(a, b) = expr;`
    Fn(Function),
    /// `model NAME { ... }`
    Model(Model),
    /// `simulate` or `optimize`
    Experiment(Experiment),
    /// `expect error E0203;`
    ExpectDiagnostic(ExpectDiagnostic),
    /// A statement the parser could not read.
    Bad(Span),
}

/// A name as written, normalized to NFKC.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Ident {
    /// The name.
    pub name: String,
    /// Where it stands.
    pub span: Span,
}

/// `use PATH;`, `use PATH as name;` or `use PATH.{a, b as c};`
#[derive(Clone, Debug, PartialEq)]
pub struct Use {
    /// What is imported from.
    pub source: UseSource,
    /// Imported names with their local names; empty without braces.
    pub names: Vec<(Ident, Option<Ident>)>,
    /// `as name` of the whole import.
    pub alias: Option<Ident>,
    /// The statement.
    pub span: Span,
}

/// Where a `use` looks.
#[derive(Clone, Debug, PartialEq)]
pub enum UseSource {
    /// `./actuators`, `../lib/plant`: a path relative to the file.
    Relative(Ident),
    /// `std.friction`: a dotted path.
    Dotted(Vec<Ident>),
}

/// `const n = 3;` in a file or a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Const {
    /// Declared name.
    pub name: Ident,
    /// Its value.
    pub value: Expr,
    /// The statement.
    pub span: Span,
}

/// `fn f(a, b) = expr;`
#[derive(Clone, Debug, PartialEq)]
pub struct Function {
    /// Declared name.
    pub name: Ident,
    /// Parameters.
    pub params: Vec<Ident>,
    /// What it returns.
    pub body: Expr,
    /// The statement.
    pub span: Span,
}

/// `expect error CODE;` or `expect warning CODE;` of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpectDiagnostic {
    /// `error` or `warning`.
    pub severity: Ident,
    /// The code.
    pub code: Ident,
    /// The statement.
    pub span: Span,
}

/// `model NAME { ... }`
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Declared name.
    pub name: Ident,
    /// Statements in order of appearance.
    pub body: Vec<Stmt>,
    /// The whole item.
    pub span: Span,
}

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
    /// `jump NAME when c <= 0 { v := -e*v; }`
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
    /// Which of the five it is.
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

/// `N/m`, kept as written until units are checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// The text.
    pub text: String,
    /// Where it stands.
    pub span: Span,
}

/// `in [lo, hi]` or `in {a, b, c}`
#[derive(Clone, Debug, PartialEq)]
pub enum Domain {
    /// An interval.
    Box(Expr, Expr),
    /// A finite set.
    Set(Vec<Expr>),
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
    /// `a <= b <= c;`
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

/// `jump NAME when guard { v := -e*v; }`
#[derive(Clone, Debug, PartialEq)]
pub struct Jump {
    /// Declared name.
    pub name: Ident,
    /// When it happens.
    pub guard: Expr,
    /// Resets: target and value before the jump.
    pub resets: Vec<Bind>,
    /// The statement.
    pub span: Span,
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
    /// The derivative, or the term added to it.
    pub value: Expr,
    /// The statement.
    pub span: Span,
}

/// `a.b[2].c`
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// First name.
    pub head: Ident,
    /// What follows it.
    pub rest: Vec<Segment>,
    /// The whole path.
    pub span: Span,
}

/// A step of a [`Path`].
#[derive(Clone, Debug, PartialEq)]
pub enum Segment {
    /// `.name`
    Field(Ident),
    /// `[i, j]`
    Index(Vec<Index>),
}

/// `simulate NAME of MODEL { ... }` or `optimize ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// Which of the two it is.
    pub kind: ExperimentKind,
    /// Declared name.
    pub name: Ident,
    /// The model.
    pub model: Path,
    /// Settings in order of appearance.
    pub settings: Vec<ExperimentSetting>,
    /// The whole item.
    pub span: Span,
}

/// Simulation or optimal control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExperimentKind {
    /// `simulate`
    Simulate,
    /// `optimize`
    Optimize,
}

/// A setting of an experiment, with the span of its statement.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentSetting {
    /// Which setting.
    pub kind: SettingKind,
    /// The statement.
    pub span: Span,
}

/// The settings of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub enum SettingKind {
    /// `with { omega = 6; }`
    With(Vec<Bind>),
    /// `guess { from crossing; u = 0; }`
    Guess {
        /// `from` sources.
        from: Vec<GuessSource>,
        /// Values.
        binds: Vec<Bind>,
    },
    /// `method fesd { steps = 10; }`
    Method {
        /// The method.
        name: Ident,
        /// Its options.
        options: Vec<Setting>,
    },
    /// `horizon pi/2;` or `horizon free in [0.1, 10] = 4;`
    Horizon {
        /// True after `free`.
        free: bool,
        /// Range of a free horizon.
        range: Option<(Expr, Expr)>,
        /// Length, or guess of a free one.
        value: Option<Expr>,
    },
    /// `output q, E every 0.01;`
    Output {
        /// What is kept.
        paths: Vec<Path>,
        /// When.
        when: OutputWhen,
    },
    /// `lower step, timefreezing;`
    Lower(Vec<Ident>),
    /// `subject to { rows } at elements;`
    SubjectTo {
        /// Constraints.
        rows: Vec<Row>,
        /// `nodes`, `elements` or `intervals`.
        at: Option<Ident>,
    },
    /// `final { q = [..]; }`
    Final(Vec<Row>),
    /// `initial { x[1] free in [0, 1]; }`
    Initial {
        /// Freed states with their ranges.
        free: Vec<(Path, Option<Domain>)>,
        /// Constraints.
        rows: Vec<Row>,
    },
    /// `free { k; }`
    Free(Vec<(Path, Option<Domain>)>),
    /// `perturb every 0.16 by sphere(1e-4) seed 1;`
    Perturb {
        /// Period.
        every: Expr,
        /// Distribution.
        by: Option<Expr>,
        /// Seed.
        seed: Option<Expr>,
    },
    /// `starts 40 by gauss(0.5) seed 1;`
    Starts {
        /// How many.
        count: Expr,
        /// Distribution.
        by: Option<Expr>,
        /// Seed.
        seed: Option<Expr>,
    },
    /// `tolerance`, `runs`, `intervals`, `elements`, `scheme`, `controls`, `minimize`
    Value {
        /// Which setting.
        name: Ident,
        /// Its value.
        value: Expr,
    },
    /// `expect ...;`
    Expect(Expect),
    /// A statement the parser could not read.
    Bad,
}

/// Where a `guess` is taken from.
#[derive(Clone, Debug, PartialEq)]
pub enum GuessSource {
    /// An experiment.
    Experiment(Path),
    /// `"file.json"`
    File(String, Span),
}

/// When outputs are recorded.
#[derive(Clone, Debug, PartialEq)]
pub enum OutputWhen {
    /// At the method's own points.
    Method,
    /// `every dt`
    Every(Expr),
    /// `at [..]`
    At(Expr),
}

/// What an `expect` of an experiment asserts.
#[derive(Clone, Debug, PartialEq)]
pub enum Expect {
    /// `expect lowering golden;`
    LoweringGolden,
    /// `expect mode at 2.0 is inside and sliding(s);`
    Mode {
        /// The instant; `end` is a name.
        at: Expr,
        /// The mode.
        mode: Expr,
    },
    /// `expect status is locally_infeasible;`
    Status(Ident),
    /// `expect warning W0102;`
    Warning(Ident),
    /// `expect x at end ~ [1, 0] within 1e-9;`
    Relation(Box<ExpectRelation>),
}

/// `LEFT when? REL RIGHT (at T)? (within TOL)?`
#[derive(Clone, Debug, PartialEq)]
pub struct ExpectRelation {
    /// Left side.
    pub left: Expr,
    /// When the left side is taken.
    pub when: ExpectWhen,
    /// The relation.
    pub relation: ExpectOp,
    /// Right side.
    pub right: Expr,
    /// When the right side is taken.
    pub right_at: Option<Expr>,
    /// Absolute tolerance.
    pub within: Option<Expr>,
}

/// When the left side of an `expect` is taken.
#[derive(Clone, Debug, PartialEq)]
pub enum ExpectWhen {
    /// No instant: a value of the whole run.
    Run,
    /// `at t`; `end` is a name.
    At(Expr),
    /// `always`
    Always,
}

/// Relation of an `expect`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExpectOp {
    /// `~`
    Close,
    /// `=`
    Equal,
    /// `<`
    Less,
    /// `<=`
    LessEqual,
    /// `>`
    Greater,
    /// `>=`
    GreaterEqual,
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
}

/// An expression.
#[derive(Clone, Debug, PartialEq)]
pub struct Expr {
    /// Which one.
    pub kind: ExprKind,
    /// Where it stands.
    pub span: Span,
}

/// The expressions.
#[derive(Clone, Debug, PartialEq)]
pub enum ExprKind {
    /// `2.5`
    Number(f64),
    /// `"data.csv"`
    String(String),
    /// `x`
    Name(String),
    /// `b.force`
    Field(Box<Expr>, Ident),
    /// `x[2]`, `A[:, 2]`
    Index(Box<Expr>, Vec<Index>),
    /// `f(x, fit = cubic)`
    Call(Box<Expr>, Vec<Arg>),
    /// `[a, b; c, d]`
    Matrix(Matrix),
    /// `[expr for i in 1..n]`
    Comprehension(Box<Expr>, Vec<Binder>),
    /// `-x`
    Negate(Box<Expr>),
    /// `a + b`
    Binary(BinaryOp, Box<Expr>, Box<Expr>),
    /// `-1 < x < 1`
    Compare(Box<Expr>, Vec<(Relation, Expr)>),
    /// `not c`
    Not(Box<Expr>),
    /// `a and b`
    And(Box<Expr>, Box<Expr>),
    /// `a or b`
    Or(Box<Expr>, Box<Expr>),
    /// `if c then a else b`
    If(Box<Expr>, Box<Expr>, Box<Expr>),
}

/// `[a, b]` is a column, `[a, b; c, d]` a matrix, `[a, b;]` a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrix {
    /// Rows between semicolons.
    pub rows: Vec<Vec<Expr>>,
    /// True when a semicolon was written.
    pub semicolons: bool,
}

/// An index in brackets.
#[derive(Clone, Debug, PartialEq)]
pub enum Index {
    /// `:`
    All(Span),
    /// `2`
    One(Expr),
    /// `1..3`
    Range(Expr, Expr),
}

/// An argument of a call.
#[derive(Clone, Debug, PartialEq)]
pub enum Arg {
    /// `fit = cubic`
    Named(Ident, Expr),
    /// `x`, or `x for i in 1..n` in a reduction.
    Positional(Expr, Vec<Binder>),
}

/// Binary operators.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BinaryOp {
    /// `+`
    Add,
    /// `-`
    Sub,
    /// `*`: matrix product or scaling
    Mul,
    /// `/`
    Div,
    /// `^`
    Pow,
    /// `.*`
    ElementMul,
    /// `./`
    ElementDiv,
    /// `.^`
    ElementPow,
}
