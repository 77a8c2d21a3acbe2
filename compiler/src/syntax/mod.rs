//! Text to abstract syntax.

pub mod ast;
mod error;

pub use ast::*;
pub use error::SyntaxError;

/// Deepest nesting of brackets, blocks and operators that is accepted.
pub const MAX_DEPTH: usize = 128;

/// Largest file that is accepted, in bytes.
pub const MAX_BYTES: usize = 4 << 20;
