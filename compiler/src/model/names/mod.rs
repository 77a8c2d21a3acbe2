//! Names of instances: their values, the parts they lead to, and what is given to those.

pub(crate) mod bind;
pub(crate) mod connect;
pub(crate) mod draft;
pub(crate) mod fields;
pub(crate) mod file;
pub(crate) mod kind;
pub(crate) mod lookup;
pub(crate) mod parts;
pub(crate) mod places;
pub(crate) mod scope;
pub(crate) mod target;
