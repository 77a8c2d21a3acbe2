//! Abstract syntax of a `.nsd` file: structure without layout and comments.
//!
//! Every node carries its [`Span`]. Wrong statements that the parser recovered
//! from stand as `Bad` nodes, each with a diagnostic of its own, so later stages
//! pass over them in silence.

mod experiment;
mod expression;
mod statement;

pub use experiment::*;
pub use expression::*;
pub use statement::*;

use std::sync::Arc;

use crate::source::{Span, table};

/// A whole file.
#[derive(Clone, Debug, PartialEq)]
pub struct File {
    /// Items in order of appearance.
    pub items: Vec<Item>,
    /// The files of data that its signals name, once they have been looked for.
    pub data: table::Sources,
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

/// `use PATH;`, `use PATH as name;` or `use PATH.{a, b as c};`
#[derive(Clone, Debug, PartialEq)]
pub struct Use {
    /// What is imported from.
    pub source: UseSource,
    /// Imported names with their local names; empty without braces.
    pub names: Vec<(Ident, Option<Ident>)>,
    /// `as name` of the whole import.
    pub alias: Option<Ident>,
    /// The file it means.
    pub link: Link,
    /// The statement.
    pub span: Span,
}

/// What has become of the file that a `use` means.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Link {
    /// It has not been looked for.
    #[default]
    Open,
    /// It could not be used, as has been reported.
    Failed,
    /// It is there, with its own imports linked.
    File(Arc<File>),
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
