//! The commands.

pub(crate) mod check;
pub(crate) mod completions;
pub(crate) mod emit;
pub(crate) mod explain;
pub(crate) mod fmt;
pub(crate) mod modes;
pub(crate) mod new;
pub(crate) mod order;
pub(crate) mod plot;
pub(crate) mod run;
pub(crate) mod solve;
pub(crate) mod sweep;
pub(crate) mod test;
pub(crate) mod verify;
pub(crate) mod watch;
