//! Compiler for `.nsd`.
