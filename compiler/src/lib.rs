//! Compiler for `.nsd`.

pub mod report;
pub mod source;
pub mod syntax;
