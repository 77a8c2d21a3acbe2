//! The `nsdc` command line.

fn main() {}
