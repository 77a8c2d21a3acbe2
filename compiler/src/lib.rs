//! Compiler for `.nsd`.

pub mod cli;
pub mod dcs;
pub mod diagnostics;
pub mod explain;
pub mod expr;
pub mod model;
pub mod report;
pub mod simulate;
pub mod source;
pub mod syntax;
pub mod system;
