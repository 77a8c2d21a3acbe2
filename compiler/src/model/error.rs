//! What can be wrong with a model: names (E01), shapes and types (E02), dynamics (E03).

use miette::Diagnostic;
use thiserror::Error;

use crate::source::Span;

/// A mistake in a model, or (E09) something that is not supported yet.
#[derive(Clone, Debug, Diagnostic, Error)]
#[allow(
    missing_docs,
    reason = "fields are the words of the message; labels say the rest"
)]
pub enum ModelError {
    /// A name that is declared nowhere.
    #[error("unknown name `{name}`")]
    #[diagnostic(code(E0101))]
    UnknownName {
        name: String,
        #[label("not declared here")]
        span: Span,
        #[help]
        help: Option<String>,
    },

    /// Two declarations of one name.
    #[error("`{name}` is declared twice")]
    #[diagnostic(code(E0102), help("rename one of them"))]
    Redeclared {
        name: String,
        #[label("declared here")]
        first: Span,
        #[label(primary, "and again here")]
        second: Span,
    },

    /// A declaration of a model that takes a name of the file.
    #[error("`{name}` already names a {kind} of the file")]
    #[diagnostic(code(E0103), help("rename one of them"))]
    ShadowsFile {
        name: String,
        kind: &'static str,
        #[label("the {kind}")]
        first: Span,
        #[label(primary, "redeclared here")]
        second: Span,
    },

    /// A declaration of a built-in name.
    #[error("`{name}` is built in and cannot be redeclared")]
    #[diagnostic(code(E0104), help("choose another name"))]
    BuiltIn {
        name: String,
        #[label("declared here")]
        span: Span,
    },

    /// Declarations that need each other.
    #[error("{what} depends on itself: {chain}")]
    #[diagnostic(code(E0105), help("write one of them without the others"))]
    Cycle {
        what: String,
        chain: String,
        #[label("needed to compute itself")]
        span: Span,
    },

