//! Numbers in, numbers out.

pub mod tape;
