//! Text to abstract syntax.

pub mod ast;

pub use ast::*;
