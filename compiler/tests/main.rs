//! Tests of `nsdc` as a program and of its documents, in one program: each file is a module.

#![allow(clippy::disallowed_methods, reason = "a test is no library")]

mod animate;
mod cli;
mod documents;
mod expect;
mod explain;
mod fix;
mod foreign;
mod imports;
mod limits;
mod new;
mod optimize;
mod order;
mod plot;
mod reports;
mod roads;
mod solve;
mod sweep;
mod terminal;
mod test;
mod verify;
