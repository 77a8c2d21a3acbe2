//! Text to abstract syntax.

pub mod ast;

pub use ast::*;

/// Deepest nesting of brackets, blocks and operators that is accepted.
pub const MAX_DEPTH: usize = 128;

/// Largest file that is accepted, in bytes.
pub const MAX_BYTES: usize = 4 << 20;
