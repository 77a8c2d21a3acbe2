//! Taylor arithmetic on tapes.

pub(crate) mod bulk;
pub(crate) mod jet;
pub(crate) mod recurrence;
pub(crate) mod row;
pub(crate) mod steps;
