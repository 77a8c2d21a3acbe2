//! What can be wrong with names (E01), and with shapes and types (E02).

pub(crate) mod dynamics;
pub(crate) mod foreign;
pub(crate) mod given;
pub(crate) mod tables;
pub(crate) mod unsupported;
use miette::{Diagnostic, LabeledSpan};
use thiserror::Error;

use crate::diagnostics::{Fix, Fixable, Help};
use crate::source::Span;

/// A mistake in a name or an expression.
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
        help: Option<Help>,
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

    /// A declaration of the name of a built-in function.
    #[error("`{name}` is the name of a function, too")]
    #[diagnostic(
        code(W0104),
        severity(Warning),
        help(
            "`{name}` is now what is declared here, and `{name}(..)` still the function; another name keeps them apart"
        )
    )]
    ShadowsFunction {
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
        #[label(primary, "needed to compute itself")]
        span: Span,
        #[label(collection)]
        others: Vec<LabeledSpan>,
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
        help: Option<Help>,
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
        help: Option<Help>,
    },

    /// `x.y` where x has no parts.
    #[error("`{name}` has no field `{field}`")]
    #[diagnostic(code(E0110))]
    NoField {
        name: String,
        field: String,
        #[label("no such field")]
        span: Span,
        #[help]
        help: Option<Help>,
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
    #[error("`{name}` is declared in a loop and needs its indices")]
    #[diagnostic(code(E0112), help("write {count} in brackets: `{name}[..]`"))]
    NeedsIndices {
        name: String,
        count: String,
        #[label("which one")]
        span: Span,
    },

    /// A line in the braces of a part that names nothing in its model.
    #[error("model `{model}` declares no `{name}`")]
    #[diagnostic(code(E0113))]
    NotInModel {
        model: String,
        name: String,
        #[label("not in `{model}`")]
        span: Span,
        #[help]
        help: Option<Help>,
    },

    /// An input of a part that nobody gives.
    #[error("{kind} `{name}` of part `{part}` has no value")]
    #[diagnostic(code(E0114), help("give it in the braces of the part: `{name} = ..;`"))]
    NotGiven {
        name: String,
        kind: &'static str,
        part: String,
        #[label(primary, "does not give `{name}`")]
        span: Span,
        #[label("declared without a default")]
        declared: Span,
    },

    /// Two lines in the braces of a part that give one thing.
    #[error("{what} is given twice")]
    #[diagnostic(code(E0115), help("keep one of the lines"))]
    GivenTwice {
        what: String,
        #[label("given here")]
        first: Span,
        #[label(primary, "and again here")]
        second: Span,
    },

    /// A model that contains itself.
    #[error("model `{name}` contains itself: {chain}")]
    #[diagnostic(
        code(E0116),
        help("a model cannot be a part of itself; use an array of parts to repeat")
    )]
    RecursiveParts {
        name: String,
        chain: String,
        #[label("leads back to `{name}`")]
        span: Span,
    },

    /// Parts in parts in parts.
    #[error("parts are nested more than {limit} deep")]
    #[diagnostic(code(E0116), help("put some of the models into one"))]
    DeepParts {
        limit: usize,
        #[label("too deep")]
        span: Span,
    },

    /// A line in the braces of a part that gives what the part computes.
    #[error("{name} cannot be given: it is computed as {kind}")]
    #[diagnostic(
        code(E0117),
        help("give constants, params, initial values, inputs and controls")
    )]
    CannotGive {
        name: String,
        kind: &'static str,
        #[label("the part computes it")]
        span: Span,
    },

    /// A reading that is neither of the two.
    #[error("a switch is read `linear` or `nonlinear`")]
    #[diagnostic(code(E0117), help("write `linear` or `nonlinear`"))]
    UnknownReading {
        #[label("not a reading")]
        span: Span,
    },

    /// Inputs of parts that need each other at one instant.
    #[error("input `{name}` depends on itself: {chain}")]
    #[diagnostic(code(E0118), help("put a state between, or solve for one of them"))]
    Loop {
        name: String,
        chain: String,
        #[label("needed to compute itself")]
        span: Span,
    },

    /// A name that the other file does not declare.
    #[error("the imported file declares no `{name}`")]
    #[diagnostic(code(E0121))]
    NotInFile {
        name: String,
        #[label("not declared there")]
        span: Span,
        #[help]
        help: Option<Help>,
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
        #[label("out of range")]
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

    /// A unit behind a number in a model that has a value of that name.
    #[error("`{name}` is a unit behind this number, and a value here")]
    #[diagnostic(code(E0236))]
    UnitOrValue {
        name: String,
        #[label("which of them")]
        span: Span,
        #[help]
        help: Option<Help>,
    },

    /// An expression of numbers that has no value, as `sqrt(-1)`.
    #[error("{what} is no finite number")]
    #[diagnostic(code(E0225))]
    NotFinite {
        what: String,
        #[label("gives {value}")]
        span: Span,
        value: f64,
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
        expected: String,
        found: String,
        #[label("{found}, the first row has {expected}")]
        span: Span,
    },

    /// Blocks of different height side by side.
    #[error("the blocks of this row do not fit")]
    #[diagnostic(
        code(E0211),
        help("blocks side by side must have the same number of rows")
    )]
    BlockHeight {
        expected: String,
        found: String,
        #[label("{found}, the first block has {expected}")]
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

    /// A signal that depends on more than time.
    #[error("signal `{name}` must be a function of time")]
    #[diagnostic(code(E0222), help("use `let` for what depends on states"))]
    SignalDepends {
        name: String,
        cause: String,
        #[label("depends on {cause}")]
        span: Span,
    },
}

impl Fixable for ModelError {
    fn fix(&self) -> Option<Fix> {
        match self {
            ModelError::UnknownName { help, span, .. }
            | ModelError::UnknownModel { help, span, .. }
            | ModelError::UnknownFunction { help, span, .. }
            | ModelError::NoField { help, span, .. }
            | ModelError::UnitOrValue { help, span, .. }
            | ModelError::NotInModel { help, span, .. }
            | ModelError::NotInFile { help, span, .. } => help.as_ref()?.fix(*span),
            _ => None,
        }
    }
}
