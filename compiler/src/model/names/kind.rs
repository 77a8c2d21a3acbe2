//! Kinds of declarations, and what a path names of them.

use crate::model::Shape;

/// What a path names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    /// What it is.
    pub kind: TargetKind,
    /// Positions of the named entries in it.
    pub entries: Vec<usize>,
    /// Their shape.
    pub shape: Shape,
}

/// A declaration, by its index in the list of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TargetKind {
    /// A structural constant.
    Const,
    /// [`crate::model::Quantities::params`]
    Param(usize),
    /// [`crate::model::Quantities::states`]
    State(usize),
    /// [`crate::model::Quantities::algebraics`]
    Algebraic(usize),
    /// [`crate::model::Quantities::controls`]
    Control(usize),
    /// [`crate::model::Quantities::inputs`]
    Input(usize),
    /// [`crate::model::Definitions::signals`]
    Signal(usize),
    /// [`crate::model::Definitions::lets`]
    Let(usize),
    /// [`crate::model::Definitions::outputs`]
    Output(usize),
    /// [`crate::model::Model::switches`]
    Switch(usize),
    /// `s.sliding` of a switch.
    Sliding(usize),
}

impl TargetKind {
    /// The word of the language for it.
    pub fn word(self) -> &'static str {
        match self {
            TargetKind::Const => "constant",
            TargetKind::Param(_) => "param",
            TargetKind::State(_) => "state",
            TargetKind::Algebraic(_) => "solution of equations",
            TargetKind::Control(_) => "control",
            TargetKind::Input(_) => "input",
            TargetKind::Signal(_) => "signal",
            TargetKind::Let(_) => "let",
            TargetKind::Output(_) => "output",
            TargetKind::Switch(_) | TargetKind::Sliding(_) => "switch",
        }
    }
}
