//! A system with switches as plain data, and what describes a run of it.

pub(crate) mod breakpoints;
pub mod check;
pub(crate) mod form;
pub(crate) mod outcome;
pub(crate) mod periodic;
pub(crate) mod piecewise;
pub(crate) mod point;
pub(crate) mod settings;
pub(crate) mod side;
pub(crate) mod sided;
pub(crate) mod status;
pub(crate) mod system;

pub use form::{Argument, Form, Instance, Partials};
pub use outcome::Outcome;
pub use periodic::{LEAST_SHARE, Periodic};
pub use piecewise::{Piece, Piecewise, write_pieces};
pub use settings::Settings;
pub(crate) use side::Few;
pub use side::Side;
pub use sided::Sided;
pub use status::{Coefficient, Function, Note, Stats, Status};
pub use system::{
    Block, Effect, Guard, HybridSystem, Impact, ImpactLaw, Input, Law, Reset, Role, Switch,
    SwitchKind,
};