    /// A function that calls itself.
    #[error("function `{name}` calls itself: {chain}")]
    #[diagnostic(
        code(E0106),
        help("functions are inlined; use `for` or a reduction to repeat")
    )]
    Recursion {
        name: String,
        chain: String,
        #[label("recursive")]
        span: Span,
    },

    /// A model that is not in the file.
    #[error("unknown model `{name}`")]
    #[diagnostic(code(E0107))]
    UnknownModel {
        name: String,
        #[label("no model of that name")]
        span: Span,
        #[help]
        help: Option<String>,
    },

    /// A function, model or region where a value must stand.
    #[error("`{name}` is a {kind}, not a value")]
    #[diagnostic(code(E0108))]
    NotAValue {
        name: String,
        kind: &'static str,
        #[label("needs a value")]
        span: Span,
        #[help]
        help: Option<String>,
    },

    /// A call of something that is not a function.
    #[error("unknown function `{name}`")]
    #[diagnostic(code(E0109))]
    UnknownFunction {
        name: String,
        #[label("not a function")]
        span: Span,
        #[help]
        help: Option<String>,
    },

    /// `x.y` where x has no parts.
    #[error("`{name}` has no field `{field}`")]
    #[diagnostic(code(E0110), help("only parts have fields"))]
    NoField {
        name: String,
        field: String,
        #[label("no such field")]
        span: Span,
    },

    /// A statement that may not stand where it stands.
    #[error("{statement} cannot stand inside {place}")]
    #[diagnostic(code(E0111), help("move it to the top of the model"))]
    Misplaced {
        statement: &'static str,
        place: &'static str,
        #[label("declared too deep")]
        span: Span,
    },

    /// Something declared in a loop, used without its indices.
    #[error("`{name}` is declared in a loop and needs {count} indices")]
    #[diagnostic(code(E0112), help("write `{name}[..]` with the loop's indices"))]
    NeedsIndices {
        name: String,
        count: usize,
        #[label("which one")]
        span: Span,
    },

    /// Operands whose shapes do not fit.
    #[error("`{operator}` does not fit {left} and {right}")]
    #[diagnostic(code(E0201))]
    Operands {
        operator: String,
        left: String,
        right: String,
        #[label("{left}")]
        left_span: Span,
        #[label("{right}")]
        right_span: Span,
        #[help]
        help: Option<String>,
    },

    /// `*` between two vectors.
    #[error("`*` does not multiply two vectors")]
    #[diagnostic(
        code(E0202),
        help("use `dot(a, b)` for the inner product or `a .* b` entry by entry")
    )]
    VectorProduct {
        left: String,
        right: String,
        #[label("{left}")]
        left_span: Span,
        #[label("{right}")]
        right_span: Span,
    },

    /// A value of the wrong shape.
    #[error("{what} is {expected}, its value is {found}")]
    #[diagnostic(code(E0203))]
    WrongShape {
        what: String,
        expected: String,
        found: String,
        #[label("{found}")]
        span: Span,
        #[help]
        help: Option<String>,
    },

    /// A vector or matrix where one number must stand.
    #[error("{what} must be a scalar, not {found}")]
    #[diagnostic(code(E0204))]
    ScalarExpected {
        what: String,
        found: String,
        #[label("{found}")]
        span: Span,
        #[help]
        help: Option<String>,
    },

    /// An index beyond the size.
    #[error("index {index} is out of range for {what}")]
    #[diagnostic(code(E0205), help("valid indices are {valid}"))]
    OutOfRange {
        index: String,
        what: String,
        valid: String,
        #[label("must be in {valid}")]
        span: Span,
    },

    /// A fraction where an integer must stand.
    #[error("{what} must be an integer, not {found}")]
    #[diagnostic(code(E0206))]
    NotInteger {
        what: String,
        found: f64,
        #[label("{found}")]
        span: Span,
    },

    /// A value that changes, where a structural constant must stand.
    #[error("{what} must be a structural constant")]
    #[diagnostic(code(E0207), help("declare what it is made of with `const`"))]
    NotConstant {
        what: String,
        #[label("depends on {cause}")]
        span: Span,
        cause: String,
    },

    /// A condition where a number must stand.
    #[error("a condition is not a number")]
    #[diagnostic(
        code(E0208),
        help("write `if .. then 1 else 0` to make a number of it")
    )]
    BooleanAsNumber {
        #[label("true or false")]
        span: Span,
    },

    /// A number where a condition must stand.
    #[error("a number is not a condition")]
    #[diagnostic(code(E0209), help("compare it, as in `{text} > 0`"))]
    NumberAsCondition {
        text: String,
        #[label("must be true or false")]
        span: Span,
    },

    /// A call with wrong arguments.
    #[error("`{function}` takes {expected}, not {found}")]
    #[diagnostic(code(E0210))]
    Arguments {
        function: String,
        expected: String,
        found: String,
        #[label("called here")]
        span: Span,
    },

    /// Rows of different length, or blocks that do not fit.
    #[error("the rows of this matrix do not fit")]
    #[diagnostic(code(E0211), help("every row must have the same number of columns"))]
    Ragged {
        expected: usize,
        found: usize,
        #[label("{found} columns, the first row has {expected}")]
        span: Span,
    },

    /// Blocks of different height side by side.
    #[error("the blocks of this row do not fit")]
    #[diagnostic(
        code(E0211),
        help("blocks side by side must have the same number of rows")
    )]
    BlockHeight {
        expected: usize,
        found: usize,
        #[label("{found} rows, the first block has {expected}")]
        span: Span,
    },

    /// A derivative by something that is not a variable.
    #[error("`{function}` differentiates by states, params and other variables only")]
    #[diagnostic(
        code(E0212),
        help("write the second argument as a declared name or its entry")
    )]
    DifferentiateBy {
        function: String,
        #[label("an expression")]
        span: Span,
    },

    /// More entries than memory is worth.
    #[error("{what} is too large")]
    #[diagnostic(code(E0213), help("a model may have about a million entries"))]
    TooLarge {
        what: String,
        #[label("grows too large here")]
        span: Span,
    },

    /// The inverse of a singular matrix.
    #[error("the matrix is singular")]
    #[diagnostic(code(E0214), help("its determinant is zero"))]
    Singular {
        #[label("has no inverse")]
        span: Span,
    },

    /// Too many or too few indices.
    #[error("{what} takes {expected}, not {found}")]
    #[diagnostic(code(E0215))]
    IndexCount {
        what: String,
        expected: &'static str,
        found: usize,
        #[label("indexed here")]
        span: Span,
    },

    /// Division by the number zero.
    #[error("division by zero")]
    #[diagnostic(code(E0216))]
    DivisionByZero {
        #[label("is zero")]
        span: Span,
    },

    /// A default that is not known before the run.
    #[error("{what} may depend on params only")]
    #[diagnostic(code(E0217))]
    DefaultDepends {
        what: String,
        cause: String,
        #[label("depends on {cause}")]
        span: Span,
    },

    /// A text where a number must stand.
    #[error("a text is not a value")]
    #[diagnostic(code(E0218))]
    Text {
        #[label("must be a number")]
        span: Span,
    },

    /// `min` or `max` of nothing.
    #[error("`{function}` of nothing")]
    #[diagnostic(code(E0219), help("the range must not be empty"))]
    EmptyReduction {
        function: String,
        #[label("has no entries")]
        span: Span,
    },

    /// Functions that call functions, very deep.
    #[error("the expression is nested too deeply")]
    #[diagnostic(code(E0220), help("name its parts with `let` at the top of the model"))]
    TooDeep {
        #[label("here")]
        span: Span,
    },

    /// Bounds the wrong way round.
    #[error("the lower bound of `{name}` is above the upper one")]
    #[diagnostic(code(E0221), help("write `in [lower, upper]`"))]
    EmptyBounds {
        name: String,
        #[label("contains no number")]
        span: Span,
    },

    /// A signal that depends on more than time.
    #[error("signal `{name}` must be a function of time")]
    #[diagnostic(code(E0222), help("use `let` for what depends on states"))]
    SignalDepends {
        name: String,
        cause: String,
        #[label("depends on {cause}")]
        span: Span,
    },

    /// A state without dynamics.
    #[error("state `{name}` has no dynamics")]
    #[diagnostic(
        code(E0301),
        help("add `{entry}' = ..;`, or `{entry}' = 0;` if it is constant")
    )]
    NoDynamics {
        name: String,
        entry: String,
        #[label("`{entry}` is never set")]
        span: Span,
    },

    /// A state set twice.
    #[error("the dynamics of `{entry}` are set twice")]
    #[diagnostic(code(E0302), help("use `+=` to add a term"))]
    SetTwice {
        entry: String,
        #[label("set here")]
        first: Span,
        #[label(primary, "and again here")]
        second: Span,
    },

    /// Dynamics of something that is not a state.
    #[error("`{name}` is a {kind}, not a state")]
    #[diagnostic(code(E0303))]
    NotAState {
        name: String,
        kind: &'static str,
        #[label("has no dynamics")]
        span: Span,
        #[help]
        help: Option<String>,
    },

    /// A region of a partition that leaves out a state the others set.
    #[error("region `{region}` does not set `{entry}`")]
    #[diagnostic(code(E0304), help("add `{entry}' = ..;` to region `{region}`"))]
    RegionMisses {
        region: String,
        entry: String,
        #[label("set here, in region `{other}`")]
        first: Span,
        #[label(primary, "not set here")]
        second: Span,
        other: String,
    },

    /// An `else` without other regions.
    #[error("region `{region}` is the rest of nothing")]
    #[diagnostic(
        code(E0305),
        help("an `else` region sets the states that other regions set")
    )]
    ElseAlone {
        region: String,
        #[label("no other region sets these states")]
        span: Span,
    },

    /// Two `else` regions of one partition.
    #[error("two `else` regions set `{entry}`")]
    #[diagnostic(code(E0306), help("give one of them a guard"))]
    TwoElse {
        entry: String,
        #[label("the rest")]
        first: Span,
        #[label(primary, "the rest again")]
        second: Span,
    },

    /// A region with one partner only in name: nothing covers the rest.
    #[error("nothing sets `{entry}` outside region `{region}`")]
    #[diagnostic(code(E0307), help("add the other regions, or one with `else`"))]
    LoneRegion {
        region: String,
        entry: String,
        #[label("set here only")]
        span: Span,
    },

    /// A comparison that never changes.
    #[error("this comparison is always {value}")]
    #[diagnostic(code(E0308), help("a guard must depend on the state or on time"))]
    ConstantComparison {
        value: bool,
        #[label("constant")]
        span: Span,
    },

    /// A guard that holds nowhere, or on a surface only.
    #[error("this guard holds on a thin set at most")]
    #[diagnostic(
        code(E0309),
        help("`<` and `<=` are the same; a surface belongs to no region")
    )]
    ThinGuard {
        #[label("needs both sides of one surface at once")]
        span: Span,
    },

    /// `hidden` that sets.
    #[error("hidden terms add to the dynamics")]
    #[diagnostic(code(E0310), help("write `+=`"))]
    HiddenSets {
        #[label("sets")]
        span: Span,
    },

    /// A hidden term that is not hidden.
    #[error("this hidden term does not vanish at `{switch}` = {at}")]
    #[diagnostic(code(E0311), help("multiply it by `1 - {switch}^2`"))]
    HiddenVisible {
        switch: String,
        at: f64,
        #[label("is not zero there")]
        span: Span,
    },

    /// `hidden on` something else.
    #[error("`{name}` is not a named switch")]
    #[diagnostic(code(E0312), help("declare `switch s = sign(..);`"))]
    NotASwitch {
        name: String,
        #[label("needs a switch")]
        span: Span,
    },

    /// A `switch` that is none.
    #[error("a switch is `sign(..)`, `step(..)` or `hysteresis(..)`")]
    #[diagnostic(code(E0313), help("use `let` for other expressions"))]
    SwitchForm {
        #[label("something else")]
        span: Span,
    },

    /// What this version cannot do.
    #[error("{what} are not supported yet")]
    #[diagnostic(code(E0901))]
    Imports {
        what: &'static str,
        #[label("not supported yet")]
        span: Span,
    },

    /// Parts.
    #[error("parts are not supported yet")]
    #[diagnostic(code(E0902), help("write the statements of the part into the model"))]
    Parts {
        #[label("a part")]
        span: Span,
    },

    /// Mechanics and contacts.
    #[error("mechanics and contacts are not supported yet")]
    #[diagnostic(
        code(E0903),
        help("write `v' = ..;` and a switch for the contact force")
    )]
    Mechanics {
        #[label("mechanics")]
        span: Span,
    },

    /// Jumps.
    #[error("state jumps are not supported yet")]
    #[diagnostic(code(E0904))]
    Jumps {
        #[label("a jump")]
        span: Span,
    },

    /// Projected dynamics.
    #[error("projected dynamics are not supported yet")]
    #[diagnostic(code(E0905))]
    Projections {
        #[label("a projection")]
        span: Span,
    },

    /// Algebraic states, equations and complementarity.
    #[error("algebraic states and complementarity are not supported yet")]
    #[diagnostic(
        code(E0906),
        help("solve for the algebraic state where that is possible")
    )]
    Algebraic {
        #[label("algebraic")]
        span: Span,
    },

    /// Convex programs and variational inequalities.
    #[error("convex programs and variational inequalities are not supported yet")]
    #[diagnostic(
        code(E0907),
        help("projections onto boxes can be written with `min` and `max`")
    )]
    Programs {
        #[label("a program")]
        span: Span,
    },

    /// Relays with memory.
    #[error("hysteresis is not supported yet")]
    #[diagnostic(code(E0908))]
    Hysteresis {
        #[label("a relay with memory")]
        span: Span,
    },

    /// Signals from data.
    #[error("signals from tables are not supported yet")]
    #[diagnostic(code(E0909), help("write the signal as an expression in `time`"))]
    Tables {
        #[label("a table")]
        span: Span,
    },

    /// Stewart's indicators.
    #[error("regions with indicators are not supported yet")]
    #[diagnostic(
        code(E0910),
        help("write the guard with `where`: `g1 < g2 and g1 < g3`")
    )]
    Indicators {
        #[label("an indicator")]
        span: Span,
    },

    /// Controls from a finite set.
    #[error("controls from a finite set are not supported yet")]
    #[diagnostic(code(E0911))]
    FiniteSets {
        #[label("a finite set")]
        span: Span,
    },

    /// Large symbolic inverses.
    #[error("the inverse of a {size} by {size} matrix is not supported yet")]
    #[diagnostic(code(E0912), help("symbolic matrices can be inverted up to 4 by 4"))]
    LargeInverse {
        size: usize,
        #[label("{size} by {size}")]
        span: Span,
    },

    /// Units.
    #[error("units are not checked yet")]
    #[diagnostic(code(W0901), severity(Warning))]
    Units {
        #[label("taken as a comment")]
        span: Span,
    },
}
