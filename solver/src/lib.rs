//! Numbers in, numbers out.

pub mod lcp;
pub mod linalg;
pub mod simulate;
pub mod tape;
