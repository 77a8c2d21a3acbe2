//! Compiler for `.nsd`.

pub mod report;
pub mod source;
