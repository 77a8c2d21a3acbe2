//! Compiler for `.nsd`.

pub mod diagnostics;
pub mod expr;
pub mod report;
pub mod source;
pub mod syntax;
