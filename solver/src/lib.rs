#![doc = include_str!("../README.md")]

pub mod lcp;
pub mod linalg;
pub mod simulate;
pub mod tape;
