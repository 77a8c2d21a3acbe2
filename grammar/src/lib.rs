//! Concrete syntax of `.nsd` and nothing else: the grammar is `nsd.pest`.
#![allow(
    missing_docs,
    reason = "pest derives one undocumented variant per rule"
)]

/// The parser pest derives from `nsd.pest`.
#[derive(pest_derive::Parser)]
#[grammar = "../nsd.pest"]
pub struct NsdParser;
