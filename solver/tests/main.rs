//! Tests of tapes, Taylor series and files, in one program: each file is a module.

mod allocation;
mod derivative;
mod elements;
mod nl_files;
mod plain;
mod tape;
mod taylor;
